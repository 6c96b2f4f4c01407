"""The last rows of a core, kept whether or not anybody records, and passed on to whoever does.

A verdict on a program that hangs or dies shows them. Rows are those of
`recorder.py`.

Invariant: the same run leaves the same rows, on both executors, recorded or not.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from bluepill_sim.cpu.recorder import BLOCK, BlockRecorder, Row

#: How many rows every core keeps (`LAST_ROWS` of bluepill_sim/native/core.h).
LAST_ROWS = 32


class KeptRows(Protocol):
    """The last rows of a core."""

    #: Whether the recorder has not been told of anything yet.
    is_fresh: bool

    def append(self, row: Row) -> None:
        """Add a row; the oldest goes when there are more than `LAST_ROWS`."""
        ...

    def rows(self) -> tuple[Row, ...]:
        """Return them, oldest first."""
        ...

    def put_back(self, rows: Sequence[Row]) -> None:
        """Have these and no others."""
        ...

    def ends_with_block(self, address: int) -> bool:
        """Tell whether the last row is of the block at an address."""
        ...


class LastRows:
    """`KeptRows` in Python."""

    def __init__(self) -> None:
        self._rows: deque[Row] = deque(maxlen=LAST_ROWS)
        self.is_fresh = False

    @property
    def append(self) -> Callable[[Row], None]:
        """The list's own: it is called for each block."""
        return self._rows.append

    def rows(self) -> tuple[Row, ...]:
        """As of `KeptRows`."""
        return tuple(self._rows)

    def put_back(self, rows: Sequence[Row]) -> None:
        """As of `KeptRows`."""
        self._rows.clear()
        self._rows.extend(rows)

    def ends_with_block(self, address: int) -> bool:
        """As of `KeptRows`."""
        return bool(self._rows) and self._rows[-1][1:] == (address, BLOCK)


class BlockLog:
    """Takes the rows of one core."""

    def __init__(self, last: KeptRows, fail: Callable[[BaseException], None]) -> None:
        """Keep rows.

        Args:
            last: where.
            fail: told of what a recorder raises, since C stands between here and the caller.
        """
        self._last = last
        self._fail = fail
        self._recorder: BlockRecorder | None = None
        #: Takes a row; another one when the recorder changes.
        self.tell: Callable[[Row], None] = last.append

    @property
    def recorder(self) -> BlockRecorder | None:
        """Who is told of all rows from now on."""
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: BlockRecorder | None) -> None:
        self._recorder = recorder
        self._last.is_fresh = True
        self.tell = self._last.append if recorder is None else self._keep_and_pass_on

    def tell_spin(self, cycle: int, address: int) -> None:
        """Take the row of a branch to itself: once, however long it spins."""
        row = cycle, address, BLOCK
        if not self._last.ends_with_block(address):
            self.tell(row)
        elif self._recorder is not None and self._last.is_fresh:
            self.pass_on(row)

    def pass_on(self, row: Row) -> None:
        """Tell the recorder of a row that is kept already."""
        self._last.is_fresh = False
        if self._recorder is not None:
            try:
                self._recorder.put(*row)
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
                self._fail(error)

    def rows(self) -> tuple[Row, ...]:
        """Return what ran last, oldest first: at most `LAST_ROWS` rows."""
        return self._last.rows()

    def put_back(self, rows: Sequence[Row]) -> None:
        """Have run these last."""
        self._last.put_back(rows)

    def _keep_and_pass_on(self, row: Row) -> None:
        self._last.append(row)
        self.pass_on(row)
