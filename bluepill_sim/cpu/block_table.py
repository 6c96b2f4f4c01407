"""The blocks that an engine has measured, by address.

Blocks in flash are looked up in one dictionary, which is what a run spends its
time in. Apart from it stand blocks that need more than their cycles added up,
and blocks in writable memory, whose bytes are compared each time.

Invariant: an address is in `plain` only if its block takes no attention and its bytes cannot change during a run.
"""

import ctypes
from collections.abc import Callable

from bluepill_sim.block_cost import Block
from bluepill_sim.cpu.frozen import WritableMemory

#: Returns the costs of the block of `size` bytes at `address`.
Measure = Callable[[int, int], Block]


class BlockTable:
    """Measured blocks."""

    def __init__(self, measure: Measure) -> None:
        self._measure = measure
        #: Blocks that take no attention.
        self.plain: dict[int, Block] = {}
        self._special: dict[int, Block] = {}
        self._in_writable: dict[int, tuple[bytes, Block]] = {}
        self.writable: list[WritableMemory] = []
        #: Whether code has run from writable memory.
        self.ran_writable = False
        #: Whether a block takes exclusive reservations.
        self.uses_exclusive = False

    def at(self, address: int, size: int) -> Block:
        """Return a block that is not in `plain`; measure it if it is new or its bytes have changed."""
        special = self._special.get(address)
        if special is not None:
            return special
        code = self._writable_bytes(address, size)
        if code is not None:
            known = self._in_writable.get(address)
            if known is not None and known[0] == code:
                return known[1]
        block = self._measure(address, size)
        self.uses_exclusive |= block.has_exclusive
        if code is not None:
            self.ran_writable = True
            self._in_writable[address] = code, block
        elif block.needs_attention:
            self._special[address] = block
        else:
            self.plain[address] = block
        return block

    def forget(self) -> None:
        """Measure every block again when it is next entered."""
        self.plain.clear()
        self._special.clear()
        self._in_writable.clear()

    def writable_at(self, address: int) -> WritableMemory | None:
        """Return the writable memory that an address is in; None elsewhere."""
        return next((memory for memory in self.writable if memory[0] <= address < memory[1]), None)

    def _writable_bytes(self, address: int, size: int) -> bytes | None:
        """Return the bytes of a block in writable memory; None elsewhere."""
        memory = self.writable_at(address)
        return None if memory is None else ctypes.string_at(memory[2] + address - memory[0], size)
