"""Mutated sessions and random bytes through everything that reads them: no exception, no hang, no growth.

The targets are those of `tools/fuzz/protocol.py`.
"""

import gc
import json
import random
import runpy
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from p2os.protocol.commands import Command
from p2os.protocol.connection import Connection, ConnectionRole
from p2os.protocol.frames import MAX_COUNT, PREFIX_BYTES, BadChecksum, Decoder, Frame
from p2os.protocol.packets import packet_frame, read_packet
from p2os.protocol.profiles import Profile
from simbase.timing import NS_PER_MS

ROOT = Path(__file__).resolve().parents[3]
CAPTURES = ROOT / "tests" / "golden" / "captures"
FUZZ = runpy.run_path(str(ROOT / "tools" / "fuzz" / "protocol.py"))
MEGABYTE = 1_000_000


@pytest.mark.parametrize("target", FUZZ["TARGETS"])
def test_a_target_withstands_mutated_seeds(target: str) -> None:
    if target == "columns":
        pytest.importorskip("numpy")
    FUZZ["mutate"](target, 150, 0)


@pytest.mark.parametrize("target", FUZZ["TARGETS"])
def test_a_target_takes_nothing_and_its_seeds(target: str) -> None:
    if target == "columns":
        pytest.importorskip("numpy")
    for data in (b"", *FUZZ["seeds"](target)[:20]):
        FUZZ["TARGETS"][target](data)


