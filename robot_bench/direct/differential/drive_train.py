"""Two motors, their gears and the robot's mass: what volts make of the wheels' speeds.

Theory of operation. Over a step a bridge applies +V, −V, a short or nothing for known parts of the time. The winding's
inductance is neglected, so the mean current is linear in the mean speed of the step,

    i = ((forward − reverse) V − (forward + reverse + brake) K N ω) / R,

and so is the torque N K i at the wheel. Both wheels carry the robot: with the sum s and the difference d of their
speeds (J + m r²/2) s' = the sum of the torques, and (J + 2 I r²/b²) d' = their difference. The step is taken by the
midpoint rule: torques and currents are those of the mean of the speeds before and after, so that the rule makes no
energy. Friction is as large as it takes to stop a wheel, up to its limit.

Not modelled: inductance, slip, a wheel's load where the robot leans, backlash, and heat.
Invariant: with no volts, the kinetic energy never grows.
"""

import math
from typing import NamedTuple

from robot_bench.direct.differential.bridge import Shares
from robot_bench.direct.differential.description import Differential
from simbase.state import Stateful

#: chosen: friction on both wheels is found by turns; each turn takes the rest down by the wheels' coupling, below 1.
_TURNS = 50
#: chosen: where nothing brakes, no wheel comes to this speed.
FREE_RADPS = 1e4


class DriveStep(NamedTuple):
    """What became of a step."""

    #: Mean speeds of the wheels, rad/s.
    left_radps: float
    right_radps: float
    #: Mean currents of the windings, A.
    left_a: float
    right_a: float
    #: Mean current out of the supply, A; below 0 the motors feed it.
    supply_a: float


class Aim(NamedTuple):
    """Where a motor drives its wheel in a step, and how hard: never beyond where its torque ends."""

    #: rad/s.
    rate_radps: float
    #: At the wheel.
    torque_nm: float


