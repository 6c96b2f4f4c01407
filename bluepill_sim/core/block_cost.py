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

from bluepill_sim.core.thumb import Instruction, Kind, decode_all

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

#: Bytes that one access to the flash delivers (RM0008 3.3.3: 64-bit lines).
LINE_BYTES = 8

_SINGLE_LOADS = frozenset({Kind.LOAD, Kind.LOAD_LITERAL})
_PIPELINED_AFTER_LOAD = frozenset({Kind.LOAD, Kind.LOAD_LITERAL, Kind.STORE_INDEXED})


class Block:
    """A basic block's costs and what in it needs attention."""

    __slots__ = (
        "aligned",
        "changes_masks",
        "divides",
        "end",
        "has_exclusive",
        "has_it",
        "is_self_loop",
        "it_states",
        "last",
        "late_divides",
        "offsets",
        "sends_event",
        "start",
        "straight",
        "taken",
    )

    def __init__(self, start: int, end: int, straight: int, taken: int, offsets: dict[int, int]) -> None:
        self.start = start
        #: Address after the block: where it goes on if no branch is taken.
        self.end = end
        #: Cycles when the block falls through to `end`.
        self.straight = straight
        #: Cycles when it goes anywhere else.
        self.taken = taken
        #: Cycles from the block's start to each instruction, by address.
        self.offsets = offsets
        #: Addresses and divisor registers of its divisions.
        self.divides: tuple[tuple[int, int], ...] = ()
        #: Those with a store before them in the block, which may be the one that switches the trap on.
        self.late_divides: tuple[tuple[int, int], ...] = ()
        #: Addresses and base registers of its accesses that must be aligned.
        self.aligned: tuple[tuple[int, int], ...] = ()
        #: Whether it may change what may interrupt (CPS, MSR).
        self.changes_masks = False
        self.sends_event = False
        #: Whether it takes an exclusive reservation.
        self.has_exclusive = False
        #: Whether an IT instruction is in it.
        self.has_it = False
        #: ITSTATE of its instructions that stand under an IT of the same block, by address.
        self.it_states: dict[int, int] = {}
        #: Whether it is a single branch to itself.
        self.is_self_loop = False
        #: Kind of its last instruction.
        self.last = Kind.PLAIN

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

    def rest(self, address: int) -> "Block":
        """Return what is left of it when the core stands before the instruction at `address`."""
        done = self.cycles_until(address)
        offsets = {at: cycles - done for at, cycles in self.offsets.items() if at >= address}
        block = Block(address, self.end, self.straight - done, self.taken - done, offsets)
        block.it_states = self.it_states
        block.has_it = True  # at least it may begin inside an IT block
        block.last = self.last
        return block

    @property
    def needs_attention(self) -> bool:
        """Whether entering it takes more than adding up its cycles."""
        return self.changes_masks or self.sends_event or self.is_self_loop


#: What stands for "no block is running": it costs nothing.
NO_BLOCK = Block(-1, -1, 0, 0, {})


def measure_block(code: bytes, start: int, wait_states: int, *, has_prefetch: bool) -> Block:
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
    end = start + len(code)
    block = Block(start, end, clock, clock + _refill(previous, wait_states), offsets)
    _note(block, instructions)
    return block


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


def _note(block: Block, instructions: list[Instruction]) -> None:
    """Write down what in the block needs the emulator's attention."""
    multiples = (Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE, Kind.LOAD_DUAL, Kind.STORE_DUAL)
    block.divides = tuple((i.address, i.base) for i in instructions if i.kind is Kind.DIVIDE and i.base is not None)
    stores = [i.address for i in instructions if i.kind in {Kind.STORE, Kind.STORE_INDEXED}]
    block.late_divides = tuple(row for row in block.divides if stores and row[0] > stores[0])
    block.aligned = tuple(
        (i.address, i.base) for i in instructions if i.kind in multiples and i.base is not None and i.base < 13
    )
    kinds = {i.kind for i in instructions}
    block.changes_masks = Kind.MASK_CHANGE in kinds
    block.sends_event = Kind.SEND_EVENT in kinds
    block.has_exclusive = Kind.EXCLUSIVE in kinds
    block.has_it = Kind.IF_THEN in kinds
    if block.has_it:
        block.it_states = _it_states(instructions)
    block.last = instructions[-1].kind if instructions else Kind.PLAIN
    block.is_self_loop = len(instructions) == 1 and instructions[0].destination == block.start


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
