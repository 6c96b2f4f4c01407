"""A recorded conversation's SIPs as a table in SI units, by columns: the fast way of `p2os.capture.table.table_of`.

Invariant: cell by cell what `table_of(from_robot(rows_of(capture, reading)), reading.parameters)` returns. The
conversions are those of `p2os.capture.describe`, asked once for each raw value that occurs.
"""

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import Capture, Chunk, Direction
from p2os.capture.columns.framing import Indexes, stalls_of
from p2os.capture.columns.table import Table as RawTable
from p2os.capture.columns.tables import Columns, decode
from p2os.capture.describe import Plain, sip_fields
from p2os.capture.listing import Reading
from p2os.capture.table import LEADING, Cell, Table
from p2os.protocol.frames import GIVE_UP_NS
from p2os.protocol.packets import packet_name
from p2os.protocol.sip import MOVING, POSITION_MASK, TAIL, SonarReading, StandardSip
from simbase.timing import NS_PER_S

#: A field in SI units → the raw field that alone decides it.
RAW_OF = {
    "heading_rad": "raw_heading", "left_mps": "raw_left_velocity", "right_mps": "raw_right_velocity",
    "battery_v": "raw_battery", "stall_left": "stall_left", "stall_right": "stall_right",
    "front_bumpers": "front_bumpers", "rear_bumpers": "rear_bumpers", "control_rad": "raw_control",
    "flags": "raw_flags", "servo_pulse": "raw_flags", "compass_deg": "raw_compass",
    "gripper_state": "gripper_state", "analog_port": "analog_port", "analog": "raw_analog",
    "digital_in": "digital_in", "digital_out": "digital_out",
}  # fmt: skip


def sip_table(capture: Capture, reading: Reading) -> Table | None:
    """Return a capture's SIPs as a table in SI units.

    Returns:
        None where the robot's bytes are not one stream: some with a direction and some without.
    """
    streams = {chunk.direction for chunk in capture.chunks if chunk.direction is not Direction.TO_ROBOT}
    if len(streams) != 1:
        return None
    (direction,) = streams
    chunks = [chunk for chunk in capture.chunks if chunk.direction is direction and chunk.data]
    data = np.frombuffer(b"".join(chunk.data for chunk in chunks), np.uint8)
    columns = decode(data, reading.profile, pauses=_pauses(chunks))
    raw = columns.tables.get("sip")
    if raw is None:
        return Table({name: [] for name in LEADING})
    return _Builder(raw, _times(capture.chunks, chunks, columns)[raw.packets], reading).table()


def _pauses(chunks: Sequence[Chunk]) -> Indexes:
    """Return the places before which the line was quiet for so long that the decoder gives up."""
    times, places = _arrivals(chunks)
    return places[1:-1][np.diff(times) >= GIVE_UP_NS]


def _arrivals(chunks: Sequence[Chunk]) -> tuple[Indexes, Indexes]:
    """Return when each chunk came and where it begins, and one past the last byte."""
    times = np.array([chunk.at_ns for chunk in chunks], np.int64)
    return times, np.concatenate(([0], np.cumsum([len(chunk.data) for chunk in chunks])))


def _times(every: Sequence[Chunk], chunks: Sequence[Chunk], columns: Columns) -> Indexes:
    """Return when each packet was known: at its last byte, or when what had hidden it was given up."""
    times, places = _arrivals(chunks)
    # The checksum's second byte is the last.
    last = columns.ends + 1
    known = times[np.searchsorted(places, last, side="right") - 1]
    stalls, limits = stalls_of(columns.data, columns.starts, columns.ends, columns.pauses)
    ticks = np.array([chunk.at_ns for chunk in every], np.int64)
    # From a segment's first stall on, all that follows in it was known only when the decoder gave up.
    for limit in np.unique(limits).tolist():
        hidden = (last >= stalls[limits == limit].min()) & (last < limit)
        silent = times[np.searchsorted(places, limit) - 1] + GIVE_UP_NS
        noticed = np.searchsorted(ticks, silent)
        known[hidden] = ticks[noticed] if noticed < len(ticks) else ticks[-1]
    return known


