"""The work at the rims: |torque · rate| of both driven wheels over time, joules.

What a motor gives and what it takes when it brakes both count. It is that of motor and gear at the wheel, with the
rotor's inertia where a model has one: no current, no losses of a winding. A wheel that is held has torque and no rate,
and so no work. No body has rolling friction.

An engine tells the torques. The kinematic body has none: `RimLoad` says what its mass would ask for.
"""

import math

from p2os.pioneer.body.physical import CASTER_MASS_KG, Chassis
from p2os.robots.parameters import RobotParameters


def mean_magnitude(before: float, after: float) -> float:
    """Return the mean of |rate| while a rate goes evenly from one value to another, in their unit."""
    if before * after >= 0.0:
        return abs(before + after) / 2
    return (before * before + after * after) / (2 * abs(after - before))


class RimLoad:
    """The masses of a robot, as the engines' bodies have them, as they weigh on its rims.

    Args:
        parameters: Whose chassis is a box, whose wheels are balls, and whose caster is a point.
    """

    def __init__(self, parameters: RobotParameters) -> None:
        body, chassis, track_m = parameters.body, Chassis.of(parameters), parameters.track_mm / 1000
        radius_m = body.wheel_diameter_m / 2
        ball = body.wheel_mass_kg * radius_m**2 * 2 / 5
        wheel_kg = (ball + parameters.rotor_inertia_kg_m2) / radius_m**2
        box = math.hypot(chassis.length_m, chassis.width_m) ** 2 / 12 + chassis.centre[0] ** 2
        turning = chassis.mass_kg * box + 2 * (body.wheel_mass_kg * (track_m / 2) ** 2 + ball)
        turning += CASTER_MASS_KG * body.caster_x_m**2
        self._track_m = track_m
        #: What one rim accelerates where both go alike, and where they go against each other, kg.
        self.both_kg = wheel_kg + body.mass_kg / 2
        self.apart_kg = wheel_kg + 2 * turning / track_m**2
        #: How much lies ahead of the axle, kg·m; below 0 behind it. In a turn the rims hold it on its circle.
        self.ahead_kg_m = chassis.mass_kg * chassis.centre[0] + CASTER_MASS_KG * body.caster_x_m

    def work_j(self, before_mps: tuple[float, float], after_mps: tuple[float, float], dt_s: float) -> float:
        """Return the work of a step in which the rims, left and right, go evenly from speeds to others, joules."""
        (left_0, right_0), (left_1, right_1) = before_mps, after_mps
        left, right = left_1 - left_0, right_1 - right_0
        forward_mps = (left_0 + left_1 + right_0 + right_1) / 4
        turn_radps = (right_0 + right_1 - left_0 - left_1) / (2 * self._track_m)
        held = self.ahead_kg_m * turn_radps
        both_n = self.both_kg * (left + right) / 2 / dt_s - held * turn_radps / 2
        apart_n = self.apart_kg * (right - left) / 2 / dt_s + held * forward_mps / self._track_m
        way_l, way_r = mean_magnitude(left_0, left_1) * dt_s, mean_magnitude(right_0, right_1) * dt_s
        return abs(both_n - apart_n) * way_l + abs(both_n + apart_n) * way_r