class DriveTrain(Stateful):
    """Both wheels; `dt_s` is the length of a step."""

    STATE = ("left_radps", "right_radps")

    def __init__(self, robot: Differential, dt_s: float) -> None:
        motor, body, gear = robot.motor, robot.body, robot.motor.gear_ratio
        radius = body.wheel_diameter_m / 2
        self._dt_s = dt_s
        self._resistance = motor.resistance_ohm + robot.bridge.resistance_ohm
        self._drop_v = robot.bridge.drop_v
        self._k = motor.torque_constant * gear
        self._friction = motor.friction_nm * gear
        self._damping = motor.damping_nm_s * gear**2
        # chosen: a wheel is a disc
        wheel = motor.rotor_inertia_kg_m2 * gear**2 + body.wheel_mass_kg * radius**2 / 2
        both = wheel + body.mass_kg * radius**2 / 2
        apart = wheel + 2 * robot.yaw_inertia_kg_m2 * radius**2 / robot.track_m**2
        #: The wheels' inertia, and that by which one moves the other, kg·m².
        self.own, self.other = (both + apart) / 2, (both - apart) / 2
        #: Speeds of the wheels now, rad/s.
        self.left_radps = 0.0
        self.right_radps = 0.0

    @property
    def kinetic_j(self) -> float:
        """The energy of all that moves."""
        left, right = self.left_radps, self.right_radps
        return (self.own * (left**2 + right**2)) / 2 + self.other * left * right

    def supply_v(self, left: Shares, right: Shares, source_v: float, source_ohm: float, idle_a: float) -> float:
        """Return the supply's volts at the speeds of now, where its source has a resistance."""
        conductance = (left.forward + left.reverse + right.forward + right.reverse) / self._resistance
        emf_a = self._k / self._resistance * (
            (left.forward - left.reverse) * self.left_radps + (right.forward - right.reverse) * self.right_radps
        )  # fmt: skip
        lost_v = self._drop_v * conductance
        return max(0.0, (source_v - source_ohm * (idle_a - emf_a - lost_v)) / (1 + source_ohm * conductance))

    def step(self, left: Shares, right: Shares, supply_v: float) -> DriveStep:
        """Take a step."""
        volts, k, resistance, dt = max(0.0, supply_v - self._drop_v), self._k, self._resistance, self._dt_s
        pull = k / resistance
        along_l, along_r = left.forward - left.reverse, right.forward - right.reverse
        driven_l, driven_r = left.forward + left.reverse, right.forward + right.reverse
        torque_l, torque_r = pull * volts * along_l, pull * volts * along_r
        brake_l = pull * k * (driven_l + left.brake) + self._damping
        brake_r = pull * k * (driven_r + right.brake) + self._damping
        # (M + B dt/2) (after − before) = dt (torque − B before + friction)
        own_l, own_r, other = self.own + brake_l * dt / 2, self.own + brake_r * dt / 2, self.other
        scale = dt / (own_l * own_r - other * other)
        push_l = torque_l - brake_l * self.left_radps
        push_r = torque_r - brake_r * self.right_radps
        free_l = self.left_radps + scale * (own_r * push_l - other * push_r)
        free_r = self.right_radps + scale * (own_l * push_r - other * push_l)
        after_l, after_r = self._rubbed(free_l, free_r, scale * own_r, scale * own_l, -scale * other)
        return self.take(left, right, supply_v, after_l, after_r)

    def aims(self, left: Shares, right: Shares, supply_v: float) -> tuple["Aim", "Aim"]:
        """Return what each motor makes of its wheel in a step of a body that has the masses."""
        volts = max(0.0, supply_v - self._drop_v)
        return self._aim(left, volts, self.left_radps), self._aim(right, volts, self.right_radps)

    def _aim(self, shares: Shares, volts: float, speed: float) -> "Aim":
        pull, rub = self._k / self._resistance, self._friction
        drive = pull * volts * (shares.forward - shares.reverse)
        brake = pull * self._k * (shares.forward + shares.reverse + shares.brake) + self._damping
        if speed == 0.0:
            if abs(drive) <= rub:
                return Aim(0.0, rub)
            way = math.copysign(1.0, drive)
        else:
            way = math.copysign(1.0, speed)
        net = drive - rub * way
        most = abs(net - brake * speed)
        if net * way > 0.0:
            return Aim(net / brake if brake else way * FREE_RADPS, most)
        if abs(drive) <= rub:  # friction and brake alone: it ends in rest
            return Aim(0.0, most)
        back = drive + rub * way
        return Aim(back / brake if brake else -way * FREE_RADPS, most)

    def take(self, left: Shares, right: Shares, supply_v: float, left_radps: float, right_radps: float) -> DriveStep:
        """Take the speeds to which a body has come with the last `aims`."""
        volts, k, resistance = max(0.0, supply_v - self._drop_v), self._k, self._resistance
        mean_l, mean_r = (self.left_radps + left_radps) / 2, (self.right_radps + right_radps) / 2
        self.left_radps, self.right_radps = left_radps, right_radps
        along_l, along_r = left.forward - left.reverse, right.forward - right.reverse
        driven_l, driven_r = left.forward + left.reverse, right.forward + right.reverse
        left_a = (along_l * volts - (driven_l + left.brake) * k * mean_l) / resistance
        right_a = (along_r * volts - (driven_r + right.brake) * k * mean_r) / resistance
        supply_a = ((driven_l + driven_r) * volts - k * (along_l * mean_l + along_r * mean_r)) / resistance
        return DriveStep(mean_l, mean_r, left_a, right_a, supply_a)

    def _rubbed(self, left: float, right: float, own_l: float, own_r: float, other: float) -> tuple[float, float]:
        """Return speeds with friction, from those without; the rest are the speeds that a torque of 1 N·m adds."""
        most = self._friction
        if most == 0.0:
            return left, right
        whole = own_l * own_r - other * other
        if abs(own_r * left - other * right) < most * whole and abs(own_l * right - other * left) < most * whole:
            return 0.0, 0.0  # it holds both
        rub_l = rub_r = 0.0
        for _ in range(_TURNS):
            before = rub_l, rub_r
            rub_l = min(max(-(left + other * rub_r) / own_l, -most), most)
            rub_r = min(max(-(right + other * rub_l) / own_r, -most), most)
            if (rub_l, rub_r) == before:
                break
        after_l, after_r = left + own_l * rub_l + other * rub_r, right + other * rub_l + own_r * rub_r
        # What friction holds stands still, and does not creep by the rounding of floats.
        return (0.0 if abs(rub_l) < most else after_l), (0.0 if abs(rub_r) < most else after_r)


def no_load_radps(robot: Differential) -> float:
    """Return how fast a free wheel turns at most."""
    volts = max(0.0, robot.battery.full_v - robot.bridge.drop_v)
    return volts / (robot.motor.torque_constant * robot.motor.gear_ratio)


def box_inertia(mass_kg: float, length_m: float, width_m: float, offset_m: float) -> float:
    """Return the inertia of a box about an upright axis beside its middle, kg·m²."""
    return mass_kg * (math.hypot(length_m, width_m) ** 2 / 12 + offset_m**2)
