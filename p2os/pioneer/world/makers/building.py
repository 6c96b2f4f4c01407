"""What the makers build with: walls along the axes, posts, and the world around them.

Every length is rounded to a millimetre, so that a written world is short.
"""

import math
from collections.abc import Iterable

from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Obstacle, ObstacleKind, Pose, World

WALL_M = 0.1
#: chosen: the floor reaches so far beyond the outermost wall.
MARGIN_M = 0.15


def wall(name: str, x0: float, y0: float, x1: float, y1: float, *, height_m: float = 1.0) -> Obstacle:
    """Return a wall between two points, as a `[[wall]]` of a world file is made; along an axis."""
    along_y = abs(y1 - y0) > abs(x1 - x0)
    return Obstacle(
        name=name,
        x_m=mm((x0 + x1) / 2),
        y_m=mm((y0 + y1) / 2),
        heading_rad=math.radians(90.0) if along_y else 0.0,
        length_m=mm(math.hypot(x1 - x0, y1 - y0) + WALL_M),
        width_m=WALL_M,
        height_m=height_m,
        kind=ObstacleKind.WALL,
    )


def walls_around(x0: float, y0: float, x1: float, y1: float) -> list[Obstacle]:
    """Return four walls whose middle lines are the sides of a rectangle."""
    return [
        wall("north wall", x0, y1, x1, y1),
        wall("south wall", x0, y0, x1, y0),
        wall("east wall", x1, y0, x1, y1),
        wall("west wall", x0, y0, x0, y1),
    ]


def box(name: str, x: float, y: float, length: float, width: float, height: float) -> Obstacle:
    """Return a box; metres."""
    return Obstacle(name=name, x_m=mm(x), y_m=mm(y), length_m=mm(length), width_m=mm(width), height_m=height)


def finished(name: str, description: str, start: Pose, things: Iterable[Obstacle]) -> World:
    """Return the world of some things, its floor just larger than they are."""
    obstacles = tuple(things)
    boxes = [Footprint(item).bounds for item in obstacles]
    return World(
        name=name,
        source=name,
        description=description,
        start=start,
        extent=(
            mm(min(b[0] for b in boxes) - MARGIN_M),
            mm(min(b[1] for b in boxes) - MARGIN_M),
            mm(max(b[2] for b in boxes) + MARGIN_M),
            mm(max(b[3] for b in boxes) + MARGIN_M),
        ),
        obstacles=obstacles,
    )


def mm(metres: float) -> float:
    """Return a length to a whole millimetre."""
    return round(metres, 3)
