"""What the motors experiments measure: pins, commands on the line, rim speeds, ramps and delays."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from p2os.protocol.commands import CommandNumber
from robot_bench.events.kinds import Pose
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Finding, Missing, worst_or_missing
from robot_bench.experiments.validation.nominal import BODY_MM_S, JITTER_S, LINE, PAIR_BYTES, POSE_S, Nominal
from robot_bench.experiments.validation.signals import (
    Course,
    at,
    motor_pairs,
    poses_between,
    rim_mm_s,
    sent,
    wheel_steps,
)
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_S, Nanos

Pair = tuple[int, int]
#: Of a ramp the part that is fitted: its ends are rounded by a controller's steps.
FITTED = 0.1, 0.9
#: chosen: shares of a ramp's slope, and what they are for.
SLOPE = 0.0015, "a controller's ramp goes in whole mm/s and steps of milliseconds"
SLOPE_AT_PORT = 0.05, "speeds are whole mm/s, each 100 ms"
#: chosen: over less a way tells too little of a speed.
LEAST_SPAN_NS: Nanos = NS_PER_S // 4
#: chosen: poses on a ramp that a line can be laid through.
LEAST_POSES = 6
_NO_RAMP = f"no change of three codes took {LEAST_POSES} poses or more"


def motor_figures(record: RunRecord, nominal: Nominal, wanted: Sequence[tuple[Pair, float]]) -> list[Finding]:
    """Return what a program did that shows these pairs one after the other, each for so many seconds.

    The first pair is the stand still before; `wanted` begins with the first that moves.
    """
    course = motor_pairs(record)
    shown = [pair for _, pair in course]
    if not shown:
        return [Missing(group="pins", what="motor pins", why="no motor pin was recorded")]
    course = course[next((place for place, (_, pair) in enumerate(course) if pair != (0, 0)), len(course)) :]
    if not course:
        return [Missing(group="pins", what="pairs of codes in their order", why="the motor pins said nothing but 0")]
    ends = [t for t, _ in course[1:]] + [record.last_ns]
    held = [(pair, t, end) for (t, pair), end in zip(course, ends, strict=True)]
    result: list[Finding] = [_order(held, wanted), _holds(held, wanted)]
    spans = _spans(held)
    if not nominal.is_direct and record.wire:
        result += _commands(record, nominal, spans)
    return result + _motion(record, nominal, spans)


def _order(held: Sequence[tuple[Pair, Nanos, Nanos]], wanted: Sequence[tuple[Pair, float]]) -> Finding:
    """Return how many of the pairs came in their order."""
    right = 0
    for (pair, _, _), (expected, _) in zip(held, wanted, strict=False):
        if pair != expected:
            break
        right += 1
    surplus = max(0, len(held) - len(wanted))
    at_text = f"the pins said {held[right][0]}" if right < min(len(held), len(wanted)) else ""
    return Figure(
        group="pins", what="pairs of codes in their order", expected=len(wanted), measured=right - surplus,
        uncertainty=0, unit="", bound=FigureTolerance(name="order of codes", value=0,
                                                      formula="every one, and no other"),
        count=len(wanted), at=at_text,
    )  # fmt: skip


def _holds(held: Sequence[tuple[Pair, Nanos, Nanos]], wanted: Sequence[tuple[Pair, float]]) -> Finding:
    """Return the hold time that is furthest from what the program says; the last pair's end is not known."""
    bound = FigureTolerance(
        name="hold time", value=JITTER_S, formula=f"jitter of a tick's program {JITTER_S * 1e6:g} us"
    )
    figures = [
        Figure(
            group="pins", what="time that a pair is held", expected=seconds, measured=(end - begin) / NS_PER_S,
            uncertainty=1e-9, unit="s", bound=bound, at=str(pair),
        )
        for (pair, begin, end), (expected, seconds) in zip(held[:-1], wanted, strict=False) if pair == expected
    ]  # fmt: skip
    return worst_or_missing(figures, "pins", "time that a pair is held", "no pair of codes came as expected")


def _spans(held: Sequence[tuple[Pair, Nanos, Nanos]]) -> list[tuple[Pair, Pair, Nanos, Nanos]]:
    """Return (pair before, pair, begin, end) for each pair."""
    first = ((0, 0), held[0][0], held[0][1], held[0][2]) if held else None
    rest = [(before[0], pair, begin, end) for before, (pair, begin, end) in pairwise(held)]
    return [first, *rest] if first else []


