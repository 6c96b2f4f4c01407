"""A firmware on a board by itself, live on the page: the chip does what it does alone, and is controlled."""

import json
import signal
import subprocess
from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.cli.browser import viewing
from bluepill_sim.cli.browser.viewing import ViewedRun
from bluepill_sim.fabric.subscriptions import EDGE
from bluepill_sim.parts.registry import parse_part
from p2os.cli.main import run as p2os
from p2os.view.run_control import RunCommand
from robot_bench.bench import Bench
from robot_bench.cli.debugging.hands import hand_of
from robot_bench.cli.debugging.session import RunSession
from robot_bench.cli.shown import lone_board
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.cli.shown.lone_board import board_scenario
from robot_bench.cli.shown.offered_hands import hands_of
from robot_bench.events.kinds import PinEdge, Pose, Text
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.view.test_page_in_browser import SCRIPTS, tools
from tests.robot_bench.running.test_run_control import Controlled, Listener
from tests.tools.examples import EXAMPLES
from tests.tools.forked_python import forked_p2os

MOTORS = EXAMPLES / "motors.elf"
SPAN = 40 * NS_PER_MS


def test_the_chip_does_what_it_does_alone() -> None:
    alone, rows, edges, texts = BluePill(MOTORS), bytearray(), list[tuple[int, str]](), list[bytes]()
    alone.subscribe_pins([pin.name for pin in alone.pins], rows.extend)
    alone.advance_to(SPAN)
    bench = Bench(board_scenario(MOTORS, SPAN))
    bench.events.subscribe(lambda event: edges.append((event.t, event.wire)), PinEdge)
    bench.events.subscribe(lambda event: texts.append(event.data), Text)
    bench.events.subscribe(lambda _event: pytest.fail("there is no robot"), Pose)
    bench.run_until(bench.end)
    bench.finish()
    assert b"".join(texts) == bytes(alone.usart1.unread) != b""
    made = {(at, f"P{'ABCD'[pin >> 4]}{pin & 15}") for at, pin, *_ in EDGE.iter_unpack(bytes(rows))}
    seen = {row for row in edges if row[0] > 0}
    assert seen <= made
    assert {wire for _, wire in seen} == {"PA9", "PB12"}, "the bits of what it prints, and p2dx_con"
    assert (bench.chip.now_ns, board_of(bench).cycle) == (alone.now_ns, alone.cycle)


def board_of(bench: Bench) -> BluePill:
    assert isinstance(bench.chip, BluePill)
    return bench.chip


class Board(Controlled):
    def __init__(self, folder: Path) -> None:
        self.clock_ns = 0
        self.session = RunSession(Bench(board_scenario(MOTORS, NS_PER_S)), Listener(), folder, 0.0)


def test_it_halts_steps_goes_back_forks_and_has_hands_as_any_run(tmp_path: Path) -> None:
    board = Board(tmp_path)
    board.do("go", at_ns=20 * NS_PER_MS)
    before = board.session.state().head_ns
    stepped = board.step("instruction").head_ns
    assert stepped > before
    assert board.do("back", unit="millisecond").head_ns == stepped - NS_PER_MS
    assert board.do("halt_at", words="pin PA4 high").trouble == ""
    assert board.do("hand", words="pin PA4 high").trouble == ""
    state = board.session.state()
    assert state.hands[0].words == "pin PA4 high"
    assert board_of(board.session.bench).pin("PA4").level
    assert board.do("fork", words="pin PA4 low").future == "fork 1"
    assert not board_of(board.session.chosen.bench).pin("PA4").level


def test_hands_are_those_of_a_board() -> None:
    bench = Bench(board_scenario(MOTORS, SPAN))
    for words in ("pin PA4 low", "volts PA0 1.2", "type usart1 go", "let go PA4"):
        assert hand_of(words, 1, bench).words == words
    for words in ("carry robot to 1 0", "drive 0.1 0", "place post cylinder 0.1 at 1 1", "press stop-button"):
        with pytest.raises(UsageError, match="neither robot nor world"):
            hand_of(words, 1, bench)
    offer = hands_of(bench.scenario)
    assert (offer.most_mps, offer.faults, offer.buttons) == (0.0, (), ())
    assert {"PA0", "PB12", "PC13"} <= set(offer.pins)


