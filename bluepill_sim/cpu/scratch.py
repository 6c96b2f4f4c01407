"""A page of code of our own, for what only an instruction can do: breaking the exclusive reservation.

Invariant: it lies where an STM32F103C has nothing, outside the regions that never execute.
"""

import ctypes

from bluepill_sim.block_cost import Block
from bluepill_sim.cpu.core import Core

#: chosen: see the module's text.
BASE, _BYTES = 0x9FFF_FC00, 0x400
#: CLREX, WFI.
_CODE = bytes.fromhex("bff32f8f 30bf")
_BLOCK = Block(BASE, BASE + len(_CODE), 0, 0, {})


class Scratch:
    """The page of one core."""

    def __init__(self, core: Core, table: dict[int, Block]) -> None:
        """Map it; `table` is where the engine looks blocks up."""
        self._core = core
        self._table = table
        core.map_memory(BASE, ctypes.create_string_buffer(_CODE, _BYTES), "x")

    def clear_exclusive(self) -> None:
        """Run CLREX, between runs; the block hook is called for it."""
        self._table[BASE] = _BLOCK
        self._core.start(BASE | 1)
