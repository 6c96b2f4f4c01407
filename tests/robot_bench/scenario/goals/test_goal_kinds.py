"""Each kind of goal that watches motion, wires and events: one tick before, at and after its bound."""

import json
import runpy
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import ScenarioError
from p2os.toml_record import Record
from p2os.toml_schema import Key
from robot_bench.cli.names import setting_keys
from robot_bench.events.kinds import Clearance, Contact, Event, Fault, Note, PinEdge, Pose, Ranges, Text, Wave
from robot_bench.scenario.goals.judging import GoalJudge, RunEnd, judge, load_goal
from robot_bench.scenario.goals.kinds import KINDS, every_kind
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, Watch
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError
from tests.robot_bench.recording.records import S, pose

ROOT = Path(__file__).resolve().parents[4]
MS = 10**6
UM = 1_000_000


def outcome(kind: str, run: Sequence[Event], end: int = 10 * S, **arguments: Any) -> GoalOutcome:
    """Return what a goal says of a run.

    It must say the same where it was saved and restored between any two events, and never otherwise than it has once
    decided.
    """
    goal = load_goal(
        {"kind": kind, **{key.rstrip("_"): value for key, value in arguments.items()}}, "mine.toml: [[goal]] 1"
    )
    assert goal.wanted
    found = []
    for is_saved in (False, True):
        judge = GoalJudge([goal])
        for event in sorted(run, key=lambda event: event.t):
            judge.feed([event])
            if is_saved:
                fresh = GoalJudge([goal])
                fresh.restore(judge.snapshot())
                judge = fresh
        judge.advance_to(end)
        (said,), (decided,) = judge.at_end(RunEnd(end)), judge._decided
        assert decided is None or decided.met == said.outcome.met
        assert not said.is_open
        found.append(said.outcome)
    assert found[0] == found[1]
    return found[0]


def at(t: int, x_m: float = 0.0, y_m: float = 0.0, *, left: float = 0.0, right: float = 0.0, deg: float = 0.0) -> Pose:
    heading = round(deg / 180 * 3.141592653589793 * UM)
    return replace(
        pose(t, round(x_m * UM), round(y_m * UM)), left=round(left * UM), right=round(right * UM), heading=heading
    )


def edges(wire: str, *levels: tuple[int, int]) -> list[Event]:
    return [PinEdge(t=t, wire=wire, level=bool(level)) for t, level in levels]


def printed(*lines: tuple[int, str]) -> list[Event]:
    return [Text(t=t, data=line.encode() + b"\n") for t, line in lines]


def test_every_kind_of_goal_is_tried() -> None:
    from tests.robot_bench.scenario.goals import test_goals, test_goals_on_answers, test_goals_on_steering

    tests = [*globals(), *vars(test_goals), *vars(test_goals_on_steering), *vars(test_goals_on_answers)]
    names = " ".join(name for name in tests if name.startswith("test_goal_"))
    missing = [kind for kind in every_kind() if kind not in names]
    assert missing == [], "write test_goal_KIND_... in tests/robot_bench/scenario/goals/test_goals.py"


@pytest.mark.parametrize(("t", "met"), [(2 * S - 1, True), (2 * S, True), (2 * S + 1, False)])
def test_goal_reach_in_time(t: int, met: bool) -> None:
    found = outcome("reach", [at(0), at(t, 1.0)], x_m=1.2, y_m=0, radius_m=0.2, within_s=2)
    assert (found.met, found.unit) == (met, "s")
    assert found.robustness == pytest.approx((2 * S - t) / S)


@pytest.mark.parametrize(("x_m", "met"), [(0.999999, False), (1.0, True)])
def test_goal_reach_of_a_place(x_m: float, met: bool) -> None:
    found = outcome("reach", [at(0), at(S, x_m)], area_m=[1, -1, 2, 1])
    assert found.met is met
    assert found.robustness == pytest.approx(x_m - 1)
    assert met or found.says == "it was not reached by 10.000 s, and came to 0.00 m of it"


