"""Capture files of Wireshark and tcpdump: pcap (read, write) and pcapng (read), and the TCP streams in them.

What we write has the link type USER0, one record a chunk: one byte of direction
(0 to the robot, 1 from it), then the bytes. The dissector p2os.lua takes it.
What we read may also be TCP over Ethernet, loopback or the `any` device, so
that a conversation recorded by tcpdump can be decoded: segments are put in order,
repeated ones left out (`TcpStreams`). Fragments of IP are not put together; P2OS
frames are far too short to be fragmented. The robot's side of a conversation is the
one that was connected to: the receiver of the SYN, else port 8101, else the lower port.

Source: the pcap and pcapng descriptions of the IETF opsawg drafts; link types
of tcpdump.org.

Invariant: `read_pcap(write_pcap(chunks))` has the same bytes in each direction.
"""

import io
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from p2os.capture.chunks import Capture, Chunk, Direction, Part, capture_of
from simbase.errors import FileError
from simbase.timing import NS_PER_S, NS_PER_US, Nanos

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
#: The port on which simulated Pioneers listen.
ROBOT_PORT = 8101
_TCP = 6
_SYN, _ACK = 0x02, 0x10
_IPV4, _IPV6 = 0x0800, 0x86DD
#: Link type → (bytes before the IP packet, offset of the Ethernet type or None where IP follows at once).
_LINKS: dict[int, tuple[int, int | None]] = {
    0: (4, None),  # NULL: BSD loopback
    1: (14, 12),  # EN10MB
    101: (0, None),  # RAW
    113: (16, 14),  # LINUX_SLL
    276: (20, 0),  # LINUX_SLL2
}
#: chosen: a year; a longer time is a damaged one.
LONGEST_NS: Nanos = 366 * 86_400 * NS_PER_S
#: chosen: more segments than this out of order, and the missing one was never captured.
MOST_WAITING = 64
#: chosen: far more than any capture program's snap length; a longer record is a damaged one.
LARGEST_RECORD = 16 << 20

_End = tuple[bytes, int]


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
        chunk: What was sent; without direction it counts as the robot's.
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
    return capture_of(pcap_parts(io.BytesIO(data)))


def pcap_parts(file: BinaryIO) -> Iterator[Part]:
    """Yield what a pcap or pcapng file holds, one record read at a time; times count from its first.

    Raises:
        FileError: The file is cut or of a kind that is not read here.
    """
    magic = file.read(4)
    records = _pcapng_records(file, magic) if magic == PCAPNG_MAGIC.to_bytes(4, "big") else _pcap_records(file, magic)
    streams, start, is_empty = TcpStreams(), None, True
    try:
        for item in records:
            start = item.at_ns if start is None else start
            at_ns = max(0, item.at_ns - start)
            if at_ns > LONGEST_NS:
                raise FileError(f"a record {at_ns / NS_PER_S:.3g} s after the first: its time is damaged")
            if item.link == LINKTYPE_USER0:
                if item.data[:1] not in (b"\0", b"\1"):
                    raise FileError("a record of link type USER0 that is not ours: its first byte gives no direction")
                is_empty = False
                yield at_ns, _IN_DIRECTION[item.data[0]], item.data[1:]
            else:
                for direction, sent in streams.take(item.link, item.data):
                    is_empty = False
                    yield at_ns, direction, sent
    except struct.error as error:
        raise FileError("the capture file is cut off in the middle of a record") from error
    if is_empty and streams.unread_links:
        kinds = ", ".join(str(link) for link in sorted(streams.unread_links))
        raise FileError(
            f"no P2OS in the capture file: link type {kinds} is not read here",
            hint="capture TCP on Ethernet or loopback, or use p2os sniff --pcap",
        )


def _pcap_records(file: BinaryIO, first: bytes) -> Iterator[_Record]:
    order = "<" if int.from_bytes(first, "little") in {MAGIC_US, MAGIC_NS} else ">"
    try:
        magic, _, _, _, _, _, link = struct.unpack(order + _FILE_HEADER, first + file.read(20))
    except struct.error as error:
        raise FileError("the capture file ends in its header") from error
    unit_ns, place, link = (1 if magic == MAGIC_NS else NS_PER_US), 24, link & 0xFFFF
    header = struct.Struct(order + _RECORD_HEADER)
    while head := file.read(16):
        seconds, fraction, size, _ = header.unpack(head)
        place += 16
        yield _Record(seconds * NS_PER_S + fraction * unit_ns, link, _taken(file, size, place))
        place += size


