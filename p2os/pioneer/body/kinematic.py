"""The exact body: a plan view without mass, without any dependency.

Within a step both rims keep their set-points and the path is the exact arc.
Slopes are flat to it; walls and echoes are those at the height of the hull and
of the sonar ring; what is lower than the hull stops the wheels, unless it is a
sill. A step that would bring the hull into a thing does not happen: the robot slides
along the thing where one slower wheel leads past it, without friction, else the wheels
stall until the set-points lead away. A thing that can be pushed slides out of
the way, without turning, where it has room and its friction is less than what
the motors can push. What walks by itself goes on through the robot. Another
robot of the same world stops it as a wall does.

It serves as the oracle for the other bodies, and where PyBullet is not to be had.
"""

import math
from collections.abc import Sequence

from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.body.in_world import DT_S, BodyInWorld
from p2os.pioneer.body.other_robots import OtherRobots, StandingPose
from p2os.pioneer.body.ray_cast import Direction, Echo, cast, echoes, narrow_parts
from p2os.pioneer.sonar.ring import Cone, cones, reading
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters

#: Below this turn in one step the arc is a straight line to double precision, rad.
STRAIGHT_RAD = 1e-9
#: Farther than this nothing is measured exactly, m: it only bounds how soon the next look is due.
LOOK_AHEAD_M = 2.0
#: Where the set-points lead into a thing, one wheel is tried at these shares of its own (chosen).
SLIDING_SHARES = (0.75, 0.5, 0.25, 0.0)
#: What walks is moved each 10 ms (chosen: 8 mm at a walker's pace).
WALK_STEPS = 10
GRAVITY_MPS2 = 9.81


