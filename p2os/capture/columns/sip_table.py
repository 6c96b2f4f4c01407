"""A conversation's SIPs as tables in SI units, with NumPy: many times as fast as `p2os.capture.table.tables_of_sips`.

Theory of operation. A robot's bytes are decoded a block at a time. A block is cut where the decoder of
`p2os.protocol.frames` holds nothing: at a place that no frame spans and that lies so far before the end of what has
come that everything that begins before it is decided. What follows the cut is looked at again with the next block.

Invariants: cell by cell what `tables_of_sips(sips_of(blocks, reading), reading)` yields; the
conversions are those of `p2os.capture.describe`, asked once for each raw value that occurs. No more than a block of
bytes and its table is held.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import cast

import numpy as np
import numpy.typing as npt

from p2os.capture.cells import Cell
from p2os.capture.chunks import LETTERS, ChunkBlock, Direction
from p2os.capture.columns.column import ArrayConversion, Column
from p2os.capture.columns.framing import LARGEST_FRAME, Bytes, Indexes, stalls_of
from p2os.capture.columns.table import Table as RawTable
from p2os.capture.columns.tables import Columns, decode
from p2os.capture.describe import RAW_OF, Memo, SipFields
from p2os.capture.reading import Reading
from p2os.capture.sip_columns import KIND_SAYS, LEADING
from p2os.capture.table import FIRST_ROWS, CaptureTable, uniform
from p2os.protocol.frames import CHECKSUM_BYTES, GIVE_UP_NS, PREFIX_BYTES
from p2os.protocol.sip import POSITION_MASK, SIP_KINDS, TAIL
from simbase.timing import NS_PER_S, Nanos

#: chosen: some ten thousand SIPs; larger ones take more memory and hardly less time.
BLOCK_BYTES = 1 << 19


def sip_tables(
    blocks: Iterable[ChunkBlock], reading: Reading, *, first_rows: int = FIRST_ROWS, block: int = BLOCK_BYTES
) -> Iterator[CaptureTable]:
    """Yield a robot's SIPs as tables in SI units.

    Args:
        blocks: In order of time; all of the robot's chunks have the same direction, or none has one.
        reading: How to read them.
        first_rows: How many rows decide which columns there are, and are in the first table.
        block: How many of the robot's bytes are decoded together; any number gives the same cells.
    """
    builder = _Builder(reading)
    return uniform(_first_alone((builder.table(*part) for part in _blocks(blocks, reading, block)), first_rows))


def _first_alone(tables: Iterator[CaptureTable], first_rows: int) -> Iterator[CaptureTable]:
    """Yield the same rows with exactly so many in the first table, if there are."""
    head: CaptureTable | None = None
    for table in tables:
        head = table if head is None else _joined(head, table)
        if head.rows >= first_rows:
            yield _cut(head, 0, first_rows)
            if head.rows > first_rows:
                yield _cut(head, first_rows, head.rows)
            yield from tables
            return
    if head is not None:
        yield head


def _joined(first: CaptureTable, second: CaptureTable) -> CaptureTable:
    none = [[None] * table.rows for table in (first, second)]
    parts = {
        name: (first.columns.get(name, none[0]), second.columns.get(name, none[1]))
        for name in {**first.columns, **second.columns}
    }
    return CaptureTable({name: Column.joined(*pair) for name, pair in parts.items()})


def _cut(table: CaptureTable, start: int, end: int) -> CaptureTable:
    columns = {name: column[start:end] for name, column in table.columns.items()}
    has = {
        name: name in LEADING or not isinstance(column, Column) or column.has_any() for name, column in columns.items()
    }
    return CaptureTable({name: column for name, column in columns.items() if has[name]})


class _Held:
    """What has come of the robot's bytes and is not decoded yet."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._data: list[bytes] = []
        #: Of each of the robot's chunks: when it came, and how many bytes of it are held.
        self._at_ns = np.zeros(0, np.int64)
        self._sizes = np.zeros(0, np.int64)
        #: When something of the client came first after the robot had been silent for so long that its decoder gives
        #: up what has begun.
        self._ticks = np.zeros(0, np.int64)
        self._last_ns: Nanos = 0
        self.size = 0

    def take(self, block: ChunkBlock) -> None:
        """Take a block of both sides."""
        at_ns, ends = np.frombuffer(block.at_ns, np.int64), np.frombuffer(block.ends, np.int64)
        sizes, data = np.diff(ends, prepend=0), block.data
        is_mine = np.frombuffer(block.senders, np.uint8) != LETTERS[Direction.TO_ROBOT][0]
        self._last_ns = int(at_ns[-1])
        others = np.zeros(0, np.int64)
        if not is_mine.all():
            data = np.frombuffer(data, np.uint8)[np.repeat(is_mine, sizes)].tobytes()
            others, at_ns, sizes = at_ns[~is_mine], at_ns[is_mine], sizes[is_mine]
        if data:
            self._data.append(data)
            self._at_ns = np.concatenate((self._at_ns, at_ns))
            self._sizes = np.concatenate((self._sizes, sizes))
            self.size += len(data)
        if len(self._at_ns):
            self._ticks = self._first_after_silence(np.concatenate((self._ticks, others)))

    def _first_after_silence(self, ticks: Indexes) -> Indexes:
        before = np.searchsorted(self._at_ns, ticks, side="right") - 1
        late = (before >= 0) & (ticks >= self._at_ns[before] + GIVE_UP_NS)
        ticks, before = ticks[late], before[late]
        first: Indexes = ticks[np.append(True, before[1:] != before[:-1])[: len(ticks)]]
        return first

    def decoded(self, *, is_last: bool) -> tuple[RawTable, int, Indexes] | None:
        """Return the SIPs of what is decided, how many of them, and when each was known; None where there is none."""
        if not self.size:
            return None
        data, times = np.frombuffer(b"".join(self._data), np.uint8), self._at_ns
        places = np.concatenate(([0], np.cumsum(self._sizes)))
        columns = decode(data, self._reading.profile, pauses=places[1:-1][np.diff(times) >= GIVE_UP_NS])
        stalls = stalls_of(columns.data, columns.starts, columns.ends, columns.pauses)
        # The decoder notices that a frame is given up when anything comes, of either side.
        ticks = np.sort(np.concatenate((times, self._ticks, [self._last_ns])))
        known = _known(times, places, ticks, columns, stalls)
        cut = len(data) if is_last else _cut_place(columns, stalls)
        self._drop(data, places, cut)
        raw = columns.tables.get("sip")
        if raw is None:
            return None
        count = int(np.searchsorted(columns.starts[raw.packets], cut))
        return (raw, count, known[raw.packets]) if count else None

    def _drop(self, data: Bytes, places: Indexes, place: int) -> None:
        rest = data[place:].tobytes()
        self._data, self.size = ([rest] if rest else []), len(rest)
        number = int(np.searchsorted(places, place, side="right")) - 1
        self._at_ns, self._sizes = self._at_ns[number:], np.diff(np.maximum(places[number:], place))
        if len(self._at_ns):
            self._ticks = self._ticks[self._ticks >= self._at_ns[0]]


