"""Serial ports, by pyserial: 8 data bits, no parity, one stop bit, no flow control.

The port is opened for this program alone, so that two hosts cannot talk over
each other. Ports named like COM3 go through the same path; they are untried.
"""

import serial
from serial.tools import list_ports

from p2os.errors import TransportError
from p2os.transport.ports import READ_BYTES, HungUpError, Transport
from p2os.transport.url import SerialUrl

#: chosen: 200 bytes take 0.21 s at 9600 bit/s; a line that takes none for longer is stuck.
WRITE_TIMEOUT_S = 1.0


class SerialTransport:
    """A byte line over an open serial port."""

    def __init__(self, port: serial.Serial, description: str) -> None:
        self.description = description
        self._port = port

    def read(self) -> bytes:
        """Return what has arrived without waiting."""
        try:
            return bytes(self._port.read(READ_BYTES))
        except (OSError, TypeError) as error:  # pyserial says TypeError when the port vanished under it
            raise HungUpError(f"{self.description} vanished", hint="was it unplugged? (p2os ports)") from error

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise TransportError(f"{self.description} takes no more bytes", hint="is a device connected?") from error
        except OSError as error:
            raise HungUpError(f"{self.description} vanished", hint="was it unplugged? (p2os ports)") from error

    def fileno(self) -> int:
        """Return the port's descriptor.

        Raises:
            TransportError: this operating system has none for serial ports.
        """
        descriptor = getattr(self._port, "fd", None)
        if not isinstance(descriptor, int):
            raise TransportError(f"{self.description} cannot be waited for", hint="poll it instead")
        return descriptor

    def set_baud(self, baud: int) -> None:
        """Change the line's speed in bit/s."""
        self._port.baudrate = baud

    def close(self) -> None:
        """Give the port back."""
        self._port.close()


def open_serial(url: SerialUrl) -> Transport:
    """Return a line over a serial port.

    Raises:
        TransportError: there is no such port, it is in use, or it may not be opened.
    """
    try:
        port = serial.Serial(url.path, url.baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
    except (OSError, ValueError) as error:
        raise TransportError(f"cannot open {url.path}: {_reason(error)}", hint=_hint(error)) from error
    return SerialTransport(port, str(url))


class SerialListener:
    """A serial port on which the one peer is always there."""

    poll_s: float | None = 0.5

    def __init__(self, url: SerialUrl) -> None:
        self.description = str(url)
        self._url = url
        self._transport: Transport | None = open_serial(url)

    def accept(self) -> Transport | None:
        """Return the line; after it was lost, try to open the port anew."""
        transport, self._transport = self._transport, None
        if transport is None:
            try:
                transport = open_serial(self._url)
            except TransportError:  # still away: asked again after `poll_s`
                return None
        return transport

    def fileno(self) -> int | None:
        """Return None: no descriptor shows when a port comes back."""
        return None

    def close(self) -> None:
        """Give the port back if nobody took it."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None


def list_serial_ports() -> list[dict[str, str]]:
    """Return the serial ports of this machine: url, description, hardware, in order of name."""
    return [
        {"url": f"serial:{port.device}", "description": port.description or "", "hardware": port.hwid or ""}
        for port in sorted(list_ports.comports(), key=lambda port: port.device)
    ]


#: errno values and what to try; pyserial passes the system's number on.
_HINTS = {
    2: "p2os ports lists the ports that are there",
    13: "add yourself to the group that owns the port: sudo usermod -aG dialout $USER, then log in again",
    16: "another program has the port open",
    11: "another program has the port open",
}
_REASONS = {2: "no such port", 13: "permission denied", 16: "in use", 11: "in use"}


def _reason(error: Exception) -> str:
    number = getattr(error, "errno", None)
    return _REASONS.get(number or 0) or str(error).splitlines()[0]


def _hint(error: Exception) -> str:
    return _HINTS.get(getattr(error, "errno", None) or 0, "p2os ports lists the ports that are there")
