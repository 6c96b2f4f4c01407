"""A capture's packets as tables, one a kind of packet.

Every field that `p2os.protocol.packets` reads is a column here, by the same name and from
the same declaration; row by row they are equal. Arrays of varying length
(sonar readings, gyro readings, analog inputs) stand beside their table with the
row that each item belongs to; texts and bytes are places in the data. What is
unknown, or not sound inside, is in the table `raw`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from p2os.capture.columns.framing import Indexes, RejectedCounts, damage_of, find_frames
from p2os.capture.columns.readers import READERS
from p2os.capture.columns.table import Table
from p2os.capture.columns.walker import PacketWalk
from p2os.protocol.packets import PACKET_KINDS, CompassPacket
from p2os.protocol.profiles import Profile

#: Table → the packet types that go into it.
KINDS = {
    table: tuple(row.kind for row in PACKET_KINDS if row.table == table)
    for table in dict.fromkeys(row.table for row in PACKET_KINDS if row.table)
}
_NAMES = [*KINDS, "raw"]
_RAW = len(_NAMES) - 1
#: Packet type → the number of its table.
_TABLE_OF_KIND = np.full(256, _RAW, np.uint8)
for _number, _kinds in enumerate(KINDS.values()):
    _TABLE_OF_KIND[list(_kinds)] = _number


@dataclass(slots=True, kw_only=True)
class Columns:
    """A decoded capture.

    Args:
        data: Its bytes.
        starts: Where each packet's type stands; packets are in the order of the stream.
        ends: One past each packet's last byte before the checksum.
        tables: By name; only those that have a row.
        pauses: As `decode` took them.
    """

    data: npt.NDArray[np.uint8]
    starts: Indexes
    ends: Indexes
    tables: dict[str, Table]
    pauses: Indexes | None = None

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def kinds(self) -> npt.NDArray[np.uint8]:
        """The type of each packet."""
        return self.data[self.starts]

    def damage(self) -> RejectedCounts:
        """Return what was wrong with the capture, by kind of error."""
        return damage_of(self.data, self.starts, self.ends, self.pauses)

    def rows(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield each packet's table and row, in the order of the stream; slow, for looking at a few."""
        place = {
            int(packet): (table, row) for table in self.tables.values() for row, packet in enumerate(table.packets)
        }
        for packet in range(len(self)):
            table, row = place[packet]
            yield table.name, table.row(row)


def decode(data: bytes | npt.NDArray[np.uint8], profile: Profile, *, pauses: Indexes | None = None) -> Columns:
    """Decode a whole capture of what a robot sent.

    Args:
        data: The bytes as they came, damage and all.
        profile: The robot's firmware family.
        pauses: Places, in rising order, before which the line was quiet for 250 ms or more.
    """
    array = np.frombuffer(data, np.uint8) if isinstance(data, bytes) else np.ascontiguousarray(data, np.uint8)
    starts, ends = find_frames(array, pauses=pauses)
    table_of = _TABLE_OF_KIND[array[starts]] if len(starts) else np.zeros(0, np.uint8)
    tables: dict[str, Table] = {}
    raw = [np.flatnonzero(table_of == _RAW)]
    for number in np.flatnonzero(np.bincount(table_of, minlength=_RAW + 1)).tolist():
        if number != _RAW:
            packets = np.flatnonzero(table_of == number)
            raw.extend(_read(tables, _NAMES[number], array, starts, ends, packets, profile))
    rest = np.sort(np.concatenate(raw))
    if len(rest):
        _read(tables, "raw", array, starts, ends, rest, profile)
    return Columns(data=array, starts=starts, ends=ends, tables=tables, pauses=pauses)


def table_name(payload: bytes) -> str:
    """Return the table that a packet goes into if it is sound inside."""
    name = _NAMES[_TABLE_OF_KIND[payload[0]]]
    is_unsized = name == "compass" and len(payload) == CompassPacket.READING_BYTES + 1
    return "compass_unsized" if is_unsized else name


def _read(
    tables: dict[str, Table], name: str, data: npt.NDArray[np.uint8], starts: Indexes, ends: Indexes,
    packets: Indexes, profile: Profile,
) -> list[Indexes]:  # fmt: skip
    """Read packets into a table; return those that are not sound inside."""
    lost: list[Indexes] = []
    if name == "compass":
        # The byte that counts the others may be missing: 20 bytes are a reading without it.
        short = ends[packets] - starts[packets] == CompassPacket.READING_BYTES + 1
        if short.any():
            lost += _read(tables, "compass_unsized", data, starts, ends, packets[short], profile)
            packets = packets[~short]
    while len(packets):
        walk = PacketWalk(data, starts[packets] + 1, ends[packets])
        READERS[name](walk, profile)
        if walk.sound.all():
            tables[name] = Table(
                name=name, data=data, packets=packets, columns=walk.columns, texts=walk.texts, ragged=walk.ragged
            )
            break
        lost.append(packets[~walk.sound])
        packets = packets[walk.sound]
    return lost
