"""The plan of a world that changes: what stands where, by name.

Both bodies keep one: it answers what is nearest to the hull, and it refuses what
cannot be (a second obstacle of the same name, moving one that is not there).
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from difflib import get_close_matches
from operator import itemgetter

from p2os.errors import WorldError
from p2os.parameters import BodyParameters
from p2os.pioneer.geometry import INFINITY, Footprint, hull_polygon, placed
from p2os.pioneer.scenery import Obstacle


class Plan:
    """Obstacles by name, cut where they could touch the hull."""

    def __init__(self, obstacles: Iterable[Obstacle], body: BodyParameters) -> None:
        self._low_m, self._high_m = body.ground_clearance_m, body.hull_height_m
        self._hull = hull_polygon(body)
        self._hull_reach = max(math.hypot(x, y) for x, y in self._hull)
        self._obstacles: dict[str, Obstacle] = {}
        self._touchable: dict[str, Footprint] = {}
        for obstacle in obstacles:
            self.place(obstacle)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """All that stands there now, in the order of its placing."""
        return tuple(self._obstacles.values())

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the plan.

        Raises:
            WorldError: The name is taken.
        """
        if obstacle.name in self._obstacles:
            raise WorldError(f"there is an obstacle {obstacle.name!r} already", hint="names are unique in a world")
        self._keep(obstacle)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
        """Put an obstacle somewhere else; return it as it stands now.

        Raises:
            WorldError: There is none of that name.
        """
        moved = replace(self._find(name), x_m=x_m, y_m=y_m, heading_rad=heading_rad)
        self._keep(moved)
        return moved

    def remove(self, name: str) -> None:
        """Take an obstacle out.

        Raises:
            WorldError: There is none of that name.
        """
        self._find(name)
        del self._obstacles[name]
        self._touchable.pop(name, None)

    def clearance(self, x_m: float, y_m: float, heading_rad: float, *, no_more_than: float = INFINITY) -> float:
        """Return the distance from the hull at a pose to the nearest thing that it could touch.

        Args:
            x_m: Where the middle of the axle is.
            y_m: The same.
            heading_rad: Where it looks.
            no_more_than: Things farther than this need not be measured; the answer is then at most this.
        """
        hull = placed(self._hull, x_m, y_m, heading_rad)
        nearest = no_more_than
        # No point of the hull is farther from the axle than its reach: the likely nearest first, then stop.
        things = list(self._touchable.values())
        bounds = [thing.distance_to_point(x_m, y_m) - self._hull_reach for thing in things]
        for bound, thing in sorted(zip(bounds, things, strict=True), key=itemgetter(0)):
            if bound >= nearest:
                break
            nearest = min(nearest, thing.distance(hull))
        return nearest

    def _find(self, name: str) -> Obstacle:
        if name not in self._obstacles:
            close = get_close_matches(name, self._obstacles, n=1)
            raise WorldError(f"no obstacle {name!r}", hint=f"did you mean {close[0]!r}?" if close else None)
        return self._obstacles[name]

    def _keep(self, obstacle: Obstacle) -> None:
        self._obstacles[obstacle.name] = obstacle
        if obstacle.stands_in(self._low_m, self._high_m):
            self._touchable[obstacle.name] = Footprint(obstacle)
