"""The schematic as .kicad_sch files: a root sheet and one file a page.

Nets are told by global labels and power symbols; two facing pins of one net on one
line get a wire between them. Invariant: same design, same bytes.
"""

from dataclasses import dataclass, field

from hardware.pcb.ids import sheet_path, uid, uuid_node
from hardware.pcb.netlist import Component, Design
from hardware.pcb.schematic_pages import PAGES, STEP_MM, TITLES, frames, page_of, place_of
from hardware.pcb.sexp import Node, Text, node, render
from hardware.pcb.symbols import POWER_SYMBOLS, SYMBOLS, Pin, property_node, symbol_node

LIBRARY = "adapter"
#: Format of KiCad 9.0.
_VERSION = "20250114"
_LIBRARY_VERSION = "20241209"
_OUTWARD = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}
#: Nets whose current enters through passive parts only: ERC is told that they are supplied.
_FLAGGED = ("GND", "+12V", "+5V", "BP_5V", "ESP_5V")
#: Longest gap between two facing pins that gets a wire, steps.
_WIRE_STEPS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedPin:
    """A pin on a page: its end in steps, its outward side and its net."""

    component: Component
    pin: Pin
    x: int
    y: int
    net: str | None


@dataclass(slots=True)
class Page:
    """A page under construction."""

    design: Design
    name: str
    nodes: list[Node] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    count: int = 0

    def ident(self, kind: str) -> Node:
        """Return the next identifier on this page."""
        self.count += 1
        return uuid_node(self.design.variant, self.name, kind, self.count)


def page_text(design: Design, name: str) -> str:
    """Return the file of one page."""
    page = Page(design, name)
    for frame in frames(design, name):
        _frame(page, frame.title, frame.note, (frame.left, frame.top, frame.right, frame.bottom))
    components = [component for component in design.components if page_of(component) == name]
    pins = [pin for component in components for pin in placed_pins(component)]
    joined = _wires(page, pins)
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


def root_text(design: Design) -> str:
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
            node("fill", node("color", 235, 240, 250, 1)), node("uuid", Text(uid(design.variant, "sheet", name))),
            node("property", Text("Sheetname"), Text(name), node("at", x, y - 0.8, 0), font),
            node("property", Text("Sheetfile"), Text(f"{design.variant}-{name}.kicad_sch"), node("at", x, y + 26.2, 0),
                 small),
            node("instances", node("project", Text(design.variant),
                                   node("path", Text(f"/{uid(design.variant, 'root')}"),
                                        node("page", Text(str(number + 2)))))),
        ))  # fmt: skip
        tree.append(_text(TITLES[name], (x + 4.0, y + 12.0), 2.0, uuid_node(design.variant, "root", name)))
    tree.append(node("sheet_instances", node("path", Text("/"), node("page", Text("1")))))
    tree.append(node("embedded_fonts", "no"))
    return render(tree) + "\n"


def library_text() -> str:
    """Return the symbol library that the pages were drawn from."""
    tree = node("kicad_symbol_lib", node("version", _LIBRARY_VERSION), node("generator", Text("hardware_pcb")),
                node("generator_version", Text("9.0")))  # fmt: skip
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


def _head(design: Design, name: str, title: str) -> Node:
    ident = uid(design.variant, "root") if name == "root" else uid(design.variant, "file", name)
    number = 1 if name == "root" else PAGES.index(name) + 2
    return node(
        "kicad_sch", node("version", _VERSION), node("generator", Text("hardware_pcb")),
        node("generator_version", Text("9.0")), node("uuid", Text(ident)), node("paper", Text("A4")),
        node("title_block", node("title", Text(f"{number}. {title}" if name != "root" else title)),
             node("rev", Text(design.variant)), node("company", Text("p2os: BluePill to Pioneer 2-DX")),
             node("comment", "1", Text(design.title)),
             node("comment", "2", Text("Generated from hardware/pcb; no board has been made yet"))),
    )  # fmt: skip


def _text(text: str, at: tuple[float, float], size: float, ident: Node, *, is_bold: bool = False) -> Node:
    font = node("font", node("size", size, size), *([node("bold", "yes")] if is_bold else []))
    return node("text", Text(text), node("exclude_from_sim", "no"), node("at", *at, 0),
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
        "global_label", Text(net), node("shape", "passive"), node("at", *_mm(*at), angle),
        node("fields_autoplaced", "yes"),
        node("effects", node("font", node("size", 1.27, 1.27)), node("justify", justify)), page.ident("label"),
        node("property", Text("Intersheetrefs"), Text("${INTERSHEET_REFS}"), node("at", *_mm(*at), 0),
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
        "symbol", node("lib_id", Text(f"{LIBRARY}:{name}")), node("at", x, y, 0), node("unit", 1),
        node("exclude_from_sim", "no"), node("in_bom", "yes" if in_bom and not symbol.is_power else "no"),
        node("on_board", "yes"), node("dnp", "no"),
        node("uuid", Text(uid(page.design.variant, ref, "symbol"))),
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
        node("pin", Text(pin.number), uuid_node(page.design.variant, ref, "pin", pin.number)) for pin in symbol.pins
    ]
    path = sheet_path(page.design.variant, page.name)
    tree.append(node("instances", node("project", Text(page.design.variant), node(
        "path", Text(path), node("reference", Text(ref)), node("unit", 1)))))  # fmt: skip
    return tree
