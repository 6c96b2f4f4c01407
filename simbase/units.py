"""Numbers with units, as people type them: `0.5m`, `-90deg`, `200mm/s`, `2s`.

A number without its unit is refused: 500 may be metres or millimetres, and a robot would drive either. Only 0 is the
same in all of them. What is counted, and what has one unit only (a line's speed, a factor), may stand bare.

Not here: options of a command line; each of them makes its own of a row of the table at the end.
Invariant: a whole number comes out exactly, for no binary fraction stands between the text and its value.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, NS_PER_US

#: Makes an exception of one line for a person.
MakeError = Callable[[str], Exception]

_NUMBER = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>\S*)", re.ASCII)
#: What else is typed for the u of microseconds.
_MICRO = str.maketrans("\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}", "uu")


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """What is measured."""

    #: As a message calls it, with its article's noun: "length".
    name: str
    #: As help shows its values: "LENGTH".
    metavar: str
    #: Unit → how many of the unit in which the value is handed on it is.
    units: Mapping[str, float]
    #: A value as one would type it.
    example: str
    #: Whether the value is handed on as a whole number.
    is_whole: bool = False

    def option(
        self,
        error: MakeError,
        *,
        purpose: str,
        least: str = "",
        most: str = "",
        above_zero: bool = False,
        shown: str = "",
        metavar: str = "",
    ) -> dict[str, Any]:
        """Return what makes an option of a command line take this quantity: `typer.Option(*flags, **these)`.

        Args:
            error: Makes what is raised at a value that cannot be.
            purpose: What it is for.
            least: The least value, as typed; empty: none.
            most: The greatest, likewise.
            above_zero: Refuse 0 and less.
            shown: The default as help shows it; empty where there is none.
            metavar: In place of the quantity's own.
        """
        bounds = range_words(least, most, above_zero=above_zero) if least or most else ""
        notes = "; ".join(note for note in (bounds, f"default: {shown}" if shown else "") if note)
        return {
            "help": f"{purpose}  [{notes}]" if notes else purpose,
            "metavar": metavar or self.metavar,
            "show_default": False,
            "parser": self.parser(error, least=least, most=most, above_zero=above_zero),
        }

    def parser(
        self, error: MakeError, *, least: str = "", most: str = "", above_zero: bool = False
    ) -> Callable[[str], float]:
        """Return what reads a value of this quantity and raises what `error` makes; other arguments as of `option`."""
        lowest = self.read(least) if least else -math.inf
        highest = self.read(most) if most else math.inf
        words = range_words(least, most, above_zero=above_zero)

        def parse(text: str) -> float:
            if not isinstance(text, str):  # a default that is in its unit already
                return text
            value = self.read(text, error, words)
            if not lowest <= value <= highest or (above_zero and value <= 0):
                raise error(f"{text!r} is out of range: {self._takes(words)}")
            return value

        parse.__name__ = self.metavar
        return parse

    def read(self, text: str, error: MakeError = UsageError, words: str = "") -> float:
        """Return a value, in the unit that counts 1.

        Args:
            text: As typed.
            error: What it makes is raised.
            words: The range, for the message.

        Raises:
            Exception: It is no number, or has no unit or another one.
        """
        found = _NUMBER.fullmatch(text.strip().translate(_MICRO))
        if found is None:
            raise error(f"{text!r} is no {self.name}: {self._takes(words)}")
        number, unit = float(found["number"]), found["unit"]
        if unit not in self.units and not (number == 0 and not unit):
            what = f"has the unit {unit!r}" if unit else "has no unit"
            raise error(f"{text!r} {what}: {self._takes(words)}")
        value = number * self.units.get(unit, 1.0)
        if not math.isfinite(value):
            raise error(f"{text!r} is too large: {self._takes(words)}")
        if not self.is_whole:
            return value
        if "" in self.units and value != round(value):
            raise error(f"{text!r} is no {self.name}: {self._takes(words)}")
        return int(Decimal(found["number"]) * int(self.units.get(unit, 1)))

    def _takes(self, words: str) -> str:
        """Return what is taken, in words: range, units, an example."""
        *others, last = [unit for unit in self.units if unit] or [""]
        units = f"in {', '.join(others)} or {last}" if others else ""
        return ", ".join(text for text in (words, units, f"such as {self.example}") if text)


def range_words(least: str, most: str, *, above_zero: bool = False) -> str:
    """Return a range in words: "0.1s to 10s"; empty where there is none."""
    if above_zero:
        return f"more than 0, {most} at most" if most else "more than 0"
    if least and most:
        return f"{least} to {most}"
    return f"{least} or more" if least else f"{most} or less" if most else ""


_DEGREE = math.pi / 180

LENGTH = Quantity(name="length", metavar="LENGTH", units={"m": 1.0, "cm": 0.01, "mm": 0.001}, example="0.5m")
ANGLE = Quantity(name="angle", metavar="ANGLE", units={"deg": _DEGREE, "°": _DEGREE, "rad": 1.0}, example="90deg")
SPEED = Quantity(name="speed", metavar="SPEED", units={"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001}, example="0.2m/s")
TURN_RATE = Quantity(
    name="turning speed", metavar="RATE", units={"deg/s": _DEGREE, "°/s": _DEGREE, "rad/s": 1.0}, example="30deg/s"
)
#: Nanoseconds.
TIME = Quantity(
    name="time", metavar="TIME", example="2s", is_whole=True,
    units={"ns": 1, "us": NS_PER_US, "ms": NS_PER_MS, "s": NS_PER_S, "min": 60 * NS_PER_S, "h": 3600 * NS_PER_S},
)  # fmt: skip
#: Bits a second.
BAUD = Quantity(
    name="speed of a line", metavar="BAUD", units={"": 1, "baud": 1, "kbaud": 1000}, example="9600", is_whole=True
)
#: How many times as fast.
FACTOR = Quantity(name="factor", metavar="FACTOR", units={"": 1.0, "x": 1.0, "×": 1.0}, example="2")
#: Hundredths.
PERCENT = Quantity(name="percentage", metavar="PERCENT", units={"": 1.0, "%": 1.0}, example="80%")
COUNT = Quantity(name="whole number", metavar="N", units={"": 1}, example="3", is_whole=True)
SEED = Quantity(name="whole number", metavar="SEED", units={"": 1}, example="7", is_whole=True)
PORT = Quantity(name="number of a TCP port", metavar="PORT", units={"": 1}, example="3333", is_whole=True)


def ranges_text(numbers: Iterable[int]) -> str:
    """Return whole numbers as a person writes them, in order, neighbours as a range: "3-5, 9"."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number == found[-1][1] + 1:
            found[-1][1] = number
        else:
            found.append([number, number])
    return ", ".join(f"{first}" if first == last else f"{first}-{last}" for first, last in found)