def _taken(file: BinaryIO, size: int, place: int) -> bytes:
    """Return the next bytes of a file, all of them."""
    data = file.read(size) if size <= LARGEST_RECORD else b""
    if len(data) < size:
        raise FileError(f"the capture file is cut off at byte {place}")
    return data


def _pcapng_records(file: BinaryIO, first: bytes) -> Iterator[_Record]:
    order, place = "<", 0
    interfaces: list[tuple[int, int]] = []
    while head := first + file.read(8 - len(first)):
        first = b""
        if head[:4] == PCAPNG_MAGIC.to_bytes(4, "big"):
            mark = file.read(4)
            order = "<" if mark == _BYTE_ORDER_MAGIC.to_bytes(4, "little") else ">"
            interfaces.clear()
        else:
            mark = b""
        kind, size = struct.unpack(order + "II", head)
        if size < 12:
            raise FileError(f"the capture file is cut off at byte {place}")
        body = (mark + _taken(file, size - 8 - len(mark), place))[:-4]
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


@dataclass(slots=True)
class _Half:
    """One direction of one conversation."""

    next_sequence: int | None = None
    waiting: dict[int, bytes] = field(default_factory=dict)

    def take(self, sequence: int, data: bytes, *, is_syn: bool) -> bytes:
        """Return the bytes that are now in order."""
        if is_syn or self.next_sequence is None:
            self.next_sequence = (sequence + is_syn) & 0xFFFFFFFF
            sequence = self.next_sequence
        if data:
            self.waiting[sequence] = data
        if len(self.waiting) > MOST_WAITING:
            self.next_sequence = min(self.waiting, key=self._ahead)
        ready = b""
        for start in sorted(self.waiting, key=self._ahead):
            ahead = self._ahead(start)
            if ahead > 0:
                break
            segment = self.waiting.pop(start)[-ahead:]  # what was sent again is left out
            ready += segment
            self.next_sequence = (self.next_sequence + len(segment)) & 0xFFFFFFFF
        return ready

    def _ahead(self, sequence: int) -> int:
        """Return how far a sequence number lies after the next one; negative before it."""
        distance = (sequence - (self.next_sequence or 0)) & 0xFFFFFFFF
        return distance - (1 << 32) if distance >= 1 << 31 else distance


class TcpStreams:
    """Follows every TCP conversation of a capture file."""

    def __init__(self) -> None:
        self._halves: dict[tuple[_End, _End], _Half] = {}
        self._robots: dict[frozenset[_End], _End] = {}
        #: Link types that are not read here.
        self.unread_links: set[int] = set()

    def take(self, link: int, packet: bytes) -> Iterator[tuple[Direction, bytes]]:
        """Take a captured packet; yield what it adds to a conversation."""
        if link not in _LINKS:
            self.unread_links.add(link)
            return
        found = _segment(link, packet)
        if found is None:
            return
        source, target, sequence, flags, data = found
        ends = frozenset((source, target))
        if flags & _SYN:
            self._robots[ends] = source if flags & _ACK else target
        elif ends not in self._robots:
            self._robots[ends] = min((source, target), key=lambda end: (end[1] != ROBOT_PORT, end[1]))
        half = self._halves.setdefault((source, target), _Half())
        ready = half.take(sequence, data, is_syn=bool(flags & _SYN))
        if ready:
            yield (Direction.FROM_ROBOT if self._robots[ends] == source else Direction.TO_ROBOT), ready


def _segment(link: int, packet: bytes) -> tuple[_End, _End, int, int, bytes] | None:
    """Return (source, target, sequence, flags, data) of a TCP segment, or None for anything else."""
    skip, type_at = _LINKS[link]
    if type_at is not None:
        kind = int.from_bytes(packet[type_at : type_at + 2], "big")
        if kind not in {_IPV4, _IPV6}:
            return None
    ip = packet[skip:]
    try:
        if ip[:1] and ip[0] >> 4 == 4:
            header, size, protocol = (ip[0] & 15) * 4, int.from_bytes(ip[2:4], "big"), ip[9]
            source, target, tcp = ip[12:16], ip[16:20], ip[header : size or None]
        elif ip[:1] and ip[0] >> 4 == 6:
            protocol, size = ip[6], int.from_bytes(ip[4:6], "big")
            source, target, tcp = ip[8:24], ip[24:40], ip[40 : 40 + size]
        else:
            return None
        if protocol != _TCP:
            return None
        source_port, target_port, sequence, _, offset, flags = struct.unpack_from(">HHIIBB", tcp)
    except (IndexError, struct.error):
        return None
    return (source, source_port), (target, target_port), sequence, flags, tcp[(offset >> 4) * 4 :]
