"""Driving by game pad: Up connects, R2, L2 and the right stick drive, Down lets the robot go.

Invariant: the robot stands unless a report younger than the pad's loss time asks for more,
and after a pause of the program until Up is pressed anew.
"""

import contextlib
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from p2os.client.notices import DeadmanStopped, GapStopped, Notice
from p2os.client.problems import LinkLostError
from p2os.gamepad import STICK_FULL, TRIGGER_FULL, Gamepad, PadReport
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.transport.wall_clock import GapWatch

#: How often the pad is asked, nanoseconds.
PERIOD_NS: Nanos = 20 * NS_PER_MS


class Driven(Protocol):
    """What is needed of the robot's client."""

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        """Drive at these speeds from now on."""
        ...

    def on_event(self, callback: Callable[[Notice], None]) -> object:
        """Call `callback` with what happens, from any thread."""
        ...


#: Returns how the pad stands; None while it is gone.
Reports = Callable[[], PadReport | None]


class PadDriver:
    """One pad and one robot.

    Args:
        reports: The pad.
        connect: Opens the robot; leaving it stops the motors.
        fastest: Speeds at full deflection, m/s and rad/s.
        clock: Returns the time, nanoseconds.
        wait: Lets so many nanoseconds pass.
        say: Told of each change, one line.
    """

    def __init__(
        self,
        reports: Reports,
        connect: Callable[[], AbstractContextManager[Driven]],
        fastest: tuple[float, float],
        *,
        clock: Callable[[], Nanos],
        wait: Callable[[Nanos], None],
        say: Callable[[str], None],
    ) -> None:
        self._reports, self._connect, self._fastest = reports, connect, fastest
        self._clock, self._wait, self._say = clock, wait, say
        self._pad = Gamepad()

    def run(self) -> None:
        """Drive until the pad is gone for good while no robot is connected."""
        self._say("Up connects")
        while True:
            while not self._pad.wants_robot:
                if self._look() is None:
                    self._say("the pad is gone")
                    return
                self._wait(PERIOD_NS)
            with self._connect() as robot:
                self._say("connected: R2 ahead, L2 back, right stick turns, Down lets go")
                why = self._drive(robot)
            self._pad.forget_wish()
            self._say(f"{why}: the robot stands; Up connects again")

    def _drive(self, robot: Driven) -> str:
        """Hand speeds on while the wish lasts; return why it ended."""
        stops: deque[Notice] = deque()
        robot.on_event(lambda notice: stops.append(notice) if is_stop(notice) else None)
        gaps = GapWatch(self._clock())
        while True:
            if (gap_ns := gaps.gap(self._clock())) or stops:
                _stop(robot)
                self._pad.lose()
                return f"paused for {gap_ns / NS_PER_S:.1f} s" if gap_ns else "the client stopped the robot"
            self._look()
            lost_at = self._pad.lost_at
            if lost_at is None or self._clock() >= lost_at:
                _stop(robot)
                self._pad.lose()
                return "the pad is lost"
            if not self._pad.wants_robot:
                _stop(robot)
                return "Down was pressed"
            try:
                robot.set_velocity(
                    self._fastest[0] * self._pad.forward / TRIGGER_FULL, self._fastest[1] * self._pad.turn / STICK_FULL
                )
            except LinkLostError:
                return "the link is lost"
            gaps.expect(self._clock() + PERIOD_NS)
            self._wait(PERIOD_NS)

    def _look(self) -> PadReport | None:
        report = self._reports()
        if report is not None:
            self._pad.take(report, self._clock())
        return report


def is_stop(notice: Notice) -> bool:
    """Tell whether the client has stopped the robot by itself: what drove it must be asked for anew."""
    return isinstance(notice, (GapStopped, DeadmanStopped))


def _stop(robot: Driven) -> None:
    with contextlib.suppress(LinkLostError):  # it stands by itself then
        robot.set_velocity(0.0, 0.0)
