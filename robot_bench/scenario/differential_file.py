"""The file of a differential robot: its tables, their keys and ranges, and what is wrong with one in a line.

docs/own-robot.md lists every key. Units stand in the keys; what a file does not say has the default of `_KEYS`.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import cast

from p2os.errors import ScenarioError
from p2os.robots.parameters import BodyParameters
from p2os.toml_schema import Key, Place, Table, check_table, within
from robot_bench.direct.differential.analog import GP2Y0A21
from robot_bench.direct.differential.description import (
    Battery,
    Bridge,
    BridgeKind,
    Bumper,
    Differential,
    DistanceSensor,
    Encoder,
    Motor,
    Off,
)
from robot_bench.direct.differential.drive_train import box_inertia, no_load_radps
from simbase.errors import shown

#: chosen: a bench hands the chip no more edges of both encoders in a step of 1 ms than it has room for.
MOST_EDGES_A_SECOND = 400_000
#: chosen: the largest voltage that is no danger to who touches it, and batteries of robots of this size.
_MOST_V, _MOST_OHM, _MOST_M = 60.0, 10_000.0, 5.0


def _number(name: str, least: float, most: float, *, required: bool = True) -> Key:
    return Key(name=name, kind="number", least=least, most=most, required=required)


_NAME = Key(name="name", kind="text", required=True)
#: Every table of a file and its keys.
TABLES: Mapping[str, tuple[Key, ...]] = {
    "": (
        Key(name="kind", kind="text", required=True),
        Key(name="title", kind="text"),
        *(
            Key(name=name, kind="table", required=True)
            for name in ("body", "bridge", "motor", "encoder", "battery", "pins")
        ),
        Key(name="distance_period_ms", kind="number", least=1, most=10_000),
        Key(name="distance", kind="tables"),
        Key(name="bumper", kind="tables"),
    ),
    "body": (
        _number("track_m", 0.02, _MOST_M),
        _number("mass_kg", 0.3, 1000),
        _number("yaw_inertia_kg_m2", 1e-6, 10_000, required=False),
        _number("wheel_diameter_m", 0.01, 2),
        _number("wheel_width_m", 0.001, 1),
        _number("wheel_mass_kg", 0.001, 100),
        _number("hull_front_m", 0.01, _MOST_M),
        _number("hull_rear_m", 0.01, _MOST_M),
        _number("hull_width_m", 0.01, _MOST_M),
        _number("hull_height_m", 0.01, _MOST_M),
        _number("ground_clearance_m", 0.001, 1),
        _number("caster_radius_m", 0.001, 1),
        _number("caster_x_m", -_MOST_M, _MOST_M),
    ),
    "bridge": (
        Key(name="kind", kind="text", required=True, choices=tuple(BridgeKind)),
        Key(name="off", kind="text", choices=tuple(Off)),
        _number("resistance_ohm", 0, _MOST_OHM, required=False),
        _number("drop_v", 0, 10, required=False),
        _number("dead_time_us", 0, 100, required=False),
    ),
    "motor": (
        _number("resistance_ohm", 0.001, _MOST_OHM),
        _number("torque_constant_nm_a", 1e-6, 10),
        _number("rotor_inertia_kg_m2", 0, 1),
        _number("friction_nm", 0, 10),
        _number("damping_nm_s", 0, 1, required=False),
        _number("gear_ratio", 0.1, 10_000),
    ),
    "encoder": (
        _number("lines", 1, 100_000),
        Key(name="on", kind="text", choices=("motor", "wheel")),
    ),
    "battery": (
        Key(name="full_v", kind="number", above=0, most=_MOST_V, required=True),
        Key(name="empty_v", kind="number", above=0, most=_MOST_V, required=True),
        Key(name="capacity_ah", kind="number", above=0, most=10_000, required=True),
        _number("resistance_ohm", 0, 100),
        _number("idle_current_a", 0, 100, required=False),
        _number("divider_top_ohm", 0, 1e8),
        Key(name="divider_bottom_ohm", kind="number", above=0, most=1e8, required=True),
    ),
    "distance": (
        _NAME,
        _number("x_m", -_MOST_M, _MOST_M),
        _number("y_m", -_MOST_M, _MOST_M),
        _number("heading_deg", -360, 360),
        Key(name="curve", kind="list"),
    ),
    "bumper": (_NAME, _number("heading_deg", -360, 360), _number("width_deg", 1, 360)),
}  # fmt: skip
#: chosen: a short range has no more points that matter; 3.3 V is what the chip's pins bear.
_MOST_POINTS, _MOST_PIN_V = 100, 3.3


def load_differential(table: Table, where: Place, pins: Mapping[str, str]) -> Differential:
    """Return the robot that a file describes.

    Args:
        table: The file's table.
        where: The file's place, for messages.
        pins: Signal → pin of the chip, checked by who has read them.

    Raises:
        ScenarioError: A key is unknown, missing or out of range, or parts do not go together.
    """
    check_table(table, TABLES[""], where)
    parts = {name: _part(table, name, where) for name in ("body", "bridge", "motor", "encoder", "battery")}
    body, bridge, motor, battery = (parts[name] for name in ("body", "bridge", "motor", "battery"))
    _refuse_impossible(body, battery, where)
    mass_kg, front, rear = (cast("float", body[name]) for name in ("mass_kg", "hull_front_m", "hull_rear_m"))
    box = box_inertia(mass_kg, front + rear, cast("float", body["hull_width_m"]), (front - rear) / 2)
    top, bottom = cast("float", battery["divider_top_ohm"]), cast("float", battery["divider_bottom_ohm"])
    robot = Differential(
        title=str(table.get("title", "differential robot")),
        track_m=cast("float", body["track_m"]),
        yaw_inertia_kg_m2=cast("float", body.get("yaw_inertia_kg_m2", box)),
        body=BodyParameters(
            # The torque of a stalled motor: the bodies hold a wheel with no more.
            motor_torque_nm=_stall_torque(motor, battery),
            **{
                name: float(cast("float", value))
                for name, value in body.items()
                if name not in {"track_m", "yaw_inertia_kg_m2"}
            },
        ),
        bridge=Bridge(
            kind=BridgeKind(str(bridge["kind"])), off=Off(str(bridge.get("off", Off.BRAKE))),
            resistance_ohm=cast("float", bridge.get("resistance_ohm", 0.0)),
            drop_v=cast("float", bridge.get("drop_v", 0.0)),
            dead_time_ns=round(1000 * cast("float", bridge.get("dead_time_us", 0.0))),
        ),
        motor=Motor(
            resistance_ohm=cast("float", motor["resistance_ohm"]),
            torque_constant=cast("float", motor["torque_constant_nm_a"]),
            rotor_inertia_kg_m2=cast("float", motor["rotor_inertia_kg_m2"]),
            friction_nm=cast("float", motor["friction_nm"]),
            damping_nm_s=cast("float", motor.get("damping_nm_s", 0.0)),
            gear_ratio=cast("float", motor["gear_ratio"]),
        ),
        encoder=Encoder(
            lines=cast("float", parts["encoder"]["lines"]),
            is_on_motor=parts["encoder"].get("on", "motor") == "motor",
        ),
        battery=Battery(
            full_v=cast("float", battery["full_v"]), empty_v=cast("float", battery["empty_v"]),
            capacity_ah=cast("float", battery["capacity_ah"]),
            resistance_ohm=cast("float", battery["resistance_ohm"]),
            idle_current_a=cast("float", battery.get("idle_current_a", 0.0)), divider=bottom / (top + bottom),
        ),
        distances=tuple(
            DistanceSensor(
                name=str(one["name"]), x_m=cast("float", one["x_m"]), y_m=cast("float", one["y_m"]),
                heading_deg=cast("float", one["heading_deg"]), curve=_curve(one.get("curve"), at),
            )
            for one, at in _rows(table, "distance", where)
        ),
        distance_period_ns=round(1e6 * cast("float", table.get("distance_period_ms", 38.3))),
        bumpers=tuple(
            Bumper(
                name=str(one["name"]), heading_deg=cast("float", one["heading_deg"]),
                width_deg=cast("float", one["width_deg"]),
            )
            for one, _ in _rows(table, "bumper", where)
        ),
        pins=pins,
    )  # fmt: skip
    _refuse_fast_encoder(robot, where)
    return robot


def _part(table: Table, name: str, where: Place) -> Table:
    part = cast("Table", table[name])
    check_table(part, TABLES[name], within(where, name))
    return part


def _rows(table: Table, name: str, where: Place) -> list[tuple[Table, Place]]:
    """Return the tables of an array with their places; names are given once."""
    found: list[tuple[Table, Place]] = []
    for number, one in enumerate(cast("list[Table]", table.get(name, []))):
        at = Place(where.source, name, number, f"[[{name}]] {number + 1}")
        check_table(one, TABLES[name], at)
        word = str(one["name"])
        if not word.isidentifier() or not word.isascii() or word in {str(other["name"]) for other, _ in found}:
            raise ScenarioError(
                f"{at.at('name')}: name = {shown(word)} is no name of a signal", hint="a word, and another for each"
            )
        found.append((one, at))
    return found


def _stall_torque(motor: Table, battery: Table) -> float:
    volts, ohms = cast("float", battery["full_v"]), cast("float", motor["resistance_ohm"])
    torque = cast("float", motor["torque_constant_nm_a"]) * cast("float", motor["gear_ratio"]) * volts / ohms
    return min(max(torque, 0.01), 10_000.0)


def _curve(value: object, at: Place) -> tuple[tuple[float, float], ...]:
    """Return the points of a sensor's curve."""
    if value is None:
        return GP2Y0A21
    points = value if isinstance(value, list) else []
    good = 2 <= len(points) <= _MOST_POINTS and all(
        isinstance(point, list)
        and len(point) == 2
        and all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in point)
        and 0 <= point[0] <= 100
        and 0 <= point[1] <= _MOST_PIN_V
        for point in points
    )
    found = tuple((float(metres), float(volts)) for metres, volts in points) if good else ()
    if not good or any(one[0] >= other[0] for one, other in pairwise(found)):
        raise ScenarioError(
            f"{at.at('curve')}: curve must be points of [metres, volts], nearest first",
            hint=f"such as [[0.1, 2.3], [0.8, 0.4]], 2 to {_MOST_POINTS} of them, up to 100 m and {_MOST_PIN_V} V",
        )
    return found


