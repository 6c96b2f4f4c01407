"""A serial line delivers each message when its last character has arrived."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError
from robot_bench.wires.serial_line import Arrival, SerialLine

#: 10 bits at 9600 bit/s are 1 041 666.67 ns; arrivals are rounded up from the start of the stretch.
CHARACTER_NS = 1_041_667


def test_a_character_takes_ten_bits() -> None:
    line = SerialLine(9600)
    line.send(b"x", 100)
    assert line.next_deadline() == 100 + CHARACTER_NS
    line.advance_to(99 + CHARACTER_NS)
    assert line.take_arrived() == []
    line.advance_to(100 + CHARACTER_NS)
    assert line.take_arrived() == [Arrival(100 + CHARACTER_NS, b"x")]
    assert line.next_deadline() is None


def test_a_pair_of_commands_takes_18_75_ms() -> None:
    line = SerialLine(9600)
    for _ in range(2):
        line.send(bytes(9), 0)
    assert line.free_at == 18_750_000


def test_a_message_queues_behind_what_is_going_out() -> None:
    line = SerialLine(9600)
    line.send(b"abc", 0)
    line.send(b"d", 1_000_000)
    line.send(b"", 1_000_000)
    assert [line.next_deadline(), line.free_at] == [3_125_000, 4_166_667]
    line.advance_to(10_000_000)
    assert [(item.at, item.data) for item in line.take_arrived()] == [(3_125_000, b"abc"), (4_166_667, b"d")]


def test_a_message_sent_as_the_line_falls_free_begins_at_once() -> None:
    line = SerialLine(9600)
    line.send(b"abc", 0)
    line.send(b"abc", 3_125_000)
    assert line.free_at == 6_250_000


@given(st.lists(st.tuples(st.integers(0, 3_000_000), st.binary(min_size=1, max_size=8)), max_size=12), st.data())
def test_arrivals_do_not_depend_on_when_anybody_looks(messages: list[tuple[int, bytes]], data: st.DataObject) -> None:
    whole, watched = SerialLine(9600), SerialLine(9600)
    now, seen = 0, []
    for gap, message in messages:
        for _ in range(data.draw(st.integers(0, 3))):
            watched.advance_to(now + data.draw(st.integers(0, gap)))
            seen += watched.take_arrived()
            restored = SerialLine(9600)
            restored.restore(pickle.loads(pickle.dumps(watched.snapshot())))  # noqa: S301 - our own bytes
            watched = restored
        now += gap
        whole.send(message, now)
        watched.send(message, now)
    for line in (whole, watched):
        line.advance_to(now + 10**9)
    seen += watched.take_arrived()
    assert sorted(seen, key=lambda item: item.at) == whole.take_arrived()


def test_a_line_without_speed_is_refused() -> None:
    with pytest.raises(LocalProtocolError, match="0 bit/s"):
        SerialLine(0)
