"""What is read many at a time, by NumPy, and every source that a capture may come from, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import io
import random
import struct
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from unittest.mock import patch

import pytest

np = pytest.importorskip("numpy")

from p2os.capture import Capture, Chunk, Direction, Reading, read_capture, read_file, rows_of  # noqa: E402
from p2os.capture.chunks import block_of, blocks_of, capture_of, chunks_of, in_order  # noqa: E402
from p2os.capture.columns.column import ArrayConversion, Column  # noqa: E402
from p2os.capture.columns.framing import find_frames  # noqa: E402
from p2os.capture.columns.gathering import gather, gather_items, indexes_of, joined, offsets_of  # noqa: E402
from p2os.capture.columns.objects import rows_by_objects  # noqa: E402
from p2os.capture.columns.sip_table import sip_tables  # noqa: E402
from p2os.capture.columns.tables import decode, table_name  # noqa: E402
from p2os.capture.dissector import plugin_folder, script  # noqa: E402
from p2os.capture.formats import pcap_records, sources  # noqa: E402
from p2os.capture.formats.hex_text import hex_parts, is_hexdump, looks_like_hex  # noqa: E402
from p2os.capture.formats.pcap import is_pcap, pcap_blocks, write_pcap  # noqa: E402
from p2os.capture.formats.pcap_records import MAGIC_NS, MAGIC_US, PCAPNG_MAGIC  # noqa: E402
from p2os.capture.formats.recording import note_of, recorded_parts, write_recording  # noqa: E402
from p2os.capture.formats.recording_bulk import plain_lines  # noqa: E402
from p2os.capture.formats.sources import open_argument  # noqa: E402
from p2os.capture.formats.tcp_streams import TcpStreams  # noqa: E402
from p2os.capture.reading import FollowedReading  # noqa: E402
from p2os.capture.replay import Replay  # noqa: E402
from p2os.capture.sips import in_groups, sips_of  # noqa: E402
from p2os.capture.table import write_csv  # noqa: E402
from p2os.capture.tap import Tap  # noqa: E402
from p2os.cli.captures.reading import chosen_rows, direction_of, wanted_names  # noqa: E402
from p2os.protocol.commands import Command  # noqa: E402
from p2os.protocol.frames import Frame  # noqa: E402
from p2os.protocol.packets import IDENTITY_KIND, READERS, StandardSip, packet_frame  # noqa: E402
from p2os.protocol.profiles import Profile  # noqa: E402
from p2os.protocol.sip import SIP_KINDS  # noqa: E402
from p2os.robots.parameters import load_parameters  # noqa: E402
from simbase.timing import NS_PER_MS, NS_PER_S  # noqa: E402
from tests.p2os.capture.blocks import blocks_of as in_blocks  # noqa: E402
from tests.p2os.capture.network_files import block, network_file, segment  # noqa: E402
from tests.p2os.capture.test_columns import stream_of  # noqa: E402
from tests.p2os.capture.test_pcap_bulk import LINKS, packets  # noqa: E402
from tests.p2os.protocol.drawn_packets import KINDS, Draw, any_packet, any_sip  # noqa: E402
from tests.tools.suite.approved import Trace, judge_of, said, tried  # noqa: E402

TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT
READINGS = [Reading(profile=profile, parameters=load_parameters(name))
            for profile, name in zip(Profile, ("p2dx", "p2at8", "p3dx"), strict=True)]  # fmt: skip
HEADER = struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)


def columns(draw: random.Random) -> Iterator[str]:
    """Decode streams of anything into columns, in one piece, in blocks and with pauses."""
    source = Draw(draw.getrandbits(30))
    streams = [stream_of(draw.getrandbits(30)) for _ in range(24)]
    streams += [
        packet_frame(make(source), Profile.P2OS).to_bytes() + packet_frame(make(source), Profile.P2OS).to_bytes()
        for make in KINDS.values()
    ]
    streams += [
        Frame(bytes([kind])).to_bytes() + Frame(bytes([kind, 0, 1])).to_bytes()
        for kind in (*READERS, *SIP_KINDS, IDENTITY_KIND)
    ]
    streams += [nested(draw) for _ in range(12)]
    for number, data in enumerate(streams):
        pauses = None if number % 3 else np.array(sorted({draw.randrange(len(data) + 1) for _ in range(3)}), np.int64)
        found = decode(data, [*Profile][number % 3], pauses=pauses)
        yield said((found.starts.tolist(), found.ends.tolist(), found.kinds.tolist(), found.damage()))
        yield said([*found.rows()])
        if pauses is None:
            yield said([*rows_by_objects(data, [*Profile][number % 3])] == [*found.rows()])
        for name, table in found.tables.items():
            yield said(
                (name, len(table), table.packets.tolist(), table.structured().dtype.descr, table.structured().tolist())
            )
            yield said([(key, ragged.offsets.tolist(), ragged.rows.tolist()) for key, ragged in table.ragged.items()])
        for size in (1, 30):
            yield said(
                [each.tolist() for each in find_frames(np.frombuffer(data, np.uint8), pauses=pauses, block=size)]
            )
    yield said([table_name(bytes([kind]) + bytes(size)) for kind in range(256) for size in (0, 20, 21)])


def nested(draw: random.Random) -> bytes:
    """Return frames that hold others, of which some have others in their checksums; the outer ones perhaps damaged."""
    data = Frame(draw.randbytes(3)).to_bytes()
    for _ in range(draw.randint(1, 4)):
        other = Frame(draw.randbytes(draw.randint(1, 9))).to_bytes()
        data = Frame(draw.choice((b"\x77" + data, b"\x77" + data + other, b"\x77" + other + data + other))).to_bytes()
        data = draw.choice((data, data, data[:-1] + b"\0", data[:-2] + Frame(b"\x0b").to_bytes()))
    return data + Frame(b"\x0c").to_bytes()


def chunks_drawn(draw: random.Random, source: Draw, count: int) -> list[Chunk]:
    """Return what a robot and a client may say, cut, late, damaged and within each other."""
    now, found = 0, list[Chunk]()
    for _ in range(count):
        data = packet_frame(draw.choice((any_sip, any_sip, any_packet))(source), Profile.P2OS).to_bytes()
        place = draw.randrange(len(data))
        parts = draw.choice(((data,), (data,), (data[:place], data[place:]), (data[:place],), (data[place:],), (b"\xfa\xfb\xc0", data),
                             (data[:place] + b"\x01" + data[place + 1 :],), (data + data,)))  # fmt: skip
        for part in parts:
            now += draw.choice((0, 1, 90, 249, 250, 251)) * NS_PER_MS
            if part:
                found.append(Chunk(at_ns=now, direction=FROM, data=part))
        if draw.random() < 0.3:
            now += draw.choice((0, 100, 250)) * NS_PER_MS
            command = Command(draw.choice((0, 1, 2, 11, 29)), draw.choice((None, 1))).to_frame().to_bytes()
            found.append(
                Chunk(at_ns=now, direction=TO, data=draw.choice((command, command + command, command[:4], b"\xfa")))
            )
    return found


def text_of(tables: Iterable[object]) -> str:
    write_csv(tables, text := io.StringIO())  # type: ignore[arg-type]
    return text.getvalue()


def sip_columns(draw: random.Random) -> Iterator[str]:
    """Make tables of SIPs by columns, in blocks of any size, and cut them anywhere."""
    source = Draw(draw.getrandbits(30))
    for number in range(14):
        chunks, reading = chunks_drawn(draw, source, 7), READINGS[number % 3]
        first, together, size = draw.choice((1, 2, 3, 4096)), draw.choice((1, 3, 100)), draw.choice((1, 250, 1 << 20))
        made = [*sip_tables(in_blocks(chunks, together), reading, first_rows=first, block=size)]
        yield said([(table.rows, [*table.columns]) for table in made])
        for table in made:
            yield text_of([table])
            yield said([(name, [type(cell).__name__ for cell in column][:3]) for name, column in table.columns.items()])
        every = [*sips_of(in_blocks(chunks, together), reading)]
        yield said(
            [
                (one.at_ns, [payload.hex() for payload in one.payloads])
                for one in in_groups(every, draw.choice((1, 2, 5)))
            ]
        )
    for xs in (
        (32760, 4, 32761),
        (16383, 16384, 0),
        (16384, 16383, 32767),
        (0, 16383, 32767, 0),
        (0xFFFF, 0x8000, 5),
        (20000, 3000, 19000),
    ):
        data = [packet_frame(StandardSip(raw_x=x, raw_y=x, raw_heading=x % 4096), Profile.P2OS).to_bytes() for x in xs]
        yield text_of(
            sip_tables(in_blocks(capture_of([(0, FROM, one) for one in data]).chunks, 1), READINGS[0], block=1)
        )


def passed(draw: random.Random) -> Iterator[str]:
    """List some kinds of rows alone, by NumPy and by a loop."""
    source = Draw(draw.getrandbits(30))
    for number in range(12):
        chunks = chunks_drawn(draw, source, 6)
        if number % 4 == 3:
            chunks = [Chunk(at_ns=one.at_ns, direction=None, data=one.data) for one in chunks]
        for only in ("sip", "vel,encoder", "pulse,sync0", "damaged", "stop,gyropac,config"):
            for least, together in ((0, 1), (0, 50), (1 << 11, 3)):
                with patch("p2os.capture.columns.passing.LEAST_BYTES", least):
                    rows = [*chosen_rows(in_blocks(chunks, together), READINGS[number % 3], wanted_names(only))]
                yield said(
                    [
                        (row.at_ns, row.direction and row.direction.arrow, row.name, row.problem, len(row.data))
                        for row in rows
                    ]
                )
        yield said([(row.at_ns, row.is_sip, row.as_plain()) for row in rows_of(chunks, READINGS[number % 3])])
    for word in ("", "to", "from", "client", "robot", "c2r", "r2c", ">", "<", "x"):
        yield tried(direction_of, word)


def network(draw: random.Random) -> Iterator[str]:
    """Read conversations of a network in bulk: segments that are repeated, lost, late and of others."""
    with patch("p2os.capture.formats.pcap.LEAST_RECORDS", 1), patch("p2os.capture.formats.pcap_bulk.LEAST_RECORDS", 1):
        for number in range(40):
            source, link = Draw(draw.getrandbits(30) | 1 << 29), draw.choice([*LINKS])
            data = network_file(
                packets(source), link, LINKS[link], order="<>"[number % 2], magic=(MAGIC_US, MAGIC_NS)[number % 3 == 0]
            )
            size = draw.choice((90, 300, 1 << 20))
            with patch("p2os.capture.formats.pcap_bulk.MOST_WAITING", draw.choice((2, 64))):
                yield tried(lambda data=data, size=size: blocks_said(data, size))
        for chunks in (
            [(0, TO, b"a"), (9, FROM, b"bc"), (9, TO, b""), (5, FROM, b"d")],
            [(0, FROM, b"")],
            [(0, TO, b"x" * 3)],
        ):
            whole = write_pcap(
                [Chunk(at_ns=at, direction=who, data=said_) for at, who, said_ in chunks],
                base_ns=1_700_000_000 * NS_PER_S,
            )
            for hurt in (
                whole,
                whole[:-1],
                whole[:-1] + b"\2",
                whole[:40] + b"\2" + whole[41:],
                whole[:40] + b"\1" + whole[41:],
                whole[:27] + b"\0" + whole[28:],
            ):
                yield tried(lambda data=hurt: blocks_said(data, 1 << 20))
        for ticks in (b"", b"\x06", b"\x09", b"\x07", b"\x0a", b"\x8a", b"\x80", b"\x03"):
            for late in (0, 1 << 12, 1 << 20, 1 << 31):
                data = pcapng(ticks, late)
                yield tried(lambda data=data: blocks_said(data, 1 << 20))
    for late_s in (366 * 86_400, 366 * 86_400 + 1):
        rows = [struct.pack("<IIII", at, 0, 2, 2) + b"\1a" for at in (5, 5 + late_s, 4)]
        for least in (1, 64):
            with patch("p2os.capture.formats.pcap.LEAST_RECORDS", least):
                yield tried(lambda rows=rows: blocks_said(write_pcap([]) + b"".join(rows), 1 << 20))


def blocks_said(data: bytes, size: int) -> list[object]:
    found = [*in_order(pcap_blocks([data[place : place + size] for place in range(0, len(data), size)]))]
    return [(one.at_ns.tolist(), one.senders, one.ends.tolist(), one.data, one.is_in_order) for one in found]


def pcapng(ticks: bytes, late: int, order: str = "<") -> bytes:
    """Return a pcapng file of an interface of USER0 with some packets, and a simple one."""
    head = block(PCAPNG_MAGIC, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)
    option = (
        struct.pack(order + "HH", 2, 3)
        + b"abc\0"
        + struct.pack(order + "HH", 9, len(ticks))
        + ticks.ljust(4, b"\0")
        + bytes(4)
    )
    rows = [
        block(6, struct.pack(order + "IIIII", 0, 5 + late * (at > 2), at, 2, 9) + b"\1" + bytes([at]), order)
        for at in range(5)
    ]
    simple = block(3, struct.pack(order + "I", 2) + b"\0z", order)
    return (
        head + block(1, struct.pack(order + "HHI", 147, 0, 0) + option, order) + rows[0] + simple + b"".join(rows[1:])
    )


def records(draw: random.Random) -> Iterator[str]:
    """Cut capture files at each byte, and give each number of their headers another value."""
    pcap = write_pcap([Chunk(at_ns=7 * at, direction=(TO, FROM)[at % 2], data=b"ab"[: at % 3]) for at in range(5)])
    for data in (pcap, pcapng(b"\x09", 0), pcapng(b"\x06", 0, ">")):
        for end in range(len(data) + 1):
            yield tried(lambda data=data, end=end: read_capture(data[:end]).duration_ns)
        for place in range(0, len(data) - 4, 4):
            for number in (0, 1, 3, 6, 11, 12, 15, 16, 31, 32, 1 << 24, 0xFFFFFFFF):
                hurt = data[:place] + number.to_bytes(4, "little") + data[place + 4 :]
                yield tried(lambda hurt=hurt: [(one.at_ns, one.data) for one in read_capture(hurt).chunks])
    with patch.object(pcap_records, "LARGEST_RECORD", 40):
        for size in (39, 40, 41):
            yield tried(
                lambda size=size: read_capture(pcap[:24] + struct.pack("<IIII", 0, 0, size, size) + b"\1").duration_ns
            )
            yield tried(
                lambda size=size: (
                    read_capture(
                        block(PCAPNG_MAGIC, HEADER, "<") + struct.pack("<III", 9, size, 0) + bytes(9)
                    ).duration_ns
                )
            )
    for magic in (MAGIC_US, MAGIC_NS, PCAPNG_MAGIC, 0):
        for order in ("big", "little"):
            data = magic.to_bytes(4, order)  # type: ignore[arg-type]
            yield said([is_pcap(data), is_pcap(data[:3]), is_pcap(data[:2] + b"\1" + data[3:])])
    for link in (0, 1, 2, 101, 113, 147, 276):
        yield tried(
            lambda link=link: (
                read_capture(network_file([segment(8101, 5, 1, b"ab")], link, LINKS.get(link, b""))).chunks
            )
        )


def segments(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of rows
    """Take IP packets of each kind, and each of their header's bytes otherwise."""
    for link, before in LINKS.items():
        for v6 in (False, True):
            packet = before + segment(8101, 40000, 9, b"data", v6=v6)
            if v6 and link in {1, 113, 276}:
                place = {1: 12, 113: 14, 276: 0}[link]
                packet = packet[:place] + b"\x86\xdd" + packet[place + 2 :]
            for size in {
                0,
                len(before),
                len(before) + 1,
                len(packet) - 5,
                len(packet) - 4,
                len(packet) - 1,
                len(packet),
            }:
                yield said(TcpStreams().take(link, packet[:size]))
            for place in (*range(len(before), min(len(before) + 36, len(packet))), len(packet) - 12, len(packet) - 11):
                for value in (0, 1, 0x10, 0x40, 0x45, 0x46, 0x50, 0x60, 255):
                    yield said(TcpStreams().take(link, packet[:place] + bytes([value]) + packet[place + 1 :]))
    for _ in range(30):
        streams, at = TcpStreams(), {}
        for _ in range(12):
            way = draw.choice(((40000, 8101), (8101, 40000), (7, 9), (9, 7), (5, 6)))
            begin = at.setdefault(way, draw.choice((0, 0xFFFFFFFA)))
            shift = draw.choice((0, 0, 0, 1, 3, -1, -3, 5))
            size = draw.choice((0, 1, 2, 4))
            flags = draw.choice((0x10, 0x10, 0x10, 2, 0x12))
            yield said((way, streams.take(101, segment(*way, begin + shift, b"abcdefgh"[:size], flags))))
            at[way] = begin + size + (flags & 2 > 0)
    for v6, addresses in ((False, range(12, 20)), (True, range(8, 40))):
        first, later = (segment(8101, 40000, sequence, b"abc", v6=v6) for sequence in (9, 99))
        for place in addresses:  # another host, whose conversation begins anew
            streams = TcpStreams()
            other = later[:place] + bytes([later[place] ^ 1]) + later[place + 1 :]
            yield said([place, streams.take(101, first), streams.take(101, other), streams.take(101, later)])
    with patch("p2os.capture.formats.tcp_streams.MOST_WAITING", 3):
        for count in (3, 4, 5):
            streams = TcpStreams()
            for number in (0, *range(2, 2 + count)):
                yield said(streams.take(101, segment(8101, 5, 3 * number, b"abc")))
    yield said(TcpStreams().take(9, b"") or "none")


