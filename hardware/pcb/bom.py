"""The bill of materials: rows, a CSV file and one interactive page.

The page is ours: a drawing of the board beside the list; a click on a row marks its
parts. It loads nothing from anywhere. Invariant: every bought component is in exactly one row.
"""

import csv
import html
import io
import re
from dataclasses import dataclass

from hardware.pcb import rules
from hardware.pcb.footprints import FOOTPRINTS
from hardware.pcb.netlist import Design
from hardware.pcb.parts import Part
from hardware.pcb.placement import place
from hardware.pcb.routing import placed_pads, turn
from hardware.pcb.shapes import Line, PadKind


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
    return _PAGE.format(
        title=html.escape(design.title), count=sum(len(row.refs) for row in rows(design)), lines=len(rows(design)),
        board=board_svg(design), rows=lines,
    )  # fmt: skip


def board_svg(design: Design) -> str:
    """Return a drawing of the board's top side: outline, bodies, pads and references."""
    width, height = rules.BOARD_WIDTH_MM, rules.BOARD_HEIGHT_MM
    places = place(design)
    out = [f'<svg viewBox="-2 -2 {width + 4:g} {height + 4:g}" xmlns="http://www.w3.org/2000/svg">',
           f'<rect class="edge" width="{width:g}" height="{height:g}" rx="{rules.CORNER_MM:g}"/>']  # fmt: skip
    pads = placed_pads(design)
    for component in design.components:
        at = places[component.ref]
        ends = [turn(point, at) for shape in FOOTPRINTS[component.part.footprint].drawings
                if isinstance(shape, Line) and shape.layer == "F.Fab" for point in (shape.start_mm, shape.end_mm)]  # fmt: skip
        out.append(
            f'<g class="part" id="{component.ref}"><title>{component.ref} {html.escape(component.part.value)}</title>'
        )
        if ends:
            left, top = min(x for x, _ in ends), min(y for _, y in ends)
            right, bottom = max(x for x, _ in ends), max(y for _, y in ends)
            out.append(
                f'<rect class="body" x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" height="{bottom - top:.2f}"/>'
            )
        for pad in (pad for pad in pads if pad.ref == component.ref):
            x0, y0, x1, y1 = pad.box_mm
            kind = "hole" if pad.pad.kind is PadKind.HOLE else "pad"
            radius = min(x1 - x0, y1 - y0) / 2 if pad.pad.kind is not PadKind.SMD else 0.1
            out.append(
                f'<rect class="{kind}" x="{x0:.2f}" y="{y0:.2f}" width="{x1 - x0:.2f}" height="{y1 - y0:.2f}" rx="{radius:.2f}"/>'
            )
        if ends:
            size = 1.0 if right - left < 8 else 2.2
            out.append(
                f'<text x="{(left + right) / 2:.2f}" y="{(top + bottom) / 2 + size / 3:.2f}" font-size="{size:g}">{component.ref}</text>'
            )
        out.append("</g>")
    out.append("</svg>")
    return "\n".join(out)


def _natural(ref: str) -> tuple[str, int]:
    found = re.fullmatch(r"([A-Z]+)(\d+)", ref)
    return (found[1], int(found[2])) if found else (ref, 0)


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}: bill of materials</title><style>
body{{font:14px/1.35 system-ui,sans-serif;margin:0;display:flex;flex-wrap:wrap;color:#1b2430;background:#f6f7f9}}
figure{{margin:0;flex:1 1 420px;max-width:760px;position:sticky;top:0;align-self:flex-start}}
main{{flex:2 1 560px;padding:12px;overflow-x:auto}} h1{{font-size:19px;margin:4px 0}}
table{{border-collapse:collapse;background:#fff;width:100%}} td,th{{padding:4px 7px;border-bottom:1px solid #dde3ea;text-align:left}}
tr{{cursor:pointer}} tr:hover{{background:#eef4ff}} tr.on{{background:#ffe9b8}} tr.done td{{color:#8a94a0;text-decoration:line-through}}
.edge{{fill:#e9f0e6;stroke:#3d5a3d;stroke-width:.3}} .body{{fill:#fff;fill-opacity:.55;stroke:#56606b;stroke-width:.12}}
.pad{{fill:#c9a227}} .hole{{fill:#fff;stroke:#56606b;stroke-width:.12}} text{{text-anchor:middle;fill:#25303c;font-family:sans-serif}}
.part.on .body{{fill:#ff9d2e;fill-opacity:.85}} .part.on .pad{{fill:#d62f2f}}
</style></head><body><figure>{board}</figure><main><h1>{title}: bill of materials</h1>
<p>{count} parts in {lines} lines. Click a row to see its parts on the board; tick what is soldered (kept in this browser).
Part numbers are proposals: compare each with its data sheet before ordering. No board has been made from this design yet.</p>
<table><thead><tr><th></th><th>Qty</th><th>References</th><th>Value</th><th>Footprint</th><th>Manufacturer</th><th>Part number</th>
<th>Description</th></tr></thead><tbody>
{rows}</tbody></table></main><script>
const key = document.title;
let done = {{}};
try {{ done = JSON.parse(localStorage.getItem(key) || "{{}}"); }} catch (error) {{ done = {{}}; }}
for (const row of document.querySelectorAll("tbody tr")) {{
  const box = row.querySelector("input"), refs = row.dataset.refs;
  const show = () => row.classList.toggle("done", box.checked);
  box.checked = Boolean(done[refs]); show();
  box.addEventListener("click", event => {{
    event.stopPropagation(); done[refs] = box.checked; show();
    try {{ localStorage.setItem(key, JSON.stringify(done)); }} catch (error) {{ /* private mode: not kept */ }}
  }});
  row.addEventListener("click", () => {{
    const on = !row.classList.contains("on");
    for (const one of document.querySelectorAll(".on")) one.classList.remove("on");
    if (!on) return;
    row.classList.add("on");
    for (const ref of refs.split(" ")) document.getElementById(ref)?.classList.add("on");
  }});
}}
</script></body></html>
"""
