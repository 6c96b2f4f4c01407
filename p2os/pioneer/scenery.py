"""A world: a start and the things that stand in it, as plain values.

A world knows nothing of engines; `p2os.pioneer.world` reads it from TOML and `arena`
makes one from a seed.
"""

import math
from dataclasses import dataclass, field
from enum import Enum

from p2os.errors import WorldError
from p2os.pioneer.walk import Walk

Vertex = tuple[float, float, float]
Triangle = tuple[int, int, int]

#: Where a mesh is cut for a picture: at the height of the Pioneer's sonar ring; and how thick its walls are drawn, m.
CUT_M, CUT_THICK_M = 0.2, 0.02
MARK_KINDS = ("goal", "dock", "home", "forbidden")
#: The tables of a world file, in the order in which a world keeps its obstacles.
SECTIONS = ("box", "cylinder", "floor", "ramp")


class Kind(Enum):
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
        return self in {Kind.FLOOR, Kind.RAMP}


@dataclass(frozen=True, slots=True)
class Pose:
    """A place and a heading: metres, radians counter-clockwise, and the floor's height."""

    x_m: float
    y_m: float
    heading_rad: float
    z_m: float = 0.0


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
        fixed: Part of the building: never moved or taken out, so that a body may melt all such into one.
        mass_kg: Of a thing that the robot can push; 0 stands fast.
        friction: Of a thing that can be pushed, against the floor.
        walk: How it moves by itself; it then stands at the walk's first point, whatever x_m and y_m say.
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
    kind: Kind = Kind.OBSTACLE
    fixed: bool = False
    mass_kg: float = 0.0
    friction: float = 0.5
    walk: Walk | None = None

    def __post_init__(self) -> None:
        is_box = self.length_m > 0 and self.width_m > 0 and self.radius_m == 0
        is_cylinder = self.radius_m > 0 and self.length_m == 0 and self.width_m == 0
        if not (is_box or is_cylinder) or self.height_m < 0 or (self.height_m == 0 and self.kind is not Kind.RAMP):
            raise WorldError(f"obstacle {self.name!r}: needs a length and a width, or a radius, and a height above 0")
        if not all(math.isfinite(value) for value in (self.x_m, self.y_m, self.heading_rad, self.base_m)):
            raise WorldError(f"obstacle {self.name!r}: its place must be finite")
        if not 0 <= self.mass_kg < math.inf or not 0 <= self.friction < math.inf:
            raise WorldError(f"obstacle {self.name!r}: mass and friction must be 0 or more")
        if sum((self.fixed, self.mass_kg > 0, self.walk is not None, self.kind.is_driven_on)) > 1:
            raise WorldError(
                f"obstacle {self.name!r}: it can be only one of fixed, pushed (mass_kg), walking (path_m) or a floor"
            )

    @property
    def is_cylinder(self) -> bool:
        """Whether the footprint is a circle."""
        return self.radius_m > 0

    @property
    def section(self) -> str:
        """The table of a world file that it belongs to: box, cylinder, floor or ramp."""
        if self.kind is Kind.RAMP:
            return "ramp"
        if self.is_cylinder:
            return "cylinder"
        return "floor" if self.kind is Kind.FLOOR and self.base_m == self.heading_rad == 0 else "box"

    @property
    def reach_m(self) -> float:
        """Radius of the circle around the footprint."""
        return self.radius_m or math.hypot(self.length_m, self.width_m) / 2

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Static geometry of any shape: metres in the world, Z up.

    Args:
        name: Unique in its world.
        vertices: x, y, z of each corner.
        triangles: Three indices into `vertices` each; their winding is of no account.
    """

    name: str
    vertices: tuple[Vertex, ...]
    triangles: tuple[Triangle, ...]

    def __post_init__(self) -> None:
        if not self.triangles:
            raise WorldError(f"mesh {self.name!r}: it has no triangles")
        if not all(math.isfinite(value) for vertex in self.vertices for value in vertex):
            raise WorldError(f"mesh {self.name!r}: a vertex is not finite")
        count = len(self.vertices)
        if not all(0 <= index < count for triangle in self.triangles for index in triangle):
            raise WorldError(f"mesh {self.name!r}: a triangle names a vertex that is not there")

    @property
    def bounds(self) -> tuple[Vertex, Vertex]:
        """The least and the greatest x, y, z."""
        xs, ys, zs = zip(*self.vertices, strict=True)
        return (min(xs), min(ys), min(zs)), (max(xs), max(ys), max(zs))


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A place on the plan that is no thing: drawn, and felt by nobody.

    Args:
        name: What is written beside it; need not be unique.
        kind: `goal`, `dock`, `home`, or `forbidden` for a line or an area that programs keep out of.
        points_m: One point, or the ends of a line, or the corners of an area.
    """

    name: str
    kind: str
    points_m: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        if self.kind not in MARK_KINDS:
            raise WorldError(f"kind {self.kind!r} is unknown", hint=f"one of {', '.join(MARK_KINDS)}")
        if not self.points_m or not all(math.isfinite(value) for point in self.points_m for value in point):
            raise WorldError("a mark needs a point, or several")


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

    def __post_init__(self) -> None:
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
        return any(obstacle.kind is Kind.RAMP for obstacle in self.obstacles)

    def to_plain(self) -> dict[str, object]:
        """Return the plan as plain values, for a report; a mesh as the thin walls of its cut."""
        from p2os.pioneer.mesh_plan import cut

        walls = [
            {
                "name": f"{mesh.name}, wall {number}",
                "kind": Kind.WALL.value,
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
