"""Every symbol of the schematic, drawn by functions of a few measures.

Symbol coordinates: millimetres, y up, as KiCad keeps them. No symbol is ever turned
on a page, so that every text stands upright. Invariant: pin ends lie on a 1.27 mm grid.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from hardware.pcb.circuit.modules import BLUEPILL_PINS, ESP32_PINS, ESP32_SILKSCREEN
from hardware.pcb.outputs.sexp import Node, QuotedText, node

G = 2.54
#: Kind of a stroke (rectangle, polyline, circle) and its points.
Stroke: TypeAlias = tuple[str, tuple[tuple[float, float], ...]]
#: Number, name and electrical kind of a pin; None leaves a gap.
Row: TypeAlias = tuple[str, str, str] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SymbolPin:
    """A pin: `side` is where it leaves the body (left, right, top or bottom), `at` its outer end."""

    number: str
    name: str
    kind: str
    at: tuple[float, float]
    side: str
    length: float = G


@dataclass(frozen=True, slots=True, kw_only=True)
class SchematicSymbol:
    """A symbol: its pins and its picture."""

    name: str
    prefix: str
    pins: tuple[SymbolPin, ...]
    picture: tuple[Stroke, ...]
    #: Positions of reference and value.
    ref_at: tuple[float, float]
    value_at: tuple[float, float]
    shows_names: bool = True
    is_power: bool = False
    #: Where reference and value stand around their positions: "center", or "left" for texts beside the symbol.
    justify: str = "center"

    def pin_name(self, number: str) -> str:
        """Return the name of a pin; KeyError where there is none."""
        return {pin.number: pin.name for pin in self.pins}[number]

    def rows(self) -> Iterator[tuple[str, str, str]]:
        """Yield number, name and electrical kind of each pin."""
        for pin in self.pins:
            yield pin.number, pin.name, pin.kind


def _two(name: str, prefix: str, numbers: tuple[str, str], picture: Sequence[Stroke]) -> SchematicSymbol:
    """Draw a part that lies across the page, first pin at the left."""
    left, right = numbers
    pins = (SymbolPin(number=left, name=left, kind="passive", at=(-1.5 * G, 0), side="left", length=1.27),
            SymbolPin(number=right, name=right, kind="passive", at=(1.5 * G, 0), side="right",
                      length=1.27))  # fmt: skip
    # Above the tallest picture: a light's arrows.
    return SchematicSymbol(name=name, prefix=prefix, pins=pins, picture=tuple(picture),
                           ref_at=(0, 3.3 if name == "LED" else 2.54),
                           value_at=(0, -2.54), shows_names=False)  # fmt: skip


def _upright(name: str, prefix: str, numbers: tuple[str, str], picture: Sequence[Stroke]) -> SchematicSymbol:
    """Draw a part that stands, first pin at the top."""
    top, bottom = numbers
    pins = (SymbolPin(number=top, name=top, kind="passive", at=(0, 1.5 * G), side="top", length=2.54),
            SymbolPin(number=bottom, name=bottom, kind="passive", at=(0, -1.5 * G), side="bottom",
                      length=2.54))  # fmt: skip
    return SchematicSymbol(name=name, prefix=prefix, pins=pins, picture=tuple(picture), ref_at=(2.2, 1.1),
                           value_at=(2.2, -1.1), shows_names=False, justify="left")  # fmt: skip


def _box(
    name: str,
    prefix: str,
    sides: Mapping[str, list[Row]],
    half_width: float,
) -> SchematicSymbol:
    """Draw a box; each side lists (number, name, kind) from top or left, None leaves a gap."""
    rows = max(len(sides.get("left", [])), len(sides.get("right", [])), 1)
    half_height = (rows + 1) * G / 2
    half_height = round(half_height / 1.27) * 1.27
    pins = []
    for side in ("left", "right"):
        sign = -1 if side == "left" else 1
        for index, row in enumerate(sides.get(side, [])):
            if row is not None:
                pins.append(SymbolPin(number=row[0], name=row[1], kind=row[2], side=side,
                                      at=(sign * (half_width + G), half_height - G * (index + 1))))  # fmt: skip
    for side in ("top", "bottom"):
        sign = 1 if side == "top" else -1
        entries = sides.get(side, [])
        for index, row in enumerate(entries):
            if row is not None:
                x = G * (index - (len(entries) - 1) // 2)
                pins.append(
                    SymbolPin(number=row[0], name=row[1], kind=row[2], side=side, at=(x, sign * (half_height + G)))
                )
    body = (("rectangle", ((-half_width, half_height), (half_width, -half_height))),)
    value_at = (half_width - 2.54, half_height + 1.9) if half_width > 6 else (0.0, -half_height - 1.9)
    return SchematicSymbol(name=name, prefix=prefix, pins=tuple(pins), picture=body, value_at=value_at,
                           ref_at=(-half_width + 2.54, half_height + 1.9))  # fmt: skip


def _power(name: str, picture: Sequence[Stroke], *, is_up: bool) -> SchematicSymbol:
    pin = SymbolPin(number="1", name=name, kind="power_in", at=(0, 0), side="bottom" if is_up else "top", length=0)
    return SchematicSymbol(name=name, prefix="#PWR", pins=(pin,), picture=tuple(picture), ref_at=(0, 0),
                           value_at=(0, 3.3 if is_up else -3.3), shows_names=False, is_power=True)  # fmt: skip


_ARROW = [("polyline", ((0, 0), (0, 2.0))), ("polyline", ((-0.8, 1.0), (0, 2.2), (0.8, 1.0)))]
_PLATES = [("polyline", ((-1.5, 0.5), (1.5, 0.5))), ("polyline", ((-1.5, -0.5), (1.5, -0.5))),
           ("polyline", ((0, 0.5), (0, 1.27))), ("polyline", ((0, -0.5), (0, -1.27)))]  # fmt: skip
_DIODE = [("polyline", ((-1.27, 1.27), (-1.27, -1.27), (1.27, 0), (-1.27, 1.27))),
          ("polyline", ((-2.54, 0), (2.54, 0)))]  # fmt: skip
_BAR = ("polyline", ((1.27, 1.27), (1.27, -1.27)))
_SCHOTTKY_BAR = ("polyline", ((0.6, 0.8), (0.6, 1.27), (1.27, 1.27), (1.27, -1.27), (1.94, -1.27), (1.94, -0.8)))


def _module(pins: tuple[str, ...], names: Mapping[str, str], *, is_source: bool) -> dict[str, list[Row]]:
    rows: list[Row] = []
    for number, pin in enumerate(pins, start=1):
        alias = f"{pin}({names[pin]})" if pin in names else pin
        kind = {"5V": "power_in", "GND": "power_in", "3V3": "power_out" if is_source else "passive", "EN": "input",
                "NRST": "input", "VBAT": "passive", "NC": "no_connect"}.get(pin, "bidirectional")  # fmt: skip
        rows.append((str(number), alias, kind))
    return {"left": rows[:20], "right": rows[20:] if is_source else rows[:19:-1]}


def _numbered(count: int) -> list[Row]:
    return [(str(number), str(number), "passive") for number in range(1, count + 1)]


def _all() -> list[SchematicSymbol]:
    header = _numbered(24)
    rs232: dict[str, list[Row]] = {
        "left": [("1", "C1+", "passive"), ("3", "C1-", "passive"), ("4", "C2+", "passive"), ("5", "C2-", "passive"),
                 None,
                 ("11", "DIN1", "input"), ("12", "ROUT1", "output"), ("10", "DIN2", "input"), ("9", "ROUT2", "output")],
        "right": [("2", "V+", "passive"), ("6", "V-", "passive"), None, None, None,
                  ("14", "DOUT1", "output"), ("13", "RIN1", "input"), ("7", "DOUT2", "output"), ("8", "RIN2", "input")],
        "top": [("16", "VCC", "power_in")], "bottom": [("15", "GND", "power_in")],
    }  # fmt: skip
    shift: dict[str, list[Row]] = {
        "left": [("14", "DS", "input"), ("11", "SHCP", "input"), ("12", "STCP", "input"), None,
                 ("10", "~{MR}", "input"),
                 ("13", "~{OE}", "input")],
        "right": [("15", "QA", "output"), ("1", "QB", "output"), ("2", "QC", "output"), ("3", "QD", "output"),
                  ("4", "QE", "output"), ("5", "QF", "output"), ("6", "QG", "output"), ("7", "QH", "output"),
                  ("9", "QH'", "output")],
        "top": [("16", "VCC", "power_in")], "bottom": [("8", "GND", "power_in")],
    }  # fmt: skip
    de9 = [("1", "DCD", "passive"), ("2", "RXD", "passive"), ("3", "TXD", "passive"), ("4", "DTR", "passive"),
           ("5", "GND", "passive"), ("6", "DSR", "passive"), ("7", "RTS", "passive"), ("8", "CTS", "passive"),
           ("9", "RI", "passive"), ("0", "SHELL", "passive")]  # fmt: skip
    transistor = (
        SymbolPin(number="1", name="B", kind="input", at=(-2 * G, 0), side="left", length=G),
        SymbolPin(number="3", name="C", kind="open_collector", at=(0, 2 * G), side="top", length=G),
        SymbolPin(number="2", name="E", kind="passive", at=(0, -2 * G), side="bottom", length=G),
    )
    emitter_up = (
        SymbolPin(number="1", name="B", kind="input", at=(-2 * G, 0), side="left", length=G),
        SymbolPin(number="2", name="E", kind="passive", at=(0, 2 * G), side="top", length=G),
        SymbolPin(number="3", name="C", kind="open_emitter", at=(0, -2 * G), side="bottom", length=G),
    )
    return [
        _two("R", "R", ("1", "2"), [("rectangle", ((-2.54, 1.0), (2.54, -1.0)))]),
        _two("FUSE", "F", ("1", "2"),
             [("rectangle", ((-2.54, 1.0), (2.54, -1.0))), ("polyline", ((-2.54, 0), (2.54, 0)))]),
        _two("SCHOTTKY", "D", ("A", "K"), [*_DIODE, _SCHOTTKY_BAR]),
        _two("LED", "D", ("A", "K"),
             [*_DIODE, _BAR, ("polyline", ((0, 1.5), (1.0, 2.6))), ("polyline", ((0.9, 1.5), (1.9, 2.6)))]),
        _two("SWITCH", "SW", ("1", "2"),
             [("circle", ((-1.9, 0), (-1.5, 0))), ("circle", ((1.9, 0), (2.3, 0))),
              ("polyline", ((-1.9, 1.2), (1.9, 1.2))), ("polyline", ((0, 1.2), (0, 2.0)))]),
        _upright("C", "C", ("1", "2"), _PLATES),
        _upright("CP", "C", ("1", "2"),
                 [*_PLATES, ("polyline", ((-1.5, 1.4), (-0.7, 1.4))), ("polyline", ((-1.1, 1.8), (-1.1, 1.0)))]),
        _upright("TVS", "D", ("K", "A"), [("polyline", ((-1.27, -1.27), (1.27, -1.27), (0, 1.27), (-1.27, -1.27))),
                                          ("polyline", ((-1.7, 0.8), (-1.27, 1.27), (1.27, 1.27), (1.7, 1.74)))]),
        _box("CONN2", "J", {"right": _numbered(2)}, 2.54),
        _box("CONN3", "JP", {"left": _numbered(3)}, 2.54),
        _box("CONN10", "J", {"left": _numbered(10)[::2], "right": _numbered(10)[1::2]}, 5.08),
        _box("CONN24", "J", {"left": header[::2], "right": header[1::2]}, 5.08),
        _box("REGULATOR3", "U", {"left": [("1", "IN", "power_in")], "right": [("3", "OUT", "power_out")],
                                 "bottom": [("2", "GND", "power_in")]}, 7.62),
        _box("LM317", "U", {"left": [("3", "IN", "power_in")], "right": [("2", "OUT", "power_out")],
                            "bottom": [("1", "ADJ", "input")]}, 7.62),
        _box("MAX3232", "U", rs232, 10.16),
        _box("HC595", "U", shift, 7.62),
        _box("DE9", "J", {"left": [*de9]}, 5.08),
        SchematicSymbol(name="NPN", prefix="Q", pins=transistor, ref_at=(1.6, 1.1), value_at=(1.6, -1.1),
                        shows_names=False,
                        justify="left",
                        picture=(("polyline", ((-2.54, 2.0), (-2.54, -2.0))), ("polyline", ((-2.54, 0.8), (0, 2.54))),
                                 ("polyline", ((-2.54, -0.8), (0, -2.54))),
                                 ("polyline", ((-1.4, -1.0), (-0.6, -2.2), (-2.0, -1.9))))),
        SchematicSymbol(name="PNP", prefix="Q", pins=emitter_up, ref_at=(1.6, 1.1), value_at=(1.6, -1.1),
                        shows_names=False,
                        justify="left",
                        picture=(("polyline", ((-2.54, 2.0), (-2.54, -2.0))), ("polyline", ((-2.54, 0.8), (0, 2.54))),
                                 ("polyline", ((-2.54, -0.8), (0, -2.54))),
                                 ("polyline", ((-1.2, 2.2), (-2.0, 1.2), (-0.8, 1.4))))),
        SchematicSymbol(name="TESTPOINT", prefix="TP", ref_at=(3.4, 0), value_at=(3.4, -1.9), shows_names=False,
                        justify="left",
                        pins=(SymbolPin(number="1", name="1", kind="passive", at=(0, 0), side="left", length=1.27),),
                        picture=(("circle", ((1.97, 0), (2.67, 0))),)),
        SchematicSymbol(name="HOLE", prefix="H", pins=(), ref_at=(2.4, 0), value_at=(2.4, -1.9), shows_names=False,
                        justify="left",
                        picture=(("circle", ((0, 0), (1.6, 0))),)),
        _box("BLUEPILL", "U", _module(BLUEPILL_PINS, {}, is_source=False), 15.24),
        _box("ESP32_D1_MINI", "U", _module(ESP32_PINS, ESP32_SILKSCREEN, is_source=True), 15.24),
        _power("GND",
               [("polyline", ((0, 0), (0, -1.27))),
                ("polyline", ((-1.27, -1.27), (1.27, -1.27), (0, -2.3), (-1.27, -1.27)))],
               is_up=False),
        _power("+5V", _ARROW, is_up=True), _power("+3V3", _ARROW, is_up=True), _power("+12V", _ARROW, is_up=True),
        SchematicSymbol(name="PWR_FLAG", prefix="#FLG", ref_at=(0, 0), value_at=(0, 4.2), shows_names=False,
                        is_power=True,
                        pins=(SymbolPin(number="1", name="flag", kind="power_out", at=(0, 0), side="bottom",
                                        length=0),),
                        picture=(("polyline", ((0, 0), (0, 1.27), (-1.0, 2.0), (0, 2.8), (1.0, 2.0), (0, 1.27))),)),
    ]  # fmt: skip


#: Every symbol by its name.
SYMBOLS: Mapping[str, SchematicSymbol] = MappingProxyType({symbol.name: symbol for symbol in _all()})
#: Nets that pages show as a power symbol instead of a label.
POWER_SYMBOLS = ("GND", "+5V", "+3V3", "+12V")

_ANGLE = {"left": 0, "right": 180, "top": 270, "bottom": 90}


def symbol_node(symbol: SchematicSymbol, name: str) -> Node:
    """Return a symbol's definition under a name (`R` in the library, `adapter:R` on a page)."""
    tree = node("symbol", QuotedText(name))
    if symbol.is_power:
        tree.append(node("power"))
    if not symbol.shows_names:
        tree += [node("pin_numbers", node("hide", "yes")), node("pin_names", node("offset", 0), node("hide", "yes"))]
    else:
        tree.append(node("pin_names", node("offset", 0.762)))
    in_bom = "no" if symbol.is_power or symbol.name in {"TESTPOINT", "HOLE"} else "yes"
    tree += [node("exclude_from_sim", "no"), node("in_bom", in_bom), node("on_board", "yes")]
    for key, text, at, is_hidden in (
        ("Reference", symbol.prefix, symbol.ref_at, symbol.is_power), ("Value", symbol.name, symbol.value_at, False),
        ("Footprint", "", (0.0, 0.0), True), ("Datasheet", "", (0.0, 0.0), True), ("Description", "", (0.0, 0.0), True),
    ):  # fmt: skip
        tree.append(property_node(key, text, at, is_hidden=is_hidden, justify=symbol.justify))
    body = node("symbol", QuotedText(f"{symbol.name}_0_1"), *(_shape(kind, points) for kind, points in symbol.picture))
    legs = node("symbol", QuotedText(f"{symbol.name}_1_1"), *(_pin(pin) for pin in symbol.pins))
    tree += [body, legs, node("embedded_fonts", "no")]
    return tree


