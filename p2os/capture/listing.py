"""A capture as rows: every frame read, every damaged byte shown, in the order of time; and rows as lines for a person.

What stands in a frame is described in `p2os.capture.describe`, each of its bytes in
`p2os.capture.explain`.

Theory of operation. Three decoders run side by side: one a direction, and one for
bytes whose direction the source does not give. Numbers 0, 1 and 2 mean SYNC0, SYNC1,
SYNC2 before a session is open and PULSE, OPEN, CLOSE in it: the same bytes.
`RecordedSession` tells them apart; where the beginning was not captured, only a
robot's packet shows that a session is open.

Invariant: rows partition what was sent. Each byte stands in exactly one row, except
that a rejected frame's row shows all of its bytes, also those that turned out to hold
another frame.
"""

import math
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, cast

from p2os.capture.chunks import Chunk, Direction
from p2os.capture.describe import PacketFields, Plain, command_fields, command_name
from p2os.capture.reading import FollowedReading, Reading
from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.commands import NEGATIVE, POSITIVE, STRING, CommandNumber
from p2os.protocol.frames import (
    CHECKSUM_BYTES,
    HEADER,
    PREFIX_BYTES,
    BadChecksum,
    BadCount,
    Decoder,
    Frame,
    Item,
    Noise,
    Stalled,
    sound_frames,
)
from p2os.protocol.packets import IDENTITY_KIND, RESET_KINDS, packet_name
from p2os.protocol.sip import SIP_KINDS, is_sip
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: What the numbers of `SYNC_NAMES` are called in a session.
COMMAND_NAMES = tuple(CommandNumber(number).name for number in range(len(SYNC_NAMES)))
#: chosen: packets that were on their way when CLOSE was sent; three cycles.
IN_FLIGHT_NS: Nanos = 300 * NS_PER_MS
#: Longer than any decoder waits for the rest of a frame.
_LONG_AFTER_NS: Nanos = NS_PER_S
#: The longest run of bytes shown in one line; `--explain` shows all.
SHOWN_BYTES = 24


class ListingRow:
    """One frame, or one run of bytes that is none.

    Args:
        at_ns: When its last byte had come, in nanoseconds since the start.
        direction: Who sent it; None where nobody can tell.
        data: Its bytes on the wire.
        kind: Command number or packet type; None for what is no frame.
        name: Its name in the manuals, or what is wrong.
        describe: What says what stands inside, when someone asks for `fields`.
        problem: One sentence about what is wrong; empty for a sound frame.
    """

    __slots__ = ("_describe", "_fields", "at_ns", "data", "direction", "kind", "name", "problem")

    def __init__(
        self, *, at_ns: Nanos, direction: Direction | None, data: bytes, kind: int | None, name: str,
        describe: Callable[[bytes], dict[str, Plain]], problem: str = "",
    ) -> None:  # fmt: skip
        self.at_ns, self.direction, self.data = at_ns, direction, data
        self.kind, self.name, self.problem = kind, name, problem
        self._describe = describe
        self._fields: dict[str, Plain] | None = None

    @property
    def fields(self) -> dict[str, Plain]:
        """What stands inside, SI units, in the order of the wire."""
        if self._fields is None:
            self._fields = self._describe(self.data)
        return self._fields

    @property
    def valid(self) -> bool:
        """Whether this is a sound frame."""
        return not self.problem

    @property
    def is_sip(self) -> bool:
        """Whether this is a standard SIP and sound inside, if the robot has sent it."""
        return self.kind in SIP_KINDS and is_sip(self.data[PREFIX_BYTES:-CHECKSUM_BYTES])

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


class RowFilter(Protocol):
    """What finds sound frames and says which of them need no row."""

    def found_in(self, data: bytes, direction: Direction | None) -> "Finder":
        """Look at bytes; return what tells the sound frames that stand in them."""
        ...


