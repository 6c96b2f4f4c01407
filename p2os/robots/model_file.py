"""A robot model's TOML file: its sections, its keys, and what is wrong with a file in words.

`based_on` takes another model's numbers and overrides some.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

from p2os.robots.model import BodyParameters, Equipment, MotionDefaults, ParametersError, RobotParameters, SonarPose
from p2os.toml_file import TomlPlaces, TomlSource, find_places, read_toml
from simbase.errors import shown, shown_name

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
SONAR_KEYS = ("fitted", "range_m", "min_range_m", "cone_deg", "height_m", "poses")
TOP_KEYS = ("based_on", "subclass", "robot_class", "title")
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
_WORDS: Mapping[type, str] = {str: "text", bool: "true or false", int: "whole number", float: "number"}


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
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = getattr(error, "strerror", None) or str(error)
        raise ParametersError(f"cannot read {shown_name(path)}: {why.lower()}") from error


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
    source = TomlSource(name, places)
    sections = {*FLAT_SECTIONS, "equipment", "motion", "sonar", "infrared", "body"}
    _only(source, "", table, (*TOP_KEYS, *sections))
    values: Table = {key: _value(source, "", table, key, str) for key in TOP_KEYS[1:]}
    for section, keys in FLAT_SECTIONS.items():
        part = _section(source, table, section, keys)
        for key in keys:
            if key in FINE_KEYS:
                values[FINE_KEYS[key]] = round(_value(source, section, part, key, float) * 1000)
            else:
                values[key] = _value(source, section, part, key, int)
    motion = _section(source, table, "motion", _keys(MotionDefaults))
    body = _section(source, table, "body", _keys(BodyParameters))
    sonar = _section(source, table, "sonar", SONAR_KEYS)
    fitted, poses = _value(source, "sonar", sonar, "fitted", int), _poses(source, sonar.get("poses"))
    if fitted > len(poses):
        raise ParametersError(
            f"{source.at('sonar', 'fitted')}: sonar.fitted = {fitted}, but there are only {len(poses)} poses"
        )
    numbers = {f"sonar_{key}": _value(source, "sonar", sonar, key, float) for key in SONAR_KEYS[1:-1]}
    _refuse_impossible(source, body)
    return RobotParameters(
        **values,
        **numbers,
        equipment=_equipment(source, table.get("equipment", {})),
        motion=MotionDefaults(**{key: _value(source, "motion", motion, key, int) for key in _keys(MotionDefaults)}),
        body=BodyParameters(**{key: _value(source, "body", body, key, float) for key in _keys(BodyParameters)}),
        sonar_fitted=fitted,
        sonar=poses,
        infrared=_infrared(source, table.get("infrared", {"points": []})),
    )


def _keys(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _equipment(source: TomlSource, part: object) -> Equipment:
    """Return what a model has; every key may be left out."""
    if not isinstance(part, dict):
        raise ParametersError(f"{source.at('equipment')}: [equipment] is no section")
    _only(source, "equipment.", part, _keys(Equipment))
    kinds: Mapping[str, Callable[..., object]] = {field.name: type(field.default) for field in fields(Equipment)}
    return Equipment(**{key: _value(source, "equipment", part, key, cast("type", kinds[key])) for key in part})


def _section(source: TomlSource, table: Table, name: str, keys: tuple[str, ...]) -> Table:
    part = table.get(name)
    if not isinstance(part, dict):
        raise ParametersError(f"{source.at(name)}: the section [{name}] is missing")
    _only(source, f"{name}.", part, keys)
    return part


def _only(source: TomlSource, prefix: str, table: Table, keys: tuple[str, ...]) -> None:
    """Refuse a key that nobody reads: it is a misspelt one."""
    for key in table:
        if key not in keys:
            close = get_close_matches(key, keys, n=1)
            raise ParametersError(
                f"{source.at(prefix[:-1], key)}: unknown key {shown_name(prefix + key)}",
                hint=f"did you mean {prefix}{close[0]}?" if close else None,
            )


def _value(source: TomlSource, section: str, table: Table, key: str, kind: type) -> Any:
    """Return one value within its range; an integer serves as a float."""
    name = f"{section}.{key}" if section else key
    if key not in table:
        raise ParametersError(f"{source.at(section)}: {name} is missing")
    value, at = table[key], source.at(section, key)
    if isinstance(value, bool) is not (kind is bool) or not isinstance(value, (int, float) if kind is float else kind):
        raise ParametersError(f"{at}: {name} = {shown(value)} is no {_WORDS[kind]}")
    if kind is bool:
        return value
    if kind is str:
        text = str(value)
        if not text.isprintable() or not text.isascii() or len(text) > LONGEST_TEXT:
            raise ParametersError(
                f"{at}: {name} = {shown(value)} is no line of at most {LONGEST_TEXT} ASCII characters"
            )
        return value
    least, most = RANGES[section][key]
    if not least <= cast("float", value) <= most:
        raise ParametersError(f"{at}: {name} = {shown(value)} is out of range: {least:g} to {most:g}")
    return kind(value)


def _refuse_impossible(source: TomlSource, body: Table) -> None:
    """Refuse a body whose parts do not go together."""
    kinds: Mapping[str, float] = {key: _value(source, "body", body, key, float) for key in _keys(BodyParameters)}
    wheels_kg = 2 * kinds["wheel_mass_kg"] + CASTER_KG
    if kinds["mass_kg"] <= wheels_kg:
        raise ParametersError(
            f"{source.at('body', 'mass_kg')}: body.mass_kg = {kinds['mass_kg']:g}, but wheels and caster have"
            f" {wheels_kg:g} kg"
        )
    if kinds["hull_height_m"] <= kinds["ground_clearance_m"]:
        raise ParametersError(
            f"{source.at('body', 'hull_height_m')}: body.hull_height_m = {kinds['hull_height_m']:g} is not above"
            f" ground_clearance_m = {kinds['ground_clearance_m']:g}"
        )


def _poses(source: TomlSource, rows: object) -> tuple[SonarPose, ...]:
    good = isinstance(rows, list) and all(
        isinstance(row, list)
        and len(row) == 3
        and all(_is_within(item, *limits) for item, limits in zip(row, POSE_RANGES, strict=True))
        for row in rows
    )
    if not good:
        raise ParametersError(
            f"{source.at('sonar', 'poses')}: sonar.poses must be rows of [x mm, y mm, heading deg]",
            hint="within 20 m of the robot's middle, and 360 degrees",
        )
    return tuple(SonarPose(x_mm=x, y_mm=y, heading_deg=h) for x, y, h in cast("list[list[float]]", rows))


def _infrared(source: TomlSource, part: object) -> tuple[tuple[float, float], ...]:
    """Return where the infra-red eyes see; the section may be left out."""
    if not isinstance(part, dict):
        raise ParametersError(f"{source.at('infrared')}: [infrared] is no section")
    _only(source, "infrared.", part, ("points",))
    rows = part.get("points")
    good = (
        isinstance(rows, list)
        and len(rows) <= MOST_EYES
        and all(
            isinstance(row, list)
            and len(row) == 2
            and all(_is_within(item, *limits) for item, limits in zip(row, POSE_RANGES, strict=False))
            for row in rows
        )
    )
    if not good:
        raise ParametersError(
            f"{source.at('infrared', 'points')}: infrared.points must be up to {MOST_EYES} rows of [x mm, y mm]",
            hint="within 20 m of the robot's middle",
        )
    return tuple((x, y) for x, y in cast("list[list[float]]", rows))


def _is_within(item: object, least: float, most: float) -> bool:
    return isinstance(item, (int, float)) and not isinstance(item, bool) and least <= item <= most
