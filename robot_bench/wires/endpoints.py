"""Endpoints in the loop: each joins a part to its lines and hands its bytes on.

An endpoint is a follower of the run loop. It takes what its line has delivered at
the very time of delivery, brings its part there, and sends what comes out.

Invariant: bytes enter a part at the time at which their last character arrived,
and leave it at the time at which the part acted.
"""

from collections.abc import Callable
from typing import Protocol

from robot_bench.wires.serial_line import SerialLine
from simbase.state import Stateful
from simbase.timing import Nanos, Reached, Timed


class EndpointPart(Timed, Protocol):
    """A part that exchanges bytes: the adapter, the robot's controller."""

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`."""

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""


class Endpoint(Stateful):
    """A part between an incoming and an outgoing line.

    Args:
        part: What stands here.
        incoming: The line whose arrivals it reads.
        outgoing: The line that it writes to.
        on_arrival: Called with each delivery, before the part takes it: (bytes, ns).
        next_due: Returns when the part is to be brought forward; None asks its `next_deadline`.
        first_sight: Returns the earliest time at which the part acts on what arrives at a time; until then nobody need
            bring it there. None: at once.
    """

    STATE = ("part", "_incoming")
    DERIVED = ("_own_deadline",)

    def __init__(
        self,
        part: EndpointPart,
        *,
        incoming: SerialLine,
        outgoing: SerialLine,
        on_arrival: Callable[[bytes, Nanos], None] | None = None,
        next_due: Callable[[], Nanos | None] | None = None,
        first_sight: Callable[[Nanos], Nanos] | None = None,
    ) -> None:
        self.part = part
        self._next_due = next_due or part.next_deadline
        self._incoming = incoming
        self._outgoing = outgoing
        self._on_arrival = on_arrival
        self._first_sight = first_sight
        #: The part's own deadline, which moves only when it acts or receives.
        self._own_deadline = self._next_due()

    def next_deadline(self) -> Nanos | None:
        """Return when the part wants to act, or when it may see bytes that will have arrived for it."""
        own, arrival = self._own_deadline, self._incoming.next_deadline()
        if arrival is not None and self._first_sight is not None:
            arrival = self._first_sight(arrival)
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
        self._own_deadline = self._next_due()
        return Reached(limit)

    def _restored(self) -> None:
        self._own_deadline = self._next_due()