def lines(draw: random.Random) -> Iterator[str]:
    """Read lines of recordings many at a time and one by one, whole, hurt, and of other recorders."""
    for number in range(30):
        parts = [
            (
                draw.choice((0, 7, 99, 10**8, 10**14, 10**15 - 1, 10**15)),
                draw.choice((TO, FROM)),
                draw.randbytes(draw.randint(1, 4)),
            )
            for _ in range(draw.randint(1, 5))
        ]
        text = (
            write_recording(capture_of(sorted(parts, key=lambda part: part[0]) if number % 2 else parts, note="n"))
            .split("\n", 1)[1]
            .encode()
        )
        place = draw.randrange(len(text))
        for data in (
            text,
            text.replace(b"\n", b"\r\n"),
            text[:-1],
            text[:place] + draw.choice((b"", b"g", b"9", b'"', b"\n")) + text[place + 1 :],
        ):
            found = plain_lines(data)
            yield said(
                found and (found.at_ns.tolist(), found.senders, found.ends.tolist(), found.data, found.is_in_order)
            )
    for line in (
        '{"t": 1, "dir": "c2s", "hex": "fa"}', '{"t": 0.5, "dir": "s2c", "hex": "fa fb"}', '{"t": 1, "dir": "event"}', '{"t": -1, "dir": "c2r", "hex": ""}',
        '{"t": 1000000, "dir": "s2c", "hex": "fa"}', '{"t": 1000001, "dir": "s2c", "hex": "fa"}', '{"t": true, "dir": "r2c", "hex": "fa"}', '{"t": 1, "dir": "r2c", "hex": "f"}',
        '{"t": "1", "dir": "r2c"}', '{"dir": "r2c"}', '{"t": 1, "dir": 5}', '{"t": 1, "dir": "x"}', "[]", "{", "", "  ", '{"format": "x"}', '{"format": "p2os-recording"}',
        '{"format": "p2os-recording", "version": 1, "note": "a"}', '{"format": "p2os-recording", "version": 2}', '{"note": "b"}', "[" * 9999,
    ):  # fmt: skip
        yield tried(lambda line=line: [*recorded_parts([line, "", '{"t": 3, "dir": "c2r", "hex": "ab"}'], 5)])
        yield said(note_of(line))
    for times in ((3, 1, 2), (0, 0), (5, 6)):
        blocks = [block_of([(at, TO, b"a")]) for at in times] + [
            block_of([]),
            block_of([(2, None, b"b"), (1, FROM, b""), (1, FROM, b"c")]),
        ]
        yield said(
            [
                (one.at_ns.tolist(), one.senders, len(one), [one.chunk(n) for n in range(len(one))])
                for one in in_order(blocks)
            ]
        )
        yield said([*chunks_of(blocks_of([(at, TO, b"a") for at in times]))])
    yield tried(Chunk, at_ns=-1, direction=None, data=b"")
    whole = capture_of([(1, TO, b"a"), (0, FROM, b"b"), (2, TO, b"c")])
    yield said(
        [whole.bytes_of(way) for way in (TO, FROM, None)]
        + [Capture().duration_ns, whole.duration_ns, TO.opposite, FROM.opposite, TO.arrow, FROM.arrow]
    )


