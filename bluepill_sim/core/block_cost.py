"""What a basic block costs on a Cortex-M3, in cycles, and where in it each instruction starts.

It is worked out in C (`extension/source/core/measure.c`, by the tables of `extension/encodings.py`); here is what a
block is to the rest of the emulator.

Not modelled: instructions skipped in an IT block (each is charged in full),
the alignment of branch targets, the write buffer when full, contention of
loads with the fetch unit, waits of the peripheral buses, code in SRAM (it runs
as flash without wait states would).

Invariant: a block's cost depends on its bytes, its address, the wait states
and the prefetch setting, and on nothing else.
"""

import ctypes
from dataclasses import dataclass, field
from functools import lru_cache

from bluepill_sim.core.thumb import KINDS, MeasuredRow
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.extension.layout import BLOCK_COST, structure
from bluepill_sim.extension.library import library

#: chosen: of so many blocks it is known what they cost and access, several programs' all.
KNOWN_BLOCKS = 4096
_MULTIPLES = frozenset({Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE, Kind.LOAD_DUAL, Kind.STORE_DUAL})
_STORES = frozenset({Kind.STORE, Kind.STORE_INDEXED})
#: Of `block_cost.flags` (`enum row_flag`).
_CHANGES_MASKS, _SENDS_EVENT, _SELF_LOOP = 1, 2, 4
#: Multiple transfers by the SP, which is aligned.
_FIRST_ALIGNED = 13
_CostStruct = structure(BLOCK_COST)


@dataclass(frozen=True, slots=True)
class BasicBlock:
    """A basic block's costs and what in it needs attention."""

    start: int
    #: Address after the block: where it goes on if no branch is taken.
    end: int
    #: Cycles when the block goes on at `end`: it falls through, or that is where its B goes.
    straight: int
    #: Cycles when it goes anywhere else.
    taken: int
    #: Cycles from the block's start to each instruction, by address.
    offsets: dict[int, int]
    #: Addresses and divisor registers of its divisions.
    divides: tuple[tuple[int, int], ...] = ()
    #: Those with a store before them in the block, which may be the one that switches the trap on.
    late_divides: tuple[tuple[int, int], ...] = ()
    #: Addresses and base registers of its accesses that must be aligned.
    aligned: tuple[tuple[int, int], ...] = ()
    #: Addresses of its instructions that an exception in their midst leaves undone, to begin anew or go on behind it.
    given_up: frozenset[int] = frozenset()
    #: Whether it may change what may interrupt (CPS, MSR).
    changes_masks: bool = False
    sends_event: bool = False
    #: Whether it takes an exclusive reservation.
    has_exclusive: bool = False
    #: Whether an IT instruction is in it.
    has_it: bool = False
    #: ITSTATE of its instructions that stand under an IT of the same block, by address.
    it_states: dict[int, int] = field(default_factory=dict)
    #: Whether it is a single branch to itself.
    is_self_loop: bool = False
    #: Kind of its last instruction.
    last: Kind = Kind.PLAIN

    def cycles_until(self, address: int) -> int:
        """Return the cycles from the block's start until the core stands at `address`, inside the block or after it."""
        if address == self.end:
            return self.straight
        return self.offsets.get(address, self.taken)

    def it_state_at(self, address: int, initial: int = 0) -> int:
        """Return ITSTATE before the instruction at `address`, if the block begins with `initial`."""
        state = initial
        for at in self.offsets:
            if at >= address or not state:
                break
            state = _advance(state)
        return state or self.it_states.get(address, 0)

    def rest(self, address: int) -> "BasicBlock":
        """Return what is left of it when the core stands before the instruction at `address`."""
        done = self.cycles_until(address)
        offsets = {at: cycles - done for at, cycles in self.offsets.items() if at >= address}
        # It has an IT instruction at least in so far as it may begin inside an IT block.
        return BasicBlock(
            address, self.end, self.straight - done, self.taken - done, offsets,
            divides=self.divides, aligned=self.aligned, has_it=True, it_states=self.it_states, last=self.last,
        )  # fmt: skip

    @property
    def needs_attention(self) -> bool:
        """Whether entering it takes more than adding up its cycles."""
        return self.changes_masks or self.sends_event or self.is_self_loop


#: What stands for "no block is running": it costs nothing.
NO_BLOCK = BasicBlock(-1, -1, 0, 0, {})


@lru_cache(maxsize=KNOWN_BLOCKS)  # after each restored state a chip asks anew
def measure_block(code: bytes, start: int, wait_states: int, *, has_prefetch: bool) -> BasicBlock:
    """Return the costs of the block whose bytes are `code`.

    Args:
        code: the bytes of the block, whole instructions.
        start: its address.
        wait_states: 0 to 2 for flash; 0 for code in SRAM.
        has_prefetch: FLASH_ACR PRFTBE.
    """
    rows, cost = (MeasuredRow * (len(code) // 2))(), _CostStruct()
    library().measure_block(
        code, len(code), start, wait_states, has_prefetch, ctypes.addressof(rows), ctypes.addressof(cost)
    )
    instructions = [(row, KINDS[row.kind]) for row in rows[: cost.count]]
    divides = tuple((row.address, row.base) for row, kind in instructions if kind is Kind.DIVIDE)
    stores = [row.address for row, kind in instructions if kind in _STORES]
    kinds = {kind for _, kind in instructions}
    return BasicBlock(
        start,
        start + len(code),
        cost.straight,
        cost.taken,
        {row.address: row.cycle for row, _ in instructions},
        divides=divides,
        late_divides=tuple(row for row in divides if stores and row[0] > stores[0]),
        aligned=tuple(
            (row.address, row.base) for row, kind in instructions if kind in _MULTIPLES and row.base < _FIRST_ALIGNED
        ),
        given_up=frozenset(row.address for row, _ in instructions if row.gives_up),
        changes_masks=bool(cost.flags & _CHANGES_MASKS),
        sends_event=bool(cost.flags & _SENDS_EVENT),
        has_exclusive=Kind.EXCLUSIVE in kinds,
        has_it=Kind.IF_THEN in kinds,
        it_states={row.address: row.it_state for row, _ in instructions if row.it_state},
        is_self_loop=bool(cost.flags & _SELF_LOOP),
        last=instructions[-1][1] if instructions else Kind.PLAIN,
    )


def _advance(it_state: int) -> int:
    return it_state & 0xE0 | it_state << 1 & 0x1F if it_state & 7 else 0
