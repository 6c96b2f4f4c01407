"""Standard packets folded into states: SI units, one pose, the last reading of every sonar.

Units and wraps are `p2os.protocol`'s; where a state goes is the core's.

The robot counts from where its session opened. A client's pose goes on: at the
first packet of a later session the robot is taken to stand where it was last
seen, since nobody knows how far it was carried meanwhile (`PoseKeeper`).

Which firmware family's packets these are is judged by what arrives (`Firmware`);
the name of the model is a hint for the order of two bytes, and for nothing else.

Invariant: within a session the pose is the robot's own odometry, moved and
turned by one fixed amount; nothing is accumulated but whole counts.
"""

import math
from dataclasses import dataclass, replace

from p2os.client.robot_state import Limits, RobotPose, RobotState, SonarEcho
from p2os.protocol.config_packet import AROS_1_6_FIELDS, AROS_1_8_FIELDS, P2OS_FIELDS, ConfigPacket
from p2os.protocol.odometry import POSITION_MODULUS, Odometry
from p2os.protocol.profiles import Profile, profiles_of
from p2os.protocol.sip import StandardSip
from p2os.protocol.units import battery_v, range_m, rim_mps
from p2os.robots.parameters import RobotParameters
from simbase.timing import NS_PER_S, Nanos

#: Flag bits of AROS and ARCOS packets (Pioneer 2/3 H8 manual, FLAGS): motors, STOP button.
MOTORS_FLAG, STOP_BUTTON_FLAG = 1 << 0, 1 << 5
#: Compass counts of 2 degrees; these mean that there is none (player's driver reads them so).
COMPASS_COUNT_RAD = math.radians(2)
NO_COMPASS = frozenset({0, 181, 255})
#: A full byte of the analog reading is 5 V (Pioneer 2/3 manuals, standard SIP).
ANALOG_COUNT_V = 5 / 255
#: Bumper segments sit in bits 1 to 7 of the stall bytes.
SEGMENTS = range(1, 8)
#: What the byte of the analog port can be (Pioneer 2 manual, SIP table).
ANALOG_PORTS = range(1, 6)


@dataclass(frozen=True, slots=True)
class Bumpers:
    """How many segments are fitted in front and at the rear."""

    front: int = 0
    rear: int = 0


class Firmware:
    """Which family's packets a robot sends, and whether their word 16 is known to hold flags.

    P2OS has a servo's pulse width there, so a bit of it says nothing of the motors until one of three things came: a
    tail, which only ARCOS sends; a CONFIGpac longer than that of P2OS; or bit 0, off until this client sent ENABLE,
    came on then. AROS before 1.6 has the CONFIGpac of P2OS. The one byte of gripper and analog port that is 0 is the
    gripper's, which tells their order.

    Args:
        given: What the program says it is; None: what arrives decides.
    """

    def __init__(self, given: Profile | None = None) -> None:
        self._given = given
        self.new_session(Profile.P2OS)

    def new_session(self, hint: Profile) -> None:
        """Know nothing but what the model's name hints at."""
        #: The family whose layout packets are read in.
        self.profile = self._given or hint
        self._is_shown = self._given is not None
        self._has_flags_shown = False
        self._is_order_shown = False
        self._is_on_asked = self._was_off = self._has_servo = False

    @property
    def tells_motors(self) -> bool:
        """Whether word 16 is known to hold flags."""
        return self.profile.has_flags and (self._is_shown or self._has_flags_shown)

    def take_motors_asked(self, on: bool) -> None:
        """Note that ENABLE is sent."""
        self._is_on_asked = on

    def take_servo_set(self) -> None:
        """Note that PTUPOS is sent: from here on word 16 may change by it."""
        self._has_servo = True

    def take_config(self, config: ConfigPacket | None) -> None:
        """Judge by a CONFIGpac; None: the robot sends none."""
        if self._is_shown or config is None:
            return
        if config.fields_sent > P2OS_FIELDS:
            self.profile = Profile.ARCOS if config.fields_sent > AROS_1_8_FIELDS else Profile.AROS
            self._is_shown = True
        elif self.profile is Profile.ARCOS:
            self.profile = Profile.P2OS

    def take(self, sip: StandardSip) -> None:
        """Judge by a standard packet that was read in the present layout."""
        if self._given is None and sip.tail:
            self.profile, self._is_shown = Profile.ARCOS, True
        if self._is_shown:
            return
        self._take_order(sip)
        is_on = bool(sip.raw_flags & MOTORS_FLAG)
        if not self._is_on_asked:
            self._was_off = not is_on
        elif is_on and self._was_off and not self._has_servo:
            self._has_flags_shown = True

    def _take_order(self, sip: StandardSip) -> None:
        pair = (sip.analog_port, sip.gripper_state)
        first, second = reversed(pair) if self.profile.has_gripper_first else pair
        if self._is_order_shown or 0 not in (first, second) or first + second not in ANALOG_PORTS:
            return
        self._is_order_shown = True
        if second == 0:
            self.profile = Profile.P2OS
        elif self.profile is Profile.P2OS:
            self.profile = Profile.AROS


