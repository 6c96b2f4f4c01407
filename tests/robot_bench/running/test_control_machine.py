"""Any commands in any order, by a rule-based machine: the run itself stays what it is, and time stays in it."""

import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from p2os.view.run_control import RunState
from robot_bench.bench import Bench
from simbase.timing import NS_PER_MS, Nanos
from tests.robot_bench.running.test_run_control import Controlled, scenario

#: The run of the machine: short, and with events in it.
DURATION_S = 0.6
TIMES = st.integers(0, round(DURATION_S * 1000)).map(lambda ms: ms * NS_PER_MS)
UNITS = st.sampled_from(["instruction", "line", "edge", "packet", "event", "millisecond"])
PLACES = st.sampled_from([
    "pin p2dx_con high", "packet PULSE", "note adapter connected", "robot near 0 0 1", "time 0.4", "line dodge.c:1",
    "variable nothing", "goal met",
])  # fmt: skip
BY_HAND = st.sampled_from([
    "move crate to 1.2 0.1 heading 20", "place post cylinder 0.1 at 1 1", "remove crate", "carry robot to 0.3 0.2",
    "fault sonar-stuck 3 0.2", "clear sonar-stuck 3", "press stop-button", "pin DD3 high", "let go DD3",
    "volts PA0 1.5", "type usart1 go", "drive 0.2 30", "let go wheels", "nonsense",
])  # fmt: skip
DONE = st.sampled_from(["", "fault link-down", "fault sonar-stuck 3 0.2", "pin DD3 high", "nonsense"])