def _refuse_impossible(body: Table, battery: Table, where: Place) -> None:
    mass, wheel = cast("float", body["mass_kg"]), cast("float", body["wheel_mass_kg"])
    if mass <= 2 * wheel + 0.2:
        raise ScenarioError(
            f"{within(where, 'body')}: mass_kg = {mass:g} is not more than two wheels of {wheel:g} kg and a caster"
            " of 0.2 kg"
        )
    if cast("float", body["hull_height_m"]) <= cast("float", body["ground_clearance_m"]):
        raise ScenarioError(f"{within(where, 'body')}: hull_height_m is not above ground_clearance_m")
    if cast("float", battery["empty_v"]) > cast("float", battery["full_v"]):
        raise ScenarioError(f"{within(where, 'battery')}: empty_v is above full_v")


def _refuse_fast_encoder(robot: Differential, where: Place) -> None:
    edges = robot.encoder.edges_per_turn(robot.motor) * no_load_radps(robot) / (2 * math.pi)
    if edges > MOST_EDGES_A_SECOND:
        raise ScenarioError(
            f"{within(where, 'encoder')}: a wheel without load would make {edges:.0f} edges a second",
            hint=f"at most {MOST_EDGES_A_SECOND}: fewer lines, less gear or fewer volts",
        )
