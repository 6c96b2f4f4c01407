"""The rest of a block, when a debugger halted the core inside of it.

Going on, it costs what was left of the block's cycles, and its run ends when
the halted one would have: so halts change no time.

Invariant: there is a rest only between a halt and the run that goes on from it.
"""

from bluepill_sim.block_cost import NO_BLOCK, Block
from bluepill_sim.thumb import Kind

#: Start, end, straight, taken, offsets, ITSTATEs, kind of the last instruction, when the run was to end.
RestSnapshot = tuple[int, int, int, int, tuple[tuple[int, int], ...], tuple[tuple[int, int], ...], str, int]


class RestOfBlock:
    """What is left of a block; empty most of the time."""

    def __init__(self) -> None:
        #: None where the core stands at a border.
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
