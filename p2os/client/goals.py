"""`drive` and `turn`: MOVE and HEAD, watched until they arrive.

MOVE and HEAD have no answer and can be lost like any frame, so each packet's
odometry is held against what was asked: a robot that stands short of its goal
is sent on, one that stalls, does not start, or takes too long ends the goal
with its reason. A robot that still comes nearer does not take too long, however
slowly it goes, unless the program gave a limit of its own. HEAD names an absolute heading and is repeated; MOVE is
relative and never is: what is left is asked for when the robot stands.

Long ways go in legs: MOVE carries at most `LEG_M`, and HEAD turns the shorter
way round, so a goal of more than half a turn runs ahead of the robot in steps.
"""

import math
from dataclasses import dataclass, replace
from numbers import Real
from typing import Protocol

from p2os.client.notices import MotionEnded
from p2os.client.robot_state import Limits, RobotPose, RobotState
from p2os.protocol.commands import Command, CommandNumber
from simbase.errors import UsageError, shown
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: ARIA's documentation advises no MOVE beyond 5 m.
LEG_M = 5.0
#: chosen: the next leg is asked for while the robot still has this way to go, so that it does not brake between.
NEXT_LEG_M = 1.5
#: Each step of HEAD is at most this far ahead: well below the half turn that is ambiguous.
STEP_RAD = math.radians(120)
#: chosen: MOVE is whole millimetres, and robots stop within a few.
NEAR_M = 0.015
#: chosen: HEAD is whole degrees, rounded by half of one, and robots stop within one.
NEAR_RAD = math.radians(2)
#: chosen: below these the robot stands; packets carry whole mm/s.
STANDING_MPS, STANDING_RADPS = 0.01, 0.03
#: chosen: standing short of the goal for so long, the robot is sent on (its command may have been lost).
SEND_ON_NS: Nanos = 600 * NS_PER_MS
#: How often it is sent on without having come nearer.
SEND_ON_LIMIT = 3
#: chosen: longer than a shove at a door sill, far shorter than motors take to get hot.
STALL_LIMIT_NS: Nanos = 1 * NS_PER_S
#: HEAD is repeated so often, like any speed.
REPEAT_NS: Nanos = 200 * NS_PER_MS
#: chosen: beyond twice the time that the limits allow, and again whenever a robot has come nearer by its share.
GRACE_NS: Nanos = 10 * NS_PER_S
#: chosen: a controller that goes the more slowly the nearer it is, as AMRISim's, does a tenth of what is left in a
#: second or two; and at a tenth each time the end of a goal cannot be put off for ever.
NEARER_SHARE = 0.9


@dataclass(frozen=True, slots=True)
class MotionResult:
    """How a `drive` or a `turn` ended: metres or radians, as the odometry has it."""

    asked: float
    reached: float
    took_ns: Nanos


def as_number(value: object, call: str, unit: str) -> float:
    """Return a number that a program gave.

    Args:
        value: What it gave.
        call: What it was given to: "drive".
        unit: What is taken there: "metres".

    Raises:
        UsageError: It is no number, such as a text with a unit.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise UsageError(f"{call} takes {unit} as a number, not {shown(value)}", hint="0.5, for example")
    return float(value)


class MotionAxis(Protocol):
    """What differs between driving and turning."""

    what: str
    asked: float

    def begin(self, state: RobotState) -> None:
        """Take the place from which the goal counts."""

    def reached(self, state: RobotState) -> float:
        """Return how far the robot has come."""

    def is_near(self, remaining: float) -> bool:
        """Tell whether this little may be left."""

    def is_standing(self, state: RobotState) -> bool:
        """Tell whether the robot stands along this axis."""

    def command(self, remaining: float, *, standing: bool) -> Command | None:
        """Return what is to be sent now, or None."""

    def fastest_ns(self, limits: Limits) -> Nanos:
        """Return how long the goal takes at the robot's limits."""

    def speed_of(self, limits: Limits) -> float:
        """Return the largest speed along this axis."""

    def with_speed(self, limits: Limits, speed: float) -> Limits:
        """Return limits with another largest speed along this axis."""

    def speed_command(self, speed: float) -> Command:
        """Return what sets that speed."""


