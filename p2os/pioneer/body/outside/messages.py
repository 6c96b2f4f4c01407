"""The messages of the protocol by which another program is the body, as values and as bytes.

A frame is a length (u32, of all that follows), a type (u8) and the fields of that message. Numbers are little-endian;
a real number is an IEEE 754 double. A text is a u16 length and UTF-8; a blob is a u32 length and bytes; a list is its
count and its rows. `REQUESTS` says what each request is answered by: the answer has its type with bit 7 set. A `Failed`
may answer any.

Source: docs/outside-body.md, whose table a test compares with this one.
Invariant: whatever `decode` returns, `encode` writes as the same bytes; no real number in it is beyond `LARGEST`, but
for a distance where no echo came, which is infinite.
"""

import math
import struct
from collections.abc import Mapping
from itertools import chain
from typing import NamedTuple, TypeAlias

from simbase.errors import P2osError, shown

#: Another version is refused by either side.
VERSION = 1
#: chosen: a longer frame is no message; a mesh of a building has 10 MB.
LONGEST_FRAME = 64 * 2**20
#: chosen: a real number beyond is no distance, angle, speed or energy of a robot.
LARGEST = 1e9
#: The answer to a request has its type and this.
ANSWER = 0x80
FAILED = 0xFF

Row: TypeAlias = tuple[float, ...]
Rows: TypeAlias = tuple[Row, ...]


class MessageError(P2osError):
    """Bytes that are no message; the text says what they lack."""


# Fields -----------------------------------------------------------------------------------


class _Cursor:
    """Where in a frame the next field begins."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise MessageError(f"ends {size - (len(self.data) - self.at)} bytes early")
        self.at += size
        return self.data[self.at - size : self.at]


class _Record:
    """Numbers of one layout, as a tuple; or one number as itself."""

    def __init__(self, layout: str, *, may_be_infinite: bool = False) -> None:
        self._struct, self._may_be_infinite = struct.Struct("<" + layout), may_be_infinite
        self._is_single = len(layout) == 1
        self._has_reals = "d" in layout

    def put(self, value: object, out: bytearray) -> None:
        try:
            out += self._struct.pack(*((value,) if self._is_single else value))  # type: ignore[misc]  # a tuple
        except struct.error as error:
            raise MessageError(f"cannot be written: {error}") from error

    def take(self, cursor: _Cursor) -> object:
        values = self._struct.unpack(cursor.take(self._struct.size))
        self.check(values)
        return values[0] if self._is_single else values

    def take_rows(self, cursor: _Cursor, count: int) -> tuple[object, ...]:
        rows = tuple(self._struct.iter_unpack(cursor.take(count * self._struct.size)))
        self.check(tuple(chain.from_iterable(rows)))
        return tuple(row[0] for row in rows) if self._is_single else rows

    def check(self, values: tuple[float, ...]) -> None:
        """Refuse what is no number of a robot."""
        if self._has_reals and not all(-LARGEST <= value <= LARGEST for value in values):
            for value in values:
                if not -LARGEST <= value <= LARGEST and not (value == math.inf and self._may_be_infinite):
                    raise MessageError(f"has {value} where a number within {LARGEST:g} belongs")


class _Text:
    """A text: u16 length, UTF-8."""

    def put(self, value: object, out: bytearray) -> None:
        data = str(value).encode("utf-8", "replace")
        if len(data) > 0xFFFF:
            raise MessageError("has a text that is longer than 65535 bytes")
        out += struct.pack("<H", len(data)) + data

    def take(self, cursor: _Cursor) -> object:
        (size,) = struct.unpack("<H", cursor.take(2))
        data = cursor.take(size)
        try:
            return data.decode()
        except UnicodeDecodeError as error:
            raise MessageError(f"has a text that is no UTF-8: {shown(data)}") from error


class _Blob:
    """Bytes: u32 length, the bytes."""

    def put(self, value: object, out: bytearray) -> None:
        data = value if isinstance(value, bytes) else b""
        out += struct.pack("<I", len(data)) + data

    def take(self, cursor: _Cursor) -> object:
        (size,) = struct.unpack("<I", cursor.take(4))
        return cursor.take(size)


class _Table:
    """Rows of one layout: their count and the rows."""

    def __init__(self, count: str, layout: str, *, may_be_infinite: bool = False) -> None:
        self._count, self._row = struct.Struct("<" + count), _Record(layout, may_be_infinite=may_be_infinite)

    def put(self, value: object, out: bytearray) -> None:
        rows: tuple[object, ...] = tuple(value)  # type: ignore[arg-type]  # the message's field says so
        out += self._count.pack(len(rows))
        for row in rows:
            self._row.put(row, out)

    def take(self, cursor: _Cursor) -> object:
        (count,) = self._count.unpack(cursor.take(self._count.size))
        return self._row.take_rows(cursor, count)


class _List:
    """Rows that hold texts: a u16 count and the rows, each its fields."""

    def __init__(self, *fields: "_Field") -> None:
        self._fields = fields

    def put(self, value: object, out: bytearray) -> None:
        rows: tuple[tuple[object, ...], ...] = tuple(value)  # type: ignore[arg-type]  # the message's field says so
        out += struct.pack("<H", len(rows))
        for row in rows:
            for field, item in zip(self._fields, row, strict=True):
                field.put(item, out)

    def take(self, cursor: _Cursor) -> object:
        (count,) = struct.unpack("<H", cursor.take(2))
        return tuple(tuple(field.take(cursor) for field in self._fields) for _ in range(count))


_Field: TypeAlias = "_Record | _Text | _Blob | _Table | _List"

# Requests ---------------------------------------------------------------------------------


class Hello(NamedTuple):
    """Who asks, and what robot it is; metres, kilograms, newton metres and radians, in the robot's frame."""

    version: int
    step_ns: int
    robot: str
    #: track, wheel diameter, ground clearance, hull height, mass, mass of a wheel, greatest torque of a motor at its
    #: wheel, height of the sonar ring, longest and least range, opening angle of a sonar
    sizes: Row
    #: The hull's outline from above, counter-clockwise.
    hull: Rows
    #: x, y and heading of each sonar, number 0 first.
    sonar: Rows


