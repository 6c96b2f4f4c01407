"""The router's input, its run, and its result as data: tracks and vias in routes/*.txt.

A build reads the committed result; only `python -m hardware.pcb route` needs a C++17
compiler. Invariant: a result is used only with the placement that it was made for
(its first line carries a hash of the router's input).
"""

import hashlib
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from math import cos, radians, sin
from pathlib import Path

from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.layout import rules
from hardware.pcb.layout.footprints import ANTENNA_AREA_MM, FOOTPRINTS
from hardware.pcb.layout.placement import ESP32_AT_MM, Placement, place
from hardware.pcb.layout.shapes import Pad, PadKind
from simbase.errors import P2osError

HERE = Path(__file__).parents[1]
#: A screw's head and its washer: no track below.
SCREW_RADIUS_MM = 3.3


class RoutingError(P2osError):
    """A routing result is missing, is stale or cannot be read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """A straight piece of copper; layer 0 is the top, 1 the bottom."""

    net: str
    layer: int
    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    width_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Via:
    """A plated hole between both layers."""

    net: str
    at_mm: tuple[float, float]
    size_mm: float
    drill_mm: float
    #: Only joins the two ground pours; pours.py keeps those that meet copper on both sides.
    is_stitch: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedPad:
    """A pad on the board: its net and its box."""

    ref: str
    pad: Pad
    net: str | None
    center_mm: tuple[float, float]
    #: left, top, right, bottom
    box_mm: tuple[float, float, float, float]

    @property
    def layers(self) -> int:
        """Return the layers with copper: 1 the top, 2 the bottom, 3 both."""
        return 1 if self.pad.kind is PadKind.SMD else 3


def placed_pads(design: BoardDesign) -> list[PlacedPad]:
    """Return every pad of the board in board coordinates, parts in the design's order."""
    places = place(design)
    found = []
    for component in design.components:
        nets = dict(component.pins)
        for pad in FOOTPRINTS[component.part.footprint].pads:
            at = places[component.ref]
            x, y = turn(pad.at_mm, at)
            width, height = pad.size_mm if at.angle_deg % 180 == 0 else (pad.size_mm[1], pad.size_mm[0])
            box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
            found.append(PlacedPad(ref=component.ref, pad=pad, net=nets.get(pad.number), center_mm=(x, y), box_mm=box))
    return found


def turn(point: tuple[float, float], at: Placement) -> tuple[float, float]:
    """Return a point of a footprint in board coordinates; angles turn counter-clockwise as seen."""
    angle = radians(at.angle_deg)
    x, y = point
    return (round(at.x_mm + x * cos(angle) + y * sin(angle), 6), round(at.y_mm - x * sin(angle) + y * cos(angle), 6))


def antenna_area() -> tuple[float, float, float, float]:
    """Return the area without copper under the ESP32's antenna, in board coordinates, up to the board's edge."""
    left, top, right, bottom = ANTENNA_AREA_MM
    x, y = ESP32_AT_MM
    return (x + left, max(0.0, y + top), x + right, y + bottom)


def router_input(design: BoardDesign) -> str:
    """Return the text that the router reads."""
    nets = sorted(design.nets())
    index = {net: number for number, net in enumerate(nets)}
    lines = [f"board {rules.ROUTE_GRID_MM} {rules.BOARD_WIDTH_MM} {rules.BOARD_HEIGHT_MM} {rules.EDGE_CLEARANCE_MM}"]
    lines.append(f"classes {len(rules.NET_CLASSES)}")
    lines += [f"{c.track_mm} {c.clearance_mm} {c.via_mm} {c.via_drill_mm}" for c in rules.NET_CLASSES]
    lines.append(f"nets {len(nets)}")
    lines += [f"{net} {rules.NET_CLASSES.index(rules.net_class(net))}" for net in nets]
    pads = placed_pads(design)
    lines.append(f"pads {len(pads)}")
    for pad in pads:
        box = pad.box_mm
        if pad.pad.kind is PadKind.HOLE:
            x, y = pad.center_mm
            box = (x - SCREW_RADIUS_MM, y - SCREW_RADIUS_MM, x + SCREW_RADIUS_MM, y + SCREW_RADIUS_MM)
        lines.append(f"{-1 if pad.net is None else index[pad.net]} {pad.layers} " + " ".join(f"{v:.4f}" for v in box))
    lines += ["keepouts 1", " ".join(f"{value:.4f}" for value in antenna_area())]
    lines.append(f"stitch GND {rules.STITCH_PITCH_MM}")
    return "\n".join(lines) + "\n"


def fingerprint(design: BoardDesign) -> str:
    """Return the hash that ties a routing result to placement, nets and rules."""
    return hashlib.sha256(router_input(design).encode()).hexdigest()[:16]


def run_router(design: BoardDesign) -> str:
    """Compile and run the router; return the text for routes/VARIANT.txt.

    Raises:
        RoutingError: There is no compiler, or the router found no way.
    """
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        raise RoutingError("no C++ compiler found", hint="apt-get install g++")
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "router"
        source = HERE / "router" / "router.cpp"
        flags = ("-std=c++17", "-O2", "-ffp-contract=off", "-Wall", "-Wextra")
        command = [compiler, *flags, str(source), "-o", str(program)]
        built = subprocess.run(command, capture_output=True, text=True, check=False)
        if built.returncode != 0:
            raise RoutingError(f"the router does not compile:\n{built.stderr}")
        ran = subprocess.run([str(program)], input=router_input(design), capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        raise RoutingError("the router found no way:\n" + "\n".join(ran.stderr.splitlines()[-12:]))
    return f"# input {fingerprint(design)}\n{ran.stdout}"


def read_lines(file: Path, verb: str) -> list[str]:
    """Return the lines of a committed result of a verb of `python -m hardware.pcb`.

    Raises:
        RoutingError: It cannot be read.
    """
    try:
        return file.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        hint = f"python -m hardware.pcb {verb}"
        raise RoutingError(f"cannot read {file.name}: {error.strerror}", hint=hint) from error


def load_routes(design: BoardDesign, path: Path | None = None) -> tuple[list[Track], list[Via]]:
    """Read the committed routing of a variant.

    Raises:
        RoutingError: It is missing, broken, or was made for another placement.
    """
    file = path or HERE / "routes" / f"{design.variant}.txt"
    lines = read_lines(file, "route")
    if not lines or lines[0] != f"# input {fingerprint(design)}":
        raise RoutingError(f"{file.name} was made for another placement", hint="python -m hardware.pcb route")
    tracks, vias = [], []
    for number, line in enumerate(lines[1:], start=2):
        kind, net, *rest = line.split()
        try:
            values = [float(word) for word in rest]
            if kind == "T":
                layer, x0, y0, x1, y1, width = values
                tracks.append(Track(net=net, layer=int(layer), start_mm=(x0, y0), end_mm=(x1, y1), width_mm=width))
            else:
                x, y, size, drill = values
                vias.append(Via(net=net, at_mm=(x, y), size_mm=size, drill_mm=drill, is_stitch=kind == "S"))
        except ValueError as error:
            raise RoutingError(f"{file.name}, line {number}: {line!r} is no track and no via") from error
    return tracks, vias