class DriveAxis:
    """Along the heading at which it began."""

    def __init__(self, distance_m: float) -> None:
        self.asked = as_number(distance_m, "drive", "metres")
        self.what = f"drive {self.asked:.3f} m"
        self._start = RobotPose()
        self._leg_ends_m: float | None = None

    def begin(self, state: RobotState) -> None:
        """Count from here."""
        self._start = state.odometry
        self._leg_ends_m = None

    def reached(self, state: RobotState) -> float:
        """Return the way along the first heading, metres."""
        start, pose = self._start, state.odometry
        return (pose.x_m - start.x_m) * math.cos(start.heading_rad) + (pose.y_m - start.y_m) * math.sin(
            start.heading_rad
        )

    def is_near(self, remaining: float) -> bool:
        """Within a centimetre and a half."""
        return abs(remaining) <= NEAR_M

    def is_standing(self, state: RobotState) -> bool:
        """Neither wheel turns."""
        return max(abs(state.left_mps), abs(state.right_mps)) < STANDING_MPS

    def command(self, remaining: float, *, standing: bool) -> Command | None:
        """Return MOVE for the first leg, for the next one in time, or for what is left where the robot stands."""
        at = self.asked - remaining
        if not standing and self._leg_ends_m is not None:
            left = (self._leg_ends_m - at) * math.copysign(1, self.asked)
            is_last = abs(self.asked - self._leg_ends_m) < NEAR_M
            if is_last or left > NEXT_LEG_M:
                return None
        leg = max(-LEG_M, min(LEG_M, remaining))
        self._leg_ends_m = at + leg
        return Command(CommandNumber.MOVE, round(leg * 1000))

    def fastest_ns(self, limits: Limits) -> Nanos:
        """By the speed and both ramps."""
        return _fastest_ns(abs(self.asked), limits.forward_mps, limits.accel_mps2, limits.decel_mps2)

    def speed_of(self, limits: Limits) -> float:
        """Metres a second."""
        return limits.forward_mps

    def with_speed(self, limits: Limits, speed: float) -> Limits:
        """Slower, or as fast."""
        return replace(limits, forward_mps=speed)

    def speed_command(self, speed: float) -> Command:
        """SETV, which MOVE keeps to."""
        return Command(CommandNumber.SETV, max(1, round(speed * 1000)))


class TurnAxis:
    """About the robot's centre, counter-clockwise positive."""

    def __init__(self, angle_rad: float) -> None:
        self.asked = as_number(angle_rad, "turn", "radians")
        self.what = f"turn {math.degrees(self.asked):.1f} deg"
        self._start_rad = 0.0

    def begin(self, state: RobotState) -> None:
        """Count from here."""
        self._start_rad = state.odometry.heading_rad

    def reached(self, state: RobotState) -> float:
        """Return how far it has turned, radians."""
        return state.odometry.heading_rad - self._start_rad

    def is_near(self, remaining: float) -> bool:
        """Within two degrees."""
        return abs(remaining) <= NEAR_RAD

    def is_standing(self, state: RobotState) -> bool:
        """It does not turn."""
        return abs(state.turn_radps) < STANDING_RADPS

    def command(self, remaining: float, *, standing: bool) -> Command | None:  # noqa: ARG002  # for drives
        """Return HEAD: the goal, or a step of the way to it."""
        at = self.asked - remaining
        ahead = self._start_rad + at + max(-STEP_RAD, min(STEP_RAD, remaining))
        return Command(CommandNumber.HEAD, round(math.degrees(ahead)) % 360)

    def fastest_ns(self, limits: Limits) -> Nanos:
        """By the speed and both ramps."""
        return _fastest_ns(abs(self.asked), limits.turn_radps, limits.turn_accel_radps2, limits.turn_decel_radps2)

    def speed_of(self, limits: Limits) -> float:
        """Radians a second."""
        return limits.turn_radps

    def with_speed(self, limits: Limits, speed: float) -> Limits:
        """Slower, or as fast."""
        return replace(limits, turn_radps=speed)

    def speed_command(self, speed: float) -> Command:
        """SETRV, which HEAD keeps to."""
        return Command(CommandNumber.SETRV, max(1, round(math.degrees(speed))))


