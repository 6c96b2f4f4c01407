"""The serial line of a CDC ACM device, as a program on the host sees it.

It is to USB what a `SerialPort` is to a USART. The host opens it as soon as the device is configured: DTR and RTS are
set.
Invariant: bytes come and go in the order of the bus.
"""

from collections.abc import Callable

from bluepill_sim.parts.serial_port import BoardSerialLine, WaitForBytes, WordSink
from bluepill_sim.parts.usb.host import UsbHost
from bluepill_sim.parts.usb.pipes import UsbPacket


class UsbSerial(BoardSerialLine):
    """A CDC line, seen from the host."""

    STATE = ("received_bytes", "sent_bytes")
    DERIVED = ("_sinks",)

    def __init__(self, host: UsbHost, wait: WaitForBytes, stop: Callable[[], None]) -> None:
        """Make the line of a host.

        Args:
            host: the host.
            wait: runs the board until something has come.
            stop: ends the board's slice.
        """
        super().__init__("USB", wait)
        self._host, self._stop = host, stop
        self._sinks: list[tuple[WordSink, bool]] = []
        self.received_bytes = self.sent_bytes = 0
        host.subscribe_packets(self._take)

    def receive(self, data: bytes) -> None:
        """Send bytes to the device: now, or when it is configured."""
        self.sent_bytes += len(data)
        self._host.send_line(data)

    def subscribe(self, sink: WordSink, *, ends_slice: bool = False) -> Callable[[], None]:
        """Have `sink` called with what comes from now on, packet by packet; return a function that ends it."""
        row = sink, ends_slice
        self._sinks.append(row)
        return lambda: self._sinks.remove(row)

    def _take(self, endpoint: int, packet: UsbPacket) -> None:
        if endpoint != self._host.serial_in or not packet.data:
            return
        self.received_bytes += len(packet.data)
        self._keep(packet.data)
        rows = [(byte, packet.at_ns) for byte in packet.data]
        for sink, ends_slice in self._sinks:
            sink(rows)
            if ends_slice:
                self._stop()
