"""A P2OS robot as a node: which messages its states make, and what messages ask of it.

Passive: who reads the robot and the network is `p2os.cli.robots.ros`, which passes time in.

The deadman here counts from the last message that asked for a speed. The client has one of its own behind it, which
counts from the program's last call and so also stops the robot where this program hangs.

Invariant: of the messages that came together only the newest speed counts, and one that is no speed counts as none.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias, cast

from p2os.client.robot_state import RobotState
from p2os.pioneer.devices.laser import LaserModel
from p2os.protocol.commands import CommandNumber
from p2os.protocol.packets import ServerPacket, SimLaserPacket
from p2os.protocol.times import CYCLE_NS
from p2os.robots.motor_step import STEP_MPS
from p2os.robots.parameters import RobotParameters
from p2os.ros.codec import Message
from p2os.ros.frames import Frames
from p2os.ros.robot_messages import (
    Scans,
    WheelTravel,
    battery,
    bumpers,
    compass,
    diagnostics,
    health,
    joint_state,
    odometry,
    sonar_points,
    sonar_range,
)
from p2os.ros.thesis_topics import FIRST, encoder_code, motor_speed, near
from p2os.ros.topics import SERVICES, TOPICS
from p2os.ros.transport import NodeOptions, Received, Topic
from p2os.ros.urdf import urdf_text
from simbase.timing import Nanos

Outgoing: TypeAlias = tuple[Topic, Message]
#: Topics of every robot, announced before the first state.
ALWAYS = ("odom", "tf", "joint_states", "sonar", "battery_state", "diagnostics", "encoder_left", "encoder_right")
COMMANDS = (*(key for key, row in TOPICS.items() if row.is_command), "motor_left", "motor_right")


@dataclass(frozen=True, slots=True)
class Speed:
    """Move so: m/s ahead, rad/s counter-clockwise."""

    forward_mps: float
    turn_radps: float


@dataclass(frozen=True, slots=True)
class MotorPower:
    """Switch the motors."""

    on: bool


@dataclass(frozen=True, slots=True)
class ResetOdometry:
    """The robot is at the origin now."""


@dataclass(frozen=True, slots=True)
class Refused:
    """A message asks for what cannot be."""

    text: str


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Nobody has asked for a speed in time: stop."""


Asked: TypeAlias = Speed | StopRequest | MotorPower | ResetOdometry | Refused