def _blocks(blocks: Iterable[ChunkBlock], reading: Reading, size: int) -> Iterator[tuple[RawTable, int, Indexes]]:
    held, least = _Held(reading), 0
    for block in blocks:
        held.take(block)
        if held.size >= max(size, least):
            found = held.decoded(is_last=False)
            # What is not decided yet must not be looked at again with each block.
            least = 2 * held.size
            if found is not None:
                yield found
    found = held.decoded(is_last=True)
    if found is not None:
        yield found


def _cut_place(columns: Columns, stalls: tuple[Indexes, Indexes]) -> int:
    """Return a place where the decoder holds nothing, whatever comes."""
    place = len(columns.data) - LARGEST_FRAME
    if place <= 0:
        return 0
    before = int(np.searchsorted(columns.starts, place + PREFIX_BYTES)) - 1
    if before >= 0:
        place = max(place, int(columns.ends[before]) + CHECKSUM_BYTES)
    # Frames behind a stall are known only when it is given up: they stay together.
    starts, limits = stalls
    hidden = (starts < place) & (place < limits)
    if hidden.any():
        place = int(starts[limits == limits[hidden][0]].min())
    return place


def _known(
    times: Indexes, places: Indexes, ticks: Indexes, columns: Columns, found: tuple[Indexes, Indexes]
) -> Indexes:
    """Return when each packet was known: at its last byte, or when what had hidden it was given up."""
    # The checksum's second byte is the last.
    last = columns.ends + 1
    known: Indexes = times[np.searchsorted(places, last, side="right") - 1]
    stalls, limits = found
    # From a segment's first stall on, all that follows in it was known only when the decoder gave up.
    for limit in np.unique(limits).tolist():
        hidden = (last >= stalls[limits == limit].min()) & (last < limit)
        silent = times[np.searchsorted(places, limit) - 1] + GIVE_UP_NS
        noticed = np.searchsorted(ticks, silent)
        known[hidden] = ticks[noticed] if noticed < len(ticks) else ticks[-1]
    return known


