"""The gerbers read back by a library that is not KiCad's (gerbonara), and held against the design.

It is needed by checks only: a development dependency, imported late.
"""

import importlib.util
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.layout import rules
from hardware.pcb.layout.routing import Via, placed_pads
from hardware.pcb.layout.shapes import PadKind


@dataclass(frozen=True, slots=True, kw_only=True)
class GerberReading:
    """What an independent reader finds in a set of gerbers."""

    width_mm: float
    height_mm: float
    layers: tuple[str, ...]
    copper_layers: int
    plated: int
    unplated: int
    smallest_drill_mm: float
    #: Every hole: x and y from the upper left corner, and its diameter, millimetres.
    holes: frozenset[tuple[float, float, float]] = frozenset()


def is_installed() -> bool:
    """Tell whether gerbonara can be imported."""
    return importlib.util.find_spec("gerbonara") is not None


def read(files: dict[str, str]) -> GerberReading:
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
        drilled = [hole for layer in (plated, unplated) if layer for hole in layer.objects]
        holes = {_place(hole, left + pen / 2, top - pen / 2) for hole in drilled}
        return GerberReading(
            width_mm=round(right - left - pen, 3), height_mm=round(top - bottom - pen, 3),
            layers=tuple(sorted(" ".join(key) for key, layer in stack.graphic_layers.items() if layer is not None)),
            copper_layers=len(stack.copper_layers), plated=len(plated.objects) if plated else 0,
            unplated=len(unplated.objects) if unplated else 0,
            smallest_drill_mm=min((size for *_, size in holes), default=0.0), holes=frozenset(holes),
        )  # fmt: skip


def _place(hole: Any, left: float, top: float) -> tuple[float, float, float]:  # gerbonara has no types
    x, y, size = (hole.unit.convert_to("mm", value) for value in (hole.x, hole.y, hole.aperture.diameter))
    return round(x - left, 2), round(top - y, 2), round(size, 2)


def faults(design: BoardDesign, vias: list[Via], reading: GerberReading) -> list[str]:
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
    if reading.holes:
        drilled = {(*via.at_mm, via.drill_mm) for via in vias}
        drilled |= {(*pad.center_mm, pad.pad.drill_mm) for pad in pads if pad.pad.drill_mm}
        goal_holes = {(round(x, 2), round(y, 2), round(size, 2)) for x, y, size in drilled}
        found += [f"no hole of {size:g} mm at {x:g}, {y:g}" for x, y, size in sorted(goal_holes - reading.holes)]
        found += [f"a hole of {size:g} mm at {x:g}, {y:g}" for x, y, size in sorted(reading.holes - goal_holes)]
    missing = _LAYERS - set(reading.layers)
    return [*found, *(f"layer {layer} is missing" for layer in sorted(missing))]


_LAYERS = {"top copper", "bottom copper", "top mask", "bottom mask", "top silk", "top paste", "mechanical outline"}
