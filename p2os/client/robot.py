"""The blocking `Robot`: a thread moves the bytes, the program waits where it wants to.

    with Robot("tcp:127.0.0.1:8101") as robot:
        robot.drive(0.5)

All decisions are `RobotCore`'s. Here are the clock and the waiting; the thread is a
`RobotThread`.
The robot is stopped and the session closed when the block is left for any
reason, and when the program ends without leaving it.
"""

from collections.abc import Iterator
from types import TracebackType
from typing import Self

from p2os.client.aux_ports import AuxStream
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
from p2os.client.robot_state import RobotState
from p2os.client.robot_thread import RobotThread
from simbase.interrupts import exit_on_signals
from simbase.timing import NS_PER_S


class Robot(RobotCalls):
    """A P2OS robot on a line.

    Args:
        url: Where it is: `serial:/dev/ttyUSB0`, `tcp:HOST:8101`, `pty:PATH`.
        model: A model's name, a file of parameters, or the parameters; None: by the robot's identity.
        auto_enable: Switch the motors on with the first motion of a session.
        reconnect: Look for a lost robot again; nothing moves until asked.
        deadman_s: A speed is taken back when the program has made no call for so long; None: never.
        settings: All settings at once, in place of the three before.
        opener: Opens the line; for lines that no URL names.
        clock: Nanoseconds that never go back, and go on while the machine sleeps.

    Raises:
        UsageError: The URL or a setting is none.
        ParametersError: There is no such model.
    """

    _runner_type = RobotThread
    _runner: RobotThread

    # Coming and going ---------------------------------------------------------------------

    def connect(self) -> Self:
        """Find the robot and open its session; return when its first packet and its configuration are here.

        Raises:
            ConnectError: the line cannot be opened, or no robot answers; the message says how far it came.
        """
        thread = self._runner
        exit_on_signals()
        thread.start()
        try:
            with thread.changed:
                thread.run(lambda core, now: core.connect(now))
                thread.do(connecting(self._core))
        except BaseException:
            self.close()
            raise
        return self

    def close(self) -> None:
        """Stop the robot, end the session, give the line back; a second call changes nothing."""
        self._runner.finish()

    def __enter__(self) -> Self:
        return self.connect()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()
        self._runner.raise_failure(error)

    # Waiting ------------------------------------------------------------------------------

    def sleep(self, duration_s: float) -> None:
        """Do nothing for so long, without tripping the deadman: held speeds go on.

        Raises:
            P2osError: the client's thread failed meanwhile.
        """
        self._runner.do(sleeping(duration_s))

    def next_state(self, timeout_s: float = 2.0) -> RobotState:
        """Wait for the next packet and return its state.

        Raises:
            LinkLostError: none came in time.
        """
        return self._runner.do(next_state(self._core, timeout_s))

    def fetch(self, kind: type[PacketType], timeout_s: float = 1.0) -> PacketType:
        """Ask the robot for a packet of a type, and return it.

        Args:
            kind: Such as `IoPacket` or `EncoderPacket` of `p2os.protocol.packets`.
            timeout_s: How long it may take.

        Raises:
            NoAnswerError: None came in time; not every robot has every device.
            LinkLostError: No session is open.
            UsageError: Nothing asks for such a packet.
        """
        return self._runner.do(fetching(self._core, kind, timeout_s, self.send))

    def wait_open(self, timeout_s: float | None = None) -> None:
        """Wait until the session is open again after a loss.

        Raises:
            LinkLostError: it is not, in time or for good.
        """
        self._runner.do(opening(self._core, timeout_s))

    def states(self, lasts_s: float | None = None) -> Iterator[RobotState]:
        """Yield each new state as it comes, the newest where the program is slow.

        Ends when the client does, and after `lasts_s` seconds, also while the robot is lost; None: never.
        """
        last: RobotState | None = None
        ends = None if lasts_s is None else self._clock() + round(lasts_s * NS_PER_S)
        while ends is None or self._clock() < ends:
            left_s = None if ends is None else (ends - self._clock()) / NS_PER_S
            last = self._runner.do(newer_state(self._core, last, left_s))
            if last is None:
                return
            yield last

    def events(self) -> Iterator[Notice]:
        """Yield what happens beside the states, from now on, in order; ends when the client does."""
        with self._runner.listeners.queue() as queue:
            while (notice := self._runner.do(next_notice(queue))) is not None:
                yield notice

    # Motion that waits --------------------------------------------------------------------

    def drive(
        self, distance_m: float, *, speed_mps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Drive straight and return when the robot has arrived and stands.

        Args:
            distance_m: Metres, negative backwards.
            speed_mps: The most for this way; None: the robot's limit.
            timeout_s: Give up after so long; None: twice what the limits allow, and 10 s.

        Raises:
            MotionError: it stalled, stood short of its goal, or took too long; it was stopped.
            LinkLostError: the link was lost on the way; or before, since the last motion call.
            MotorsDisabledError: as `set_velocity`.
        """
        return self._reach(DriveAxis(distance_m), speed_mps, timeout_s)

    def turn(
        self, angle_rad: float, *, speed_radps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Turn on the spot, any number of turns, and return when the robot stands; to a degree or two.

        Args:
            angle_rad: Radians, positive counter-clockwise.
            speed_radps: The most for this turn; None: the robot's limit.
            timeout_s: As `drive`.

        Raises:
            MotionError, LinkLostError, MotorsDisabledError: as `drive`.
        """
        return self._reach(TurnAxis(angle_rad), speed_radps, timeout_s)

    def turn_to(
        self, heading_rad: float, *, speed_radps: float | None = None, timeout_s: float | None = None
    ) -> MotionResult:
        """Turn the shorter way to a heading of the pose's frame; otherwise as `turn`."""
        return self.turn(self._angle_to(heading_rad), speed_radps=speed_radps, timeout_s=timeout_s)

    def aux(self, port: int = 1) -> AuxStream:
        """Return one of the robot's own serial ports, as a file of bytes."""
        return AuxStream(self._runner, port)

    def _reach(self, axis: MotionAxis, speed: float | None, timeout_s: float | None) -> MotionResult:
        return self._runner.do(reaching(self._core, axis, speed, timeout_s, self._run))