class _Builder:
    """Turns raw SIPs into columns, block by block."""

    def __init__(self, reading: Reading) -> None:
        self._metres = reading.parameters.distance_conv_mm / 1000
        memos = cast("dict[str, Memo[Cell]]", SipFields(reading.profile, reading.parameters).memos)
        self._names = list(memos)
        self._fields = {name: ArrayConversion(memo.__getitem__, type(memo[0])) for name, memo in memos.items()}
        kind = SIP_KINDS[0]
        self._names_of = {name: ArrayConversion(convert, type(convert(kind))) for name, convert in KIND_SAYS.items()}
        self._range = self._fields["sonar_m"]
        self._tail = {name: ArrayConversion(int, int) for name, _, _ in TAIL}
        #: Counts and raw value of the last SIP, by coordinate.
        self._last: dict[str, tuple[int, int]] = {}

    def table(self, raw: RawTable, rows: int, times: Indexes) -> CaptureTable:
        """Return the first rows of a block, columns in the order in which the rows first have them."""
        kinds = raw["kind"][:rows]
        leading = [conversion.column(kinds) for conversion in self._names_of.values()]
        found: dict[tuple[float, float], tuple[str, Column]] = {}
        for place, name in enumerate(self._names):
            if name == "sonar_m":
                found |= self._sonar(raw, rows, place)
            elif name in {"x_m", "y_m"}:
                found[0, place] = name, self._followed(f"raw_{name[0]}", raw, rows)
            else:
                found[0, place] = name, self._fields[name].column(raw[RAW_OF[name]][:rows])
        counts = raw["tail_count"][:rows]
        for number, (name, width, _) in enumerate(TAIL[: int(counts.max(initial=0))]):
            has = counts > number
            column, present = raw[name][:rows], None if has.all() else has
            cells = self._tail[name].column(column, present) if width < 4 else Column(column.astype(np.int64), present)
            found[float(np.argmax(has)), len(self._names) + number] = name.removeprefix("raw_"), cells
        rest = raw.texts["rest"]
        has = (rest.ends > rest.starts)[:rows]
        if has.any():
            texts = np.array([data.hex(" ") for data in raw.bytes_of("rest")[:rows]], object)
            found[float(np.argmax(has)), len(self._names) + len(TAIL)] = "rest", Column(texts, has)
        columns: dict[str, Sequence[Cell]] = dict(
            zip(LEADING, (Column(times[:rows] / NS_PER_S), *leading), strict=True)
        )
        return CaptureTable({**columns, **dict(found[order] for order in sorted(found))})

    def _followed(self, name: str, raw: RawTable, rows: int) -> Column:
        """Return a coordinate followed over the wraps of its counter, metres; the first within half a span of 0."""
        values = raw[name][:rows].astype(np.int64) & POSITION_MASK
        half, modulus = (POSITION_MASK + 1) // 2, POSITION_MASK + 1
        first = int(values[0])
        count, before = self._last.get(name, (first if first <= POSITION_MASK // 2 else first - modulus, first))
        totals = count + np.cumsum((np.diff(values, prepend=before) + half) % modulus - half)
        self._last[name] = int(totals[-1]), int(values[-1])
        return Column(_rounded(totals * self._metres))

    def _sonar(self, raw: RawTable, rows: int, place: int) -> dict[tuple[float, float], tuple[str, Column]]:
        ragged = raw.ragged["sonar"]
        items = int(ragged.offsets[rows])
        if not items:
            return {}
        numbers, row_of = ragged.columns["number"][:items], ragged.rows[:items]
        codes = self._range.codes(ragged.columns["raw_range"][:items])
        # A row of places each, for the numbers that occur.
        those = np.flatnonzero(np.bincount(numbers))
        place_of = np.zeros(256, np.int64)
        place_of[those] = np.arange(len(those)) * rows
        present, cells = np.zeros(len(those) * rows, np.bool_), np.zeros(len(those) * rows, np.uint16)
        places = place_of[numbers] + row_of
        # Of two readings of one row the later counts.
        present[places], cells[places] = True, codes
        firsts = np.zeros(256, np.int64)
        firsts[numbers[::-1]] = np.arange(items)[::-1]
        found = {}
        for which, number in enumerate(those.tolist()):
            mine = slice(which * rows, (which + 1) * rows)
            first = int(firsts[number])
            row = int(row_of[first])
            behind = first - int(ragged.offsets[row])
            column = Column(cells[mine], present[mine], self._range)
            found[float(row), place + behind / 256] = f"sonar_m_{number}", column
        return found


def _rounded(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return values rounded to six decimals as `round` does it."""
    millionths = values * 1e6
    whole = np.rint(millionths)
    rounded: npt.NDArray[np.float64] = whole / 1e6
    # The product is inexact: what lies near the middle between two is left to `round`.
    for place in np.flatnonzero(np.abs(np.abs(millionths - whole) - 0.5) < 1e-3).tolist():
        rounded[place] = round(float(values[place]), 6)
    return rounded + 0.0
