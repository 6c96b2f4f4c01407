"""A log of what signals did, in order of time: in C where the core is, in Python where it is not.

Signals have numbers, in the order in which a person reads them. A row that
comes late (the bits of a character, known at its end) goes where it belongs,
behind those of its time and number.

Invariant: both logs hold the same rows after the same calls.
"""

import ctypes
import os
import struct
import weakref
from bisect import insort
from collections.abc import Iterator
from typing import Protocol

from bluepill_sim.native.library import library
from simbase.timing import Nanos

#: (ns, number of the signal, value).
Row = tuple[Nanos, int, int]
_ROW = struct.Struct("<QII")
#: Pins of five ports; more than all signals (`SIGNALS` of edges.c).
_PINS, _SIGNALS = 80, 256


class EdgeLog(Protocol):
    """What a probe writes to."""

    def put(self, at_ns: Nanos, signal: int, value: int) -> None:
        """Add a row."""
        ...

    def rows(self) -> Iterator[Row]:
        """Iterate over the rows in order of time, then number."""
        ...

    def used(self) -> set[int]:
        """Return the numbers of the signals that have rows."""
        ...


class PythonEdgeLog:
    """A list of rows."""

    def __init__(self) -> None:
        self._rows: list[Row] = []

    def put(self, at_ns: Nanos, signal: int, value: int) -> None:
        """As of `EdgeLog`."""
        rows = self._rows
        if not rows or rows[-1][:2] <= (at_ns, signal):
            rows.append((at_ns, signal, value))
        else:
            insort(rows, (at_ns, signal, value), key=lambda row: row[:2])

    def rows(self) -> Iterator[Row]:
        """As of `EdgeLog`."""
        return iter(self._rows)

    def used(self) -> set[int]:
        """As of `EdgeLog`."""
        return {signal for _, signal, _ in self._rows}


class NativeEdgeLog:
    """Rows in C, where the native core's pins arrive without passing through Python.

    Args:
        bonded: Mask of the pins that have a leg, for each port.
        levels: Value of each pin at the start.
    """

    def __init__(self, bonded: list[int], levels: list[int]) -> None:
        self._calls = calls = library()
        self._log = ctypes.c_void_p(calls.edge_log_new())
        if not self._log.value:
            raise MemoryError("no memory for a log of edges")
        weakref.finalize(self, calls.edge_log_free, self._log)
        self._bonded = (ctypes.c_uint32 * len(bonded))(*bonded)
        #: Value of each pin, by its number.
        self.last = (ctypes.c_uint8 * _PINS)(*levels)

    def put(self, at_ns: Nanos, signal: int, value: int) -> None:
        """As of `EdgeLog`."""
        self._check(self._calls.edge_log_put(self._log, at_ns, signal, value))

    def take(self, core: ctypes.c_void_p, clock: tuple[int, Nanos, int]) -> None:
        """Take over what a core has recorded at (frequency in Hz, base time in ns, base cycle)."""
        frequency_hz, base_ns, base_cycle = clock
        self._check(
            self._calls.edge_log_take(self._log, core, base_ns, base_cycle, frequency_hz, self._bonded, self.last)
        )

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
        """As of `EdgeLog`."""
        size = _ROW.size * self._calls.edge_log_count(self._log)
        return _ROW.iter_unpack(ctypes.string_at(self._calls.edge_log_rows(self._log), size))

    def used(self) -> set[int]:
        """As of `EdgeLog`."""
        flags = (ctypes.c_uint8 * _SIGNALS)()
        self._calls.edge_log_used(self._log, flags)
        return {signal for signal, flag in enumerate(flags) if flag}

    @staticmethod
    def _check(is_done: bool) -> None:
        if not is_done:
            raise MemoryError("no memory for more edges")
