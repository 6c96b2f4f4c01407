"""A capture as rows: every frame read, every damaged byte told, in the order of time.

Three decoders run side by side: one a direction, and one for bytes whose
direction the source does not tell. Rows partition what was sent: each byte
stands in exactly one row, except that a rejected frame's row shows all of its
bytes, also those that turned out to hold another frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from p2os.parameters import RobotParameters
from p2os.profiles import Profile
from p2os.timing import NS_PER_S, Nanos
from p2os.trace.capture import Capture, Chunk, Direction
from p2os.trace.describe import Plain, describe_command, describe_packet
from p2os.trace.session import Session, guess_direction
from p2os.wire import BadChecksum, BadCount, Decoder, Frame, Item, Noise, Stalled

#: Longer than any decoder waits for the rest of a frame.
_LONG_AFTER_NS: Nanos = NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How a capture is to be read: the firmware's family, and whose units."""

    profile: Profile
    parameters: RobotParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One frame, or one run of bytes that is none.

    Args:
        at_ns: When its last byte had come, in nanoseconds since the start.
        direction: Who sent it; None where nobody can tell.
        data: Its bytes on the wire.
        kind: Command number or packet type; None for what is no frame.
        name: The manual's word, or what is wrong.
        fields: What stands inside, SI units, in the order of the wire.
        problem: One sentence about what is wrong; empty for a sound frame.
    """

    at_ns: Nanos
    direction: Direction | None
    data: bytes
    kind: int | None
    name: str
    fields: dict[str, Plain] = field(default_factory=dict)
    problem: str = ""

    @property
    def valid(self) -> bool:
        """Whether this is a sound frame."""
        return not self.problem

    def as_plain(self) -> dict[str, Plain]:
        """Return it as JSON wants it: `t` in seconds."""
        return {
            "t": self.at_ns / NS_PER_S,
            "dir": None if self.direction is None else self.direction.value,
            "type": self.kind,
            "name": self.name,
            "fields": self.fields,
            "valid": self.valid,
        }


class Lister:
    """Turns chunks into rows as they come.

    Args:
        reading: How to read what stands in the frames.
    """

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._session = Session()
        self._streams: dict[Direction | None, _Stream] = {}

    def take(self, chunk: Chunk) -> Iterator[Row]:
        """Take a chunk; yield the rows that it completes."""
        if chunk.direction not in self._streams:
            self._streams[chunk.direction] = _Stream(chunk.direction)
        yield from self.advance_to(chunk.at_ns)
        stream = self._streams[chunk.direction]
        stream.decoder.receive(chunk.data, chunk.at_ns)
        yield from self._drain(stream, chunk.at_ns)

    def advance_to(self, now: Nanos) -> Iterator[Row]:
        """Yield what has been given up by `now` nanoseconds: frames whose rest never came."""
        for stream in self._streams.values():
            stream.decoder.advance_to(now)
            yield from self._drain(stream, now)

    def finish(self, now: Nanos) -> Iterator[Row]:
        """Yield what was left when the capture ended."""
        for stream in self._streams.values():
            stream.decoder.advance_to(now + _LONG_AFTER_NS)
            yield from self._drain(stream, now)

    def _drain(self, stream: "_Stream", now: Nanos) -> Iterator[Row]:
        while (item := stream.decoder.next_item()) is not None:
            row = self._row(stream, item, now)
            if row is not None:
                yield row

    def _row(self, stream: "_Stream", item: Item, now: Nanos) -> Row | None:
        if isinstance(item, Frame):
            stream.consume(len(item.to_bytes()))
            return self._frame_row(stream.direction, item, now)
        if isinstance(item, Noise):
            shown = stream.consume_noise(item.data)
            if not shown:
                return None
            return _damage(stream, now, shown, "noise", f"{len(shown)} bytes outside any frame")
        if isinstance(item, BadChecksum):
            stream.reject(len(item.data))
            problem = f"checksum: 0x{item.expected:04X} expected, got 0x{item.got:04X}"
            return _damage(stream, now, item.data, "bad checksum", problem)
        if isinstance(item, BadCount):
            data = b"\xfa\xfb" + bytes((item.count,))
            stream.reject(len(data))
            return _damage(stream, now, data, "bad count", f"count {item.count}: frames have 3 to 204")
        stream.reject(len(item.data))
        return _damage(stream, now, item.data, "cut off", _cut_off(item))

    def _frame_row(self, direction: Direction | None, frame: Frame, now: Nanos) -> Row:
        if direction is None:
            direction = guess_direction(frame)
        sync_name = self._session.name_of(frame, direction, now)
        if direction is Direction.FROM_ROBOT:
            name, fields = describe_packet(frame, self._reading.profile, self._reading.parameters)
        else:
            name, fields = describe_command(frame)
        return Row(
            at_ns=now, direction=direction, data=frame.to_bytes(), kind=frame.kind, name=sync_name or name,
            fields=fields,
        )  # fmt: skip


def rows_of(capture: Capture, reading: Reading) -> Iterator[Row]:
    """Yield every row of a capture."""
    lister = Lister(reading)
    for chunk in capture.chunks:
        yield from lister.take(chunk)
    yield from lister.finish(capture.duration_ns)


class FrameCutter:
    """Cuts chunks at frames as they come: one chunk a frame, or a run of bytes that is none.

    Nothing is lost: all that comes out, joined by direction, is all that went in.
    """

    def __init__(self) -> None:
        self._decoders: dict[Direction | None, Decoder] = {}
        self._last: Nanos = 0

    def take(self, chunk: Chunk) -> Iterator[Chunk]:
        """Take a chunk; yield what it completes, with its time."""
        decoder = self._decoders.setdefault(chunk.direction, Decoder())
        self._last = chunk.at_ns
        decoder.receive(chunk.data, self._last)
        yield from self._cut(decoder, chunk.direction)

    def finish(self) -> Iterator[Chunk]:
        """Yield what was begun and never completed."""
        for direction, decoder in self._decoders.items():
            decoder.advance_to(self._last + _LONG_AFTER_NS)
            yield from self._cut(decoder, direction)

    def _cut(self, decoder: Decoder, direction: Direction | None) -> Iterator[Chunk]:
        while (item := decoder.next_item()) is not None:
            if isinstance(item, (Frame, Noise)):
                data = item.data if isinstance(item, Noise) else item.to_bytes()
                yield Chunk(at_ns=self._last, direction=direction, data=data)


def frame_chunks(chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """Yield the same bytes cut at frames."""
    cutter = FrameCutter()
    for chunk in chunks:
        yield from cutter.take(chunk)
    yield from cutter.finish()


class _Stream:
    """One direction's decoder, and how far its bytes were told."""

    def __init__(self, direction: Direction | None) -> None:
        self.direction = direction
        self.decoder = Decoder()
        self._place = 0
        #: Bytes before this place were shown in the row of a rejected frame.
        self._shown_to = 0

    def consume(self, size: int) -> None:
        self._place += size

    def consume_noise(self, data: bytes) -> bytes:
        """Return what of the noise was not shown yet."""
        new = data[max(0, self._shown_to - self._place) :]
        self._place += len(data)
        return new

    def reject(self, size: int) -> None:
        self._shown_to = max(self._shown_to, self._place + size)


def _damage(stream: _Stream, now: Nanos, data: bytes, name: str, problem: str) -> Row:
    fields: dict[str, Plain] = {"bytes": data.hex(" "), "problem": problem}
    return Row(
        at_ns=now, direction=stream.direction, data=data, kind=None, name=name, fields=fields, problem=problem
    )  # fmt: skip


def _cut_off(item: Stalled) -> str:
    if len(item.data) < 3:
        return "a header whose frame never came"
    return f"{len(item.data)} of {item.data[2] + 3} bytes came"
