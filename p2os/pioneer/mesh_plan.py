"""What a plan view sees of a mesh: its cut at one height, and its shadow within a band of heights.

A cut is a set of segments, a shadow a set of convex polygons (two points where a
face stands upright). Faces come as triangles, so that one wall gives many pieces
on one line: these are joined.
"""

import math
from collections.abc import Iterable
from itertools import pairwise

from p2os.pioneer.scenery import Mesh, Vertex

Point = tuple[float, float]
Segment = tuple[Point, Point]
Polygon = tuple[Point, ...]

#: Pieces on lines that differ by less are one, m; and the grain to which lines are compared.
GRAIN_M = 1e-4
#: A shadow of less area is an upright face, m².
UPRIGHT_M2 = 1e-8
_LINE_ANGLE_STEPS = 1e4


def cut(mesh: Mesh, height_m: float) -> list[Segment]:
    """Return where a mesh meets a level plane; a face that lies in the plane is not met."""
    found: list[Segment] = []
    vertices = mesh.vertices
    for triangle in mesh.triangles:
        corners = [vertices[index] for index in triangle]
        above = [corner[2] >= height_m for corner in corners]
        if any(above) and not all(above):
            crossings = [
                _crossing(corners[i], corners[(i + 1) % 3], height_m)
                for i in range(3)
                if above[i] is not above[(i + 1) % 3]
            ]
            if math.dist(crossings[0], crossings[1]) > GRAIN_M:
                found.append((crossings[0], crossings[1]))
    return joined(found)


def shadow(mesh: Mesh, low_m: float, high_m: float) -> list[Polygon]:
    """Return the plan of all that stands between two heights."""
    polygons: dict[tuple[tuple[int, int], ...], Polygon] = {}
    upright: list[Segment] = []
    vertices = mesh.vertices
    for triangle in mesh.triangles:
        corners = [vertices[index] for index in triangle]
        heights = [corner[2] for corner in corners]
        if min(heights) >= high_m or max(heights) <= low_m:
            continue
        inside = _above(_above(corners, low_m, 1.0), -high_m, -1.0)
        outline = [(x, y) for x, y, _ in inside]
        if len(outline) < 2:
            continue
        area = _area(outline)
        if abs(area) < UPRIGHT_M2:
            upright.append(_longest(outline))
            continue
        polygon = tuple(outline if area > 0 else reversed(outline))
        polygons.setdefault(tuple(sorted({_grained(point) for point in polygon})), _without_twins(polygon))
    return [*(segment for segment in joined(upright)), *polygons.values()]


def joined(segments: Iterable[Segment]) -> list[Segment]:
    """Return segments with those that lie on one line and overlap or touch made into one."""
    lines: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for (ax, ay), (bx, by) in segments:
        if math.hypot(bx - ax, by - ay) < GRAIN_M:
            continue
        angle = math.atan2(by - ay, bx - ax) % math.pi
        step = round(angle * _LINE_ANGLE_STEPS) % round(math.pi * _LINE_ANGLE_STEPS)
        c, s = math.cos(step / _LINE_ANGLE_STEPS), math.sin(step / _LINE_ANGLE_STEPS)
        offset = round(((ay + by) / 2 * c - (ax + bx) / 2 * s) / GRAIN_M)
        ends = sorted((ax * c + ay * s, bx * c + by * s))
        lines.setdefault((step, offset), []).append((ends[0], ends[1]))
    result: list[Segment] = []
    for (step, offset), spans in lines.items():
        c, s = math.cos(step / _LINE_ANGLE_STEPS), math.sin(step / _LINE_ANGLE_STEPS)
        away = offset * GRAIN_M
        for low, high in _union(sorted(spans)):
            result.append(((low * c - away * s, low * s + away * c), (high * c - away * s, high * s + away * c)))
    return result


def _union(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    merged = [spans[0]]
    for low, high in spans[1:]:
        if low <= merged[-1][1] + GRAIN_M:
            merged[-1] = (merged[-1][0], max(merged[-1][1], high))
        else:
            merged.append((low, high))
    return merged


def _crossing(a: Vertex, b: Vertex, height_m: float) -> Point:
    share = (height_m - a[2]) / (b[2] - a[2])
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])


def _above(corners: list[Vertex], height_m: float, sign: float) -> list[Vertex]:
    """Return the part of a convex outline where sign * z >= height (Sutherland and Hodgman's clip)."""
    kept: list[Vertex] = []
    for i, a in enumerate(corners):
        b = corners[(i + 1) % len(corners)]
        a_in, b_in = sign * a[2] >= height_m, sign * b[2] >= height_m
        if a_in:
            kept.append(a)
        if a_in is not b_in:
            at = height_m * sign
            x, y = _crossing(a, b, at)
            kept.append((x, y, at))
    return kept


def _area(outline: list[Point]) -> float:
    """Return the area of an outline, positive counter-clockwise."""
    ox, oy = outline[0]
    return sum((ax - ox) * (by - oy) - (bx - ox) * (ay - oy) for (ax, ay), (bx, by) in pairwise(outline[1:])) / 2


def _longest(outline: list[Point]) -> Segment:
    """Return the two points of a flat outline that are farthest apart."""
    return max(((a, b) for a in outline for b in outline), key=lambda pair: math.dist(*pair))


def _grained(point: Point) -> tuple[int, int]:
    return round(point[0] / GRAIN_M), round(point[1] / GRAIN_M)


def _without_twins(polygon: Polygon) -> Polygon:
    """Return an outline without corners that follow each other at one place."""
    return tuple(point for place, point in enumerate(polygon) if math.dist(point, polygon[place - 1]) > GRAIN_M / 10)
