"""Variables of a program that runs, as numbers over time.

They are read between two slices of the chip, from its memory, where a program's own reads do not go: nothing that the
program does or sees depends on it. What changes and changes back between two looks is not seen.

Invariant: the board is the same before and after a look.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from bluepill_sim.program.variables import Variable
from simbase.timing import NS_PER_MS, Nanos

#: chosen: a loop of a firmware's control takes some milliseconds.
PERIOD_NS: Nanos = NS_PER_MS


class ReadableBoard(Protocol):
    """A board, as far as it is looked at."""

    @property
    def now_ns(self) -> Nanos:
        """The time reached."""

    def read_memory(self, address: int, size: int) -> bytes | None:
        """Return bytes of flash or SRAM; None where there is no memory."""


#: Gets when variables were looked at, whether all is told anew (time went back, or others are looked at), and the names
#: and values of those that are others than at the look before.
TakeLook = Callable[[Nanos, bool, Sequence[tuple[str, float]]], None]


class VariableSampler:
    """Looks at variables of one board, once in each period: at the first stop of the chip in it.

    Args:
        board: It.
        take: Gets each look.
        period_ns: How long a period is; they are counted from 0.
    """

    def __init__(self, board: ReadableBoard, take: TakeLook, period_ns: Nanos = PERIOD_NS) -> None:
        self._board, self._take, self._period_ns = board, take, period_ns
        self._variables: tuple[Variable, ...] = ()
        self._last: dict[str, bytes] = {}
        self._looked_at: Nanos = -1

    @property
    def variables(self) -> Sequence[Variable]:
        """What is looked at."""
        return self._variables

    def watch(self, variables: Sequence[Variable]) -> None:
        """Look at these from now on, at first at once."""
        self._variables = tuple(variables)
        self._look(self._board.now_ns, is_anew=True)

    def look(self, now: Nanos) -> Nanos:
        """Look at them where that is due; return how long it is until it is due next, ns.

        Args:
            now: The time that the board has come to; where it is before the last look, all is told anew.
        """
        if self._variables:
            is_anew = now < self._looked_at
            if is_anew or now // self._period_ns != self._looked_at // self._period_ns:
                self._look(now, is_anew=is_anew)
        return self._period_ns - now % self._period_ns

    def _look(self, now: Nanos, *, is_anew: bool) -> None:
        self._looked_at = now
        if is_anew:
            self._last.clear()
        changes = []
        for variable in self._variables:
            data = self._board.read_memory(variable.address, variable.size)
            if data is not None and self._last.get(variable.name) != data:
                self._last[variable.name] = data
                changes.append((variable.name, variable.number(data)))
        self._take(now, is_anew, changes)