def texts(draw: random.Random) -> Iterator[str]:
    """Read hex as people and programs write it, and what is none."""
    dump = "00000000  fa fb 03 00 00 00                                 |......|\n00000006\n"
    every = (
        "fafb03000000", "FA FB 03", "0xFA, 0xFB", "\\xfa\\xfb", "> fa\n< fb\n fc # fd", "00000000: fafb 0300  ..text", dump, dump[:-9], "fa f", "fa g0", "", "\n",
        "# only", "[fa;fb](03):", "00000000  fa fb |..|\n0000000", "0000: fa  x", "000: fa", "\u00e4", "fa\x00fb", "\f fa", "0000000000000000  fa",
    )  # fmt: skip
    for text in every:
        yield said((looks_like_hex(text), is_hexdump(text)))
        yield tried(lambda text=text: [*hex_parts(text.splitlines(), is_dump=is_hexdump(text))])
        for data in (text.encode(), b"\xef\xbb\xbf" + text.encode(), text.encode("utf-16"), text.encode() + b"\xff"):
            yield tried(lambda data=data: [(one.direction, one.data) for one in read_capture(data, FROM).chunks])
    with tempfile.TemporaryDirectory() as made:
        path = Path(made)
        for name, data in (
            ("a.hex", b"fa fb"),
            ("b.jsonl", b'{"t": 1, "dir": "r2c", "hex": "fafb"}\n' * 3),
            ("c", b"\xfa\xfb" * 9),
            ("wire.jsonl", b"{\n"),
        ):
            (path / name).write_bytes(data)
        for words in (
            ["fa", "fb"],
            ["fafb"],
            [""],
            ["x"],
            ["x", "y"],
            [],
            *([f"{path / name}"] for name in ("a.hex", "b.jsonl", "c", "", "d")),
        ):
            yield tried(
                lambda words=words: [(one.at_ns, one.direction, one.data) for one in open_argument(words).chunks]
            ).replace(made, "…")
        for most in (5, 6, 17, 18):
            with patch.object(sources, "LARGEST_BYTES", most):
                yield tried(lambda: len(read_file(path / "b.jsonl").chunks)).replace(made, "…")
                yield tried(lambda: len(read_file(path / "c").chunks)).replace(made, "…")
        for longest in (37, 38, 39, 120):
            for size in (10, 1 << 16):
                with (
                    patch.object(sources, "LONGEST_LINE", longest),
                    patch.object(sources, "BLOCK_BYTES", size),
                    patch.object(sources, "LARGE_BLOCK_BYTES", size),
                ):
                    yield tried(lambda: len(read_file(path / "b.jsonl").chunks)).replace(made, "…")
    two = b'{"t": 1, "dir": "r2c", "hex": "fafb"}\n' * 4000
    for bad in (b"\xff\n", b"{}\n", b'{"t": 1}\r\n', b""):
        yield tried(lambda bad=bad: len(read_capture(two + bad).chunks))
    yield said([sources.LONGEST_LINE, sources.LARGEST_BYTES])


