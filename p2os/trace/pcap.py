"""Capture files of Wireshark and tcpdump: pcap (read, write) and pcapng (read).

What we write has the link type USER0, one record a chunk: one byte of direction
(0 to the robot, 1 from it), then the bytes. The dissector p2os.lua takes it.
What we read may also be TCP over Ethernet, loopback or the `any` device, so
that a conversation recorded by tcpdump can be decoded.

Source: the pcap and pcapng descriptions of the IETF opsawg drafts; link types
of tcpdump.org.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from p2os.errors import FileError
from p2os.timing import NS_PER_S, NS_PER_US, Nanos
from p2os.trace.capture import Capture, CaptureBuilder, Chunk, Direction
from p2os.trace.tcp_streams import TcpStreams

LINKTYPE_USER0 = 147
MAGIC_US, MAGIC_NS = 0xA1B2C3D4, 0xA1B23C4D
PCAPNG_MAGIC = 0x0A0D0D0A
_BYTE_ORDER_MAGIC = 0x1A2B3C4D
SNAP_BYTES = 65_535
_FILE_HEADER = "IHHiIII"
_RECORD_HEADER = "IIII"
_IN_DIRECTION = {0: Direction.TO_ROBOT, 1: Direction.FROM_ROBOT}
_OF_DIRECTION = {direction: code for code, direction in _IN_DIRECTION.items()}
#: pcapng block types.
_INTERFACE, _SIMPLE, _ENHANCED = 1, 3, 6
#: pcapng option of an interface: the unit of its time stamps.
_IF_TSRESOL = 9


@dataclass(frozen=True, slots=True)
class _Record:
    at_ns: Nanos
    link: int
    data: bytes


def is_pcap(data: bytes) -> bool:
    """Tell whether bytes begin like a pcap or pcapng file."""
    numbers = {int.from_bytes(data[:4], "big"), int.from_bytes(data[:4], "little")}
    return len(data) >= 4 and bool(numbers & {MAGIC_US, MAGIC_NS, PCAPNG_MAGIC})


def file_header() -> bytes:
    """Return the first bytes of a pcap file of ours: nanoseconds, link type USER0."""
    return struct.pack("<" + _FILE_HEADER, MAGIC_NS, 2, 4, 0, 0, SNAP_BYTES, LINKTYPE_USER0)


def record(chunk: Chunk, base_ns: Nanos = 0) -> bytes:
    """Return a chunk as a record.

    Args:
        chunk: What was said; without direction it counts as the robot's.
        base_ns: The capture's start, in nanoseconds since 1970.
    """
    seconds, nanoseconds = divmod(base_ns + chunk.at_ns, NS_PER_S)
    data = bytes((_OF_DIRECTION[chunk.direction or Direction.FROM_ROBOT],)) + chunk.data[: SNAP_BYTES - 1]
    return struct.pack("<" + _RECORD_HEADER, seconds, nanoseconds, len(data), len(chunk.data) + 1) + data


def write_pcap(chunks: Iterable[Chunk], base_ns: Nanos = 0) -> bytes:
    """Return a pcap file; one record a chunk, so hand in one chunk a frame (`frame_chunks`)."""
    return file_header() + b"".join(record(chunk, base_ns) for chunk in chunks)


def read_pcap(data: bytes) -> Capture:
    """Read a pcap or pcapng file; times count from its first record.

    Raises:
        FileError: The file is cut or of a kind that is not read here.
    """
    records = _pcapng_records(data) if data[:4] == PCAPNG_MAGIC.to_bytes(4, "big") else _pcap_records(data)
    builder, streams, start = CaptureBuilder(), TcpStreams(), None
    try:
        for item in records:
            start = item.at_ns if start is None else start
            at_ns = max(0, item.at_ns - start)
            if item.link == LINKTYPE_USER0:
                if item.data[:1] not in (b"\0", b"\1"):
                    raise FileError("a record of link type USER0 that is not ours: its first byte tells no direction")
                builder.add(at_ns, _IN_DIRECTION[item.data[0]], item.data[1:])
            else:
                for direction, said in streams.take(item.link, item.data):
                    builder.add(at_ns, direction, said)
    except struct.error as error:
        raise FileError("the capture file is cut off in the middle of a record") from error
    if not builder.chunks and streams.unread_links:
        kinds = ", ".join(str(link) for link in sorted(streams.unread_links))
        raise FileError(
            f"no P2OS in the capture file: link type {kinds} is not read here",
            hint="capture TCP on Ethernet or loopback, or use p2os sniff --pcap",
        )
    return builder.build()


def _pcap_records(data: bytes) -> Iterator[_Record]:
    order = "<" if int.from_bytes(data[:4], "little") in {MAGIC_US, MAGIC_NS} else ">"
    try:
        magic, _, _, _, _, _, link = struct.unpack_from(order + _FILE_HEADER, data)
    except struct.error as error:
        raise FileError("the capture file ends in its header") from error
    unit_ns, place = (1 if magic == MAGIC_NS else NS_PER_US), 24
    while place < len(data):
        seconds, fraction, size, _ = struct.unpack_from(order + _RECORD_HEADER, data, place)
        place += 16
        if place + size > len(data):
            raise FileError(f"the capture file is cut off at byte {place}")
        yield _Record(seconds * NS_PER_S + fraction * unit_ns, link & 0xFFFF, data[place : place + size])
        place += size


def _pcapng_records(data: bytes) -> Iterator[_Record]:
    order, place = "<", 0
    interfaces: list[tuple[int, int]] = []
    while place < len(data):
        if data[place : place + 4] == PCAPNG_MAGIC.to_bytes(4, "big"):
            order = "<" if data[place + 8 : place + 12] == _BYTE_ORDER_MAGIC.to_bytes(4, "little") else ">"
            interfaces.clear()
        kind, size = struct.unpack_from(order + "II", data, place)
        if size < 12 or place + size > len(data):
            raise FileError(f"the capture file is cut off at byte {place}")
        body = data[place + 8 : place + size - 4]
        if kind == _INTERFACE:
            interfaces.append((struct.unpack_from(order + "H", body)[0], _ticks_per_s(body, order)))
        elif kind == _ENHANCED:
            number, high, low, length, _ = struct.unpack_from(order + "IIIII", body)
            link, ticks = _interface(interfaces, number)
            yield _Record((high << 32 | low) * NS_PER_S // ticks, link, body[20 : 20 + length])
        elif kind == _SIMPLE:
            yield _Record(0, _interface(interfaces, 0)[0], body[4 : 4 + struct.unpack_from(order + "I", body)[0]])
        place += size


def _interface(interfaces: list[tuple[int, int]], number: int) -> tuple[int, int]:
    if number >= len(interfaces):
        raise FileError(f"the capture file names interface {number}, which it never declared")
    return interfaces[number]


def _ticks_per_s(body: bytes, order: str) -> int:
    """Return the resolution of an interface's time stamps; microseconds unless an option says otherwise."""
    place = 8
    while place + 4 <= len(body):
        code, size = struct.unpack_from(order + "HH", body, place)
        if code == _IF_TSRESOL and size == 1:
            value = body[place + 4]
            return int((2 if value & 0x80 else 10) ** (value & 0x7F))
        if code == 0:
            break
        place += 4 + (size + 3) // 4 * 4
    return 1_000_000
