"""What every writer walks: bodies in a tree, each with shapes, a mass and frictions. Metres, kilograms, radians, Z up.

A scene knows neither worlds nor robots, and no format. Its bodies stand in an order in
which each comes after the one that it hangs on.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from p2os.pioneer.world.interchange.transform import Transform, from_roll_pitch_yaw
from p2os.pioneer.world.model import Triangle, Vertex

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class FixedPose:
    """A pose: turned about the fixed x, then y, then z axis, as SDF and URDF write it."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    @property
    def position(self) -> Vector:
        """x, y, z."""
        return self.x_m, self.y_m, self.z_m

    @property
    def turns(self) -> Vector:
        """Roll, pitch, yaw."""
        return self.roll_rad, self.pitch_rad, self.yaw_rad

    @property
    def transform(self) -> Transform:
        """The same as a matrix."""
        return from_roll_pitch_yaw(*self.position, *self.turns)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The turn alone: w, x, y, z."""
        (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle / 2), math.sin(angle / 2)) for angle in self.turns)
        return (
            cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Box:
    """A box about its middle."""

    size_m: Vector


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder about its middle, along its own Z."""

    radius_m: float
    length_m: float


@dataclass(frozen=True, slots=True)
class Sphere:
    """A sphere about its middle."""

    radius_m: float


@dataclass(frozen=True, slots=True)
class TriangleMesh:
    """Triangles, each by three numbers of vertices."""

    vertices: tuple[Vertex, ...]
    triangles: tuple[Triangle, ...]


Shape = Box | Cylinder | Sphere | TriangleMesh


class JointKind(Enum):
    """How a body hangs on its parent."""

    FIXED = "fixed"
    #: By nothing: it can be pushed, or drives.
    FREE = "free"
    #: About its own Y axis, as a wheel.
    WHEEL = "wheel"


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMark:
    """A place on a body that is no thing, as of a sensor."""

    name: str
    place: FixedPose


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneBody:
    """A thing, or a part of a robot.

    Args:
        name: Unique in its scene.
        parent: Name of the body that it hangs on; None is the world.
        place: Where its frame is in its parent's.
        shape, at: Its shape, and the shape's middle in its frame.
        friction: Coulomb friction of its surface.
        mass_kg: 0 where it stands fast.
        centre, inertia: Of a mass: its centre in the frame, m, and the moments about it along the axes, kg m².
        torque_nm: Most that turns a wheel.
        colour: Red, green, blue, 0 to 1.
        marks: Places on it.
        kind, floor_m, is_fixed: As a world has them (`Obstacle`); "" for what is no thing of a world.
    """

    name: str
    place: FixedPose
    shape: Shape
    friction: float
    colour: Vector
    parent: str | None = None
    motion: JointKind = JointKind.FIXED
    at: FixedPose = field(default_factory=FixedPose)
    mass_kg: float = 0.0
    centre: Vector = (0.0, 0.0, 0.0)
    inertia: Vector = (0.0, 0.0, 0.0)
    torque_nm: float = 0.0
    marks: tuple[SceneMark, ...] = ()
    kind: str = ""
    floor_m: float = 0.0
    is_fixed: bool = False


class Property(Enum):
    """What a world or a robot has that a format may not hold; the value is what a message calls it."""

    BOX = "boxes"
    ROUND = "cylinders and spheres"
    MESH = "meshes"
    POSE = "poses"
    MASS = "masses"
    PUSHED = "what can be pushed"
    FRICTION = "frictions"
    NAME = "names that the format has no room for"
    KIND = "kinds (wall, rail, floor, ramp)"
    START = "the start, where no robot stands on it"
    WALK = "walks"
    MARK = "goals, docks, forbidden areas"
    WHEEL = "wheels that turn"
    TORQUE = "the motors' torque"
    SONAR = "places of the sonars"
    CONE = "the sonars' cones and ranges"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportScene:
    """A world, a robot, or a robot in a world."""

    name: str
    bodies: tuple[SceneBody, ...]
    #: How many of each property there are to be held or lost.
    holds: Mapping[Property, int]
    #: x, y, z and heading of the start, and the extent of the floor; None for a robot alone.
    start: tuple[float, float, float, float] | None = None
    extent: tuple[float, float, float, float] | None = None
