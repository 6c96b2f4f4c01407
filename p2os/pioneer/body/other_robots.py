"""The other robots of a world, as one of them meets them: hulls that stand where they were last seen.

To another robot a robot is an upright box: the hull of its model, from its underside to its
top. Nothing here moves a robot; `multi_robot_world` knows where each stands.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol, runtime_checkable

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import Obstacle, World
from p2os.pioneer.world.plan import Bands
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful

#: Footprints kept of one robot: where it stands now, and where it stood at the last boundary.
KEPT = 2


class StandingPose(NamedTuple):
    """Where the middle of a robot's axle is: metres and radians."""

    x_m: float
    y_m: float
    heading_rad: float


class OtherRobot(Stateful):
    """One robot as the others meet it.

    Args:
        name: What it is called among the things of the others' worlds.
        parameters: Its model.
        body: Itself.
        rise_m: How much taller it is taken for, so that it stands on every floor of the world at once.
    """

    STATE = ("current", "at_boundary")
    #: Footprints that were asked for.
    DERIVED = ("_shapes",)

    def __init__(self, name: str, parameters: RobotParameters, body: RobotBody, rise_m: float = 0.0) -> None:
        shape = parameters.body
        self.name, self.body = name, body
        self._sees_others = body if isinstance(body, SeesOtherRobots) else None
        self._hull = hull_polygon(shape)
        self._ahead_m = (shape.hull_front_m - shape.hull_rear_m) / 2
        self._outline = Obstacle(
            name=name, x_m=0.0, y_m=0.0, length_m=shape.hull_front_m + shape.hull_rear_m, width_m=shape.hull_width_m,
            base_m=shape.ground_clearance_m, height_m=shape.hull_height_m - shape.ground_clearance_m + rise_m,
        )  # fmt: skip
        #: No point of the hull is farther from the middle of its axle.
        self.reach_m = self._outline.reach_m + abs(self._ahead_m)
        self._shapes: dict[StandingPose, Footprint] = {}
        #: Where it was seen last, and where it stood at the last boundary of the multi-robot world.
        self.current = StandingPose(0.0, 0.0, 0.0)
        self.at_boundary = self.look()

    def look(self) -> StandingPose:
        """Take where it stands now from its body; return it."""
        if self._sees_others is not None:
            self.current = self._sees_others.standing_pose
        else:
            state = self.body.state
            self.current = StandingPose(state.x_m, state.y_m, state.heading_rad)
        return self.current

    def obstacle(self, standing_pose: StandingPose) -> Obstacle:
        """Return the robot as a thing that stands somewhere."""
        x, y, heading = self._middle(standing_pose)
        return replace(self._outline, x_m=x, y_m=y, heading_rad=heading)

    def footprint(self, standing_pose: StandingPose) -> Footprint:
        """Return its plan where it stands."""
        shape = self._shapes.get(standing_pose)
        if shape is None:
            if len(self._shapes) >= KEPT:
                self._shapes.clear()
            shape = self._shapes[standing_pose] = Footprint.of_polygon(self.name, placed(self._hull, *standing_pose))
        return shape

    def bump(self) -> None:
        """Report a contact: another robot has driven against it."""
        if self._sees_others is not None:
            self._sees_others.bump()

    def move_in(self, body: RobotBody, standing_pose: StandingPose) -> None:
        """Put it somewhere in the world of a body that keeps a copy of it there."""
        body.move(self.name, *self._middle(standing_pose))

    def _middle(self, standing_pose: StandingPose) -> StandingPose:
        x, y, heading = standing_pose
        return StandingPose(x + self._ahead_m * math.cos(heading), y + self._ahead_m * math.sin(heading), heading)


class OtherRobots:
    """All others, for one robot."""

    def __init__(self, others: Sequence[OtherRobot], parameters: RobotParameters) -> None:
        bands = Bands(parameters)
        self.others = tuple(others)
        seen_as = [(other, other.obstacle(other.current)) for other in others]
        self._echoing = tuple(other for other, shape in seen_as if bands.echoes(shape))
        self._touched = frozenset(other.name for other, shape in seen_as if bands.is_touched(shape))
        #: Those with which it runs step by step until the next boundary, and those of them that its hull could meet.
        self.close_to: tuple[OtherRobot, ...] = ()
        self.near: tuple[OtherRobot, ...] = ()

    @property
    def is_close(self) -> bool:
        """Whether it runs step by step with others."""
        return bool(self.close_to)

    def come_near(self, near: Iterable[OtherRobot]) -> None:
        """Note who is near until the next boundary; none: it runs by itself."""
        self.close_to = tuple(near)
        self.near = tuple(other for other in self.close_to if other.name in self._touched)

    def standing_pose_of(self, other: OtherRobot) -> StandingPose:
        """Return where this robot sees another one."""
        return other.current if self.is_close else other.at_boundary

    def echoing_within(self, x0: float, y0: float, x1: float, y1: float) -> Iterator[Footprint]:
        """Return the others whose hulls may reach into a rectangle and echo this robot's sonar."""
        for other in self._echoing:
            standing_pose, reach = self.standing_pose_of(other), other.reach_m
            if x0 - reach <= standing_pose[0] <= x1 + reach and y0 - reach <= standing_pose[1] <= y1 + reach:
                yield other.footprint(standing_pose)

    def touchable(self) -> Iterator[Footprint]:
        """Return every other robot that this one's hull could meet, wherever it is."""
        return (other.footprint(self.standing_pose_of(other)) for other in self.others if other.name in self._touched)


@runtime_checkable
class SeesOtherRobots(Protocol):
    """A body that looks for the others itself, when it needs to; other bodies keep copies of them in their worlds."""

    @property
    def standing_pose(self) -> StandingPose:
        """Where it stands, without the rest of its state."""
        ...

    def join(self, other_robots: OtherRobots | None) -> None:
        """Share the world with others from now on, also after a reset."""
        ...

    def bump(self) -> None:
        """Take a contact: another robot has driven against the hull."""
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
