"""P2OS frames on the wire: header, count, payload, checksum; and the decoder that finds them in a stream.

What stands in a payload is read elsewhere (`p2os.protocol.commands`,
`p2os.protocol.packets`).

Theory of operation. Bytes wait in one buffer. At its head the decoder wants
`FA FB`, a count of 3 to 204, and that many bytes. Whatever does not fit costs
one byte: the head moves on by one and the same bytes are looked at again, so a
damaged frame hides nothing that follows it. A frame whose bytes stop coming for
`GIVE_UP_NS` is treated as damaged, so that a false header with a legal count
cannot hold up a quiet line. The price of re-scanning: a frame that stands inside
the payload of a damaged frame can be found. Inside a sound frame nothing is
looked for.

Source: Pioneer 3 manual, page 32; P2OS manual, page 36.

Invariants: a `Frame` that exists can be sent, and `from_bytes` and `to_bytes`
are inverses. The decoder's buffer never holds more than one frame (207 bytes)
between calls.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from zlib import adler32

from p2os.errors import LocalProtocolError
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos, Reached

HEADER = b"\xfa\xfb"
#: Header and count.
PREFIX_BYTES = 3
CHECKSUM_BYTES = 2
#: The count covers the payload and the checksum. Smallest: one command byte.
MIN_COUNT = 3
#: Largest count that an ARCOS robot accepts (Pioneer 3 manual, page 32).
MAX_COUNT = 204
MAX_PAYLOAD_BYTES = MAX_COUNT - CHECKSUM_BYTES
#: chosen: two and a half SIP cycles; the longest frame takes 216 ms at 9600 baud, but its bytes never pause so long.
GIVE_UP_NS: Nanos = 250 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame, without header, count and checksum.

    Args:
        payload: Command or type byte and arguments, 1 to 202 bytes.

    Raises:
        LocalProtocolError: The payload is empty or too long to be framed.
    """

    payload: bytes

    def __post_init__(self) -> None:
        if not 1 <= len(self.payload) <= MAX_PAYLOAD_BYTES:
            raise LocalProtocolError(
                f"a payload of {len(self.payload)} bytes cannot be framed (1 to {MAX_PAYLOAD_BYTES})",
                hint="split the data over several packets",
            )

    @property
    def kind(self) -> int:
        """The command number (client) or packet type (robot)."""
        return self.payload[0]

    @property
    def data(self) -> bytes:
        """What follows the command number or packet type."""
        return self.payload[1:]

    def to_bytes(self) -> bytes:
        """Return the frame as it goes over the wire."""
        count = len(self.payload) + CHECKSUM_BYTES
        return HEADER + bytes((count,)) + self.payload + checksum(self.payload).to_bytes(CHECKSUM_BYTES, "big")

    @classmethod
    def from_bytes(cls, data: bytes) -> "Frame":
        """Read exactly one frame.

        Raises:
            LocalProtocolError: `data` is not one whole and sound frame.
        """
        if data[:2] != HEADER or len(data) < PREFIX_BYTES + MIN_COUNT or len(data) != data[2] + PREFIX_BYTES:
            raise LocalProtocolError(f"not one whole frame: {data.hex(' ')}")
        payload, stated = data[PREFIX_BYTES:-CHECKSUM_BYTES], int.from_bytes(data[-CHECKSUM_BYTES:], "big")
        if stated != checksum(payload):
            raise LocalProtocolError(f"checksum: expected 0x{checksum(payload):04X}, got 0x{stated:04X}")
        return cls(payload)


def checksum(data: bytes) -> int:
    """Return the checksum of a frame's payload, 0 to 0xFFFF.

    A 16-bit sum of big-endian pairs; an odd last byte is XORed into the low byte.
    Source: Pioneer manuals, "Packet checksum".

    Args:
        data: At most 256 bytes.
    """
    pairs, odd = (data[:-1], data[-1]) if len(data) & 1 else (data, 0)
    # The lower half of an Adler-32 is 1 and the sum of the bytes, modulo 65521, which 256 bytes do not reach. Of a
    # pair's two bytes the first counts 256 times: once among all bytes, 255 times among those at even places.
    return (255 * adler32(pairs[::2]) + adler32(pairs) - 256) & 0xFFFF ^ odd


def sound_frames(data: bytes, place: int = 0, limit: int | None = None) -> Iterator[bytes]:
    """Yield the payload of each sound frame that stands from a place on; end where something else stands.

    Args:
        data: The bytes.
        place: Where the first is looked for.
        limit: One past the last byte that is looked at; None for all.
    """
    limit = len(data) if limit is None else limit
    while place + PREFIX_BYTES < limit and data[place : place + 2] == HEADER:
        count = data[place + 2]
        end = place + PREFIX_BYTES + count
        if not MIN_COUNT <= count <= MAX_COUNT or end > limit:
            return
        payload = data[place + PREFIX_BYTES : end - CHECKSUM_BYTES]
        if data[end - 2] << 8 | data[end - 1] != checksum(payload):
            return
        yield payload
        place = end


