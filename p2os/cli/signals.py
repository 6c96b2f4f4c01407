"""Ctrl-C and SIGTERM as one exception, so that `finally` blocks stop the robot."""

import signal
from types import FrameType


def end_on_signals() -> None:
    """Let SIGINT and SIGTERM raise KeyboardInterrupt.

    SIGINT too: a shell starts background programs deaf to it.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)


def _end(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
