"""The exact body: a plan view without mass, without any dependency.

Within a step both rims keep their set-points and the path is the exact arc.
Slopes are flat to it; walls and echoes are those at the height of the hull and
of the sonar ring; what is lower than the hull stops the wheels, unless it is a
sill. A step that would bring the hull into a thing does not happen: the robot slides
along the thing where one slower wheel leads past it, without friction, else the wheels
stall until the set-points lead away. A thing that can be pushed slides out of
the way, without turning, where it has room and its friction is less than what
the motors can push. What walks by itself goes on through the robot. Another
robot gives way as such a thing does, along the shortest way out of the hull that
pushes it and without turning, where there is room and where its own hold is less
than what the motors behind it can push (`physical` has the shares). Its wheels turn
by the part of the way that lies along its heading, and count. Robots move one after
the other within a step, the first first, and hulls never overlap.

It has no torques. The work at its rims is what the robot's mass asks for when the set-points change, and what it
takes to push things and robots; a rim that is slowed down or pushed by what it meets does none (`rim_work`).

It serves as the oracle for the other bodies, and where PyBullet is not to be had.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from itertools import islice, repeat

from p2os.pioneer.body.contacts import APART_STEPS, ContactCounter
from p2os.pioneer.body.contract import BodyState, Turned, free_wheels
from p2os.pioneer.body.in_world import DT_S, BodyInWorld, StandingPose, WorldScene
from p2os.pioneer.body.physical import BACK_DRIVE, GRAVITY_MPS2, UNPOWERED_SHARE, WHEEL_FRICTION
from p2os.pioneer.body.ray_cast import Direction, Echo, cast, echoes, narrow_parts
from p2os.pioneer.body.rim_work import RimLoad
from p2os.pioneer.sonar.ring import Cone, reading
from p2os.pioneer.world.geometry import Footprint, placed
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.pioneer.world.plan import APART_M
from p2os.robots.parameters import RobotParameters

#: Below this turn in one step the arc is a straight line to double precision, rad.
STRAIGHT_RAD = 1e-9
#: Farther than this nothing is measured exactly, m: it only bounds how soon the next look is due.
LOOK_AHEAD_M = 2.0
#: Where the set-points lead into a thing, one wheel is tried at these shares of its own (chosen).
SLIDING_SHARES = (0.75, 0.5, 0.25, 0.0)
#: More than a bound on what is free has lost by rounding, m.
ROUNDING_M = 1e-9
#: What walks is moved each 10 ms (chosen: 8 mm at a walker's pace).
WALK_STEPS = 10
#: Robots whose circles are farther apart are not looked at until they have moved by as much, m. chosen: below the
#: distance at which robots begin; four times as much cost half of the step of 64 robots.
SPARE_M = 0.1


#: Of a robot: where it stands, what it is asked, and whether its motors have power.
_Standing = tuple[float, float, float, tuple[float, float], bool]


class KinematicScene(WorldScene):
    """Robots on one plan, one after the other in each step."""

    DERIVED = ("_spare_m",)

    name = "kinematic"
    bodies: "tuple[KinematicBody, ...]"

    def __init__(
        self, world: World, models: Sequence[RobotParameters], starts: Sequence[Pose] | None = None
    ) -> None:  # fmt: skip
        super().__init__(world, len(models))
        #: By so much two robots that are not near to each other can still close in.
        self._spare_m = 0.0
        self._take(KinematicBody(self, model, number) for number, model in enumerate(models))
        self.reset(starts or [world.start] * len(models), 0)

    def _restored(self) -> None:
        self._spare_m = 0.0

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let every robot stand still at its pose in the world as it was made; nothing here is random."""
        del seed
        for body, pose in zip(self.bodies, poses, strict=True):
            body.begin_at_start(pose)
        self.changed()

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Turned]:
        """Move all on by one step, the first robot first."""
        if len(self.bodies) == 1:
            ((left_mps, right_mps),) = setpoints
            return (self.bodies[0].go(left_mps, right_mps),)
        fastest = max(max(abs(left), abs(right)) for left, right in setpoints)
        # An axle moves no faster than its faster rim; one that is pushed, than a corner of what pushes it.
        self._spare_m -= 4 * fastest * DT_S
        if self._spare_m <= 0.0:
            self._find_near()
        return [body.go(*asked) for body, asked in zip(self.bodies, setpoints, strict=True)]

    def changed(self) -> None:
        """Prepare for another world."""
        self._spare_m = 0.0
        super().changed()

    def thing_moved(self, by: "KinematicBody", name: str) -> None:
        """Tell the others that one robot has pushed a thing."""
        for other in by.others:
            other.follow_thing(by.thing(name))

    def _find_near(self) -> None:
        """Find which robots could meet before they have moved by `SPARE_M`: a sweep along x."""
        self._spare_m = SPARE_M
        near: dict[KinematicBody, list[KinematicBody]] = {body: [] for body in self.bodies}
        row = sorted((body.standing_pose[:2], number) for number, body in enumerate(self.bodies))
        widest = max(body.reach_m for body in self.bodies)
        for place, ((x, y), number) in enumerate(row):
            body = self.bodies[number]
            for (other_x, other_y), other_number in row[place + 1 :]:
                if other_x - x > body.reach_m + widest + SPARE_M:
                    break
                other = self.bodies[other_number]
                if math.hypot(other_x - x, other_y - y) <= body.reach_m + other.reach_m + SPARE_M:
                    near[body].append(other)
                    near[other].append(body)
        for body, found in near.items():
            body.near = tuple(other for other in body.others if other in found)


