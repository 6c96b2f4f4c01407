"""The second physical body: MuJoCo at 1 kHz, to check the first one by.

The same robot as `bullet`'s: wheels that collide as spheres on a thick floor,
torque limits, friction, and who meets whom (`physical`). What differs is the
engine: contacts are the solution of one convex problem in each step, not of an
iteration that is cut short, so that hardly anything slips that need not.

Not modelled: tyre scrub and wheel-size errors, battery sag; floors of meshes
(refused, see `model`).
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import MOST_HITS, STEP_NS, BodyState, Hit, Turned
from p2os.pioneer.body.mujoco.model import (
    HULL,
    ROBOT,
    ROTORS,
    THING,
    WHEELS,
    floor_geometries,
    low_geometries,
    make_model,
    matrix,
    quaternion,
)
from p2os.pioneer.body.mujoco.rays import SonarRays
from p2os.pioneer.body.physical import (
    PUSHED_M,
    SETTLE_STEPS,
    STALL_RIM_MPS,
    STALL_STEPS,
    STALL_TORQUE_SHARE,
    middle_and_slope,
)
from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import cones, reading
from p2os.pioneer.world.model import Obstacle, Pose, Walker, World
from p2os.pioneer.world.plan import Plan, StaticPlan
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_S, Nanos

#: All that MuJoCo needs to go on alike.
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_DT_S = STEP_NS / NS_PER_S
#: The joints of the robot: its place in the world, its wheels, and what drives them.
ROBOT_JOINTS = (ROBOT, *WHEELS, *ROTORS)


class MujocoBody:
    """A differential drive with mass, torque limits and friction."""

    name = "mujoco"
    dt_ns: Nanos = STEP_NS

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        self._world = world
        self._parameters = parameters
        self._static = StaticPlan(world, parameters)
        self._sonar_rays = SonarRays(cones(parameters), parameters.sonar_height_m, parameters.sonar_range_m)
        self._radius_m = parameters.body.wheel_diameter_m / 2
        self._straining_nm = STALL_TORQUE_SHARE * parameters.body.motor_torque_nm
        self._slow_radps = STALL_RIM_MPS / self._radius_m
        self._state: BodyState | None = None
        self.reset(world.start, 0)

    @property
    def note(self) -> str | None:
        """How it takes meshes, where the world has some."""
        if not self._world.meshes:
            return None
        return "the mujoco body touches a mesh as upright walls over its plan, at the height of the hull"

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
        self._plan = Plan((), self._parameters, self._static)
        self._walkers: dict[str, tuple[int, Walker]] = {}
        self._moved_things: dict[str, None] = {}
        for item in self._world.obstacles:
            if not item.fixed:
                self._keep(item)
        self._build()
        self._data.joint(ROBOT).qpos = (pose.x_m, pose.y_m, pose.z_m, *quaternion(pose.heading_rad))
        for _ in range(SETTLE_STEPS):
            mujoco.mj_step(self._model, self._data)
        self._zero = tuple(float(self._qpos[place]) for place in self._wheel_places)
        #: How the robot came to rest: each of its joints.
        self._start = {name: tuple(self._data.joint(name).qpos.tolist()) for name in ROBOT_JOINTS}
        self._count_anew()
        return self.state

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        for item in self._plan.pushable(self._world):
            self.move(item.name, item.x_m, item.y_m, item.heading_rad)
            self._moved_things[item.name] = None
        for name, place in self._start.items():
            self._data.joint(name).qpos, self._data.joint(name).qvel = place, 0.0
        self._count_anew()

    def _count_anew(self) -> None:
        """Begin to count contacts and stalls."""
        self._contacts = ContactCounter()
        self._hits: deque[Hit] = deque(maxlen=MOST_HITS)
        self._stalling = [0, 0]
        self._state = None

    def _build(self) -> None:
        """Make the engine's model of what stands in the world now; all rests, the robot at the world's middle."""
        model = self._model = make_model(self._world, self._parameters, self._plan.obstacles)
        data = self._data = mujoco.MjData(model)
        self._qpos, self._qvel, self._efforts = data.qpos, data.qvel, data.efc_force
        joints = [model.joint(name) for name in WHEELS]
        self._wheel_places = [int(joint.qposadr[0]) for joint in joints]
        self._wheel_speeds = [int(joint.dofadr[0]) for joint in joints]
        self._rotors = [int(model.joint(name).dofadr[0]) for name in ROTORS]
        self._robot_place, self._robot_speed = (
            int(model.joint(ROBOT).qposadr[0]), int(model.joint(ROBOT).dofadr[0]),
        )  # fmt: skip
        self._hull = int(model.geom(HULL).id)
        self._floors, self._low = floor_geometries(model), low_geometries(model)
        for item in self._plan.obstacles:
            self._put(item)

    def _rebuild(self) -> None:
        """Make the model anew and go on where everything was."""
        model, data = self._model, self._data
        names = [model.joint(number).name for number in range(model.njnt)]
        kept = {name: (data.joint(name).qpos.copy(), data.joint(name).qvel.copy()) for name in names}
        self._build()
        for name in (self._model.joint(number).name for number in range(self._model.njnt)):
            if name in kept:
                self._data.joint(name).qpos, self._data.joint(name).qvel = kept[name]
        self._state = None

    def step(self, left_mps: float, right_mps: float) -> Turned:
        """Move on by one step with these rim-speed set-points."""
        model, data, qvel = self._model, self._data, self._qvel
        self._state = None
        self._steps += 1
        if self._walkers:
            self._walk()
        left, right = self._rotors
        qvel[left], qvel[right] = left_mps / self._radius_m, right_mps / self._radius_m
        mujoco.mj_step(model, data)
        if self._contacts.update(touching=self._is_touching()):
            self._note_hit()
        # The motors are the only frictions of joints, and the engine lists those first.
        for wheel, effort in enumerate(data.efc_force[:2].tolist()):
            strains = abs(effort) > self._straining_nm and abs(qvel[self._wheel_speeds[wheel]]) < self._slow_radps
            self._stalling[wheel] = min(STALL_STEPS, self._stalling[wheel] + 1) if strains else 0
        left, right = self._wheel_places
        return Turned(float(self._qpos[left]) - self._zero[0], float(self._qpos[right]) - self._zero[1])

    def _walk(self) -> None:
        """Put everything that walks where it is by now; the plan learns of it when it is asked."""
        for name, (since, walker) in self._walkers.items():
            x, y, heading = walker.pose_at((self._steps - since) * _DT_S)
            self._put(replace(self._plan.find(name), x_m=x, y_m=y, heading_rad=heading))
            self._moved_things[name] = None

    def _put(self, item: Obstacle) -> None:
        """Put a thing of the model where it stands; one that can be pushed then rests."""
        place, slope = middle_and_slope(item)
        turn, name = quaternion(item.heading_rad, slope), THING + item.name
        number = int(self._model.body(name).mocapid[0])
        if number < 0:
            joint = self._data.joint(name)
            joint.qpos, joint.qvel = (*place, *turn), 0.0
        else:
            self._data.mocap_pos[number], self._data.mocap_quat[number] = place, turn

    def _is_touching(self) -> bool:
        return self._touched() is not None

    def _touched(self) -> tuple[int, int] | None:
        """Return the first contact of the hull with anything but a floor, or of the wheels with a low thing.

        As its number and that of the geometry that is touched; None where there is none.
        """
        for number, (one, other) in enumerate(self._data.contact.geom.tolist()):
            if self._hull in {one, other}:
                if one not in self._floors and other not in self._floors:
                    return number, other if one == self._hull else one
            elif one in self._low or other in self._low:
                return number, one if one in self._low else other
        return None

    def _note_hit(self) -> None:
        """Remember a collision; the building has no names in the engine and is found by its place."""
        touched = self._touched()
        if touched is None:
            return
        number, geometry = touched
        x, y, _ = self._data.contact.pos[number].tolist()
        name = self._model.body(int(self._model.geom_bodyid[geometry])).name
        if name.startswith(THING):
            name = name.removeprefix(THING)
        else:
            self._tell_plan()
            name = self._plan.thing_at(x, y)
        self._hits.append(Hit(at_ns=self._steps * STEP_NS, name=name, x_m=x, y_m=y))

    def _read(self) -> BodyState:
        qpos, qvel = self._qpos, self._qvel
        place, speed = self._robot_place, self._robot_speed
        x, y, z = qpos[place : place + 3].tolist()
        m = matrix(qpos[place + 3 : place + 7].tolist())
        vx, vy, _, wx, wy, wz = qvel[speed : speed + 6].tolist()
        heading = math.atan2(m[3], m[0])
        (left, right), (left_rate, right_rate) = self._wheel_places, self._wheel_speeds
        return BodyState(
            x_m=x,
            y_m=y,
            z_m=z,
            heading_rad=heading,
            pitch_rad=math.asin(max(-1.0, min(1.0, m[6]))),
            left_angle_rad=float(qpos[left]) - self._zero[0],
            right_angle_rad=float(qpos[right]) - self._zero[1],
            left_speed_mps=float(qvel[left_rate]) * self._radius_m,
            right_speed_mps=float(qvel[right_rate]) * self._radius_m,
            forward_mps=vx * math.cos(heading) + vy * math.sin(heading),
            # The engine tells the rate of turn in the robot's own frame.
            turn_radps=m[6] * wx + m[7] * wy + m[8] * wz,
            stalled_left=self._stalling[0] >= STALL_STEPS,
            stalled_right=self._stalling[1] >= STALL_STEPS,
            collisions=self._contacts.collisions,
            in_contact=self._contacts.touching,
        )

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres; the rays tilt with the body."""
        frame = self._look()
        return [
            reading(self._sonar_rays.nearest(number, self._model, self._data, *frame), self._parameters)
            for number in numbers
        ]

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        frame = self._look()
        return [self._sonar_rays.echoes(number, self._model, self._data, *frame) for number in numbers]

    def _look(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bring the engine's geometry to the end of the last step; return the robot's origin and turn."""
        mujoco.mj_kinematics(self._model, self._data)
        place = self._robot_place
        turn = matrix(self._qpos[place + 3 : place + 7].tolist())
        return np.array(self._qpos[place : place + 3]), np.array(turn).reshape(3, 3)

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
        for name, (since, walker) in self._walkers.items():
            self._plan.move(name, *walker.pose_at((self._steps - since) * _DT_S))
        for item in self._plan.obstacles:
            if item.mass_kg > 0:
                x, y, _, *turn = self._data.joint(THING + item.name).qpos.tolist()
                if math.dist((x, y), (item.x_m, item.y_m)) > PUSHED_M:
                    m = matrix(turn)
                    self._plan.move(item.name, x, y, math.atan2(m[3], m[0]))
                    self._moved_things[item.name] = None

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world; one that walks begins at its first point, now."""
        self._keep(obstacle)
        self._rebuild()

    def _keep(self, obstacle: Obstacle) -> None:
        if obstacle.walk is not None:
            walker = Walker(obstacle.walk)
            x, y, heading = walker.pose_at(0.0)
            obstacle = replace(obstacle, x_m=x, y_m=y, heading_rad=heading)
        self._plan.place(obstacle)
        if obstacle.walk is not None:
            self._walkers[obstacle.name] = (self._steps, walker)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else; one that walks stays there."""
        moved = self._plan.move(name, x_m, y_m, heading_rad)
        self._walkers.pop(name, None)
        self._put(moved)

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        self._plan.remove(name)
        self._walkers.pop(name, None)
        self._rebuild()

    def snapshot(self) -> object:
        """Return all that decides the future, as plain values."""
        numbers = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, numbers, _STATE)
        return {
            "engine": numbers.tobytes(),
            "obstacles": self._plan.obstacles,
            "walking": {name: since for name, (since, _) in self._walkers.items()},
            "moved": tuple(self._moved_things),
            "zero": self._zero,
            "contacts": self._contacts.snapshot(),
            "hits": tuple(self._hits),
            "stalling": tuple(self._stalling),
            "steps": self._steps,
            "start": dict(self._start),
        }

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, in this body or in a new one."""
        saved = cast("dict[str, Any]", snapshot)
        self._steps = saved["steps"]
        self._plan = Plan(saved["obstacles"], self._parameters, self._static)
        self._moved_things = dict.fromkeys(saved["moved"])
        walks = {item.name: item.walk for item in self._plan.obstacles if item.walk is not None}
        self._walkers = {name: (since, Walker(walks[name])) for name, since in saved["walking"].items()}
        self._build()
        mujoco.mj_setState(self._model, self._data, np.frombuffer(saved["engine"]), _STATE)
        self._zero, self._start = saved["zero"], dict(saved["start"])
        self._contacts.restore(saved["contacts"])
        self._hits = deque(saved["hits"], maxlen=MOST_HITS)
        self._stalling = list(saved["stalling"])
        self._state = None
