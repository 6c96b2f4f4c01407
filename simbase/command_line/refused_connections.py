"""Connections that `simbase.listening` refuses, as lines on standard error: for every verb that listens."""

import contextlib
import logging
import sys
import time
from collections.abc import Iterator

from simbase.listening import LOGGER

#: chosen: of a page that tries a thousand times so many lines a second are enough.
MOST_A_SECOND = 5


@contextlib.contextmanager
def shown_refusals(program: str) -> Iterator[None]:
    """Show each refusal in the block.

    Args:
        program: How it was called, which lines begin with.
    """
    log, handler = logging.getLogger(LOGGER), _Lines(program)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


class _Lines(logging.Handler):
    """Writes records to whatever standard error is then."""

    def __init__(self, program: str) -> None:
        super().__init__(logging.WARNING)
        self._program = program
        self._second, self._written, self._left_out = -1, 0, 0

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record, or count it where its second is full."""
        second = int(time.monotonic())
        if second != self._second:
            self._second, self._written = second, 0
        if self._written >= MOST_A_SECOND:
            self._left_out += 1
            return
        self._written += 1
        with contextlib.suppress(OSError):  # nobody reads it
            if self._left_out:
                sys.stderr.write(f"{self._program}: {self._left_out} connections more were refused\n")
                self._left_out = 0
            sys.stderr.write(f"{self._program}: {record.getMessage()}\n")
            sys.stderr.flush()
