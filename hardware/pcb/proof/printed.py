"""The print, read back from its geometry and held against the netlist: polarity, pin 1, names of pins and connectors.

What a person reads off the board is where a mark stands, not what it was meant for: the bar of a diode is the stroke
that closes one end, a plus belongs to the pad beside it, a name to the pad that it stands next to. Each is found by
place alone, and must say of its pad's net what the circuit says.

Not here: whether a text can be read; pictures show that (docs/pictures/board).

Invariant: a fault names the part or the text, and the pad that it stands at.
"""

import math
import re
from collections.abc import Iterator, Mapping

from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.outputs.read_places import Point
from hardware.pcb.proof.board_file import PlacedLand, PrintedBoard, PrintedMark, SilkPart
from hardware.pcb.proof.expected import print_names

#: Letters of KiCad's stroke font, from middle to middle, by their height.
LETTER = 0.92
#: How far a mark may stand from the pad that it is about, millimetres.
REACH_MM = 6.0
#: A reference may stand this much nearer to another part: between two columns of one row.
TIE_MM = 0.6
#: Texts of the board: the part that they stand at, and the net of the nearest of its pads, where that matters.
LABELS: Mapping[str, tuple[str, str | None]] = {
    "11-14.8V": ("J1", None), "12V": ("JP1", "5V_REG"), "BANK": ("JP1", "5V_BANK"), "MODE": ("J5", None),
    "DTR": ("JP2", "DTR_ON"), "PWR": ("D6", None), "TX": ("D7", None), "RX": ("D8", None), "STATUS": ("D9", None),
    "HOST (RS-232 plug, DTE)": ("J3", None), "LOGIC": ("J4", None), "3.3V only": ("J4", None), "STOP": ("J7", None),
    "BOOT/MODE": ("SW1", None), "JP8 ribbon": ("J6", None), "JP8 12V": ("JP3", None),
}  # fmt: skip
#: A connector's label between its plus and its minus: the part.
POLES = {"+12V-": "J1", "+5V-": "J2"}
#: Texts that are about the whole board.
OF_BOARD = re.compile(r"BluePill to Pioneer adapter|REV [BC].*|5V: 150mA, peaks 250mA|LOOP OPEN: .*")
#: Symbols whose two ends differ, and which of them the print marks.
_MARKED = {"SCHOTTKY": "K", "LED": "K", "TVS": "K", "CP": "1"}
#: Symbols without a pin 1 to look for.
_UNMARKED = frozenset({"R", "C", "FUSE", "TESTPOINT", "HOLE", "SWITCH", *_MARKED, "REGULATOR3", "CONN2"})
#: The names beside a step-down module's pins.
_BUCK = {"IN": "1", "G": "2", "OUT": "3"}
_HEADER = {r"DD(\d)": r"DD\1", r"E(\d)S(\d)": r"ENCODER\1_S\2", r"M(\d)C(\d)": r"MOTOR\1_COMM\2", "CON": "P2DX_CON"}


def faults(board: PrintedBoard, design: BoardDesign) -> list[str]:
    """Return what the print says wrongly, one line each."""
    found = [f"{part.ref} is not on the board" for part in design.components if part.ref not in board.parts]
    for component in design.components:
        if component.ref in board.parts:
            part = board.parts[component.ref]
            found += [*_polarity(part, component), *_first(part, component), *_names(part, component)]
            found += _reference(board, part)
    return [*found, *_labels(board, design)]


def nearest(lands: Mapping[str, tuple[PlacedLand, ...]], point: Point) -> tuple[str, PlacedLand, float]:
    """Return the part and its land that stand nearest to a point, and how far from its rim, millimetres."""
    ref, land = min(((ref, land) for ref, own in lands.items() for land in own), key=lambda row: _gap(row[1], point))
    return ref, land, _gap(land, point)


def _gap(land: PlacedLand, point: Point) -> float:
    return max(0.0, math.dist(land.at, point) - min(land.size_mm) / 2)


def _at(part: SilkPart, point: Point) -> tuple[PlacedLand, float]:
    _, land, gap = nearest({part.ref: part.lands}, point)
    return land, gap


def _net(component: Component, pin: str) -> str:
    return dict(component.pins).get(pin) or ""


