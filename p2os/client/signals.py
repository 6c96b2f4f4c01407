"""Signals that would kill a program at once end it in good order once it has a robot: the robot is stopped first.

Python itself does so with Ctrl-C alone. Whoever handles a signal in a way of their own keeps it, and one that the
program was made deaf to (`nohup` and SIGHUP) stays so. Ctrl-Z suspends as ever: the robot's watchdog stops it, and
STOP is the first frame when the program goes on.

SIGKILL, SIGSTOP and a power cut cannot be caught.
"""

import signal
import threading
from types import FrameType

#: What kills a program that does not handle it, by name: not every system has each.
FATAL = (
    "SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGVTALRM", "SIGPROF", "SIGXCPU",
    "SIGPOLL", "SIGPWR", "SIGSTKFLT",
)  # fmt: skip


def signal_numbers(names: tuple[str, ...]) -> list[signal.Signals]:
    """Return those of some signals that this system has."""
    return [number for name in names if (number := getattr(signal, name, None)) is not None]


def exit_on_signals() -> None:
    """Let each of `FATAL` that nobody handles raise SystemExit, with the exit code of a shell: 128 and its number.

    Only a program's main thread can; in others nothing is changed.
    """
    if threading.current_thread() is not threading.main_thread():
        return
    for number in signal_numbers(FATAL):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _exit)


def _exit(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
