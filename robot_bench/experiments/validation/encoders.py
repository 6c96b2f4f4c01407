"""What the encoder experiments measure: the pins against the wheels' true angles, and what a program counts."""

import bisect
import math
import re
from collections.abc import Sequence
from itertools import pairwise
from operator import attrgetter

from p2os.protocol.odometry import POSITION_MODULUS
from p2os.protocol.profiles import Profile
from robot_bench.events.kinds import MICRO, Pose
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Finding, Missing, worst_or_missing
from robot_bench.experiments.validation.nominal import Nominal
from robot_bench.experiments.validation.signals import (
    ENCODER_STEPS,
    Course,
    at,
    encoder_steps,
    motor_pairs,
    packets,
    poses_between,
    rim_mm_s,
    wheel_steps,
)
from robot_bench.recording.recorder import SAMPLE_NS
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_S, Nanos

SIDES = ("encoder1", "encoder2")
HALF_TURN = ENCODER_STEPS // 2
#: Figures: the pins against the truth, and against what the adapter was told.
BY_ANGLE, BY_PACKETS = "encoder code against the wheel's angle", "encoder code against the packets' odometry"
#: The motor value of most speed, by its size.
MOST_CODE = 4
#: What the program prints: the pair, and the steps that it has counted on both encoders.
COUNTED = re.compile(r"^codes: (-?\d+) (-?\d+) at (-?\d+) (-?\d+)$")
#: chosen: what a line of text takes from the program's count to its last character, seconds.
LINE_S = 0.01


def encoder_figures(record: RunRecord, nominal: Nominal) -> list[Finding]:
    """Return how near the pins come to the truth, of both wheels, from the first motion on.

    Where a wheel turns more than half a turn between two samples of its angle, pins that show each sample as it is tell
    where in its turn it is and no more: they are looked at when they are new, and whole turns are left out.
    """
    start = next((t for t, pair in motor_pairs(record) if pair != (0, 0)), None)
    if start is None:
        return [Missing(group="pins", what="encoder pins", why="the motor pins never said anything but 0")]
    result: list[Finding] = []
    moving: list[Figure] = []
    told: list[Figure] = []
    poses = nominal.packet_poses(record)
    for side in SIDES:
        steps = encoder_steps(record, side, start)
        if not steps:
            return [Missing(group="pins", what="encoder pins", why=f"no wire of {side} was recorded")]
        result.append(_changes(steps, side))
        if not nominal.is_direct:
            told += _after_packets(nominal, poses, side, steps)
        if nominal.at_port:
            continue
        whole = _beginning(record, nominal, side, start, steps[0][1])
        is_within_turn = nominal.is_direct and bool(_ambiguous(record, nominal, start))
        for pose in record.poses:
            if pose.t < start or (is_within_turn and pose.t % round(nominal.encoder_period_s * NS_PER_S)):
                continue
            truth = wheel_steps(pose, side)
            off = (at(steps, pose.t) or 0) + whole + 0.5 - truth
            moving.append(_against(
                BY_ANGLE, truth, _within_turn(off) if is_within_turn else off, f"{side} at {pose.t / NS_PER_S:.2f} s",
                nominal.encoder_bound(0.0 if is_within_turn else _fastest(record, nominal, pose.t, side)),
            ))  # fmt: skip
    if not nominal.is_direct:
        result.append(worst_or_missing(told, "pins", BY_PACKETS, "no packet came"))
    if not nominal.at_port:
        result.append(worst_or_missing(moving, "motion", BY_ANGLE, "no pose was recorded"))
    return result


def _against(what: str, truth: float, off: float, where: str, bound: FigureTolerance) -> Figure:
    return Figure(
        group="motion" if what == BY_ANGLE else "pins", what=what, expected=truth, measured=truth + off,
        uncertainty=ENCODER_STEPS / MICRO, unit="steps", at=where, bound=bound,
    )  # fmt: skip


