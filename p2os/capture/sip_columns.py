"""A robot's SIPs as columns, without NumPy: each raw column converted at once, instead of each packet described.

Invariant: cell by cell what `ListingRow.fields` says, positions left out: those are followed by who makes a table.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import cast, overload

from p2os.capture.cells import Cell, cell_text
from p2os.capture.chunks import Direction
from p2os.capture.describe import RAW_OF, Memo, Plain, SipFields
from p2os.capture.sips import Sip
from p2os.protocol.packets import packet_name
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import (
    BEFORE_SONAR,
    BEHIND_SONAR,
    HEAD_BYTES,
    READING_BYTES,
    unpack_tail,
)
from p2os.robots.parameters import RobotParameters

#: Where a column comes first: row, and place in that row.
_Place = tuple[int, float]


#: Columns that every table begins with.
LEADING = ("t_s", "dir", "type", "name", "valid")
#: What those say of a SIP, whose type decides them but for the time.
KIND_SAYS: Mapping[str, Callable[[int], Cell]] = {
    "dir": lambda _: Direction.FROM_ROBOT.value, "type": int, "name": packet_name, "valid": lambda _: True,
}  # fmt: skip
#: Raw value of a cell that is not there.
_ABSENT = -1


class Conversion:
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
        raw: The raw values.
        conversion: What they say.
    """

    def __init__(self, raw: Sequence[int], conversion: Conversion) -> None:
        self._raw, self._conversion = raw, conversion

    def texts(self) -> Sequence[str]:
        """Return each cell as it stands in CSV."""
        return list(map(self._conversion.text_of, self._raw))

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
        self._conversions = {name: Conversion(memo) for name, memo in self._fields.memos.items()}
        self._range = self._conversions["sonar_m"]
        self._leading = {name: Conversion(Memo(convert)) for name, convert in KIND_SAYS.items()}
        self._fields.memos["sonar_m"][_ABSENT] = None

    def of(self, sips: Sequence[Sip]) -> dict[str, Sequence[Cell]]:
        """Return the columns but for the time, in the order in which SIPs first have them; there is one at the least.

        Positions are those of each SIP alone.
        """
        payloads, heads = [sip.payload for sip in sips], [sip.head for sip in sips]
        before, behind = len(BEFORE_SONAR), len(BEHIND_SONAR)
        raw = dict(zip(BEFORE_SONAR, zip(*[head[:before] for head in heads], strict=True), strict=True))
        raw |= dict(zip(BEHIND_SONAR, zip(*[head[-behind:] for head in heads], strict=True), strict=True))
        kinds = raw["kind"] = tuple([payload[0] for payload in payloads])
        for side, bumpers in (("left", "rear_bumpers"), ("right", "front_bumpers")):
            raw[f"stall_{side}"] = tuple([value & 1 for value in raw[side]])
            raw[bumpers] = tuple([value >> 1 for value in raw[side]])
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        for place, name in enumerate(self._fields.memos):
            if name == "sonar_m":
                found |= self._sonar(heads, place)
            else:
                raw_name = RAW_OF[name]
                column = raw[self._renamed.get(raw_name, raw_name)]
                found[0, place] = name, RawColumn(column, self._conversions[name])
        found |= self._tail(payloads, raw["count"], len(self._fields.memos))
        leading = {name: RawColumn(kinds, conversion) for name, conversion in self._leading.items()}
        return {**leading, **dict(found[order] for order in sorted(found))}

    def _sonar(self, heads: list[tuple[int, ...]], place: int) -> dict[_Place, tuple[str, Sequence[Cell]]]:
        begin, end = len(BEFORE_SONAR), -len(BEHIND_SONAR)
        columns: dict[int, list[int]] = {}
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        for row, head in enumerate(heads):
            numbers = head[begin:end:2]
            for number, raw_range in zip(numbers, head[begin + 1 : end : 2], strict=True):
                if number not in columns:
                    columns[number] = [_ABSENT] * len(heads)
                    column = RawColumn(columns[number], self._range)
                    found[row, place + numbers.index(number) / 256] = f"sonar_m_{number}", column
                columns[number][row] = raw_range
        return found

    def _tail(
        self, payloads: list[bytes], counts: tuple[int, ...], place: int
    ) -> dict[_Place, tuple[str, Sequence[Cell]]]:
        columns: dict[str, list[Cell]] = {}
        found: dict[_Place, tuple[str, Sequence[Cell]]] = {}
        for row, (payload, count) in enumerate(zip(payloads, counts, strict=True)):
            size = HEAD_BYTES + READING_BYTES * count
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
