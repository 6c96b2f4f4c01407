"""The physical body: PyBullet at 1 kHz.

The drive wheels collide as spheres (they touch the floor in one point; cylinders
scrub and turn 7 degrees short) and drive on a thick box, not on a plane. Wheels
and caster touch floors only, the hull touches everything; so a wheel's sphere,
wider than the real tyre, never brushes a wall. Every body has a client of its own.

Not modelled: tyre scrub and wheel-size errors, battery sag, things that can be pushed.
"""

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from p2os.parameters import RobotParameters
from p2os.pioneer.body import STEP_NS, BodyState, Turned
from p2os.pioneer.bullet.engine import pybullet
from p2os.pioneer.bullet.model import (
    FLOOR_GROUP,
    LEFT,
    OBSTACLE_GROUP,
    RIGHT,
    add_floor,
    add_obstacle,
    add_robot,
    move_obstacle,
    park_obstacle,
)
from p2os.pioneer.contacts import ContactCounter
from p2os.pioneer.plan import Plan
from p2os.pioneer.scenery import Obstacle, Pose, World
from p2os.pioneer.sonar import cones, reading
from p2os.timing import NS_PER_S, Nanos

#: Steps after a reset in which the robot comes to rest on its wheels.
SETTLE_STEPS = 300
#: A wheel is stalled when its motor gives this share of its torque, its rim is slower than that, for so many steps.
STALL_TORQUE_SHARE = 0.95
STALL_RIM_MPS = 0.05
STALL_STEPS = 200
#: Bullet keeps contact points a little apart; touching is no farther than this, m.
TOUCH_M = 1e-4
WHEELS = (LEFT, RIGHT)


