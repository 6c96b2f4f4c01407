"""Write a world as TOML that `file` reads back as an equal one.

Numbers are written with every digit. A heading is written in degrees; where no
number of degrees is exactly the heading in radians, the next one is taken: then
the heading alone comes back with its last bit changed. That can befall a world
that was made by a program, never one that was read.
"""

import math

from p2os.pioneer.world.file import CALLED, SHAPES, WORLD
from p2os.pioneer.world.model import Mark, Mesh, Obstacle, World
from p2os.toml_file import toml_value

#: How many neighbours of a number of degrees are tried.
TRIES = 4
Fields = dict[str, object]


def write_world(world: World) -> str:
    """Return the text of a world file."""
    x, y, heading, z = world.start.x_m, world.start.y_m, world.start.heading_rad, world.start.z_m
    start: Fields = {"x_m": x, "y_m": y, "heading_deg": degrees(heading)}
    if z:
        start["z_m"] = z
    top: Fields = {"version": WORLD.newest, "name": world.name, "description": world.description}
    parts = [
        _lines({**top, "extent_m": list(world.extent)}),
        f"[start]\n{_lines(start)}",
    ]
    parts += [f"[[{item.section}]]\n{_lines(_fields(item))}" for item in world.obstacles]
    parts += [f"[[mesh]]\n{_lines(_mesh(item))}" for item in world.meshes]
    parts += [f"[[mark]]\n{_lines(_mark(item))}" for item in world.marks]
    return "\n".join(parts)


def degrees(radians: float) -> float:
    """Return the degrees that come back as these radians, to the last bit where there are any."""
    nearest = math.degrees(radians)
    rounded = round(nearest, 9)
    candidates = [rounded, nearest]
    up = down = nearest
    for _ in range(TRIES):
        up, down = math.nextafter(up, math.inf), math.nextafter(down, -math.inf)
        candidates += [up, down]
    return next((value for value in candidates if math.radians(value) == radians), nearest)


def _fields(item: Obstacle) -> Fields:
    """Return the keys of an obstacle that must be given, and those whose value is not the default."""
    values: Fields = {"heading_deg": degrees(item.heading_rad), "kind": item.kind.value}
    if (walk := item.walk) is not None:
        values |= {"path_m": [list(point) for point in walk.points_m], "repeat": walk.repeat.value}
        values |= {"speed_mps": walk.speed_mps, "start_s": walk.start_s}
    for key in SHAPES[item.section]:
        values.setdefault(key.name, getattr(item, CALLED.get(key.name, key.name), key.default))
    return {key.name: values[key.name] for key in SHAPES[item.section] if values[key.name] != key.default}


def _mesh(item: Mesh) -> Fields:
    return {
        "name": item.name,
        "vertices_m": [list(vertex) for vertex in item.vertices],
        "triangles": [list(triangle) for triangle in item.triangles],
    }


def _mark(item: Mark) -> Fields:
    return {"name": item.name, "kind": item.kind, "points_m": [list(point) for point in item.points_m]}


def _lines(fields: Fields) -> str:
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in fields.items())
