"""The other robots of a world, as one of them meets them: hulls that stand where they were last seen.

To another robot a robot is an upright box: the hull of its model, from its underside to its
top. Nothing here moves anybody; `meeting` says where everyone stands.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol, runtime_checkable

from p2os.parameters import RobotParameters
from p2os.pioneer.body import RobotBody
from p2os.pioneer.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.scenery import Obstacle, World
from p2os.pioneer.static_plan import Bands

#: Footprints kept of one robot: where it stands now, and where it stood at the last border.
KEPT = 2


class Stand(NamedTuple):
    """Where the middle of a robot's axle is: metres and radians."""

    x_m: float
    y_m: float
    heading_rad: float


class Presence:
    """One robot as the others meet it.

    Args:
        name: What it is called among the things of the others' worlds.
        parameters: Its model.
        body: Itself.
        rise_m: How much taller it is taken for, so that it stands on every floor of the world at once.
    """

    def __init__(self, name: str, parameters: RobotParameters, body: RobotBody, rise_m: float = 0.0) -> None:
        shape = parameters.body
        self.name, self.body = name, body
        self._sociable = body if isinstance(body, Sociable) else None
        self._hull = hull_polygon(shape)
        self._ahead_m = (shape.hull_front_m - shape.hull_rear_m) / 2
        self._outline = Obstacle(
            name=name, x_m=0.0, y_m=0.0, length_m=shape.hull_front_m + shape.hull_rear_m, width_m=shape.hull_width_m,
            base_m=shape.ground_clearance_m, height_m=shape.hull_height_m - shape.ground_clearance_m + rise_m,
        )  # fmt: skip
        #: No point of the hull is farther from the middle of its axle.
        self.reach_m = self._outline.reach_m + abs(self._ahead_m)
        self._shapes: dict[Stand, Footprint] = {}
        #: Where it was seen last, and where it stood at the last border of the meeting.
        self.live = Stand(0.0, 0.0, 0.0)
        self.at_border = self.look()

    def look(self) -> Stand:
        """Take where it stands now from its body; return it."""
        if self._sociable is not None:
            self.live = self._sociable.stand
        else:
            state = self.body.state
            self.live = Stand(state.x_m, state.y_m, state.heading_rad)
        return self.live

    def obstacle(self, stand: Stand) -> Obstacle:
        """Return the robot as a thing that stands somewhere."""
        x, y, heading = self._middle(stand)
        return replace(self._outline, x_m=x, y_m=y, heading_rad=heading)

    def footprint(self, stand: Stand) -> Footprint:
        """Return its plan where it stands."""
        shape = self._shapes.get(stand)
        if shape is None:
            if len(self._shapes) >= KEPT:
                self._shapes.clear()
            shape = self._shapes[stand] = Footprint.of_polygon(self.name, placed(self._hull, *stand))
        return shape

    def bump(self) -> None:
        """Let it feel that another robot has driven against it."""
        if self._sociable is not None:
            self._sociable.bump()

    def move_in(self, body: RobotBody, stand: Stand) -> None:
        """Put it somewhere in the world of a body that keeps a copy of it there."""
        body.move(self.name, *self._middle(stand))

    def _middle(self, stand: Stand) -> Stand:
        x, y, heading = stand
        return Stand(x + self._ahead_m * math.cos(heading), y + self._ahead_m * math.sin(heading), heading)


class Company:
    """All others, for one robot."""

    def __init__(self, others: Sequence[Presence], parameters: RobotParameters) -> None:
        bands = Bands(parameters)
        self.others = tuple(others)
        seen_as = [(other, other.obstacle(other.live)) for other in others]
        self._heard = tuple(other for other, shape in seen_as if bands.echoes(shape))
        self._touched = frozenset(other.name for other, shape in seen_as if bands.is_touched(shape))
        #: Those with whom it lives step by step until the next border, and those of them that its hull could meet.
        self.close_to: tuple[Presence, ...] = ()
        self.near: tuple[Presence, ...] = ()

    @property
    def is_close(self) -> bool:
        """Whether it lives step by step with others."""
        return bool(self.close_to)

    def come_near(self, near: Iterable[Presence]) -> None:
        """Note who is near until the next border; nobody: it lives by itself."""
        self.close_to = tuple(near)
        self.near = tuple(other for other in self.close_to if other.name in self._touched)

    def stand_of(self, other: Presence) -> Stand:
        """Return where this robot sees another one."""
        return other.live if self.is_close else other.at_border

    def heard_within(self, x0: float, y0: float, x1: float, y1: float) -> Iterator[Footprint]:
        """Return the others whose hulls may reach into a rectangle and are heard by this robot's sonar."""
        for other in self._heard:
            stand, reach = self.stand_of(other), other.reach_m
            if x0 - reach <= stand[0] <= x1 + reach and y0 - reach <= stand[1] <= y1 + reach:
                yield other.footprint(stand)

    def touchable(self) -> Iterator[Footprint]:
        """Return every other robot that this one's hull could meet, wherever it is."""
        return (other.footprint(self.stand_of(other)) for other in self.others if other.name in self._touched)


@runtime_checkable
class Sociable(Protocol):
    """A body that looks for the others itself, when it needs to; all others keep copies of them in their worlds."""

    @property
    def stand(self) -> Stand:
        """Where it stands, without the rest of its state."""
        ...

    def join(self, company: Company | None) -> None:
        """Meet others from now on, also after a reset."""
        ...

    def bump(self) -> None:
        """Feel that another robot has driven against the hull."""
        ...


def free_name(number: int, world: World) -> str:
    """Return what robot `number` is called among the things of a world: a name that nothing there has."""
    taken = {item.name for item in world.obstacles} | {mesh.name for mesh in world.meshes}
    name = f"robot {number}"
    while name in taken:
        name += "'"
    return name


def highest_floor(world: World) -> float:
    """Return the height of the highest floor or ramp, metres."""
    return max((item.base_m + item.height_m for item in world.obstacles if item.kind.is_driven_on), default=0.0)
