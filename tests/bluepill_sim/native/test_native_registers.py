"""Which accesses of a program the native core answers by itself."""

from collections import Counter

import pytest

from bluepill_sim import BluePill
from bluepill_sim.core.blocks import NO_BLOCK
from bluepill_sim.native.engine import NativeEngine
from bluepill_sim.stm32f103 import BASES, PERIPHERAL_BASE
from tests.bluepill_sim.machine import Machine

SPI1, RCC, ADC1, TIM2 = (BASES[name] for name in ("SPI1", "RCC", "ADC1", "TIM2"))
#: `.half 0x4211` is tst r1, r2. SPI1 on, as the master, at PCLK2 / 4.
#: Each word is sent once TXE is set, and taken by polling RXNE.
POLLING = f"""mov32 r0, #{RCC}
mov32 r1, #0x1000
str r1, [r0, #24]
mov32 r0, #{SPI1}
mov32 r1, #0x34C
str r1, [r0, #0]
again: ldr r1, [r0, #8]
movs r2, #2
.half 0x4211
beq again
str r6, [r0, #12]
full: ldr r1, [r0, #8]
movs r2, #1
.half 0x4211
beq full
ldr r1, [r0, #12]
adds r6, #1
b again"""


#: ADC1 and TIM2 get their clocks and some words, and are reset; then their clocks are taken away. Again and again.
GATES = f"""mov32 r0, #{RCC}
mov32 r3, #{ADC1}
mov32 r4, #{TIM2}
again: mov32 r1, #0x200
movs r2, #1
str r1, [r0, #24]
str r2, [r0, #28]
movs r5, #17
str r5, [r3, #44]
str r5, [r4, #44]
str r1, [r0, #12]
str r2, [r0, #16]
ldr r5, [r3, #44]
adds r6, r6, r5
ldr r5, [r4, #44]
adds r7, #1
movs r1, #0
str r1, [r0, #12]
str r1, [r0, #16]
str r1, [r0, #24]
str r1, [r0, #28]
b again"""


#: PA0 and PA1 become outputs and analog inputs in turn: bics r2, r3; orrs r2, r4.
MODES = f"""mov32 r0, #{RCC}
movs r1, #4
str r1, [r0, #24]
mov32 r0, #{BASES["GPIOA"]}
movs r3, #255
again: movs r4, #0x22
ldr r2, [r0, #0]
.half 0x439A
.half 0x4322
str r2, [r0, #0]
movs r4, #0
ldr r2, [r0, #0]
.half 0x439A
.half 0x4322
str r2, [r0, #0]
adds r7, #1
b again"""


def asked(board: BluePill) -> "Counter[tuple[str, int]]":
    """Count from now on what the native core asks Python: ("read" or "write", address)."""
    found: Counter[tuple[str, int]] = Counter()
    engine = board.chip.engine
    assert isinstance(engine, NativeEngine)
    base, size, read, write = engine._regions[0]
    assert base == PERIPHERAL_BASE

    def on_read(unicorn: int, offset: int, count: int, user: int) -> int:
        found["read", base + offset] += 1
        return read(unicorn, offset, count, user)

    def on_write(unicorn: int, offset: int, count: int, value: int, user: int) -> None:
        found["write", base + offset] += 1
        write(unicorn, offset, count, value, user)

    engine._regions[0] = base, size, on_read, on_write
    return found


@pytest.fixture(autouse=True)
def native(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "native")


def test_a_device_in_c_is_polled_up_to_its_event_without_python(watchdog: None) -> None:
    board = Machine(POLLING, {}).board
    board.run_for("20 us")
    found = asked(board)
    board.run_for("1 ms")
    assert board.register("R6") > 150
    assert not found


def test_clock_gates_and_resets_of_devices_in_c_are_not_pythons(watchdog: None) -> None:
    board = Machine(GATES, {}).board
    board.run_for("20 us")
    found = asked(board)
    board.run_for("1 ms")
    assert board.register("R7") > 100
    assert (board.register("R6"), board.register("R5")) in {(0, 0), (0, 17), (0, 0xFFFF)}
    assert not found


def test_pins_that_change_their_modes_ask_python_only_at_first(watchdog: None) -> None:
    board = Machine(MODES, {}).board
    board.run_for("20 us")
    found = asked(board)
    forced, count = board.chip.fabric.forced, [0]

    def counted(address: int) -> tuple[int, dict[int, int]]:
        count[0] += 1
        return forced(address)

    board.chip.fabric.forced = counted
    board.run_for("1 ms")
    assert board.register("R7") > 100
    assert (found, count) == (Counter(), [0])


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_reset_by_rcc_leaves_a_device_as_that_of_the_chip_does(
    core: str, monkeypatch: pytest.MonkeyPatch, watchdog: None
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    board = Machine("wait: b wait", {}).board
    parts = board.chip.parts.by_name
    rcc, tim, usart = parts["RCC"], parts["TIM2"], parts["USART2"]
    fresh = [(bytes(part.words), part.held[64:], part.due_ns) for part in (tim, usart)]
    rcc.write(0x1C, 4, 1 | 1 << 17)
    for offset, word in ((0x2C, 100), (0x34, 50), (0x0C, 1), (0x00, 1)):
        tim.write(offset, 4, word)
    usart.write(0x0C, 4, 0x2008)
    assert tim.due_ns is not None
    rcc.write(0x10, 4, 1)
    assert (bytes(tim.words), tim.due_ns) == (fresh[0][0], fresh[0][2])
    assert usart.words[3] == 0x2008
    rcc.write(0x10, 4, 1 | 1 << 17)
    assert bytes(usart.words) == fresh[1][0]
    tim.write(0x2C, 4, 7)
    rcc.write(0x10, 4, 1 << 17)  # neither has risen
    assert tim.words[11] == 7


def test_a_native_core_that_has_no_fabric_says_so_and_runs_nothing() -> None:
    engine = NativeEngine(lambda _address, _size: NO_BLOCK)
    for run in (engine.run, engine.step, engine.go_on, lambda _: engine.next_event):
        with pytest.raises(RuntimeError, match="runs on a fabric alone"):
            run(100)