class Finder(Protocol):
    """The sound frames of some bytes."""

    def frames(self, place: int) -> tuple[list[tuple[int, int, bool]], int]:
        """Return the sound frames that stand one behind the other from a place on.

        Returns:
            Where the payload of each begins and ends, and whether it is passed over; of several such in a row only
            the last. And where the frames end: the place itself where there is none.
        """
        ...


class Lister:
    """Turns chunks into rows as they come.

    Args:
        reading: How to read what stands in the frames; one that is followed is given each packet of the robot.
        passing: Which packets are passed over; None for none.
    """

    def __init__(self, reading: Reading | FollowedReading, passing: RowFilter | None = None) -> None:
        self._passing = passing
        self._followed = reading if isinstance(reading, FollowedReading) else None
        self._read_by(reading.reading if isinstance(reading, FollowedReading) else reading)
        self._session = RecordedSession()
        self._streams: dict[Direction | None, _Stream] = {}

    def take(self, chunk: Chunk) -> Iterator[ListingRow]:
        """Take a chunk; yield the rows that it completes."""
        if chunk.direction not in self._streams:
            self._streams[chunk.direction] = _Stream(chunk.direction)
        yield from self.advance_to(chunk.at_ns)
        if chunk.data:
            yield from self._take(self._streams[chunk.direction], chunk.data, chunk.at_ns)

    @property
    def is_waiting(self) -> bool:
        """Whether a frame has begun whose rest has not come, in any direction."""
        return any(stream.decoder.next_deadline() is not None for stream in self._streams.values())

    def pass_over(self, direction: Direction | None, now: Nanos) -> None:
        """Take the last in a row of what `passing` allows to pass over; without direction it is the robot's."""
        if direction is not Direction.TO_ROBOT:
            self._session.take_in_session(now)

    def _read_by(self, reading: Reading) -> None:
        self._reading = reading
        self._packets = PacketFields(reading.profile, reading.parameters)

    def _take(self, stream: "_Stream", data: bytes, now: Nanos) -> Iterator[ListingRow]:
        # Most bytes are sound frames, one behind the other: these need no decoder. What it has to look at it gets up to
        # the next header, before which it tells of noise anyway, so that rows are those of the whole given at once.
        finder, place = None, 0
        while place < len(data):
            waiting = stream.decoder.take_back()
            known = 0
            if waiting is not None:
                if finder is None:
                    data, place = waiting + data[place:], len(waiting)
                    look = LoopFinder if self._passing is None else self._passing.found_in
                    finder = look(data, stream.direction)
                start = place - len(waiting)
                frames, end = finder.frames(start)
                for first, last, is_passed in frames:
                    if is_passed:
                        self.pass_over(stream.direction, now)
                    else:
                        whole = data[first - PREFIX_BYTES : last + CHECKSUM_BYTES]
                        yield self._frame_row(stream.direction, data[first:last], whole, now)
                stream.consume(end - start)
                known, place = max(0, place - end), end
            cut = next_header(data, place + known + 1)
            stream.decoder.receive(data[place:cut], now)
            place = cut
            yield from self._drain(stream, now)

    def advance_to(self, now: Nanos) -> Iterator[ListingRow]:
        """Yield what has been given up by `now` nanoseconds: frames whose rest never came."""
        for stream in self._streams.values():
            if stream.decoder.next_deadline() is not None:
                stream.decoder.advance_to(now)
                yield from self._drain(stream, now)

    def finish(self, now: Nanos) -> Iterator[ListingRow]:
        """Yield what was left when the capture ended."""
        for stream in self._streams.values():
            stream.decoder.advance_to(now + _LONG_AFTER_NS)
            yield from self._drain(stream, now)

    def _drain(self, stream: "_Stream", now: Nanos) -> Iterator[ListingRow]:
        while (item := stream.decoder.next_item()) is not None:
            row = self._row(stream, item, now)
            if row is not None:
                yield row

    def _row(self, stream: "_Stream", item: Item, now: Nanos) -> ListingRow | None:
        if isinstance(item, Frame):
            whole = item.to_bytes()
            stream.consume(len(whole))
            return self._frame_row(stream.direction, item.payload, whole, now)
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

    def _frame_row(self, direction: Direction | None, payload: bytes, whole: bytes, now: Nanos) -> ListingRow:
        if direction is None:
            direction = guess_direction(payload)
        kind = payload[0]
        name = self._session.name_of(payload, direction, now)
        if direction is Direction.FROM_ROBOT:
            if self._followed is not None:
                self._followed.take(payload)
                if self._followed.reading is not self._reading:
                    self._read_by(self._followed.reading)
            name, describe = name or packet_name(kind), self._packets.fields_of
        else:
            name, describe = name or command_name(kind), command_fields
        return ListingRow(at_ns=now, direction=direction, data=whole, kind=kind, name=name, describe=describe)


