"""Fuzz targets for whatever reads bytes of others, and a plain mutator to run them with; files: `files.py`.

A target takes any bytes and raises only when something is wrong: an exception
that its reader does not promise, or a broken invariant.

Usage: python tools/fuzz/protocol.py TARGET COUNT [SEED]
"""

import itertools
import json
import random
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from p2os.capture import Direction, Reading, capture_of, rows_of
from p2os.capture.explain import explain
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world import parse_world
from p2os.protocol.commands import Command
from p2os.protocol.connection import Connection, ConnectionRole, ConnectionState
from p2os.protocol.frames import GIVE_UP_NS, MAX_COUNT, PREFIX_BYTES, Decoder, Frame
from p2os.protocol.packets import packet_frame, read_packet
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, Nanos

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests" / "golden"
EMPTY = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
P2DX = load_parameters("p2dx")
#: Where a client may begin anew.
AT_REST = {ConnectionState.CLOSED, ConnectionState.LOST, ConnectionState.FAILED}
WAITS_NS = (0, NS_PER_MS, 20 * NS_PER_MS, 100 * NS_PER_MS, GIVE_UP_NS - 1, GIVE_UP_NS, 1000 * NS_PER_MS)


def chunks_of(data: bytes) -> Iterator[tuple[Nanos, bytes]]:
    """Yield (nanoseconds, bytes): a byte of wait and one of size stand before each chunk."""
    now, place = 0, 0
    while place + 1 < len(data):
        now += WAITS_NS[data[place] % len(WAITS_NS)]
        end = place + 2 + data[place + 1]
        yield now, data[place + 2 : end]
        place = end


def packed(parts: Iterable[bytes]) -> bytes:
    """Return what `chunks_of` reads as these parts, 20 ms apart."""
    return b"".join(bytes((2, len(part))) + part for part in parts)


def drain(decoder: Decoder) -> list[Frame]:
    """Return the frames that a decoder has found."""
    found = []
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Frame):
            found.append(item)
    return found


def fuzz_decoder(data: bytes) -> None:
    """Every byte is in a frame or is noise, nothing stays, no more than a frame is kept."""
    decoder, now, fed, held = Decoder(), 0, 0, 0
    for now, chunk in chunks_of(data):
        decoder.receive(chunk, now)
        fed += len(chunk)
        held += sum(len(frame.to_bytes()) for frame in drain(decoder))
        assert len(decoder._buffer) < MAX_COUNT + PREFIX_BYTES  # noqa: SLF001 - the bound is the point
    decoder.advance_to(now + GIVE_UP_NS)
    held += sum(len(frame.to_bytes()) for frame in drain(decoder))
    assert held + decoder.stats.noise_bytes == fed
    assert decoder.next_deadline() is None


def fuzz_packets(data: bytes) -> None:
    """Any payload reads as a packet and writes as itself, in every family; any payload reads as a command."""
    if not 1 <= len(data) <= MAX_COUNT - 2:
        return
    frame = Frame(data)
    for profile in Profile:
        assert packet_frame(read_packet(frame, profile), profile) == frame
    command = Command.from_frame(frame)
    assert Command.from_frame(command.to_frame()) == command


def fuzz_rows(data: bytes) -> None:
    """Any bytes, either way or of unknown origin, are listed and explained byte by byte."""
    directions = (Direction.TO_ROBOT, Direction.FROM_ROBOT, None)
    parts = [(now, directions[len(part) % 3], part) for now, part in chunks_of(data)]
    for profile in Profile:
        reading = Reading(profile=profile, parameters=P2DX)
        for row in rows_of(capture_of(parts), reading):
            assert b"".join(part.data for part in explain(row, reading)) == row.data
            json.dumps(row.as_plain(), allow_nan=False)


def fuzz_server(data: bytes) -> None:
    """A server takes anything, answers with sound frames, and keeps its deadlines ahead of the time."""
    _fuzz_connection(Connection(ConnectionRole.SERVER), data)


def fuzz_client(data: bytes) -> None:
    """A client takes anything from its robot, and begins anew whenever it may."""
    _fuzz_connection(Connection(ConnectionRole.CLIENT), data)


