"""The board as a .kicad_pcb file: outline, parts, copper, pours, texts.

The file is written here from the design alone; only the shape of the filled pours
comes from KiCad (pours/*.txt, see pours.py). Invariant: same design, same bytes.

Shapes as KiCad's nodes: pads, strokes, texts, for footprints and boards alike.

Invariant: angles of pads and texts are absolute on a board, so callers pass the part's angle.
"""

from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.layout import rules
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import Placement, place, silk_labels, unturn
from hardware.pcb.layout.routing import Track, Via, antenna_area
from hardware.pcb.layout.shapes import SILK_MM, Circle, Label, Pad, PadKind, PadShape, PartFootprint, StraightStroke
from hardware.pcb.outputs.schematic import page_of
from hardware.pcb.outputs.sexp import Node, QuotedText, node, render, sheet_path, uid, uuid_node
from hardware.pcb.outputs.symbols import SYMBOLS

_COPPER = {
    PadKind.SMD: ("F.Cu", "F.Mask", "F.Paste"),
    PadKind.THROUGH: ("*.Cu", "*.Mask"),
    PadKind.HOLE: ("*.Cu", "*.Mask"),
}
_CORNER_RATIO = 0.25


def text_effects(size: float, justify: str = "center", *, is_hidden: bool = False, is_bold: bool = False) -> list[Node]:
    """Return a text's font node (and what hides it); strokes are 15 % of the height, at least what makers print."""
    thickness = max(SILK_MM, round(size * (0.2 if is_bold else 0.15), 3))
    font = node("font", node("size", size, size), node("thickness", thickness))
    effects = node("effects", font)
    if justify != "center":
        effects.append(node("justify", justify))
    return [node("hide", "yes"), effects] if is_hidden else [effects]


def pad_node(pad: Pad, angle: float, net: tuple[int, str] | None, ident: tuple[object, ...], copper: bool) -> Node:
    """Return a pad; test points have copper and mask but no paste."""
    layers = _COPPER[pad.kind] if copper else tuple(layer for layer in _COPPER[pad.kind] if layer != "F.Paste")
    result = node("pad", QuotedText(pad.number), pad.kind.value, pad.shape.value)
    result.append(node("at", *pad.at_mm, *([angle] if angle else [])))
    result.append(node("size", *pad.size_mm))
    if pad.drill_mm:
        result.append(node("drill", pad.drill_mm))
    result.append(node("layers", *(QuotedText(layer) for layer in layers)))
    if pad.kind is PadKind.THROUGH:
        result.append(node("remove_unused_layers", "no"))
    if pad.shape is PadShape.ROUND_RECT:
        result.append(node("roundrect_rratio", _CORNER_RATIO))
    if net is not None:
        result.append(node("net", net[0], QuotedText(net[1])))
    result.append(uuid_node(*ident))
    return result


def stroke(width: float) -> Node:
    """Return a solid stroke."""
    return node("stroke", node("width", width), node("type", "solid"))


def shape_node(shape: StraightStroke | Circle | Label, prefix: str, angle: float, ident: tuple[object, ...]) -> Node:
    """Return a stroke, circle or text; `prefix` is fp (in a footprint) or gr (on the board)."""
    if isinstance(shape, StraightStroke):
        return node(
            f"{prefix}_line", node("start", *shape.start_mm), node("end", *shape.end_mm), stroke(shape.width_mm),
            node("layer", QuotedText(shape.layer)), uuid_node(*ident),
        )  # fmt: skip
    if isinstance(shape, Circle):
        x, y = shape.center_mm
        return node(
            f"{prefix}_circle", node("center", x, y), node("end", x + shape.radius_mm, y), stroke(shape.width_mm),
            node("fill", "yes" if shape.is_filled else "no"), node("layer", QuotedText(shape.layer)), uuid_node(*ident),
        )  # fmt: skip
    kind = ["user"] if prefix == "fp" else []
    at = node("at", *shape.at_mm, shape.angle_deg + angle)
    return node(
        f"{prefix}_text", *kind, QuotedText(shape.text), at, node("layer", QuotedText(shape.layer)), uuid_node(*ident),
        *text_effects(shape.size_mm, shape.justify),
    )  # fmt: skip


