"""A recording: the header of a page, and the rows of its channels, growing while it is live.

Invariant: within a channel time never runs back.
"""

import math
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

from p2os.view.channels import BY_NAME, WHOLE_PIXELS, CellType, ChannelKind
from p2os.view.detail import ROWS_A_PIXEL, Extremes, changes, curve, nearest, rows_in, thinned_list
from p2os.view.frames import (
    NO_FLAGS,
    ColumnValues,
    FrameFlags,
    LaterText,
    LaterTexts,
    PackedFrame,
    ViewFrame,
    chosen_rows,
    empty_columns,
)
from p2os.view.header import ChannelHeader, PageHeader
from simbase.timing import Nanos

#: One cell of a row, or those of a wide column.
Cell = int | float | str | LaterText | bytes | Sequence[float]
#: chosen: rows of a list that are sent at once; a screen shows some fifty.
LISTED_ROWS = 500
#: By which columns the least and greatest of a pixel are chosen.
_CURVES: Mapping[str, tuple[str, ...]] = {"samples": ("value",), "pose": ("x_m", "y_m"), "ranges": ("range_m",)}
#: What makes a row of a list more severe.
_SEVERITY: Mapping[str, str] = {"events": "severity", "packets": "is_bad", "text": ""}


class ChannelTrack:
    """The rows of one channel.

    Args:
        header: What they are of.
    """

    def __init__(self, header: ChannelHeader) -> None:
        self.header = header
        self.kind: ChannelKind = BY_NAME[header.kind]
        #: Adds the rows when somebody is to see them; None: they are there.
        self.later: Callable[[], None] | None = None
        #: Rows of the whole time on `WHOLE_PIXELS`, as they were packed before; None: they are when asked for.
        self.packed_whole: PackedFrame | None = None
        #: Counts how often its rows were made anew: who has sent some sends all again.
        self.generation = 0
        self._take(empty_columns(self.kind))
        self._widths = [header.width if column.is_wide else 1 for column in self.kind.columns]
        #: Of columns that curves are thinned by: their extremes, and their numbers without NaN.
        self._indices: dict[str, tuple[Extremes, array[float]]] = {}

    def __len__(self) -> int:
        return len(self.times)

    @property
    def columns(self) -> list[ColumnValues]:
        """Its columns, as its kind has them."""
        self._fill()
        return self._columns

    @property
    def times(self) -> "array[int]":
        """The times of its rows, ns."""
        self._fill()
        return self._times

    def _fill(self) -> None:
        """Add the rows that wait to be seen."""
        if self.later is not None:
            later, self.later = self.later, None
            later()

    def _take(self, columns: list[ColumnValues]) -> None:
        self._columns, self._times = columns, cast("array[int]", columns[0])
        self._adders: list[Callable[[Any], None]] = []

    def _find_adders(self) -> list[Callable[[Any], None]]:
        """Return what adds a cell to each column but the first: of the column's type, as the caller has it."""
        self._adders = [
            cast("array[float]", values).extend if column.is_wide else cast("list[str]", values).append
            for values, column in zip(self._columns[1:], self.kind.columns[1:], strict=True)
        ]
        return self._adders

    def append(self, t_ns: Nanos, *cells: Cell) -> None:
        """Add a row; a time that steps back is moved up."""
        times = self._times
        times.append(times[-1] if times and times[-1] > t_ns else t_ns)
        for add, cell in zip(self._adders or self._find_adders(), cells, strict=True):
            add(cell)

    def replace_rows(self, first: int, last: int, columns: Sequence[ColumnValues]) -> None:
        """Put other rows where those from one to before another are; none but the kinds of plain columns."""
        for values, new in zip(self.columns, columns, strict=True):
            values[first:last] = new  # type: ignore[assignment,index]  # of one type, as its kind has it
        self.generation += 1
        self._indices.clear()

    def extend_levels(self, times: Iterable[int], levels: Iterable[int]) -> None:
        """Add rows of a wire at once, in the order of time."""
        _, found, edges = cast("tuple[array[int], array[int], array[int]]", self.columns)
        before = len(self.times)
        self.times.extend(times)
        found.extend(levels)
        edges.extend([1] * (len(self.times) - before))

    def take_rows(self, other: "ChannelTrack", count: int) -> None:
        """Take the first rows of a channel of the same kind, before any of its own."""
        self._take(list(other.rows(0, count)))

    def take_columns(self, columns: Iterable[ColumnValues]) -> None:
        """Take rows as a frame has them, before any of its own."""
        self._take([values if isinstance(values, (array, LaterTexts)) else list(values) for values in columns])  # type: ignore[misc]  # of one type, as its kind has it

    def column(self, name: str) -> ColumnValues:
        """Return a column by its name."""
        return self.columns[[column.name for column in self.kind.columns].index(name)]

    def frame(
        self, from_ns: Nanos, to_ns: Nanos, pixels: int, *, listed: int = LISTED_ROWS, flags: FrameFlags = NO_FLAGS
    ) -> ViewFrame:
        """Return the rows of a stretch of time, with those just outside it.

        Args:
            from_ns: Its beginning.
            to_ns: Its end.
            pixels: As many rows as these show, where it is drawn.
            listed: At most so many, where it is a list.
            flags: Of the frame.
        """
        first, last = rows_in(self.times, from_ns, to_ns)
        if last - first <= ROWS_A_PIXEL * pixels and self.kind.name not in _SEVERITY:
            return self._frame(self.rows(first, last), from_ns, to_ns, last - first, flags)
        return self._frame(self._thinned(first, last, pixels, listed), from_ns, to_ns, last - first, flags)

    def packed(self, from_ns: Nanos, to_ns: Nanos, pixels: int) -> bytes | memoryview:
        """Return a frame's bytes, as of `frame`: of the whole time those that were packed before, where there are."""
        whole = self.packed_whole
        if whole is not None and (from_ns, to_ns, pixels) == (whole.from_ns, whole.to_ns, WHOLE_PIXELS):
            return whole.data
        return self.frame(from_ns, to_ns, pixels).to_bytes()

    def tail(self, first: int, last: int) -> ViewFrame:
        """Return the rows from one to before another, all of them."""
        times = self.times
        return self._frame(self.rows(first, last), times[first], times[last - 1], last - first, NO_FLAGS)

    def _frame(
        self, columns: tuple[ColumnValues, ...], from_ns: Nanos, to_ns: Nanos, of: int, flags: FrameFlags
    ) -> ViewFrame:  # fmt: skip
        if len(columns[0]) < of:
            flags |= FrameFlags.REDUCED
        columns = tuple(
            list(map(str, values)) if column.cells is CellType.TEXT else values
            for column, values in zip(self.kind.columns, columns, strict=True)
        )
        return ViewFrame(kind=self.kind, channel=self.header.id, columns=columns, from_ns=from_ns, to_ns=to_ns, of=of,
                         width=self.header.width if any(one.is_wide for one in self.kind.columns) else 1,
                         flags=flags)  # fmt: skip

    def rows(self, first: int, last: int) -> tuple[ColumnValues, ...]:
        """Return the columns of some rows, copied."""
        return tuple(
            values[first * width : last * width] for values, width in zip(self.columns, self._widths, strict=True)
        )

    def _thinned(self, first: int, last: int, pixels: int, most: int) -> tuple[ColumnValues, ...]:
        name = self.kind.name
        if name in _CURVES:
            return self._chosen(curve(self.times, self._grown(_CURVES[name]), first, last, pixels))
        if name in _SEVERITY:
            column = _SEVERITY[name]
            severity = cast("array[int]", self.column(column)).__getitem__ if column else lambda _row: 0
            return self._chosen(thinned_list(severity, first, last, most))
        shown = list(changes(self.times, first, last, pixels))
        columns = self._chosen([row for row, _ in shown])
        if name == "levels":
            return (*columns[:2], array("I", [count for _, count in shown]))
        return columns

    def _chosen(self, rows: Sequence[int]) -> tuple[ColumnValues, ...]:
        return chosen_rows(self.columns, rows, self._widths)

    def _grown(self, names: Iterable[str]) -> list[Extremes]:
        """Return the indices of some columns, brought up to their last row."""
        found = []
        for name in names:
            values = cast("array[float]", self.column(name))
            column = next(one for one in self.kind.columns if one.name == name)
            width = self.header.width if column.is_wide else 1
            index, plain = self._indices.setdefault(name, (Extremes(), array("d")))
            new = values[len(plain) * width :]
            _extend_plain(plain, nearest(new, width) if column.is_wide else new)
            index.grow(plain)
            found.append(index)
        return found


