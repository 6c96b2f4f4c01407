"""Robots in one world: a scene steps all of them together, and a body is one of them.

A `WorldScene` holds what is one for all: the engine, the step, and who meets whom. A `BodyInWorld` holds what is a
robot's own: its plan of the world (heights decide what its hull, wheels and sonar meet), what walks and what has
moved, its collisions. A body that is made by itself is the only one of a scene. How robots move, and what they do
to each other, is the scene's own.

To another robot's sonar and to a plan a robot is an upright box: the hull of its model, where it stands now.

Invariant: a thing that walks is where its path leads at the step to which the scene was brought.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import ClassVar, NamedTuple

from p2os.errors import WorldError
from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import STEP_NS, BodyState, Hit, Turned, Wheels
from p2os.pioneer.body.ray_cast import Direction, Echo, cast, echoes, narrow_parts
from p2os.pioneer.sonar.ring import Cone, cones
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import Obstacle, Pose, Walker, World
from p2os.pioneer.world.plan import Plan, StaticPlan
from p2os.pioneer.world.start_places import floor_height
from p2os.robots.parameters import RobotParameters
from simbase.errors import UsageError, shown
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos

DT_S = STEP_NS / NS_PER_S


class StandingPose(NamedTuple):
    """Where the middle of a robot's axle is: metres and radians."""

    x_m: float
    y_m: float
    heading_rad: float
    z_m: float = 0.0


class WorldScene(Stateful):
    """Robots in one world, stepped together.

    Its snapshot is that of all of them; a body that is alone in its scene gives it as its own.
    """

    STATE: ClassVar[tuple[str, ...]] = ("_owns",)
    #: They are taken and named once, when the scene is made.
    DERIVED: ClassVar[tuple[str, ...]] = ("bodies", "names")

    dt_ns: Nanos = STEP_NS
    #: The first robot first.
    bodies: "tuple[BodyInWorld, ...]"

    def __init__(self, world: World, robots: int) -> None:
        self.world = world
        #: What each robot is called among the things of the world.
        self.names = tuple(free_name(number, world) for number in range(1, robots + 1))

    def _take(self, bodies: "Iterable[BodyInWorld]") -> None:
        """Take the robots, and let each know the others."""
        self.bodies = tuple(bodies)
        self._owns = tuple(_Own(body) for body in self.bodies)
        for body in self.bodies:
            body.others = tuple(other for other in self.bodies if other is not body)

    def name_robots(self, names: Sequence[str]) -> None:
        """Call the robots otherwise, the first first: names that no thing of the world has."""
        self.names = tuple(names)
        for body, name in zip(self.bodies, names, strict=True):
            body.robot_name = name

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let every robot stand still at its pose in the world as it was made, wheels at angle 0, collisions at 0."""
        raise NotImplementedError

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Turned]:
        """Move all on by `dt_ns` with these rim-speed set-points, left and right, m/s; return their wheels' angles."""
        raise NotImplementedError

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world; one that walks begins at its first point, now."""
        for body in self.bodies:
            entered = body.enter(obstacle)
        self._placed(entered)
        self.changed()

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else; one that walks stays there."""
        for body in self.bodies:
            moved = body.take_place(name, x_m, y_m, heading_rad)
        self._put(moved)
        self.changed()

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        for body in self.bodies:
            body.forget(name)
        self._removed(name)
        self.changed()

    def changed(self) -> None:
        """Prepare for another world: something was put, moved or taken out, or a robot was."""
        for body in self.bodies:
            body.look_anew()

    # What a scene that has an engine does beside -------------------------------------------

    def _placed(self, item: Obstacle) -> None:
        """Make an obstacle that is in the plans now."""

    def _put(self, item: Obstacle) -> None:
        """Put an obstacle that was made where it stands now."""

    def _removed(self, name: str) -> None:
        """Take out an obstacle that is no longer in the plans."""


