"""Which accesses of a program the native core answers by itself."""

from collections import Counter

import pytest

from bluepill_sim import BluePill
from bluepill_sim.native.engine import NativeEngine
from bluepill_sim.stm32f103 import BASES, PERIPHERAL_BASE
from tests.bluepill_sim.machine import Machine

SPI1, RCC = BASES["SPI1"], BASES["RCC"]
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
