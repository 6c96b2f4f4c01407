"""A world as plain values: a start, the things that stand in it, their paths, its meshes and marks.

A world knows nothing of engines and files: `loader` reads one by its name, `file` from
TOML, `formats` from other programs' files, and `makers` make some from a seed.

A thing may follow a path. Its place is then a function of the time alone, so that a walk
goes on exactly after a restore and no step length changes it. The thing has no sensors:
it walks through other things, and into the robot.

A mesh has any shape, and two plans: its `cut` at one height is a set of segments, its
`shadow` within a band of heights a set of convex polygons (two points where a face
stands upright). Faces come as triangles, so that one wall gives many pieces on one
line: these are joined.

Invariant: an invalid world cannot exist; every constructor refuses by a `WorldError`.
"""

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from itertools import accumulate, pairwise
from operator import attrgetter

from p2os.errors import WorldError
from simbase.errors import shown

Point = tuple[float, float]
Segment = tuple[Point, Point]
Polygon = tuple[Point, ...]
Vertex = tuple[float, float, float]
Triangle = tuple[int, int, int]

#: chosen: farther out is no building, m; and what is thinner is nothing.
FARTHEST_M, LEAST_M = 10_000.0, 1e-6
#: Measured: PyBullet flings away what is pushed and thinner, and lets a robot through what is heavier (100 t hold,
#: 200 t do not); what is lighter weighs nothing to MuJoCo.
LEAST_PUSHED_M, LEAST_PUSHED_KG, MOST_PUSHED_KG = 0.01, 1e-3, 10_000.0
#: chosen: a longer name fits no line of a picture or a message.
LONGEST_NAME = 200
_PLACE = (-FARTHEST_M, FARTHEST_M)
_SIZE = (LEAST_M, 2 * FARTHEST_M)
#: Key of a world file, and of the constructors below → least and most.
RANGES: Mapping[str, tuple[float, float]] = {
    "x_m": _PLACE, "y_m": _PLACE, "z_m": _PLACE, "base_m": _PLACE, "floor_m": _PLACE, "extent_m": _PLACE,
    "from_m": _PLACE, "to_m": _PLACE, "path_m": _PLACE, "points_m": _PLACE, "vertices_m": _PLACE,
    "length_m": _SIZE, "width_m": _SIZE, "radius_m": (LEAST_M, FARTHEST_M), "height_m": _SIZE, "thickness_m": _SIZE,
    "top_m": _SIZE, "rise_m": (0.0, FARTHEST_M),
    # A hundred turns: more is no heading, and keeps no fraction.
    "heading_deg": (-36_000.0, 36_000.0),
    # 0 stands fast.
    "mass_kg": (0.0, MOST_PUSHED_KG), "friction": (0.0, 10.0),
    "speed_mps": (1e-3, 100.0), "start_s": (0.0, 1e6), "scale": (1e-6, 1e6),
    "triangles": (0, 1_000_000),
}  # fmt: skip
#: Where a mesh is cut for a picture: at the height of the Pioneer's sonar ring; and how thick its walls are drawn, m.
CUT_M, CUT_THICK_M = 0.2, 0.02
MARK_KINDS = ("goal", "dock", "home", "forbidden", "reflector")
#: The tables of a world file, in the order in which a world keeps its obstacles.
SECTIONS = ("box", "cylinder", "floor", "ramp")
#: Pieces on lines that differ by less are one, m; and the grain to which lines are compared.
GRAIN_M = 1e-4
#: A shadow of less area is an upright face, m².
UPRIGHT_M2 = 1e-8
_LINE_ANGLE_STEPS = 1e4


class ObstacleKind(Enum):
    """What an obstacle is; walls and rails are drawn darker, floors and ramps are driven on."""

    WALL = "wall"
    RAIL = "rail"
    OBSTACLE = "obstacle"
    #: A raised, level floor.
    FLOOR = "floor"
    #: An inclined floor; its length is measured along the ground.
    RAMP = "ramp"

    @property
    def is_driven_on(self) -> bool:
        """Whether touching it is no collision."""
        return self in {ObstacleKind.FLOOR, ObstacleKind.RAMP}


@dataclass(frozen=True, slots=True)
class Pose:
    """A place and a heading: metres, radians counter-clockwise, and the floor's height."""

    x_m: float
    y_m: float
    heading_rad: float
    z_m: float = 0.0


