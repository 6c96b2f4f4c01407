"""A design as a circuit for ngspice: every part between its own nets, with its own value.

A deck adds what is outside the board (battery, modules' pins, cable) at pins, never at nets that it
assumes: a part that is turned, moved or left out changes what the simulator computes.

Invariant: an element line comes from one component of the design and from nothing else.
"""

import re
from collections.abc import Callable, Collection, Mapping

from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS
from hardware.pcb.circuit.netlist import BoardDesign, Component

_MODULE_PINS = {"U1": BLUEPILL_PINS, "U2": ESP32_PINS}
#: A fuse between its lowest and highest resistance.
FUSE_OHM = 0.13
#: Series resistance of a ceramic capacitor whose row says none. chosen: far below what any deck asks.
CERAMIC_OHM = 0.02


def node(design: BoardDesign, pin: str) -> str:
    """Return the simulator's name of the node at a pin: `U5.13`, or by the print of a module `U2.IO17`.

    A pin that is open, or whose part is left out, has a node of its own.
    """
    ref, name = pin.split(".")
    for part in design.components:
        if part.ref == ref:
            names = _MODULE_PINS.get(ref)
            number = str(names.index(name) + 1) if names and name in names else name
            return _name(dict(part.pins).get(number), f"{ref}_{number}")
    return _name(None, f"{ref}_{name}")


def circuit(
    design: BoardDesign,
    *,
    closed: Collection[tuple[str, str]] = (),
    without: Collection[str] = (),
    fuse_ohm: float = FUSE_OHM,
) -> str:
    """Return the element lines of a board.

    Args:
        design: The board; modules and connectors give no element.
        closed: Pins that a jumper joins.
        without: Symbols of parts that the deck leaves out or replaces.
        fuse_ohm: Resistance of the fuse, ohms.
    """
    lines = [
        line
        for part in design.components
        if part.part.symbol in _ELEMENTS and part.part.symbol not in without
        for line in _ELEMENTS[part.part.symbol](design, part, fuse_ohm)
    ]
    lines += [
        f"Rjumper{number} {node(design, first)} {node(design, second)} 0.02"
        for number, (first, second) in enumerate(closed)
    ]
    nodes = sorted({word for line in lines for word in line.split()[1:] if word.startswith("n_")})
    # Nothing floats: the simulator needs a path to ground from everywhere.
    return "\n".join([*lines, *(f"Rleak_{name} {name} 0 1g" for name in nodes)])


def _name(net: str | None, pin: str) -> str:
    if net == "GND":
        return "0"
    if net is None:
        return f"n_open_{pin.lower()}"
    return "n_" + re.sub(r"[^a-z0-9]", "_", net.lower().replace("+", "p").replace("-", "m"))


def _nodes(part: Component) -> dict[str, str]:
    return {pin: _name(net, f"{part.ref}_{pin}") for pin, net in part.pins}


def _resistor(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
    _ = design
    one, two = _nodes(part).values()
    ohm = fuse_ohm if part.part.symbol == "FUSE" else part.part.facts["ohm"]
    return [f"R{part.ref} {one} {two} {ohm:g}"]


def _capacitor(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
    _ = design, fuse_ohm
    one, two = _nodes(part).values()
    facts, inner = part.part.facts, f"n_in_{part.ref.lower()}"
    return [
        f"C{part.ref} {one} {inner} {facts['farad']:g}",
        f"R{part.ref} {inner} {two} {facts.get('esr_ohm', CERAMIC_OHM):g}",
    ]


def _diode(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
    _ = design, fuse_ohm
    pins = _nodes(part)
    model = "LED" if part.part.symbol == "LED" else part.part.value
    return [f"D{part.ref} {pins['A']} {pins['K']} {model}"]


def _transistor(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
    _ = design, fuse_ohm
    pins = _nodes(part)
    return [f"Q{part.ref} {pins['3']} {pins['1']} {pins['2']} {part.part.key}"]


def _chip(model: str, order: str) -> Callable[[BoardDesign, Component, float], list[str]]:
    def lines(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
        _ = design, fuse_ohm
        pins = _nodes(part)
        return [f"X{part.ref} {' '.join(pins[pin] for pin in order.split())} {model}"]

    return lines


def _transceiver(design: BoardDesign, part: Component, fuse_ohm: float) -> list[str]:
    """Return the transceiver; its averaged pump takes the smaller of both flying capacitors as fitted."""
    pins = dict(part.pins)
    pumps = [_farad_between(design, pins["1"], pins["3"]), _farad_between(design, pins["4"], pins["5"])]
    line = _chip("MAX3232", " ".join(str(number) for number in range(1, 17)))(design, part, fuse_ohm)[0]
    return [f"{line} cpump={max(min(pumps), 1e-12):g}"]


def _farad_between(design: BoardDesign, one: str | None, two: str | None) -> float:
    return sum(
        part.part.facts["farad"]
        for part in design.components
        if "farad" in part.part.facts and {net for _, net in part.pins} == {one, two}
    )


_ELEMENTS: Mapping[str, Callable[[BoardDesign, Component, float], list[str]]] = {
    "R": _resistor, "FUSE": _resistor, "C": _capacitor, "CP": _capacitor, "SCHOTTKY": _diode, "LED": _diode,
    "TVS": _diode, "NPN": _transistor, "PNP": _transistor, "REGULATOR3": _chip("BUCK", "1 2 3"),
    "LM317": _chip("LM317", "3 1 2"), "MAX3232": _transceiver,
}  # fmt: skip