def footprint_attributes(footprint: PartFootprint, *, is_bought: bool) -> Node:
    """Return how the part is mounted and whether it is in the bill of materials."""
    words = ["smd"] if footprint.is_smd and footprint.pads else ["through_hole"]
    if not is_bought:
        words = ["exclude_from_pos_files", "exclude_from_bom"]
    return node("attr", *words)


LIBRARY = "adapter"
#: The board's upper left corner on the drawing sheet (A4).
ORIGIN_MM = (98.0, 50.0)
#: Format of KiCad 9.0.
_VERSION = "20241229"
_LAYERS = (
    (0, "F.Cu", "signal", ""), (2, "B.Cu", "signal", ""), (9, "F.Adhes", "user", "F.Adhesive"),
    (11, "B.Adhes", "user", "B.Adhesive"), (13, "F.Paste", "user", ""), (15, "B.Paste", "user", ""),
    (5, "F.SilkS", "user", "F.Silkscreen"), (7, "B.SilkS", "user", "B.Silkscreen"), (1, "F.Mask", "user", ""),
    (3, "B.Mask", "user", ""), (17, "Dwgs.User", "user", "User.Drawings"), (19, "Cmts.User", "user", "User.Comments"),
    (25, "Edge.Cuts", "user", ""), (27, "Margin", "user", ""), (31, "F.CrtYd", "user", "F.Courtyard"),
    (29, "B.CrtYd", "user", "B.Courtyard"), (35, "F.Fab", "user", ""), (33, "B.Fab", "user", ""),
)  # fmt: skip


def board_text(design: BoardDesign, tracks: list[Track], vias: list[Via], pours: dict[str, list[Node]]) -> str:
    """Return the whole file.

    Args:
        design: A variant with a board.
        tracks: Copper of the router.
        vias: Holes of the router, stitching included.
        pours: Filled polygons by the key of their area ("GND:F.Cu"); empty before KiCad has filled them.
    """
    nets = _net_names(design)
    numbers = {name: number for number, name in enumerate(nets)}
    tree = node("kicad_pcb", node("version", _VERSION), node("generator", QuotedText("hardware_pcb")),
                node("generator_version", QuotedText("9.0")))  # fmt: skip
    tree.append(node("general", node("thickness", rules.BOARD_THICKNESS_MM), node("legacy_teardrops", "no")))
    tree.append(node("paper", QuotedText("A4")))
    tree.append(node("title_block", node("title", QuotedText(design.title)), node("rev", QuotedText(design.variant)),
                     node("comment", "1",
                          QuotedText("Generated from hardware/pcb; no board has been made yet"))))  # fmt: skip
    layers = node("layers")
    for number, name, kind, alias in _LAYERS:
        layers.append(node(str(number), QuotedText(name), kind, *([QuotedText(alias)] if alias else [])))
    tree.append(layers)
    tree.append(_setup())
    tree += [node("net", number, QuotedText(name)) for number, name in enumerate(nets)]
    places = place(design)
    tree += [_part(design, part, places[part.ref], numbers) for part in design.components]
    tree += _outline()
    for number, label in enumerate(silk_labels(design)):
        x, y = _board(label.at_mm)
        moved = Label(layer=label.layer, text=label.text, at_mm=(x, y), size_mm=label.size_mm, justify=label.justify,
                      angle_deg=label.angle_deg)  # fmt: skip
        tree.append(shape_node(moved, "gr", 0, (design.variant, "text", number)))
    tree += _copper(design, tracks, vias, numbers)
    for priority, pour in enumerate(rules.pours(design.variant)):
        tree.append(_pour(design, pour, numbers[pour.net], max(0, priority - 1), pours.get(pour.key, [])))
    tree.append(_antenna(design))
    tree.append(node("embedded_fonts", "no"))
    return render(tree) + "\n"


