"""A world as shapes to draw: the one list that the pictures and the terminal share."""

import math
from dataclasses import dataclass
from enum import Enum

from p2os.pioneer.geometry import Footprint
from p2os.pioneer.mesh_plan import cut, shadow
from p2os.pioneer.scenery import CUT_M, Kind, Obstacle, World

Point = tuple[float, float]


class Look(Enum):
    """How a shape is drawn: its fill colour."""

    FLOOR = "#e6e9de"
    RAMP = "#d3dac2"
    #: Above the hull, like a table's top: passed beneath.
    OVERHEAD = "#dcd3ea"
    THING = "#b9a66b"
    PUSHED = "#d9944a"
    WALL = "#4a5560"
    WALKING = "#1b6ca8"
    #: A scripted path.
    PATH = "#7fb2d6"
    #: A line or an area that programs keep out of.
    FORBIDDEN = "#d98c8c"
    GOAL = "#5a9367"


#: What is drawn later covers what is drawn before.
ORDER = tuple(Look)
#: Of the dot that is drawn for a goal.
MARK_RADIUS_M = 0.08
#: What begins higher is passed beneath by a Pioneer 2.
OVERHEAD_M = 0.22


@dataclass(frozen=True, slots=True)
class Shape:
    """A polygon of some points, a line (open), or a circle (one point and a radius); metres."""

    look: Look
    name: str
    points: tuple[Point, ...]
    radius_m: float = 0.0
    is_open: bool = False


def shapes(world: World) -> list[Shape]:
    """Return what there is to draw, the lowest first."""
    found = [_thing(item) for item in world.obstacles]
    for item in world.obstacles:
        if item.walk is not None:
            points = item.walk.points_m
            found.append(Shape(Look.PATH, f"{item.name}'s path", points, is_open=True))
    for mark in world.marks:
        look = Look.FORBIDDEN if mark.kind == "forbidden" else Look.GOAL
        is_open, radius = len(mark.points_m) > 1, 0.0 if len(mark.points_m) > 1 else MARK_RADIUS_M
        points = (*mark.points_m, mark.points_m[0]) if len(mark.points_m) > 2 else mark.points_m
        found.append(Shape(look, mark.name or mark.kind, points, radius, is_open=is_open))
    for mesh in world.meshes:
        found += [
            Shape(Look.THING, mesh.name, polygon) for polygon in shadow(mesh, CUT_M / 4, CUT_M) if len(polygon) > 2
        ]
        found += [Shape(Look.WALL, mesh.name, segment, is_open=True) for segment in cut(mesh, CUT_M)]
    return sorted(found, key=lambda shape: ORDER.index(shape.look))


def start_arrow(world: World, length_m: float) -> tuple[Point, ...]:
    """Return an arrowhead at the start that looks where the robot looks."""
    start, outline = world.start, ((1.0, 0.0), (-0.7, 0.6), (-0.4, 0.0), (-0.7, -0.6))
    c, s = length_m * math.cos(start.heading_rad), length_m * math.sin(start.heading_rad)
    return tuple((start.x_m + x * c - y * s, start.y_m + x * s + y * c) for x, y in outline)


def _thing(item: Obstacle) -> Shape:
    at = (item.x_m, item.y_m) if item.walk is None else item.walk.points_m[0]
    if item.is_cylinder:
        return Shape(_look(item), item.name, (at,), item.radius_m)
    return Shape(_look(item), item.name, Footprint(item).polygon)


def _look(item: Obstacle) -> Look:
    if item.kind.is_driven_on:
        return Look.RAMP if item.kind is Kind.RAMP else Look.FLOOR
    if item.walk is not None:
        return Look.WALKING
    if item.base_m - item.floor_m >= OVERHEAD_M:
        return Look.OVERHEAD
    if item.kind in {Kind.WALL, Kind.RAIL}:
        return Look.WALL
    return Look.PUSHED if item.mass_kg else Look.THING
