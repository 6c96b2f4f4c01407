"""What the controller needs of a body, whichever engine moves it.

A body is stepped by the controller at fixed multiples of `dt_ns` with
rim-speed set-points, and answers with its state. Frames: world x, y in metres,
heading in radians counter-clockwise; robot frame x forward, y left, origin in
the middle of the axle, on the floor.

Invariant: the same calls after the same `reset` give the same states, bit for bit.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Obstacle, Pose
from simbase.timing import NS_PER_MS, Nanos

#: One step of every body: 1 kHz.
STEP_NS: Nanos = NS_PER_MS
#: No point of a hull is faster: both rims at the highest ceiling of any model, against each other, m/s.
FASTEST_MPS = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyState:
    """Where the body is and how it moves.

    Metres, radians, m/s and rad/s. Wheel angles count from the reset, positive
    forward; rim speeds are those achieved, not those asked for. A stalled wheel
    is one that its motor cannot turn. `collisions` counts new contacts of the
    hull with anything but the floor. `rim_work_j` is what the motors gave and took
    at both rims since the reset, |torque · rate| over time, joules; `put_back` does
    not end the count.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    heading_rad: float = 0.0
    pitch_rad: float = 0.0
    left_angle_rad: float = 0.0
    right_angle_rad: float = 0.0
    left_speed_mps: float = 0.0
    right_speed_mps: float = 0.0
    forward_mps: float = 0.0
    turn_radps: float = 0.0
    stalled_left: bool = False
    stalled_right: bool = False
    collisions: int = 0
    in_contact: bool = False
    #: Where the hull is touched, counter-clockwise from ahead, rad: where the last collision was; None without contact.
    contact_rad: float | None = None
    rim_work_j: float = 0.0


#: chosen: so many hits are remembered until somebody takes them; collisions are 0.2 s apart at the least.
MOST_HITS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Hit:
    """A collision: what the robot has come to touch, where in the plan, and when, counted from the reset.

    `name` is that of an obstacle, a mesh or another robot; empty where the body cannot tell.
    """

    at_ns: Nanos
    name: str
    x_m: float
    y_m: float


class Wheels(Protocol):
    """What a step tells at once; a `BodyState` is one too."""

    @property
    def left_angle_rad(self) -> float:
        """Rotation of the left wheel since the reset."""
        ...

    @property
    def right_angle_rad(self) -> float:
        """Rotation of the right wheel since the reset."""
        ...

    @property
    def stalled_left(self) -> bool:
        """Whether the left motor cannot turn its wheel."""
        ...

    @property
    def stalled_right(self) -> bool:
        """Whether the right motor cannot turn its wheel."""
        ...


class Turned(NamedTuple):
    """The wheels alone, for a body that reads the rest of its state only when asked."""

    left_angle_rad: float
    right_angle_rad: float
    stalled_left: bool = False
    stalled_right: bool = False


def free_wheels(left_angle_rad: float, right_angle_rad: float) -> Turned:
    """Return wheels that no motor stalls at: `Turned` of two angles in half the time, for it is made at each step."""
    return tuple.__new__(Turned, (left_angle_rad, right_angle_rad, False, False))


class Changeable(Protocol):
    """A world whose things change, and that can go on from where it was; that of a robot alone, or of all in it."""

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world."""
        ...

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else."""
        ...

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        ...

    def snapshot(self) -> object:
        """Return all that decides the future, of every robot in it."""
        ...

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        ...


