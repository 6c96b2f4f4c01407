"""An office floor: a corridor, rooms with desks on legs on both sides, chairs, and people who walk.

A desk's top is above hull and sonar, so that only its legs are in the way: the
classic trap for a robot with a ring of sonar.
"""

import random

from p2os.pioneer.world.makers.building import WALL_M, box, finished, mm, wall, walls_around
from p2os.pioneer.world.model import Obstacle, Pose, Walk, World

ROOMS = 3
ROOM_M, DEPTH_M, CORRIDOR_M, DOOR_M = 4.0, 4.0, 2.0, 0.9
LEG_M, TOP_M, TOP_THICK_M = 0.05, 0.72, 0.03
CHAIR_KG, CHAIR_FRICTION = 4.0, 0.2


def make(seed: int) -> World:
    """Return a floor of six rooms along a corridor; desks, doors and chairs are where the seed wants."""
    random_source = random.Random(seed)
    length, half = ROOMS * ROOM_M, CORRIDOR_M / 2
    # The corridor's middle line is y = 0; the robot starts at its western end.
    x0 = -1.0
    things = walls_around(x0, -half - DEPTH_M, x0 + length, half + DEPTH_M)
    for side, sign in (("north", 1), ("south", -1)):
        doors = [mm(x0 + ROOM_M * room + random_source.uniform(0.8, ROOM_M - 0.8)) for room in range(ROOMS)]
        things += _front(side, x0, length, sign * half, doors)
        for room in range(1, ROOMS):
            x = x0 + ROOM_M * room
            things.append(wall(f"{side} partition {room}", x, sign * half, x, sign * (half + DEPTH_M)))
        for room in range(ROOMS):
            things += _furniture(random_source, f"{side} {room + 1}", x0 + ROOM_M * room, sign)
    things.append(
        Obstacle(
            name="visitor",
            x_m=mm(x0 + length - 1),
            y_m=0.6,
            radius_m=0.2,
            height_m=1.7,
            walk=Walk(points_m=((mm(x0 + length - 1), 0.6), (mm(x0 + 1), 0.6)), speed_mps=0.8, start_s=2.0),
        )
    )
    return finished(
        "office", "Six rooms along a corridor: desks on legs, chairs that can be pushed, a visitor who walks",
        Pose(0.0, 0.0, 0.0), things,
    )  # fmt: skip


def _front(side: str, x0: float, length: float, y: float, doors: list[float]) -> list[Obstacle]:
    """Return the corridor's wall on one side, with a gap at each door."""
    edges = [x0, *(mm(door + sign * (DOOR_M + WALL_M) / 2) for door in doors for sign in (-1, 1)), x0 + length]
    return [
        wall(f"{side} front {piece + 1}", edges[2 * piece], y, edges[2 * piece + 1], y)
        for piece in range(len(doors) + 1)
    ]


def _furniture(random_source: random.Random, name: str, x0: float, sign: int) -> list[Obstacle]:
    """Return a desk, its chair and a shelf; a metre behind the front stays free."""
    x = mm(x0 + random_source.uniform(1.2, ROOM_M - 1.2))
    y = mm(sign * (CORRIDOR_M / 2 + DEPTH_M - random_source.uniform(0.6, 1.0)))
    length, width = 1.6, 0.8
    legs = [
        box(
            f"{name} desk leg {number}",
            x + dx * (length / 2 - LEG_M),
            y + dy * (width / 2 - LEG_M),
            LEG_M,
            LEG_M,
            TOP_M,
        )
        for number, (dx, dy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1)), start=1)
    ]
    top = Obstacle(
        name=f"{name} desk top", x_m=x, y_m=y, length_m=length, width_m=width, base_m=TOP_M, height_m=TOP_THICK_M
    )
    chair = Obstacle(
        name=f"{name} chair", x_m=mm(x + random_source.uniform(-0.4, 0.4)), y_m=mm(y - sign * 0.75), radius_m=0.22,
        height_m=0.45, mass_kg=CHAIR_KG, friction=CHAIR_FRICTION,
    )  # fmt: skip
    at_west = random_source.random() < 0.5
    shelf = box(
        f"{name} shelf", x0 + (0.25 if at_west else ROOM_M - 0.25), mm(sign * (CORRIDOR_M / 2 + 2.0)), 0.3, 1.0, 1.8
    )
    return [*legs, top, chair, shelf]
