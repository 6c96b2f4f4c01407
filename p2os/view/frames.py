"""Rows of one channel as a binary frame, on the WebSocket and in a page that is one file.

A frame is a head of 48 bytes and the columns of its kind (`channels`), all little-endian, each column at a multiple of
8 bytes, so that typed arrays lie on them:

    0  4s  "P2VF"            16  u32  width: cells a row of a wide column
    4  u8  format            20  u32  of: rows there are in this time; more than `count` where some are left out
    5  u8  number of kind    24  u32  size of the whole frame, a multiple of 8
    6  u8  flags             28  u32  0
    7  u8  0                 32  i64  from_ns
    8  u32 channel           40  i64  to_ns
    12 u32 count of rows

Numbers: `count` cells (a wide column `count * width`), filled up with zeros to 8 bytes. Texts and bytes, each distinct
one once: u32 count of distinct, u32 bytes of all; u32 place of each row's; u32 end of each distinct; the bytes. Each of
these four is filled up to 8 bytes.

Invariant: `ViewFrame.from_bytes` is the inverse of `to_bytes`, and refuses all else by `FrameError`: what it accepts,
`to_bytes` spells alike.
"""

import struct
import sys
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntFlag
from itertools import pairwise
from typing import TypeAlias, cast, overload

from p2os.errors import RemoteProtocolError
from p2os.view.channels import BY_NUMBER, FORMAT, CellType, ChannelKind
from simbase.timing import Nanos

MAGIC = b"P2VF"
HEAD = struct.Struct("<4sBBBBIIIIIIqq")
#: chosen: a page's browser holds it without a pause; the server cuts what is longer.
LARGEST_FRAME_BYTES = 64 << 20
_ALIGN = 8
_U32 = struct.Struct("<II")
#: Type code of `array` and bytes a cell.
_NUMBERS = {
    CellType.I64: ("q", 8),
    CellType.F64: ("d", 8),
    CellType.F32: ("f", 4),
    CellType.U32: ("I", 4),
    CellType.U8: ("B", 1),
}


class LaterText:
    """A text that is made when somebody is to read it.

    Args:
        make: Makes it.
    """

    __slots__ = ("_make", "_text")

    def __init__(self, make: Callable[[], str]) -> None:
        self._make: Callable[[], str] | None = make
        self._text = ""

    def __str__(self) -> str:
        """Return it, made by now."""
        if self._make is not None:
            self._text, self._make = self._make(), None
        return self._text

    def __repr__(self) -> str:
        """Return it as a text is written."""
        return repr(str(self))


class LaterTexts(Sequence[str]):
    """A column of texts, each made when somebody is to read it.

    Args:
        count: Rows.
        make: Returns the text of a row.
    """

    def __init__(self, count: int, make: Callable[[int], str]) -> None:
        self._rows, self._make = range(count), make

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice) -> list[str]: ...

    def __getitem__(self, place: int | slice) -> str | list[str]:
        """Return the text of a row, or those of some."""
        if isinstance(place, slice):
            return list(map(self._make, self._rows[place]))
        return self._make(self._rows[place])


#: One column: numbers as an array of its type, texts or bytes as a list.
ColumnValues: TypeAlias = "array[int] | array[float] | list[str] | list[bytes] | LaterTexts"


class FrameError(RemoteProtocolError):
    """Bytes that are no frame of this format."""


class FrameFlags(IntFlag):
    """What is to be known of a frame."""

    #: Rows are left out: those that show the least and greatest of each pixel are kept.
    REDUCED = 1
    #: It replaces what the page has of the channel, whatever its times.
    REPLACES = 2


NO_FLAGS = FrameFlags(0)