class LoopFinder:
    """Finds sound frames one by one; passes over none, or some kinds.

    Args:
        data: The bytes.
        direction: Who sent them.
        passed_kinds: Which numbers need no row.
    """

    def __init__(self, data: bytes, direction: Direction | None, passed_kinds: Collection[int] = ()) -> None:
        self._data, self._direction, self._passed_kinds = data, direction, passed_kinds

    def frames(self, place: int) -> tuple[list[tuple[int, int, bool]], int]:
        """Return the sound frames from a place on, as a `Finder`."""
        found: list[tuple[int, int, bool]] = []
        for payload in sound_frames(self._data, place):
            start = place + PREFIX_BYTES
            end = start + len(payload)
            place = end + CHECKSUM_BYTES
            passed = payload[0] in self._passed_kinds and (self._direction is not None or is_sip(payload))
            if passed and found and found[-1][2]:
                found.pop()
            found.append((start, end, passed))
        return found, place


def next_header(data: bytes, place: int, limit: int | None = None) -> int:
    """Return where the next header begins, or the limit, which is the end; not one behind a first byte that is alone.

    Args:
        data: The bytes.
        place: From where on.
        limit: One past the last byte that is looked at; None for all.
    """
    limit = len(data) if limit is None else limit
    while (place := data.find(HEADER, place, limit)) > 0 and data[place - 1] == HEADER[0]:
        place += 1
    return limit if place < 0 else place


def rows_of(
    chunks: Iterable[Chunk], reading: Reading | FollowedReading, passing: RowFilter | None = None
) -> Iterator[ListingRow]:
    """Yield every row of a capture, or of chunks while they are read; none of what is passed over."""
    lister, last_ns = Lister(reading, passing), 0
    for chunk in chunks:
        last_ns = chunk.at_ns
        yield from lister.take(chunk)
    yield from lister.finish(last_ns)


def frame_row(data: bytes, *, at_ns: Nanos, direction: Direction | None, name: str, reading: Reading) -> ListingRow:
    """Return the row of a sound frame of which all but its fields is known.

    Args:
        data: Its bytes on the wire.
        at_ns: When its last byte had come.
        direction: Who sent it.
        name: As its row had it.
        reading: By which its fields are read.
    """

    def describe(data: bytes) -> dict[str, Plain]:
        if direction is Direction.FROM_ROBOT:
            return PacketFields(reading.profile, reading.parameters).fields_of(data)
        return command_fields(data)

    kind = data[PREFIX_BYTES]
    return ListingRow(at_ns=at_ns, direction=direction, data=data, kind=kind, name=name, describe=describe)


def line_of(row: ListingRow, *, has_time: bool = True) -> str:
    """Return a row as one line."""
    time = f"{row.at_ns / NS_PER_S:10.6f} s  " if has_time else ""
    arrow = " " if row.direction is None else row.direction.arrow
    if not row.valid:
        return f"{time}{arrow} !! {row.name}: {row.problem}: {_hex(row.data)}"
    return f"{time}{arrow} {row.name}{_inside(row)}"


