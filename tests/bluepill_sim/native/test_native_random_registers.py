"""Programs that write anything to registers of DMA1, ADCs and USARTs: no crash or hang, all cores and slices alike.

A table in SRAM says what is stored where, and how long to wait; DMA may write over it, and over what it likes.
"""

import struct
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.fabric.signals import Oscillation, Waveform
from bluepill_sim.stm32f103 import BASES
from tests.bluepill_sim.machine import Machine

TABLE, BUFFER = 0x2000_1000, 0x2000_3000
ADC1, ADC2, DMA1, USART1 = (BASES[name] for name in ("ADC1", "ADC2", "DMA1", "USART1"))
#: Clocks of everything; the writes of the table, and the wait behind each; then sleep. The handler clears all flags.
PROGRAM = f"""mov32 r0, #0x40021014
movs r1, #1
str r1, [r0, #0]
mov32 r1, #0x5605
str r1, [r0, #4]
mov32 r1, #0x60000
str r1, [r0, #8]
mov32 r4, #{TABLE}
again: ldr r1, [r4, #0]
cmp r1, #0
beq done
ldr r2, [r4, #4]
str r2, [r1, #0]
ldr r3, [r1, #0]
adds r6, r6, r3
ldr r5, [r4, #8]
wait: subs r5, #1
bne wait
adds r4, #12
b again
done: wfi
b done
handler: mov32 r0, #{DMA1}
mov32 r1, #0x0FFFFFFF
str r1, [r0, #4]
movs r1, #0
mov32 r0, #{ADC1}
str r1, [r0, #0]
mov32 r0, #{ADC2}
str r1, [r0, #0]
bx lr"""
VECTORS: dict[int, str | int] = dict.fromkeys(range(16 + 11, 16 + 19), "handler")

REGISTERS = st.one_of(
    st.integers(0, 36).map(lambda n: DMA1 + 4 * n),
    st.tuples(st.sampled_from([ADC1, ADC1, ADC2]), st.integers(0, 19)).map(lambda pair: pair[0] + 4 * pair[1]),
    st.integers(3, 7).map(lambda n: BASES["RCC"] + 4 * n),  # resets and clock gates
    st.tuples(st.sampled_from(["USART1", "USART2", "EXTI", "AFIO", "GPIOA"]), st.integers(0, 5)).map(
        lambda pair: BASES[pair[0]] + 4 * pair[1]
    ),
)
WORDS = st.one_of(
    st.integers(0, 0xFFFF_FFFF), st.integers(0, 40),
    st.sampled_from([BUFFER, BUFFER + 3, TABLE, ADC1 + 0x4C, USART1 + 4, DMA1 + 8, DMA1 + 0x0C, 0x0800_0100, 0x1000]),
)  # fmt: skip
#: What does something more often than chance would.
PLACES = st.sampled_from([BUFFER, BUFFER + 0x20, ADC1 + 0x4C, USART1 + 4, DMA1, 0x4001_0814])
CHANNEL = st.tuples(st.integers(0, 6), st.integers(0, 0x7FFF), st.integers(0, 40), PLACES, PLACES).map(
    lambda row: [
        (DMA1 + 8 + 20 * row[0] + offset, word)
        for offset, word in ((0, 0), (4, row[2]), (8, row[3]), (12, row[4]), (0, row[1] | 1))
    ]
)
CONVERSION = st.tuples(st.sampled_from([ADC1, ADC1, ADC2]), st.integers(0, 1 << 24), st.integers(0, 0xFFF)).map(
    lambda row: [
        (row[0] + 4, row[1]), (row[0] + 0x34, row[2]), (row[0] + 8, 1), (row[0] + 8, 0x1E_0101 | row[1] & 2),
        (row[0] + 8, 0x5E_0101 | row[1] & 2),
    ]
)  # fmt: skip
IRQS = st.integers(0, 0xFF).map(lambda bits: [(0xE000_E100, bits << 11)])
STEPS = st.lists(
    st.one_of(CHANNEL, CHANNEL, CONVERSION, st.tuples(REGISTERS, WORDS).map(lambda pair: [pair]), IRQS),
    min_size=3, max_size=16,
)  # fmt: skip
WAITS = st.lists(st.sampled_from([1, 1, 1, 3, 20, 300]), min_size=4, max_size=4)


def board(core: str, table: bytes) -> BluePill:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        made = Machine(PROGRAM, VECTORS).board
    made.chip.memory.write(TABLE, table)
    made.pin("PA0").set_volts(Oscillation(shape=Waveform.TRIANGLE, low_v=0, high_v=3.3, period_ns=300_000))
    return made


def state(made: BluePill) -> tuple[Any, ...]:
    parts = made.chip.parts.by_name
    return (
        made.cycle, made.pc, made.read_memory(0x2000_0000, 0x5000), [made.register(f"R{n}") for n in range(8)],
        [(name, tuple(part.words[:40]), part.held, part.due_ns) for name, part in parts.items()],
        made.chip.fabric.lines, made.last_rows,
    )  # fmt: skip


def compare(steps: list[list[tuple[int, int]]], waits: list[int], slices: list[int]) -> None:
    rows = [pair for step in steps for pair in step]
    table = b"".join(struct.pack("<III", *row, waits[n % len(waits)]) for n, row in enumerate(rows)) + bytes(12)
    boards = [board(core, table) for core in ("python", "native", "native")]
    for end_ns in (300_000, 1_500_000):
        left = list(slices)
        while left and boards[2].now_ns + left[-1] < end_ns:
            boards[2].advance_to(boards[2].now_ns + left.pop())
        for one in boards:
            one.advance_to(end_ns)
        first, *others = map(state, boards)
        assert others[0] == first
        assert others[1] == first


FUZZED = given(steps=STEPS, waits=WAITS, slices=st.lists(st.integers(100, 200_000), max_size=6))


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@FUZZED
def test_whatever_a_program_writes_both_cores_do_the_same(
    steps: list[list[tuple[int, int]]], waits: list[int], slices: list[int], watchdog: None
) -> None:
    compare(steps, waits, slices)


@pytest.mark.soak
@settings(max_examples=10_000)
@FUZZED
def test_whatever_many_programs_write_both_cores_do_the_same(
    steps: list[list[tuple[int, int]]], waits: list[int], slices: list[int]
) -> None:
    compare(steps, waits, slices)