def empty_columns(kind: ChannelKind) -> list[ColumnValues]:
    """Return a kind's columns without rows."""
    return [array(_NUMBERS[column.cells][0]) if column.cells in _NUMBERS else [] for column in kind.columns]


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewFrame:
    """Rows of a channel, from one time to another.

    Args:
        kind: Of the channel.
        channel: Its number in the header.
        columns: As the kind has them; as long as one another, wide ones times `width`.
        from_ns: From when on these are the rows.
        to_ns: Until when, both included.
        of: How many rows there are in that time.
        width: CellType a row of wide columns; 1 where there are none.
        flags: What is to be known.

    Raises:
        FrameError: Columns do not fit one another, or a number does not fit its field.
    """

    kind: ChannelKind
    channel: int
    columns: tuple[ColumnValues, ...]
    from_ns: Nanos
    to_ns: Nanos
    of: int
    width: int = 1
    flags: FrameFlags = NO_FLAGS

    def __post_init__(self) -> None:
        if len(self.columns) != len(self.kind.columns):
            raise FrameError(f"{len(self.columns)} columns, and {self.kind.name} has {len(self.kind.columns)}")
        for column, values in zip(self.kind.columns, self.columns, strict=True):
            wanted = self.count * (self.width if column.is_wide else 1)
            if len(values) != wanted:
                raise FrameError(f"{len(values)} cells of {column.name}, expected {wanted}")
        if not self.count <= self.of < 2**32:
            raise FrameError(f"{self.count} rows of {self.of}")

    @property
    def count(self) -> int:
        """Rows."""
        return len(self.columns[0])

    def to_bytes(self) -> bytes:
        """Return it as bytes."""
        parts = [part for column, values in zip(self.kind.columns, self.columns, strict=True)
                 for part in _packed(column.cells, values)]  # fmt: skip
        size = HEAD.size + sum(map(len, parts))
        head = HEAD.pack(
            MAGIC, FORMAT, self.kind.number, self.flags, 0, self.channel, self.count, self.width, self.of, size, 0,
            self.from_ns, self.to_ns,
        )  # fmt: skip
        return b"".join((head, *parts))

    @classmethod
    def from_bytes(cls, data: bytes) -> "ViewFrame":
        """Return the frame that these bytes are.

        Raises:
            FrameError: They are none, or more or less than one.
        """
        if len(data) < HEAD.size:
            raise FrameError(f"{len(data)} bytes, and a frame has {HEAD.size} at least")
        magic, version, number, flags, zero, channel, count, width, of, size, other_zero, from_ns, to_ns = HEAD.unpack(
            data[: HEAD.size]
        )
        if magic != MAGIC or version != FORMAT or zero or other_zero or flags > max(_ALL_FLAGS):
            raise FrameError("a head of another format")
        if size != len(data) or size > LARGEST_FRAME_BYTES:
            raise FrameError(f"{len(data)} bytes, and the head says {size}")
        kind = BY_NUMBER.get(number)
        if kind is None:
            raise FrameError(f"a channel of an unknown kind, {number}")
        reader = _Reader(data, HEAD.size)
        columns = tuple(
            reader.column(column.cells, count * (width if column.is_wide else 1)) for column in kind.columns
        )
        if reader.place != size:
            raise FrameError(f"{size - reader.place} bytes behind the last column")
        return cls(kind=kind, channel=channel, columns=columns, from_ns=from_ns, to_ns=to_ns, of=of, width=width,
                   flags=FrameFlags(flags))  # fmt: skip


_ALL_FLAGS = (0, FrameFlags.REDUCED, FrameFlags.REPLACES, FrameFlags.REDUCED | FrameFlags.REPLACES)


def frames_in(data: bytes) -> Iterator[ViewFrame]:
    """Yield frames that stand one behind the other.

    Raises:
        FrameError: At one that is none.
    """
    for packed in packed_frames(data):
        yield packed.frame()


@dataclass(frozen=True, slots=True)
class PackedFrame:
    """A frame whose rows are read when they are asked for; what its head says is known."""

    data: memoryview
    kind_number: int
    channel: int
    from_ns: Nanos
    to_ns: Nanos

    def frame(self) -> ViewFrame:
        """Return it with its rows.

        Raises:
            FrameError: It is none.
        """
        return ViewFrame.from_bytes(bytes(self.data))


