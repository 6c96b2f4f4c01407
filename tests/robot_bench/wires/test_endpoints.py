"""An endpoint is brought to what its part can see, and hands on what arrived before with its own time."""

import pytest

from adapter_sim.receiver import PASS_NS, Receiver
from robot_bench.wires.endpoints import Endpoint
from robot_bench.wires.serial_line import SerialLine
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos, Reached


class Listener(Stateful):
    """A part that never acts by itself, and keeps what it receives."""

    STATE = ("heard", "reached")

    def __init__(self) -> None:
        self.heard: list[tuple[bytes, Nanos]] = []
        self.reached: Nanos = 0

    def receive(self, data: bytes, now: Nanos) -> None:
        assert now >= self.reached, "time does not go back"
        self.heard.append((data, now))

    def next_deadline(self) -> Nanos | None:
        return None

    def advance_to(self, limit: Nanos) -> Reached:
        self.reached = limit
        return Reached(limit)

    def take_output(self) -> list[bytes]:
        return []


def sent(at: Nanos, *, sees_late: bool) -> tuple[Endpoint, Listener, Nanos]:
    """Return an endpoint to which a byte was sent at a time, its part, and when the byte arrives."""
    line, part = SerialLine(), Listener()
    sight = Receiver().first_sight if sees_late else None
    end = Endpoint(part, incoming=line, outgoing=SerialLine(), first_sight=sight)
    line.send(b"x", at)
    arrival = line.next_deadline()
    assert arrival is not None
    return end, part, arrival


@pytest.mark.parametrize(("sees_late", "wait"), [(False, 0), (True, PASS_NS)])
def test_nobody_stops_for_bytes_before_the_part_may_see_them(sees_late: bool, wait: Nanos) -> None:
    end, part, arrival = sent(0, sees_late=sees_late)
    due = end.next_deadline()
    assert due is not None
    assert (due, due % PASS_NS == 0) == ((-(-arrival // PASS_NS) * PASS_NS, True) if wait else (arrival, False))
    end.advance_to(due)
    assert part.heard == [(b"x", arrival)]


def test_whoever_is_brought_farther_before_gets_them_at_their_time() -> None:
    end, part, arrival = sent(0, sees_late=True)
    end.advance_to(arrival - 1)
    assert part.heard == []
    end.advance_to(arrival)
    assert part.heard == [(b"x", arrival)]
    assert end.next_deadline() is None


def test_bytes_that_arrive_with_a_pass_are_seen_by_it() -> None:
    receiver = Receiver()
    assert receiver.first_sight(3 * NS_PER_MS) == 3 * NS_PER_MS
    assert receiver.first_sight(3 * NS_PER_MS + 1) == 4 * NS_PER_MS
    receiver.restart(250)
    assert receiver.first_sight(3 * NS_PER_MS) == 3 * NS_PER_MS + 250
