"""Values out of a recorded run: codes on the motor pins, encoder steps, distances, commands on the line, angles.

Times are nanoseconds of the trace. A course is a list of (time, value from then on), the first at the recording's
beginning; wires of one value that change within a millisecond change together.
"""

import bisect
import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from operator import attrgetter, itemgetter
from typing import TypeAlias, TypeVar

from adapter_sim.codec import motor_value
from adapter_sim.pinout import WireRole, load_pinout
from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from robot_bench.events.kinds import MICRO, Pose
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.goals.signals import SKEW_NS
from robot_bench.wires.edges import Edges, codes
from simbase.timing import Nanos

#: Steps of an encoder in a turn of its wheel.
ENCODER_STEPS = 8
_pinout = cache(load_pinout)
_TIME = itemgetter(0)
T = TypeVar("T")
Course: TypeAlias = list[tuple[Nanos, T]]


def value_course(record: RunRecord, wires: Sequence[str]) -> Course[int]:
    """Return the unsigned value of some wires, least significant first; empty where they were not recorded."""
    course = Course[int]()
    for t, code in codes([record.pins.get(wire, Edges()) for wire in wires]):
        if course and t - course[-1][0] < SKEW_NS:
            course[-1] = course[-1][0], code
        elif not course or course[-1][1] != code:
            course.append((t, code))
    return course


def motor_pairs(record: RunRecord) -> Course[tuple[int, int]]:
    """Return what both motors were told: values of the pins as the wiring table says, left and right."""
    pinout = _pinout()
    sides = [pinout.value(side).wires for side in ("motor1", "motor2")]
    course = value_course(record, [wire for wires in sides for wire in wires])
    width, mask = len(sides[0]), (1 << len(sides[0])) - 1
    return [(t, (motor_value(code & mask, width), motor_value(code >> width, width))) for t, code in course]


def encoder_steps(record: RunRecord, side: str, start: Nanos) -> Course[int]:
    """Return how many steps an encoder has shown since `start`, whole turns counted; it begins with its code there.

    Args:
        record: A run.
        side: `encoder1` (left) or `encoder2`.
        start: Before it the pins show what they idle at.
    """
    course = value_course(record, _pinout().value(side).wires)
    begin = max(0, bisect.bisect_right(course, start, key=_TIME) - 1)
    steps = [(start, course[begin][1])] if course else []
    for (_, before), (t, code) in pairwise(course[begin:]):
        change = (code - before + ENCODER_STEPS // 2) % ENCODER_STEPS - ENCODER_STEPS // 2
        steps.append((t, steps[-1][1] + change))
    return steps


def distance_wires() -> tuple[str, ...]:
    """Return the wires of the distance sensors, leftmost first."""
    return tuple(wire.name for wire in _pinout().with_role(WireRole.DISTANCE))


def seen_spans(record: RunRecord, wires: Sequence[str], start: Nanos) -> list[tuple[Nanos, Nanos]]:
    """Return when at least one of the wires was high: (from, to); what was high at `start` is from then."""
    whole = value_course(record, wires)
    before = [(start, value) for value in [at(whole, start)] if value is not None]
    course = [*before, *((t, value) for t, value in whole if t > start)]
    spans: list[tuple[Nanos, Nanos]] = []
    begin: Nanos | None = None
    for t, value in course:
        if value and begin is None:
            begin = t
        elif not value and begin is not None:
            spans.append((begin, t))
            begin = None
    return spans if begin is None else [*spans, (begin, record.last_ns)]


def sent(record: RunRecord, number: int) -> Course[int]:
    """Return the arguments of a command that came to the robot, with its last byte's time."""
    found = Course[int]()
    for packet in record.wire:
        if packet.direction != "c2r":
            continue
        try:
            command = Command.from_frame(Frame.from_bytes(packet.data))
        except LocalProtocolError:  # a noisy line
            continue
        if command.number == number and isinstance(command.argument, int):
            found.append((packet.t, command.argument))
    return found


def packets(record: RunRecord, profile: Profile) -> Course[StandardSip]:
    """Return the standard packets of the robot, each with the time at which it had arrived."""
    found = Course[StandardSip]()
    for packet in record.wire:
        if packet.direction != "r2c":
            continue
        try:
            frame = Frame.from_bytes(packet.data)
            if frame.kind in SIP_KINDS:
                found.append((packet.t, StandardSip.from_frame(frame, profile)))
        except (LocalProtocolError, RemoteProtocolError):  # a noisy line
            continue
    return found


def driving_since(record: RunRecord) -> Nanos | None:
    """Return when the adapter began to drive the robot, by its state log; None: it never did, or there is none."""
    return next((note.t for note in record.events if note.who == "adapter" and note.what == "driving"), None)


def at(course: Course[T], t: Nanos) -> T | None:
    """Return a course's value at a time; None before its beginning."""
    place = bisect.bisect_right(course, t, key=_TIME)
    return course[place - 1][1] if place else None


def poses_between(record: RunRecord, begin: Nanos, end: Nanos) -> list[Pose]:
    """Return the poses in a span of time, its end left out."""
    first, last = (bisect.bisect_left(record.poses, t, key=attrgetter("t")) for t in (begin, end))
    return record.poses[first:last]


def wheel_steps(pose: Pose, side: str) -> float:
    """Return how far a wheel has truly turned since the start, in steps of its encoder."""
    angle = pose.left_angle if side == "encoder1" else pose.right_angle
    return angle / MICRO / math.tau * ENCODER_STEPS


def rim_mm_s(pose: Pose, side: str) -> float:
    """Return the speed of a wheel's rim, mm/s; `motor1` is left."""
    return (pose.left if side == "motor1" else pose.right) / 1000
