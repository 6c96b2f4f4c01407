"""One direction of a serial line, with the time that its characters take.

A message is delivered whole when its last character has arrived; messages queue
behind what is still going out. The time of each character is arithmetic, so a
line between two busy moments costs nothing.

Not modelled: levels, framing errors and noise (a later issue's fault injector
stands between two lines).

Invariant: arrivals are those of `LineTime`, in the order of sending.
"""

from collections import deque
from dataclasses import dataclass

from p2os.errors import LocalProtocolError
from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.line_time import LineTime
from simbase.state import Stateful
from simbase.timing import Nanos, Reached


@dataclass(frozen=True, slots=True)
class Arrival:
    """Bytes whose last character has arrived at `at`."""

    at: Nanos
    data: bytes


class SerialLine(Stateful):
    """Carries messages one way at a fixed speed in bit/s."""

    STATE = ("is_cut", "_time", "_under_way", "_arrived")

    def __init__(self, baud: int = DEFAULT_BAUD) -> None:
        if baud <= 0:
            raise LocalProtocolError(f"a serial line needs a positive speed, got {baud} bit/s")
        self.baud = baud
        #: Whether it is broken: what is sent and what would arrive meanwhile is lost.
        self.is_cut = False
        self._time = LineTime(baud)
        self._under_way: deque[Arrival] = deque()
        self._arrived: list[Arrival] = []

    @property
    def free_at(self) -> Nanos:
        """Return when the last character sent so far has arrived."""
        return self._time.free_at

    def send(self, data: bytes, now: Nanos) -> None:
        """Send bytes as one message, behind what is still going out."""
        if not data:
            return
        self._time = self._time.sent(len(data), now)
        if not self.is_cut:
            self._under_way.append(Arrival(self.free_at, bytes(data)))

    def take_arrived(self) -> list[Arrival]:
        """Return the messages that have arrived, oldest first, and forget them."""
        arrived, self._arrived = self._arrived, []
        return arrived

    def next_deadline(self) -> Nanos | None:
        """Return when the next message will have arrived."""
        return self._under_way[0].at if self._under_way else None

    def advance_to(self, limit: Nanos) -> Reached:
        """Deliver what has arrived by `limit`."""
        while self._under_way and self._under_way[0].at <= limit:
            arrival = self._under_way.popleft()
            if not self.is_cut:
                self._arrived.append(arrival)
        return Reached(limit)
