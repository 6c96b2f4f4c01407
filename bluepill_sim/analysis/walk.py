"""Makes sense of a stream of recorded blocks: what ran, for how long, and what came next.

    BLOCK a   BLOCK b   ENTRY 15 at c   BLOCK h   RETURN to c   BLOCK c
    └ a ran, then b     └ b ran, then c was due   └ h ran, nothing of its own follows

A block is told of once it is known what follows it. Exceptions stand between
blocks; a fault stands inside one, and its address says how far that came.

Invariant: the cycles of all blocks and of all gaps that exceptions leave add up
to the time from the first row to the last.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol

from bluepill_sim.core import BLOCK, EXCEPTION_RETURN, BlockRow


class Listener(Protocol):
    """Who is told of what ran."""

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:
        """Take a block: where it began, what its own thread of execution went on with, when, and for how long."""
        ...

    def enter(self, number: int, cycle: int) -> None:
        """Take the entry of an exception."""
        ...

    def leave(self, cycle: int) -> None:
        """Take the return from an exception."""
        ...


class Walk:
    """Follows the rows of one recording.

    Args:
        listeners: notified of everything, in order of time.
    """

    def __init__(self, listeners: Sequence[Listener]) -> None:
        self._listeners = tuple(listeners)
        #: Start and cycle of the block that has begun.
        self._running: tuple[int, int] | None = None

    def take(self, rows: Iterable[BlockRow]) -> None:
        """Take the next rows."""
        for cycle, address, kind in rows:
            if kind == BLOCK:
                self._end(address, cycle)
                self._running = address, cycle
            elif kind == EXCEPTION_RETURN:
                self._end(None, cycle)
                for listener in self._listeners:
                    listener.leave(cycle)
            else:
                self._end(address, cycle)
                for listener in self._listeners:
                    listener.enter(kind, cycle)

    def finish(self, cycle: int) -> None:
        """Tell of what still runs, up to a cycle."""
        self._end(None, cycle)

    def _end(self, following: int | None, cycle: int) -> None:
        if self._running is None:
            return
        address, began = self._running
        self._running = None
        for listener in self._listeners:
            listener.block(address, following, began, cycle - began)
