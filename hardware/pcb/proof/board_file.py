"""What a .kicad_pcb file says of its parts: pads with place and net, and every mark of the print, on the board's axes.

It reads KiCad's file, not the tables that the file was written from: what the checks of print and lands hold against
the netlist is what is plotted. Not read: copper, pours, values.

Invariant: places are millimetres from the board's upper left corner, turned as the part is.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from hardware.pcb.outputs.board import ORIGIN_MM
from hardware.pcb.outputs.read_places import Point, angle, point, turned
from hardware.pcb.outputs.sexp import Node, child, children, parse, word

#: The layer of the print.
PRINT = "F.SilkS"


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedMark:
    """A stroke (two points), a circle (its centre) or a text (its anchor) of the print."""

    points: tuple[Point, ...]
    width_mm: float = 0.0
    text: str = ""
    #: "left", "right" or "center": which end of the text stands at its point.
    justify: str = "center"
    is_filled: bool = False
    #: True of a part's printed reference.
    is_reference: bool = False

    @property
    def at(self) -> Point:
        """Return its middle."""
        xs, ys = zip(*self.points, strict=True)
        return sum(xs) / len(xs), sum(ys) / len(ys)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLand:
    """A pad: as its footprint has it, and where it is on the board."""

    number: str
    own_mm: Point
    size_mm: Point
    drill_mm: float
    at: Point
    net: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SilkPart:
    """A part: its lands and its marks."""

    ref: str
    footprint: str
    lands: tuple[PlacedLand, ...]
    marks: tuple[PrintedMark, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedBoard:
    """A board: parts by reference, texts that belong to no part, and the lower edge."""

    parts: Mapping[str, SilkPart]
    labels: tuple[PrintedMark, ...]
    bottom_mm: float


def read_board(text: str) -> PrintedBoard:
    """Return what a board's file says.

    Raises:
        SexpError: It is no board.
    """
    tree = parse(text)
    parts = [_part(one) for one in children(tree, "footprint")]
    edges = [point(child(one, end)) for one in children(tree, "gr_line") if _layer(one) == "Edge.Cuts"
             for end in ("start", "end")]  # fmt: skip
    return PrintedBoard(
        parts={part.ref: part for part in parts}, labels=tuple(_marks(tree, "gr", ORIGIN_MM, 0.0, back=True)),
        bottom_mm=max((y for _, y in edges), default=0.0) - ORIGIN_MM[1],
    )  # fmt: skip


def _part(one: Node) -> SilkPart:
    place = child(one, "at")
    at = point(place)
    origin, turn = (at[0] - ORIGIN_MM[0], at[1] - ORIGIN_MM[1]), angle(place)
    words = {word(entry, 1): entry for entry in children(one, "property")}
    marks = _marks(one, "fp", origin, turn)
    reference = words["Reference"]
    if not children(reference, "hide"):
        marks.append(
            PrintedMark(
                points=(turned(point(child(reference, "at")), origin, turn),),
                text=word(reference, 2),
                is_reference=True,
            )
        )
    lands = [_land(pad, origin, turn) for pad in children(one, "pad")]
    return SilkPart(ref=word(reference, 2), footprint=word(one).split(":")[-1], lands=tuple(lands), marks=tuple(marks))


def _land(pad: Node, origin: Point, turn: float) -> PlacedLand:
    own = point(child(pad, "at"))
    drill, net = children(pad, "drill"), children(pad, "net")
    return PlacedLand(
        number=word(pad), own_mm=own, size_mm=point(child(pad, "size")),
        drill_mm=float(word(drill[0])) if drill else 0.0, at=turned(own, origin, turn),
        net=word(net[0], 2) if net else "",
    )  # fmt: skip


def _marks(tree: Node, prefix: str, origin: Point, turn: float, *, back: bool = False) -> list[PrintedMark]:
    def placed(own: Point) -> Point:
        return (round(own[0] - origin[0], 4), round(own[1] - origin[1], 4)) if back else turned(own, origin, turn)

    found = []
    for one in children(tree, f"{prefix}_line"):
        if _layer(one) == PRINT:
            width = float(word(child(child(one, "stroke"), "width")))
            ends = (placed(point(child(one, "start"))), placed(point(child(one, "end"))))
            found.append(PrintedMark(points=ends, width_mm=width))
    for one in children(tree, f"{prefix}_circle"):
        if _layer(one) == PRINT:
            filled = word(child(one, "fill")) == "yes"
            found.append(PrintedMark(points=(placed(point(child(one, "center"))),), is_filled=filled))
    for one in children(tree, f"{prefix}_text"):
        if _layer(one) == PRINT:
            effects = child(one, "effects")
            justify = children(effects, "justify")
            size = float(word(child(child(effects, "font"), "size")))
            found.append(PrintedMark(points=(placed(point(child(one, "at"))),),
                                     text=word(one, 2 if prefix == "fp" else 1),
                                     width_mm=size, justify=word(justify[0]) if justify else "center"))  # fmt: skip
    return found


def _layer(one: Node) -> str:
    return word(child(one, "layer"))
