"""The state of a robot as a program sees it: frozen values in SI units, one a standard packet.

Frames: the robot's has x forward, y left, angles counter-clockwise. The pose's
frame is where the robot stood when the first session opened, or what
`set_pose` made it.
"""

import math
from dataclasses import dataclass
from enum import Enum

from p2os.protocol.sip import StandardSip
from simbase.timing import Nanos


class Link(Enum):
    """Where a client stands with its robot."""

    #: Nothing is under way.
    CLOSED = "closed"
    #: The line is being opened.
    OPENING = "opening the line"
    #: The handshake runs, at one baud rate after the other.
    SEARCHING = "searching"
    #: OPEN is out; the first packet has not come.
    STARTING = "starting"
    #: Packets flow.
    OPEN = "open"
    #: Lost; the next try waits for its time.
    WAITING = "waiting to try again"
    #: Given up.
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class RobotPose:
    """A place and a direction: metres, and radians that do not wrap."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class SonarEcho:
    """The last reading of one sonar."""

    #: From 0.
    number: int
    #: From the transducer, metres.
    range_m: float
    #: Where the echo came from on the sonar's axis, robot frame, metres.
    x_m: float
    y_m: float
    #: False: nothing within the sonar's reach.
    is_echo: bool
    #: When its packet came.
    at_ns: Nanos


@dataclass(frozen=True, slots=True)
class Limits:
    """How fast the robot may go; from its CONFIGpac, or from its model's parameters until that has come."""

    forward_mps: float
    turn_radps: float
    accel_mps2: float
    decel_mps2: float
    turn_accel_radps2: float
    turn_decel_radps2: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """One moment of the robot, as its standard packet reported it."""

    #: Packets since the client was made, from 1.
    number: int
    #: When the packet came, on the client's clock.
    at_ns: Nanos
    #: Where the robot is, over sessions and `set_pose`.
    pose: RobotPose
    #: The robot's own count since its session opened.
    odometry: RobotPose = RobotPose()
    #: What the wheels do: m/s forward and of each wheel, rad/s counter-clockwise.
    forward_mps: float
    turn_radps: float
    left_mps: float
    right_mps: float
    #: The packet's own claim that the wheels turn.
    is_moving: bool
    #: None: P2OS robots do not report it, and of others it is not known before their packets have shown it.
    motors_enabled: bool | None
    battery_v: float
    stall_left: bool
    stall_right: bool
    #: Segments that are pressed, numbered from 1; empty where the robot has no bumpers.
    front_bumpers: tuple[int, ...]
    rear_bumpers: tuple[int, ...]
    #: The last reading of every sonar in this session, by number.
    sonar: tuple[SonarEcho, ...]
    #: None without a compass.
    compass_rad: float | None
    #: The analog port that `select_analog` chose, 0 to 5 V.
    analog_port: int
    analog_v: float
    #: Eight bits each.
    digital_in: int
    digital_out: int
    #: The STOP button is pressed; None as above.
    stop_button: bool | None
    #: ARCOS tail, where it was sent.
    state_of_charge: float | None
    temperature_c: float | None
    #: The packet itself, raw.
    sip: StandardSip

    @property
    def is_stalled(self) -> bool:
        """Whether either wheel is blocked."""
        return self.stall_left or self.stall_right

    def nearest(self, from_rad: float = -math.pi, to_rad: float = math.pi) -> SonarEcho | None:
        """Return the nearest echo whose direction from the robot's centre lies between two angles, or None."""
        echoes = [echo for echo in self.sonar
                  if echo.is_echo and from_rad <= math.atan2(echo.y_m, echo.x_m) <= to_rad]  # fmt: skip
        return min(echoes, key=lambda echo: echo.range_m, default=None)
