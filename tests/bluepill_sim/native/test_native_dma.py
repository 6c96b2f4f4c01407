"""DMA1 under programs that run, poll and sleep: the same on both cores, in any slices, in bulk or not."""

from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.stm32f103 import line_of
from tests.bluepill_sim.machine import Machine

DMA1, SRAM, WORDS = 0x4002_0000, 0x2000_1000, 300
EN, TCIE, HTIE, DIR, CIRC, PINC, MINC, MEM2MEM = (1 << n for n in (0, 1, 2, 4, 5, 6, 7, 14))
WORD = 2 << 8 | 2 << 10
ENABLE = "mov32 r0, #0x40021014\nmovs r1, #1\nstr r1, [r0, #0]"


def channel(n: int, control: int, count: int, peripheral: int, memory: int) -> str:
    words = ((4, count), (8, peripheral), (12, memory), (0, control))
    at = DMA1 + 8 + 20 * (n - 1)
    return f"mov32 r0, #{at}\n" + "\n".join(f"mov32 r1, #{word}\nstr r1, [r0, #{offset}]" for offset, word in words)


COPY = channel(2, EN | HTIE | TCIE | PINC | MINC | MEM2MEM | WORD, WORDS, SRAM, SRAM + 0x800)
#: A second channel of higher priority whose requests come in between.
REQUESTED = channel(1, EN | CIRC | PINC | MINC | WORD | 2 << 12, 7, SRAM + 0x40, SRAM + 0xE00)
IRQ_ON = "mov32 r0, #0xE000E100\nmov32 r1, #0x1000\nstr r1, [r0, #0]"
HANDLER = "\nb stop\nhandler: log #9\nmov32 r0, #0x40020004\nmov32 r1, #0x10\nstr r1, [r0, #0]\nbx lr"
PROGRAMS = {
    "sleeps": "again: wfi\nb again",
    "spins": "again: b again",
    "polls the flag":
        f"mov32 r0, #{DMA1}\nmov32 r2, #0x20\nagain: ldr r1, [r0, #0]\nsubs r3, r1, r2\ncmp r3, #0x10\nbne again",
    "polls the count":
        f"mov32 r0, #{DMA1 + 0x20}\nagain: ldr r1, [r0, #0]\nadds r6, #1\ncmp r1, #0\nbne again\nstr r6, [r7, #0]",
    "watches the last word":
        f"mov32 r0, #{SRAM + 0x800 + 4 * WORDS - 4}\nagain: ldr r1, [r0, #0]\ncmp r1, #0\nbeq again\nlog #3",
    "computes": "again: adds r6, #1\nmuls r5, r6\nadds r4, #3\nb again",
}  # fmt: skip


def machine(name: str, core: str, *, irq: bool) -> Machine:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        text = f"{ENABLE}\n{REQUESTED}\n{IRQ_ON if irq else ''}\n{COPY}\n{PROGRAMS[name]}{HANDLER}"
        made = Machine(text, {16 + 12: "handler"})
    for n in range(WORDS):
        made.board.chip.memory.write(SRAM + 4 * n, (n * 0x01_0101 + 1).to_bytes(4, "little"))
    return made


def state(board: BluePill) -> tuple[Any, ...]:
    dma = board.chip.parts.by_name["DMA1"]
    return (
        board.cycle, board.pc, board.read_memory(0x2000_0000, 0x2000), tuple(dma.words[:37]), dma.held, dma.due_ns,
        [board.register(f"R{n}") for n in range(8)], board.last_rows,
    )  # fmt: skip


@pytest.mark.parametrize("name", PROGRAMS)
@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    irq=st.booleans(),
    slices=st.lists(st.integers(100, 90_000), min_size=2, max_size=8),
    pulses=st.lists(st.integers(10_000, 150_000), max_size=4),
)
def test_a_copy_of_memory_is_the_same_on_both_cores_however_the_program_waits(
    name: str, irq: bool, slices: list[int], pulses: list[int], watchdog: None
) -> None:
    boards = [machine(name, core, irq=irq).board for core in ("python", "native", "native")]
    line = line_of("TIM2.cc3_dma")
    for pulse in sorted(pulses):
        for board in boards:
            while board is boards[2] and slices and board.now_ns + slices[-1] < pulse:
                board.advance_to(board.now_ns + slices.pop())
            board.advance_to(pulse)
            board.chip.fabric.set_line(line, True)
            board.chip.fabric.set_line(line, False)
    seen = []
    for end_ns in (150_000, 190_000, 260_000):
        for board in boards:
            while board is boards[2] and slices and board.now_ns + slices[-1] < end_ns:
                board.advance_to(board.now_ns + slices.pop())
            board.advance_to(end_ns)
        seen.append([state(board) for board in boards])
        assert seen[-1][1] == seen[-1][0]
        assert seen[-1][2] == seen[-1][0]
    assert boards[0].read_memory(SRAM + 0x800, 4 * WORDS) == boards[0].read_memory(SRAM, 4 * WORDS)
    assert seen[0][0][3][1 + 5 * 1 + 2] > 0  # not yet done at the first look


@pytest.mark.parametrize("wait", ["wfi", "nop\n" * 40])
def test_code_that_a_copy_writes_over_is_run_as_written(wait: str, watchdog: None) -> None:
    # `movs r5, #1; bx lr` becomes `movs r5, #2; bx lr` while the core sleeps, and while it runs.
    call = f"mov32 r4, #{SRAM + 1}\nblx r4\nstr r5, [r7, #0]\nadds r7, #4\n"
    copy = channel(2, EN | TCIE | PINC | MINC | MEM2MEM | WORD, 4, SRAM + 0x40, SRAM)
    for core in ("python", "native"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            made = Machine(f"{ENABLE}\n{IRQ_ON}\n{call}{copy}\n{wait}\n{call}{HANDLER}", {16 + 12: "handler"})
        made.board.chip.memory.write(SRAM, bytes.fromhex("0125704700bf00bf"))
        made.board.chip.memory.write(SRAM + 0x40, bytes.fromhex("0225704700bf00bf") * 2)
        made.board.advance_to(100_000)
        assert made.log == [1, 9, 2]