class KinematicBody(BodyInWorld):
    """A differential drive on a plan."""

    STATE = ("_x", "_y", "_heading", "_left_angle", "_right_angle", "_left", "_right", "_asked", "_stalled",
             "_is_bumped", "_blocked_at", "_free_m", "_carried_m", "_driven", "_steady_j")  # fmt: skip
    DERIVED = ("_cos", "_sin", "near", "_held", "_felt")

    name = "kinematic"
    scene: KinematicScene
    others: "tuple[KinematicBody, ...]"

    def __init__(self, scene: KinematicScene, parameters: RobotParameters, number: int) -> None:
        super().__init__(scene, parameters, number)
        self._track_m = parameters.track_mm / 1000
        self._radius_m = parameters.body.wheel_diameter_m / 2
        #: The greatest force of both motors together, and of tyres that scrape sideways, N.
        self._push_n = 2 * parameters.body.motor_torque_nm / self._radius_m
        self._scrape_n = WHEEL_FRICTION * parameters.body.mass_kg * GRAVITY_MPS2
        self._load = RimLoad(parameters)
        self._longest_m = parameters.sonar_range_m
        #: The robots that it could meet soon.
        self.near: tuple[KinematicBody, ...] = ()
        #: How all stood when others last kept it where it is, and whom it drove against; None while not known twice.
        self._held: tuple[list[_Standing], tuple[KinematicBody, ...] | None] | None = None
        #: Whom it has driven against in this step.
        self._felt: list[KinematicBody] = []
        self._x, self._y, self._heading, self._cos, self._sin = 0.0, 0.0, 0.0, 1.0, 0.0

    def _restored(self) -> None:
        super()._restored()
        self._held = None
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
            contact_rad=self._contacts.bearing_rad(self._x, self._y, self._heading),
            rim_work_j=self._rim_work_j,
        )

    @property
    def standing_pose(self) -> StandingPose:
        """Where it stands."""
        return StandingPose(self._x, self._y, self._heading)

    @property
    def footprint(self) -> Footprint:
        """The outline of its hull where it stands."""
        if self._footprint is not None:  # robots that push each other ask little else
            (x, y, heading, _), outline = self._footprint
            if x == self._x and y == self._y and heading == self._heading:
                return outline
        return super().footprint

    def begin_at_start(self, pose: Pose) -> None:
        """Stand still at a pose in the world as it was made."""
        self.begin(pose)
        self._begin_at(pose)

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        super().put_back()
        self._begin_at(self.start)
        self.scene.changed()

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere."""
        self._place_for(x_m, y_m, heading_rad)
        self._take_pose(x_m, y_m, heading_rad)
        self._left = self._right = 0.0
        self._driven = (0.0, 0.0)
        self._stalled = False
        self.scene.changed()

    def _begin_at(self, pose: Pose) -> None:
        """Stand still at a pose, wheels at angle 0, collisions at 0."""
        self._take_pose(pose.x_m, pose.y_m, pose.heading_rad)
        self._left_angle = self._right_angle = self._left = self._right = 0.0
        self._asked = (0.0, 0.0)
        #: The rims' speeds by their own motors: without what another robot has pushed.
        self._driven = (0.0, 0.0)
        #: The work of a step in which these do not change, joules; None: not worked out.
        self._steady_j: float | None = None
        self._stalled = False
        #: Another robot has driven against this one since the last step, and has pushed it along its heading so far.
        self._is_bumped, self._carried_m = False, 0.0
        #: The last set-points, where they would have brought the hull into a thing.
        self._blocked_at: tuple[float, float] | None = None
        self._contacts = ContactCounter()
        #: No thing is nearer to the hull than this; 0 only where the hull is inside one.
        self._free_m = 0.0

    def go(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step along the exact arc, or stall."""
        self._steps += 1
        if self._walking and self._steps % WALK_STEPS == 0:
            self._walk()
        self._asked = asked = (left_mps, right_mps)
        if left_mps == 0.0 and right_mps == 0.0:
            return self._stand()
        arc = self._arc(left_mps, right_mps)
        # What was blocked stays so until the pose or the plan changes, or a robot that could be met.
        is_known = self._is_held() if self.near else asked == self._blocked_at
        rims = asked if not is_known and self._take(arc) else None
        is_touching = rims is None or self._is_bumped or self._free_m == 0.0
        if rims is None and not is_known:
            rims = self._slide(left_mps, right_mps)
            self._note_blocked(is_blocked=rims is None)
        elif rims is not None:
            self._blocked_at = self._held = None
        self._stalled = rims is None
        contacts = self._contacts
        if (is_touching or contacts.apart < APART_STEPS) and contacts.update(touching=is_touching):
            self._note_contact(*arc[:3])
        # What is in the way slows a rim down, not its motor.
        if rims == asked:
            if asked != self._driven:
                self._rim_work_j += self._load.work_j(self._driven, asked, DT_S)
                self._steady_j = None
            else:
                if self._steady_j is None:
                    self._steady_j = self._load.work_j(asked, asked, DT_S)
                self._rim_work_j += self._steady_j
        self._left, self._right = self._driven = rims or (0.0, 0.0)
        return self._turn_wheels()

    def hold(self, left_mps: float, right_mps: float, steps: int) -> Sequence[Turned]:
        """Make so many steps with these set-points; see `RobotBody`."""
        asked = (left_mps, right_mps)
        made: list[Turned] = []
        while (left := steps - len(made)) > 0:
            on = self._stand_on(left) if asked == (0.0, 0.0) else self._roll_on(repeat(asked, left))
            made += on or [self.step(left_mps, right_mps)]
        return made

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Turned]:
        """Make a step with each of these set-points; see `RobotBody`."""
        made: list[Turned] = []
        while len(made) < len(setpoints):
            made += self._roll_on(islice(setpoints, len(made), None)) or [self.step(*setpoints[len(made)])]
        return made

    def _roll_on(self, setpoints: Iterable[tuple[float, float]]) -> list[Turned]:
        """Make those first steps that surely lead nowhere near a thing: what as many of `go` do."""
        if self._is_stepped_by_others or self._is_bumped or self._contacts.apart < APART_STEPS:
            return []
        x, y, heading, c, s, free = self._x, self._y, self._heading, self._cos, self._sin, self._free_m
        left_angle, right_angle, work_j, driven = self._left_angle, self._right_angle, self._rim_work_j, self._driven
        steady_j, last, made = self._steady_j, None, list[Turned]()
        for asked in islice(setpoints, self._steps_until_walk):
            if asked is not last:
                if asked == (0.0, 0.0):
                    break
                left_mps, right_mps = last = asked
                forward, turn = self._ways(left_mps, right_mps)
                travel, is_straight = abs(forward) + abs(turn) * self.reach_m, abs(turn) < STRAIGHT_RAD
                radius = 0.0 if is_straight else forward / turn
                left_rad, right_rad = left_mps * DT_S / self._radius_m, right_mps * DT_S / self._radius_m
            if free <= travel:
                break
            free -= travel
            before, heading, old_c, old_s = heading, heading + turn, c, s
            if heading != before:
                c, s = math.cos(heading), math.sin(heading)
            if is_straight:
                x, y = x + forward * old_c, y + forward * old_s
            else:
                x, y = x + radius * (s - old_s), y - radius * (c - old_c)
            if asked is not driven and asked != driven:
                steady_j, step_j = None, self._load.work_j(driven, asked, DT_S)
            else:
                step_j = steady_j = self._load.work_j(asked, asked, DT_S) if steady_j is None else steady_j
            work_j += step_j
            driven = asked
            left_angle, right_angle = left_angle + left_rad, right_angle + right_rad
            made.append(free_wheels(left_angle, right_angle))
        if made:
            self._x, self._y, self._heading, self._cos, self._sin, self._free_m = x, y, heading, c, s, free
            self._left_angle, self._right_angle, self._rim_work_j = left_angle, right_angle, work_j
            self._asked = self._driven = self._left, self._right = driven
            self._blocked_at, self._steady_j = None, steady_j
            self._steps += len(made)
        return made

    def _stand_on(self, steps: int) -> list[Turned]:
        """Make up to so many steps in which the robot goes on standing: what as many of `go` do."""
        until_walk = self._steps_until_walk
        if self._is_stepped_by_others or self._is_bumped or self._driven != (0.0, 0.0) or until_walk == 0:
            return []
        steps = steps if until_walk is None else min(steps, until_walk)
        turned = self.go(0.0, 0.0)
        self._steps += steps - 1
        self._contacts.update(touching=self._free_m == 0.0, steps=steps - 1)
        return [turned] * steps

    @property
    def _steps_until_walk(self) -> int | None:
        """How many steps are left until something that walks is moved; None: for ever."""
        return WALK_STEPS - 1 - self._steps % WALK_STEPS if self._walking else None

    def _turn_wheels(self) -> Turned:
        """Turn the wheels by this step, and by how far another robot has pushed them since the last."""
        if self._is_bumped:
            pushed_mps = self._carried_m / DT_S
            self._left, self._right = self._left + pushed_mps, self._right + pushed_mps
            self._is_bumped, self._carried_m = False, 0.0
        self._left_angle += self._left * DT_S / self._radius_m
        self._right_angle += self._right * DT_S / self._radius_m
        if self._stalled:
            return Turned(self._left_angle, self._right_angle, self._asked[0] != 0.0, self._asked[1] != 0.0)
        return free_wheels(self._left_angle, self._right_angle)

    def _ways(self, left_mps: float, right_mps: float) -> tuple[float, float]:
        """Return how far a step leads along, metres, and around, rad."""
        return (left_mps + right_mps) / 2 * DT_S, (right_mps - left_mps) / self._track_m * DT_S

    def _arc(self, left_mps: float, right_mps: float) -> tuple[float, float, float, float, float, float]:
        """Return where one step leads: x, y, heading, its cosine and sine, and the farthest way of a point, metres."""
        forward, turn = self._ways(left_mps, right_mps)
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
        return x, y, heading, c, s, abs(forward) + abs(turn) * self.reach_m

    def _take(self, arc: tuple[float, float, float, float, float, float]) -> bool:
        """Go where a step leads; tell whether nothing is in the way."""
        x, y, heading, c, s, travel = arc
        if self.near and self._meets_robots(x, y, heading):
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

    def _is_held(self) -> bool:
        """Tell whether other robots keep it where it is as they did before, and let them feel it again."""
        self._felt.clear()
        if self._held is None:
            return False
        before, felt = self._held
        if before != self._all_standing():
            self._held = None
        elif felt is not None:
            for other in felt:
                other.feel_push()
            return True
        return False

    def _note_blocked(self, *, is_blocked: bool) -> None:
        """Remember what has kept it where it is, if anything has."""
        self._blocked_at = self._asked if is_blocked and not self.near else None
        if not is_blocked or not self.near:
            self._held = None
            return
        # Once is not enough: what it tried on the way may have moved others.
        standing = self._all_standing()
        is_same = self._held is not None and self._held[0] == standing
        self._held = standing, tuple(self._felt) if is_same else None

    def _all_standing(self) -> list[_Standing]:
        """Return all that decides whether others give way, but for the plan."""
        return [self.standing, *[other.standing for other in self.others]]

    @property
    def standing(self) -> _Standing:
        """What others depend on."""
        return self._x, self._y, self._heading, self._asked, self.is_powered

    def _stand(self) -> Turned:
        """Stand for one step, and feel what has come to touch the hull."""
        self._left = self._right = 0.0
        if self._driven != (0.0, 0.0):
            self._rim_work_j += self._load.work_j(self._driven, (0.0, 0.0), DT_S)
            self._driven = (0.0, 0.0)
        self._stalled = False
        if self._contacts.update(touching=self._is_bumped or self._free_m == 0.0):
            self._note_contact(self._x, self._y, self._heading)
        return self._turn_wheels() if self._is_bumped else Turned(self._left_angle, self._right_angle)

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
        self._note_hit(*self._plan.contact(x, y, heading, [other.footprint for other in self.others]))

    # Robots and things in the way -----------------------------------------------------------

    def _meets_robots(self, x: float, y: float, heading: float) -> bool:
        """Tell whether another robot is in the way and does not give way; one that was put into another may move."""
        found = self._overlapped(x, y, heading)
        if not found:
            return False
        here = self.footprint.polygon
        if any(other.footprint.overlaps(here) for other in found):
            return False
        for other in found:
            other.feel_push()
        self._felt += found
        moves = self._pushed_robots(found, x, y, heading, (self,))
        if moves is None or sum(hold_n for _, _, _, hold_n in moves) >= self._push_n:
            return True
        for other, dx, dy, hold_n in moves:
            other.give_way(dx, dy)
            self._rim_work_j += hold_n * math.hypot(dx, dy)
        if self._contacts.update(touching=True, steps=0):
            self._note_contact(x, y, heading)
        return False

    def _overlapped(self, x: float, y: float, heading: float) -> "list[KinematicBody]":
        """Return the robots that the hull would overlap at a pose."""
        reach, found = self.reach_m, []
        hull = None
        for other in self.near:
            if math.hypot(other._x - x, other._y - y) <= reach + other.reach_m:  # noqa: SLF001 - of its own class
                hull = hull or placed(self._hull, x, y, heading)
                if other.footprint.overlaps(hull):
                    found.append(other)
        return found

    def _pushed_robots(
        self, found: "list[KinematicBody]", x: float, y: float, heading: float, pushing: "tuple[KinematicBody, ...]"
    ) -> "list[tuple[KinematicBody, float, float, float]] | None":
        """Return how far each robot must be pushed out of the hull at a pose, and what holds it, N; None: no room.

        Args:
            found: The robots that the hull overlaps there.
            x: Where the hull is to be.
            y: The same.
            heading: The same.
            pushing: This robot and those behind it, which cannot be pushed themselves.
        """
        moves: list[tuple[KinematicBody, float, float, float]] = []
        if not found:
            return moves
        hull = placed(self._hull, x, y, heading)
        for other in found:
            if other in pushing:
                return None
            dx, dy = other.footprint.way_out(hull)
            length = math.hypot(dx, dy)
            if length == 0.0:
                continue
            share = 1 + APART_M / length
            dx, dy = dx * share, dy * share
            further = other.what_it_pushes(dx, dy, (*pushing, other))
            if further is None:
                return None
            moves += [*further, (other, dx, dy, other.hold_n(dx / length, dy / length))]
        robots = [robot for robot, _, _, _ in moves]
        return moves if len(set(robots)) == len(robots) else None

    def what_it_pushes(
        self, dx: float, dy: float, pushing: "tuple[KinematicBody, ...]"
    ) -> "list[tuple[KinematicBody, float, float, float]] | None":
        """Return what is pushed when this robot gives way by (dx, dy), metres; None where a thing stands there."""
        x, y, way = self._x + dx, self._y + dy, math.hypot(dx, dy)
        if self._free_m <= way and self._plan.clearance(x, y, self._heading, no_more_than=LOOK_AHEAD_M) == 0.0:
            return None
        return self._pushed_robots(self._overlapped(x, y, self._heading), x, y, self._heading, pushing)

    def hold_n(self, dx: float, dy: float) -> float:
        """Return the force that it takes to push this robot along a unit direction, N."""
        along, across = dx * self._cos + dy * self._sin, dy * self._cos - dx * self._sin
        drives = self._asked[0] + self._asked[1]
        if not self.is_powered:
            share = UNPOWERED_SHARE
        elif drives == 0.0 or drives * along < 0.0:
            share = BACK_DRIVE
        else:
            share = 1.0  # it drives the same way, slower: its motors brake
        return abs(along) * share * self._push_n + abs(across) * self._scrape_n

    def feel_push(self) -> None:
        """Feel that another robot has driven against the hull."""
        self._is_bumped = True

    def give_way(self, dx_m: float, dy_m: float) -> None:
        """Be pushed by another robot; the wheels roll along the heading and scrape across."""
        self._is_bumped = True
        self._carried_m += dx_m * self._cos + dy_m * self._sin
        self._x, self._y = self._x + dx_m, self._y + dy_m
        self._free_m = self._plan.clearance(self._x, self._y, self._heading, no_more_than=LOOK_AHEAD_M)
        self._blocked_at = None

    def _push(self, x: float, y: float, heading: float) -> bool:
        """Push what is in the way; tell whether all of it went."""
        names = self._plan.touched(x, y, heading)
        things = [item for item in self._plan.obstacles if item.name in names and item.mass_kg > 0]
        resistance_n = sum(item.mass_kg * item.friction * GRAVITY_MPS2 for item in things)
        if len(things) < len(names) or resistance_n > self._push_n:
            return False
        robots = [other.footprint for other in self.others]
        if not all(self._plan.push(item.name, x, y, heading, robots) for item in things):
            return False
        for item in things:
            there = self._plan.find(item.name)
            way_m = math.hypot(there.x_m - item.x_m, there.y_m - item.y_m)
            self._rim_work_j += item.mass_kg * item.friction * GRAVITY_MPS2 * way_m
            self.note_moved(item.name)
            self.scene.thing_moved(self, item.name)
        return True

    def thing(self, name: str) -> Obstacle:
        """Return a thing where it stands now."""
        return self._plan.find(name)

    def follow_thing(self, item: Obstacle) -> None:
        """Take over where another robot has pushed a thing."""
        self._plan.move(item.name, item.x_m, item.y_m, item.heading_rad)
        self.note_moved(item.name)
        self.look_anew()

    def _walk(self) -> None:
        """Put everything that walks where it is by now."""
        for name, pose in self._walked():
            self._plan.move(name, *pose)
            self.note_moved(name)
        self.look_anew()

    def look_anew(self) -> None:
        """Prepare for a plan that is another one now."""
        self._blocked_at = self._held = None
        self._free_m = self._plan.clearance(self._x, self._y, self._heading, no_more_than=LOOK_AHEAD_M)

    # Sensors ---------------------------------------------------------------------------------

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

    def _echoing(self, x: float, y: float, rays: Sequence[Direction], longest_m: float) -> Collection[Footprint]:
        things = self._plan.all_echoing
        if things is None:
            xs, ys = [x, *(x + longest_m * dx for dx, _ in rays)], [y, *(y + longest_m * dy for _, dy in rays)]
            things = self._plan.echoing_within(min(xs), min(ys), max(xs), max(ys))
        return [*things, *self._echoing_robots(x, y, rays, longest_m)] if self.others else things

    @property
    def _is_stepped_by_others(self) -> bool:
        """Whether its steps are not its own alone: other robots are there, or its scene has another `step`."""
        return bool(self.others) or type(self.scene).step is not KinematicScene.step

    def steps_within(self, turn_rad: float, rim_mps: float) -> int:
        """Return for how many steps no wheel turns farther while it is told no more; 0 where a robot may push it."""
        return 0 if self._is_stepped_by_others else self._steps_to_roll(turn_rad, rim_mps)

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return the distance from the hull to the nearest thing that it could touch, metres, or `no_more_than`."""
        # Where nothing is as near, which its own steps know, nobody looks.
        free = no_more_than
        if self._free_m <= no_more_than + ROUNDING_M:
            free = self._plan.clearance(self._x, self._y, self._heading, no_more_than=no_more_than)
        return self._nearest_robot(free)
