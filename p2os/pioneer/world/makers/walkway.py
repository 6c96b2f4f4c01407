"""The ramp of the thesis in the form that its picture shows: three legs around a void.

A long leg rises between a solid wall and the void's rails; a short leg crosses at its far end, and gaps in the wall
behind it lead on to corridors; a third leg comes back beside the void, between rails, up to a wall across its head.
The form is read off the picture (figure 10). The measures are ours: it tells no slope, length or height.

The shipped world `walkway` is what `walkway(Measures())` gives.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from p2os.pioneer.world.makers.building import finished, mm, wall
from p2os.pioneer.world.model import Obstacle, ObstacleKind, Pose, World

#: chosen: a rail beside an incline is made of level pieces of this length.
RAIL_PIECE_M = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """The measures, all chosen; metres and degrees.

    Args:
        width_m: Of each leg.
        void_m: Between the long leg and the third.
        landing_m: Level floor before the first incline, and behind the second.
        long_m, third_m: Lengths of the two inclines on the ground.
        slope_deg: Of both; a Pioneer 2 climbs 5 degrees in every body.
        gap_m, corridor_m: Width of the two gaps behind the cross leg, and length of the corridors.
        slab_m: Thickness of the raised floors.
        wall_m: Height of the walls above the highest floor beside them.
        rails_m: Undersides of the two rails above the floor; the lower one is at a Pioneer's hull and sonar.
        rail_high_m, rail_thick_m: Of each rail.
    """

    width_m: float = 2.4
    void_m: float = 3.0
    landing_m: float = 2.6
    long_m: float = 6.0
    third_m: float = 4.0
    slope_deg: float = 4.0
    gap_m: float = 1.4
    corridor_m: float = 2.4
    slab_m: float = 0.2
    wall_m: float = 1.5
    rails_m: tuple[float, float] = (0.15, 0.85)
    rail_high_m: float = 0.1
    rail_thick_m: float = 0.04


def walkway(measures: Measures) -> World:
    """Return the walkway; the robot starts on the lower landing and looks up the long leg."""
    return finished(
        "walkway",
        f"The thesis's ramp: three legs around a void, {measures.slope_deg:g} degrees; measures are ours",
        Pose(0.0, 0.0, 0.0),
        _Builder(measures).things(),
    )


class _Builder:
    def __init__(self, measures: Measures) -> None:
        self._m = m = measures
        half = m.width_m / 2
        steep = math.tan(math.radians(m.slope_deg))
        #: Lower end, begin and end of the long incline, far side of the cross leg.
        self._x = (
            -m.landing_m / 2,
            m.landing_m / 2,
            m.landing_m / 2 + m.long_m,
            m.landing_m / 2 + m.long_m + m.width_m,
        )
        #: Sides of the long leg and of the third.
        self._y = (-half, half, half + m.void_m, half + m.void_m + m.width_m)
        self._middle = (0.0, half + m.void_m + half)
        #: Heights of the cross leg and of the head.
        self._cross, self._head = mm(m.long_m * steep), mm((m.long_m + m.third_m) * steep)

    def things(self) -> list[Obstacle]:
        m, (low, begin, end, far), (y0, y1, y2, y3) = self._m, self._x, self._y
        top, head = self._cross, self._head
        turn = end - m.third_m
        last = turn - m.landing_m
        return [
            self._ramp("long incline", begin, end, self._middle[0], 0.0, top, 0.0),
            self._slab("cross leg", end, y0, far, y3, top),
            self._ramp("third incline", turn, end, self._middle[1], top, head - top, 180.0),
            self._slab("head", last, y2, turn, y3, head),
            self._wall("outer wall of the long leg", (low, y0), (far, y0), 0.0, top),
            self._wall("lower end", (low, y0), (low, y1), 0.0, 0.0),
            self._wall("end of the cross leg", (end, y3), (far, y3), 0.0, top),
            self._wall("wall across the head", (last, y2), (last, y3), 0.0, head),
            *self._corridors(),
            *self._rails("rail of the long leg", low, begin, y1, 0.0, 0.0),
            *self._rails("rail of the long incline", begin, end, y1, 0.0, top),
            *self._rails("rail of the cross leg", y1, y2, end, top, top, across=True),
            *self._rails("inner rail of the third incline", turn, end, y2, head, top),
            *self._rails("outer rail of the third incline", turn, end, y3, head, top),
            *self._rails("inner rail of the head", last, turn, y2, head, head),
            *self._rails("outer rail of the head", last, turn, y3, head, head),
        ]

    def _corridors(self) -> Iterator[Obstacle]:
        """Yield the wall behind the cross leg with its gaps, and a corridor behind each gap."""
        m, far, top = self._m, self._x[3], self._cross
        end, edge = far + m.corridor_m, self._y[0]
        for number, middle in enumerate(self._middle, start=1):
            near, beyond = middle - m.gap_m / 2, middle + m.gap_m / 2
            yield self._wall(f"wall before gap {number}", (far, edge), (far, near), 0.0, top)
            yield self._slab(f"corridor {number}", far, near, end, beyond, top)
            yield self._wall(f"corridor {number}, right", (far, near), (end, near), 0.0, top)
            yield self._wall(f"corridor {number}, left", (far, beyond), (end, beyond), 0.0, top)
            yield self._wall(f"corridor {number}, end", (end, near), (end, beyond), 0.0, top)
            edge = beyond
        yield self._wall("wall behind the gaps", (far, edge), (far, self._y[3]), 0.0, top)

    def _ramp(self, name: str, x0: float, x1: float, y: float, base: float, rise: float, heading: float) -> Obstacle:
        return Obstacle(
            name=name, x_m=mm((x0 + x1) / 2), y_m=mm(y), heading_rad=math.radians(heading), length_m=mm(x1 - x0),
            width_m=self._m.width_m, height_m=mm(rise), base_m=base, kind=ObstacleKind.RAMP,
        )  # fmt: skip

    def _slab(self, name: str, x0: float, y0: float, x1: float, y1: float, top: float) -> Obstacle:
        return Obstacle(
            name=name, x_m=mm((x0 + x1) / 2), y_m=mm((y0 + y1) / 2), length_m=mm(x1 - x0), width_m=mm(y1 - y0),
            height_m=self._m.slab_m, base_m=mm(top - self._m.slab_m), kind=ObstacleKind.FLOOR,
        )  # fmt: skip

    def _wall(self, name: str, a: tuple[float, float], b: tuple[float, float], base: float, top: float) -> Obstacle:
        """Return a wall from the ground up, a full thickness longer than its middle line."""
        made = wall(name, *a, *b, height_m=mm(top + self._m.wall_m))
        return replace(made, base_m=base, fixed=True)

    def _rails(
        self, name: str, a: float, b: float, side: float, first: float, last: float, *, across: bool = False
    ) -> Iterator[Obstacle]:
        """Yield two rails from a to b over a floor that rises from `first` to `last`; along x, or across it."""
        m, count = self._m, 1 if first == last else max(1, round((b - a) / RAIL_PIECE_M))
        for number in range(count):
            along, floor = a + (b - a) * (number + 0.5) / count, mm(first + (last - first) * (number + 0.5) / count)
            x, y = (side, along) if across else (along, side)
            for which, underside in zip(("lower", "upper"), m.rails_m, strict=True):
                yield Obstacle(
                    name=f"{name}, {which} {number + 1}", x_m=mm(x), y_m=mm(y),
                    heading_rad=math.radians(90.0) if across else 0.0, length_m=mm((b - a) / count),
                    width_m=m.rail_thick_m, base_m=mm(floor + underside), height_m=m.rail_high_m, floor_m=floor,
                    kind=ObstacleKind.RAIL, fixed=True,
                )  # fmt: skip
