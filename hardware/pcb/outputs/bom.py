"""The bill of materials: rows, a CSV file and one interactive page.

The page is ours: a drawing of the board beside the list; a click on a row marks its
parts. It loads nothing from anywhere. Invariant: every bought component is in exactly one row, beside its accessories.
"""

import csv
import html
import io
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.parts import ACCESSORIES, Part
from hardware.pcb.layout import rules
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import place
from hardware.pcb.outputs.assembly import STYLE, board_svg

#: The interactive page, with @names@ where its contents go.
_PAGE = Path(__file__).parent / "bom_page.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class BomRow:
    """One line to order: a part and where it goes."""

    part: Part
    refs: tuple[str, ...]
    quantity: int


def rows(design: BoardDesign) -> list[BomRow]:
    """Return the bill of materials, the largest quantity last, references in natural order; accessories follow."""
    groups: dict[str, list[str]] = {}
    parts: dict[str, Part] = {}
    for component in design.components:
        if component.part.bought:
            groups.setdefault(component.part.key, []).append(component.ref)
            parts[component.part.key] = component.part
    found = [
        BomRow(part=parts[key], refs=tuple(sorted(refs, key=_natural)), quantity=len(refs))
        for key, refs in groups.items()
    ]
    found.sort(key=lambda row: (row.quantity, row.part.key))
    return found + [
        BomRow(part=part, refs=tuple(where.split()), quantity=quantity) for quantity, where, part in ACCESSORIES
    ]


def csv_text(design: BoardDesign) -> str:
    """Return the list as CSV."""
    head = [
        "Quantity",
        "References",
        "Value",
        "Footprint",
        "Manufacturer",
        "Part number",
        "Description",
        "Source",
        "Ask the distributor",
    ]
    return _csv(head, (
        [row.quantity, " ".join(row.refs), part.value, part.footprint, part.manufacturer, part.mpn, part.description,
         part.source, part.ask]
        for row in rows(design) for part in [row.part]
    ))  # fmt: skip


def placement_csv(design: BoardDesign) -> str:
    """Return centres of the surface parts for a placing machine: from the lower left corner, y up, millimetres."""
    places = place(design)
    return _csv(["Reference", "Value", "Footprint", "X mm", "Y mm", "Angle deg", "Side"], (
        [part.ref, part.part.value, part.part.footprint, f"{at.x_mm:.3f}", f"{rules.BOARD_HEIGHT_MM - at.y_mm:.3f}",
         f"{at.angle_deg:g}", "top"]
        for part in sorted(design.components, key=lambda part: _natural(part.ref))
        if part.part.bought and FOOTPRINTS[part.part.footprint].is_smd for at in [places[part.ref]]
    ))  # fmt: skip


def _csv(head: list[str], lines: Iterable[list[object]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([head, *lines])
    return out.getvalue()


def html_text(design: BoardDesign) -> str:
    """Return the interactive page."""
    lines = "".join(
        f'<tr data-refs="{" ".join(row.refs)}" data-part="{html.escape(row.part.key)}">'
        f'<td><input type="checkbox"></td><td>{row.quantity}</td>'
        f"<td>{' '.join(row.refs)}</td><td>{html.escape(row.part.value)}</td><td>{html.escape(row.part.footprint)}</td>"
        f"<td>{html.escape(row.part.manufacturer)}</td><td>{html.escape(row.part.mpn)}</td>"
        f"<td>{html.escape(row.part.description)}</td><td>{html.escape(row.part.ask)}</td></tr>\n"
        for row in rows(design)
    )
    page = _PAGE.read_text(encoding="utf-8")
    words = {
        "title": html.escape(design.title),
        "count": str(sum(row.quantity for row in rows(design))),
        "lines": str(len(rows(design))),
        "board": board_svg(design),
        "style": STYLE,
        "rows": lines,
    }
    for name, text in words.items():
        page = page.replace(f"@{name}@", text)
    return page


def _natural(ref: str) -> tuple[str, int]:
    found = re.fullmatch(r"([A-Z]+)(\d+)", ref)
    return (found[1], int(found[2])) if found else (ref, 0)