@pytest.mark.parametrize(("x_m", "met"), [(0.5, True), (0.500001, False)])
def test_goal_avoid_and_goal_stay_within(x_m: float, met: bool) -> None:
    run = [at(0), at(S, x_m), at(2 * S)]
    assert outcome("avoid", run, x_m=1, y_m=0, radius_m=0.5).met is met
    found = outcome("stay_within", run, area_m=[-1, -1, 0.5, 1])
    assert found.met is met
    assert found.robustness == pytest.approx(0.5 - x_m)
    assert met or found.says == "it was left at 1.000 s, x 0.50 m, y 0.00 m, by 0.00 m at most"


@pytest.mark.parametrize(("um", "met"), [(200_000, True), (199_999, False)])
def test_goal_clearance(um: int, met: bool) -> None:
    found = outcome("clearance", [Clearance(t=0, um=900_000), Clearance(t=S, um=um)], least_m=0.2)
    assert (found.met, found.robustness) == (met, pytest.approx((um - 200_000) / UM))


def test_what_is_as_near_as_it_may_be_decides_nothing() -> None:
    """What comes nearer later is missed, and as far as it came at first below the limit."""
    seen = [Clearance(t=t * S, um=um) for t, um in enumerate((900_000, 200_000, 150_000, 100_000))]
    assert outcome("clearance", seen[:2], least_m=0.2).met
    found = outcome("clearance", seen, least_m=0.2)
    assert (found.met, found.robustness) == (False, pytest.approx(-0.1))


def worked(*rows: tuple[int, float, float]) -> list[Event]:
    """Return poses: (time, x in metres, joules so far)."""
    return [pose(t, round(x_m * UM), work=round(joules * UM)) for t, x_m, joules in rows]


@pytest.mark.parametrize(("joules", "met"), [(2.0, True), (2.000001, False)])
def test_goal_energy_of_a_run(joules: float, met: bool) -> None:
    found = outcome("energy", worked((0, 0, 0), (S, 0.5, 0.5), (2 * S, 1, joules), (4 * S, 2, joules + 0)), most_j=2)
    assert (found.met, found.unit) == (met, "J")
    assert found.robustness == pytest.approx(2 - joules)
    assert met or found.says == (
        "more than 2 J from 2.000 s, x 1.00 m, y 0.00 m, on; 2.000 J for 2.00 m, 1.000 J a metre, "
        "most at 2.000 s, x 1.00 m, y 0.00 m: 1.50 W"
    )


@pytest.mark.parametrize(("x_m", "met"), [(2.0, True), (1.999999, False)])
def test_goal_energy_of_a_metre(x_m: float, met: bool) -> None:
    found = outcome("energy", worked((0, 0, 0), (S, 1, 2), (2 * S, x_m, 3)), most_j_a_metre=1.5, most_j=9)
    assert found.met is met
    assert found.robustness == pytest.approx(1.5 * x_m - 3)
    assert met or found.says.endswith("2.00 W; 1.5 J a metre are allowed")


def test_goal_energy_of_a_robot_that_stands_or_spins_its_wheels() -> None:
    assert outcome("energy", worked((0, 0, 0), (S, 0, 0)), most_j_a_metre=1).met
    assert not outcome("energy", worked((0, 0, 0), (S, 0, 0.1)), most_j_a_metre=1).met
    assert outcome("energy", [at(0), at(S)], most_j=1).says == "the run does not tell the work at the rims"
    assert outcome("energy", [], most_j=1).met is False


def test_goal_energy_wants_a_bound() -> None:
    with pytest.raises(ScenarioError, match="a goal energy needs most_j or most_j_a_metre"):
        outcome("energy", [])


@pytest.mark.parametrize(("t", "met"), [(1500 * MS, True), (1500 * MS + 1, False)])
def test_goal_stop_within_a_time(t: int, met: bool) -> None:
    run = [at(0, left=0.2, right=0.2), Fault(t=S, op="inject", words="link-down"), at(t, 0.05)]
    found = outcome("stop_within", run, after="fault link", within_s=0.5)
    assert found.met is met
    assert found.robustness == pytest.approx((1500 * MS - t) / S)


