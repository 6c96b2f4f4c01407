"""A robot that a verb holds: connected, watched while it does something, and released undisturbed.

`hold_robot` is also for verbs that stand between a robot and its client: it
prepares the process. What the robot does is the verbs' own.

Invariant: from `hold_robot` on, nothing suspends the program from its terminal, nothing
that it prints makes it wait, and no signal cuts the release of a robot short.
"""

import contextlib
import math
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import TypeVar

from p2os.cli.printing import queue_output
from p2os.client import (
    ClientSettings,
    DeadmanStopped,
    Disobeyed,
    GapStopped,
    Limits,
    Link,
    LinkLost,
    LinkLostError,
    MotionError,
    MotorsDisabled,
    Notice,
    Robot,
    RobotState,
)
from p2os.client.goals import STALL_LIMIT_NS
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock
from simbase.command_line.signals import end_on_suspension, postponed
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how soon a notice is seen; packets come every 100 ms.
LOOK_NS: Nanos = 50 * NS_PER_MS
#: A robot that is asked who it is: motors off, the speed of its line as it is found.
ASKED = ClientSettings(reconnect=False, auto_enable=False, raise_baud=None)

Held = TypeVar("Held")


def hold_robot() -> None:
    """Prepare the process for holding a robot; before anything is sent to it."""
    end_on_suspension()
    queue_output()


@contextlib.contextmanager
def held(robot: AbstractContextManager[Held], *, moves: bool = False) -> Iterator[Held]:
    """Connect a robot for a block, and release it undisturbed by signals when the block is left.

    Args:
        robot: The robot.
        moves: Whether the block moves it: an interruption says that it was stopped.
    """
    hold_robot()
    client = robot.__enter__()
    try:
        yield client
    except BaseException as error:
        with postponed():
            if not robot.__exit__(*sys.exc_info()):
                if moves and isinstance(error, KeyboardInterrupt):
                    sys.stderr.write("\nthe robot was stopped and let go\n")
                raise
    else:
        with postponed():
            robot.__exit__(None, None, None)


def say_what_is_beyond(limits: Limits, *, speed_mps: float | None, rate_radps: float | None) -> None:
    """Say on stderr which of `--vel` and `--turn-rate` are above the robot's limits, to which the client cuts them."""
    notes = []
    if speed_mps is not None and abs(speed_mps) > limits.forward_mps:
        notes.append(f"--vel {abs(speed_mps):.2f} m/s is above this robot's limit, {limits.forward_mps:.2f} m/s")
    if rate_radps is not None and abs(rate_radps) > limits.turn_radps:
        asked, most = math.degrees(abs(rate_radps)), math.degrees(limits.turn_radps)
        notes.append(f"--turn-rate {asked:.0f} deg/s is above this robot's limit, {most:.0f} deg/s")
    for note in notes:
        sys.stderr.write(f"note: {note}: it takes that\n")


class RobotWatch:
    """Waits beside a robot that does something: until the time is over, or at once when it cannot go on.

    Args:
        robot: A connected one.
        what: What it does, as a message begins: "hold 0.20 m/s".
        moves: Whether it is to move: stalls, wheels and motors that do not follow and the deadman count then.
        clock: Nanoseconds that never run back.
    """

    def __init__(self, robot: Robot, what: str, *, moves: bool, clock: Clock = wall_clock) -> None:
        self._robot, self._what, self._moves, self._clock = robot, what, moves, clock
        self._notices: deque[Notice] = deque()
        self._stalled_since: Nanos | None = None

    def wait(self, lasts_ns: Nanos) -> None:
        """Wait so long.

        Raises:
            LinkLostError: The link was lost; the wait is over then.
            MotionError: The robot does not do what it is to do; it was stopped first.
        """
        unsubscribe = self._robot.on_event(self._notices.append)
        now = began = self._clock()
        gaps = GapWatch(now)
        try:
            while (left_ns := began + lasts_ns - now) > 0:
                gaps.expect(now + min(left_ns, LOOK_NS))
                self._robot.sleep(min(left_ns, LOOK_NS) / NS_PER_S)
                now = self._clock()
                gap_ns = gaps.gap(now)
                if (problem := problem_of(GapStopped(gap_ns), moves=True) if gap_ns else self._problem()) is not None:
                    self._end(problem, now - began)
        finally:
            unsubscribe()

    def _problem(self) -> str | None:
        """Return what is wrong now."""
        while self._notices:
            notice = self._notices.popleft()
            if (problem := problem_of(notice, moves=self._moves)) is not None:
                return problem
        if self._robot.link is not Link.OPEN:
            return "the link was lost"
        return self._stall(self._robot.state) if self._moves else None

    def _stall(self, state: RobotState) -> str | None:
        if not state.is_stalled:
            self._stalled_since = None
            return None
        if self._stalled_since is None:
            self._stalled_since = state.at_ns
        return "stalled" if state.at_ns - self._stalled_since >= STALL_LIMIT_NS else None

    def _end(self, problem: str, after_ns: Nanos) -> None:
        with contextlib.suppress(LinkLostError):
            self._robot.stop()
        text = f"{self._what}: {problem}, after {after_ns / NS_PER_S:.1f} s"
        if self._robot.link is not Link.OPEN:
            raise LinkLostError(text, hint="is the robot on, and the cable in?")
        raise MotionError(text)


def problem_of(notice: Notice, *, moves: bool) -> str | None:
    """Return why a robot cannot go on after a notice, or None where it can."""
    match notice:
        case LinkLost():
            return f"the link was lost: {notice.reason}"
        case GapStopped():
            return f"this program paused for {notice.gap_ns / NS_PER_S:.1f} s"
        case DeadmanStopped() if moves:
            return f"this program did nothing for {notice.silent_ns / NS_PER_S:.1f} s"
        case Disobeyed() if moves:
            return notice.text
        case MotorsDisabled() if moves:
            return notice.reason
        case _:
            return None
