"""What was wrong with a capture: the decoder's counters, from the columns' side.

Invariant: equal to `p2os.wire.DecoderStats` of a decoder that was fed the same bytes and left alone.
"""

from dataclasses import dataclass

import numpy as np

from p2os.columns.framing import Bytes, Indexes, crosses, headers
from p2os.wire.frame import CHECKSUM_BYTES, HEADER, MAX_COUNT, MIN_COUNT, PREFIX_BYTES


@dataclass(frozen=True, slots=True, kw_only=True)
class Damage:
    """Counts of what was rejected; of bytes where the name says so."""

    noise_bytes: int
    bad_checksums: int
    bad_counts: int
    #: Frames whose rest never came, or came too late.
    stalled: int
    #: Frames found among the bytes of a rejected one.
    rescued: int


def damage_of(data: Bytes, starts: Indexes, ends: Indexes, pauses: Indexes | None) -> Damage:
    """Return what was wrong.

    Args:
        data: The capture.
        starts: Of the payloads of its sound frames.
        ends: Of the same.
        pauses: As `find_frames` takes them.
    """
    quiet = np.array([*([] if pauses is None else pauses), len(data)], np.int64)
    first, last = starts - PREFIX_BYTES, ends + CHECKSUM_BYTES
    places = _outside(_headers(data, quiet), first, last)
    limits = quiet[np.searchsorted(quiet, places, side="right")]
    counted = places + 2 < limits
    counts = np.zeros(len(places), np.int64)
    counts[counted] = data[places[counted] + 2]
    illegal = counted & ((counts < MIN_COUNT) | (counts > MAX_COUNT))
    sizes = np.where(illegal, PREFIX_BYTES, counts + PREFIX_BYTES)
    stalls = ~counted | (~illegal & (places + sizes > limits))
    reach = np.maximum.accumulate(np.where(stalls, limits, places + sizes))
    before = np.searchsorted(places, first)
    rescued = np.concatenate(([0], reach))[before] > first
    return Damage(
        noise_bytes=len(data) - int((last - first).sum()),
        bad_checksums=int((~illegal & ~stalls).sum()),
        bad_counts=int(illegal.sum()),
        stalled=int(stalls.sum()),
        rescued=int(rescued.sum()),
    )


def _headers(data: Bytes, quiet: Indexes) -> Indexes:
    """Return the places of headers that no pause cuts, and of a lone first byte before a pause."""
    whole = headers(data)
    whole = whole[~crosses(quiet, whole, whole + 2)]
    final = np.unique(quiet[quiet > 0]) - 1
    return np.union1d(whole, final[data[final] == HEADER[0]])


def _outside(places: Indexes, first: Indexes, last: Indexes) -> Indexes:
    """Return the places that no sound frame covers."""
    frame = np.searchsorted(first, places, side="right") - 1
    return places[np.concatenate((last, [0]))[frame] <= places]
