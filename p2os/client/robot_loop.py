"""The event loop's own readers and timers turn the line of the asyncio robot, so there is no thread.

Lines are opened in the loop's executor. While the loop is blocked nothing is sent;
when it goes on, STOP is the first frame.

The event loop refers to a `RobotLoop` only, never to the `Robot`: so a robot that the
program drops is collected, and that stops it. The end of `asyncio.run` does too.

Invariant: every way out, cancellation included, writes STOP before the line is closed.
"""

import asyncio
import contextlib
from collections.abc import Callable

from p2os.client.core import RobotCore
from p2os.client.line import TOUCH_S, Line, Listeners, Result, Waiting
from p2os.client.robot_thread import CLOSING_S
from p2os.errors import TransportError
from p2os.transport.ports import Transport
from p2os.transport.waiting import BLIND_POLL_S
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.errors import P2osError
from simbase.timing import Nanos


class RobotLoop:
    """Drives one core on one line by an event loop's readers and timers.

    Args:
        core: The client.
        baud: Speed at which a serial line is opened; None for other lines.
        open_line: Opens the line; called in the loop's executor.
        clock: Nanoseconds that never go back, and go on while the machine sleeps.
    """

    def __init__(
        self, core: RobotCore, baud: int | None, open_line: Callable[[], Transport], clock: Clock = wall_clock
    ) -> None:
        self.core = core
        self.listeners = Listeners()
        self.failure: BaseException | None = None
        #: Whether the failure was raised in the program.
        self.has_reported = False
        self._line = Line(core, baud, clock)
        self._open_line = open_line
        self._loop: asyncio.AbstractEventLoop | None = None
        self._end_task: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._watched: int | None = None
        self._opening: asyncio.Task[None] | None = None
        self._is_closed = self._is_finished = False

    def start(self) -> None:
        """Begin to move bytes in the running loop.

        Raises:
            P2osError: The robot was closed.
        """
        if self._is_closed:
            raise P2osError("this robot was closed", hint="make another Robot")
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
            self._end_task = self._loop.create_task(self._until_cancelled())

    def run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        """Act on the core, now; what it wants to send leaves at once."""
        self.check()
        now = self._line.now()
        self.core.touch(now)
        result = call(self.core, now)
        self._turn()
        return result

    async def do(self, waiting: Waiting[Result]) -> Result:
        """Carry out a call that waits; it is left where waiting ends by an exception."""
        with contextlib.closing(waiting):
            try:
                is_so, timeout_s = next(waiting)
                while True:
                    for left_s in self._line.waits(is_so, timeout_s):
                        self.check()
                        await _changes(self._changed, left_s)
                    is_so, timeout_s = waiting.send(is_so(self.core))
            except StopIteration as end:
                result: Result = end.value
                return result

    async def close(self) -> None:
        """Stop the robot, end the session, give the line back; whatever comes between, `finish` does the rest."""
        try:
            if not self._is_closed:
                self._is_closed = True
                self.core.close(self._line.now())
                self._turn()  # STOP is out before anything can interrupt
            if self._loop is not None and not self._loop.is_running():
                return  # a coroutine that has outlived its loop is thrown away: nobody can wait
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(CLOSING_S):
                    while not (self._line.is_over or self._is_finished) and self.failure is None:
                        await _changes(self._changed, TOUCH_S)
        finally:
            self.finish()

    def finish(self) -> None:
        """Give everything back, with or without a loop; where closing could not come to its end, STOP goes first."""
        self._is_closed = True
        try:
            self._line.finish()
        finally:
            was_finished, self._is_finished = self._is_finished, True
            if self._loop is not None and not self._loop.is_closed():
                self._let_go_of_loop()
                self._changed.set()  # in a loop that was closed nobody waits any more
            if not was_finished:
                self._line.log_end()

    def check(self) -> None:
        """Raise what the client failed with.

        Raises:
            P2osError: It failed.
        """
        if self.failure is not None:
            self.has_reported = True
            raise P2osError(f"the client failed: {self.failure}") from self.failure

    async def _until_cancelled(self) -> None:
        """Wait for the loop's end: `asyncio.run` cancels what is left."""
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            self.finish()

    def _let_go_of_loop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._unwatch()
        end_task, self._end_task = self._end_task, None
        if end_task is not None:
            end_task.cancel()

    def _turn(self) -> None:
        """Do what is due, notify the program, and arrange the next turn."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        try:
            self._line.turn()
            self._notify()
        except BaseException as error:
            self.failure = error
            self.finish()
            if not isinstance(error, Exception):
                raise
            return
        if self._line.is_wanted and self._opening is None:
            self._opening = asyncio.ensure_future(self._open())
        self._arrange()

    def _arrange(self) -> None:
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        transport, wait_s = self._line.transport, self._line.wait_s()
        descriptor = None
        if transport is not None:
            try:
                descriptor = transport.fileno()
            except TransportError:
                wait_s = min(wait_s, BLIND_POLL_S)
        if descriptor != self._watched:
            self._unwatch()
            if descriptor is not None:
                loop.add_reader(descriptor, self._turn)
                self._watched = descriptor
        if not self._line.is_over:
            self._timer = loop.call_later(wait_s, self._turn)

    def _notify(self) -> None:
        news = self._line.take_news()
        self._line.log(news)
        self.listeners.keep(news)
        self.listeners.call(news)
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def _open(self) -> None:
        try:
            transport = await asyncio.get_running_loop().run_in_executor(None, self._open_line)
        except Exception as error:  # noqa: BLE001  # an opener may raise anything; the wait for it has to end
            self._line.failed(error)
        else:
            self._line.opened(transport)
        self._opening = None
        self._turn()

    def _unwatch(self) -> None:
        if self._watched is not None and self._loop is not None:
            self._loop.remove_reader(self._watched)
            self._watched = None


async def _changes(changed: asyncio.Event, longest_s: float) -> None:
    """Wait for a change, at most so long.

    `asyncio.wait_for` of Python 3.11 swallows a cancellation that comes together with the change.
    """
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(longest_s):
            await changed.wait()
