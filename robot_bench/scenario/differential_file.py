"""The file of a differential robot: its tables, their keys and ranges, and what is wrong with one in a line.

docs/own-robot.md lists every key. Units stand in the keys; what a file does not say has the default of `TABLES`.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from p2os.errors import ScenarioError
from p2os.robots.parameters import BodyParameters
from p2os.toml_schema import Key, Table, TablePlace, filled, within
from robot_bench.direct.differential.analog import GP2Y0A21
from robot_bench.direct.differential.description import (
    BatteryDescription,
    BridgeDescription,
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

#: A table with a value for every key.
Values = dict[str, Any]
#: chosen: a bench hands the chip no more edges of both encoders in a step of 1 ms than it has room for.
MOST_EDGES_A_SECOND = 400_000
#: chosen: the largest voltage that is no danger to who touches it, and batteries of robots of this size.
_MOST_V, _MOST_OHM, _MOST_M = 60.0, 10_000.0, 5.0


def _number(name: str, least: float, most: float, *, default: float | None = None) -> Key:
    return Key(name=name, kind="number", least=least, most=most, required=default is None, default=default)


_NAME = Key(name="name", kind="text", required=True)
#: Every table of a file and its keys.
TABLES: Mapping[str, tuple[Key, ...]] = {
    "": (
        Key(name="kind", kind="text", required=True),
        Key(name="title", kind="text", default="differential robot"),
        *(
            Key(name=name, kind="table", required=True)
            for name in ("body", "bridge", "motor", "encoder", "battery", "pins")
        ),
        Key(name="distance_period_ms", kind="number", least=1, most=10_000, default=38.3),
        Key(name="distance", kind="tables", default=[]),
        Key(name="bumper", kind="tables", default=[]),
    ),
    "body": (
        _number("track_m", 0.02, _MOST_M),
        _number("mass_kg", 0.3, 1000),
        Key(name="yaw_inertia_kg_m2", kind="number", least=1e-6, most=10_000),
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
        Key(name="off", kind="text", choices=tuple(Off), default=Off.BRAKE),
        _number("resistance_ohm", 0, _MOST_OHM, default=0.0),
        _number("drop_v", 0, 10, default=0.0),
        _number("dead_time_us", 0, 100, default=0.0),
    ),
    "motor": (
        _number("resistance_ohm", 0.001, _MOST_OHM),
        _number("torque_constant_nm_a", 1e-6, 10),
        _number("rotor_inertia_kg_m2", 0, 1),
        _number("friction_nm", 0, 10),
        _number("damping_nm_s", 0, 1, default=0.0),
        _number("gear_ratio", 0.1, 10_000),
    ),
    "encoder": (
        _number("lines", 1, 100_000),
        Key(name="on", kind="text", choices=("motor", "wheel"), default="motor"),
    ),
    "battery": (
        Key(name="full_v", kind="number", above=0, most=_MOST_V, required=True),
        Key(name="empty_v", kind="number", above=0, most=_MOST_V, required=True),
        Key(name="capacity_ah", kind="number", above=0, most=10_000, required=True),
        _number("resistance_ohm", 0, 100),
        _number("idle_current_a", 0, 100, default=0.0),
        _number("divider_top_ohm", 0, 1e8),
        Key(name="divider_bottom_ohm", kind="number", above=0, most=1e8, required=True),
    ),
    "distance": (
        _NAME,
        _number("x_m", -_MOST_M, _MOST_M),
        _number("y_m", -_MOST_M, _MOST_M),
        _number("heading_deg", -360, 360),
        Key(name="curve", kind="points", count=2, least=0, most=100, default=GP2Y0A21),
    ),
    "bumper": (_NAME, _number("heading_deg", -360, 360), _number("width_deg", 1, 360)),
}  # fmt: skip
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
    top = filled(table, TABLES[""], where)
    body, bridge, motor, encoder, battery = (
        filled(top[name], TABLES[name], within(where, name))
        for name in ("body", "bridge", "motor", "encoder", "battery")
    )
    _refuse_impossible(body, battery, where)
    front, rear, track_m, inertia = (
        body[name] for name in ("hull_front_m", "hull_rear_m", "track_m", "yaw_inertia_kg_m2")
    )
    box = box_inertia(body["mass_kg"], front + rear, body["hull_width_m"], (front - rear) / 2)
    over, under = battery.pop("divider_top_ohm"), battery.pop("divider_bottom_ohm")
    named = {key.name for key in TABLES["body"]} - {"track_m", "yaw_inertia_kg_m2"}
    robot = Differential(
        title=top["title"],
        track_m=track_m,
        yaw_inertia_kg_m2=box if inertia is None else inertia,
        # The torque of a stalled motor: the bodies hold a wheel with no more.
        body=BodyParameters(
            motor_torque_nm=_stall_torque(motor, battery), **{name: float(body[name]) for name in named}
        ),
        bridge=BridgeDescription(
            kind=BridgeKind(bridge["kind"]), off=Off(bridge["off"]), resistance_ohm=bridge["resistance_ohm"],
            drop_v=bridge["drop_v"], dead_time_ns=round(1000 * bridge["dead_time_us"]),
        ),
        motor=Motor(torque_constant=motor.pop("torque_constant_nm_a"), **motor),
        encoder=Encoder(lines=encoder["lines"], is_on_motor=encoder["on"] == "motor"),
        battery=BatteryDescription(divider=under / (over + under), **battery),
        distances=tuple(
            DistanceSensor(**one | {"curve": _curve(one["curve"], at)})
            for one, at in _rows(top["distance"], "distance", where)
        ),
        distance_period_ns=round(1e6 * top["distance_period_ms"]),
        bumpers=tuple(Bumper(**one) for one, _ in _rows(top["bumper"], "bumper", where)),
        pins=pins,
    )  # fmt: skip
    _refuse_fast_encoder(robot, where)
    return robot


def _rows(rows: list[Table], name: str, where: TablePlace) -> list[tuple[Values, TablePlace]]:
    """Return the tables of an array with their places; names are given once."""
    found: dict[str, tuple[Values, TablePlace]] = {}
    for number, row in enumerate(rows):
        at = TablePlace(where.source, name, number, f"[[{name}]] {number + 1}")
        one = filled(row, TABLES[name], at)
        word = str(one["name"])
        if not word.isidentifier() or not word.isascii() or word in found:
            raise ScenarioError(
                f"{at.at('name')}: name = {shown(word)} is no name of a signal", hint="a word, and another for each"
            )
        found[word] = one, at
    return list(found.values())


def _stall_torque(motor: Values, battery: Values) -> float:
    torque: float = motor["torque_constant_nm_a"] * motor["gear_ratio"] * battery["full_v"] / motor["resistance_ohm"]
    return min(max(torque, 0.01), 10_000.0)


def _curve(points: list[list[float]], at: TablePlace) -> tuple[tuple[float, float], ...]:
    """Return the points of a sensor's curve."""
    found = tuple((float(metres), float(volts)) for metres, volts in points)
    good = 2 <= len(found) <= _MOST_POINTS and all(volts <= _MOST_PIN_V for _, volts in found)
    if not good or any(one[0] >= other[0] for one, other in pairwise(found)):
        raise ScenarioError(
            f"{at.at('curve')}: curve must be points of [metres, volts], nearest first",
            hint=f"such as [[0.1, 2.3], [0.8, 0.4]], 2 to {_MOST_POINTS} of them, up to 100 m and {_MOST_PIN_V} V",
        )
    return found


def _refuse_impossible(body: Values, battery: Values, where: TablePlace) -> None:
    mass, wheel = body["mass_kg"], body["wheel_mass_kg"]
    if mass <= 2 * wheel + 0.2:
        raise ScenarioError(
            f"{within(where, 'body')}: mass_kg = {mass:g} is not more than two wheels of {wheel:g} kg and a caster"
            " of 0.2 kg"
        )
    if body["hull_height_m"] <= body["ground_clearance_m"]:
        raise ScenarioError(f"{within(where, 'body')}: hull_height_m is not above ground_clearance_m")
    if battery["empty_v"] > battery["full_v"]:
        raise ScenarioError(f"{within(where, 'battery')}: empty_v is above full_v")


def _refuse_fast_encoder(robot: Differential, where: TablePlace) -> None:
    edges = robot.encoder.edges_per_turn(robot.motor) * no_load_radps(robot) / (2 * math.pi)
    if edges > MOST_EDGES_A_SECOND:
        raise ScenarioError(
            f"{within(where, 'encoder')}: a wheel without load would make {edges:.0f} edges a second",
            hint=f"at most {MOST_EDGES_A_SECOND}: fewer lines, less gear or fewer volts",
        )