def inside_of(row: ListingRow) -> str:
    """Return what stands inside a row, in a line; what is wrong with a damaged one."""
    return _inside(row).strip() if row.valid else row.problem


def summary_of(rows: int, damaged: int, capture_s: float) -> str:
    """Return the last line of a listing."""
    packets = rows - damaged
    text = f"{packets} packet{'' if packets == 1 else 's'}"
    if capture_s > 0:
        text += f" in {capture_s:.3f} s"
    return f"{text}, {damaged} damaged" if damaged else f"{text}, none damaged"


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece(Chunk):
    """A frame, or a run of bytes that is none."""

    frame: Frame | None


class FrameCutter:
    """Cuts chunks at frames as they come: one chunk a frame, or a run of bytes that is none.

    Nothing is lost: all that comes out, joined by direction, is all that went in.
    """

    def __init__(self) -> None:
        self._decoders: dict[Direction | None, Decoder] = {}
        self._last: Nanos = 0

    def take(self, chunk: Chunk) -> Iterator[Piece]:
        """Take a chunk; yield what it completes, with its time."""
        decoder = self._decoders.setdefault(chunk.direction, Decoder())
        self._last = chunk.at_ns
        decoder.receive(chunk.data, self._last)
        yield from self._cut(decoder, chunk.direction)

    def finish(self) -> Iterator[Piece]:
        """Yield what was begun and never completed."""
        for direction, decoder in self._decoders.items():
            decoder.advance_to(self._last + _LONG_AFTER_NS)
            yield from self._cut(decoder, direction)

    def _cut(self, decoder: Decoder, direction: Direction | None) -> Iterator[Piece]:
        while (item := decoder.next_item()) is not None:
            if isinstance(item, Frame):
                yield Piece(at_ns=self._last, direction=direction, data=item.to_bytes(), frame=item)
            elif isinstance(item, Noise):
                yield Piece(at_ns=self._last, direction=direction, data=item.data, frame=None)


def frame_chunks(chunks: Iterable[Chunk]) -> Iterator[Piece]:
    """Yield the same bytes cut at frames."""
    cutter = FrameCutter()
    for chunk in chunks:
        yield from cutter.take(chunk)
    yield from cutter.finish()


class _State(Enum):
    CLOSED = "closed"
    #: The robot has sent its identity; the next number 1 is OPEN.
    SYNCED = "synced"
    OPEN = "open"


class RecordedSession:
    """Follows one conversation."""

    def __init__(self) -> None:
        self._state = _State.CLOSED
        self._closed_at: Nanos | None = None

    @property
    def is_open(self) -> bool:
        """Whether a session is open, as far as was captured."""
        return self._state is _State.OPEN

    def name_of(self, payload: bytes, direction: Direction | None, now: Nanos) -> str:
        """Take a frame's payload; return its name if it is one of the six, else an empty string."""
        kind, has_data = payload[0], len(payload) > 1
        if direction is Direction.FROM_ROBOT:
            return self._take_packet(kind, now, has_data=has_data)
        if kind > CommandNumber.CLOSE:
            return ""
        if self._state is _State.SYNCED and kind == CommandNumber.OPEN:
            self._state = _State.OPEN
        is_command = self._state is _State.OPEN or (has_data and kind != CommandNumber.PULSE)
        if not is_command:
            return SYNC_NAMES[kind]
        if kind == CommandNumber.CLOSE:
            self._state, self._closed_at = _State.CLOSED, now
        return COMMAND_NAMES[kind]

    def take_in_session(self, now: Nanos) -> None:
        """Take a robot's packet of a kind that it sends in a session only."""
        if self._closed_at is None or now > self._closed_at + IN_FLIGHT_NS:
            self._state, self._closed_at = _State.OPEN, None

    def _take_packet(self, kind: int, now: Nanos, *, has_data: bool) -> str:
        if kind > IDENTITY_KIND and kind not in RESET_KINDS:
            self.take_in_session(now)
        elif kind == IDENTITY_KIND and has_data:
            self._state = _State.SYNCED
        elif kind in RESET_KINDS:
            self._state = _State.CLOSED
        elif not has_data:
            self._state = _State.CLOSED
            return SYNC_NAMES[kind]
        return ""


