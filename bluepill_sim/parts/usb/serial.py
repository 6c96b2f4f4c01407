"""The serial line of a CDC ACM device, as a program on the host sees it.

It is to USB what `parts/serial_port.py` is to a USART, with the same names. The host opens it as soon as the device is
configured: DTR and RTS are set.
Invariant: `unread` holds what has come and no `expect` or `read` has taken yet, at most twice `KEPT_BYTES`.
"""

from collections.abc import Callable, Sequence

from bluepill_sim.errors import BluePillError
from bluepill_sim.parts.usb.host import UsbHost, UsbRequestError, Wait
from bluepill_sim.parts.usb.pipes import Packet
from bluepill_sim.spans import Span, to_nanos
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: chosen: older ones are forgotten.
KEPT_BYTES = 64 * 1024
_SHOWN_BYTES = 60

#: Takes rows (byte, ns at the end of its packet), oldest first.
ByteSink = Callable[[Sequence[tuple[int, Nanos]]], None]


class UsbSerial(Stateful):
    """A CDC line, seen from the host."""

    STATE = ("unread", "received_bytes", "sent_bytes")
    DERIVED = ("_sinks",)

    def __init__(self, host: UsbHost, wait: Wait, stop: Callable[[], None]) -> None:
        """Make the line of a host.

        Args:
            host: the host.
            wait: runs the board until something is so.
            stop: ends the board's slice.
        """
        self.name = "USB"
        self._host, self._wait, self._stop = host, wait, stop
        self._sinks: list[tuple[ByteSink, bool]] = []
        #: What has come and nobody has taken.
        self.unread = bytearray()
        self.received_bytes = self.sent_bytes = 0
        host.subscribe_packets(self._take)

    def receive(self, data: bytes) -> None:
        """Send bytes to the device: now, or when it is configured."""
        self.sent_bytes += len(data)
        self._host.send_line(data)

    def subscribe(self, sink: ByteSink, *, ends_slice: bool = False) -> Callable[[], None]:
        """Have `sink` called with what comes from now on, packet by packet; return a function that ends it."""
        row = sink, ends_slice
        self._sinks.append(row)
        return lambda: self._sinks.remove(row)

    def read(self) -> bytes:
        """Return what has come and was not yet taken, and take it."""
        data = bytes(self.unread)
        self.unread.clear()
        return data

    def expect(self, pattern: bytes, *, within: Span = "1 s") -> bytes:
        """Run the board until `pattern` has come; return what came, up to and with it.

        Args:
            pattern: what to wait for, at least one byte.
            within: the longest wait, in virtual time.

        Raises:
            UsbRequestError: it did not come in time.
        """
        if not pattern:
            raise BluePillError("an empty pattern is always there", hint="expect at least one byte")
        self._wait(lambda: pattern in self.unread, within)
        if pattern not in self.unread:
            last = bytes(self.unread[-_SHOWN_BYTES:])
            raise UsbRequestError(
                f"USB did not send {pattern!r} within {to_nanos(within) / NS_PER_S:g} s; it sent {last!r}; "
                f"{self._host.describe()}"
            )
        end = self.unread.index(pattern) + len(pattern)
        taken = bytes(self.unread[:end])
        del self.unread[:end]
        return taken

    def _take(self, endpoint: int, packet: Packet) -> None:
        if endpoint != self._host.serial_in or not packet.data:
            return
        self.received_bytes += len(packet.data)
        self.unread += packet.data
        if len(self.unread) > 2 * KEPT_BYTES:
            del self.unread[:-KEPT_BYTES]
        rows = [(byte, packet.at_ns) for byte in packet.data]
        for sink, ends_slice in self._sinks:
            sink(rows)
            if ends_slice:
                self._stop()
