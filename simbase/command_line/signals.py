"""Every signal that would kill the program ends it in an orderly way instead, so that `finally` blocks stop the robot.

Theory of operation. The first signal raises KeyboardInterrupt in the main thread,
with the signal's name as its argument. From then on the program is ending, and
further signals mean nothing for `ENDING_NS`: whoever presses Ctrl-C twice, or
closes a terminal that sends SIGHUP after SIGTERM, does not cut the stopping
short. One that comes later raises again: an ending that takes so long hangs.

Where an exception would be unsafe (a robot is being released, a part of the bench is
half-way through a slice) the signal waits: `postponed`.

SIGKILL, SIGSTOP and a power cut cannot be caught: the robot's own watchdog, or
what takes its place, stops it then.

Invariant: the handlers themselves are the only state; who puts others in their
place has ended it.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from time import monotonic_ns
from types import FrameType, TracebackType
from typing import Self

from simbase.interrupts import FATAL, signal_numbers
from simbase.timing import NS_PER_S, Nanos

#: Caught even where they are ignored: shells start background programs with the keyboard's two ignored.
ALWAYS_CAUGHT = frozenset({"SIGINT", "SIGQUIT", "SIGTERM"})
#: Ctrl-Z would leave a robot driving by its last command; a program that holds one ends instead.
SUSPENDING = ("SIGTSTP",)
#: A program that holds a robot must not be suspended for writing to its terminal in the background.
IGNORED = ("SIGTTOU",)
#: chosen: releasing a robot takes two seconds at most; a second more, and it hangs.
ENDING_NS: Nanos = 3 * NS_PER_S


class _Ending:
    """The end of this program, once a signal asks for it."""

    def __init__(self) -> None:
        #: How many `postponed` blocks are open.
        self.postponements = 0
        #: The signal that waits for their end.
        self.waiting: str | None = None
        self._began_at: Nanos | None = None

    def handle(self, number: int, _frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt, or note that it is to be raised."""
        now, name = monotonic_ns(), signal.Signals(number).name
        if self._began_at is None:
            self._began_at = now
            if self.postponements:
                self.waiting = name
                return
        elif now - self._began_at < ENDING_NS:
            return
        self.waiting = None
        raise KeyboardInterrupt(name)


def end_on_signals() -> None:
    """Let each of `FATAL` end the program in an orderly way; once is enough.

    One that was ignored when this program started stays so (`nohup` and SIGHUP), except `ALWAYS_CAUGHT`.
    """
    if threading.current_thread() is threading.main_thread() and _present() is None:
        _catch(_Ending(), FATAL)


def end_on_suspension() -> None:
    """From now on, let Ctrl-Z end the program too, and let nothing else suspend it by way of its terminal."""
    ending = _present()
    if threading.current_thread() is not threading.main_thread() or ending is None:
        return
    _catch(ending, SUSPENDING)
    for number in signal_numbers(IGNORED):
        signal.signal(number, signal.SIG_IGN)


def ignore_signals() -> None:
    """Let nothing interrupt the end of the process: all is done."""
    if threading.current_thread() is threading.main_thread():
        for number in signal_numbers(FATAL):
            signal.signal(number, signal.SIG_IGN)


@contextlib.contextmanager
def restored_signals() -> Iterator[None]:
    """Put the handlers back that were there before, at the end of the block."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in signal_numbers(FATAL + SUSPENDING + IGNORED)}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: not set by Python, and not to be set by it
                signal.signal(number, handler)


class postponed:  # noqa: N801  # reads as `with postponed():`
    """A block that signals do not interrupt: what came meanwhile ends the program when it is left."""

    def __enter__(self) -> Self:
        self._ending = _present() if threading.current_thread() is threading.main_thread() else None
        if self._ending is not None:
            self._ending.postponements += 1
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if self._ending is not None:
            self._ending.postponements -= 1
            if not self._ending.postponements:
                self.raise_due()

    def raise_due(self) -> None:
        """Let a signal that waits end the program now: this is a good moment.

        Raises:
            KeyboardInterrupt: One does; its argument is the signal's name.
        """
        if self._ending is not None and self._ending.waiting is not None:
            name, self._ending.waiting = self._ending.waiting, None
            raise KeyboardInterrupt(name)


def _catch(ending: _Ending, names: tuple[str, ...]) -> None:
    for number in signal_numbers(names):
        if number.name in ALWAYS_CAUGHT or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, ending.handle)


def _present() -> _Ending | None:
    owner = getattr(signal.getsignal(signal.SIGINT), "__self__", None)
    return owner if isinstance(owner, _Ending) else None