@dataclass(frozen=True, slots=True)
class Noise:
    """Bytes outside any frame, in one run."""

    data: bytes


@dataclass(frozen=True, slots=True)
class BadChecksum:
    """A frame's length of bytes whose checksum is wrong; they are scanned again after its first byte."""

    data: bytes
    expected: int
    got: int


@dataclass(frozen=True, slots=True)
class BadCount:
    """A header with a count that no frame has."""

    count: int


@dataclass(frozen=True, slots=True)
class Stalled:
    """The start of a frame whose rest did not come in time; scanned again after its first byte."""

    data: bytes


Item = Frame | Noise | BadChecksum | BadCount | Stalled


@dataclass(slots=True)
class DecoderStats:
    """What has passed the decoder so far; counts of items, and of bytes where the name says so."""

    frames: int = 0
    noise_bytes: int = 0
    bad_checksums: int = 0
    bad_counts: int = 0
    stalled: int = 0
    #: Frames found among the bytes of a rejected one.
    rescued: int = 0


class Decoder(Stateful):
    """Turn a stream of bytes into frames, whatever the stream holds."""

    STATE = ("_buffer", "_noise", "_items", "_last_byte_ns", "_rescanned", "stats")

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._noise = bytearray()
        self._items: deque[Item] = deque()
        self._last_byte_ns: Nanos = 0
        #: Bytes at the head of the buffer that belong to a frame already rejected.
        self._rescanned = 0
        self.stats = DecoderStats()

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that arrived at `now` nanoseconds, any number of them."""
        self.advance_to(now)
        if data:
            self._last_byte_ns = now
            self._buffer += data
            self._scan()

    def take_back(self) -> bytes | None:
        """Return the beginning of a frame that waits for its rest, and hold it no longer.

        None where something else waits: items, or bytes of a rejected frame that are scanned again.
        """
        if self._items or self._rescanned:
            return None
        waiting = bytes(self._buffer)
        self._buffer.clear()
        return waiting

    def next_item(self) -> Item | None:
        """Return what was found next, in the order of the stream, or None."""
        return self._items.popleft() if self._items else None

    def next_deadline(self) -> Nanos | None:
        """Return when the frame that has begun will be given up."""
        return self._last_byte_ns + GIVE_UP_NS if self._buffer else None

    def advance_to(self, limit: Nanos) -> Reached:
        """Give up a frame whose bytes stopped, and scan its bytes again."""
        if self._buffer and limit >= self._last_byte_ns + GIVE_UP_NS:
            while self._buffer:
                self.stats.stalled += 1
                self._items.append(Stalled(bytes(self._buffer)))
                self._reject(len(self._buffer))
                self._scan()
        return Reached(limit)

    def _scan(self) -> None:
        """Find everything that the buffer holds."""
        buffer = self._buffer
        while buffer:
            if not buffer.startswith(HEADER) and (start := self._header()):
                self._drop_noise(start)
                continue
            if len(buffer) < PREFIX_BYTES:
                break
            count = buffer[2]
            if not MIN_COUNT <= count <= MAX_COUNT:
                self._flush_noise()
                self.stats.bad_counts += 1
                self._items.append(BadCount(count))
                self._reject(PREFIX_BYTES)
                continue
            size = count + PREFIX_BYTES
            if len(buffer) < size:
                break
            self._check(bytes(buffer[:size]))
        self._flush_noise()

    def _header(self) -> int:
        """Return how many bytes stand before the first header, or before what may become one."""
        start = self._buffer.find(HEADER)
        if start >= 0:
            return start
        return len(self._buffer) - (1 if self._buffer[-1] == HEADER[0] else 0)

    def _check(self, data: bytes) -> None:
        """Check a whole frame's bytes by their checksum: take the frame, or reject them."""
        payload = data[PREFIX_BYTES:-CHECKSUM_BYTES]
        got, expected = int.from_bytes(data[-CHECKSUM_BYTES:], "big"), checksum(payload)
        if self._noise:
            self._flush_noise()
        if got == expected:
            self.stats.frames += 1
            self._items.append(Frame(payload))
            if self._rescanned:
                self.stats.rescued += 1
                self._consume(len(data))
            else:
                del self._buffer[: len(data)]
            return
        self.stats.bad_checksums += 1
        self._items.append(BadChecksum(data, expected, got))
        self._reject(len(data))

    def _reject(self, size: int) -> None:
        """Drop the first byte of a rejected frame of `size` bytes; the rest is scanned again."""
        self._rescanned = max(self._rescanned, size)
        self._drop_noise(1)

    def _drop_noise(self, size: int) -> None:
        self.stats.noise_bytes += size
        self._noise += self._buffer[:size]
        self._consume(size)

    def _consume(self, size: int) -> None:
        del self._buffer[:size]
        self._rescanned = max(0, self._rescanned - size)

    def _flush_noise(self) -> None:
        if self._noise:
            self._items.append(Noise(bytes(self._noise)))
            self._noise.clear()
