"""The AUX serial ports: bytes of a client pass through the robot to the device there.

Source: Pioneer 2/3 H8 manual (TTY2, GETAUX, SERAUXpac): GETAUX waits until so
many bytes have come, and 0 flushes what waits.
"""

from dataclasses import dataclass

from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.packets import SerauxPacket

#: chosen: what a port keeps; older bytes are lost, as in the firmware's ring.
BUFFER_BYTES = 256
#: A SERAUXpac holds no more (H8 manual, GETAUX).
LARGEST_REQUEST = 200
PORTS = (1, 2, 3)


@dataclass(slots=True)
class AuxPort:
    """One AUX port."""

    number: int
    #: Came in and waits for GETAUX.
    waiting: bytes = b""
    #: Goes out to the device.
    outgoing: bytes = b""
    #: How many bytes GETAUX wants, 0 none.
    wanted: int = 0
    baud: int = DEFAULT_BAUD

    def receive(self, data: bytes) -> None:
        """Take bytes of the device."""
        self.waiting = (self.waiting + data)[-BUFFER_BYTES:]

    def send(self, data: bytes) -> None:
        """Send bytes of a client to the device."""
        self.outgoing = (self.outgoing + data)[-BUFFER_BYTES:]

    def request(self, count: int) -> None:
        """Answer once `count` bytes have come (GETAUX); 0 forgets what waits."""
        if count == 0:
            self.waiting = b""
        self.wanted = min(max(count, 0), LARGEST_REQUEST)

    @property
    def has_answer(self) -> bool:
        """Tell whether a SERAUXpac is due."""
        return 0 < self.wanted <= len(self.waiting)

    def take_answer(self) -> SerauxPacket:
        """Return the packet, and forget the request and its bytes."""
        data, self.waiting = self.waiting[: self.wanted], self.waiting[self.wanted :]
        self.wanted = 0
        return SerauxPacket(port=self.number, data=data)

    def take_outgoing(self) -> bytes:
        """Return what goes out to the device, and forget it."""
        data, self.outgoing = self.outgoing, b""
        return data
