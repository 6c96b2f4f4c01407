"""The assembly drawing as SVG: the board's top side with bodies, pads, marks and references.

The page of the bill of materials shows the same drawing. Not here: copper tracks.
Invariant: same design, same bytes.
"""

import html
from collections.abc import Iterator

from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.layout import rules
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import Placement, place, silk_labels, unturn
from hardware.pcb.layout.routing import PlacedPad, placed_pads, turn
from hardware.pcb.layout.shapes import Circle, Label, PadKind, StraightStroke

#: Colours and strokes; the page of the bill of materials adds the marked states to them.
STYLE = """
.edge{fill:#eef3ec;stroke:#3d5a3d;stroke-width:.3} .body{fill:#fff;fill-opacity:.6;stroke:none}
.fab{stroke:#56606b;stroke-width:.1;fill:none} .silk{stroke:#25303c;stroke-width:.14;fill:none}
.dot{fill:#25303c} .pad{fill:#c9a227} .hole{fill:#fff;stroke:#56606b;stroke-width:.12}
text{fill:#25303c;font-family:sans-serif} .ref{font-weight:bold;fill:#1c4f9c}
"""
_LAYER_CLASS = {"F.Fab": "fab", "F.SilkS": "silk"}
_ANCHOR = {"left": "start", "center": "middle", "right": "end"}


def assembly_svg(design: BoardDesign) -> str:
    """Return the drawing as a file of its own, with a title line below the board."""
    title = html.escape(f"{design.title}: assembly, top side, {rules.BOARD_WIDTH_MM:g} x {rules.BOARD_HEIGHT_MM:g} mm")
    caption = f'<text x="0" y="{rules.BOARD_HEIGHT_MM + 5:g}" font-size="2.6">{title}</text>'
    return board_svg(design, head=f"<style>{STYLE}</style>", tail=caption) + "\n"


def board_svg(design: BoardDesign, head: str = "", tail: str = "") -> str:
    """Return the drawing; each part is a group with its reference as identifier.

    Args:
        design: A variant with a board.
        head: What goes before the board, a style sheet for instance.
        tail: What goes after it.
    """
    width, height = rules.BOARD_WIDTH_MM, rules.BOARD_HEIGHT_MM
    bottom = height + (10 if tail else 9)
    out = [
        f'<svg viewBox="-2 -2 {width + 4:g} {bottom:g}" xmlns="http://www.w3.org/2000/svg">{head}',
        f'<rect class="edge" width="{width:g}" height="{height:g}" rx="{rules.CORNER_MM:g}"/>',
    ]
    places, pads = place(design), placed_pads(design)
    for component in design.components:
        title = html.escape(f"{component.ref} {component.part.value}")
        out.append(f'<g class="part" id="{component.ref}"><title>{title}</title>')
        out += _part(component, places[component.ref], [pad for pad in pads if pad.ref == component.ref])
        out.append("</g>")
    out += [_text(label.text, label.at_mm, label) for label in silk_labels(design)]
    return "\n".join([*out, tail, "</svg>"])


def _part(component: Component, at: Placement, pads: list[PlacedPad]) -> Iterator[str]:
    footprint = FOOTPRINTS[component.part.footprint]
    body = body_mm(component, at)
    if body:
        yield _rect("body", body)
    for pad in pads:
        x0, y0, x1, y1 = pad.box_mm
        radius = min(x1 - x0, y1 - y0) / 2 if pad.pad.kind is not PadKind.SMD else 0.1
        yield _rect("hole" if pad.pad.kind is PadKind.HOLE else "pad", pad.box_mm, f' rx="{radius:.2f}"')
    for shape in footprint.drawings:
        if shape.layer not in _LAYER_CLASS:
            continue
        if isinstance(shape, StraightStroke):
            (x0, y0), (x1, y1) = turn(shape.start_mm, at), turn(shape.end_mm, at)
            kind = _LAYER_CLASS[shape.layer]
            yield f'<line class="{kind}" x1="{x0:.2f}" y1="{y0:.2f}" x2="{x1:.2f}" y2="{y1:.2f}"/>'
        elif isinstance(shape, Circle):
            x, y = turn(shape.center_mm, at)
            kind = "dot" if shape.is_filled else _LAYER_CLASS[shape.layer]
            yield f'<circle class="{kind}" cx="{x:.2f}" cy="{y:.2f}" r="{shape.radius_mm:.2f}"/>'
        else:
            yield _text(shape.text, turn(shape.at_mm, at), shape)
    if component.ref.startswith(("H", "TP")):
        if component.label:
            mark = Label(layer="F.SilkS", text=component.label, at_mm=(0, 0))
            yield _text(component.label, turn(footprint.ref_at_mm, at), mark)
        return
    offset = footprint.ref_at_mm if at.ref_mm is None else unturn(at.ref_mm, at.angle_deg)
    yield _text(component.ref, turn(offset, at), Label(layer="F.SilkS", text="", at_mm=(0, 0), size_mm=0.9), "ref")


def body_mm(component: Component, at: Placement) -> tuple[float, float, float, float] | None:
    """Return the box around a part's drawn body: left, top, right, bottom; None where nothing is drawn."""
    ends = [
        turn(point, at)
        for shape in FOOTPRINTS[component.part.footprint].drawings
        if isinstance(shape, StraightStroke) and shape.layer == "F.Fab"
        for point in (shape.start_mm, shape.end_mm)
    ]
    if not ends:
        return None
    across, down = [x for x, _ in ends], [y for _, y in ends]
    return min(across), min(down), max(across), max(down)


def _rect(kind: str, box_mm: tuple[float, float, float, float], more: str = "") -> str:
    x0, y0, x1, y1 = box_mm
    return f'<rect class="{kind}" x="{x0:.2f}" y="{y0:.2f}" width="{x1 - x0:.2f}" height="{y1 - y0:.2f}"{more}/>'


def _text(text: str, at_mm: tuple[float, float], label: Label, kind: str = "mark") -> str:
    # KiCad's letters stand around their position; SVG's stand on it.
    x, y = at_mm[0], at_mm[1] + 0.36 * label.size_mm
    turned = f' transform="rotate({-label.angle_deg:g} {at_mm[0]:.2f} {at_mm[1]:.2f})"' if label.angle_deg else ""
    return (
        f'<text class="{kind}" x="{x:.2f}" y="{y:.2f}" font-size="{1.15 * label.size_mm:.2f}" '
        f'text-anchor="{_ANCHOR[label.justify]}"{turned}>{html.escape(text)}</text>'
    )
