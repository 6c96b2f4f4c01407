"""A polygon of a mesh file as triangles, whichever its shape.

Modellers write a wall with a doorway as one polygon that goes around the opening;
a fan of triangles from its first corner would close the door. Ears are cut off
instead: a corner that points outwards and has no other corner in its triangle.

Not modelled: polygons that cross themselves; they come out as some triangles over
their corners.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from p2os.pioneer.world.model import Triangle, Vertex

#: Cutting ears takes time with the square of the corners at least; larger polygons become fans (chosen).
MOST_CORNERS = 100

Flat = list[tuple[float, float]]


@dataclass(slots=True)
class Triangles:
    """The corners and faces of a file, and what of it was left out."""

    vertices: list[Vertex] = field(default_factory=list)
    triangles: list[Triangle] = field(default_factory=list)
    skipped: dict[str, None] = field(default_factory=dict)


def triangulated(corners: Sequence[Vertex]) -> list[Triangle]:
    """Return the triangles of a polygon as numbers of its corners.

    Args:
        corners: Three or more, in order around it, in about one plane.
    """
    count = len(corners)
    fan = [(0, b, b + 1) for b in range(1, count - 1)]
    if count == 3 or count > MOST_CORNERS:
        return fan
    flat = _flattened(corners)
    if flat is None or all(_turn(flat[i - 1], flat[i], flat[(i + 1) % count]) >= 0 for i in range(count)):
        return fan
    left = list(range(count))
    found: list[Triangle] = []
    while len(left) > 3:
        ear = next((place for place in range(len(left)) if _is_ear(flat, left, place)), None)
        if ear is None:  # it crosses itself
            break
        found.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return found + [(left[0], left[b], left[b + 1]) for b in range(1, len(left) - 1)]


def _flattened(corners: Sequence[Vertex]) -> Flat | None:
    """Return a polygon in its own plane, counter-clockwise; None where it has no area."""
    nx = ny = nz = 0.0
    for (ax, ay, az), (bx, by, bz) in zip(corners, [*corners[1:], corners[0]], strict=True):
        # Newell's sum: twice the area over each plane of the axes.
        nx += (ay - by) * (az + bz)
        ny += (az - bz) * (ax + bx)
        nz += (ax - bx) * (ay + by)
    if not math.isfinite(nx + ny + nz) or nx == ny == nz == 0.0:
        return None
    # The axis that the polygon looks along most is left out; the sign keeps it counter-clockwise.
    if abs(nz) >= max(abs(nx), abs(ny)):
        return [(x if nz > 0 else -x, y) for x, y, _ in corners]
    if abs(nx) >= abs(ny):
        return [(y if nx > 0 else -y, z) for _, y, z in corners]
    return [(z if ny > 0 else -z, x) for x, _, z in corners]


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """Return a positive number where the way from a by b to c turns left."""
    return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])


def _is_ear(flat: Flat, left: list[int], place: int) -> bool:
    a, b, c = flat[left[place - 1]], flat[left[place]], flat[left[(place + 1) % len(left)]]
    if _turn(a, b, c) <= 0:
        return False
    for number in left:
        p = flat[number]
        if p in {a, b, c}:
            continue
        if _turn(a, b, p) >= 0 and _turn(b, c, p) >= 0 and _turn(c, a, p) >= 0:
            return False
    return True