@pytest.mark.parametrize(("x_m", "met"), [(0.3, True), (0.300001, False)])
def test_goal_stop_within_a_way(x_m: float, met: bool) -> None:
    run = [at(0, left=0.2), Fault(t=S, op="inject", words="link-down"), at(S + 1, 0.1, left=0.2), at(2 * S, x_m)]
    found = outcome("stop_within", run, after="fault", within_s=2, way_m=0.3)
    assert found.met is met
    assert met or found.says == "after 'fault' at 1.000 s it stood after 1.000 s and 0.300 m, 2 s and 0.3 m are allowed"
    assert outcome("stop_within", [at(0)], after="fault", within_s=2).says == "'fault' did not happen"


@pytest.mark.parametrize(("deg", "met"), [(-179, True), (-174, True), (-173.9, False), (170, True), (169, False)])
def test_goal_hold_heading_goes_the_short_way(deg: float, met: bool) -> None:
    assert outcome("hold_heading", [at(0, deg=178), at(S, deg=deg)], heading_deg=178, tolerance_deg=8).met is met


@pytest.mark.parametrize(("t", "met"), [(S - 1, True), (S, False), (2 * S, False), (2 * S + 1, True)])
def test_goal_hold_speed_within_its_window(t: int, met: bool) -> None:
    run = [at(0), at(t, left=0.5, right=0.5), at(3 * S)]
    found = outcome("hold_speed", run, speed_mps=0, tolerance_mps=0.1, from_s=1, to_s=2)
    assert found.met is met
    assert met or found.says.startswith(f"speed_mps was out of bounds by 0.4 m/s at {t / S:.3f} s")


@pytest.mark.parametrize(("t", "met"), [(5 * S - 1, True), (5 * S, True), (5 * S + 1, False)])
def test_goal_moves_on_counts_from_the_place_where_it_was_so_far_away_last(t: int, met: bool) -> None:
    run = [at(0), at(2 * S, 0.29), at(3 * S, 0.3), at(3 * S + t, 0.3, 0.3), at(9 * S, 0.9, 0.3)]
    found = outcome("moves_on", run, way_m=0.3, within_s=5)
    assert (found.met, found.robustness) == (met, (5 * S - t) / S)
    assert met or found.says == ("it did not get 0.3 m away from x 0.30 m, y 0.00 m where it was at 3.000 s within 5 s")


def test_goal_moves_on_begins_where_it_is_told_to() -> None:
    run = [at(0), at(6 * S), at(7 * S, 0.5), at(10 * S, 0.9)]
    assert not outcome("moves_on", run, way_m=0.3, within_s=5).met
    assert outcome("moves_on", run, way_m=0.3, within_s=5, from_s=6).met


def ranges(t: int, ahead_m: float, aside_m: float = 0.3) -> Ranges:
    return Ranges(t=t, mm=tuple(round(1000 * one) for one in (aside_m, aside_m, *[ahead_m] * 4, aside_m, aside_m)))


@pytest.mark.parametrize(("t", "met"), [(5 * S - 1, True), (5 * S, True), (5 * S + 1, False)])
def test_goal_moves_on_counts_from_where_free_floor_was_seen(t: int, met: bool) -> None:
    run = [at(0), ranges(S - 400 * MS, 1.201), at(S), ranges(S + 1, 0.4), at(S + t), at(9 * S, 0.9)]
    assert outcome("moves_on", run, way_m=0.3, within_s=9, free_m=1.2).met
    found = outcome("moves_on", run[:-1], end=S + t, way_m=0.3, within_s=5, free_m=1.2)
    assert (found.met, found.robustness) == (met, (5 * S - t) / S)
    assert met or found.says.endswith("within 5 s, having seen 1.2 m of free floor")


def test_goal_moves_on_does_not_hurry_who_sees_no_free_floor() -> None:
    shut = [at(0), ranges(S, 1.2), at(2 * S), at(9 * S)]  # as far as that, and no farther
    assert outcome("moves_on", shut, way_m=0.3, within_s=5, free_m=1.2).met
    not_heard_yet = [at(0), ranges(S, 5.0), at(S + 400 * MS - 1), ranges(S + 400 * MS - 1, 0.5), at(9 * S)]
    assert outcome("moves_on", not_heard_yet, way_m=0.3, within_s=5, free_m=1.2).met
    one_side = [at(0), Ranges(t=S, mm=(300, 300, 1300, 1300, 1300, 1200, 300, 300)), at(2 * S), at(9 * S)]
    assert outcome("moves_on", one_side, way_m=0.3, within_s=5, free_m=1.2).met
    assert not outcome("moves_on", one_side, way_m=0.3, within_s=5, free_m=1.2, ahead=[3, 4, 5]).met
    another_place = [at(0), ranges(S, 3.0), at(2 * S), ranges(3 * S, 0.5), at(4 * S, 0.5), at(10 * S, 0.5)]
    assert outcome("moves_on", another_place, way_m=0.3, within_s=5, free_m=1.2).met


