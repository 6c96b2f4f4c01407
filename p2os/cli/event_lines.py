"""What robots do, a line each, and never a flood of lines: a client that shouts syncs would fill a disk with them.

Invariant: no more than `MOST_LINES` a second of a robot's own time, and what was
left out is told by number with the next line.
"""

from collections.abc import Callable

from p2os.timing import NS_PER_S, Nanos

#: chosen: several times what an eager client causes, and still readable.
MOST_LINES = 50


class EventLines:
    """The lines of one robot.

    Args:
        write: Takes a line's text, with its end.
        who: Begins each line after the time; empty for a robot that is alone.
    """

    def __init__(self, write: Callable[[str], object], who: str = "") -> None:
        self._write = write
        self._who = who
        self._second = -1
        self._written = 0
        self._left_out = 0

    def tell(self, now: Nanos, what: str, detail: str) -> None:
        """Write that something happened, or count it where its second is full."""
        if now // NS_PER_S != self._second:
            self._second, self._written = now // NS_PER_S, 0
        if self._written >= MOST_LINES:
            self._left_out += 1
            return
        self._written += 1
        if self._left_out:
            left_out, self._left_out = self._left_out, 0
            self._line(now, "left out", f"{left_out} lines like the last")
        self._line(now, what, detail)

    def _line(self, now: Nanos, what: str, detail: str) -> None:
        self._write(f"{now / NS_PER_S:10.3f} s  {self._who}{what}{': ' if detail else ''}{detail}\n")
