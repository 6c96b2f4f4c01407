"""Accesses that are warned of: C makes them alone once Python need not hear of them; the warnings stay as they are."""

import struct
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.memory.bus import UNCLOCKED_NS
from bluepill_sim.stm32f103 import BASES
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_random_registers import state

TABLE = 0x2000_1000
RCC, USART1 = BASES["RCC"], BASES["USART1"]
#: Does the table's rows (how, address, value) over and over: str, strh, strb, ldr, 60 times ldr.
PROGRAM = f"""again: mov32 r4, #{TABLE}
next: ldr r0, [r4, #0]
ldr r1, [r4, #4]
ldr r2, [r4, #8]
adds r4, #12
cmp r0, #0
beq again
cmp r0, #1
beq word
cmp r0, #2
beq half
cmp r0, #3
beq byte
cmp r0, #4
beq load
movs r5, #60
poll: ldr r3, [r1, #0]
subs r5, #1
bne poll
b next
word: str r2, [r1, #0]
b next
half: strh r2, [r1, #0]
b next
byte: strb r2, [r1, #0]
b next
load: ldr r3, [r1, #0]
adds r6, r6, r3
b next"""


def alias(address: int, bit: int) -> int:
    return 0x4200_0000 + (address - 0x4000_0000) * 32 + 4 * bit


#: Some with a clock, some that are given one and lose it, some that never have one; holes; the core's own.
ENABLES = st.sampled_from([(1, RCC + 0x18, 0), (1, RCC + 0x18, 4), (1, RCC + 0x18, 0x4005), (1, RCC + 0x1C, 1)])
PLACES = st.one_of(
    st.sampled_from(["USART1", "TIM2", "GPIOA", "GPIOB", "DMA1", "I2C2", "SPI1", "CRC", "AFIO"]).flatmap(
        lambda name: st.integers(0, 12).map(lambda n: BASES[name] + 4 * n)
    ),
    st.sampled_from([0x4001_0850, 0x4001_5000, 0x4002_2000, 0xE000_ED94, 0xE000_EE00, 0xE000_EF04]),
)
BITS = st.tuples(PLACES.filter(lambda at: at < 0x5000_0000), st.integers(0, 31)).map(lambda pair: alias(*pair))
SRAM_BITS = st.integers(0, 63).map(lambda n: 0x2200_0000 + 0x4000 * 32 + 4 * n)
VALUES = st.one_of(st.integers(0, 0xFFFF_FFFF), st.sampled_from([0, 0, 1, 0xFF]))
ROWS = st.lists(
    st.one_of(
        ENABLES,
        st.tuples(st.sampled_from([1, 4, 5]), st.one_of(PLACES, BITS, SRAM_BITS), VALUES),
        st.tuples(st.just(2), PLACES.flatmap(lambda at: st.sampled_from([at, at + 2])), VALUES),
        st.tuples(st.just(3), PLACES.flatmap(lambda at: st.integers(at, at + 3)), VALUES),
    ),
    min_size=1, max_size=8,
)  # fmt: skip


def board(core: str, rows: list[tuple[int, int, int]]) -> tuple[BluePill, list[tuple[int, str]]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        made = Machine(PROGRAM, {}).deafen().board
    made.chip.memory.write(TABLE, b"".join(struct.pack("<III", *row) for row in rows) + bytes(4))
    reported: list[tuple[int, str]] = []
    made.subscribe_warnings(lambda text: reported.append((made.chip.engine.access_cycle, text)))
    return made, reported


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=ROWS, slices=st.lists(st.integers(100, 400_000), max_size=4))
def test_both_cores_warn_alike_whatever_the_accesses(
    rows: list[tuple[int, int, int]], slices: list[int], watchdog: None
) -> None:
    compare(rows, slices)


@pytest.mark.soak
@settings(max_examples=5_000)
@given(rows=ROWS, slices=st.lists(st.integers(100, 400_000), max_size=4))
def test_both_cores_warn_alike_whatever_many_accesses(rows: list[tuple[int, int, int]], slices: list[int]) -> None:
    compare(rows, slices)


def compare(rows: list[tuple[int, int, int]], slices: list[int]) -> None:
    boards = [board(core, rows) for core in ("python", "native", "native")]
    for length in slices:
        boards[2][0].advance_to(boards[2][0].now_ns + length)
    for one, _ in boards:
        one.advance_to(2_200_000)
    first, *others = [(reported, state(one)) for one, reported in boards]
    assert others[0] == first
    assert others[1] == first


def asked_of(made: BluePill) -> list[int]:
    """Return a list that gets the offset of each access that Python is asked for from now on."""
    regions: Any = made.chip.engine._regions  # type: ignore[attr-defined]
    asked: list[int] = []

    def heard(raw: Any) -> Any:
        def call(uc: int, offset: int, *rest: int) -> Any:
            asked.append(offset)
            return raw(uc, offset, *rest)

        return call

    regions[:] = [(base, size, heard(read), heard(write)) for base, size, read, write in regions]
    return asked


