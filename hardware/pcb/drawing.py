"""Shapes as KiCad's nodes: pads, strokes, texts, for footprints and boards alike.

Invariant: angles of pads and texts are absolute on a board, so callers pass the part's angle.
"""

from hardware.pcb.ids import uuid_node
from hardware.pcb.sexp import Node, Text, node
from hardware.pcb.shapes import Circle, Footprint, Label, Line, Pad, PadKind, PadShape

_COPPER = {
    PadKind.SMD: ("F.Cu", "F.Mask", "F.Paste"),
    PadKind.THROUGH: ("*.Cu", "*.Mask"),
    PadKind.HOLE: ("*.Cu", "*.Mask"),
}
_CORNER_RATIO = 0.25


def text_effects(size: float, justify: str = "center", *, is_hidden: bool = False, is_bold: bool = False) -> list[Node]:
    """Return a text's font node (and what hides it); thickness is 15 % of the height."""
    font = node("font", node("size", size, size), node("thickness", round(size * (0.2 if is_bold else 0.15), 3)))
    effects = node("effects", font)
    if justify != "center":
        effects.append(node("justify", justify))
    return [node("hide", "yes"), effects] if is_hidden else [effects]


def pad_node(pad: Pad, angle: float, net: tuple[int, str] | None, ident: tuple[object, ...], copper: bool) -> Node:
    """Return a pad; test points have copper and mask but no paste."""
    layers = _COPPER[pad.kind] if copper else tuple(layer for layer in _COPPER[pad.kind] if layer != "F.Paste")
    result = node("pad", Text(pad.number), pad.kind.value, pad.shape.value)
    result.append(node("at", *pad.at_mm, *([angle] if angle else [])))
    result.append(node("size", *pad.size_mm))
    if pad.drill_mm:
        result.append(node("drill", pad.drill_mm))
    result.append(node("layers", *(Text(layer) for layer in layers)))
    if pad.kind is PadKind.THROUGH:
        result.append(node("remove_unused_layers", "no"))
    if pad.shape is PadShape.ROUND_RECT:
        result.append(node("roundrect_rratio", _CORNER_RATIO))
    if net is not None:
        result.append(node("net", net[0], Text(net[1])))
    result.append(uuid_node(*ident))
    return result


def stroke(width: float) -> Node:
    """Return a solid stroke."""
    return node("stroke", node("width", width), node("type", "solid"))


def shape_node(shape: Line | Circle | Label, prefix: str, angle: float, ident: tuple[object, ...]) -> Node:
    """Return a stroke, circle or text; `prefix` is fp (in a footprint) or gr (on the board)."""
    if isinstance(shape, Line):
        return node(
            f"{prefix}_line", node("start", *shape.start_mm), node("end", *shape.end_mm), stroke(shape.width_mm),
            node("layer", Text(shape.layer)), uuid_node(*ident),
        )  # fmt: skip
    if isinstance(shape, Circle):
        x, y = shape.center_mm
        return node(
            f"{prefix}_circle", node("center", x, y), node("end", x + shape.radius_mm, y), stroke(shape.width_mm),
            node("fill", "yes" if shape.is_filled else "no"), node("layer", Text(shape.layer)), uuid_node(*ident),
        )  # fmt: skip
    kind = ["user"] if prefix == "fp" else []
    at = node("at", *shape.at_mm, shape.angle_deg + angle)
    return node(
        f"{prefix}_text", *kind, Text(shape.text), at, node("layer", Text(shape.layer)), uuid_node(*ident),
        *text_effects(shape.size_mm, shape.justify),
    )  # fmt: skip


def footprint_attributes(footprint: Footprint, *, is_bought: bool) -> Node:
    """Return how the part is mounted and whether it is in the bill of materials."""
    words = ["smd"] if footprint.is_smd and footprint.pads else ["through_hole"]
    if not is_bought:
        words = ["exclude_from_pos_files", "exclude_from_bom"]
    return node("attr", *words)