class MakeWorld(NamedTuple):
    """An empty world: what was there before is forgotten. The floor's x0, y0, x1, y1 in metres, top at height 0."""

    name: str
    extent: Row


class Place(NamedTuple):
    """A thing is in the world from now on.

    `kind` is 0 box, 1 upright cylinder, 2 floor (driven on), 3 ramp (driven on). `sizes`: x, y, heading of its middle,
    length, width (0, 0 of a cylinder), radius (0 of others), height of its underside, height from there to its top,
    mass (0: it stands fast) and friction against the floor.
    """

    name: str
    kind: int
    sizes: Row


class PlaceMesh(NamedTuple):
    """Triangles that stand fast: corners x, y, z, and three numbers of corners a triangle."""

    name: str
    corners: Rows
    triangles: tuple[tuple[int, int, int], ...]


class Move(NamedTuple):
    """A thing stands elsewhere from now on, at rest: x, y, heading."""

    name: str
    pose: Row


class Remove(NamedTuple):
    """A thing is no longer in the world."""

    name: str


class Reset(NamedTuple):
    """The robot stands still at x, y, heading, floor height; wheel angles are 0, things stay as they are."""

    pose: Row
    seed: int


class StandAt(NamedTuple):
    """The robot stands still at x, y, heading, floor height, as if carried there; wheel angles go on."""

    pose: Row


class Step(NamedTuple):
    """Steps in order: set-points of the left and the right rim, m/s, and 1 where the motors have power."""

    rows: Rows


class AskRanges(NamedTuple):
    """How far the nearest echo of these sonar is now."""

    numbers: tuple[int, ...]


class AskRays(NamedTuple):
    """What rays in the plane of the sonar ring meet within a distance: x, y, heading of each in the robot's frame."""

    longest_m: float
    rays: Rows


class Save(NamedTuple):
    """All that decides the future."""


class Restore(NamedTuple):
    """What `Saved` held, on a connection that has had the same robot and things."""

    state: bytes


class Bye(NamedTuple):
    """Nothing follows."""


# Answers ----------------------------------------------------------------------------------


class Welcome(NamedTuple):
    """Who answers, what it can (`Ability`), and what a reader of a result has to know of it, or nothing."""

    version: int
    abilities: int
    name: str
    note: str


class Done(NamedTuple):
    """It is so."""


class Report(NamedTuple):
    """The robot after the last step.

    x, y, z, heading, pitch; angles of the left and the right wheel since the reset, achieved rim speeds; speed forward,
    rate of turn; free distance around the hull in the plan (negative: not told); work at the rims since the
    world was made, joules (0: not told).
    """

    numbers: Row


