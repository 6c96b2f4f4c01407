"""What is wrong with a wire, in words: drivers that fight, shorts, too many volts, inputs that float.

The pins know levels, not currents; what they can tell is told here. Each
complaint is a warning, once a pin, with the program's place.

Not modelled: currents through clamp diodes, the total current of the supply
pins, and slew rates.
Source: data sheet DS5319 tables 5 and 6 (pin definitions, absolute maximum ratings).
Invariant: these functions only read.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bluepill_sim.pins import Pin

#: What a wire can be shorted to, and the level that it then has.
RAILS = {"GND": False, "3V3": True}
#: An input that is not 5 V-tolerant bears VDD + 0.3 V (DS5319 table 6); chosen: what counts as more than that.
MOST_VOLTS = 3.65


def overvoltage(pin: "Pin", volts: float) -> str | None:
    """Return what is wrong with so many volts on a pin; None when it bears them."""
    if volts <= MOST_VOLTS:
        return None
    if not pin.is_five_volt_tolerant:
        reason = "it bears 3.6 V at most"
    elif pin.output.is_strong:
        reason = "it bears 5 V only as an input"
    elif pin.output.level is not None:
        reason = "it bears 5 V only without its pull"
    else:
        return None
    return f"{volts:g} V on {pin.name}: {reason}"


def contention(pin: "Pin") -> str:
    """Return what to say of two drivers that fight."""
    outside = "high" if pin.driven else "low"
    return f"{pin.name}: two drivers fight: the chip drives it {pin.output.value}, the other end {outside}"


def floating_inputs(names: Sequence[str]) -> str:
    """Return what to say of inputs that nobody drives."""
    one = len(names) == 1
    what, they = ("floating input", "it reads") if one else ("floating inputs", "they read")
    return f"{', '.join(names)}: {what} that nobody drives: {they} 0 here and anything on a board; configured"


def short_circuit(pin: "Pin", rail: str) -> str:
    """Return what to say of an output that works against a supply rail."""
    return f"{pin.name}: output {pin.output.value} is shorted to {rail}"
