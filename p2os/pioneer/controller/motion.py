"""How set speeds become wheel speeds: limits, ramps, and the two ways to command them.

P2OS takes either a translation and a rotation (VEL, RVEL, MOVE, HEAD ...) or
two wheel speeds (VEL2); each cancels the other (Pioneer 2/3 H8 manual p. 44).

Theory of operation
-------------------
Two *axes* are ramped, each towards its set speed at its own acceleration and
deceleration: translation and rotation in one mode, left and right wheel in the
other. A change of mode converts the speeds of this moment, so that the wheels
do not jump. A goal (MOVE, HEAD) sets its axis' speed anew each step from the
distance left, as fast as the deceleration allows to stop there.

HOLD (the watchdog) makes the axes aim at zero without forgetting what was set;
release, and they ramp back up: "automatically accelerates back to the last set
speed" (H8 manual p. 43).

Without power the wheels stand, but set speeds are still taken: they hold from
the moment of ENABLE, as MobileSim's do (untried on a real robot). Taking the
power away stops the wheels at once and forgets what was set.

What it is not: a servo loop. The body's motors follow the set-points as their
torque allows; the PID gains of the real firmware are not modelled.

Invariant: speeds are whole nm/s and micro-degrees/s and change by whole steps,
so a ramp is exact for every step that is a whole number of microseconds.
"""

import math
from dataclasses import asdict, dataclass, replace
from enum import Enum

from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import Nanos

NM_PER_MM = 1_000_000
NM_PER_M = 1_000_000_000
UDEG_PER_DEG = 1_000_000
UDEG_PER_TURN = 360 * UDEG_PER_DEG
#: nm/s of wheel speed change in one step of 1 ns at 1 mm/s²: 10⁶ nm/mm ÷ 10⁹ ns/s.
_STEP_DIVISOR = 1_000

#: chosen: a goal is reached when less than this is left and the axis is as slow as one step of its ramp.
GOAL_REACHED_NM = 2 * NM_PER_MM
GOAL_REACHED_UDEG = UDEG_PER_DEG // 2
#: chosen: per second; the last stretch is approached no faster than this times the way left, which keeps
#: the lag of real motors from turning into a swing around the goal.
GOAL_GAIN_PER_S = 4


class SpeedMode(Enum):
    """Which two speeds are set."""

    #: Translation and rotation.
    TRANSLATE_ROTATE = "translate and rotate"
    #: Left and right wheel (VEL2).
    WHEELS = "wheels"


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """Speeds and accelerations, each positive; the tops are the robot's own and cannot be set."""

    top_velocity_mm_s: int
    top_rotation_deg_s: int
    max_velocity_mm_s: int
    max_rotation_deg_s: int
    accel_mm_s2: int
    decel_mm_s2: int
    rot_accel_deg_s2: int
    rot_decel_deg_s2: int

    @classmethod
    def of(cls, parameters: RobotParameters) -> "MotionLimits":
        """Return the limits with which a robot starts."""
        tops = {"top_velocity_mm_s": parameters.max_velocity_mm_s, "top_rotation_deg_s": parameters.max_rotation_deg_s}
        return cls(**tops, **asdict(parameters.motion))

    def with_max_velocity(self, mm_s: int) -> "MotionLimits":
        """Return these limits after SETV, which cannot exceed the robot's top."""
        return replace(self, max_velocity_mm_s=min(abs(mm_s), self.top_velocity_mm_s))

    def with_max_rotation(self, deg_s: int) -> "MotionLimits":
        """Return these limits after SETRV, which cannot exceed the robot's top."""
        return replace(self, max_rotation_deg_s=min(abs(deg_s), self.top_rotation_deg_s))

    def with_acceleration(self, mm_s2: int) -> "MotionLimits":
        """Return these limits after SETA: positive sets the acceleration, negative the deceleration, 0 nothing."""
        if mm_s2 == 0:
            return self
        return replace(self, accel_mm_s2=mm_s2) if mm_s2 > 0 else replace(self, decel_mm_s2=-mm_s2)

    def with_rotational_acceleration(self, deg_s2: int) -> "MotionLimits":
        """Return these limits after SETRA, with the signs of SETA."""
        if deg_s2 == 0:
            return self
        return replace(self, rot_accel_deg_s2=deg_s2) if deg_s2 > 0 else replace(self, rot_decel_deg_s2=-deg_s2)


@dataclass(slots=True)
class _Axis:
    """One ramped speed."""

    set_speed: int = 0
    speed: int = 0
    #: Where to stop, in the unit of the axis, or None when a speed was set.
    goal: int | None = None

    def stop_now(self) -> None:
        self.set_speed = self.speed = 0
        self.goal = None

    def set(self, speed: int) -> None:
        self.set_speed = speed
        self.goal = None

    def approach(self, target: int, faster: int, slower: int) -> None:
        """Come nearer to `target` by one step, through zero only by standing at it."""
        speed = self.speed
        if speed == target:
            return
        if speed * target < 0:
            self.speed = max(speed - slower, 0) if speed > 0 else min(speed + slower, 0)
        elif abs(target) > abs(speed):
            self.speed = min(speed + faster, target) if target > 0 else max(speed - faster, target)
        else:
            self.speed = max(speed - slower, target) if speed > 0 else min(speed + slower, target)


