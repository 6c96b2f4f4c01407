"""How true a map is: its occupied cells against what stands in the world, and what stands there against its cells."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np

from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Point
from tools.foreign.nodes.driving import OCCUPIED, Grid

#: The outlines are asked so often, m.
STEP_M = 0.05


def share_near(grid: Grid, things: Iterable[Footprint], near_m: float) -> float:
    """Return which share of the occupied cells has its middle within a distance of a thing; 0 of none."""
    standing = list(things)
    points = _middles(grid)
    near = sum(any(thing.distance_to_point(x, y) <= near_m for thing in standing) for x, y in points)
    return near / len(points) if len(points) else 0.0


def share_found(grid: Grid, things: Iterable[Footprint], near_m: float) -> float:
    """Return which share of what a laser on the floor could meet has an occupied cell within a distance.

    Asked are points of the outlines beside which a known free cell is within two cells: what the robot could not see
    from where it was, such as the outside of the building, is none of the map's business.
    """
    occupied = _middles(grid)
    free_near = _grown(grid.cells == 0, 2)
    asked = found = 0
    for x, y in (point for thing in things for point in outline(thing)):
        row, column = grid.cell(x, y)
        if not grid.has(row, column) or not free_near[row, column]:
            continue
        asked += 1
        found += bool(len(occupied)) and float(np.min(np.hypot(*(occupied - (x, y)).T))) <= near_m
    return found / asked if asked else 0.0


def outline(thing: Footprint) -> Iterator[Point]:
    """Yield points of a thing's outline, `STEP_M` apart."""
    if not thing.polygon:
        steps = max(8, math.ceil(math.tau * thing.radius / STEP_M))
        for step in range(steps):
            angle = math.tau * step / steps
            yield thing.x + thing.radius * math.cos(angle), thing.y + thing.radius * math.sin(angle)
        return
    for (ax, ay), (bx, by) in pairwise((*thing.polygon, thing.polygon[0])):
        steps = max(1, math.ceil(math.hypot(bx - ax, by - ay) / STEP_M))
        for step in range(steps):
            yield ax + (bx - ax) * step / steps, ay + (by - ay) * step / steps


def _middles(grid: Grid) -> np.ndarray:
    """Return the middles of the occupied cells, [n, 2] m."""
    rows, columns = np.nonzero(grid.cells >= OCCUPIED)
    return np.stack([grid.x + (columns + 0.5) * grid.size, grid.y + (rows + 0.5) * grid.size], axis=1)


def _grown(cells: np.ndarray, by: int) -> np.ndarray:
    """Return which cells have one that is set within so many rows and columns."""
    wide = np.pad(cells, by)
    rows, columns = cells.shape
    span = range(2 * by + 1)
    return np.logical_or.reduce([wide[down : down + rows, right : right + columns] for down in span for right in span])