def _after_packets(nominal: Nominal, poses: Sequence[Pose], side: str, steps: Course[int]) -> list[Figure]:
    """Return what an encoder shows when it has walked to what a packet tells, against what the packets tell.

    Both count from where the wheel stood when the drive began: of a robot at a port nothing else is known.
    """
    start = steps[0][0]
    standing = [pose for pose in poses if pose.t <= start]
    origin = (wheel_steps(standing[-1], side) if standing else 0.0) - steps[0][1]
    figures = []
    for pose, following in pairwise(poses[max(0, len(standing) - 1) :]):
        shown = at(steps, following.t - 1)
        if shown is None or following.t - pose.t < nominal.walk_ns(_turned_steps(poses, pose.t, side)):
            continue
        truth = wheel_steps(pose, side) - origin
        where = f"{side} at {pose.t / NS_PER_S:.2f} s"
        figures.append(_against(BY_PACKETS, truth, shown + 0.5 - truth, where, nominal.encoder_packet_bound))
    return figures


def _turned_steps(poses: Sequence[Pose], t: Nanos, side: str) -> float:
    """Return how many steps a wheel has turned in the last few packets before a time."""
    first, last = (bisect.bisect_left(poses, when, key=attrgetter("t")) for when in (t - NS_PER_S // 2, t + 1))
    near = [wheel_steps(pose, side) for pose in poses[first:last]]
    return max(near) - min(near) if near else 0.0


def _beginning(record: RunRecord, nominal: Nominal, side: str, start: Nanos, code: int) -> int:
    """Return by how many steps a code is counted from another beginning than the wheel's angle.

    Straight from the body these are whole turns. An adapter counts on from the code that it began with, which is
    the one that its wires show while it boots.
    """
    if nominal.is_direct:
        first = next((wheel_steps(pose, side) for pose in record.poses if pose.t >= start), 0.0)
        return round((first - code - 0.5) / ENCODER_STEPS) * ENCODER_STEPS
    standing = [pose for pose in record.poses if pose.t <= start]
    return math.floor(wheel_steps(standing[-1], side) if standing else 0.0) - code


def _within_turn(steps: float) -> float:
    """Return a difference with its whole turns left out."""
    return (steps + HALF_TURN) % ENCODER_STEPS - HALF_TURN


def _ambiguous(record: RunRecord, nominal: Nominal, start: Nanos) -> set[tuple[str, bool]]:
    """Return which wheels have turned more than half a turn between two samples, and whether forward."""
    apart = round(nominal.encoder_period_s * NS_PER_S / SAMPLE_NS)
    found = set()
    for side in SIDES:
        angles = [wheel_steps(pose, side) for pose in record.poses if pose.t >= start]
        changes = [after - before for before, after in zip(angles, angles[apart:], strict=False)]
        found |= {(side, change > 0) for change in changes if abs(change) > HALF_TURN}
    return found


def sparse_figures(record: RunRecord, nominal: Nominal) -> list[Finding]:
    """Return what becomes of a wheel that turns more than half a turn between two samples of its angle.

    The adapter counts ways and walks through each code, so that a program misses none. Pins that show samples let a
    program lose turns, but whole ones only.
    """
    start = next((t for t, pair in motor_pairs(record) if pair != (0, 0)), 0)
    seen = _ambiguous(record, nominal, start)
    ends: list[Figure] = []
    for _, line in record.usart_lines()[-2:]:
        found = COUNTED.match(line)
        for side, text in zip(SIDES, found.group(3, 4) if found else (), strict=False):
            begin = next((count for _, count in encoder_steps(record, side, start)), 0)
            truth = wheel_steps(record.poses[-1], side)
            off = int(text) + begin + _beginning(record, nominal, side, start, begin) + 0.5 - truth
            ends.append(Figure(
                group="pins", what="count of the program at the end, against the wheel", expected=truth,
                measured=truth + (_within_turn(off) if nominal.is_direct else off), uncertainty=ENCODER_STEPS / MICRO,
                unit="steps", bound=nominal.encoder_bound(0.0), at=side,
            ))  # fmt: skip
    return [
        Figure(
            group="motion", what="wheels and ways round with more than half a turn between two samples", expected=4,
            measured=len(seen), uncertainty=0, unit="",
            bound=FigureTolerance(name="half a turn", value=0, formula="both wheels, both ways round"),
        ),
        *encoder_figures(record, nominal),
        worst_or_missing(ends, "pins", "count of the program at the end, against the wheel", "it printed no counts"),
    ]  # fmt: skip


def wrap_figure(record: RunRecord, profile: Profile) -> Finding:
    """Return whether the position in the packets wraps at all: it counts no negative numbers."""
    told = [(sip.raw_x, sip.raw_y) for _, sip in packets(record, profile)]
    wraps = sum(
        abs(now - before) > POSITION_MODULUS // 2
        for one, other in pairwise(told) for before, now in zip(one, other, strict=True)
    )  # fmt: skip
    return Figure(
        group="wire", what="a wrap of the position counter, at least", expected=1, measured=min(wraps, 1),
        uncertainty=0, unit="", at=f"{wraps} of them",
        bound=FigureTolerance(name="wrap", value=0, formula="behind its origin x is below 0"),
    )  # fmt: skip


def slip_figures(record: RunRecord, nominal: Nominal, body: str) -> list[Finding]:
    """Return the encoders' figures, and that the wheels did slip: in each direction by more than a step."""
    slipped = dict.fromkeys((True, False), 0.0)
    for before, pose in pairwise(record.poses):
        turned = (wheel_steps(pose, SIDES[0]) - wheel_steps(before, SIDES[0])) * nominal.encoder_step_mm
        slipped[turned > 0] += abs(turned) - math.hypot(pose.x - before.x, pose.y - before.y) / 1000
    return [
        Figure(
            group="motion", what="directions in which the wheels slip", expected=0 if body == "kinematic" else 2,
            measured=sum(way > nominal.encoder_step_mm for way in slipped.values()), uncertainty=0, unit="",
            bound=FigureTolerance(
                name="slip", value=0,
                formula=f"against both walls, by more than {nominal.encoder_step_mm:.4g} mm; kinematic wheels stall",
            ), at=f"{slipped[True]:.0f} mm ahead, {slipped[False]:.0f} mm back",
        ),
        *(one for one in encoder_figures(record, nominal) if "codes reached" not in one.what),
    ]  # fmt: skip


def _fastest(record: RunRecord, nominal: Nominal, t: Nanos, side: str) -> float:
    """Return the fastest that a rim was within the time that its code may be old."""
    lag_ns = round(nominal.encoder_lag(MOST_CODE * nominal.step_mm_s).seconds * NS_PER_S)
    near = poses_between(record, t - lag_ns - SAMPLE_NS, t + 1)
    motor = "motor1" if side == "encoder1" else "motor2"
    # A wheel that slips may have turned, though it stood at both poses.
    turned = (abs(wheel_steps(after, side) - wheel_steps(before, side)) for before, after in pairwise(near))
    means = [steps * nominal.encoder_step_mm * NS_PER_S / SAMPLE_NS for steps in turned]
    return max([*means, *(abs(rim_mm_s(pose, motor)) for pose in near)], default=0.0)


def _changes(steps: list[tuple[Nanos, int]], side: str) -> Figure:
    """Return how many of the eight codes were reached from below and from above."""
    reached = {(count % ENCODER_STEPS, count > before) for (_, before), (_, count) in pairwise(steps)}
    return Figure(
        group="pins", what=f"{side}: codes reached, forward and backward", expected=2 * ENCODER_STEPS,
        measured=len(reached), uncertainty=0, unit="",
        bound=FigureTolerance(name="codes reached", value=0, formula="all eight, both ways"), count=len(steps) - 1,
    )  # fmt: skip


def count_figures(record: RunRecord) -> list[Finding]:
    """Return whether the program has counted what its pins showed, line by line."""
    start = next((t for t, pair in motor_pairs(record) if pair != (0, 0)), 0)
    courses = [encoder_steps(record, side, start) for side in SIDES]
    bound = FigureTolerance(name="steps counted", value=0, formula="a program that looks each tick misses none")
    figures: list[Figure] = []
    for t, line in record.usart_lines():
        found = COUNTED.match(line)
        if found is None:
            continue
        for side, course, text in zip(SIDES, courses, found.group(3, 4), strict=True):
            then = {at(course, t - round(back * NS_PER_S)) for back in (0.0, LINE_S)}
            begin = course[0][1] if course else 0
            near = min(
                (step - begin for step in then if step is not None), key=lambda step: abs(step - int(text)), default=0
            )
            figures.append(Figure(
                group="pins", what="steps that the program counts", expected=near, measured=int(text), uncertainty=0,
                unit="steps", bound=bound, at=f"{side} at {t / NS_PER_S:.2f} s",
            ))  # fmt: skip
    return [worst_or_missing(figures, "pins", "steps that the program counts", "it printed no counts")]
