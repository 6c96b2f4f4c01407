"""The last blocks before a program died or was given up, without recording the whole run.

Theory of operation. The board is saved every so often; when its last blocks are
wanted, a second board goes on from the last save, with the levels that were put
on pins since, to the same cycle, and that bit alone is recorded. A run is
repeatable, so the second board does what the first one did.

Invariant: the watched board is not touched, and nobody is told of anything twice.
"""

from bluepill_sim.board import BluePill, BoardSnapshot
from bluepill_sim.cpu import BLOCK, BlockRecorder, Row
from bluepill_sim.faults import FaultKind
from bluepill_sim.image import SymbolTable
from bluepill_sim.sight.line_table import LineTable
from bluepill_sim.timing import NS_PER_MS, Nanos, Reached, Reason
from bluepill_sim.vectors import exception_name

#: chosen: so far a run goes between two saves, and so much is run again at the end.
STRIDE_NS: Nanos = 20 * NS_PER_MS
#: How many blocks a verdict shows.
SHOWN_BLOCKS = 32


class LastBlocks:
    """Runs a board and can tell what it last did."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        self._saved: BoardSnapshot = board.snapshot()

    @property
    def now_ns(self) -> Nanos:
        """The time that the board has reached."""
        return self._board.now_ns

    def advance_to(self, limit_ns: Nanos) -> Reached:
        """Bring the board to a time, with saves on the way; use it in place of the board's own.

        Whatever the caller does to the board between two calls is in the next save.
        """
        board = self._board
        while True:
            if board.fault is None:
                self._saved = board.snapshot()
            reached = board.advance_to(min(limit_ns, board.now_ns + STRIDE_NS))
            if reached.reason is not Reason.DEADLINE or reached.now >= limit_ns or board.fault is not None:
                return reached

    def rows(self, count: int = SHOWN_BLOCKS) -> list[Row]:
        """Return the last recorded rows, oldest first: up to the fault, if there was one, else up to now."""
        original = self._board
        again = BluePill(original.image)
        again.restore(self._saved)
        kept: list[Row] = []
        end_ns = original.now_ns

        def keep(full: BlockRecorder) -> None:
            kept.extend(full.drain())
            del kept[: -2 * count]

        recorder = again.chip.record_blocks(count, keep)
        if original.fault is None:
            while again.cycle < original.cycle and again.advance_to(end_ns).reason is Reason.EDGE:
                pass
        else:
            report = again.chip.processor.on_fault

            def stop(kind: FaultKind, pc: int, address: int | None, is_lockup: bool) -> None:
                if report is not None:
                    report(kind, pc, address, is_lockup)
                if again.fault is not None and not at_fault:
                    at_fault.extend([*kept, *recorder.drain()])
                    again.request_stop()

            at_fault: list[Row] = []
            again.chip.processor.on_fault = stop
            while not at_fault and again.advance_to(end_ns).reason is Reason.EDGE:
                pass
            return at_fault[-count:]
        return [*kept, *recorder.drain()][-count:]


def lines_of(rows: list[Row], symbols: SymbolTable, table: LineTable) -> list[str]:
    """Return rows as a person reads them: cycle, place, source line."""
    found = []
    for cycle, address, kind in rows:
        place = symbols.where(address)
        line = table.place(address)
        if kind == BLOCK:
            what = f"{place}  {line}".rstrip()
        elif kind > 0:
            what = f"-> {exception_name(kind)}, interrupts {place}"
        else:
            what = f"<- back to {place}" if address < 0xFFFF_FFE0 else "<- chains to the next exception"
        found.append(f"{cycle:>12}  {what}")
    return found
