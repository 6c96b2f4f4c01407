"""Goals of a scenario: what a run must have shown, judged from its trace alone.

Each kind is a row of `KINDS`: the keys that its table may have, a sentence that
says what is wanted, and a judge that returns what is wrong or None. `p2os
report` can judge again, since nothing but the trace is asked.

A goal that is unknown of a real robot (a collision) is not judged there. What wants
something to be reached is missed only by a run that was as long as the scenario plans:
a shorter one meets it or leaves it open. What forbids is judged from the start.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

from p2os.errors import ScenarioError
from robot_bench.recording.run_record import PoseSample, RunRecord
from robot_bench.recording.signals import motor_steps
from robot_bench.recording.summary import cells_entered, distance_m
from robot_bench.scenario.schema import LONGEST_S, Key, Table, Where, check_table, nearest
from simbase.errors import shown
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

NS_PER_MINUTE = 60 * NS_PER_S
#: chosen: two motor values that follow each other within this are one change (two ports are written in turn).
SKEW_NS: Nanos = 1 * NS_PER_MS
#: chosen: so many collisions are named in one line; all stand in the state log.
NAMED_HITS = 3
#: What is unknown of a real robot, and what needs a world of ours.
NOT_AT_A_PORT = frozenset({"no_collision", "encoder_counts_match", "sensor_named"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """One thing that a run must show."""

    kind: str
    arguments: Table

    @property
    def wanted(self) -> str:
        """Return the goal as a sentence."""
        return KINDS[self.kind].wanted(self.arguments)

    def judged_from(self, planned_ns: Nanos) -> Nanos:
        """Return from when on a run can miss the goal, if the scenario plans to last so long."""
        return 0 if KINDS[self.kind].forbids else planned_ns

    def failure(self, record: RunRecord) -> str | None:
        """Return what a run lacks, or None when it meets the goal."""
        return KINDS[self.kind].judge(record, self.arguments)


@dataclass(frozen=True, slots=True)
class _Kind:
    keys: tuple[Key, ...]
    wanted: Callable[[Table], str]
    judge: Callable[[RunRecord, Table], str | None]
    #: It forbids something, and does not want anything to be reached.
    forbids: bool = False


@dataclass(frozen=True, slots=True)
class Judgement:
    """What became of a run's goals, each as a sentence."""

    met: list[str]
    missed: list[str]
    #: The run was too short to miss them, and has not met them.
    not_judged: list[str]


def load_goal(table: Table, where: Where) -> Goal:
    """Return the goal that a TOML table asks for.

    Raises:
        ScenarioError: The kind or a key is unknown, or a value is wrong.
    """
    kind = table.get("kind")
    check_table({"kind": kind} if "kind" in table else {}, (Key(name="kind", kind="text", required=True),), where)
    if kind not in KINDS:
        raise ScenarioError(f"{where}: there is no goal {shown(kind)}", hint=nearest(str(kind), KINDS))
    arguments = {name: value for name, value in table.items() if name != "kind"}
    check_table(arguments, KINDS[str(kind)].keys, f"{where} ({kind})" if isinstance(where, str) else where)
    _check_lists(arguments, where)
    return Goal(kind=str(kind), arguments=arguments)


def _check_lists(arguments: Table, where: Where) -> None:
    """Check what is in the lists of a goal."""
    pairs, texts = arguments.get("values", []), arguments.get("texts", [])
    if not all(_is_pair(pair) for pair in cast("list[object]", pairs)):
        raise ScenarioError(
            f"{where}: values must be pairs of motor values, [[left, right], ...]", hint="of -128 to 127"
        )
    if not all(isinstance(text, str) for text in cast("list[object]", texts)):
        raise ScenarioError(f"{where}: texts must be a list of texts in quotes")


def _is_pair(pair: object) -> bool:
    return (
        isinstance(pair, list)
        and len(pair) == 2
        and all(isinstance(value, int) and not isinstance(value, bool) and -128 <= value <= 127 for value in pair)
    )


def judge(record: RunRecord, goals: tuple[Goal, ...], *, end_ns: Nanos, planned_ns: Nanos = 0) -> Judgement:
    """Judge a run's goals.

    Args:
        record: The run.
        goals: What it has to show.
        end_ns: When it ended.
        planned_ns: How long the scenario plans it to be; 0 judges all.
    """
    found = Judgement([], [], [])
    for goal in goals:
        if record.meta.get("mode") == "port" and goal.kind in NOT_AT_A_PORT:
            continue
        failure = goal.failure(record)
        judged_from = goal.judged_from(planned_ns)
        if failure is None:
            found.met.append(goal.wanted)
        elif end_ns < judged_from:
            found.not_judged.append(f"{goal.wanted}: not judged before {judged_from / NS_PER_S:g} s")
        else:
            found.missed.append(f"{goal.kind}: {failure}")
    return found


