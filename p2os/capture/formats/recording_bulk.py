"""Lines of our recordings many at a time, by their bytes: `recording.recorded_parts` without an object a line.

Ten times as fast, measured on 400,000 lines of one SIP each. Needs NumPy.

Invariant: what is returned is what `recorded_parts` yields.
"""

from array import array
from binascii import unhexlify
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import ChunkBlock, Direction
from p2os.capture.columns.gathering import gather, joined
from p2os.capture.formats.recording import chunk_words

_BEFORE_TIME, _BEFORE_WORD, _BEFORE_HEX, _END = chunk_words()
_WORDS = [np.frombuffer(direction.value.encode("ascii"), np.uint8) for direction in Direction]
_WORD_BYTES = 3
#: The longest time below `recording.LONGEST_NS`.
MOST_DIGITS = 15
Bytes: TypeAlias = npt.NDArray[np.uint8]
Indexes: TypeAlias = npt.NDArray[np.int64]
_NEWLINE, _RETURN, _ZERO, _COMMA = b"\n\r0,"


def plain_lines(lines: bytes) -> ChunkBlock | None:
    """Return what whole lines hold if each is spelled as `chunk_line` does."""
    data = np.frombuffer(lines, np.uint8)
    ends = np.flatnonzero(data == _NEWLINE)
    if not len(ends) or ends[-1] != len(data) - 1:
        return None
    starts = np.concatenate(([0], ends[:-1] + 1))
    ends = ends - (data[np.maximum(ends - 1, 0)] == _RETURN)
    heads = _heads(data, starts, ends)
    if heads is None:
        return None
    at_ns, senders, texts = heads
    sizes = ends - len(_END) - texts
    if not sizes.all() or (sizes & 1).any() or (_rows(data, texts + sizes, len(_END)) != list(_END)).any():
        return None
    try:
        whole = unhexlify(joined(lines, texts, sizes))
    except ValueError:
        return None
    return ChunkBlock(
        at_ns=array("q", at_ns.tobytes()), senders=senders.tobytes(), ends=array("q", np.cumsum(sizes >> 1).tobytes()),
        data=whole, is_in_order=bool((at_ns[1:] >= at_ns[:-1]).all()),
    )  # fmt: skip


def _heads(data: Bytes, starts: Indexes, ends: Indexes) -> tuple[Indexes, Bytes, Indexes] | None:
    """Return the time and the sender of each line and where its bytes begin, or None where one begins otherwise."""
    at_ns, texts, senders = np.zeros_like(starts), np.zeros_like(starts), np.zeros(len(starts), np.uint8)
    rest = np.arange(len(starts))
    while len(rest):
        # Lines whose times have as many digits as the first are alike up to their bytes.
        begin = int(starts[rest[0]]) + len(_BEFORE_TIME)
        digits = max(0, data[begin : begin + MOST_DIGITS + 1].tobytes().find(_COMMA))
        alike = data[np.minimum(starts[rest] + (len(_BEFORE_TIME) + digits), len(data) - 1)] == _COMMA
        mine, rest = rest[alike], rest[~alike]
        head = _Head(digits)
        # Shorter ones do not hold their own end.
        is_short = (ends[mine] - starts[mine] < head.size + len(_END)).any()
        read = None if digits < 1 or is_short else head.read(data, starts[mine])
        if read is None:
            return None
        at_ns[mine], senders[mine] = read
        texts[mine] = starts[mine] + head.size
    return at_ns, senders, texts


class _Head:
    """What a line begins with whose time has so many digits."""

    def __init__(self, digits: int) -> None:
        pieces = (_BEFORE_TIME, bytes(digits), _BEFORE_WORD, bytes(_WORD_BYTES), _BEFORE_HEX)
        whole = b"".join(pieces)
        self.size = len(whole)
        self._bytes = np.frombuffer(whole, np.uint8)
        self._is_fixed = self._bytes != 0
        self._digits = slice(len(_BEFORE_TIME), len(_BEFORE_TIME) + digits)
        word_at = self._digits.stop + len(_BEFORE_WORD)
        self._word = slice(word_at, word_at + _WORD_BYTES)
        self._powers = 10.0 ** np.arange(digits - 1, -1, -1)

    def read(self, data: Bytes, starts: Indexes) -> tuple[Indexes, Bytes] | None:
        """Return the time and the sender of each line, or None where one does not begin so."""
        rows = _rows(data, starts, self.size)
        if ((rows != self._bytes).any(axis=0) & self._is_fixed).any():
            return None
        digits, words = rows[:, self._digits] - np.uint8(_ZERO), rows[:, self._word]
        is_known = np.logical_or.reduce([(words == word).all(axis=1) for word in _WORDS])
        if (digits > 9).any() or not is_known.all():
            return None
        # Fifteen digits are exact in 64-bit floats.
        return (digits @ self._powers).astype(np.int64), words[:, 0]


def _rows(data: Bytes, starts: Indexes, size: int) -> Bytes:
    """Return so many bytes from each start on, a row each."""
    rows: Bytes = gather(data, starts, np.dtype([("bytes", "u1", (size,))]), None)["bytes"]
    return rows
