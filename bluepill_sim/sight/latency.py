"""How long interrupts wait: from the moment that one is due to the first instruction of its handler.

Told of the interrupt lines and of SysTick. What a program makes pending by
itself (PendSV, a write to NVIC_ISPR) and a line that is still high when its
handler returns are entries without a wait of their own.

On an idle chip a wait is 12 cycles (TRM 5.7), and what the running block still
needs: exceptions enter at block borders here, at instructions on silicon.

Invariant: of one exception, entries = waits known + waits not known.
"""

from dataclasses import dataclass, field

from bluepill_sim.board import BluePill
from bluepill_sim.nvic import FIRST_IRQ, SYSTICK
from bluepill_sim.timing import Nanos


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


class Latency:
    """Measures waits; a listener of a walk, which must be fed in the run's own order of time."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        #: Cycles at which each exception fell due, oldest first, until its entry is told of.
        self._due: dict[int, list[int]] = {}
        self.costs: dict[int, ExceptionCost] = {}
        #: (number, cycle of the entry, when it was due) of the handlers that run, outermost first.
        self._running: list[tuple[int, int]] = []
        #: An entry whose handler has not begun: (number, when it was due).
        self._entered: tuple[int, int | None] | None = None
        board.chip.irq_listeners.append(self._irq_changed)
        board.chip.processor.systick.tick_listeners.append(self._ticked)

    def detach(self) -> None:
        """Look on no more."""
        self._board.chip.irq_listeners.remove(self._irq_changed)
        self._board.chip.processor.systick.tick_listeners.remove(self._ticked)

    @property
    def by_name(self) -> list[ExceptionCost]:
        """What each exception that was entered has cost, by number."""
        return [self.costs[number] for number in sorted(self.costs)]

    # As a listener.

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:  # noqa: ARG002 - a listener
        """Take the first block of a handler."""
        if self._entered is not None:
            number, due = self._entered
            self._entered = None
            if due is not None:
                self.costs[number].waits.append(cycle - due)

    def enter(self, number: int, cycle: int) -> None:
        """Take an entry."""
        cost = self.costs.setdefault(number, ExceptionCost(number))
        cost.entries += 1
        dues = self._due.get(number, [])
        passed = [due for due in dues if due <= cycle]
        # What fell due more than once before the entry is served once, and waits since the first time.
        self._due[number] = dues[len(passed) :]
        self._entered = number, passed[0] if passed else None
        self._running.append((number, cycle))

    def leave(self, cycle: int) -> None:
        """Take a return."""
        self._entered = None
        if self._running:
            number, began = self._running.pop()
            self.costs[number].durations.append(cycle - began)

    # What makes exceptions pending.

    def _irq_changed(self, irq: int, level: bool, at_ns: Nanos) -> None:
        nvic = self._board.chip.processor.nvic
        if level and nvic.enabled >> irq & 1:
            self._due.setdefault(FIRST_IRQ + irq, []).append(self._board.chip.cycle_at(at_ns))

    def _ticked(self, cycle: int) -> None:
        self._due.setdefault(SYSTICK, []).append(cycle)
