"""A grid of taken and free cells as few rectangles."""

import re
from collections.abc import Iterable
from itertools import chain

#: First column, first row, columns, rows; rows count from the top.
Rectangle = tuple[int, int, int, int]
_RUN = re.compile(rb"\x01+")


def rectangles(rows: Iterable[bytes]) -> list[Rectangle]:
    """Return rectangles that cover just the cells that are 1.

    Runs of equal ends in rows that follow each other are one rectangle: walls
    along the axes, filled areas and single cells come out as few.

    Args:
        rows: The top row first, one byte a cell, 0 or 1.
    """
    done: list[Rectangle] = []
    growing: dict[tuple[int, int], int] = {}
    for number, row in enumerate(chain(rows, (b"",))):  # the last one, which is empty, ends what grows
        runs = {match.span() for match in _RUN.finditer(row)}
        for span in [span for span in growing if span not in runs]:
            first = growing.pop(span)
            done.append((span[0], first, span[1] - span[0], number - first))
        for span in sorted(runs):
            growing.setdefault(span, number)
    return sorted(done, key=lambda r: (r[1], r[0]))
