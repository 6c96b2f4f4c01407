"""The physical body: PyBullet at 1 kHz.

The drive wheels collide as spheres (they touch the floor in one point; cylinders
scrub and turn 7 degrees short) and drive on a thick box, not on a plane. Wheels
and caster touch floors and what is lower than the hull, the hull touches all
else; so a wheel's sphere, wider than the real tyre, never brushes a wall (but it
meets a low thing up to 6 cm beside the tyre). Every scene has a client of its own,
in which all its robots stand; their hulls meet each other as they meet all else.

What can be pushed is a rigid body; what walks is put along its path in each step.
Whatever is fixed is merged into one body. Wheels slip where the floor's friction
gives way, and stall where the motors do.

Not modelled: tyre scrub and wheel-size errors, battery sag.
"""

import math
import tempfile
from collections.abc import Iterable, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any, cast

from p2os.pioneer.body.bullet.engine import clients, pybullet, start_anew
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
from p2os.pioneer.body.contacts import APART_STEPS
from p2os.pioneer.body.contract import BodyState, Turned, free_wheels
from p2os.pioneer.body.engine_body import EngineBody, EngineScene
from p2os.pioneer.body.physical import (
    FLOOR_GROUP,
    LOW_GROUP,
    SETTLE_STEPS,
    group_for,
)
from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.pioneer.world.plan import Bands
from p2os.robots.parameters import RobotParameters
from simbase.files import writing_temporary

#: Bullet keeps contact points a little apart; touching is no farther than this, m.
TOUCH_M = 1e-4
#: So much faster than its set-point and than it was turns no wheel of a robot that touches nothing but the floor
#: (measured with set-points that jump, of five models from 0.05 to 2 m/s: 1.38; the rest is chosen).
OVERSHOOT = 2.0
WHEELS = (LEFT, RIGHT)


