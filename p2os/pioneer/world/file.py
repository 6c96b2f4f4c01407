"""The world file: TOML, every key checked, every error with its line.

Lengths are in metres and headings in degrees, as the keys name them. `writer`
writes what this reads.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from p2os.errors import WorldError
from p2os.pioneer.world.makers.arena import arena
from p2os.pioneer.world.model import LONGEST_NAME, RANGES, Kind, Mark, Mesh, Obstacle, Pose, Repeat, Walk, World
from p2os.toml_file import TomlPlaces, read_toml
from simbase.errors import shown, shown_name

Table = dict[str, Any]
TOP_KEYS = (
    "name", "description", "extent_m", "start", "box", "cylinder", "wall", "floor", "ramp", "mesh", "mark",
    "import", "arena",
)  # fmt: skip
START_KEYS = ("x_m", "y_m", "heading_deg", "z_m")
#: What a thing that can be pushed or walks has beside its shape.
MOVING: Mapping[str, object] = {
    "fixed": False, "mass_kg": 0.0, "friction": 0.5,
    "path_m": (), "speed_mps": 0.5, "start_s": 0.0, "repeat": Repeat.BACK_AND_FORTH.value,
}  # fmt: skip
#: Section → its keys with their defaults; None where a value must be given.
SHAPES: Mapping[str, Mapping[str, object]] = {
    "box": {
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "height_m": 0.5,
        "heading_deg": 0.0, "base_m": 0.0, "floor_m": 0.0, "kind": "obstacle", **MOVING,
    },
    "cylinder": {
        "name": None, "x_m": None, "y_m": None, "radius_m": None, "height_m": 0.5, "base_m": 0.0, "floor_m": 0.0,
        **MOVING,
    },
    "wall": {
        "name": None, "from_m": None, "to_m": None, "thickness_m": 0.1, "height_m": 1.0, "kind": "wall",
        "fixed": False,
    },
    "floor": {"name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "top_m": None},
    "ramp": {
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "rise_m": None,
        "heading_deg": 0.0, "base_m": 0.0,
    },
}  # fmt: skip
MARK_KEYS: Mapping[str, object] = {"name": "", "kind": "goal", "points_m": None}
MESH_KEYS: Mapping[str, object] = {"name": None, "vertices_m": None, "triangles": None}
IMPORT_KEYS: Mapping[str, object] = {
    "file": None, "x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "heading_deg": 0.0, "scale": 1.0, "up": "auto",
}  # fmt: skip
#: End of a key → its unit.
UNITS = {"_deg": "degrees", "_m": "metres", "_kg": "kilograms", "_mps": "metres a second", "_s": "seconds"}
_TEXTS = frozenset({"name", "kind", "file", "up", "repeat"})
#: Keys whose value is a list of lists of so many numbers.
_LISTS = {"path_m": 2, "points_m": 2, "vertices_m": 3, "triangles": 3}


@dataclass(frozen=True, slots=True)
class Section:
    """One table of the file, for its checks: where it stands and what it holds."""

    source: str
    places: TomlPlaces
    name: str
    number: int
    row: Table

    def at(self, key: str = "") -> str:
        """Return `file:line` of a key of this table."""
        return f"{self.source}:{self.places.line(self.name, self.number, key)}"

    def label(self, key: str) -> str:
        """Return the key with its table before it."""
        return f"{self.name}.{key}" if self.name else key


def parse_world(text: str, source: str, seed: int = 0, folder: Path | None = None) -> World:
    """Return the world that a TOML text describes.

    Args:
        text: The file's text.
        source: What to call it in messages.
        seed: For an `[arena]`.
        folder: Where files named by `[[import]]` are looked for; None is the present folder.

    Raises:
        WorldError: The text is no TOML or breaks the schema; the message names the source, the line and the key.
        MissingDependencyError: An imported file needs a reader that is not installed.
    """
    table, places = read_toml(text, source, "a world", WorldError)
    top = Section(source, places, "", 0, table)
    _only(top, TOP_KEYS)
    begins = Section(source, places, "start", 0, _table(top, "start"))
    start = _start(begins)
    obstacles: list[Obstacle] = []
    named: dict[str, str] = {}
    for name, keys in SHAPES.items():
        for section in _sections(top, name):
            obstacles.append(_obstacle(section, keys))
            if obstacles[-1].name in named:
                at, first = section.at("name"), named[obstacles[-1].name]
                raise WorldError(
                    f"{at}: two obstacles are named {obstacles[-1].name!r}", hint=f"the first is at {first}"
                )
            named[obstacles[-1].name] = section.at("name")
    meshes = [_mesh(section) for section in _sections(top, "mesh")]
    marks = [_mark(section) for section in _sections(top, "mark")]
    if "arena" in table:
        _only(Section(source, places, "arena", 0, _table(top, "arena")), ())
        obstacles += arena(seed, start)
    skipped: list[str] = []
    for section in _sections(top, "import"):
        brought = _imported(section, folder or Path())
        obstacles += brought.obstacles
        meshes += brought.meshes
        marks += brought.marks
        skipped += brought.skipped
    extent = _numbers(top, "extent_m", table.get("extent_m"), 4)
    if extent[0] >= extent[2] or extent[1] >= extent[3]:
        raise WorldError(f"{top.at('extent_m')}: extent_m must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
    return World(
        name=_text(top, "name", table.get("name")),
        source=source,
        description=_text(top, "description", table.get("description", "")),
        start=start,
        extent=(extent[0], extent[1], extent[2], extent[3]),
        obstacles=tuple(obstacles),
        meshes=tuple(meshes),
        marks=tuple(marks),
        skipped=tuple(skipped),
        start_at=f"{begins.at()}: [start]",
    )


def _sections(top: Section, name: str) -> list[Section]:
    rows = top.row.get(name, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise WorldError(f"{top.source}:{top.places.line(name)}: {name} must be written as [[{name}]]")
    return [Section(top.source, top.places, name, number, row) for number, row in enumerate(rows)]


def _table(top: Section, name: str) -> Table:
    row = top.row.get(name, {})
    if not isinstance(row, dict):
        raise WorldError(f"{top.source}:{top.places.line(name)}: {name} must be a table [{name}]")
    return row


def _obstacle(section: Section, keys: Mapping[str, object]) -> Obstacle:
    values = _values(section, keys)
    try:
        return _SHAPERS[section.name](values)
    except WorldError as error:
        raise WorldError(f"{section.at()}: {section.name}: {error}", hint=error.hint) from error


def _values(section: Section, keys: Mapping[str, object]) -> Table:
    """Return the row with every default filled in and every type checked."""
    _only(section, tuple(keys))
    values: Table = {}
    for key, default in keys.items():
        if key not in section.row and default is None:
            raise WorldError(
                f"{section.at()}: {section.label(key)} is missing",
                hint=f"a [[{section.name}]] has {', '.join(keys)}",
            )
        value = section.row.get(key, default)
        if key in _TEXTS:
            values[key] = _text(section, key, value)
        elif key == "fixed":
            values[key] = _truth(section, key, value)
        elif key in {"from_m", "to_m"}:
            values[key] = _numbers(section, key, value, 2)
        elif key in _LISTS:
            values[key] = _lists(section, key, value, _LISTS[key])
        else:
            values[key] = _number(section, key, value)
    return values


def _box(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], heading_rad=math.radians(v["heading_deg"]), length_m=v["length_m"],
        width_m=v["width_m"], height_m=v["height_m"], base_m=v["base_m"], floor_m=v["floor_m"],
        kind=_kind(v["kind"]), fixed=v["fixed"], mass_kg=v["mass_kg"], friction=v["friction"], walk=_walk(v),
    )  # fmt: skip


def _cylinder(v: Table) -> Obstacle:
    return Obstacle(
        name=v["name"], x_m=v["x_m"], y_m=v["y_m"], radius_m=v["radius_m"], height_m=v["height_m"],
        base_m=v["base_m"], floor_m=v["floor_m"],
        fixed=v["fixed"], mass_kg=v["mass_kg"], friction=v["friction"], walk=_walk(v),
    )  # fmt: skip


def _wall(v: Table) -> Obstacle:
    (x0, y0), (x1, y1) = v["from_m"], v["to_m"]
    return Obstacle(
        name=v["name"], x_m=(x0 + x1) / 2, y_m=(y0 + y1) / 2, heading_rad=math.atan2(y1 - y0, x1 - x0),
        length_m=math.hypot(x1 - x0, y1 - y0) + v["thickness_m"], width_m=v["thickness_m"], height_m=v["height_m"],
        kind=_kind(v["kind"]), fixed=v["fixed"],
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


def _walk(v: Table) -> Walk | None:
    if not v["path_m"]:
        return None
    if v["repeat"] not in {member.value for member in Repeat}:
        raise WorldError(
            f"repeat {shown(v['repeat'])} is unknown", hint=f"one of {', '.join(member.value for member in Repeat)}"
        )
    return Walk(points_m=v["path_m"], speed_mps=v["speed_mps"], start_s=v["start_s"], repeat=Repeat(v["repeat"]))


def _mesh(section: Section) -> Mesh:
    values = _values(section, MESH_KEYS)
    triangles = tuple((int(a), int(b), int(c)) for a, b, c in values["triangles"])
    try:
        return Mesh(name=values["name"], vertices=values["vertices_m"], triangles=triangles)
    except WorldError as error:
        raise WorldError(f"{section.at()}: {error}") from error


def _mark(section: Section) -> Mark:
    values = _values(section, MARK_KEYS)
    try:
        return Mark(name=values["name"], kind=values["kind"], points_m=values["points_m"])
    except WorldError as error:
        raise WorldError(f"{section.at()}: mark: {error}", hint=error.hint) from error


def _imported(section: Section, folder: Path) -> World:
    """Return what another file holds, moved to where this one wants it."""
    from p2os.pioneer.world.formats import Placing, read_placed

    v = _values(section, IMPORT_KEYS)
    try:
        placing = Placing(
            x_m=v["x_m"], y_m=v["y_m"], z_m=v["z_m"], heading_rad=math.radians(v["heading_deg"]),
            scale=v["scale"], up=v["up"],
        )  # fmt: skip
        world = read_placed(folder / v["file"], placing)
    except WorldError as error:
        raise WorldError(f"{section.at('file')}: import: {error}", hint=error.hint) from error
    label = f"{Path(v['file']).stem} {section.number + 1}"
    return replace(
        world,
        obstacles=tuple(replace(item, name=f"{label}: {item.name}") for item in world.obstacles),
        meshes=tuple(replace(item, name=f"{label}: {item.name}") for item in world.meshes),
    )


def _kind(text: str) -> Kind:
    try:
        return Kind(text)
    except ValueError:
        raise WorldError(f"kind {shown(text)} is unknown", hint=f"one of {', '.join(k.value for k in Kind)}") from None


def _start(section: Section) -> Pose:
    _only(section, START_KEYS)
    x, y, heading, z = (_number(section, key, section.row.get(key, 0.0)) for key in START_KEYS)
    return Pose(x, y, math.radians(heading), z)


def _only(section: Section, keys: tuple[str, ...]) -> None:
    for key in section.row:
        if key not in keys:
            close = get_close_matches(key, keys, n=1)
            known = f"known keys: {', '.join(keys)}" if keys else f"[{section.name}] has no keys"
            hint = f"did you mean {section.label(close[0])}?" if close else known
            raise WorldError(f"{section.at(key)}: unknown key {shown_name(section.label(key))}", hint=hint)


def _text(section: Section, key: str, value: object) -> str:
    if not isinstance(value, str):
        raise WorldError(f"{section.at(key)}: {section.label(key)} must be a text")
    if key == "name" and section.name and (not value.isprintable() or len(value) > LONGEST_NAME):
        raise WorldError(
            f"{section.at(key)}: {section.label(key)} = {shown(value)} is no line of at most {LONGEST_NAME} characters"
        )
    return value


def _truth(section: Section, key: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise WorldError(f"{section.at(key)}: {section.label(key)} must be true or false")
    return value


def _number(section: Section, key: str, value: object) -> float:
    at, label = section.at(key), section.label(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:  # noqa: PLR0124 - not a number
        unit = next((unit for end, unit in UNITS.items() if key.endswith(end)), "")
        raise WorldError(
            f"{at}: {label} = {shown(value)} must be a number", hint=f"in {unit}, without a unit" if unit else None
        )
    least, most = RANGES[key]
    if not least <= value <= most:
        raise WorldError(f"{at}: {label} = {shown(value)} is out of range: {least:g} to {most:g}")
    if key == "triangles" and not isinstance(value, int):
        raise WorldError(
            f"{at}: {label} = {shown(value)} must be a whole number", hint="the number of a vertex, from 0"
        )
    return value if key == "triangles" else float(value)


def _numbers(section: Section, key: str, value: object, count: int) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != count:
        raise WorldError(f"{section.at(key)}: {section.label(key)} must be a list of {count} numbers")
    return tuple(_number(section, key, item) for item in value)


def _lists(section: Section, key: str, value: object, count: int) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, (list, tuple)):
        raise WorldError(f"{section.at(key)}: {section.label(key)} must be a list of lists of {count} numbers")
    return tuple(_numbers(section, key, item, count) for item in value)
