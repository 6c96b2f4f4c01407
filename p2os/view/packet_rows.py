"""Bytes of a P2OS line as rows of a channel of packets: name, what it says, and what each byte means.

What a packet says is made when somebody is to read it: of an hour's hundred thousand, few are looked at. Most commands
and idle packets come again and again: each distinct one is explained once.
"""

import json
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from functools import cached_property, partial

from p2os.capture import Chunk, Direction, FollowedReading, Lister, ListingRow, Reading, explain
from p2os.capture.listing import frame_row, inside_of
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES
from p2os.view.frames import LaterText
from simbase.timing import Nanos

#: chosen: explanations that are kept; a robot at rest needs few, one that drives has new ones with each packet.
MOST_KEPT = 4096
#: Who has sent a row, in its column.
_SENDERS = {Direction.FROM_ROBOT: 0, Direction.TO_ROBOT: 1, None: 2}
_DIRECTIONS = {number: direction for direction, number in _SENDERS.items()}
#: Time, sender, bytes, name, what it says, fields, whether it is bad.
PacketRow = tuple[Nanos, int, bytes, str, LaterText, LaterText, int]


class PacketRows:
    """Follows one conversation.

    Args:
        robot: Model or file, for units; empty: what the robot says.
    """

    def __init__(self, robot: str = "") -> None:
        self.reading = FollowedReading(robot)
        self._lister = Lister(self.reading)
        #: By bytes, name and who has sent them, as they are read now.
        self._explained: dict[tuple[bytes, str, Direction | None], tuple[LaterText, LaterText]] = {}
        self._read_by = self.reading.reading

    def take(self, chunk: Chunk) -> Iterator[tuple[PacketRow, ListingRow]]:
        """Yield the rows that a chunk completes, and what they were made of."""
        for row in self._lister.take(chunk):
            yield self._row(row), row

    def finish(self, now: Nanos) -> Iterator[tuple[PacketRow, ListingRow]]:
        """Yield what was left when the recording ended."""
        for row in self._lister.finish(now):
            yield self._row(row), row

    def _row(self, row: ListingRow) -> PacketRow:
        if len(self._explained) >= MOST_KEPT or self.reading.reading is not self._read_by:
            self._explained.clear()
            self._read_by = self.reading.reading
        key = row.data, row.name, row.direction  # a robot echoes SYNC0 to SYNC2
        if key not in self._explained:
            made = LaterText(partial(inside_of, row)), LaterText(partial(_fields_of, row, self._read_by))
            self._explained[key] = made
        says, fields = self._explained[key]
        return row.at_ns, _SENDERS[row.direction], row.data, row.name, says, fields, int(not row.valid)


class PacketTexts:
    """What packets say that were kept without it: made again of their bytes.

    Args:
        robot: Model or file, as of `PacketRows`.
        senders: Of each row, as its column has it.
        data: Its bytes.
        names: Its name.
        are_bad: Whether it is no sound frame.
    """

    def __init__(
        self, robot: str, senders: Sequence[int], data: Sequence[bytes], names: Sequence[str], are_bad: Sequence[int]
    ) -> None:
        self._robot, self._senders, self._data, self._names, self._are_bad = robot, senders, data, names, are_bad

    def says(self, row: int) -> str:
        """Return what a sound packet says."""
        return inside_of(self._row(row))

    def fields(self, row: int) -> str:
        """Return its fields, as the column has them."""
        return _fields_of(self._row(row), self._reading_at(row))

    def _row(self, row: int) -> ListingRow:
        direction = _DIRECTIONS[self._senders[row]]
        return frame_row(
            self._data[row], at_ns=0, direction=direction, name=self._names[row], reading=self._reading_at(row)
        )

    def _reading_at(self, row: int) -> Reading:
        firsts, readings = self._readings
        return readings[bisect_right(firsts, row) - 1]

    @cached_property
    def _readings(self) -> tuple[list[int], list[Reading]]:
        """From which row on packets are read how: what a robot says of itself holds for its packet, too."""
        followed, from_robot = FollowedReading(self._robot), _SENDERS[Direction.FROM_ROBOT]
        firsts, readings = [0], [followed.reading]
        for row, (sender, data, is_bad) in enumerate(zip(self._senders, self._data, self._are_bad, strict=True)):
            if sender == from_robot and not is_bad:
                followed.take(data[PREFIX_BYTES:-CHECKSUM_BYTES])
                if followed.reading is not readings[-1]:
                    firsts.append(row)
                    readings.append(followed.reading)
        return firsts, readings


def _fields_of(row: ListingRow, reading: Reading) -> str:
    parts = [(part.offset, part.offset + len(part.data), part.name, part.meaning) for part in explain(row, reading)]
    return json.dumps(parts, ensure_ascii=False, separators=(",", ":"))
