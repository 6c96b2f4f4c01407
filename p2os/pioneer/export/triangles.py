"""Shapes as triangles, for formats that have nothing else, and meshes as OBJ files."""

import math

from p2os.pioneer.export.scene import Box, Cylinder, Shape, Sphere, TriangleMesh
from p2os.pioneer.world.formats.collection import BOX_TRIANGLES
from p2os.pioneer.world.model import Triangle, Vertex

#: chosen: sides of a cylinder, and sectors of a sphere, which has half as many bands.
SIDES = 32


def triangulated(shape: Shape) -> TriangleMesh:
    """Return a shape as triangles that look outwards; a round one as a prism inside of it."""
    if isinstance(shape, TriangleMesh):
        return shape
    if isinstance(shape, Box):
        x, y, z = (size / 2 for size in shape.size_m)
        ring = ((-x, -y), (x, -y), (x, y), (-x, y))
        return TriangleMesh(tuple((a, b, c) for c in (-z, z) for a, b in ring), BOX_TRIANGLES)
    if isinstance(shape, Cylinder):
        half = shape.length_m / 2
        return _lathe([(0.0, -half), (shape.radius_m, -half), (shape.radius_m, half), (0.0, half)])
    return _lathe(_arc(shape))


def _arc(ball: Sphere) -> list[tuple[float, float]]:
    angles = [math.pi * (band / (SIDES // 2) - 0.5) for band in range(SIDES // 2 + 1)]
    inner = [(ball.radius_m * math.cos(angle), ball.radius_m * math.sin(angle)) for angle in angles[1:-1]]
    return [(0.0, -ball.radius_m), *inner, (0.0, ball.radius_m)]


def _lathe(profile: list[tuple[float, float]]) -> TriangleMesh:
    """Return a solid of revolution about Z: (radius, height) from the bottom up, closed at both ends."""
    turns = [2 * math.pi * side / SIDES for side in range(SIDES)]
    vertices: list[Vertex] = [(0.0, 0.0, profile[0][1])]
    vertices += [(r * math.cos(turn), r * math.sin(turn), z) for r, z in profile[1:-1] for turn in turns]
    vertices.append((0.0, 0.0, profile[-1][1]))
    last, top = len(vertices) - 1, len(vertices) - 1 - SIDES
    triangles: list[Triangle] = []
    for side in range(SIDES):
        after = (side + 1) % SIDES
        triangles += [(0, 1 + after, 1 + side), (last, top + side, top + after)]
        for ring in range(1, top, SIDES):
            a, b = ring + side, ring + after
            triangles += [(a, b, b + SIDES), (a, b + SIDES, a + SIDES)]
    return TriangleMesh(tuple(vertices), tuple(triangles))


def obj_text(mesh: TriangleMesh) -> bytes:
    """Return an OBJ file: metres, with the axes of the mesh."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.triangles]
    return ("\n".join(lines) + "\n").encode()