class BulletScene(EngineScene):
    """Robots and things in one client of the engine."""

    STATE = ("_made", "engine_state")
    #: What `engine_state` makes anew.
    DERIVED = ("floors", "low", "is_uneven", "_numbers")

    name = "bullet"
    bodies: "tuple[BulletBody, ...]"

    def __init__(
        self, world: World, models: Sequence[RobotParameters], starts: Sequence[Pose] | None = None
    ) -> None:  # fmt: skip
        super().__init__(world, len(models))
        self._bands = [Bands(model) for model in models]
        #: The engine takes its client as a keyword of every call.
        self.client = clients.take()
        self._take(BulletBody(self, model, number) for number, model in enumerate(models))
        self.reset(starts or [world.start] * len(models), 0)

    def __del__(self) -> None:
        client = getattr(self, "client", -1)
        if client >= 0 and pybullet.isConnected(client):
            clients.give_back(client)

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let every robot stand still at its pose in the world as it was made; nothing here is random."""
        del seed
        for body, pose in zip(self.bodies, poses, strict=True):
            body.begin(pose)
        self._build([(item, True) for item in self.bodies[0].things], poses)
        for body in self.bodies:
            body.rest()
        for _ in range(SETTLE_STEPS):
            pybullet.stepSimulation(physicsClientId=self.client)
        for body in self.bodies:
            body.begin_here()

    def _build(self, made: Sequence[tuple[Obstacle, bool]], poses: Sequence[Pose]) -> None:
        """Make the engine's world anew.

        The engine finds bodies again by their order, so each keeps its place from
        its making on: a thing that was taken out is parked, not removed.
        """
        client, static = self.client, [item for item in self.world.obstacles if item.fixed]
        start_anew(client, robots=len(self.bodies))
        #: Floors, and what is lower than a hull and stops wheels, by the engine's numbers.
        self.floors = {add_floor(self.world, client)}
        self.low: set[int] = set()
        for body, pose in zip(self.bodies, poses, strict=True):
            body.make(pose)
        _, driven_on = add_building(self.world, client)
        self.floors.update(driven_on)
        in_building = {item.name for item in merged(self.world)}
        for item in static:
            if item.name not in in_building:
                self._add(item)
        #: Every obstacle ever made, by the engine's number, and whether it stands in the world.
        self._made: dict[int, tuple[Obstacle, bool]] = {}
        self.is_uneven = bool(driven_on) or any(item.kind.is_driven_on for item in static)
        #: Those that stand in the world, by name.
        self._numbers: dict[str, int] = {}
        for item, stands in made:
            self._placed(item)
            if not stands:
                self._removed(item.name)
        self.changed()

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Turned]:
        """Move all on by one step with these rim-speed set-points."""
        bodies = self.bodies
        self._count_step(setpoints)
        pybullet.stepSimulation(self.client)
        turned = [body.take_step() for body in bodies]
        for body in bodies:
            body.read_anew()
        return turned

    def name_of(self, number: int) -> str | None:
        """Return what a thing or a robot is called by the engine's number; None for the building."""
        if number in self._made:
            return self._made[number][0].name
        return next((body.robot_name for body in self.bodies if body.robot == number), None)

    def where_is(self, name: str) -> tuple[float, float, Sequence[float]]:
        """Return where a thing that can be pushed is: x, y, and its turn as nine numbers."""
        place, turn = pybullet.getBasePositionAndOrientation(self._numbers[name], physicsClientId=self.client)
        return place[0], place[1], pybullet.getMatrixFromQuaternion(turn)

    def _placed(self, item: Obstacle) -> None:
        number = self._numbers[item.name] = self._add(item)
        self._made[number] = (item, True)

    def _put(self, item: Obstacle) -> None:
        move_obstacle(self._numbers[item.name], item, self.client)

    def _removed(self, name: str) -> None:
        number = self._numbers.pop(name)
        self._made[number] = (self._made[number][0], False)
        park_obstacle(number, self.client)

    def _add(self, obstacle: Obstacle) -> int:
        """Make an obstacle's body and note what touching it means."""
        group = group_for(obstacle, self._bands)
        number = add_obstacle(obstacle, group, self.client)
        if group == FLOOR_GROUP:
            self.floors.add(number)
        elif group & LOW_GROUP:
            self.low.add(number)
        return number

    @property
    def engine_state(self) -> bytes:
        """The engine's own file; it holds addresses too, so that one state can be written in two ways."""
        with writing_temporary(), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "state.bullet"
            pybullet.saveBullet(str(path), physicsClientId=self.client)
            return path.read_bytes()

    @engine_state.setter
    def engine_state(self, saved: bytes) -> None:
        self._build(list(self._made.values()), [self.world.start] * len(self.bodies))
        with writing_temporary(), tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "state.bullet"
            path.write_bytes(saved)
            pybullet.restoreState(fileName=str(path), physicsClientId=self.client)
        for body in self.bodies:
            body.go_on()


