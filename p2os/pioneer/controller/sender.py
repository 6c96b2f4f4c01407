"""The robot's transmit side: answers queue for their turn, nothing piles up, and the line takes its time.

A standard packet is made when its turn comes, and goes before extra packets;
extra packets go only into what its cycle leaves free, and are dropped where that
is nothing. When the standard packet alone fills its cycle, the cycle stretches.
Answers (handshake, CONFIG) go as soon as the line is free, in turn with the
standard packets; more than a handful that wait are lost, as in the firmware's
small buffer.

The line is a UART that sends one character after the other, 8N1: 9600 bit/s carry 96
characters in 100 ms. `TransmitLine` counts when the last character will have left;
what is sent still goes out as whole frames, and the host that carries them spreads the
characters. Without a speed the line takes no time.

Invariant: no more than `MOST_ANSWERS` frames wait, whatever a client asks for.
"""

from collections import deque
from dataclasses import dataclass, field

from p2os.protocol.line_time import LineTime
from simbase.state import Stateful
from simbase.timing import Nanos

#: chosen: the load is averaged over so many cycles, a second at the usual rate.
LOAD_CYCLES = 10
#: chosen: three syncs, a CONFIGpac and as much again.
MOST_ANSWERS = 8


class Sender(Stateful):
    """The transmit side of one robot."""

    STATE = ("line", "lost", "_answers", "_output", "_answers_next")

    def __init__(self, baud: int | None) -> None:
        self.line = TransmitLine(LineTime(baud))
        #: Answers that found no place.
        self.lost = 0
        self._answers: deque[bytes] = deque()
        self._output: list[bytes] = []
        #: Whose turn it is when an answer and a standard packet wait for the same moment.
        self._answers_next = True

    def answer(self, frames: list[bytes], now: Nanos) -> None:
        """Send answers as soon as the line is free."""
        for frame in frames:
            if len(self._answers) < MOST_ANSWERS:
                self._answers.append(frame)
            else:
                self.lost += 1
        self.flush(now)

    def flush(self, now: Nanos) -> None:
        """Send the answers for which the line is free."""
        while self._answers and self.line.free_at <= now:
            self.put(self._answers.popleft(), now)
            self._answers_next = False

    def put(self, data: bytes, now: Nanos) -> None:
        """Send a frame behind what is still going out."""
        self.line.put(len(data), now)
        self._output.append(data)

    def is_turn_of_packet(self, now: Nanos) -> bool:
        """Tell whether a standard packet may go now: the line is free, and no answer goes first."""
        return self.line.free_at <= now and not (self._answers and self._answers_next)

    def packet_sent(self) -> None:
        """Let an answer go next."""
        self._answers_next = True

    def turn_after(self, due: Nanos) -> Nanos:
        """Return when a packet that is due then finds the line free."""
        return max(due, self.line.free_at)

    def next_deadline(self) -> Nanos | None:
        """Return when the next answer goes."""
        return self.line.free_at if self._answers else None

    def take_output(self) -> list[bytes]:
        """Return the frames that go out, oldest first, and forget them."""
        output, self._output = self._output, []
        return output

    def clear(self) -> None:
        """Forget what waits."""
        self._answers.clear()
        self._output.clear()


@dataclass(slots=True)
class TransmitLine:
    """The robot's end of its serial line: what fits, and how full it is."""

    time: LineTime
    #: Characters since the last cycle ended, and (characters, ns) of the cycles before.
    this_cycle: int = 0
    cycle_began: Nanos = 0
    cycles: tuple[tuple[int, Nanos], ...] = field(default=())

    @property
    def free_at(self) -> Nanos:
        """When the last character sent so far has left."""
        return self.time.free_at

    def put(self, size: int, now: Nanos) -> None:
        """Send so many characters, behind what is still going out."""
        self.time = self.time.sent(size, now)
        self.this_cycle += size

    def fits(self, size: int, now: Nanos, until: Nanos) -> bool:
        """Tell whether so many more characters will have left by `until`."""
        return max(self.free_at, now) + self.time.time_of(size) <= until

    def set_baud(self, baud: int) -> None:
        """Change the speed (HOSTBAUD); what is still going out goes at the old one."""
        if self.time.baud is not None:
            self.time = self.time.at_baud(baud)

    def end_cycle(self, now: Nanos) -> None:
        """Begin a new cycle of the load."""
        self.cycles = (*self.cycles, (self.this_cycle, now - self.cycle_began))[-LOAD_CYCLES:]
        self.this_cycle, self.cycle_began = 0, now

    def begin_session(self, now: Nanos) -> None:
        """Forget the load of the session before."""
        self.cycles, self.this_cycle, self.cycle_began = (), 0, now

    @property
    def load_percent(self) -> int | None:
        """How much of the line the last cycles took; None without a speed or a cycle."""
        if self.time.baud is None:
            return None
        span = sum(ns for _, ns in self.cycles)
        return round(100 * self.time.time_of(sum(size for size, _ in self.cycles)) / span) if span else None