def test_goal_smooth() -> None:
    run = [at(0), at(50 * MS, left=0.02, right=-0.02), at(100 * MS, left=0.02, right=0.01)]
    assert outcome("smooth", run, most_mps2=0.6).met
    found = outcome("smooth", run, most_mps2=0.59)
    assert (found.met, found.says) == (False, "0.60 m/s² at 0.100 s, 0.59 m/s² are allowed")


samples = st.lists(
    st.tuples(st.integers(0, 40), st.integers(-20, 20)), min_size=1, max_size=12, unique_by=lambda s: s[0]
)


@given(samples, st.integers(0, 20), st.integers(1, 30), st.integers(-10, 10))
def test_goal_always_and_goal_eventually_are_the_least_and_greatest_margin(
    rows: list[tuple[int, int]], start: int, length: int, least: int
) -> None:
    run = [at(t * S, float(x)) for t, x in sorted(rows)]
    window = {"from_s": start, "to_s": start + length}
    inside = [x - least for t, x in rows if start <= t <= start + length]
    always = outcome("always", run, signal="x_m", least=least, end=50 * S, **window)
    eventually = outcome("eventually", run, signal="x_m", least=least, end=50 * S, **window)
    assert always.met is (min(inside, default=0) >= 0)
    assert eventually.met is (max(inside, default=-1) >= 0)
    assert always.robustness == min(inside, default=None)
    if not eventually.met or not inside:
        assert eventually.robustness == max(inside, default=None)
    negated = outcome("eventually", run, signal="x_m", most=least, end=50 * S, **window)
    if inside and not negated.met:
        assert always.robustness == -negated.robustness  # type: ignore[operator] # always p is not eventually not p


def test_goal_always_after_an_event_looks_at_each_occurrence() -> None:
    reported = [Note(t=t * S, who="adapter", what="driving") for t in (1, 5)]
    run = [*reported, at(S, left=1.0), at(2 * S), at(5 * S), at(6 * S, left=0.3)]
    ends = {"signal": "left_mps", "most": 0.2, "after": "note adapter driving", "from_s": 0.5, "to_s": 1}
    found = outcome("always", run, **ends)
    assert (found.met, found.robustness) == (False, pytest.approx(-0.1))
    assert found.says == "left_mps was out of bounds by 0.1 m/s at 6.000 s after 'note adapter driving' at 5.000 s"
    assert outcome("always", run[:-1], **ends).met
    assert outcome("always", [at(0)], **ends).says == "'note adapter driving' did not happen"
    fast = outcome("eventually", run, signal="left_mps", least=0.3, after="note adapter driving", from_s=0.5, to_s=1)
    assert (fast.met, fast.robustness) == (False, pytest.approx(-0.3))


@pytest.mark.parametrize(("t", "met"), [(2 * S, True), (2 * S + 1, False)])
def test_goal_happens_in_time(t: int, met: bool) -> None:
    found = outcome("happens", printed((S, "booting"), (t, "ready 7")), event=r"usart1 matches ^ready \d$", within_s=2)
    assert found.met is met
    assert found.says == ("1 time(s), first at 2.000 s" if met else
                          r"'usart1 matches ^ready \\d$' happened 0 time(s) by 2 s, 1 at least")  # fmt: skip


@pytest.mark.parametrize(("count", "met"), [(1, False), (2, True), (3, True), (4, False)])
def test_goal_happens_so_often(count: int, met: bool) -> None:
    run = [Contact(t=n * S, what="'crate'", x_m=0, y_m=0) for n in range(count)]
    assert outcome("happens", run, event="contact crate", least=2, most=3).met is met
    assert outcome("happens", run, event="contact cat", least=0, most=0).met