def readings(draw: random.Random) -> Iterator[str]:
    """Follow what a robot says of itself and of its firmware."""
    payloads = [b"\2a\0Pioneer\0p3dx\0", b"\2a\0Pioneer\0nothing\0", b"\2", b"\2\0\0\0", StandardSip().to_frame(Profile.P2OS).payload, StandardSip(tail=(1,)).to_frame(Profile.ARCOS).payload,
                StandardSip().to_frame(Profile.P2OS).payload[:24], b"\x90\0", bytes([0x90] * 40)]  # fmt: skip
    for robot in ("", "p2at"):
        for profile in (None, Profile.AROS):
            for _ in range(9):
                one = FollowedReading(robot, profile)
                for _ in range(5):
                    one.take(draw.choice(payloads))
                    yield said((one.is_settled, one.reading.profile, one.reading.parameters.subclass))
    yield tried(FollowedReading, "nothing")


def taps(draw: random.Random) -> Iterator[str]:
    """Listen between a client and a robot."""
    for _ in range(30):
        tap, now = Tap(), 0
        for _ in range(10):
            frame = (
                Command(draw.choice((0, 1, 2, 2, 3, 11, 50, 51)), draw.choice((None, 0, 2, 4, 5, -1)))
                .to_frame()
                .to_bytes()
            )
            way = draw.choice((TO, TO, FROM))
            seen = tap.observe(
                way,
                frame if way is TO else draw.choice((frame, packet_frame(StandardSip(), Profile.P2OS).to_bytes())),
                now,
            )
            now += draw.choice((0, 100, 2500)) * NS_PER_MS
            yield said((seen, tap.new_baud, tap.closing_frames().hex()))
    yield from script().splitlines()
    yield said(plugin_folder(Path("h")))