def _polarity(part: SilkPart, component: Component) -> Iterator[str]:
    """Find the end that a diode's print closes, or the plus of a capacitor, and compare the net there."""
    pin = _MARKED.get(component.part.symbol)
    if pin is None:
        return
    if pin == "1":
        marks = [mark.at for mark in part.marks if mark.text == "+"]
        what = "plus"
    else:
        marks, what = _bars(part), "bar"
    if len(marks) != 1:
        yield f"{part.ref} has {len(marks)} marks of its {what}"
        return
    (land, gap), wanted = _at(part, marks[0]), _net(component, pin)
    if gap > REACH_MM or land.net != wanted:
        yield f"{part.ref}: its {what} stands at the pad on {land.net}, {pin} is on {wanted}"


def _bars(part: SilkPart) -> list[Point]:
    """Return the strokes that cross the axis through both pads beyond one of them."""
    (one, other), found = (land.at for land in part.lands), []
    along = (other[0] - one[0], other[1] - one[1])
    length = math.hypot(*along)
    for mark in part.marks:
        if len(mark.points) != 2:
            continue
        sides = [(x - one[0]) * along[1] - (y - one[1]) * along[0] for x, y in mark.points]
        x, y = mark.at
        place = ((x - one[0]) * along[0] + (y - one[1]) * along[1]) / length**2
        if sides[0] * sides[1] < 0 and not 0 <= place <= 1:
            found.append(mark.at)
    return found


def _first(part: SilkPart, component: Component) -> Iterator[str]:
    """Find the dot, corner or figure that marks pin 1, and the pad beside it."""
    if component.part.symbol in _UNMARKED and not part.footprint.startswith("HEADER"):
        return
    figures = [mark for mark in part.marks if re.fullmatch(r"\d", mark.text) and mark.justify == "center"]
    dots = [mark for mark in part.marks if mark.is_filled or (len(mark.points) == 2 and mark.width_mm == 0.2)]
    for mark in figures or dots:
        land, _ = _at(part, mark.at)
        wanted = mark.text or "1"
        if land.number != wanted:
            yield f"{part.ref}: the mark of pin {wanted} stands at pad {land.number}"
        if land.net and _net(component, land.number) != land.net and not land.net.startswith("unconnected-"):
            yield f"{part.ref}.{land.number} is on {land.net}, the circuit has {_net(component, land.number)}"
    if not figures and len(dots) != 1:
        yield f"{part.ref} has {len(dots)} marks of pin 1"
    if figures and [mark.text for mark in figures] != sorted({mark.text for mark in figures}):
        yield f"{part.ref} has figures {[mark.text for mark in figures]}"


def _names(part: SilkPart, component: Component) -> Iterator[str]:
    """Compare each name beside a pad with what stands there by the module's own print, or with its net."""
    texts = [mark for mark in part.marks if mark.text and not mark.is_reference]
    if names := print_names(part.ref, [land.at for land in part.lands]):
        beside = [mark for mark in texts if mark.justify != "center"]
        for mark in beside:
            land, _ = _at(part, mark.at)
            if mark.text != names[land.at]:
                yield f"{part.ref}: {mark.text!r} stands at the pad of {names[land.at]}"
        if len(beside) != len(part.lands):
            yield f"{part.ref} has {len(beside)} names for {len(part.lands)} pads"
    elif component.part.symbol == "REGULATOR3":
        for mark in texts:
            land, _ = _at(part, mark.at)
            if land.net != _net(component, _BUCK.get(mark.text, "")):
                yield f"{part.ref}: {mark.text!r} stands at the pad on {land.net}"
        if sorted(mark.text for mark in texts) != sorted(_BUCK):
            yield f"{part.ref} lacks a name of a pin"
    elif component.part.symbol == "TESTPOINT" and [mark.text for mark in texts] != [part.lands[0].net]:
        yield f"{part.ref} says {[mark.text for mark in texts]}, it is on {part.lands[0].net}"


