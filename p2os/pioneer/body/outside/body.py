"""The body that another program moves, in lock-step: it stands still until it is asked for the next steps.

Steps are asked for together: a step is noted, and goes out when somebody reads what it made. So one round trip carries
all the steps between two looks at the wheels, and what is read does not depend on how many those were.

The other program decides where the robot is, what its sonar and rays meet, what it touches and what it pushes. Ours
keeps the plan of the world beside it: names of things, what walks, and where there is room, unless the other tells.
There is one robot in a world.
"""

import math
import weakref
from collections.abc import Sequence
from enum import IntFlag
from typing import ClassVar, NoReturn

from p2os.errors import LocalProtocolError, RemoteProtocolError, WorldError
from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import STEP_NS, BodyState, Hit
from p2os.pioneer.body.in_world import BodyInWorld, WorldScene
from p2os.pioneer.body.outside.address import Address
from p2os.pioneer.body.outside.connection import OutsideConnection
from p2os.pioneer.body.outside.messages import (
    VERSION,
    AskRanges,
    AskRays,
    Hello,
    MakeWorld,
    Move,
    Place,
    PlaceMesh,
    Ranges,
    Rays,
    Remove,
    Report,
    Reset,
    Restore,
    Save,
    Saved,
    StandAt,
    Step,
    Stepped,
    Welcome,
)
from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import Cone, reading
from p2os.pioneer.world.geometry import hull_polygon
from p2os.pioneer.world.model import Obstacle, ObstacleKind, Pose, World
from p2os.robots.parameters import RobotParameters
from simbase.errors import UsageError, one_line, shown
from simbase.state import PartState

#: chosen: so many steps wait at the most before they are sent; a second.
MOST_STEPS = 1000
#: What walks is moved each 10 ms, as in the exact body.
WALK_STEPS = 10
#: Bits of a step.
_STALLED_LEFT, _STALLED_RIGHT, _TOUCHES = 1, 2, 4
#: The type of a thing: driven on, or by its outline.
_DRIVEN = {ObstacleKind.FLOOR: 2, ObstacleKind.RAMP: 3}


class Ability(IntFlag):
    """What an outside body can beside the least."""

    #: Save and restore.
    SAVES = 1
    #: Rays, for lasers, infra-red eyes and models of a sonar's echo.
    CASTS_RAYS = 2
    #: Its wheels turn no faster than they are told: nothing pushes them.
    ROLLS = 4


class StepWheels:
    """The wheels after a step that goes out when they are read."""

    __slots__ = ("_row", "_scene")

    def __init__(self, scene: "OutsideScene") -> None:
        self._scene, self._row = scene, None  # type: tuple[OutsideScene, tuple[float, ...] | None]

    def take(self, row: tuple[float, ...]) -> None:
        """Take what the step has made: both angles, rad, and the bits."""
        self._row = row

    def _made(self) -> tuple[float, ...]:
        if self._row is None:
            self._scene.flush()
        if self._row is None:
            raise self._scene.line.failure or LocalProtocolError("this step was given up: its robot was put elsewhere")
        return self._row

    @property
    def left_angle_rad(self) -> float:
        """Rotation of the left wheel since the reset."""
        return self._made()[0]

    @property
    def right_angle_rad(self) -> float:
        """Rotation of the right wheel since the reset."""
        return self._made()[1]

    @property
    def stalled_left(self) -> bool:
        """Whether the left motor cannot turn its wheel."""
        return bool(int(self._made()[2]) & _STALLED_LEFT)

    @property
    def stalled_right(self) -> bool:
        """Whether the right motor cannot turn its wheel."""
        return bool(int(self._made()[2]) & _STALLED_RIGHT)


