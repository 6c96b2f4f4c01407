"""Basic blocks as an engine keeps them: the measured ones, and one in which a run was halted.

What a block costs is worked out by `block_cost.py`; entering and charging blocks
is the engine's business.

Theory of operation. Blocks in flash are looked up in one dictionary, which is
what a run spends its time in. Apart from it stand blocks that need more than
their cycles added up, and blocks in writable memory, whose bytes are compared
each time. Unicorn ends a run that a hook stops only after the IT block that it
is in, and makes the access that the hook looked at; so the state before the
instruction is kept (`Frozen`), and what runs after the hook is undone. Going on
from there costs what was left of the block's cycles, and ends when the halted
run would have (`RestOfBlock`): so halts change no time.

Invariant: an address is in `plain` only if its block takes no attention and its
bytes cannot change during a run; there is a rest only between a halt and the run
that goes on from it.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.core.block_cost import NO_BLOCK, BasicBlock
from bluepill_sim.core.halts import Halt
from bluepill_sim.core.unicorn_core import CoreContext, Reg, UnicornCore
from simbase.state import Stateful

#: ITSTATE in CPSR and xPSR: bits 1 to 0 at 26, bits 7 to 2 at 15.
IT_BITS = 0x0600_FC00

#: First address, address after, place in the host's memory.
HostMemory = tuple[int, int, int]

#: Returns the costs of the block of `size` bytes at `address`.
Measure = Callable[[int, int], BasicBlock]


class BlockTable(Stateful):
    """Measured blocks."""

    STATE = ("uses_exclusive",)
    DERIVED = ("plain", "_special", "_in_writable", "ran_writable", "holds_exclusive", "entered", "ways")

    def __init__(self, measure: Measure) -> None:
        self._measure = measure
        #: Tells whether a block, by its address and size, is to be looked at each time that it is entered.
        self.must_look: Callable[[int, int], bool] = lambda _address, _size: False
        #: Blocks that take no attention.
        self.plain: dict[int, BasicBlock] = {}
        self._special: dict[int, BasicBlock] = {}
        self._in_writable: dict[int, tuple[bytes, BasicBlock]] = {}
        self.writable: list[HostMemory] = []
        #: Whether code has run from writable memory.
        self.ran_writable = False
        #: Whether a block takes exclusive reservations: one that has run, and one that is kept here.
        self.uses_exclusive = self.holds_exclusive = False
        #: The first address of every block that this engine has ever entered; a snapshot takes none back.
        self.entered: set[int] = set()
        #: (the address at which a block ends, whether it was left for another one) of every block that was left.
        self.ways: set[tuple[int, bool]] = set()

    def at(self, address: int, size: int) -> BasicBlock:
        """Return a block that is not in `plain`; measure it if it is new or its bytes have changed."""
        self.entered.add(address)
        special = self._special.get(address)
        if special is not None:
            return special
        code = self._writable_bytes(address, size)
        if code is not None:
            known = self._in_writable.get(address)
            if known is not None and known[0] == code:
                return known[1]
        block = self._measure(address, size)
        if block.has_exclusive:
            self.uses_exclusive = self.holds_exclusive = True
        if code is not None:
            self.ran_writable = True
            self._in_writable[address] = code, block
        elif block.needs_attention or self.must_look(address, size):
            self._special[address] = block
        else:
            self.plain[address] = block
        return block

    def forget(self) -> None:
        """Measure every block again when it is next entered."""
        self.plain.clear()
        self._special.clear()
        self._in_writable.clear()
        self.holds_exclusive = False

    def forget_in(self, first: int, end: int) -> None:
        """Measure again the blocks of which something stands from `first` up to before `end`."""
        for table in (self.plain, self._special):
            for start in [start for start, block in table.items() if start < end and block.end > first]:
                del table[start]

    def writable_at(self, address: int) -> HostMemory | None:
        """Return the writable memory that an address is in; None elsewhere."""
        return next((memory for memory in self.writable if memory[0] <= address < memory[1]), None)

    def _writable_bytes(self, address: int, size: int) -> bytes | None:
        """Return the bytes of a block in writable memory; None elsewhere."""
        memory = self.writable_at(address)
        return None if memory is None else ctypes.string_at(memory[2] + address - memory[0], size)


@dataclass(frozen=True, slots=True)
class Frozen:
    """The state before the instruction at which a hook ended a run: all that running on would change."""

    halt: Halt
    block: BasicBlock
    cycle: int
    stop_at: int
    it_state: int
    registers: CoreContext
    #: What each writable memory held.
    memories: tuple[bytes, ...]

    def put_back(self, core: UnicornCore, writable: list[HostMemory]) -> None:
        """Undo what has run since: the core stands exactly before the instruction, ITSTATE included."""
        for (first, end, at), data in zip(writable, self.memories, strict=True):
            if ctypes.string_at(at, end - first) != data:
                ctypes.memmove(at, data, len(data))
                core.drop_code(first, end - first)
        core.context = self.registers
        flags = core.registers[Reg.CPSR] & ~IT_BITS
        core.registers[Reg.CPSR] = flags | (self.it_state & 3) << 25 | (self.it_state >> 2) << 10
        # Not every hook finds it up to date; nothing but a comparison of states looks at it.
        core.registers[Reg.PC] = self.halt.pc | flags >> 5 & 1


class RestOfBlock(Stateful):
    """What is left of a block that a debugger halted inside; empty most of the time."""

    STATE = ("halted_in",)
    DERIVED = ("block", "resumed", "has_raised", "_stop_at", "_displaced")

    def __init__(self) -> None:
        #: None where the core stands at a boundary.
        self.block: BasicBlock | None = None
        #: The one that the present run began with.
        self.resumed: BasicBlock | None = None
        self._stop_at = 0
        #: Whether an access before the halt raised an exception: it interrupts before the next one.
        self.has_raised = False
        #: The block of the table that usually stands in its place.
        self._displaced: BasicBlock | None = None

    @property
    def halted_in(self) -> tuple[BasicBlock, int, bool] | None:
        """What is left of the block, when the run was to end, and `has_raised`; None at a boundary."""
        return None if self.block is None else (self.block, self._stop_at, self.has_raised)

    @halted_in.setter
    def halted_in(self, halted_in: tuple[BasicBlock, int, bool] | None) -> None:
        self.block, self._stop_at, self.has_raised = halted_in or (None, 0, False)

    def is_at(self, pc: int) -> bool:
        """Tell whether the core, at `pc`, stands inside a block."""
        return self.block is not None and self.block.start == pc

    def keep(self, block: BasicBlock, pc: int, stop_at: int, *, has_raised: bool) -> None:
        """Halt inside `block`, before the instruction at `pc`, in a run that was to end at `stop_at`."""
        if block is not NO_BLOCK:
            self.block, self._stop_at, self.has_raised = block.rest(pc), stop_at, has_raised

    def resume(self, table: dict[int, BasicBlock], stop_at: int) -> None:
        """Prepare a run that begins inside the block."""
        if self.block is not None:
            self._displaced = table.pop(self.block.start, None)
            self._stop_at = min(stop_at, self._stop_at)

    def enter(self, table: dict[int, BasicBlock], address: int, size: int) -> tuple[BasicBlock | None, int]:
        """Return it, or None where its code has changed, and when the run is to end."""
        rest, self.block = self.block, None
        if self._displaced is not None:
            table[address] = self._displaced
        if rest is not None and (rest.start != address or rest.end != address + size):
            rest = None
        self.resumed = rest
        return rest, self._stop_at


def copy_of(writable: list[HostMemory]) -> tuple[bytes, ...]:
    """Return what each writable memory holds."""
    return tuple(ctypes.string_at(at, end - first) for first, end, at in writable)


def it_state_of(psr: int) -> int:
    """Return ITSTATE of a CPSR or xPSR, its bits in the architecture's order."""
    return psr >> 25 & 3 | (psr >> 10 & 0x3F) << 2