def packed_frames(data: "bytes | memoryview") -> Iterator[PackedFrame]:
    """Yield frames that stand one behind the other, without a look at their rows.

    Raises:
        FrameError: At one that has no whole head, or ends behind the data.
    """
    left = memoryview(data)
    while left:
        if len(left) < HEAD.size:
            raise FrameError(f"{len(left)} bytes, and a frame has {HEAD.size} at least")
        _, _, kind, _, _, channel, _, _, _, size, _, from_ns, to_ns = HEAD.unpack_from(left)
        if not HEAD.size <= size <= len(left):
            raise FrameError(f"{len(left)} bytes, and the head says {size}")
        yield PackedFrame(left[:size], kind, channel, from_ns, to_ns)
        left = left[size:]


def _packed(cells: CellType, values: ColumnValues) -> Iterator[bytes]:
    if isinstance(values, array):
        if values.typecode != _NUMBERS[cells][0]:
            raise FrameError(f"an array of {values.typecode!r} where {cells.value} is")
        yield _filled(_little(values))
        return
    places: dict[bytes, int] = {}
    runs = (value.encode("utf-8", "replace") if isinstance(value, str) else value for value in values)
    rows = array("I", [places.setdefault(run, len(places)) for run in runs])
    ends, end = array("I"), 0
    for one in places:
        end += len(one)
        ends.append(end)
    yield _U32.pack(len(places), end)
    yield _filled(_little(rows))
    yield _filled(_little(ends))
    yield _filled(b"".join(places))


def _filled(data: bytes) -> bytes:
    return data + bytes(-len(data) % _ALIGN)


def _little(values: "array[int] | array[float]") -> bytes:
    if sys.byteorder == "big":
        values = array(values.typecode, values)
        values.byteswap()
    return values.tobytes()


class _Reader:
    """Takes columns one behind the other."""

    def __init__(self, data: bytes, place: int) -> None:
        self._data, self.place = data, place

    def column(self, cells: CellType, count: int) -> ColumnValues:
        if cells in _NUMBERS:
            code, size = _NUMBERS[cells]
            return _array(code, self._bytes(count * size))
        distinct, size = _U32.unpack(self._bytes(_U32.size))
        rows, ends = _array("I", self._bytes(4 * count)), _array("I", self._bytes(4 * distinct))
        blob = self._bytes(size)
        if any(end < start for start, end in pairwise((0, *ends))) or (ends[-1] if ends else 0) != size:
            raise FrameError("texts that end before they begin")
        seen, places = 0, cast("array[int]", rows)
        for place in places:
            if place > seen or place >= distinct:
                raise FrameError("a row's text is not there")
            seen += place == seen
        if seen != distinct:
            raise FrameError("a text of no row")
        runs = [blob[start:end] for start, end in pairwise((0, *ends))]
        if len(set(runs)) != distinct:
            raise FrameError("a text that stands twice")
        if cells is CellType.BYTES:
            return [runs[place] for place in places]
        try:
            texts = [run.decode() for run in runs]
        except UnicodeDecodeError as error:
            raise FrameError("a text that is no UTF-8") from error
        return [texts[place] for place in places]

    def _bytes(self, count: int) -> bytes:
        end = self.place + count
        whole = end + -count % _ALIGN
        if whole > len(self._data) or any(self._data[end:whole]):
            raise FrameError("a column that is cut off")
        found = self._data[self.place : end]
        self.place = whole
        return found


def _array(code: str, data: bytes) -> "array[int] | array[float]":
    values: array[int] | array[float] = array(code)
    values.frombytes(data)
    if sys.byteorder == "big":
        values.byteswap()
    return values


def chosen_rows(
    columns: Sequence[ColumnValues], rows: Sequence[int], widths: Sequence[int]
) -> tuple[ColumnValues, ...]:
    """Return some rows of columns; `widths` has the cells a row of each."""
    return tuple(_chosen(values, rows, width) for values, width in zip(columns, widths, strict=True))


def _chosen(values: ColumnValues, rows: Sequence[int], width: int) -> ColumnValues:
    places = rows if width == 1 else [row * width + cell for row in rows for cell in range(width)]
    if isinstance(values, array):
        return array(values.typecode, [values[place] for place in places])
    return [values[place] for place in places]  # type: ignore[return-value]  # of the one or the other
