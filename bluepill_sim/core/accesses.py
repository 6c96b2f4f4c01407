"""Which memory each load and store of a block reaches for: base, index and offset.

The native core needs it to find the instruction that has accessed a
peripheral. Accesses relative to SP and PC are left out: they never reach one.

Source: ARMv7-M Architecture Reference Manual A5.2.4 (16 bit), A5.3.5 to A5.3.9
(32 bit).
Invariant: an access is to `base + offset + (index << shift)` and the `count - 1`
words after it, with the registers as they are before the instruction.
"""

from dataclasses import dataclass
from functools import lru_cache

from bluepill_sim.core.block_cost import KNOWN_BLOCKS

_SP, _PC = 13, 15
_FIRST_WIDE = 0xE800


@dataclass(frozen=True, slots=True)
class Access:
    """A load or a store of one instruction."""

    #: The instruction.
    address: int
    is_load: bool
    #: Of each transfer: 1, 2 or 4.
    bytes: int
    base: int
    offset: int = 0
    index: int | None = None
    shift: int = 0
    #: Words of a multiple transfer.
    count: int = 1


#: Narrow loads and stores with an immediate: first five bits → (is a load, bytes).
_IMMEDIATE = {0x60: (False, 4), 0x68: (True, 4), 0x70: (False, 1), 0x78: (True, 1), 0x80: (False, 2), 0x88: (True, 2)}
#: Those with an index register, by bits 11 to 9.
_INDEXED = (
    (False, 4), (False, 2), (False, 1), (True, 1), (True, 4), (True, 2), (True, 1), (True, 2),
)  # fmt: skip


@lru_cache(maxsize=KNOWN_BLOCKS)
def accesses_of(code: bytes, start: int) -> tuple[Access, ...]:
    """Return the accesses of a straight run of code that stands at `start`, in order."""
    found = []
    at = 0
    while at + 2 <= len(code):
        first = code[at] | code[at + 1] << 8
        if first < _FIRST_WIDE or at + 4 > len(code):
            access = _narrow(first, start + at)
            at += 2
        else:
            access = _wide(first, code[at + 2] | code[at + 3] << 8, start + at)
            at += 4
        if access is not None and access.base not in (_SP, _PC):
            found.append(access)
    return tuple(found)


def _narrow(word: int, address: int) -> Access | None:
    base = word >> 3 & 7
    immediate = _IMMEDIATE.get(word >> 8 & 0xF8)
    if immediate is not None:
        is_load, size = immediate
        return Access(address, is_load, size, base, (word >> 6 & 31) * size)
    if word & 0xF000 == 0x5000:
        is_load, size = _INDEXED[word >> 9 & 7]
        return Access(address, is_load, size, base, index=word >> 6 & 7)
    if word & 0xF000 == 0xC000:
        count = (word & 0xFF).bit_count()
        return Access(address, bool(word & 0x800), 4, word >> 8 & 7, count=max(count, 1))
    return None


def _wide(first: int, second: int, address: int) -> Access | None:
    base = first & 15
    if first & 0xFE00 == 0xF800:
        return _wide_single(first, second, address, base)
    if first & 0xFE00 != 0xE800:
        return None
    is_load = bool(first & 0x10)
    if not first & 0x40:  # LDM, STM: increment after or decrement before
        count = max(second.bit_count(), 1)
        return Access(address, is_load, 4, base, 0 if first & 0x80 else -4 * count, count=count)
    if first & 0x120 == 0:  # no writeback, no index: exclusives and table branches
        return _exclusive(first, second, address, base)
    offset = (second & 0xFF) * 4 * (1 if first & 0x80 else -1)
    return Access(address, is_load, 4, base, offset if first & 0x100 else 0, count=2)


def _exclusive(first: int, second: int, address: int, base: int) -> Access | None:
    is_load = bool(first & 0x10)
    if not first & 0x80:
        return Access(address, is_load, 4, base, (second & 0xFF) * 4)
    size = {4: 1, 5: 2}.get(second >> 4 & 15)
    return None if size is None else Access(address, is_load, size, base)


def _wide_single(first: int, second: int, address: int, base: int) -> Access | None:
    code = first >> 5 & 3
    if code == 3:
        return None
    is_load, size = bool(first & 0x10), 1 << code
    if first & 0x80:
        return Access(address, is_load, size, base, second & 0xFFF)
    if second & 0x800:
        is_before = second & 0x400
        offset = (second & 0xFF) * (1 if second & 0x200 else -1)
        return Access(address, is_load, size, base, offset if is_before else 0)
    return Access(address, is_load, size, base, index=second & 15, shift=second >> 4 & 3)


def may_write(code: bytes, at: int) -> int:
    """Return which registers the instruction at offset `at` may write, as a mask: all that it does write, or more."""
    first = code[at] | code[at + 1] << 8
    if first < _FIRST_WIDE or at + 4 > len(code):
        if first & 0xF000 in (0x5000, 0x6000, 0x7000, 0x8000) and not first & 0x0800 and first & 0xFE00 != 0x5600:
            return 0  # a store
        if first & 0xF000 == 0xC000:
            return first & 0xFF | 1 << (first >> 8 & 7)
        return 1 << (first & 7) | 1 << (first >> 8 & 7) | 1 << (first >> 4 & 8 | first & 7)
    second = code[at + 2] | code[at + 3] << 8
    if first & 0xFE40 == 0xE800:
        return second | 1 << (first & 15)
    is_store = first & 0xFE10 == 0xF800
    if is_store and (first & 0x80 or not second & 0x100):
        return 0  # without writeback
    return 1 << (second >> 12) | 1 << (second >> 8 & 15) | 1 << (first & 15)


def may_end_in_it(code: bytes) -> bool:
    """Tell whether what follows some code may be inside an IT block that begins there: in doubt, yes."""
    for at in range(0, len(code) - 1, 2):
        if code[at + 1] == 0xBF and code[at] & 15:
            end = at + 2
            for _ in range(4 - (code[at] & -code[at] & 15).bit_length() + 1):
                if end >= len(code):
                    return True
                end += 4 if code[end + 1] >> 3 >= _FIRST_WIDE >> 11 else 2
    return False


@lru_cache(maxsize=KNOWN_BLOCKS)
def is_ambiguous(code: bytes, start: int) -> bool:
    """Tell whether two accesses look alike although the first one's base may change in between.

    Then the registers at the second could be taken for those of the first.
    """
    seen: dict[tuple[bool, int, int, int, int | None], int] = {}
    for access in accesses_of(code, start):
        key = access.is_load, access.bytes, access.base, access.offset, access.index
        before = seen.setdefault(key, access.address)
        if before != access.address and _changes(access.base, code, before - start, access.address - start):
            return True
    return False


def _changes(register: int, code: bytes, at: int, end: int) -> bool:
    while at < end:
        if may_write(code, at) >> register & 1:
            return True
        at += 4 if (code[at] | code[at + 1] << 8) >= _FIRST_WIDE else 2
    return False
