"""What the firmware watches by itself: bumpers, stalls, the stop button, the battery.

Source: Pioneer 2/3 H8 manual (BUMPSTALL, E_STALL), Pioneer 3 manual: a pressed
bumper stalls the robot only when it drives that way. How often the firmware
looks at the bumpers is chosen; the battery is looked at once a packet.

Of the ring the segment is pressed where the body is touched, as ARIA's ArBumpers places
them: evenly over 135 degrees ahead and behind, the first one at the left end in front
and at the right end behind. Beside these nothing is pressed. Where a body cannot tell
its place, it is the middle segment on the side of the way.
"""

import math

from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.flash import FlashParameters
from simbase.timing import NS_PER_MS, Nanos

#: chosen: the bumpers are looked at so often while BUMPSTALL is on.
BUMPER_WATCH_NS: Nanos = 20 * NS_PER_MS
FRONT, REAR = 1, 2
#: Of each ring, half of it to each side (ARIA).
RING_RAD = math.radians(135)


def is_watching(context: Context) -> bool:
    """Tell whether the bumpers are watched."""
    return context.devices.switches.bump_stall != 0


def check_bumpers(context: Context, body: BodyState, flash: FlashParameters, now: Nanos) -> bool:
    """Stop for a bumper that is pressed on the side of the way; tell whether it did just now."""
    context.bumper_watch.next_ns = now + BUMPER_WATCH_NS
    front, rear = pressed(context, body, flash)
    left, right = context.motion.wheels_mps
    way = left + right
    policy = context.devices.switches.bump_stall
    if not (front and policy & FRONT and way > 0) and not (rear and policy & REAR and way < 0):
        return False
    context.motion.stop_now()
    context.bumper_watch.stalled_until = now + flash.number("stallcount") * NS_PER_MS
    return True


def pressed(context: Context, body: BodyState, flash: FlashParameters) -> tuple[int, int]:
    """Return the pressed segments, front and rear, bit 0 is segment 1."""
    pins = context.devices.pins
    front, rear = pins.front_pressed, pins.rear_pressed
    segments = flash.number("frontbumps"), flash.number("rearbumps")
    if body.in_contact and body.contact_rad is not None:
        front |= _touched(segments[0], body.contact_rad)
        rear |= _touched(segments[1], math.remainder(body.contact_rad - math.pi, math.tau))
    elif body.in_contact:
        left, right = context.motion.wheels_mps
        if left + right >= 0:
            front |= _middle(segments[0])
        if left + right <= 0:
            rear |= _middle(segments[1])
    return front, rear


def _touched(segments: int, bearing_rad: float) -> int:
    """Return the segment of a ring that is at a bearing from its middle, counter-clockwise; none beside the ring."""
    if not segments or abs(bearing_rad) > RING_RAD / 2:
        return 0
    return 1 << min(int((RING_RAD / 2 - bearing_rad) / (RING_RAD / segments)), segments - 1)


def _middle(segments: int) -> int:
    return 1 << segments // 2 if segments else 0


def stalls(context: Context, body: BodyState, now: Nanos) -> tuple[bool, bool]:
    """Return whether the left and right wheel are reported as stalled; without power by the stop button alone."""
    switches, faults = context.devices.switches, context.faults
    by_button = switches.stop_button and switches.e_stall
    if not context.motors_enabled:
        return by_button, by_button
    both = by_button or now < context.bumper_watch.stalled_until
    left, right = context.motion.wheels_mps
    return (
        both or body.stalled_left or (faults.left_blocked and left != 0),
        both or body.stalled_right or (faults.right_blocked and right != 0),
    )
