"""Numbers with units on the command line: `0.5m`, `-90deg`, `200mm/s`, `2s`.

A number without its unit is refused: 500 may be metres or millimetres, and the
robot would drive either.
"""

import math
import re
from collections.abc import Mapping
from enum import Enum

from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

_NUMBER = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>\S*)")


class Quantity(Enum):
    """What is measured: the units that are taken, and an example."""

    LENGTH = ({"m": 1.0, "cm": 0.01, "mm": 0.001}, "0.5m")
    ANGLE = ({"deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0}, "90deg")
    SPEED = ({"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001}, "0.2m/s")
    TURN_RATE = ({"deg/s": math.pi / 180, "°/s": math.pi / 180, "rad/s": 1.0}, "30deg/s")
    TIME = ({"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}, "2s")

    @property
    def units(self) -> Mapping[str, float]:
        """Unit → how many of the SI unit (metres, radians, seconds) it is."""
        return self.value[0]

    @property
    def example(self) -> str:
        """A value as one would type it."""
        return self.value[1]


def parse_quantity(text: str, quantity: Quantity, option: str) -> float:
    """Return a value in SI units.

    Args:
        text: As typed.
        quantity: What is measured.
        option: Where it was typed, for the message.

    Raises:
        UsageError: It is no number, or has no unit or another one.
    """
    found = _NUMBER.fullmatch(text.strip())
    units = ", ".join(quantity.units)
    if found is None:
        raise UsageError(f"{option} {text!r} is no number with a unit", hint=f"{option} {quantity.example}")
    if found["unit"] not in quantity.units:
        what = f"has the unit {found['unit']!r}" if found["unit"] else "has no unit"
        raise UsageError(f"{option} {text!r} {what}; take {units}", hint=f"{option} {quantity.example}")
    value = float(found["number"]) * quantity.units[found["unit"]]
    if not math.isfinite(value):
        raise UsageError(f"{option} {text!r} is too large", hint=f"{option} {quantity.example}")
    return value


def parse_duration(text: str, option: str) -> Nanos:
    """Return a duration in nanoseconds.

    Raises:
        UsageError: It is no time, or not positive.
    """
    seconds = parse_quantity(text, Quantity.TIME, option)
    if not 0 < seconds < 1e9:
        raise UsageError(f"{option} {text!r} must be more than 0", hint=f"{option} 10s")
    return round(seconds * NS_PER_S)