class Motion(Stateful):
    """The motion commands of one robot, and the wheel speeds that they ask for."""

    STATE = ("limits", "mode", "is_held", "is_powered", "_first", "_second", "_wheels")
    DERIVED = ("_changes_of", "_changes")

    def __init__(self, limits: MotionLimits, *, track_mm: int, dt_ns: Nanos) -> None:
        self.limits = limits
        self.mode = SpeedMode.TRANSLATE_ROTATE
        self.is_held = False
        self.is_powered = False
        self._dt_ns = dt_ns
        #: nm/s of each wheel per micro-degree/s of turning.
        self._rim_nm_per_udeg = math.pi / 180 / UDEG_PER_DEG * track_mm * NM_PER_MM / 2
        # Translation and rotation, or left and right, by mode.
        self._first = _Axis()
        self._second = _Axis()
        self._wheels = (0.0, 0.0)
        #: The limits of the last step, and what follows from them.
        self._changes_of: MotionLimits | None = None
        self._changes = (0, 0, 0, 0)

    # Commands ---------------------------------------------------------------------

    def set_velocity(self, mm_s: int) -> None:
        """Translate at a speed (VEL)."""
        self._set_mode(SpeedMode.TRANSLATE_ROTATE)
        self._first.set(_clamp(mm_s, self.limits.max_velocity_mm_s) * NM_PER_MM)

    def set_rotation(self, deg_s: int) -> None:
        """Turn at a speed, positive counter-clockwise (RVEL, ROTATE)."""
        self._set_mode(SpeedMode.TRANSLATE_ROTATE)
        self._second.set(_clamp(deg_s, self.limits.max_rotation_deg_s) * UDEG_PER_DEG)

    def set_wheels(self, left_mm_s: int, right_mm_s: int) -> None:
        """Turn the wheels at two speeds (VEL2)."""
        self._set_mode(SpeedMode.WHEELS)
        self._first.set(_clamp(left_mm_s, self.limits.max_velocity_mm_s) * NM_PER_MM)
        self._second.set(_clamp(right_mm_s, self.limits.max_velocity_mm_s) * NM_PER_MM)

    def set_wheels_as_turn(self, left_mm_s: int, right_mm_s: int) -> None:
        """Turn two wheel speeds into a translation and a rotation, each within its limit (VEL2 of ARCOS)."""
        self._set_mode(SpeedMode.TRANSLATE_ROTATE)
        top, turn_top = self.limits.max_velocity_mm_s * NM_PER_MM, self.limits.max_rotation_deg_s * UDEG_PER_DEG
        self._first.set(_clamp((left_mm_s + right_mm_s) * NM_PER_MM // 2, top))
        self._second.set(_clamp(round((right_mm_s - left_mm_s) * NM_PER_MM / 2 / self._rim_nm_per_udeg), turn_top))

    def move_to(self, travel_nm: int) -> None:
        """Translate until the odometer of `step` shows `travel_nm` (MOVE)."""
        self._set_mode(SpeedMode.TRANSLATE_ROTATE)
        self._first.goal = travel_nm

    def turn_to(self, heading_udeg: int) -> None:
        """Turn the shorter way to a heading (HEAD, DHEAD, DCHEAD)."""
        self._set_mode(SpeedMode.TRANSLATE_ROTATE)
        self._second.goal = heading_udeg % UDEG_PER_TURN

    def stop(self) -> None:
        """Slow down to a stand at the set decelerations (STOP)."""
        self._first.set(0)
        self._second.set(0)

    def stop_now(self) -> None:
        """Set both wheels to zero at once and forget every command (E_STOP)."""
        self._first.stop_now()
        self._second.stop_now()
        self._wheels = (0.0, 0.0)

    def ramp_from_zero(self) -> None:
        """Ramp from zero to what is set, as wheels do that a wall has stopped."""
        self._first.speed = self._second.speed = 0
        self._wheels = (0.0, 0.0)

    def power(self, *, on: bool) -> None:
        """Switch the motors (ENABLE); off stops the wheels at once and forgets every command."""
        if not on:
            self.stop_now()
        self.is_powered = on

    def hold(self) -> None:
        """Slow down to a stand, but remember what was set."""
        self.is_held = True

    def release(self) -> None:
        """Go back to what was set before `hold`."""
        self.is_held = False

    # Results ----------------------------------------------------------------------

    @property
    def heading_goal_udeg(self) -> int | None:
        """Return the heading that is being turned to, in micro-degrees, or None when a speed was set."""
        return self._second.goal if self.mode is SpeedMode.TRANSLATE_ROTATE else None

    @property
    def wheels_mps(self) -> tuple[float, float]:
        """Return the rim-speed set-points of this moment, left and right, in m/s."""
        return self._wheels

    @property
    def setpoints(self) -> tuple[object, ...]:
        """Return what was set last, to compare with what is set next."""
        first, second = self._first, self._second
        return self.mode, first.set_speed, first.goal, second.set_speed, second.goal

    @property
    def has_goal(self) -> bool:
        """Tell whether the robot drives or turns to somewhere, so that `step` needs to know where it is."""
        return self._first.goal is not None or self._second.goal is not None

    @property
    def is_steady(self) -> bool:
        """Tell whether no step will change anything until the next command."""
        first, second = self._first, self._second
        if not self.is_powered:
            return True
        if self.is_held:
            return not first.speed and not second.speed
        return first.speed == first.set_speed and second.speed == second.set_speed and not self.has_goal

    def step(self, travel_nm: int, heading_udeg: int) -> tuple[float, float]:
        """Ramp for one step and return the rim-speed set-points for it, left and right, in m/s.

        Args:
            travel_nm: the odometer along the path, forward positive; read only while there is a goal.
            heading_udeg: the heading by odometry, any number of turns; read only while there is a goal.
        """
        return self._wheels if self.is_steady else self._change(travel_nm, heading_udeg)

    def _change(self, travel_nm: int, heading_udeg: int) -> tuple[float, float]:
        """Do as `step` where the robot is not steady."""
        limits, first, second = self.limits, self._first, self._second
        if limits is not self._changes_of:
            self._changes_of, self._changes = limits, self._changes_per_step(limits)
        faster, slower, turn_faster, turn_slower = self._changes
        if self.mode is SpeedMode.WHEELS:
            first.approach(0 if self.is_held else first.set_speed, faster, slower)
            second.approach(0 if self.is_held else second.set_speed, faster, slower)
            self._wheels = (first.speed / NM_PER_M, second.speed / NM_PER_M)
            return self._wheels
        if first.goal is not None:
            left_nm = first.goal - travel_nm
            top = limits.max_velocity_mm_s * NM_PER_MM
            _aim(first, left_nm, top, limits.decel_mm_s2 * NM_PER_MM, reached=GOAL_REACHED_NM, crawl=slower)
        if second.goal is not None:
            left_udeg = (second.goal - heading_udeg + UDEG_PER_TURN // 2) % UDEG_PER_TURN - UDEG_PER_TURN // 2
            top = limits.max_rotation_deg_s * UDEG_PER_DEG
            decel = limits.rot_decel_deg_s2 * UDEG_PER_DEG
            _aim(second, left_udeg, top, decel, reached=GOAL_REACHED_UDEG, crawl=turn_slower)
        first.approach(0 if self.is_held else first.set_speed, faster, slower)
        second.approach(0 if self.is_held else second.set_speed, turn_faster, turn_slower)
        rim = second.speed * self._rim_nm_per_udeg
        self._wheels = ((first.speed - rim) / NM_PER_M, (first.speed + rim) / NM_PER_M)
        return self._wheels

    def ramp(self, steps: int) -> list[tuple[float, float]]:
        """Return the set-points of the next steps, at most so many, up to where nothing changes any more.

        They are those of as many `step`, where there is no goal.
        """
        made: list[tuple[float, float]] = []
        while len(made) < steps and not self.is_steady:
            made.append(self._change(0, 0))
        return made

    # Helpers ----------------------------------------------------------------------

    def _changes_per_step(self, limits: MotionLimits) -> tuple[int, int, int, int]:
        """Return by how much a step changes speeds at most: either axis faster and slower, a rotation likewise."""
        rates = limits.accel_mm_s2, limits.decel_mm_s2, limits.rot_accel_deg_s2, limits.rot_decel_deg_s2
        faster, slower, turn_faster, turn_slower = (rate * self._dt_ns // _STEP_DIVISOR for rate in rates)
        return faster, slower, turn_faster, turn_slower

    def _set_mode(self, mode: SpeedMode) -> None:
        if mode is self.mode:
            return
        first, second = self._first.speed, self._second.speed
        if mode is SpeedMode.WHEELS:
            rim = round(second * self._rim_nm_per_udeg)
            speeds = first - rim, first + rim
        else:
            speeds = (first + second) // 2, round((second - first) / 2 / self._rim_nm_per_udeg)
        self.mode = mode
        self._first, self._second = _Axis(speed=speeds[0]), _Axis(speed=speeds[1])


def _clamp(value: int, limit: int) -> int:
    return max(-limit, min(limit, value))


def _aim(axis: _Axis, left: int, top: int, decel: int, *, reached: int, crawl: int) -> None:
    """Set an axis' speed so that it stops when nothing is left, or end the goal when it has."""
    if abs(left) <= reached and abs(axis.speed) <= crawl:
        axis.set(0)
        return
    speed = min(top, math.isqrt(2 * decel * abs(left)), GOAL_GAIN_PER_S * abs(left))
    axis.set_speed = speed if left > 0 else -speed
