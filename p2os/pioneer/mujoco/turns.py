"""Quaternions as MuJoCo writes them: w, x, y, z."""

import math
from collections.abc import Sequence

Quaternion = tuple[float, float, float, float]


def quaternion(heading_rad: float, slope_rad: float = 0.0) -> Quaternion:
    """Return the turn of a thing whose length rises by a slope and then looks along a heading."""
    ch, sh = math.cos(heading_rad / 2), math.sin(heading_rad / 2)
    cs, ss = math.cos(slope_rad / 2), math.sin(slope_rad / 2)
    return ch * cs, sh * ss, -ch * ss, sh * cs


def matrix(turn: Sequence[float]) -> tuple[float, ...]:
    """Return the same turn as nine numbers, row by row."""
    w, x, y, z = turn
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
