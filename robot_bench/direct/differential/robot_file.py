"""The file of a differential robot: its tables, their keys and ranges, and what is wrong with one in a line.

docs/own-robot.md lists every key. Units stand in the keys; what a file does not say has the default of `TABLES`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, TypeVar

from p2os.errors import ScenarioError
from p2os.robots.parameters import BodyParameters
from p2os.toml_record import Record, given, read, sections
from p2os.toml_schema import Key, Table, TablePlace, within
from robot_bench.direct.differential.description import (
    MOST_M,
    Along,
    BatteryDescription,
    BridgeDescription,
    Bumper,
    Differential,
    DistanceSensor,
    Encoder,
    Motor,
)
from robot_bench.direct.differential.drive_train import box_inertia, no_load_radps
from simbase.errors import shown

#: chosen: a bench hands the chip no more edges of both encoders in a step of 1 ms than it has room for.
MOST_EDGES_A_SECOND = 400_000


_Length = Annotated[float, Key(least=0.01, most=MOST_M, doc="of the hull, from the middle of the axle or across")]


class BodyTable(Record):
    """`[body]`: the robot as a physical thing."""

    track_m: Annotated[float, Key(least=0.02, most=MOST_M, doc="from wheel to wheel")]
    mass_kg: Annotated[float, Key(least=0.3, most=1000, doc="of all")]
    yaw_inertia_kg_m2: Annotated[
        float | None, Key(least=1e-6, most=10_000, doc="about the middle of the axle; default a box of the hull's size")
    ] = None
    wheel_diameter_m: Annotated[float, Key(least=0.01, most=2, doc="of a driven wheel")]
    wheel_width_m: Annotated[float, Key(least=0.001, most=1, doc="of a driven wheel")]
    wheel_mass_kg: Annotated[float, Key(least=0.001, most=100, doc="of a driven wheel")]
    hull_front_m: _Length
    hull_rear_m: _Length
    hull_width_m: _Length
    hull_height_m: _Length
    ground_clearance_m: Annotated[float, Key(least=0.001, most=1, doc="under the hull")]
    caster_radius_m: Annotated[float, Key(least=0.001, most=1, doc="of the caster")]
    caster_x_m: Along

    def __post_init__(self) -> None:
        if self.mass_kg <= 2 * self.wheel_mass_kg + 0.2:
            raise ScenarioError(
                f"mass_kg = {self.mass_kg:g} is not more than two wheels of {self.wheel_mass_kg:g} kg and a caster"
                " of 0.2 kg"
            )
        if self.hull_height_m <= self.ground_clearance_m:
            raise ScenarioError("hull_height_m is not above ground_clearance_m")


class DifferentialTable(Record):
    """The top of the file."""

    kind: Annotated[str, Key(doc="`differential`")]
    title: Annotated[str, Key(doc="what reports call it")] = "differential robot"
    body: Annotated[BodyTable, Key(doc="hull, wheels and caster")]
    bridge: Annotated[BridgeDescription, Key(doc="the H-bridges")]
    motor: Annotated[Motor, Key(doc="the motors with their gears")]
    encoder: Annotated[Encoder, Key(doc="the quadrature encoders")]
    battery: Annotated[BatteryDescription, Key(doc="the battery and its divider")]
    pins: Annotated[Mapping[str, object], Key(doc="signal = pin of the BluePill, each once")]
    distance_period_ms: Annotated[float, Key(least=1, most=10_000, doc="from one measurement to the next")] = 38.3
    distance: Annotated[tuple[Table, ...], Key(record=DistanceSensor, doc="analog distance sensors")] = ()
    bumper: Annotated[tuple[Table, ...], Key(record=Bumper, doc="switches at the hull")] = ()


#: Every table of a file and its keys.
TABLES: Mapping[str, tuple[Key, ...]] = dict(sections(DifferentialTable))
#: chosen: a short range has no more points that matter; 3.3 V is what the chip's pins bear.
_MOST_POINTS, _MOST_PIN_V = 100, 3.3


def load_differential(table: Table, where: TablePlace, pins: Mapping[str, str]) -> Differential:
    """Return the robot that a file describes.

    Args:
        table: The file's table.
        where: The file's place, for messages.
        pins: Signal → pin of the chip, checked by who has read them.

    Raises:
        ScenarioError: A key is unknown, missing or out of range, or parts do not go together.
    """
    top = read(DifferentialTable, table, where)
    body, named = top.body, dict(given(top.body))
    front, rear = body.hull_front_m, body.hull_rear_m
    robot = Differential(
        title=top.title,
        track_m=named.pop("track_m"),
        yaw_inertia_kg_m2=named.pop("yaw_inertia_kg_m2", None)
        or box_inertia(body.mass_kg, front + rear, body.hull_width_m, (front - rear) / 2),
        # The torque of a stalled motor: the bodies hold a wheel with no more.
        body=BodyParameters(motor_torque_nm=_stall_torque(top.motor, top.battery), **named),
        bridge=top.bridge,
        motor=top.motor,
        encoder=top.encoder,
        battery=top.battery,
        distances=tuple(
            replace(one, curve=_curve(one.curve, at))
            for one, at in _rows(DistanceSensor, top.distance, "distance", where)
        ),
        distance_period_ns=round(1e6 * top.distance_period_ms),
        bumpers=tuple(one for one, _ in _rows(Bumper, top.bumper, "bumper", where)),
        pins=pins,
    )  # fmt: skip
    _refuse_fast_encoder(robot, where)
    return robot


T = TypeVar("T", DistanceSensor, Bumper)


def _rows(record: type[T], rows: Sequence[Table], name: str, where: TablePlace) -> list[tuple[T, TablePlace]]:
    """Return the tables of an array with their places; names are given once."""
    found: dict[str, tuple[T, TablePlace]] = {}
    for number, row in enumerate(rows):
        at = within(where, name, number)
        one = read(record, row, at)
        if not one.name.isidentifier() or not one.name.isascii() or one.name in found:
            raise ScenarioError(
                f"{at.at('name')}: name = {shown(one.name)} is no name of a signal", hint="a word, and another for each"
            )
        found[one.name] = one, at
    return list(found.values())


def _stall_torque(motor: Motor, battery: BatteryDescription) -> float:
    return min(
        max(motor.torque_constant_nm_a * motor.gear_ratio * battery.full_v / motor.resistance_ohm, 0.01), 10_000.0
    )


def _curve(points: Sequence[tuple[float, float]], at: TablePlace) -> tuple[tuple[float, float], ...]:
    """Return the points of a sensor's curve."""
    found = tuple((float(metres), float(volts)) for metres, volts in points)
    good = 2 <= len(found) <= _MOST_POINTS and all(volts <= _MOST_PIN_V for _, volts in found)
    if not good or any(one[0] >= other[0] for one, other in pairwise(found)):
        raise ScenarioError(
            f"{at.at('curve')}: curve must be points of [metres, volts], nearest first",
            hint=f"such as [[0.1, 2.3], [0.8, 0.4]], 2 to {_MOST_POINTS} of them, up to 100 m and {_MOST_PIN_V} V",
        )
    return found


def _refuse_fast_encoder(robot: Differential, where: TablePlace) -> None:
    edges = robot.encoder.edges_per_turn(robot.motor) * no_load_radps(robot) / (2 * math.pi)
    if edges > MOST_EDGES_A_SECOND:
        raise ScenarioError(
            f"{within(where, 'encoder')}: a wheel without load would make {edges:.0f} edges a second",
            hint=f"at most {MOST_EDGES_A_SECOND}: fewer lines, less gear or fewer volts",
        )
