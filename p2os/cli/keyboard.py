"""The keyboard of somebody who watches a robot: keys without a line's end, and any of them as a stop."""

import contextlib
import os
import sys
from collections.abc import Callable, Iterator

from p2os.transport.waiting import wait_readable
from simbase.errors import MissingDependencyError

#: More than anybody types at once.
_MOST_KEYS = 256


@contextlib.contextmanager
def raw_keyboard() -> Iterator[None]:
    """Read keys one by one without echo, and put the terminal back afterwards.

    Raises:
        MissingDependencyError: This system has no Unix terminals.
    """
    try:
        import termios
        import tty
    except ImportError as error:  # pragma: no cover - Windows
        raise MissingDependencyError("teleop needs a Unix terminal", hint="p2os drive") from error
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor, termios.TCSANOW)  # the other ways wait for a terminal that is held
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSANOW, before)


def has_keyboard() -> bool:
    """Tell whether somebody can press keys: standard input is a terminal, and this program not in its background."""
    if sys.stdin is None or sys.stdin.closed or not sys.stdin.isatty() or not hasattr(os, "tcgetpgrp"):
        return False
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # it controls no programs, and so none is in its background
        return True


@contextlib.contextmanager
def any_key_stops() -> Iterator[Callable[[], None]]:
    """Yield what raises KeyboardInterrupt once a key was pressed, or the terminal has gone; at no keyboard nothing.

    It does not wait. Keys that were pressed before count too.
    """
    if not has_keyboard():
        yield lambda: None
        return
    descriptor = sys.stdin.fileno()

    def raise_if_pressed() -> None:
        if wait_readable((descriptor,), 0):
            with contextlib.suppress(OSError):  # what is typed is not for the shell
                os.read(descriptor, _MOST_KEYS)
            raise KeyboardInterrupt("a key")

    with raw_keyboard():
        yield raise_if_pressed
