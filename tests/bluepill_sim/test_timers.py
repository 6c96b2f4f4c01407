"""A compiled program uses the timers: PWM, its measure, an encoder, interrupts, waits; and says what it saw."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

pytest.importorskip("unicorn")

from bluepill_sim.board import BluePill
from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.debug.monitor import Monitor
from tests.bluepill_sim.firmware.compiled import COMPILER, compiled

pytestmark = [
    pytest.mark.skipif(shutil.which(COMPILER) is None, reason=f"{COMPILER} is not installed"),
    pytest.mark.usefixtures("watchdog"),
]

#: In ns, when the program has come to its end.
END_NS = 25_000_000
#: 72 MHz / 20 kHz; CH3N is high but for 900 ticks and a dead time of 72; 100 - 130 is 65506 in 16 bits.
EXPECTED = """\
period 3600
high 2628
forward 100
back 65506
direction 1
three-updates-us 3000
two-polled-us 2000
one-pulse-us 200
waited-us 2000
ready
"""


@pytest.fixture(scope="session", params=["-O2", pytest.param("-Og", marks=pytest.mark.soak)])
def elf(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled("timers", tmp_path_factory.mktemp("timers"), request.param)


def run(elf: Path, slice_ns: int) -> tuple[str, BluePill]:
    board = BluePill(elf)
    text: list[str] = []

    def take(rows: Sequence[tuple[int, int]]) -> None:
        text.extend(chr(word) for word, _ in rows)

    board.usart1.subscribe(take)
    while board.now_ns < END_NS:
        board.advance_to(min(board.now_ns + slice_ns, END_NS))
    return "".join(text), board


@pytest.mark.slow
def test_the_program_sees_what_its_registers_promise_on_both_cores_in_any_slices(
    elf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ends = []
    for core, slice_ns in (("native", END_NS), ("native", 77_777), ("python", 1_234_567)):
        monkeypatch.setenv("P2OS_CORE", core)
        text, board = run(elf, slice_ns)
        assert text == EXPECTED
        wave = board.pin("PA8").wave
        assert wave is not None
        assert (wave.frequency_hz, wave.duty) == (20_000, 0.25)
        assert board.fault is None
        assert not [warning for warning in board.warnings if "TIM" in warning]
        ends.append(state(board))
    assert all(end == ends[0] for end in ends)


def state(board: BluePill) -> tuple[object, ...]:
    timers = [board.chip.parts.by_name[f"TIM{n}"] for n in (1, 2, 3, 4)]
    return board.cycle, [(bytes(timer.words), timer.held, timer.due_ns) for timer in timers]


@pytest.mark.parametrize("at_ns", [2_500_000, 4_100_000, 9_000_000, 15_000_001])
def test_a_snapshot_goes_on_on_another_board(elf: Path, at_ns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "native")
    board, other = BluePill(elf), BluePill(elf)
    board.advance_to(at_ns)
    other.restore(board.snapshot())
    rows: list[bytes] = []
    for one in (board, other):
        found = bytearray()
        one.subscribe_pins(["PA8", "PB1", "PB6"], found.extend)
        one.advance_to(END_NS)
        rows.append(bytes(found))
    assert rows[0] == rows[1]
    assert rows[0]
    assert state(board) == state(other)


def test_gdb_sees_a_wave_at_its_pin(elf: Path) -> None:
    board = BluePill(elf)
    board.advance_to(5_000_000)
    monitor = Monitor(Execution(LoneChip(board), lambda _text: None))
    assert monitor.run("pin PA8").split()[1:5] == ["20000", "Hz,", "25.0", "%"]
    assert "CEN=0x1" in monitor.run("registers TIM1")


def test_a_burst_of_dma_renews_three_compare_registers_with_each_update(tmp_path: Path) -> None:
    """TIM3_UP is channel 3 (RM0008 table 78); DCR makes three words by DMAR CCR1 to CCR3."""
    (tmp_path / "idle.bin").write_bytes(bytes.fromhex("00500020 09000008 fee7fee7"))
    board = BluePill(tmp_path / "idle.bin")
    parts = board.chip.parts.by_name
    parts["RCC"].write(0x14, 4, 0x15)
    parts["RCC"].write(0x1C, 4, 2)
    words = [100, 200, 300, 110, 210, 310]
    assert board.chip.memory.write(0x2000_1000, b"".join(word.to_bytes(2, "little") for word in words))
    for offset, word in (
        (0x38, 0x4000_044C),
        (0x3C, 0x2000_1000),
        (0x34, 6),
        (0x30, 1 << 10 | 1 << 8 | 1 << 7 | 1 << 4 | 1),
    ):
        parts["DMA1"].write(offset, 4, word)
    for offset, word in ((0x2C, 799), (0x48, 2 << 8 | 13), (0x0C, 0x100), (0x00, 1)):
        parts["TIM3"].write(offset, 4, word)
    seen = []
    for at_ns in (100_000, 105_000, 200_000, 205_000, 305_000):
        board.advance_to(at_ns)
        seen.append([board.registers("TIM3")[f"CCR{n}"].word for n in (1, 2, 3, 4)])
    first, second = [*words[:3], 0], [*words[3:], 0]
    assert seen == [[0, 0, 0, 0], first, first, second, second]
    assert board.registers("DMA1")["CNDTR3"].word == 0