def _number(arguments: Table, name: str, default: float = 0.0) -> float:
    return float(cast("float", arguments.get(name, default)))


def _no_collision(record: RunRecord, _arguments: Table) -> str | None:
    first = next((pose for pose in record.poses if pose.collisions), None)
    hits = record.collisions()
    if hits:
        more = f", and {len(hits) - NAMED_HITS} more" if len(hits) > NAMED_HITS else ""
        return f"{len(hits)} collision(s): {'; '.join(map(str, hits[:NAMED_HITS]))}{more}"
    if first is None:
        return None
    return f"{record.poses[-1].collisions} collision(s), the first at {_seconds(first.t)}, {_place(first)}"


def _min_distance(record: RunRecord, arguments: Table) -> str | None:
    wanted = _number(arguments, "distance_m")
    wanted += _number(arguments, "distance_m_a_minute") * record.last_ns / NS_PER_MINUTE
    driven = distance_m(record)
    return None if driven >= wanted else f"{driven:.2f} m were driven, {wanted:.2f} m are wanted"


def _wanted_distance(arguments: Table) -> str:
    parts = []
    if "distance_m" in arguments:
        parts.append(f"{_number(arguments, 'distance_m'):g} m")
    if "distance_m_a_minute" in arguments:
        parts.append(f"{_number(arguments, 'distance_m_a_minute'):g} m a minute")
    return f"drives at least {' and '.join(parts)}"


def _cells(record: RunRecord, arguments: Table) -> str | None:
    wanted, entered = int(_number(arguments, "least")), cells_entered(record)
    return None if entered >= wanted else f"{entered} cells of 0.5 m were entered, {wanted} are wanted"


def _motor_sequence(record: RunRecord, arguments: Table) -> str | None:
    wanted = [tuple(pair) for pair in cast("list[list[int]]", arguments["values"])]
    held_ns = round(_number(arguments, "held_s") * NS_PER_S)
    seen = motor_pairs(record)
    pairs = [pair for _, pair in seen]
    if pairs != wanted:
        return f"the motor pins said {_shown(pairs)}, not {_shown(wanted)}"
    ends = [at for at, _ in seen[1:]] + [record.last_ns]
    for (begin, pair), end in zip(seen, ends, strict=True):
        if end - begin < held_ns:
            return f"{pair} was held {(end - begin) / NS_PER_S:.3f} s, {held_ns / NS_PER_S:g} s are wanted"
    return None


def motor_pairs(record: RunRecord) -> list[tuple[Nanos, tuple[int, int]]]:
    """Return the values of both motors' pins over time; changes within a millisecond are one."""
    left, right = (motor_steps(record.pins, motor) for motor in (1, 2))
    changes = sorted([(at, 0, value) for at, value in left] + [(at, 1, value) for at, value in right])
    result: list[tuple[Nanos, tuple[int, int]]] = []
    values = [0, 0]
    for at, side, value in changes:
        values[side] = value
        if result and at - result[-1][0] < SKEW_NS:
            at = result.pop()[0]  # noqa: PLW2901 - the change began with the first of its edges
        pair = (values[0], values[1])
        if not result or result[-1][1] != pair:
            result.append((at, pair))
    return result


def _usart_contains(record: RunRecord, arguments: Table) -> str | None:
    text = str(arguments["text"])
    return None if text in record.usart_text else f"{text!r} was not printed; {_last_line(record)}"


def _usart_lacks(record: RunRecord, arguments: Table) -> str | None:
    text = str(arguments["text"])
    found = next((at for at, line in record.usart_lines() if text in line), None)
    return None if found is None else f"{text!r} was printed at {_seconds(found)}"


def _usart_in_order(record: RunRecord, arguments: Table) -> str | None:
    place, printed = 0, record.usart_text
    for text in cast("list[str]", arguments["texts"]):
        place = printed.find(text, place)
        if place < 0:
            return f"{text!r} was not printed in its turn; {_last_line(record)}"
        place += len(text)
    return None


_COUNTS = re.compile(r"left=(-?\d+) right=(-?\d+)")


