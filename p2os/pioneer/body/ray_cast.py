"""Rays of one sonar against footprints: the nearest hit of each ray, and how squarely it hits.

The rays of a sonar are narrow, so that most edges are left out at one look: those behind it,
beside it, or seen from their back.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

from p2os.pioneer.world.geometry import INFINITY, Footprint

Direction = tuple[float, float]
#: chosen: half the cone of a sonar; wider parts of a fan leave out fewer edges.
NARROW_RAD = math.radians(15)


class Echo(NamedTuple):
    """What one ray meets.

    `range_m` is infinite where it meets nothing; `cosine` is 1 where the ray
    meets the surface squarely and 0 where it grazes it.
    """

    range_m: float
    cosine: float


def cast(things: Iterable[Footprint], x: float, y: float, rays: Sequence[Direction], longest_m: float) -> list[float]:
    """Return how far each ray goes until it meets a thing, metres; `longest_m` where it meets none.

    Args:
        things: What can be met.
        x: Where the rays begin.
        y: The same.
        rays: Unit directions, the rightmost first, within less than half a turn.
        longest_m: Nothing is looked for beyond.
    """
    hits = [longest_m] * len(rays)
    (rx, ry), (lx, ly) = rays[0], rays[-1]
    for thing in things:
        px, py, reach = thing.x - x, thing.y - y, thing.reach
        # The circle around it is wholly right of the rightmost ray, or left of the leftmost, or too far.
        if rx * py - ry * px < -reach or lx * py - ly * px > reach or px * px + py * py > (longest_m + reach) ** 2:
            continue
        if not thing.edges:
            _circle(thing, px, py, rays, hits)
            continue
        # From inside, no edge is seen from its outer side.
        if not _edges(thing, x, y, rays, hits, is_inside=False) and thing.contains(x, y):
            _edges(thing, x, y, rays, hits, is_inside=True)
    return hits


def narrow_parts(headings_rad: Sequence[float]) -> Iterator[tuple[int, int]]:
    """Yield the first ray, and the one after the last, of each part of a fan that `cast` takes at one look."""
    first = 0
    for ray, heading in enumerate(headings_rad):
        if heading - headings_rad[first] > NARROW_RAD:
            yield first, ray
            first = ray
    if headings_rad:
        yield first, len(headings_rad)


def _edges(
    thing: Footprint, x: float, y: float, rays: Sequence[Direction], hits: list[float], *, is_inside: bool
) -> bool:
    """Shorten what the edges of a polygon stop; tell whether one was seen from its outer side."""
    (rx, ry), (lx, ly) = rays[0], rays[-1]
    is_seen = False
    for ax, ay, ex, ey in thing.edges:
        qx, qy = ax - x, ay - y
        crossed = qx * ey - qy * ex
        if crossed < 0.0:
            is_seen = True
        elif not is_inside:
            continue
        sx, sy = qx + ex, qy + ey
        if (rx * qy - ry * qx < 0.0 and rx * sy - ry * sx < 0.0) or (
            lx * qy - ly * qx > 0.0 and lx * sy - ly * sx > 0.0
        ):
            continue
        for ray, (dx, dy) in enumerate(rays):
            across = dx * ey - dy * ex
            if across != 0.0:
                along = crossed / across
                if 0.0 <= along < hits[ray] and 0.0 <= (qx * dy - qy * dx) / across <= 1.0:
                    hits[ray] = along
    return is_seen


def _circle(thing: Footprint, px: float, py: float, rays: Sequence[Direction], hits: list[float]) -> None:
    radius = thing.radius
    outside = px * px + py * py - radius * radius
    for ray, (dx, dy) in enumerate(rays):
        along = px * dx + py * dy
        under_root = along * along - outside
        if under_root < 0.0:
            continue
        root = math.sqrt(under_root)
        hit = along - root if along >= root else along + root
        if 0.0 <= hit < hits[ray]:
            hits[ray] = hit


def echoes(
    things: Collection[Footprint], x: float, y: float, rays: Sequence[Direction], longest_m: float
) -> list[Echo]:
    """Return the echo of each ray, with the angle at which it meets the surface."""
    found = []
    for ray in rays:
        best, cosine = longest_m, 0.0
        for thing in things:
            hit = thing.hit(x, y, *ray)
            if hit < best:
                best = hit
                nx, ny = thing.normal_at(x + hit * ray[0], y + hit * ray[1])
                cosine = abs(nx * ray[0] + ny * ray[1])
        found.append(Echo(best if best < longest_m else INFINITY, cosine))
    return found
