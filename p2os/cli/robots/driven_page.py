"""A robot at a port that a page drives (`p2os view URL --drive`).

Pages say what is held; the loop hands it to the robot's client each 50 ms and looks at once at what comes in. There are
three that stop the robot: the page, when it loses focus or is left; this loop, when it hears nothing of a page for
`DRIVE_HOLD_NS`; and the client's own deadman, when this program does nothing any more.

Invariant: the robot stands unless a page has said within that time that something is held, with its motors' link open.
"""

import math
import queue
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from p2os.cli.robots.command_queue import is_stop
from p2os.cli.robots.drive_deadman import DriveDeadman
from p2os.cli.robots.page_control import QueuedControl
from p2os.client import Link
from p2os.client.notices import DeadmanStopped, GapStopped, LinkLost, LinkLostError, MotorsDisabled, Notice
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock
from p2os.view.run_control import RunCommand, RunState
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how often the line is renewed.
TURN_NS: Nanos = 50 * NS_PER_MS
STOPPED = "stopped: let go of what is held, and press anew"


class PageDrivenClient(Protocol):
    """What is needed of a robot's client."""

    @property
    def link(self) -> Link:
        """Whether there is a session."""

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        """Drive at these speeds from now on."""

    def stop(self) -> None:
        """Stop at once, and stay."""

    def on_event(self, callback: Callable[[Notice], None]) -> object:
        """Call `callback` with what happens, from any thread."""


class PageDriver(QueuedControl):
    """Drives a robot as its pages say; the page's `RunControl`.

    Args:
        most_mps: Greatest speed, m/s.
        most_dps: Greatest turning speed, deg/s.
        clock: Nanoseconds that never run back.
    """

    def __init__(self, most_mps: float, most_dps: float, clock: Clock = wall_clock) -> None:
        super().__init__(RunState(is_running=True, why="the robot stands"))
        self._deadman, self._clock = DriveDeadman(most_mps, most_dps), clock
        self._notices: queue.SimpleQueue[Notice] = queue.SimpleQueue()
        self._gaps = GapWatch(clock())

    def drive(self, client: PageDrivenClient) -> None:
        """Drive until an interrupt is raised here."""
        client.on_event(self._notices.put)
        while True:
            self.turn(client)

    def turn(self, client: PageDrivenClient, wait_ns: Nanos = TURN_NS) -> None:
        """Wait for a command, no longer than a turn; have the robot drive as is wanted then."""
        self._gaps.expect(self._clock() + wait_ns)
        command = self._commands.take(wait_ns / NS_PER_S)
        now, was_driving = self._clock(), self._deadman.is_driving
        if self._gaps.gap(now):
            self._deadman.stop()  # this machine slept: what waited means nothing, but for stops
            command = command if command is not None and is_stop(command) else None
        trouble = "" if command is None else self._take(command, now)
        self._deadman.advance_to(now)
        self._hear()
        try:
            if (was_driving and not self._deadman.is_driving) or (command is not None and command.do == "stop"):
                client.stop()
            elif self._deadman.is_driving:
                forward_mps, turn_dps = self._deadman.speeds
                client.set_velocity(forward_mps, math.radians(turn_dps))
        except LinkLostError as error:  # looked for again by the client; nothing moves at once then
            self._deadman.stop()
            trouble = str(error)
        self._say(client, command, trouble)

    def _take(self, command: RunCommand, now: Nanos) -> str:
        if command.do == "drive":
            self._deadman.ask(command.forward_mps, command.turn_dps, now)
        elif command.do == "stop":
            self._deadman.stop()
        else:
            return f"a robot at a port is driven and stopped: it knows no {command.do!r}"
        return ""

    def _hear(self) -> None:
        """Stop for good where the client has stopped by itself."""
        while not self._notices.empty():
            if _has_stopped(self._notices.get()):
                self._deadman.stop()

    def _say(self, client: PageDrivenClient, command: RunCommand | None, trouble: str) -> None:
        old = self._state
        done = old.done + (command is not None)
        if client.link is not Link.OPEN:
            why = f"link: {client.link.value}"
        elif self._deadman.is_driving:
            why = f"driving {self._deadman.speeds[0]:+.2f} m/s, {self._deadman.speeds[1]:+.0f} deg/s"
        else:
            why = STOPPED if self._deadman.is_stopped else "the robot stands"
        if command is None and not trouble:
            trouble = old.trouble
        self._show(replace(old, why=why, trouble=trouble, done=done))


def _has_stopped(notice: Notice) -> bool:
    """Tell whether a client has stopped its robot by itself, or cannot reach it."""
    return isinstance(notice, GapStopped | DeadmanStopped | LinkLost | MotorsDisabled)
