"""A run under control: whatever is asked, the run itself leaves the trace that it leaves alone; forks are others."""

from pathlib import Path

import pytest

from p2os.view.run_control import RunCommand, RunState
from robot_bench.bench import Bench
from robot_bench.cli.debugging.future import Future
from robot_bench.cli.debugging.session import RunSession
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.robot_bench.firmware.hurried import hurried_scenario

DURATION_S = 2.0
DURATION_NS = round(DURATION_S * NS_PER_S)


def scenario(duration_s: float = DURATION_S) -> Scenario:
    """Return that of a program that goes on after half a second; the robot moves from 0.7 s on."""
    return hurried_scenario("dodge", 50, body="kinematic", duration_s=duration_s)


class Listener:
    """Keeps until when each future is known, as the page's recorder does."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def begin(self, future: Future) -> None:
        def take(_events: object, limit: Nanos) -> None:
            future.known_ns = max(future.known_ns, limit)

        self.names.append(future.name)
        future.bench.events.record(take)

    def forked(self, future: Future, _parent: Future) -> None:
        self.begin(future)

    def dropped(self, future: Future) -> None:
        self.names.remove(future.name)

    def saved(self, future: Future, kind: str) -> str:
        return f"{future.name} as a {kind}"


class Controlled:
    """A session with a clock of its own."""

    def __init__(self, folder: Path, speed: float = 0.0, duration_s: float = DURATION_S) -> None:
        self.clock_ns: Nanos = 0
        self.session = RunSession(Bench(scenario(duration_s)), Listener(), folder, speed)

    def do(self, do: str, **about: object) -> RunState:
        self.session.do(RunCommand(do=do, **about))  # type: ignore[arg-type]  # as a page has it
        return self.session.state()

    def until_it_stands(self, most: int = 100_000) -> RunState:
        for _ in range(most):
            if not self.session.is_running:
                return self.session.state()
            self.clock_ns += round(self.session.go_on(self.clock_ns) * NS_PER_S)
        raise AssertionError(f"it still runs at {self.session.state().head_ns} ns")

    def step(self, unit: str, **about: object) -> RunState:
        self.do("step", unit=unit, **about)
        return self.until_it_stands()


@pytest.fixture(scope="module")
def alone() -> str:
    """Return the hash of the run that nobody controls."""
    bench = Bench(scenario())
    bench.run_until(bench.end)
    bench.finish()
    return bench.trace.sha256


@pytest.fixture
def run(tmp_path: Path) -> Controlled:
    return Controlled(tmp_path)


def hash_at_end(run: Controlled) -> str:
    run.do("choose", future="run")
    for halt in run.session.state().halts:
        run.do("halt_not_at", number=halt.number)
    run.do("speed", speed=0.0)
    run.do("run")
    state = run.until_it_stands()
    assert (state.why, run.session.is_over) == ("the end of the run", True)
    run.session.bench.finish()
    return run.session.bench.trace.sha256


def at(run: Controlled, at_s: float) -> RunState:
    return run.do("go", at_ns=round(at_s * NS_PER_S))


def test_a_run_that_is_only_let_go_is_the_run_alone(run: Controlled, alone: str) -> None:
    assert run.until_it_stands().why == "the end of the run"
    assert hash_at_end(run) == alone


@pytest.mark.soak
def test_steps_by_every_unit_and_back_change_nothing(run: Controlled, alone: str) -> None:
    at(run, 1.0)
    for unit in ("instruction", "line", "edge", "packet", "event", "millisecond"):
        places = [run.session.state().head_ns]
        for _ in range(3):
            state = run.step(unit)
            assert state.trouble == ""
            places.append(state.head_ns)
        assert places == sorted(set(places)), unit
        back = [run.do("back", unit=unit).head_ns for _ in range(2)]
        assert back == places[-2:0:-1], unit
    assert hash_at_end(run) == alone


def test_a_step_of_a_millisecond_is_one(run: Controlled) -> None:
    start = at(run, 0.9).head_ns
    assert run.step("millisecond").head_ns == start + NS_PER_MS
    assert run.do("back", unit="millisecond").head_ns == start
    assert at(run, 0.0).head_ns == 0
    assert run.do("back", unit="millisecond").head_ns == 0


def test_a_step_goes_to_the_next_edge_of_one_wire_and_back_over_it(run: Controlled) -> None:
    at(run, 0.6)
    first = run.step("edge", words="encoder1_s1")
    level = run.session.bench.level("encoder1_s1")
    second = run.step("edge", words="encoder1_s1")
    assert run.session.bench.level("encoder1_s1") is not level
    assert second.why.startswith("encoder1_s1")
    back = run.do("back", unit="edge", words="encoder1_s1")
    assert (back.head_ns, run.session.bench.level("encoder1_s1")) == (first.head_ns, level)


@pytest.mark.parametrize("words", ["pin encoder1_s1 changes", "packet VEL", "robot moves", "note adapter driving"])
def test_it_halts_at_the_moment_of_an_event(words: str, run: Controlled, alone: str) -> None:
    probe = Bench(scenario())
    event = probe.run_until(words)
    assert event is not None
    at(run, 0.1)
    assert run.do("halt_at", words=words).trouble == ""
    run.do("run")
    state = run.until_it_stands()
    assert state.head_ns == event.t
    assert words in state.why
    assert state.halts[0].count == 1
    assert 0 <= run.session.chosen.now_ns - event.t < NS_PER_MS
    run.do("run")
    assert run.until_it_stands().head_ns > event.t
    assert hash_at_end(run) == alone


def test_it_halts_before_a_line_and_after_a_write_to_a_variable(run: Controlled, alone: str) -> None:
    board = run.session.chosen.machine.board
    at(run, 0.8)
    place = run.step("line").place.split(" ")[0]
    assert run.do("halt_at", words=f"line {place}").trouble == ""
    for _ in range(2):
        before = run.session.chosen.now_ns
        run.do("run")
        state = run.until_it_stands()
        assert (state.place.split(" ")[0], state.why) == (place, f"line {place}")
        assert run.session.chosen.now_ns > before
    run.do("halt_not_at", number=state.halts[0].number)
    name = next(one.name for one in board.image.symbols.symbols if one.size == 4 and one.address >= 0x2000_0000)
    assert run.do("halt_at", words=f"variable {name}").trouble == ""
    run.do("run")
    assert run.until_it_stands().why in {f"variable {name}", "the end of the run"}
    assert hash_at_end(run) == alone


@pytest.mark.parametrize(
    ("words", "trouble"),
    [
        ("line dodge.c:9999", "has no code"), ("line nothing.c:1", "no source file"), ("line 12", "is no line"),
        ("variable nothing", "there is no variable"), ("pin PZ9 high", "there is no wire"),
        ("spi1 sends 00", "not recorded"),
        ("nothing at all", "there is no place"), ("", "there is no place"),
    ],
)  # fmt: skip
def test_a_place_that_is_none_is_refused_in_words(words: str, trouble: str, run: Controlled) -> None:
    state = run.do("halt_at", words=words)
    assert trouble in state.trouble
    assert state.halts == []


def test_a_fork_is_the_run_again_where_nothing_is_done_and_parts_where_something_is(
    run: Controlled, alone: str
) -> None:
    at(run, 1.6)
    same = run.do("fork", at_ns=NS_PER_S)
    assert (same.future, same.head_ns) == ("fork 1", NS_PER_S)
    run.do("go", at_ns=round(1.5 * NS_PER_S))
    assert run.do("open", number=1).trouble == "a run knows no 'open'"
    alike = run.do("compare", future="run").futures[1]
    assert (alike.against, alike.parting) == ("run", ())
    assert alike.until_ns >= round(1.5 * NS_PER_S)
    run.do("choose", future="run")
    other = run.do("fork", at_ns=NS_PER_S, words="fault link-down")
    assert other.future == "fork 2"
    run.do("go", at_ns=round(1.5 * NS_PER_S))
    parted = run.do("compare", future="run").futures[2]
    assert parted.parting
    assert parted.parting[0].signal == "fault"
    assert parted.parting[0].at_ns >= NS_PER_S
    assert any(one.signal.startswith("packets") for one in parted.parting)
    between = run.do("compare", future="fork 1").futures[2]
    assert between.parting == parted.parting
    assert run.session.state().head_ns == round(1.5 * NS_PER_S)
    assert hash_at_end(run) == alone


def test_what_was_done_at_the_very_end_of_what_is_known_is_found_too(run: Controlled) -> None:
    for at_ns in (150_000, DURATION_NS - 1_000_000):
        run.do("choose", future="run")
        state = run.do("fork", at_ns=at_ns, words="fault link-down")
        run.step("millisecond")
        parting = run.do("compare", future="run").futures[-1].parting
        assert [one.signal for one in parting] == ["fault"], state


def test_a_fork_goes_back_to_where_it_begins_and_no_further(run: Controlled) -> None:
    at(run, 1.2)
    run.do("fork", words="fault sonar-stuck 3 0.2")
    run.do("go", at_ns=round(1.4 * NS_PER_S))
    assert run.do("go", at_ns=NS_PER_S).head_ns == round(1.2 * NS_PER_S)
    assert run.do("back", unit="event").why == "the beginning"


def test_forks_are_dropped_and_the_run_itself_is_not(run: Controlled) -> None:
    at(run, 0.5)
    run.do("fork")
    assert "stays" in run.do("drop", future="run").trouble
    state = run.do("drop", future="fork 1")
    assert ([one.name for one in state.futures], state.future) == (["run"], "run")
    assert "there is no future" in run.do("choose", future="fork 1").trouble
    for _ in range(7):
        run.do("fork")
    assert "8 futures" in run.do("fork").trouble


@pytest.mark.parametrize(
    ("words", "trouble"),
    [
        ("fault nothing", "nothing"), ("pin PZ9 low", "no wire"), ("pin PB12 up", "no level"),
        ("dance", "nothing is done"),
        ("volts PA0 much", "not understood"), ("type usart9 x", "none of usart1"), ("remove nobody", "nobody"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_makes_no_fork(words: str, trouble: str, run: Controlled) -> None:
    at(run, 0.3)
    state = run.do("fork", words=words)
    assert trouble in state.trouble
    assert [one.name for one in state.futures] == ["run"]


def test_the_pace_is_that_of_the_clock(tmp_path: Path) -> None:
    for speed in (0.01, 0.25, 1.0, 4.0):
        run = Controlled(tmp_path, speed)
        at(run, 0.2)
        run.do("run")
        for _ in range(40):
            run.clock_ns += 10 * NS_PER_MS
            run.session.go_on(run.clock_ns)
        passed = run.session.state().head_ns - round(0.2 * NS_PER_S)
        assert passed == pytest.approx(speed * 0.4 * NS_PER_S, rel=0.2), speed


def test_slow_motion_shows_what_happens_when_it_does(tmp_path: Path) -> None:
    run = Controlled(tmp_path, 0.01)
    at(run, 1.0)
    run.do("run")
    for _ in range(10):
        run.clock_ns += 20 * NS_PER_MS
        run.session.go_on(run.clock_ns)
        chosen = run.session.chosen
        assert chosen.known_ns >= chosen.head_ns


def test_a_bench_that_is_too_slow_goes_on_from_where_it_is(tmp_path: Path) -> None:
    run = Controlled(tmp_path, 1.0)
    at(run, 0.1)
    run.do("run")
    run.session.go_on(run.clock_ns)
    run.clock_ns += 60 * NS_PER_S
    run.session.go_on(run.clock_ns)
    assert run.session.state().head_ns < NS_PER_S


def test_who_ends_a_run_that_was_set_back_has_what_was_known_of_it(run: Controlled) -> None:
    at(run, 1.5)
    known = run.session.chosen.known_ns
    at(run, 0.4)
    run.session.end()
    assert run.session.bench.now >= known >= round(1.5 * NS_PER_S)


def test_the_run_goes_on_to_be_looked_into_when_it_is_over(run: Controlled, alone: str, tmp_path: Path) -> None:
    run.until_it_stands()
    bench = run.session.bench
    run.session.replace_main(tmp_path / "copy.jsonl")
    bench.finish()
    assert bench.trace.sha256 == alone
    assert at(run, 1.0).head_ns == NS_PER_S
    assert run.step("event").head_ns > NS_PER_S
    assert run.do("fork", words="fault link-down").trouble == ""
    assert bench.trace.sha256 == alone