def footprint_file(footprint: PartFootprint, *, is_bought: bool = True) -> str:
    """Return a library file (.kicad_mod) of a footprint."""
    tree = node("footprint", QuotedText(footprint.name), node("version", _VERSION),
                node("generator", QuotedText("hardware_pcb")),
                node("generator_version", QuotedText("9.0")), node("layer", QuotedText("F.Cu")),
                node("descr", QuotedText(footprint.description)))  # fmt: skip
    tree += [
        node("property", QuotedText(name), QuotedText(text), node("at", *at, 0), node("layer", QuotedText(layer)),
             uuid_node(footprint.name, name), *text_effects(0.8, is_hidden=name == "Value"))
        for name, text, at, layer in (
            ("Reference", "REF**", footprint.ref_at_mm, "F.SilkS"), ("Value", footprint.name, (0.0, 0.0), "F.Fab"),
        )
    ]  # fmt: skip
    tree.append(footprint_attributes(footprint, is_bought=is_bought))
    for number, shape in enumerate(footprint.drawings):
        tree.append(shape_node(shape, "fp", 0, (footprint.name, "shape", number)))
    for number, pad in enumerate(footprint.pads):
        tree.append(pad_node(pad, 0, None, (footprint.name, "pad", number), copper=is_bought))
    tree.append(node("embedded_fonts", "no"))
    return render(tree) + "\n"


def pad_net(component: Component, pin: str) -> str | None:
    """Return the net of a pad as KiCad names it: a pin left open has a net of its own."""
    nets = dict(component.pins)
    if pin not in nets:
        return None
    if nets[pin] is not None:
        return nets[pin]
    name = {number: name for number, name, *_ in SYMBOLS[component.part.symbol].rows()}[pin]
    suffix = f"{name}-Pad{pin}" if name != pin else f"Pad{pin}"
    return f"unconnected-({component.ref}-{suffix})"


def _net_names(design: BoardDesign) -> list[str]:
    names = {pad_net(part, pin) for part in design.components for pin, _ in part.pins}
    return ["", *sorted(name for name in names if name)]


def _board(point: tuple[float, float]) -> tuple[float, float]:
    return (round(point[0] + ORIGIN_MM[0], 6), round(point[1] + ORIGIN_MM[1], 6))


def _setup() -> Node:
    mask = [node("color", QuotedText("Green")), node("thickness", 0.01)]
    copper = [node("type", QuotedText("copper")), node("thickness", 0.035)]
    core = [node("type", QuotedText("core")), node("thickness", 1.51), node("material", QuotedText("FR4"))]
    stackup = node(
        "stackup",
        node("layer", QuotedText("F.SilkS"), node("type", QuotedText("Top Silk Screen")),
             node("color", QuotedText("White"))),
        node("layer", QuotedText("F.Mask"), node("type", QuotedText("Top Solder Mask")), *mask),
        node("layer", QuotedText("F.Cu"), *copper),
        node("layer", QuotedText("dielectric 1"), *core), node("layer", QuotedText("B.Cu"), *copper),
        node("layer", QuotedText("B.Mask"), node("type", QuotedText("Bottom Solder Mask")), *mask),
        node("layer", QuotedText("B.SilkS"), node("type", QuotedText("Bottom Silk Screen")),
             node("color", QuotedText("White"))),
        node("copper_finish", QuotedText("None")), node("dielectric_constraints", "no"),
    )  # fmt: skip
    return node(
        "setup", stackup, node("pad_to_mask_clearance", 0), node("allow_soldermask_bridges_in_footprints", "no"),
        node("tenting", "front", "back"), node("aux_axis_origin", ORIGIN_MM[0], ORIGIN_MM[1] + rules.BOARD_HEIGHT_MM),
        node("grid_origin", *ORIGIN_MM),
    )  # fmt: skip


