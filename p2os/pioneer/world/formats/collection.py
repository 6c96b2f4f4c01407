"""What a reader has found so far: upright boxes and cylinders as things, all else as meshes.

Readers of robot and world descriptions put their shapes here, each with its place in
the world; the collection names them, bounds them, and finds a start for the robot in a
world whose file names none. It reads no file itself.

Invariant: no name is given twice, and no world is larger than a body can take.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypedDict

from p2os.errors import WorldError
from p2os.pioneer.world.formats.annotation import Traits
from p2os.pioneer.world.geometry import Footprint, point_segment
from p2os.pioneer.world.interchange.transform import Transform, apply, upright_heading
from p2os.pioneer.world.model import (
    FARTHEST_M,
    LEAST_PUSHED_M,
    LONGEST_NAME,
    Mark,
    Mesh,
    Obstacle,
    ObstacleKind,
    Pose,
    Triangle,
    Vertex,
    World,
    has_area,
    shadow,
)
from p2os.pioneer.world.solids import Solid, box, cylinder, sphere

#: chosen: a Pioneer turns on the spot in it.
FREE_M = 0.5
#: So much beyond the farthest a mesh is cut, not refused: the floor of an exported world reaches 1 m farther than it.
BEYOND_M = 2.0
#: Between these heights nothing may stand.
LOW_M, HIGH_M = 0.05, 0.5
#: The plan is searched on a grid of so many places along its longer side.
PLACES = 24
MOST_TRIANGLES = 200_000
#: In a mesh file, before it is known which of them triangles use.
MOST_VERTICES = 1_000_000
MOST_THINGS = 20_000
#: The floor reaches so far beyond what stands on it, m.
MARGIN_M = 0.5
#: What is noted of a thing that moves in its file and not in a world.
STANDS_STILL = "that a model can move: it stands still"
#: What a file says of nothing.
PLAIN = Traits()
#: A round thing is made of so many sectors.
SECTORS = 16


class _TraitKeys(TypedDict):
    kind: ObstacleKind
    fixed: bool
    floor_m: float
    mass_kg: float
    friction: float


class Collection:
    """Gathers a file's static geometry: metres, Z up."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.obstacles: list[Obstacle] = []
        self.meshes: list[Mesh] = []
        self.marks: list[Mark] = []
        self._skipped: dict[str, int] = {}
        #: Names taken, each with the last number that was put behind it.
        self._names: dict[str, int] = {}
        self._triangles = 0

    def skip(self, what: str) -> None:
        """Note that something of the file is left out."""
        self._skipped[what] = self._skipped.get(what, 0) + 1

    def add_box(self, name: str, size: Sequence[float], place: Transform, traits: Traits = PLAIN) -> None:
        """Take a box about its middle: its size along its own axes; a tilted one as a mesh, if it is no ramp."""
        if min(size) <= 0:
            raise WorldError(f"{self.path}: box {name!r}: its size must be above 0")
        if traits.kind is ObstacleKind.RAMP:
            self._add_ramp(name, size, place)
            return
        heading = upright_heading(place)
        if heading is not None:
            self.add_thing(
                Obstacle(
                    name=self._name(name),
                    x_m=place[0][3],
                    y_m=place[1][3],
                    heading_rad=heading,
                    length_m=size[0],
                    width_m=size[1],
                    height_m=size[2],
                    base_m=place[2][3] - size[2] / 2,
                    **self._traits(traits, size),
                )
            )
            return
        self._stands_still(traits)
        self._add_solid(name, box(size), place)

    def add_cylinder(self, name: str, radius: float, length: float, place: Transform, traits: Traits = PLAIN) -> None:
        """Take a cylinder about its middle, along its own Z."""
        if min(radius, length) <= 0:
            raise WorldError(f"{self.path}: cylinder {name!r}: its size must be above 0")
        if upright_heading(place) is not None:
            self.add_thing(
                Obstacle(
                    name=self._name(name),
                    x_m=place[0][3],
                    y_m=place[1][3],
                    radius_m=radius,
                    height_m=length,
                    base_m=place[2][3] - length / 2,
                    **self._traits(traits, (radius, length)),
                )
            )
            return
        self._stands_still(traits)
        self._add_solid(name, cylinder(radius, length, SECTORS), place)

    def add_sphere(self, name: str, radius: float, place: Transform) -> None:
        """Take a sphere, as a mesh."""
        if radius <= 0:
            raise WorldError(f"{self.path}: sphere {name!r}: its size must be above 0")
        self._add_solid(name, sphere(radius, SECTORS), place)

    def add_mesh(self, name: str, vertices: Iterable[Vertex], triangles: Iterable[Triangle]) -> None:
        """Take a mesh in the world's frame; triangles without an area are left out."""
        corners = tuple(vertices)
        for vertex in corners:
            if not all(-FARTHEST_M - BEYOND_M <= value <= FARTHEST_M + BEYOND_M for value in vertex):
                raise WorldError(
                    f"{self.path}: {name!r}: a vertex is not finite, or farther out than {FARTHEST_M:g} m",
                    hint="is its unit the metre?",
                )
        corners = tuple((_within(x), _within(y), _within(z)) for x, y, z in corners)
        count = len(corners)
        kept = []
        for triangle in triangles:
            if not all(0 <= index < count for index in triangle):
                raise WorldError(f"{self.path}: {name!r}: a face names a vertex that is not there")
            if has_area(*(corners[index] for index in triangle)):
                kept.append(triangle)
        self._triangles += len(kept)
        if self._triangles > MOST_TRIANGLES:
            raise WorldError(f"{self.path}: more than {MOST_TRIANGLES} triangles", hint="decimate it first")
        if kept:
            self.meshes.append(Mesh(name=self._name(name), vertices=corners, triangles=tuple(kept)))

    def add_wall(self, name: str, a: tuple[float, float], b: tuple[float, float], *, thick: float, high: float) -> None:
        """Take a thin wall between two points."""
        length = math.dist(a, b)
        if length == 0:
            return
        self.add_thing(
            Obstacle(
                name=self._name(name),
                x_m=(a[0] + b[0]) / 2,
                y_m=(a[1] + b[1]) / 2,
                heading_rad=math.atan2(b[1] - a[1], b[0] - a[0]),
                length_m=length + thick,
                width_m=thick,
                height_m=high,
                kind=ObstacleKind.WALL,
                fixed=True,
            )
        )

    def world(self, start: Pose | None = None, extent: tuple[float, float, float, float] | None = None) -> World:
        """Return all that was found.

        Args:
            start: Where the robot begins; None finds a free place.
            extent: The floor; None is what things cover, and a margin.

        Raises:
            WorldError: Nothing was found.
        """
        if not self.obstacles and not self.meshes:
            raise WorldError(f"{self.path}: there is nothing in it that a robot could meet", hint=self._hint())
        bounds = extent or self._bounds()
        return World(
            name=self.path.stem,
            source=str(self.path),
            description=f"from {self.path.name}",
            start=start or _free_start(self.obstacles, self.meshes, bounds),
            extent=bounds,
            obstacles=tuple(self.obstacles),
            meshes=tuple(self.meshes),
            marks=tuple(self.marks),
            skipped=tuple(
                f"skipped: {what}" + (f" ({count} times)" if count > 1 else "") for what, count in self._skipped.items()
            ),
        )

    def _add_ramp(self, name: str, size: Sequence[float], place: Transform) -> None:
        """Take the upper face of a tilted box as an incline."""
        (a, _, c, x), (d, _, f, y), (g, _, i, z) = place
        rise, thick = size[0] * g, size[2] / 2
        self.add_thing(
            Obstacle(
                name=self._name(name),
                x_m=x + c * thick,
                y_m=y + f * thick,
                heading_rad=math.atan2(d, a),
                length_m=size[0] * math.hypot(a, d),
                width_m=size[1],
                height_m=max(0.0, rise),
                base_m=z + i * thick - rise / 2,
                kind=ObstacleKind.RAMP,
            )
        )

    def _traits(self, traits: Traits, size: Sequence[float]) -> "_TraitKeys":
        """Return what an obstacle is beside its shape; what is too thin to be pushed stands fast."""
        is_pushed = traits.mass_kg > 0 and min(size) >= LEAST_PUSHED_M
        if not is_pushed:
            self._stands_still(traits)
        return {
            "kind": traits.kind,
            "fixed": traits.fixed or (traits.mass_kg > 0 and not is_pushed),
            "floor_m": traits.floor_m,
            "mass_kg": traits.mass_kg if is_pushed else 0.0,
            "friction": traits.friction,
        }

    def _stands_still(self, traits: Traits) -> None:
        if traits.mass_kg > 0:
            self.skip(STANDS_STILL)

    def _add_solid(self, name: str, solid: Solid, place: Transform) -> None:
        vertices, triangles = solid
        self.add_mesh(name, apply(place, vertices), triangles)

    def add_thing(self, item: Obstacle) -> None:
        """Take an upright box or cylinder whose name no other has."""
        if max(abs(item.x_m), abs(item.y_m), item.reach_m, abs(item.base_m), item.height_m) > FARTHEST_M:
            raise WorldError(f"{self.path}: {item.name!r} is farther out than {FARTHEST_M:g} m")
        self.obstacles.append(item)
        if len(self.obstacles) > MOST_THINGS:
            raise WorldError(f"{self.path}: more than {MOST_THINGS} things", hint="make it simpler first")

    def _name(self, wanted: str) -> str:
        # Room for the number, and for what an import puts before it.
        wanted = "".join(letter if letter.isprintable() else "?" for letter in wanted[: LONGEST_NAME // 2])
        name, number = wanted, self._names.get(wanted, 0)
        while name in self._names:
            number += 1
            name = f"{wanted} {number + 1}"
        self._names[wanted] = number
        self._names[name] = 0 if name != wanted else number
        return name

    def _bounds(self) -> tuple[float, float, float, float]:
        xs: list[float] = []
        ys: list[float] = []
        for item in self.obstacles:
            xs += [item.x_m - item.reach_m, item.x_m + item.reach_m]
            ys += [item.y_m - item.reach_m, item.y_m + item.reach_m]
        for mesh in self.meshes:
            low, high = mesh.bounds
            xs += [low[0], high[0]]
            ys += [low[1], high[1]]
        for mark in self.marks:
            xs += [x for x, _ in mark.points_m]
            ys += [y for _, y in mark.points_m]
        return (
            _within(min(xs) - MARGIN_M), _within(min(ys) - MARGIN_M),
            _within(max(xs) + MARGIN_M), _within(max(ys) + MARGIN_M),
        )  # fmt: skip

    def _hint(self) -> str | None:
        return f"skipped: {', '.join(self._skipped)}" if self._skipped else None


def _within(value_m: float) -> float:
    return min(FARTHEST_M, max(-FARTHEST_M, value_m))


def _free_start(
    obstacles: Iterable[Obstacle], meshes: Iterable[Mesh], extent: tuple[float, float, float, float]
) -> Pose:
    """Return the origin where it is free, else the free place nearest to the middle, else the middle."""
    x0, y0, x1, y1 = extent
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    step = max(x1 - x0, y1 - y0) / PLACES
    grid = [
        (x0 + step * (column + 0.5), y0 + step * (row + 0.5))
        for column in range(math.ceil((x1 - x0) / step))
        for row in range(math.ceil((y1 - y0) / step))
    ]
    grid.sort(key=lambda place: math.dist(place, (middle_x, middle_y)))
    origin = [(0.0, 0.0)] if x0 < 0 < x1 and y0 < 0 < y1 else []
    footprints = [Footprint(item) for item in obstacles if item.stands_in(LOW_M, HIGH_M)]
    tried = (*origin, (middle_x, middle_y), *grid)
    left = sorted(place for place in {*tried} if all(thing.distance_to_point(*place) > FREE_M for thing in footprints))
    for mesh in meshes:
        for polygon in shadow(mesh, LOW_M, HIGH_M):
            for a, b in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
                _drop_near(left, a, b)
            if not left:
                return Pose(middle_x, middle_y, 0.0)
    x, y = next((place for place in tried if place in left), (middle_x, middle_y))
    return Pose(round(x, 3), round(y, 3), 0.0) if left else Pose(x, y, 0.0)


def _drop_near(places: list[tuple[float, float]], a: tuple[float, float], b: tuple[float, float]) -> None:
    """Take out of sorted places those near a segment; only those about its own x are looked at."""
    low, high = min(a[1], b[1]) - FREE_M, max(a[1], b[1]) + FREE_M
    first = bisect_left(places, (min(a[0], b[0]) - FREE_M, -math.inf))
    last = bisect_right(places, (max(a[0], b[0]) + FREE_M, math.inf))
    for number in range(last - 1, first - 1, -1):
        x, y = places[number]
        if low <= y <= high and point_segment(x, y, *a, *b) <= FREE_M:
            del places[number]
