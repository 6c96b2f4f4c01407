"""The rest of a block, when a debugger halted the core inside of it.

Going on, it costs what was left of the block's cycles, and its run ends when
the halted one would have: so halts change no time.

Invariant: there is a rest only between a halt and the run that goes on from it.

The state before an instruction where a hook ends a run.

Unicorn ends a run that a hook stops only after the IT block that it is in, and
makes the access that a hook looked at. What runs after the hook is therefore
undone: registers and memories are put back.

Invariant: `put_back` leaves the core exactly before the instruction, ITSTATE included.

The blocks that an engine has measured, by address.

Blocks in flash are looked up in one dictionary, which is what a run spends its
time in. Apart from it stand blocks that need more than their cycles added up,
and blocks in writable memory, whose bytes are compared each time.

Invariant: an address is in `plain` only if its block takes no attention and its bytes cannot change during a run.

What the numbers mean with which Unicorn ends a run.

Source: unicorn.h, and target/arm of Unicorn 2.1 (EXCP_ numbers).
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.core.block_cost import NO_BLOCK, Block
from bluepill_sim.core.machine import (
    FETCH_PROTECTED,
    FETCH_UNMAPPED,
    WRITE_PROTECTED,
    WRITE_UNMAPPED,
    Core,
    CoreSnapshot,
    Register,
)
from bluepill_sim.core.thumb import Kind
from bluepill_sim.timing import Halt, HaltKind

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


#: Branches to these addresses are exception returns in handler mode (ARMv7-M B1.5.8).
FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0

#: UC_ERR_EXCEPTION, and the number of the interrupt that it stands for.
_DENIED, _PREFETCH_ABORT = 21, 3

#: 3 and 8 are told apart by the PC.
_INTERRUPTS = {
    2: HaltKind.SUPERVISOR_CALL,
    3: HaltKind.EXECUTE_NEVER,
    4: HaltKind.UNALIGNED,
    7: HaltKind.BKPT,
    8: HaltKind.EXECUTE_NEVER,
    17: HaltKind.NO_COPROCESSOR,
}

_BAD_ACCESSES = {
    WRITE_UNMAPPED: HaltKind.WRITE_ERROR,
    WRITE_PROTECTED: HaltKind.WRITE_ERROR,
    FETCH_UNMAPPED: HaltKind.FETCH_ERROR,
    FETCH_PROTECTED: HaltKind.FETCH_ERROR,
}


def kind_of_interrupt(number: int, pc: int) -> HaltKind:
    """Return what an exception of Unicorn's own numbering is."""
    kind = _INTERRUPTS.get(number, HaltKind.UNDEFINED)
    if kind is HaltKind.EXECUTE_NEVER and pc >= FIRST_EXCEPTION_RETURN:
        return HaltKind.EXCEPTION_RETURN
    return kind


def kind_of_bad_access(access: int) -> HaltKind:
    """Return what an access to no memory, or against its protection, is."""
    return _BAD_ACCESSES.get(access, HaltKind.READ_ERROR)


def kind_of_invalid(block: Block, pc: int, *, is_thumb: bool) -> HaltKind | None:
    """Return what an instruction is that Unicorn does not know; None for one that does nothing.

    It takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC.
    """
    last = block.last if pc == block.end else None
    if last is Kind.YIELD:
        return None
    if last is Kind.WAIT_EVENT:
        return HaltKind.WAIT_EVENT
    return HaltKind.UNDEFINED if is_thumb else HaltKind.INVALID_STATE


def halt_without_reason(error: int, block: Block, pc: int) -> Halt:
    """Tell why Unicorn came back without having called anything: WFI, or a fetch that its TLB denied.

    Raises:
        RuntimeError: it was not; a bug here.
    """
    if error == 0 and block.last is Kind.WAIT_INTERRUPT and pc == block.end:
        return Halt(HaltKind.WAIT_INTERRUPT, pc)
    if error == _DENIED:
        return Halt(kind_of_interrupt(_PREFETCH_ABORT, pc), pc)
    raise RuntimeError(f"Unicorn stopped at {pc:#010x} with error {error}")


#: Start, end, straight, taken, offsets, ITSTATEs, kind of the last instruction, when the run was to end.
RestSnapshot = tuple[int, int, int, int, tuple[tuple[int, int], ...], tuple[tuple[int, int], ...], str, int]


class RestOfBlock:
    """What is left of a block; empty most of the time."""

    def __init__(self) -> None:
        #: None where the core stands at a boundary.
        self.block: Block | None = None
        #: The one that the present run began with.
        self.resumed: Block | None = None
        self._stop_at = 0
        #: The block of the table that usually stands in its place.
        self._displaced: Block | None = None

    def is_at(self, pc: int) -> bool:
        """Tell whether the core, at `pc`, stands inside a block."""
        return self.block is not None and self.block.start == pc

    def keep(self, block: Block, pc: int, stop_at: int) -> None:
        """Halt inside `block`, before the instruction at `pc`, in a run that was to end at `stop_at`."""
        if block is not NO_BLOCK:
            self.block, self._stop_at = block.rest(pc), stop_at

    def resume(self, table: dict[int, Block], stop_at: int) -> None:
        """Get ready for a run that begins inside the block."""
        if self.block is not None:
            self._displaced = table.pop(self.block.start, None)
            self._stop_at = min(stop_at, self._stop_at)

    def enter(self, table: dict[int, Block], address: int, size: int) -> tuple[Block | None, int]:
        """Return it, or None where its code has changed, and when the run is to end."""
        rest, self.block = self.block, None
        if self._displaced is not None:
            table[address] = self._displaced
        if rest is not None and (rest.start != address or rest.end != address + size):
            rest = None
        self.resumed = rest
        return rest, self._stop_at

    def snapshot(self) -> RestSnapshot | None:
        """Return the state as plain values."""
        b = self.block
        if b is None:
            return None
        offsets, it_states = tuple(b.offsets.items()), tuple(b.it_states.items())
        return b.start, b.end, b.straight, b.taken, offsets, it_states, b.last.value, self._stop_at

    def restore(self, snapshot: RestSnapshot | None) -> None:
        """Put back what `snapshot` returned."""
        self.block = None
        if snapshot is None:
            return
        start, end, straight, taken, offsets, it_states, last, self._stop_at = snapshot
        self.block = block = Block(start, end, straight, taken, dict(offsets))
        block.it_states, block.has_it, block.last = dict(it_states), True, Kind(last)
