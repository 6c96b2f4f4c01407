"""The adapter's endpoint at a real line: what mode C has in the place of the virtual robot.

Bytes go out as they come from the adapter; the line itself paces them. Bytes
that have come in are read at fixed instants of virtual time, which a pacer
keeps at the wall clock, and enter the recording with that time.

Invariant: nothing here decides about motion; `stop_robot` is the one exception
and only ever stops.
"""

from collections.abc import Callable

from p2os.protocol.commands import Command, CommandNumber, rvel, stop, vel
from p2os.transport import Transport
from robot_bench.wires.endpoints import EndpointPart
from simbase.timing import NS_PER_MS, Nanos, Reached

#: chosen: a tenth of a standard packet's time on a line of 9600 bit/s.
POLL_NS: Nanos = 2 * NS_PER_MS

#: What stops a robot and lets it go, whatever it was doing: each command is sent twice, since nothing is acknowledged.
_STOPS = b"".join(command.to_frame().to_bytes() for command in (stop(), vel(0), rvel(0)))
_CLOSE = Command(CommandNumber.CLOSE).to_frame().to_bytes()
STOP_SEQUENCE = _STOPS + _STOPS + _CLOSE

#: (bytes, ns): what went by on the line.
ByteListener = Callable[[bytes, Nanos], None]


class PortEndpoint:
    """An adapter on a transport.

    Args:
        part: The adapter.
        transport: The line to the robot.
        on_sent: Called with each frame sent.
        on_received: Called with what was read, before the adapter takes it.
    """

    def __init__(
        self, part: EndpointPart, transport: Transport, *, on_sent: ByteListener, on_received: ByteListener
    ) -> None:
        self.part = part
        self._transport = transport
        self._on_sent = on_sent
        self._on_received = on_received
        self._next_poll: Nanos = 0

    def next_deadline(self) -> Nanos:
        """Return when the line is read next, or when the adapter wants to act."""
        own = self.part.next_deadline()
        return self._next_poll if own is None else min(own, self._next_poll)

    def advance_to(self, limit: Nanos) -> Reached:
        """Read, act and send.

        Raises:
            TransportError: The line is lost.
        """
        if self._next_poll <= limit:
            self._next_poll = limit + POLL_NS
            data = self._transport.read()
            if data:
                self._on_received(data, limit)
                self.part.receive(data, limit)
        self.part.advance_to(limit)
        for frame in self.part.take_output():
            self._on_sent(frame, limit)
            self._transport.write(frame)
        return Reached(limit)


def stop_robot(transport: Transport) -> None:
    """Send what stops a robot and closes its session.

    Raises:
        TransportError: The line is lost; the robot's own watchdog stops it after two seconds.
    """
    transport.write(STOP_SEQUENCE)
