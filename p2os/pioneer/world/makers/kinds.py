"""The kinds of world that can be made from a seed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from p2os.pioneer.world.makers import arena as arena_maker
from p2os.pioneer.world.makers import doorway, maze, office, slalom
from p2os.pioneer.world.model import Pose, World
from simbase.errors import UsageError

#: The floor's edge lies so far outside the arena's walls.
_ARENA_HALF_M = arena_maker.SIDE_M / 2 + 0.2


def _arena(seed: int) -> World:
    start = Pose(0.0, 0.0, 0.0)
    things = arena_maker.arena(seed, start)
    return World(
        name="arena",
        source="arena",
        description="8 x 8 m with boxes and cylinders 0.08 to 0.6 m wide, gaps of 0.9 m or more",
        start=start,
        extent=(-_ARENA_HALF_M, -_ARENA_HALF_M, _ARENA_HALF_M, _ARENA_HALF_M),
        # A heading in whole tenths of a degree is written and read without loss.
        obstacles=tuple(
            replace(item, heading_rad=math.radians(round(math.degrees(item.heading_rad), 1))) for item in things
        ),
    )


KINDS: Mapping[str, Callable[[int], World]] = {
    "arena": _arena,
    "doorway": doorway.make,
    "maze": maze.make,
    "office": office.make,
    "slalom": slalom.make,
}


def make_world(kind: str, seed: int) -> World:
    """Return the world of a kind and a seed; the same on every machine.

    Raises:
        UsageError: There is no such kind.
    """
    if kind not in KINDS:
        raise UsageError(f"no kind of world {kind!r}", hint=f"kinds: {', '.join(KINDS)}")
    world = KINDS[kind](seed)
    return replace(world, description=f"{world.description} (seed {seed})")
