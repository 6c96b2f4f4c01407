"""Files around schematic and board: design rules, net classes, library tables, and bodies for the 3D picture.

No check has another severity than KiCad's own. Bodies are boxes in
VRML, drawn from the footprints' own measures: no mechanical models to build a case by,
for the heights are nominal.

Invariant: same design, same bytes.
"""

import json

from hardware.pcb.circuit.netlist import POWER_NETS, BoardDesign
from hardware.pcb.layout import rules
from hardware.pcb.layout.shapes import PartBox, PartFootprint

#: KiCad's VRML unit: a tenth of an inch.
_UNIT_MM = 2.54


def project_text(design: BoardDesign) -> str:
    """Return the .kicad_pro file of a variant."""
    settings = {
        "board": {
            "design_settings": {
                "defaults": {"silk_text_size_h": 0.8, "silk_text_size_v": 0.8, "silk_text_thickness": 0.12},
                "rules": {
                    "min_clearance": rules.SIGNAL.clearance_mm,
                    "min_copper_edge_clearance": rules.EDGE_CLEARANCE_MM,
                    "min_hole_clearance": 0.25,
                    "min_hole_to_hole": 0.25,
                    # One spoke is enough: every ground pad has its 0.8 mm track besides the pour.
                    "min_resolved_spokes": 1,
                    "min_silk_clearance": 0.0,
                    "min_text_height": 0.8,
                    "min_text_thickness": 0.1,
                    "min_through_hole_diameter": rules.SIGNAL.via_drill_mm,
                    "min_track_width": rules.SIGNAL.track_mm,
                    "min_via_annular_width": 0.13,
                    "min_via_diameter": rules.SIGNAL.via_mm,
                    "solder_mask_to_copper_clearance": 0.0,
                },
                "rule_severities": {},
            }
        },
        "erc": {"rule_severities": {}},
        "meta": {"filename": f"{design.variant}.kicad_pro", "version": 3},
        "net_settings": {
            "classes": [_class(entry, index) for index, entry in enumerate(rules.NET_CLASSES)],
            "meta": {"version": 4},
            "netclass_patterns": [
                {"netclass": rules.POWER.name, "pattern": net} for net in design.nets() if net in POWER_NETS
            ],
        },
        "pcbnew": {"page_layout_descr_file": ""},
        "schematic": {"legacy_lib_dir": "", "legacy_lib_list": [], "page_layout_descr_file": ""},
        "sheets": [],
        "text_variables": {},
    }
    return json.dumps(settings, indent=2, sort_keys=True) + "\n"


def library_tables() -> dict[str, str]:
    """Return the tables that lead KiCad to our symbols and footprints, by file name."""
    rows = {"sym_lib_table": ("sym-lib-table", "adapter.kicad_sym"), "fp_lib_table": ("fp-lib-table", "adapter.pretty")}
    return {
        file: f'({table}\n  (version 7)\n  (lib (name "adapter")(type "KiCad")'
        f'(uri "${{KIPRJMOD}}/../library/{target}")(options "")(descr "drawn by hardware/pcb"))\n)\n'
        for table, (file, target) in rows.items()
    }  # fmt: skip


def model_text(footprint: PartFootprint) -> str:
    """Return the .wrl file of a footprint; y points up there."""
    return "#VRML V2.0 utf8\n" + "".join(_box(box) for box in footprint.boxes)


def _class(entry: rules.NetClass, priority: int) -> dict[str, object]:
    return {
        "name": entry.name, "clearance": entry.clearance_mm, "track_width": entry.track_mm,
        "via_diameter": entry.via_mm, "via_drill": entry.via_drill_mm, "microvia_diameter": 0.3, "microvia_drill": 0.1,
        "diff_pair_width": 0.25, "diff_pair_gap": 0.25, "wire_width": 6, "bus_width": 12, "line_style": 0,
        "pcb_color": "rgba(0, 0, 0, 0.000)", "schematic_color": "rgba(0, 0, 0, 0.000)",
        "priority": 2147483647 if entry is rules.SIGNAL else priority,
    }  # fmt: skip


def _box(box: PartBox) -> str:
    low, high = box.z_mm
    x, y = box.center_mm
    centre = " ".join(f"{value / _UNIT_MM:.4f}" for value in (x, -y, (low + high) / 2))
    size = " ".join(f"{value / _UNIT_MM:.4f}" for value in (*box.size_mm, high - low))
    colour = " ".join(f"{value:g}" for value in box.colour)
    return (
        f"Transform {{ translation {centre} children Shape {{\n"
        f"  appearance Appearance {{ material Material {{ diffuseColor {colour} specularColor 0.1 0.1 0.1 }} }}\n"
        f"  geometry Box {{ size {size} }} }} }}\n"
    )
