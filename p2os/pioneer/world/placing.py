"""Where a file's content goes in a world, and which of its axes points up.

The order is the importer's law: scale to metres, turn the file's up axis to Z,
turn by the heading, move.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from p2os.errors import WorldError
from p2os.pioneer.world.model import Obstacle, Pose, Vertex, World

#: Which axis of a file is up: `auto` is what its format states or usually has.
UP_AXES = ("auto", "x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Placing:
    """How to put a file's content into a world: metres, radians."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    heading_rad: float = 0.0
    #: Multiplies lengths, after the file's own unit.
    scale: float = 1.0
    up: str = "auto"

    def __post_init__(self) -> None:
        if self.up not in UP_AXES:
            raise WorldError(f"up = {self.up!r} is unknown", hint=f"one of {', '.join(UP_AXES)}")
        if not 0 < self.scale < math.inf:
            raise WorldError(f"scale = {self.scale:g} must be above 0")

    @property
    def is_identity(self) -> bool:
        """Whether nothing is moved or scaled."""
        return self.scale == 1.0 and not any((self.x_m, self.y_m, self.z_m, self.heading_rad))


def with_z_up(vertices: Iterable[Vertex], up: str) -> list[Vertex]:
    """Return vertices turned so that the named axis points along Z; no mirror image.

    Y up: x stays, y becomes z, z becomes -y (the quarter turn about X that Blender's exporters undo).
    X up: the quarter turn about Y.
    """
    if up == "y":
        return [(x, -z, y) for x, y, z in vertices]
    if up == "x":
        return [(-z, y, x) for x, y, z in vertices]
    return list(vertices)


def placed_world(world: World, placing: Placing) -> World:
    """Return a world with everything in it scaled, turned and moved; its up axis is up already."""
    if placing.is_identity:
        return world
    obstacles = tuple(_placed_obstacle(item, placing) for item in world.obstacles)
    meshes = tuple(replace(item, vertices=tuple(placed_points(item.vertices, placing))) for item in world.meshes)
    marks = tuple(
        replace(item, points_m=tuple((x, y) for x, y, _ in placed_points([(*p, 0.0) for p in item.points_m], placing)))
        for item in world.marks
    )
    ((x, y, z),) = placed_points([(world.start.x_m, world.start.y_m, world.start.z_m)], placing)
    x0, y0, x1, y1 = world.extent
    corners = placed_points([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0)], placing)
    xs, ys = [corner[0] for corner in corners], [corner[1] for corner in corners]
    return replace(
        world,
        obstacles=obstacles,
        meshes=meshes,
        marks=marks,
        start=Pose(x, y, world.start.heading_rad + placing.heading_rad, z),
        extent=(min(xs), min(ys), max(xs), max(ys)),
    )


def placed_points(points: Sequence[Vertex], placing: Placing) -> list[Vertex]:
    """Return points scaled, turned about Z and moved."""
    k = placing.scale
    c, s = k * math.cos(placing.heading_rad), k * math.sin(placing.heading_rad)
    return [(placing.x_m + c * x - s * y, placing.y_m + s * x + c * y, placing.z_m + k * z) for x, y, z in points]


def _placed_obstacle(item: Obstacle, placing: Placing) -> Obstacle:
    k = placing.scale
    ((x, y, _),) = placed_points([(item.x_m, item.y_m, 0.0)], placing)
    return replace(
        item, x_m=x, y_m=y, heading_rad=item.heading_rad + placing.heading_rad, length_m=item.length_m * k,
        width_m=item.width_m * k, radius_m=item.radius_m * k, height_m=item.height_m * k,
        base_m=item.base_m * k + placing.z_m, floor_m=item.floor_m * k,
    )  # fmt: skip
