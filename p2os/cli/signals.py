"""Ctrl-C, SIGTERM and a closed terminal as one exception, so that `finally` blocks stop the robot."""

import signal
from types import FrameType


def end_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt.

    SIGINT too: a shell starts background programs deaf to it. SIGHUP comes when the
    terminal is closed; `nohup` makes a program deaf to it, and it stays so.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    hang_up = getattr(signal, "SIGHUP", None)  # Windows has none
    if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
        signal.signal(hang_up, _end)


def _end(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