class OutsideScene(WorldScene):
    """One robot in a world that another program steps.

    Args:
        address: Where that program answers.
        world: What it is told to be the world.
        models: The robot's model.

    Raises:
        UsageError: There is more than one robot.
        TransportError: Nobody answers.
        RemoteProtocolError: It answers what is no such body.
    """

    STATE = ("_seed", "engine_state")
    #: Sent before a snapshot, forgotten by a restore.
    DERIVED = ("_waiting",)

    bodies: "tuple[OutsideBody, ...]"

    def __init__(self, address: Address, world: World, models: Sequence[RobotParameters]) -> None:
        super().__init__(world, len(models))
        if len(models) != 1:
            raise UsageError(f"an outside body is one robot, not {len(models)}", hint="--body best")
        self.line = OutsideConnection(address)
        weakref.finalize(self, self.line.close)
        welcome = self.line.ask(_hello(models[0]), Welcome)
        if welcome.version != VERSION:
            raise RemoteProtocolError(
                f"the outside body {address.text} speaks version {welcome.version} of the protocol, expected {VERSION}"
            )
        self.abilities = Ability(welcome.abilities & sum(Ability))
        self.name, self.address = address.text, address.text
        self.what = one_line(welcome.name)
        self.note = one_line(welcome.note) or None
        #: Steps that were noted and not sent.
        self._waiting: list[tuple[tuple[float, float, int], StepWheels]] = []
        self._take([OutsideBody(self, models[0], 0)])
        self.reset([world.start], 0)

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let the robot stand still at its pose in the world as it was made."""
        self._waiting.clear()
        (body,), (pose,) = self.bodies, poses
        body.begin(pose)
        self._seed = seed
        self._tell_world()
        self.stand_at_start(body)

    def stand_at_start(self, body: "OutsideBody") -> None:
        """Let the robot stand still where it began, its wheels at angle 0, its collisions at 0."""
        start = body.start
        pose = (start.x_m, start.y_m, start.heading_rad, start.z_m)
        body.stand_down(self.line.ask(Reset(pose, self._seed), Report))

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[StepWheels]:  # type: ignore[override]  # read late
        """Note a step with these rim-speed set-points; it goes out when its wheels are read."""
        ((left_mps, right_mps),) = setpoints
        return (self.note_step(left_mps, right_mps),)

    def note_step(self, left_mps: float, right_mps: float) -> StepWheels:
        """Note a step."""
        wheels = StepWheels(self)
        self._waiting.append(((left_mps, right_mps, int(self.bodies[0].is_powered)), wheels))
        if len(self._waiting) >= MOST_STEPS:
            self.flush()
        return wheels

    def flush(self) -> None:
        """Have all steps made that were noted."""
        (body,) = self.bodies
        while self._waiting:
            count = body.steps_until_walk(len(self._waiting))
            part, waiting = self._waiting[:count], self._waiting[count:]
            self._waiting = []  # a step that fails is never made
            made = self.line.ask(Step(tuple(row for row, _ in part)), Stepped)
            if len(made.rows) != count:
                raise self.line.refused(f"{len(made.rows)} steps, where {count} were asked for")
            for (_, wheels), row in zip(part, made.rows, strict=True):
                wheels.take(row)
            body.take_steps(made)
            for item in body.walk():
                self._put(item)
            self._waiting = waiting

    # The world -------------------------------------------------------------------------------

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world; one that walks begins at its first point, now."""
        self.flush()
        super().place(obstacle)

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else; one that walks stays there."""
        self.flush()
        super().move(name, x_m, y_m, heading_rad)

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        self.flush()
        super().remove(name)

    def _placed(self, item: Obstacle) -> None:
        self.line.send(_place(item))

    def _put(self, item: Obstacle) -> None:
        self.line.send(Move(item.name, (item.x_m, item.y_m, item.heading_rad)))

    def _removed(self, name: str) -> None:
        self.line.send(Remove(name))

    def _tell_world(self) -> None:
        """Tell the other program all that stands in the world now."""
        self.line.send(MakeWorld(self.world.name, self.world.extent))
        for item in self.world.obstacles:
            if item.fixed:
                self._placed(item)
        for item in self.bodies[0].things:
            self._placed(item)
        for mesh in self.world.meshes:
            self.line.send(PlaceMesh(mesh.name, mesh.vertices, mesh.triangles))

    # Its state -------------------------------------------------------------------------------

    def snapshot(self) -> PartState:
        """Return all that decides the future, where the other program can save its part.

        Raises:
            UsageError: It cannot.
        """
        if Ability.SAVES not in self.abilities:
            self._refuse_saving()
        self.flush()
        return super().snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned.

        Raises:
            UsageError: The other program cannot save.
        """
        if Ability.SAVES not in self.abilities:
            self._refuse_saving()
        self._waiting.clear()
        super().restore(snapshot)

    def _refuse_saving(self) -> NoReturn:
        raise UsageError(
            f"the outside body {self.what} at {self.address} cannot save its state",
            hint="without snapshot, fork and rewind it can be run from the beginning alone",
        )

    @property
    def engine_state(self) -> bytes:
        """The other program's part of the state, in its own form."""
        return self.line.ask(Save(), Saved).state

    @engine_state.setter
    def engine_state(self, saved: bytes) -> None:
        self._tell_world()
        self.bodies[0].take_report(self.line.ask(Restore(saved), Report))


