"""The asyncio `Robot`: the same calls, waiting with `await`.

    async with Robot("tcp:127.0.0.1:8101") as robot:
        await robot.drive(0.5)

All decisions are `RobotCore`'s; the loop's own readers and timers turn the
line, so there is no thread. Lines are opened in the loop's executor. While the
loop is blocked nothing is sent, and the robot's watchdog stops it.
"""

import asyncio
import contextlib
import math
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from types import TracebackType
from typing import Self

from p2os.client.aux_async import AsyncAux
from p2os.client.calls import Result, RobotCalls
from p2os.client.core import RobotCore
from p2os.client.engine import BLIND_POLL_S, CLOSING_S, MOST_NOTICES, SIGN_OF_LIFE_S, Opener
from p2os.client.goals import Axis, DriveAxis, MotionResult, TurnAxis
from p2os.client.line import Line
from p2os.client.notices import Notice
from p2os.client.opening import core_for, motion_result, no_answer, not_connected, not_found
from p2os.client.requests import PacketType, request_for
from p2os.client.settings import ClientSettings
from p2os.client.snapshots import Link, RobotState
from p2os.errors import P2osError, TransportError
from p2os.parameters import RobotParameters
from p2os.timing import NS_PER_S, Nanos
from p2os.transport import open_url
from p2os.transport.ports import Transport


