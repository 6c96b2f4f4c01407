"""What the firmware watches by itself: bumpers, stalls, the stop button, the battery.

Source: Pioneer 2/3 H8 manual (BUMPSTALL, E_STALL), Pioneer 3 manual: a pressed
bumper stalls the robot only when it drives that way. How often the firmware
looks at the bumpers is chosen; the battery is looked at once a packet.

Where a body touches something the segment is not known: the middle one of the
ring on the side of the way is pressed.
"""

from p2os.pioneer.flash import Flash
from p2os.pioneer.ports import SensedState
from p2os.pioneer.works import Works
from p2os.timing import NS_PER_MS, Nanos

#: chosen: the bumpers are looked at so often while BUMPSTALL is on.
GUARD_NS: Nanos = 20 * NS_PER_MS
FRONT, REAR = 1, 2


def is_watching(works: Works) -> bool:
    """Tell whether the bumpers are watched."""
    return works.rack.switches.bump_stall != 0


def look_at_bumpers(works: Works, body: SensedState, flash: Flash, now: Nanos) -> bool:
    """Stop for a bumper that is pressed on the side of the way; tell whether it did just now."""
    works.guard.next_ns = now + GUARD_NS
    front, rear = pressed(works, body, flash)
    left, right = works.motion.wheels_mps
    way = left + right
    policy = works.rack.switches.bump_stall
    if not (front and policy & FRONT and way > 0) and not (rear and policy & REAR and way < 0):
        return False
    works.motion.stop_now()
    works.guard.stalled_until = now + flash.number("stallcount") * NS_PER_MS
    return True


def pressed(works: Works, body: SensedState, flash: Flash) -> tuple[int, int]:
    """Return the pressed segments, front and rear, bit 0 is segment 1."""
    pins = works.rack.pins
    front, rear = pins.front_pressed, pins.rear_pressed
    if body.in_contact:
        left, right = works.motion.wheels_mps
        if left + right >= 0:
            front |= _middle(flash.number("frontbumps"))
        if left + right <= 0:
            rear |= _middle(flash.number("rearbumps"))
    return front, rear


def _middle(segments: int) -> int:
    return 1 << segments // 2 if segments else 0


def stalls(works: Works, body: SensedState, now: Nanos) -> tuple[bool, bool]:
    """Return whether the left and right wheel are told to be stalled."""
    switches, faults = works.rack.switches, works.faults
    both = now < works.guard.stalled_until or (switches.stop_button and switches.e_stall)
    left, right = works.motion.wheels_mps
    return (
        both or body.stalled_left or (faults.left_blocked and left != 0),
        both or body.stalled_right or (faults.right_blocked and right != 0),
    )
