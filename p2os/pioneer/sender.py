"""What the robot has to say and when the line lets it: answers wait their turn, nothing piles up.

A standard packet is made when its turn comes, and goes before extra packets;
extra packets go only into what its cycle leaves free, and are dropped where that
is nothing. When the standard packet alone fills its cycle, the cycle stretches.
Answers (handshake, CONFIG) go as soon as the line is free, in turn with the
standard packets; more than a handful that wait are lost, as in the firmware's
small buffer.

Invariant: no more than `MOST_ANSWERS` frames wait, whatever a client asks for.
"""

from collections import deque
from dataclasses import replace

from p2os.pioneer.line import TransmitLine
from p2os.timing import Nanos

#: chosen: three syncs, a CONFIGpac and as much again.
MOST_ANSWERS = 8


class Sender:
    """The transmit side of one robot."""

    def __init__(self, baud: int | None) -> None:
        self.line = TransmitLine(baud)
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

    def snapshot(self) -> object:
        """Return all that decides the future."""
        return replace(self.line), self.lost, tuple(self._answers), tuple(self._output), self._answers_next

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        assert isinstance(snapshot, tuple)  # noqa: S101  # our own value
        line, self.lost, answers, output, self._answers_next = snapshot
        self.line, self._answers, self._output = replace(line), deque(answers), list(output)
