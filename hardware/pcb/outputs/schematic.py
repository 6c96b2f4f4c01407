"""The schematic as .kicad_sch files: a root sheet and one file a page, and which part stands where on it.

Each page is a set of framed groups; a frame has a title and words for the reader. Places
are in steps of 1.27 mm. Nets are named by global labels and power symbols; two facing
pins of one net on one line get a wire between them.

Invariant: every component of every variant has a page and a place on it; same design,
same bytes.
"""

from dataclasses import dataclass, field

from adapter_sim.pinout import load_pinout
from hardware.pcb.circuit.design import PULL_OFFSET, series_wires
from hardware.pcb.circuit.netlist import BoardDesign, Component, DesignError
from hardware.pcb.outputs.sexp import Node, QuotedText, node, render, sheet_path, uid, uuid_node
from hardware.pcb.outputs.symbols import POWER_SYMBOLS, SYMBOLS, SymbolPin, property_node, symbol_node

#: One step, millimetres: half of KiCad's usual grid, on which all pins lie.
STEP_MM = 1.27
PAGES = ("modules", "signals", "supply", "serial", "stop", "test")
TITLES = {
    "modules": "BluePill and ESP32",
    "signals": "Wires between the modules",
    "supply": "Supply",
    "serial": "RS-232, reset, mode",
    "stop": "Emergency stop, mode button",
    "test": "Test points, logic header, holes",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetFrame:
    """A group on a page: corners in steps, a title, and a note below it."""

    title: str
    left: int
    top: int
    right: int
    bottom: int
    note: str = ""


def page_of(component: Component) -> str:
    """Return the page of a component.

    Raises:
        DesignError: It has none.
    """
    for page, table in _TABLES.items():
        if component.ref in table:
            return page
    raise DesignError(f"{component.ref} has no page in the schematic")


def place_of(component: Component) -> tuple[int, int]:
    """Return the place on its page, in steps."""
    return _TABLES[page_of(component)][component.ref]


def frames(design: BoardDesign, page: str) -> list[SheetFrame]:
    """Return the groups of a page."""
    if page == "supply":
        own = {"rev-b": _BUCK_FRAMES, "lm317": _LINEAR_FRAMES, "rev-c": [*_BUCK_FRAMES, _JP8_FRAME]}
        return [*_SUPPLY_FRAMES, *own[design.variant]]
    extra = _REV_C_FRAMES if design.variant == "rev-c" and page == "serial" else []
    return [*_FRAMES[page], *extra]


def _signal_places() -> dict[str, tuple[int, int]]:
    """Return two columns of rows, one a wire: series resistor, and its pull half a row lower."""
    places = {}
    for index in range(len(series_wires(load_pinout()))):
        column, row = divmod(index, 11)
        x, y = 50 + 107 * column, 22 + 9 * row
        places[f"R{index + 1}"] = (x, y)
        places[f"R{index + 1 + PULL_OFFSET}"] = (x + 44, y + 4)
    return places


def _test_points() -> dict[str, tuple[int, int]]:
    return {f"TP{n}": (104 + 44 * ((n - 1) // 6), 30 + 8 * ((n - 1) % 6)) for n in range(1, 13)}


_SUPPLY = {
    "J1": (18, 26), "F1": (34, 25), "D1": (50, 25), "D2": (66, 28), "C1": (78, 28), "C2": (92, 28),
    "J2": (18, 66), "D3": (36, 65), "JP1": (80, 68), "C4": (98, 70),
    "D4": (138, 64), "D5": (138, 74), "R61": (182, 72), "D6": (200, 72),
    # Buck and LM317 share the place: a variant has one of them.
    "U3": (138, 26), "C3": (178, 29),
    "R68": (154, 40), "R69": (172, 40), "C11": (196, 32),
    "J6": (142, 108), "F2": (161, 106), "JP3": (182, 106), "D10": (206, 114),
    "U4": (38, 104), "R70": (56, 118), "R71": (74, 118), "C12": (80, 104), "C13": (96, 118),
}  # fmt: skip
_SERIAL = {
    "U5": (64, 40), "JP2": (112, 58), "R73": (78, 82),
    "C5": (18, 40), "C6": (30, 40), "C7": (96, 40), "C8": (110, 40), "C9": (124, 40), "J3": (156, 40),
    "R62": (46, 82), "R63": (46, 90), "R64": (46, 100), "D7": (60, 100), "R65": (46, 110), "D8": (60, 110),
    "R66": (136, 92), "R67": (136, 104), "Q1": (152, 92), "J5": (30, 136), "R60": (48, 137),
    "U6": (198, 36), "R74": (188, 60), "C10": (212, 60), "R72": (194, 90), "D9": (208, 90),
}  # fmt: skip
_STOP = {
    "R77": (40, 32), "J7": (34, 44), "R78": (40, 56), "C14": (66, 54),
    "R79": (104, 32), "Q3": (118, 32), "R80": (160, 46), "R81": (160, 58), "Q2": (174, 46),
    "R82": (104, 58), "Q4": (118, 58),
    "R75": (40, 94), "R76": (66, 104), "SW1": (80, 104),
}  # fmt: skip
_TEST = {"J4": (44, 44), **_test_points(), **{f"H{n}": (20 + 20 * n, 118) for n in range(1, 5)}}
_TABLES = {
    "modules": {"U1": (56, 66), "U2": (168, 66)},
    "signals": _signal_places(),
    "supply": _SUPPLY,
    "serial": _SERIAL,
    "stop": _STOP,
    "test": _TEST,
}

_SUPPLY_FRAMES = [
    SheetFrame(title="12 V input", left=10, top=12, right=112, bottom=46,
               note="Fuse, reverse protection, transient suppressor. 11 to 14.8 V."),
    SheetFrame(title="5 V power bank and choice of source", left=10, top=52, right=112, bottom=88,
               note="JP1 1-2: from 12 V; 2-3: from the power bank. One jumper only."),
    SheetFrame(title="To the modules", left=116, top=52, right=224, bottom=88,
               note="A diode each: neither module's USB feeds the board or the other module."),
    SheetFrame(title="For the rule check: these nets are supplied", left=10, top=136, right=130, bottom=156),
]  # fmt: skip
_BUCK_FRAMES = [
    SheetFrame(title="12 V to 5 V, 1 A", left=116, top=12, right=224, bottom=46,
               note="The 3.3 V of this board comes from the ESP32 module's own regulator.")
]  # fmt: skip
_LINEAR_FRAMES = [
    SheetFrame(title="12 V to 5 V, LM317: 150 mA on average, 250 mA in peaks", left=116, top=12, right=224, bottom=50,
               note="5.02 V; 10.4 mA through the divider: above the minimum load."),
    SheetFrame(title="12 V to 3.3 V, LM317: transceiver and LEDs only", left=10, top=92, right=112, bottom=132,
               note="3.34 V; the ESP32 keeps its own 3.3 V regulator."),
]  # fmt: skip
_JP8_FRAME = SheetFrame(
    title="An old Pioneer 2's JP8: straight ribbon, instead of J3", left=116, top=92, right=224, bottom=128,
    note="What JP8 can give is unknown: JP3 stays off unless it was measured. 5 V and port pins stay open.",
)  # fmt: skip
_REV_C_FRAMES = [
    SheetFrame(
        title="Distances by shift register",
        left=174,
        top=12,
        right=224,
        bottom=70,
        note="Released until the program enables it.",
    ),
    SheetFrame(title="Status LED", left=174, top=74, right=224, bottom=118),
]
_FRAMES = {
    "modules": [
        SheetFrame(title="BluePill (USB at the top)", left=10, top=20, right=108, bottom=112),
        SheetFrame(title="ESP32 D1 mini (antenna at the top)", left=114, top=20, right=224, bottom=112,
                   note="GPIO6 to 11 carry the module's flash: never connected."),
    ],
    "signals": [
        SheetFrame(title="One row a wire, from pad to pad", left=10, top=12, right=224, bottom=128,
                   note="_BP: the BluePill's side. 1k2 limits what an unpowered module takes; "
                        "680R at PC13 holds a low against the BluePill's LED. IO5 and IO15 boot high: pulled up."),
    ],
    "serial": [
        SheetFrame(title="RS-232 at 3.3 V; DIN2 low asserts DTR", left=10, top=12, right=170, bottom=70,
                   note="Plug, wired as DTE: straight cable to the robot's HOST socket."),
        SheetFrame(title="UART with activity lights", left=10, top=74, right=100, bottom=118,
                   note="A light is on while its line is low: it flickers with data."),
        SheetFrame(title="Reset: PB13 high pulls EN low", left=106, top=74, right=170, bottom=118,
                   note="Emitter to ground. The module has its own pull-up at EN."),
        SheetFrame(title="Mode jumper, read at boot only", left=10, top=122, right=100, bottom=144),
    ],
    "stop": [
        SheetFrame(title="Emergency stop: a loop that must be closed", left=10, top=12, right=78, bottom=74,
                   note="J7: a contact that opens, or its jumper. Open, cut, at ground: stop."),
        SheetFrame(title="Stop: EN low and TXD at mark, apart from each other", left=82, top=12, right=200, bottom=74,
                   note="The ESP32 is held in reset, the line falls silent: "
                        "the robot stops by its own watchdog, in 2 s."),
        SheetFrame(title="Mode button; held at reset: download", left=10, top=80, right=100, bottom=118,
                   note="IO0 is a strap: high at boot unless the button is held. The module has no button for it."),
    ],
    "test": [
        SheetFrame(title="Logic header: each wire at its receiver", left=10, top=12, right=84, bottom=70,
                   note="3.3 V signals. Drive nothing here that a module drives."),
        SheetFrame(title="Test points", left=90, top=12, right=200, bottom=80),
        SheetFrame(title="Mounting holes M3", left=10, top=106, right=112, bottom=130),
    ],
}  # fmt: skip


LIBRARY = "adapter"
#: Format of KiCad 9.0.
_VERSION = "20250114"
_LIBRARY_VERSION = "20241209"
_OUTWARD = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}
#: Nets whose current enters through passive parts only: ERC is told that they are supplied.
_FLAGGED = ("GND", "+12V", "+5V", "BP_5V", "ESP_5V")
#: Parts whose pads a wire joins.
_PADS = frozenset({"U1", "U2", "J4", "U6"})
#: Longest gap between two facing pins that gets a wire, steps.
_WIRE_STEPS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedPin:
    """A pin on a page: its end in steps, its outward side and its net."""

    component: Component
    pin: SymbolPin
    x: int
    y: int
    net: str | None


@dataclass(slots=True)
class Page:
    """A page under construction."""

    design: BoardDesign
    name: str
    nodes: list[Node] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    count: int = 0

    def ident(self, kind: str) -> Node:
        """Return the next identifier on this page."""
        self.count += 1
        return uuid_node(self.design.variant, self.name, kind, self.count)


def page_text(design: BoardDesign, name: str) -> str:
    """Return the file of one page."""
    page = Page(design, name)
    for frame in frames(design, name):
        _frame(page, frame.title, frame.note, (frame.left, frame.top, frame.right, frame.bottom))
    components = [component for component in design.components if page_of(component) == name]
    pins = [pin for component in components for pin in placed_pins(component)]
    joined = _wires(page, pins)
    if name == "signals":
        joined |= _rows(page, pins)
    for pin in pins:
        if (pin.component.ref, pin.pin.number) not in joined:
            _end(page, pin)
    for component in components:
        page.used.add(component.part.symbol)
        page.nodes.append(_instance(page, component))
    if name == "supply":
        for number, net in enumerate(_FLAGGED):
            _flag(page, net, 20 + 22 * number)
    tree = _head(design, name, TITLES[name])
    library = node("lib_symbols")
    library += [symbol_node(SYMBOLS[symbol], f"{LIBRARY}:{symbol}") for symbol in sorted(page.used)]
    tree += [library, *page.nodes, node("embedded_fonts", "no")]
    return render(tree) + "\n"


def root_text(design: BoardDesign) -> str:
    """Return the root sheet: one box a page, and what the board is."""
    tree = _head(design, "root", design.title)
    tree.append(node("lib_symbols"))
    note = (
        f"{design.title}\nPin map: {design.revision} (adapter_sim/pinout.toml)\n\n"
        "Generated from hardware/pcb. No board has been made from it yet.\n"
        "Nets connect by name: global labels and power symbols."
    )
    tree.append(_text(note, (20.0, 22.0), 2.0, uuid_node(design.variant, "root", "note")))
    for number, name in enumerate(PAGES):
        x, y = 25.4 + 83.82 * (number % 3), 63.5 + 45.72 * (number // 3)
        font = node("effects", node("font", node("size", 1.6, 1.6)), node("justify", "left", "bottom"))
        small = node("effects", node("font", node("size", 1.27, 1.27)), node("justify", "left", "top"))
        tree.append(node(
            "sheet", node("at", x, y), node("size", 63.5, 25.4), node("exclude_from_sim", "no"), node("in_bom", "yes"),
            node("on_board", "yes"), node("dnp", "no"), node("stroke", node("width", 0.2), node("type", "solid")),
            node("fill", node("color", 235, 240, 250, 1)), node("uuid", QuotedText(uid(design.variant, "sheet", name))),
            node("property", QuotedText("Sheetname"), QuotedText(name), node("at", x, y - 0.8, 0), font),
            node("property", QuotedText("Sheetfile"), QuotedText(f"{design.variant}-{name}.kicad_sch"),
                 node("at", x, y + 26.2, 0),
                 small),
            node("instances", node("project", QuotedText(design.variant),
                                   node("path", QuotedText(f"/{uid(design.variant, 'root')}"),
                                        node("page", QuotedText(str(number + 2)))))),
        ))  # fmt: skip
        tree.append(_text(TITLES[name], (x + 4.0, y + 12.0), 2.0, uuid_node(design.variant, "root", name)))
    tree.append(node("sheet_instances", node("path", QuotedText("/"), node("page", QuotedText("1")))))
    tree.append(node("embedded_fonts", "no"))
    return render(tree) + "\n"


def library_text() -> str:
    """Return the symbol library that the pages were drawn from."""
    tree = node("kicad_symbol_lib", node("version", _LIBRARY_VERSION), node("generator", QuotedText("hardware_pcb")),
                node("generator_version", QuotedText("9.0")))  # fmt: skip
    tree += [symbol_node(SYMBOLS[name], name) for name in sorted(SYMBOLS)]
    return render(tree) + "\n"


def placed_pins(component: Component) -> list[PlacedPin]:
    """Return the pins of a component on its page."""
    x, y = place_of(component)
    nets = dict(component.pins)
    return [
        PlacedPin(component=component, pin=pin, x=x + round(pin.at[0] / STEP_MM), y=y - round(pin.at[1] / STEP_MM),
                  net=nets[pin.number])
        for pin in SYMBOLS[component.part.symbol].pins
    ]  # fmt: skip


def _mm(*steps: float) -> list[float]:
    return [round(step * STEP_MM, 4) for step in steps]


def _head(design: BoardDesign, name: str, title: str) -> Node:
    ident = uid(design.variant, "root") if name == "root" else uid(design.variant, "file", name)
    number = 1 if name == "root" else PAGES.index(name) + 2
    return node(
        "kicad_sch", node("version", _VERSION), node("generator", QuotedText("hardware_pcb")),
        node("generator_version", QuotedText("9.0")), node("uuid", QuotedText(ident)), node("paper", QuotedText("A4")),
        node("title_block", node("title", QuotedText(f"{number}. {title}" if name != "root" else title)),
             node("rev", QuotedText(design.variant)), node("company", QuotedText("p2os: BluePill to Pioneer 2-DX")),
             node("comment", "1", QuotedText(design.title)),
             node("comment", "2", QuotedText("Generated from hardware/pcb; no board has been made yet"))),
    )  # fmt: skip


def _text(text: str, at: tuple[float, float], size: float, ident: Node, *, is_bold: bool = False) -> Node:
    font = node("font", node("size", size, size), *([node("bold", "yes")] if is_bold else []))
    return node("text", QuotedText(text), node("exclude_from_sim", "no"), node("at", *at, 0),
                node("effects", font, node("justify", "left", "top")), ident)  # fmt: skip


def _frame(page: Page, title: str, note: str, corners: tuple[int, int, int, int]) -> None:
    left, top, right, bottom = corners
    page.nodes.append(node(
        "rectangle", node("start", *_mm(left, top)), node("end", *_mm(right, bottom)),
        node("stroke", node("width", 0.15), node("type", "dash")), node("fill", node("type", "none")),
        page.ident("frame"),
    ))  # fmt: skip
    x, y = _mm(left + 1, top + 1)
    page.nodes.append(_text(title, (x, y), 2.0, page.ident("title"), is_bold=True))
    if note:
        _, low = _mm(left, bottom - 2.4)
        page.nodes.append(_text(note, (x, low), 1.27, page.ident("note")))


def _wires(page: Page, pins: list[PlacedPin]) -> set[tuple[str, str]]:
    """Join facing pins of one net on one line; return the pins that need no label of their own."""
    joined: set[tuple[str, str]] = set()
    for first in pins:
        if first.pin.side != "right" or first.net is None or first.net in POWER_SYMBOLS:
            continue
        facing = [p for p in pins if p.pin.side == "left" and p.y == first.y and 0 < p.x - first.x <= _WIRE_STEPS]
        if not facing or min(facing, key=lambda p: p.x).net != first.net:
            continue
        second = min(facing, key=lambda p: p.x)
        _wire(page, (first.x, first.y), (second.x, second.y))
        _label(page, first.net, ((first.x + second.x) // 2, first.y), "top")
        joined |= {(end.component.ref, end.pin.number) for end in (first, second)}
    return joined


def _rows(page: Page, pins: list[PlacedPin]) -> set[tuple[str, str]]:
    """Draw each wire's path: pads at both ends, series resistor, pull; return the pins that need no label of their own.

    The modules are on a page of their own, so their pads stand as words: name, reference, number and name.
    """
    ends = {(placed.component.ref, placed.pin.number): placed for placed in pins}
    joined: set[tuple[str, str]] = set()
    for index in range(len(series_wires(load_pinout()))):
        near, far = ends[f"R{index + 1}", "1"], ends[f"R{index + 1}", "2"]
        pull = ends.get((f"R{index + 1 + PULL_OFFSET}", "1"))
        fork, label = far.x + 4, far.x + 8
        _wire(page, (far.x, far.y), (fork, far.y))
        _wire(page, (fork, far.y), (label, far.y))
        _label(page, far.net or "", (label, far.y), "right")
        joined.add((far.component.ref, "2"))
        if pull is not None and pull.net == far.net:
            _wire(page, (fork, far.y), (fork, pull.y))
            _wire(page, (fork, pull.y), (pull.x, pull.y))
            page.nodes.append(node("junction", node("at", *_mm(fork, far.y)), node("diameter", 0),
                                   node("color", 0, 0, 0, 0), page.ident("junction")))  # fmt: skip
            joined.add((pull.component.ref, "1"))
        for net, x in ((near.net, near.x - 34), (far.net, label + 15)):
            words = [
                f"{part.ref}.{pin} {SYMBOLS[part.part.symbol].pin_name(pin)}".removesuffix(f" {pin}")
                for part in page.design.components
                for pin, name in part.pins
                if part.ref in _PADS and name == net
            ]
            left, y = _mm(x, near.y)
            page.nodes.append(_text("  ".join(words), (left, y - 1.2), 1.27, page.ident("pads")))
    return joined


def _end(page: Page, placed: PlacedPin) -> None:
    """Finish a pin that no wire joins: a mark, a power symbol or a label."""
    if placed.pin.kind == "no_connect":
        return
    if placed.net is None:
        page.nodes.append(node("no_connect", node("at", *_mm(placed.x, placed.y)), page.ident("nc")))
        return
    dx, dy = _OUTWARD[placed.pin.side]
    crowded = len(placed.component.pins) > 2 and placed.pin.side in {"left", "right"}
    stub = 2 if placed.net not in POWER_SYMBOLS or placed.pin.side in {"left", "right"} else 1
    x, y = placed.x + stub * dx, placed.y + stub * dy
    _wire(page, (placed.x, placed.y), (x, y))
    if placed.net in POWER_SYMBOLS and not crowded:
        _power(page, placed.net, x, y)
    else:
        _label(page, placed.net, (x, y), placed.pin.side)


def _wire(page: Page, start: tuple[int, int], end: tuple[int, int]) -> None:
    page.nodes.append(node("wire", node("pts", node("xy", *_mm(*start)), node("xy", *_mm(*end))),
                           node("stroke", node("width", 0), node("type", "default")), page.ident("wire")))  # fmt: skip


def _label(page: Page, net: str, at: tuple[int, int], side: str) -> None:
    angle = {"left": 180, "right": 0, "top": 90, "bottom": 270}[side]
    justify = "right" if side in {"left", "bottom"} else "left"
    page.nodes.append(node(
        "global_label", QuotedText(net), node("shape", "passive"), node("at", *_mm(*at), angle),
        node("fields_autoplaced", "yes"),
        node("effects", node("font", node("size", 1.27, 1.27)), node("justify", justify)), page.ident("label"),
        node("property", QuotedText("Intersheetrefs"), QuotedText("${INTERSHEET_REFS}"), node("at", *_mm(*at), 0),
             node("effects", node("font", node("size", 1.27, 1.27)), node("hide", "yes"))),
    ))  # fmt: skip


def _power(page: Page, net: str, x: int, y: int) -> None:
    page.used.add(net)
    page.count += 1
    page.nodes.append(_symbol(page, net, f"#PWR{PAGES.index(page.name) + 1}{page.count:03d}", net, (x, y), {}))


def _flag(page: Page, net: str, x: int) -> None:
    y = 146
    page.used.add("PWR_FLAG")
    page.count += 1
    page.nodes.append(_symbol(page, "PWR_FLAG", f"#FLG{page.count:03d}", "PWR_FLAG", (x, y), {}))
    if net in POWER_SYMBOLS:
        # The flag stands upright on the symbol's pin; ground points down, supplies to the side.
        _wire(page, (x, y), (x, y + 2) if net == "GND" else (x + 5, y))
        _power(page, net, x if net == "GND" else x + 5, y + 2 if net == "GND" else y)
    else:
        _wire(page, (x, y), (x, y + 2))
        _label(page, net, (x, y + 2), "bottom")


def _instance(page: Page, component: Component) -> Node:
    part = component.part
    fields = {"Footprint": f"{LIBRARY}:{part.footprint}", "Datasheet": "", "Description": part.description,
              "MPN": part.mpn, "Manufacturer": part.manufacturer}  # fmt: skip
    return _symbol(page, part.symbol, component.ref, part.value, place_of(component), fields, in_bom=part.bought)


def _symbol(
    page: Page, name: str, ref: str, value: str, at: tuple[int, int], fields: dict[str, str], *, in_bom: bool = True
) -> Node:
    symbol = SYMBOLS[name]
    x, y = _mm(*at)
    tree = node(
        "symbol", node("lib_id", QuotedText(f"{LIBRARY}:{name}")), node("at", x, y, 0), node("unit", 1),
        node("exclude_from_sim", "no"), node("in_bom", "yes" if in_bom and not symbol.is_power else "no"),
        node("on_board", "yes"), node("dnp", "no"),
        node("uuid", QuotedText(uid(page.design.variant, ref, "symbol"))),
    )  # fmt: skip
    tree.append(
        property_node(
            "Reference",
            ref,
            (x + symbol.ref_at[0], y - symbol.ref_at[1]),
            is_hidden=symbol.is_power,
            justify=symbol.justify,
        )
    )
    tree.append(property_node("Value", value, (x + symbol.value_at[0], y - symbol.value_at[1]),
                              is_hidden=name in {"PWR_FLAG", "TESTPOINT"}, justify=symbol.justify))  # fmt: skip
    rows = fields or {"Footprint": "", "Datasheet": "", "Description": ""}
    tree += [property_node(key, text, (x, y), is_hidden=True) for key, text in rows.items()]
    tree += [
        node("pin", QuotedText(pin.number), uuid_node(page.design.variant, ref, "pin", pin.number))
        for pin in symbol.pins
    ]
    path = sheet_path(page.design.variant, page.name)
    tree.append(node("instances", node("project", QuotedText(page.design.variant), node(
        "path", QuotedText(path), node("reference", QuotedText(ref)), node("unit", 1)))))  # fmt: skip
    return tree
