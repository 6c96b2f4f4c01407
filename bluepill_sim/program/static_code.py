"""A program's instructions, cut into basic blocks as they stand in the flash.

A recorded block tells only where it began; how far it went follows from its
instructions and from where the next one began.

Invariant: a block ends at the first instruction that may leave the straight line, or sleeps.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from bluepill_sim.core.thumb import Instruction, decode
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.program.alterations import word_of

#: Instructions after which execution may go on elsewhere.
_LEAVING = frozenset({
    Kind.BRANCH, Kind.CALL, Kind.BRANCH_REGISTER, Kind.TABLE_BRANCH, Kind.LOAD_PC, Kind.SUPERVISOR_CALL,
    Kind.BREAKPOINT,
})  # fmt: skip
#: Instructions that end a block and go on after it.
_SLEEPING = frozenset({Kind.WAIT_INTERRUPT, Kind.WAIT_EVENT})
#: chosen: longer than any real block; code that never branches is no code.
_MAX_INSTRUCTIONS = 1024


@dataclass(frozen=True, slots=True)
class StaticBlock:
    """A straight run of instructions up to one that may leave it."""

    start: int
    #: The address after it.
    end: int
    #: Where each instruction starts.
    addresses: tuple[int, ...]
    last: Instruction
    #: Whether the last instruction leaves only under a condition.
    is_conditional: bool
    #: Whether it is BL or BLX: it comes back.
    is_call: bool

    @property
    def can_fall_through(self) -> bool:
        """Whether it may go on at its end."""
        return self.is_conditional or self.last.kind not in _LEAVING or self.last.kind is Kind.SUPERVISOR_CALL

    def ends_before(self, following: int | None) -> bool:
        """Tell whether the block was left before its last instruction had run, when `following` ran next.

        The engine ends a translation at pages and after instructions that change its state; a fault ends it anywhere.
        Where the block could have gone there by itself, it has. None is not known: False.
        """
        if following not in self.addresses or self.last.destination == following:
            return False
        return following != self.start or not self._leaves_indirectly

    @property
    def _leaves_indirectly(self) -> bool:
        return self.last.destination is None and (self.last.kind in _LEAVING or self.last.loads_pc)

    def executed(self, following: int | None) -> tuple[int, ...]:
        """Return the instructions that ran, when the next one that ran was `following`; None: not known."""
        if following is None or not self.ends_before(following):
            return self.addresses
        return tuple(address for address in self.addresses if address < following)


class StaticCode:
    """Blocks of one program, cut when they are first asked for."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._blocks: dict[int, StaticBlock] = {}

    def block(self, address: int) -> StaticBlock:
        """Return the block that starts at an address; an empty one where no memory is."""
        found = self._blocks.get(address)
        if found is None:
            found = self._blocks[address] = self._cut(address)
        return found

    def reachable(self, entries: Iterable[int], ends: Callable[[int], int]) -> dict[int, StaticBlock]:
        """Return the blocks that direct branches lead to from some addresses, each inside its own function.

        Args:
            entries: where to begin: functions, and whatever is known to have run (targets of switches).
            ends: returns the address after the function that an address is in; 0 where none is.
        """
        found: dict[int, StaticBlock] = {}
        left = list(entries)
        while left:
            at = left.pop()
            if at in found or not ends(at):
                continue
            block = found[at] = self.block(at)
            if not block.addresses:
                continue
            if block.can_fall_through or block.is_call:
                left.append(block.end)
            if block.last.destination is not None and not block.is_call and ends(block.last.destination) == ends(at):
                left.append(block.last.destination)
        return found

    def _cut(self, start: int) -> StaticBlock:
        addresses: list[int] = []
        at, conditional_left = start, 0
        last = Instruction(start, 2, Kind.PLAIN)
        word = 0
        is_in_it = False
        for _ in range(_MAX_INSTRUCTIONS):
            code = self._memory.read(at, 4) or self._memory.read(at, 2)
            if code is None:
                break
            last = decode(code, 0, at)
            word = word_of(code[: last.size])
            addresses.append(at)
            at += last.size
            is_in_it = conditional_left > 0
            conditional_left = max(0, conditional_left - 1)
            if last.kind is Kind.IF_THEN:
                mask = word & 0xF
                conditional_left = 4 - ((mask & -mask).bit_length() - 1)
            if last.kind in _LEAVING or last.kind in _SLEEPING or last.loads_pc:
                break
        leaves = last.kind in _LEAVING or last.loads_pc
        is_conditional = leaves and (is_in_it or _has_condition(last, word))
        is_call = last.kind is Kind.CALL or (last.size == 2 and word & 0xFF80 == 0x4780)
        return StaticBlock(start, at, tuple(addresses), last, is_conditional, is_call)


def _has_condition(instruction: Instruction, word: int) -> bool:
    """Tell whether a branch has a condition of its own: B<c>, CBZ, CBNZ (ARMv7-M A7.7.12, A7.7.21)."""
    if instruction.kind is not Kind.BRANCH:
        return False
    if instruction.size == 2:
        return word & 0xF000 == 0xD000 or word & 0xF500 == 0xB100
    return word & 0xD000 == 0x8000
