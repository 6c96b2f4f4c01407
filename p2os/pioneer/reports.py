"""What the robot says of itself: the standard packet.

Values that no part of this model knows are those of the one packet captured
from a P2-DX: bumpers that are not fitted read as floating inputs, the analog
port is number 5, the heading set-point is the heading.
"""

import math

from p2os.parameters import RobotParameters
from p2os.pioneer.motion import UDEG_PER_DEG
from p2os.pioneer.odometry_counts import raw_angle
from p2os.pioneer.ports import WheelState
from p2os.pioneer.works import Works
from p2os.profiles import Profile
from p2os.sip import MOVING, STANDING, SonarReading, StandardSip
from p2os.timing import Nanos

RAD_PER_DEG = math.pi / 180

#: Seven floating inputs read as ones (the captured P2-DX packet: stall bytes FE FE).
BUMPERS_NOT_FITTED = 0x7F
#: Bits of the AROS and ARCOS flags (H8 manual, SIP table).
FLAG_MOTORS, FLAG_SONAR, FLAG_STOP_BUTTON, FLAG_E_STALL = 1 << 0, 1 << 1, 1 << 5, 1 << 6
FLAG_JOYSTICK, FLAG_CHARGING = 1 << 9, 1 << 10
#: The ARCOS tail where nothing is known: no fault, no sideways motion, no thermometer, no charge sensor.
NO_TEMPERATURE, CHARGE_UNKNOWN, CHARGE_BULK = -127, -1, 1


def standard_packet(
    works: Works,
    wheels: WheelState,
    parameters: RobotParameters,
    stalls: tuple[bool, bool],
    bumps: tuple[int, int],
    now: Nanos,
) -> StandardSip:
    """Return the packet that describes this moment, and take the sonar readings that it carries.

    Args:
        works: The robot's parts.
        wheels: What its wheels do.
        parameters: Its conversions.
        stalls: Left and right wheel.
        bumps: Front and rear segments as this family tells them.
        now: The time, ns.
    """
    raw_x, raw_y = works.reckoning.raw_position(parameters.distance_nm_per_count)
    left, right = (_raw_velocity(speed, parameters) for speed in (wheels.left_speed_mps, wheels.right_speed_mps))
    rack, profile = works.rack, works.profile
    return StandardSip(
        kind=MOVING if left or right or any(works.motion.wheels_mps) else STANDING,
        raw_x=raw_x,
        raw_y=raw_y,
        raw_heading=raw_angle(works.reckoning.heading_rad),
        raw_left_velocity=left,
        raw_right_velocity=right,
        raw_battery=rack.battery.decivolts,
        stall_left=stalls[0],
        stall_right=stalls[1],
        rear_bumpers=bumps[1],
        front_bumpers=bumps[0],
        raw_control=_raw_heading_setpoint(works),
        raw_flags=_flags(works) if profile.has_flags else rack.pins.servos[0],
        raw_compass=rack.compass.raw_compass,
        sonar=tuple(SonarReading(number, counts) for number, counts in works.sonar.take_readings()),
        analog_port=rack.pins.selected,
        gripper_state=int(rack.gripper.state(now)),
        raw_analog=rack.pins.raw_analog,
        digital_in=rack.digital_in(now),
        digital_out=rack.pins.digital_out,
        tail=_arcos_tail(works, wheels, parameters) if profile is Profile.ARCOS else (),
    )


def _flags(works: Works) -> int:
    rack = works.rack
    pressed = rack.switches.stop_button
    return (
        works.motors_enabled * FLAG_MOTORS
        | works.sonar.is_on * FLAG_SONAR
        | pressed * FLAG_STOP_BUTTON
        | (pressed and rack.switches.e_stall) * FLAG_E_STALL
        | bool(rack.joystick.button1) * FLAG_JOYSTICK
        | rack.battery.is_charging * FLAG_CHARGING
    )


def _raw_velocity(speed_mps: float, parameters: RobotParameters) -> int:
    return round(speed_mps * 1_000_000 / parameters.velocity_um_s_per_count)


def _raw_heading_setpoint(works: Works) -> int:
    """Return where the robot turns to, or its heading when it turns by speed."""
    goal_udeg = works.motion.heading_goal_udeg
    if goal_udeg is None:
        return raw_angle(works.reckoning.heading_rad)
    return raw_angle(goal_udeg / UDEG_PER_DEG * RAD_PER_DEG - works.reckoning.zero_rad)


def _arcos_tail(works: Works, wheels: WheelState, parameters: RobotParameters) -> tuple[int, ...]:
    """Return the tail up to the state of charge, as far as ARCOS itself sends it."""
    turn_rad_s = (wheels.right_speed_mps - wheels.left_speed_mps) * 1000 / parameters.track_mm
    battery = works.rack.battery
    charge_state = CHARGE_BULK if battery.is_charging else CHARGE_UNKNOWN
    return (
        battery.decivolts, charge_state, round(turn_rad_s / RAD_PER_DEG * 10), 0, 0, NO_TEMPERATURE, 0,
    )  # fmt: skip
