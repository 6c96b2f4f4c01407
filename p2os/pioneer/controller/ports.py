"""What the controller needs of a body: to turn its wheels, and to read their sensors and the sonar."""

from collections.abc import Sequence
from typing import Protocol

from p2os.pioneer.sonar.ring import Cone
from simbase.timing import Nanos


class WheelAngles(Protocol):
    """What the encoders read after a step."""

    @property
    def left_angle_rad(self) -> float:
        """Turned by the left wheel since the body was reset, forward positive."""
        ...

    @property
    def right_angle_rad(self) -> float:
        """Turned by the right wheel since the body was reset, forward positive."""
        ...


class WheelState(WheelAngles, Protocol):
    """What the robot's own sensors know of its body; the pose is not among it."""

    @property
    def left_speed_mps(self) -> float:
        """Speed of the left wheel's rim."""
        ...

    @property
    def right_speed_mps(self) -> float:
        """Speed of the right wheel's rim."""
        ...

    @property
    def stalled_left(self) -> bool:
        """Whether the left motor is stalled."""
        ...

    @property
    def stalled_right(self) -> bool:
        """Whether the right motor is stalled."""
        ...


class SensedState(WheelState, Protocol):
    """What compass, gyro and bumpers look at, how the body really stands and turns; a simulator tells its place too."""

    @property
    def x_m(self) -> float:
        """Where it is in the world; told by SIMSTAT alone."""
        ...

    @property
    def y_m(self) -> float:
        """The same."""
        ...

    @property
    def z_m(self) -> float:
        """The same."""
        ...

    @property
    def heading_rad(self) -> float:
        """Heading in the world, counter-clockwise from x."""
        ...

    @property
    def pitch_rad(self) -> float:
        """Pitch."""
        ...

    @property
    def turn_radps(self) -> float:
        """Rate of turn, counter-clockwise positive."""
        ...

    @property
    def in_contact(self) -> bool:
        """Whether the hull touches anything but the floor."""
        ...

    @property
    def contact_rad(self) -> float | None:
        """Where it does, counter-clockwise from ahead; None where that is not known."""
        ...


class Body(Protocol):
    """A body that is stepped; for a snapshot of the robot its state is declared (`simbase.state`)."""

    @property
    def dt_ns(self) -> Nanos:
        """Length of a step; a whole number of microseconds."""
        ...

    #: Whether the motors have power; the controller says so before a step.
    is_powered: bool

    @property
    def state(self) -> SensedState:
        """What the sensors know now."""
        ...

    def put_back(self) -> None:
        """Stand still where it began, wheels at angle 0, and what was pushed where it was."""
        ...

    def who_stands_at_start(self) -> str | None:
        """Return the name of another robot that stands where `put_back` would put this one, or None."""
        ...

    def stand_at(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Stand still elsewhere, as if carried there.

        Raises:
            WorldError: It cannot stand there; nothing has changed then.
        """
        ...

    def scan(self, fan: Cone, longest_m: float) -> Sequence[float]:
        """Return how far each ray of a laser goes, metres; `longest_m` where it meets nothing."""
        ...

    def step(self, left_mps: float, right_mps: float) -> WheelAngles:
        """Make one step with these rim-speed set-points."""
        ...

    def hold(self, left_mps: float, right_mps: float, steps: int) -> Sequence[WheelAngles]:
        """Make so many steps with set-points that stay; return the wheels after each."""
        ...

    def ramp(self, setpoints: Sequence[tuple[float, float]]) -> Sequence[WheelAngles]:
        """Make a step with each of these set-points; return the wheels after each."""
        ...

    def ranges(self, numbers: Sequence[int]) -> Sequence[float]:
        """Return the range that each sonar measures now, in metres; the longest range where there is no echo."""
        ...