@pytest.mark.parametrize(("t", "met"), [(S - 1, True), (S, False)])
def test_goal_never(t: int, met: bool) -> None:
    found = outcome("never", edges("p2dx_con", (0, 1), (t, 0)), event="pin PB12 low", from_s=1)
    assert found.met is met
    assert met or found.says == "'pin PB12 low' happened 1 time(s), first at 1.000 s"


def test_goal_in_order() -> None:
    wanted = ["pin PB12 high", "note adapter driving", "robot moves"]
    run = [*edges("p2dx_con", (0, 0), (S, 1)), Note(t=2 * S, who="adapter", what="driving"), at(0), at(3 * S, left=0.1)]
    assert outcome("in_order", run, events=wanted).met
    found = outcome("in_order", run, events=wanted[::-1])
    assert found.says == "'note adapter driving' did not happen after 'robot moves' at 3.000 s"


@pytest.mark.parametrize(("t", "met"), [(S + 5 * MS - 1, True), (S + 5 * MS, True), (S + 5 * MS + 1, False)])
def test_goal_latency(t: int, met: bool) -> None:
    run = [*edges("DD3", (0, 0), (S, 1)), *edges("motor1_comm1", (0, 0), (t, 1))]
    found = outcome("latency", run, from_="pin DD3 high", to="pin PB7 changes", most_s=0.005)
    assert found.met is met
    if met:
        assert found.robustness == pytest.approx((S + 5 * MS - t) / S)
    never = outcome("latency", run[:2], from_="pin DD3 high", to="pin PB7 changes", most_s=0.005)
    assert never.says == "'pin PB7 changes' did not follow 'pin DD3 high' at 1.000 s, 0.005 s are allowed"


@pytest.mark.parametrize(
    ("end", "says"),
    [
        (S + 5 * MS - 1, "'pin PB7 changes' did not happen"),
        (S + 5 * MS, "'pin PB7 changes' did not follow 'pin DD3 high' at 1.000 s, 0.005 s are allowed"),
    ],
)
def test_goal_latency_is_open_until_its_last_instant(end: int, says: str) -> None:
    run = edges("DD3", (0, 0), (S, 1))
    assert outcome("latency", run, end, from_="pin DD3 high", to="pin PB7 changes", most_s=0.005).says == says


@pytest.mark.parametrize(
    ("levels", "failed_at"),
    [
        ([(0, 1), (2 * S + 1, 0)], None), ([(0, 1), (2 * S, 0)], "2.000"), ([(0, 0), (S, 1)], None),
        ([(0, 0), (S + 1, 1)], "1.000"), ([(0, 0)], "1.000"), ([(0, 1), (S - 1, 0), (S, 1)], None),
    ],
)  # fmt: skip
def test_goal_pin_holds(levels: list[tuple[int, int]], failed_at: str | None) -> None:
    found = outcome("pin_holds", edges("p2dx_con", *levels), pin="PB12", level="high", from_s=1, to_s=2)
    assert found.met is (failed_at is None)
    assert found.met or found.says == f"PB12 was low at {failed_at} s"


@pytest.mark.parametrize(("high_ms", "met"), [(1, True), (2, True), (3, False)])
def test_goal_wave_by_edges_and_goal_wave_by_wave(high_ms: int, met: bool) -> None:
    rows = [(0, 0)] + [(n * 10 * MS + d * MS, level) for n in range(1, 4) for d, level in ((0, 1), (high_ms, 0))]
    bounds = {"pin": "PB7", "least_hz": 99, "most_hz": 101, "least_duty": 0.05, "most_duty": 0.2}
    found = outcome("wave", edges("motor1_comm1", *rows), periods=2, **bounds)
    assert found.met is met
    assert met or found.says == "PB7 had 100 Hz and 30.0% duty in the period up to 0.020 s"
    wave = Wave(t=5, wire="motor1_comm1", at=0, period=10_000, high=high_ms * 1000, ticks_hz=1_000_000)
    assert outcome("wave", [wave], **bounds).met is met
    assert not outcome("wave", [wave], pin="PB7", most_duty=0).met, "a bound of 0 is one"
    few = outcome("wave", edges("motor1_comm1", *rows), periods=3, pin="PB7")
    assert few.says == "PB7 had 2 whole periods, 3 are wanted"


