"""An arena from a seed: a walled square with boxes and cylinders in it.

The same seed gives the same arena on every machine: only the 53-bit random
numbers of Python's Mersenne Twister and sums of them decide, and every place is
rounded to whole millimetres.
"""

import math
import random

from p2os.pioneer.world.makers.building import WALL_M, walls_around
from p2os.pioneer.world.model import Obstacle, Pose

SIDE_M = 8.0
#: How many things stand in it.
LEAST_OBSTACLES, MOST_OBSTACLES = 16, 18
#: Widths of the things.
NARROWEST_M, WIDEST_M = 0.08, 0.60
#: Free width between any two things, and from a thing to a wall.
#: 0.9 m and 2 mm to spare, so that no rounding eats into it.
GAP_M = 0.902
#: Free radius about the start.
START_FREE_M = 1.0
#: Tries to place one thing before the whole layout is begun anew.
TRIES = 400


def arena(seed: int, start: Pose) -> list[Obstacle]:
    """Return the walls and things of the arena with this seed."""
    random_source = random.Random(seed)
    while True:
        things = _layout(random_source, start)
        if len(things) >= LEAST_OBSTACLES:
            half = (SIDE_M + WALL_M) / 2
            return [*walls_around(-half, -half, half, half), *things]


def _layout(random_source: random.Random, start: Pose) -> list[Obstacle]:
    """Place things one by one, each as far from the others as the gap wants; fewer where no room is left."""
    things: list[Obstacle] = []
    wanted = random_source.randint(LEAST_OBSTACLES, MOST_OBSTACLES)
    for number in range(wanted):
        # The first half of the tries takes any width, the second only small things, so that a layout fills up.
        for attempt in range(TRIES):
            widest = WIDEST_M if attempt < TRIES // 2 else 0.2
            thing = _thing(random_source, number, widest)
            if _fits(thing, things, start):
                things.append(thing)
                break
    return things


def _thing(random_source: random.Random, number: int, widest_m: float) -> Obstacle:
    limit = SIDE_M / 2 - GAP_M
    x, y = (round(random_source.uniform(-limit, limit), 3) for _ in range(2))
    length, width = (round(random_source.uniform(NARROWEST_M, widest_m), 3) for _ in range(2))
    height = round(random_source.uniform(0.3, 0.8), 3)
    name = f"thing {number + 1}"
    if random_source.random() < 0.5:
        return Obstacle(name=name, x_m=x, y_m=y, radius_m=length / 2, height_m=height)
    heading = round(random_source.uniform(-math.pi, math.pi), 3)
    return Obstacle(name=name, x_m=x, y_m=y, heading_rad=heading, length_m=length, width_m=width, height_m=height)


def _fits(thing: Obstacle, others: list[Obstacle], start: Pose) -> bool:
    """Tell whether the circle around a thing keeps every gap; the gaps of the things themselves are wider."""
    reach, limit = thing.reach_m, SIDE_M / 2 - GAP_M - thing.reach_m
    if abs(thing.x_m) > limit or abs(thing.y_m) > limit:
        return False
    if math.hypot(thing.x_m - start.x_m, thing.y_m - start.y_m) < START_FREE_M + reach:
        return False
    return all(
        math.hypot(thing.x_m - other.x_m, thing.y_m - other.y_m) >= GAP_M + reach + other.reach_m for other in others
    )