class KinematicBody(BodyInWorld):
    """A differential drive on a plan."""

    STATE = ("_start", "_x", "_y", "_heading", "_left_angle", "_right_angle", "_left", "_right", "_asked", "_stalled",
             "_is_bumped", "_blocked_at", "_free_m")  # fmt: skip
    #: The other robots of a world are made known by `join`.
    DERIVED = ("_cos", "_sin", "_other_robots")

    name = "kinematic"

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        super().__init__(world, parameters)
        self._cones = cones(parameters)
        self._track_m = parameters.track_mm / 1000
        self._radius_m = parameters.body.wheel_diameter_m / 2
        body = parameters.body
        self._hull = hull_polygon(body)
        self._other_robots: OtherRobots | None = None
        #: The greatest force of both motors together, N.
        self._push_n = 2 * body.motor_torque_nm / self._radius_m
        self._longest_m = parameters.sonar_range_m
        #: How far any point of the hull moves when the robot turns by 1 rad.
        self._hull_reach = math.hypot(max(body.hull_front_m, body.hull_rear_m), body.hull_width_m / 2)
        self._x, self._y, self._heading, self._cos, self._sin = 0.0, 0.0, 0.0, 1.0, 0.0
        self.reset(world.start, 0)

    def _restored(self) -> None:
        super()._restored()
        self._take_pose(self._x, self._y, self._heading)

    @property
    def note(self) -> str | None:
        """That slopes are flat, where the world has some."""
        return "the kinematic body is a plan view: slopes are flat to it" if self._world.has_slopes else None

    @property
    def state(self) -> BodyState:
        """The state after the last step."""
        return BodyState(
            x_m=self._x,
            y_m=self._y,
            heading_rad=math.remainder(self._heading, 2 * math.pi),
            left_angle_rad=self._left_angle,
            right_angle_rad=self._right_angle,
            left_speed_mps=self._left,
            right_speed_mps=self._right,
            forward_mps=(self._left + self._right) / 2,
            turn_radps=(self._right - self._left) / self._track_m,
            stalled_left=self._stalled and self._asked[0] != 0.0,
            stalled_right=self._stalled and self._asked[1] != 0.0,
            collisions=self._contacts.collisions,
            in_contact=self._contacts.touching,
        )

    @property
    def standing_pose(self) -> StandingPose:
        """Where it stands, without the rest of its state."""
        return StandingPose(self._x, self._y, self._heading)

    def join(self, other_robots: OtherRobots | None) -> None:
        """Meet others from now on, also after a reset."""
        self._other_robots = other_robots

    def bump(self) -> None:
        """Feel that another robot has driven against the hull."""
        self._is_bumped = True

    def reset(self, pose: Pose, seed: int) -> BodyState:
        """Stand still at a pose in the world as it was made; nothing here is random."""
        del seed
        self._begin()
        self._start = pose
        self._begin_at(pose)
        return self.state

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        super().put_back()
        self._begin_at(self._start)

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere."""
        self._place_for(x_m, y_m, heading_rad)
        self._take_pose(x_m, y_m, heading_rad)
        self._left = self._right = 0.0
        self._stalled = False
        self._changed()

    def _begin_at(self, pose: Pose) -> None:
        """Stand still at a pose, wheels at angle 0, collisions at 0."""
        self._take_pose(pose.x_m, pose.y_m, pose.heading_rad)
        self._left_angle = self._right_angle = self._left = self._right = 0.0
        self._asked = (0.0, 0.0)
        self._stalled = False
        #: Another robot has driven against this one since the last step.
        self._is_bumped = False
        #: The last set-points, where they would have brought the hull into a thing.
        self._blocked_at: tuple[float, float] | None = None
        self._contacts = ContactCounter()
        #: No thing is nearer to the hull than this; 0 only where the hull is inside one.
        self._free_m = 0.0
        self._changed()

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step along the exact arc, or stall."""
        self._steps += 1
        if self._walking and self._steps % WALK_STEPS == 0:
            self._walk()
        self._asked = asked = (left_mps, right_mps)
        if left_mps == 0.0 and right_mps == 0.0:
            return self._stand()
        arc = self._arc(left_mps, right_mps)
        robots_near = self._other_robots is not None and bool(self._other_robots.near)
        # What was blocked stays so: neither the pose nor the plan has changed since; other robots may have.
        is_known = asked == self._blocked_at and not robots_near
        rims = asked if not is_known and self._take(arc) else None
        is_touching = rims is None or self._is_bumped or self._free_m == 0.0
        if rims is None and not is_known:
            rims = self._slide(left_mps, right_mps)
            self._blocked_at = asked if rims is None and not robots_near else None
        self._stalled = rims is None
        if self._contacts.update(touching=is_touching):
            self._note_contact(*arc[:3])
        self._is_bumped = False
        self._left, self._right = rims or (0.0, 0.0)
        self._left_angle += self._left * DT_S / self._radius_m
        self._right_angle += self._right * DT_S / self._radius_m
        return Turned(self._left_angle, self._right_angle)

    def _arc(self, left_mps: float, right_mps: float) -> tuple[float, float, float, float, float, float]:
        """Return where one step leads: x, y, heading, its cosine and sine, and the farthest way of a point, metres."""
        forward, turn = (left_mps + right_mps) / 2 * DT_S, (right_mps - left_mps) / self._track_m * DT_S
        c, s = self._cos, self._sin
        heading = self._heading + turn
        if abs(turn) < STRAIGHT_RAD:
            x, y = self._x + forward * c, self._y + forward * s
            if heading != self._heading:
                c, s = math.cos(heading), math.sin(heading)
        else:
            radius, c, s = forward / turn, math.cos(heading), math.sin(heading)
            x = self._x + radius * (s - self._sin)
            y = self._y - radius * (c - self._cos)
        return x, y, heading, c, s, abs(forward) + abs(turn) * self._hull_reach

    def _take(self, arc: tuple[float, float, float, float, float, float]) -> bool:
        """Go where a step leads; tell whether nothing is in the way."""
        x, y, heading, c, s, travel = arc
        others = self._other_robots
        if others is not None and others.near and self._meets(others, x, y, heading):
            return False
        if self._free_m > travel:
            self._free_m -= travel
        elif self._is_blocked(x, y, heading):
            return False
        self._x, self._y, self._heading, self._cos, self._sin = x, y, heading, c, s
        return True

    def _slide(self, left_mps: float, right_mps: float) -> tuple[float, float] | None:
        """Go on with one wheel slower, where that leads along what is in the way; return the rims' speeds."""
        if left_mps == 0.0 or right_mps == 0.0:
            return None
        for share in SLIDING_SHARES:
            for rims in ((left_mps, right_mps * share), (left_mps * share, right_mps)):
                if self._take(self._arc(*rims)):
                    return rims
        return None

    def _stand(self) -> Turned:
        """Stand for one step, and feel what has come to touch the hull."""
        self._left = self._right = 0.0
        self._stalled = False
        if self._contacts.update(touching=self._is_bumped or self._free_m == 0.0):
            self._note_contact(self._x, self._y, self._heading)
        self._is_bumped = False
        return Turned(self._left_angle, self._right_angle)

    def _take_pose(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Take a pose, and what is often asked of its heading."""
        self._x, self._y, self._heading = x_m, y_m, heading_rad
        self._cos, self._sin = math.cos(heading_rad), math.sin(heading_rad)

    def _is_blocked(self, x: float, y: float, heading: float) -> bool:
        """Tell whether the pose is inside a thing, and keep the bound on what is free around the hull.

        A robot that is inside one already (because it was put there) may move.
        """
        free = self._plan.clearance(x, y, heading, no_more_than=LOOK_AHEAD_M)
        if free == 0.0 and self._free_m > 0.0:
            if not self._push(x, y, heading):
                return True
            if self._contacts.update(touching=True, steps=0):
                self._note_contact(x, y, heading)
            free = self._plan.clearance(x, y, heading, no_more_than=LOOK_AHEAD_M)
        self._free_m = free
        return False

    def _note_contact(self, x: float, y: float, heading: float) -> None:
        """Remember a collision at a pose, whether or not the robot may take it."""
        robots = () if self._other_robots is None else self._other_robots.touchable()
        self._note_hit(*self._plan.contact(x, y, heading, robots))

    def _meets(self, other_robots: OtherRobots, x: float, y: float, heading: float) -> bool:
        """Tell whether another robot is in the way, and let it feel so; one that was put into another may move."""
        reach = self._hull_reach
        close = [
            other for other in other_robots.near
            if math.hypot(other.current[0] - x, other.current[1] - y) <= reach + other.reach_m
        ]  # fmt: skip
        if not close:
            return False
        hull = placed(self._hull, x, y, heading)
        shapes = [(other, other.footprint(other.current)) for other in close]
        found = [(other, shape) for other, shape in shapes if shape.overlaps(hull)]
        if not found:
            return False
        here = placed(self._hull, self._x, self._y, self._heading)
        if any(shape.overlaps(here) for _, shape in found):
            return False
        for other, _ in found:
            other.bump()
        return True

    def _push(self, x: float, y: float, heading: float) -> bool:
        """Push what is in the way; tell whether all of it went."""
        names = self._plan.touched(x, y, heading)
        things = [item for item in self._plan.obstacles if item.name in names and item.mass_kg > 0]
        resistance_n = sum(item.mass_kg * item.friction * GRAVITY_MPS2 for item in things)
        if len(things) < len(names) or resistance_n > self._push_n:
            return False
        robots = (
            () if self._other_robots is None else [other.footprint(other.current) for other in self._other_robots.near]
        )
        if not all(self._plan.push(item.name, x, y, heading, robots) for item in things):
            return False
        self._moved_things |= dict.fromkeys(item.name for item in things)
        return True

    def _walk(self) -> None:
        """Put everything that walks where it is by now."""
        for name, pose in self._walked():
            self._plan.move(name, *pose)
            self._moved_things[name] = None
        self._changed()

    def _changed(self) -> None:
        """Prepare for a plan that is another one now."""
        self._blocked_at = None
        self._free_m = self._plan.clearance(self._x, self._y, self._heading, no_more_than=LOOK_AHEAD_M)

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres."""
        return [self._range(number) for number in numbers]

    def _range(self, number: int) -> float:
        x, y, rays = self._rays(self._cones[number])
        return reading(min(self._cast(x, y, rays, self._longest_m)), self._parameters)

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a fan goes, metres."""
        x, y, rays = self._rays(fan)
        found: list[float] = []
        for first, last in narrow_parts(fan.headings_rad):
            found += self._cast(x, y, rays[first:last], longest_m)
        return found

    def _cast(self, x: float, y: float, rays: Sequence[Direction], longest_m: float) -> list[float]:
        return cast(self._echoing(x, y, rays, longest_m), x, y, rays, longest_m)

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        found = []
        for number in numbers:
            x, y, rays = self._rays(self._cones[number])
            found.append(echoes(self._echoing(x, y, rays, self._longest_m), x, y, rays, self._longest_m))
        return found

    def _rays(self, cone: Cone) -> tuple[float, float, list[Direction]]:
        """Return where a sensor is and the directions of its rays, the rightmost first."""
        c, s = self._cos, self._sin
        x, y = self._x + cone.x_m * c - cone.y_m * s, self._y + cone.x_m * s + cone.y_m * c
        return x, y, [(dx * c - dy * s, dx * s + dy * c) for dx, dy in cone.directions]

    def _echoing(self, x: float, y: float, rays: Sequence[Direction], longest_m: float) -> Sequence[Footprint]:
        xs, ys = [x, *(x + longest_m * dx for dx, _ in rays)], [y, *(y + longest_m * dy for _, dy in rays)]
        box = (min(xs), min(ys), max(xs), max(ys))
        if self._other_robots is None:
            return self._plan.echoing_within(*box)
        return [*self._plan.echoing_within(*box), *self._other_robots.echoing_within(*box)]

    def most_radps(self, rim_mps: float) -> float | None:
        """Return how fast a wheel turns at most while it is told no more than `rim_mps`."""
        return rim_mps / self._radius_m

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return the distance from the hull to the nearest thing that it could touch, metres, or `no_more_than`."""
        free = self._plan.clearance(self._x, self._y, self._heading, no_more_than=no_more_than)
        if self._other_robots is None:
            return free
        hull = placed(self._hull, self._x, self._y, self._heading)
        return min([free, *(shape.distance(hull) for shape in self._other_robots.touchable())])
