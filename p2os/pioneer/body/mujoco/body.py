"""The second physical body: MuJoCo at 1 kHz, to check the first one by.

The same robot as `bullet`'s: wheels that collide as spheres on a thick floor,
torque limits, friction, and who meets whom (`physical`). What differs is the
engine: contacts are the solution of one convex problem in each step, not of an
iteration that is cut short, so that hardly anything slips that need not.

Not modelled: tyre scrub and wheel-size errors, battery sag; floors of meshes
(refused, see `model`). All robots of a scene are one model; their hulls meet each other.
"""

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from p2os.pioneer.body.contacts import APART_STEPS
from p2os.pioneer.body.contract import BodyState, Turned, free_wheels
from p2os.pioneer.body.engine_body import EngineBody, EngineScene
from p2os.pioneer.body.mujoco.model import (
    THING,
    RobotNames,
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
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import RobotParameters

#: All that MuJoCo needs to go on alike.
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


class MujocoScene(EngineScene):
    """Robots and things in one model of the engine."""

    STATE = ("engine_state",)
    #: The engine's own objects: `engine_state` makes them anew.
    DERIVED = ("model", "data", "floors", "low")

    name = "mujoco"
    bodies: "tuple[MujocoBody, ...]"

    def __init__(
        self, world: World, models: Sequence[RobotParameters], starts: Sequence[Pose] | None = None
    ) -> None:  # fmt: skip
        super().__init__(world, len(models))
        self._models = tuple(models)
        self.is_uneven = any(item.kind.is_driven_on for item in world.obstacles if item.fixed)
        self._take(MujocoBody(self, model, number) for number, model in enumerate(models))
        self.reset(starts or [world.start] * len(models), 0)

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let every robot stand still at its pose in the world as it was made; nothing here is random."""
        del seed
        for body, pose in zip(self.bodies, poses, strict=True):
            body.begin(pose)
        self._build()
        for body, pose in zip(self.bodies, poses, strict=True):
            body.stand_down(pose)
        for _ in range(SETTLE_STEPS):
            mujoco.mj_step(self.model, self.data)
        for body in self.bodies:
            body.begin_here()

    def _build(self) -> None:
        """Make the engine's model of what stands in the world now; all rests, the robots at the world's middle."""
        things = self.bodies[0].things
        self.model = make_model(self.world, self._models, things)
        self.data = mujoco.MjData(self.model)
        self.floors, self.low = floor_geometries(self.model), low_geometries(self.model)
        for body in self.bodies:
            body.find_joints()
        for item in things:
            self._put(item)
        self.changed()

    def _rebuild(self) -> None:
        """Make the model anew and go on where everything was."""
        model, data = self.model, self.data
        names = [model.joint(number).name for number in range(model.njnt)]
        kept = {name: (data.joint(name).qpos.copy(), data.joint(name).qvel.copy()) for name in names}
        self._build()
        for name in (self.model.joint(number).name for number in range(self.model.njnt)):
            if name in kept:
                self.data.joint(name).qpos, self.data.joint(name).qvel = kept[name]
        for body in self.bodies:
            body.read_anew()

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Turned]:
        """Move all on by one step with these rim-speed set-points."""
        bodies = self.bodies
        self._count_step(setpoints)
        data = self.data
        mujoco.mj_step(self.model, data)
        efforts, contacts = self.efforts_nm, self.contacts
        turned = [body.take_step(efforts[2 * number : 2 * number + 2], contacts) for number, body in enumerate(bodies)]
        for body in bodies:
            body.read_anew()
        return turned

    @property
    def efforts_nm(self) -> list[float]:
        """What motor and gear of each wheel gave in the last step, the robots' one after the other."""
        # The motors are the only frictions of joints, and the engine lists those first.
        efforts: list[float] = self.data.efc_force[: 2 * len(self.bodies)].tolist()
        return efforts

    @property
    def contacts(self) -> list[list[int]]:
        """The two geometries of each contact."""
        found: list[list[int]] = self.data.contact.geom.tolist()
        return found

    def _placed(self, item: Obstacle) -> None:
        del item
        self._rebuild()

    def _removed(self, name: str) -> None:
        del name
        self._rebuild()

    def _put(self, item: Obstacle) -> None:
        """Put a thing of the model where it stands; one that can be pushed then rests."""
        place, slope = middle_and_slope(item)
        turn, name = quaternion(item.heading_rad, slope), THING + item.name
        number = int(self.model.body(name).mocapid[0])
        if number < 0:
            joint = self.data.joint(name)
            joint.qpos, joint.qvel = (*place, *turn), 0.0
        else:
            self.data.mocap_pos[number], self.data.mocap_quat[number] = place, turn

    @property
    def engine_state(self) -> bytes:
        """All that MuJoCo needs to go on alike, for a model of what stands in the plan."""
        numbers = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, self.data, numbers, _STATE)
        return numbers.tobytes()

    @engine_state.setter
    def engine_state(self, saved: bytes) -> None:
        self._build()
        mujoco.mj_setState(self.model, self.data, np.frombuffer(saved), _STATE)
        for body in self.bodies:
            body.read_anew()


