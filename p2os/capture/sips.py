"""The SIPs of a robot in a capture, many at a time, without a row for anything else.

Theory of operation. A robot's chunks that follow each other without a pause that ends a frame are one run of bytes,
however they were cut. Sound frames are taken out of it here while none waits for its rest. All else goes to a
`Lister`, chunk by chunk and up to the next header, before which it tells of noise anyway. What a client sends changes
no SIP: it only ends a run, and tells the time, at which a frame whose rest never came is given up.

Invariant: the SIPs, and when each had come, are those of a listing's rows.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from p2os.capture.chunks import LETTERS, Chunk, ChunkBlock, Direction
from p2os.capture.listing import Lister, ListingRow, next_header
from p2os.capture.reading import Reading
from p2os.protocol.frames import CHECKSUM_BYTES, GIVE_UP_NS, PREFIX_BYTES, sound_frames
from p2os.protocol.sip import SIP_KINDS, is_sip
from simbase.timing import Nanos

_CLIENT = LETTERS[Direction.TO_ROBOT][0]
_FRAMING_BYTES = PREFIX_BYTES + CHECKSUM_BYTES


@dataclass(frozen=True, slots=True)
class Sips:
    """Standard SIPs, all of them sound inside.

    Args:
        at_ns: When the last byte of each had come, in nanoseconds since the start.
        payloads: Type and what follows of each.
    """

    at_ns: list[Nanos] = field(default_factory=list)
    payloads: list[bytes] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.payloads)

    def add(self, rows: Iterable[ListingRow]) -> None:
        """Take a robot's SIPs among rows."""
        for row in rows:
            if row.direction is not Direction.TO_ROBOT and row.is_sip:
                self.at_ns.append(row.at_ns)
                self.payloads.append(row.data[PREFIX_BYTES:-CHECKSUM_BYTES])


def sips_of(blocks: Iterable[ChunkBlock], reading: Reading) -> Iterator[Sips]:
    """Yield the SIPs of a capture's robot, in the order in which they had come, those of each block together."""
    reader, now = _Reader(reading), 0
    for block in blocks:
        yield reader.take(block)
        now = block.at_ns[-1]
    yield reader.finish(now)


def in_groups(every: Iterable[Sips], size: int) -> Iterator[Sips]:
    """Yield the same SIPs, so many at a time, the last fewer."""
    held = Sips()
    for sips in every:
        held.at_ns.extend(sips.at_ns)
        held.payloads.extend(sips.payloads)
        start = 0
        while len(held) - start >= size:
            end = start + size
            yield Sips(held.at_ns[start:end], held.payloads[start:end])
            start = end
        del held.at_ns[:start], held.payloads[:start]
    if len(held):
        yield held


class _Reader:
    """Finds SIPs in blocks.

    Args:
        reading: How to read them.
    """

    def __init__(self, reading: Reading) -> None:
        self._lister = Lister(reading)
        self._is_waiting = False

    def take(self, block: ChunkBlock) -> Sips:
        """Return the SIPs that a block completes."""
        found = Sips()
        for first, last in pairwise(_runs(block)):
            if block.senders[first] != _CLIENT:
                self._run(block, first, last, found)
            elif self._is_waiting:
                for at_ns in block.at_ns[first:last]:
                    self._look(found, self._lister.advance_to(at_ns))
        return found

    def finish(self, now: Nanos) -> Sips:
        """Return what was left when the capture ended."""
        found = Sips()
        self._look(found, self._lister.finish(now))
        return found

    def _look(self, found: Sips, rows: Iterable[ListingRow]) -> None:
        found.add(rows)
        self._is_waiting = self._lister.is_waiting

    def _run(self, block: ChunkBlock, first: int, last: int, found: Sips) -> None:
        """Find the SIPs in chunks of the robot without a long pause between them."""
        data, ends, at_ns = block.data, block.ends, block.at_ns
        place, limit = ends[first - 1] if first else 0, ends[last - 1]
        number, end = first, ends[first]
        while place < limit:
            if not self._is_waiting:
                for payload in sound_frames(data, place, limit):
                    place += len(payload) + _FRAMING_BYTES
                    while place > end:
                        number += 1
                        end = ends[number]
                    if payload[0] in SIP_KINDS and is_sip(payload):
                        found.at_ns.append(at_ns[number])
                        found.payloads.append(payload)
                if place == limit:
                    break
            while place >= end:
                number += 1
                end = ends[number]
            # Up to the next header, before which noise ends anyway.
            cut = next_header(data, place + 1, end)
            chunk = Chunk(at_ns=at_ns[number], direction=block.direction(number), data=data[place:cut])
            self._look(found, self._lister.take(chunk))
            place = cut


def _runs(block: ChunkBlock) -> list[int]:
    """Return where runs of one sender's chunks begin between which no frame is given up, and one past the last."""
    at_ns, senders, end = block.at_ns, block.senders, len(block)
    chunks = zip(range(1, end), senders, senders[1:], at_ns, at_ns[1:], strict=False)
    cuts = [number for number, one, other, before, now in chunks if other != one or now - before >= GIVE_UP_NS]
    return [0, *cuts, end]
