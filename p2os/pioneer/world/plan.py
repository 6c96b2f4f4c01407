"""The plan of a world that changes: what stands where, by name.

Each body keeps a `Plan`: it answers what is nearest to the hull and what the sonar
may meet, and it refuses what cannot be (a second obstacle of the same name, moving
one that is not there or that is part of the building). It moves nothing by itself.

Three parts: `Bands` decides by heights what hull, wheels and sonar meet of a thing;
`StaticPlan` holds all that never moves (fixed obstacles, and meshes cut once);
`FootprintGrid` finds footprints by their place, since a map has thousands of walls
and a question concerns a few square metres.

Invariant: the order of what is found depends on the world alone.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import pairwise
from operator import itemgetter

from p2os.errors import WorldError
from p2os.pioneer.world.geometry import INFINITY, Footprint, hull_polygon, placed, wheel_polygons
from p2os.pioneer.world.model import Mesh, Obstacle, Point, Polygon, World, cut, shadow
from p2os.robots.parameters import RobotParameters
from simbase.errors import nearest
from simbase.state import Stateful

#: The first ring of a search for the nearest wall beyond the hull; it is doubled until something is found, m.
FIRST_RING_M = 2.0
#: chosen: as many names as a line of help holds.
NAMED = 12
#: A thing farther than this from where the robot touches something is not what it touches, m.
TOUCHED_WITHIN_M = 0.1
#: How finely the hull's outline is looked along for the place of a contact, m.
OUTLINE_STEP_M = 0.01
#: How far a pushed thing is kept from what pushes it, m.
APART_M = 1e-6
#: chosen: wheels of 165 mm roll over what is lower, and a robot's maker calls it a sill.
SILL_M = 0.02
#: chosen: a sonar's cone touches some twenty cells.
CELL_M = 1.0
#: A footprint that would fill more cells than this is looked at always.
MOST_CELLS = 4096


class Plan(Stateful):
    """Obstacles by name, cut where they could touch the hull."""

    STATE = ("_obstacles",)
    DERIVED = ("_touchable", "_echoing", "_low")

    def __init__(self, obstacles: Iterable[Obstacle], parameters: RobotParameters, static: "StaticPlan") -> None:
        body = parameters.body
        self._bands = Bands(parameters)
        self._static = static
        self._hull = hull_polygon(body)
        self._wheels = wheel_polygons(parameters)
        self._hull_reach = max(math.hypot(x, y) for x, y in self._hull)
        self._obstacles: dict[str, Obstacle] = {}
        self._restored()
        for obstacle in obstacles:
            self.place(obstacle)

    def _restored(self) -> None:
        self._touchable: dict[str, Footprint] = {}
        self._echoing: dict[str, Footprint] = {}
        self._low: dict[str, Footprint] = {}
        for obstacle in self._obstacles.values():
            self._keep(obstacle)

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

    def pushable(self, world: World) -> list[Obstacle]:
        """Return what of a world can be pushed and has not been taken out since, where the world has it."""
        there = self._obstacles
        return [item for item in world.obstacles if item.name in there and there[item.name].mass_kg > 0]

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
        moved = self.find(name).standing_at(x_m, y_m, heading_rad)
        self._keep_moved(moved, Footprint(moved))
        return moved

    def remove(self, name: str) -> None:
        """Take an obstacle out.

        Raises:
            WorldError: There is none of that name, or it is part of the building.
        """
        self.find(name)
        for table in (self._obstacles, self._touchable, self._echoing, self._low):
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
            there = ", ".join(list(self._obstacles)[:NAMED]) or "nothing that can change"
            raise WorldError(f"no obstacle {name!r}", hint=nearest(name, self._obstacles, f"there is {there}"))
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

    def echoing_within(self, x0: float, y0: float, x1: float, y1: float) -> Sequence[Footprint]:
        """Return what may echo the sonar in a rectangle, and perhaps some more."""
        return [*self._echoing.values(), *self._static.echoing.near(x0, y0, x1, y1)]

    @property
    def all_echoing(self) -> Collection[Footprint] | None:
        """What may echo the sonar anywhere, where it is not worth looking at less; None where the building may."""
        return None if self._static.echoing.footprints else self._echoing.values()

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

    def thing_at(self, x_m: float, y_m: float) -> str:
        """Return the name of what stands at a point where the robot touches something; empty where nothing does."""
        reach = TOUCHED_WITHIN_M
        near = self._meetable(x_m - reach, y_m - reach, x_m + reach, y_m + reach)
        found = min(((thing.distance_to_point(x_m, y_m), thing.name) for thing in near), default=(INFINITY, ""))
        return found[1] if found[0] <= reach else ""

    def contact(
        self, x_m: float, y_m: float, heading_rad: float, robots: Iterable[Footprint] = ()
    ) -> tuple[str, float, float]:
        """Return the name of what is nearest to the robot at a pose, and the point of its outline nearest to that."""
        reach = self._hull_reach + TOUCHED_WITHIN_M
        hull = placed(self._hull, x_m, y_m, heading_rad)
        things = [(thing, hull) for thing in (*self._touchable.values(), *robots)]
        box = (x_m - reach, y_m - reach, x_m + reach, y_m + reach)
        things += [(thing, hull) for thing in self._static.touched.near(*box)]
        for wheel in self._wheels:
            outline = placed(wheel, x_m, y_m, heading_rad)
            things += [(thing, outline) for thing in (*self._low.values(), *self._static.low.near(*box))]
        if not things:
            return "", x_m, y_m
        thing, outline = min(things, key=lambda pair: pair[0].distance(pair[1]))
        if thing.distance(outline) > TOUCHED_WITHIN_M:
            return "", x_m, y_m
        x, y = min(_along(outline), key=lambda point: thing.distance_to_point(*point))
        return thing.name, x, y

    def _meetable(self, x0: float, y0: float, x1: float, y1: float) -> list[Footprint]:
        """Return what hull or wheels could meet in a rectangle, and perhaps some more."""
        static = self._static
        return [
            *self._touchable.values(), *static.touched.near(x0, y0, x1, y1),
            *self._low.values(), *static.low.near(x0, y0, x1, y1),
        ]  # fmt: skip

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
        there = self._obstacles[name]
        moved = there.standing_at(thing.x + dx * share, thing.y + dy * share, there.heading_rad)
        shape = Footprint(moved)
        x0, y0, x1, y1 = shape.bounds
        others = [other for other in self._touchable.values() if other.name != name]
        if any(_overlap(shape, other) for other in (*others, *robots, *self._static.touched.near(x0, y0, x1, y1))):
            return False
        self._keep_moved(moved, shape)
        return True

    def _nearest(self, things: Iterable[Footprint], hull: Polygon, x_m: float, y_m: float, nearest: float) -> float:
        """Return the least distance from a hull about (x, y) to some things, or `nearest` where that is less."""
        # No point of the hull is farther from the axle than its reach: the likely nearest first, then stop.
        reach, hypot = self._hull_reach, math.hypot
        looked_at = [
            (thing.distance_to_point(x_m, y_m) - reach, thing)
            for thing in things
            if hypot(thing.x - x_m, thing.y - y_m) - thing.reach - reach < nearest  # of the circle around it: cheaper
        ]
        for bound, thing in sorted(looked_at, key=itemgetter(0)):
            if bound >= nearest:
                break
            nearest = min(nearest, thing.distance(hull))
        return nearest

    def _keep(self, obstacle: Obstacle) -> None:
        name, bands = obstacle.name, self._bands
        self._obstacles[name] = obstacle
        touched, echoing, low = bands.is_touched(obstacle), bands.echoes(obstacle), bands.stops_wheels(obstacle)
        if touched or echoing or low:
            shape = Footprint(obstacle)
            for table, belongs in ((self._touchable, touched), (self._echoing, echoing), (self._low, low)):
                if belongs:
                    table[name] = shape

    def _keep_moved(self, obstacle: Obstacle, shape: Footprint) -> None:
        """Keep what only stands elsewhere: who meets it depends on its heights."""
        self._obstacles[obstacle.name] = obstacle
        for table in (self._touchable, self._echoing, self._low):
            if obstacle.name in table:
                table[obstacle.name] = shape


def _along(outline: Polygon) -> Iterator[Point]:
    """Return points along an outline, near to each other."""
    for (ax, ay), (bx, by) in pairwise((*outline, outline[0])):
        count = max(1, math.ceil(math.dist((ax, ay), (bx, by)) / OUTLINE_STEP_M))
        for number in range(count):
            yield ax + (bx - ax) * number / count, ay + (by - ay) * number / count


def _overlap(one: Footprint, other: Footprint) -> bool:
    """Tell whether two footprints overlap."""
    if math.dist((one.x, one.y), (other.x, other.y)) > one.reach + other.reach:
        return False
    if one.polygon:
        return other.distance(one.polygon) == 0.0
    if other.polygon:
        return one.distance(other.polygon) == 0.0
    return math.dist((one.x, one.y), (other.x, other.y)) < one.radius + other.radius


class Bands:
    """The heights at which a robot meets things.

    `touch`: what the hull meets; `ring`: the plane of its sonar; `low`: what passes under the
    hull and stops its wheels.
    """

    __slots__ = ("low", "ring", "touch")

    def __init__(self, parameters: RobotParameters) -> None:
        body = parameters.body
        self.touch = (body.ground_clearance_m, body.hull_height_m)
        self.ring = parameters.sonar_height_m
        self.low = (min(SILL_M, body.ground_clearance_m), body.ground_clearance_m)

    def is_touched(self, item: Obstacle) -> bool:
        """Tell whether the hull can meet it."""
        return item.stands_in(*self.touch)

    def echoes(self, item: Obstacle) -> bool:
        """Tell whether it echoes the sonar."""
        return item.stands_in(self.ring, self.ring)

    def stops_wheels(self, item: Obstacle) -> bool:
        """Tell whether it passes under the hull and is too high to be driven over."""
        return item.stands_in(*self.low) and not self.is_touched(item)

    def is_sill(self, item: Obstacle) -> bool:
        """Tell whether wheels drive over it."""
        stands_on_floor = item.base_m - item.floor_m <= self.low[0]
        return not item.kind.is_driven_on and stands_on_floor and not item.stands_in(self.low[0], math.inf)


class StaticPlan:
    """What is fixed in a world, for one model of robot."""

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        bands = Bands(parameters)
        self.obstacles = tuple(item for item in world.obstacles if item.fixed)
        self.names = frozenset(item.name for item in self.obstacles) | {mesh.name for mesh in world.meshes}
        footprints = [(item, Footprint(item)) for item in self.obstacles]
        touched = [shape for item, shape in footprints if bands.is_touched(item)]
        echoing = [shape for item, shape in footprints if bands.echoes(item)]
        low = [shape for item, shape in footprints if bands.stops_wheels(item)]
        self.touched = FootprintGrid([*touched, *_shadows(world.meshes, *bands.touch)])
        self.echoing = FootprintGrid([*echoing, *_cuts(world.meshes, bands.ring)])
        self.low = FootprintGrid(low)


def _shadows(meshes: Iterable[Mesh], low_m: float, high_m: float) -> list[Footprint]:
    return [Footprint.of_polygon(mesh.name, polygon) for mesh in meshes for polygon in shadow(mesh, low_m, high_m)]


def _cuts(meshes: Iterable[Mesh], height_m: float) -> list[Footprint]:
    return [Footprint.of_polygon(mesh.name, segment) for mesh in meshes for segment in cut(mesh, height_m)]


class FootprintGrid:
    """Footprints that never move, kept in the square cells that they reach into."""

    def __init__(self, footprints: Iterable[Footprint]) -> None:
        self.footprints = tuple(footprints)
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._always: list[int] = []
        for number, thing in enumerate(self.footprints):
            x0, y0, x1, y1 = (math.floor(value / CELL_M) for value in thing.bounds)
            if (x1 - x0 + 1) * (y1 - y0 + 1) > MOST_CELLS:
                self._always.append(number)
                continue
            for column in range(x0, x1 + 1):
                for row in range(y0, y1 + 1):
                    self._cells.setdefault((column, row), []).append(number)
        columns, rows = [c for c, _ in self._cells], [r for _, r in self._cells]
        #: First and last column and row that hold anything.
        self._span = (min(columns), min(rows), max(columns), max(rows)) if self._cells else None

    def near(self, x0: float, y0: float, x1: float, y1: float) -> list[Footprint]:
        """Return what may reach into a rectangle, each once, in one fixed order."""
        if not self.footprints:
            return []
        found = set(self._always)
        if self._span is not None:
            cells = self._cells
            first_column, first_row, last_column, last_row = self._span
            for column in range(
                max(first_column, math.floor(x0 / CELL_M)), min(last_column, math.floor(x1 / CELL_M)) + 1
            ):
                for row in range(max(first_row, math.floor(y0 / CELL_M)), min(last_row, math.floor(y1 / CELL_M)) + 1):
                    found.update(cells.get((column, row), ()))
        return [self.footprints[number] for number in sorted(found)]

    def covers(self, x0: float, y0: float, x1: float, y1: float) -> bool:
        """Tell whether nothing lies outside a rectangle: a wider search would find no more."""
        if self._span is None:
            return True
        c0, r0, c1, r1 = (value * CELL_M for value in self._span)
        return x0 <= c0 and y0 <= r0 and x1 >= c1 + CELL_M and y1 >= r1 + CELL_M
