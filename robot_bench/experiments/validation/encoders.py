"""What the encoder experiments measure: the pins against the wheels' true angles, and what a program counts."""

import re
from itertools import pairwise

from robot_bench.events.kinds import MICRO
from robot_bench.experiments.validation.figures import Bound, Figure, Finding, Missing, worst_or_missing
from robot_bench.experiments.validation.nominal import Nominal
from robot_bench.experiments.validation.signals import (
    ENCODER_STEPS,
    at,
    encoder_steps,
    motor_pairs,
    poses_between,
    rim_mm_s,
    wheel_steps,
)
from robot_bench.recording.recorder import SAMPLE_NS
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_S, Nanos

SIDES = ("encoder1", "encoder2")
#: What the program prints: the pair, and the steps that it has counted on both encoders.
COUNTED = re.compile(r"^codes: (-?\d+) (-?\d+) at (-?\d+) (-?\d+)$")
#: chosen: what a line of text takes from the program's count to its last character, seconds.
LINE_S = 0.01


def encoder_figures(record: RunRecord, nominal: Nominal) -> list[Finding]:
    """Return how near the pins come to the truth, of both wheels, from the first motion on."""
    start = next((t for t, pair in motor_pairs(record) if pair != (0, 0)), None)
    if start is None:
        return [Missing(group="pins", what="encoder pins", why="the motor pins never said anything but 0")]
    result: list[Finding] = []
    moving: list[Figure] = []
    for side in SIDES:
        steps = encoder_steps(record, side, start)
        if not steps:
            return [Missing(group="pins", what="encoder pins", why=f"no wire of {side} was recorded")]
        result.append(_changes(steps, side))
        first = next((wheel_steps(pose, side) for pose in record.poses if pose.t >= start), 0.0)
        # Angles and codes are counted from other beginnings, whole turns apart.
        whole = round((first - steps[0][1] - 0.5) / ENCODER_STEPS) * ENCODER_STEPS
        for pose in record.poses:
            if pose.t < start:
                continue
            shown = at(steps, pose.t)
            moving.append(Figure(
                group="motion", what="encoder code against the wheel's angle", expected=wheel_steps(pose, side),
                measured=(shown or 0) + whole + 0.5, uncertainty=ENCODER_STEPS / MICRO, unit="steps",
                bound=nominal.encoder_bound(_fastest(record, pose.t, side)), at=f"{side} at {pose.t / NS_PER_S:.2f} s",
            ))  # fmt: skip
    return [*result, worst_or_missing(moving, "motion", "encoder code against the wheel's angle", "no pose")]


def _fastest(record: RunRecord, t: Nanos, side: str) -> float:
    """Return the fastest that a rim was within the time that its code may be old: this pose and the four before."""
    near = poses_between(record, t - 4 * SAMPLE_NS, t + 1)
    motor = "motor1" if side == "encoder1" else "motor2"
    return max((abs(rim_mm_s(pose, motor)) for pose in near), default=0.0)


def _changes(steps: list[tuple[Nanos, int]], side: str) -> Figure:
    """Return how many of the eight codes were reached from below and from above."""
    reached = {(count % ENCODER_STEPS, count > before) for (_, before), (_, count) in pairwise(steps)}
    return Figure(
        group="pins", what=f"{side}: codes reached, forward and backward", expected=2 * ENCODER_STEPS,
        measured=len(reached), uncertainty=0, unit="",
        bound=Bound(name="codes reached", value=0, formula="all eight, both ways"), count=len(steps) - 1,
    )  # fmt: skip


def count_figures(record: RunRecord) -> list[Finding]:
    """Return whether the program has counted what its pins showed, line by line."""
    start = next((t for t, pair in motor_pairs(record) if pair != (0, 0)), 0)
    courses = [encoder_steps(record, side, start) for side in SIDES]
    bound = Bound(name="steps counted", value=0, formula="a program that looks each tick misses none")
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