class ControlMachine(RuleBasedStateMachine):
    """One run, and whoever controls it."""

    alone = ""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(mkdtemp(prefix="p2os-test-"))
        self.run = Controlled(self.folder, duration_s=DURATION_S)
        self.done = 0

    def teardown(self) -> None:
        """End as whoever ends the run does: it is the run that nobody controls, with what hands did in it."""
        session = self.run.session
        known = session.state().futures[0].end_ns
        session.end()
        assert session.bench.now >= min(known, session.bench.end)
        session.bench.run_until(session.bench.end)
        session.bench.finish()
        assert session.bench.trace.sha256 == (self.with_hands() if session.hands else type(self).alone)
        shutil.rmtree(self.folder)

    def with_hands(self) -> str:
        """Return the hash of the run whose scenario has what hands did."""
        bench = Bench(replace(scenario(DURATION_S), hands=tuple(self.run.session.hands)))
        bench.run_until(bench.end)
        bench.finish()
        return bench.trace.sha256

    @rule(words=BY_HAND)
    def hand(self, words: str) -> None:
        """It is done where the run stands, in a fork where it is known what comes next, or not at all."""
        before = self.run.session.state()
        is_past = self.run.session.chosen.is_past
        state = self.do("hand", words=words)
        if state.trouble:
            assert (state.hands, len(state.futures)) == (before.hands, len(before.futures))
        else:
            assert state.hands[-1].words == words
            assert before.head_ns < state.hands[-1].at_ns <= state.head_ns
            assert len(state.futures) == len(before.futures) + is_past

    @rule(forward_mps=st.sampled_from([0.0, 0.2, -0.3]), turn_dps=st.sampled_from([0.0, 30.0]))
    def drive(self, forward_mps: float, turn_dps: float) -> None:
        """A run that stands still stays where it is: it is driven when it goes on."""
        before = self.run.session.state()
        state = self.do("drive", forward_mps=forward_mps, turn_dps=turn_dps)
        assert before.is_running or state.head_ns == before.head_ns

    def do(self, do: str, **about: object) -> RunState:
        self.done += 1
        return self.run.do(do, **about)

    @rule(at_ns=TIMES)
    def go(self, at_ns: Nanos) -> None:
        """It stands at the time itself, but where that is not in the future."""
        chosen = self.run.session.chosen
        state = self.do("go", at_ns=at_ns)
        assert not state.is_running
        begins = chosen.begins_ns if chosen.parent else 0
        assert state.head_ns == max(at_ns, begins)
        assert chosen.known_ns >= min(chosen.now_ns, chosen.bench.end)

    @rule(unit=UNITS)
    def step(self, unit: str) -> None:
        """It never goes back."""
        before = self.run.session.state().head_ns
        self.do("step", unit=unit)
        assert self.run.until_it_stands().head_ns >= before

    @rule(unit=UNITS)
    def back(self, unit: str) -> None:
        """It never goes on, nor before where the future begins."""
        before, chosen = self.run.session.state().head_ns, self.run.session.chosen
        state = self.do("back", unit=unit)
        assert (chosen.begins_ns if chosen.parent else 0) <= state.head_ns <= max(before, chosen.begins_ns)

    @rule(slices=st.integers(1, 4), speed=st.sampled_from([0.0, 0.01, 1.0, 50.0]))
    def let_go(self, slices: int, speed: float) -> None:
        """Some slices at some speed."""
        self.do("speed", speed=speed)
        self.do("run")
        for _ in range(slices):
            if self.run.session.is_running:
                self.run.clock_ns += 10 * NS_PER_MS
                self.run.session.go_on(self.run.clock_ns)

    @rule()
    def pause(self) -> None:
        """It stands where it was."""
        before = self.run.session.state().head_ns
        assert self.do("pause").head_ns == before

    @precondition(lambda self: len(self.run.session.state().halts) < 3)
    @rule(words=PLACES)
    def halt_at(self, words: str) -> None:
        """A place is there, or why not."""
        state = self.do("halt_at", words=words)
        assert bool(state.trouble) != any(one.words == words for one in state.halts)

    @rule(number=st.integers(1, 4))
    def halt_not_at(self, number: int) -> None:
        """It is there no more."""
        assert all(one.number != number for one in self.do("halt_not_at", number=number).halts)

    @precondition(lambda self: len(self.run.session.state().futures) < 4)
    @rule(at_ns=TIMES, words=DONE)
    def fork(self, at_ns: Nanos, words: str) -> None:
        """A fork is chosen and begins where it was asked for, or there is none."""
        before = len(self.run.session.state().futures)
        state = self.do("fork", at_ns=at_ns, words=words)
        assert len(state.futures) == before + (not state.trouble)
        if not state.trouble:
            assert state.futures[-1].name == state.future
            assert 0 <= state.head_ns - state.futures[-1].at_ns <= (NS_PER_MS if words else 0)

    @rule(place=st.integers(0, 3))
    def choose(self, place: int) -> None:
        """It goes on where that future stands."""
        futures = self.run.session.state().futures
        name = futures[place % len(futures)].name
        assert self.do("choose", future=name).future == name

    @rule(place=st.integers(0, 3))
    def compare(self, place: int) -> None:
        """Futures without anything done do not part; nobody moves."""
        state = self.run.session.state()
        other = state.futures[place % len(state.futures)]
        compared = self.do("compare", future=other.name)
        assert compared.head_ns == state.head_ns
        for one in compared.futures:
            if one.against and not any(future.words for future in compared.futures):
                assert list(one.parting) == []

    @rule(place=st.integers(0, 3))
    def drop(self, place: int) -> None:
        """A fork goes, the run itself does not."""
        futures = self.run.session.state().futures
        name = futures[place % len(futures)].name
        state = self.do("drop", future=name)
        assert bool(state.trouble) is (name == "run")
        assert "run" in [one.name for one in state.futures]

    @invariant()
    def is_whole(self) -> None:
        """The state is one that a page can show."""
        state = self.run.session.state()
        chosen = next(one for one in state.futures if one.name == state.future)
        assert state.head_ns == chosen.head_ns <= chosen.end_ns
        assert state.done == self.done
        assert all(0 <= one.head_ns <= one.end_ns for one in state.futures)


@pytest.mark.soak
def test_a_run_stays_what_it_is_whatever_is_asked() -> None:
    bench = Bench(scenario(DURATION_S))
    bench.run_until(bench.end)
    bench.finish()
    ControlMachine.alone = bench.trace.sha256
    ControlMachine.TestCase.settings = settings(
        max_examples=30, stateful_step_count=12,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
    )  # fmt: skip
    ControlMachine.TestCase().runTest()
