"""Levels of wires to numbers and back: pure functions, integers only.

Motor values are two's complement of any width (three bits today: −4..+3).
Encoder codes are absolute positions of a wheel, taken by floor.

Invariant: every function is exact, and its inverse where it has one.
"""

from enum import StrEnum


class BitOrder(StrEnum):
    """Which motor wire carries the most significant bit."""

    #: As pinout.toml says: the last wire (comm3) weighs most.
    COMM3_MSB = "comm3_msb"
    #: As one printed listing packs them: comm1 weighs most.
    COMM1_MSB = "comm1_msb"


def reverse_bits(code: int, width: int) -> int:
    """Return a code of `width` bits read from its other end."""
    _check_code(code, width)
    reversed_code = 0
    for bit in range(width):
        reversed_code |= (code >> bit & 1) << (width - 1 - bit)
    return reversed_code


def motor_value(code: int, width: int, bit_order: BitOrder = BitOrder.COMM3_MSB) -> int:
    """Return the signed value that motor wires carry.

    Args:
        code: The wires' levels, each at its weight of pinout.toml; 0 to 2**width − 1.
        width: Number of wires, 1 or more.
        bit_order: Which wire weighs most.

    Returns:
        −2**(width−1) .. 2**(width−1) − 1; positive is forward.
    """
    if bit_order is BitOrder.COMM1_MSB:
        code = reverse_bits(code, width)
    _check_code(code, width)
    sign = 1 << (width - 1)
    return (code ^ sign) - sign


def motor_code(value: int, width: int, bit_order: BitOrder = BitOrder.COMM3_MSB) -> int:
    """Return the wires' levels for a signed value: the inverse of `motor_value`."""
    sign = 1 << (width - 1)
    if not -sign <= value < sign:
        raise ValueError(f"motor value {value} does not fit {width} bits ({-sign}..{sign - 1})")
    code = value & ((1 << width) - 1)
    return reverse_bits(code, width) if bit_order is BitOrder.COMM1_MSB else code


def encoder_count(angle: int, per_turn: int, width: int) -> int:
    """Return how many encoder steps a wheel has turned, by floor and without wrapping.

    Args:
        angle: Angle or travel in any unit, either sign.
        per_turn: The same unit for one turn, positive.
        width: Number of encoder wires; a turn has 2**width steps.
    """
    if per_turn <= 0:
        raise ValueError(f"per_turn must be positive, got {per_turn}")
    return (angle << width) // per_turn


def encoder_code(angle: int, per_turn: int, width: int) -> int:
    """Return the absolute code of a wheel's angle: −1 degree is code 7 of three bits."""
    return encoder_count(angle, per_turn, width) & ((1 << width) - 1)


def is_near(range_um: int, threshold_um: int) -> bool:
    """Tell whether something stands nearer than the threshold; at the threshold is not nearer."""
    return range_um < threshold_um


def divide_half_away(numerator: int, denominator: int) -> int:
    """Return the quotient rounded to the nearest integer, halves away from zero.

    The one rounding rule of the adapter's arithmetic; the C++ twin has the same.
    """
    if denominator <= 0:
        raise ValueError(f"denominator must be positive, got {denominator}")
    magnitude = (2 * abs(numerator) + denominator) // (2 * denominator)
    return magnitude if numerator >= 0 else -magnitude


def _check_code(code: int, width: int) -> None:
    if width < 1:
        raise ValueError(f"width must be 1 or more, got {width}")
    if not 0 <= code < 1 << width:
        raise ValueError(f"code {code} does not fit {width} bits")
