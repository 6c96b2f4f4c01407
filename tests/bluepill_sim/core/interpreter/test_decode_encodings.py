"""The interpreter takes instructions apart as the table of encodings says, bit by bit, and gives each its cost."""

import ctypes
from collections.abc import Iterator

import pytest

from bluepill_sim.core.block_cost import measure_block
from bluepill_sim.core.thumb import KINDS, decode
from bluepill_sim.extension.encodings import CYCLES, GIVEN_UP, NARROW, REFILL, UNDEFINED, WIDE, Encoding, Kind, find
from bluepill_sim.extension.library import library
from tests.bluepill_sim.machine import FLASH

#: By their numbers in C, and the letters in the order of `struct decoded`.
OPERATIONS = (UNDEFINED, *dict.fromkeys(row.operation for row in (*NARROW, *WIDE) if row.operation != UNDEFINED))
LETTERS = "dnmtaijhbspuwcr"


def taken_apart(word: int, *, is_wide: bool) -> tuple[str, dict[str, int]]:
    """Return the operation and the fields that C finds."""
    found = (ctypes.c_uint32 * (1 + len(LETTERS)))()
    library().interpreter_take_apart(word, is_wide, ctypes.addressof(found))
    return OPERATIONS[found[0]], dict(zip(LETTERS, found[1:], strict=True))


def words_of(row: Encoding) -> Iterator[int]:
    """Yield words about a row: each of its bits set, clear, and turned over, with the others clear and set."""
    bits = 32 if row.is_wide else 16
    free = ~row.mask & (1 << bits) - 1
    for base in (row.value, row.value | free):
        yield base
        yield from (base ^ 1 << bit for bit in range(bits))


@pytest.mark.parametrize("table", [NARROW, WIDE], ids=["16 bits", "32 bits"])
def test_each_bit_of_each_encoding_is_looked_at_as_the_table_has_it(table: tuple[Encoding, ...]) -> None:
    is_wide = table is WIDE
    words = {word for row in table for word in words_of(row) if word >> 16 >= 0xE800 or not is_wide}
    wrong = []
    for word in sorted(words):
        row = find(word, is_wide=is_wide)
        operation, fields = taken_apart(word, is_wide=is_wide)
        expected = {} if row is None else row.values(word)
        if operation != (UNDEFINED if row is None else row.operation) or fields != dict.fromkeys(LETTERS, 0) | expected:
            wrong.append(f"{word:#x}: {operation} {fields}, not {row} {expected}")
    assert not wrong, "\n".join(wrong[:5])


#: TRM 18.2.1, with what docs/core.md calls chosen: cycles, refill of a branch that is taken, given up for an exception.
COSTS = {
    Kind.PLAIN: (1, 0, 0), Kind.MULTIPLY_ACCUMULATE: (2, 0, 0), Kind.MULTIPLY_LONG: (4, 0, 1),
    Kind.MULTIPLY_ACCUMULATE_LONG: (5, 0, 1), Kind.DIVIDE: (7, 0, 1), Kind.LOAD: (2, 0, 0),
    Kind.LOAD_LITERAL: (2, 0, 0), Kind.LOAD_PC: (2, 3, 0), Kind.STORE: (1, 0, 0), Kind.STORE_INDEXED: (2, 0, 0),
    Kind.LOAD_MULTIPLE: (1, 3, 1), Kind.STORE_MULTIPLE: (1, 0, 1), Kind.LOAD_DUAL: (1, 0, 0),
    Kind.STORE_DUAL: (1, 0, 0), Kind.EXCLUSIVE: (2, 0, 0), Kind.BRANCH: (1, 1, 0), Kind.CALL: (1, 1, 0),
    Kind.BRANCH_REGISTER: (1, 2, 0), Kind.TABLE_BRANCH: (1, 3, 0), Kind.MASK_CHANGE: (2, 0, 0),
    Kind.READ_SPECIAL: (1, 0, 0), Kind.BARRIER: (1, 0, 0), Kind.SYNCHRONISE: (4, 0, 0), Kind.SEND_EVENT: (1, 0, 0),
    Kind.WAIT_EVENT: (1, 0, 0), Kind.WAIT_INTERRUPT: (1, 0, 0), Kind.YIELD: (1, 0, 0), Kind.IF_THEN: (1, 0, 0),
    Kind.SUPERVISOR_CALL: (1, 0, 0), Kind.BREAKPOINT: (1, 0, 0),
}  # fmt: skip


def test_each_kind_costs_what_the_manual_says() -> None:
    assert {kind: (CYCLES[kind], REFILL.get(kind, 0), int(kind in GIVEN_UP)) for kind in Kind} == COSTS
    assert tuple(COSTS) == KINDS


def test_each_encoding_costs_what_its_kind_does_where_blocks_are_measured() -> None:
    """Of a block of the instruction alone, at no wait state: straight on, and by a branch."""
    words = [(row, row.value | ~row.mask & (0x1000 if row.is_wide else 1)) for row in (*NARROW, *WIDE)]  # R1 for Rt
    words += [(row, row.value | 0xF000) for row in WIDE if row.operation in {"LDR_I", "LDR_X", "LDR_LITERAL"}]  # R15
    for row, word in words:
        halfwords = (word >> 16, word & 0xFFFF) if row.is_wide else (word,)
        code = b"".join(half.to_bytes(2, "little") for half in halfwords)
        found = find(word, is_wide=row.is_wide)
        kind = Kind.PLAIN if found is None else found.kind
        if kind in {Kind.LOAD, Kind.LOAD_LITERAL} and row.is_wide and word >> 12 & 15 == 15:
            kind = Kind.LOAD_PC
        one = decode(code.ljust(4, b"\0"), 0, FLASH)
        assert one.kind is kind, row
        cycles, refill, _ = COSTS[kind]
        block = measure_block(code, FLASH, 0, has_prefetch=True)
        straight = cycles + one.count
        taken = straight + (0 if kind is Kind.LOAD_MULTIPLE and not one.loads_pc else refill)
        goes_straight_on = one.always_branches and one.destination == FLASH + len(code)
        assert (block.straight, block.taken) == (taken if goes_straight_on else straight, taken), row
        assert bool(block.given_up) is bool(COSTS[kind][2]), row
