"""What the robot says of itself: the standard packet and the configuration.

Values that no part of this model knows are those of the one packet captured
from a P2-DX: bumpers that are not fitted read as floating inputs, the analog
port is number 5, the heading set-point is the heading.
"""

import math

from p2os.config_packet import ARCOS_FIELDS, AROS_1_8_FIELDS, P2OS_FIELDS, ConfigPacket
from p2os.parameters import RobotParameters
from p2os.pioneer.command_handlers import Works
from p2os.pioneer.motion import UDEG_PER_DEG, MotionLimits
from p2os.pioneer.odometry_counts import raw_angle
from p2os.pioneer.ports import WheelState
from p2os.pioneer.settings import ControllerSettings
from p2os.profiles import Profile
from p2os.sip import MOVING, STANDING, SonarReading, StandardSip
from p2os.timing import NS_PER_MS

RAD_PER_DEG = math.pi / 180

#: Seven floating inputs read as ones (the captured P2-DX packet: stall bytes FE FE).
BUMPERS_NOT_FITTED = 0x7F
#: Selected when nobody has selected another (Pioneer 2 manual, ADSEL).
ANALOG_PORT = 5
#: Bits of the AROS and ARCOS flags: motors on, first sonar array on (H8 manual, SIP table).
FLAG_MOTORS, FLAG_SONAR = 1 << 0, 1 << 1
#: The ARCOS tail where nothing is known: no fault, no sideways motion, no thermometer, no charge sensor.
NO_TEMPERATURE, CHARGE_UNKNOWN = -127, -1

#: chosen: what ARIA may set at most, until a real robot's FLASH says otherwise.
TOP_ACCELERATION_MM_S2, TOP_ROTATIONAL_ACCELERATION_DEG_S2 = 2000, 300
#: chosen: full duty cycle is 500.
PWM_MAX = 500
#: chosen: 11.0 V, a nearly empty lead-acid battery of nominal 12 V.
LOW_BATTERY_DECIVOLTS = 110
FIELDS_OF_PROFILE = {Profile.P2OS: P2OS_FIELDS, Profile.AROS: AROS_1_8_FIELDS, Profile.ARCOS: ARCOS_FIELDS}


def standard_packet(
    works: Works, wheels: WheelState, parameters: RobotParameters, settings: ControllerSettings
) -> StandardSip:
    """Return the packet that describes this moment, and take the sonar readings that it carries."""
    raw_x, raw_y = works.reckoning.raw_position(parameters.distance_nm_per_count)
    left, right = (_raw_velocity(speed, parameters) for speed in (wheels.left_speed_mps, wheels.right_speed_mps))
    profile = settings.profile
    bumpers = 0 if profile.has_flags else BUMPERS_NOT_FITTED
    motors_and_sonar = works.motors_enabled * FLAG_MOTORS | works.sonar.is_on * FLAG_SONAR
    return StandardSip(
        kind=MOVING if left or right or any(works.motion.wheels_mps) else STANDING,
        raw_x=raw_x,
        raw_y=raw_y,
        raw_heading=raw_angle(works.reckoning.heading_rad),
        raw_left_velocity=left,
        raw_right_velocity=right,
        raw_battery=settings.battery_decivolts,
        stall_left=wheels.stalled_left,
        stall_right=wheels.stalled_right,
        rear_bumpers=bumpers,
        front_bumpers=bumpers,
        raw_control=_raw_heading_setpoint(works),
        raw_flags=motors_and_sonar if profile.has_flags else 0,
        sonar=tuple(SonarReading(number, counts) for number, counts in works.sonar.take_readings()),
        analog_port=ANALOG_PORT,
        tail=_arcos_tail(wheels, parameters, settings) if profile is Profile.ARCOS else (),
    )


def configuration(parameters: RobotParameters, settings: ControllerSettings, limits: MotionLimits) -> ConfigPacket:
    """Return the answer to CONFIG: the robot's own limits, and those in force."""
    return ConfigPacket(
        robot_class=parameters.robot_class,
        subclass=parameters.subclass,
        serial=settings.serial,
        rotveltop=parameters.max_rotation_deg_s,
        transveltop=parameters.max_velocity_mm_s,
        rotacctop=TOP_ROTATIONAL_ACCELERATION_DEG_S2,
        transacctop=TOP_ACCELERATION_MM_S2,
        pwmmax=PWM_MAX,
        name=settings.name,
        sipcycle=settings.sip_period_ns // NS_PER_MS,
        frontsonar=1,
        rearsonar=int(parameters.sonar_fitted > 8),
        lowbattery=LOW_BATTERY_DECIVOLTS,
        watchdog=settings.watchdog_ns // NS_PER_MS,
        rotvelmax=limits.max_rotation_deg_s,
        transvelmax=limits.max_velocity_mm_s,
        rotacc=limits.rot_accel_deg_s2,
        rotdecel=limits.rot_decel_deg_s2,
        transacc=limits.accel_mm_s2,
        transdecel=limits.decel_mm_s2,
        fields_sent=FIELDS_OF_PROFILE[settings.profile],
    )


def _raw_velocity(speed_mps: float, parameters: RobotParameters) -> int:
    return round(speed_mps * 1_000_000 / parameters.velocity_um_s_per_count)


def _raw_heading_setpoint(works: Works) -> int:
    """Return where the robot turns to, or its heading when it turns by speed."""
    goal_udeg = works.motion.heading_goal_udeg
    if goal_udeg is None:
        return raw_angle(works.reckoning.heading_rad)
    return raw_angle(goal_udeg / UDEG_PER_DEG * RAD_PER_DEG - works.reckoning.zero_rad)


def _arcos_tail(wheels: WheelState, parameters: RobotParameters, settings: ControllerSettings) -> tuple[int, ...]:
    """Return the tail up to the state of charge, as far as ARCOS itself sends it."""
    turn_rad_s = (wheels.right_speed_mps - wheels.left_speed_mps) * 1000 / parameters.track_mm
    return (
        settings.battery_decivolts, CHARGE_UNKNOWN, round(turn_rad_s / RAD_PER_DEG * 10), 0, 0, NO_TEMPERATURE, 0,
    )  # fmt: skip
