"""A robot model's TOML file: its sections, its keys, and what is wrong with a file in words.

`based_on` takes another model's numbers and overrides some.
"""

from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from p2os.robots.model import (
    FIRMWARE,
    BodyParameters,
    Equipment,
    MotionDefaults,
    ParametersError,
    RobotParameters,
    SonarPose,
)
from p2os.toml_file import TomlPlaces, TomlSource, find_places, read_toml
from p2os.toml_schema import Key, TablePlace, check_table, within
from simbase.errors import nearest, shown
from simbase.files import read_text

#: A TOML table.
Table = dict[str, Any]

#: Section of a file → the keys that go into `RobotParameters` itself.
FLAT_SECTIONS: Mapping[str, tuple[str, ...]] = {
    "conversion": (
        "distance_nm_per_count", "angle_counts_per_turn", "velocity_um_s_per_count", "range_um_per_count",
        "vel2_divisor_mm_s", "track_mm",
    ),
    "limits": ("max_velocity_mm_s", "max_rotation_deg_s"),
    "footprint": ("radius_mm", "width_mm", "length_mm", "front_mm", "rear_mm"),
}  # fmt: skip
#: Keys that may have a fraction → the field that holds a thousandth of their unit.
FINE_KEYS: Mapping[str, str] = {
    "velocity_um_s_per_count": "velocity_nm_s_per_count",
    "range_um_per_count": "range_nm_per_count",
}
#: Section → key → least and most. chosen: a tenth of the smallest robot that ships to ten times the largest, or what
#: the field's own field on the wire holds.
RANGES: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "conversion": {
        "distance_nm_per_count": (1000, 20_000_000), "angle_counts_per_turn": (16, 65_536),
        "velocity_um_s_per_count": (1, 100_000), "range_um_per_count": (1, 100_000), "vel2_divisor_mm_s": (1, 1000),
        "track_mm": (20, 10_000),
    },
    "limits": {"max_velocity_mm_s": (1, 32_767), "max_rotation_deg_s": (1, 32_767)},
    "footprint": {
        "radius_mm": (10, 10_000), "width_mm": (10, 20_000), "length_mm": (10, 20_000), "front_mm": (1, 10_000),
        "rear_mm": (1, 10_000),
    },
    "equipment": {
        "front_bumpers": (0, 16), "rear_bumpers": (0, 16), "wheels": (1, 64),
        "max_lateral_mm_s": (0, 32_767), "gyro_scaler": (0.001, 1000),
        "laser_x_mm": (-10_000, 10_000), "laser_y_mm": (-10_000, 10_000),
    },
    "motion": {
        "max_velocity_mm_s": (1, 32_767), "max_rotation_deg_s": (1, 32_767), "accel_mm_s2": (1, 32_767),
        "decel_mm_s2": (1, 32_767), "rot_accel_deg_s2": (1, 32_767), "rot_decel_deg_s2": (1, 32_767),
    },
    "sonar": {
        "fitted": (0, 256), "range_m": (0.1, 100), "min_range_m": (0.001, 10), "cone_deg": (0.1, 180),
        "height_m": (0.01, 10),
    },
    "body": {
        "hull_front_m": (0.01, 10), "hull_rear_m": (0.01, 10), "hull_width_m": (0.01, 20), "hull_height_m": (0.01, 20),
        "ground_clearance_m": (0.001, 5), "mass_kg": (0.3, 10_000), "wheel_diameter_m": (0.01, 5),
        "wheel_width_m": (0.001, 2), "wheel_mass_kg": (0.01, 1000), "caster_radius_m": (0.001, 2),
        "caster_x_m": (-10, 10), "motor_torque_nm": (0.01, 10_000),
        "axle_distance_m": (0.01, 10), "wheel_distance_m": (0.01, 20),
    },
}  # fmt: skip
#: A sonar's place on its robot, mm and degrees.
POSE_RANGES = ((-20_000, 20_000), (-20_000, 20_000), (-360, 360))
#: Infra-red eyes that the IOpac has bits for.
MOST_EYES = 8
#: chosen: longer is no name; a title is shown on one line.
LONGEST_TEXT = 100
#: A caster of this mass rolls under every robot (`p2os.pioneer.body`).
CASTER_KG = 0.2
#: Keys of what has more than one axle.
_OF_SEVERAL_AXLES = frozenset({"axle_distance_m", "wheel_distance_m"})
#: Keys of numbers that may have a fraction, beside those of the sonar and the body.
_FRACTIONS = frozenset({*FINE_KEYS, "gyro_scaler"})


