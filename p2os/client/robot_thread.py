"""The thread behind the blocking robot: it waits for bytes, deadlines and calls, and turns the line.

One lock guards the core. Calls of the program act on the core under it and wake
the thread; the thread notifies `changed` after each turn. The line is opened
outside the lock, for that can take seconds. For asyncio, `RobotLoop` stands in its place.

Closing is the thread's work: signals interrupt the program's own thread only, so
none of them can come between the frames that stop the robot. Where the thread is
held up by a callback, the caller of `finish` does it in its place.

Invariant: `finish` returns after STOP has been written, whatever state the
thread is in and however often it is interrupted.
"""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator

from p2os.client.core import RobotCore
from p2os.client.line import Line, Listeners, Result, Waiting
from p2os.errors import TransportError
from p2os.transport.ports import Transport
from p2os.transport.waiting import BLIND_POLL_S, WakeUp, waits_of
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.errors import P2osError
from simbase.interrupts import held_back
from simbase.timing import Nanos

#: Opens the line that a URL names.
Opener = Callable[[str], Transport]

#: chosen: how long closing may take: a dozen frames at 9600 baud.
CLOSING_S = 2.0
#: chosen: a thread that has not begun to close by then is held up in a callback; two SIP cycles.
HANDOVER_S = 0.2
#: chosen: how often a closing program looks whether that is done.
LOOK_S = 0.002
#: chosen: an ending that cannot have the lock in a second goes on without: a program that was interrupted inside of
#: Python's own `threading` can leave it locked for ever. Several tries: one can run out while the process is stopped.
LOCK_TRIES, LOCK_S = 5, 0.2