class Robot(RobotCalls):
    """A P2OS robot on a line; arguments as those of the blocking `p2os.Robot`."""

    def __init__(
        self,
        url: str,
        *,
        model: str | RobotParameters | None = None,
        auto_enable: bool = True,
        reconnect: bool = True,
        deadman_s: float | None = 2.0,
        settings: ClientSettings | None = None,
        opener: Opener = open_url,
    ) -> None:
        self._core, baud = core_for(
            url, model=model, auto_enable=auto_enable, reconnect=reconnect, deadman_s=deadman_s, settings=settings
        )
        self.url = url
        self._opener = opener
        self._line = Line(self._core, baud)
        self._changed = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None
        self._watched: int | None = None
        self._opening: asyncio.Task[None] | None = None
        self._is_closed = False
        self._queues: list[deque[Notice]] = []
        self._state_callbacks: list[Callable[[RobotState], None]] = []
        self._event_callbacks: list[Callable[[Notice], None]] = []
        self._failure: BaseException | None = None
        #: Whether the program has met the failure.
        self._has_told = False

    # Coming and going ---------------------------------------------------------------------

    async def connect(self) -> Self:
        """Find the robot and open its session; otherwise as `p2os.Robot.connect`.

        Raises:
            ConnectError: the line cannot be opened, or no robot answers.
        """
        try:
            self._run(lambda core, now: core.connect(now))
            await self._wait_for(lambda core: core.is_ready or core.link in {Link.FAILED, Link.CLOSED}, None)
            if not self._core.is_ready:
                raise not_found(self._core)  # noqa: TRY301  # closing is the same for every way out
        except BaseException:
            await self.close()
            raise
        return self

    async def close(self) -> None:
        """Stop the robot, end the session, give the line back; twice is harmless."""
        if self._is_closed:
            return
        self._is_closed = True
        self._core.close(self._now())
        self._turn()  # STOP is out before anything can interrupt
        try:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(CLOSING_S):
                    await self._drain()
        finally:
            self._end()

    async def __aenter__(self) -> Self:
        return await self.connect()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        await self.close()
        if error is None and not self._has_told:
            self._check()

    # Waiting ------------------------------------------------------------------------------

    async def sleep(self, duration_s: float) -> None:
        """Do nothing for so long, and be known to live: held speeds go on."""
        await self._wait_for(lambda _: False, duration_s)

    async def next_state(self, timeout_s: float = 2.0) -> RobotState:
        """Wait for the next packet and return its state.

        Raises:
            LinkLostError: none came in time.
        """
        before = self._core.state
        await self._wait_for(lambda core: core.state is not before, timeout_s)
        state = self._core.state
        if state is None or state is before:
            raise not_connected(self._core)
        return state

    async def fetch(self, kind: type[PacketType], timeout_s: float = 1.0) -> PacketType:
        """Ask the robot for a packet of a type, and return it; otherwise as `p2os.Robot.fetch`."""
        before = self._core.newest(kind)
        self.send(request_for(kind))
        if not await self._wait_for(lambda core: core.newest(kind) is not before, timeout_s):
            raise no_answer(self._core, kind, timeout_s)
        packet = self._core.newest(kind)
        if packet is None:
            raise not_connected(self._core)
        return packet

    async def wait_open(self, timeout_s: float | None = None) -> None:
        """Wait until the session is open again after a loss.

        Raises:
            LinkLostError: it is not, in time or for good.
        """
        await self._wait_for(lambda core: core.link in {Link.OPEN, Link.FAILED, Link.CLOSED}, timeout_s)
        if self._core.link is not Link.OPEN:
            raise not_connected(self._core)

    async def states(self) -> AsyncIterator[RobotState]:
        """Yield each new state as it comes, the newest where the program is slow; ends when the client does."""
        last: RobotState | None = None
        while True:
            await self._wait_for(lambda core, seen=last: core.state is not seen or _is_over(core), None)  # type: ignore[misc]  # bound now
            state = self._core.state
            if state is None or state is last:
                return
            last = state
            yield state

    async def events(self) -> AsyncIterator[Notice]:
        """Yield what happens beside the states, from now on, in order; ends when the client does."""
        queue: deque[Notice] = deque(maxlen=MOST_NOTICES)
        self._queues.append(queue)
        try:
            while True:
                await self._wait_for(lambda core: bool(queue) or _is_over(core), None)
                if not queue:
                    return
                yield queue.popleft()
        finally:
            self._queues = [other for other in self._queues if other is not queue]

    def on_state(self, callback: Callable[[RobotState], None]) -> Callable[[], None]:
        """Call `callback` with each state, in the loop; return what ends that.

        An exception in it stops the robot and is raised in the program's next call.
        """
        self._state_callbacks.append(callback)
        return lambda: _remove(self._state_callbacks, callback)

    def on_event(self, callback: Callable[[Notice], None]) -> Callable[[], None]:
        """Call `callback` with what happens beside the states; otherwise as `on_state`."""
        self._event_callbacks.append(callback)
        return lambda: _remove(self._event_callbacks, callback)

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
        angle_rad = math.remainder(heading_rad - self.pose.heading_rad, 2 * math.pi)
        return await self.turn(angle_rad, speed_radps=speed_radps, timeout_s=timeout_s)

    async def _reach(self, axis: Axis, speed: float | None, timeout_s: float | None) -> MotionResult:
        limit_ns = None if timeout_s is None else round(timeout_s * NS_PER_S)
        goal = self._run(lambda core, now: core.begin_goal(axis, limit_ns, speed, now))
        try:
            await self._wait_for(lambda _: goal.ended is not None, None)
        finally:
            if goal.ended is None and self._failure is None:
                self._run(lambda core, now: core.cancel_goal(goal, now))
        return motion_result(goal, self._core)

    # The robot's own serial ports ---------------------------------------------------------

    def aux(self, port: int = 1) -> AsyncAux:
        """Return one of the robot's own serial ports, as a file of bytes whose calls are awaited."""
        return AsyncAux(port, send=self.send, listen=self.on_event, wait_for=self._wait_for)

    # The loop -----------------------------------------------------------------------------

    def _run(self, call: Callable[[RobotCore, Nanos], Result]) -> Result:
        self._check()
        now = self._now()
        self._core.touch(now)
        result = call(self._core, now)
        self._turn()
        return result

    async def _wait_for(self, is_so: Callable[[RobotCore], bool], timeout_s: float | None) -> bool:
        ends = None if timeout_s is None else self._now() + round(timeout_s * NS_PER_S)
        while not is_so(self._core):
            self._check()
            now = self._now()
            self._core.touch(now)
            if ends is not None and now >= ends:
                return False
            left = SIGN_OF_LIFE_S if ends is None else min(SIGN_OF_LIFE_S, (ends - now) / NS_PER_S)
            changed = self._changed
            await _changes(changed, left)
        return True

    def _turn(self) -> None:
        """Do what is due, tell the news, and arrange to be woken."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        try:
            self._line.turn(self._now())
            self._tell()
        except BaseException as error:
            self._failure = error
            self._end()
            if not isinstance(error, Exception):
                raise
            return
        if self._line.is_wanted and self._opening is None:
            self._opening = asyncio.ensure_future(self._open())
        self._arrange()

    def _arrange(self) -> None:
        loop = asyncio.get_running_loop()
        transport, wake = self._line.transport, self._line.next_wake()
        descriptor, waits = None, []
        if transport is not None:
            try:
                descriptor = transport.fileno()
            except TransportError:
                waits.append(BLIND_POLL_S)
        if descriptor != self._watched:
            self._unwatch()
            if descriptor is not None:
                loop.add_reader(descriptor, self._turn)
                self._watched = descriptor
        if wake is not None:
            waits.append(max(wake - self._now(), 0) / NS_PER_S)
        if waits:
            self._timer = loop.call_later(min(waits), self._turn)

    def _tell(self) -> None:
        news = list(self._core.news)
        self._core.news.clear()
        for item in news:
            if isinstance(item, RobotState):
                for on_state in tuple(self._state_callbacks):
                    on_state(item)
                continue
            for queue in self._queues:
                queue.append(item)
            for on_event in tuple(self._event_callbacks):
                on_event(item)
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            transport: Transport = await loop.run_in_executor(None, self._opener, self.url)
        except P2osError as error:
            self._line.failed(error, self._now())
        else:
            self._line.opened(transport, self._now())
        self._opening = None
        self._turn()

    async def _drain(self) -> None:
        """Wait until all that closing says has gone out."""
        while not self._line.is_over and self._failure is None:
            changed = self._changed
            await _changes(changed, SIGN_OF_LIFE_S)

    def _end(self) -> None:
        """Give everything back; where closing could not come to its end, STOP first."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = self._now()
        with contextlib.suppress(Exception):
            self._core.close(now)
            while not self._core.is_quiet:  # nothing is left to space the frames: they go now
                due = self._core.next_deadline()
                self._line.write(now if due is None else max(now, due))
        self._unwatch()
        self._line.close()
        self._changed.set()

    def _unwatch(self) -> None:
        if self._watched is not None:
            asyncio.get_running_loop().remove_reader(self._watched)
            self._watched = None

    def _check(self) -> None:
        if self._failure is not None:
            self._has_told = True
            raise P2osError(f"the client failed: {self._failure}") from self._failure

    def _now(self) -> Nanos:
        return time.monotonic_ns()


async def _changes(changed: asyncio.Event, longest_s: float) -> None:
    """Wait for a change, at most so long.

    `asyncio.wait_for` of Python 3.11 swallows a cancellation that comes together with the change.
    """
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(longest_s):
            await changed.wait()


def _is_over(core: RobotCore) -> bool:
    return core.link in {Link.CLOSED, Link.FAILED}


def _remove(callbacks: list[Callable[..., None]], callback: Callable[..., None]) -> None:
    with contextlib.suppress(ValueError):
        callbacks.remove(callback)
