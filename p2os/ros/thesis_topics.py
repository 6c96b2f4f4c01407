"""The values of the thesis's own topics, std_msgs/Int32 each: three-bit motors and encoders, one-bit distances.

Source: the thesis's chapters 5.1.2.2 and 5.2.2.2: motors are two's complement (+1 to +3 ahead, -1 to -4 back), encoders
absolute with eight places a turn, distance sensors 1 where something is nearer than a threshold. Its emulator published
motors as 0 to 7, so both spellings are taken; the signed one is published. Encoders go by floor: -1 degree is 7, where
the thesis's plug-in, which cuts towards zero, had 0 twice as wide.
"""

import math

from p2os.robots.motor_step import STEP_MPS

#: Places of an encoder a turn, and codes of a motor.
CODES = 8
#: The topics are numbered from 1; the sonar from 0.
FIRST = 1
#: The largest code ahead.
_MOST_AHEAD = CODES // 2 - 1


def motor_speed(code: int, step_mps: float = STEP_MPS) -> float | None:
    """Return the rim speed that a motor's value asks for, m/s; None where it is no such value."""
    if not -CODES // 2 <= code < CODES:
        return None
    return (code if code <= _MOST_AHEAD else code - CODES) * step_mps


def encoder_code(angle_rad: float) -> int:
    """Return the place of a wheel, 0 to 7."""
    return math.floor(angle_rad / math.tau * CODES) % CODES


def near(range_m: float, reach_m: float) -> int:
    """Return 1 where a range is below half of a sonar's reach, as the thesis's adapter has it."""
    return int(range_m < reach_m / 2)