def test_the_fuzzer_names_the_input_that_fails(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    def fails(data: bytes) -> None:
        raise ZeroDivisionError(len(data))

    monkeypatch.setitem(FUZZ["TARGETS"], "decoder", fails)
    with pytest.raises(ZeroDivisionError):
        FUZZ["mutate"]("decoder", 1, 7)
    assert "decoder: input 0 of seed 7: " in capsys.readouterr().err


#: The captured sessions of both ways.
SESSIONS = ("aria_p2de", "player_p2de")


def sessions() -> list[tuple[list[bytes], list[bytes]]]:
    """Return the captured sessions as the chunks of client and robot."""
    found = []
    for path in (CAPTURES / f"{name}.jsonl" for name in SESSIONS):
        entries = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        ways = ([bytes.fromhex(entry["hex"]) for entry in entries if entry["dir"] == way] for way in ("c2s", "s2c"))
        client, robot = ways
        found.append((client, robot))
    return found


def half_mutated(total: int, rng: random.Random) -> Iterator[tuple[bytes, bytes]]:
    """Yield chunks of client and robot, half of them mutated valid sessions and half thrown."""
    known, done = sessions(), 0
    while done < total:
        if rng.random() < 0.5:
            size = rng.randrange(1, 600)
            pair = rng.randbytes(size), rng.randbytes(size)
        else:
            client, robot = rng.choice(known)
            start, count = rng.randrange(max(len(client), len(robot))), rng.randrange(1, 30)
            mutated = (b"".join(way[start % len(way) :][:count]) for way in (client, robot))
            first, second = (FUZZ["mutated"](data, rng) if rng.random() < 0.7 else data for data in mutated)
            pair = first, second
        done += len(pair[0]) + len(pair[1])
        yield pair


def endure(total: int, seed: int) -> None:
    """Feed so many bytes to a decoder, a client and a server; memory after the first tenth may not grow."""
    rng, now, fed = random.Random(seed), 0, 0
    decoder, ends = Decoder(), {role: Connection(role) for role in ConnectionRole}
    settled, at = 0, total // 10
    for chunks in half_mutated(total, rng):
        now += rng.choice((1, 20, 100, 240, 260, 3000)) * NS_PER_MS
        for role, data in zip((ConnectionRole.SERVER, ConnectionRole.CLIENT), chunks, strict=True):
            end = ends[role]
            if role is ConnectionRole.CLIENT and end.state in FUZZ["AT_REST"]:
                end.connect(now)
            end.receive(data, now)
            end.take_output()
            while end.next_event() is not None:
                pass
            decoder.receive(data, now)
            while (item := decoder.next_item()) is not None:
                if isinstance(item, Frame):
                    assert packet_frame(read_packet(item, Profile.P2OS), Profile.P2OS) == item
                    Command.from_frame(item)
            assert len(decoder._buffer) < MAX_COUNT + PREFIX_BYTES
            fed += len(data)
        if fed >= at:
            gc.collect()
            size = tracemalloc.get_traced_memory()[0]
            settled = settled or size
            assert size < settled + 20_000, f"{size - settled} bytes more after {fed} of seed {seed}"
            at += total // 10
    assert decoder.stats.frames > total // 1000
    assert decoder.stats.bad_checksums > 0


@pytest.mark.slow
def test_bytes_half_of_them_mutated_sessions_are_endured() -> None:
    tracemalloc.start()
    try:
        endure(150_000, 1)
    finally:
        tracemalloc.stop()


@pytest.mark.soak
def test_ten_million_bytes_half_of_them_mutated_sessions_are_endured() -> None:
    tracemalloc.start()
    try:
        endure(10 * MEGABYTE, 2)
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("way", [0, 1], ids=["client", "robot"])
@pytest.mark.parametrize("session", sessions(), ids=SESSIONS)
def test_a_frame_cut_and_corrupted_at_every_byte_alone_is_lost(session: tuple, way: int) -> None:
    # The frames of a session are of few kinds: each fifth, and the first of each kind and length.
    assert lose_only_what_was_hit(b"".join(session[way]), every=5) > 50


@pytest.mark.soak
@pytest.mark.parametrize("way", [0, 1], ids=["client", "robot"])
@pytest.mark.parametrize("session", sessions(), ids=SESSIONS)
def test_a_session_cut_and_corrupted_at_every_byte_loses_only_what_was_hit(session: tuple, way: int) -> None:
    stream = b"".join(session[way])
    assert lose_only_what_was_hit(stream, every=1) == len(stream)


def lose_only_what_was_hit(stream: bytes, every: int) -> int:
    """Hit every so many frames of a stream, and the first of each kind and length, at each byte; return how many."""
    whole = Decoder()
    whole.receive(stream, 0)
    places, at = [], 0
    while (item := whole.next_item()) is not None:
        assert isinstance(item, Frame), "the captures are clean"
        places.append((at, at + len(item.to_bytes()), item))
        at += len(item.to_bytes())
    seen, count = set(), 0
    # Only the frame that is hit and the two behind it can be touched: the rest is not fed again, but for one before it.
    for number, (start, end, hit) in enumerate(places):
        if number % every and (hit.kind, end - start) in seen:
            continue
        seen.add((hit.kind, end - start))
        count += end - start
        first, last = max(0, number - 1), min(len(places), number + 3)
        near = [frame for _, _, frame in places[first:last]]
        begin, stop = places[first][0], places[last - 1][1]
        for place in range(start, end):
            flipped = stream[begin:place] + bytes((stream[place] ^ 0x10,)) + stream[place + 1 : stop]
            lost = stream[begin:place] + stream[place + 1 : stop]
            for damaged in (flipped, lost, stream[begin:place]):
                found, rejected = frames_of(damaged)
                others = near[: number - first] if damaged == stream[begin:place] else [f for f in near if f is not hit]
                assert without(others, found) == [], f"byte {place}"
                assert rejected <= len(damaged)
    return count


def frames_of(data: bytes) -> tuple[list[Frame], int]:
    decoder, found, rejected = Decoder(), [], 0
    decoder.receive(data, 0)
    decoder.advance_to(250 * NS_PER_MS)
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Frame):
            found.append(item)
        rejected += isinstance(item, BadChecksum)
    return found, rejected


def without(wanted: list[Frame], found: list[Frame]) -> list[Frame]:
    """Return those wanted that were not found, each found one counting once."""
    left = list(found)
    missing = []
    for frame in wanted:
        if frame in left:
            left.remove(frame)
        else:
            missing.append(frame)
    return missing
