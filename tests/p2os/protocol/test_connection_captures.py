"""Captured sessions, cut and corrupted at every byte, through either end of a connection.

Each chunk of a capture is replayed from a snapshot of the end that takes it, once
a damage: a bit flipped, a byte lost, the line dead from there on. What follows has
to be the session that goes on, or a loss or failure with a name; never an
exception, and never a robot that is open without a watchdog. The quick tests take
the handshake and the first packets; the slow ones take every byte of commands, and the soak those of packets.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from p2os.protocol.connection import (
    ConnectFailed,
    Connection,
    ConnectionLost,
    ConnectionRole,
    ConnectionSettings,
    ConnectionState,
    Event,
    WatchdogExpired,
)
from simbase.timing import NS_PER_S, Nanos

CAPTURES = Path(__file__).resolve().parents[2] / "golden" / "captures"
NAMES = ["aria_p2de", "player_p2de"]
#: How many chunks of each direction the quick tests damage: the handshake and a second of packets.
QUICK_CHUNKS = 12
#: How many chunks are fed after a damaged one.
FOLLOWING = 1
#: Longer than any patience of a client, and than the robot's watchdog.
LONG_NS: Nanos = 20 * NS_PER_S

Chunk = tuple[Nanos, bytes]
#: chunk and place → what arrives in its stead, and whether the line lives on.
Damage = Callable[[bytes, int], tuple[bytes, bool]]
DAMAGES: dict[str, Damage] = {
    "flipped": lambda data, place: (data[:place] + bytes((data[place] ^ 0x10,)) + data[place + 1 :], True),
    "lost": lambda data, place: (data[:place] + data[place + 1 :], True),
    "dead": lambda data, place: (data[:place], False),
}


def chunks(name: str, direction: str) -> list[Chunk]:
    rows = map(json.loads, (CAPTURES / f"{name}.jsonl").read_text(encoding="utf-8").splitlines())
    return [(round(row["t"] * NS_PER_S), bytes.fromhex(row["hex"])) for row in rows if row["dir"] == direction]


def new_end(role: ConnectionRole) -> Connection:
    """Return an end with the patience of the client that was captured, and its handshake under way."""
    settings = ConnectionSettings(open_delay_ns=1, liveness_ns=2 * NS_PER_S, first_packet_ns=2 * NS_PER_S)
    end = Connection(role, settings=settings)
    if role is ConnectionRole.CLIENT:
        end.connect(0)
    return end


def events(end: Connection) -> Iterator[Event]:
    while (event := end.next_event()) is not None:
        yield event


def feed(end: Connection, story: list[Chunk]) -> None:
    for now, data in story:
        end.receive(data, now)


def damaged(story: list[Chunk], which: int, place: int, damage: Damage) -> list[Chunk]:
    """Return a chunk with its damage, and what follows it."""
    now, data = story[which]
    left, is_alive = damage(data, place)
    return [(now, left), *(story[which + 1 : which + 1 + FOLLOWING] if is_alive else [])]


def check(role: ConnectionRole, name: str, damage: Damage, most_chunks: int | None) -> int:
    """Damage every byte of a capture; return how many there were."""
    story = chunks(name, "s2c" if role is ConnectionRole.CLIENT else "c2s")
    end, count = new_end(role), 0
    for which, (now, data) in enumerate(story[:most_chunks]):
        before = end.snapshot()
        feed(end, story[which : which + 1 + FOLLOWING])
        whole = end.stats.frames_received
        for place in range(len(data)):
            end.restore(before)
            list(events(end))
            feed(end, damaged(story, which, place, damage))
            has_a_name(end, end.advance_to(now + LONG_NS).now)
            lost = whole - end.stats.frames_received  # counted late: a false count holds bytes back for 250 ms
            assert lost <= 1 or damage is DAMAGES["dead"], f"byte {place} of chunk {which} cost {lost} frames"
            count += 1
        end.restore(before)
        feed(end, [story[which]])
        list(events(end))
    assert end.is_open or most_chunks is None
    return count


def has_a_name(end: Connection, now: Nanos) -> None:
    """Hold an end that has heard nothing for long to what it must have said."""
    reported = list(events(end))
    if end.role is ConnectionRole.CLIENT:
        assert end.state in {ConnectionState.LOST, ConnectionState.FAILED}
        assert any(isinstance(event, (ConnectFailed, ConnectionLost)) for event in reported)
        assert end.next_deadline() is None or end.next_deadline() > now  # type: ignore[operator]  # not None here
    elif end.is_open:
        assert any(isinstance(event, WatchdogExpired) for event in reported), "open, silent, and not stopped"


@pytest.mark.parametrize("role", list(ConnectionRole), ids=lambda role: role.value)
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_handshake_damaged_at_any_byte_opens_or_fails_by_name(role: ConnectionRole, name: str, damage: str) -> None:
    assert check(role, name, DAMAGES[damage], QUICK_CHUNKS) > 60


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_session_damaged_at_any_byte_goes_on_or_ends_by_name(name: str) -> None:
    for damage in DAMAGES.values():
        assert check(ConnectionRole.SERVER, name, damage, None) > 100


@pytest.mark.soak
@pytest.mark.parametrize(("name", "most"), [("aria_p2de", 29_000), ("player_p2de", 100)])
def test_packets_damaged_at_any_byte_go_on_or_end_by_name(name: str, most: int) -> None:
    for damage in DAMAGES.values():
        assert check(ConnectionRole.CLIENT, name, damage, None) > most