# Paths ----------------------------------------------------------------------------------


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
        if any(math.dist(first, second) < LEAST_M for first, second in pairwise(self.points_m)):
            raise WorldError("a path must not name the same point twice in a row")
        _refuse_outside("a path", "path_m", *(value for point in self.points_m for value in point))
        if not self.speed_mps > 0 or not self.start_s >= 0:
            raise WorldError("a path needs a speed above 0 and a start of 0 s or later")
        _refuse_outside("a path", "speed_mps", self.speed_mps)
        _refuse_outside("a path", "start_s", self.start_s)
        if self.repeat is Repeat.LOOP and math.dist(self.points_m[0], self.points_m[-1]) < LEAST_M:
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


# Things, meshes and marks ---------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A box or a cylinder that stands upright, or a floor.

    Args:
        name: Unique in its world.
        x_m, y_m, heading_rad: Middle of the footprint; the length runs along the heading.
        length_m, width_m: Footprint of a box; 0 for a cylinder.
        radius_m: Of a cylinder; 0 for a box.
        base_m: Height of the underside above the world's zero; of a ramp, of its lower edge's surface.
        height_m: From the underside to the top; of a ramp, the rise along its heading.
        floor_m: Height of the floor around it, against which a plan view cuts.
        fixed: Part of the building: never moved or taken out, so that a body may merge all such into one.
        mass_kg: Of a thing that the robot can push; 0 stands fast.
        friction: Of a thing that can be pushed, against the floor.
        walk: How it moves by itself; it then stands at the walk's first point, whatever x_m and y_m are.
    """

    name: str
    x_m: float
    y_m: float
    heading_rad: float = 0.0
    length_m: float = 0.0
    width_m: float = 0.0
    radius_m: float = 0.0
    base_m: float = 0.0
    height_m: float = 0.5
    floor_m: float = 0.0
    kind: ObstacleKind = ObstacleKind.OBSTACLE
    fixed: bool = False
    mass_kg: float = 0.0
    friction: float = 0.5
    walk: Walk | None = None

    def __post_init__(self) -> None:
        is_box = self.length_m > 0 and self.width_m > 0 and self.radius_m == 0
        is_cylinder = self.radius_m > 0 and self.length_m == 0 and self.width_m == 0
        if (
            not (is_box or is_cylinder)
            or self.height_m < 0
            or (self.height_m == 0 and self.kind is not ObstacleKind.RAMP)
        ):
            raise WorldError(f"obstacle {self.name!r}: needs a length and a width, or a radius, and a height above 0")
        if not all(math.isfinite(value) for value in (self.x_m, self.y_m, self.heading_rad, self.base_m)):
            raise WorldError(f"obstacle {self.name!r}: its place must be finite")
        if not self.mass_kg >= 0 or not self.friction >= 0:
            raise WorldError(f"obstacle {self.name!r}: mass and friction must be 0 or more")
        self._refuse_what_no_body_bears()
        if sum((self.fixed, self.mass_kg > 0, self.walk is not None, self.kind.is_driven_on)) > 1:
            raise WorldError(
                f"obstacle {self.name!r}: it can be only one of fixed, pushed (mass_kg), walking (path_m) or a floor"
            )

    def _refuse_what_no_body_bears(self) -> None:
        if not self.name.isprintable() or len(self.name) > LONGEST_NAME:
            raise WorldError(f"obstacle {shown(self.name)}: its name is no line of at most {LONGEST_NAME} characters")
        what = f"obstacle {shown(self.name)}"
        for key in ("x_m", "y_m", "base_m", "floor_m", "mass_kg", "friction"):
            _refuse_outside(what, key, getattr(self, key))
        sizes = (self.radius_m,) if self.radius_m else (self.length_m, self.width_m)
        _refuse_outside(what, "radius_m" if self.radius_m else "length_m", *sizes)
        _refuse_outside(what, "rise_m" if self.kind is ObstacleKind.RAMP else "height_m", self.height_m)
        if self.mass_kg and (self.mass_kg < LEAST_PUSHED_KG or min(*sizes, self.height_m) < LEAST_PUSHED_M):
            raise WorldError(
                f"{what}: what is pushed has {LEAST_PUSHED_KG:g} kg and is {LEAST_PUSHED_M:g} m thick at least",
                hint="without mass_kg it stands fast",
            )

    @property
    def is_cylinder(self) -> bool:
        """Whether the footprint is a circle."""
        return self.radius_m > 0

    @property
    def section(self) -> str:
        """The table of a world file that it belongs to: box, cylinder, floor or ramp."""
        if self.kind is ObstacleKind.RAMP:
            return "ramp"
        if self.is_cylinder:
            return "cylinder"
        return "floor" if self.kind is ObstacleKind.FLOOR and self.base_m == self.heading_rad == 0 else "box"

    @property
    def reach_m(self) -> float:
        """Radius of the circle around the footprint."""
        return self.radius_m or math.hypot(self.length_m, self.width_m) / 2

    def standing_at(self, x_m: float, y_m: float, heading_rad: float) -> "Obstacle":
        """Return it with another place; the rest of it, which was checked when it was made, is kept.

        Raises:
            WorldError: The place is not finite, or too far out.
        """
        if not math.isfinite(heading_rad):
            raise WorldError(f"obstacle {shown(self.name)}: its place must be finite")
        least, most = _PLACE
        if not (least <= x_m <= most and least <= y_m <= most):  # what walks asks for this in each step
            _refuse_outside(f"obstacle {shown(self.name)}", "x_m", x_m)
            _refuse_outside(f"obstacle {shown(self.name)}", "y_m", y_m)
        moved, put = object.__new__(Obstacle), object.__setattr__  # `replace` takes five times as long
        for name, value in zip(_KEPT, _kept_of(self), strict=True):
            put(moved, name, value)
        put(moved, "x_m", x_m)
        put(moved, "y_m", y_m)
        put(moved, "heading_rad", heading_rad)
        return moved

    def stands_in(self, low_m: float, high_m: float) -> bool:
        """Tell whether it stands in a band of heights above the floor around it."""
        if self.kind.is_driven_on:
            return False
        bottom = self.base_m - self.floor_m
        return bottom < high_m and bottom + self.height_m > low_m

    def to_plain(self) -> dict[str, object]:
        """Return its plan as plain values, for a report: metres and radians."""
        plain: dict[str, object] = {
            "name": self.name,
            "kind": self.kind.value,
            "shape": "cylinder" if self.is_cylinder else "box",
            "x": self.x_m,
            "y": self.y_m,
            "heading": self.heading_rad,
            "height": self.height_m,
        }
        if self.is_cylinder:
            return plain | {"radius": self.radius_m}
        return plain | {"length": self.length_m, "width": self.width_m}


#: What of an obstacle stays while it moves.
_KEPT = tuple(part.name for part in fields(Obstacle) if part.name not in {"x_m", "y_m", "heading_rad"})
_kept_of = attrgetter(*_KEPT)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Static geometry of any shape: metres in the world, Z up.

    Args:
        name: Unique in its world.
        vertices: x, y, z of each corner.
        triangles: Three indices into `vertices` each; their winding does not matter.
    """

    name: str
    vertices: tuple[Vertex, ...]
    triangles: tuple[Triangle, ...]

    def __post_init__(self) -> None:
        if not self.triangles:
            raise WorldError(f"mesh {self.name!r}: it has no triangles")
        if not self.name.isprintable() or len(self.name) > LONGEST_NAME:
            raise WorldError(f"mesh {shown(self.name)}: its name is no line of at most {LONGEST_NAME} characters")
        if not all(-FARTHEST_M <= value <= FARTHEST_M for vertex in self.vertices for value in vertex):
            raise WorldError(f"mesh {self.name!r}: a vertex is not finite, or farther out than {FARTHEST_M:g} m")
        count = len(self.vertices)
        if not all(0 <= index < count for triangle in self.triangles for index in triangle):
            raise WorldError(f"mesh {self.name!r}: a triangle names a vertex that is not there")
        if not any(has_area(*(self.vertices[index] for index in triangle)) for triangle in self.triangles):
            raise WorldError(f"mesh {self.name!r}: no triangle of it has an area")

    @property
    def bounds(self) -> tuple[Vertex, Vertex]:
        """The least and the greatest x, y, z."""
        xs, ys, zs = zip(*self.vertices, strict=True)
        return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A place on the plan that is no thing: drawn, and nothing meets it.

    Args:
        name: What is written beside it; need not be unique.
        kind: `goal`, `dock`, `home`, `forbidden` for a line or an area that programs keep out of, or `reflector` for a
            line that shines (its wall is an obstacle of its own).
        points_m: One point, or the ends of a line, or the corners of an area.
    """

    name: str
    kind: str
    points_m: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if self.kind not in MARK_KINDS:
            raise WorldError(f"kind {shown(self.kind)} is unknown", hint=f"one of {', '.join(MARK_KINDS)}")
        if not self.points_m:
            raise WorldError("a mark needs a point, or several")
        _refuse_outside("a mark", "points_m", *(value for point in self.points_m for value in point))


def normal_of(a: Vertex, b: Vertex, c: Vertex) -> Vertex:
    """Return what stands upright on a triangle, as long as twice its area."""
    (ux, uy, uz), (vx, vy, vz) = ((end[0] - a[0], end[1] - a[1], end[2] - a[2]) for end in (b, c))
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def has_area(a: Vertex, b: Vertex, c: Vertex) -> bool:
    """Tell whether a triangle is more than a point or a line."""
    area = math.hypot(*normal_of(a, b, c)) / 2
    longest = max(math.dist(a, b), math.dist(b, c), math.dist(c, a))
    return area > LEAST_M * longest and longest > LEAST_M


def _refuse_outside(what: str, key: str, *values: float) -> None:
    """Refuse values outside the range of a key."""
    least, most = RANGES[key]
    for value in values:
        if not least <= value <= most:
            raise WorldError(f"{what}: {key} = {shown(value)} is out of range: {least:g} to {most:g}")


# The world ------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Where a robot can be."""

    name: str
    #: Where it was read from; two worlds that differ only in it are equal.
    source: str = field(compare=False)
    description: str
    start: Pose
    #: x0, y0, x1, y1 of the floor, metres.
    extent: tuple[float, float, float, float]
    #: Kept as a file holds them: boxes, cylinders, floors, ramps, each in the order given.
    obstacles: tuple[Obstacle, ...]
    meshes: tuple[Mesh, ...] = ()
    marks: tuple[Mark, ...] = ()
    #: What a reader of the file left out, one line each.
    skipped: tuple[str, ...] = field(default=(), compare=False)
    #: What a message calls the start: file, line and key.
    start_at: str = field(default="its start", compare=False)

    def contains(self, x_m: float, y_m: float) -> bool:
        """Tell whether a place is on the floor."""
        x0, y0, x1, y1 = self.extent
        return x0 <= x_m <= x1 and y0 <= y_m <= y1

    def __post_init__(self) -> None:
        _refuse_outside(f"world {shown(self.name)}", "extent_m", *self.extent)
        _refuse_outside(f"the start of world {shown(self.name)}", "x_m", self.start.x_m, self.start.y_m, self.start.z_m)
        in_order = sorted(self.obstacles, key=lambda item: SECTIONS.index(item.section))
        object.__setattr__(self, "obstacles", tuple(in_order))
        seen: set[str] = set()
        for name in (*(item.name for item in self.obstacles), *(item.name for item in self.meshes)):
            if name in seen:
                raise WorldError(f"{self.source}: two obstacles are named {name!r}")
            seen.add(name)

    @property
    def has_slopes(self) -> bool:
        """Whether a plan view leaves something out."""
        return any(obstacle.kind is ObstacleKind.RAMP for obstacle in self.obstacles)

    def to_plain(self) -> dict[str, object]:
        """Return the plan as plain values, for a report; a mesh as the thin walls of its cut."""
        walls = [
            {
                "name": f"{mesh.name}, wall {number}",
                "kind": ObstacleKind.WALL.value,
                "shape": "box",
                "x": (ax + bx) / 2,
                "y": (ay + by) / 2,
                "heading": math.atan2(by - ay, bx - ax),
                "height": CUT_M,
                "length": math.dist((ax, ay), (bx, by)) + CUT_THICK_M,
                "width": CUT_THICK_M,
            }
            for mesh in self.meshes
            for number, ((ax, ay), (bx, by)) in enumerate(cut(mesh, CUT_M), start=1)
        ]
        return {
            "name": self.name,
            "extent": list(self.extent),
            "obstacles": [*(obstacle.to_plain() for obstacle in self.obstacles), *walls],
        }


