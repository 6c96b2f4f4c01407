"""Runs a board while tools listen to the stream of its blocks.

Invariant: every row reaches the listeners once, in order of time; the run is
the same as one that nobody observes.
"""

from collections.abc import Sequence
from typing import Self

from bluepill_sim.analysis.walk import Listener, Walk
from bluepill_sim.board import BluePill
from bluepill_sim.core import BlockRecorder

#: chosen: rows that wait before they are handed on; a few megabytes.
_CAPACITY = 1 << 15


class Observation:
    """Hands what a board runs, from now on, to listeners.

    >>> with Observation(board, [profile]):        # doctest: +SKIP
    ...     board.run_for("1 s")
    """

    def __init__(self, board: BluePill, listeners: Sequence[Listener]) -> None:
        self._board = board
        self._walk = Walk(listeners)
        self._recorder: BlockRecorder | None = None

    def __enter__(self) -> Self:
        self._recorder = self._board.chip.record_blocks(_CAPACITY, self._pass_on)
        return self

    def __exit__(self, *_: object) -> None:
        if self._recorder is not None:
            self._pass_on(self._recorder)
            self._walk.finish(self._board.cycle)
        self._board.chip.stop_recording()

    def _pass_on(self, recorder: BlockRecorder) -> None:
        self._walk.take(recorder.drain())
