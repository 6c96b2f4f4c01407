"""The world file: TOML, every key checked, every error with its line.

Lengths are in metres and headings in degrees, as the keys name them. `writer`
writes what this reads.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any

from p2os.errors import WorldError
from p2os.pioneer.world.makers.arena import arena
from p2os.pioneer.world.model import LONGEST_NAME, RANGES, Mark, Mesh, Obstacle, ObstacleKind, Pose, Repeat, Walk, World
from p2os.pioneer.world.placing import Placing
from p2os.pioneer.world.readers import read_placed
from p2os.toml_file import TomlSource, read_toml
from p2os.toml_schema import Key, Table, TablePlace, check_table, filled, placed, within
from p2os.toml_schema import Kind as KeyKind
from simbase.files import VersionedFormat

#: As `writer` writes it.
WORLD = VersionedFormat("a world")
#: A table with a value for every key.
Values = dict[str, Any]
#: What stands in a key that is no number, and of how many numbers a list is.
_KINDS: Mapping[str, tuple[KeyKind, int]] = {
    "name": ("line", 0), "file": ("text", 0), "kind": ("text", 0), "up": ("text", 0), "repeat": ("text", 0),
    "fixed": ("flag", 0), "extent_m": ("numbers", 4), "from_m": ("numbers", 2), "to_m": ("numbers", 2),
    "path_m": ("points", 2), "points_m": ("points", 2), "vertices_m": ("points", 3), "triangles": ("points", 3),
}  # fmt: skip


def in_range(name: str, *, required: bool = False, default: object = None, doc: str = "") -> Key:
    """Return the key of a world file that has this name; a default of an enumeration stands for its choices."""
    choices = tuple(one.value for one in type(default)) if isinstance(default, Enum) else ()
    default = default.value if isinstance(default, Enum) else default
    kind, count = _KINDS.get(name, ("number", 0))
    least, most = RANGES.get(name, (None, LONGEST_NAME if kind == "line" else None))
    return Key(
        name=name, kind=kind, count=count, required=required, default=default, choices=choices, least=least, most=most,
        doc=doc,
    )  # fmt: skip


def _keys(defaults: Mapping[str, object]) -> tuple[Key, ...]:
    """Return keys by their names and defaults; None where a value must be given."""
    return tuple(in_range(name, required=default is None, default=default) for name, default in defaults.items())


START_KEYS = _keys(dict.fromkeys(("x_m", "y_m", "heading_deg", "z_m"), 0.0))
#: What a thing that walks has beside its shape, and what one that walks or can be pushed has.
PATH_KEYS = {"path_m": (), "speed_mps": 0.5, "start_s": 0.0, "repeat": Repeat.BACK_AND_FORTH}
MOVING: Mapping[str, object] = {"fixed": False, "mass_kg": 0.0, "friction": 0.5, **PATH_KEYS}
#: Keys that an `Obstacle` calls otherwise, and the kind that a section gives.
CALLED = {"heading_deg": "heading_rad", "top_m": "height_m", "rise_m": "height_m"}
_KIND_OF = {"floor": ObstacleKind.FLOOR, "ramp": ObstacleKind.RAMP}
#: Section → its keys with their defaults; None where a value must be given.
SHAPES: Mapping[str, tuple[Key, ...]] = {
    "box": _keys({
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "height_m": 0.5,
        "heading_deg": 0.0, "base_m": 0.0, "floor_m": 0.0, "kind": ObstacleKind.OBSTACLE, **MOVING,
    }),
    "cylinder": _keys({
        "name": None, "x_m": None, "y_m": None, "radius_m": None, "height_m": 0.5, "base_m": 0.0, "floor_m": 0.0,
        **MOVING,
    }),
    "wall": _keys({
        "name": None, "from_m": None, "to_m": None, "thickness_m": 0.1, "height_m": 1.0, "kind": ObstacleKind.WALL,
        "fixed": False,
    }),
    "floor": _keys({"name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "top_m": None}),
    "ramp": _keys({
        "name": None, "x_m": None, "y_m": None, "length_m": None, "width_m": None, "rise_m": None,
        "heading_deg": 0.0, "base_m": 0.0,
    }),
}  # fmt: skip
MARK_KEYS = _keys({"name": "", "kind": "goal", "points_m": None})
MESH_KEYS = _keys({"name": None, "vertices_m": None, "triangles": None})
IMPORT_KEYS = _keys({
    "file": None, "x_m": 0.0, "y_m": 0.0, "z_m": 0.0, "heading_deg": 0.0, "scale": 1.0, "up": "auto",
})  # fmt: skip
TOP_KEYS = (
    Key(name="version", kind="whole", least=1, most=WORLD.newest, default=WORLD.newest, doc="of these keys"),
    Key(name="name", kind="text", required=True), Key(name="description", kind="text", default=""),
    in_range("extent_m", required=True), Key(name="start", kind="table", default={}), Key(name="arena", kind="table"),
    *(Key(name=name, kind="tables", default=[]) for name in (*SHAPES, "mesh", "mark", "import")),
)  # fmt: skip


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
    table, places = read_toml(text, source, WORLD, WorldError)
    where = TablePlace(TomlSource(source, places), error=WorldError)
    top = filled(table, TOP_KEYS, where)
    begins = within(where, "start")
    at_start = _values(top["start"], START_KEYS, begins)
    start = Pose(at_start["x_m"], at_start["y_m"], math.radians(at_start["heading_deg"]), at_start["z_m"])
    obstacles: list[Obstacle] = []
    named: dict[str, str] = {}
    for name, keys in SHAPES.items():
        for at, row in _rows(top[name], name, keys, where):
            with placed(at):
                obstacles.append(_obstacle(name, row))
            if obstacles[-1].name in named:
                first = named[obstacles[-1].name]
                raise WorldError(
                    f"{at.at('name')}: two obstacles are named {obstacles[-1].name!r}", hint=f"the first is at {first}"
                )
            named[obstacles[-1].name] = at.source.at(name, "name", at.number)
    meshes = [_mesh(row, at) for at, row in _rows(top["mesh"], "mesh", MESH_KEYS, where)]
    marks = [_mark(row, at) for at, row in _rows(top["mark"], "mark", MARK_KEYS, where)]
    if top["arena"] is not None:
        check_table(top["arena"], (), within(where, "arena"))
        obstacles += arena(seed, start)
    skipped: list[str] = []
    for at, row in _rows(top["import"], "import", IMPORT_KEYS, where):
        brought = _imported(row, at, folder or Path())
        obstacles += brought.obstacles
        meshes += brought.meshes
        marks += brought.marks
        skipped += brought.skipped
    x0, y0, x1, y1 = map(float, top["extent_m"])
    if x0 >= x1 or y0 >= y1:
        raise WorldError(f"{where.at('extent_m')}: extent_m must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
    return World(
        name=top["name"], source=source, description=top["description"], start=start, extent=(x0, y0, x1, y1),
        obstacles=tuple(obstacles), meshes=tuple(meshes), marks=tuple(marks), skipped=tuple(skipped),
        start_at=str(begins),
    )  # fmt: skip


def _rows(
    rows: list[Table], name: str, keys: tuple[Key, ...], where: TablePlace
) -> Iterator[tuple[TablePlace, Values]]:
    """Yield the tables `[[name]]` with their places, checked and with every default filled in."""
    for number, row in enumerate(rows):
        at = within(where, name, number)
        yield at, _values(row, keys, at)


def _values(row: Table, keys: tuple[Key, ...], where: TablePlace) -> Values:
    """Check a table, and return the value or the default of every key, whole numbers as floats too."""
    found = filled(row, keys, where)
    return {name: float(value) if type(value) is int else value for name, value in found.items()}


def _obstacle(section: str, v: Values) -> Obstacle:
    if section == "wall":
        return _wall(v)
    fields = {CALLED.get(key, key): value for key, value in v.items() if key not in PATH_KEYS}
    fields["heading_rad"] = math.radians(v.get("heading_deg", 0.0))
    fields["kind"] = ObstacleKind(v.get("kind", _KIND_OF.get(section, ObstacleKind.OBSTACLE)))
    return Obstacle(**fields, walk=_walk(v))


def _wall(v: Values) -> Obstacle:
    (x0, y0), (x1, y1) = v["from_m"], v["to_m"]
    return Obstacle(
        name=v["name"], x_m=(x0 + x1) / 2, y_m=(y0 + y1) / 2, heading_rad=math.atan2(y1 - y0, x1 - x0),
        length_m=math.hypot(x1 - x0, y1 - y0) + v["thickness_m"], width_m=v["thickness_m"], height_m=v["height_m"],
        kind=ObstacleKind(v["kind"]), fixed=v["fixed"],
    )  # fmt: skip


def _walk(v: Values) -> Walk | None:
    if not v.get("path_m"):
        return None
    return Walk(
        points_m=_points(v["path_m"]), speed_mps=v["speed_mps"], start_s=v["start_s"], repeat=Repeat(v["repeat"])
    )


def _points(rows: Any) -> Any:
    return tuple(tuple(map(float, row)) for row in rows)


def _mesh(v: Values, at: TablePlace) -> Mesh:
    odd = [corner for row in v["triangles"] for corner in row if not isinstance(corner, int)]
    if odd:
        raise WorldError(f"{at.at('triangles')}: triangles: {odd[0]} is no whole number", hint="of a vertex, from 0")
    with placed(at):
        return Mesh(name=v["name"], vertices=_points(v["vertices_m"]), triangles=tuple(map(tuple, v["triangles"])))


def _mark(v: Values, at: TablePlace) -> Mark:
    with placed(at):
        return Mark(name=v["name"], kind=v["kind"], points_m=_points(v["points_m"]))


def _imported(v: Values, at: TablePlace, folder: Path) -> World:
    with placed(at, "file"):
        placing = Placing(
            x_m=v["x_m"], y_m=v["y_m"], z_m=v["z_m"], heading_rad=math.radians(v["heading_deg"]), scale=v["scale"],
            up=v["up"],
        )  # fmt: skip
        world = read_placed(folder / v["file"], placing)
    label = f"{Path(v['file']).stem} {at.number + 1}"
    return replace(
        world,
        obstacles=tuple(replace(item, name=f"{label}: {item.name}") for item in world.obstacles),
        meshes=tuple(replace(item, name=f"{label}: {item.name}") for item in world.meshes),
    )
