"""The ESP32's UART in front of the adapter: when bytes that have arrived are seen.

The firmware tells the driver of ESP-IDF to take bytes from the receiver when as many stand there as come in a pass of
its loop, or when the line has been idle for 16 bits (adapter_fw/esp32/main/line.cpp; the register counts eight at a
time). At 9600 baud that is each byte at once. The loop looks once a millisecond, counted from where the chip began.

Not modelled: a message is seen whole with its last byte, also where the driver has handed its beginning over before;
rings, which the line cannot fill; the microseconds of an interrupt.

Invariant: bytes are seen in their order, none before it has arrived.
"""

from collections import deque

from p2os.protocol.bauds import DEFAULT_BAUD
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: The firmware's loop comes round so often.
PASS_NS: Nanos = NS_PER_MS
_BITS_A_BYTE = 10
#: A time-out of one byte, as the register rounds it up.
_TIMEOUT_BITS = 16
#: Half of the receiver's FIFO.
_MOST_BYTES = 64


def threshold(baud: int) -> int:
    """Return how many bytes the driver waits for at a line speed in bit/s."""
    return min(max(1, baud * PASS_NS // (_BITS_A_BYTE * NS_PER_S)), _MOST_BYTES)


class Receiver(Stateful):
    """Holds what has arrived until the firmware's loop sees it.

    Args:
        baud: Speed of the line in bit/s.
    """

    STATE = ("_origin", "_level", "_held")

    def __init__(self, baud: int = DEFAULT_BAUD) -> None:
        self._threshold = threshold(baud)
        self._timeout_ns = -(-_TIMEOUT_BITS * NS_PER_S // baud)
        #: A pass.
        self._origin: Nanos = 0
        #: Bytes in the FIFO while the last that is held waits for its time-out.
        self._level = 0
        #: When the driver takes them, and the bytes.
        self._held: deque[tuple[Nanos, bytes]] = deque()

    @property
    def due_at(self) -> Nanos | None:
        """Return the pass that sees the oldest bytes, None where there are none."""
        return self._pass_after(self._held[0][0]) if self._held else None

    def first_sight(self, at: Nanos) -> Nanos:
        """Return the first pass that may see bytes which arrive at a time."""
        return self._pass_after(at)

    def restart(self, now: Nanos) -> None:
        """Begin anew, as after a reset: nothing is held, and passes count from `now`."""
        self._origin = now
        self._held.clear()

    def arrive(self, data: bytes, now: Nanos) -> None:
        """Take bytes the last of which has arrived at `now`."""
        waits = bool(self._held) and self._held[-1][0] > now
        level = len(data) + (self._level if waits else 0)
        self._level = level % self._threshold
        taken_at = now if self._level == 0 else now + self._timeout_ns
        moved_to = now if level >= self._threshold else taken_at
        for place in range(len(self._held)):
            if self._held[place][0] > now:
                self._held[place] = (moved_to, self._held[place][1])
        self._held.append((taken_at, data))

    def take(self, now: Nanos) -> list[bytes]:
        """Return what a pass at `now` sees, oldest first, and forget it."""
        seen = []
        while (due_at := self.due_at) is not None and due_at <= now:
            seen.append(self._held.popleft()[1])
        return seen

    def _pass_after(self, at: Nanos) -> Nanos:
        return at + (self._origin - at) % PASS_NS
