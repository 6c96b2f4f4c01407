"""A maze with one way between any two cells, by a walk that turns back where it is stuck."""

import random

from p2os.pioneer.world.makers.building import finished, wall, walls_around
from p2os.pioneer.world.model import Pose, World

CELLS = 5
#: chosen: the robot turns on the spot with 0.5 m around its hull.
CELL_M = 1.8
Cell = tuple[int, int]


def make(seed: int) -> World:
    """Return a maze of 5 x 5 cells; the start is one corner, the middle of the opposite one is at 7.2, 7.2."""
    passages = _carve(random.Random(seed))
    low, high = -CELL_M / 2, CELL_M * CELLS - CELL_M / 2
    things = walls_around(low, low, high, high)
    for line in range(1, CELLS):
        at = line * CELL_M - CELL_M / 2
        # A wall runs on as long as no passage breaks it.
        closed = [((line - 1, place), (line, place)) not in passages for place in range(CELLS)]
        things += [wall(f"wall x{line} {a}-{b}", at, _edge(a), at, _edge(b)) for a, b in _runs(closed)]
        closed = [((place, line - 1), (place, line)) not in passages for place in range(CELLS)]
        things += [wall(f"wall y{line} {a}-{b}", _edge(a), at, _edge(b), at) for a, b in _runs(closed)]
    first = ((0, 0), (1, 0)) in passages
    start = Pose(0.0, 0.0, 0.0 if first else 1.5707963267948966)
    return finished(
        "maze", f"A maze of {CELLS} x {CELLS} cells of {CELL_M} m, one way between any two; from corner to corner",
        start, things,
    )  # fmt: skip


def _carve(random_source: random.Random) -> set[tuple[Cell, Cell]]:
    """Return the pairs of neighbours that are open to each other, the smaller cell first."""
    passages: set[tuple[Cell, Cell]] = set()
    way, seen = [(0, 0)], {(0, 0)}
    while way:
        x, y = way[-1]
        near = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
        unvisited = [cell for cell in near if cell not in seen and 0 <= cell[0] < CELLS and 0 <= cell[1] < CELLS]
        if not unvisited:
            way.pop()
            continue
        cell = random_source.choice(unvisited)
        passages.add((min(cell, (x, y)), max(cell, (x, y))))
        seen.add(cell)
        way.append(cell)
    return passages


def _runs(closed: list[bool]) -> list[tuple[int, int]]:
    """Return the stretches of a line that are closed, as from and to."""
    runs: list[tuple[int, int]] = []
    begin: int | None = None
    for place, is_closed in enumerate([*closed, False]):
        if is_closed and begin is None:
            begin = place
        elif not is_closed and begin is not None:
            runs.append((begin, place))
            begin = None
    return runs


def _edge(place: int) -> float:
    return place * CELL_M - CELL_M / 2
