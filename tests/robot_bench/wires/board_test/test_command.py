"""`p2os board test`: emulated, and at two ports, which are pseudo-terminals with an emulated board behind them."""

import json
import os
import select
import threading
import tty
from collections.abc import Callable, Iterator

import pytest
import typer
from typer.testing import CliRunner

from robot_bench.cli import board as verb
from robot_bench.wires.board_test.circuit import BoardFault, Side, WireFault
from robot_bench.wires.board_test.emulated import PROGRAM, STEP_MS, EmulatedBoard
from robot_bench.wires.board_test.esp32 import CONSOLE
from simbase.errors import UsageError

Run = Callable[..., tuple[int, str]]
RUNNER = CliRunner()


@pytest.fixture
def run() -> Run:
    app = _app()

    def run(*words: str) -> tuple[int, str]:
        result = RUNNER.invoke(app, ["board", "test", *words])
        if isinstance(result.exception, UsageError):
            return result.exception.exit_code, str(result.exception)
        return result.exit_code, result.output

    return run


def test_a_sound_board_ends_with_0_and_its_table_fits_a_terminal(run: Run) -> None:
    code, said = run("--emulated")
    lines = said.splitlines()
    assert (code, lines[-1]) == (0, "no fault in 26 rows, 1 not tested")
    assert "DD3          PA6 - IO5        ok" in lines
    assert "link         IO17 - J3 - IO16 ok            8 bytes came back" in lines
    assert max(map(len, lines)) <= 80


def test_faults_end_with_1_and_are_named(run: Run) -> None:
    code, said = run("--emulated", "--fault", "short:DD3,DD4", "--fault", "3v3:DD8@esp32", "--json")
    rows = {row["name"]: row for row in json.loads(said)}
    assert code == 1
    assert (rows["DD3"]["verdict"], rows["DD3"]["with"]) == ("short", ["DD4"])
    assert rows["DD8"]["detail"] == "held at 3V3 at the adapter's end"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("open:DD3", BoardFault(WireFault.OPEN, "DD3")),
        ("gnd:rst@esp32", BoardFault(WireFault.GND, "rst", side=Side.ESP32)),
        ("short:DD1,EN@esp32", BoardFault(WireFault.SHORT, "DD1", "EN", Side.ESP32)),
    ],
)
def test_a_fault_is_a_word(text: str, fault: BoardFault) -> None:
    assert verb.fault_of(text, verb.load_pinout()) == fault


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--adapter", "pty:/dev/null"),
        ("--emulated", "--bluepill", "pty:/dev/null"),
        ("--fault", "open:DD3"),
        ("--emulated", "--revision", "rev-z"),
        ("--emulated", "--revision", "thesis-board"),
        *(("--emulated", "--fault", text) for text in (
            "DD3", "shut:DD3", "open:DD9", "open:DD1,DD2", "short:DD1", "short:DD1,DD1", "open:EN", "short:EN,DD1",
            "open:DD3@left",
        )),
    ],
)  # fmt: skip
def test_wrong_usage_is_one_line_and_2(run: Run, words: tuple[str, ...]) -> None:
    code, said = run(*words)
    assert code == 2
    assert len(said.splitlines()) == 1


def test_a_wire_that_is_misspelt_gets_the_nearest() -> None:
    with pytest.raises(UsageError, match="no wire 'DD33'") as caught:
        verb.fault_of("open:DD33", verb.load_pinout())
    assert caught.value.hint == "did you mean 'DD3'?"


class Ports:
    """An emulated board whose consoles are pseudo-terminals; its time passes as fast as it can."""

    def __init__(self, board: EmulatedBoard) -> None:
        self._board = board
        self._ends = [os.openpty() for _ in range(2)]
        for master, slave in self._ends:
            tty.setraw(slave)
            os.set_blocking(master, False)
        self.urls = [f"pty:{os.ttyname(slave)}" for _, slave in self._ends]
        self._has_ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        board = self._board
        (adapter, _), (bluepill, _) = self._ends
        while not self._has_ended.is_set():
            board.esp32.receive(CONSOLE, self._typed(adapter))
            board.bluepill.usart1.receive(self._typed(bluepill))
            board.run_ms(STEP_MS)
            said = os.write(adapter, board.esp32.sent(CONSOLE)) + os.write(bluepill, board.bluepill.usart1.read())
            if not said:  # an answer may take several steps: time goes on, but slower
                select.select([adapter, bluepill], [], [], 0.001)

    @staticmethod
    def _typed(descriptor: int) -> bytes:
        try:
            return os.read(descriptor, 4096)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        self._has_ended.set()
        self._thread.join()
        for end in self._ends:
            for descriptor in end:
                os.close(descriptor)


@pytest.fixture
def ports() -> Iterator[Ports]:
    served = Ports(EmulatedBoard((BoardFault(WireFault.OPEN, "DD5"),)))
    yield served
    served.close()


def test_the_same_walk_at_two_ports_names_the_same_fault(run: Run, ports: Ports) -> None:
    code, said = run("--adapter", ports.urls[0], "--bluepill", ports.urls[1], "--json")
    assert (code, [row["name"] for row in json.loads(said) if row["verdict"] not in {"ok", "not tested"}]) == (
        1,
        ["DD5"],
    )


def test_a_bluepill_that_does_not_answer_is_one_line_and_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verb, "ANSWER_S", 0.05)
    ends = [os.openpty() for _ in range(2)]
    urls = [f"pty:{os.ttyname(slave)}" for _, slave in ends]
    try:
        result = RUNNER.invoke(_app(), ["board", "test", "--adapter", urls[0], "--bluepill", urls[1]])
    finally:
        for end in ends:
            for descriptor in end:
                os.close(descriptor)
    assert str(result.exception) == "the BluePill does not answer"
    assert PROGRAM.name in str(getattr(result.exception, "hint", ""))


def _app() -> typer.Typer:
    app = typer.Typer()
    verb.register(app)
    app.callback()(lambda: None)
    return app