def _keys(section: str) -> tuple[Key, ...]:
    """Return the keys of a section that are numbers."""
    return tuple(
        Key(
            name=name, kind="number" if name in _FRACTIONS or (section in {"sonar", "body"} and name != "fitted")
            else "whole", least=least, most=most, required=section != "equipment" and name not in _OF_SEVERAL_AXLES,
        )
        for name, (least, most) in RANGES[section].items()
    )  # fmt: skip


SECTIONS: Mapping[str, tuple[Key, ...]] = {
    **{section: _keys(section) for section in RANGES},
    "equipment": (*_keys("equipment"), Key(name="has_move", kind="flag"), Key(name="sends_io_packets", kind="flag")),
    "sonar": (*_keys("sonar"), Key(name="poses", kind="points", count=3, required=True)),
    "infrared": (Key(name="points", kind="points", count=2, required=True),),
}
TOP = (
    Key(name="based_on", kind="text"),
    *(Key(name=name, kind="ascii", required=True, most=LONGEST_TEXT) for name in ("subclass", "robot_class", "title")),
    Key(name="firmware", kind="texts"),
    *(Key(name=name, kind="table", required=name not in {"equipment", "infrared"}) for name in SECTIONS),
)


def known_robots() -> tuple[str, ...]:
    """Return the subclasses that ship with the package."""
    return tuple(sorted(path.name.removesuffix(".toml") for path in files("p2os.robots").iterdir()
                        if path.name.endswith(".toml")))  # fmt: skip


def shipped_table(name: str) -> Table:
    """Return the table of a shipped model, with what it is based on filled in."""
    text = files("p2os.robots").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return table_of(f"{name}.toml", text)


def file_parameters(path: Path) -> RobotParameters:
    """Return the parameters of a TOML file.

    Raises:
        ParametersError: The file breaks the schema; the message names the line.
    """
    text = text_of(path)
    table = table_of(str(path), text)
    return build_parameters(str(path), table, find_places(text))


def text_of(path: Path) -> str:
    """Return what a user's file holds; bytes that are no UTF-8 are shown as such.

    Raises:
        ParametersError: The file cannot be read.
    """
    return read_text(path, ParametersError, errors="replace")


def table_of(source: str, text: str) -> Table:
    """Return the table of a TOML text, with what it is based on filled in.

    Args:
        source: Its name, for messages.
        text: TOML.

    Raises:
        ParametersError: It is not TOML, or what it is based on is no shipped model.
    """
    table, places = read_toml(text, source, "a robot model", ParametersError)
    base = table.get("based_on")
    if base is None:
        return table
    if base not in known_robots() or f"{base}.toml" == source:
        at = f"{source}:{places.line('', 0, 'based_on')}"
        raise ParametersError(f"{at}: based_on = {shown(base)} is no shipped model")
    return merged(shipped_table(base), table)


def merged(base: Table, table: Table) -> Table:
    """Return a model's table with the keys of another over it, section by section."""
    result = dict(base)
    for key, value in table.items():
        old = result.get(key)
        result[key] = {**old, **value} if isinstance(value, dict) and isinstance(old, dict) else value
    return result


