"""A program drives a bench: waits, expects, changes the world, breaks things, forks, goes back."""

import pickle
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from p2os.errors import ScenarioError, WorldError
from robot_bench.bench import Bench, run_of
from robot_bench.events.codec import events_of
from robot_bench.events.expectation import ExpectationError
from robot_bench.events.kinds import Fault, PinEdge, Pose, WorldChange
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError
from tests.robot_bench.test_bench import S, bench, scenario
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

MS = 10**6


def made(mode: str = "adapter") -> Bench:
    """A robot that stands, drives on from 1 s, and turns from 2 s; 'hello' and 'world' are printed at half a second."""
    return bench(scenario(mode))


def booted(duration_s: float = 9.0) -> Bench:
    return Bench(load_scenario("motors").with_options(body="kinematic", duration_s=duration_s))


def test_a_bench_runs_until_an_event_and_stands_soon_after_it() -> None:
    one = made()
    text = one.run_until("usart1 sends hello")
    assert text is not None
    assert text.t == S // 2 + 87_000 * 5
    assert text.t < one.now <= 550 * MS + MS
    edge = one.run_until("pin PB7 high", within="1 s")
    assert edge == PinEdge(t=S, wire="motor1_comm1", level=True)
    assert one.run_until("pin PB12 low", within="200 ms") is None
    assert one.now == pytest.approx(1200 * MS, abs=MS), "counted from the edge"
    one.run_until(lambda now: now.pose.x_m > -1.0 or now.now > 2 * S)
    assert one.now <= 2 * S + MS


@pytest.mark.parametrize(("within", "comes"), [("299 ns", False), ("300 ns", True), ("301 ns", True)])
def test_an_expectation_after_another_is_a_bound_of_the_time_between(within: str, comes: bool) -> None:
    one = made()
    first = one.expect("pin PB7 high")
    assert first.t < one.now - MS
    if comes:
        assert one.expect("pin PB6 high", within=within).t == first.t + 300
    else:
        with pytest.raises(ExpectationError, match=r"'pin PB6 high' did not happen within 299 ns .*, from 1\.000 s"):
            one.expect("pin PB6 high", within=within)
    one.run_until("2.6 s")
    with pytest.raises(ExpectationError, match=r"from 2\.600 s"):
        one.expect("pin PB7 changes", within="100 ms")


def test_what_happened_at_the_very_instant_is_not_missed_and_not_taken_twice() -> None:
    chip = FakeChip([(0, "PB13", PinDrive.LOW), (0, "PB7", PinDrive.LOW), (0, "PB6", PinDrive.LOW),
                     (S, "PB7", PinDrive.HIGH), (S, "PB6", PinDrive.HIGH)])  # fmt: skip
    one = Bench(scenario("direct"), chip=chip)
    assert one.expect("pin PB7 high").t == one.expect("pin PB6 high", within="1 ns").t == S
    with pytest.raises(ExpectationError):
        one.expect("pin PB6 high", within="200 ms")


def test_waiting_changes_nothing() -> None:
    waited, straight = made(), made()
    waited.run_until("usart1 sends hello")
    waited.expect("robot moves", within="2 s")
    for one in (waited, straight):
        one.run_until("3 s")
        one.finish()
    assert waited.trace.text == straight.trace.text


def test_what_was_expected_and_came_is_returned() -> None:
    one = made()
    assert one.expect_text(re.compile("^hel+o$")).t < S
    one.expect_pin("PB12", "high")
    one.expect_pin("motor1_comm1", "high", within="1 s")
    there = one.pose
    one.expect_pose(x_m=there.x_m, tolerance_m=0.001)
    assert isinstance(one.expect("robot moves", within="1 s"), Pose)
    one.expect_no("contact", "100 ms")


@pytest.mark.parametrize(
    ("expects", "says"),
    [
        (lambda one: one.expect_text("hullo", within="1 s"), "'usart1 sends hullo' did not happen, from 0.000"),
        (lambda one: one.expect_pin("PB12", "low", within="0.1 s"), "'pin PB12 low' did not happen, from 0.000 s"),
        (lambda one: one.expect_pose(x_m=9, within="0.1 s"), r"the robot was not at x 9 m; it is at x -?\d"),
        (lambda one: one.expect_no("usart1 sends hello", "1 s"), "'usart1 sends hello' happened at 0.500 s"),
    ],
)  # fmt: skip
def test_what_was_expected_and_did_not_come_is_reported_with_the_last_events(
    expects: Callable[[Bench], Any], says: str
) -> None:
    one = made()
    if "low" in says:
        one.run_until("0.05 s")
        says = says.replace("0.000 s", "0.050 s to 0.150 s")
    with pytest.raises(ExpectationError, match=says) as unmet:
        expects(one)
    assert isinstance(unmet.value, AssertionError)
    if one.now >= S:
        assert "usart1 sends 'hello'" in str(unmet.value)


