"""Bytes of a P2OS line as rows of a channel of packets: name, what it says, and what each byte means.

What a packet says is made when somebody is to read it: of an hour's hundred thousand, few are looked at. Most commands
and idle packets come again and again: each distinct one is explained once.
"""

import json
from collections.abc import Callable, Iterator
from functools import partial

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
        #: By bytes and name, as they are read now.
        self._explained: dict[tuple[bytes, str], tuple[LaterText, LaterText]] = {}
        self._read_by = self.reading.reading

    def take(self, chunk: Chunk) -> Iterator[tuple[PacketRow, ListingRow]]:
        """Yield the rows that a chunk completes, and what they were made of."""
        for row in self._lister.take(chunk):
            yield self._row(row), row

    def finish(self, now: Nanos) -> Iterator[tuple[PacketRow, ListingRow]]:
        """Yield what was left when the recording ended."""
        for row in self._lister.finish(now):
            yield self._row(row), row

    def texts_again(self, sender: int, data: bytes, name: str) -> tuple[LaterText, LaterText]:
        """Return what a sound packet says, and its fields, once those before it were taken."""
        if sender == _SENDERS[Direction.FROM_ROBOT]:
            self.reading.take(data[PREFIX_BYTES:-CHECKSUM_BYTES])
        if self.reading.reading is not self._read_by:
            self._explained.clear()
            self._read_by = self.reading.reading
        key = data, name
        if key not in self._explained:
            row = partial(_row_again, sender, data, name, self._read_by)
            says, inside = partial(_says_again, row), partial(_fields_again, row, self._read_by)
            self._explained[key] = LaterText(says), LaterText(inside)
        return self._explained[key]

    def _row(self, row: ListingRow) -> PacketRow:
        if len(self._explained) >= MOST_KEPT or self.reading.reading is not self._read_by:
            self._explained.clear()
            self._read_by = self.reading.reading
        key = row.data, row.name
        if key not in self._explained:
            made = LaterText(partial(inside_of, row)), LaterText(partial(_fields_of, row, self._read_by))
            self._explained[key] = made
        says, fields = self._explained[key]
        return row.at_ns, _SENDERS[row.direction], row.data, row.name, says, fields, int(not row.valid)


def _row_again(sender: int, data: bytes, name: str, reading: Reading) -> ListingRow:
    return frame_row(data, at_ns=0, direction=_DIRECTIONS[sender], name=name, reading=reading)


def _says_again(row: Callable[[], ListingRow]) -> str:
    return inside_of(row())


def _fields_again(row: Callable[[], ListingRow], reading: Reading) -> str:
    return _fields_of(row(), reading)


def _fields_of(row: ListingRow, reading: Reading) -> str:
    parts = [(part.offset, part.offset + len(part.data), part.name, part.meaning) for part in explain(row, reading)]
    return json.dumps(parts, ensure_ascii=False, separators=(",", ":"))
