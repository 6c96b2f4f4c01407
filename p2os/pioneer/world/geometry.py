"""Plan-view geometry: footprints, rays and distances.

Floats in metres. A footprint is a circle or a convex polygon, and both bodies
measure clearance with it; the kinematic body also finds its walls so.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from p2os.pioneer.world.model import Obstacle, Point, Polygon
from p2os.robots.parameters import BodyParameters, RobotParameters

#: No echo, nothing near.
INFINITY = math.inf


class Footprint:
    """The plan of a thing, prepared for many questions: a circle, or a convex polygon counter-clockwise.

    A polygon of two points is an upright face of a mesh: it has two sides and no inside.
    """

    __slots__ = ("_box", "edges", "name", "polygon", "radius", "reach", "x", "y")

    def __init__(self, obstacle: Obstacle | None, polygon: Polygon = (), name: str = "") -> None:
        """Prepare an obstacle's footprint, or with None that of a polygon (`of_polygon`)."""
        #: Cosine and sine of the heading, half length and half width, where it is a box.
        self._box: tuple[float, float, float, float] | None = None
        if obstacle is None:
            count = len(polygon)
            self.name, self.radius, self.polygon = name, 0.0, polygon
            self.x, self.y = sum(x for x, _ in polygon) / count, sum(y for _, y in polygon) / count
            self.reach = max(math.dist((self.x, self.y), point) for point in polygon)
        else:
            self.name, self.radius, self.reach = obstacle.name, obstacle.radius_m, obstacle.reach_m
            self.x, self.y = obstacle.x_m, obstacle.y_m
            self.polygon = () if obstacle.is_cylinder else self._corners(obstacle)
        #: Start and run of each edge.
        self.edges = tuple(
            (ax, ay, bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise((*self.polygon, *self.polygon[:1]))
        )

    @classmethod
    def of_polygon(cls, name: str, polygon: Polygon) -> "Footprint":
        """Return the footprint of a part of a mesh."""
        return cls(None, polygon, name)

    def _corners(self, item: Obstacle) -> Polygon:
        half_length, half_width = item.length_m / 2, item.width_m / 2
        self._box = (math.cos(item.heading_rad), math.sin(item.heading_rad), half_length, half_width)
        corners = (
            (half_length, half_width),
            (-half_length, half_width),
            (-half_length, -half_width),
            (half_length, -half_width),
        )
        return placed(corners, item.x_m, item.y_m, item.heading_rad)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return x0, y0, x1, y1 of the rectangle around it."""
        if not self.polygon:
            r = self.radius
            return self.x - r, self.y - r, self.x + r, self.y + r
        xs, ys = [x for x, _ in self.polygon], [y for _, y in self.polygon]
        return min(xs), min(ys), max(xs), max(ys)

    def contains(self, x: float, y: float) -> bool:
        """Tell whether a point is inside a polygon or on its edge; of a circle, and of two points, never asked."""
        if len(self.edges) < 3:
            return False
        return all((x - ax) * ey - (y - ay) * ex <= 0.0 for ax, ay, ex, ey in self.edges)

    def hit(self, x: float, y: float, dx: float, dy: float) -> float:
        """Return how far a ray of unit direction goes until it meets this, or infinity."""
        if not self.edges:
            return _ray_circle(x - self.x, y - self.y, dx, dy, self.radius)
        nearest = INFINITY
        for ax, ay, ex, ey in self.edges:
            denominator = dx * ey - dy * ex
            if denominator == 0.0:
                continue
            px, py = ax - x, ay - y
            along = (px * ey - py * ex) / denominator
            if 0.0 <= along < nearest and 0.0 <= (px * dy - py * dx) / denominator <= 1.0:
                nearest = along
        return nearest

    def normal_at(self, x: float, y: float) -> Point:
        """Return the unit normal of the surface nearest to a point of the outline."""
        if not self.edges:
            return (x - self.x) / self.radius, (y - self.y) / self.radius
        _, _, ex, ey = min(
            self.edges, key=lambda edge: point_segment(x, y, edge[0], edge[1], edge[0] + edge[2], edge[1] + edge[3])
        )
        length = math.hypot(ex, ey)
        return ey / length, -ex / length

    def distance_to_point(self, x: float, y: float) -> float:
        """Return the distance to a point; 0 inside."""
        if not self.edges:
            return max(0.0, math.hypot(x - self.x, y - self.y) - self.radius)
        if self._box is not None:
            c, s, half_length, half_width = self._box
            dx, dy = x - self.x, y - self.y
            along, across = abs(dx * c + dy * s) - half_length, abs(dy * c - dx * s) - half_width
            return math.hypot(max(0.0, along), max(0.0, across))
        if self.contains(x, y):
            return 0.0
        return min(point_segment(x, y, ax, ay, ax + ex, ay + ey) for ax, ay, ex, ey in self.edges)

    def distance(self, hull: Polygon) -> float:
        """Return the distance to a convex polygon; 0 where they overlap."""
        if not self.polygon:
            return max(0.0, point_polygon(self.x, self.y, hull) - self.radius)
        if self.overlaps(hull):
            return 0.0
        return min(_nearest(hull, self.polygon), _nearest(self.polygon, hull))

    def overlaps(self, hull: Polygon) -> bool:
        """Tell whether this polygon and a convex one overlap or touch; of a circle, never asked."""
        return not _apart(hull, self.polygon) and not _apart(self.polygon, hull)

    def way_out(self, hull: Polygon) -> Point:
        """Return the shortest move that takes this out of a convex polygon that it overlaps.

        The separating axes are the normals of both outlines, and for a circle
        the line from its middle to the nearest corner.
        """
        best, move = INFINITY, (0.0, 0.0)
        own = self.polygon
        # Along the normal of an edge, nothing of its outline lies farther out than the edge itself.
        for (ax, ay), (bx, by) in pairwise((*hull, hull[0])):
            nx, ny = by - ay, ax - bx
            if length := math.hypot(nx, ny):
                nx, ny = nx / length, ny / length
                near = min([px * nx + py * ny for px, py in own]) if own else self.x * nx + self.y * ny - self.radius
                way = ax * nx + ay * ny - near
                if way < best:
                    best, move = way, (way * nx, way * ny)
        for ax, ay, ex, ey in self.edges or (self._from_corner(hull),):
            if length := math.hypot(ex, ey):
                nx, ny = -ey / length, ex / length
                way = max([px * nx + py * ny for px, py in hull]) - (ax * nx + ay * ny)
                if way < best:
                    best, move = way, (way * nx, way * ny)
        return move

    def _from_corner(self, hull: Polygon) -> tuple[float, float, float, float]:
        """Return the point of a circle nearest to the nearest corner of a polygon, and the tangent there."""
        x, y = min(hull, key=lambda point: math.dist(point, (self.x, self.y)))
        dx, dy = self.x - x, self.y - y
        share = self.radius / (math.hypot(dx, dy) or math.inf)
        return self.x - dx * share, self.y - dy * share, dy, -dx


def hull_polygon(body: BodyParameters) -> Polygon:
    """Return the hull's outline in the robot frame, counter-clockwise."""
    front, rear, half = body.hull_front_m, body.hull_rear_m, body.hull_width_m / 2
    return ((front, half), (-rear, half), (-rear, -half), (front, -half))


def wheel_polygons(parameters: RobotParameters) -> tuple[Polygon, ...]:
    """Return where wheels and caster meet a thing as high as the hull's underside, in the robot frame."""
    body = parameters.body
    high = body.ground_clearance_m

    def reach(radius: float) -> float:
        depth = min(high, radius)
        return math.sqrt(depth * (2 * radius - depth))

    half, ahead, aside = body.wheel_width_m / 2, reach(body.wheel_diameter_m / 2), parameters.track_mm / 2000
    caster = reach(body.caster_radius_m)
    return (
        _rectangle(0.0, aside, ahead, half),
        _rectangle(0.0, -aside, ahead, half),
        _rectangle(body.caster_x_m, 0.0, caster, caster),
    )


def _rectangle(x: float, y: float, half_length: float, half_width: float) -> Polygon:
    return (
        (x + half_length, y + half_width),
        (x - half_length, y + half_width),
        (x - half_length, y - half_width),
        (x + half_length, y - half_width),
    )


def placed(polygon: Sequence[Point], x: float, y: float, heading: float) -> Polygon:
    """Return a polygon moved and turned."""
    c, s = math.cos(heading), math.sin(heading)
    return tuple([(x + px * c - py * s, y + px * s + py * c) for px, py in polygon])  # a generator takes twice as long


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
    ax, ay = first[-1]
    for bx, by in first:
        ex, ey = bx - ax, by - ay
        for px, py in second:  # a generator costs twice as much, and robots that push each other ask little else
            if (px - ax) * ey - (py - ay) * ex <= 0.0:
                break
        else:
            return True
        ax, ay = bx, by
    return False


def _nearest(points: Polygon, polygon: Polygon) -> float:
    """Return the least distance from some points to a polygon's edges."""
    nearest, hypot = INFINITY, math.hypot
    for (ax, ay), (bx, by) in pairwise((*polygon, polygon[0])):
        # `point_segment` of each point, in place: a run measures its clearance twenty times a second.
        ex, ey = bx - ax, by - ay
        length = ex * ex + ey * ey
        for x, y in points:
            share = ((x - ax) * ex + (y - ay) * ey) / length if length > 0.0 else 0.0
            share = 0.0 if share < 0.0 else min(share, 1.0)
            found = hypot(x - ax - share * ex, y - ay - share * ey)
            if found < nearest:  # noqa: PLR1730 - a call a point
                nearest = found
    return nearest


def point_polygon(x: float, y: float, polygon: Polygon) -> float:
    """Return the distance from a point to a convex polygon (counter-clockwise); 0 inside."""
    edges = tuple(pairwise((*polygon, polygon[0])))
    if all((x - ax) * (by - ay) - (y - ay) * (bx - ax) <= 0.0 for (ax, ay), (bx, by) in edges):
        return 0.0
    return min(point_segment(x, y, *a, *b) for a, b in edges)


def point_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance from a point to a straight line between two others."""
    ex, ey = bx - ax, by - ay
    length = ex * ex + ey * ey
    share = ((x - ax) * ex + (y - ay) * ey) / length if length > 0.0 else 0.0
    share = min(1.0, max(0.0, share))
    return math.hypot(x - ax - share * ex, y - ay - share * ey)
