"""Turns and moves in space, as 3 x 4 matrices: rows of (x, y, z, offset)."""

import math
from collections.abc import Iterable

from p2os.pioneer.world.model import Vertex

Row = tuple[float, float, float, float]
Transform = tuple[Row, Row, Row]

IDENTITY: Transform = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


def after(outer: Transform, inner: Transform) -> Transform:
    """Return the transform that applies `inner` first."""
    rows = []
    for row in outer:
        values = [sum(row[k] * inner[k][column] for k in range(3)) for column in range(4)]
        rows.append((values[0], values[1], values[2], values[3] + row[3]))
    return rows[0], rows[1], rows[2]


def apply(transform: Transform, points: Iterable[Vertex]) -> list[Vertex]:
    """Return points moved."""
    (a, b, c, u), (d, e, f, v), (g, h, i, w) = transform
    return [(a * x + b * y + c * z + u, d * x + e * y + f * z + v, g * x + h * y + i * z + w) for x, y, z in points]


def moved(x: float, y: float, z: float) -> Transform:
    """Return a move."""
    return (1.0, 0.0, 0.0, x), (0.0, 1.0, 0.0, y), (0.0, 0.0, 1.0, z)


def scaled(x: float, y: float, z: float) -> Transform:
    """Return a scale along the axes."""
    return (x, 0.0, 0.0, 0.0), (0.0, y, 0.0, 0.0), (0.0, 0.0, z, 0.0)


def from_roll_pitch_yaw(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Transform:
    """Return a pose as SDF and URDF write it: about fixed x, then y, then z; metres and radians."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y),
        (-sp, cp * sr, cp * cr, z),
    )


def about_axis(x: float, y: float, z: float, angle_rad: float) -> Transform:
    """Return a turn about an axis through the origin; no turn about an axis without length."""
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0:
        return IDENTITY
    x, y, z = x / length, y / length, z / length
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    t = 1 - c
    return (
        (t * x * x + c, t * x * y - s * z, t * x * z + s * y, 0.0),
        (t * x * y + s * z, t * y * y + c, t * y * z - s * x, 0.0),
        (t * x * z - s * y, t * y * z + s * x, t * z * z + c, 0.0),
    )


def upright_heading(transform: Transform) -> float | None:
    """Return the heading of a transform that only turns about Z, or None where it tilts or scales."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _) = transform
    flat = max(abs(c), abs(f), abs(g), abs(h), abs(i - 1.0)) < 1e-9
    return (
        math.atan2(d, a) if flat and abs(a - e) < 1e-9 and abs(b + d) < 1e-9 and abs(a * a + d * d - 1) < 1e-9 else None
    )
