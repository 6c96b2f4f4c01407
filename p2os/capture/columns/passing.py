"""Passing over packets that nobody asked for: their frames are found and checked together, and no row is made.

Invariant: what is passed over is a robot's sound packet whose row a filter by names would leave out, and which the
session takes as any other packet; the other rows are those of a listing that passes over nothing.
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import Direction
from p2os.capture.columns.framing import find_frames
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, sound_frames
from p2os.protocol.packets import IDENTITY_KIND, RESET_KINDS, packet_name
from p2os.protocol.sip import HEAD_BYTES, READING_BYTES, SIP_KINDS, is_sip

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

    def frames(self, data: bytes, direction: Direction | None) -> tuple[list[tuple[int, int, bool]], int]:
        """Return the sound frames that bytes begin with.

        Returns:
            Where the payload of each begins and ends, and whether it is passed over; of several such in a row only
            the last. And where the frames end.
        """
        kinds = self._undirected if direction is None else self._kinds
        if direction is Direction.TO_ROBOT:
            kinds = frozenset()
        if len(data) < LEAST_BYTES:
            return self._by_loop(data, kinds, direction)
        array = np.frombuffer(data, np.uint8)
        starts, ends = find_frames(array)
        behind = ends + CHECKSUM_BYTES
        joined = starts == np.concatenate(([0], behind[:-1])) + PREFIX_BYTES
        count = len(starts) if joined.all() else int(np.argmin(joined))
        starts, ends = starts[:count], ends[:count]
        if not count:
            return [], 0
        passed: npt.NDArray[np.bool_] = np.isin(array[starts], list(kinds))
        if direction is None:
            readings = array[np.minimum(starts + _COUNT_AT, ends - 1)].astype(np.int64)
            sizes = ends - starts
            passed &= (sizes >= HEAD_BYTES) & (sizes >= HEAD_BYTES + READING_BYTES * readings)
        kept = ~passed
        kept[:-1] |= kept[1:]
        kept[-1] = True
        chosen = zip(starts[kept].tolist(), ends[kept].tolist(), passed[kept].tolist(), strict=True)
        return list(chosen), int(ends[-1]) + CHECKSUM_BYTES

    @staticmethod
    def _by_loop(
        data: bytes, kinds: frozenset[int], direction: Direction | None
    ) -> tuple[list[tuple[int, int, bool]], int]:
        found: list[tuple[int, int, bool]] = []
        place = 0
        for payload in sound_frames(data):
            start = place + PREFIX_BYTES
            end = start + len(payload)
            place = end + CHECKSUM_BYTES
            passed = payload[0] in kinds and (direction is not None or is_sip(payload))
            if passed and found and found[-1][2]:
                found.pop()
            found.append((start, end, passed))
        return found, place
