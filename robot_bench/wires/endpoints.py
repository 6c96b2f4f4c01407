"""Endpoints in the loop: each joins a part to its lines and hands its bytes on.

An endpoint is a follower of the run loop. It takes what its line has delivered at
the very time of delivery, brings its part there, and sends what comes out.

Invariant: bytes enter a part at the time at which their last character arrived,
and leave it at the time at which the part acted.
"""

from collections.abc import Callable, Mapping
from typing import Protocol, cast

from robot_bench.wires.serial_line import SerialLine
from simbase.timing import Nanos, Reached


class EndpointPart(Protocol):
    """A part that exchanges bytes: the adapter, the robot's controller."""

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`."""
        ...

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        ...

    def next_deadline(self) -> Nanos | None:
        """Return when this part next wants to act."""
        ...

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`."""
        ...

    def snapshot(self) -> object:
        """Return all that decides this part's future."""
        ...

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        ...


class Endpoint:
    """A part between an incoming and an outgoing line.

    Args:
        part: What stands here.
        incoming: The line whose arrivals it reads.
        outgoing: The line that it writes to.
        on_arrival: Called with each delivery, before the part takes it: (bytes, ns).
    """

    def __init__(
        self,
        part: EndpointPart,
        *,
        incoming: SerialLine,
        outgoing: SerialLine,
        on_arrival: Callable[[bytes, Nanos], None] | None = None,
    ) -> None:
        self.part = part
        self._incoming = incoming
        self._outgoing = outgoing
        self._on_arrival = on_arrival
        #: The part's own deadline, which moves only when it acts or receives.
        self._own_deadline = part.next_deadline()

    def next_deadline(self) -> Nanos | None:
        """Return when the part wants to act, or when bytes will have arrived for it."""
        own, arrival = self._own_deadline, self._incoming.next_deadline()
        if own is None or arrival is None:
            return arrival if own is None else own
        return min(own, arrival)

    def advance_to(self, limit: Nanos) -> Reached:
        """Deliver, act and send, up to and including `limit`."""
        part = self.part
        deadline = self._incoming.next_deadline()
        if deadline is not None and deadline <= limit:
            self._incoming.advance_to(limit)
            for arrival in self._incoming.take_arrived():
                if self._on_arrival is not None:
                    self._on_arrival(arrival.data, arrival.at)
                part.receive(arrival.data, arrival.at)
        part.advance_to(limit)
        for frame in part.take_output():
            self._outgoing.send(frame, limit)
        self._own_deadline = part.next_deadline()
        return Reached(limit)

    def snapshot(self) -> dict[str, object]:
        """Return the part and the line that it reads."""
        return {"part": self.part.snapshot(), "incoming": self._incoming.snapshot()}

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        state = cast("Mapping[str, object]", snapshot)
        self.part.restore(state["part"])
        self._incoming.restore(state["incoming"])
        self._own_deadline = self.part.next_deadline()
