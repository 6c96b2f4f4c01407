"""Where an operator gives orders to running robots: the terminal, or a line that programs open.

What the orders mean is in `orders`; one operator at a time is served.
"""

import contextlib
import os
import sys
from collections.abc import Callable, Sequence

from p2os.errors import TransportError
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.orders import LONGEST_LINE, execute
from p2os.transport.ports import READ_BYTES, HungUpError, Listener, Transport
from p2os.transport.waiting import wait_readable


def write_stderr(text: str) -> None:
    """Write a text to standard error at once."""
    sys.stderr.write(text)
    sys.stderr.flush()


class Terminal:
    """Standard input as a line: orders are typed, answers go to standard error.

    Args:
        write: Takes the answers' text; an OSError of it ends the line.
    """

    description = "the terminal"

    def __init__(self, write: Callable[[str], object] = write_stderr) -> None:
        self._write = write

    def read(self) -> bytes:
        """Return what was typed."""
        if not self.is_ours() or not wait_readable((0,), 0):
            return b""
        try:
            data = os.read(0, READ_BYTES)
        except OSError as error:
            raise HungUpError(f"the terminal is gone: {error.strerror}") from error
        if not data:
            raise HungUpError("the terminal has ended")
        return data

    def write(self, data: bytes) -> None:
        """Show an answer."""
        try:
            self._write(data.decode())
        except OSError as error:
            raise HungUpError(f"the terminal is gone: {error.strerror}") from error

    def fileno(self) -> int:
        """Return standard input."""
        return 0

    def set_baud(self, _baud: int) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Leave standard input open."""

    @staticmethod
    def is_ours() -> bool:
        """Tell whether we may read: a program in the background that reads its terminal is stopped."""
        try:
            return not os.isatty(0) or os.tcgetpgrp(0) == os.getpgrp()
        except (OSError, AttributeError):  # Windows has no process groups
            return False


class ControlLine:
    """Takes orders, one a line, from one operator at a time.

    Args:
        listener: Where the operator connects; None takes standard input.
        write: Takes the answers where standard input is taken.
    """

    def __init__(self, listener: Listener | None, write: Callable[[str], object] = write_stderr) -> None:
        self._listener = listener
        self._operator: Transport | None = Terminal(write) if listener is None else None
        self._buffer = b""

    @property
    def poll_s(self) -> float | None:
        """Return how often to poll for an operator; None where a descriptor shows it."""
        return None if self._operator is not None or self._listener is None else self._listener.poll_s

    def descriptors(self) -> list[int]:
        """Return the descriptors that become readable when there is something to do."""
        if isinstance(self._operator, Terminal) and not self._operator.is_ours():
            return []
        found = None
        if self._operator is not None:
            found = self._operator.fileno()
        elif self._listener is not None:
            found = self._listener.fileno()
        return [] if found is None else [found]

    def serve(self, hosts: Sequence[Host]) -> bool:
        """Take the lines that have come and answer them; return whether there were any."""
        if self._operator is None and self._listener is not None:
            self._operator, self._buffer = self._listener.accept(), b""
        if self._operator is None:
            return False
        try:
            data = self._operator.read()
            *lines, self._buffer = (self._buffer + data).replace(b"\r", b"\n").split(b"\n")
            self._buffer = self._buffer[-LONGEST_LINE:]
            orders = [line[:LONGEST_LINE].decode(errors="replace") for line in lines if line.strip()]
            for line in orders:
                self._operator.write("".join(f"{row}\n" for row in execute(hosts, line)).encode())
        except TransportError:
            self._close_line()
            return False
        return bool(orders)

    def close(self) -> None:
        """Close the operator's line and give the place back."""
        self._close_line()
        if self._listener is not None:
            self._listener.close()

    def _close_line(self) -> None:
        if self._operator is not None:
            with contextlib.suppress(TransportError):
                self._operator.close()
            self._operator = None