class BulletBody(EngineBody):
    """A differential drive with mass, torque limits and friction."""

    STATE = ("_targets", "_start")
    #: What the scene's `engine_state` makes anew, and what is read from the engine.
    DERIVED = ("robot", "_centre", "_joints", "_matrix", "_origin", "_motors", "_commanded")

    _rays_of = SonarRays
    name = "bullet"
    note: str | None = None
    scene: BulletScene

    def __init__(self, scene: BulletScene, parameters: RobotParameters, number: int) -> None:
        super().__init__(scene, parameters, number)
        self._sonar_rays = SonarRays(self._cones, parameters.sonar_height_m, parameters.sonar_range_m)
        self._client = scene.client
        self._targets = (0.0, 0.0)
        #: What the motors were commanded, a rate and a torque each, and what that was worked out from beside the grip
        #: of the wheels.
        self._motors: list[tuple[float, float]] = []
        self._commanded: tuple[object, ...] = ()

    def make(self, pose: Pose) -> None:
        """Make the robot in the engine's empty world."""
        #: The engine's number of it.
        self.robot, self._centre = add_robot(self._parameters, pose, self._client)

    def rest(self) -> None:
        """Hold the wheels while the robot comes to rest on them."""
        self._targets, self._is_at_rest = (0.0, 0.0), [False, False]
        self._command()

    def begin_here(self) -> None:
        """Take the pose to which the robot has come as its start."""
        joints = pybullet.getJointStates(self.robot, WHEELS, physicsClientId=self._client)
        self._zero = (joints[0][0], joints[1][0])
        #: Where the engine's base came to rest: place and turn.
        self._start = pybullet.getBasePositionAndOrientation(self.robot, physicsClientId=self._client)
        self._count_anew()

    def go_on(self) -> None:
        """Go on in an engine whose state was restored; it does not save the motors' targets."""
        self._state = None
        self._command()
        self._joints = pybullet.getJointStates(self.robot, WHEELS, physicsClientId=self._client)

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        super().put_back()
        client = self._client
        pybullet.resetBasePositionAndOrientation(self.robot, *self._start, physicsClientId=client)
        pybullet.resetBaseVelocity(self.robot, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), physicsClientId=client)
        for wheel, angle in zip(WHEELS, self._zero, strict=True):
            pybullet.resetJointState(self.robot, wheel, angle, 0.0, physicsClientId=client)
        self._targets = (0.0, 0.0)
        self._count_anew()
        self._command()
        self.scene.changed()

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere, a hair's breadth above the floor or on it."""
        height_m, (cx, _, cz) = self._place_for(x_m, y_m, heading_rad), self._centre
        place = x_m + cx * math.cos(heading_rad), y_m + cx * math.sin(heading_rad), height_m + cz
        turn, still, client = pybullet.getQuaternionFromEuler((0.0, 0.0, heading_rad)), (0.0, 0.0, 0.0), self._client
        pybullet.resetBasePositionAndOrientation(self.robot, place, turn, physicsClientId=client)
        pybullet.resetBaseVelocity(self.robot, still, still, physicsClientId=client)
        for wheel, joint in zip(
            WHEELS, pybullet.getJointStates(self.robot, WHEELS, physicsClientId=client), strict=True
        ):
            pybullet.resetJointState(self.robot, wheel, joint[0], 0.0, physicsClientId=client)
        self._command()
        self._joints = pybullet.getJointStates(self.robot, WHEELS, physicsClientId=client)
        self._halt()
        self.scene.changed()

    def _count_anew(self) -> None:
        super()._count_anew()
        self._joints = pybullet.getJointStates(self.robot, WHEELS, physicsClientId=self._client)

    def _step_alone(self, setpoints: Iterable[tuple[float, float]]) -> list[Turned]:
        step, take_step, client, made = pybullet.stepSimulation, self.take_step, self._client, list[Turned]()
        commanded: object = None
        for asked in setpoints:
            if self._is_grip_changed or asked is not commanded:
                self._tell_motors(*asked)
                commanded = asked
            self._state = None
            self._steps += 1
            step(client)
            made.append(take_step())
        self._state = None
        return made

    def count_step(self, left_mps: float, right_mps: float) -> None:
        """Begin a step with these rim-speed set-points."""
        self._state = None
        self._tell_motors(left_mps, right_mps)
        self._steps += 1

    def _tell_motors(self, left_mps: float, right_mps: float) -> None:
        """Give the motors these set-points, where that is news to them."""
        commanded = (left_mps, right_mps, self.is_powered, self._most_nm)
        if self._is_grip_changed or commanded != self._commanded:
            self._targets = (left_mps, right_mps)
            if self._wanted_motors() != self._motors:
                self._command()
            self._commanded, self._is_grip_changed = commanded, False

    def take_step(self) -> Turned:
        """Take what the engine's step has made of the robot."""
        # By place: the engine's calls take names of their arguments slowly.
        left, right = self._joints = pybullet.getJointStates(self.robot, WHEELS, self._client)
        if self._alone:
            self._alone -= 1
            if self._contacts.apart < APART_STEPS:
                self._contacts.update(touching=False)
        else:
            if self._contacts.update(touching=self._is_touching()):
                self._note_contact()
            self._look_around()
        asked_left, asked_right = self._targets
        self._watch_motor(LEFT, asked_left, left[3], left[1])
        self._watch_motor(RIGHT, asked_right, right[3], right[1])
        zero_left, zero_right = self._zero
        if self._stalling[LEFT] or self._stalling[RIGHT]:
            return Turned(left[0] - zero_left, right[0] - zero_right, *self._stalled)
        return free_wheels(left[0] - zero_left, right[0] - zero_right)

    def steps_within(self, turn_rad: float, rim_mps: float) -> int:
        """Return for how many steps no wheel turns farther while it is told no more; 0 where something may push it."""
        if self.others:
            return 0
        fastest_mps = max(rim_mps, self._radius_m * max(map(abs, self._rates)))
        return min(self._alone, self._steps_to_roll(turn_rad, OVERSHOOT * fastest_mps))

    def _wanted_motors(self) -> list[tuple[float, float]]:
        left_mps, right_mps = self._targets
        return [self._motor(LEFT, left_mps), self._motor(RIGHT, right_mps)]

    def _command(self) -> None:
        """Give the motors their targets; the engine does not save them with its state."""
        left, right = self._motors = self._wanted_motors()
        self._commanded = ()
        pybullet.setJointMotorControlArray(
            self.robot, WHEELS, pybullet.VELOCITY_CONTROL,
            targetVelocities=[left[0], right[0]], forces=[left[1], right[1]],
            physicsClientId=self._client,
        )  # fmt: skip

    def _is_touching(self) -> bool:
        return bool(self._touching_points())

    def _touching_points(self) -> list[tuple[Any, ...]]:
        """Return the engine's contacts of the hull with anything but a floor, else of the wheels with low things."""
        points = pybullet.getContactPoints(bodyA=self.robot, linkIndexA=-1, physicsClientId=self._client)
        found = [point for point in points if point[8] <= TOUCH_M and point[2] not in self.scene.floors]
        if found or not self.scene.low:
            return found
        points = pybullet.getContactPoints(bodyA=self.robot, physicsClientId=self._client)
        return [point for point in points if point[8] <= TOUCH_M and point[2] in self.scene.low]

    def _note_contact(self) -> None:
        """Remember a collision, at the deepest of its points; what is merged into one body is found by its place."""
        point = min(self._touching_points(), key=itemgetter(8))
        number, (x, y, _) = point[2], point[6]
        self._note_touched(self.scene.name_of(number), x, y)

    def _read(self) -> BodyState:
        """Return the engine's state as ours, and keep the robot's frame for the rays."""
        client = self._client
        place, turn = pybullet.getBasePositionAndOrientation(self.robot, physicsClientId=client)
        linear, angular = pybullet.getBaseVelocity(self.robot, physicsClientId=client)
        self._matrix = pybullet.getMatrixFromQuaternion(turn)
        m, (cx, _, cz) = self._matrix, self._centre
        # The engine's point is the hull's centre of mass: take the axle's middle, on the floor.
        x, y, z = (place[row] - m[3 * row] * cx - m[3 * row + 2] * cz for row in range(3))
        self._origin = (x, y, z)
        return self._state_of((x, y, z), m, [joint[:2] for joint in self._joints], linear[:2], angular[2])

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres; the rays tilt with the body."""
        shares, rays = [hit[2] for hit in self._cast(numbers)], self._sonar_rays.rays
        longest = self._sonar_rays.longest_m
        found = [longest * min(shares[rays * place : rays * (place + 1)]) for place in range(len(numbers))]
        return self._readings(numbers, found)

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        hits, rays = self._cast(numbers), self._sonar_rays.rays
        met = [
            self._sonar_rays.echoes(number, hits[rays * place : rays * (place + 1)], self._matrix)
            for place, number in enumerate(numbers)
        ]
        return self._with_robots(numbers, met)

    def _cast_fan(self, rays: SonarRays) -> list[float]:
        return [rays.longest_m * hit[2] for hit in self._cast((0,), rays)]

    def _cast(self, numbers: Sequence[int], rays: SonarRays | None = None) -> list[tuple[Any, ...]]:
        """Return what the engine returns for each ray of some sonar, or of other rays by their numbers."""
        if not numbers:
            return []
        _ = self.state  # reads the robot's frame
        starts, ends = (rays or self._sonar_rays).points(numbers, self._origin, self._matrix)
        # The engine reads lists faster than arrays.
        hits = pybullet.rayTestBatch(
            starts.tolist(), ends.tolist(), collisionFilterMask=ECHOING, physicsClientId=self._client
        )  # fmt: skip
        return cast("list[tuple[Any, ...]]", hits)

    def _where_is(self, name: str) -> tuple[float, float, Sequence[float]]:
        return self.scene.where_is(name)
