"""Find a place where a robot can stand, in a world whose file names none."""

import math
from collections.abc import Iterable

from p2os.pioneer.geometry import Footprint
from p2os.pioneer.mesh_plan import shadow
from p2os.pioneer.scenery import Mesh, Obstacle, Pose

#: chosen: a Pioneer turns on the spot in it.
FREE_M = 0.5
#: Between these heights nothing may stand.
LOW_M, HIGH_M = 0.05, 0.5
#: The plan is searched on a grid of so many places along its longer side.
PLACES = 24


def free_start(
    obstacles: Iterable[Obstacle], meshes: Iterable[Mesh], extent: tuple[float, float, float, float]
) -> Pose:
    """Return the origin where it is free, else the free place nearest to the middle, else the middle."""
    footprints = [Footprint(item) for item in obstacles if item.stands_in(LOW_M, HIGH_M)]
    segments = [
        (a, b)
        for mesh in meshes
        for polygon in shadow(mesh, LOW_M, HIGH_M)
        for a, b in zip(polygon, (*polygon[1:], polygon[0]), strict=True)
    ]

    def is_free(x: float, y: float) -> bool:
        return all(thing.distance_to_point(x, y) > FREE_M for thing in footprints) and all(
            distance_to_segment(x, y, a, b) > FREE_M for a, b in segments
        )

    x0, y0, x1, y1 = extent
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    step = max(x1 - x0, y1 - y0) / PLACES
    grid = [
        (x0 + step * (column + 0.5), y0 + step * (row + 0.5))
        for column in range(math.ceil((x1 - x0) / step))
        for row in range(math.ceil((y1 - y0) / step))
    ]
    grid.sort(key=lambda place: math.dist(place, (middle_x, middle_y)))
    origin = [(0.0, 0.0)] if x0 < 0 < x1 and y0 < 0 < y1 else []
    for x, y in (*origin, (middle_x, middle_y), *grid):
        if is_free(x, y):
            return Pose(round(x, 3), round(y, 3), 0.0)
    return Pose(middle_x, middle_y, 0.0)


def distance_to_segment(x: float, y: float, a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the distance of a point from a segment."""
    ex, ey = b[0] - a[0], b[1] - a[1]
    length = ex * ex + ey * ey
    share = 0.0 if length == 0 else min(1.0, max(0.0, ((x - a[0]) * ex + (y - a[1]) * ey) / length))
    return math.hypot(x - a[0] - share * ex, y - a[1] - share * ey)