# The plans of a mesh --------------------------------------------------------------------


def cut(mesh: Mesh, height_m: float) -> list[Segment]:
    """Return where a mesh meets a level plane; a face that lies in the plane is not met."""
    found: list[Segment] = []
    vertices = mesh.vertices
    for triangle in mesh.triangles:
        corners = [vertices[index] for index in triangle]
        above = [corner[2] >= height_m for corner in corners]
        if any(above) and not all(above):
            crossings = [
                _crossing(corners[i], corners[(i + 1) % 3], height_m)
                for i in range(3)
                if above[i] is not above[(i + 1) % 3]
            ]
            if math.dist(crossings[0], crossings[1]) > GRAIN_M:
                found.append((crossings[0], crossings[1]))
    return joined(found)


def shadow(mesh: Mesh, low_m: float, high_m: float) -> list[Polygon]:
    """Return the plan of all that stands between two heights."""
    polygons: dict[tuple[tuple[int, int], ...], Polygon] = {}
    upright: list[Segment] = []
    vertices = mesh.vertices
    for triangle in mesh.triangles:
        corners = [vertices[index] for index in triangle]
        heights = [corner[2] for corner in corners]
        if min(heights) >= high_m or max(heights) <= low_m:
            continue
        inside = _above(_above(corners, low_m, 1.0), -high_m, -1.0)
        outline = [(x, y) for x, y, _ in inside]
        if len(outline) < 2:
            continue
        area = _area(outline)
        if abs(area) < UPRIGHT_M2:
            upright.append(_longest(outline))
            continue
        polygon = tuple(outline if area > 0 else reversed(outline))
        polygons.setdefault(tuple(sorted({_grained(point) for point in polygon})), _without_twins(polygon))
    return [*(segment for segment in joined(upright)), *polygons.values()]


