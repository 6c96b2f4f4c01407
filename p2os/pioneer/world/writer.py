"""Write a world as TOML that `file` reads back as an equal one.

Numbers are written with every digit. A heading is written in degrees; where no
number of degrees is exactly the heading in radians, the next one is taken: then
the heading alone comes back with its last bit changed. That can befall a world
that was made by a program, never one that was read.
"""

import math

from p2os.pioneer.world.model import Kind, Mark, Mesh, Obstacle, World
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
    parts = [
        _lines({"name": world.name, "description": world.description, "extent_m": list(world.extent)}),
        f"[start]\n{_lines(start)}",
    ]
    parts += [f"[[{item.section}]]\n{_lines(_FIELDS[item.section](item))}" for item in world.obstacles]
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


def _floor(item: Obstacle) -> Fields:
    return {
        "name": item.name, "x_m": item.x_m, "y_m": item.y_m, "length_m": item.length_m, "width_m": item.width_m,
        "top_m": item.height_m,
    }  # fmt: skip


def _ramp(item: Obstacle) -> Fields:
    return {
        "name": item.name, "x_m": item.x_m, "y_m": item.y_m, "length_m": item.length_m, "width_m": item.width_m,
        "rise_m": item.height_m, "heading_deg": degrees(item.heading_rad), "base_m": item.base_m,
    }  # fmt: skip


def _box(item: Obstacle) -> Fields:
    fields: Fields = {
        "name": item.name, "x_m": item.x_m, "y_m": item.y_m, "length_m": item.length_m, "width_m": item.width_m,
        "height_m": item.height_m,
    }  # fmt: skip
    if item.heading_rad:
        fields["heading_deg"] = degrees(item.heading_rad)
    if item.kind is not Kind.OBSTACLE:
        fields["kind"] = item.kind.value
    return fields | _rest(item)


def _cylinder(item: Obstacle) -> Fields:
    return {
        "name": item.name, "x_m": item.x_m, "y_m": item.y_m, "radius_m": item.radius_m, "height_m": item.height_m,
    } | _rest(item)  # fmt: skip


_FIELDS = {"box": _box, "cylinder": _cylinder, "floor": _floor, "ramp": _ramp}


def _rest(item: Obstacle) -> Fields:
    """Return what boxes and cylinders share, where it is not the default."""
    fields: Fields = {}
    if item.base_m:
        fields["base_m"] = item.base_m
    if item.floor_m:
        fields["floor_m"] = item.floor_m
    if item.fixed:
        fields["fixed"] = True
    if item.mass_kg:
        fields["mass_kg"] = item.mass_kg
    if item.friction != 0.5:
        fields["friction"] = item.friction
    if item.walk is not None:
        fields["path_m"] = [list(point) for point in item.walk.points_m]
        fields["speed_mps"] = item.walk.speed_mps
        fields["start_s"] = item.walk.start_s
        fields["repeat"] = item.walk.repeat.value
    return fields


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
