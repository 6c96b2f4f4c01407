"""Footprints that never move, found by where they are.

A map has thousands of walls; a question concerns a few square metres. The plan
is cut in square cells, each with the footprints that reach into it.
"""

import math
from collections.abc import Iterable

from p2os.pioneer.geometry import Footprint

#: chosen: a sonar's cone touches some twenty cells.
CELL_M = 1.0
#: A footprint that would fill more cells than this is looked at always.
MOST_CELLS = 4096


class FootprintGrid:
    """An index of footprints."""

    def __init__(self, footprints: Iterable[Footprint]) -> None:
        self.footprints = tuple(footprints)
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._always: list[int] = []
        for number, thing in enumerate(self.footprints):
            x0, y0, x1, y1 = (math.floor(value / CELL_M) for value in thing.bounds)
            if (x1 - x0 + 1) * (y1 - y0 + 1) > MOST_CELLS:
                self._always.append(number)
                continue
            for column in range(x0, x1 + 1):
                for row in range(y0, y1 + 1):
                    self._cells.setdefault((column, row), []).append(number)
        columns, rows = [c for c, _ in self._cells], [r for _, r in self._cells]
        #: First and last column and row that hold anything.
        self._span = (min(columns), min(rows), max(columns), max(rows)) if self._cells else None

    def near(self, x0: float, y0: float, x1: float, y1: float) -> list[Footprint]:
        """Return what may reach into a rectangle, each once, in one fixed order."""
        if not self.footprints:
            return []
        found = set(self._always)
        if self._span is not None:
            cells = self._cells
            first_column, first_row, last_column, last_row = self._span
            for column in range(
                max(first_column, math.floor(x0 / CELL_M)), min(last_column, math.floor(x1 / CELL_M)) + 1
            ):
                for row in range(max(first_row, math.floor(y0 / CELL_M)), min(last_row, math.floor(y1 / CELL_M)) + 1):
                    found.update(cells.get((column, row), ()))
        return [self.footprints[number] for number in sorted(found)]

    def covers(self, x0: float, y0: float, x1: float, y1: float) -> bool:
        """Tell whether nothing lies outside a rectangle: a wider search would find no more."""
        if self._span is None:
            return True
        c0, r0, c1, r1 = (value * CELL_M for value in self._span)
        return x0 <= c0 and y0 <= r0 and x1 >= c1 + CELL_M and y1 >= r1 + CELL_M