def guess_direction(payload: bytes) -> Direction | None:
    """Return who is likely to have sent a frame, by its shape; None where both would send the same bytes."""
    kind = payload[0]
    if kind in SIP_KINDS and is_sip(payload):
        return Direction.FROM_ROBOT
    data = payload[1:]
    if kind <= IDENTITY_KIND and not data:
        return None
    if kind == IDENTITY_KIND and data.count(b"\0") >= 3 and data[-1:] == b"\0":
        return Direction.FROM_ROBOT
    if _is_argument(data):
        return Direction.TO_ROBOT
    return Direction.FROM_ROBOT


def _is_argument(data: bytes) -> bool:
    """Tell whether a command's argument may look so: none, an integer, a string, or SETO's lone type byte."""
    if not data or data in (bytes((POSITIVE,)), bytes((NEGATIVE,))):
        return True
    if data[0] in {POSITIVE, NEGATIVE}:
        return len(data) == 3
    return data[0] == STRING and len(data) >= 2 and len(data) - 2 - data[1] in {0, 1}


class _Stream:
    """One direction's decoder, and how far its bytes were shown."""

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


def _damage(stream: _Stream, now: Nanos, data: bytes, name: str, problem: str) -> ListingRow:
    def describe(data: bytes) -> dict[str, Plain]:
        return {"bytes": data.hex(" "), "problem": problem}

    return ListingRow(
        at_ns=now, direction=stream.direction, data=data, kind=None, name=name, describe=describe, problem=problem
    )


def _cut_off(item: Stalled) -> str:
    if len(item.data) < 3:
        return "a header whose frame never came"
    return f"{len(item.data)} of {item.data[2] + 3} bytes came"


def _inside(row: ListingRow) -> str:
    if "x_m" in row.fields:
        return f"  {_sip(row.fields)}"
    if "argument" in row.fields and not set(row.fields) - {"argument", "unit"}:
        return f" {row.fields['argument']} {row.fields.get('unit', '')}".rstrip()
    if "text" in row.fields:
        return f' "{row.fields["text"]}" ({row.fields["argument"]})'
    inside = {name: value for name, value in row.fields.items() if name not in {"argument", "unit"}}
    shown = ", ".join(f"{name} {_value(value)}" for name, value in inside.items())
    unit = f", each x {row.fields['unit']}" if "unit" in row.fields else ""
    return f"  {shown}{unit}" if shown else ""


def _sip(fields: dict[str, Plain]) -> str:
    number = cast("dict[str, float]", fields)
    text = (
        f"x {number['x_m']:.3f} m, y {number['y_m']:.3f} m, heading {math.degrees(number['heading_rad']):.1f} deg, "
        f"wheels {number['left_mps']:.3f} {number['right_mps']:.3f} m/s, {number['battery_v']:.1f} V"
    )
    stalls = [side for side in ("left", "right") if fields[f"stall_{side}"]]
    if stalls:
        text += f", stalled {' and '.join(stalls)}"
    sonar = cast("dict[str, float]", fields["sonar_m"])
    if sonar:
        text += ", sonar " + " ".join([f"{place}:{range_m:.3f}" for place, range_m in sonar.items()]) + " m"
    return text


def _value(value: Plain) -> str:
    if isinstance(value, str):
        return value if value and " " not in value else f'"{value}"'
    if isinstance(value, list):
        return "[" + " ".join(_value(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{" + " ".join(f"{key}:{_value(item)}" for key, item in value.items()) + "}"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _hex(data: bytes) -> str:
    shown = data[:SHOWN_BYTES].hex(" ")
    return shown if len(data) <= SHOWN_BYTES else f"{shown} … ({len(data)} bytes)"
