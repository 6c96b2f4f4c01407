"""The physical body: PyBullet at 1 kHz.

The drive wheels collide as spheres (they touch the floor in one point; cylinders
scrub and turn 7 degrees short) and drive on a thick box, not on a plane. Wheels
and caster touch floors and what is lower than the hull, the hull touches all
else; so a wheel's sphere, wider than the real tyre, never brushes a wall (but it
meets a low thing up to 6 cm beside the tyre). Every body has a client of its own.

What can be pushed is a rigid body; what walks is put along its path in each step.
Whatever is fixed is merged into one body. Wheels slip where the floor's friction
gives way, and stall where the motors do.

Not modelled: tyre scrub and wheel-size errors, battery sag.
"""

import math
import tempfile
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any, cast

from p2os.pioneer.body.bullet.engine import pybullet, start_anew
from p2os.pioneer.body.bullet.model import (
    ECHOING,
    LEFT,
    RIGHT,
    add_building,
    add_floor,
    add_obstacle,
    add_robot,
    merged,
    move_obstacle,
    park_obstacle,
)
from p2os.pioneer.body.bullet.rays import SonarRays
from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import MOST_HITS, STEP_NS, BodyState, Hit, Turned
from p2os.pioneer.body.physical import (
    FLOOR_GROUP,
    LOW_GROUP,
    PUSHED_M,
    SETTLE_STEPS,
    STALL_RIM_MPS,
    STALL_STEPS,
    STALL_TORQUE_SHARE,
    group_of,
)
from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import cones, reading
from p2os.pioneer.world.model import Obstacle, Pose, Walker, World
from p2os.pioneer.world.plan import Bands, Plan, StaticPlan
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_S, Nanos

#: Bullet keeps contact points a little apart; touching is no farther than this, m.
TOUCH_M = 1e-4
#: No point of the hull is faster than this: both rims at the highest ceiling of any model, against each other, m/s.
FASTEST_MPS = 8.0
#: Farther than this from everything, contacts need not be looked for; looked again after so many steps otherwise.
FAR_M, LOOK_STEPS = 0.1, 50
_DT_S = STEP_NS / NS_PER_S
WHEELS = (LEFT, RIGHT)


