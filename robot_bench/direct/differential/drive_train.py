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

import ctypes
import math
from typing import NamedTuple

from robot_bench.direct.differential.bridge import Shares
from robot_bench.direct.differential.description import Differential
from robot_bench.direct.differential.native import TrainStruct, functions, in_struct
from simbase.state import Stateful


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

    STATE = ("left_radps", "right_radps", "currents_a")
    left_radps: float = in_struct("left_radps", "Speed of the left wheel now, rad/s.")
    right_radps: float = in_struct("right_radps", "Speed of the right wheel now, rad/s.")

    def __init__(self, robot: Differential, dt_s: float) -> None:
        motor, body, gear = robot.motor, robot.body, robot.motor.gear_ratio
        radius = body.wheel_diameter_m / 2
        # chosen: a wheel is a disc
        wheel = motor.rotor_inertia_kg_m2 * gear**2 + body.wheel_mass_kg * radius**2 / 2
        both = wheel + body.mass_kg * radius**2 / 2
        apart = wheel + 2 * robot.yaw_inertia_kg_m2 * radius**2 / robot.track_m**2
        self.struct = TrainStruct(
            dt_s, motor.resistance_ohm + robot.bridge.resistance_ohm, robot.bridge.drop_v,
            motor.torque_constant_nm_a * gear, motor.friction_nm * gear, motor.damping_nm_s * gear**2,
            (both + apart) / 2, (both - apart) / 2,  # the wheels' inertia, and that by which one moves the other, kg·m²
        )  # fmt: skip
        self.address = ctypes.addressof(self.struct)

    @property
    def currents_a(self) -> tuple[float, float]:
        """Mean currents of the windings in the last step, left and right, A."""
        return self.struct.left_a, self.struct.right_a

    @currents_a.setter
    def currents_a(self, currents_a: tuple[float, float]) -> None:
        self.struct.left_a, self.struct.right_a = currents_a

    def supply_v(self, left: Shares, right: Shares, source_v: float, source_ohm: float, idle_a: float) -> float:
        """Return the supply's volts at the speeds of now, where its source has a resistance."""
        given = _given(left), _given(right)
        return float(functions().train_supply_v(self.address, *given, source_v, source_ohm, idle_a))

    def step(self, left: Shares, right: Shares, supply_v: float) -> DriveStep:
        """Take a step."""
        functions().train_step(self.address, _given(left), _given(right), supply_v)
        return self._made()

    def aims(self, left: Shares, right: Shares, supply_v: float) -> tuple[Aim, Aim]:
        """Return what each motor makes of its wheel in a step of a body that has the masses."""
        return self._aim(left, supply_v, self.left_radps), self._aim(right, supply_v, self.right_radps)

    def _aim(self, shares: Shares, supply_v: float, speed: float) -> Aim:
        aim = (ctypes.c_double * 2)()
        functions().train_aim(self.address, _given(shares), supply_v, speed, aim)
        return Aim(*aim)

    def take(self, left: Shares, right: Shares, supply_v: float, left_radps: float, right_radps: float) -> DriveStep:
        """Take the speeds to which a body has come with the last `aims`."""
        functions().train_take(self.address, _given(left), _given(right), supply_v, left_radps, right_radps)
        return self._made()

    def _made(self) -> DriveStep:
        made = self.struct
        return DriveStep(made.mean_left, made.mean_right, made.left_a, made.right_a, made.supply_a)


def _given(shares: Shares) -> "ctypes.Array[ctypes.c_double]":
    return (ctypes.c_double * 3)(*shares)


def no_load_radps(robot: Differential) -> float:
    """Return how fast a free wheel turns at most."""
    volts = max(0.0, robot.battery.full_v - robot.bridge.drop_v)
    return volts / (robot.motor.torque_constant_nm_a * robot.motor.gear_ratio)


def box_inertia(mass_kg: float, length_m: float, width_m: float, offset_m: float) -> float:
    """Return the inertia of a box about an upright axis beside its middle, kg·m²."""
    return mass_kg * (math.hypot(length_m, width_m) ** 2 / 12 + offset_m**2)