class RobotThread:
    """Drives one core on one line, in real time.

    Args:
        core: The client.
        baud: Speed at which a serial line is opened; None for other lines.
        open_line: Opens the line.
        clock: Nanoseconds that never go back, and go on while the machine sleeps.
    """

    def __init__(
        self, core: RobotCore, baud: int | None, open_line: Callable[[], Transport], clock: Clock = wall_clock
    ) -> None:
        self.core = core
        self._lock = threading.RLock()
        self.changed = threading.Condition(self._lock)
        self._line = Line(core, baud, clock)
        self._waits = waits_of(clock)
        self._open_line = open_line
        self._thread: threading.Thread | None = None
        self._wake_up = WakeUp()
        self._failure: BaseException | None = None
        #: Whether the failure was raised in the program.
        self._has_reported = False
        #: The program wants to close; somebody has begun to; the thread is at its end.
        self._is_ending = False
        self._is_closing = False
        self._has_ended = False
        self.listeners = Listeners()

    def start(self) -> None:
        """Begin to move bytes."""
        with self._lock:
            if self._is_ending:
                raise P2osError("this robot was closed", hint="make another Robot")
            if self._thread is None:
                self._thread = threading.Thread(target=self._live, name="p2os-robot", daemon=True)
                self._thread.start()
                self._waits.add(self._thread)

    def run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        """Act on the core, now; what it wants to send leaves at once."""
        with self._lock:
            self._check()
            now = self._line.now()
            self.core.touch(now)
            result = call(self.core, now)
        self._wake_up.ring()
        return result

    def wait_for(self, is_so: Callable[[RobotCore], bool], timeout_s: float | None) -> bool:
        """Wait, under `changed`, until something is so; the deadman does not trip meanwhile."""
        for left_s in self._line.waits(is_so, timeout_s):
            self._check()
            self._waits.wait_for_change(self.changed, left_s)
        return is_so(self.core)

    def do(self, waiting: Waiting[Result]) -> Result:
        """Carry out a call that waits; it is left where waiting ends by an exception."""
        with self.changed, contextlib.closing(waiting):
            try:
                wanted = next(waiting)
                while True:
                    wanted = waiting.send(self.wait_for(*wanted))
            except StopIteration as end:
                result: Result = end.value
                return result

    def finish(self) -> None:
        """Stop the robot, close the session and the line, end the thread; a second call changes nothing.

        Interrupts (Ctrl-C) meanwhile are raised when that is done. From a callback it returns at once, and the
        thread closes when the callback has returned.
        """
        self._is_ending = True  # from here on the thread does it, whatever becomes of the caller
        ends_s = time.monotonic() + CLOSING_S
        held_back(lambda: self._wait_for_the_end(ends_s))

    def raise_failure(self, error: BaseException | None) -> None:
        """Raise what the thread failed with, unless the program fails already or it was raised before."""
        if error is None and self._failure is not None and not self._has_reported:
            raise P2osError(f"the client's thread failed: {self._failure}") from self._failure

    # Closing ------------------------------------------------------------------------------

    def _wait_for_the_end(self, ends_s: float) -> None:
        """Wait until the thread has closed; do it here where the thread cannot.

        It looks at flags and sleeps: an interrupt inside of Python's own events and joins leaves their locks taken.
        """
        self._wake_up.ring()
        if self._thread is threading.current_thread():
            return
        handover_s = min(time.monotonic() + HANDOVER_S, ends_s)
        while self._thread is not None and not self._is_closing and time.monotonic() < handover_s:
            self._waits.look(LOOK_S)
        if not self._is_closing:
            with self._locked():
                self._line.finish()
                self._is_closing = True  # only now: who is interrupted before comes here again
        while self._thread is not None and not self._has_ended and time.monotonic() < ends_s:
            self._waits.look(LOOK_S)
        if not self._has_ended:
            with self._locked():
                self._line.finish()

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        has_lock, tries = self._lock.acquire(timeout=LOCK_S), 1
        while not (has_lock or (self._is_ending and tries >= LOCK_TRIES)):
            has_lock, tries = self._lock.acquire(timeout=LOCK_S), tries + 1
        try:
            yield
        finally:
            if has_lock:
                self._lock.release()

    # The thread ---------------------------------------------------------------------------

    def _live(self) -> None:
        try:
            while not self._turn():
                self._wait()
        except BaseException as error:  # noqa: BLE001  # whatever it is: the robot stops, the program gets it
            self._failure = error
        finally:
            with self._locked():
                self._is_closing = True
                self._line.finish()
            try:
                self._line.log_end()  # before the program goes on: whoever has closed finds it written
            finally:
                with self._locked():
                    self._has_ended = True
                    with contextlib.suppress(RuntimeError):  # without the lock nobody is notified; their waits time out
                        self.changed.notify_all()

    def _turn(self) -> bool:
        """Do what is due; return whether all is over."""
        with self._locked():
            if self._is_ending and not self._is_closing:
                self._is_closing = True
                self.core.close(self._line.now())
            self._line.turn()
            wants_line = self._line.is_wanted
            news = self._line.take_news()
            self.listeners.keep(news)
            if news:
                self.changed.notify_all()
        self._line.log(news)  # without the lock, as callbacks
        self.listeners.call(news)
        if wants_line:
            self._open()
        return self._is_closing and self._line.is_over

    def _open(self) -> None:
        try:
            transport = self._open_line()
        except Exception as error:  # noqa: BLE001  # an opener may raise anything; the wait for it has to end
            with self._locked():
                self._line.failed(error)
        else:
            with self._locked():
                self._line.opened(transport)
        self._wake_up.ring()

    def _wait(self) -> None:
        """Sleep until bytes, a deadline or a call."""
        with self._locked():
            wait_s, transport = self._line.wait_s(), self._line.transport
            waiting: list[int] = [self._wake_up.fileno()]
            if transport is not None:
                try:
                    waiting.append(transport.fileno())
                except TransportError:
                    wait_s = min(wait_s, BLIND_POLL_S)
        self._waits.wait_readable(waiting, wait_s)
        self._wake_up.clear()

    def _check(self) -> None:
        if self._failure is not None:
            self._has_reported = True
            raise P2osError(f"the client's thread failed: {self._failure}") from self._failure