def plays(draw: random.Random) -> Iterator[str]:
    """Play a session again to a far side that answers soon, late, or not."""
    said_there = [
        (TO, Command(0)),
        (FROM, Command(0)),
        (TO, Command(1)),
        (FROM, Command(1)),
        (TO, Command(2)),
        (FROM, None),
        (TO, Command(1)),
        (FROM, Command(11)),
        (TO, Command(11, 100)),
        (FROM, Command(12)),
        (TO, Command(2)),
    ]
    parts = [
        (100 * NS_PER_MS * place, way, (Frame(b"\2a\0b\0c\0") if one is None else one.to_frame()).to_bytes())
        for place, (way, one) in enumerate(said_there)
    ]
    for number in range(16):
        role = (TO, FROM)[number % 2]
        replay, now = (
            Replay(
                capture_of(parts + [(3 * NS_PER_S + at, way, data) for at, way, data in parts]),
                role,
                speed=draw.choice((0.5, 1.0, 2.0)),
            ),
            11,
        )
        replay.start(now)
        others = [data for _, way, data in parts if way is not role] * 2
        for _ in range(30):
            due = replay.next_deadline()
            now = (
                max(now, due + draw.choice((-1, 0, 1))) if due is not None else now + draw.choice((1, 400)) * NS_PER_MS
            )
            replay.advance_to(now)
            if others and (due is None or draw.random() < 0.4):
                replay.receive(others.pop(0), now)
            yield said(
                (
                    now,
                    due,
                    [data.hex() for data in replay.take_output()],
                    replay.frames_left,
                    replay.awaited,
                    replay.waited(now),
                    replay.is_closed,
                )
            )
    empty = Replay(Capture(), TO)
    empty.start(4)
    yield said((empty.next_deadline(), empty.frames_left, empty.awaited))


