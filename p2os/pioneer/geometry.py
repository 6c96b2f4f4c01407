"""Plan-view geometry: footprints, rays and distances.

Floats in metres. A footprint is a circle or a convex polygon, and both bodies
measure clearance with it; the kinematic body also finds its walls so.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from p2os.parameters import BodyParameters
from p2os.pioneer.scenery import Obstacle

Point = tuple[float, float]
Polygon = tuple[Point, ...]

#: No echo, nothing near.
INFINITY = math.inf


class Footprint:
    """The plan of an obstacle, prepared for many questions."""

    __slots__ = ("axis", "edges", "halves", "name", "polygon", "radius", "reach", "x", "y")

    def __init__(self, obstacle: Obstacle) -> None:
        self.name = obstacle.name
        self.x, self.y = obstacle.x_m, obstacle.y_m
        self.radius = obstacle.radius_m
        self.reach = obstacle.reach_m
        self.axis = (math.cos(obstacle.heading_rad), math.sin(obstacle.heading_rad))
        self.halves = (obstacle.length_m / 2, obstacle.width_m / 2)
        self.polygon: Polygon = ()
        if not obstacle.is_cylinder:
            half_length, half_width = self.halves
            corners = (
                (half_length, half_width),
                (-half_length, half_width),
                (-half_length, -half_width),
                (half_length, -half_width),
            )
            self.polygon = placed(corners, obstacle.x_m, obstacle.y_m, obstacle.heading_rad)
        self.edges = tuple(pairwise((*self.polygon, self.polygon[0]))) if self.polygon else ()

    def hit(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return how far a ray of unit direction goes until it meets this, or infinity."""
        if not self.edges:
            return _ray_circle(x - self.x, y - self.y, dx, dy, self.radius)
        nearest = INFINITY
        for (ax, ay), (bx, by) in self.edges:
            ex, ey = bx - ax, by - ay
            denominator = dx * ey - dy * ex
            if denominator == 0.0:
                continue
            px, py = ax - x, ay - y
            along = (px * ey - py * ex) / denominator
            if 0.0 <= along < nearest and 0.0 <= (px * dy - py * dx) / denominator <= 1.0:
                nearest = along
        return nearest

    def distance_to_point(self, x: float, y: float) -> float:
        """Return the distance to a point; 0 inside."""
        dx, dy = x - self.x, y - self.y
        if not self.polygon:
            return max(0.0, math.hypot(dx, dy) - self.radius)
        (c, s), (half_length, half_width) = self.axis, self.halves
        along, across = abs(dx * c + dy * s) - half_length, abs(dy * c - dx * s) - half_width
        return math.hypot(max(0.0, along), max(0.0, across))

    def distance(self, hull: Polygon) -> float:
        """Return the distance to a convex polygon; 0 where they overlap."""
        if not self.polygon:
            return max(0.0, _point_polygon(self.x, self.y, hull) - self.radius)
        if not _apart(hull, self.polygon) and not _apart(self.polygon, hull):
            return 0.0
        return min(_nearest(hull, self.polygon), _nearest(self.polygon, hull))


def hull_polygon(body: BodyParameters) -> Polygon:
    """Return the hull's outline in the robot frame, counter-clockwise."""
    front, rear, half = body.hull_front_m, body.hull_rear_m, body.hull_width_m / 2
    return ((front, half), (-rear, half), (-rear, -half), (front, -half))


def placed(polygon: Sequence[Point], x: float, y: float, heading: float) -> Polygon:
    """Return a polygon moved and turned."""
    c, s = math.cos(heading), math.sin(heading)
    return tuple((x + px * c - py * s, y + px * s + py * c) for px, py in polygon)


def _ray_circle(px: float, py: float, dx: float, dy: float, radius: float) -> float:
    """Return the distance along a ray from (px, py), relative to the centre, to the circle."""
    along = -(px * dx + py * dy)
    under_root = along * along - (px * px + py * py - radius * radius)
    if under_root < 0.0:
        return INFINITY
    root = math.sqrt(under_root)
    if along - root >= 0.0:
        return along - root
    return along + root if along + root >= 0.0 else INFINITY


def _apart(first: Polygon, second: Polygon) -> bool:
    """Tell whether an edge of the first convex polygon (counter-clockwise) has all of the second outside."""
    for (ax, ay), (bx, by) in pairwise((*first, first[0])):
        ex, ey = bx - ax, by - ay
        if all((px - ax) * ey - (py - ay) * ex > 0.0 for px, py in second):
            return True
    return False


def _nearest(points: Polygon, polygon: Polygon) -> float:
    """Return the least distance from some points to a polygon's edges."""
    edges = tuple(pairwise((*polygon, polygon[0])))
    return min(_point_segment(px, py, *a, *b) for px, py in points for a, b in edges)


def _point_polygon(x: float, y: float, polygon: Polygon) -> float:
    """Return the distance from a point to a convex polygon (counter-clockwise); 0 inside."""
    edges = tuple(pairwise((*polygon, polygon[0])))
    if all((x - ax) * (by - ay) - (y - ay) * (bx - ax) <= 0.0 for (ax, ay), (bx, by) in edges):
        return 0.0
    return min(_point_segment(x, y, *a, *b) for a, b in edges)


def _point_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    ex, ey = bx - ax, by - ay
    share = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
    share = min(1.0, max(0.0, share))
    return math.hypot(x - ax - share * ex, y - ay - share * ey)
