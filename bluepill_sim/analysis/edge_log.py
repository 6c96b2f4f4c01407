"""A log of what signals did, in order of time; it is kept in C (`extension/source/fabric/edges.c`).

Signals have numbers, in the order in which a person reads them. A row that
comes late (the bits of a character, known at its end) goes where it belongs,
behind those of its time and number.
"""

import ctypes
import os
import struct
import weakref
from collections.abc import Iterator, Sequence

from bluepill_sim.extension.library import library, made
from bluepill_sim.fabric.subscriptions import EDGE
from simbase.timing import Nanos

#: (ns, number of the signal, value).
Row = tuple[Nanos, int, int]
_ROW = struct.Struct("<QII")
#: More than all signals, pins and lines (`SIGNALS` of edges.c).
_SIGNALS = 256


class EdgeLog:
    """Rows in C, where those of a subscription arrive without passing through Python one by one.

    Args:
        signals: The number of the signal of each pin, and of each line behind the pins.
        values: The value of each signal at the start.
    """

    def __init__(self, signals: Sequence[int], values: Sequence[int]) -> None:
        self._calls = calls = library()
        self._log = ctypes.c_void_p(made(calls.edge_log_new(), "a log of edges"))
        weakref.finalize(self, calls.edge_log_free, self._log)
        self._signals = (ctypes.c_uint8 * _SIGNALS)(*signals)
        #: Value of each signal, by its number.
        self.last = (ctypes.c_uint8 * _SIGNALS)(*values)

    def put(self, at_ns: Nanos, signal: int, value: int) -> None:
        """Add a row."""
        made(self._calls.edge_log_put(self._log, at_ns, signal, value), "more edges")

    def take(self, rows: bytes) -> None:
        """Take rows of a subscription over."""
        taken = self._calls.edge_log_take(self._log, rows, len(rows) // EDGE.size, self._signals, self.last)
        made(taken, "more edges")

    def write(self, path: bytes, codes: list[str], first_word: int, span: tuple[Nanos, Nanos]) -> None:
        """Append the changes to a value change dump.

        Raises:
            OSError: The file cannot be written.
        """
        texts = (ctypes.c_char_p * len(codes))(*(code.encode() for code in codes))
        error = self._calls.edge_log_write(self._log, path, texts, first_word, *span)
        if error:
            raise OSError(error, os.strerror(error))

    def rows(self) -> Iterator[Row]:
        """Iterate over the rows in order of time, then number."""
        size = _ROW.size * self._calls.edge_log_count(self._log)
        return _ROW.iter_unpack(ctypes.string_at(self._calls.edge_log_rows(self._log), size))

    def used(self) -> set[int]:
        """Return the numbers of the signals that have rows."""
        flags = (ctypes.c_uint8 * _SIGNALS)()
        self._calls.edge_log_used(self._log, flags)
        return {signal for signal, flag in enumerate(flags) if flag}