def joined(segments: Iterable[Segment]) -> list[Segment]:
    """Return segments with those that lie on one line and overlap or touch made into one."""
    lines: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for (ax, ay), (bx, by) in segments:
        if math.hypot(bx - ax, by - ay) < GRAIN_M:
            continue
        angle = math.atan2(by - ay, bx - ax) % math.pi
        step = round(angle * _LINE_ANGLE_STEPS) % round(math.pi * _LINE_ANGLE_STEPS)
        c, s = math.cos(step / _LINE_ANGLE_STEPS), math.sin(step / _LINE_ANGLE_STEPS)
        offset = round(((ay + by) / 2 * c - (ax + bx) / 2 * s) / GRAIN_M)
        ends = sorted((ax * c + ay * s, bx * c + by * s))
        lines.setdefault((step, offset), []).append((ends[0], ends[1]))
    result: list[Segment] = []
    for (step, offset), spans in lines.items():
        c, s = math.cos(step / _LINE_ANGLE_STEPS), math.sin(step / _LINE_ANGLE_STEPS)
        away = offset * GRAIN_M
        for low, high in _union(sorted(spans)):
            result.append(((low * c - away * s, low * s + away * c), (high * c - away * s, high * s + away * c)))
    return result


def _union(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    merged = [spans[0]]
    for low, high in spans[1:]:
        if low <= merged[-1][1] + GRAIN_M:
            merged[-1] = (merged[-1][0], max(merged[-1][1], high))
        else:
            merged.append((low, high))
    return merged


def _crossing(a: Vertex, b: Vertex, height_m: float) -> Point:
    share = (height_m - a[2]) / (b[2] - a[2])
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])