class MujocoBody(EngineBody):
    """A differential drive with mass, torque limits and friction."""

    STATE = ("_start",)
    #: Where in the engine's objects things are.
    DERIVED = ("_qpos", "_qvel", "_most_torques", "_wheel_places", "_wheel_speeds", "_rotors", "_robot_place",
               "_robot_speed", "_hull_number", "_wheel_numbers", "_asked", "_commanded", "_rotor_rates")  # fmt: skip

    _rays_of = SonarRays
    name = "mujoco"
    scene: MujocoScene
    others: "tuple[MujocoBody, ...]"

    def __init__(self, scene: MujocoScene, parameters: RobotParameters, number: int) -> None:
        super().__init__(scene, parameters, number)
        self._names, self._number = RobotNames.of(number), number
        self._sonar_rays = SonarRays(self._cones, parameters.sonar_height_m, parameters.sonar_range_m)
        #: What the motors were commanded, that and what it was worked out from, and the rates of the rotors, rad/s.
        self._asked, self._commanded, self._rotor_rates = (0.0, 0.0), tuple[object, ...](), (0.0, 0.0)

    @property
    def note(self) -> str | None:
        """How it takes meshes, where the world has some."""
        if not self._world.meshes:
            return None
        return "the mujoco body touches a mesh as upright walls over its plan, at the height of the hull"

    def find_joints(self) -> None:
        """Find the robot in a model that was made anew."""
        model, data, names = self.scene.model, self.scene.data, self._names
        self._qpos, self._qvel, self._most_torques = data.qpos, data.qvel, model.tendon_frictionloss
        self._commanded = ()
        joints = [model.joint(name) for name in names.wheels]
        self._wheel_places = [int(joint.qposadr[0]) for joint in joints]
        self._wheel_speeds = [int(joint.dofadr[0]) for joint in joints]
        self._rotors = [int(model.joint(name).dofadr[0]) for name in names.rotors]
        self._robot_place, self._robot_speed = (
            int(model.joint(names.robot).qposadr[0]), int(model.joint(names.robot).dofadr[0]),
        )  # fmt: skip
        self._hull_number = int(model.geom(names.hull).id)
        #: Its wheels and its caster.
        self._wheel_numbers = frozenset(int(model.geom(name).id) for name in (*names.wheels, names.caster))

    def stand_down(self, pose: Pose) -> None:
        """Put the robot at a pose of a model that was made anew."""
        place = (pose.x_m, pose.y_m, pose.z_m, *quaternion(pose.heading_rad))
        self.scene.data.joint(self._names.robot).qpos = place

    def begin_here(self) -> None:
        """Take the pose to which the robot has come as its start."""
        self._zero = tuple(float(self._qpos[place]) for place in self._wheel_places)
        #: How the robot came to rest: each of its joints.
        self._start = {name: tuple(self.scene.data.joint(name).qpos.tolist()) for name in self._names.joints}
        self._count_anew()

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        super().put_back()
        for name, place in self._start.items():
            self.scene.data.joint(name).qpos, self.scene.data.joint(name).qvel = place, 0.0
        self._count_anew()
        self.scene.changed()

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere."""
        height_m, data = self._place_for(x_m, y_m, heading_rad), self.scene.data
        data.joint(self._names.robot).qpos = (x_m, y_m, height_m, *quaternion(heading_rad))
        for name in self._names.joints:
            data.joint(name).qvel = 0.0
        self._halt()
        self.scene.changed()

    def count_step(self, left_mps: float, right_mps: float) -> None:
        """Begin a step with these rim-speed set-points: the rotors pull their wheels along with their torque."""
        self._state = None
        self._steps += 1
        commanded = (left_mps, right_mps, self.is_powered, self._most_nm)
        if self._is_grip_changed or commanded != self._commanded:
            self._commanded, self._is_grip_changed = commanded, False
            (left_radps, left_nm), (right_radps, right_nm) = self._motor(0, left_mps), self._motor(1, right_mps)
            self._asked, self._rotor_rates = (left_mps, right_mps), (left_radps, right_radps)
            first, most_torques = 2 * self._number, self._most_torques
            most_torques[first], most_torques[first + 1] = left_nm, right_nm
        (left, right), qvel = self._rotors, self._qvel
        qvel[left], qvel[right] = self._rotor_rates

    def _step_alone(self, setpoints: Iterable[tuple[float, float]]) -> list[Turned]:
        step, scene, take_step, made = mujoco.mj_step, self.scene, self.take_step, list[Turned]()
        model, data = scene.model, scene.data
        for left_mps, right_mps in setpoints:
            self.count_step(left_mps, right_mps)
            step(model, data)
            made.append(take_step(scene.efforts_nm, () if self._alone else scene.contacts))
        self._state = None
        return made

    def take_step(self, efforts_nm: Sequence[float], contacts: Iterable[Sequence[int]]) -> Turned:
        """Take what the engine's step has made of the robot.

        Args:
            efforts_nm: What motor and gear of each wheel gave.
            contacts: The two geometries of each contact in the scene.
        """
        if self._alone:
            self._alone -= 1
            if self._contacts.apart < APART_STEPS:
                self._contacts.update(touching=False)
        else:
            touched = self._touched(contacts)
            if self._contacts.update(touching=touched is not None) and touched is not None:
                self._note_contact(*touched)
            self._look_around()
        (left, right), (left_rate, right_rate) = self._wheel_places, self._wheel_speeds
        (asked_left, asked_right), qpos, qvel = self._asked, self._qpos, self._qvel
        self._watch_motor(0, asked_left, efforts_nm[0], qvel.item(left_rate))
        self._watch_motor(1, asked_right, efforts_nm[1], qvel.item(right_rate))
        zero_left, zero_right = self._zero
        if self._stalling[0] or self._stalling[1]:
            return Turned(qpos.item(left) - zero_left, qpos.item(right) - zero_right, *self._stalled)
        return free_wheels(qpos.item(left) - zero_left, qpos.item(right) - zero_right)

    def _touched(self, contacts: Iterable[Sequence[int]]) -> tuple[int, int] | None:
        """Return the first contact of the hull with anything but a floor, or of the wheels with a low thing.

        As its number and that of the geometry that is touched; None where there is none.
        """
        floors, low, hull, wheels = self.scene.floors, self.scene.low, self._hull_number, self._wheel_numbers
        for number, (one, other) in enumerate(contacts):
            if one == hull or other == hull:  # noqa: PLR1714 - a set of two takes as long as all else
                if one not in floors and other not in floors:
                    return number, other if one == hull else one
            elif low and ((one in low and other in wheels) or (other in low and one in wheels)):
                return number, one if one in low else other
        return None

    def _note_contact(self, number: int, geometry: int) -> None:
        """Remember a collision; the building has no names in the engine and is found by its place."""
        model = self.scene.model
        x, y, _ = self.scene.data.contact.pos[number].tolist()
        name = model.body(int(model.geom_bodyid[geometry])).name
        robots = (other.robot_name for other in self.others if other.is_hull(geometry))
        self._note_touched(name.removeprefix(THING) if name.startswith(THING) else next(robots, None), x, y)

    def is_hull(self, geometry: int) -> bool:
        """Tell whether a piece of geometry is this robot's hull."""
        return geometry == self._hull_number

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
        found = [self._sonar_rays.nearest(number, *frame) for number in numbers]
        return self._readings(numbers, found)

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        frame = self._look()
        return self._with_robots(numbers, [self._sonar_rays.echoes(number, *frame) for number in numbers])

    def _cast_fan(self, rays: SonarRays) -> list[float]:
        return rays.ranges(0, *self._look())

    def _look(self) -> tuple[mujoco.MjModel, mujoco.MjData, NDArray[np.float64], NDArray[np.float64]]:
        """Bring the engine's geometry to the end of the last step; return the engine, the robot's origin and turn."""
        mujoco.mj_kinematics(self.scene.model, self.scene.data)
        place = self._robot_place
        turn = matrix(self._qpos[place + 3 : place + 7].tolist())
        origin = np.array(self._qpos[place : place + 3])
        return self.scene.model, self.scene.data, origin, np.array(turn).reshape(3, 3)

    def _where_is(self, name: str) -> tuple[float, float, Sequence[float]]:
        x, y, _, *turn = self.scene.data.joint(THING + name).qpos.tolist()
        return x, y, matrix(turn)
