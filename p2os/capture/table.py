"""A capture as columns of plain values, for CSV and Arrow: a table after the other, so that any length is written.

One row a packet. Nested fields become columns of their own (`sonar_m_3`), lists
become JSON text. Positions are followed over the packets, so that they do not
jump where the robot's 15-bit counters wrap.

Which columns there are is known from the first `FIRST_ROWS` packets. A cell that comes later
and has no column there, or is of another kind (a text among numbers), stands as JSON in one more, `more`.

Invariant: all tables of a capture have the same columns in the same order, and no more than one is held.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain, islice, pairwise, repeat
from typing import IO, Protocol, runtime_checkable

from p2os.capture.cells import Alike, Cell, quoted, texts_of
from p2os.capture.describe import RAW_OF, Plain
from p2os.capture.listing import ListingRow
from p2os.capture.reading import Reading
from p2os.capture.sip_columns import LEADING, SipColumns
from p2os.capture.sips import Sips, in_groups
from p2os.protocol.sip import POSITION_MASK, unpack_heads
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_S

#: Cells whose column the beginning did not have.
MORE = "more"
#: chosen: seven minutes of SIPs; a table of them takes some MB.
FIRST_ROWS = 4096
#: Where XPOS and YPOS stand in a SIP's frame, header included.
_X_AT, _Y_AT = 4, 6


@runtime_checkable
class TextColumn(Protocol):
    """A column that has its texts ready."""

    def texts(self) -> Sequence[str] | Alike:
        """Return each cell as it stands in CSV."""
        ...


@dataclass(frozen=True, slots=True)
class CaptureTable:
    """Columns of equal length, by name; None where a packet has no such field."""

    columns: Mapping[str, Sequence[Cell]]

    @property
    def rows(self) -> int:
        """How many packets it holds."""
        return len(self.columns["t_s"])


def tables_of(rows: Iterable[ListingRow], reading: Reading, first_rows: int = FIRST_ROWS) -> Iterator[CaptureTable]:
    """Yield rows as tables, each of `first_rows` rows, the last of fewer.

    Args:
        rows: What is to stand in them, in order of time.
        reading: How to read them, and the robot's units, for positions over several packets.
        first_rows: How many rows decide which columns there are.
    """
    tables = _Tables(reading)
    every = iter(rows)
    yield from uniform(tables.table(block) for block in iter(lambda: list(islice(every, first_rows)), []))


def tables_of_sips(sips: Iterable[Sips], reading: Reading, first_rows: int = FIRST_ROWS) -> Iterator[CaptureTable]:
    """Yield a robot's SIPs as tables, as `tables_of` does rows."""
    yield from uniform(map(_Tables(reading).sip_table, in_groups(sips, first_rows)))


def table_of(rows: Iterable[ListingRow], reading: Reading) -> CaptureTable:
    """Return rows as one table, as `tables_of` with room for all."""
    return _Tables(reading).table(list(rows))


def uniform(tables: Iterable[CaptureTable]) -> Iterator[CaptureTable]:
    """Yield tables with the columns of the first; what other columns hold goes to `MORE` if a second one comes."""
    every = iter(tables)
    head = next(every, None)
    if head is None:
        return
    second = next(every, None)
    if second is None:
        yield head
        return
    kinds = {name: _kinds(column) for name, column in head.columns.items()}
    for table in chain((head, second), every):
        columns: dict[str, Sequence[Cell]] = {}
        more: dict[int, dict[str, Cell]] = {}
        for name, column in table.columns.items():
            known = kinds.get(name, set())
            if known and (isinstance(column, TextColumn) or len(known) > 1 or _kinds(column) <= known):
                columns[name] = column
            else:
                kept = list(column)
                for row, cell in enumerate(kept):
                    if cell is not None and type(cell) not in known:
                        more.setdefault(row, {})[name] = cell
                        kept[row] = None
                columns[name] = kept
        none: list[Cell] = [None] * table.rows
        texts = none
        if more:
            texts = [json.dumps(more[row], sort_keys=True) if row in more else None for row in range(table.rows)]
        yield CaptureTable({**{name: columns.get(name, none) for name in kinds}, MORE: texts})


def write_csv(tables: Iterable[CaptureTable], file: IO[str]) -> int:
    """Write tables as CSV with one line of names, each as it comes; empty cells are None.

    Returns:
        How many rows were written.
    """
    count = 0
    for table in tables:
        if not count:
            file.write(",".join(map(quoted, table.columns)) + "\n")
        file.write("\n".join(map(",".join, zip(*_texts(table), strict=True))) + "\n")
        file.flush()
        count += table.rows
    return count


