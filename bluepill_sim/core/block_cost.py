"""What a basic block costs on a Cortex-M3, in cycles, and where in it each instruction starts.

Costs are those of the Cortex-M3 Technical Reference Manual (r1p1, chapter 18
"Instruction timing"), with the data-dependent ones at a stated value between
their bounds. Flash wait states follow a model of the prefetch buffer that is
ours and not measured on silicon: two 8-byte lines, the next line being read
while the present one runs.

Not modelled: instructions skipped in an IT block (each is charged in full),
the alignment of branch targets, the write buffer when full, contention of
loads with the fetch unit, waits of the peripheral buses, code in SRAM (it runs
as flash without wait states would).

Invariant: a block's cost depends on its bytes, its address, the wait states
and the prefetch setting, and on nothing else.
"""

from dataclasses import dataclass, field
from functools import lru_cache

from bluepill_sim.core.thumb import Instruction, decode_all
from bluepill_sim.extension.encodings import Kind

#: TRM table 18-1: cycles without pipeline refill and per-register cycles.
CYCLES = {
    Kind.PLAIN: 1,
    Kind.MULTIPLY_ACCUMULATE: 2,
    Kind.MULTIPLY_LONG: 4,  # chosen: 3 to 5 by operands
    Kind.MULTIPLY_ACCUMULATE_LONG: 5,  # chosen: 4 to 7 by operands
    Kind.DIVIDE: 7,  # chosen: 2 to 12 by operands
    Kind.LOAD: 2,
    Kind.LOAD_LITERAL: 2,
    Kind.LOAD_PC: 2,
    Kind.STORE: 1,
    Kind.STORE_INDEXED: 2,
    Kind.LOAD_MULTIPLE: 1,
    Kind.STORE_MULTIPLE: 1,
    Kind.LOAD_DUAL: 1,
    Kind.STORE_DUAL: 1,
    Kind.EXCLUSIVE: 2,
    Kind.BRANCH: 1,
    Kind.CALL: 1,
    Kind.BRANCH_REGISTER: 1,
    Kind.TABLE_BRANCH: 1,  # with count = 2: three cycles for the load and the addition
    Kind.MASK_CHANGE: 2,  # chosen: 1 or 2
    Kind.READ_SPECIAL: 1,
    Kind.BARRIER: 1,
    Kind.SYNCHRONISE: 4,  # chosen: 1 and a refill
    Kind.SEND_EVENT: 1,
    Kind.WAIT_EVENT: 1,
    Kind.WAIT_INTERRUPT: 1,
    Kind.YIELD: 1,
    Kind.IF_THEN: 1,
    Kind.SUPERVISOR_CALL: 1,
    Kind.BREAKPOINT: 1,
}

#: Pipeline refill of a taken branch: P of the TRM is 1 to 3, by how early the target is known.
REFILL = {
    Kind.BRANCH: 1,
    Kind.CALL: 1,
    Kind.BRANCH_REGISTER: 2,
    Kind.TABLE_BRANCH: 3,
    Kind.LOAD_PC: 3,
    Kind.LOAD_MULTIPLE: 3,
}

#: What takes so long that an exception need not wait for it (TRM 18.2, ARM B1.5.10). chosen: LDM and STM begin anew
#: too, where silicon goes on with the word at which they were left.
GIVEN_UP = frozenset(
    {Kind.MULTIPLY_LONG, Kind.MULTIPLY_ACCUMULATE_LONG, Kind.DIVIDE, Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE}
)

#: chosen: of so many blocks it is known what they cost and access, several programs' all.
KNOWN_BLOCKS = 4096
#: Bytes that one access to the flash delivers (RM0008 3.3.3: 64-bit lines).
LINE_BYTES = 8

