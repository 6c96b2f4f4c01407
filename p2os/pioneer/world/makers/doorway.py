"""Rooms in a row, each door narrower than the last, the last one with a sill."""

import random

from p2os.pioneer.world.makers.building import WALL_M, box, finished, mm, wall, walls_around
from p2os.pioneer.world.model import Pose, World

DOORS_M = (1.2, 0.9, 0.7, 0.55)
ROOM_M, WIDTH_M = 2.5, 4.0
#: chosen: a strip that wheels of 165 mm climb.
SILL_M = 0.012


def make(seed: int) -> World:
    """Return a row of five rooms; where the doors are in their walls is the seed's."""
    random_source = random.Random(seed)
    half, x0 = WIDTH_M / 2, -ROOM_M / 2
    things = walls_around(x0, -half, x0 + ROOM_M * (len(DOORS_M) + 1), half)
    for number, width in enumerate(DOORS_M, start=1):
        x = x0 + ROOM_M * number
        y = mm(random_source.uniform(-half + width, half - width))
        gap = (width + WALL_M) / 2
        things.append(wall(f"wall {number} right of the door", x, -half, x, mm(y - gap)))
        things.append(wall(f"wall {number} left of the door", x, mm(y + gap), x, half))
    sill = box("sill of the last door", x, y, 0.06, DOORS_M[-1], SILL_M)
    widths = ", ".join(f"{width:g}" for width in DOORS_M)
    return finished(
        "doorway", f"Five rooms in a row with doors {widths} m wide, the last with a sill of {SILL_M * 1e3:g} mm",
        Pose(0.0, 0.0, 0.0), [*things, sill],
    )  # fmt: skip
