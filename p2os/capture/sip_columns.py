"""A robot's SIPs as columns, without NumPy: each raw column converted at once, instead of each packet described.

What stands in CSV is looked up for each raw value; a column in which all are alike has one text for all.

Invariant: cell by cell what `ListingRow.fields` says, positions left out: those are followed by who makes a table.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from operator import ne
from typing import TypeVar, cast, overload

from p2os.capture.cells import Alike, Cell, cell_text
from p2os.capture.chunks import Direction
from p2os.capture.describe import RAW_OF, Memo, Plain, SipFields
from p2os.protocol.packets import packet_name
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import HEAD_BYTES, READING_BYTES, SONAR_AT, Heads, unpack_tail
from p2os.robots.parameters import RobotParameters

#: Where a column comes first: row, and place in that row.
_Place = tuple[int, float]
_Said = TypeVar("_Said")

#: Columns that every table begins with.
LEADING = ("t_s", "dir", "type", "name", "valid")
#: What those say of a SIP, whose type decides them but for the time.
KIND_SAYS: Mapping[str, Callable[[int], Cell]] = {
    "dir": lambda _: Direction.FROM_ROBOT.value, "type": int, "name": packet_name, "valid": lambda _: True,
}  # fmt: skip


class FieldConversion:
    """What a field says of each raw value that occurs, and how that stands in CSV.

    Args:
        cells: The field.
    """

    def __init__(self, cells: "Memo[Plain] | Memo[Cell]") -> None:
        self.cell_of = cast("Callable[[int], Cell]", cells.__getitem__)
        self.text_of: Callable[[int], str] = Memo(lambda raw: cell_text(self.cell_of(raw))).__getitem__


class RawColumn(Sequence[Cell]):
    """A column whose cells are converted when they are asked for.

    Args:
        raw: The raw values, one at the least.
        conversion: What they say.
    """

    def __init__(self, raw: Sequence[int], conversion: FieldConversion) -> None:
        self._raw, self._conversion = raw, conversion

    def texts(self) -> Sequence[str] | Alike:
        """Return each cell as it stands in CSV."""
        raw, text_of = self._raw, self._conversion.text_of
        return Alike(text_of(raw[0])) if raw.count(raw[0]) == len(raw) else list(map(text_of, raw))

    def __len__(self) -> int:
        return len(self._raw)

    def __iter__(self) -> Iterator[Cell]:
        return map(self._conversion.cell_of, self._raw)

    @overload
    def __getitem__(self, place: int) -> Cell: ...
    @overload
    def __getitem__(self, place: slice) -> "RawColumn": ...
    def __getitem__(self, place: int | slice) -> "Cell | RawColumn":
        if isinstance(place, slice):
            return RawColumn(self._raw[place], self._conversion)
        return self._conversion.cell_of(self._raw[place])


class _Readings:
    """The sonar readings of some SIPs.

    Args:
        heads: Theirs.
        count: How many SIPs.
        conversion: What a raw range says.
    """

    def __init__(self, heads: Heads, count: int, conversion: FieldConversion) -> None:
        self._heads, self._count, self._conversion = heads, count, conversion

    @cached_property
    def cells(self) -> dict[int, list[Cell]]:
        """The column of each sonar's number."""
        return self._spread(self._conversion.cell_of, None)

    @cached_property
    def texts(self) -> dict[int, list[str]]:
        """The same as it stands in CSV."""
        return self._spread(self._conversion.text_of, cell_text(None))

    def _spread(self, convert: Callable[[int], _Said], absent: _Said) -> dict[int, list[_Said]]:
        numbers = self._heads.numbers
        found = {number: [absent] * self._count for number in set(numbers)}
        # Of two readings of one row the later counts.
        for number, row, said in zip(numbers, self._heads.rows, map(convert, self._heads.ranges), strict=True):
            found[number][row] = said
        return found