_SINGLE_LOADS = frozenset({Kind.LOAD, Kind.LOAD_LITERAL})
_MULTIPLES = frozenset({Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE, Kind.LOAD_DUAL, Kind.STORE_DUAL})
_PIPELINED_AFTER_LOAD = frozenset({Kind.LOAD, Kind.LOAD_LITERAL, Kind.STORE_INDEXED})


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
    #: Addresses of its instructions that an exception in their midst leaves undone, to begin anew after it.
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
            has_it=True, it_states=self.it_states, last=self.last,
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
    instructions = decode_all(code, start)
    fetch = _Fetch(start, wait_states, has_prefetch=has_prefetch)
    offsets: dict[int, int] = {}
    clock = 0
    previous: Instruction | None = None
    for instruction in instructions:
        clock = fetch.until(instruction, clock)
        offsets[instruction.address] = clock
        clock += cycles_of(instruction, previous)
        if instruction.kind is Kind.LOAD_LITERAL:
            clock += wait_states
        previous = instruction
    divides = tuple((i.address, i.base) for i in instructions if i.kind is Kind.DIVIDE and i.base is not None)
    stores = [i.address for i in instructions if i.kind in {Kind.STORE, Kind.STORE_INDEXED}]
    kinds = {i.kind for i in instructions}
    end, taken, it_states = start + len(code), clock + _refill(previous, wait_states), _it_states(instructions)
    return BasicBlock(
        start,
        end,
        taken if _always_goes(previous, end, it_states) else clock,
        taken,
        offsets,
        divides=divides,
        late_divides=tuple(row for row in divides if stores and row[0] > stores[0]),
        aligned=tuple(
            (i.address, i.base) for i in instructions if i.kind in _MULTIPLES and i.base is not None and i.base < 13
        ),
        given_up=frozenset(i.address for i in instructions if i.kind in GIVEN_UP),
        changes_masks=Kind.MASK_CHANGE in kinds,
        sends_event=Kind.SEND_EVENT in kinds,
        has_exclusive=Kind.EXCLUSIVE in kinds,
        has_it=Kind.IF_THEN in kinds,
        it_states=it_states,
        is_self_loop=len(instructions) == 1 and instructions[0].destination == start,
        last=instructions[-1].kind if instructions else Kind.PLAIN,
    )


def cycles_of(instruction: Instruction, previous: Instruction | None = None) -> int:
    """Return the cycles of an instruction without refill and wait states, after `previous`."""
    cycles = CYCLES[instruction.kind] + instruction.count
    if previous is None or previous.kind not in _SINGLE_LOADS:
        return cycles
    # TRM 18.3: an access right after a load overlaps it, unless its address needs the value loaded.
    depends = previous.target in (instruction.base, instruction.index)
    if instruction.kind in _PIPELINED_AFTER_LOAD and not depends:
        return cycles - 1
    return cycles


class _Fetch:
    """The two-line prefetch buffer between flash and core."""

    def __init__(self, start: int, wait_states: int, *, has_prefetch: bool) -> None:
        self._wait_states = wait_states
        self._has_prefetch = has_prefetch
        self._line = start // LINE_BYTES
        #: When the present line arrived, and when its first instruction started.
        self._ready = 0
        self._entered = 0

    def until(self, instruction: Instruction, clock: int) -> int:
        """Return when the instruction can start, if the core is ready for it at `clock`."""
        if not self._wait_states:
            return clock
        last = (instruction.address + instruction.size - 1) // LINE_BYTES
        while self._line < last:
            self._line += 1
            if self._has_prefetch:
                self._ready = max(self._ready, self._entered) + 1 + self._wait_states
                clock = max(clock, self._ready)
            else:
                clock += self._wait_states
            self._entered = clock
        return clock


def _always_goes(last: Instruction | None, end: int, it_states: dict[int, int]) -> bool:
    """Tell whether the block ends in a branch to the very next instruction, which refills the pipeline as any other."""
    return last is not None and last.always_branches and last.destination == end and last.address not in it_states


def _refill(last: Instruction | None, wait_states: int) -> int:
    """Return what leaving the block by a branch costs beyond its straight cycles."""
    if last is None:
        return 0
    refill = REFILL.get(last.kind, 0)
    if last.kind is Kind.LOAD_MULTIPLE and not last.loads_pc:
        refill = 0
    if last.destination is not None and last.destination // LINE_BYTES == last.address // LINE_BYTES:
        return refill  # the line is still in the buffer
    return refill + wait_states


def _it_states(instructions: list[Instruction]) -> dict[int, int]:
    """Return ITSTATE before each instruction that stands under an IT (ARM B1.4.2, ITAdvance)."""
    states = {}
    state = 0
    for instruction in instructions:
        if state:
            states[instruction.address] = state
            state = _advance(state)
        if instruction.kind is Kind.IF_THEN:
            state = instruction.it_state
    return states


def _advance(it_state: int) -> int:
    return it_state & 0xE0 | it_state << 1 & 0x1F if it_state & 7 else 0