def property_node(key: str, text: str, at: tuple[float, float], *, is_hidden: bool, justify: str = "center") -> Node:
    """Return a property of a symbol or sheet."""
    effects = node("effects", node("font", node("size", 1.27, 1.27)))
    if justify != "center":
        effects.append(node("justify", justify))
    if is_hidden:
        effects.append(node("hide", "yes"))
    return node("property", QuotedText(key), QuotedText(text), node("at", *at, 0), effects)


def _shape(kind: str, points: tuple[tuple[float, float], ...]) -> Node:
    line = node("stroke", node("width", 0.2), node("type", "default"))
    if kind == "rectangle":
        return node("rectangle", node("start", *points[0]), node("end", *points[1]), line,
                    node("fill", node("type", "background")))  # fmt: skip
    if kind == "circle":
        (x, y), (edge, _) = points
        return node("circle", node("center", x, y), node("radius", edge - x), line, node("fill", node("type", "none")))
    return node(
        "polyline", node("pts", *(node("xy", *point) for point in points)), line, node("fill", node("type", "none"))
    )


def _pin(pin: SymbolPin) -> Node:
    font = node("effects", node("font", node("size", 1.1, 1.1)))
    return node("pin", pin.kind, "line", node("at", *pin.at, _ANGLE[pin.side]), node("length", pin.length),
                node("name", QuotedText(pin.name), font), node("number", QuotedText(pin.number), font))  # fmt: skip
