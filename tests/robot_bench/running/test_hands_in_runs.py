"""A run that hands have changed is that of a scenario with the same hands, to the hash; who drives has to be there."""

from dataclasses import replace
from pathlib import Path

import pytest

from p2os.view.run_control import DRIVE_HOLD_NS, RunCommand, RunState
from robot_bench.bench import Bench
from robot_bench.bench.hand_driven_body import HandDrivenBody
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.cli.shown.offered_hands import hands_of
from robot_bench.run import run_scenario
from robot_bench.scenario.hands.doing import Doing
from robot_bench.scenario.hands.timed import hand_at
from robot_bench.scenario.hands.words import meant_by
from robot_bench.scenario.loading import load_scenario, read_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_MS, Nanos
from tests.robot_bench.running.test_run_control import Controlled, scenario

MS = NS_PER_MS
#: What one does in the run, while it stands and while it goes on.
WORDS = (
    "move crate to 1.4 0.1 heading 30", "place post cylinder 0.1 at 1 1", "carry robot to 0.2 0.3 heading 90",
    "fault sonar-stuck 3 0.2", "pin DD3 high", "let go DD3", "volts PA0 1.5", "type usart1 go", "drive 0.2 30",
    "let go wheels", "remove post",
)  # fmt: skip


def hash_with(hands: object, what: Scenario) -> str:
    bench = Bench(replace(what, hands=tuple(hands)))  # type: ignore[arg-type]  # hands
    bench.run_until(bench.end)
    bench.finish()
    return bench.trace.sha256


def ended(run: Controlled) -> str:
    run.session.end()
    bench = run.session.bench
    bench.run_until(bench.end)
    bench.finish()
    return bench.trace.sha256


@pytest.fixture
def run(tmp_path: Path) -> Controlled:
    return Controlled(tmp_path, duration_s=1.5)


def slices(run: Controlled, count: int) -> None:
    for _ in range(count):
        run.clock_ns += 10 * MS
        run.session.go_on(run.clock_ns)


def test_a_run_with_hands_is_that_of_a_scenario_with_them(run: Controlled) -> None:
    run.do("go", at_ns=200 * MS)
    for words in WORDS[:5]:
        assert run.do("hand", words=words).trouble == ""
    run.do("run")
    for words in WORDS[5:]:
        slices(run, 1)
        assert run.do("hand", words=words).trouble == ""
    assert run.session.state().is_running
    run.do("go", at_ns=300 * MS)
    run.do("back", unit="millisecond")
    run.do("run")
    run.until_it_stands()
    hands = run.session.hands
    assert [one.words for one in hands] == list(WORDS)
    assert ended(run) == hash_with(hands, scenario(1.5)) != hash_with([], scenario(1.5))


def test_what_cannot_be_done_changes_nothing_and_a_run_goes_on(run: Controlled) -> None:
    run.do("run")
    slices(run, 2)
    for words, trouble in (
        ("carry robot to 1.6 -1.3", "inside 'crate'"), ("move nobody to 1 1", "nobody"), ("fault x", "no fault"),
        ("dance", "nothing is done"),
    ):  # fmt: skip
        state = run.do("hand", words=words)
        assert trouble in state.trouble
        assert (state.is_running, state.hand_count) == (True, 0)
    assert run.do("save", words="novel").trouble.startswith("hands are not saved as 'novel'")
    run.until_it_stands()
    assert "the run is over" in run.do("hand", words="drive 0.1 0").trouble
    assert ended(run) == hash_with([], scenario(1.5))


@pytest.mark.slow
def test_what_is_done_in_the_past_begins_a_fork_without_what_hands_did_later(run: Controlled) -> None:
    run.do("go", at_ns=400 * MS)
    run.do("hand", words="remove crate")
    run.do("go", at_ns=900 * MS)
    run.do("go", at_ns=300 * MS)
    before = run.session.hands
    state = run.do("hand", words="move crate to 1.2 0")
    assert (state.future, [one.words for one in state.hands]) == ("fork 1", ["move crate to 1.2 0"])
    assert run.session.hands is before
    fork = run.session.chosen
    run.do("run")
    run.until_it_stands()
    fork.bench.finish()
    assert fork.bench.trace.sha256 == hash_with(fork.hands, scenario(1.5))
    assert ended(run) == hash_with(before, scenario(1.5))


@pytest.mark.slow
def test_a_fork_without_anything_done_has_what_hands_do_later(run: Controlled) -> None:
    run.do("go", at_ns=400 * MS)
    run.do("hand", words="remove crate")
    run.do("go", at_ns=900 * MS)
    state = run.do("fork", at_ns=300 * MS)
    assert [one.words for one in state.hands] == ["remove crate"]
    run.do("run")
    run.until_it_stands()
    run.session.chosen.bench.finish()
    assert run.session.chosen.bench.trace.sha256 == hash_with(run.session.hands, scenario(1.5))


