"""Round and square solids as triangles that look outwards: for formats without them, and for things that are tilted."""

import math
from collections.abc import Sequence

from p2os.pioneer.world.model import Triangle, Vertex

#: Corners, and triangles by the numbers of their corners.
Solid = tuple[tuple[Vertex, ...], tuple[Triangle, ...]]

BOX_TRIANGLES: tuple[Triangle, ...] = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip


def box(size: Sequence[float]) -> Solid:
    """Return a box about its middle."""
    x, y, z = (value / 2 for value in size)
    ring = ((-x, -y), (x, -y), (x, y), (-x, y))
    return tuple((a, b, c) for c in (-z, z) for a, b in ring), BOX_TRIANGLES


def cylinder(radius: float, length: float, sides: int) -> Solid:
    """Return a cylinder about its middle, along Z, as a prism inside of it."""
    half = length / 2
    return _lathe([(0.0, -half), (radius, -half), (radius, half), (0.0, half)], sides)


def sphere(radius: float, sides: int) -> Solid:
    """Return a sphere about its middle: so many sectors, and half as many bands."""
    angles = [math.pi * (band / (sides // 2) - 0.5) for band in range(1, sides // 2)]
    inner = [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]
    return _lathe([(0.0, -radius), *inner, (0.0, radius)], sides)


def _lathe(profile: Sequence[tuple[float, float]], sides: int) -> Solid:
    """Return a solid of revolution about Z: (radius, height) from the bottom up, closed at both ends."""
    turns = [2 * math.pi * side / sides for side in range(sides)]
    vertices: list[Vertex] = [(0.0, 0.0, profile[0][1])]
    vertices += [(r * math.cos(turn), r * math.sin(turn), z) for r, z in profile[1:-1] for turn in turns]
    vertices.append((0.0, 0.0, profile[-1][1]))
    last, top = len(vertices) - 1, len(vertices) - 1 - sides
    triangles: list[Triangle] = []
    for side in range(sides):
        after = (side + 1) % sides
        triangles += [(0, 1 + after, 1 + side), (last, top + side, top + after)]
        for ring in range(1, top, sides):
            a, b = ring + side, ring + after
            triangles += [(a, b, b + sides), (a, b + sides, a + sides)]
    return tuple(vertices), tuple(triangles)