@pytest.mark.parametrize(
    ("row", "most"),
    [
        ((5, USART1, 0), 60),  # for a millisecond, where a loop that waits is one round; then the warning
        ((1, USART1 + 4, 1), 1),
        ((1, USART1 + 4, 0), 0),  # what a reset leaves: nothing to be told
        ((1, BASES["RCC"] + 0x50, 1), 1),
        ((4, BASES["RCC"] + 0x50, 1), 1),
        ((1, 0xE000_EE00, 1), 1),
        ((2, BASES["RCC"] + 0x14, 4), 0),
        ((4, alias(USART1, 5), 0), 3),
        ((1, alias(USART1 + 4, 5), 1), 3),
        ((4, 0x2200_0000, 0), 0),
        ((1, 0x2200_0000, 1), 0),
    ],
)
def test_python_hears_of_what_is_warned_of_once(row: tuple[int, int, int], most: int) -> None:
    made, reported = board("native", [row])
    asked = asked_of(made)
    made.advance_to(20_000_000)
    assert len(asked) <= most
    assert len(reported) == (most > 0)


def test_a_narrow_write_that_is_warned_of_is_python_s_once() -> None:
    odr = BASES["GPIOA"] + 0x0C
    made, reported = board("native", [(1, RCC + 0x18, 4), (3, odr, 0x5A), (3, odr, 0xA5), (2, odr, 0x1234)])
    asked = asked_of(made)
    made.advance_to(5_000_000)
    assert (len(asked), len(reported)) == (1, 1)
    assert made.chip.parts.by_name["GPIOA"].words[3] in (0x5A5A, 0xA5A5, 0x1234)


def test_a_narrow_write_that_needs_no_warning_leaves_the_warning_to_the_first_that_does() -> None:
    crl = BASES["GPIOA"]
    rows = [(1, RCC + 0x18, 4), (2, crl, 0x4444), (3, crl, 0x44), (2, crl, 0x4443)]  # the first two change nothing
    compare(rows, [1_000])
    _, reported = boards = board("native", rows)
    boards[0].advance_to(100_000)
    assert len(reported) == 1


@pytest.mark.parametrize("place", [USART1, BASES["DMA1"], alias(BASES["GPIOA"] + 8, 3)])
def test_the_warning_comes_at_the_same_access_where_a_loop_polls(place: int) -> None:
    compare([(5, place, 0)], [400_000, 700_000])


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_clock_that_was_on_meanwhile_begins_the_millisecond_anew(core: str) -> None:
    made, reported = board(core, [(5, USART1, 0)])
    made.advance_to(600_000)
    for gates in (0x4000, 0):
        made.chip.parts.rcc.write(0x18, 4, gates)
    made.advance_to(1_595_000)
    assert not reported
    made.advance_to(1_620_000)
    assert len(reported) == 1


@pytest.mark.parametrize("core", ["native", "python"])
def test_the_millisecond_is_one_at_another_frequency_too(core: str) -> None:
    made, reported = board(core, [(5, USART1, 0)])
    made.advance_to(600_000)
    made.chip.parts.rcc.write(4, 4, 8 << 4)  # HCLK is 4 MHz
    made.advance_to(995_000)
    assert not reported
    made.advance_to(1_020_000)
    assert len(reported) == 1


def test_the_warning_comes_with_the_first_read_a_millisecond_after_the_first() -> None:
    slow, slow_reported = board("python", [(4, USART1, 0)])
    quick, quick_reported = board("native", [(4, USART1, 0)])
    quick.advance_to(1_500_000)
    slow.advance_to(1_500_000)
    assert quick_reported == slow_reported
    first_ns = slow.chip._bus.read_unclocked_ns["USART1"]
    round_ns = 5_000  # chosen: longer than a round of the program at 8 MHz
    assert 0 <= slow_reported[0][0] * 125 - first_ns - UNCLOCKED_NS < round_ns


def test_a_restored_board_warns_again_and_the_clock_ends_the_silence() -> None:
    made, reported = board("native", [(5, USART1, 0)])
    made.advance_to(500_000)
    early = made.snapshot()
    made.advance_to(3_000_000)
    made.restore(early)
    made.advance_to(3_000_000)
    assert len(reported) == 2
    assert reported[0] == reported[1]
    made.chip.parts.rcc.write(0x18, 4, 0x4000)
    made.advance_to(3_100_000)
    assert made.register("R3") == 0xC0, "its SR reads"


#: Programs halfwords of the last page from R4 on: one that is erased, then the same again, which is an error.
PROGRAMMER = f"""mov32 r0, #{BASES["FLASH"]}
mov32 r1, #0x45670123
str r1, [r0, #4]
mov32 r1, #0xCDEF89AB
str r1, [r0, #4]
movs r1, #1
str r1, [r0, #16]
mov32 r4, #0x0800FC00
more: movs r5, #0
strh r6, [r4, #0]
ldr r3, [r0, #12]
ldrh r2, [r4, #0]
adds r5, r5, r3
str r3, [r7, #0]
str r2, [r7, #4]
adds r7, #8
movs r1, #0x34
str r1, [r0, #12]
adds r6, #3
cmp r6, #30
bne past
strh r6, [r4, #0]
past: adds r4, #2
b more"""


@pytest.mark.parametrize("slices", [[], [1_000, 60_000, 52_500, 52_499, 3]])
def test_a_halfword_takes_its_time_and_shows_alike_on_both_cores(slices: list[int]) -> None:
    boards = []
    for core in ("python", "native", "native"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            boards.append(Machine(PROGRAMMER, {}).deafen().board)
    for length in slices:
        boards[2].advance_to(boards[2].now_ns + length)
    for one in boards:
        one.advance_to(1_000_000)
    first, *others = [(state(one), one.read_memory(0x0800_FC00, 64)) for one in boards]
    assert first[1][:6] == bytes((0, 0, 3, 0, 6, 0))
    assert others == [first, first]
