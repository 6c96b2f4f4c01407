"""Passing over packets that nobody asked for: their frames are found and checked together, and no row is made.

Theory of operation. A block's bytes are looked at by direction. Chunks that hold nothing but frames to be passed over
are left out whole, as long as no frame waits for its rest where they begin or end; all others go to a `Lister`, one by
one, which passes over what it finds inside them.

Invariant: what is passed over is a sound frame whose row a filter by names would leave out, and which changes no
session but as any other packet of a robot does; the other rows are those of a listing that passes over nothing.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import LETTERS, ChunkBlock, Direction
from p2os.capture.columns.framing import Bytes, Indexes, find_frames
from p2os.capture.describe import command_name
from p2os.capture.listing import COMMAND_NAMES, Finder, Lister, ListingRow, LoopFinder
from p2os.capture.reading import FollowedReading, Reading
from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.commands import CommandNumber
from p2os.protocol.frames import CHECKSUM_BYTES, GIVE_UP_NS, PREFIX_BYTES
from p2os.protocol.packets import IDENTITY_KIND, RESET_KINDS, packet_name
from p2os.protocol.sip import COUNT_AT, HEAD_BYTES, READING_BYTES, SIP_KINDS

#: chosen: below, a loop takes less time than NumPy's calls.
LEAST_BYTES = 1 << 11
#: Packet types and commands that a filter by names may leave out, with their names in lower case. A reset ends a
#: session; PULSE and SYNC0 are one number, which changes none, and OPEN and CLOSE change it.
_PACKETS = tuple((kind, packet_name(kind).lower()) for kind in range(IDENTITY_KIND + 1, 256) if kind not in RESET_KINDS)
_COMMANDS = tuple((kind, command_name(kind).lower()) for kind in range(CommandNumber.CLOSE + 1, 256))
_Flags = npt.NDArray[np.bool_]


def rows_passing(
    blocks: Iterable[ChunkBlock], reading: Reading | FollowedReading, wanted: Iterable[str]
) -> Iterator[ListingRow]:
    """Yield the rows of a capture but for some of those whose names nobody wants, all damage with them.

    Args:
        blocks: In the order of time.
        reading: How to read them.
        wanted: Names of packets and commands, in lower case.
    """
    passing = Passing(wanted)
    lister, now = Lister(reading, passing), 0
    for block in blocks:
        place, chunks = 0, _Chunks(block, passing)
        for number in chunks.left.tolist():
            yield from chunks.passed(lister, place, number)
            yield from lister.take(block.chunk(number))
            place = number + 1
        yield from chunks.passed(lister, place, len(block))
        now = block.at_ns[-1]
    yield from lister.finish(now)


class Passing:
    """What is passed over.

    Args:
        wanted: The names of packets and commands whose rows are asked for, in lower case.
    """

    def __init__(self, wanted: Iterable[str]) -> None:
        names = frozenset(wanted)
        robots = frozenset([kind for kind, name in _PACKETS if name not in names])
        clients = {kind for kind, name in _COMMANDS if name not in names}
        if names.isdisjoint({SYNC_NAMES[0].lower(), COMMAND_NAMES[0].lower()}):
            clients.add(0)
        #: Without direction only a SIP's shape tells for certain that a robot has sent it.
        self._kinds = {
            Direction.FROM_ROBOT: robots, Direction.TO_ROBOT: frozenset(clients), None: robots & frozenset(SIP_KINDS)
        }  # fmt: skip

    def found_in(self, data: bytes, direction: Direction | None) -> Finder:
        """Look at bytes; return what tells the sound frames that stand in them."""
        if len(data) < LEAST_BYTES:
            return LoopFinder(data, direction, self._kinds[direction])
        return _Found(*self.frames(np.frombuffer(data, np.uint8), direction, None))

    def frames(
        self, data: Bytes, direction: Direction | None, pauses: Indexes | None
    ) -> tuple[Indexes, Indexes, _Flags]:
        """Return where the payload of each sound frame begins and ends, and whether it is passed over."""
        starts, ends = find_frames(data, pauses=pauses)
        is_passed = np.zeros(256, np.bool_)
        is_passed[list(self._kinds[direction])] = True
        passed: _Flags = is_passed[data[starts]] if len(starts) else np.zeros(0, np.bool_)
        if direction is None and len(starts):
            readings = data[np.minimum(starts + COUNT_AT, ends - 1)].astype(np.int64)
            sizes = ends - starts
            passed &= (sizes >= HEAD_BYTES) & (sizes >= HEAD_BYTES + READING_BYTES * readings)
        return starts, ends, passed


class _Found:
    """Sound frames that were found together."""

    def __init__(self, starts: Indexes, ends: Indexes, passed: npt.NDArray[np.bool_]) -> None:
        self._starts, self._ends, self._passed = starts, ends, passed
        #: Where a frame does not stand right behind the one before, and the end.
        gaps = np.flatnonzero(starts[1:] - ends[:-1] != CHECKSUM_BYTES + PREFIX_BYTES)
        self._breaks = np.append(gaps + 1, len(starts))

    def frames(self, place: int) -> tuple[list[tuple[int, int, bool]], int]:
        """Return the sound frames from a place on, as a `Finder`."""
        first = int(np.searchsorted(self._starts, place + PREFIX_BYTES))
        if first == len(self._starts) or self._starts[first] != place + PREFIX_BYTES:
            return [], place
        last = int(self._breaks[np.searchsorted(self._breaks, first, side="right")])
        passed = self._passed[first:last]
        kept = ~passed
        kept[:-1] |= kept[1:]
        kept[-1] = True
        rows = np.flatnonzero(kept) + first
        chosen = zip(self._starts[rows].tolist(), self._ends[rows].tolist(), self._passed[rows].tolist(), strict=True)
        return list(chosen), int(self._ends[last - 1]) + CHECKSUM_BYTES


class _Chunks:
    """Which chunks of a block hold nothing but what is passed over.

    Args:
        block: The block.
        passing: What is passed over.
    """

    def __init__(self, block: ChunkBlock, passing: Passing) -> None:
        self._block, self._passing = block, passing
        self._passed = np.zeros(len(block), np.bool_)
        #: Before the chunk, and behind the last, no frame that is passed over has begun and not ended.
        self._is_closed_before = np.ones(len(block) + 1, np.bool_)
        self._is_closed_behind = np.ones(len(block) + 1, np.bool_)
        self._data = np.frombuffer(block.data, np.uint8)
        self._at_ns: Indexes = np.frombuffer(block.at_ns, np.int64)
        ends: Indexes = np.frombuffer(block.ends, np.int64)
        self._sizes = ends - np.concatenate(([0], ends[:-1]))
        senders = np.frombuffer(block.senders, np.uint8)
        for direction, letter in LETTERS.items():
            if letter in block.senders:
                self._look(direction, senders == letter[0])
        self._robots = np.flatnonzero(senders != LETTERS[Direction.TO_ROBOT][0])

    @property
    def left(self) -> Indexes:
        """The numbers of the chunks that have to be looked at."""
        return np.flatnonzero(~self._passed)

    def _look(self, direction: Direction | None, is_mine: _Flags) -> None:
        """Look at the chunks of one direction."""
        numbers = np.flatnonzero(is_mine)
        alone = len(numbers) == len(is_mine)
        data, sizes = (self._data, self._sizes) if alone else (
            self._data[np.repeat(is_mine, self._sizes)], self._sizes[numbers]
        )  # fmt: skip
        behind: Indexes = np.cumsum(sizes)
        before: Indexes = behind - sizes
        pauses = before[1:][np.diff(self._at_ns[numbers]) >= GIVE_UP_NS]
        starts, ends, passed = self._passing.frames(data, direction, pauses)
        starts, ends = starts[passed] - PREFIX_BYTES, ends[passed] + CHECKSUM_BYTES
        if not len(starts):
            return
        # Frames that stand one behind the other are one chain.
        chains = np.concatenate(([0], np.cumsum(starts[1:] != ends[:-1])))
        first = np.searchsorted(starts, before, side="right") - 1
        last = np.minimum(np.searchsorted(ends, behind), len(ends) - 1)
        passed = (first >= 0) & (behind <= ends[last]) & (chains[first] == chains[last])
        self._passed[numbers] = passed
        begins, stops = ~passed | (before == starts[first]), ~passed | (behind == ends[last])
        if not (begins.all() and stops.all()):
            nexts = np.searchsorted(numbers, np.arange(len(is_mine) + 1))
            self._is_closed_before &= np.append(begins, True)[nexts]
            self._is_closed_behind &= np.append(True, stops)[nexts]

    def passed(self, lister: Lister, place: int, end: int) -> Iterator[ListingRow]:
        """Pass over the chunks between two places, as far as that may be; yield the rows of the others."""
        last = end
        while last > place and not self._is_closed_behind[last]:
            last -= 1
        while place < last and (lister.is_waiting or not self._is_closed_before[place]):
            yield from lister.take(self._block.chunk(place))
            place += 1
        if place < last:
            robot = int(np.searchsorted(self._robots, last)) - 1
            if robot >= 0 and self._robots[robot] >= place:
                lister.pass_over(None, self._block.at_ns[int(self._robots[robot])])
            place = last
        for number in range(place, end):
            yield from lister.take(self._block.chunk(number))
