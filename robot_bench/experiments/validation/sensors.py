"""What the sensor experiments measure: which distance pins rise, before what, how late, and what the robot does."""

from collections.abc import Mapping, Sequence

from adapter_sim.receiver import PASS_NS
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Finding, Missing, worst_or_missing
from robot_bench.experiments.validation.nominal import PORT_MM_S, PROGRAM_S, TICK_S, Nominal
from robot_bench.experiments.validation.signals import (
    at,
    distance_wires,
    driving_since,
    motor_pairs,
    packets,
    poses_between,
    seen_spans,
    value_course,
)
from robot_bench.recording.run_record import RunRecord
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.world_script import Op
from simbase.timing import NS_PER_S, Nanos

#: chosen: the program counts a change when so many samples in a row show it.
DEBOUNCE_TICKS = 2
#: The code at which the sensors program drives.
SPEED_CODE = 2
#: chosen: so long after its beginning nothing is about, and the distances are told.
SETTLED_NS = 3 * NS_PER_S
#: chosen: a wheel slower than this stands, mm/s.
STANDS_MM_S = 0.5


def sensor_figures(record: RunRecord, nominal: Nominal, scenario: Scenario) -> list[Finding]:
    """Return what the distance pins said of the things that the scenario puts before the sonar."""
    windows = things_before(scenario)
    if not windows:
        return [Missing(group="pins", what="distance pins", why="the scenario puts nothing before a sonar")]
    delay = nominal.to_distance_pin
    start = min(begin for spans in windows.values() for begin, _ in spans) - NS_PER_S
    bound = delay.bound("delay to a distance pin" + nominal.suffix)
    rises: list[Figure] = []
    falls: list[Figure] = []
    wrong = total = 0
    where = ""
    for number, wire in enumerate(distance_wires(), start=1):
        spans, expected = seen_spans(record, (wire,), start), windows.get(number, [])
        total += len(expected)
        for begin, end in expected:
            match = [span for span in spans if begin <= span[0] <= end]
            if len(match) != 1:
                wrong, where = wrong + 1, f"{wire} rose {len(match)} times for the thing at {begin / NS_PER_S:g} s"
                continue
            rose, fell = span = match.pop()
            spans.remove(span)
            for figures, name, late in ((rises, "thing appears", rose - begin), (falls, "thing is gone", fell - end)):
                figures.append(Figure(
                    group="pins", what=f"{name} to the distance pin", expected=0.0, measured=late / NS_PER_S,
                    uncertainty=1e-9, unit="s", bound=bound, at=f"{wire} at {begin / NS_PER_S:g} s",
                ))  # fmt: skip
        if spans:
            wrong, where = wrong + len(spans), f"{wire} rose at {spans[0][0] / NS_PER_S:.2f} s before nothing"
    return [
        Figure(
            group="pins", what="things seen by their own sensor, and by no other", expected=total,
            measured=total - wrong, uncertainty=0, unit="", count=total, at=where,
            bound=FigureTolerance(name="things seen", value=0, formula="each once, and nothing else"),
        ),
        worst_or_missing(rises, "pins", "thing appears to the distance pin", "no pin rose"),
        worst_or_missing(falls, "pins", "thing is gone to the distance pin", "no pin fell"),
    ]  # fmt: skip


def reading_figures(record: RunRecord, scenario: Scenario) -> list[Finding]:
    """Return whether each distance pin says what the packets do: the last reading is nearer than the threshold, or not.

    A reading stands on its pin a pass of the adapter's loop after its packet has arrived, and no pin changes later.
    """
    what = "readings in packets that stand on their pins"
    begin = driving_since(record)
    if begin is None:
        return [Missing(group="pins", what=what, why="the adapter never drove the robot")]
    courses = [value_course(record, (wire,)) for wire in distance_wires()]
    brought: list[set[Nanos]] = [set() for _ in courses]
    seen: list[set[bool]] = [set() for _ in courses]
    right = total = 0
    where = ""
    for t, sip in packets(record, scenario.controller.family_of(scenario.parameters)):
        for reading in sip.sonar if t >= begin else ():
            if reading.number >= len(courses):
                continue
            is_near = reading.raw_range * scenario.parameters.range_um_per_count < scenario.threshold_um
            brought[reading.number].add(t)
            seen[reading.number].add(is_near)
            total += 1
            if at(courses[reading.number], t + PASS_NS) == is_near:
                right += 1
            else:
                where = where or f"sonar {reading.number + 1} at {t / NS_PER_S:.2f} s"
    if not total:
        return [Missing(group="pins", what=what, why="no packet brought a reading")]
    alone = [
        (t, number)
        for number, (course, times) in enumerate(zip(courses, brought, strict=True), start=1)
        for t, _ in course if t > begin and not any(t - PASS_NS <= come <= t for come in times)
    ]  # fmt: skip
    both = [number for number, levels in enumerate(seen, start=1) if len(levels) == 2]
    found: list[Finding] = [
        Figure(
            group="pins", what=what, expected=total, measured=right, uncertainty=0, unit="", count=total, at=where,
            bound=FigureTolerance(name="readings on pins", value=0,
                                  formula="each, a pass after its packet has arrived"),
        ),
        Figure(
            group="pins", what="changes of a distance pin without a reading", expected=0, measured=len(alone),
            uncertainty=0, unit="", bound=FigureTolerance(name="changes of pins", value=0, formula="none"),
            at=f"sonar {min(alone)[1]} at {min(alone)[0] / NS_PER_S:.2f} s" if alone else "",
        ),
    ]  # fmt: skip
    return [*found, Figure(
        group="pins", what="sonar that saw something within the threshold and beyond", expected=len(courses),
        measured=len(both), uncertainty=0, unit="",
        bound=FigureTolerance(name="sonar used", value=0, formula="all of them"),
        at=", ".join(f"not {number + 1}" for number in range(len(courses)) if number + 1 not in both),
    )]  # fmt: skip


