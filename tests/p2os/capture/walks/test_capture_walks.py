"""Captures, sound and damaged, read from every format, listed, explained, tabled, shown and played, as approved."""

import io
import json
import random
from collections.abc import Iterator
from pathlib import Path

from p2os.capture import (
    Capture,
    Chunk,
    Direction,
    Reading,
    capture_of,
    explain,
    frame_chunks,
    read_capture,
    read_file,
    rows_of,
    write_pcap,
    write_recording,
)
from p2os.capture.explain import lines_of
from p2os.capture.formats.hex_text import write_hex
from p2os.capture.listing import guess_direction, line_of, summary_of
from p2os.capture.replay import Replay
from p2os.capture.sips import sips_of
from p2os.capture.table import table_of, tables_of, tables_of_sips, write_csv
from p2os.protocol.command_table import BY_NUMBER
from p2os.protocol.commands import Command
from p2os.protocol.frames import Frame
from p2os.protocol.packets import EncoderPacket, packet_frame
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from p2os.view.capture_recording import CaptureTracks
from p2os.view.header import PageHeader
from p2os.view.recording import ViewRecording
from simbase.timing import NS_PER_MS
from tests.p2os.capture.blocks import blocks_of
from tests.p2os.capture.network_files import ETHERNET, network_file, segment
from tests.p2os.protocol.drawn_packets import KINDS, Draw
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

GOLDEN = Path(__file__).resolve().parents[3] / "golden"
VECTORS = [bytes.fromhex(str(row["hex"])) for row in json.loads((GOLDEN / "p2os_vectors.json").read_text())]
READINGS = tuple(
    Reading(profile=profile, parameters=load_parameters(model))
    for profile, model in zip(Profile, ("p2dx", "p2at8", "p3dx"), strict=True)
)
TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT


def captured(name: str, first: int, count: int) -> Capture:
    chunks = read_file(GOLDEN / "captures" / f"{name}.jsonl").chunks[first : first + count]
    return capture_of([(chunk.at_ns, chunk.direction, chunk.data) for chunk in chunks])


SESSIONS = (
    captured("aria_p2de", 0, 60), captured("aria_p3dx_gyro", 0, 21), captured("player_p2de", 0, 30),
    captured("ros_p2dx", 5, 30), captured("soar_p3dx", 0, 20),
)  # fmt: skip


def damaged(draw: random.Random, capture: Capture) -> Capture:
    """Return a capture of which bytes are lost, changed and cut, and some are without a direction."""
    parts = []
    for chunk in capture.chunks:
        data = bytearray(chunk.data)
        for _ in range(draw.choice((0, 0, 1))):
            place = draw.randrange(len(data))
            data[place : place + draw.choice((0, 1, 2))] = draw.randbytes(draw.choice((0, 1, 3)))
        cut = draw.randrange(len(data) + 1)
        direction = chunk.direction if draw.random() < 0.9 else None
        late = draw.choice((0, 0, 300 * NS_PER_MS))
        parts += [(chunk.at_ns, direction, bytes(data[:cut])), (chunk.at_ns + late, direction, bytes(data[cut:]))]
    return capture_of(sorted((part for part in parts if part[2]), key=lambda part: part[0]))


def listed(capture: Capture, reading: Reading) -> Iterator[str]:
    for row in rows_of(capture, reading):
        yield line_of(row)
        yield said((row.at_ns, row.kind, row.name, row.problem, row.as_plain()))


def vectors(draw: random.Random) -> Iterator[str]:
    """List and explain each frame that there is, to and from a robot of each firmware."""
    commands = [
        Command(row.number, value).to_frame().to_bytes()
        for row in BY_NUMBER.values() for value in (None, 1, -300, b"ab\0")
    ]  # fmt: skip
    for number, data in enumerate([*VECTORS, *commands]):
        reading = READINGS[number % 3]
        for direction in (TO, FROM, None) if number < len(VECTORS) else (TO,):
            for row in rows_of(capture_of([(NS_PER_MS, direction, data)]), reading):
                yield "\n".join([line_of(row, has_time=False), *lines_of(explain(row, reading))])
        yield said((guess_direction(data[3:-2]), guess_direction(draw.randbytes(4))))
    yield said([summary_of(rows, bad, s) for rows, bad, s in ((0, 0, 0.0), (1, 1, 0.5), (2, 0, 61.0), (1200, 3, 3.0))])


def fields(draw: random.Random) -> Iterator[str]:
    """Explain each kind of packet in each layout, with bytes behind its last field and without its last one."""
    source = Draw(draw.getrandbits(20))
    for number, make in enumerate(KINDS.values()):
        for profile, reading in zip(Profile, READINGS, strict=True):
            payload = packet_frame(make(source), profile).payload
            for changed in (payload, payload + b"\1\2", payload[:-1] or payload):
                data = Frame(changed[:200]).to_bytes()
                for row in rows_of(capture_of([(NS_PER_MS * number, FROM, data)]), reading):
                    yield "\n".join([line_of(row, has_time=False), *lines_of(explain(row, reading))])


