"""The thread behind the blocking robot: it waits for bytes, deadlines and calls, and turns the line.

One lock guards the core. Calls of the program act on the core under it and ring
a bell that wakes the thread; the thread tells `changed` after each turn. The
line is opened outside the lock, for that can take seconds.

Invariant: `shut_down` returns after STOP has been written, whatever state the
thread is in.
"""

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from p2os.client.calls import Result
from p2os.client.core import RobotCore
from p2os.client.line import Line
from p2os.client.notices import Notice
from p2os.client.snapshots import RobotState
from p2os.errors import P2osError, TransportError
from p2os.timing import NS_PER_S, Nanos
from p2os.transport.ports import Transport

#: Opens the line that a URL names.
Opener = Callable[[str], Transport]

#: chosen: the longest sleep of an idle thread.
LONGEST_WAIT_S = 0.5
#: chosen: how often a line without a descriptor is asked for bytes.
BLIND_POLL_S = 0.001
#: chosen: how long closing may take: a dozen frames at 9600 baud.
CLOSING_S = 2.0
#: How many notices wait for a slow reader.
MOST_NOTICES = 1000
#: A waiting program is known to live: it is asked so often.
SIGN_OF_LIFE_S = 0.25


class Engine:
    """Drives one core on one line, in real time.

    Args:
        core: The client.
        baud: Speed at which a serial line is opened; None for other lines.
        open_line: Opens the line.
        clock: Nanoseconds that only go forward.
    """

    def __init__(
        self,
        core: RobotCore,
        baud: int | None,
        open_line: Callable[[], Transport],
        clock: Callable[[], Nanos] = time.monotonic_ns,
    ) -> None:
        self.core = core
        self.changed = threading.Condition(threading.RLock())
        self._line = Line(core, baud)
        self._open_line = open_line
        self._clock = clock
        self._thread: threading.Thread | None = None
        self._bell, self._bell_push = socket.socketpair()
        self._bell.setblocking(False)
        self._bell_push.setblocking(False)
        self._failure: BaseException | None = None
        #: Whether the program has met the failure.
        self._has_told = False
        self._is_ending = False
        self._queues: list[deque[Notice]] = []
        self._state_callbacks: list[Callable[[RobotState], None]] = []
        self._event_callbacks: list[Callable[[Notice], None]] = []

    def start(self) -> None:
        """Begin to move bytes."""
        with self.changed:
            if self._is_ending:
                raise P2osError("this robot was closed", hint="make another Robot")
            if self._thread is None:
                self._thread = threading.Thread(target=self._live, name="p2os-robot", daemon=True)
                self._thread.start()

    def call(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        """Act on the core, now; what it wants to send leaves at once."""
        with self.changed:
            self._check()
            now = self._clock()
            self.core.touch(now)
            result = call(self.core, now)
        self._ring()
        return result

    def wait_for(self, is_so: Callable[[RobotCore], bool], timeout_s: float | None) -> bool:
        """Wait, under `changed`, until something is so; the program is known to live meanwhile."""
        ends = None if timeout_s is None else self._clock() + round(timeout_s * NS_PER_S)
        while not is_so(self.core):
            self._check()
            now = self._clock()
            self.core.touch(now)
            if ends is not None and now >= ends:
                return False
            left = SIGN_OF_LIFE_S if ends is None else min(SIGN_OF_LIFE_S, (ends - now) / NS_PER_S)
            self.changed.wait(left)
        return True

    def shut_down(self) -> None:
        """Stop the robot, close the session and the line, end the thread."""
        with self.changed:
            if self._is_ending:
                return
            self._is_ending = True
            with contextlib.suppress(P2osError):
                now = self._clock()
                self.core.close(now)
                self._line.write(now)  # STOP is out before anything else can go wrong
        self._ring()
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(CLOSING_S)
        with self.changed:
            self._line.close()
            self.changed.notify_all()

    def raise_failure(self, error: BaseException | None) -> None:
        """Raise what the thread failed with, unless the program fails already or has met it."""
        if error is None and self._failure is not None and not self._has_told:
            raise P2osError(f"the client's thread failed: {self._failure}") from self._failure

    # Listeners ----------------------------------------------------------------------------

    def subscribe(self) -> deque[Notice]:
        """Return a queue that gets every notice from now on."""
        queue: deque[Notice] = deque(maxlen=MOST_NOTICES)
        with self.changed:
            self._queues.append(queue)
        return queue

    def unsubscribe(self, queue: deque[Notice]) -> None:
        """Give a queue back."""
        with self.changed:
            self._queues = [other for other in self._queues if other is not queue]

    def on_state(self, callback: Callable[[RobotState], None]) -> Callable[[], None]:
        """Call `callback` with each state."""
        return self._listen(self._state_callbacks, callback)

    def on_event(self, callback: Callable[[Notice], None]) -> Callable[[], None]:
        """Call `callback` with each notice."""
        return self._listen(self._event_callbacks, callback)

    def _listen(self, callbacks: list[Any], callback: Callable[..., None]) -> Callable[[], None]:
        with self.changed:
            callbacks.append(callback)

        def end() -> None:
            with self.changed, contextlib.suppress(ValueError):
                callbacks.remove(callback)

        return end

    # The thread ---------------------------------------------------------------------------

    def _live(self) -> None:
        try:
            while not self._turn():
                self._wait()
        except BaseException as error:  # noqa: BLE001  # whatever it is: the robot stops, the program is told
            self._fail(error)
        finally:
            with self.changed:
                self._line.close()
                self.changed.notify_all()

    def _turn(self) -> bool:
        """Do what is due; return whether all is over."""
        with self.changed:
            self._line.turn(self._clock())
            wants_line = self._line.is_wanted
            news = self._take_news()
        self._tell(news)
        if wants_line:
            self._open()
        with self.changed:
            return self._is_ending and self._line.is_over

    def _open(self) -> None:
        try:
            transport = self._open_line()
        except P2osError as error:
            with self.changed:
                self._line.failed(error, self._clock())
        else:
            with self.changed:
                self._line.opened(transport, self._clock())
        self._ring()

    def _take_news(self) -> list[RobotState | Notice]:
        news = list(self.core.news)
        self.core.news.clear()
        for item in news:
            if not isinstance(item, RobotState):
                for queue in self._queues:
                    queue.append(item)
        if news:
            self.changed.notify_all()
        return news

    def _tell(self, news: list[RobotState | Notice]) -> None:
        """Call the callbacks, without the lock."""
        for item in news:
            if isinstance(item, RobotState):
                for on_state in tuple(self._state_callbacks):
                    on_state(item)
            else:
                for on_event in tuple(self._event_callbacks):
                    on_event(item)

    def _wait(self) -> None:
        """Sleep until bytes, a deadline or a call."""
        with self.changed:
            wake, transport = self._line.next_wake(), self._line.transport
            waits = [LONGEST_WAIT_S]
            if wake is not None:
                waits.append(max(wake - self._clock(), 0) / NS_PER_S)
            waiting: list[int] = [self._bell.fileno()]
            if transport is not None:
                try:
                    waiting.append(transport.fileno())
                except TransportError:
                    waits.append(BLIND_POLL_S)
        select.select(waiting, [], [], min(waits))
        with contextlib.suppress(BlockingIOError):
            self._bell.recv(4096)

    def _fail(self, error: BaseException) -> None:
        with self.changed:
            self._failure = error
            now = self._clock()
            with contextlib.suppress(Exception):
                self.core.close(now)
                while not self.core.is_quiet:  # no thread is left to space the frames: they go now
                    due = self.core.next_deadline()
                    self._line.write(now if due is None else max(now, due))
            self.changed.notify_all()

    def _check(self) -> None:
        if self._failure is not None:
            self._has_told = True
            raise P2osError(f"the client's thread failed: {self._failure}") from self._failure

    def _ring(self) -> None:
        with contextlib.suppress(OSError):  # full: it wakes anyway
            self._bell_push.send(b"\0")