def things_before(scenario: Scenario) -> Mapping[int, list[tuple[Nanos, Nanos]]]:
    """Return when something stands nearer to each sonar than the threshold, by the file: number → (from, to)."""
    windows: dict[int, list[tuple[Nanos, Nanos]]] = {}
    gone = {change.name: change.at for change in scenario.changes if change.op is Op.REMOVE}
    for change in scenario.changes:
        if change.op is Op.PLACE and change.before is not None:
            surface_m = change.before.distance_m - (change.obstacle.radius_m if change.obstacle else 0.0)
            if round(surface_m * 1e6) >= scenario.threshold_um:
                continue
            windows.setdefault(change.before.number, []).append(
                (change.at, gone.get(change.name, scenario.duration_ns))
            )
    return windows


def only_while_seen_figures(record: RunRecord, nominal: Nominal) -> list[Finding]:
    """Return how soon the program drives and stops after its pins, and that the robot moves at no other time."""
    start = SETTLED_NS + ((driving_since(record) or 0) if nominal.at_port else 0)
    seen = seen_spans(record, distance_wires(), start)
    driven = [(t, pair != (0, 0)) for t, pair in motor_pairs(record) if t >= start]
    edges = [(t, True) for t, _ in seen if t > start] + [(t, False) for _, t in seen if t < record.last_ns]
    reaction = FigureTolerance(
        name="reaction of the program", value=DEBOUNCE_TICKS * TICK_S + PROGRAM_S,
        formula=f"{DEBOUNCE_TICKS} samples of {TICK_S * 1000:g} ms + {PROGRAM_S * 1000:g} ms of the program",
    )  # fmt: skip
    figures = [
        Figure(
            group="pins", what="first sensor on, or last one off, to the motor pins", expected=0.0,
            measured=(next((at for at, drives in driven if at >= t and drives is on), record.last_ns) - t) / NS_PER_S,
            uncertainty=1e-9, unit="s", bound=reaction, at=f"{'on' if on else 'off'} at {t / NS_PER_S:.3f} s",
        )
        for t, on in sorted(edges)
    ]  # fmt: skip
    what = "first sensor on, or last one off, to the motor pins"
    return [worst_or_missing(figures, "pins", what, "no sensor saw anything"), *_standing(record, nominal, seen, start)]


def _standing(record: RunRecord, nominal: Nominal, seen: Sequence[tuple[Nanos, Nanos]], start: Nanos) -> list[Finding]:
    """Return how long the wheels turn after the last sensor went off, and how fast they are while nothing is seen."""
    delay = nominal.to_motion.seconds + DEBOUNCE_TICKS * TICK_S + PROGRAM_S
    ramp_s = SPEED_CODE * nominal.step_mm_s / nominal.ramp_mm_s2 if nominal.ramp_mm_s2 else 0.0
    stop = FigureTolerance(
        name="time to stop" + nominal.suffix, value=delay + nominal.pose_s,
        formula=f"reaction and delay to the wheels {delay * 1000:.4g} ms"
        f" + {nominal.pose_s * 1000:g} ms between two poses",
    )  # fmt: skip
    stops: list[Figure] = []
    idle: list[Figure] = []
    still = FigureTolerance(name="standing", value=0, formula="a wheel that is told to stand does not turn")
    if nominal.at_port:
        still = FigureTolerance(
            name="standing, at a port", value=PORT_MM_S, formula=f"resolution of its packets {PORT_MM_S:g} mm/s"
        )
    free_from = start
    for begin, end in [*seen, (record.last_ns, record.last_ns)]:
        idle += [
            Figure(
                group="motion", what="rim speed while nothing is seen", expected=0.0,
                measured=max(abs(pose.left), abs(pose.right)) / 1000, uncertainty=1e-3, unit="mm/s",
                bound=still,
                at=f"{pose.t / NS_PER_S:.2f} s",
            )
            for pose in poses_between(record, free_from, begin)
        ]  # fmt: skip
        free_from = end + round((ramp_s + delay + nominal.pose_s) * NS_PER_S)
        after = poses_between(record, end, min(free_from + NS_PER_S, record.last_ns))
        moving = [pose.t for pose in after if max(abs(pose.left), abs(pose.right)) / 1000 > STANDS_MM_S]
        if end < record.last_ns and after:
            stops.append(Figure(
                group="motion", what="last sensor off to standing", expected=ramp_s,
                measured=(max(moving, default=end) - end) / NS_PER_S, uncertainty=nominal.pose_s, unit="s", bound=stop,
                at=f"{end / NS_PER_S:.3f} s",
            ))  # fmt: skip
    return [
        worst_or_missing(stops, "motion", "last sensor off to standing", "it never stopped for that"),
        worst_or_missing(idle, "motion", "rim speed while nothing is seen", "something was seen all the time"),
    ]