def gathered(draw: random.Random) -> Iterator[str]:
    """Copy pieces together, and convert cells of each width."""
    data = bytes(range(60))
    for count in (0, 1, 7, 8, 9, 40):
        for few in (True, False):
            sizes = np.array([draw.choice((2, 3) if few else range(9)) for _ in range(count)], np.int64)
            starts = np.array([draw.randrange(50) for _ in range(count)], np.int64)
            yield said(
                (joined(data, starts, sizes).hex(), offsets_of(sizes).tolist(), indexes_of(starts, sizes).tolist())
            )
            items, offsets = gather_items(
                np.frombuffer(data, np.uint8), starts, sizes % 3, np.dtype([("a", "<u2"), ("b", "u1")])
            )
            yield said((items.tolist(), offsets.tolist()))
            for sound in (None, sizes > 2, sizes > -1):
                yield said(
                    [
                        gather(
                            np.frombuffer(data[:size], np.uint8), starts % 5, np.dtype([("a", "<u4")]), sound
                        ).tolist()
                        for size in (3, 60)
                    ]
                )
    for dtype in ("u1", "i1", "<u2", "<i2"):
        for convert, kind in (
            (lambda raw: raw / 10, float),
            (lambda raw: f"w{raw}", str),
            (lambda raw: raw > 0, bool),
            (int, int),
        ):
            asked: list[int] = []
            one = ArrayConversion(lambda raw, asked=asked, convert=convert: (asked.append(raw), convert(raw))[1], kind)  # type: ignore[func-returns-value]
            raw = np.array([draw.choice((0, 1, 127, -1 if "i" in dtype else 200)) for _ in range(6)], dtype)
            for present in (None, np.array([True, False] * 3)):
                column = one.column(raw, present)
                yield said(
                    (
                        column.tolist(),
                        column.kind,
                        [*column.texts()],
                        column.has_any(),
                        asked,
                        len(column),
                        column[1],
                        [*column[2:5]],
                    )
                )
                yield said(column.encoded() if kind is str else column.values.tolist())
                yield said(
                    [
                        [*Column.joined(column, [None, None])],
                        [*Column.joined([None], column)],
                        [*Column.joined(column, column)],
                    ]
                )
    for cells in ([], [None], ["a", None, "bä"], [1, None, 3], [1.5, 2.0], [True, None], ["a", 1, None]):
        for kind in "Oifb":
            if kind == "O" or all(
                isinstance(cell, {"i": int, "f": float, "b": bool}[kind]) for cell in cells if cell is not None
            ):
                column = Column.of(cells, kind)
                yield said(
                    (
                        column.tolist(),
                        column.kind,
                        column.has_any(),
                        column.texts() and [*column.texts()] if isinstance(column.texts(), list) else column.texts(),
                    )
                )
                yield said(
                    [part if isinstance(part, bytes) else part.tolist() for part in column.encoded()]
                    if kind == "O"
                    else ""
                )


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (
        columns,
        sip_columns,
        passed,
        network,
        records,
        segments,
        lines,
        texts,
        readings,
        taps,
        plays,
        gathered,
    )
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
