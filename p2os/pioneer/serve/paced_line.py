"""A line that carries bytes at the speed of a UART where the medium itself is faster: TCP, a pseudo-terminal.

Bytes arrive in lumps of up to 16 characters, each at the time of its last one,
as a UART with a FIFO hands them to its driver.

Invariant: arrivals are those of `LineTime`; none is before the one that was put before it.
"""

from collections import deque
from dataclasses import replace

from p2os.protocol.line_time import LineTime
from simbase.timing import Nanos

#: The receive FIFO of the common UARTs (16550 and its kin), characters.
LUMP = 16


class PacedLine:
    """One direction of a line, in the robot's time."""

    def __init__(self, baud: int) -> None:
        self._time = LineTime(baud)
        self._lumps: deque[tuple[Nanos, bytes]] = deque()
        #: Bytes that are still under way.
        self.waiting = 0

    @property
    def free_at(self) -> Nanos:
        """Return when the last byte put so far has arrived."""
        return self._time.free_at

    def put(self, data: bytes, now: Nanos) -> None:
        """Send bytes behind what is still under way."""
        for start in range(0, len(data), LUMP):
            lump = data[start : start + LUMP]
            self._time = self._time.sent(len(lump), now)
            self._lumps.append((self.free_at, lump))
        self.waiting += len(data)

    def take(self, now: Nanos) -> list[tuple[Nanos, bytes]]:
        """Return what has arrived by `now`, as (when, bytes), and forget it."""
        found = []
        while self._lumps and self._lumps[0][0] <= now:
            found.append(self._lumps.popleft())
        self.waiting -= sum(len(lump) for _, lump in found)
        return found

    def take_all(self) -> bytes:
        """Return what is still under way, and forget it."""
        data = b"".join(lump for _, lump in self._lumps)
        self.clear()
        return data

    def next_deadline(self) -> Nanos | None:
        """Return when the next lump arrives."""
        return self._lumps[0][0] if self._lumps else None

    def set_baud(self, baud: int) -> None:
        """Change the speed; what is still under way goes at the old one."""
        self._time = self._time.at_baud(baud)

    def clear(self) -> None:
        """Forget what is under way."""
        self._lumps.clear()
        self.waiting = 0
        self._time = replace(self._time, characters=0)