class Observer:
    """What is known of the robot so far.

    Args:
        parameters: Its model's.
        profile: Its firmware family, where the program says it.
    """

    def __init__(self, parameters: RobotParameters, profile: Profile | None = None) -> None:
        self.parameters = parameters
        self.firmware = Firmware(profile)
        self.bumpers = Bumpers()
        self.state: RobotState | None = None
        self._pose = PoseKeeper()
        self._sonar: dict[int, SonarEcho] = {}
        self._number = 0

    def doubtful_gap_ns(self, limits: Limits) -> Nanos | None:
        """Return the time between the last two packets, if the odometry's counters may have wrapped in it unnoticed.

        That is so when the robot, at its limits, could have driven half of the position's span or turned half round.
        """
        gap_s = self._pose.gap_ns / NS_PER_S
        half_span_m = POSITION_MODULUS // 2 * self.parameters.distance_conv_mm / 1000
        is_doubtful = gap_s * limits.forward_mps >= half_span_m or gap_s * limits.turn_radps >= math.pi
        return self._pose.gap_ns if is_doubtful else None

    @property
    def wheels_mps(self) -> tuple[float, float]:
        """Left and right wheel in the last packet, m/s."""
        return (0.0, 0.0) if self.state is None else (self.state.left_mps, self.state.right_mps)

    def new_session(self, parameters: RobotParameters) -> None:
        """Begin with a robot whose counters start anew."""
        self.parameters = parameters
        self.firmware.new_session(profiles_of(parameters)[0])
        self._pose.new_session()
        self._sonar.clear()

    def place(self, pose: RobotPose) -> None:
        """Set where the robot is; the newest state and those to come have it there."""
        self._pose.place(pose)
        if self.state is not None:
            self.state = replace(self.state, pose=pose)

    def take(self, sip: StandardSip, now: Nanos) -> RobotState:
        """Return the state that a packet makes."""
        self._number += 1
        parameters = self.parameters
        for reading in sip.sonar:
            self._take_echo(reading.number, range_m(reading.raw_range, parameters), now)
        left_mps, right_mps = (rim_mps(raw, parameters) for raw in (sip.raw_left_velocity, sip.raw_right_velocity))
        has_flags = self.firmware.tells_motors
        charge, temperature = sip.tail_field("state_of_charge"), sip.tail_field("raw_temperature")
        self.state = RobotState(
            number=self._number,
            at_ns=now,
            pose=self._pose.take(sip, parameters, now),
            odometry=self._pose.odometry,
            forward_mps=(left_mps + right_mps) / 2,
            turn_radps=(right_mps - left_mps) / (parameters.track_mm / 1000),
            left_mps=left_mps,
            right_mps=right_mps,
            is_moving=sip.moving,
            motors_enabled=bool(sip.raw_flags & MOTORS_FLAG) if has_flags else None,
            battery_v=battery_v(sip.raw_battery),
            stall_left=sip.stall_left,
            stall_right=sip.stall_right,
            front_bumpers=_pressed(sip.front_bumpers, self.bumpers.front),
            rear_bumpers=_pressed(sip.rear_bumpers, self.bumpers.rear),
            sonar=tuple(self._sonar[number] for number in sorted(self._sonar)),
            compass_rad=None if sip.raw_compass in NO_COMPASS else sip.raw_compass * COMPASS_COUNT_RAD,
            analog_port=sip.analog_port,
            analog_v=sip.raw_analog * ANALOG_COUNT_V,
            digital_in=sip.digital_in,
            digital_out=sip.digital_out,
            stop_button=bool(sip.raw_flags & STOP_BUTTON_FLAG) if has_flags else None,
            state_of_charge=None if charge is None else charge / 100,
            temperature_c=None if temperature is None or temperature <= -127 else float(temperature),
            sip=sip,
        )
        return self.state

    def _take_echo(self, number: int, range_m: float, now: Nanos) -> None:
        """Keep a reading, and where on its sonar's axis it came from."""
        if number >= len(self.parameters.sonar):
            return
        place = self.parameters.sonar[number]
        direction = math.radians(place.heading_deg)
        self._sonar[number] = SonarEcho(
            number=number,
            range_m=range_m,
            x_m=place.x_mm / 1000 + range_m * math.cos(direction),
            y_m=place.y_mm / 1000 + range_m * math.sin(direction),
            is_echo=range_m < self.parameters.sonar_range_m,
            at_ns=now,
        )


