"""Levels of detail: which rows of a channel show a stretch of time on so many pixels.

Of what a wire or a state does, a pixel has the first two changes and the last one, found by bisection: that costs the
same for any number of rows. Of numbers it has the first, the last, the least and the greatest, found by an index of
least and greatest rows in runs of 64, of 4096 and so on. Of lists it has what is most severe.

Invariant: what is shown is a row of the recording, and both ends of the stretch are among the rows.
"""

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from typing import cast

from p2os.view.frames import ColumnValues
from simbase.timing import Nanos

#: chosen: runs of rows of which the index has least and greatest.
RUN = 64
#: chosen: more rows than pixels by so many are thinned.
ROWS_A_PIXEL = 4


class Extremes:
    """The rows with the least and the greatest value, of any stretch of a growing column of numbers."""

    def __init__(self) -> None:
        self._values: Sequence[float] = ()
        #: Of runs of 64 rows, of 64 such runs, …: the least and the greatest row of each whole one.
        self._levels: list[tuple[array[int], array[int]]] = []

    def grow(self, values: Sequence[float]) -> None:
        """Take the column as it is now: what it had before stands at its beginning."""
        self._values = values
        rows, level = len(values), 0
        while rows >= RUN:
            if level == len(self._levels):
                self._levels.append((array("q"), array("q")))
            least, greatest = self._levels[level]
            for run in range(len(least), rows // RUN):
                lows, highs = self._at(level)
                first, last = run * RUN, (run + 1) * RUN
                if level:
                    least.append(min(lows[first:last], key=values.__getitem__))
                    greatest.append(max(highs[first:last], key=values.__getitem__))
                else:
                    piece = values[first:last]
                    least.append(values.index(min(piece), first))
                    greatest.append(values.index(max(piece), first))
            rows, level = rows // RUN, level + 1

    def within(self, first: int, last: int) -> tuple[int, int]:
        """Return the rows with the least and the greatest value from `first` to before `last`, of one row at least."""
        if last - first <= RUN:  # most pixels of most runs
            piece, find = self._values[first:last], self._values.index
            return find(min(piece), first), find(max(piece), first)
        least, greatest = list[int](), list[int]()
        level = 0
        while True:
            run_first, run_last = -(-first // RUN), last // RUN
            if level == len(self._levels) or run_last <= run_first:
                self._take(level, first, last, least, greatest)
                break
            self._take(level, first, run_first * RUN, least, greatest)
            self._take(level, run_last * RUN, last, least, greatest)
            first, last, level = run_first, run_last, level + 1
        value = self._values.__getitem__
        return min(least, key=value), max(greatest, key=value)

    def _take(self, level: int, first: int, last: int, least: list[int], greatest: list[int]) -> None:
        """Add the rows of a level that have the least and the greatest value among some of it."""
        if first < last:
            value = self._values.__getitem__
            lows, highs = self._at(level)
            least.append(min(lows[first:last], key=value))
            greatest.append(max(highs[first:last], key=value))

    def _at(self, level: int) -> tuple[Sequence[int], Sequence[int]]:
        """Return the candidates of a level: all rows, or of each run the least and the greatest."""
        if level == 0:
            rows = range(len(self._values))
            return rows, rows
        return self._levels[level - 1]


def buckets(times: Sequence[int], first: int, last: int, pixels: int) -> Iterator[tuple[int, int]]:
    """Yield the first row of each pixel, and that behind its last; pixels without rows are none."""
    if first >= last:
        return
    begin, span = times[first], times[last - 1] - times[first] + 1
    row = first
    while row < last:
        pixel = (times[row] - begin) * pixels // span
        # The least time of the next pixel.
        behind = begin - (-(pixel + 1) * span // pixels)
        end = bisect_left(times, behind, lo=row + 1, hi=last)
        yield row, end
        row = end


def changes(times: Sequence[int], first: int, last: int, pixels: int) -> Iterator[tuple[int, int]]:
    """Yield (row, how many rows it stands for): of each pixel the first two and the last."""
    for row, end in buckets(times, first, last, pixels):
        if end - row <= 3:
            yield from ((each, 1) for each in range(row, end))
        else:
            yield from ((row, 1), (row + 1, end - row - 2), (end - 1, 1))


def curve(times: Sequence[int], indices: Sequence[Extremes], first: int, last: int, pixels: int) -> list[int]:
    """Return rows: of each pixel the first and the last, and the least and the greatest by each index."""
    rows: list[int] = []
    for row, end in buckets(times, first, last, pixels):
        if end - row <= 2:
            rows += range(row, end)
            continue
        chosen = {row, end - 1}
        for index in indices:
            chosen.update(index.within(row, end))
        rows += sorted(chosen)
    return rows


def curve_of(times: Sequence[int], columns: Sequence[Sequence[float]], pixels: int) -> Sequence[int]:
    """Return the rows that so many pixels show of whole columns: all where that is four a pixel at most."""
    if len(times) <= ROWS_A_PIXEL * pixels:
        return range(len(times))
    indices = []
    for column in columns:
        indices.append(Extremes())
        indices[-1].grow(column)
    return curve(times, indices, 0, len(times), pixels)


def thinned_list(severity: Callable[[int], int], first: int, last: int, most: int) -> list[int]:
    """Return at most so many rows: the most severe, of the others those spread evenly, and both ends."""
    if last - first <= most:
        return list(range(first, last))
    by_severity: dict[int, list[int]] = {}
    for row in range(first + 1, last - 1):
        by_severity.setdefault(severity(row), []).append(row)
    chosen = {first, last - 1}
    for _, rows in sorted(by_severity.items(), reverse=True):
        room = most - len(chosen)
        if room <= 0:
            break
        chosen.update(rows if len(rows) <= room else (rows[place * len(rows) // room] for place in range(room)))
    return sorted(chosen)


def nearest(values: ColumnValues, width: int) -> "array[float]":
    """Return the least number of each row of a wide column, NaN aside; infinite where there is none."""
    far = float("inf")
    cells = [cell if cell == cell else far for cell in cast("array[float]", values)]  # noqa: PLR0124 - no NaN
    if width <= 1:
        return array("d", cells)
    return array("d", map(min, *(cells[place::width] for place in range(width))))


def rows_in(times: Sequence[int], from_ns: Nanos, to_ns: Nanos) -> tuple[int, int]:
    """Return the first row of a stretch, which is in force at its beginning, and the second behind its end."""
    first = bisect_left(times, from_ns)
    if first and (first == len(times) or times[first] > from_ns):
        first -= 1
    return first, min(bisect_left(times, to_ns + 1, lo=first) + 1, len(times))
