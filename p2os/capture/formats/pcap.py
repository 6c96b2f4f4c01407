"""Capture files of Wireshark and tcpdump: pcap (read, write) and pcapng (read), and the TCP streams in them.

What we write has the link type USER0, one record a chunk: one byte of direction
(0 to the robot, 1 from it), then the bytes. The dissector p2os.lua takes it.
What we read may also be TCP over Ethernet, loopback or the `any` device, so
that a conversation recorded by tcpdump can be decoded: segments are put in order,
repeated ones left out (`tcp_streams`).

Invariant: what `write_pcap` has made is read so that it has the same bytes in each direction.
"""

import contextlib
import struct
from collections.abc import Callable, Iterable, Iterator

from p2os.capture.chunks import Chunk, ChunkBlock, Direction, blocks_of
from p2os.capture.formats.conversations import IN_DIRECTION, LEAST_RECORDS, LINKTYPE_USER0, Conversations
from p2os.capture.formats.pcap_records import (
    FILE_HEADER,
    MAGIC_NS,
    MAGIC_US,
    PCAPNG_MAGIC,
    RECORD_HEADER,
    Records,
    read_records,
)
from simbase.errors import FileError
from simbase.timing import NS_PER_S, Nanos

SNAP_BYTES = 65_535
_OF_DIRECTION = {direction: code for code, direction in IN_DIRECTION.items()}


def is_pcap(data: bytes) -> bool:
    """Tell whether bytes begin like a pcap or pcapng file."""
    numbers = {int.from_bytes(data[:4], "big"), int.from_bytes(data[:4], "little")}
    return len(data) >= 4 and bool(numbers & {MAGIC_US, MAGIC_NS, PCAPNG_MAGIC})


def file_header() -> bytes:
    """Return the first bytes of a pcap file of ours: nanoseconds, link type USER0."""
    return struct.pack("<" + FILE_HEADER, MAGIC_NS, 2, 4, 0, 0, SNAP_BYTES, LINKTYPE_USER0)


def record(chunk: Chunk, base_ns: Nanos = 0) -> bytes:
    """Return a chunk as a record.

    Args:
        chunk: What was sent; without direction it counts as the robot's.
        base_ns: The capture's start, in nanoseconds since 1970.
    """
    seconds, nanoseconds = divmod(base_ns + chunk.at_ns, NS_PER_S)
    data = bytes((_OF_DIRECTION[chunk.direction or Direction.FROM_ROBOT],)) + chunk.data[: SNAP_BYTES - 1]
    return struct.pack("<" + RECORD_HEADER, seconds, nanoseconds, len(data), len(chunk.data) + 1) + data


def write_pcap(chunks: Iterable[Chunk], base_ns: Nanos = 0) -> bytes:
    """Return a pcap file; one record a chunk, so hand in one chunk a frame (`frame_chunks`)."""
    return file_header() + b"".join(record(chunk, base_ns) for chunk in chunks)


def pcap_blocks(blocks: Iterable[bytes]) -> Iterator[ChunkBlock]:
    """Yield what a pcap or pcapng file holds; times count from its first record.

    Args:
        blocks: The file's bytes, cut anywhere.

    Raises:
        FileError: The file is cut or of a kind that is not read here.
    """
    said = Conversations()
    for records in read_records(blocks):
        yield from _bulk(len(records.starts))(records, said)
    if said.is_empty and said.streams.unread_links:
        kinds = ", ".join(str(link) for link in sorted(said.streams.unread_links))
        raise FileError(
            f"no P2OS in the capture file: link type {kinds} is not read here",
            hint="capture TCP on Ethernet or loopback, or use p2os sniff --pcap",
        )


def _bulk(count: int) -> Callable[[Records, Conversations], Iterator[ChunkBlock]]:
    """Return how so many records are read."""
    if count >= LEAST_RECORDS:
        with contextlib.suppress(ImportError):
            from p2os.capture.formats.pcap_bulk import in_bulk

            return in_bulk
    return lambda records, said: blocks_of(said.parts(records))
