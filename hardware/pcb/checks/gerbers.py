"""The gerbers read back by a library that is not KiCad's (gerbonara), and held against the design.

It is needed by checks only: a development dependency, imported late.
"""

import importlib.util
import tempfile
from dataclasses import dataclass
from pathlib import Path

from hardware.pcb.circuit.netlist import Design
from hardware.pcb.layout import rules
from hardware.pcb.layout.routing import Via, placed_pads
from hardware.pcb.layout.shapes import PadKind


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """What an independent reader finds in a set of gerbers."""

    width_mm: float
    height_mm: float
    layers: tuple[str, ...]
    copper_layers: int
    plated: int
    unplated: int
    smallest_drill_mm: float


def is_installed() -> bool:
    """Tell whether gerbonara can be imported."""
    return importlib.util.find_spec("gerbonara") is not None


def read(files: dict[str, str]) -> Reading:
    """Read a set of gerber and drill files."""
    import warnings

    from gerbonara import LayerStack

    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        stack = LayerStack.open(Path(folder))
        outline = stack.outline
        (left, bottom), (right, top) = outline.bounding_box(unit="mm")
        pen = 0.1
        plated, unplated = stack.drill_pth, stack.drill_npth
        tools = [hole.aperture.diameter for layer in (plated, unplated) if layer for hole in layer.objects]
        return Reading(
            width_mm=round(right - left - pen, 3), height_mm=round(top - bottom - pen, 3),
            layers=tuple(sorted(" ".join(key) for key, layer in stack.graphic_layers.items() if layer is not None)),
            copper_layers=len(stack.copper_layers), plated=len(plated.objects) if plated else 0,
            unplated=len(unplated.objects) if unplated else 0, smallest_drill_mm=min(tools, default=0.0),
        )  # fmt: skip


def faults(design: Design, vias: list[Via], reading: Reading) -> list[str]:
    """Return where the gerbers differ from the design."""
    pads = placed_pads(design)
    plated = len(vias) + sum(pad.pad.kind is PadKind.THROUGH for pad in pads)
    holes = sum(pad.pad.kind is PadKind.HOLE for pad in pads)
    wanted = [
        ("width", reading.width_mm, rules.BOARD_WIDTH_MM), ("height", reading.height_mm, rules.BOARD_HEIGHT_MM),
        ("copper layers", reading.copper_layers, 2), ("plated holes", reading.plated, plated),
        ("holes without plating", reading.unplated, holes),
        ("smallest drill", round(reading.smallest_drill_mm, 3), min(via.drill_mm for via in vias)),
    ]  # fmt: skip
    found = [f"{name} is {value:g}, the design has {goal:g}" for name, value, goal in wanted if value != goal]
    missing = _LAYERS - set(reading.layers)
    return [*found, *(f"layer {layer} is missing" for layer in sorted(missing))]


_LAYERS = {"top copper", "bottom copper", "top mask", "bottom mask", "top silk", "top paste", "mechanical outline"}
