"""What interrupts a program: signals that end it in an orderly way, and work that none of them may cut short.

Python itself raises an exception with Ctrl-C alone; other signals kill at once, and a
robot would drive on until its watchdog stops it. So a program that has a robot ends by
SystemExit on them. A signal with a handler of its own keeps it, and one that was ignored
when the program started (`nohup` and SIGHUP) stays ignored. Ctrl-Z suspends as ever: the
robot's watchdog stops it, and STOP is the first frame when the program goes on.

SIGKILL, SIGSTOP and a power cut cannot be caught. The verbs of `p2os` go further: see
`simbase.command_line.signals`.

Invariant: `held_back` returns, or raises an interrupt, only when its work is done.
"""

import signal
import threading
from collections.abc import Callable
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


def held_back(work: Callable[[], None]) -> None:
    """Do some work to its end; interrupts that come meanwhile are raised afterwards.

    Args:
        work: Is begun again after each interrupt (KeyboardInterrupt, or what else a handler of signals raises),
            so it must know what it has done. It must take a bounded time.

    Raises:
        BaseException: The last interrupt, once the work is done; or at once an Exception of the work itself.
    """
    held: BaseException | None = None
    while True:
        try:
            work()
            break
        except Exception:
            raise
        except BaseException as interrupt:  # noqa: BLE001  # raised below
            held = interrupt
    if held is not None:
        raise held


def _exit(number: int, _frame: FrameType | None) -> None:
    raise SystemExit(128 + number)