def limits_of(parameters: RobotParameters, config: ConfigPacket | None) -> Limits:
    """Return how fast a robot may go: its CONFIGpac's present maxima, never above what its model can.

    A field of 0 is one that was not sent; the model's own default stands for it.
    """
    motion = parameters.motion

    def value(name: str, default: int, most: int | None = None) -> float:
        sent = (getattr(config, name) if config is not None else 0) or default
        return float(sent if most is None else min(sent, most))

    return Limits(
        forward_mps=value("transvelmax", motion.max_velocity_mm_s, parameters.max_velocity_mm_s) / 1000,
        turn_radps=math.radians(value("rotvelmax", motion.max_rotation_deg_s, parameters.max_rotation_deg_s)),
        accel_mps2=value("transacc", motion.accel_mm_s2) / 1000,
        decel_mps2=value("transdecel", motion.decel_mm_s2) / 1000,
        turn_accel_radps2=math.radians(value("rotacc", motion.rot_accel_deg_s2)),
        turn_decel_radps2=math.radians(value("rotdecel", motion.rot_decel_deg_s2)),
    )


def bumpers_of(config: ConfigPacket | None) -> Bumpers:
    """Return the bumpers that a CONFIGpac names; robots before AROS 1.6 name none."""
    if config is None or config.fields_sent < AROS_1_6_FIELDS:
        return Bumpers()
    return Bumpers(config.frontbumps, config.rearbumps)


class PoseKeeper:
    """Turns the counters of the packets into one pose."""

    def __init__(self) -> None:
        self.pose = RobotPose()
        #: The robot's own count since its session opened; HEAD means its heading.
        self.odometry = RobotPose()
        #: Between the last two packets of this session.
        self.gap_ns: Nanos = 0
        self._last_ns: Nanos = 0
        self._anchor: tuple[RobotPose, RobotPose] | None = None
        self._odometry: Odometry | None = None

    def new_session(self) -> None:
        """Hold the pose until the next packet, which is taken to show the same place."""
        self._anchor = self._odometry = None

    def place(self, pose: RobotPose) -> None:
        """Set where the robot is."""
        self.pose = pose
        if self._anchor is not None:
            self._anchor = (pose, self.odometry)

    def take(self, sip: StandardSip, parameters: RobotParameters, now: Nanos) -> RobotPose:
        """Follow the robot to the place that a packet shows, and return it."""
        if self._odometry is None:
            self._odometry, self._last_ns = Odometry(parameters), now
        self._odometry.update(sip)
        self.gap_ns, self._last_ns = now - self._last_ns, now
        self.odometry = RobotPose(self._odometry.x_m, self._odometry.y_m, self._odometry.heading_rad)
        if self._anchor is None:
            self._anchor = (self.pose, self.odometry)
        self.pose = _moved(*self._anchor, self.odometry)
        return self.pose


def _moved(start: RobotPose, then: RobotPose, now: RobotPose) -> RobotPose:
    """Return the pose of a robot that stood at `start` when it counted `then` and counts `now`."""
    turned = start.heading_rad - then.heading_rad
    cos, sin = math.cos(turned), math.sin(turned)
    dx, dy = now.x_m - then.x_m, now.y_m - then.y_m
    heading = start.heading_rad + now.heading_rad - then.heading_rad
    return RobotPose(start.x_m + cos * dx - sin * dy, start.y_m + sin * dx + cos * dy, heading)


def _pressed(bits: int, fitted: int) -> tuple[int, ...]:
    return tuple(segment for segment in SEGMENTS[:fitted] if bits >> (segment - 1) & 1)