def _reference(board: PrintedBoard, part: SilkPart) -> Iterator[str]:
    """Compare a printed reference with its part, and with the part that it stands nearest to."""
    for mark in part.marks:
        if not mark.is_reference or not part.lands:
            continue
        if mark.text != part.ref:
            yield f"{part.ref} is printed as {mark.text}"
        own = _beside(part, mark.at)
        gap, ref = min((_beside(one, mark.at), ref) for ref, one in board.parts.items() if one.lands)
        if gap < own - TIE_MM:
            yield f"the reference of {part.ref} stands at {ref}"


def _beside(part: SilkPart, point: Point) -> float:
    """Return how far a point is from what is drawn of a part, its texts aside; 0 within it."""
    places = [land.at for land in part.lands] + [at for mark in part.marks if not mark.text for at in mark.points]
    (left, right), (top, bottom) = ((min(row), max(row)) for row in zip(*places, strict=True))
    x, y = point
    return math.hypot(max(left - x, x - right, 0.0), max(top - y, y - bottom, 0.0))


def _labels(board: PrintedBoard, design: BoardDesign) -> Iterator[str]:
    lands = {ref: part.lands for ref, part in board.parts.items() if part.lands and not ref.startswith("TP")}
    header = {ref: lands[ref] for ref in ("J4",) if ref in lands}
    seen = []
    for mark in board.labels:
        seen.append(mark.text)
        if mark.text in POLES:
            yield from _poles(mark, POLES[mark.text], board, lands, design)
        elif mark.text in LABELS:
            wanted, net = LABELS[mark.text]
            ref = min(lands, key=lambda name: _beside(board.parts[name], mark.at))
            if ref != wanted or _beside(board.parts[ref], mark.at) > REACH_MM:
                yield f"{mark.text!r} stands at {ref}, it is about {wanted}"
            elif net is not None and (land := _at(board.parts[ref], mark.at)[0]).net != net:
                yield f"{mark.text!r} stands at the pad of {ref} on {land.net}, expected {net}"
        elif (name := header_net(mark.text)) is not None and header:
            _, land, gap = nearest(header, mark.at)
            if gap > REACH_MM or land.net not in name:
                yield f"{mark.text!r} stands at J4.{land.number} on {land.net}"
        elif not OF_BOARD.fullmatch(mark.text):
            yield f"nobody knows what {mark.text!r} is about"
    parts = {part.ref for part in design.components}
    wanted_texts = [text for text, (ref, _) in LABELS.items() if ref in parts] + list(POLES)
    yield from (f"{text!r} is printed {seen.count(text)} times" for text in wanted_texts if seen.count(text) != 1)
    named = sum(header_net(text) is not None for text in seen)
    if "J4" in board.parts and named != len(board.parts["J4"].lands):
        yield f"J4 has {named} names for {len(board.parts['J4'].lands)} pins"


def header_net(text: str) -> tuple[str, ...] | None:
    """Return the nets that a name beside the logic header may mean; None of another text."""
    if text in {"GND", "RST"}:
        return ("GND",) if text == "GND" else ("RST_REQ",)
    for pattern, name in _HEADER.items():
        if re.fullmatch(pattern, text):
            wire = re.sub(pattern, name, text)
            return wire, f"{wire}_BP"
    return None


def _poles(
    mark: PrintedMark, ref: str, board: PrintedBoard, lands: Mapping[str, tuple[PlacedLand, ...]], design: BoardDesign
) -> Iterator[str]:
    """The sign at either end of a text belongs to the pad of its part that stands nearest to it."""
    if ref not in lands or all(part.ref != ref for part in design.components):
        yield f"{mark.text!r} is about {ref}, which is not in circuit and board"
        return
    half = (len(mark.text) - 1) / 2 * LETTER * mark.width_mm
    (x, y), pins = mark.at, dict(design.component(ref).pins)
    nearby = min((_beside(board.parts[name], mark.at), name) for name in lands)
    if nearby[1] != ref or nearby[0] > REACH_MM:
        yield f"{mark.text!r} stands at {nearby[1]}, it is about {ref}"
    for sign, at, number in ((mark.text[0], (x - half, y), "1"), (mark.text[-1], (x + half, y), "2")):
        _, land, _ = nearest({ref: lands[ref]}, at)
        if land.net != pins[number]:
            yield f"the {sign} of {mark.text!r} stands at the pad of {ref} on {land.net}"