class MotionGoal:
    """One `drive` or `turn` under way.

    Args:
        axis: What is to be done.
        limit_ns: When it is given up, counted from `begin`; None: twice what the limits allow, and some seconds;
            later while the robot comes nearer.
    """

    def __init__(self, axis: MotionAxis, limit_ns: Nanos | None) -> None:
        self.axis = axis
        self._limit_ns = limit_ns
        self._ends_at: Nanos = 0
        self._began_at: Nanos = 0
        self._sent_at: Nanos = 0
        self._sent_on_at: Nanos = 0
        self._standing_since: Nanos | None = None
        self._stalled_since: Nanos | None = None
        self._standing_packets = 0
        self._sent_on = 0
        self._least_left = math.inf
        #: What was left when the end was last put off.
        self._left_then = abs(axis.asked)
        self.reached = 0.0
        #: How it ended, once it has.
        self.ended: MotionEnded | None = None

    def begin(self, state: RobotState, limits: Limits, now: Nanos) -> Command | None:
        """Start from a state; return the first command."""
        self._began_at = self._sent_at = self._sent_on_at = now
        allowed = self._limit_ns
        self._ends_at = now + (2 * self.axis.fastest_ns(limits) + GRACE_NS if allowed is None else allowed)
        self.axis.begin(state)
        if self.axis.is_near(self.axis.asked):
            return None
        return self.axis.command(self.axis.asked, standing=True)

    def next_deadline(self) -> Nanos:
        """Return when it is given up."""
        return self._ends_at

    def result(self, now: Nanos) -> MotionResult:
        """Return how far it came."""
        return MotionResult(self.axis.asked, self.reached, now - self._began_at)

    def time_is_up(self, now: Nanos) -> str | None:
        """Return why it ends, if its time is up."""
        return f"not there after {(now - self._began_at) / NS_PER_S:.1f} s" if now >= self._ends_at else None

    def take(self, state: RobotState, now: Nanos) -> tuple[Command | None, bool, str | None]:
        """Take a state; return what to send, whether it has arrived, and why it failed."""
        axis = self.axis
        self.reached = axis.reached(state)
        remaining = axis.asked - self.reached
        if self._limit_ns is None and abs(remaining) <= NEARER_SHARE * self._left_then:
            self._left_then = abs(remaining)
            self._ends_at = max(self._ends_at, now + GRACE_NS)
        if (stalled := self._stalled(state, now)) is not None:
            return None, False, stalled
        if not axis.is_standing(state):
            self._standing_since, self._standing_packets = None, 0
            return self._on_the_way(remaining, now), False, None
        self._standing_packets += 1
        self._standing_since = now if self._standing_since is None else self._standing_since
        if axis.is_near(remaining):
            return None, self._standing_packets >= 2, None
        if now - max(self._standing_since, self._sent_on_at) < SEND_ON_NS:
            return self._on_the_way(remaining, now), False, None
        came_nearer = abs(remaining) < self._least_left
        self._least_left = min(self._least_left, abs(remaining))
        self._sent_on = 1 if came_nearer else self._sent_on + 1
        if self._sent_on > SEND_ON_LIMIT:
            return None, False, "the robot stands: are its motors off, or is the way blocked?"
        self._sent_at = self._sent_on_at = now
        return axis.command(remaining, standing=True), False, None

    def _on_the_way(self, remaining: float, now: Nanos) -> Command | None:
        """Return the next leg of a way, or HEAD where it is to be repeated."""
        if isinstance(self.axis, TurnAxis) and now - self._sent_at < REPEAT_NS:
            return None
        command = self.axis.command(remaining, standing=False)
        if command is not None:
            self._sent_at = now
        return command

    def _stalled(self, state: RobotState, now: Nanos) -> str | None:
        if not state.is_stalled:
            self._stalled_since = None
            return None
        if self._stalled_since is None:
            self._stalled_since = now
        return "stalled" if now - self._stalled_since >= STALL_LIMIT_NS else None


def _fastest_ns(way: float, top: float, accel: float, decel: float) -> Nanos:
    """Return the time of a trapezoid: way over top speed, and half of both ramps."""
    return round((way / top + top / (2 * accel) + top / (2 * decel)) * NS_PER_S)