def _extend_plain(plain: "array[float]", values: "array[float]") -> None:
    """Add numbers to others; NaN is the number before it, or the first one."""
    if not math.isnan(sum(values)):  # else there is NaN, or infinity of both signs
        plain.fromlist(values.tolist())
        return
    last = plain[-1] if plain else next((value for value in values if value == value), 0.0)  # noqa: PLR0124 - no NaN
    for value in values:
        last = value if value == value else last  # noqa: PLR0124 - it is no NaN
        plain.append(last)


@dataclass(slots=True)
class ViewRecording:
    """All that a page shows.

    Args:
        header: Without its channels, which are those of the tracks.
    """

    header: PageHeader
    tracks: list[ChannelTrack] = field(default_factory=list)
    #: Sources whose channels are shown no more.
    dropped: set[str] = field(default_factory=set)

    def add(self, header: ChannelHeader) -> ChannelTrack:
        """Add a channel, without rows yet; its `id` is given here."""
        made = ChannelTrack(replace(header, id=len(self.tracks)))
        self.tracks.append(made)
        return made

    def copied(self, track: ChannelTrack, source: str, until_ns: Nanos, of: int) -> ChannelTrack:
        """Add a channel that has the rows of another one up to a time, from another source, belonging to a channel."""
        made = self.add(replace(track.header, source=source, of=of))
        made.take_rows(track, bisect_right(track.times, until_ns))
        return made

    def shared(self, header: ChannelHeader) -> ChannelTrack:
        """Return the channel of this name and kind, whoever has added it."""
        alike = [one for one in self.tracks if (one.header.name, one.kind.name) == (header.name, header.kind)]
        return alike[0] if alike else self.add(header)

    @property
    def full_header(self) -> PageHeader:
        """The header with its channels."""
        shown = [track.header for track in self.tracks if track.header.source not in self.dropped]
        return replace(self.header, channels=shown)

    def frames(self, pixels: int, listed: int) -> Iterator[ViewFrame]:
        """Yield one frame a channel, of the whole time, as of `ChannelTrack.frame`."""
        start, end = self.header.start_ns, self.header.end_ns
        for track in self.tracks:
            yield track.frame(start, end, pixels, listed=listed, flags=FrameFlags.REPLACES)


#: What makes a recording of a file or folder; None where it is of another kind.
RecordingOf = Callable[[str], ViewRecording | None]