class OutsideBody(BodyInWorld):
    """The robot of an outside scene."""

    STATE: ClassVar[tuple[str, ...]] = ("_is_stalled",)
    DERIVED: ClassVar[tuple[str, ...]] = ("_numbers",)

    scene: OutsideScene

    def __init__(self, scene: OutsideScene, parameters: RobotParameters, number: int) -> None:
        super().__init__(scene, parameters, number)
        self._numbers: tuple[float, ...] = (0.0,) * 13
        self._is_stalled = (False, False)

    @property
    def name(self) -> str:
        """Where it answers."""
        return self.scene.name

    @property
    def note(self) -> str | None:
        """What it is, and what it says that a reader has to know of it."""
        return f"the body is {self.scene.what}, another program{f': {self.scene.note}' if self.scene.note else ''}"

    @property
    def state(self) -> BodyState:
        """The state after the last step."""
        self.scene.flush()
        x, y, z, heading, pitch, left, right, left_mps, right_mps, forward, turn, _, work = self._numbers
        return BodyState(
            x_m=x,
            y_m=y,
            z_m=z,
            heading_rad=heading,
            pitch_rad=pitch,
            left_angle_rad=left,
            right_angle_rad=right,
            left_speed_mps=left_mps,
            right_speed_mps=right_mps,
            forward_mps=forward,
            turn_radps=turn,
            stalled_left=self._is_stalled[0],
            stalled_right=self._is_stalled[1],
            collisions=self._contacts.collisions,
            in_contact=self._contacts.touching,
            contact_rad=self._contacts.bearing_rad(x, y, heading),
            rim_work_j=work,
        )

    def stand_down(self, report: Report) -> None:
        """Take the robot as it stands after a reset."""
        self._contacts, self._is_stalled = ContactCounter(), (False, False)
        self.take_report(report)

    def take_report(self, report: Report) -> None:
        """Take the robot as the other program has it."""
        self._numbers = report.numbers

    def steps_until_walk(self, steps: int) -> int:
        """Return how many of the next steps may go out together: no more than up to where what walks is moved."""
        return min(steps, WALK_STEPS - self._steps % WALK_STEPS) if self._walking else steps

    def walk(self) -> list[Obstacle]:
        """Bring what walks to where it is by now, if it is moved now; return it there."""
        found: list[Obstacle] = []
        if self._steps % WALK_STEPS == 0:
            for name, pose in self._walked():
                found.append(self._plan.move(name, *pose))
                self.note_moved(name)
        return found

    def take_steps(self, made: Stepped) -> None:
        """Take what the other program has made of the steps that were asked for."""
        begun = {step: (x, y, name) for step, (x, y), name in made.touched}
        x, y = self._numbers[:2]
        for number, (_, _, bits) in enumerate(made.rows):
            self._steps += 1
            if self._contacts.update(touching=bool(int(bits) & _TOUCHES)):
                hit_x, hit_y, name = begun.get(number, (x, y, ""))
                self._note_hit(one_line(name), hit_x, hit_y)
        self._numbers = made.numbers
        bits = int(made.rows[-1][2])
        self._is_stalled = bool(bits & _STALLED_LEFT), bool(bits & _STALLED_RIGHT)
        for name, pose in made.moved:
            try:
                self._plan.move(name, *pose)
            except (WorldError, KeyError) as error:
                raise self.scene.line.refused(f"that {shown(name)} has moved, which is not in the world") from error
            self.note_moved(name)

    def step(self, left_mps: float, right_mps: float) -> StepWheels:  # type: ignore[override]  # read late
        """Note a step with these rim-speed set-points."""
        return self.scene.note_step(left_mps, right_mps)

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, and what was pushed where the world has it."""
        self.scene.flush()
        super().put_back()
        self.scene.stand_at_start(self)

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere."""
        height_m = self._place_for(x_m, y_m, heading_rad)
        self.take_report(self.scene.line.ask(StandAt((x_m, y_m, heading_rad, height_m)), Report))
        self._is_stalled = (False, False)

    def _tell_plan(self) -> None:
        self.scene.flush()

    def take_hits(self) -> list[Hit]:
        """Return the collisions since this was asked last."""
        self.scene.flush()
        return super().take_hits()

    def steps_within(self, turn_rad: float, rim_mps: float) -> int:
        """Return for how many steps no wheel turns farther while it is told no more, where the other program promises
        that it turns no faster.
        """  # noqa: D205  # one sentence of two lines
        return self._steps_to_roll(turn_rad, rim_mps) if Ability.ROLLS in self.scene.abilities else 0

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return the free distance around the hull, metres: as the other program tells it, or in our plan."""
        state, given = self.state, self._numbers[11]
        if given >= 0.0:
            return min(given, no_more_than)
        return self._plan.clearance(state.x_m, state.y_m, state.heading_rad, no_more_than=no_more_than)

    # Sensors ---------------------------------------------------------------------------------

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return the nearest echo of each cone, metres."""
        self.scene.flush()
        distances = self.scene.line.ask(AskRanges(tuple(numbers)), Ranges).distances
        if len(distances) != len(numbers) or any(distance < 0.0 for distance in distances):
            raise self.scene.line.refused(f"{len(distances)} ranges, where {len(numbers)} of 0 m or more belong")
        return [reading(distance, self._parameters) for distance in distances]

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, with the angle at which it meets it."""
        return [self._cast(self._cones[number], self._parameters.sonar_range_m) for number in numbers]

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a fan goes, metres."""
        return [min(echo.range_m, longest_m) for echo in self._cast(fan, longest_m)]

    def _cast(self, fan: Cone, longest_m: float) -> list[Echo]:
        """Return what each ray of a fan meets.

        Raises:
            UsageError: The other program casts no rays.
        """
        scene = self.scene
        if Ability.CASTS_RAYS not in scene.abilities:
            raise UsageError(
                f"the outside body {scene.what} at {scene.address} casts no rays",
                hint="a laser, infra-red eyes and a sonar with errors need them",
            )
        scene.flush()
        rays = tuple((fan.x_m, fan.y_m, heading) for heading in fan.headings_rad)
        hits = scene.line.ask(AskRays(longest_m, rays), Rays).hits
        if len(hits) != len(rays) or any(far < 0.0 or not 0.0 <= cosine <= 1.0 for far, cosine in hits):
            raise scene.line.refused(f"{len(hits)} rays, where {len(rays)} belong, each a distance and a cosine")
        return [Echo(far if far < longest_m else math.inf, cosine if far < longest_m else 0.0) for far, cosine in hits]


def _hello(robot: RobotParameters) -> Hello:
    body = robot.body
    sizes = (
        robot.track_mm / 1000, body.wheel_diameter_m, body.ground_clearance_m, body.hull_height_m, body.mass_kg,
        body.wheel_mass_kg, body.motor_torque_nm, robot.sonar_height_m, robot.sonar_range_m, robot.sonar_min_range_m,
        math.radians(robot.sonar_cone_deg),
    )  # fmt: skip
    sonar = tuple(
        (pose.x_mm / 1000, pose.y_mm / 1000, math.radians(pose.heading_deg))
        for pose in robot.sonar[: robot.sonar_fitted]
    )
    return Hello(VERSION, STEP_NS, robot.subclass, sizes, hull_polygon(body), sonar)


def _place(item: Obstacle) -> Place:
    kind = _DRIVEN.get(item.kind, int(item.is_cylinder))
    sizes = (
        item.x_m, item.y_m, item.heading_rad, item.length_m, item.width_m, item.radius_m, item.base_m, item.height_m,
        item.mass_kg, item.friction,
    )  # fmt: skip
    return Place(item.name, kind, sizes)