def _part(design: BoardDesign, component: Component, at: Placement, numbers: dict[str, int]) -> Node:
    footprint, part, ref = FOOTPRINTS[component.part.footprint], component.part, component.ref
    ident = (design.variant, ref)
    tree = node(
        "footprint",
        QuotedText(f"{LIBRARY}:{footprint.name}"),
        node("layer", QuotedText("F.Cu")),
        uuid_node(*ident, "part"),
    )
    tree.append(node("at", *_board((at.x_mm, at.y_mm)), *([at.angle_deg] if at.angle_deg else [])))
    tree.append(node("descr", QuotedText(footprint.description)))
    ref_at = footprint.ref_at_mm if at.ref_mm is None else unturn(at.ref_mm, at.angle_deg)
    # Texts stay readable: a part turned upside down keeps its text upright.
    rows = [("Reference", ref, ref_at, "F.SilkS", ref.startswith(("H", "TP"))),
            ("Value", part.value, (0.0, 0.0), "F.Fab", True), ("Datasheet", "", (0.0, 0.0), "F.Fab", True),
            ("Description", part.description, (0.0, 0.0), "F.Fab", True), ("MPN", part.mpn, (0.0, 0.0), "F.Fab", True),
            ("Manufacturer", part.manufacturer, (0.0, 0.0), "F.Fab", True)]  # fmt: skip
    for name, text, place_at, layer, is_hidden in rows:
        tree.append(node("property", QuotedText(name), QuotedText(text), node("at", *place_at, 0),
                         node("layer", QuotedText(layer)),
                         uuid_node(*ident, name), *text_effects(0.8, is_hidden=is_hidden)))  # fmt: skip
    page = page_of(component)
    symbol = f"{sheet_path(design.variant, page).rsplit('/', 1)[1]}/{uid(design.variant, ref, 'symbol')}"
    tree += [node("path", QuotedText(f"/{symbol}")), node("sheetname", QuotedText(f"/{page}/")),
             node("sheetfile", QuotedText(f"{design.variant}-{page}.kicad_sch"))]  # fmt: skip
    tree.append(footprint_attributes(footprint, is_bought=part.bought))
    for number, shape in enumerate(footprint.drawings):
        tree.append(shape_node(shape, "fp", at.angle_deg, (*ident, "shape", number)))
    if component.label and ref.startswith("TP"):
        label = Label(layer="F.SilkS", text=component.label, at_mm=footprint.ref_at_mm)
        tree.append(shape_node(label, "fp", 0, (*ident, "name")))
    for number, pad in enumerate(footprint.pads):
        net = pad_net(component, pad.number)
        pair = (numbers[net], net) if net is not None and pad.kind is not PadKind.HOLE else None
        tree.append(pad_node(pad, at.angle_deg, pair, (*ident, "pad", number), copper=part.bought))
    tree.append(node("embedded_fonts", "no"))
    tree.append(node("model", QuotedText(f"${{KIPRJMOD}}/../library/models/{footprint.name}.wrl"),
                     node("offset", node("xyz", 0, 0, 0)),
                     node("scale", node("xyz", 1, 1, 1)), node("rotate", node("xyz", 0, 0, 0))))  # fmt: skip
    return tree