class BodyInWorld(Stateful):
    """The part of a body that all of them share."""

    STATE: ClassVar[tuple[str, ...]] = ("is_powered", "start", "_steps", "_plan", "_walking", "_moved_things",
                                    "_contacts", "_rim_work_j")  # fmt: skip
    DERIVED: ClassVar[tuple[str, ...]] = ("scene", "_walkers", "_footprint")

    dt_ns: Nanos = STEP_NS

    def __init__(self, scene: WorldScene, parameters: RobotParameters, number: int) -> None:
        self.scene, self.robot_name = scene, scene.names[number]
        self._world, self._parameters = scene.world, parameters
        self._static = StaticPlan(scene.world, parameters)
        self._cones = cones(parameters)
        self._hull = hull_polygon(parameters.body)
        #: No point of the hull is farther from the middle of the axle.
        self.reach_m = max(math.hypot(x, y) for x, y in self._hull)
        #: The other robots of its scene.
        self.others: tuple[BodyInWorld, ...] = ()
        #: Where it stood when its outline was asked for last.
        self._footprint: tuple[StandingPose, Footprint] | None = None
        #: Whether its motors have power; without it a wheel that has come to rest is held by its gear alone.
        self.is_powered = True
        self.begin(scene.world.start)

    @property
    def state(self) -> BodyState:
        """The state after the last step."""
        raise NotImplementedError

    @property
    def things(self) -> tuple[Obstacle, ...]:
        """All that is not part of the building."""
        return self._plan.obstacles

    @property
    def standing_pose(self) -> StandingPose:
        """Where it stands."""
        state = self.state
        return StandingPose(state.x_m, state.y_m, state.heading_rad, state.z_m)

    @property
    def footprint(self) -> Footprint:
        """The outline of its hull where it stands."""
        pose = self.standing_pose
        if self._footprint is None or self._footprint[0] != pose:
            self._footprint = pose, self.footprint_at(pose.x_m, pose.y_m, pose.heading_rad)
        return self._footprint[1]

    def footprint_at(self, x_m: float, y_m: float, heading_rad: float) -> Footprint:
        """Return the outline of its hull at a pose."""
        return Footprint.of_polygon(self.robot_name, placed(self._hull, x_m, y_m, heading_rad))

    def who_stands_at_start(self, leaving: "Collection[BodyInWorld]" = ()) -> str | None:
        """Return the name of another robot that stands where this one began, or None.

        Args:
            leaving: Robots that go away at the same moment.
        """
        hull = placed(self._hull, self.start.x_m, self.start.y_m, self.start.heading_rad)
        there = (body for body in self.others if body not in leaving and body.footprint.overlaps(hull))
        return next((body.robot_name for body in there), None)

    def begin(self, start: Pose) -> None:
        """Count from step 0, in the world as it was made; `start` is where it begins."""
        self.start = start
        self._steps = 0
        #: What the motors gave and took at the rims, joules.
        self._rim_work_j = 0.0
        self._plan = Plan((), self._parameters, self._static)
        #: What walks, and the step at which it began.
        self._walking: dict[str, int] = {}
        self._walkers: dict[str, Walker] = {}
        self._moved_things: dict[str, None] = {}
        self._contacts = ContactCounter()
        for item in self._world.obstacles:
            if not item.fixed:
                self.enter(item)

    def _restored(self) -> None:
        walks = {item.name: item.walk for item in self._plan.obstacles}
        self._walkers = {name: Walker(walk) for name in self._walking if (walk := walks[name]) is not None}

    def snapshot(self) -> PartState:
        """Return the scene's state where this robot is alone in it; else nothing: that of many is the scene's."""
        return PartState() if self.others else self.scene.snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned.

        Raises:
            TypeError: It is no snapshot of such a body.
        """
        if not self.others:
            self.scene.restore(snapshot)

    def _steps_to_roll(self, turn_rad: float, rim_mps: float) -> int:
        """Return how many whole steps a wheel whose rim has a speed takes for a way, rad."""
        return int(turn_rad * self._parameters.body.wheel_diameter_m / (2 * rim_mps * DT_S))

    # One of its scene ------------------------------------------------------------------------

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step with these rim-speed set-points.

        Raises:
            UsageError: There are other robots in its scene, which steps all of them together.
        """
        if self.others:
            raise UsageError("robots of one scene are stepped together", hint="Scene.step, or MultiRobotWorld.bring")
        (turned,) = self.scene.step(((left_mps, right_mps),))
        return turned

    def hold(self, left_mps: float, right_mps: float, steps: int) -> Sequence[Wheels]:
        """Make so many steps with these set-points.

        Raises:
            UsageError: There are other robots in its scene, which steps all of them together.
        """
        # None is read before the last is asked for: a body in another program makes them all at once.
        return [self.step(left_mps, right_mps) for _ in range(steps)]

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Wheels]:
        """Make a step with each of these set-points; see `RobotBody`."""
        return [self.step(*asked) for asked in setpoints]

    def reset(self, pose: Pose, seed: int) -> BodyState:
        """Stand still at a pose in the world as it was made; nothing here is random.

        Raises:
            UsageError: There are other robots in its scene, which is reset as a whole.
        """
        if self.others:
            raise UsageError("robots of one scene are reset together", hint="Scene.reset")
        self.scene.reset((pose,), seed)
        return self.state

    def put_back(self) -> None:
        """Put what was pushed where the world has it; the robot itself is put back by its own."""
        for item in self._plan.pushable(self._world):
            self.move(item.name, item.x_m, item.y_m, item.heading_rad)
            for body in self.scene.bodies:
                body.note_moved(item.name)

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the scene; one that walks begins at its first point, now."""
        self.scene.place(obstacle)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle of the scene somewhere else; one that walks stays there."""
        self.scene.move(name, x_m, y_m, heading_rad)

    def remove(self, name: str) -> None:
        """Take an obstacle out of the scene."""
        self.scene.remove(name)

    def _place_for(self, x_m: float, y_m: float, heading_rad: float) -> float:
        """Return the height of the floor where the robot can stand.

        Raises:
            WorldError: A thing or another robot stands there, or there is no level floor.
        """
        self._tell_plan()
        where, world = f"{x_m:g}, {y_m:g} m", shown(self._world.name)
        if not self._world.contains(x_m, y_m):
            raise WorldError(f"{where} is not in world {world}")
        if self._plan.clearance(x_m, y_m, heading_rad, no_more_than=1.0) == 0.0:
            names = self._plan.touched(x_m, y_m, heading_rad)
            raise WorldError(f"{where} in world {world} is inside {shown(names[0]) if names else 'a low thing'}")
        own = self.footprint_at(x_m, y_m, heading_rad)
        standing = next((other for other in self.others if other.footprint.overlaps(own.polygon)), None)
        if standing is not None:
            raise WorldError(f"{where} in world {world} is where {standing.robot_name} stands")
        height_m = floor_height(self._world, x_m, y_m)
        if height_m is None:
            raise WorldError(f"{where} in world {world} is on a slope")
        return height_m

    # The others, as its sensors meet them -----------------------------------------------------

    def _nearest_robot(self, nearest: float) -> float:
        """Return the plan-view distance from the hull to the nearest other robot, or `nearest` where that is less."""
        if self.others:
            x, y, _, z = self.standing_pose
            hull = self.footprint.polygon
            for other in self.others:
                ox, oy, _, oz = other.standing_pose
                is_level = self._meets_heights(other, oz - z)
                if is_level and math.hypot(ox - x, oy - y) - self.reach_m - other.reach_m < nearest:
                    nearest = min(nearest, other.footprint.distance(hull))
        return nearest

    def _meets_heights(self, other: "BodyInWorld", above_m: float) -> bool:
        """Tell whether the hulls reach to one height, the other's floor so much above this one's."""
        own, its = self._parameters.body, other._parameters.body  # noqa: SLF001  # one of its own kind
        return (
            its.ground_clearance_m + above_m <= own.hull_height_m
            and own.ground_clearance_m <= its.hull_height_m + above_m
        )

    def _echoing_robots(self, x: float, y: float, rays: Sequence[Direction], longest_m: float) -> list[Footprint]:
        """Return the hulls of other robots that some rays may meet, in the plane of the ring where it stands now."""
        found: list[Footprint] = []
        if not self.others:
            return found
        ring_m = self.standing_pose.z_m + self._parameters.sonar_height_m
        xs, ys = [x, *(x + longest_m * dx for dx, _ in rays)], [y, *(y + longest_m * dy for _, dy in rays)]
        x0, y0, x1, y1 = min(xs), min(ys), max(xs), max(ys)
        for other in self.others:
            ox, oy, _, oz = other.standing_pose
            reach, shape = other.reach_m, other._parameters.body  # noqa: SLF001  # one of its own kind
            if (
                x0 - reach <= ox <= x1 + reach
                and y0 - reach <= oy <= y1 + reach
                and shape.ground_clearance_m <= ring_m - oz <= shape.hull_height_m
            ):
                found.append(other.footprint)
        return found

    def _rays(self, cone: Cone) -> tuple[float, float, list[Direction]]:
        """Return where a sensor is in the plan and the directions of its rays, the rightmost first."""
        px, py, heading, _ = self.standing_pose
        c, s = math.cos(heading), math.sin(heading)
        x, y = px + cone.x_m * c - cone.y_m * s, py + cone.x_m * s + cone.y_m * c
        return x, y, [(dx * c - dy * s, dx * s + dy * c) for dx, dy in cone.directions]

    def _robot_ranges(self, cone: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a cone goes to another robot, metres; `longest_m` where it meets none."""
        x, y, rays = self._rays(cone)
        found: list[float] = []
        for first, last in narrow_parts(cone.headings_rad):
            part = rays[first:last]
            found += cast(self._echoing_robots(x, y, part, longest_m), x, y, part, longest_m)
        return found

    def _with_robots(self, numbers: Sequence[int], met: list[list[Echo]]) -> list[list[Echo]]:
        """Return the echoes of some sonar, nearer where another robot stands before what they met."""
        if not self.others:
            return met
        longest, found = self._parameters.sonar_range_m, []
        for number, own in zip(numbers, met, strict=True):
            x, y, rays = self._rays(self._cones[number])
            robots = echoes(self._echoing_robots(x, y, rays, longest), x, y, rays, longest)
            found.append([min(pair, key=lambda echo: echo.range_m) for pair in zip(own, robots, strict=True)])
        return found

    def sees(self, number: int, other: "BodyInWorld", its_number: int) -> float | None:
        """Return how far one of its sonar is from one of another's, metres, where each stands in the other's beam.

        None where they do not face each other, are out of range, or something stands between them.
        """
        own, its = self.standing_pose, other.standing_pose
        longest = self._parameters.sonar_range_m
        if math.hypot(its.x_m - own.x_m, its.y_m - own.y_m) > longest + self.reach_m + other.reach_m:
            return None
        x, y = _point(own, self._cones[number])
        ox, oy = _point(its, other._cones[its_number])  # noqa: SLF001  # one of its own kind
        far, bearing = math.hypot(ox - x, oy - y), math.atan2(oy - y, ox - x)
        if (
            not 0.0 < far <= longest
            or not _is_in_beam(self._cones[number], bearing - own.heading_rad)
            or not _is_in_beam(other._cones[its_number], bearing + math.pi - its.heading_rad)  # noqa: SLF001  # as above
        ):
            return None
        way = ((ox - x) / far, (oy - y) / far)
        self._tell_plan()
        box = (min(x, ox), min(y, oy), max(x, ox), max(y, oy))
        between = list(self._plan.echoing_within(*box))
        between += [robot.footprint for robot in self.others if robot is not other]
        is_free = cast(between, x, y, [way], far)[0] >= far
        return far if is_free else None

    # What changes ----------------------------------------------------------------------------

    def take_moved(self) -> list[Obstacle]:
        """Return what has walked or was pushed since this was asked last, where it is now."""
        self._tell_plan()
        if not self._moved_things:
            return []
        moved, self._moved_things = self._moved_things, {}
        return [item for item in self._plan.obstacles if item.name in moved]

    def take_hits(self) -> list[Hit]:
        """Return the collisions since this was asked last."""
        return self._contacts.take_hits()

    def enter(self, obstacle: Obstacle) -> Obstacle:
        """Put an obstacle into the plan; return it where it stands now."""
        if obstacle.walk is not None:
            walker = Walker(obstacle.walk)
            obstacle = obstacle.standing_at(*walker.pose_at(0.0))
        self._plan.place(obstacle)
        if obstacle.walk is not None:
            self._walking[obstacle.name], self._walkers[obstacle.name] = self._steps, walker
        return obstacle

    def take_place(self, name: str, x_m: float, y_m: float, heading_rad: float) -> Obstacle:
        """Note in the plan that an obstacle stands somewhere else for good; return it there."""
        moved = self._plan.move(name, x_m, y_m, heading_rad)
        self._walking.pop(name, None)
        return moved

    def forget(self, name: str) -> None:
        """Take an obstacle out of the plan."""
        self._plan.remove(name)
        self._walking.pop(name, None)

    def note_moved(self, name: str) -> None:
        """Remember that a thing has moved."""
        self._moved_things[name] = None

    def _walked(self) -> Iterator[tuple[str, tuple[float, float, float]]]:
        """Yield the name and the pose, by now, of everything that walks."""
        for name, since in self._walking.items():
            yield name, self._walkers[name].pose_at((self._steps - since) * DT_S)

    def _note_hit(self, name: str, x_m: float, y_m: float) -> None:
        """Remember a collision."""
        self._contacts.note(Hit(at_ns=self._steps * STEP_NS, name=name, x_m=x_m, y_m=y_m))

    def look_anew(self) -> None:
        """Prepare for a plan that is another one now."""

    def _tell_plan(self) -> None:
        """Let the plan know where things are that an engine moves."""


class _Own:
    """What of a body is its own, as a part of its scene."""

    def __init__(self, body: BodyInWorld) -> None:
        self._body = body

    def snapshot(self) -> PartState:
        """Return the state of the robot without that of the scene."""
        return Stateful.snapshot(self._body)

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        Stateful.restore(self._body, snapshot)


def free_name(number: int, world: World) -> str:
    """Return what robot `number` is called among the things of a world: a name that nothing there has."""
    taken = {item.name for item in world.obstacles} | {mesh.name for mesh in world.meshes}
    name = f"robot {number}"
    while name in taken:
        name += "'"
    return name


def _point(pose: StandingPose, cone: Cone) -> tuple[float, float]:
    """Return where a sensor of a robot is in the plan."""
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    return pose.x_m + cone.x_m * c - cone.y_m * s, pose.y_m + cone.x_m * s + cone.y_m * c


def _is_in_beam(cone: Cone, bearing_rad: float) -> bool:
    """Tell whether a bearing in the robot's frame lies in a cone."""
    right, left = cone.headings_rad[0], cone.headings_rad[-1]
    return abs(math.remainder(bearing_rad - (right + left) / 2, math.tau)) <= (left - right) / 2