def sessions(draw: random.Random) -> Iterator[str]:
    for number, capture in enumerate(SESSIONS):
        yield from listed(capture, READINGS[number % 3])
        yield from listed(damaged(draw, capture), READINGS[(number + 1) % 3])


def formats(draw: random.Random) -> Iterator[str]:
    """Write each session in each format and read it again: whole, cut short and changed."""
    for capture in SESSIONS:
        pieces = [*frame_chunks(capture.chunks)][:20]
        small = Capture(chunks=tuple(Chunk(at_ns=one.at_ns, direction=one.direction, data=one.data) for one in pieces))
        packets = [segment(8101, 40000, 1 + sum(len(one.data) for one in pieces[:n]), one.data)
                   for n, one in enumerate(pieces)]  # fmt: skip
        files = [write_pcap(pieces), write_recording(small).encode(), write_hex(small).encode(),
                 network_file([packets[0], packets[2], packets[1], *packets[2:]], 1, ETHERNET)]  # fmt: skip
        for data in files:
            cut = draw.randrange(len(data))
            spoilt = data[:cut] + draw.randbytes(2) + data[cut + 2 :]
            for one in (data, data[:cut], spoilt):
                yield tried(lambda one=one: [read_capture(one, FROM).duration_ns, *read_capture(one, FROM).chunks])


def tables(draw: random.Random) -> Iterator[str]:
    for number, capture in enumerate(SESSIONS):
        reading = READINGS[number % 3]
        rows = [*rows_of(damaged(draw, capture), reading)]
        for several in (tables_of(rows, reading, 7), [table_of(rows, reading)]):
            write_csv(several, text := io.StringIO())
            yield from text.getvalue().splitlines()
        every = [*sips_of(blocks_of(capture.chunks, 9), reading)]
        yield said([(one.at_ns, [payload.hex() for payload in one.payloads]) for one in every])
        write_csv(tables_of_sips(every, reading, 9), text := io.StringIO())
        yield from text.getvalue().splitlines()
    for xs in ((16383, 16384, 0), (16384, 32767, 16383), (0, 16384, 0), (5, 16389, 32768), (20000, 3000, 19000)):
        sips = [packet_frame(StandardSip(raw_x=x, raw_y=x // 2), Profile.P2OS).to_bytes() for x in xs]
        chunks = capture_of([(number, FROM, data) for number, data in enumerate(sips)]).chunks
        encoder = packet_frame(EncoderPacket(left_counts=1, right_counts=2), Profile.P2OS).to_bytes()
        mixed = capture_of([*((one.at_ns, FROM, one.data) for one in chunks), (9, FROM, encoder)])
        for table in (
            *tables_of_sips(sips_of(blocks_of(chunks, 2), READINGS[0]), READINGS[0], 2),
            table_of(list(rows_of(mixed, READINGS[0])), READINGS[0]),
        ):
            yield said([xs, [*table.columns["x_m"]], [*table.columns["y_m"]]])


def views(draw: random.Random) -> Iterator[str]:
    for number, capture in enumerate(SESSIONS):
        tracks = CaptureTracks(ViewRecording(PageHeader(title="x")), ("", "p2dx", "p3at")[number % 3])
        tracks.take(damaged(draw, capture).chunks)
        yield said(tracks.recording.full_header)
        for pixels, listed_rows in ((1000, 1000), (4, 5)):
            for frame in tracks.recording.frames(pixels, listed_rows):
                yield said(
                    (frame.kind.name, frame.from_ns, frame.to_ns, frame.of, int(frame.flags), len(frame.to_bytes()))
                )
                yield said([[*column][:40] for column in frame.columns])


def replays(draw: random.Random) -> Iterator[str]:
    for number, capture in enumerate(SESSIONS):
        role = (TO, FROM)[number % 2]
        replay = Replay(capture, role, speed=draw.choice((0.5, 1.0, 4.0)))
        replay.start(now := 5)
        for _ in range(30):
            due = replay.next_deadline()
            now = max(now, due) if due is not None else now + draw.choice((50, 300)) * NS_PER_MS
            if due is None:
                replay.receive(Command(draw.randrange(3)).to_frame().to_bytes(), now)
            replay.advance_to(now)
            yield said(
                (
                    now,
                    due,
                    replay.take_output(),
                    replay.frames_left,
                    replay.awaited,
                    replay.waited(now),
                    replay.is_closed,
                )
            )


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (vectors, fields, sessions, formats, tables, views, replays)
}
TRACES["declared"] = declared_of("p2os.capture", "p2os.capture.columns", "p2os.capture.formats")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
