"""Bodies for the 3D picture: boxes in VRML, drawn from the footprints' own measures.

Not here: mechanical models to build a case by; the heights are nominal.
"""

from hardware.pcb.shapes import Box, Footprint

#: KiCad's VRML unit: a tenth of an inch.
_UNIT_MM = 2.54


def model_text(footprint: Footprint) -> str:
    """Return the .wrl file of a footprint; y points up there."""
    return "#VRML V2.0 utf8\n" + "".join(_box(box) for box in footprint.boxes)


def _box(box: Box) -> str:
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
