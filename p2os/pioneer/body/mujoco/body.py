"""The second physical body: MuJoCo at 1 kHz, to check the first one by.

The same robot as `bullet`'s: wheels that collide as spheres on a thick floor,
torque limits, friction, and who meets whom (`physical`). What differs is the
engine: contacts are the solution of one convex problem in each step, not of an
iteration that is cut short, so that hardly anything slips that need not.

Not modelled: tyre scrub and wheel-size errors, battery sag; floors of meshes
(refused, see `model`).
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.body.engine_body import EngineBody
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
    SETTLE_STEPS,
    middle_and_slope,
)
from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import Cone, cones, reading
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import RobotParameters

#: All that MuJoCo needs to go on alike.
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
#: The joints of the robot: its place in the world, its wheels, and what drives them.
ROBOT_JOINTS = (ROBOT, *WHEELS, *ROTORS)


class MujocoBody(EngineBody):
    """A differential drive with mass, torque limits and friction."""

    STATE = ("_start", "engine_state")
    #: The engine's own objects, and where in them things are: `engine_state` makes them anew.
    DERIVED = ("_model", "_data", "_qpos", "_qvel", "_efforts", "_wheel_places", "_wheel_speeds", "_rotors",
               "_robot_place", "_robot_speed", "_hull", "_floors", "_low", "_fan", "_fan_rays")  # fmt: skip

    name = "mujoco"

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        super().__init__(world, parameters)
        self._sonar_rays = SonarRays(cones(parameters), parameters.sonar_height_m, parameters.sonar_range_m)
        #: The fan of rays that was cast last, prepared.
        self._fan: tuple[Cone, float] | None = None
        self.reset(world.start, 0)

    @property
    def note(self) -> str | None:
        """How it takes meshes, where the world has some."""
        if not self._world.meshes:
            return None
        return "the mujoco body touches a mesh as upright walls over its plan, at the height of the hull"

    def reset(self, pose: Pose, seed: int) -> BodyState:
        """Stand still at a pose in the world as it was made; nothing here is random."""
        del seed
        self._begin()
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
        super().put_back()
        for name, place in self._start.items():
            self._data.joint(name).qpos, self._data.joint(name).qvel = place, 0.0
        self._count_anew()

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere."""
        height_m, data = self._place_for(x_m, y_m, heading_rad), self._data
        data.joint(ROBOT).qpos = (x_m, y_m, height_m, *quaternion(heading_rad))
        for name in ROBOT_JOINTS:
            data.joint(name).qvel = 0.0
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
        if self._walking:
            self._walk()
        asked = left_mps, right_mps
        for wheel, rotor in enumerate(self._rotors):
            qvel[rotor], model.tendon_frictionloss[wheel] = self._motor(wheel, asked[wheel])
        mujoco.mj_step(model, data)
        if self._contacts.update(touching=self._is_touching()):
            self._note_contact()
        # The motors are the only frictions of joints, and the engine lists those first.
        for wheel, effort in enumerate(data.efc_force[:2].tolist()):
            self._watch_motor(wheel, asked[wheel], effort, float(qvel[self._wheel_speeds[wheel]]))
        left, right = self._wheel_places
        return Turned(float(self._qpos[left]) - self._zero[0], float(self._qpos[right]) - self._zero[1])

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

    def _note_contact(self) -> None:
        """Remember a collision; the building has no names in the engine and is found by its place."""
        touched = self._touched()
        if touched is None:
            return
        number, geometry = touched
        x, y, _ = self._data.contact.pos[number].tolist()
        name = self._model.body(int(self._model.geom_bodyid[geometry])).name
        self._note_touched(name.removeprefix(THING) if name.startswith(THING) else None, x, y)

    def _read(self) -> BodyState:
        qpos, qvel = self._qpos, self._qvel
        place, speed = self._robot_place, self._robot_speed
        x, y, z = qpos[place : place + 3].tolist()
        m = matrix(qpos[place + 3 : place + 7].tolist())
        vx, vy, _, wx, wy, wz = qvel[speed : speed + 6].tolist()
        wheels = [
            (float(qpos[angle]), float(qvel[rate]))
            for angle, rate in zip(self._wheel_places, self._wheel_speeds, strict=True)
        ]
        # The engine tells the rate of turn in the robot's own frame.
        return self._state_of((x, y, z), m, wheels, (vx, vy), m[6] * wx + m[7] * wy + m[8] * wz)

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

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a fan goes, metres; the rays tilt with the body."""
        if (fan, longest_m) != self._fan:
            self._fan = (fan, longest_m)
            self._fan_rays = SonarRays((fan,), self._parameters.sonar_height_m, longest_m)
        return self._fan_rays.ranges(0, self._model, self._data, *self._look())

    def _look(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bring the engine's geometry to the end of the last step; return the robot's origin and turn."""
        mujoco.mj_kinematics(self._model, self._data)
        place = self._robot_place
        turn = matrix(self._qpos[place + 3 : place + 7].tolist())
        return np.array(self._qpos[place : place + 3]), np.array(turn).reshape(3, 3)

    def _where_is(self, name: str) -> tuple[float, float, Sequence[float]]:
        x, y, _, *turn = self._data.joint(THING + name).qpos.tolist()
        return x, y, matrix(turn)

    def _placed(self, item: Obstacle) -> None:
        del item
        self._rebuild()

    def _removed(self, name: str) -> None:
        del name
        self._rebuild()

    @property
    def engine_state(self) -> bytes:
        """All that MuJoCo needs to go on alike, for a model of what stands in the plan."""
        numbers = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, numbers, _STATE)
        return numbers.tobytes()

    @engine_state.setter
    def engine_state(self, saved: bytes) -> None:
        self._build()
        mujoco.mj_setState(self._model, self._data, np.frombuffer(saved), _STATE)