def _fuzz_connection(end: Connection, data: bytes) -> None:
    for now, chunk in chunks_of(data):
        if end.role is ConnectionRole.CLIENT and end.state in AT_REST:
            end.connect(now)
        end.receive(chunk, now)
        end.advance_to(now)
        due = end.next_deadline()
        assert due is None or due > now
        for frame in end.take_output():
            Frame.from_bytes(frame)
        while end.next_event() is not None:
            pass


def fuzz_robot(data: bytes) -> None:
    """The virtual Pioneer takes anything from its client and goes on sending sound frames."""
    robot = Pioneer(body=make_body("kinematic", EMPTY, P2DX), parameters=P2DX)
    for command in (0, 1, 2, 1):
        robot.receive(Command(command).to_frame().to_bytes(), 0)
    for now, chunk in chunks_of(data):
        robot.receive(chunk, min(now, 3000 * NS_PER_MS))
        for frame in robot.take_output():
            Frame.from_bytes(frame)


def fuzz_columns(data: bytes) -> None:
    """Columns are the objects, row by row."""
    from p2os.capture.columns import decode
    from p2os.capture.columns.objects import rows_by_objects

    for profile in (Profile.P2OS, Profile.AROS):
        for ours, theirs in itertools.zip_longest(decode(data, profile).rows(), rows_by_objects(data, profile)):
            assert ours == theirs, (ours, theirs)


TARGETS: Mapping[str, Callable[[bytes], None]] = {
    "decoder": fuzz_decoder, "packets": fuzz_packets, "rows": fuzz_rows, "server": fuzz_server,
    "client": fuzz_client, "robot": fuzz_robot, "columns": fuzz_columns,
}  # fmt: skip


def seeds(target: str) -> list[bytes]:
    """Return what a target's inputs are mutated from."""
    vectors = json.loads((GOLDEN / "p2os_vectors.json").read_text(encoding="utf-8"))
    frames = [bytes.fromhex(vector["hex"]) for vector in vectors]
    if target == "packets":
        return [frame[3:-2] for frame in frames]
    found = []
    for path in sorted((GOLDEN / "captures").glob("*.jsonl")):
        lines = path.read_text(encoding="utf-8").splitlines()
        for way in ("c2s", "s2c"):
            parts = [bytes.fromhex(entry["hex"]) for entry in map(json.loads, lines) if entry["dir"] == way]
            if target == "columns":
                found.append(b"".join(parts)[:4000])
            else:
                found.append(packed(part[at : at + 255] for part in parts[:60] for at in range(0, len(part), 255)))
    return found + [frame if target == "columns" else packed((frame,)) for frame in frames]


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with a few hits: flipped, lost, doubled, cut, copied from elsewhere, or thrown in."""
    work = bytearray(data)
    for _ in range(rng.randrange(1, 9)):
        place = rng.randrange(len(work) + 1)
        size = rng.choice((1, 1, 1, 2, 4, 16, 64))
        match rng.randrange(6):
            case 0 if work:
                work[place % len(work)] ^= 1 << rng.randrange(8)
            case 1:
                del work[place : place + size]
            case 2:
                work[place:place] = work[place : place + size]
            case 3:
                work[place : place + size] = rng.randbytes(size)
            case 4:
                other = rng.randrange(len(work) + 1)
                work[place:place] = work[other : other + size]
            case _:
                work[place:place] = rng.choice(
                    (b"\xfa\xfb", b"\xfa\xfb\x03", b"\xfa\xfb\xc8", b"\xfa", b"\0", b"\xff\xff")
                )
    return bytes(work)


def mutate(target: str, count: int, seed: int) -> None:
    """Run a target on mutated seeds; what fails is written beside and named."""
    rng, begun = random.Random(seed), seeds(target)
    for number in range(count):
        data = mutated(rng.choice(begun), rng)
        try:
            TARGETS[target](data)
        except BaseException:
            print(f"{target}: input {number} of seed {seed}: {data.hex()}", file=sys.stderr)
            raise


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in TARGETS:
        sys.exit(f"usage: {sys.argv[0]} {'|'.join(TARGETS)} COUNT [SEED]")
    mutate(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0)
