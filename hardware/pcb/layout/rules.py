"""Widths and distances of the board, and which net belongs to which class.

They are what any maker of two-layer boards offers in the cheapest class, with room
to spare: 0.2 mm clearance, 0.3 mm drills. Source of the 0.8 mm for power: IPC-2221
(about 2 A at 10 K in 35 um outer copper); the board never carries more than 1 A.
"""

from dataclasses import dataclass

from hardware.pcb.circuit.netlist import POWER_NETS


@dataclass(frozen=True, slots=True, kw_only=True)
class NetClass:
    """Track and via of a class of nets, millimetres."""

    name: str
    track_mm: float
    clearance_mm: float
    via_mm: float
    via_drill_mm: float


SIGNAL = NetClass(name="Default", track_mm=0.25, clearance_mm=0.2, via_mm=0.6, via_drill_mm=0.3)
POWER = NetClass(name="Power", track_mm=0.8, clearance_mm=0.2, via_mm=0.8, via_drill_mm=0.4)
NET_CLASSES = (SIGNAL, POWER)

BOARD_WIDTH_MM, BOARD_HEIGHT_MM = 100.0, 100.0
BOARD_THICKNESS_MM = 1.6
#: Corner radius of the outline.
CORNER_MM = 3.0
#: Copper keeps this distance from the board's edge.
EDGE_CLEARANCE_MM = 0.5
#: Ground pour: distance to other nets, narrowest copper, and the spokes at its pads.
POUR_CLEARANCE_MM, POUR_MIN_MM, THERMAL_GAP_MM, THERMAL_SPOKE_MM = 0.25, 0.25, 0.25, 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Pour:
    """A filled area of one net on one layer; corners left, top, right, bottom."""

    net: str
    layer: str
    corners_mm: tuple[float, float, float, float]
    #: Pads of the net melt into it (heat), instead of hanging on spokes (soldering by hand).
    is_solid: bool = False

    @property
    def key(self) -> str:
        """Return its name in pours/*.txt."""
        return f"{self.net}:{self.layer}"


#: Raster of the stitching vias between the two ground pours.
STITCH_PITCH_MM = 7.5
#: Raster of the router; pads need not stand on it.
ROUTE_GRID_MM = 0.25


def pours(variant: str) -> tuple[Pour, ...]:
    """Return the poured areas of a board, the ground below the others."""
    rim = EDGE_CLEARANCE_MM
    whole = (rim, rim, BOARD_WIDTH_MM - rim, BOARD_HEIGHT_MM - rim)
    ground = tuple(Pour(net="GND", layer=layer, corners_mm=whole) for layer in ("F.Cu", "B.Cu"))
    # The tab of a SOT-223 is its output: copper there is its heat sink.
    heat = (Pour(net="5V_REG", layer="F.Cu", corners_mm=(44.6, 74.0, 53.6, 91.0), is_solid=True),)
    return (*ground, *heat) if variant == "lm317" else ground


def net_class(net: str) -> NetClass:
    """Return the class of a net."""
    return POWER if net in POWER_NETS else SIGNAL