def test_a_thing_is_placed_moved_and_taken_away_while_the_bench_stands() -> None:
    one = made("direct")
    one.run_until("0.3 s")
    one.place("box", shape="cylinder", radius_m=0.05, height_m=0.5, before_sonar=3, distance_m=0.3, hold_s=0.2)
    one.run_until("0.4 s")
    assert one.level("DD3")
    one.run_until("0.6 s")
    assert not one.level("DD3")
    one.place("post", shape="cylinder", radius_m=0.05, height_m=0.5, x_m=1.0, y_m=1.0)
    one.move("post", x_m=1.1, y_m=1.0)
    one.remove("post")
    one.run_until("0.7 s")
    ops = [
        event.op for event in events_of(one.trace.lines()) if isinstance(event, WorldChange) and event.name == "post"
    ]
    assert ops == ["place", "move", "remove"]
    with pytest.raises(WorldError):
        one.remove("post")
    one.run_until("0.8 s")


def test_a_broken_link_is_noticed_and_mended() -> None:
    one = booted()
    one.expect("note adapter driving", within="5 s")
    one.drop_link("3 s")
    dropped = one.now
    one.expect("note adapter lost", within="3 s")
    one.run_until(dropped + 2900 * MS)
    assert not [packet for packet in one.record().wire if dropped + 50 * MS < packet.t < dropped + 2900 * MS]
    one.run_until(dropped + 4 * S)
    faults = [(event.op, event.words) for event in events_of(run_of(one).recorder.lines()) if isinstance(event, Fault)]
    assert faults == [("inject", "link-down"), ("clear", "link-down")]
    assert [packet for packet in one.record().wire if packet.t > dropped + 3 * S], "the line carries bytes again"


@pytest.mark.parametrize(
    ("do", "error", "says"),
    [
        (lambda one: one.inject("sonar-stuk 3 1"), ScenarioError, "no fault 'sonar-stuk'"),
        (lambda one: one.press("stopp"), ScenarioError, "there is no button 'stopp'"),
        (lambda one: one.place("x", shape="box"), ScenarioError, "'x_m' is missing"),
        (lambda one: one.place("x", shap="box"), ScenarioError, "unknown key 'shap'"),
        (lambda one: one.run_until("pin PB99 high"), UsageError, "there is no wire 'PB99'"),
        (lambda one: one.expect_pin("PB12", "hi"), UsageError, "a pin, and high, low or changes"),
        (lambda one: one.rewind("9 s"), UsageError, "9 s is not reached yet"),
    ],
)
def test_a_wrong_word_is_refused_and_the_bench_goes_on(
    do: Callable[[Bench], Any], error: type[Exception], says: str
) -> None:
    one = made()
    one.run_until("0.1 s")
    with pytest.raises(error, match=says):
        do(one)
    one.run_until("0.2 s")


@pytest.mark.parametrize("seed", [-1, 2**63])
def test_a_seed_is_what_a_scenario_takes(seed: int) -> None:
    with pytest.raises(UsageError, match="is no seed") as caught:
        Bench.from_scenario("motors", seed=seed)
    assert caught.value.hint == f"a whole number from 0 to {2**63 - 1}"


def test_who_waits_at_the_end_of_the_run_is_told_that_it_is_over() -> None:
    one = made()
    one.run_until("2.9 s")
    with pytest.raises(ExpectationError, match=r"to 2\.999 s") as caught:
        one.expect("contact", within="99 ms")
    assert caught.value.hint is None
    with pytest.raises(ExpectationError) as caught:
        one.expect("contact", within="1 s")
    assert caught.value.hint == "the run is over at 3 s: duration_s makes it longer"


def test_mode_a_has_no_link_to_drop() -> None:
    with pytest.raises(ScenarioError, match="mode direct has none"):
        made("direct").drop_link()


def ended(one: Bench) -> tuple[str, str]:
    one.run_until(one.end)
    one.finish()
    return "".join(line for line in one.trace.lines() if '"k": "meta"' not in line), one.trace.sha256


