"""Frames of a whole capture at once: where each sound frame stands, and what was wrong, without a loop over bytes.

The result is that of the decoder of `p2os.protocol.frames` fed with the same bytes and then
left alone until it gives up: rejected frames are scanned again, frames inside
sound frames are not looked for. What the frames hold is read in `p2os.capture.columns.tables`.

Theory of operation. Every place with `FA FB`, a legal count and room for the frame is a
candidate. A prefix sum of pairs, modulo 2^32, gives each candidate's checksum as
a difference of two numbers. Of candidates that overlap (rare: a frame within a
payload) the first wins.

Invariants: the frames are in the order of the stream and do not overlap; `RejectedCounts` equals the
`p2os.protocol.frames.DecoderStats` of a decoder that was fed the same bytes and left alone.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.protocol.frames import CHECKSUM_BYTES, HEADER, MAX_COUNT, MIN_COUNT, PREFIX_BYTES

Bytes: TypeAlias = npt.NDArray[np.uint8]
Indexes: TypeAlias = npt.NDArray[np.int64]
Halves: TypeAlias = npt.NDArray[np.uint16]

#: chosen: a block's arrays stay in the processor's cache.
BLOCK_BYTES = 1 << 16
LARGEST_FRAME = MAX_COUNT + PREFIX_BYTES


def find_frames(data: Bytes, *, pauses: Indexes | None = None, block: int = BLOCK_BYTES) -> tuple[Indexes, Indexes]:
    """Return where the payload of each sound frame starts, and where it ends.

    Args:
        data: The bytes of one direction of a conversation.
        pauses: Places, in rising order, before which the line was quiet for so long (`p2os.protocol.frames.GIVE_UP_NS`)
            that a frame across them had been given up; None where no times are known.
        block: How many bytes are looked at together; any size gives the same result.

    Returns:
        Two arrays of the same length: first byte of the payload (the packet type), and one past its last.
    """
    starts: list[Indexes] = []
    ends: list[Indexes] = []
    place = 0
    while place < len(data):
        # Frames that begin in this block may end behind it.
        part = data[place : place + block + LARGEST_FRAME]
        found, sizes = _sound_frames(part, block)
        if pauses is not None and len(pauses):
            whole = ~crosses(pauses, found + place, found + (place + PREFIX_BYTES + CHECKSUM_BYTES) + sizes)
            found, sizes = found[whole], sizes[whole]
        found, sizes = _without_overlaps(found, sizes)
        starts.append(found + (place + PREFIX_BYTES))
        ends.append(found + (place + PREFIX_BYTES) + sizes)
        last = int(found[-1] + sizes[-1]) + PREFIX_BYTES + CHECKSUM_BYTES if len(found) else 0
        place += max(block, last)
    if not starts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return np.concatenate(starts), np.concatenate(ends)


def headers(data: Bytes) -> Indexes:
    """Return the places of `FA FB`."""
    first = data[:-1] == HEADER[0]
    first &= data[1:] == HEADER[1]
    return np.flatnonzero(first)


def crosses(pauses: Indexes, starts: Indexes, ends: Indexes) -> npt.NDArray[np.bool_]:
    """Tell which runs of bytes have a pause between their first byte and their last."""
    return np.not_equal(np.searchsorted(pauses, starts, side="right"), np.searchsorted(pauses, ends))


def _sound_frames(part: Bytes, block: int) -> tuple[Indexes, Indexes]:
    """Return where the sound frames begin that begin in the first `block` bytes, and the sizes of their payloads."""
    places = headers(part[: min(block + 1, len(part) - 1)])
    counts = part[places + 2].astype(np.int64)
    good = (counts >= MIN_COUNT) & (counts <= MAX_COUNT) & (places + PREFIX_BYTES + counts <= len(part))
    if not good.all():
        places, counts = places[good], counts[good]
    sizes = counts - CHECKSUM_BYTES
    good = stated(part, places + PREFIX_BYTES + sizes) == checksums(part, places + PREFIX_BYTES, sizes)
    if not good.all():
        places, sizes = places[good], sizes[good]
    return places, sizes


def stated(part: Bytes, places: Indexes) -> Halves:
    """Return the checksums that stand in the stream, high byte first."""
    high: Halves = part[places].astype(np.uint16)
    high <<= 8
    high |= part[places + 1]
    return high


def checksums(part: Bytes, starts: Indexes, sizes: Indexes) -> Halves:
    """Return the checksums of payloads, which have their count before and a checksum behind them.

    One prefix sum over the pairs that begin at even places serves all. The pairs
    are read low byte first, as `even + 256 * odd`. A difference of the sum then
    has in its upper half the checksum of what begins at an odd place, with one
    outer byte too many on either side, and in its lower half the sum of the odd
    bytes alone; 256 times the upper half plus the lower one is the checksum of
    what begins at an even place.
    """
    pairs = part[: len(part) & ~1].view("<u2").astype(np.uint32)
    sums = np.zeros(len(pairs) + 1, np.uint32)
    np.add.accumulate((pairs << 16) + (pairs >> 8), out=sums[1:])
    whole = starts + (sizes & ~1)
    found = sums[(whole + 1) >> 1] - sums[starts >> 1]
    upper, last = found >> 16, part[whole]
    outer = (last.astype(np.uint32) << 8) + part[starts - 1]
    totals: Halves = np.where(starts & 1, upper - outer, (upper << 8) + found).astype(np.uint16)
    totals ^= last * (sizes & 1).astype(np.uint8)
    return totals


def _without_overlaps(places: Indexes, sizes: Indexes) -> tuple[Indexes, Indexes]:
    """Return the frames without those that begin inside one before."""
    ends = places + sizes + (PREFIX_BYTES + CHECKSUM_BYTES)
    inside = np.flatnonzero(places[1:] < ends[:-1])
    if not len(inside):
        return places, sizes
    keep = np.ones(len(places), bool)
    for number in inside.tolist():
        if keep[number]:
            following = number + 1
            while following < len(places) and places[following] < ends[number]:
                keep[following] = False
                following += 1
    return places[keep], sizes[keep]


Flags: TypeAlias = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedCounts:
    """Counts of what was rejected; of bytes where the name ends so."""

    noise_bytes: int
    bad_checksums: int
    bad_counts: int
    #: Frames whose rest never came, or came too late.
    stalled: int
    #: Frames found among the bytes of a rejected one.
    rescued: int


def damage_of(data: Bytes, starts: Indexes, ends: Indexes, pauses: Indexes | None) -> RejectedCounts:
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
    return RejectedCounts(
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
    places = _headers_between(data, np.concatenate(([0], last)), np.concatenate((first, [len(data)])), quiet)
    limits = quiet[np.searchsorted(quiet, places, side="right")]
    counted = places + 2 < limits
    counts = np.zeros(len(places), np.int64)
    counts[counted] = data[places[counted] + 2]
    illegal = counted & ((counts < MIN_COUNT) | (counts > MAX_COUNT))
    sizes = np.where(illegal, PREFIX_BYTES, counts + PREFIX_BYTES)
    return _Rejected(places, limits, sizes, illegal, ~counted | (~illegal & (places + sizes > limits)))


def _headers_between(data: Bytes, starts: Indexes, ends: Indexes, quiet: Indexes) -> Indexes:
    """Return the places of headers that no pause cuts, and of a lone first byte before a pause, in some gaps."""
    gaps = starts < ends
    starts, sizes = starts[gaps], (ends - starts)[gaps]
    places = np.repeat(starts - (np.cumsum(sizes) - sizes), sizes) + np.arange(sizes.sum())
    places = places[data[places] == HEADER[0]]
    behind = places + 1
    is_whole = data[np.minimum(behind, len(data) - 1)] == HEADER[1]
    found: Indexes = places[is_whole | np.isin(behind, quiet)]
    return found
