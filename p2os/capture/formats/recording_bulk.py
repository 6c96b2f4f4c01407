"""Lines of our recordings many at a time, by their bytes: `recording.plain_block` without an object a word.

Three to four times as fast, measured on 200,000 lines of one SIP each. Needs NumPy.

Invariant: what is returned is what `plain_block` returns.
"""

from array import array
from binascii import unhexlify
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import Block
from p2os.capture.formats.recording import MOST_DIGITS, PLAIN_DIRECTIONS, chunk_words

_BEFORE_TIME, _BEFORE_WORD, _BEFORE_HEX, _END = (np.frombuffer(word, np.uint8) for word in chunk_words())
_WORD_BYTES = 3
Bytes: TypeAlias = npt.NDArray[np.uint8]
Indexes: TypeAlias = npt.NDArray[np.int64]
_NEWLINE, _RETURN, _ZERO, _COMMA = b"\n\r0,"


def plain_lines(lines: bytes) -> Block | None:
    """Return what whole lines hold if each is spelled as `chunk_line` does."""
    data = np.frombuffer(lines, np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view
    ends = np.flatnonzero(data == _NEWLINE)
    if not len(ends) or ends[-1] != len(data) - 1:
        return None
    starts = np.concatenate(([0], ends[:-1] + 1))
    longest = len(_BEFORE_TIME) + MOST_DIGITS + len(_BEFORE_WORD) + _WORD_BYTES + len(_BEFORE_HEX) + len(_END)
    ends = ends - (data[np.maximum(ends - 1, 0)] == _RETURN)
    data = np.concatenate((data, np.zeros(longest, np.uint8)))
    places = starts + len(_BEFORE_TIME)
    digits = (windows(data, MOST_DIGITS + 1)[places] == _COMMA).argmax(axis=1)
    at_ns = _times(data, places, digits)
    if at_ns is None:
        return None
    places = places + digits
    words = places + len(_BEFORE_WORD)
    texts = words + _WORD_BYTES + len(_BEFORE_HEX)
    sizes = ends - len(_END) - texts
    is_plain = (
        (sizes > 0).all() and not (sizes & 1).any()
        and (windows(data, len(_BEFORE_TIME))[starts] == _BEFORE_TIME).all()
        and (windows(data, len(_BEFORE_WORD))[places] == _BEFORE_WORD).all()
        and (windows(data, len(_BEFORE_HEX))[words + _WORD_BYTES] == _BEFORE_HEX).all()
        and (windows(data, len(_END))[texts + sizes] == _END).all()
    )  # fmt: skip
    directions = windows(data, _WORD_BYTES)[words]
    known = [(directions == np.frombuffer(word, np.uint8)).all(axis=1) for word in PLAIN_DIRECTIONS]
    if not is_plain or not np.logical_or.reduce(known).all():
        return None
    pieces = [lines[begin:end] for begin, end in zip(texts.tolist(), (texts + sizes).tolist(), strict=True)]
    try:
        whole = unhexlify(b"".join(pieces))
    except ValueError:
        return None
    return Block(
        at_ns=array("q", at_ns.tobytes()), senders=np.ascontiguousarray(directions[:, 0]).tobytes(),
        ends=array("q", np.cumsum(sizes >> 1).tobytes()), data=whole,
    )  # fmt: skip


def _times(data: Bytes, places: Indexes, digits: Indexes) -> Indexes | None:
    """Return the numbers of so many digits at some places, or None where one is no number."""
    found = np.zeros(len(places), np.int64)
    for count in np.unique(digits).tolist():
        mine = np.flatnonzero(digits == count)
        values = np.lib.stride_tricks.sliding_window_view(data, max(count, 1))[places[mine]] - np.uint8(_ZERO)
        if not count or (values > 9).any():
            return None
        # Fifteen digits are exact in 64-bit floats.
        found[mine] = values @ 10.0 ** np.arange(count - 1, -1, -1)
    return found
