"""A world as characters for a terminal: two square points in each, one above the other."""

import math
from collections.abc import Iterator

from p2os.pioneer.drawing import Look, Shape, shapes
from p2os.pioneer.scenery import World

#: Which looks are drawn in characters; what is driven on or beneath would hide the rest.
SOLID = (Look.THING, Look.PUSHED, Look.WALL, Look.WALKING)
#: Upper and lower point taken → character.
BLOCKS = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
#: By eighths of a turn, from east counter-clockwise.
ARROWS = "→↗↑↖←↙↓↘"


def text(world: World, columns: int) -> list[str]:
    """Return the rows of the drawing, the northern first; the arrow is the start.

    Args:
        world: What to draw.
        columns: How wide it may be; at least 8.
    """
    x0, y0, x1, y1 = world.extent
    columns = max(8, columns)
    point_m = (x1 - x0) / columns
    rows = max(2, math.ceil((y1 - y0) / point_m))
    taken = [[False] * columns for _ in range(rows + rows % 2)]
    for shape in shapes(world):
        if shape.look in SOLID:
            for column, row in _points(shape, x0, y1, point_m):
                if 0 <= row < len(taken) and 0 <= column < columns:
                    taken[row][column] = True
    lines = [
        "".join(BLOCKS[upper, lower] for upper, lower in zip(taken[row], taken[row + 1], strict=True))
        for row in range(0, len(taken), 2)
    ]
    column, row = int((world.start.x_m - x0) / point_m), int((y1 - world.start.y_m) / point_m) // 2
    if 0 <= row < len(lines) and 0 <= column < columns:
        arrow = ARROWS[round(world.start.heading_rad / (math.pi / 4)) % 8]
        lines[row] = lines[row][:column] + arrow + lines[row][column + 1 :]
    return [line.rstrip() for line in lines]


def _points(shape: Shape, x0: float, y1: float, point_m: float) -> Iterator[tuple[int, int]]:
    """Yield column and row of each point that a shape covers, at least one."""
    xs, ys = [x for x, _ in shape.points], [y for _, y in shape.points]
    r = shape.radius_m
    first, last = int((min(xs) - r - x0) / point_m), int((max(xs) + r - x0) / point_m)
    top, bottom = int((y1 - max(ys) - r) / point_m), int((y1 - min(ys) + r) / point_m)
    for row in range(top, bottom + 1):
        for column in range(first, last + 1):
            if _covers(shape, x0 + (column + 0.5) * point_m, y1 - (row + 0.5) * point_m, point_m / 2):
                yield column, row


def _covers(shape: Shape, x: float, y: float, slack_m: float) -> bool:
    points = shape.points
    if shape.radius_m:
        return math.hypot(x - points[0][0], y - points[0][1]) <= max(shape.radius_m, slack_m)
    if not shape.is_open and _is_inside(points, x, y):
        return True
    ends = points[1:] if shape.is_open else (*points[1:], points[0])
    return any(_distance(x, y, a, b) <= slack_m for a, b in zip(points, ends, strict=False))


def _is_inside(points: tuple[tuple[float, float], ...], x: float, y: float) -> bool:
    """Tell whether a point is on the left of every edge of a convex counter-clockwise outline."""
    return all(
        (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0
        for (ax, ay), (bx, by) in zip(points, (*points[1:], points[0]), strict=True)
    )


def _distance(x: float, y: float, a: tuple[float, float], b: tuple[float, float]) -> float:
    ex, ey = b[0] - a[0], b[1] - a[1]
    length = ex * ex + ey * ey
    share = 0.0 if length == 0 else min(1.0, max(0.0, ((x - a[0]) * ex + (y - a[1]) * ey) / length))
    return math.hypot(x - a[0] - share * ex, y - a[1] - share * ey)
