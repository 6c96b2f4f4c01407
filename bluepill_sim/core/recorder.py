"""What ran, block by block: a record for tools, and the last rows of every core.

    (cycle, address, BLOCK)              a basic block began
    (cycle, address, n > 0)              exception n was entered from the instruction at `address`
    (cycle, address, EXCEPTION_RETURN)   a handler was left; `address` runs next

The cycle of an entry or a return is that of the boundary where it begins; the
next block's says when it was done. A tail-chain is a return and an entry at
one time, with the EXC_RETURN value as the address of both. A branch to itself
is one row, however long it spins.

A `BlockRecorder` is what a tool attaches; the last `LAST_ROWS` rows are kept
whether or not there is one (`BlockLog`), for the report on a program that hangs
or dies.

Invariant: rows are in the order of time and independent of the caller's slices;
the same run leaves the same rows, on both executors, recorded or not.
"""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from bluepill_sim.extension import layout
from bluepill_sim.extension.layout import LAST_ROWS, packing
from simbase.state import Stateful

#: Kinds of rows that are not the number of an entered exception.
BLOCK, EXCEPTION_RETURN = 0, -1

#: Cycle, address, kind.
BlockRow = tuple[int, int, int]
#: A row as bytes (`struct record` of extension/layout.py).
RECORD = packing(layout.RECORD)


class BlockRecorder:
    """Keeps the last rows until they are drained."""

    def __init__(self, capacity: int, on_full: Callable[["BlockRecorder"], None] | None = None) -> None:
        """Record nothing yet.

        Args:
            capacity: how many rows are kept, 1 or more; when there are more the oldest are lost.
            on_full: called at a block boundary when that many wait, to drain them; it must not touch the chip.

        Raises:
            ValueError: there is no room for a row.
        """
        if capacity < 1:
            raise ValueError(f"a recorder keeps 1 row or more, not {capacity}")
        self.capacity = capacity
        #: Rows that were overwritten before they were drained.
        self.lost = 0
        self._on_full = on_full
        self._rows: deque[BlockRow] = deque(maxlen=capacity)
        #: Rows after those, as bytes.
        self._packed = bytearray()

    def __len__(self) -> int:
        """Return how many rows wait."""
        return len(self._rows) + len(self._packed) // RECORD.size

    def put(self, cycle: int, address: int, kind: int) -> None:
        """Add a row."""
        self._unpack()
        rows = self._rows
        if len(rows) == self.capacity:
            if self._on_full is not None:
                self._on_full(self)
            if len(rows) == self.capacity:
                self.lost += 1
        rows.append((cycle, address, kind))

    def put_packed(self, data: bytes) -> None:
        """Add rows of `RECORD`, as `put` does each."""
        if self._on_full is not None:
            for row in RECORD.iter_unpack(data):
                self.put(*row)
            return
        self._packed += data
        excess = max(0, len(self) - self.capacity)
        self.lost += excess
        while excess and self._rows:
            self._rows.popleft()
            excess -= 1
        del self._packed[: excess * RECORD.size]

    def _unpack(self) -> None:
        if self._packed:
            self._rows.extend(RECORD.iter_unpack(self._packed))
            self._packed.clear()

    def drain(self) -> list[BlockRow]:
        """Take all rows, oldest first."""
        self._unpack()
        rows = list(self._rows)
        self._rows.clear()
        return rows

    def drain_packed(self) -> bytes:
        """Take all rows, oldest first, as bytes of `RECORD` each: equal rows are equal bytes."""
        data = b"".join(RECORD.pack(*row) for row in self._rows) + self._packed
        self._rows.clear()
        self._packed.clear()
        return data

    def last(self, count: int) -> list[BlockRow]:
        """Return the last rows, oldest first, and leave them."""
        return [*self._rows, *RECORD.iter_unpack(self._packed)][-count:] if count > 0 else []


class BlockLog(Stateful):
    """Takes the rows of one core."""

    STATE = ("_last",)
    DERIVED = ("_recorder", "add")

    def __init__(self, last: "KeptRows", fail: Callable[[BaseException], None]) -> None:
        """Keep rows.

        Args:
            last: where.
            fail: called with what a recorder raises, since C stands between here and the caller.
        """
        self._last = last
        self._fail = fail
        self._recorder: BlockRecorder | None = None
        #: Takes a row; another one when the recorder changes.
        self.add: Callable[[BlockRow], None] = last.append

    @property
    def recorder(self) -> BlockRecorder | None:
        """Who is notified of all rows from now on."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: BlockRecorder | None) -> None:
        self._recorder = recorder
        self._last.is_first = True
        self.add = self._last.append if recorder is None else self._keep_and_pass_on

    def add_spin(self, cycle: int, address: int) -> None:
        """Take the row of a branch to itself: once, however long it spins."""
        row = cycle, address, BLOCK
        if not self._last.ends_with_block(address):
            self.add(row)
        elif self._recorder is not None and self._last.is_first:
            self.pass_on(row)

    def pass_on(self, row: BlockRow) -> None:
        """Notify the recorder of a row that is kept already."""
        self._last.is_first = False
        if self._recorder is not None:
            try:
                self._recorder.put(*row)
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
                self._fail(error)

    def rows(self) -> tuple[BlockRow, ...]:
        """Return what ran last, oldest first: at most `LAST_ROWS` rows."""
        return tuple(RECORD.iter_unpack(self._last.packed))

    def _keep_and_pass_on(self, row: BlockRow) -> None:
        self._last.append(row)
        self.pass_on(row)


class KeptRows(Protocol):
    """The last rows of a core."""

    #: Whether the recorder has not been notified of anything yet.
    is_first: bool

    def append(self, row: BlockRow) -> None:
        """Add a row; the oldest goes when there are more than `LAST_ROWS`."""

    #: They as bytes, `RECORD` by `RECORD`, oldest first.
    packed: bytes

    def ends_with_block(self, address: int) -> bool:
        """Tell whether the last row is of the block at an address."""


class LastRows(Stateful):
    """`KeptRows` in Python."""

    STATE = ("packed",)
    DERIVED = ("_rows",)

    def __init__(self) -> None:
        self._rows: deque[BlockRow] = deque(maxlen=LAST_ROWS)
        self.is_first = False

    @property
    def append(self) -> Callable[[BlockRow], None]:
        """The list's own: it is called for each block."""
        return self._rows.append

    @property
    def packed(self) -> bytes:
        """As of `KeptRows`."""
        return b"".join([RECORD.pack(*row) for row in self._rows])

    @packed.setter
    def packed(self, packed: bytes) -> None:
        self._rows.clear()
        self._rows.extend(RECORD.iter_unpack(packed))

    def ends_with_block(self, address: int) -> bool:
        """As of `KeptRows`."""
        return bool(self._rows) and self._rows[-1][1:] == (address, BLOCK)