def _texts(table: CaptureTable) -> Iterator[Iterable[str]]:
    """Yield what stands in each column, such as are alike and stand together as one."""
    columns = (
        column.texts() if isinstance(column, TextColumn) else texts_of(column) for column in table.columns.values()
    )
    alike: list[str] = []
    for texts in columns:
        if isinstance(texts, Alike):
            alike.append(texts.text)
            continue
        if alike:
            yield repeat(",".join(alike), table.rows)
            alike = []
        yield texts
    if alike:
        yield repeat(",".join(alike), table.rows)


def _kinds(column: Sequence[Cell]) -> set[type]:
    return set(map(type, column)) - {type(None)}


class _Tables:
    """Makes tables of rows, one behind the other."""

    def __init__(self, reading: Reading) -> None:
        self._sips = SipColumns(reading.profile, reading.parameters)
        self._x, self._y = (_Place(reading.parameters, name) for name in ("x_m", "y_m"))

    def table(self, rows: list[ListingRow]) -> CaptureTable:
        """Return the next rows as a table."""
        sips = Sips()
        sips.add(rows)
        if len(sips) == len(rows):
            return self.sip_table(sips)
        leading = (
            [row.at_ns / NS_PER_S for row in rows],
            [None if row.direction is None else row.direction.value for row in rows],
            [row.kind for row in rows],
            [row.name for row in rows],
            [row.valid for row in rows],
        )
        columns: dict[str, Sequence[Cell]] = dict(zip(LEADING, leading, strict=True))
        columns |= _described(rows)
        if "x_m" in columns:
            has = [cell is not None for cell in columns["x_m"]]
            for place, at in ((self._x, _X_AT), (self._y, _Y_AT)):
                raw = [row.data[at] | row.data[at + 1] << 8 if there else None
                       for row, there in zip(rows, has, strict=True)]  # fmt: skip
                columns[place.name] = place.follow(raw)
        return CaptureTable(columns)

    def sip_table(self, sips: Sips) -> CaptureTable:
        """Return the next SIPs as a table."""
        heads = unpack_heads(sips.payloads)
        columns = self._sips.of(sips.payloads, heads)
        for place in (self._x, self._y):
            columns[place.name] = place.follow(heads.columns[RAW_OF[place.name]])
        times: list[Cell] = [at_ns / NS_PER_S for at_ns in sips.at_ns]
        return CaptureTable({LEADING[0]: times, **columns})


def _described(rows: list[ListingRow]) -> dict[str, Sequence[Cell]]:
    found: list[dict[str, Cell]] = []
    names: dict[str, None] = {}
    for row in rows:
        cells: dict[str, Cell] = {}
        _flatten(row.fields, cells)
        names.update(dict.fromkeys(cells))
        found.append(cells)
    return {name: [cells.get(name) for cells in found] for name in names}


def _flatten(fields: Mapping[str, Plain], cells: dict[str, Cell], before: str = "") -> None:
    for name, value in fields.items():
        if isinstance(value, dict):
            _flatten(value, cells, f"{before}{name}_")
        elif isinstance(value, list):
            cells[before + name] = json.dumps(value)
        else:
            cells[before + name] = value


class _Place:
    """One coordinate of a robot's SIPs, followed over the wraps of its counter."""

    def __init__(self, parameters: RobotParameters, name: str) -> None:
        self._metres = parameters.distance_conv_mm / 1000
        self.name = name
        self._counts = 0
        self._last = 0

    def follow(self, raw: Sequence[int | None]) -> list[Cell]:
        """Return the coordinate in metres where there is one; the first one lies within half a span of 0."""
        metres, half = self._metres, (POSITION_MASK + 1) // 2
        values = [self._last, *(value & POSITION_MASK for value in raw if value is not None)]
        # The nearer way round; also from 0 to the first.
        steps = [(after - before + half & POSITION_MASK) - half for before, after in pairwise(values)]
        counts = list(accumulate(steps, initial=self._counts))
        self._counts, self._last = counts[-1], values[-1]
        found: list[Cell] = [round(count * metres, 6) for count in counts[1:]]
        if len(found) == len(raw):
            return found
        every = iter(found)
        return [None if value is None else next(every) for value in raw]
