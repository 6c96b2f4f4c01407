"""What ran, block by block: a bounded record for whoever asks; the last rows are kept in any case (`block_log.py`).

    (cycle, address, BLOCK)              a basic block began
    (cycle, address, n > 0)              exception n was entered from the instruction at `address`
    (cycle, address, EXCEPTION_RETURN)   a handler was left; `address` runs next

The cycle of an entry or a return is that of the border where it begins; the
next block's says when it was done. A tail-chain is a return and an entry at
one time, with the EXC_RETURN value as the address of both. A branch to itself
is told of once, however long it spins.

Invariant: rows are in the order of time, and independent of the caller's slices.
"""

from collections import deque
from collections.abc import Callable

#: Kinds of rows that are not the number of an entered exception.
BLOCK, EXCEPTION_RETURN = 0, -1

#: Cycle, address, kind.
Row = tuple[int, int, int]


class BlockRecorder:
    """Keeps the last rows until somebody takes them."""

    def __init__(self, capacity: int, on_full: Callable[["BlockRecorder"], None] | None = None) -> None:
        """Record nothing yet.

        Args:
            capacity: how many rows are kept, 1 or more; when there are more the oldest are lost.
            on_full: called when that many wait, at a block border, to drain them; it must not touch the chip.

        Raises:
            ValueError: there is no room for a row.
        """
        if capacity < 1:
            raise ValueError(f"a recorder keeps 1 row or more, not {capacity}")
        self.capacity = capacity
        #: Rows that nobody has taken and that had to go.
        self.lost = 0
        self._on_full = on_full
        self._rows: deque[Row] = deque(maxlen=capacity)

    def __len__(self) -> int:
        """Return how many rows wait."""
        return len(self._rows)

    def put(self, cycle: int, address: int, kind: int) -> None:
        """Add a row."""
        rows = self._rows
        if len(rows) == self.capacity:
            if self._on_full is not None:
                self._on_full(self)
            if len(rows) == self.capacity:
                self.lost += 1
        rows.append((cycle, address, kind))

    def drain(self) -> list[Row]:
        """Take all rows, oldest first."""
        rows = list(self._rows)
        self._rows.clear()
        return rows

    def last(self, count: int) -> list[Row]:
        """Return the last rows, oldest first, and leave them."""
        return list(self._rows)[-count:] if count > 0 else []
