"""What a hand does, in a line of words: the table of a scenario that they mean.

    fault sonar-stuck 3 0.2              as `[[fault]]` of a scenario has it; `clear` sets it right again
    press stop-button                    a button of the robot, held until `clear stop-button`
    pin bumper_front low                 a level on a wire or a free pin (high, low)
    volts PA0 2.6                        volts on a pin of the BluePill
    let go PA0                           what is held on a pin is let go; `wheels`: the robot drives by itself again
    type usart1 go                       characters and a line end, into a USART
    move box 1 to 1.5 0 heading 90       a thing of the world is put elsewhere: x and y, metres; degrees
    place crate box 0.4 0.3 at 1.5 0     a new thing, standing fast: length and width, metres, and where
    place post cylinder 0.1 at 1 1       or its radius
    remove box 1                         a thing of the world is taken away
    carry robot to 1.5 0 heading 90      the robot is put elsewhere
    drive 0.2 45                         its wheels turn so: m/s ahead, degrees a second to the left

Invariant: whatever may be written here may be written in a `[[hand]]` table, and does the same.
"""

import math
import re
from collections.abc import Callable, Mapping
from typing import TypeAlias

from simbase.errors import UsageError, nearest, shown

#: What is done, and the keys of its table.
Meant: TypeAlias = tuple[str, dict[str, object]]
#: chosen: so high is a new thing, metres; a sonar ring of any model is lower.
HEIGHT_M = 0.5
_NUMBER = r"(-?\d+(?:\.\d*)?(?:e-?\d+)?)"
_PLACE = rf"{_NUMBER} {_NUMBER}(?: heading {_NUMBER})?"
_MOVE = re.compile(rf"(.+) to {_PLACE}")
_CARRY = re.compile(rf"robot to {_PLACE}")
_BOX = re.compile(rf"(.+) box {_NUMBER} {_NUMBER} at {_PLACE}")
_CYLINDER = re.compile(rf"(.+) cylinder {_NUMBER} at {_PLACE}")
_DRIVE = re.compile(rf"{_NUMBER} {_NUMBER}")


def _found(pattern: re.Pattern[str], rest: str) -> tuple[str, ...]:
    match = pattern.fullmatch(rest)
    if match is None:
        raise ValueError("a word is missing, or one too many")
    return match.groups("0")


def _at(x: str, y: str, heading: str) -> dict[str, object]:
    place: dict[str, object] = {"x_m": _number(x), "y_m": _number(y)}
    return place | {"heading_deg": _number(heading)} if _number(heading) else place


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is too much")
    return value


def _move(rest: str) -> Meant:
    name, *place = _found(_MOVE, rest)
    return "move", {"name": name, **_at(*place)}


def _place(rest: str) -> Meant:
    if " cylinder " in rest:
        name, radius, *place = _found(_CYLINDER, rest)
        size: dict[str, object] = {"shape": "cylinder", "radius_m": _number(radius)}
    else:
        name, length, width, *place = _found(_BOX, rest)
        size = {"length_m": _number(length), "width_m": _number(width)}
    return "place", {"name": name, **size, "height_m": HEIGHT_M, **_at(*place)}


def _pin(rest: str) -> Meant:
    pin, _, level = rest.rpartition(" ")
    if level not in {"high", "low"}:
        raise ValueError(f"{shown(level)} is no level: high or low")
    return "set_pin", {"pin": pin, "level": level}


def _volts(rest: str) -> Meant:
    pin, _, volts = rest.rpartition(" ")
    return "set_volts", {"pin": pin, "volts": _number(volts)}


def _let(rest: str) -> Meant:
    go, _, what = rest.partition(" ")
    if go != "go":
        raise ValueError("let go of what")
    return "let_go", {"what": what}


def _type(rest: str) -> Meant:
    port, _, text = rest.partition(" ")
    return "type", {"text": f"{text}\n", "port": port}


def _drive(rest: str) -> Meant:
    forward, turn = _found(_DRIVE, rest)
    return "drive", {"forward_mps": _number(forward), "turn_dps": _number(turn)}


#: First word → how it is written, and what it means.
WORDS: Mapping[str, tuple[str, Callable[[str], Meant]]] = {
    "fault": ("fault sonar-stuck 3 0.2", lambda rest: ("inject", {"fault": rest})),
    "clear": ("clear sonar-stuck 3", lambda rest: ("clear", {"fault": rest})),
    "press": ("press stop-button", lambda rest: ("press", {"button": rest})),
    "pin": ("pin bumper_front low", _pin),
    "volts": ("volts PA0 2.6", _volts),
    "let": ("let go PA0", _let),
    "type": ("type usart1 TEXT", _type),
    "move": ("move NAME to X Y", _move),
    "place": ("place NAME box LENGTH WIDTH at X Y", _place),
    "remove": ("remove NAME", lambda rest: ("remove", {"name": rest})),
    "carry": ("carry robot to X Y", lambda rest: ("carry", _at(*_found(_CARRY, rest)))),
    "drive": ("drive 0.2 45", _drive),
}


def meant_by(words: str) -> Meant:
    """Return what a line of words means: what is done, and the keys of its table.

    Raises:
        UsageError: They mean nothing that can be done; the hint says how it is written.
    """
    name, _, rest = words.strip().partition(" ")
    row = WORDS.get(name)
    if row is None:
        hint = nearest(name, WORDS, "; ".join(usage for usage, _ in WORDS.values()))
        raise UsageError(f"nothing is done by {shown(words)}", hint=hint)
    usage, meant = row
    try:
        return meant(rest.strip())
    except ValueError as error:
        raise UsageError(f"{shown(words)} is not understood: {error}", hint=f"such as {usage}") from error
