"""A scripted path: where a thing that moves by itself is at a given time.

The place is a function of the time alone, so a walk goes on exactly after a
restore, and no step length changes it. The thing does not look where it goes:
it walks through other things, and into the robot.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum
from itertools import accumulate, pairwise

from p2os.errors import WorldError

Point = tuple[float, float]


class Repeat(Enum):
    """What follows the last point."""

    #: It stays there.
    ONCE = "once"
    #: It goes on to the first point, round and round.
    LOOP = "loop"
    #: It goes back the same way, to and fro.
    BACK_AND_FORTH = "back-and-forth"


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A path along straight legs at one speed.

    Args:
        points_m: At least two different places, metres; the thing begins at the first.
        speed_mps: Above 0.
        start_s: How long it waits at the first point, from the reset or from its placing on.
        repeat: What it does at the last point.
    """

    points_m: tuple[Point, ...]
    speed_mps: float
    start_s: float = 0.0
    repeat: Repeat = Repeat.BACK_AND_FORTH

    def __post_init__(self) -> None:
        if len(self.points_m) < 2 or not all(math.isfinite(value) for point in self.points_m for value in point):
            raise WorldError("a path needs two points or more")
        if any(first == second for first, second in pairwise(self.points_m)):
            raise WorldError("a path must not name the same point twice in a row")
        if not 0 < self.speed_mps < math.inf or not 0 <= self.start_s < math.inf:
            raise WorldError("a path needs a speed above 0 and a start of 0 s or later")
        if self.repeat is Repeat.LOOP and self.points_m[0] == self.points_m[-1]:
            raise WorldError("a path that loops must not name its first point again at its end")

    def pose_at(self, seconds: float) -> tuple[float, float, float]:
        """Return x and y in metres and the heading of the leg in radians, so many seconds after its placing."""
        return Walker(self).pose_at(seconds)

    def round_trip(self) -> tuple[Point, ...]:
        """Return every point passed until the same begins again."""
        if self.repeat is Repeat.LOOP:
            return (*self.points_m, self.points_m[0])
        if self.repeat is Repeat.BACK_AND_FORTH:
            return (*self.points_m, *self.points_m[-2::-1])
        return self.points_m


class Walker:
    """A walk, prepared to be asked often."""

    __slots__ = ("_ends", "_headings", "_points", "_walk")

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._points = walk.round_trip()
        legs = list(pairwise(self._points))
        self._ends = tuple(accumulate(math.dist(first, second) for first, second in legs))
        self._headings = tuple(math.atan2(second[1] - first[1], second[0] - first[0]) for first, second in legs)

    def pose_at(self, seconds: float) -> tuple[float, float, float]:
        """Return x and y in metres and the heading of the leg in radians.

        Args:
            seconds: Since the thing was put there.
        """
        walk, ends = self._walk, self._ends
        gone = max(0.0, seconds - walk.start_s) * walk.speed_mps
        gone = min(gone, ends[-1]) if walk.repeat is Repeat.ONCE else gone % ends[-1]
        leg = min(bisect_right(ends, gone), len(ends) - 1)
        (ax, ay), (bx, by) = self._points[leg], self._points[leg + 1]
        begin = ends[leg - 1] if leg else 0.0
        share = (gone - begin) / (ends[leg] - begin)
        return ax + (bx - ax) * share, ay + (by - ay) * share, self._headings[leg]
