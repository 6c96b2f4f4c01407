"""Pieces of bytes that stand apart, copied together: a loop over their sizes, and none over the pieces."""

import numpy as np
import numpy.typing as npt

from p2os.capture.columns.framing import Bytes, Flags, Indexes

#: chosen: where there are more sizes than one in so many pieces, a copy of each takes less time.
_PIECES_OF_A_SIZE = 8


def joined(data: bytes, starts: Indexes, sizes: Indexes) -> bytes:
    """Return so many bytes from each start on, joined; all of them stand in the data."""
    if np.count_nonzero(np.bincount(sizes)) * _PIECES_OF_A_SIZE > len(sizes):
        ends = (starts + sizes).tolist()
        return b"".join([data[start:end] for start, end in zip(starts.tolist(), ends, strict=True)])
    return gather_items(np.frombuffer(data, np.uint8), starts, sizes, np.dtype([("byte", "u1")]))[0].tobytes()


def gather(data: Bytes, starts: Indexes, dtype: np.dtype[np.void], sound: Flags | None) -> npt.NDArray[np.void]:
    """Return one record a start; zeros where a packet is not sound."""
    size = dtype.itemsize
    if len(data) < size:
        return np.zeros(len(starts), dtype)
    # Every place of the data seen as the start of a block of bytes: taking blocks is one copy each.
    blocks = np.ndarray((len(data) - size + 1,), f"V{size}", data, strides=(1,))
    if sound is None or sound.all():
        return blocks[starts].view(dtype)
    records = np.zeros(len(starts), dtype)
    records[sound] = blocks[starts[sound]].view(dtype)
    return records


def gather_items(
    data: Bytes, starts: Indexes, counts: Indexes, dtype: np.dtype[np.void]
) -> tuple[npt.NDArray[np.void], Indexes]:
    """Return so many records from each start on, and where those of each start begin."""
    offsets, size = offsets_of(counts), dtype.itemsize
    total = int(offsets[-1])
    items = np.empty(total, dtype)
    # Packets with as many records are copied together, the records of each in one piece.
    for count in np.flatnonzero(np.bincount(counts, minlength=1)).tolist():
        if count:
            rows = np.flatnonzero(counts == count)
            source = np.ndarray((len(data) - count * size + 1,), f"V{count * size}", data, strides=(1,))
            target = np.ndarray((total - count + 1,), f"V{count * size}", items, strides=(size,))
            target[offsets[rows]] = source[starts[rows]]
    return items, offsets


def offsets_of(counts: Indexes) -> Indexes:
    """Return where the items of each row begin, and one past the last."""
    offsets: Indexes = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


def indexes_of(starts: Indexes, counts: Indexes) -> Indexes:
    """Return the places `start`, `start + 1`, ... of each start, as many as its count says."""
    offsets = offsets_of(counts)
    return np.repeat(starts - offsets[:-1], counts) + np.arange(offsets[-1])