def _outline() -> list[Node]:
    width, height, corner = rules.BOARD_WIDTH_MM, rules.BOARD_HEIGHT_MM, rules.CORNER_MM
    far = corner * (1 - 0.5**0.5)
    sides = [((corner, 0), (width - corner, 0)), ((width, corner), (width, height - corner)),
             ((width - corner, height), (corner, height)), ((0, height - corner), (0, corner))]  # fmt: skip
    arcs = [((0, corner), (far, far), (corner, 0)),
            ((width - corner, 0), (width - far, far), (width, corner)),
            ((width, height - corner), (width - far, height - far), (width - corner, height)),
            ((corner, height), (far, height - far), (0, height - corner))]  # fmt: skip
    edge = [stroke(0.1), node("layer", QuotedText("Edge.Cuts"))]
    nodes = [
        node("gr_line", node("start", *_board(start)), node("end", *_board(end)), *edge, uuid_node("edge", number))
        for number, (start, end) in enumerate(sides)
    ]
    nodes += [
        node("gr_arc", node("start", *_board(start)), node("mid", *_board(mid)), node("end", *_board(end)), *edge,
             uuid_node("corner", number))
        for number, (start, mid, end) in enumerate(arcs)
    ]  # fmt: skip
    return nodes


def _copper(design: BoardDesign, tracks: list[Track], vias: list[Via], numbers: dict[str, int]) -> list[Node]:
    nodes = [
        node("segment", node("start", *_board(track.start_mm)), node("end", *_board(track.end_mm)),
             node("width", track.width_mm), node("layer", QuotedText("F.Cu" if track.layer == 0 else "B.Cu")),
             node("net", numbers[track.net]), uuid_node(design.variant, "track", number))
        for number, track in enumerate(tracks)
    ]  # fmt: skip
    nodes += [
        node("via", node("at", *_board(via.at_mm)), node("size", via.size_mm), node("drill", via.drill_mm),
             node("layers", QuotedText("F.Cu"), QuotedText("B.Cu")), node("net", numbers[via.net]),
             uuid_node(design.variant, "via", number))
        for number, via in enumerate(vias)
    ]  # fmt: skip
    return nodes


def _polygon(points: list[tuple[float, float]]) -> Node:
    return node("polygon", node("pts", *(node("xy", *_board(point)) for point in points)))


def _pour(design: BoardDesign, pour: rules.Pour, number: int, priority: int, fills: list[Node]) -> Node:
    left, top, right, bottom = pour.corners_mm
    solid = ["yes"] if pour.is_solid else []
    return node(
        "zone", node("net", number), node("net_name", QuotedText(pour.net)), node("layer", QuotedText(pour.layer)),
        uuid_node(design.variant, "pour", pour.key), node("name", QuotedText(f"{pour.net} {pour.layer}")),
        node("hatch", "edge", 0.5), *([node("priority", priority)] if priority else []),
        node("connect_pads", *solid, node("clearance", rules.POUR_CLEARANCE_MM)),
        node("min_thickness", rules.POUR_MIN_MM), node("filled_areas_thickness", "no"),
        node("fill", "yes", node("thermal_gap", rules.THERMAL_GAP_MM),
             node("thermal_bridge_width", rules.THERMAL_SPOKE_MM)),
        _polygon([(left, top), (right, top), (right, bottom), (left, bottom)]), *fills,
    )  # fmt: skip


def _antenna(design: BoardDesign) -> Node:
    left, top, right, bottom = antenna_area()
    forbidden = [("tracks", "not_allowed"), ("vias", "not_allowed"), ("pads", "allowed"), ("copperpour", "not_allowed"),
                 ("footprints", "allowed")]  # fmt: skip
    return node(
        "zone", node("net", 0), node("net_name", QuotedText("")),
        node("layers", QuotedText("F.Cu"), QuotedText("B.Cu")),
        uuid_node(design.variant, "antenna"), node("name", QuotedText("antenna")), node("hatch", "edge", 0.5),
        node("connect_pads", node("clearance", 0)), node("min_thickness", 0.25), node("filled_areas_thickness", "no"),
        node("keepout", *(node(name, rule) for name, rule in forbidden)),
        node("fill", node("thermal_gap", 0.5), node("thermal_bridge_width", 0.5)),
        _polygon([(left, top), (right, top), (right, bottom), (left, bottom)]),
    )  # fmt: skip