def test_the_page_has_wires_texts_and_the_chip_and_no_robot(tmp_path: Path) -> None:
    scenario = board_scenario(MOTORS, SPAN)
    live = LiveRun(scenario, speed=0.0)
    live.offer(RunCommand(do="hand", words="pin PA4 high"))
    live.drive(Bench(scenario))
    live.source.update()
    recording = live.source.recording
    kinds = {track.kind.name for track in recording.tracks}
    assert {"levels", "text"} <= kinds
    assert not kinds & {"pose", "ranges"}
    assert {track.header.name for track in recording.tracks} >= {"PA4", "PC13", "usart1"}
    header = recording.header
    assert (header.world, header.robots) == (None, ())
    assert header.lead == "firmware motors.elf · a BluePill by itself"
    assert [panel.name for panel in header.panels] == ["board", "program", "chip"]


def test_a_pin_that_a_part_has_been_given_is_none_of_the_wires() -> None:
    scenario = board_scenario(MOTORS, SPAN, parts=[parse_part("hc-sr04,trig=PB8,echo=PB9")])
    assert scenario.own_robot is not None
    names = {wire.name for wire in scenario.own_robot.robot.signals}
    assert not names & {"PB8", "PB9"}
    bench = Bench(scenario)
    bench.run_until(NS_PER_MS)
    assert "PB10" in names


@pytest.mark.parametrize(
    ("words", "says"),
    [(["--view", "--uart", "log.txt"], "--uart cannot stand beside --view"), (["--gdb"], "--gdb goes with --view only"),
     (["--view", "--drive", "PA6=1@1ms"], "--drive cannot stand beside --view"),
     (["--no-browser"], "--no-browser goes with --view only")],
)  # fmt: skip
def test_what_a_page_has_in_its_own_way_is_refused(
    words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["mcu", "run", str(MOTORS), *words]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"p2os: {says}")
    assert "hint: " in said


def test_without_a_package_that_has_a_page_it_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(viewing, "installed_points", lambda _group: {})
    assert p2os(["mcu", "run", str(MOTORS), "--view"]) == 2
    assert "no installed package shows a run on a page" in capsys.readouterr().err


def test_what_is_asked_for_comes_to_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[ViewedRun] = []
    monkeypatch.setattr(lone_board, "view_board", asked.append)
    assert p2os(["mcu", "run", str(MOTORS), "--view", "--for", "2s", "--no-browser", "--gdb"]) == 0
    assert [(one.end_ns, one.gdb, one.is_opened) for one in asked] == [(2 * NS_PER_S, 3333, False)]


@pytest.mark.slow
def test_the_page_of_a_board_in_a_browser() -> None:
    pytest.importorskip("uvicorn")
    node, chromium = tools()
    words = forked_p2os("mcu", "run", str(MOTORS), "--view", "--no-browser")
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        link = running.stderr.readline().partition(": ")[2].strip()
        done = subprocess.run([node, str(SCRIPTS / "board.mjs"), chromium, link],
                              capture_output=True, text=True, timeout=170, check=False)  # fmt: skip
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=60)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert {"Logic analyser", "Plots", "Hands", "Board", "Program", "Chip", "Consoles"} <= set(found["tabs"])
    assert not {"Plan", "3D"} & set(found["tabs"])
    assert found["back"]["head_ns"] < found["stepped"]["head_ns"]
    assert found["back"]["trouble"] == found["hand"]["trouble"] == ""
    assert found["hand"]["hands"][0]["words"] == "pin PA0 high"
    assert (found["things"], found["saves"], found["errors"]) == (0, 0, [])