def _above(corners: list[Vertex], height_m: float, sign: float) -> list[Vertex]:
    """Return the part of a convex outline where sign * z >= height (Sutherland and Hodgman's clip)."""
    kept: list[Vertex] = []
    for i, a in enumerate(corners):
        b = corners[(i + 1) % len(corners)]
        a_in, b_in = sign * a[2] >= height_m, sign * b[2] >= height_m
        if a_in:
            kept.append(a)
        if a_in is not b_in:
            at = height_m * sign
            x, y = _crossing(a, b, at)
            kept.append((x, y, at))
    return kept


def _area(outline: list[Point]) -> float:
    """Return the area of an outline, positive counter-clockwise."""
    ox, oy = outline[0]
    return sum((ax - ox) * (by - oy) - (bx - ox) * (ay - oy) for (ax, ay), (bx, by) in pairwise(outline[1:])) / 2


def _longest(outline: list[Point]) -> Segment:
    """Return the two points of a flat outline that are farthest apart."""
    return max(((a, b) for a in outline for b in outline), key=lambda pair: math.dist(*pair))


def _grained(point: Point) -> tuple[int, int]:
    return round(point[0] / GRAIN_M), round(point[1] / GRAIN_M)


def _without_twins(polygon: Polygon) -> Polygon:
    """Return an outline without corners that follow each other at one place."""
    return tuple(point for place, point in enumerate(polygon) if math.dist(point, polygon[place - 1]) > GRAIN_M / 10)
