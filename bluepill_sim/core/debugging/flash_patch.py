"""What the FPB puts in the place of words of the Code region: the pages as fetches and loads see them.

Theory of operation. A comparator that remaps has the core take a word of a table in SRAM in place of its own. Unicorn
asks for each page, and tells a fetch from a load: a page with such a word is shown to fetches as one copy, to loads as
another, while stores, and what anybody else reads of it, are as ever. A block that may have such a word in it looks at
the table before it runs; where that has changed since the copies were made, they are made anew.

Nothing of this exists while no comparator remaps.

Chosen: comparators count from the next block on, and so does a change of the table; any load from the word of a
comparator of literals is remapped, whatever its base and its width; of two comparators for one word the lower number
counts; a vector is not remapped; a comparator whose word, or whose place in the table, is not in memory does nothing.

Source: ARMv7-M Architecture Reference Manual C1.11; TRM r2p0 7.3.
Invariant: between runs the copies hold what was in memory when `apply` was called last.
"""

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass

from bluepill_sim.core.blocks import HostMemory
from bluepill_sim.extension.layout import VIEW_BYTES, VIEWS_BASE, VIEWS_BYTES

_COMPARATORS, _TABLE_ALIGNMENT = 8, 32
_WORD_BYTES = 4


@dataclass(frozen=True, slots=True)
class Remapped:
    """Which words are remapped: the number of the comparator by the word's address."""

    #: Where the table is.
    table: int = 0
    instructions: tuple[tuple[int, int], ...] = ()
    literals: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class View:
    """A page, and where its fetches and its loads find it."""

    page: int
    code: int
    data: int


class FlashPatch:
    """The copies of one core."""

    def __init__(self) -> None:
        self.buffer = ctypes.create_string_buffer(VIEWS_BYTES)
        self._wanted = Remapped()
        #: Whether something else is wanted, or is in memory, than when `apply` was called last.
        self.has_changed = False
        self._words: dict[int, int] = {}
        self._loads = False
        #: Where the table is in the host's memory, and what it held.
        self.table_at, self.table = 0, b""

    @property
    def is_on(self) -> bool:
        """Whether any word is remapped."""
        return bool(self._words) or self._loads

    def choose(self, wanted: Remapped) -> None:
        """Say what is to be remapped from the next run on."""
        self.has_changed |= wanted != self._wanted
        self._wanted = wanted

    def touch(self, address: int, size: int) -> None:
        """Take note that bytes of memory have changed."""
        wanted = (*self._wanted.instructions, *self._wanted.literals)
        self.has_changed |= any(
            word & -VIEW_BYTES < address + size and address < (word & -VIEW_BYTES) + VIEW_BYTES for word, _ in wanted
        )

    def apply(self, memories: list[HostMemory]) -> tuple[View, ...]:
        """Make the copies; return their pages."""
        self.has_changed = False
        wanted = self._wanted
        self.table_at = _host(memories, wanted.table, _COMPARATORS * _WORD_BYTES) or 0
        self.table = ctypes.string_at(self.table_at, _COMPARATORS * _WORD_BYTES) if self.table_at else b""
        code = self._in_memory(wanted.instructions, memories)
        data = self._in_memory(wanted.literals, memories)
        self._words, self._loads = code, bool(data)
        free = iter(range(0, VIEWS_BYTES, VIEW_BYTES))
        return tuple(
            View(page, self._copy(page, code, memories, free), self._copy(page, data, memories, free))
            for page in sorted({word & -VIEW_BYTES for word in (*code, *data)})
        )

    def concerns(self, address: int, size: int) -> bool:
        """Tell whether what a block does depends on the table."""
        return self._loads or any(word < address + size and address < word + _WORD_BYTES for word in self._words)

    def is_stale(self) -> bool:
        """Tell whether the table holds something else than the copies."""
        return self.is_on and ctypes.string_at(self.table_at, len(self.table)) != self.table

    def fetched(self, address: int, code: bytes) -> bytes:
        """Return code as it is fetched, from what is in memory."""
        if not self._words:
            return code
        found = bytearray(code)
        for word, number in self._words.items():
            for n in range(_WORD_BYTES):
                if 0 <= (at := word + n - address) < len(found):
                    found[at] = self.table[_WORD_BYTES * number + n]
        return bytes(found)

    def _in_memory(self, words: Iterable[tuple[int, int]], memories: list[HostMemory]) -> dict[int, int]:
        found: dict[int, int] = {}
        for word, number in words:
            if self.table_at and _host(memories, word, _WORD_BYTES) is not None:
                found.setdefault(word, number)
        return found

    def _copy(self, page: int, words: dict[int, int], memories: list[HostMemory], free: Iterable[int]) -> int:
        """Return where a page is found that has these words: itself, where it has none."""
        wanted = {word: number for word, number in words.items() if word & -VIEW_BYTES == page}
        if not wanted:
            return page
        at = next(iter(free))
        host = _host(memories, page, VIEW_BYTES)
        copy = bytearray(ctypes.string_at(host, VIEW_BYTES) if host is not None else bytes(VIEW_BYTES))
        for word, number in wanted.items():
            copy[word - page : word - page + _WORD_BYTES] = self.table[_WORD_BYTES * number :][:_WORD_BYTES]
        ctypes.memmove(ctypes.addressof(self.buffer) + at, bytes(copy), VIEW_BYTES)
        return VIEWS_BASE + at


def _host(memories: list[HostMemory], address: int, size: int) -> int | None:
    """Return where bytes are in the host's memory; None where not all of them are in one."""
    return next((host + address - first for first, end, host in memories if first <= address <= end - size), None)