def test_a_sonar_a_stop_and_a_place_are_events_once() -> None:
    ranges = [Ranges(t=t * S, mm=(3000, mm)) for t, mm in enumerate((900, 399, 300, 500, 399))]
    assert outcome("happens", ranges, event="sonar 2 below 0.4", least=2, most=2).met
    run = [at(0), at(S, 1, left=0.1), at(2 * S, 2, left=0.1), at(3 * S, 1)]
    assert outcome("happens", run, event="robot stops", least=1, most=1).met
    assert outcome("happens", run, event="robot near 1 0 0.1", least=2, most=2).met


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "reech"}, "there is no goal 'reech' .*did you mean 'reach'"),
        ({"kind": "happens", "event": "pin PB99 high"}, "there is no wire 'PB99'"),
        ({"kind": "happens", "event": "pin PB12 up"}, "not understood: a pin, and high, low or changes"),
        ({"kind": "happens", "event": "uzart1 sends x"}, "no events 'uzart1 sends x' .*did you mean 'usart1'"),
        ({"kind": "happens", "event": "usart1 matches ("}, "not understood: missing"),
        ({"kind": "in_order", "events": []}, "events is empty"),
        ({"kind": "in_order", "events": [1]}, "events must be a list of texts in quotes"),
        ({"kind": "usart_contains", "text": ""}, "text is empty"),
        ({"kind": "turns_away", "near_m": 1, "free_m": 2, "left": []}, "left is empty"),
        ({"kind": "avoid"}, "a goal avoid needs area_m or radius_m"),
        ({"kind": "reach", "within_s": 1}, "a goal reach needs area_m or radius_m"),
        ({"kind": "stay_within"}, "a goal stay_within needs area_m or radius_m"),
        ({"kind": "min_distance"}, "a goal min_distance needs distance_m or distance_m_a_minute"),
        ({"kind": "latency", "from": "contact", "to": "contact", "most_s": 1, "least_s": 2}, "least_s is above most_s"),
        ({"kind": "wave", "pin": "PB7", "least_hz": 2, "most_hz": 1}, "least_hz is above most_hz"),
        ({"kind": "happens", "event": "contact", "least": 2, "most": 1}, "least is above most"),
        ({"kind": "happens", "event": "contact", "most": 0}, "least is 1 where it is not given"),
        ({"kind": "pin_holds", "pin": "PB7", "level": "low", "from_s": 2, "to_s": 1}, "to_s lies before from_s"),
        ({"kind": "happens", "event": "robot near 1 0 0"}, "0 m are never come to"),
        ({"kind": "happens", "event": "robot near 1 nan 1"}, "nan is no number of metres"),
        ({"kind": "happens", "event": "robot within 0 1 2 0"}, "least x and y, then the greatest"),
        ({"kind": "happens", "event": "robot drives -1"}, "-1 m are never come to"),
        ({"kind": "happens", "event": "sonar 1 below 0"}, "0 m are never come to"),
        ({"kind": "reach", "radius_m": 1}, "a circle needs x_m, y_m and radius_m"),
        ({"kind": "avoid", "area_m": [0, 0, 0, 1]}, "area_m must be"),
        ({"kind": "avoid", "area_m": [0, 0, 1, 1], "x_m": 1}, "and stand alone"),
        ({"kind": "usart_in_order", "texts": [1]}, "texts must be a list of texts in quotes"),
        ({"kind": "motor_sequence", "values": [[0, 200]]}, "values must be pairs of motor values"),
        ({"kind": "no_collision", "ends_run": "soon"}, "is none of met, missed, decided"),
        ({"kind": "wave", "pin": "PB7", "hz": 3}, "unknown key 'hz'"),
    ],
)
def test_a_wrong_goal_is_refused_with_a_hint(table: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        load_goal(table, "mine.toml: [[goal]] 1")
    import re

    assert re.search(message, f"{refused.value} ({refused.value.hint})")
    assert str(refused.value).startswith("mine.toml: [[goal]] 1")


def test_a_goal_that_came_from_elsewhere_is_judged_like_any(monkeypatch: pytest.MonkeyPatch) -> None:
    from robot_bench.scenario.goals import kinds

    class Point:
        value = "mine:goal"

        @staticmethod
        def load() -> object:
            return KINDS["no_collision"]

    monkeypatch.setattr(kinds, "_entry_points", lambda: {"untouched": Point})
    assert load_goal({"kind": "untouched"}, "x").wanted == "touches nothing"
    assert load_goal({"kind": "untouched"}, "x").kind == "untouched"
    monkeypatch.setattr(Point, "load", staticmethod(lambda: 7))
    with pytest.raises(ScenarioError, match="mine:goal is no GoalKind"):
        load_goal({"kind": "untouched"}, "x")


class NamesakesTable(Record):
    """Keys that mean something else in goals of the bench."""

    x_m: Annotated[float, Key(doc="no centre")]
    area_m: Annotated[float, Key(doc="no corners")]
    values: Annotated[tuple[int, ...], Key(doc="no motor values")]
    texts: Annotated[str, Key(doc="no list")]
    events: Annotated[tuple[int, ...], Key(doc="no words")]


def test_keys_of_a_goal_from_elsewhere_mean_what_its_package_says(monkeypatch: pytest.MonkeyPatch) -> None:
    from robot_bench.scenario.goals import kinds

    own = GoalKind(NamesakesTable, str, lambda _: KINDS["no_collision"].watch(None))
    monkeypatch.setattr(kinds, "_entry_points", lambda: {"own": SimpleNamespace(load=lambda: own)})
    table = {"kind": "own", "x_m": 1, "area_m": 2.5, "values": [1], "texts": "a", "events": [3]}
    assert load_goal(table, "x").table == NamesakesTable(x_m=1, area_m=2.5, values=(1,), texts="a", events=(3,))


@pytest.mark.parametrize(
    ("keys", "says"),
    [({}, "a goal always needs least or most"), ({"least": 2, "most": 1}, "least is above most"),
     ({"least": 1, "from_s": 2, "to_s": 1.999_999_999}, "to_s lies before from_s")],
)  # fmt: skip
def test_a_goal_that_any_run_or_none_would_meet_is_refused(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        load_goal({"kind": "always", "signal": "x_m", **keys}, "mine.toml: [[goal]] 1")
    load_goal({"kind": "always", "signal": "x_m", "least": 1, "most": 1, "from_s": 2, "to_s": 2}, "at the bound")


def test_goals_that_know_a_shipped_program_come_by_entry_points_and_are_in_the_schema(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from robot_bench.scenario.goals import kinds
    from robot_bench.scenario.json_schema import scenario_schema

    plugged = {"encoder_counts_match", "sensor_named"}
    assert plugged <= set(every_kind()) - set(KINDS)
    named = {goal["properties"]["kind"]["const"] for goal in scenario_schema()["properties"]["goal"]["items"]["oneOf"]}
    assert named == set(every_kind())
    monkeypatch.setattr(kinds, "_entry_points", dict)
    assert set(every_kind()) == set(KINDS)
    with pytest.raises(ScenarioError, match="there is no goal 'sensor_named'"):
        load_goal({"kind": "sensor_named"}, "x")


class TiltTable(Record):
    most_deg: Annotated[float, Key(above=0, most=90, doc="it leans no further ([why](x.md))")]
    axis: Annotated[Literal["roll", "pitch"], Key(doc="about which")] = "roll"
    samples: Annotated[int, Key(least=1, most=100, doc="in so many poses")] = 5

    def __post_init__(self) -> None:
        if self.axis == "pitch" and self.samples > 50:
            raise UsageError("so many samples of the pitch there are not")


class Tilt(Watch):
    def __init__(self, table: TiltTable) -> None:
        self.table = table

    def finish(self, end: int) -> GoalOutcome:
        return GoalOutcome(met=self.table.most_deg > 10 and end > 0)


@pytest.fixture
def tilt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a package installed that offers a kind of goal of its own, with parameters."""
    from robot_bench.scenario.goals import kinds

    class Point:
        value = "mine:GOAL"

        @staticmethod
        def load() -> object:
            return GoalKind(
                TiltTable, lambda table: f"leans {table.most_deg:g}° at most", Tilt, doc="it never leans more"
            )

    monkeypatch.setattr(kinds, "_entry_points", lambda: {"tilt": Point})


@pytest.mark.usefixtures("tilt")
def test_one_declaration_of_a_plug_in_gives_reader_schema_page_and_completion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from p2os.cli.main import run as p2os

    text = 'extends = "dodge"\n[[goal]]\nkind = "tilt"\nmost_deg = 12\n'
    (tmp_path / "mine.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    goal = load_scenario("mine.toml").goals[0]
    assert (goal.table, goal.wanted) == (TiltTable(most_deg=12.0), "leans 12° at most")
    assert judge([], [goal], end_ns=1).met == ["leans 12° at most"]

    assert p2os(["check", "--schema"]) == 0
    goals = json.loads(capsys.readouterr().out)["properties"]["goal"]["items"]["oneOf"]
    schema = next(one for one in goals if one["properties"]["kind"] == {"const": "tilt"})
    assert schema["required"] == ["kind", "most_deg"]
    own = {key: schema["properties"][key] for key in ("most_deg", "axis", "samples")}
    assert own == {
        "most_deg": {
            "description": "it leans no further (why)", "type": "number", "exclusiveMinimum": 0, "maximum": 90,
        },
        "axis": {"description": "about which", "default": "roll", "type": "string", "enum": ["roll", "pitch"]},
        "samples": {
            "description": "in so many poses", "default": 5, "type": "integer", "minimum": 1, "maximum": 100,
        },
    }  # fmt: skip

    page = runpy.run_path(str(ROOT / "tools" / "generators" / "ranges.py"))["tables"]()["goals"]
    row = "| `tilt` | **`most_deg`** (above 0 to 90), `axis` = `roll` (`roll`, `pitch`), `samples` = 5 (1 to 100) |"
    assert f"{row} it never leans more |" in page.splitlines()

    context = SimpleNamespace(params={"scenario": "mine.toml"}, args=[])
    assert [one for one, _ in setting_keys(context, "goal.1.")] == [  # type: ignore[arg-type] # all that it looks at
        *(f"goal.1.kind={name}" for name in every_kind()), "goal.1.ends_run=met", "goal.1.ends_run=missed",
        "goal.1.ends_run=decided", "goal.1.excused_by=", "goal.1.excused=true", "goal.1.excused=false",
        "goal.1.most_deg=", "goal.1.axis=roll", "goal.1.axis=pitch",
        "goal.1.samples=",
    ]  # fmt: skip


@pytest.mark.usefixtures("tilt")
@pytest.mark.parametrize(
    ("line", "says", "hint"),
    [
        (
            "most_deg = 0",
            "4: [[goal]] 1: most_deg = 0 is out of range",
            "it is a number of degrees above 0, at most 90",
        ),
        ("most_deg = 90.1", "4: [[goal]] 1: most_deg = 90.1 is out of range", "at most 90"),
        ('most_deg = "9 deg"', '4: [[goal]] 1: most_deg = "9 deg" is not a number of degrees', "write the bare number"),
        ("most_dog = 9", "4: [[goal]] 1: unknown key 'most_dog'", "did you mean 'most_deg'?"),
        ("samples = 9", "2: [[goal]] 1: key 'most_deg' is missing", "a number of degrees"),
        ('most_deg = 9\naxis = "yaw"', '5: [[goal]] 1: axis = "yaw" is none of roll, pitch', ""),
        ('most_deg = 9\naxis = "pitch"\nsamples = 51', "2: [[goal]] 1: so many samples of the pitch there are not", ""),
    ],
)
def test_a_plug_in_s_parameters_are_held_to_what_it_declares(line: str, says: str, hint: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(f'extends = "dodge"\n[[goal]]\nkind = "tilt"\n{line}\n')
    with pytest.raises(ScenarioError) as refused:
        load_scenario(str(path))
    assert str(refused.value).startswith(f"mine.toml:{says}")
    assert hint in str(refused.value.hint or "")
