"""Makes sense of a stream of recorded blocks: what ran, for how long, and what came next.

    BLOCK a   BLOCK b   ENTRY 15   BLOCK h   RETURN   BLOCK c
    └ a ran until b     └ b was interrupted: its own time ends here, what follows it is c

A block is told of once it is known what follows it. Interrupts stand between
blocks, never in them, so that what follows an interrupted block is what runs
after the return.

Invariant: the cycles of all that is told add up to the time from the first row to the last.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

#: (cycle, address, kind) of a recorded row; a kind is BLOCK, RETURN, or the number of the exception entered.
BLOCK, RETURN = 0, -1
Row = tuple[int, int, int]


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


@dataclass(slots=True)
class _Running:
    """A block that has begun; `cycles` once it has ended."""

    address: int
    cycle: int
    cycles: int | None = None


@dataclass(slots=True)
class Walk:
    """Follows the rows of one recording."""

    listeners: list[Listener]
    #: The block of each thread of execution that an exception interrupted, outermost first; the last one runs.
    _contexts: list[_Running | None] = field(default_factory=lambda: [None])
    _last_cycle: int = 0

    def take(self, rows: Iterable[Row]) -> None:
        """Take the next rows."""
        contexts = self._contexts
        for cycle, address, kind in rows:
            self._last_cycle = cycle
            running = contexts[-1]
            if kind == BLOCK:
                if running is not None:
                    self._tell(running, address, cycle)
                contexts[-1] = _Running(address, cycle)
                continue
            if running is not None and running.cycles is None:
                running.cycles = cycle - running.cycle
            if kind == RETURN:
                if running is not None:
                    self._tell(running, None, cycle)
                if len(contexts) > 1:
                    contexts.pop()
                else:
                    contexts[-1] = None
                for listener in self.listeners:
                    listener.leave(cycle)
            else:
                contexts.append(None)
                for listener in self.listeners:
                    listener.enter(kind, cycle)

    def finish(self, cycle: int) -> None:
        """Tell of what still runs, up to a cycle."""
        while self._contexts:
            running = self._contexts.pop()
            if running is not None:
                self._tell(running, None, cycle)
        self._contexts.append(None)

    def _tell(self, running: _Running, following: int | None, cycle: int) -> None:
        cycles = cycle - running.cycle if running.cycles is None else running.cycles
        for listener in self.listeners:
            listener.block(running.address, following, running.cycle, cycles)


#: Drains a recorder.
Drain = Callable[[], Iterable[Row]]
