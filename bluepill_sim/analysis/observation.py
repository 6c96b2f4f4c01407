"""Runs a board while tools listen to the stream of its blocks: what ran, for how long, and what came next.

    BLOCK a   BLOCK b   ENTRY 15 at c   BLOCK h   RETURN to c   BLOCK c
    └ a ran, then b     └ b ran, then c was due   └ h ran, nothing of its own follows

A block is passed on once it is known what follows it. Exceptions stand between
blocks; a fault stands inside one, and its address says how far that came. What
a reset follows on is not known: nothing tells how far that block came.

Invariant: every row reaches the listeners once, in order of time, and the run is
the same as an unobserved one; the cycles of all blocks and of all gaps that
exceptions leave add up to the time from the first row to the last.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol, Self

from bluepill_sim.board import BluePill
from bluepill_sim.core import BLOCK, EXCEPTION_RETURN, BlockRecorder, BlockRow

#: chosen: rows that wait before they are handed on; a few megabytes.
_CAPACITY = 1 << 15
#: What follows a block that has left a handler: no address of an instruction.
HANDLER_LEFT = 0xFFFF_FFFF


class Observation:
    """Hands what a board runs, from now on, to listeners.

    >>> with Observation(board, [profile]):        # doctest: +SKIP
    ...     board.run_for("1 s")
    """

    def __init__(self, board: BluePill, listeners: Sequence["BlockListener"]) -> None:
        self._board = board
        self._walk = BlockWalk(listeners)
        self._recorder: BlockRecorder | None = None

    def __enter__(self) -> Self:
        self._recorder = self._board.chip.record_blocks(_CAPACITY, self._pass_on)
        self._board.chip.reset_listeners.append(self._reset)
        return self

    def __exit__(self, *_: object) -> None:
        self.finish()

    def finish(self) -> None:
        """Hand on what has run up to now, and listen no more; the end of the block does the same."""
        if self._recorder is None:
            return
        self._pass_on(self._recorder)
        self._recorder = None
        self._walk.finish(self._board.cycle)
        self._board.chip.reset_listeners.remove(self._reset)
        self._board.chip.stop_recording()

    def _reset(self) -> None:
        if self._recorder is not None:
            self._pass_on(self._recorder)
            self._walk.reset(self._board.cycle)

    def _pass_on(self, recorder: BlockRecorder) -> None:
        self._walk.take(recorder.drain())


class BlockListener(Protocol):
    """What a tool takes of a run."""

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:
        """Take a block: where it began, what its own thread of execution went on with, when, and for how long.

        `following` is `HANDLER_LEFT` where it has left a handler, and None where it is not known.
        """

    def enter(self, number: int, cycle: int) -> None:
        """Take the entry of an exception."""

    def leave(self, cycle: int) -> None:
        """Take the return from an exception."""

    def reset(self, cycle: int) -> None:
        """Take a reset of the chip."""


class BlockWalk:
    """Follows the rows of one recording.

    Args:
        listeners: called with everything, in order of time.
    """

    def __init__(self, listeners: Sequence[BlockListener]) -> None:
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
                self._end(HANDLER_LEFT, cycle)
                for listener in self._listeners:
                    listener.leave(cycle)
            else:
                self._end(address, cycle)
                for listener in self._listeners:
                    listener.enter(kind, cycle)

    def reset(self, cycle: int) -> None:
        """End the block that a reset breaks off, at a cycle."""
        self._end(None, cycle)
        for listener in self._listeners:
            listener.reset(cycle)

    def finish(self, cycle: int) -> None:
        """End the block that still runs, at a cycle."""
        self._end(None, cycle)

    def _end(self, following: int | None, cycle: int) -> None:
        if self._running is None:
            return
        address, began = self._running
        self._running = None
        for listener in self._listeners:
            listener.block(address, following, began, cycle - began)
