"""A lane with posts to pass on alternate sides, each pair nearer and thinner than the last."""

import random

from p2os.pioneer.world.makers.building import finished, mm, walls_around
from p2os.pioneer.world.model import Obstacle, Pose, World

POSTS = 9
HALF_WIDTH_M = 1.5
WIDEST_GAP_M, NARROWEST_GAP_M = 1.6, 1.0
THICKEST_M, THINNEST_M = 0.15, 0.02


def make(seed: int) -> World:
    """Return a slalom of nine posts; how far each stands off the middle is the seed's."""
    random_source = random.Random(seed)
    things: list[Obstacle] = []
    x = 1.0
    for number in range(POSTS):
        share = number / (POSTS - 1)
        x += WIDEST_GAP_M + (NARROWEST_GAP_M - WIDEST_GAP_M) * share
        off = random_source.uniform(0.05, 0.3) * (1 if number % 2 else -1)
        radius = mm(THICKEST_M + (THINNEST_M - THICKEST_M) * share)
        things.append(
            Obstacle(name=f"post {number + 1}", x_m=mm(x), y_m=mm(off), radius_m=radius, height_m=1.2)
        )  # fmt: skip
    around = walls_around(-1.5, -HALF_WIDTH_M, mm(x + 2.0), HALF_WIDTH_M)
    return finished(
        "slalom", f"A lane with {POSTS} posts from {2 * THICKEST_M:g} to {2 * THINNEST_M:g} m thick, ever nearer",
        Pose(0.0, 0.0, 0.0), [*around, *things],
    )  # fmt: skip
