"""The plan of a world that changes: what stands where, by name.

Both bodies keep one: it answers what is nearest to the hull and what the sonar
can hear, and it refuses what cannot be (a second obstacle of the same name,
moving one that is not there or that is part of the building).
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from difflib import get_close_matches
from operator import itemgetter

from p2os.errors import WorldError
from p2os.parameters import RobotParameters
from p2os.pioneer.geometry import INFINITY, Footprint, Polygon, hull_polygon, placed, wheel_polygons
from p2os.pioneer.scenery import Obstacle, World
from p2os.pioneer.static_plan import Bands, StaticPlan

#: The first ring of a search for the nearest wall beyond the hull; it is doubled until something is found, m.
FIRST_RING_M = 2.0
#: chosen: as many names as a line of help holds.
NAMED = 12
#: How far a pushed thing is kept from what pushes it, m.
APART_M = 1e-6


class Plan:
    """Obstacles by name, cut where they could touch the hull."""

    def __init__(self, obstacles: Iterable[Obstacle], parameters: RobotParameters, static: StaticPlan) -> None:
        body = parameters.body
        self._bands = Bands(parameters)
        self._static = static
        self._hull = hull_polygon(body)
        self._wheels = wheel_polygons(parameters)
        self._hull_reach = max(math.hypot(x, y) for x, y in self._hull)
        self._obstacles: dict[str, Obstacle] = {}
        self._touchable: dict[str, Footprint] = {}
        self._heard: dict[str, Footprint] = {}
        self._low: dict[str, Footprint] = {}
        for obstacle in obstacles:
            self.place(obstacle)

    @classmethod
    def of_world(cls, world: World, parameters: RobotParameters) -> "Plan":
        """Return the plan of a world as it was made."""
        movable = (item for item in world.obstacles if not item.fixed)
        return cls(movable, parameters, StaticPlan(world, parameters))

    @property
    def hull_reach_m(self) -> float:
        """How far the hull's farthest point is from the middle of the axle."""
        return self._hull_reach

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All that is not part of the building, in the order of its placing."""
        return tuple(self._obstacles.values())

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the plan.

        Raises:
            WorldError: The name is taken.
        """
        if obstacle.name in self._obstacles or obstacle.name in self._static.names:
            raise WorldError(f"there is an obstacle {obstacle.name!r} already", hint="names are unique in a world")
        self._keep(obstacle)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
        """Put an obstacle somewhere else; return it as it stands now.

        Raises:
            WorldError: There is none of that name, or it is part of the building.
        """
        moved = replace(self.find(name), x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        self._keep(moved)
        return moved

    def remove(self, name: str) -> None:
        """Take an obstacle out.

        Raises:
            WorldError: There is none of that name, or it is part of the building.
        """
        self.find(name)
        for table in (self._obstacles, self._touchable, self._heard, self._low):
            table.pop(name, None)

    def find(self, name: str) -> Obstacle:
        """Return an obstacle that is not part of the building.

        Raises:
            WorldError: There is none of that name.
        """
        if name in self._static.names:
            raise WorldError(
                f"{name!r} is part of the building", hint="only what is not `fixed` and no mesh can change"
            )
        if name not in self._obstacles:
            close = get_close_matches(name, self._obstacles, n=1)
            there = ", ".join(list(self._obstacles)[:NAMED]) or "nothing that can change"
            hint = f"did you mean {close[0]!r}?" if close else f"there is {there}"
            raise WorldError(f"no obstacle {name!r}", hint=hint)
        return self._obstacles[name]

    def clearance(self, x_m: float, y_m: float, heading_rad: float, *, no_more_than: float = INFINITY) -> float:
        """Return the distance from the hull, or the wheels, at a pose to the nearest thing that they could touch.

        Args:
            x_m: Where the middle of the axle is.
            y_m: The same.
            heading_rad: Where it looks.
            no_more_than: Things farther than this need not be measured; the answer is then at most this.
        """
        hull = placed(self._hull, x_m, y_m, heading_rad)
        nearest = self._nearest(self._touchable.values(), hull, x_m, y_m, no_more_than)
        ring, static = FIRST_RING_M, self._static.touched
        while static.footprints:
            reach = min(ring, nearest) + self._hull_reach
            box = (x_m - reach, y_m - reach, x_m + reach, y_m + reach)
            found = self._nearest(static.near(*box), hull, x_m, y_m, nearest)
            if found <= ring or ring >= nearest or static.covers(*box):
                nearest = min(nearest, found)
                break
            ring *= 2
        if self._low or self._static.low.footprints:
            reach = self._hull_reach + FIRST_RING_M
            low = [*self._low.values(), *self._static.low.near(x_m - reach, y_m - reach, x_m + reach, y_m + reach)]
            for wheel in self._wheels:
                nearest = self._nearest(low, placed(wheel, x_m, y_m, heading_rad), x_m, y_m, nearest)
        return nearest

    def heard_within(self, x0: float, y0: float, x1: float, y1: float) -> Sequence[Footprint]:
        """Return what the sonar could hear in a rectangle, and perhaps some more."""
        movable = self._heard.values()
        return [*movable, *self._static.heard.near(x0, y0, x1, y1)] if self._static.heard.footprints else [*movable]

    def touched(self, x_m: float, y_m: float, heading_rad: float) -> list[str]:
        """Return the names of the things that the hull overlaps at a pose; of the building, one name is enough."""
        hull = placed(self._hull, x_m, y_m, heading_rad)
        reach = self._hull_reach
        near = [thing for thing in self._touchable.values() if thing.distance_to_point(x_m, y_m) <= reach]
        names = [thing.name for thing in near if thing.distance(hull) == 0.0]
        walls = self._static.touched.near(x_m - reach, y_m - reach, x_m + reach, y_m + reach)
        names += [wall.name for wall in walls if wall.distance(hull) == 0.0][:1]
        if not names:  # the wheels alone
            names.append("")
        return names

    def push(self, name: str, x_m: float, y_m: float, heading_rad: float, robots: Iterable[Footprint] = ()) -> bool:
        """Push a thing out of the hull at a pose, the shortest way; tell whether there is room for it.

        The thing slides and does not turn. It finds no room where one of the other robots stands.
        """
        thing = self._touchable[name]
        dx, dy = thing.way_out(placed(self._hull, x_m, y_m, heading_rad))
        length = math.hypot(dx, dy)
        if length == 0.0:
            return True
        share = 1 + APART_M / length
        moved = replace(self._obstacles[name], x_m=thing.x + dx * share, y_m=thing.y + dy * share)
        shape = Footprint(moved)
        x0, y0, x1, y1 = shape.bounds
        others = [other for other in self._touchable.values() if other.name != name]
        if any(_overlap(shape, other) for other in (*others, *robots, *self._static.touched.near(x0, y0, x1, y1))):
            return False
        self._keep(moved)
        return True

    def _nearest(self, things: Iterable[Footprint], hull: Polygon, x_m: float, y_m: float, nearest: float) -> float:
        """Return the least distance from a hull about (x, y) to some things, or `nearest` where that is less."""
        # No point of the hull is farther from the axle than its reach: the likely nearest first, then stop.
        looked_at = list(things)
        bounds = [thing.distance_to_point(x_m, y_m) - self._hull_reach for thing in looked_at]
        for bound, thing in sorted(zip(bounds, looked_at, strict=True), key=itemgetter(0)):
            if bound >= nearest:
                break
            nearest = min(nearest, thing.distance(hull))
        return nearest

    def _keep(self, obstacle: Obstacle) -> None:
        name, bands = obstacle.name, self._bands
        self._obstacles[name] = obstacle
        touched, heard, low = bands.is_touched(obstacle), bands.echoes(obstacle), bands.stops_wheels(obstacle)
        if touched or heard or low:
            shape = Footprint(obstacle)
            for table, belongs in ((self._touchable, touched), (self._heard, heard), (self._low, low)):
                if belongs:
                    table[name] = shape


def _overlap(one: Footprint, other: Footprint) -> bool:
    """Tell whether two footprints overlap."""
    if math.dist((one.x, one.y), (other.x, other.y)) > one.reach + other.reach:
        return False
    if one.polygon:
        return other.distance(one.polygon) == 0.0
    if other.polygon:
        return one.distance(other.polygon) == 0.0
    return math.dist((one.x, one.y), (other.x, other.y)) < one.radius + other.radius
