"""Orders that change the world of running robots: things are placed, moved and removed.

place box 1 0.5 0.3 0.2         a box, its middle at x and y, so long and so wide; a heading may follow
place post 2 0 0.05             a post, so thick from its middle
move box-1 1 1 90               a thing somewhere else; names with spaces stand in quotes
remove box-1                    the thing is gone

Metres and degrees. A thing that an order places is called by its shape and a number.
"""

import contextlib
import math
import shlex
from collections.abc import Collection, Mapping
from dataclasses import replace

from p2os.errors import WorldError
from p2os.pioneer.body.contract import Changeable
from p2os.pioneer.controller.order_words import Range, read_words
from p2os.pioneer.world.model import Obstacle
from simbase.errors import UsageError

#: First words → (the others, what it means); a word in brackets may be left out.
WORLD_ORDERS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "place box": (("X", "Y", "LENGTH", "WIDTH", "[HEADING]"), "a box comes into the world, metres and degrees"),
    "place post": (("X", "Y", "RADIUS"), "a post comes into the world"),
    "move": (("NAME", "X", "Y", "[HEADING]"), "a thing that is not part of the building goes elsewhere"),
    "remove": (("NAME",), "takes the thing out of the world"),
}
#: chosen: as high as a person's hip, above every sonar ring.
HEIGHT_M = 1.0
#: chosen: farther away than any floor reaches; a slip of the finger.
FARTHEST_M = 1000.0
#: chosen: of one shape; more slow every step.
MOST_THINGS = 100
RANGES: Mapping[str, Range] = {
    "NAME": None,
    **dict.fromkeys(("X", "Y", "HEADING"), (-FARTHEST_M, FARTHEST_M)),
    **dict.fromkeys(("LENGTH", "WIDTH", "RADIUS"), (0.001, FARTHEST_M)),
}


def is_world_order(text: str) -> bool:
    """Tell whether a line is one of these orders, or begins as one."""
    return text.split(maxsplit=1)[:1] in (["place"], ["move"], ["remove"])


def change_world(world: Changeable, text: str, robots: Collection[str] = ()) -> str:
    """Execute an order in a world; return what was done.

    Args:
        world: A scene, or a body that is alone in its own.
        text: The words.
        robots: What the robots are called among the things; an order cannot name them.

    Raises:
        UsageError: The words mean nothing, or name a robot.
        WorldError: There is no such thing, or it is part of the building; nothing has changed then.
    """
    order, values = _read(text)
    if values.get("NAME") in robots:
        raise UsageError(f"{values['NAME']!r} is a robot", hint="robots move by themselves")
    if order == "remove":
        world.remove(str(values["NAME"]))
        return f"{values['NAME']} is gone"
    x, y, heading = (float(values.get(word, 0.0)) for word in ("X", "Y", "HEADING"))
    where = f"at {x:g}, {y:g}"
    if order == "move":
        world.move(str(values["NAME"]), x, y, math.radians(heading))
        return f"{values['NAME']} {where}"
    length, width, radius = (float(values.get(word, 0.0)) for word in ("LENGTH", "WIDTH", "RADIUS"))
    thing = Obstacle(
        name="", x_m=x, y_m=y, heading_rad=math.radians(heading), length_m=length, width_m=width, radius_m=radius,
        height_m=HEIGHT_M,
    )  # fmt: skip
    thing = _placed(world, thing, order.removeprefix("place "))
    return f"{thing.name} {where}"


def _placed(world: Changeable, thing: Obstacle, shape: str) -> Obstacle:
    """Put a thing into a world under the first name that is free; return it."""
    for number in range(1, MOST_THINGS + 1):
        named = replace(thing, name=f"{shape}-{number}")
        with contextlib.suppress(WorldError):  # the name is taken
            world.place(named)
            return named
    raise UsageError(f"there are {MOST_THINGS} of that shape already", hint="remove some")


def _read(text: str) -> tuple[str, dict[str, str | float]]:
    """Return which order it is and the value of each of its words."""
    try:
        words_given = shlex.split(text)
    except ValueError:
        raise UsageError(f"{text!r}: a quote is open", hint="""move "thing 3" 1 1""") from None
    order = next((name for name in WORLD_ORDERS if words_given[: len(name.split())] == name.split()), None)
    if order is None:
        raise UsageError(f"{text!r} is no order", hint="orders: place box …, place post …")
    return order, read_words(text, order, words_given[len(order.split()) :], WORLD_ORDERS[order][0], RANGES)
