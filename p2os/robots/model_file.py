"""A robot model's TOML file: its sections, its keys, and what is wrong with a file in words.

`based_on` takes another model's numbers and overrides some.
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

from p2os.robots.model import BodyParameters, Equipment, MotionDefaults, ParametersError, RobotParameters, SonarPose

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
#: Keys that may be 0 or false.
MAY_BE_ZERO = frozenset({"front_bumpers", "rear_bumpers", "max_lateral_mm_s"})


#: chosen: beyond it a number is a mistake, or no number; the largest in use are nanometres of a few metres.
LARGEST = 1e12


def known_robots() -> tuple[str, ...]:
    """Return the subclasses that ship with the package."""
    return tuple(sorted(path.name.removesuffix(".toml") for path in files("p2os.robots").iterdir()
                        if path.name.endswith(".toml")))  # fmt: skip


def shipped_table(name: str) -> Table:
    """Return the table of a shipped model, with what it is based on filled in."""
    text = files("p2os.robots").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return table_of(f"{name}.toml", text)


def file_table(path: Path) -> Table:
    """Return the table of a TOML file, with what it is based on filled in.

    Raises:
        ParametersError: The file is not TOML, or what it is based on is no shipped model.
    """
    return table_of(str(path), text_of(path))


def text_of(path: Path) -> str:
    """Return what a user's file holds; bytes that are no UTF-8 are shown as such.

    Raises:
        ParametersError: The file cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise ParametersError(f"cannot read {path}: {(error.strerror or str(error)).lower()}") from error


def table_of(source: str, text: str) -> Table:
    """Return the table of a TOML text, with what it is based on filled in.

    Args:
        source: Its name, for messages.
        text: TOML.

    Raises:
        ParametersError: It is not TOML, or what it is based on is no shipped model.
    """
    try:
        table = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ParametersError(f"{source}: {error}", hint="the file is not TOML") from error
    base = table.get("based_on")
    if base is None:
        return table
    if base not in known_robots() or f"{base}.toml" == source:
        raise ParametersError(f"{source}: based_on = {base!r} is no shipped model")
    return merged(shipped_table(base), table)


def merged(base: Table, table: Table) -> Table:
    """Return a model's table with the keys of another over it, section by section."""
    result = dict(base)
    for key, value in table.items():
        old = result.get(key)
        result[key] = {**old, **value} if isinstance(value, dict) and isinstance(old, dict) else value
    return result


def build_parameters(source: str, table: Table) -> RobotParameters:
    """Return the parameters that a table says.

    Raises:
        ParametersError: A key is missing, unknown, of another type, or out of range.
    """
    sections = {*FLAT_SECTIONS, "equipment", "motion", "sonar", "body"}
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
    fitted, poses = _value(source, "sonar", sonar, "fitted", int, least=0), _poses(source, sonar.get("poses"))
    if fitted > len(poses):
        raise ParametersError(f"{source}: sonar.fitted = {fitted}, but there are only {len(poses)} poses")
    numbers = {f"sonar_{key}": _value(source, "sonar", sonar, key, float) for key in SONAR_KEYS[1:-1]}
    return RobotParameters(
        **values,
        **numbers,
        equipment=_equipment(source, table.get("equipment", {})),
        motion=MotionDefaults(**{key: _value(source, "motion", motion, key, int) for key in _keys(MotionDefaults)}),
        body=BodyParameters(**{key: _value(source, "body", body, key, float) for key in _keys(BodyParameters)}),
        sonar_fitted=fitted,
        sonar=poses,
    )


def _keys(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _equipment(source: str, part: object) -> Equipment:
    """Return what a model has; every key may be left out."""
    if not isinstance(part, dict):
        raise ParametersError(f"{source}: [equipment] is no section")
    _only(source, "equipment.", part, _keys(Equipment))
    kinds: Mapping[str, Callable[..., object]] = {field.name: type(field.default) for field in fields(Equipment)}
    return Equipment(
        **{
            key: _value(source, "equipment", part, key, cast("type", kinds[key]), 0 if key in MAY_BE_ZERO else None)
            for key in part
        }
    )


def _section(source: str, table: Table, name: str, keys: tuple[str, ...]) -> Table:
    part = table.get(name)
    if not isinstance(part, dict):
        raise ParametersError(f"{source}: the section [{name}] is missing")
    _only(source, f"{name}.", part, keys)
    return part


def _only(source: str, prefix: str, table: Table, keys: tuple[str, ...]) -> None:
    """Refuse a key that nobody reads: it is a misspelt one."""
    for key in table:
        if key not in keys:
            close = get_close_matches(key, keys, n=1)
            raise ParametersError(
                f"{source}: unknown key {prefix}{key}", hint=f"did you mean {prefix}{close[0]}?" if close else None
            )


def _value(source: str, section: str, table: Table, key: str, kind: type, least: float | None = None) -> Any:
    """Return one value; numbers are positive but for positions, and an integer serves as a float."""
    name = f"{section}.{key}" if section else key
    if key not in table:
        raise ParametersError(f"{source}: {name} is missing")
    value = table[key]
    if isinstance(value, bool) is not (kind is bool) or not isinstance(value, (int, float) if kind is float else kind):
        raise ParametersError(f"{source}: {name} = {value!r} is no {kind.__name__}")
    if kind in {str, bool}:
        return value
    number = cast("float", value)
    if not abs(number) <= LARGEST:
        raise ParametersError(f"{source}: {name} = {value!r} is out of range")
    if key != "caster_x_m" and not (number > 0 if least is None else number >= least):
        raise ParametersError(f"{source}: {name} = {value!r} must be positive")
    return kind(number)


def _poses(source: str, rows: object) -> tuple[SonarPose, ...]:
    good = isinstance(rows, list) and all(
        isinstance(row, list)
        and len(row) == 3
        and all(isinstance(item, (int, float)) and abs(item) <= LARGEST for item in row)
        for row in rows
    )
    if not good:
        raise ParametersError(f"{source}: sonar.poses must be rows of [x mm, y mm, heading deg]")
    return tuple(SonarPose(x_mm=x, y_mm=y, heading_deg=h) for x, y, h in cast("list[list[float]]", rows))
