"""Read a world from TOML, every key checked.

Lengths are in metres and headings in degrees, as the keys say.
"""

import math
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any

from p2os.errors import WorldError
from p2os.pioneer.arena import arena
from p2os.pioneer.scenery import Kind, Obstacle, Pose, World

__all__ = ["Kind", "Obstacle", "Pose", "World", "known_worlds", "load_world", "parse_world", "read_obstacle"]

Table = dict[str, Any]
TOP_KEYS = ("name", "description", "extent_m", "start", "box", "cylinder", "wall", "floor", "ramp", "arena")
START_KEYS = ("x_m", "y_m", "heading_deg")
#: Section → its keys with their defaults; None where a value must be given.
SHAPES: Mapping[str, Mapping[str, object]] = {
    "box": {
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "height_m": 0.5,
        "heading_deg": 0.0, "base_m": 0.0, "floor_m": 0.0, "kind": "obstacle",
    },
    "cylinder": {
        "name": None, "x_m": None, "y_m": None, "radius_m": None, "height_m": 0.5, "base_m": 0.0, "floor_m": 0.0,
    },
    "wall": {"name": None, "from_m": None, "to_m": None, "thickness_m": 0.1, "height_m": 1.0, "kind": "wall"},
    "floor": {"name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "top_m": None},
    "ramp": {
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "rise_m": None,
        "heading_deg": 0.0, "base_m": 0.0,
    },
}  # fmt: skip


def known_worlds() -> tuple[str, ...]:
    """Return the names of the worlds that ship with the package."""
    entries = files("p2os.pioneer.worlds").iterdir()
    return tuple(sorted(path.name.removesuffix(".toml") for path in entries if path.name.endswith(".toml")))


def load_world(name_or_path: str | Path, seed: int = 0) -> World:
    """Return a shipped world by its name, or one from a TOML file.

    Args:
        name_or_path: `room`, `corridor`, `ramp`, `arena`, or a path that ends in .toml.
        seed: For a world that is made from one.

    Raises:
        WorldError: The world is unknown, or its file is missing or breaks the schema.
    """
    name = str(name_or_path)
    if name in known_worlds():
        text = files("p2os.pioneer.worlds").joinpath(f"{name}.toml").read_text(encoding="utf-8")
        return parse_world(text, f"{name}.toml", seed)
    path = Path(name)
    if not path.is_file():
        close = get_close_matches(name, known_worlds(), n=1)
        hint = f"did you mean {close[0]}?" if close else f"shipped worlds: {', '.join(known_worlds())}"
        raise WorldError(f"no world {name!r}", hint=hint)
    try:
        return parse_world(path.read_text(encoding="utf-8"), name, seed)
    except OSError as error:
        raise WorldError(f"{name}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise WorldError(f"{name}: not a text file", hint="a world is a TOML file") from error


def parse_world(text: str, source: str, seed: int = 0) -> World:
    """Return the world that a TOML text describes.

    Raises:
        WorldError: The text is no TOML or breaks the schema; the message names the source and the key.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise WorldError(f"{source}: {error}", hint="the file is not TOML") from error
    _only(source, "", table, TOP_KEYS)
    start = _start(source, table.get("start", {}))
    obstacles: list[Obstacle] = []
    for section, keys in SHAPES.items():
        rows = table.get(section, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise WorldError(f"{source}: {section} must be written as [[{section}]]")
        obstacles += [read_obstacle(source, section, row, keys) for row in rows]
    if "arena" in table:
        if not isinstance(table["arena"], dict):
            raise WorldError(f"{source}: arena must be a table [arena]")
        _only(source, "arena.", table["arena"], ())
        obstacles += arena(seed, start)
    extent = _numbers(source, "extent_m", table.get("extent_m"), 4)
    if extent[0] >= extent[2] or extent[1] >= extent[3]:
        raise WorldError(f"{source}: extent_m must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
    return World(
        name=_text(source, "name", table.get("name")),
        source=source,
        description=_text(source, "description", table.get("description", "")),
        start=start,
        extent=(extent[0], extent[1], extent[2], extent[3]),
        obstacles=tuple(obstacles),
    )


def read_obstacle(source: str, section: str, row: Table, keys: Mapping[str, object] | None = None) -> Obstacle:
    """Return the obstacle of one `[[box]]`, `[[cylinder]]`, `[[wall]]`, `[[floor]]` or `[[ramp]]`.

    Raises:
        WorldError: A key is unknown, missing or of the wrong type.
    """
    keys = keys or SHAPES[section]
    _only(source, f"{section}.", row, tuple(keys))
    values: Table = {}
    for key, default in keys.items():
        place = f"{section}.{key}"
        if key not in row and default is None:
            raise WorldError(f"{source}: {place} is missing", hint=f"a [[{section}]] has {', '.join(keys)}")
        value = row.get(key, default)
        if key in {"name", "kind"}:
            values[key] = _text(source, place, value)
        elif key in {"from_m", "to_m"}:
            values[key] = _numbers(source, place, value, 2)
        else:
            values[key] = _number(source, place, value)
    try:
        return _SHAPERS[section](values)
    except WorldError as error:
        raise WorldError(f"{source}: {section}: {error}", hint=error.hint) from error


def _box(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], heading_rad=math.radians(v["heading_deg"]), length_m=v["length_m"],
        width_m=v["width_m"], height_m=v["height_m"], base_m=v["base_m"], floor_m=v["floor_m"],
        kind=_kind(v["kind"]),
    )  # fmt: skip


def _cylinder(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], radius_m=v["radius_m"], height_m=v["height_m"],
        base_m=v["base_m"], floor_m=v["floor_m"],
    )  # fmt: skip


def _wall(v: Table) -> Obstacle:
    (x0, y0), (x1, y1) = v["from_m"], v["to_m"]
    return Obstacle(
        name=v["name"], x_m=(x0 + x1) / 2, y_m=(y0 + y1) / 2, heading_rad=math.atan2(y1 - y0, x1 - x0),
        length_m=math.hypot(x1 - x0, y1 - y0) + v["thickness_m"], width_m=v["thickness_m"], height_m=v["height_m"],
        kind=_kind(v["kind"]),
    )  # fmt: skip


def _floor(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], length_m=v["length_m"], width_m=v["width_m"], height_m=v["top_m"],
        kind=Kind.FLOOR,
    )  # fmt: skip


def _ramp(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], heading_rad=math.radians(v["heading_deg"]), length_m=v["length_m"],
        width_m=v["width_m"], height_m=v["rise_m"], base_m=v["base_m"], kind=Kind.RAMP,
    )  # fmt: skip


_SHAPERS = {"box": _box, "cylinder": _cylinder, "wall": _wall, "floor": _floor, "ramp": _ramp}


def _kind(text: str) -> Kind:
    try:
        return Kind(text)
    except ValueError:
        raise WorldError(f"kind {text!r} is unknown", hint=f"one of {', '.join(k.value for k in Kind)}") from None


def _start(source: str, row: object) -> Pose:
    if not isinstance(row, dict):
        raise WorldError(f"{source}: start must be a table [start]")
    _only(source, "start.", row, START_KEYS)
    x, y, heading = (_number(source, f"start.{key}", row.get(key, 0.0)) for key in START_KEYS)
    return Pose(x, y, math.radians(heading))


def _only(source: str, prefix: str, table: Table, keys: tuple[str, ...]) -> None:
    for key in table:
        if key not in keys:
            close = get_close_matches(key, keys, n=1)
            known = f"known keys: {', '.join(keys)}" if keys else f"[{prefix[:-1]}] has no keys"
            hint = f"did you mean {prefix}{close[0]}?" if close else known
            raise WorldError(f"{source}: unknown key {prefix}{key}", hint=hint)


def _text(source: str, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise WorldError(f"{source}: {key} must be a text")
    return value


def _number(source: str, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        unit = "degrees" if key.endswith("_deg") else "metres"
        raise WorldError(f"{source}: {key} = {value!r} must be a number", hint=f"in {unit}, without a unit")
    return float(value)


def _numbers(source: str, key: str, value: object, count: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise WorldError(f"{source}: {key} must be a list of {count} numbers")
    return tuple(_number(source, key, item) for item in value)