class BulletBody:
    """A differential drive with mass, torque limits and friction."""

    name = "bullet"
    note: str | None = None
    dt_ns: Nanos = STEP_NS

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        self._world = world
        self._parameters = parameters
        self._cones = cones(parameters)
        self._radius_m = parameters.body.wheel_diameter_m / 2
        #: The engine takes its client as a keyword of every call.
        self._client = pybullet.connect(pybullet.DIRECT)
        self._state: BodyState | None = None
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
        self._build([(item, True) for item in self._world.obstacles], pose)
        for _ in range(SETTLE_STEPS):
            pybullet.stepSimulation(physicsClientId=self._client)
        joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._zero = (joints[0][0], joints[1][0])
        self._contacts = ContactCounter()
        self._stalling = [0, 0]
        self._joints = joints
        self._state = None
        return self.state

    def _build(self, made: Sequence[tuple[Obstacle, bool]], pose: Pose) -> None:
        """Make the engine's world anew.

        The engine finds bodies again by their order, so each keeps its place from
        its making on: a thing that was taken out is parked, not removed.
        """
        client = self._client
        pybullet.resetSimulation(physicsClientId=client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=STEP_NS / NS_PER_S, deterministicOverlappingPairs=1, enableFileCaching=0,
            physicsClientId=client,
        )  # fmt: skip
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        self._floors = {add_floor(self._world, client)}
        self._robot, self._centre = add_robot(self._parameters, pose, client)
        self._plan = Plan((), self._parameters.body)
        #: Every obstacle ever made, by the engine's number, and whether it stands in the world.
        self._made: dict[int, tuple[Obstacle, bool]] = {}
        for obstacle, stands in made:
            self.place(obstacle)
            if not stands:
                self.remove(obstacle.name)
        self._targets = (0.0, 0.0)
        self._command()

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step with these rim-speed set-points."""
        if (left_mps, right_mps) != self._targets:
            self._targets = (left_mps, right_mps)
            self._command()
        pybullet.stepSimulation(physicsClientId=self._client)
        self._contacts.update(touching=self._is_touching())
        left, right = self._joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._stall(0, left)
        self._stall(1, right)
        self._state = None
        return Turned(left[0] - self._zero[0], right[0] - self._zero[1])

    def _command(self) -> None:
        """Give the motors their targets; the engine does not save them with its state."""
        torque = self._parameters.body.motor_torque_nm
        pybullet.setJointMotorControlArray(
            self._robot, WHEELS, pybullet.VELOCITY_CONTROL,
            targetVelocities=[speed / self._radius_m for speed in self._targets], forces=[torque, torque],
            physicsClientId=self._client,
        )  # fmt: skip

    def _is_touching(self) -> bool:
        points = pybullet.getContactPoints(bodyA=self._robot, linkIndexA=-1, physicsClientId=self._client)
        return any(point[8] <= TOUCH_M and point[2] not in self._floors for point in points)

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

    def _stall(self, wheel: int, joint: tuple[float, ...]) -> None:
        """Count the steps for which a wheel's motor strains in vain."""
        strains = abs(joint[3]) > STALL_TORQUE_SHARE * self._parameters.body.motor_torque_nm
        slow = abs(joint[1]) * self._radius_m < STALL_RIM_MPS
        self._stalling[wheel] = min(STALL_STEPS, self._stalling[wheel] + 1) if strains and slow else 0

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres; the rays tilt with the body."""
        _, longest = self.state, self._parameters.sonar_range_m
        starts: list[tuple[float, ...]] = []
        ends: list[tuple[float, ...]] = []
        for number in numbers:
            cone = self._cones[number]
            start = self._world_point(cone.x_m, cone.y_m)
            for heading in cone.headings_rad:
                starts.append(start)
                x, y = cone.x_m + longest * math.cos(heading), cone.y_m + longest * math.sin(heading)
                ends.append(self._world_point(x, y))
        hits = cast(
            "list[tuple[Any, ...]]",
            pybullet.rayTestBatch(
                starts, ends, collisionFilterMask=OBSTACLE_GROUP | FLOOR_GROUP, physicsClientId=self._client
            ),
        )
        rays = len(hits) // len(numbers) if numbers else 0
        return [
            reading(longest * min(hit[2] for hit in hits[rays * place : rays * (place + 1)]), self._parameters)
            for place in range(len(numbers))
        ]

    def _world_point(self, x_m: float, y_m: float) -> tuple[float, ...]:
        """Return a point of the sonar ring's plane in the world."""
        m, z_m = self._matrix, self._parameters.sonar_height_m
        return tuple(
            self._origin[row] + m[3 * row] * x_m + m[3 * row + 1] * y_m + m[3 * row + 2] * z_m for row in range(3)
        )

    def clearance(self) -> float:
        """Return the plan-view distance from the hull to the nearest thing that it could touch, metres."""
        state = self.state
        return self._plan.clearance(state.x_m, state.y_m, state.heading_rad)

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world."""
        self._plan.place(obstacle)
        number = add_obstacle(obstacle, self._client)
        self._made[number] = (obstacle, True)
        if obstacle.kind.is_driven_on:
            self._floors.add(number)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else."""
        moved = self._plan.move(name, x_m, y_m, heading_rad)
        number = self._number(name)
        self._made[number] = (moved, True)
        move_obstacle(number, moved, self._client)

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        self._plan.remove(name)
        number = self._number(name)
        self._made[number] = (self._made[number][0], False)
        park_obstacle(number, self._client)

    def _number(self, name: str) -> int:
        return next(number for number, (item, stands) in self._made.items() if stands and item.name == name)

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
            "stalling": tuple(self._stalling),
            "state": self.state,
        }

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, in this body or in a new one."""
        saved = cast("dict[str, Any]", snapshot)
        self._build(saved["made"], self._world.start)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "state.bullet"
            path.write_bytes(saved["engine"])
            pybullet.restoreState(fileName=str(path), physicsClientId=self._client)
        self._targets = saved["targets"]
        self._command()
        self._zero = saved["zero"]
        self._contacts.restore(saved["contacts"])
        self._stalling = list(saved["stalling"])
        self._joints = pybullet.getJointStates(self._robot, WHEELS, physicsClientId=self._client)
        self._read()
        self._state = saved["state"]
