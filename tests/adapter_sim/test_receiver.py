"""When the ESP32's program sees what has arrived: threshold, time-out and passes, one tick before and at each."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim.receiver import Receiver, threshold
from tests.adapter_sim.conftest import MS, Rig

#: 16 bits at 38400 baud, rounded up.
TIMEOUT_NS = 416_667


@pytest.mark.parametrize(
    ("baud", "expected"),
    [(9600, 1), (19_999, 1), (20_000, 2), (38_400, 3), (115_200, 11), (649_999, 64), (1_000_000, 64)],
)
def test_the_driver_waits_for_what_comes_in_a_pass(baud: int, expected: int) -> None:
    assert threshold(baud) == expected


@pytest.mark.parametrize(("arrives_at", "seen_at"), [(7, 7), (8, 7 + MS), (7 + MS - 1, 7 + MS), (7 + MS, 7 + MS)])
def test_bytes_are_seen_in_the_next_pass(arrives_at: int, seen_at: int) -> None:
    receiver = Receiver()
    receiver.restart(7)
    receiver.arrive(b"ab", arrives_at)
    assert receiver.due_at == seen_at
    assert receiver.take(seen_at - 1) == []
    assert receiver.take(seen_at) == [b"ab"]
    assert receiver.due_at is None


@pytest.mark.parametrize(("size", "taken_at"), [(1, TIMEOUT_NS), (2, TIMEOUT_NS), (3, 0), (4, TIMEOUT_NS), (6, 0)])
def test_what_is_below_the_threshold_waits_for_the_time_out(size: int, taken_at: int) -> None:
    receiver = Receiver(38_400)
    receiver.arrive(bytes(size), 10 * MS - TIMEOUT_NS)
    assert receiver.due_at == 10 * MS
    receiver = Receiver(38_400)
    receiver.arrive(bytes(size), 10 * MS - TIMEOUT_NS + 1)
    assert receiver.due_at == (11 * MS if taken_at else 10 * MS)


def test_bytes_that_come_in_time_begin_the_time_out_anew() -> None:
    receiver = Receiver(38_400)
    receiver.arrive(b"a", 9 * MS)
    receiver.arrive(b"b", 9 * MS + TIMEOUT_NS - 1)
    receiver.arrive(b"c", 9 * MS + 2 * TIMEOUT_NS - 2)
    assert receiver.take(10 * MS) == [b"a", b"b", b"c"], "three are the threshold"
    receiver.arrive(b"a", 20 * MS - TIMEOUT_NS)
    receiver.arrive(b"b", 20 * MS - 1)
    assert receiver.due_at == 21 * MS


def test_bytes_that_come_at_the_time_out_are_counted_anew() -> None:
    receiver = Receiver(38_400)
    receiver.arrive(b"ab", 9 * MS)
    receiver.arrive(b"c", 9 * MS + TIMEOUT_NS)
    assert receiver.take(10 * MS) == [b"ab", b"c"]
    receiver.arrive(b"ab", 19 * MS)
    receiver.arrive(b"c", 20 * MS - TIMEOUT_NS + 1)
    assert receiver.take(20 * MS) == [b"ab"], "the third waits for its own"


def test_the_time_out_comes_before_a_byte_of_its_instant() -> None:
    receiver = Receiver(38_400)
    receiver.arrive(b"ab", 10 * MS - TIMEOUT_NS)
    receiver.arrive(b"c", 10 * MS)
    assert receiver.take(10 * MS) == [b"ab"]
    assert receiver.due_at == 11 * MS, "one byte alone, not the third of three"


def test_a_restart_forgets_and_counts_passes_anew() -> None:
    receiver = Receiver()
    receiver.arrive(b"old", 5)
    receiver.restart(6)
    assert receiver.due_at is None
    receiver.arrive(b"new", 7)
    assert receiver.due_at == 6 + MS


@given(st.lists(st.tuples(st.integers(0, 3 * MS), st.integers(1, 40)), max_size=30), st.sampled_from([9600, 38_400]))
def test_nothing_is_lost_reordered_early_or_later_than_two_passes(messages: list[tuple[int, int]], baud: int) -> None:
    receiver, now, sent, seen = Receiver(baud), 0, [], []
    for number, (pause, size) in enumerate(messages):
        until = now + pause
        while (due_at := receiver.due_at) is not None and due_at < until:
            seen += [(due_at, data) for data in receiver.take(due_at)]
        now = until
        sent.append((now, bytes((number,)) * size))
        receiver.arrive(sent[-1][1], now)
    while (due_at := receiver.due_at) is not None:
        seen += [(due_at, data) for data in receiver.take(due_at)]
    assert [data for _, data in seen] == [data for _, data in sent]
    limit = MS if baud == 9600 else 2 * MS
    assert all(0 <= at - arrived < limit for (at, _), (arrived, _) in zip(seen, sent, strict=True))


def test_what_a_reset_finds_in_the_receiver_is_gone() -> None:
    rig = Rig(receiver=Receiver())
    rig.connect()
    rig.run(rig.now // MS * MS)
    sips = rig.adapter.status.sips
    rig.adapter.receive(b"\xfa\xfb", rig.now + 1)
    rig.pins.set("rst", True, rig.now + 2)
    rig.run(rig.now + 3 * MS)
    assert rig.adapter.state == "reset"
    assert (rig.adapter.status.sips, sips > 0) == (0, True)
    assert rig.adapter.session.stats.wire.frames == 0
