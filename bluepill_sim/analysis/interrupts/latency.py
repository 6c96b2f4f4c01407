"""How long interrupts wait: from the moment that one is due to the first instruction of its handler.

It listens to the interrupt lines, and to how SysTick is set. What a program makes pending by
itself (PendSV, a write to NVIC_ISPR) and a line that is still high when its
handler returns are entries without a wait of their own.

On an idle chip a wait is 12 cycles (TRM 5.7), and what the running block still
needs: exceptions enter at block boundaries here, at instructions on silicon.

Invariant: of one exception, entries = waits known + waits not known.
"""

from dataclasses import dataclass, field

from bluepill_sim.board import BluePill
from bluepill_sim.core.nvic import FIRST_IRQ, IRQ_NAMES, SYSTICK
from bluepill_sim.fabric.fabric import FIRST_LINE_ROW
from bluepill_sim.fabric.subscriptions import EDGE


@dataclass(slots=True)
class ExceptionCost:
    """What one exception has cost, in cycles."""

    number: int
    entries: int = 0
    #: Waits that are known.
    waits: list[int] = field(default_factory=list)
    #: From entry to return, whatever interrupted it included.
    durations: list[int] = field(default_factory=list)

    @property
    def worst_wait(self) -> int | None:
        """The longest wait; None where none is known."""
        return max(self.waits, default=None)

    @property
    def mean_wait(self) -> float | None:
        """The mean wait; None where none is known."""
        return sum(self.waits) / len(self.waits) if self.waits else None

    @property
    def least_wait(self) -> int | None:
        """The shortest wait; None where none is known."""
        return min(self.waits, default=None)

    @property
    def worst_duration(self) -> int | None:
        """The longest run of its handler; None while none has returned."""
        return max(self.durations, default=None)


class LatencyProbe:
    """Measures waits; a `BlockListener`, which must be fed in the run's own order of time."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        #: Cycles at which each exception fell due, oldest first, until its entry is recorded.
        self._due: dict[int, list[int]] = {}
        #: (from which cycle on, first exception, cycles between two) of SysTick, oldest first.
        self._ticks: list[tuple[int, int | None, int]] = []
        #: When SysTick's handler was last entered.
        self._tick_entry = -1
        self.costs: dict[int, ExceptionCost] = {}
        #: (number, cycle of the entry, when it was due) of the handlers that run, outermost first.
        self._running: list[tuple[int, int]] = []
        #: An entry whose handler has not begun: (number, when it was due).
        self._entered: tuple[int, int | None] | None = None
        self._lines = board.chip.pins.subscribe_pins((), self._irqs_changed, lines=range(len(IRQ_NAMES)))
        board.chip.processor.systick.listen(self._tick_set)

    def detach(self) -> None:
        """Stop listening."""
        self._lines.close()
        self._board.chip.processor.systick.unlisten(self._tick_set)

    @property
    def by_name(self) -> list[ExceptionCost]:
        """What each exception that was entered has cost, by number."""
        return [self.costs[number] for number in sorted(self.costs)]

    # As a `BlockListener`.

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:  # noqa: ARG002 - a listener
        """Take the first block of a handler."""
        if self._entered is not None:
            number, due = self._entered
            self._entered = None
            if due is not None:
                self.costs[number].waits.append(cycle - due)

    def enter(self, number: int, cycle: int) -> None:
        """Take an entry."""
        self._lines.deliver()  # what was raised before this
        cost = self.costs.setdefault(number, ExceptionCost(number))
        cost.entries += 1
        # What fell due more than once before the entry is served once, and waits since the first time.
        if number == SYSTICK:
            due = self._tick_due(cycle)
        else:
            dues = self._due.get(number, [])
            passed = [at for at in dues if at <= cycle]
            self._due[number] = dues[len(passed) :]
            due = passed[0] if passed else None
        self._entered = number, due
        self._running.append((number, cycle))

    def leave(self, cycle: int) -> None:
        """Take a return."""
        self._entered = None
        if self._running:
            number, began = self._running.pop()
            self.costs[number].durations.append(cycle - began)

    def reset(self, cycle: int) -> None:  # noqa: ARG002 - a listener
        """Forget what was due or ran: it never will be served, nor return."""
        self._entered = None
        self._running.clear()
        self._due.clear()

    # What makes exceptions pending.

    def _irqs_changed(self, rows: bytes) -> None:
        for at_ns, row, is_enabled, level, _, _ in EDGE.iter_unpack(rows):
            if level and is_enabled:
                self._due.setdefault(FIRST_IRQ + row - FIRST_LINE_ROW, []).append(self._board.chip.cycle_at(at_ns))

    def _tick_set(self, cycle: int, following: int | None, period: int) -> None:
        self._ticks.append((cycle, following, period))

    def _tick_due(self, cycle: int) -> int | None:
        """Return when SysTick fell due first, after its last entry and up to a cycle; forget what is over."""
        served, self._tick_entry = self._tick_entry, cycle
        due = None
        for index, (begin, first, period) in enumerate(self._ticks):
            if due is None and first is not None:
                end = self._ticks[index + 1][0] if index + 1 < len(self._ticks) else cycle
                after = max(begin, served)
                turns = max(0, -(-(after + 1 - first) // period)) if period else 0
                candidate = first + turns * period
                if after < candidate <= min(end, cycle):
                    due = candidate
        while len(self._ticks) > 1 and self._ticks[1][0] <= cycle:
            self._ticks.pop(0)
        return due
