"""Each kind of goal on small runs whose times, places and values lie on a grid, as its bounds do: at, below, above.

Each run is judged as it comes and, from a state that was saved on the way, by another judge that gets events of every
kind: both have to say the same.
"""

import math
from collections.abc import Iterator, Mapping
from random import Random
from typing import Any

from robot_bench.events.kinds import (
    Clearance,
    Contact,
    Event,
    Note,
    PinEdge,
    Pose,
    Ranges,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.stream import EventStream
from robot_bench.scenario.goals.judging import Goal, GoalJudge, RunEnd, judge, load_goal
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.goals.watch import given_in_words, window_in_words
from simbase.errors import P2osError
from tests.robot_bench.recording.records import S
from tests.robot_bench.scenario.goals.test_goals_on_long_runs import GOALS
from tests.tools.suite.approved import Trace, judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

MS = S // 1000
#: What values of goals are drawn from, by the ends of their names: the grid on which the runs lie.
GRID: Mapping[str, tuple[float, ...]] = {
    "_s": (0.05, 0.1, 0.2, 0.3, 0.5, 1.0), "_m": (0.1, 0.2, 0.3, 0.5, 0.6, 0.7), "_deg": (0.0, 5.0, 20.0, 45.0, 60.0),
    "_mps": (0.0625, 0.125, 0.1875), "_mps2": (1.25, 2.5, 5.0), "_j": (0.5, 1.0, 2.0), "_j_a_metre": (5.0, 10.0),
    "_hz": (500.0, 1000.0, 2000.0), "_duty": (0.25, 0.5, 0.75), "_a_minute": (6.0, 12.0, 30.0),
}  # fmt: skip
SPEEDS = ((3, 3), (3, 3), (2, 3), (-2, 2), (1, -1), (-2, -2), (0, 0), (0, 0), (1, 0))
LINES = ("ready", "go left=1 right=2", "go left=-2 right=2", "stop", "x=0.1 m", "x=0.30 m", "left=1 right=-1 m", "y=3")
#: What needs a run that looks and turns: few of them do.
STEERING = frozenset({"turns_away", "turns_long", "steers_away", "no_idle_turn", "backs_on_path", "turn_ends", "lasts",
                      "has_reason", "answers"})  # fmt: skip
WIRES = ("DD4", "DD5", "rst", *(f"motor{motor}_comm{bit}" for motor in (1, 2) for bit in (1, 2, 3)))
EVERY_KIND = (Clearance, Contact, Note, PinEdge, Pose, Ranges, Text, Wave, WorldChange)
NEAR = (200, 499, 500, 501, 600, 700, 900, 5000)


def numbers(draw: Random, key: str, value: Any) -> Any:  # noqa: PLR0911 - by the kind of key
    """Return another value of a key."""
    if isinstance(value, list):
        if key == "area_m":
            low = [draw.choice((-0.3, 0.0, 0.1)) for _ in range(2)]
            if draw.random() < 0.15:
                return draw.choice(([*low, 1.0], [*low, 1.0, 1.0, 1.0], [*low, True, 1.0], [*low, "1", 1.0]))
            return [*low, *(one + draw.choice((0.2, 0.5, 3.0, 3.0, 0.0, -0.1)) for one in low)]
        return value if draw.random() < 0.8 else value[::-1]
    if isinstance(value, bool | str) or draw.random() < 0.2:
        return value
    if key in {"x_m", "y_m"} and draw.random() < 0.7:
        return draw.choice((0.0, 0.1, 0.2, 0.5))
    for end in sorted(GRID, key=len, reverse=True):
        if key.endswith(end):
            return draw.choice(GRID[end])
    if key in {"least", "most", "tolerance"} and isinstance(value, float | int):
        return draw.choice((value, 0, 1, 2, 0.1, 0.3, -1, 0.0625, 0.5))
    return max(1, value + draw.choice((-1, 0, 0, 1, 2)))


def table_of(draw: Random, kind: str) -> dict[str, Any]:
    """Return a table of a kind: one that is known, with other values, and some keys left out."""
    known = draw.choice(GOALS[kind])
    found = {key.rstrip("_"): numbers(draw, key.rstrip("_"), value) for key, value in known.items()}
    optional = [key for key in found if key.endswith(("to_s", "from_s", "within_s", "row", "most", "way_m", "if_any"))]
    if optional and draw.random() < 0.15:
        del found[draw.choice(optional)]
    if found.get("free_m", 9) < found.get("near_m", 0) and draw.random() < 0.9:
        found["free_m"] = found["near_m"]
    if kind == "turns_long":
        found |= {"least_deg": draw.choice((5, 20, 45, 60)), "row": draw.randint(1, 2)}
    if kind == "motor_sequence":
        found["values"] = [[0, 0], *([one, other] for one, other in draw.sample(SPEEDS, draw.randint(0, 2)))]
    return found | {"ends_run": draw.choice(("met", "missed", "decided"))} if draw.random() < 0.3 else found


def small_run(draw: Random) -> Iterator[Event]:  # noqa: C901, PLR0912 - one kind of event after the other
    """Yield a run of some seconds, in order of time."""
    t, x, y, heading, work, hits = 0, 0.0, 0.0, 0.0, 0, 0
    left = right = 0
    levels = dict.fromkeys(WIRES, 0)
    for wire in WIRES:
        yield PinEdge(t=0, wire=wire, level=False)
    angles, period = [0.0, 0.0], 0
    for _ in range(draw.choice((24, 36, 48))):
        t += draw.choice((0, 50, 50, 100)) * MS
        chance = draw.random()
        if chance < 0.18:
            left, right = draw.choice(SPEEDS)
            for motor, code in ((1, left), (2, right)):
                for bit in range(3):
                    wire, level = f"motor{motor}_comm{bit + 1}", code >> bit & 1
                    if levels[wire] != level:
                        levels[wire] = level
                        yield PinEdge(t=t, wire=wire, level=bool(level))
        elif chance < 0.3:
            wire = draw.choice(("DD4", "DD5", "DD4", "rst"))
            levels[wire] ^= 1
            yield PinEdge(t=t, wire=wire, level=bool(levels[wire]))
        elif chance < 0.4:
            sides = [draw.choice(NEAR), draw.choice((600, 5000)), draw.choice(NEAR)]
            sides = sides[:: draw.choice((1, -1))]
            yield Ranges(t=t, mm=tuple(sides[place // 3] if draw.random() < 0.8 else 900 for place in range(8)))
        elif chance < 0.5:
            yield Text(t=t, data=f"{draw.choice(LINES)}\n".encode())
        elif chance < 0.54:
            hits += 1
            what, part = draw.choice((("'post'", "front"), ("'wall'", ""), ("something", "rear left")))
            yield Contact(t=t, what=what, x_m=x + 0.1, y_m=y, part=part)
        elif chance < 0.57:
            yield Clearance(t=t, um=draw.choice((100_000, 199_999, 200_000, 300_000, 600_000)))
        elif chance < 0.6:
            name, op = draw.choice(("post", "card", "ghost")), draw.choice(("place", "place", "move", "remove"))
            fields = {} if op == "remove" else {"x": 0.1 * draw.randrange(6), "y": 0.0, "sonar": draw.randint(1, 8)}
            yield WorldChange(t=t, op=op, name=name, fields=fields)
        elif chance < 0.63:
            period = draw.choice((0, 500, 1000, 2000))
            yield Wave(t=t, wire="p2dx_con", at=0, period=period, high=period // draw.choice((2, 4)), ticks_hz=10**6)
        elif chance < 0.65:
            yield Note(t=t, who="adapter", what=draw.choice(("driving", "lost")), detail="why")
        is_near_rest = draw.random() < 0.1
        speeds = [side * 0.0625 + (0.001 if is_near_rest else 0.0) for side in (left, right)]
        if chance > 0.4:
            step = draw.choice((0.0, 0.1)) * (left + right > 0) - draw.choice((0.0, 0.1)) * (left + right < 0)
            x, y = x + step * (draw.random() < 0.8), y + step * (draw.random() < 0.3)
            heading += math.radians(5) * draw.choice((0, 1, 4, 9)) * (right - left) / 3
            work += 250_000 * (abs(left) + abs(right) > 0)
            angles = [angle + draw.choice((0.0, 0.125, 0.25)) * math.tau * side for angle, side in
                      zip(angles, (left, right), strict=True)]  # fmt: skip
            yield Pose(
                t=t, x=round(x * 1e6), y=round(y * 1e6), z=0, heading=round(heading * 1e6), pitch=0,
                left=round(speeds[0] * 1e6), right=round(speeds[1] * 1e6), left_angle=round(angles[0] * 1e6),
                right_angle=round(angles[1] * 1e6), collisions=hits, work=work,
            )  # fmt: skip


def judged(goal: Goal, run: list[Event], draw: Random) -> Iterator[str]:
    """Say when a goal is decided, and what becomes of it, by a judge and by one that goes on from a saved state."""
    first, second = GoalJudge([goal]), GoalJudge([goal])
    second._watches[0].kinds = EVERY_KIND  # what a watch did not ask for it passes over
    cut, saved, end = draw.randrange(len(run)), draw.randrange(len(run)), run[-1].t + draw.choice((0, 50, 500)) * MS
    reported = ""
    for place, event in enumerate(run):
        first.feed([event])
        if place + 1 == len(run) or run[place + 1].t > event.t:
            first.advance_to(event.t)
        if place == min(cut, saved):
            second.restore(first.snapshot())
        elif place > min(cut, saved):
            second.feed([event])
            if place + 1 == len(run) or run[place + 1].t > event.t:
                second.advance_to(event.t)
        if not reported and (found := first._decided[0]) is not None:
            reported = f"{event.t // MS} {found.met} {found.says!r} {said(found.robustness)} {found.unit}"
    for one in (first, second):
        one.advance_to(end)
    planned = draw.choice((0, end, end + S))
    (at_end,), (other,) = first.at_end(RunEnd(end, planned)), second.at_end(RunEnd(end, planned))
    if at_end != other:
        yield f"by a saved state: {said(other)}"
    outcome = at_end.outcome
    judged = f"{outcome.met} {outcome.says!r} {said(outcome.robustness)} {outcome.unit} {at_end.is_open}"
    yield f"  {reported or '-'} | {judged}"
    found = first.missed, first.margins(end), first.finish(RunEnd(end, planned))
    yield f"  {first.has_ended_run} {' '.join(map(said, found))}"


def kinds(draw: Random) -> Iterator[str]:
    """Judge small runs by goals of each kind."""
    runs = [[*small_run(draw)] for _ in range(40)]
    for kind in every_kind():
        for _ in range(60 if kind in STEERING else 24):
            table = table_of(draw, kind)
            try:
                goal = load_goal({"kind": kind, **table}, "mine.toml")
            except P2osError as error:
                yield f"{kind} {table}: {refusal(error)}"
                continue
            yield f"{kind} {table}: {goal.wanted}"
            yield from judged(goal, draw.choice(runs), draw)


def published(draw: Random, goals: list[Goal], run: list[Event]) -> Iterator[str]:
    """Judge a run by its stream: what is published when, which verdict ends it, and by a judge that comes later."""
    stream, found = EventStream(), GoalJudge(goals, can_tell_world=draw.random() < 0.7)
    seen, ended = list[Verdict](), list[int]()
    found.subscribe(stream)
    stream.subscribe(seen.append, Verdict)
    found.on_end = lambda: ended.append(stream.released_until)
    last = run[-1].t + draw.choice((0, 500)) * MS
    end = RunEnd(last, draw.choice((0, last, last + S)), by_scenario=draw.random() < 0.3)
    for place, limit in enumerate((last // 3, last // 2, last)):
        for event in run:
            if stream.released_until < event.t <= limit:
                stream.publish(event)
        if place == 1:
            found.end_at(end)
        stream.release(limit)
        yield said([limit, seen, ended, found.has_ended_run, found.missed])
        seen.clear()
    others = goals[1:] if draw.random() < 0.5 else goals
    later = GoalJudge(others)
    later.restore(GoalJudge(goals).snapshot())
    yield said([later.is_behind, len(found.goals), found.margins(last), found.finish(end)])
    later.subscribe(stream)
    later.catch_up(run, last)
    yield said([later.is_behind, later.has_ended_run, later.finish(end), stream.pending()])
    for wrong in (None, 3, {"goals": ()}):
        yield tried(later.restore, wrong)


def together(draw: Random) -> Iterator[str]:
    """Judge runs by several goals at once, excused ones among them, as reports do."""
    for _ in range(12):
        goals = []
        for kind in draw.sample([*every_kind()], 6):
            table = {"kind": kind, **table_of(draw, kind)}
            if draw.random() < 0.4:
                table |= draw.choice(({"excused": True}, {"excused_by": ["post"]}))
            try:
                goals.append(load_goal(table, "mine.toml"))
            except P2osError as error:
                yield refusal(error)
        run = [*small_run(draw)]
        yield from published(draw, goals, run)
        for planned in (0, run[-1].t + S):
            for can_tell in (True, False):
                yield said(judge(run, goals, end_ns=run[-1].t, planned_ns=planned, can_tell_world=can_tell))
    yield said([given_in_words((" a ", 1.5, " s"), (" b ", None, " s")), window_in_words("x", from_s=1, within_s=2)])


TRACES: dict[str, Trace] = {"kinds": kinds, "together": together, "declared": declared_of("robot_bench.scenario.goals")}
test_what_goals_say_of_small_runs_is_what_was_approved = judge_of(__file__, TRACES)
