"""A SIP in SI units: metres, radians, m/s, volts.

The only other place that handles raw counts is `p2os.protocol.sip`.
"""

import math
from dataclasses import dataclass

from p2os.protocol.sip import POSITION_MASK, StandardSip
from p2os.robots.parameters import RobotParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class SipInUnits:
    """A standard SIP as a person reads it.

    Positions are those of one packet, 0 to the span of 15 bits; following a
    robot over several packets takes an `Unwrapper`. `sonar_m` holds
    (number, metres from the transducer) for each new reading.
    """

    is_moving: bool
    x_m: float
    y_m: float
    heading_rad: float
    left_mps: float
    right_mps: float
    turn_radps: float
    battery_v: float
    stall_left: bool
    stall_right: bool
    front_bumpers: int
    rear_bumpers: int
    sonar_m: tuple[tuple[int, float], ...]


def heading_rad(raw_heading: int, parameters: RobotParameters) -> float:
    """Return a heading in radians, within half a turn of 0."""
    return math.remainder(raw_heading * parameters.angle_conv_rad, 2 * math.pi)


def rim_mps(raw_velocity: int, parameters: RobotParameters) -> float:
    """Return a wheel's speed in m/s."""
    return raw_velocity * (parameters.velocity_conv / 1000)


def range_m(raw_range: int, parameters: RobotParameters) -> float:
    """Return a sonar reading in metres from the transducer."""
    return raw_range * parameters.range_conv_mm / 1000


def battery_v(raw_battery: int) -> float:
    """Return the battery's voltage."""
    return raw_battery / 10


def in_units(sip: StandardSip, parameters: RobotParameters) -> SipInUnits:
    """Return a SIP in SI units by a robot's parameters."""
    distance = parameters.distance_conv_mm / 1000
    left, right = (rim_mps(raw, parameters) for raw in (sip.raw_left_velocity, sip.raw_right_velocity))
    return SipInUnits(
        is_moving=sip.moving,
        x_m=(sip.raw_x & POSITION_MASK) * distance,
        y_m=(sip.raw_y & POSITION_MASK) * distance,
        heading_rad=heading_rad(sip.raw_heading, parameters),
        left_mps=left,
        right_mps=right,
        turn_radps=(right - left) / (parameters.track_mm / 1000),
        battery_v=battery_v(sip.raw_battery),
        stall_left=sip.stall_left,
        stall_right=sip.stall_right,
        front_bumpers=sip.front_bumpers,
        rear_bumpers=sip.rear_bumpers,
        sonar_m=tuple((echo.number, range_m(echo.raw_range, parameters)) for echo in sip.sonar),
    )
