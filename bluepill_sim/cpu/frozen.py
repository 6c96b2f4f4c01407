"""The state before an instruction where a hook ends a run.

Unicorn ends a run that a hook stops only after the IT block that it is in, and
makes the access that a hook looked at. What runs after the hook is therefore
undone: registers and memories are put back.

Invariant: `put_back` leaves the core exactly before the instruction, ITSTATE included.
"""

import ctypes
from dataclasses import dataclass

from bluepill_sim.block_cost import Block
from bluepill_sim.cpu.core import Core, CoreSnapshot
from bluepill_sim.cpu.halt import Halt
from bluepill_sim.cpu.registers import Register

#: ITSTATE in CPSR and xPSR: bits 1 to 0 at 26, bits 7 to 2 at 15.
IT_BITS = 0x0600_FC00

#: First address, address after, place in the host's memory.
WritableMemory = tuple[int, int, int]


def it_state_of(psr: int) -> int:
    """Return ITSTATE of a CPSR or xPSR, its bits in the architecture's order."""
    return psr >> 25 & 3 | (psr >> 10 & 0x3F) << 2


@dataclass(frozen=True, slots=True)
class Frozen:
    """All that running on would change."""

    halt: Halt
    block: Block
    cycle: int
    stop_at: int
    it_state: int
    registers: CoreSnapshot
    #: What each writable memory held.
    memories: tuple[bytes, ...]

    def put_back(self, core: Core, writable: list[WritableMemory]) -> None:
        """Undo what has run since."""
        for (first, end, at), data in zip(writable, self.memories, strict=True):
            if ctypes.string_at(at, end - first) != data:
                ctypes.memmove(at, data, len(data))
                core.drop_code(first, end - first)
        core.load(self.registers)
        flags = core.registers[Register.CPSR] & ~IT_BITS
        core.registers[Register.CPSR] = flags | (self.it_state & 3) << 25 | (self.it_state >> 2) << 10


def copy_of(writable: list[WritableMemory]) -> tuple[bytes, ...]:
    """Return what each writable memory holds."""
    return tuple(ctypes.string_at(at, end - first) for first, end, at in writable)