class RobotBody(Changeable, Protocol):
    """A robot as a physical thing in a world."""

    #: Whether its motors have power; without it a wheel that has come to rest is held by its gear alone.
    is_powered: bool

    @property
    def name(self) -> str:
        """Which engine this is."""
        ...

    @property
    def note(self) -> str | None:
        """What a reader of a result has to know of this engine, or None."""
        ...

    @property
    def dt_ns(self) -> Nanos:
        """The length of a step; it divides a second."""
        ...

    @property
    def state(self) -> BodyState:
        """The state after the last step."""
        ...

    def reset(self, pose: Pose, seed: int) -> BodyState:
        """Stand still at a pose, wheels at angle 0, collisions at 0."""
        ...

    def put_back(self) -> None:
        """Stand still where the last `reset` put it, wheels at angle 0, collisions at 0; the world goes on.

        What can be pushed goes back to where the world has it; `take_moved` then tells of it.
        """
        ...

    def who_stands_at_start(self, leaving: Collection[Self] = ()) -> str | None:
        """Return the name of another robot that stands where `put_back` would put this one, or None.

        Args:
            leaving: Robots that go away at the same moment.
        """
        ...

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere, as if carried there: wheel angles, collisions and the world go on.

        Raises:
            WorldError: A thing stands there, or there is no level floor; nothing has changed then.
        """
        ...

    @property
    def robot_name(self) -> str:
        """What it is called among the things of the world."""
        ...

    @property
    def footprint(self) -> Footprint:
        """The outline of its hull where it stands."""
        ...

    def footprint_at(self, x_m: float, y_m: float, heading_rad: float) -> Footprint:
        """Return the outline of its hull at a pose."""
        ...

    def sees(self, number: int, other: Self, its_number: int) -> float | None:
        """Return how far one of its sonar is from another's, metres; None where not each sees the other."""
        ...

    def step(self, left_mps: float, right_mps: float) -> Wheels:
        """Move on by `dt_ns` with these rim-speed set-points; `state` has the rest.

        Raises:
            UsageError: There are other robots in its scene, which steps all of them together.
        """
        ...

    def hold(self, left_mps: float, right_mps: float, steps: int) -> Sequence[Wheels]:
        """Make so many steps with set-points that stay; return the wheels after each.

        Raises:
            UsageError: There are other robots in its scene, which steps all of them together.
        """
        ...

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Wheels]:
        """Make a step with each of these set-points, left and right, m/s; return the wheels after each.

        Raises:
            UsageError: There are other robots in its scene, which steps all of them together.
        """
        ...

    def ranges(self, numbers: Sequence[int]) -> list[float]:
        """Return what these sonar read now, metres from each transducer; the robot file's range where no echo comes."""
        ...

    def echoes(self, numbers: Sequence[int]) -> list[list[Echo]]:
        """Return what each ray of some sonar meets, for a model of the sensor: range and angle, the rightmost first."""
        ...

    def scan(self, fan: Cone, longest_m: float) -> list[float]:
        """Return how far each ray of a fan goes, metres from where it begins; `longest_m` where it meets nothing.

        The rays run in the plane of the sonar ring, and meet what a sonar's rays meet.
        """
        ...

    def take_moved(self) -> list[Obstacle]:
        """Return what has walked or was pushed since this was asked last, where it is now."""
        ...

    def take_hits(self) -> list[Hit]:
        """Return the collisions since this was asked last, the last 16 at the most."""
        ...

    def steps_within(self, turn_rad: float, rim_mps: float) -> int:
        """Return for how many steps from now on no wheel turns farther, rounding aside, while it is told no more.

        Args:
            turn_rad: How far, above 0.
            rim_mps: The greatest set-point, either way.

        Returns:
            Steps; 0 where nothing is known, for one as where it may be pushed.
        """
        ...

    def clearance(self, *, no_more_than: float = math.inf) -> float:
        """Return the plan-view distance from the hull to the nearest thing it could touch, metres; 0 in contact.

        Things farther than `no_more_than` are not looked at; the answer is then that.
        """
        ...


class RobotScene(Changeable, Protocol):
    """Robots in one world, stepped together: they meet, push and sense each other where they are at that step.

    The order of the robots is fixed and decides, with the set-points, everything.
    """

    @property
    def bodies(self) -> Sequence[RobotBody]:
        """The robots, the first first; none of them is stepped or reset by itself where there are several."""
        ...

    @property
    def dt_ns(self) -> Nanos:
        """The length of a step."""
        ...

    def name_robots(self, names: Sequence[str]) -> None:
        """Call the robots otherwise, the first first: names that no thing of the world has."""
        ...

    def reset(self, poses: Sequence[Pose], seed: int) -> None:
        """Let every robot stand still at its pose, in the world as it was made."""
        ...

    def step(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[Wheels]:
        """Move all on by `dt_ns` with these rim-speed set-points, left and right, m/s; return their wheels' angles."""
        ...
