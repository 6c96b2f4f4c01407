"""The asyncio `Robot`: the same calls, waiting with `await`.

    async with Robot("tcp:127.0.0.1:8101") as robot:
        await robot.drive(0.5)

All decisions are `RobotCore`'s; a `RobotLoop` turns the line by the event loop, so there is no thread.
"""

from collections.abc import AsyncIterator
from types import TracebackType
from typing import Self

from p2os.client.aux_ports import AsyncAux
from p2os.client.calls import RobotCalls
from p2os.client.core import PacketType
from p2os.client.goals import DriveAxis, MotionAxis, MotionResult, TurnAxis
from p2os.client.line import (
    connecting,
    fetching,
    newer_state,
    next_notice,
    next_state,
    opening,
    reaching,
    sleeping,
)
from p2os.client.notices import Notice
from p2os.client.robot_loop import RobotLoop
from p2os.client.robot_state import RobotState
from simbase.interrupts import exit_on_signals
from simbase.timing import NS_PER_S

__all__ = ["Robot"]


class Robot(RobotCalls):
    """A P2OS robot on a line; arguments as those of the blocking `p2os.Robot`."""

    _runner_type = RobotLoop
    _runner: RobotLoop

    # Coming and going ---------------------------------------------------------------------

    async def connect(self) -> Self:
        """Find the robot and open its session; otherwise as `p2os.Robot.connect`.

        Raises:
            ConnectError: the line cannot be opened, or no robot answers.
        """
        exit_on_signals()
        self._runner.start()
        try:
            self._run(lambda core, now: core.connect(now))
            await self._runner.do(connecting(self._core))
        except BaseException:
            await self.close()
            raise
        return self

    async def close(self) -> None:
        """Stop the robot, end the session, give the line back; a second call changes nothing."""
        await self._runner.close()

    async def __aenter__(self) -> Self:
        return await self.connect()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        await self.close()
        if error is None and not self._runner.has_reported:
            self._runner.check()

    # Waiting ------------------------------------------------------------------------------

    async def sleep(self, duration_s: float) -> None:
        """Do nothing for so long, without tripping the deadman: held speeds go on."""
        await self._runner.do(sleeping(duration_s))

    async def next_state(self, timeout_s: float = 2.0) -> RobotState:
        """Wait for the next packet and return its state.

        Raises:
            LinkLostError: none came in time.
        """
        return await self._runner.do(next_state(self._core, timeout_s))

    async def fetch(self, kind: type[PacketType], timeout_s: float = 1.0) -> PacketType:
        """Ask the robot for a packet of a type, and return it; otherwise as `p2os.Robot.fetch`."""
        return await self._runner.do(fetching(self._core, kind, timeout_s, self.send))

    async def wait_open(self, timeout_s: float | None = None) -> None:
        """Wait until the session is open again after a loss.

        Raises:
            LinkLostError: it is not, in time or for good.
        """
        await self._runner.do(opening(self._core, timeout_s))

    async def states(self, lasts_s: float | None = None) -> AsyncIterator[RobotState]:
        """Yield each new state as it comes, the newest where the program is slow.

        Ends when the client does, and after `lasts_s` seconds, also while the robot is lost; None: never.
        """
        last: RobotState | None = None
        ends = None if lasts_s is None else self._clock() + round(lasts_s * NS_PER_S)
        while ends is None or self._clock() < ends:
            left_s = None if ends is None else (ends - self._clock()) / NS_PER_S
            last = await self._runner.do(newer_state(self._core, last, left_s))
            if last is None:
                return
            yield last

    async def events(self) -> AsyncIterator[Notice]:
        """Yield what happens beside the states, from now on, in order; ends when the client does."""
        with self._runner.listeners.queue() as queue:
            while (notice := await self._runner.do(next_notice(queue))) is not None:
                yield notice

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
        return await self.turn(self._angle_to(heading_rad), speed_radps=speed_radps, timeout_s=timeout_s)

    async def _reach(self, axis: MotionAxis, speed: float | None, timeout_s: float | None) -> MotionResult:
        return await self._runner.do(reaching(self._core, axis, speed, timeout_s, self._run))

    # The robot's own serial ports ---------------------------------------------------------

    def aux(self, port: int = 1) -> AsyncAux:
        """Return one of the robot's own serial ports, as a file of bytes whose calls are awaited."""
        return AsyncAux(port, send=self.send, subscribe=self.on_event, do=self._runner.do)
