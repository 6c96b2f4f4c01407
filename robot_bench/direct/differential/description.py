"""What a differential robot is made of: numbers as its file gives them, in SI units.

Invariant: a description that exists can be built: each signal has one pin, and no encoder is faster than the bench.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.robots.parameters import BodyParameters, RobotParameters, SonarPose, load_parameters
from p2os.toml_record import Record
from p2os.toml_schema import Key
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


#: (metres, volts) of a GP2Y0A21YK. Source: the example in its data sheet (10 to 80 cm), read off the graph; nearer
#: than 7 cm its volts fall again, as they do there.
GP2Y0A21: tuple[tuple[float, float], ...] = (
    (0.0, 0.3), (0.03, 1.9), (0.05, 2.8), (0.07, 3.1), (0.10, 2.3), (0.15, 1.65), (0.20, 1.3), (0.25, 1.08),
    (0.30, 0.92), (0.40, 0.74), (0.50, 0.60), (0.60, 0.51), (0.70, 0.45), (0.80, 0.40),
)  # fmt: skip
#: chosen: the largest voltage that is no danger to who touches it, and batteries of robots of this size.
_MOST_V, _MOST_OHM, MOST_M = 60.0, 10_000.0, 5.0
_Name = Annotated[str, Key(doc="of its signal")]
Along = Annotated[float, Key(least=-MOST_M, most=MOST_M, doc="from the middle of the axle")]
_Heading = Annotated[float, Key(least=-360, most=360, doc="counter-clockwise from ahead")]


class BridgeDescription(Record):
    """`[bridge]`: an H-bridge."""

    kind: Annotated[BridgeKind, Key(doc="by its pins: TB6612FNG, L298N; DRV8835; DRV8833, BTS7960")]
    off: Annotated[Off, Key(doc="while it does not drive")] = Off.BRAKE
    resistance_ohm: Annotated[float, Key(least=0, most=_MOST_OHM, doc="of both switches together")] = 0.0
    drop_v: Annotated[float, Key(least=0, most=10, doc="of bipolar transistors")] = 0.0
    dead_time_us: Annotated[
        float, Key(least=0, most=100, doc="from a pulse to its effect; a shorter one does nothing")
    ] = 0.0

    @property
    def dead_time_ns(self) -> int:
        """A pulse acts so much later than it begins; a shorter one does nothing."""
        return round(1000 * self.dead_time_us)


class Motor(Record):
    """`[motor]`: a DC motor with its gear."""

    resistance_ohm: Annotated[float, Key(least=0.001, most=_MOST_OHM, doc="of the winding")]
    torque_constant_nm_a: Annotated[float, Key(least=1e-6, most=10, doc="N·m/A, and V·s/rad")]
    rotor_inertia_kg_m2: Annotated[float, Key(least=0, most=1, doc="of the rotor")]
    friction_nm: Annotated[float, Key(least=0, most=10, doc="against each motion, at the motor's shaft")]
    damping_nm_s: Annotated[float, Key(least=0, most=1, doc="against the speed, at the motor's shaft")] = 0.0
    gear_ratio: Annotated[float, Key(least=0.1, most=10_000, doc="turns of the motor a turn of the wheel")]


class Encoder(Record):
    """`[encoder]`: a quadrature encoder: four edges a line."""

    lines: Annotated[float, Key(least=1, most=100_000, doc="a turn, four edges each")]
    on: Annotated[Literal["motor", "wheel"], Key(doc="what it turns with")] = "motor"

    def edges_per_turn(self, motor: Motor) -> float:
        """Return the edges of both channels together, a turn of the wheel."""
        return 4 * self.lines * (motor.gear_ratio if self.on == "motor" else 1.0)


class BatteryDescription(Record):
    """`[battery]`: the battery, what else it feeds, and the divider at which the chip measures it."""

    full_v: Annotated[float, Key(above=0, most=_MOST_V, doc="without load, when full")]
    empty_v: Annotated[float, Key(above=0, most=_MOST_V, doc="without load, when empty; it falls linearly")]
    capacity_ah: Annotated[float, Key(above=0, most=10_000, doc="from full to empty")]
    charge: Annotated[float, Key(least=0, most=1, doc="at the start; a scenario's `charge` wins")] = 1.0
    resistance_ohm: Annotated[float, Key(least=0, most=100, doc="internal")]
    idle_current_a: Annotated[float, Key(least=0, most=100, doc="of all but the motors")] = 0.0
    divider_top_ohm: Annotated[float, Key(least=0, most=1e8, doc="from the battery to the pin")]
    divider_bottom_ohm: Annotated[float, Key(above=0, most=1e8, doc="from the pin to ground")]

    def __post_init__(self) -> None:
        if self.empty_v > self.full_v:
            raise ScenarioError("empty_v is above full_v")

    @property
    def divider(self) -> float:
        """The part of its volts that the divider gives."""
        return self.divider_bottom_ohm / (self.divider_top_ohm + self.divider_bottom_ohm)


class DistanceSensor(Record):
    """`[[distance]]`: an analog distance sensor."""

    name: _Name
    x_m: Along
    y_m: Along
    heading_deg: _Heading
    curve: Annotated[tuple[tuple[float, float], ...], Key(
        kind="points", count=2, least=0, most=100, doc="[metres, volts], nearest first; default a GP2Y0A21YK"
    )] = GP2Y0A21  # fmt: skip


class Bumper(Record):
    """`[[bumper]]`: a switch that pulls its pin low while something touches the hull within its sector."""

    name: _Name
    heading_deg: _Heading
    width_deg: Annotated[float, Key(least=1, most=360, doc="of its sector")]


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