@pytest.mark.parametrize(("at_ns", "is_at"), [(150 * MS, 200 * MS), (149 * MS, 150 * MS), (151 * MS, 200 * MS)])
def test_where_it_stands_a_hand_acts_at_the_first_moment_that_nothing_is_known_of(
    at_ns: Nanos, is_at: Nanos, run: Controlled
) -> None:
    run.do("go", at_ns=at_ns)
    (hand,) = run.do("hand", words="remove crate").hands
    assert hand.at_ns == is_at


def test_a_robot_that_is_driven_when_it_stands_still_drives_when_it_goes_on(run: Controlled) -> None:
    run.do("go", at_ns=200 * MS)
    assert run.do("drive", forward_mps=0.3).hand_count == 0
    assert run.do("run").hands[-1].words == "drive 0.300 0.0"
    slices(run, 3)
    assert run.do("drive", forward_mps=0.3).hand_count == 1, "it is the same still"
    body = run.session.bench.parts.body
    assert [body.state.left_speed_mps, body.state.right_speed_mps] == pytest.approx([0.3, 0.3])
    run.do("drive", turn_dps=90.0)
    slices(run, 3)
    assert body.state.left_speed_mps == -body.state.right_speed_mps < 0
    run.do("hand", words="let go wheels")
    slices(run, 1)
    assert run.session.state().hand_count == 3
    assert body.state.left_speed_mps == 0


# With a page, or what was one.

QUICK = load_scenario("motors").with_options(body="kinematic", duration_s=1.5)


class Clock:
    """Goes on by so much at each look."""

    def __init__(self, step_ns: Nanos) -> None:
        self.now, self._step_ns = 0, step_ns

    def __call__(self) -> Nanos:
        self.now += self._step_ns
        return self.now


def live(folder: Path, *commands: RunCommand) -> tuple[LiveRun, RunState, Path]:
    """Return a run at which these commands have come in, at the pace of a clock of its own."""
    run = LiveRun(QUICK, speed=1.0, clock=Clock(20 * MS))
    for command in commands:
        assert run.offer(command)
    done = run_scenario(QUICK, folder / "live", drive=run.drive)
    return run, run.state, done.folder


def test_who_drives_and_is_not_heard_of_any_more_stands(tmp_path: Path) -> None:
    _, state, _ = live(tmp_path, RunCommand(do="drive", forward_mps=0.2))
    first, second = state.hands
    assert (first.words, second.words) == ("drive 0.200 0.0", "drive 0.000 0.0")
    assert 0 < second.at_ns - first.at_ns <= DRIVE_HOLD_NS + 60 * MS


def test_the_run_folder_has_a_scenario_that_is_the_run_and_tests_are_written_beside(tmp_path: Path) -> None:
    saves = [RunCommand(do="save", words=kind) for kind in ("scenario", "test")]
    run, state, folder = live(tmp_path, RunCommand(do="hand", words="remove crate"), *saves)
    again = run_scenario(read_scenario(folder / "hands.toml"), tmp_path / "again")
    wanted = run_scenario(QUICK, tmp_path / "without")
    hashes = [(one / "summary.json").read_text().split('"trace_sha256": "')[1][:64] for one in
              (folder, again.folder, wanted.folder)]  # fmt: skip
    assert hashes[0] == hashes[1] != hashes[2]
    assert (tmp_path / "live.toml").read_text() == (folder / "hands.toml").read_text()
    assert 'scenario("live.toml")' in (tmp_path / "test_live.py").read_text()
    assert run.source.recording.header.hands is not None
    assert state.trouble == ""


def test_what_is_offered_is_understood() -> None:
    offer = hands_of(QUICK)
    said = [" ".join(["fault", one.name, *(word.usual for word in one.words)]) for one in offer.faults]
    said += [f"press {one}" for one in offer.buttons] + [f"pin {one} high" for one in offer.pins]
    said += [f"volts {one} 1.2" for one in offer.analog_pins] + [f"type {one} go" for one in offer.ports]
    for words in said:
        assert hand_at(0, *meant_by(words), QUICK.parameters, "page").doing != Doing()
    assert [one.name for one in offer.faults][:3] == ["link-down", "sonar-stuck", "sonar-noisy"]
    assert offer.buttons[0] == "stop-button"
    assert "PA0" in offer.analog_pins
    assert not set(offer.analog_pins) & {"PB0"}
    assert hands_of(QUICK.with_options(mode="direct")).faults == ()
    rover = hands_of(load_scenario("rover"))
    assert (list(rover.faults), list(rover.buttons)) == ([], [])


def test_a_body_that_nobody_drives_is_itself() -> None:
    bench = Bench(QUICK)
    body = bench.parts.body
    assert isinstance(body, HandDrivenBody)
    inner = body._inner
    assert (body.step, body.hold, body.ramp) == (inner.step, inner.hold, inner.ramp)
    body.drive_by_hand((0.1, 0.0))
    saved = bench.snapshot()
    body.drive_by_hand(None)
    assert body.hold == inner.hold
    bench.restore(saved)
    assert body.hold != inner.hold
    assert inner.is_powered
