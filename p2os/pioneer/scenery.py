"""A world: a start and the things that stand in it, as plain values.

A world knows nothing of engines; `p2os.pioneer.world` reads it from TOML and `arena`
makes one from a seed.
"""

import math
from dataclasses import dataclass
from enum import Enum

from p2os.errors import WorldError


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

    def __post_init__(self) -> None:
        is_box = self.length_m > 0 and self.width_m > 0 and self.radius_m == 0
        is_cylinder = self.radius_m > 0 and self.length_m == 0 and self.width_m == 0
        if not (is_box or is_cylinder) or self.height_m < 0 or (self.height_m == 0 and self.kind is not Kind.RAMP):
            raise WorldError(f"obstacle {self.name!r}: needs a length and a width, or a radius, and a height above 0")
        if not all(math.isfinite(value) for value in (self.x_m, self.y_m, self.heading_rad, self.base_m)):
            raise WorldError(f"obstacle {self.name!r}: its place must be finite")

    @property
    def is_cylinder(self) -> bool:
        """Whether the footprint is a circle."""
        return self.radius_m > 0

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
class World:
    """Where a robot can be."""

    name: str
    #: Where it was read from.
    source: str
    description: str
    start: Pose
    #: x0, y0, x1, y1 of the floor, metres.
    extent: tuple[float, float, float, float]
    obstacles: tuple[Obstacle, ...]

    def __post_init__(self) -> None:
        names = [obstacle.name for obstacle in self.obstacles]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise WorldError(f"{self.source}: two obstacles are named {twice[0]!r}")

    @property
    def has_slopes(self) -> bool:
        """Whether a plan view leaves something out."""
        return any(obstacle.kind is Kind.RAMP for obstacle in self.obstacles)

    def to_plain(self) -> dict[str, object]:
        """Return the plan as plain values, for a report."""
        return {
            "name": self.name,
            "extent": list(self.extent),
            "obstacles": [obstacle.to_plain() for obstacle in self.obstacles],
        }
