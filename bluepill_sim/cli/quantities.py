"""Numbers with units on the command line of `p2os mcu`: times as `to_nanos` reads them, and what may stand bare.

This package imports nothing of p2os: what `p2os/cli/quantities.py` has in common with this is kept alike by a test.
"""

import re
from collections.abc import Callable
from typing import Any

import typer

from bluepill_sim.errors import BluePillError
from bluepill_sim.timing import to_nanos
from simbase.timing import Nanos

_NUMBER = re.compile(r"(?P<number>\d+\.?\d*)\s*(?P<unit>\S*)")
#: Units of a line's speed, and how many bit/s each is.
BAUDS = {"": 1, "baud": 1, "kbaud": 1000}
MOST_PORT = 65535


def time_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes a time.

    Args:
        flags: Its names.
        purpose: What it is for.
        shown: The default as help shows it; empty where there is none.
    """
    return _option(flags, purpose, shown, "TIME", _time)


def baud_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes the speed of a line; arguments as of `time_option`."""
    return _option(flags, purpose, shown, "BAUD", _number(BAUDS, 1, None, "more than 0, such as 9600"))


def port_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes the number of a TCP port; arguments as of `time_option`."""
    return _option(flags, purpose, shown, "PORT", _number({"": 1}, 0, MOST_PORT, f"0 to {MOST_PORT}, such as 3333"))


def percent_option(*flags: str, purpose: str, shown: str = "") -> Any:
    """Return an option that takes a share in percent; arguments as of `time_option`."""
    return _option(flags, purpose, shown, "PERCENT", _number({"": 1, "%": 1}, 0, 100, "0% to 100%, such as 80%"))


def _option(flags: tuple[str, ...], purpose: str, shown: str, metavar: str, parser: Callable[[str], float]) -> Any:
    text = f"{purpose}  [default: {shown}]" if shown else purpose
    return typer.Option(*flags, help=text, metavar=metavar, show_default=False, parser=parser)


def _time(text: str) -> Nanos:
    if not isinstance(text, str):  # a default that is in nanoseconds already
        return text
    try:
        return 0 if text.strip() == "0" else to_nanos(text)
    except BluePillError as error:
        raise typer.BadParameter(f"{error}: {error.hint}") from error


def _number(units: dict[str, int], least: float, most: float | None, takes: str) -> Callable[[str], float]:
    def parse(text: str) -> float:
        if not isinstance(text, str):
            return text
        found = _NUMBER.fullmatch(text.strip())
        if found is None or found["unit"] not in units:
            raise typer.BadParameter(f"{text!r} is not understood: {takes}")
        value = float(found["number"]) * units[found["unit"]]
        if value < least or (most is not None and value > most):
            raise typer.BadParameter(f"{text!r} is out of range: {takes}")
        return round(value) if "%" not in units else value

    return parse