class BulletBody:
    """A differential drive with mass, torque limits and friction."""

    name = "bullet"
    note: str | None = None
    dt_ns: Nanos = STEP_NS

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        self._world = world
        self._parameters = parameters
        self._sonar_rays = SonarRays(cones(parameters), parameters.sonar_height_m, parameters.sonar_range_m)
        self._bands = Bands(parameters)
        self._static = StaticPlan(world, parameters)
        torque = parameters.body.motor_torque_nm
        self._forces = [torque, torque]
        self._straining_nm = STALL_TORQUE_SHARE * torque
        self._slow_radps = STALL_RIM_MPS / (parameters.body.wheel_diameter_m / 2)
        self._radius_m = parameters.body.wheel_diameter_m / 2
        #: The engine takes its client as a keyword of every call.
        self._client = pybullet.connect(pybullet.DIRECT)
        self._state: BodyState | None = None
        #: Steps for which nothing can touch the robot, and steps until that is looked at again.
        self._alone, self._look_in = 0, 0
        self.reset(world.start, 0)

    def __del__(self) -> None:
        client = getattr(self, "_client", -1)
        if client >= 0 and pybullet.isConnected(client):
            pybullet.disconnect(client)

    @property
    def state(self) -> BodyState:
        """The state after the last step, read from the engine when it is asked for."""
        if self._state is None:
            self._state = self._read()
        return self._state

    def reset(self, pose: Pose, seed: int) -> BodyState:
        """Stand still at a pose in the world as it was made; nothing here is random."""
        del seed
        self._steps = 0
        self._build([(item, True) for item in self._world.obstacles if not item.fixed], pose)
        for _ in range(SETTLE_STEPS):
            pybullet.stepSimulation(physicsClientId=self._client)
        joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._zero = (joints[0][0], joints[1][0])
        #: Where the engine's base came to rest: place and turn.
        self._start = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=self._client)
        self._count_anew()
        return self.state

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        client = self._client
        for item in self._plan.pushable(self._world):
            self.move(item.name, item.x_m, item.y_m, item.heading_rad)
            self._moved_things[item.name] = None
        pybullet.resetBasePositionAndOrientation(self._robot, *self._start, physicsClientId=client)
        pybullet.resetBaseVelocity(self._robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), physicsClientId=client)
        for wheel, angle in zip(WHEELS, self._zero, strict=True):
            pybullet.resetJointState(self._robot, wheel, angle, 0.0, physicsClientId=client)
        self._targets = (0.0, 0.0)
        self._command()
        self._count_anew()
        self._changed()

    def _count_anew(self) -> None:
        """Begin to count contacts and stalls, with what the wheels show now."""
        self._contacts = ContactCounter()
        self._hits: deque[Hit] = deque(maxlen=MOST_HITS)
        self._stalling = [0, 0]
        self._joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._state = None

    def _build(self, made: Sequence[tuple[Obstacle, bool]], pose: Pose) -> None:
        """Make the engine's world anew.

        The engine finds bodies again by their order, so each keeps its place from
        its making on: a thing that was taken out is parked, not removed.
        """
        client = self._client
        start_anew(client)
        self._floors = {add_floor(self._world, client)}
        self._robot, self._centre = add_robot(self._parameters, pose, client)
        _, driven_on = add_building(self._world, client)
        self._floors.update(driven_on)
        in_building = {item.name for item in merged(self._world)}
        self._low: set[int] = set()
        for item in self._static.obstacles:
            if item.name not in in_building:
                self._add(item)
        self._plan = Plan((), self._parameters, self._static)
        self._walkers: dict[str, tuple[int, int, Walker]] = {}
        self._pushed: dict[str, int] = {}
        self._moved_things: dict[str, None] = {}
        #: Every obstacle ever made, by the engine's number, and whether it stands in the world.
        self._made: dict[int, tuple[Obstacle, bool]] = {}
        self._is_uneven = bool(driven_on) or any(item.kind.is_driven_on for item in self._static.obstacles)
        self._changed()
        for obstacle, standing_poses in made:
            self.place(obstacle)
            if not standing_poses:
                self.remove(obstacle.name)
        self._targets = (0.0, 0.0)
        self._command()

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step with these rim-speed set-points."""
        client, self._state = self._client, None
        if (left_mps, right_mps) != self._targets:
            self._targets = (left_mps, right_mps)
            self._command()
        self._steps += 1
        if self._walkers:
            self._walk()
        pybullet.stepSimulation(physicsClientId=client)
        left, right = self._joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=client)
        if self._alone:
            self._alone -= 1
            self._contacts.update(touching=False)
        else:
            if self._contacts.update(touching=self._is_touching()):
                self._note_hit()
            self._exchange_poses()
        stalling = self._stalling
        stalling[0] = self._stalled_for(stalling[0], left) if abs(left[3]) > self._straining_nm else 0
        stalling[1] = self._stalled_for(stalling[1], right) if abs(right[3]) > self._straining_nm else 0
        zero = self._zero
        return Turned(left[0] - zero[0], right[0] - zero[1])

    def _exchange_poses(self) -> None:
        """Find for how many steps nothing can touch the robot, so that contacts need not be asked for."""
        self._look_in -= 1
        if self._look_in > 0 or self._contacts.touching or self._is_busy:
            return
        self._look_in = LOOK_STEPS
        state = self.state
        free = self._plan.clearance(state.x_m, state.y_m, state.heading_rad, no_more_than=2.0)
        if free > FAR_M:
            self._alone = int((free - FAR_M / 2) / (FASTEST_MPS * _DT_S))
            self._look_in = 0

    @property
    def _is_busy(self) -> bool:
        """Whether something beside the robot moves, or the plan is not all: contacts are looked for in every step."""
        return bool(self._walkers or self._pushed or self._uneven)

    def _command(self) -> None:
        """Give the motors their targets; the engine does not save them with its state."""
        radius = self._radius_m
        left, right = self._targets
        pybullet.setJointMotorControlArray(
            self._robot, WHEELS, pybullet.VELOCITY_CONTROL,
            targetVelocities=[left / radius, right / radius], forces=self._forces,
            physicsClientId=self._client,
        )  # fmt: skip

    def _walk(self) -> None:
        """Put everything that walks where it is by now; the plan learns of it when it is asked."""
        for name, (number, since, walker) in self._walkers.items():
            x, y, heading = walker.pose_at((self._steps - since) * _DT_S)
            item = self._made[number][0]
            move_obstacle(number, replace(item, x_m=x, y_m=y, heading_rad=heading), self._client)
            self._moved_things[name] = None

    def _is_touching(self) -> bool:
        return bool(self._touching_points())

    def _touching_points(self) -> list[tuple[Any, ...]]:
        """Return the engine's contacts of the hull with anything but a floor, else of the wheels with low things."""
        points = pybullet.getContactPoints(bodyA=self._robot, linkIndexA=-1, physicsClientId=self._client)
        found = [point for point in points if point[8] <= TOUCH_M and point[2] not in self._floors]
        if found or not self._low:
            return found
        points = pybullet.getContactPoints(bodyA=self._robot, physicsClientId=self._client)
        return [point for point in points if point[8] <= TOUCH_M and point[2] in self._low]

    def _note_hit(self) -> None:
        """Remember a collision, at the deepest of its points; what is merged into one body is found by its place."""
        point = min(self._touching_points(), key=itemgetter(8))
        number, (x, y, _) = point[2], point[6]
        if number in self._made:
            name = self._made[number][0].name
        else:
            self._tell_plan()
            name = self._plan.thing_at(x, y)
        self._hits.append(Hit(at_ns=self._steps * STEP_NS, name=name, x_m=x, y_m=y))

    def _read(self) -> BodyState:
        """Return the engine's state as ours, and keep the robot's frame for the rays."""
        client = self._client
        left, right = self._joints
        place, turn = pybullet.getBasePositionAndOrientation(self._robot, physicsClientId=client)
        linear, angular = pybullet.getBaseVelocity(self._robot, physicsClientId=client)
        self._matrix = pybullet.getMatrixFromQuaternion(turn)
        m, (cx, _, cz) = self._matrix, self._centre
        heading = math.atan2(m[3], m[0])
        # The engine's point is the hull's centre of mass: take the axle's middle, on the floor.
        x, y, z = (place[row] - m[3 * row] * cx - m[3 * row + 2] * cz for row in range(3))
        self._origin = (x, y, z)
        return BodyState(
            x_m=x,
            y_m=y,
            z_m=z,
            heading_rad=heading,
            pitch_rad=math.asin(max(-1.0, min(1.0, m[6]))),
            left_angle_rad=left[0] - self._zero[0],
            right_angle_rad=right[0] - self._zero[1],
            left_speed_mps=left[1] * self._radius_m,
            right_speed_mps=right[1] * self._radius_m,
            forward_mps=linear[0] * math.cos(heading) + linear[1] * math.sin(heading),
            turn_radps=angular[2],
            stalled_left=self._stalling[0] >= STALL_STEPS,
            stalled_right=self._stalling[1] >= STALL_STEPS,
            collisions=self._contacts.collisions,
            in_contact=self._contacts.touching,
        )

    def _stalled_for(self, steps: int, joint: tuple[float, ...]) -> int:
        """Return for how many steps a wheel's motor has been stalled."""
        return min(STALL_STEPS, steps + 1) if abs(joint[1]) < self._slow_radps else 0

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres; the rays tilt with the body."""
        hits, rays = self._cast(numbers), self._sonar_rays.rays
        longest = self._sonar_rays.longest_m
        return [
            reading(longest * min(hit[2] for hit in hits[rays * place : rays * (place + 1)]), self._parameters)
            for place in range(len(numbers))
        ]

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        hits, rays = self._cast(numbers), self._sonar_rays.rays
        return [
            self._sonar_rays.echoes(number, hits[rays * place : rays * (place + 1)], self._matrix)
            for place, number in enumerate(numbers)
        ]

    def _cast(self, numbers: Sequence[int]) -> list[tuple[Any, ...]]:
        """Return what the engine returns for each ray of some sonar."""
        if not numbers:
            return []
        _ = self.state  # reads the robot's frame
        starts, ends = self._sonar_rays.points(numbers, self._origin, self._matrix)
        hits = pybullet.rayTestBatch(starts, ends, collisionFilterMask=ECHOING, physicsClientId=self._client)
        return cast("list[tuple[Any, ...]]", hits)

    def clearance(self) -> float:
        """Return the plan-view distance from the hull to the nearest thing that it could touch, metres."""
        state = self.state
        self._tell_plan()
        return self._plan.clearance(state.x_m, state.y_m, state.heading_rad)

    def take_moved(self) -> list[Obstacle]:
        """Return what has walked or was pushed since this was asked last, where it is now."""
        self._tell_plan()
        moved, self._moved_things = self._moved_things, {}
        return [item for item in self._plan.obstacles if item.name in moved]

    def take_hits(self) -> list[Hit]:
        """Return the collisions since this was asked last."""
        hits = list(self._hits)
        self._hits.clear()
        return hits

    def _tell_plan(self) -> None:
        """Let the plan know where things are that the engine moves."""
        for name, (_, since, walker) in self._walkers.items():
            self._plan.move(name, *walker.pose_at((self._steps - since) * _DT_S))
        for name, number in self._pushed.items():
            place, turn = pybullet.getBasePositionAndOrientation(number, physicsClientId=self._client)
            matrix, item = pybullet.getMatrixFromQuaternion(turn), self._plan.find(name)
            if math.dist(place[:2], (item.x_m, item.y_m)) > PUSHED_M:
                self._plan.move(name, place[0], place[1], math.atan2(matrix[3], matrix[0]))
                self._moved_things[name] = None

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world; one that walks begins at its first point, now."""
        if obstacle.walk is not None:
            x, y, heading = obstacle.walk.pose_at(0.0)
            obstacle = replace(obstacle, x_m=x, y_m=y, heading_rad=heading)
        self._plan.place(obstacle)
        number = self._add(obstacle)
        self._made[number] = (obstacle, True)
        if obstacle.walk is not None:
            self._walkers[obstacle.name] = (number, self._steps, Walker(obstacle.walk))
        if obstacle.mass_kg > 0:
            self._pushed[obstacle.name] = number
        self._changed()

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else; one that walks stays there."""
        moved = self._plan.move(name, x_m, y_m, heading_rad)
        self._walkers.pop(name, None)
        number = self._number(name)
        self._made[number] = (moved, True)
        move_obstacle(number, moved, self._client)
        self._changed()

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        self._plan.remove(name)
        self._walkers.pop(name, None)
        self._pushed.pop(name, None)
        number = self._number(name)
        self._made[number] = (self._made[number][0], False)
        park_obstacle(number, self._client)
        self._changed()

    def _add(self, obstacle: Obstacle) -> int:
        """Make an obstacle's body and note what touching it means."""
        number = add_obstacle(obstacle, self._bands, self._client)
        group = group_of(obstacle, self._bands)
        if group == FLOOR_GROUP:
            self._floors.add(number)
        elif group == LOW_GROUP:
            self._low.add(number)
        return number

    def _changed(self) -> None:
        """Look for contacts anew: something else is around the robot now."""
        self._alone, self._look_in = 0, 0
        self._uneven = self._is_uneven or any(item.kind.is_driven_on for item in self._plan.obstacles)

    def _number(self, name: str) -> int:
        return next(
            number for number, (item, standing_poses) in self._made.items() if standing_poses and item.name == name
        )

    def snapshot(self) -> object:
        """Return all that decides the future, as plain values and the engine's own file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "state.bullet"
            pybullet.saveBullet(str(path), physicsClientId=self._client)
            engine = path.read_bytes()
        return {
            "engine": engine,
            "made": tuple(self._made.values()),
            "targets": self._targets,
            "zero": self._zero,
            "contacts": self._contacts.snapshot(),
            "hits": tuple(self._hits),
            "stalling": tuple(self._stalling),
            "state": self.state,
            "steps": self._steps,
            "walking": {name: since for name, (_, since, _) in self._walkers.items()},
            "obstacles": self._plan.obstacles,
            "moved": tuple(self._moved_things),
            "start": self._start,
        }

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, in this body or in a new one."""
        saved = cast("dict[str, Any]", snapshot)
        self._steps = saved["steps"]
        self._build(saved["made"], self._world.start)
        self._plan = Plan(saved["obstacles"], self._parameters, self._static)
        self._moved_things = dict.fromkeys(saved["moved"])
        self._walkers = {
            name: (number, saved["walking"][name], walker)
            for name, (number, _, walker) in self._walkers.items()
            if name in saved["walking"]
        }
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "state.bullet"
            path.write_bytes(saved["engine"])
            pybullet.restoreState(fileName=str(path), physicsClientId=self._client)
        self._targets = saved["targets"]
        self._command()
        self._zero, self._start = saved["zero"], saved["start"]
        self._contacts.restore(saved["contacts"])
        self._hits = deque(saved["hits"], maxlen=MOST_HITS)
        self._stalling = list(saved["stalling"])
        self._joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._read()
        self._state = saved["state"]
