"""A robot's SIPs as columns, without NumPy: each raw column converted at once, instead of each packet described.

Invariant: cell by cell what `ListingRow.fields` says, positions left out: those are followed by who makes a table.
"""

from collections.abc import Sequence

from p2os.capture.describe import RAW_OF, Plain, SipFields
from p2os.capture.listing import ListingRow
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import (
    BEFORE_SONAR,
    BEHIND_SONAR,
    HEAD_BYTES,
    READING_BYTES,
    SIP_KINDS,
    unpack_head,
    unpack_tail,
)
from p2os.robots.parameters import RobotParameters

#: Where a column comes first: row, and place in that row.
_Place = tuple[int, float]


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

    def of(self, rows: Sequence[ListingRow]) -> dict[str, list[Plain]] | None:
        """Return the columns in the order in which the rows first have them; None if not all are sound SIPs."""
        payloads = [row.data[PREFIX_BYTES:-CHECKSUM_BYTES] for row in rows if row.kind in SIP_KINDS]
        heads = [head for head in map(unpack_head, payloads) if head is not None]
        if not heads or len(heads) < len(rows):
            return None
        before, behind = len(BEFORE_SONAR), len(BEHIND_SONAR)
        raw = dict(zip(BEFORE_SONAR, zip(*[head[:before] for head in heads], strict=True), strict=True))
        raw |= dict(zip(BEHIND_SONAR, zip(*[head[-behind:] for head in heads], strict=True), strict=True))
        raw["kind"] = tuple([payload[0] for payload in payloads])
        for side, bumpers in (("left", "rear_bumpers"), ("right", "front_bumpers")):
            raw[f"stall_{side}"] = tuple([value & 1 for value in raw[side]])
            raw[bumpers] = tuple([value >> 1 for value in raw[side]])
        found: dict[_Place, tuple[str, list[Plain]]] = {}
        for place, (name, memo) in enumerate(self._fields.memos.items()):
            if memo is None:
                found |= self._sonar(heads, place)
            else:
                raw_name = RAW_OF[name]
                column = raw[self._renamed.get(raw_name, raw_name)]
                found[0, place] = name, list(map(memo.__getitem__, column))
        found |= self._tail(payloads, raw["count"], len(self._fields.memos))
        return dict(found[order] for order in sorted(found))

    def _sonar(self, heads: list[tuple[int, ...]], place: int) -> dict[_Place, tuple[str, list[Plain]]]:
        begin, end = len(BEFORE_SONAR), -len(BEHIND_SONAR)
        columns: dict[int, list[Plain]] = {}
        found, none = {}, [None] * len(heads)
        memo = self._fields.sonar
        for row, head in enumerate(heads):
            for at in range(begin, len(head) + end, 2):
                number = head[at]
                if number not in columns:
                    columns[number] = list[Plain](none)
                    found[row, place + (at - begin) / 512] = f"sonar_m_{number}", columns[number]
                columns[number][row] = memo[head[at + 1]]
        return found

    def _tail(
        self, payloads: list[bytes], counts: tuple[int, ...], place: int
    ) -> dict[_Place, tuple[str, list[Plain]]]:
        columns: dict[str, list[Plain]] = {}
        found = {}
        for row, (payload, count) in enumerate(zip(payloads, counts, strict=True)):
            size = HEAD_BYTES + READING_BYTES * count
            if size == len(payload):
                continue
            values, end = unpack_tail(payload, size)
            cells: list[Plain] = list(values)
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