class _SonarColumn(Sequence[Cell]):
    """The readings of one sonar.

    Args:
        readings: Of all.
        number: Its number.
    """

    def __init__(self, readings: _Readings, number: int) -> None:
        self._readings, self._number = readings, number

    def texts(self) -> Sequence[str]:
        """Return each cell as it stands in CSV."""
        return self._readings.texts[self._number]

    def __len__(self) -> int:
        return len(self._readings.cells[self._number])

    def __iter__(self) -> Iterator[Cell]:
        return iter(self._readings.cells[self._number])

    @overload
    def __getitem__(self, place: int) -> Cell: ...
    @overload
    def __getitem__(self, place: slice) -> list[Cell]: ...
    def __getitem__(self, place: int | slice) -> "Cell | list[Cell]":
        return self._readings.cells[self._number][place]


class SipColumns:
    """Makes columns of SIPs.

    Args:
        profile: Layout of the last fields.
        parameters: The robot's units.
    """

    def __init__(self, profile: Profile, parameters: RobotParameters) -> None:
        self._fields = SipFields(profile, parameters)
        port, gripper = ("second", "first") if profile.has_gripper_first else ("first", "second")
        self._renamed = {"analog_port": port, "gripper_state": gripper}
        self._conversions = {name: FieldConversion(memo) for name, memo in self._fields.memos.items()}
        self._range = self._conversions["sonar_m"]
        self._leading = {name: FieldConversion(Memo(convert)) for name, convert in KIND_SAYS.items()}

    def of(self, payloads: Sequence[bytes], heads: Heads) -> dict[str, Sequence[Cell]]:
        """Return the columns of SIPs but for the time, in the order in which SIPs first have them.

        Positions are those of each SIP alone.

        Args:
            payloads: Of the SIPs, one at the least.
            heads: What `unpack_heads` says of them.
        """
        raw = dict(heads.columns)
        kinds = raw["kind"] = bytes([payload[0] for payload in payloads])
        for side, bumpers in (("left", "rear_bumpers"), ("right", "front_bumpers")):
            raw[f"stall_{side}"] = bytes([value & 1 for value in raw[side]])
            raw[bumpers] = bytes([value >> 1 for value in raw[side]])
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        for place, name in enumerate(self._fields.memos):
            if name == "sonar_m":
                found |= self._sonar(payloads, heads, place)
            else:
                raw_name = RAW_OF[name]
                column = raw[self._renamed.get(raw_name, raw_name)]
                found[0, place] = name, RawColumn(column, self._conversions[name])
        found |= self._tail(payloads, raw["count"], len(self._fields.memos))
        leading = {name: RawColumn(kinds, conversion) for name, conversion in self._leading.items()}
        return {**leading, **dict(found[order] for order in sorted(found))}

    def _sonar(self, payloads: Sequence[bytes], heads: Heads, place: int) -> dict[_Place, tuple[str, Sequence[Cell]]]:
        readings = _Readings(heads, len(payloads), self._range)
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        for number in set(heads.numbers):
            row = heads.rows[heads.numbers.index(number)]
            behind = payloads[row][SONAR_AT::READING_BYTES].index(number)
            found[row, place + behind / 256] = f"sonar_m_{number}", _SonarColumn(readings, number)
        return found

    def _tail(
        self, payloads: Sequence[bytes], counts: Sequence[int], place: int
    ) -> dict[_Place, tuple[str, Sequence[Cell]]]:
        columns: dict[str, list[Cell]] = {}
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        sizes = [HEAD_BYTES + READING_BYTES * count for count in counts]
        if not any(map(ne, sizes, map(len, payloads))):
            return found
        for row, (payload, size) in enumerate(zip(payloads, sizes, strict=True)):
            if size == len(payload):
                continue
            values, end = unpack_tail(payload, size)
            cells: list[Cell] = list(values)
            names = self._fields.tail[: len(cells)]
            if end < len(payload):
                names, cells = (*names, "rest"), [*cells, payload[end:].hex(" ")]
            for name, cell in zip(names, cells, strict=True):
                if name not in columns:
                    columns[name] = [None] * len(payloads)
                    behind = len(self._fields.tail) if name == "rest" else self._fields.tail.index(name)
                    found[row, float(place + behind)] = name, columns[name]
                columns[name][row] = cell
        return found