class RobotNode:
    """What one robot publishes, and takes.

    Args:
        parameters: Its measures.
        options: The node's names.
        deadman_ns: Nobody asked for a speed for so long: the robot is stopped.
        bumpers_fitted: Segments in front and at the rear.
        motor_step_mps: Rim speed of one step of `motor_left` and `motor_right`.
        laser: The simulated one that the robot is asked for; None: none.
        cycle_ns: How often the robot reports, as its CONFIGpac says.
    """

    def __init__(
        self,
        parameters: RobotParameters,
        options: NodeOptions,
        *,
        deadman_ns: Nanos,
        bumpers_fitted: tuple[int, int] = (0, 0),
        motor_step_mps: float = STEP_MPS,
        laser: LaserModel | None = None,
        cycle_ns: Nanos = CYCLE_NS,
    ) -> None:
        self.frames = Frames.of(parameters, options.namespace, has_laser=laser is not None)
        self._laser = laser
        self._scans = None if laser is None else Scans(laser, self.frames, cycle_ns)
        self._options = options
        self._deadman_ns = deadman_ns
        #: When the robot is stopped; None while nothing moves it.
        self._stops_at: Nanos | None = None
        self._bumpers = bumpers_fitted
        self._step_mps = motor_step_mps
        self._travel = WheelTravel(parameters)
        #: Sonar that are known of: those of the model, and others that were heard.
        self._sonars = list(range(parameters.sonar_fitted))
        self._motors_on: bool | None = None
        self._codes = {"motor_left": 0.0, "motor_right": 0.0}
        self.commands: Mapping[Topic, str] = {self._topic(key): key for key in COMMANDS}
        self.services: Mapping[Topic, str] = {row.topic(options): key for key, row in SERVICES.items()}

    def announced(self) -> Iterator[Topic]:
        """Yield what is published from the beginning."""
        yield from (self._topic(key) for key in ALWAYS)
        if self._laser is not None:
            yield self._topic("scan")
        for number in self._sonars:
            yield self._topic("range", number)
            yield self._topic("distance_sensor", number + FIRST)
        for key, fitted in zip(("bumper_front", "bumper_rear"), self._bumpers, strict=True):
            if fitted:
                yield self._topic(key)

    def first(self, stamp: Nanos) -> list[Outgoing]:
        """Return what stays as it is."""
        return [
            (self._topic("tf_static"), {"transforms": self.frames.fixed(stamp, self._sonars)}),
            (self._topic("robot_description"), {"data": urdf_text(self.frames)}),
        ]

    def take_state(self, state: RobotState, stamp: Nanos) -> list[Outgoing]:
        """Return what a state makes; `stamp` is when it came, as ROS counts time."""
        frames, motion = self.frames, self._travel.take(state)
        pose = (motion.x_m, motion.y_m, motion.heading_rad)
        found: list[Outgoing] = [
            (self._topic("odom"), odometry(stamp, frames, motion)),
            (self._topic("tf"), {"transforms": frames.moving(stamp, pose, motion.wheels_rad)}),
            (self._topic("joint_states"), joint_state(stamp, frames, motion)),
            *self._take_sonars(state, stamp),
            (self._topic("sonar"), sonar_points(stamp, frames, state.sonar)),
            (self._topic("battery_state"), battery(stamp, state)),
        ]
        for key, angle in zip(("encoder_left", "encoder_right"), motion.wheels_rad, strict=True):
            found.append((self._topic(key), {"data": encoder_code(angle)}))
        pressed = (state.front_bumpers, state.rear_bumpers)
        for key, segments, fitted in zip(("bumper_front", "bumper_rear"), pressed, self._bumpers, strict=True):
            if fitted:
                found.append((self._topic(key), bumpers(segments, fitted)))
        if state.compass_rad is not None:
            found.append((self._topic("imu"), compass(stamp, frames, state.compass_rad)))
        if state.motors_enabled is not None and state.motors_enabled is not self._motors_on:
            self._motors_on = state.motors_enabled
            found.append((self._topic("motors_state"), {"data": state.motors_enabled}))
        return found

    def at_connection(self) -> Iterator[tuple[CommandNumber, int]]:
        """Yield the commands and arguments that a session begins with: the laser's."""
        if self._laser is not None:
            yield CommandNumber.SIM_LRF_SET_FOV_START, self._laser.start_deg
            yield CommandNumber.SIM_LRF_SET_FOV_END, self._laser.end_deg
            yield CommandNumber.SIM_LRF_SET_RES, self._laser.step_cdeg
            yield CommandNumber.SIM_LRF_ENABLE, 1

    def take_packet(self, packet: ServerPacket, stamp: Nanos) -> list[Outgoing]:
        """Return what a packet that is no state makes: a scan, where it ends one."""
        if self._scans is None or not isinstance(packet, SimLaserPacket):
            return []
        scan = self._scans.take(packet, stamp)
        return [] if scan is None else [(self._topic("scan"), scan)]

    def tell_health(
        self, state: RobotState | None, stamp: Nanos, link: str, *, is_open: bool, counts: Mapping[str, object]
    ) -> Outgoing:
        """Return the diagnostics; arguments as of `robot_messages.health`."""
        return self._topic("diagnostics"), diagnostics(stamp, health(state, link, is_open=is_open, counts=counts))

    def take_commands(self, received: Iterable[Received], now: Nanos) -> list[Asked]:
        """Return what messages ask for, the newest speed last and alone."""
        asked: list[Asked] = []
        speed: Speed | None = None
        for item in received:
            one = self._asked(self.commands[item.topic], item.message)
            if isinstance(one, Speed):
                speed = one
            else:
                asked.append(one)
        if speed is None:
            return asked
        self._stops_at = now + self._deadman_ns
        return [*asked, speed]

    def take_call(self, call: Received) -> Asked:
        """Return what the call of a service asks for."""
        return self._asked(self.services[call.topic], call.message)

    def next_deadline(self) -> Nanos | None:
        """Return when the deadman stops the robot."""
        return self._stops_at

    def advance_to(self, now: Nanos) -> list[Asked]:
        """Return a stop where nobody has asked for a speed in time."""
        if self._stops_at is None or now < self._stops_at:
            return []
        self.stopped()
        return [StopRequest()]

    def forget_place(self) -> None:
        """Take the next pose as a place that the robot was put to."""
        self._travel.jump()

    def stopped(self) -> None:
        """Take note that the robot was stopped: a motor's topic starts from 0 again."""
        self._codes = dict.fromkeys(self._codes, 0.0)
        self._stops_at = None

    def _take_sonars(self, state: RobotState, stamp: Nanos) -> list[Outgoing]:
        found: list[Outgoing] = []
        new = [echo for echo in state.sonar if echo.at_ns == state.at_ns]
        unknown = [echo.number for echo in new if echo.number not in self._sonars]
        if unknown:
            self._sonars += unknown
            found.append((self._topic("tf_static"), {"transforms": self.frames.fixed(stamp, self._sonars)}))
        reach = self.frames.parameters.sonar_range_m
        for echo in new:
            message = sonar_range(stamp, self.frames, echo.number, echo.range_m)
            found.append((self._topic("range", echo.number), message))
            found.append((self._topic("distance_sensor", echo.number + FIRST), {"data": near(echo.range_m, reach)}))
        return found

    def _asked(self, key: str, message: Message) -> Asked:
        match key:
            case "enable_motors":
                return MotorPower(bool(message["data"]))
            case "reset_odometry":
                return ResetOdometry()
            case "motor_left" | "motor_right":
                return self._take_motor(key, cast("int", message["data"]))
            case _:
                twist = cast("Message", message["twist"]) if key == "cmd_vel_stamped" else message
                return _speed(cast("Message", twist["linear"]), cast("Message", twist["angular"]))

    def _take_motor(self, key: str, code: int) -> Asked:
        """Return the robot's speed with one wheel's set anew, as the thesis's adapter makes it of two wheels."""
        speed = motor_speed(code, self._step_mps)
        if speed is None:
            return Refused(f"{key} {code}: a motor takes -4 to 7")
        self._codes[key] = speed
        left, right = self._codes["motor_left"], self._codes["motor_right"]
        return Speed((left + right) / 2, (right - left) / (self.frames.parameters.track_mm / 1000))

    def _topic(self, key: str, number: int | None = None) -> Topic:
        return TOPICS[key].topic(self._options, number)


def _speed(linear: Message, angular: Message) -> Asked:
    forward, turn = cast("float", linear["x"]), cast("float", angular["z"])
    if not (math.isfinite(forward) and math.isfinite(turn)):
        return Refused(f"cmd_vel of {forward} m/s and {turn} rad/s")
    return Speed(forward, turn)
