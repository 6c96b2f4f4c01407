"""Robots of one world that are looked at while they run: their traces are those of robots at which nobody looks."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import pytest

from p2os.cli.robots.command_queue import MOST_COMMANDS
from p2os.view.header import PageHeader
from p2os.view.run_control import RunCommand, RunState
from robot_bench.bench import Bench
from robot_bench.cli.shown.live_fleet import LiveFleet
from robot_bench.cli.shown.looked_panels import LOOK_NS
from robot_bench.cli.shown.targets import scenario_target
from robot_bench.recording.run_record import read_run
from robot_bench.report.make import Files
from robot_bench.run import run_together
from robot_bench.scenario.loading import load_scenario
from robot_bench.view.run_recording import recording_of_all

SCENARIO = load_scenario("two-dodge").with_options(duration_s=0.3)
NAMES = ("west", "east")
MS = 1_000_000


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_together(SCENARIO, tmp_path_factory.mktemp("alone") / "run", files=Files.SUMMARY).folder


def hashes(folder: Path) -> list[object]:
    return [read_run(folder / name).end["trace_sha256"] for name in NAMES]


class Script:
    """Gives commands one after the other, each at a state of the run."""

    def __init__(self, live: LiveFleet, *commands: RunCommand) -> None:
        self._live, self._commands = live, [*commands]
        self.states: list[RunState] = []
        self.now = 0

    def clock(self) -> int:
        """Go on by half a look, with a command while there are any."""
        self.now += LOOK_NS // 2
        self.states.append(self._live.state)
        for panel in ("program", "chip"):
            self._live.look(panel, "west: next line" if panel == "program" else "east: NVIC")
        if self._commands:
            self._live.offer(self._commands.pop(0))
        return self.now


def looked_at(tmp_path: Path, *commands: RunCommand, speed: float = 1.0) -> tuple[LiveFleet, Script, Path]:
    live = LiveFleet(SCENARIO, speed=speed)
    script = Script(live, *commands)
    live._clock = script.clock

    def drive(benches: Mapping[str, Bench]) -> None:
        live.drive(benches)

    folder = run_together(SCENARIO, tmp_path / "run", drive=drive, files=Files.SUMMARY).folder
    live.source.update()
    return live, script, folder


def test_robots_that_are_looked_at_halted_and_stepped_leave_the_same_traces(alone: Path, tmp_path: Path) -> None:
    live, script, folder = looked_at(
        tmp_path, RunCommand(do="pause"), RunCommand(do="step", unit="millisecond"),
        RunCommand(do="step", unit="millisecond"), RunCommand(do="back", unit="event"),
        RunCommand(do="run", at_ns=0), RunCommand(do="speed", speed=0.0), RunCommand(do="run"),
    )  # fmt: skip
    assert hashes(folder) == hashes(alone)
    heads = [state.head_ns for state in script.states if not state.is_running]
    assert {round((after - before) / MS) for before, after in pairwise(heads)} == {0, 1}
    troubles = {state.trouble for state in script.states} - {""}
    assert any("stepped by the millisecond, and changed by hand alone" in one for one in troubles)
    assert any("not set back" in one for one in troubles)
    assert (live.state.is_running, live.state.why) == (False, "the run is over")
    assert not live.source.recording.header.is_live


def test_every_robot_has_its_rows_and_its_panels(alone: Path, tmp_path: Path) -> None:
    live, _, _ = looked_at(tmp_path, speed=0.0)
    found = live.source.recording
    assert [robot.name for robot in found.header.robots] == [*NAMES]
    whole = recording_of_all({name: read_run(alone / name) for name in NAMES}, PageHeader(title="x"))

    def rows(recording: object) -> dict[tuple[str, str, str], str]:
        return {(one.header.source, one.kind.name, one.header.name): str(one.columns)
                for one in recording.tracks if one.kind.name not in {"goal", "events"}}  # type: ignore[attr-defined]  # fmt: skip

    assert rows(found) == rows(whole)
    program = next(one for one in found.header.panels if one.name == "program")
    assert program.choices == (
        "west: next line", "west: what has run", "east: next line", "east: what has run",
    )  # fmt: skip
    west = live.look("program", "west: next line")
    assert west is not None
    assert west.sections
    assert live.look("program", "nobody") is None
    assert live.look("no such", "") is None
    assert live.offered("x") == ()


def test_what_hands_do_to_one_of_them_is_written_down_and_is_that_run_without_a_page(tmp_path: Path) -> None:
    live, script, folder = looked_at(
        tmp_path, RunCommand(do="hand", words="place post cylinder 0.1 at 0 1.5", robot="east"),
        RunCommand(do="hand", words="move post to 0.3 1.4", robot="west"),
        RunCommand(do="hand", words="fault sonar-stuck 3 0.2", robot="west"),
        RunCommand(do="hand", words="pin DD3 high", robot="east"),
        RunCommand(do="drive", forward_mps=0.3, turn_dps=20, robot="east"), RunCommand(do="pause"),
        RunCommand(do="hand", words="type usart1 go"), RunCommand(do="hand", words="remove nobody", robot="east"),
        RunCommand(do="hand", words="dance"), RunCommand(do="hand", words="let go DD3", robot="nobody"),
        RunCommand(do="run"), RunCommand(do="stop"), RunCommand(do="hand", words="let go wheels", robot="east"),
        RunCommand(do="save", words="test"), RunCommand(do="save", words="novel"), speed=0.2,
    )  # fmt: skip
    kept = [(hand.robot, hand.words) for hand in live._hands.done]
    assert kept == [
        ("east", "place post cylinder 0.1 at 0 1.5"), ("west", "move post to 0.3 1.4"),
        ("west", "fault sonar-stuck 3 0.2"), ("east", "pin DD3 high"), ("east", "drive 0.300 20.0"),
        ("west", "type usart1 go"), ("east", "drive 0.000 0.0"), ("east", "let go wheels"),
    ]  # fmt: skip
    troubles = " ".join(dict.fromkeys(state.trouble for state in script.states))
    for words in ("nobody", "nothing is done by 'dance'", "no robot with a program", "not saved as 'novel'"):
        assert words in troubles
    assert (live.state.hand_count, live.state.hands[0].words) == (8, "east: place post cylinder 0.1 at 0 1.5")
    assert {state.saved for state in script.states} - {""} == {f"saved: pytest {tmp_path / 'test_run.py'}"}
    written = load_scenario(str(folder / "hands.toml"))
    assert hashes(run_together(written, tmp_path / "again", files=Files.SUMMARY).folder) == hashes(folder)
    assert load_scenario(str(tmp_path / "run.toml")).programmed[1].hands == written.programmed[1].hands


def test_who_is_driven_moves_and_stands_when_its_page_is_not_heard_of(alone: Path, tmp_path: Path) -> None:
    live, _, folder = looked_at(tmp_path, *[RunCommand(do="drive", forward_mps=0.5, robot="west")] * 6, speed=0.2)
    way = {name: [row.x for row in read_run(one / name).poses] for name in NAMES for one in (folder,)}
    still = {name: [row.x for row in read_run(alone / name).poses] for name in NAMES}
    assert way["west"][-1] > still["west"][-1] + 0.05
    assert way["east"] == still["east"]
    assert [hand.words for hand in live._hands.done] == ["drive 0.500 0.0", "drive 0.000 0.0"]


def test_too_many_commands_are_refused() -> None:
    live = LiveFleet(SCENARIO)
    assert all(live.offer(RunCommand(do="pause")) for _ in range(MOST_COMMANDS))
    assert not live.offer(RunCommand(do="pause"))


def test_a_scenario_with_several_robots_is_shown_live_and_then_with_its_report(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("robot_bench.scenario.loading.load_scenario", lambda *_args, **_more: SCENARIO)
    target = scenario_target("two-dodge")
    assert target is not None
    assert target.run is not None
    assert target.source.control is not None
    target.source.control.offer(RunCommand(do="speed", speed=0.0))
    target.run()
    target.source.update()
    header = target.source.recording.header
    assert header.verdict
    assert [section.title for section in header.sections] == ["Robots"]
    assert not header.is_live
