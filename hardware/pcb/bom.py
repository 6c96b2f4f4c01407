"""The bill of materials: rows, a CSV file and one interactive page.

The page is ours: a drawing of the board beside the list; a click on a row marks its
parts. It loads nothing from anywhere. Invariant: every bought component is in exactly one row.
"""

import csv
import html
import io
import re
from dataclasses import dataclass
from pathlib import Path

from hardware.pcb import rules
from hardware.pcb.footprints import FOOTPRINTS
from hardware.pcb.netlist import Component, Design
from hardware.pcb.parts import Part
from hardware.pcb.placement import Place, place
from hardware.pcb.routing import placed_pads, turn
from hardware.pcb.shapes import Line, PadKind

#: The interactive page, with @names@ where its contents go.
_PAGE = Path(__file__).parent / "bom_page.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line to order: a part and where it goes."""

    part: Part
    refs: tuple[str, ...]


def rows(design: Design) -> list[Row]:
    """Return the bill of materials, the largest quantity last, references in natural order."""
    groups: dict[str, list[str]] = {}
    parts: dict[str, Part] = {}
    for component in design.components:
        if component.part.bought:
            groups.setdefault(component.part.key, []).append(component.ref)
            parts[component.part.key] = component.part
    found = [Row(part=parts[key], refs=tuple(sorted(refs, key=_natural))) for key, refs in groups.items()]
    return sorted(found, key=lambda row: (len(row.refs), row.part.key))


def csv_text(design: Design) -> str:
    """Return the list as CSV."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["Quantity", "References", "Value", "Footprint", "Manufacturer", "Part number", "Description"])
    for row in rows(design):
        part = row.part
        writer.writerow([len(row.refs), " ".join(row.refs), part.value, part.footprint, part.manufacturer, part.mpn,
                         part.description])  # fmt: skip
    return out.getvalue()


def placement_csv(design: Design) -> str:
    """Return centres of the surface parts for a placing machine: from the lower left corner, y up, millimetres."""
    places = place(design)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["Reference", "Value", "Footprint", "X mm", "Y mm", "Angle deg", "Side"])
    for component in sorted(design.components, key=lambda part: _natural(part.ref)):
        if component.part.bought and FOOTPRINTS[component.part.footprint].is_smd:
            at = places[component.ref]
            writer.writerow([component.ref, component.part.value, component.part.footprint, f"{at.x_mm:.3f}",
                             f"{rules.BOARD_HEIGHT_MM - at.y_mm:.3f}", f"{at.angle_deg:g}", "top"])  # fmt: skip
    return out.getvalue()


def html_text(design: Design) -> str:
    """Return the interactive page."""
    lines = "".join(
        f'<tr data-refs="{" ".join(row.refs)}"><td><input type="checkbox"></td><td>{len(row.refs)}</td>'
        f"<td>{' '.join(row.refs)}</td><td>{html.escape(row.part.value)}</td><td>{html.escape(row.part.footprint)}</td>"
        f"<td>{html.escape(row.part.manufacturer)}</td><td>{html.escape(row.part.mpn)}</td>"
        f"<td>{html.escape(row.part.description)}</td></tr>\n"
        for row in rows(design)
    )
    page = _PAGE.read_text(encoding="utf-8")
    words = {
        "title": html.escape(design.title),
        "count": str(sum(len(row.refs) for row in rows(design))),
        "lines": str(len(rows(design))),
        "board": board_svg(design),
        "rows": lines,
    }
    for name, text in words.items():
        page = page.replace(f"@{name}@", text)
    return page


def board_svg(design: Design) -> str:
    """Return a drawing of the board's top side: outline, bodies, pads and references."""
    width, height = rules.BOARD_WIDTH_MM, rules.BOARD_HEIGHT_MM
    places = place(design)
    out = [f'<svg viewBox="-2 -2 {width + 4:g} {height + 4:g}" xmlns="http://www.w3.org/2000/svg">',
           f'<rect class="edge" width="{width:g}" height="{height:g}" rx="{rules.CORNER_MM:g}"/>']  # fmt: skip
    pads = placed_pads(design)
    for component in design.components:
        body = _body_mm(component, places[component.ref])
        out.append(
            f'<g class="part" id="{component.ref}"><title>{component.ref} {html.escape(component.part.value)}</title>'
        )
        if body:
            out.append(_rect("body", body))
        for pad in (pad for pad in pads if pad.ref == component.ref):
            x0, y0, x1, y1 = pad.box_mm
            kind = "hole" if pad.pad.kind is PadKind.HOLE else "pad"
            radius = min(x1 - x0, y1 - y0) / 2 if pad.pad.kind is not PadKind.SMD else 0.1
            out.append(_rect(kind, pad.box_mm, f' rx="{radius:.2f}"'))
        if body:
            left, top, right, bottom = body
            size = 1.0 if right - left < 8 else 2.2
            x, y = (left + right) / 2, (top + bottom) / 2 + size / 3
            out.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size:g}">{component.ref}</text>')
        out.append("</g>")
    out.append("</svg>")
    return "\n".join(out)


def _body_mm(component: Component, at: Place) -> tuple[float, float, float, float] | None:
    """Return the box around a part's drawn body: left, top, right, bottom; None where nothing is drawn."""
    ends = [
        turn(point, at)
        for shape in FOOTPRINTS[component.part.footprint].drawings
        if isinstance(shape, Line) and shape.layer == "F.Fab"
        for point in (shape.start_mm, shape.end_mm)
    ]
    if not ends:
        return None
    across, down = [x for x, _ in ends], [y for _, y in ends]
    return min(across), min(down), max(across), max(down)


def _rect(kind: str, box_mm: tuple[float, float, float, float], more: str = "") -> str:
    x0, y0, x1, y1 = box_mm
    return f'<rect class="{kind}" x="{x0:.2f}" y="{y0:.2f}" width="{x1 - x0:.2f}" height="{y1 - y0:.2f}"{more}/>'


def _natural(ref: str) -> tuple[str, int]:
    found = re.fullmatch(r"([A-Z]+)(\d+)", ref)
    return (found[1], int(found[2])) if found else (ref, 0)
