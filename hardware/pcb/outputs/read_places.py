"""Where the things of a board's file stand, for who reads one: points, angles, and a footprint's points on the board.

The writer turns by `layout/routing.py`. What judges its files must not: a sign that is wrong there would be wrong here.
"""

import math

from hardware.pcb.outputs.sexp import Node, word

Point = tuple[float, float]


def point(node: Node) -> Point:
    """Return the two numbers of `(at x y ...)`, `(start x y)`, `(size w h)` and the like, millimetres.

    Raises:
        SexpError: A number is missing.
    """
    return float(word(node, 1)), float(word(node, 2))


def angle(at: Node) -> float:
    """Return the angle of `(at x y angle)` in degrees; none is 0."""
    return float(word(at, 3)) if len(at) > 3 else 0.0


def turned(own: Point, at: Point, angle_deg: float) -> Point:
    """Return a footprint's point on the board; KiCad turns to the left, and y points down."""
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    x, y = own
    return round(at[0] + x * cos + y * sin, 4), round(at[1] - x * sin + y * cos, 4)
