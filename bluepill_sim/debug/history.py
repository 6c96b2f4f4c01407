"""Where a machine has been: snapshots on the way, for going back.

Going back is going forward again from an older snapshot. The snapshots stand
close together at first; when there are too many every other one is dropped.

Invariant: cycles grow from one snapshot to the next; the first one is where
the history begins.
"""

from dataclasses import dataclass

from bluepill_sim.debug.machine import Machine
from simbase.timing import NS_PER_MS, Nanos

#: chosen: 64 snapshots are a few megabytes.
MOST_POINTS = 64
_FIRST_STRIDE_NS: Nanos = 1 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Point:
    """A state of the machine."""

    cycle: int
    at_ns: Nanos
    snapshot: object


class History:
    """Snapshots of one machine.

    Args:
        machine: Whose.
        most: So many are kept at most.
    """

    def __init__(self, machine: Machine, most: int = MOST_POINTS) -> None:
        self._machine, self._most = machine, most
        self._stride_ns = _FIRST_STRIDE_NS
        self._points: list[Point] = []
        self.begin()

    def begin(self) -> None:
        """Forget everything: what was before the present state led elsewhere."""
        self._stride_ns = _FIRST_STRIDE_NS
        self._points = [self.here()] if self._machine.can_rewind else []

    def take(self, other: "History") -> None:
        """Have the states of another machine that is the same."""
        self._points, self._stride_ns = other.latest_first()[::-1], other._stride_ns  # noqa: SLF001 - its own kind

    def here(self) -> Point:
        """Return the present state."""
        board = self._machine.board
        return Point(board.cycle, board.now_ns, self._machine.snapshot())

    def pass_by(self) -> None:
        """Note the present state, if it is far enough from the last one noted."""
        if not self._points or self._machine.board.now_ns < self._points[-1].at_ns + self._stride_ns:
            return
        self._points.append(self.here())
        if len(self._points) > self._most:
            self._points = self._points[::2]
            self._stride_ns *= 2

    def latest_first(self) -> list[Point]:
        """Return the states noted, the latest first."""
        return self._points[::-1]

    def before(self, cycle: int) -> list[Point]:
        """Return the states noted before a cycle, the latest first."""
        return [point for point in reversed(self._points) if point.cycle < cycle]

    def forget_after(self, cycle: int) -> None:
        """Drop what was noted after a cycle: the machine has gone back."""
        self._points = [point for n, point in enumerate(self._points) if not n or point.cycle <= cycle]