def test_forks_go_on_alike_and_share_nothing(tmp_path: Any) -> None:
    one = Bench(load_scenario("motors").with_options(body="kinematic", duration_s=1.2),
                trace=TraceWriter(tmp_path / "trace"))  # fmt: skip
    one.trace.meta({"scenario": "x"})
    one.run_until("0.7 s")
    same, other = one.fork(), one.fork()
    other.inject("sonar-dead 1")
    whole = ended(one)
    assert ended(same) == whole
    assert ended(other) != whole
    assert same.trace.text == (tmp_path / "trace").read_text()


def test_a_fork_with_what_was_done_to_it_is_pickled_whole() -> None:
    one = booted(1.4)
    one.run_until("0.7 s")
    one.place("post", shape="cylinder", radius_m=0.05, height_m=0.5, before_sonar=2, distance_m=0.4, hold_s=0.5)
    again = pickle.loads(pickle.dumps(one))  # noqa: S301 - our own bytes
    assert ended(again) == ended(one)


@pytest.mark.parametrize("in_file", [False, True])
def test_a_bench_goes_back_and_on_again_as_if_nothing_had_been(in_file: bool, tmp_path: Any) -> None:
    def fresh(name: str) -> Bench:
        trace = TraceWriter(tmp_path / name if in_file else None)
        one = Bench(load_scenario("motors").with_options(body="kinematic", duration_s=1.5), trace=trace)
        one.trace.meta({"scenario": "x"})
        return one

    one, whole = fresh("one"), ended(fresh("whole"))
    one.run_until("1.2 s")
    one.rewind("0.5 s")
    assert 500 * MS <= one.now < 501 * MS
    one.inject("sonar-dead 1")
    one.run_until("1 s")
    one.rewind("0.9 s")
    faults = [event for event in events_of(run_of(one).recorder.lines()) if isinstance(event, Fault)]
    assert len(faults) == 1, "what was done before it stays done"
    one.rewind("0.3 s")
    assert ended(one) == whole


def test_goals_are_saved_with_the_bench_and_caught_up_with_where_they_are_others() -> None:
    from dataclasses import replace

    from robot_bench.scenario.goals.judging import Goal, load_goal

    latency = load_goal({"kind": "latency", "from": "pin PB12 high", "to": "pin PB7 high", "most_s": 1.0}, "x")
    text = load_goal({"kind": "usart_contains", "text": "hello"}, "x")
    plain = scenario("adapter")

    def of(*goals: Goal) -> Bench:
        return bench(replace(plain, goals=goals))

    one, same, others = of(latency, text), of(latency, text), of(text, latency)
    one.run_until("0.8 s")
    for later in (same, others):
        later.restore(pickle.loads(pickle.dumps(one.snapshot())))  # noqa: S301 - our own bytes
    judged = []
    for each in (one, same, others):
        each.run_until("3 s")
        judged.append(each.judge())
    assert judged[0] == judged[1]
    assert sorted(judged[2].met) == sorted(judged[0].met)
    assert (len(judged[0].met), len(judged[0].not_judged)) == (1, 1)


def test_a_verdict_may_end_the_run_and_the_slice_changes_nothing() -> None:
    from dataclasses import replace

    from robot_bench.scenario.goals.judging import load_goal

    goal = load_goal({"kind": "happens", "event": "pin PB7 high", "ends_run": "met"}, "x")
    reported = set()
    for slice_ns in (MS, 10 * MS, 77_777):
        one = bench(replace(scenario("direct"), goals=(goal,)), slice_ns)
        one.run_until("3 s")
        assert one.end == 1050 * MS
        judged = one.judge()
        assert judged.met == [goal.wanted]
        (verdict,) = one.record().verdicts
        assert (verdict.t, verdict.met) == (S, True)
        reported.add(one.trace.text)
    assert len(reported) == 1


def test_a_series_of_waits_reads_each_line_of_the_trace_no_more_than_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    one = Bench.from_scenario("encoders", body="kinematic", duration_s=8)
    read = 0
    lines = one.trace.lines

    def counted(begin: int = 0) -> Iterator[str]:
        nonlocal read
        for line in lines(begin):
            read += 1
            yield line

    monkeypatch.setattr(one.trace, "lines", counted)
    found = [one.expect("pin encoder1_s1 changes", within="8 s") for _ in range(4)]
    again = [one.expect("pin encoder1_s1 changes", within="8 s") for _ in range(3)]
    times = [event.t for event in (*found, *again)]
    assert times == sorted(set(times))  # each one once
    assert read <= 2 * len(list(lines()))
    edges = [event.t for event in events_of(lines()) if getattr(event, "wire", "") == "encoder1_s1"]
    assert times == edges[1 : len(times) + 1]  # the first is what the wire begins with
