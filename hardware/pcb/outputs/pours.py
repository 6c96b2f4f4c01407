"""The filled shape of the pours, asked of KiCad, and the stitching vias between the two grounds.

KiCad's filler is the one part of the board that is not computed here. Its polygons are
never committed (two megabytes that a build renews in seconds); which stitching places
meet ground on both sides is, in stitches/VARIANT.txt, so that the board's file needs no
KiCad. `make board` fills again and compares.
"""

import shutil
import subprocess
import tempfile
from math import floor
from pathlib import Path

from hardware.pcb.layout import rules
from hardware.pcb.layout.routing import HERE, RoutingError, Via, read_lines
from hardware.pcb.outputs.board import ORIGIN_MM
from hardware.pcb.outputs.read_places import point
from hardware.pcb.outputs.sexp import Node, child, children, parse, word
from simbase.errors import MissingDependencyError

#: Runs in the system's Python: KiCad installs its module there and nowhere else.
_SCRIPT = """
import sys
try:
    import pcbnew
except ImportError:
    sys.exit(77)
board = pcbnew.LoadBoard(sys.argv[1])
pcbnew.ZONE_FILLER(board).Fill(board.Zones())
half = int(sys.argv[3])
for zone in board.Zones():
    for layer in zone.GetLayerSet().Seq() if half and not zone.GetIsRuleArea() else ():
        shape = pcbnew.SHAPE_POLY_SET(zone.GetFilledPolysList(layer))
        closed = pcbnew.SHAPE_POLY_SET(shape)
        closed.Inflate(half, pcbnew.CORNER_STRATEGY_ROUND_ALL_CORNERS, 5000)
        # A little further back, so that only what was closed is new.
        closed.Deflate(half + 6000, pcbnew.CORNER_STRATEGY_ROUND_ALL_CORNERS, 5000)
        for area in board.Zones():
            if area.GetIsRuleArea():
                closed.BooleanSubtract(area.Outline())
        shape.BooleanAdd(closed)
        shape.Fracture()
        zone.SetFilledPolysList(layer, shape)
board.Save(sys.argv[2])
"""
#: Where KiCad prunes a neck of a pour, two round ends may face each other at a hundredth of a millimetre: no maker
#: etches that, and some ask. Gaps of a pour with itself below this are closed.
SLIT_MM = 0.1
#: The exit code of a Python without the module.
_LACKS_MODULE = 77
_LIMIT_S = 300
#: Where that Python stands: Debian's, else the first of the PATH.
_PYTHONS = ("/usr/bin/python3", shutil.which("python3"))
LAYERS = ("F.Cu", "B.Cu")


def fill(board_text: str) -> dict[str, list[Node]]:
    """Return the filled polygons of a board by area, computed by KiCad.

    Raises:
        MissingDependencyError: No Python has KiCad's module.
        RoutingError: KiCad could not read the board.
    """
    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder) / "before.kicad_pcb", Path(folder) / "after.kicad_pcb"
        before.write_text(board_text, encoding="utf-8")
        for python in _PYTHONS:
            if not python or not Path(python).exists():
                continue
            command = [python, "-c", _SCRIPT, str(before), str(after), str(round(SLIT_MM / 2 * 1e6))]
            done = subprocess.run(command, capture_output=True, text=True, timeout=_LIMIT_S, check=False)
            if done.returncode == _LACKS_MODULE:
                continue
            if done.returncode != 0 or not after.exists():
                raise RoutingError(f"KiCad could not fill the pours: {done.stderr.strip()[-300:]}")
            return _polygons(after.read_text(encoding="utf-8"))
    raise MissingDependencyError("KiCad's Python module is not installed", hint="tools/install_board_tools.sh")


def kept_stitches(vias: list[Via], pours: dict[str, list[Node]]) -> list[Via]:
    """Return the stitching vias whose whole ring lies in a pour on both sides.

    Args:
        vias: Places that the router found free.
        pours: The pours as filled without any stitching via, so that no island hangs on one.
    """
    shapes = {layer: [_rows_of(_points(polygon)) for polygon in pours.get(f"GND:{layer}", [])] for layer in LAYERS}
    kept = []
    for via in vias:
        x, y = (round(at + origin, 6) for at, origin in zip(via.at_mm, ORIGIN_MM, strict=True))
        ring = [(x + via.size_mm / 2 * dx, y + via.size_mm / 2 * dy) for dx, dy in _RING]
        if all(any(all(_is_inside(point, shape) for point in ring) for shape in shapes[layer]) for layer in LAYERS):
            kept.append(via)
    return kept


def stitches_text(stitches: list[Via]) -> str:
    """Return the text of a file of stitching vias: one a line, nanometres from the board's corner."""
    return "".join(f"{round(via.at_mm[0] * 1e6)},{round(via.at_mm[1] * 1e6)}\n" for via in stitches)


def load_stitches(variant: str, path: Path | None = None) -> list[Via]:
    """Read the committed stitching vias of a variant.

    Raises:
        RoutingError: The file is missing or broken.
    """
    stitches = []
    for count, line in enumerate(read_lines(path or HERE / "stitches" / f"{variant}.txt", "stitch"), start=1):
        try:
            x, y = (int(word) for word in line.split(","))
        except ValueError as error:
            raise RoutingError(f"stitches of {variant}, line {count}: no place of a via") from error
        stitches.append(stitch_at(x * 1e-6, y * 1e-6))
    return stitches


def stitch_at(x_mm: float, y_mm: float) -> Via:
    """Return a stitching via at a place of the board."""
    size, drill = rules.POWER.via_mm, rules.POWER.via_drill_mm
    return Via(net="GND", at_mm=(round(x_mm, 3), round(y_mm, 3)), size_mm=size, drill_mm=drill, is_stitch=True)


def _rows_of(shape: list[tuple[float, float]]) -> dict[int, list[tuple[float, ...]]]:
    """Return a polygon's sides, x0 y0 x1 y1, by the millimetres of y that they touch."""
    rows: dict[int, list[tuple[float, ...]]] = {}
    for one, other in zip(shape, shape[1:] + shape[:1], strict=True):
        for row in range(floor(min(one[1], other[1])), floor(max(one[1], other[1])) + 1):
            rows.setdefault(row, []).append((*one, *other))
    return rows


def _is_inside(point: tuple[float, float], shape: dict[int, list[tuple[float, ...]]]) -> bool:
    """Tell whether a point lies in a polygon: an odd number of its sides pass to the right."""
    x, y = point
    inside = False
    for x0, y0, x1, y1 in shape.get(floor(y), ()):
        if (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0:
            inside = not inside
    return inside


#: Eight points of a ring's rim, and its middle.
_RING = ((0, 0), (1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7), (-1, 0), (-0.7, -0.7), (0, -1), (0.7, -0.7))


def _polygons(text: str) -> dict[str, list[Node]]:
    pours: dict[str, list[Node]] = {}
    for zone in children(parse(text), "zone"):
        for polygon in children(zone, "filled_polygon"):
            key = f"{word(child(zone, 'net_name'))}:{word(child(polygon, 'layer'))}"
            pours.setdefault(key, []).append(polygon)
    return pours


def _points(polygon: Node) -> list[tuple[float, float]]:
    return [point(xy) for xy in children(child(polygon, "pts"), "xy")]
