"""The interpreter does what Unicorn does: single instructions of each encoding, sequences, IT blocks."""

import random
from itertools import combinations, islice, product
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.extension.encodings import Encoding, find
from tests.bluepill_sim.core.interpreter.lockstep import (
    FLASH,
    FLASH_BYTES,
    ROWS,
    RUN_BY_UNICORN,
    SRAM,
    SRAM_BYTES,
    Case,
    Lockstep,
    any_value,
    flags_of,
    is_open,
    made,
    places,
)

#: chosen: of each encoding, and sequences: some quickly, more in `make test`.
EACH = (6, pytest.param(20, marks=pytest.mark.slow))
SEQUENCES = (1500, pytest.param(6000, marks=pytest.mark.slow))
SP = 0x2000_0800


def assert_same(lockstep: Lockstep, cases: list[Case]) -> None:
    """Hold the two to the same results; name the first cases that differ."""
    found = [f"{case}\n  {text}" for case, text in islice(lockstep.differences(cases), 5)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("each", EACH)
def test_each_encoding_does_what_it_does_on_unicorn(lockstep: Lockstep, each: int) -> None:
    dice = random.Random(38 + each)
    assert_same(lockstep, [made(dice, [row]) for row in ROWS for _ in range(each)])


def test_shifts_by_a_register_are_unicorns_for_every_amount(lockstep: Lockstep) -> None:
    """LSL, LSR, ASR and ROR of R1 by R2 into R1, as T1 and as T2 with and without flags: about 0, 32 and 256."""
    shifts = [*(0x4011 | number << 6 for number in (2, 3, 4, 7)), *(0xFA01_F102 | n << 20 for n in range(8))]
    amounts = (0, 1, 2, 30, 31, 32, 33, 34, 63, 64, 65, 127, 128, 254, 255, 256, 257, 0x8000_001F)
    cases = [
        Case((shift,), (0, value, amount, *(0,) * 10, 0x2000_0400, 0), carry << 29)
        for shift, value, amount, carry in product(shifts, (0x8000_0001, 0xC000_0000, 0x7FFF_FFFE), amounts, (0, 1))
    ]
    assert_same(lockstep, cases)


def with_fields(row: Encoding, dice: random.Random, **fixed: int) -> Case | None:
    """Return a case of an encoding with some of its fields as given; nothing where that is another, or left open."""
    word = row.value | dice.getrandbits(32 if row.is_wide else 16) & ~row.mask & (
        0xFFFF_FFFF if row.is_wide else 0xFFFF
    )
    for letter, value in fixed.items():
        above = value
        for low, bits in reversed(row.fields[letter]):
            word = word & ~(((1 << bits) - 1) << low) | (above & (1 << bits) - 1) << low
            above >>= bits
    if find(word, is_wide=row.is_wide) is not row or is_open(row, word):
        return None
    registers = [any_value(dice) for _ in range(15)]
    registers[13] &= ~3
    return Case((word,), tuple(registers), flags_of(dice), dice.getrandbits(4))


def test_each_field_at_its_bounds_and_each_register_that_is_special_do_what_they_do_on_unicorn(
    lockstep: Lockstep,
) -> None:
    """Numbers 0, 1, the largest and the next; R13, R15, and one register in two places; lists of none, one and all."""
    dice = random.Random(41)
    cases = []
    for row in ROWS:
        bits = {letter: sum(count for _, count in runs) for letter, runs in row.fields.items()}
        registers = [letter for letter in "dnmta" if bits.get(letter) == 4]
        wanted = [{letter: number} for letter in registers for number in (13, 15)]
        wanted += [{one: 3, other: 3} for one, other in combinations(registers, 2)]
        for letter in bits.keys() - {*"dnmtac"}:
            most = (1 << bits[letter]) - 1
            wanted += [{letter: number} for number in sorted({0, 1, most - 1, most} - {-1})]
        if "r" in bits and "n" in bits:
            lists = (0x01, 0x06, 0x08, 0x0C, 0x18, 0x09)  # R3, the base, is alone, first, last, or not there
            wanted += [{"n": 3, "r": list_, **({"w": n} if "w" in bits else {})} for list_ in lists for n in (0, 1)]
        cases += [case for each in wanted if (case := with_fields(row, dice, **each)) is not None]
    assert len(cases) > 1200
    assert_same(lockstep, cases)


@pytest.mark.parametrize("count", SEQUENCES)
def test_sequences_do_what_they_do_on_unicorn(lockstep: Lockstep, count: int) -> None:
    dice = random.Random(39 + count)
    assert_same(lockstep, [made(dice) for _ in range(count)])


@pytest.mark.parametrize("each", EACH)
def test_each_encoding_in_an_it_block_does_what_it_does_on_unicorn(lockstep: Lockstep, each: int) -> None:
    dice = random.Random(40 + each)
    it = next(row for row in ROWS if row.operation == "IT")
    barred = {"IT", "CBZ", "CBNZ", "B_T1", "B_T3", "CPS", "ISB"}
    rows = [row for row in ROWS if row.operation not in barred]
    cases = [made(dice, [it, row]) for row in rows for _ in range(each)]
    assert_same(lockstep, [case for case in cases if case.words[0] & 0xF == 8])  # of one instruction
    assert any(case.words[0] & 0xF == 8 for case in cases)


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Draw a case that shrinks to few and simple instructions."""
    rows = draw(st.lists(st.sampled_from(ROWS), min_size=1, max_size=4))
    return made(random.Random(draw(st.integers(0, 1 << 32))), rows)


@given(case=cases())
def test_what_hypothesis_draws_does_what_it_does_on_unicorn(lockstep: Lockstep, case: Case) -> None:
    it_at = [n for n, word in enumerate(case.words) if word >> 8 == 0xBF]
    if not it_at:  # what stands in an IT block is chosen by `made` elsewhere
        assert_same(lockstep, [case])


def test_what_the_manual_leaves_undefined_is_undefined_though_unicorn_runs_it(lockstep: Lockstep) -> None:
    registers = (0x2000_0400,) * 15
    cases = [Case((word,), registers, 0) for word in RUN_BY_UNICORN]
    lockstep.own.put(cases)
    for at, case in zip(places(), cases, strict=False):
        *_, happened = lockstep.own.run(case, at)
        assert happened[-1] == ("undefined", at), str(case)  # type: ignore[index]  # the last of what is compared


def test_n_and_z_may_both_be_set(lockstep: Lockstep) -> None:
    both = 0b11 << 30
    for word, flags in ((0xF3EF_8000, both), (0xBF00, both)):  # MRS R0, APSR; NOP
        case = Case((word,), (0,) * 13 + (SP, 0), both)
        assert_same(lockstep, [case])
        lockstep.own.put([case])
        seen: tuple[Any, ...] = lockstep.own.run(case, next(places()))
        assert seen[19] & 0xF800_0000 == flags
    assert seen[0] == 0
    conditions = [
        Case((0xBF08 | condition << 4, 0x1C40), (5,) * 13 + (SP, 0), both) for condition in range(14)
    ]  # IT c; ADD R0, #1
    assert_same(lockstep, conditions)


@pytest.mark.parametrize("condition", range(14))
def test_a_condition_is_met_by_the_same_flags(lockstep: Lockstep, condition: int) -> None:
    registers = (7,) * 13 + (SP, 0)
    branch, it = 0xD000 | condition << 8 | 2, 0xBF08 | condition << 4
    cases = [Case(words, registers, flags << 27) for flags in range(32) for words in ((branch,), (it, 0x3001))]
    assert_same(lockstep, cases)


def test_shifts_at_their_bounds_carry_what_they_carry_on_unicorn(lockstep: Lockstep) -> None:
    by_register = (0x4088, 0x40C8, 0x4108, 0x41C8, 0xFA10_F001, 0xFA30_F001, 0xFA50_F001, 0xFA70_F001)
    by_constant = (0x07C8, 0x0048, 0x0808, 0x0FC8, 0x0848, 0x1008, 0x17C8, 0xEA5F_0031, 0xEA5F_70F1)
    values = (1, 0x8000_0000, 0x7FFF_FFFF, 0xFFFF_FFFF, 0x4000_0002)
    amounts = (0, 1, 31, 32, 33, 64, 255, 256)
    cases = [
        Case((word,), (value, amount, *(0,) * 11, SP, 0), flags << 27)
        for word in by_register
        for value in values
        for amount in amounts
        for flags in (0, 4)
    ]
    # RRX, LSR #32 and ASR #32 as operands: of MOV, MVN, ADD, SUB, AND, ADC and TST, with flags and without.
    moves = (0xEA4F_0000, 0xEA5F_0000, 0xEA6F_0000)
    others = (0xEB02_0000, 0xEB12_0000, 0xEBA2_0000, 0xEA02_0000, 0xEA12_0000, 0xEB42_0000, 0xEA12_0F00)
    by_constant += tuple(word | shift | 1 for word in (*moves, *others) for shift in (0x10, 0x20, 0x30))
    cases += [
        Case((word,), (0, value, 3, *(0,) * 10, SP, 0), flags << 27)
        for word in by_constant
        for value in values
        for flags in (0, 4)
    ]
    assert_same(lockstep, cases)


def test_divisions_at_their_bounds_give_what_they_give_on_unicorn(lockstep: Lockstep) -> None:
    values = (0, 1, 2, 7, 0x7FFF_FFFF, 0x8000_0000, 0x8000_0001, 0xFFFF_FFFF)
    cases = [
        Case((word,), (5, dividend, divisor, *(0,) * 10, SP, 0), 0)
        for word in (0xFB91_F0F2, 0xFBB1_F0F2)  # SDIV, UDIV R0, R1, R2
        for dividend in values
        for divisor in values
    ]
    assert_same(lockstep, cases)


def test_accesses_at_the_ends_of_memory_do_what_they_do_on_unicorn(lockstep: Lockstep) -> None:
    """The last word, what reaches over the end or begins there, and the same at the first."""
    accesses = (0x6808, 0x8808, 0x7808, 0x5E88, 0x6008, 0x8008, 0x7008)  # LDR, LDRH, LDRB, LDRSH, STR, STRH, STRB
    several = (0xC909, 0xC109, 0xE9D1_0300, 0xE9C1_0300)  # LDM, STM, LDRD, STRD of R0 and R3 from R1
    edges = (SRAM, SRAM + SRAM_BYTES, FLASH, FLASH + FLASH_BYTES)
    cases = [
        Case((word,), (0x1234_5678, edge + off, *(0,) * 11, SP, 0), 0)
        for edge in edges
        for word in (*accesses, *several)
        for off in (range(-6, 3) if word in accesses else (-12, -8, -4, 0, 4))
    ]
    assert_same(lockstep, cases)


@pytest.mark.soak
def test_a_million_cases_do_what_they_do_on_unicorn(lockstep: Lockstep) -> None:
    seed = random.SystemRandom().getrandbits(32)
    dice = random.Random(seed)
    for _ in range(1000):
        try:
            assert_same(lockstep, [made(dice) for _ in range(1000)])
        except AssertionError as error:
            raise AssertionError(f"seed {seed}: {error}") from error


def test_flags_are_any() -> None:
    dice = random.Random(1)
    assert {flags_of(dice) >> 27 for _ in range(1000)} == set(range(32))