class Stepped(NamedTuple):
    """What each step has made, and the state after the last.

    `rows`: wheel angles, left and right, and bits: 1 left stalled, 2 right stalled, 4 the hull touches something.
    `touched`: number of the step (0 first) at which it began to touch a thing, where (x, y), and the thing's name or
    nothing. `moved`: things that were pushed: name, x, y, heading.
    """

    rows: Rows
    numbers: Row
    touched: tuple[tuple[int, Row, str], ...]
    moved: tuple[tuple[str, Row], ...]


class Ranges(NamedTuple):
    """The distances from each transducer, metres; infinite where no echo comes."""

    distances: Row


class Rays(NamedTuple):
    """What each ray meets: distance (infinite: nothing), and the cosine of its angle with the surface's normal."""

    hits: Rows


class Saved(NamedTuple):
    """The state, in the answering program's own form."""

    state: bytes


class Failed(NamedTuple):
    """It cannot be: the reason as one line."""

    reason: str


Request: TypeAlias = (
    Hello | MakeWorld | Place | PlaceMesh | Move | Remove | Reset | StandAt | Step | AskRanges | AskRays | Save
    | Restore | Bye
)  # fmt: skip
Answer: TypeAlias = Welcome | Done | Report | Stepped | Ranges | Rays | Saved | Failed
Message: TypeAlias = Request | Answer

_TEXT, _BLOB, _POSE = _Text(), _Blob(), _Record("ddd")
_REPORT = _Record("13d")
#: Request → its type and what answers it.
REQUESTS: Mapping[type[Request], tuple[int, type[Answer]]] = {
    Hello: (1, Welcome), MakeWorld: (2, Done), Place: (3, Done), PlaceMesh: (4, Done), Move: (5, Done),
    Remove: (6, Done), Reset: (7, Report), StandAt: (8, Report), Step: (9, Stepped), AskRanges: (10, Ranges),
    AskRays: (11, Rays), Save: (12, Saved), Restore: (13, Report), Bye: (14, Done),
}  # fmt: skip
#: Message → its fields, in order.
FIELDS: Mapping[type[Message], tuple[_Field, ...]] = {
    Hello: (_Record("H"), _Record("I"), _TEXT, _Record("11d"), _Table("H", "dd"), _Table("H", "ddd")),
    MakeWorld: (_TEXT, _Record("dddd")),
    Place: (_TEXT, _Record("B"), _Record("10d")),
    PlaceMesh: (_TEXT, _Table("I", "ddd"), _Table("I", "III")),
    Move: (_TEXT, _POSE),
    Remove: (_TEXT,),
    Reset: (_Record("dddd"), _Record("Q")),
    StandAt: (_Record("dddd"),),
    Step: (_Table("I", "ddB"),),
    AskRanges: (_Table("H", "H"),),
    AskRays: (_Record("d"), _Table("I", "ddd")),
    Save: (), Restore: (_BLOB,), Bye: (),
    Welcome: (_Record("H"), _Record("H"), _TEXT, _TEXT),
    Done: (),
    Report: (_REPORT,),
    Stepped: (_Table("I", "ddB"), _REPORT, _List(_Record("I"), _Record("dd"), _TEXT), _List(_TEXT, _POSE)),
    Ranges: (_Table("H", "d", may_be_infinite=True),),
    Rays: (_Table("I", "dd", may_be_infinite=True),),
    Saved: (_BLOB,),
    Failed: (_TEXT,),
}  # fmt: skip


def encode(message: Message, kind: int) -> bytes:
    """Return a message as a frame of this type.

    Raises:
        MessageError: A value does not fit its field, or the frame would be too long.
    """
    out = bytearray()
    for field, value in zip(FIELDS[type(message)], message, strict=True):
        field.put(value, out)
    if len(out) >= LONGEST_FRAME:
        raise MessageError(f"of {len(out)} bytes is longer than {LONGEST_FRAME}")
    return struct.pack("<IB", 1 + len(out), kind) + out


def decode(made: type[Message], payload: bytes) -> Message:
    """Return the message of a type from what follows the type in its frame.

    Raises:
        MessageError: It is shorter or longer than its fields, or a value cannot be.
    """
    cursor = _Cursor(payload)
    values = [field.take(cursor) for field in FIELDS[made]]
    if cursor.at != len(payload):
        raise MessageError(f"has {len(payload) - cursor.at} bytes too many")
    return made(*values)  # type: ignore[arg-type]  # the table of the fields says so


def encode_request(request: Request) -> bytes:
    """Return a request as a frame."""
    return encode(request, REQUESTS[type(request)][0])
