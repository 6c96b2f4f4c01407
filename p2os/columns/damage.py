"""What was wrong with a capture: the decoder's counters, from the columns' side.

Invariant: equal to `p2os.wire.DecoderStats` of a decoder that was fed the same bytes and left alone.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.columns.framing import Bytes, Indexes, crosses, headers
from p2os.wire.frame import CHECKSUM_BYTES, HEADER, MAX_COUNT, MIN_COUNT, PREFIX_BYTES

Flags: TypeAlias = npt.NDArray[np.bool_]


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
    first, last = starts - PREFIX_BYTES, ends + CHECKSUM_BYTES
    rejected = _rejected(data, first, last, pauses)
    stalled, illegal = rejected.stalled, rejected.illegal
    reach = np.maximum.accumulate(np.where(stalled, rejected.limits, rejected.places + rejected.sizes))
    before = np.searchsorted(rejected.places, first)
    rescued = np.concatenate(([0], reach))[before] > first
    return Damage(
        noise_bytes=len(data) - int((last - first).sum()),
        bad_checksums=int((~illegal & ~stalled).sum()),
        bad_counts=int(illegal.sum()),
        stalled=int(stalled.sum()),
        rescued=int(rescued.sum()),
    )


def stalls_of(data: Bytes, starts: Indexes, ends: Indexes, pauses: Indexes | None) -> tuple[Indexes, Indexes]:
    """Return where frames begin whose rest never came, and for each the end of what had come when it was given up."""
    rejected = _rejected(data, starts - PREFIX_BYTES, ends + CHECKSUM_BYTES, pauses)
    return rejected.places[rejected.stalled], rejected.limits[rejected.stalled]


@dataclass(frozen=True, slots=True)
class _Rejected:
    """The headers outside all sound frames, in their order."""

    places: Indexes
    #: The end of what had come when the line fell silent.
    limits: Indexes
    #: Bytes that were looked at as one frame.
    sizes: Indexes
    illegal: Flags
    stalled: Flags


def _rejected(data: Bytes, first: Indexes, last: Indexes, pauses: Indexes | None) -> _Rejected:
    quiet = np.array([*([] if pauses is None else pauses), len(data)], np.int64)
    places = _outside(_headers(data, quiet), first, last)
    limits = quiet[np.searchsorted(quiet, places, side="right")]
    counted = places + 2 < limits
    counts = np.zeros(len(places), np.int64)
    counts[counted] = data[places[counted] + 2]
    illegal = counted & ((counts < MIN_COUNT) | (counts > MAX_COUNT))
    sizes = np.where(illegal, PREFIX_BYTES, counts + PREFIX_BYTES)
    return _Rejected(places, limits, sizes, illegal, ~counted | (~illegal & (places + sizes > limits)))


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