def _commands(record: RunRecord, nominal: Nominal, spans: Sequence[tuple[Pair, Pair, Nanos, Nanos]]) -> list[Finding]:
    """Return the rounding of the commands, and how long they take to the robot."""
    rows = (("VEL", CommandNumber.VEL, "mm/s"), ("RVEL", CommandNumber.RVEL, "deg/s"))
    courses = {name: sent(record, number) for name, number, _ in rows}
    result: list[Finding] = []
    delay = nominal.to_command
    for place, (name, _, unit) in enumerate(rows):
        figures = []
        for _, pair, begin, end in spans:
            got = at(courses[name], begin + round((delay.seconds + 1e-6) * NS_PER_S))
            if got is not None and begin + delay.seconds * NS_PER_S < end:
                figures.append(Figure(
                    group="wire", what=f"{name} for a pair of codes", expected=nominal.speeds(pair)[place],
                    measured=float(got), uncertainty=0, unit=unit, bound=nominal.rounding_bounds(pair)[place],
                    at=str(pair),
                ))  # fmt: skip
        result.append(worst_or_missing(figures, "wire", f"{name} for a pair of codes", f"no {name} came to the robot"))
    late: dict[str, list[Figure]] = {"change of the pins to the robot's last command": []}
    if not nominal.at_port:  # in real time a slice comes between
        late["the same, where the line is free"] = []
    for before, pair, begin, end in spans:
        changed = _last_change(courses, begin, end)
        if changed is None:
            continue
        bounds = [delay.bound("delay to the robot" + nominal.suffix)]
        if _is_line_free(courses, nominal, begin, changed):
            is_second = any(t == changed for t, _ in courses["RVEL"])
            needed = nominal.to_free_line(PAIR_BYTES if is_second else PAIR_BYTES // 2)
            bounds.append(needed.bound("delay to the robot, line free"))
        for (what, figures), bound in zip(late.items(), bounds, strict=False):
            figures.append(Figure(
                group="wire", what=what, expected=0.0, measured=(changed - begin) / NS_PER_S, uncertainty=1e-9,
                unit="s", bound=bound, at=f"{before} -> {pair}",
            ))  # fmt: skip
    return [*result, *(worst_or_missing(figures, "wire", what, "none came") for what, figures in late.items())]


def _is_line_free(courses: dict[str, Course[int]], nominal: Nominal, begin: Nanos, changed: Nanos) -> bool:
    """Tell whether the pair that a change makes had to wait for none: of those that came since there are no others."""
    gap_ns = round(nominal.spacing.seconds * NS_PER_S) - LINE.time_of(PAIR_BYTES)
    return all(sum(begin - gap_ns < t <= changed for t, _ in course) <= 1 for course in courses.values())


def _last_change(courses: dict[str, Course[int]], begin: Nanos, end: Nanos) -> Nanos | None:
    """Return when the later of the two commands took its new value first; None where neither has changed."""
    times = []
    for course in courses.values():
        before = at(course, begin)
        times += [t for t, value in course if begin < t < end and value != before][:1]
    return max(times, default=None)


def _motion(record: RunRecord, nominal: Nominal, spans: Sequence[tuple[Pair, Pair, Nanos, Nanos]]) -> list[Finding]:
    """Return steady speeds, slopes of the ramps and their delay."""
    steady: list[Figure] = []
    turned: list[Figure] = []
    slopes: dict[str, list[Figure]] = {"both wheels alike": [], "turning on the spot": []}
    delays: list[Figure] = []
    for before, pair, begin, end in spans:
        wait = max(_ramp_s(nominal, before, pair), 0.0) + nominal.to_motion.seconds + POSE_S
        poses = poses_between(record, begin + round(wait * NS_PER_S), end)
        if poses:
            steady += [_steady(nominal, side, poses, pair) for side in _SIDES]
        if poses and poses[-1].t - poses[0].t >= LEAST_SPAN_NS:
            last = zip(steady[-2:], _SIDES, strict=True)
            turned += [_turned(nominal, figure, side, poses, pair) for figure, side in last]
        kind = _kind_of_change(before, pair)
        if kind is None or not nominal.ramp_mm_s2:
            continue
        nominal_slope = nominal.ramp_mm_s2 if kind == "both wheels alike" else nominal.turn_ramp_mm_s2
        fitted = fitted_ramp(record, begin, end)
        if fitted is None:
            continue
        slope, began = fitted
        what = f"{before} -> {pair}"
        slopes[kind].append(_slope(nominal, nominal_slope, abs(slope), kind, what))
        delays.append(Figure(
            group="motion", what="change of the pins to the wheels' ramp", expected=0.0,
            measured=began - begin / NS_PER_S, uncertainty=1e-3, unit="s",
            bound=nominal.to_motion.bound("delay to the wheels" + nominal.suffix), at=what,
        ))  # fmt: skip
    result = [worst_or_missing(steady, "motion", "steady rim speed", "no wheel came to a steady speed")]
    result.append(worst_or_missing(turned, "motion", _by_angles(nominal), "no wheel came to a steady speed"))
    if nominal.ramp_mm_s2:
        result += [
            worst_or_missing(found, "motion", f"ramp, {kind}", _NO_RAMP)
            for kind, found in slopes.items() if found or kind == "both wheels alike"
        ]  # fmt: skip
        result.append(
            worst_or_missing(
                delays,
                "motion",
                "change of the pins to the wheels' ramp",
                _NO_RAMP,
            )
        )
    return result


_SIDES = ("motor1", "motor2")


def _steady(nominal: Nominal, side: str, poses: Sequence[Pose], pair: Pair) -> Figure:
    measured = sum(rim_mm_s(pose, side) for pose in poses) / len(poses)
    return Figure(
        group="motion", what="steady rim speed", expected=nominal.rims_mm_s(pair)[_SIDES.index(side)],
        measured=measured,
        uncertainty=BODY_MM_S, unit="mm/s", bound=nominal.speed_bound(pair),
        at=f"{'left' if side == 'motor1' else 'right'} of {pair}",
    )  # fmt: skip


def _turned(nominal: Nominal, figure: Figure, side: str, poses: Sequence[Pose], pair: Pair) -> Figure:
    """Return a steady speed as the wheel's angle tells it."""
    encoder = "encoder1" if side == "motor1" else "encoder2"
    steps = wheel_steps(poses[-1], encoder) - wheel_steps(poses[0], encoder)
    span_s = (poses[-1].t - poses[0].t) / NS_PER_S
    return replace(
        figure, what=_by_angles(nominal), measured=steps * nominal.encoder_step_mm / span_s,
        bound=nominal.way_bound(pair, figure.expected, span_s),
    )  # fmt: skip


def _by_angles(nominal: Nominal) -> str:
    return "the same by the packets' odometry" if nominal.at_port else "the same by the wheels' angles"


def _ramp_s(nominal: Nominal, before: Pair, pair: Pair) -> float:
    """Return how long a change of speed takes at most: straight and turning parts one after the other."""
    if not nominal.ramp_mm_s2:
        return 0.0
    straight = abs(sum(pair) - sum(before)) / 2 * nominal.step_mm_s / nominal.ramp_mm_s2
    turning = abs((pair[1] - pair[0]) - (before[1] - before[0])) / 2 * nominal.step_mm_s / nominal.turn_ramp_mm_s2
    return straight + turning


def _kind_of_change(before: Pair, pair: Pair) -> str | None:
    """Return which ramp a change shows by itself; None: both together, or too short a one."""
    left, right = pair[0] - before[0], pair[1] - before[1]
    if min(abs(left), abs(right)) < 3:
        return None
    return {left: "both wheels alike", -left: "turning on the spot"}.get(right)


def fitted_ramp(record: RunRecord, begin: Nanos, end: Nanos) -> tuple[float, float] | None:
    """Return the slope of the right wheel's ramp, mm/s2, and when it began, seconds; None: too few poses."""
    poses = poses_between(record, begin - NS_PER_S // 2, end)
    if not poses:
        return None
    # From its own speed before to its own after: a speed that is wrong tells of itself.
    low, high = rim_mm_s(poses[0], "motor2"), rim_mm_s(poses[-1], "motor2")
    if abs(high - low) < 1.0:
        return None
    shares = [
        (pose.t / NS_PER_S, rim_mm_s(pose, "motor2"), (rim_mm_s(pose, "motor2") - low) / (high - low))
        for pose in poses if pose.t >= begin
    ]  # fmt: skip
    fitted = [(t, speed) for t, speed, share in shares if FITTED[0] <= share <= FITTED[1]]
    if len(fitted) < LEAST_POSES:
        return None
    middle_t, middle_v = (sum(values) / len(fitted) for values in zip(*fitted, strict=True))
    slope = sum((t - middle_t) * (v - middle_v) for t, v in fitted) / sum((t - middle_t) ** 2 for t, _ in fitted)
    return slope, middle_t - (middle_v - low) / slope


def _slope(nominal: Nominal, expected: float, measured: float, kind: str, what: str) -> Figure:
    share, why = SLOPE_AT_PORT if nominal.at_port else SLOPE
    return Figure(
        group="motion", what=f"ramp, {kind}", expected=expected, measured=measured,
        uncertainty=expected * 1e-4, unit="mm/s2", at=what,
        bound=FigureTolerance(
            name="slope of a ramp" + ", at a port" * nominal.at_port, value=share * expected,
            formula=f"{share:.2%} of {expected:.4g} mm/s2: {why}",
        ),
    )  # fmt: skip