class _Builder:
    """Turns one table of raw SIPs into columns of plain values."""

    def __init__(self, raw: RawTable, times: Indexes, reading: Reading) -> None:
        self._raw, self._times, self._reading = raw, times, reading
        #: (first row that has it, place in that row) → name and cells.
        self._found: dict[tuple[float, float], tuple[str, list[Cell]]] = {}

    def table(self) -> Table:
        """Return the table, its columns in the order in which the rows first have them."""
        kinds, rows = self._raw["kind"], len(self._raw)
        leading: tuple[list[Cell], ...] = (
            [at_ns / NS_PER_S for at_ns in self._times.tolist()],
            [Direction.FROM_ROBOT.value] * rows,
            kinds.tolist(),
            [packet_name(kind) for kind in kinds.tolist()],
            [True] * rows,
        )
        fields = self._fields(StandardSip())
        for place, name in enumerate(fields):
            if name == "sonar_m":
                self._sonar(place)
            elif name in {"x_m", "y_m"}:
                self._add(place, name, self._followed(f"raw_{name[0]}"))
            elif name == "moving":
                self._add(place, name, (kinds == MOVING).tolist())
            else:
                self._add(place, name, self._converted(self._raw[RAW_OF[name]], self._by_field(name)))
        for number, (name, _, _) in enumerate(TAIL):
            has = np.flatnonzero(self._raw["tail_count"] > number)
            self._add_some(len(fields) + number, name.removeprefix("raw_"), has, self._raw[name][has].tolist())
        rests = self._raw.bytes_of("rest")
        has = np.flatnonzero([bool(rest) for rest in rests])
        self._add_some(len(fields) + len(TAIL), "rest", has, [rests[row].hex(" ") for row in has.tolist()])
        columns = dict(zip(LEADING, leading, strict=True))
        return Table({**columns, **dict(self._found[order] for order in sorted(self._found))})

    def _fields(self, sip: StandardSip) -> dict[str, Plain]:
        return sip_fields(sip, self._reading.profile, self._reading.parameters)

    def _by_field(self, name: str) -> Callable[[Any], Cell]:
        raw = RAW_OF[name]

        def convert(value: Any) -> Cell:
            return cast("Cell", self._fields(StandardSip(**{raw: value}))[name])

        return convert

    def _converted(self, raw: npt.NDArray[Any], convert: Callable[[Any], Cell]) -> list[Cell]:
        """Return a raw column in units: each value that occurs is converted once."""
        values, places = np.unique(raw, return_inverse=True)
        cells = np.array([convert(value) for value in values.tolist()], object)
        found: list[Cell] = cells[places].tolist()
        return found

    def _followed(self, name: str) -> list[Cell]:
        """Return a coordinate followed over the wraps of its counter, metres; the first within half a span of 0."""
        raw = self._raw[name].astype(np.int64) & POSITION_MASK
        half, modulus = (POSITION_MASK + 1) // 2, POSITION_MASK + 1
        first = raw[0] if raw[0] <= POSITION_MASK // 2 else raw[0] - modulus
        totals = np.concatenate(([first], first + np.cumsum((np.diff(raw) + half) % modulus - half)))
        metres = self._reading.parameters.distance_conv_mm / 1000
        counts: list[int] = totals.tolist()
        return [round(count * metres, 6) for count in counts]

    def _sonar(self, place: int) -> None:
        ragged = self._raw.ragged["sonar"]
        numbers, rows = ragged.columns["number"], ragged.rows

        def convert(value: Any) -> Cell:
            found = cast("dict[str, Cell]", self._fields(StandardSip(sonar=(SonarReading(0, value),)))["sonar_m"])
            return found["0"]

        cells = np.array(self._converted(ragged.columns["raw_range"], convert), object)
        for number in np.unique(numbers).tolist():
            items = np.flatnonzero(numbers == number)
            behind = items[0] - ragged.offsets[rows[items[0]]]
            self._add_some(
                place + float(behind) / 256, f"sonar_m_{number}", rows[items], cells[items].tolist()
            )  # fmt: skip

    def _add(self, place: float, name: str, cells: list[Cell]) -> None:
        self._found[0, place] = name, cells

    def _add_some(self, place: float, name: str, rows: Indexes, cells: Sequence[Cell]) -> None:
        """Add a column that only some rows have; of two cells of one row the later counts."""
        if len(rows):
            column: list[Cell] = [None] * len(self._raw)
            for row, cell in zip(rows.tolist(), cells, strict=True):
                column[row] = cell
            self._found[float(rows[0]), place] = name, column
