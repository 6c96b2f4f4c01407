"""A SIP in SI units: metres, radians, m/s, volts.

The only other place that handles raw counts is `p2os.protocol.sip`.
"""

import math

from p2os.robots.parameters import RobotParameters


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
