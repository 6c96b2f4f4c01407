"""The device at a robot's AUX port: a program at a pseudo-terminal or a socket.

Bytes pass between it and the controller; AUX lines are not paced.
"""

import contextlib

from p2os.errors import TransportError
from p2os.pioneer.controller import Pioneer
from p2os.transport.ports import Listener, Transport
from simbase.timing import Nanos


class AuxEndpoint:
    """Joins an AUX port, 1 to 3, to what connects to a listener; one device at a time."""

    def __init__(self, port: int, listener: Listener) -> None:
        self.port = port
        self.listener = listener
        self._device: Transport | None = None

    @property
    def poll_s(self) -> float | None:
        """Return how often to poll for a device; None where a descriptor shows it."""
        return self.listener.poll_s if self._device is None else None

    def descriptors(self) -> list[int]:
        """Return the descriptors that become readable when there is something to do."""
        if self._device is not None:
            return [self._device.fileno()]
        listening = self.listener.fileno()
        return [] if listening is None else [listening]

    def move_bytes(self, pioneer: Pioneer, now: Nanos) -> None:
        """Take a device that has come, and carry bytes both ways; what no device takes is lost."""
        outgoing = pioneer.take_aux_output(self.port)
        if self._device is None:
            self._device = self.listener.accept()
        if self._device is None:
            return
        try:
            if outgoing:
                self._device.write(outgoing)
            data = self._device.read()
        except TransportError:
            self._close_line()
            return
        if data:
            pioneer.receive_aux(self.port, data, now)

    def close(self) -> None:
        """Close the device's line and give the place back."""
        self._close_line()
        self.listener.close()

    def _close_line(self) -> None:
        if self._device is not None:
            with contextlib.suppress(TransportError):
                self._device.close()
            self._device = None
