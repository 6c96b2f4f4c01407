"""The warning of an input that floats: who is told of, who is not, and when."""

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from bluepill_sim import BluePill
from bluepill_sim.__main__ import run
from bluepill_sim.extension.library import library_path
from tests.bluepill_sim.machine import Machine
from tests.tools.examples import EXAMPLES

FIRMWARE = EXAMPLES
PROGRAMS = {name: Path(str(FIRMWARE / f"{name}.elf")) for name in ("motors", "sensors", "encoders", "dodge")}
PROGRAMS["foreign"] = Path(__file__).parents[3] / "firmware_foreign" / "foreign.elf"
#: DD1 to DD8, encoder 1, encoder 2.
INPUTS = ("PA4", "PA5", "PA6", "PA7", "PB0", "PB1", "PB10", "PB11", "PB4", "PB3", "PB15", "PC13", "PC14", "PC15")
CORES = [
    "python",
    pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="no native core is built")),
]


@pytest.fixture(params=CORES, autouse=True)
def core(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", request.param)


def wired(program: str, wires: Iterable[str], *, until_ms: int = 60) -> BluePill:
    """Return a board that has run with these wires driven."""
    board = BluePill(PROGRAMS[program])
    for pin in wires:
        board.pin(pin).drive(0)
    board.advance_to(until_ms * 1_000_000)
    return board


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_program_whose_inputs_are_wired_is_not_warned_of(program: str) -> None:
    assert wired(program, INPUTS).warnings == []


@pytest.mark.parametrize("program", ["motors", "sensors", "encoders", "dodge"])
def test_a_forgotten_wire_is_reported_once_with_its_place(program: str) -> None:
    board = wired(program, [pin for pin in INPUTS if pin != "PA6"])
    (text,) = board.warnings
    assert text.startswith("PA6: floating input that nobody drives: it reads 0 here and anything on a board; ")
    assert "configured at set_mode+0x" in text


def test_pins_that_float_together_share_a_line() -> None:
    texts = wired("sensors", []).warnings
    assert [text.partition(":")[0] for text in texts] == [
        "PA4, PA5, PA6, PA7", "PB0, PB1, PB3, PB4, PB10, PB11, PB15", "PC14, PC15",
    ]  # fmt: skip


def test_a_wire_that_goes_away_is_reported_a_millisecond_later() -> None:
    board = wired("sensors", INPUTS)
    board.pin("PA6").drive(1)
    board.pin("PA6").drive(None)
    board.advance_to(60_900_000)
    assert board.warnings == []
    board.advance_to(61_200_000)
    assert [text[:4] for text in board.warnings] == ["PA6:"]
    board.pin("PA6").drive(0)
    board.pin("PA6").drive(None)
    board.advance_to(65_000_000)
    assert len(board.warnings) == 1


def test_a_wire_that_comes_in_time_is_enough() -> None:
    board = wired("sensors", [], until_ms=1)
    for pin in INPUTS:
        board.pin(pin).drive(1)
    board.advance_to(60_000_000)
    assert board.warnings == []


def test_a_forked_board_warns_of_what_the_whole_run_warns_of() -> None:
    half, whole = wired("sensors", [], until_ms=1), wired("sensors", [])
    other = BluePill(PROGRAMS["sensors"])
    other.restore(half.snapshot())
    other.advance_to(60_000_000)
    assert other.warnings == whole.warnings
    assert other.snapshot() == whole.snapshot()


@pytest.fixture
def make_machine() -> Callable[[str], Machine]:
    return lambda source: Machine(source, {})


def configure(machine_source: str) -> str:
    clock = "mov32 r1, #0x40021018\nmov32 r2, #0x4005\nstr r2, [r1, #0]\nldr r2, [r1, #0]\n"
    return clock + "mov32 r1, #0x40010800\n" + machine_source


TWICE = "mov32 r2, #0x44404444\nstr r2, [r1, #0]\nmov32 r2, #0x44444444\nstr r2, [r1, #0]"
#: What a program does to GPIOA_CRL (R1), and the pins that it means.
WRITES = [
    ("mov32 r2, #0x44444444\nstr r2, [r1, #0]", []),  # the reset value: nobody knows who was meant
    ("mov32 r2, #0x44448844\nstr r2, [r1, #0]", []),  # two pulled inputs, the others left as they are
    (TWICE, ["PA4"]),
    ("mov32 r3, #0x0F000000\nldr r2, [r1, #0]\n.half 0x439A\nmov32 r4, #0x04000000\n.half 0x4322\nstr r2, [r1, #0]",
     ["PA6"]),  # bics r2, r3; orrs r2, r4
    ("mov32 r3, #0x0F000000\nldr r2, [r1, #0]\n.half 0x439A\nstr r2, [r1, #0]", []),  # to analog
    (TWICE + "\nmov32 r2, #0x44484444\nstr r2, [r1, #0]", []),  # floating for a moment
    # One store for PA0 to PA2 again and again: lsls r3, r5; bics r2, r3; lsls r4, r5; orrs r2, r4
    (("movs r6, #0\nagain: movs r5, #0\nnext: movs r3, #15\nmovs r4, #4\nldr r2, [r1, #0]\n.half 0x40AB\n"
     ".half 0x439A\n.half 0x40AC\n.half 0x4322\nstr r2, [r1, #0]\nadds r5, #4\ncmp r5, #12\nbne next\n"
     "adds r6, #1\ncmp r6, #4\nbne again"), ["PA0, PA1, PA2"]),
    # The same of PA0 and PA3, with the place in a word of SRAM, which no register has at the end.
    (("mov32 r7, #0x20000200\nmovs r5, #0\nnext: str r5, [r7, #0]\nb over\nover: ldr r0, [r7, #0]\nmovs r3, #15\n"
     "movs r4, #4\nldr r2, [r1, #0]\n.half 0x4083\n.half 0x439A\n.half 0x4084\n.half 0x4322\nmovs r0, #0\n"
     "movs r3, #0\nmovs r4, #0\nstr r2, [r1, #0]\nadds r5, #12\ncmp r5, #24\nbne next"), ["PA0, PA3"]),
]  # fmt: skip


@pytest.mark.parametrize(("source", "pins"), WRITES)
def test_a_pin_is_meant_when_the_program_sets_it(source: str, pins: list[str], make_machine) -> None:
    machine = make_machine(configure(source)).run(5000)
    assert [text.partition(":")[0] for text in machine.board.warnings] == pins


def test_a_receiver_is_fed_with_characters(make_machine) -> None:
    """PA10 is USART1's RX: on a bench a console speaks to it, and no level does."""
    float_it = (
        "mov32 r2, #0x444440B4\nstr r2, [r1, #4]\nmov32 r2, #0x444444B4\nstr r2, [r1, #4]\n"
        "mov32 r1, #0x40013808\nmov32 r2, #69\nstr r2, [r1, #0]\n"
    )
    receiver = "mov32 r2, #0x200C\nstr r2, [r1, #4]"
    assert make_machine(configure(float_it + receiver)).run(5000).board.warnings == []
    (text,) = make_machine(configure(float_it)).run(5000).board.warnings
    assert text.startswith("PA10: ")


def test_a_reset_begins_anew() -> None:
    board = wired("sensors", INPUTS)
    board.reset()
    board.pin("PA6").drive(None)
    board.advance_to(board.now_ns + 100_000)
    assert board.warnings == []
    board.advance_to(board.now_ns + 60_000_000)
    assert [text[:4] for text in board.warnings] == ["PA6:"]


def test_info_asks_for_no_wires(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(PROGRAMS["sensors"]), "--for", "50ms"]) == 0
    assert "nothing unmodelled was touched" in capsys.readouterr().out
