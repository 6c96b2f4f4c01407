"""The asyncio `Robot`: the same calls, waiting with `await`.

    async with Robot("tcp:127.0.0.1:8101") as robot:
        await robot.drive(0.5)

All decisions are `RobotCore`'s; the event loop's own readers and timers turn the
line, so there is no thread. Lines are opened in the loop's executor. While the
loop is blocked nothing is sent; when it goes on, STOP is the first frame.

The event loop refers to a `RobotLoop` only, never to the `Robot`: so a robot that the
program drops is collected, and that stops it. The end of `asyncio.run` does too.

Invariant: every way out, cancellation included, writes STOP before the line is closed.
"""

import asyncio
import contextlib
import math
import weakref
from collections.abc import AsyncIterator, Callable
from types import TracebackType
from typing import Self

from p2os.client.aux_ports import AsyncAux
from p2os.client.calls import RobotCalls
from p2os.client.core import PacketType, RobotCore
from p2os.client.goals import Axis, DriveAxis, MotionResult, TurnAxis, as_number
from p2os.client.line import (
    TOUCH_S,
    Line,
    Listeners,
    Result,
    Waiting,
    connecting,
    core_for,
    fetching,
    newer_state,
    next_notice,
    next_state,
    opening,
    reaching,
    sleeping,
)
from p2os.client.notices import Notice
from p2os.client.robot_state import RobotState
from p2os.client.robot_thread import CLOSING_S, Opener
from p2os.client.settings import DEADMAN_S, ClientSettings
from p2os.errors import TransportError
from p2os.robots.parameters import RobotParameters
from p2os.transport import open_url
from p2os.transport.ports import Transport
from p2os.transport.waiting import BLIND_POLL_S
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.errors import P2osError
from simbase.interrupts import exit_on_signals
from simbase.timing import NS_PER_S, Nanos

__all__ = ["Robot"]


class Robot(RobotCalls):
    """A P2OS robot on a line; arguments as those of the blocking `p2os.Robot`."""

    def __init__(
        self,
        url: str,
        *,
        model: str | RobotParameters | None = None,
        auto_enable: bool = True,
        reconnect: bool = True,
        deadman_s: float | None = DEADMAN_S,
        settings: ClientSettings | None = None,
        opener: Opener = open_url,
        clock: Clock = wall_clock,
    ) -> None:
        core, baud = core_for(
            url, model=model, auto_enable=auto_enable, reconnect=reconnect, deadman_s=deadman_s, settings=settings
        )
        self.url = url
        self._clock = clock
        self._core = core
        self._robot_loop = RobotLoop(core, baud, lambda: opener(url), clock)
        self._finalizer = weakref.finalize(self, self._robot_loop.finish)

    # Coming and going ---------------------------------------------------------------------

    async def connect(self) -> Self:
        """Find the robot and open its session; otherwise as `p2os.Robot.connect`.

        Raises:
            ConnectError: the line cannot be opened, or no robot answers.
        """
        exit_on_signals()
        self._robot_loop.start()
        try:
            self._run(lambda core, now: core.connect(now))
            await self._robot_loop.do(connecting(self._core))
        except BaseException:
            await self.close()
            raise
        return self

    async def close(self) -> None:
        """Stop the robot, end the session, give the line back; a second call changes nothing."""
        await self._robot_loop.close()

    async def __aenter__(self) -> Self:
        return await self.connect()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        await self.close()
        if error is None and not self._robot_loop.has_reported:
            self._robot_loop.check()

    # Waiting ------------------------------------------------------------------------------

    async def sleep(self, duration_s: float) -> None:
        """Do nothing for so long, without tripping the deadman: held speeds go on."""
        await self._robot_loop.do(sleeping(duration_s))

    async def next_state(self, timeout_s: float = 2.0) -> RobotState:
        """Wait for the next packet and return its state.

        Raises:
            LinkLostError: none came in time.
        """
        return await self._robot_loop.do(next_state(self._core, timeout_s))

    async def fetch(self, kind: type[PacketType], timeout_s: float = 1.0) -> PacketType:
        """Ask the robot for a packet of a type, and return it; otherwise as `p2os.Robot.fetch`."""
        return await self._robot_loop.do(fetching(self._core, kind, timeout_s, self.send))

    async def wait_open(self, timeout_s: float | None = None) -> None:
        """Wait until the session is open again after a loss.

        Raises:
            LinkLostError: it is not, in time or for good.
        """
        await self._robot_loop.do(opening(self._core, timeout_s))

    async def states(self, lasts_s: float | None = None) -> AsyncIterator[RobotState]:
        """Yield each new state as it comes, the newest where the program is slow.

        Ends when the client does, and after `lasts_s` seconds, also while the robot is lost; None: never.
        """
        last: RobotState | None = None
        ends = None if lasts_s is None else self._clock() + round(lasts_s * NS_PER_S)
        while ends is None or self._clock() < ends:
            left_s = None if ends is None else (ends - self._clock()) / NS_PER_S
            last = await self._robot_loop.do(newer_state(self._core, last, left_s))
            if last is None:
                return
            yield last

    async def events(self) -> AsyncIterator[Notice]:
        """Yield what happens beside the states, from now on, in order; ends when the client does."""
        with self._robot_loop.listeners.queue() as queue:
            while (notice := await self._robot_loop.do(next_notice(queue))) is not None:
                yield notice

    def on_state(self, callback: Callable[[RobotState], None]) -> Callable[[], None]:
        """Call `callback` with each state, in the loop; return what ends that.

        An exception in it stops the robot and is raised in the program's next call.
        """
        return self._robot_loop.listeners.on_state(callback)

    def on_event(self, callback: Callable[[Notice], None]) -> Callable[[], None]:
        """Call `callback` with what happens beside the states; otherwise as `on_state`."""
        return self._robot_loop.listeners.on_event(callback)

    # Motion that waits --------------------------------------------------------------------

    async def drive(
        self, distance_m: float, *, speed_mps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Drive straight and return when the robot has arrived and stands; otherwise as `p2os.Robot.drive`.

        A task that is cancelled meanwhile stops the robot.
        """
        return await self._reach(DriveAxis(distance_m), speed_mps, timeout_s)

    async def turn(
        self, angle_rad: float, *, speed_radps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Turn on the spot and return when the robot stands; otherwise as `p2os.Robot.turn`."""
        return await self._reach(TurnAxis(angle_rad), speed_radps, timeout_s)

    async def turn_to(
        self, heading_rad: float, *, speed_radps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Turn the shorter way to a heading of the pose's frame."""
        angle_rad = math.remainder(as_number(heading_rad, "turn_to", "radians") - self.pose.heading_rad, 2 * math.pi)
        return await self.turn(angle_rad, speed_radps=speed_radps, timeout_s=timeout_s)

    async def _reach(self, axis: Axis, speed: float | None, timeout_s: float | None) -> MotionResult:
        return await self._robot_loop.do(reaching(self._core, axis, speed, timeout_s, self._run))

    # The robot's own serial ports ---------------------------------------------------------

    def aux(self, port: int = 1) -> AsyncAux:
        """Return one of the robot's own serial ports, as a file of bytes whose calls are awaited."""
        return AsyncAux(port, send=self.send, subscribe=self.on_event, do=self._robot_loop.do)

    def _run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        return self._robot_loop.run(call)


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
            self._changed.set()
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
        if loop is None:
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