def _encoder_counts_match(record: RunRecord, arguments: Table) -> str | None:
    allowed = int(_number(arguments, "steps", 1))
    width = sum(name.startswith("encoder1_s") for name in record.pins)
    counts = [(at, match) for at, line in record.usart_lines() if (match := _COUNTS.search(line))]
    if not counts or not record.poses:
        return f"no counts were printed; {_last_line(record)}"
    for at, match in counts:
        pose = min(record.poses, key=lambda sample, at=at: abs(sample.t - at))  # type: ignore[misc] # bound at once
        for side, printed, angle in (
            ("left", int(match[1]), pose.left_angle), ("right", int(match[2]), pose.right_angle),
        ):  # fmt: skip
            turned = math.floor(angle * 1e-6 / (2 * math.pi) * (1 << width))
            if abs(printed - turned) > allowed:
                return f"{side} was printed as {printed} at {_seconds(at)}, the wheel had turned {turned} steps"
    return None


_SENSOR = re.compile(r"^sensor (\d+) (on|off)$")


def _sensor_named(record: RunRecord, _arguments: Table) -> str | None:
    """Check each thing that was placed before a sonar against what was printed until the next one."""
    placed = [(int(cast("int", item["t"])), int(cast("int", item["sonar"]))) for item in record.obstacles
              if item.get("op") == "place" and "sonar" in item]  # fmt: skip
    if not placed:
        return "nothing was placed before a sonar"
    first = placed[0][0]
    early = next((line for at, line in record.usart_lines() if at < first and _SENSOR.match(line)), None)
    if early is not None:
        return f"{early!r} was printed before anything was placed"
    ends = [at for at, _ in placed[1:]] + [record.last_ns + 1]
    for (begin, number), end in zip(placed, ends, strict=True):
        said = [line for at, line in record.usart_lines() if begin <= at < end and _SENSOR.match(line)]
        if said != [f"sensor {number} on", f"sensor {number} off"]:
            return f"with something before sonar {number} from {_seconds(begin)} on it printed {said}"
    return None


KINDS: Mapping[str, _Kind] = {
    "no_collision": _Kind((), lambda _: "touches nothing", _no_collision, forbids=True),
    "min_distance": _Kind(
        (
            Key(name="distance_m", kind="number", above=0, most=1e6),
            Key(name="distance_m_a_minute", kind="number", above=0, most=1e6),
        ),
        _wanted_distance,
        _min_distance,
    ),
    "cells": _Kind(
        (Key(name="least", kind="whole", required=True, least=1, most=1_000_000),),
        lambda arguments: f"enters at least {arguments['least']} different cells of 0.5 m",
        _cells,
    ),
    "motor_sequence": _Kind(
        (Key(name="values", kind="list", required=True), Key(name="held_s", kind="number", least=0, most=LONGEST_S)),
        lambda arguments: f"sets the motors to {_shown(arguments['values'])}",
        _motor_sequence,
    ),
    "usart_contains": _Kind(
        (Key(name="text", kind="text", required=True),),
        lambda arguments: f"prints {arguments['text']!r}",
        _usart_contains,
    ),
    "usart_lacks": _Kind(
        (Key(name="text", kind="text", required=True),),
        lambda arguments: f"never prints {arguments['text']!r}",
        _usart_lacks,
        forbids=True,
    ),
    "usart_in_order": _Kind(
        (Key(name="texts", kind="list", required=True),),
        lambda arguments: f"prints in order {', '.join(map(repr, cast('list[str]', arguments['texts'])))}",
        _usart_in_order,
    ),
    "encoder_counts_match": _Kind(
        (Key(name="steps", kind="whole", least=0, most=1_000_000),),
        lambda arguments: f"counts the wheels' turns to {arguments.get('steps', 1)} step",
        _encoder_counts_match,
    ),
    "sensor_named": _Kind((), lambda _: "names the sensor before which something stands, and no other", _sensor_named),
}


def _shown(pairs: object) -> str:
    return " ".join(f"{left:+d}/{right:+d}" for left, right in cast("list[tuple[int, int]]", pairs))


def _last_line(record: RunRecord) -> str:
    lines = record.usart_lines()
    return f"the last line is {lines[-1][1]!r}" if lines else "nothing was printed"


def _seconds(at: Nanos) -> str:
    return f"{at / NS_PER_S:.3f} s"


def _place(pose: PoseSample) -> str:
    return f"x {pose.x / 1e6:.2f} m, y {pose.y / 1e6:.2f} m"
