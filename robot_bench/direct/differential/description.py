"""What a differential robot is made of: numbers as its file gives them, in SI units.

Invariant: a description that exists can be built: each signal has one pin, and no encoder is faster than the bench.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from p2os.robots.parameters import BodyParameters, RobotParameters, SonarPose, load_parameters
from robot_bench.direct.wired import RobotWire

SIDES = ("left", "right")
#: What a model needs beside what its file says: what only the P2OS protocol knows of a robot.
_BASE = "p2dx"


class Off(StrEnum):
    """What a bridge does with its motor while it does not drive it."""

    #: Both terminals are tied together: the motor brakes itself.
    BRAKE = "brake"
    #: Both terminals are open.
    COAST = "coast"


class BridgeKind(StrEnum):
    """Which pins a bridge has; `TRUTH` of bridge.py says what they do."""

    #: Two inputs choose the direction, a third one enables (L298N, TB6612FNG).
    IN1_IN2_PWM = "in1_in2_pwm"
    #: One pin drives, one chooses the direction (DRV8835, A4990).
    PWM_DIR = "pwm_dir"
    #: One pin a direction (DRV8833, DRV8871, BTS7960).
    TWO_PWM = "two_pwm"

    @property
    def pins(self) -> tuple[str, ...]:
        """The names of its pins."""
        return ("in1", "in2") if self is BridgeKind.TWO_PWM else tuple(self.value.split("_"))


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeDescription:
    """An H-bridge."""

    kind: BridgeKind
    off: Off = Off.BRAKE
    #: Of both switches together.
    resistance_ohm: float = 0.0
    #: What a bridge of bipolar transistors takes off the supply.
    drop_v: float = 0.0
    #: A pulse acts so much later than it begins; a shorter one does nothing.
    dead_time_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor:
    """A DC motor with its gear."""

    resistance_ohm: float
    #: N·m/A, and V·s/rad: the same number.
    torque_constant: float
    rotor_inertia_kg_m2: float
    #: Against each motion, at the motor's shaft.
    friction_nm: float
    #: Against the speed, at the motor's shaft.
    damping_nm_s: float
    #: Turns of the motor a turn of the wheel.
    gear_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoder:
    """A quadrature encoder: four edges a line."""

    lines: float
    is_on_motor: bool = True

    def edges_per_turn(self, motor: Motor) -> float:
        """Return the edges of both channels together, a turn of the wheel."""
        return 4 * self.lines * (motor.gear_ratio if self.is_on_motor else 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryDescription:
    """A battery, what else it feeds, and the divider at which the chip measures it."""

    full_v: float
    empty_v: float
    capacity_ah: float
    resistance_ohm: float
    idle_current_a: float
    #: The part of its volts that the divider gives.
    divider: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceSensor:
    """An analog distance sensor."""

    name: str
    x_m: float
    y_m: float
    heading_deg: float
    #: (metres, volts), nearest first; between them a straight line.
    curve: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bumper:
    """A switch that pulls its pin low while something touches the hull within its sector."""

    name: str
    heading_deg: float
    width_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Differential:
    """A whole robot."""

    title: str
    track_m: float
    #: About the middle of the axle; of all but the wheels' and rotors' own rotation.
    yaw_inertia_kg_m2: float
    body: BodyParameters
    bridge: BridgeDescription
    motor: Motor
    encoder: Encoder
    battery: BatteryDescription
    distances: tuple[DistanceSensor, ...] = ()
    distance_period_ns: int = 38_300_000
    bumpers: tuple[Bumper, ...] = ()
    #: Signal → pin of the chip.
    pins: Mapping[str, str]

    @property
    def signals(self) -> tuple[RobotWire, ...]:
        """Every wire that it has, in the order in which a person reads them."""
        return tuple(replace(wire, pin=self.pins.get(wire.name, "")) for wire in self._wires())

    def _wires(self) -> Sequence[RobotWire]:
        found = []
        for side in SIDES:
            found += [RobotWire(name=f"{side}_{pin}", pin="", pull=False) for pin in self.bridge.kind.pins]
            found += [RobotWire(name=f"{side}_{channel}", pin="") for channel in ("a", "b")]
        found += [RobotWire(name=f"bumper_{one.name}", pin="", pull=True) for one in self.bumpers]
        found.append(RobotWire(name="battery", pin="", is_analog=True))
        return [*found, *(RobotWire(name=f"distance_{one.name}", pin="", is_analog=True) for one in self.distances)]

    @property
    def parameters(self) -> RobotParameters:
        """What the bodies and worlds need: its distance sensors stand for sonar."""
        body, base = self.body, load_parameters(_BASE)
        longest_m = max([one.curve[-1][0] for one in self.distances], default=base.sonar_range_m)
        return replace(
            base,
            subclass="differential", robot_class="Robot", title=self.title, track_mm=round(self.track_m * 1000),
            radius_mm=round(1000 * math.hypot(max(body.hull_front_m, body.hull_rear_m), body.hull_width_m / 2)),
            width_mm=round(1000 * body.hull_width_m),
            length_mm=round(1000 * (body.hull_front_m + body.hull_rear_m)),
            front_mm=round(1000 * body.hull_front_m), rear_mm=round(1000 * body.hull_rear_m),
            sonar_fitted=len(self.distances), sonar_range_m=longest_m, sonar_min_range_m=0.001,
            # chosen: the light of such a sensor makes a spot of some centimetres at its longest range
            sonar_cone_deg=4.0, sonar_height_m=body.hull_height_m,
            sonar=tuple(
                SonarPose(x_mm=1000 * one.x_m, y_mm=1000 * one.y_m, heading_deg=one.heading_deg)
                for one in self.distances
            ),
            infrared=(), body=body, rotor_inertia_kg_m2=self.motor.rotor_inertia_kg_m2 * self.motor.gear_ratio**2,
        )  # fmt: skip
