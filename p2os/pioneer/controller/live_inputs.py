"""What an operator can do to a running robot's own inputs: the words of the control line, and what they do.

joystick 512 1023 1           stick to the front with the button held
analog 2 512                  half the full scale on analog port 2
digital 255                   all digital inputs high
thing on                      something stands between the gripper's paddles
charger on                    the charger is plugged in

Faults are injected and cleared by lines of their own (`faults`).
"""

from collections.abc import Callable, Mapping

from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.order_words import Range, read_words
from simbase.errors import UsageError

#: First word → (the others, what it means).
INPUTS: Mapping[str, tuple[tuple[str, ...], str]] = {
    "joystick": (("X", "Y", "BUTTON"), "where the robot's own stick stands, 0 to 1023, and whether its button is held"),
    "analog": (("PORT", "RAW"), "a voltage at an analog port of 1 to 9, 0 to 1023 for 0 to 5 V"),
    "digital": (("BYTE",), "the eight digital inputs, 0 to 255"),
    "thing": (("ON_OFF",), "something between the gripper's paddles"),
    "charger": (("ON_OFF",), "the charger is plugged in"),
}
ON_OFF = {"on": 1, "off": 0}
RANGES: Mapping[str, Range] = {
    "X": (0, 1023), "Y": (0, 1023), "BUTTON": (0, 1), "PORT": (1, 9), "RAW": (0, 1023), "BYTE": (0, 255),
    "ON_OFF": ON_OFF,
}  # fmt: skip


def apply_input(context: Context, text: str) -> None:
    """Set the input that the words name.

    Raises:
        UsageError: They are no input, or a word is missing or out of range.
    """
    name, *rest = text.split() or [""]
    if name not in INPUTS:
        raise UsageError(f"no input {name!r}", hint=f"inputs: {', '.join(INPUTS)}")
    values = read_words(text, name, rest, INPUTS[name][0], RANGES).values()
    _ACTS[name](context, [ON_OFF[value] if isinstance(value, str) else int(value) for value in values])


def _joystick(context: Context, values: list[int]) -> None:
    stick = context.devices.joystick
    stick.x, stick.y, stick.button1 = values
    context.follow_joystick()


def _digital(context: Context, values: list[int]) -> None:
    context.devices.pins.digital_in = values[0]


def _thing(context: Context, values: list[int]) -> None:
    context.devices.gripper.has_thing = bool(values[0])


def _charger(context: Context, values: list[int]) -> None:
    context.devices.battery.is_charging = bool(values[0])


_ACTS: Mapping[str, Callable[[Context, list[int]], None]] = {
    "joystick": _joystick,
    "analog": lambda context, values: context.devices.pins.set_analog(values[0], values[1]),
    "digital": _digital,
    "thing": _thing,
    "charger": _charger,
}