def build_parameters(name: str, table: Table, places: TomlPlaces | None = None) -> RobotParameters:
    """Return the parameters that a table says.

    Args:
        name: What to call the file in messages.
        table: As `table_of` gives it.
        places: The file's lines; None where it is no TOML file.

    Raises:
        ParametersError: A key is missing, unknown, of another type, or out of range.
    """
    where = TablePlace(TomlSource(name, places), error=ParametersError)
    check_table(table, TOP, where)
    parts = {"equipment": {}, "infrared": {"points": []}, **table}
    for section, keys in SECTIONS.items():
        check_table(parts[section], keys, within(where, section))
    values: Table = {key: table[key] for key in ("subclass", "robot_class", "title")}
    values["firmware"] = _firmware(table.get("firmware", FIRMWARE[0]), where)
    for section, names in FLAT_SECTIONS.items():
        values |= {key: table[section][key] for key in names if key not in FINE_KEYS}
    values |= {field: round(table["conversion"][key] * 1000) for key, field in FINE_KEYS.items()}
    sonar, poses = table["sonar"], _placed(table["sonar"]["poses"], within(where, "sonar"), "poses")
    if sonar["fitted"] > len(poses):
        raise ParametersError(
            f"{within(where, 'sonar').at('fitted')}: fitted = {sonar['fitted']}, but there are only {len(poses)} poses"
        )
    values |= {f"sonar_{key}": float(sonar[key]) for key in ("range_m", "min_range_m", "cone_deg", "height_m")}
    points = _placed(parts["infrared"]["points"], within(where, "infrared"), "points")
    if len(points) > MOST_EYES:
        raise ParametersError(f"{within(where, 'infrared').at('points')}: points: there are at most {MOST_EYES}")
    _refuse_impossible(table["body"], parts["equipment"].get("wheels", 2), within(where, "body"))
    return RobotParameters(
        **values,
        equipment=Equipment(**parts["equipment"]),
        motion=MotionDefaults(**table["motion"]),
        body=BodyParameters(**{key: float(value) for key, value in table["body"].items()}),
        sonar_fitted=sonar["fitted"],
        sonar=tuple(SonarPose(x_mm=x, y_mm=y, heading_deg=heading) for x, y, heading in poses),
        infrared=tuple((x, y) for x, y in points),
    )


def _firmware(given: str | Sequence[str], where: TablePlace) -> tuple[str, ...]:
    """Return the families of firmware that a file names, each once."""
    found = tuple(dict.fromkeys([given] if isinstance(given, str) else given))
    if not found or not set(found) <= set(FIRMWARE):
        strange = next((name for name in found if name not in FIRMWARE), "")
        hint = nearest(strange, FIRMWARE) if strange else "the usual one first"
        what = f"firmware = {shown(given)} is not of {', '.join(FIRMWARE)}"
        raise ParametersError(f"{where.at('firmware')}: {what}", hint=hint)
    return found


def _placed(rows: Sequence[Sequence[float]], where: TablePlace, key: str) -> Sequence[Sequence[float]]:
    """Return rows of [x mm, y mm, heading degrees], or of the first two, none of them far off."""
    for row in rows:
        if not all(least <= item <= most for item, (least, most) in zip(row, POSE_RANGES, strict=False)):
            hint = "within 20 m of the robot's middle, and 360 degrees"
            raise ParametersError(f"{where.at(key)}: {key}: {shown(row)} is out of range", hint=hint)
    return rows


def _refuse_impossible(body: Table, wheels: int, where: TablePlace) -> None:
    wheels_kg = max(2, wheels) * body["wheel_mass_kg"] + CASTER_KG
    if body["mass_kg"] <= wheels_kg:
        raise ParametersError(
            f"{where.at('mass_kg')}: mass_kg = {body['mass_kg']:g}, but wheels and caster have {wheels_kg:g} kg"
        )
    if body["hull_height_m"] <= body["ground_clearance_m"]:
        raise ParametersError(
            f"{where.at('hull_height_m')}: hull_height_m = {body['hull_height_m']:g} is not above "
            f"ground_clearance_m = {body['ground_clearance_m']:g}"
        )
