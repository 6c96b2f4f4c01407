"""A capture as columns of plain values, for CSV and Arrow.

One row a packet. Nested fields become columns of their own (`sonar_m_3`), lists
become JSON text. Positions are followed over the packets, so that they do not
jump where the robot's 15-bit counters wrap.
"""

import csv
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import IO, TypeAlias

from p2os.capture.chunks import Direction
from p2os.capture.describe import Plain
from p2os.capture.listing import ListingRow
from p2os.protocol.odometry import Unwrapper
from p2os.protocol.sip import POSITION_MASK
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_S

Cell: TypeAlias = "bool | int | float | str | None"
#: Columns that every table begins with.
LEADING = ("t_s", "dir", "type", "name", "valid")
#: Where XPOS and YPOS stand in a SIP's frame, header included.
_X_AT, _Y_AT = 4, 6


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of equal length, by name; None where a packet has no such field."""

    columns: Mapping[str, list[Cell]]

    @property
    def rows(self) -> int:
        """How many packets it holds."""
        return len(self.columns["t_s"])


def table_of(rows: Iterable[ListingRow], parameters: RobotParameters) -> Table:
    """Return rows as a table.

    Args:
        rows: What is to stand in it, in order of time.
        parameters: The robot's units, for positions over several packets.
    """
    places = (_Place(parameters, _X_AT), _Place(parameters, _Y_AT))
    columns: dict[str, list[Cell]] = {name: [] for name in LEADING}
    for count, row in enumerate(rows):
        cells = dict(_flat(row.fields))
        if "x_m" in cells:
            cells["x_m"], cells["y_m"] = (place.follow(row) for place in places)
        who = None if row.direction is None else row.direction.value
        leading = (row.at_ns / NS_PER_S, who, row.kind, row.name, row.valid)
        for name, cell in {**dict(zip(LEADING, leading, strict=True)), **cells}.items():
            if name not in columns:
                columns[name] = [None] * count
            columns[name].append(cell)
        for column in columns.values():
            if len(column) == count:
                column.append(None)
    return Table(columns)


def write_csv(table: Table, file: IO[str]) -> None:
    """Write a table as CSV with a line of names; empty cells are None."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(zip(*table.columns.values(), strict=True))


def _flat(fields: Mapping[str, Plain], before: str = "") -> Iterator[tuple[str, Cell]]:
    for name, value in fields.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}_")
        elif isinstance(value, list):
            yield f"{before}{name}", json.dumps(value)
        else:
            yield f"{before}{name}", value


class _Place:
    """One coordinate of a robot's SIPs, followed over the wraps of its counter."""

    def __init__(self, parameters: RobotParameters, offset: int) -> None:
        self._metres = parameters.distance_conv_mm / 1000
        self._offset = offset
        self._counter = Unwrapper(POSITION_MASK + 1)
        self._first: int | None = None

    def follow(self, row: ListingRow) -> float:
        """Return the coordinate in metres; the first one lies within half a span of 0."""
        raw = int.from_bytes(row.data[self._offset : self._offset + 2], "little") & POSITION_MASK
        if self._first is None:
            self._first = raw if raw <= POSITION_MASK // 2 else raw - POSITION_MASK - 1
        self._counter.update(raw)
        return round((self._first + self._counter.total) * self._metres, 6)


def from_robot(rows: Iterable[ListingRow]) -> Iterator[ListingRow]:
    """Yield the rows of a robot's standard SIPs."""
    for row in rows:
        if row.direction is not Direction.TO_ROBOT and "x_m" in row.fields:
            yield row
