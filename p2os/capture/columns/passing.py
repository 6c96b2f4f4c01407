"""Passing over packets that nobody asked for: their frames are found and checked together, and no row is made.

Invariant: what is passed over is a robot's sound packet whose row a filter by names would leave out, and which the
session takes as any other packet; the other rows are those of a listing that passes over nothing.
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import Direction
from p2os.capture.columns.framing import Indexes, find_frames
from p2os.capture.listing import Finder, LoopFinder
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES
from p2os.protocol.packets import IDENTITY_KIND, RESET_KINDS, packet_name
from p2os.protocol.sip import HEAD_BYTES, READING_BYTES, SIP_KINDS

#: chosen: below, a loop takes less time than NumPy's calls.
LEAST_BYTES = 1 << 11
_COUNT_AT = 19


class Passing:
    """What is passed over.

    Args:
        wanted: The names of packets and commands whose rows are asked for, in lower case.
    """

    def __init__(self, wanted: Iterable[str]) -> None:
        names = frozenset(wanted)
        self._kinds = frozenset(
            kind for kind in range(IDENTITY_KIND + 1, 256)
            if kind not in RESET_KINDS and packet_name(kind).lower() not in names
        )  # fmt: skip
        #: Bytes without direction: only a SIP's shape tells for certain that a robot has sent it.
        self._undirected = self._kinds & frozenset(SIP_KINDS)

    def found_in(self, data: bytes, direction: Direction | None) -> Finder:
        """Look at bytes; return what tells the sound frames that stand in them."""
        kinds = self._undirected if direction is None else self._kinds
        if direction is Direction.TO_ROBOT:
            kinds = frozenset()
        if len(data) < LEAST_BYTES:
            return LoopFinder(data, direction, kinds)
        array = np.frombuffer(data, np.uint8)
        starts, ends = find_frames(array)
        passed: npt.NDArray[np.bool_] = np.isin(array[starts], list(kinds))
        if direction is None and len(starts):
            readings = array[np.minimum(starts + _COUNT_AT, ends - 1)].astype(np.int64)
            sizes = ends - starts
            passed &= (sizes >= HEAD_BYTES) & (sizes >= HEAD_BYTES + READING_BYTES * readings)
        return _Found(starts, ends, passed)


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
