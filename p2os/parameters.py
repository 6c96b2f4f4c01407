"""What a robot model is: conversions of the wire, limits, sonar ring and body.

One TOML file a model in `p2os/robots/`, each number with its source; a user's
own file is loaded by its path. `based_on` takes another model's numbers and
overrides some.
"""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

from p2os.errors import FileError

#: A TOML table.
Table = dict[str, Any]


class ParametersError(FileError):
    """A robot file is missing or breaks its schema."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SonarPose:
    """Where a sonar sits and looks, robot frame (x forward, y left, + counter-clockwise)."""

    x_mm: float
    y_mm: float
    heading_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyParameters:
    """The robot as a physical thing; metres from the middle of the axle."""

    hull_front_m: float
    hull_rear_m: float
    hull_width_m: float
    hull_height_m: float
    ground_clearance_m: float
    mass_kg: float
    wheel_diameter_m: float
    wheel_width_m: float
    wheel_mass_kg: float
    caster_radius_m: float
    caster_x_m: float
    motor_torque_nm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDefaults:
    """Limits with which the robot starts, until a client sets others."""

    max_velocity_mm_s: int
    max_rotation_deg_s: int
    accel_mm_s2: int
    decel_mm_s2: int
    rot_accel_deg_s2: int
    rot_decel_deg_s2: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotParameters:
    """All that is known of a robot model."""

    subclass: str
    robot_class: str
    title: str
    distance_nm_per_count: int
    angle_counts_per_turn: int
    velocity_um_s_per_count: int
    range_um_per_count: int
    vel2_divisor_mm_s: int
    #: Effective distance of the wheels for controller, adapter and body alike.
    track_mm: int
    max_velocity_mm_s: int
    max_rotation_deg_s: int
    radius_mm: int
    width_mm: int
    length_mm: int
    front_mm: int
    rear_mm: int
    motion: MotionDefaults
    #: How many of the poses have a sonar, from number 0.
    sonar_fitted: int
    sonar_range_m: float
    sonar_min_range_m: float
    #: Total opening angle of a sonar's cone.
    sonar_cone_deg: float
    sonar_height_m: float
    sonar: tuple[SonarPose, ...]
    body: BodyParameters

    @property
    def distance_conv_mm(self) -> float:
        """DistConvFactor, mm a count."""
        return self.distance_nm_per_count / 1e6

    @property
    def angle_conv_rad(self) -> float:
        """AngleConvFactor, radians a count."""
        return 2 * math.pi / self.angle_counts_per_turn

    @property
    def velocity_conv(self) -> float:
        """VelConvFactor, mm/s a count."""
        return self.velocity_um_s_per_count / 1e3

    @property
    def range_conv_mm(self) -> float:
        """RangeConvFactor, mm a count."""
        return self.range_um_per_count / 1e3

    @property
    def vel2_divisor(self) -> int:
        """Vel2Divisor, mm/s a step."""
        return self.vel2_divisor_mm_s


#: Section of a file → the keys that go into `RobotParameters` itself.
FLAT_SECTIONS: Mapping[str, tuple[str, ...]] = {
    "conversion": (
        "distance_nm_per_count", "angle_counts_per_turn", "velocity_um_s_per_count", "range_um_per_count",
        "vel2_divisor_mm_s", "track_mm",
    ),
    "limits": ("max_velocity_mm_s", "max_rotation_deg_s"),
    "footprint": ("radius_mm", "width_mm", "length_mm", "front_mm", "rear_mm"),
}  # fmt: skip
SONAR_KEYS = ("fitted", "range_m", "min_range_m", "cone_deg", "height_m", "poses")
TOP_KEYS = ("based_on", "subclass", "robot_class", "title")


def known_robots() -> tuple[str, ...]:
    """Return the subclasses that ship with the package."""
    return tuple(sorted(path.name.removesuffix(".toml") for path in files("p2os.robots").iterdir()
                        if path.name.endswith(".toml")))  # fmt: skip


def load_parameters(name_or_path: str | Path) -> RobotParameters:
    """Return a model's parameters, by its subclass or from a TOML file.

    Raises:
        ParametersError: The model is unknown, or the file is missing or breaks the schema.
    """
    source, table = _read(str(name_or_path))
    return _build(source, table)


def _read(name: str) -> tuple[str, Table]:
    """Return where a model stands and its table, with what it is based on filled in."""
    if name.lower() in known_robots():
        source = f"{name.lower()}.toml"
        text = files("p2os.robots").joinpath(source).read_text(encoding="utf-8")
    else:
        path = Path(name)
        if path.suffix != ".toml" or not path.is_file():
            close = get_close_matches(name.lower(), known_robots(), n=1)
            hint = f"did you mean {close[0]}?" if close else f"known models: {', '.join(known_robots())}"
            raise ParametersError(f"no robot model {name!r}", hint=hint)
        source, text = str(path), path.read_text(encoding="utf-8", errors="replace")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ParametersError(f"{source}: {error}", hint="the file is not TOML") from error
    base = table.get("based_on")
    if base is None:
        return source, table
    if base not in known_robots() or f"{base}.toml" == source:
        raise ParametersError(f"{source}: based_on = {base!r} is no shipped model")
    merged = _read(base)[1]
    for key, value in table.items():
        merged[key] = {**merged[key], **value} if isinstance(value, dict) and key in merged else value
    return source, merged


def _build(source: str, table: Table) -> RobotParameters:
    sections = {*FLAT_SECTIONS, "motion", "sonar", "body"}
    _only(source, "", table, (*TOP_KEYS, *sections))
    values: Table = {key: _value(source, "", table, key, str) for key in TOP_KEYS[1:]}
    for section, keys in FLAT_SECTIONS.items():
        part = _section(source, table, section, keys)
        values |= {key: _value(source, section, part, key, int) for key in keys}
    motion_keys = tuple(field.name for field in fields(MotionDefaults))
    motion = _section(source, table, "motion", motion_keys)
    body_keys = tuple(field.name for field in fields(BodyParameters))
    body = _section(source, table, "body", body_keys)
    sonar = _section(source, table, "sonar", SONAR_KEYS)
    numbers = {f"sonar_{key}": _value(source, "sonar", sonar, key, float) for key in SONAR_KEYS[1:-1]}
    return RobotParameters(
        **values,
        **numbers,
        motion=MotionDefaults(**{key: _value(source, "motion", motion, key, int) for key in motion_keys}),
        body=BodyParameters(**{key: _value(source, "body", body, key, float) for key in body_keys}),
        sonar_fitted=_value(source, "sonar", sonar, "fitted", int, least=0),
        sonar=_poses(source, sonar.get("poses")),
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
    if isinstance(value, bool) or not isinstance(value, (int, float) if kind is float else kind):
        raise ParametersError(f"{source}: {name} = {value!r} is no {kind.__name__}")
    if kind is str:
        return value
    number = cast("float", value)
    if key != "caster_x_m" and not (number > 0 if least is None else number >= least):
        raise ParametersError(f"{source}: {name} = {value!r} must be positive")
    return kind(number)


def _poses(source: str, rows: object) -> tuple[SonarPose, ...]:
    good = isinstance(rows, list) and all(
        isinstance(row, list) and len(row) == 3 and all(isinstance(item, (int, float)) for item in row) for row in rows
    )
    if not good:
        raise ParametersError(f"{source}: sonar.poses must be rows of [x mm, y mm, heading deg]")
    return tuple(SonarPose(x_mm=x, y_mm=y, heading_deg=h) for x, y, h in cast("list[list[float]]", rows))
