"""Two boards laid over each other: what only the first has in red, what only the second has in green, the rest in grey.

Read from .kicad_pcb files, of this working tree, of another revision in git, or any others: parts with value and
place, pads with their net, tracks, vias, silkscreen, outline. Left out: pours, which follow from the rest, and the arcs
of the outline's corners.

Invariant: a board laid over itself has no difference; the same two boards give the same bytes.
"""

import subprocess
from dataclasses import dataclass
from html import escape
from pathlib import Path

from hardware.pcb.circuit.netlist import DesignError
from hardware.pcb.outputs.generated_files import GENERATED
from hardware.pcb.outputs.read_places import Point, angle, point, turned
from hardware.pcb.outputs.sexp import Node, SexpError, child, children, parse, word

OLD, NEW, BOTH = "#d00000", "#008a00", "#c9c9c9"
#: Sides of the board, each a panel; what is on every copper layer is on both.
SIDES = {"front": ("F.Cu", "F.SilkS"), "back": ("B.Cu", "B.SilkS")}
COPPER = ("F.Cu", "B.Cu")
#: Millimetres between and around the panels, and beside the outline.
MARGIN_MM = 6.0


@dataclass(frozen=True, slots=True, order=True)
class Stroke:
    """A line on a layer: a track with its net, silkscreen, or the outline; a text is a stroke without length."""

    layer: str
    start: tuple[float, float]
    end: tuple[float, float]
    width_mm: float
    #: Net of a track, or words.
    text: str = ""


@dataclass(frozen=True, slots=True, order=True)
class Land:
    """A pad or a via, with its net."""

    layers: tuple[str, ...]
    at: tuple[float, float]
    size_mm: tuple[float, float]
    angle_deg: float
    is_round: bool
    drill_mm: float
    net: str


@dataclass(frozen=True, slots=True)
class BoardContents:
    """What is compared."""

    #: Reference to value, footprint and place.
    parts: dict[str, str]
    strokes: frozenset[Stroke]
    lands: frozenset[Land]
    nets: frozenset[str]


def read_source(text: str) -> BoardContents:
    """Read a board that is named by its variant, by its file, or as REVISION:VARIANT of git.

    Raises:
        DesignError: There is no such board, or it is none.
    """
    path = Path(text)
    if (known := GENERATED / text / f"{text}.kicad_pcb").exists():
        path = known
    if path.is_file():
        return _board(path.read_text(encoding="utf-8"), text)
    revision, colon, variant = text.partition(":")
    if not colon:
        raise DesignError(f"there is no board {text!r} (a variant, a .kicad_pcb file, or REVISION:VARIANT)")
    name = f"{revision}:./{variant}/{variant}.kicad_pcb"
    done = subprocess.run(["git", "show", name], cwd=GENERATED, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise DesignError(f"git has no {text}: {done.stderr.strip().splitlines()[-1]}")
    return _board(done.stdout, text)


def _board(text: str, name: str) -> BoardContents:
    try:
        tree = parse(text)
    except (SexpError, StopIteration) as error:
        raise DesignError(f"{name} is no board: {error}") from error
    if tree[:1] != ["kicad_pcb"]:
        raise DesignError(f"{name} is no board")
    parts: dict[str, str] = {}
    strokes = {_track(one) for one in children(tree, "segment")} | set(_drawn(tree, "gr", (0.0, 0.0), 0.0))
    lands = {_via(one) for one in children(tree, "via")}
    for footprint in children(tree, "footprint"):
        place = child(footprint, "at")
        at, turn = _point(place), angle(place)
        words = {word(one, 1): word(one, 2) for one in children(footprint, "property")}
        parts[words["Reference"]] = f"{words['Value']}, {word(footprint)} at {at[0]:g} {at[1]:g}, {turn:g} degrees"
        strokes |= set(_drawn(footprint, "fp", at, turn))
        lands |= {_pad(pad, at, turn) for pad in children(footprint, "pad")}
    nets = frozenset(word(net, 2) for net in children(tree, "net"))
    numbered = {word(net, 1): word(net, 2) for net in children(tree, "net")}
    named = {
        Stroke(one.layer, one.start, one.end, one.width_mm, numbered.get(one.text, one.text))
        if one.layer in COPPER else one
        for one in strokes
    }  # fmt: skip
    return BoardContents(parts, frozenset(named), frozenset(lands), nets)


def _point(node: Node) -> Point:
    x, y = point(node)
    return round(x, 4), round(y, 4)


def _track(one: Node) -> Stroke:
    ends = sorted((_point(child(one, "start")), _point(child(one, "end"))))
    net = word(child(one, "net"))
    return Stroke(word(child(one, "layer")), ends[0], ends[1], float(word(child(one, "width"))), net)


def _via(one: Node) -> Land:
    size = float(word(child(one, "size")))
    return Land(COPPER, _point(child(one, "at")), (size, size), 0.0, True, float(word(child(one, "drill"))), "")


def _pad(pad: Node, at: Point, turn: float) -> Land:
    place = child(pad, "at")
    width, height = _point(child(pad, "size"))
    layers = [item for item in child(pad, "layers")[1:] if isinstance(item, str)]
    sides = COPPER if "*.Cu" in layers else tuple(layer for layer in COPPER if layer in layers)
    drill = children(pad, "drill")
    net = children(pad, "net")
    return Land(
        sides, turned(_point(place), at, turn), (width, height), angle(place) % 360, word(pad, 3) == "circle",
        float(word(drill[0])) if drill else 0.0, word(net[0], 2) if net else "",
    )  # fmt: skip


def _drawn(tree: Node, prefix: str, at: Point, turn: float) -> list[Stroke]:
    result = []
    for one in children(tree, f"{prefix}_line"):
        ends = sorted(turned(_point(child(one, name)), at, turn) for name in ("start", "end"))
        width = float(word(child(child(one, "stroke"), "width")))
        result.append(Stroke(word(child(one, "layer")), ends[0], ends[1], width))
    for one in children(tree, f"{prefix}_text"):
        place = turned(_point(child(one, "at")), at, turn)
        words = word(one, 2 if prefix == "fp" else 1)
        size = float(word(child(child(child(one, "effects"), "font"), "size")))
        result.append(Stroke(word(child(one, "layer")), place, place, size, words))
    return result


def words(old: BoardContents, new: BoardContents) -> list[str]:
    """Return a line for each part and each kind of thing that differ."""
    said = []
    for name in sorted(old.parts.keys() | new.parts.keys()):
        before, after = old.parts.get(name), new.parts.get(name)
        if before is None or after is None:
            said.append(f"{name}: {'new, ' + (after or '') if before is None else 'gone, ' + before}")
        elif before != after:
            said.append(f"{name}: {before} -> {after}")
    for kind, gone, come in (
        ("nets", old.nets - new.nets, new.nets - old.nets),
        ("pads and vias", old.lands - new.lands, new.lands - old.lands),
        ("tracks and strokes", old.strokes - new.strokes, new.strokes - old.strokes),
    ):
        if gone or come:
            names = f": {', '.join(sorted(map(str, gone | come)))}" if kind == "nets" else ""
            said.append(f"{kind}: {len(gone)} gone, {len(come)} new{names}")
    return said


def picture(old: BoardContents, new: BoardContents, names: tuple[str, str]) -> str:
    """Return an SVG of both boards, front and back side by side."""
    outline = [one for one in old.strokes | new.strokes if one.layer == "Edge.Cuts"]
    if not outline:
        raise DesignError("neither board has an outline")
    xs = [point[0] for one in outline for point in (one.start, one.end)]
    ys = [point[1] for one in outline for point in (one.start, one.end)]
    left, top = min(xs) - MARGIN_MM, min(ys) - 3 * MARGIN_MM
    width, height = max(xs) - left + MARGIN_MM, max(ys) - top + MARGIN_MM
    box = f"{left:g} {top:g} {2 * width:g} {height:g}"
    size = f'width="{2 * width * 6:.0f}" height="{height * 6:.0f}"'
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{box}" font-family="sans-serif">',
        f'<rect x="{left:g}" y="{top:g}" width="{2 * width:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    for number, (side, layers) in enumerate(SIDES.items()):
        shift = number * width
        out.append(f'<g transform="translate({shift:g} 0)">')
        out.append(f'<text x="{left + MARGIN_MM:g}" y="{top + 5:g}" font-size="4">{side}, seen from above</text>')
        # What both have lies below, so that no difference is hidden.
        for colour, has_old, has_new in ((BOTH, True, True), (OLD, True, False), (NEW, False, True)):
            strokes = [one for one in sorted(old.strokes | new.strokes) if one.layer in (*layers, "Edge.Cuts")]
            out += [
                _stroke(one, colour)
                for one in strokes
                if (one in old.strokes, one in new.strokes) == (has_old, has_new)
            ]
            lands = [one for one in sorted(old.lands | new.lands) if layers[0] in one.layers]
            out += [_land(one, colour) for one in lands if (one in old.lands, one in new.lands) == (has_old, has_new)]
        out.append("</g>")
    legend = ((f"only {names[0]}", OLD), (f"only {names[1]}", NEW), ("both", BOTH))
    spans = "   ".join(f'<tspan fill="{colour}">{escape(text)}</tspan>' for text, colour in legend)
    out.append(f'<text x="{left + MARGIN_MM:g}" y="{top + 10:g}" font-size="4" xml:space="preserve">{spans}</text>')
    return "\n".join([*out, "</svg>", ""])


def _stroke(one: Stroke, colour: str) -> str:
    (x1, y1), (x2, y2) = one.start, one.end
    if one.start == one.end and one.layer not in COPPER:
        style = f'font-size="{one.width_mm:g}" text-anchor="middle" dominant-baseline="middle" fill="{colour}"'
        return f'<text x="{x1:g}" y="{y1:g}" {style}>{escape(one.text)}</text>'
    return (
        f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="{colour}" stroke-width="{one.width_mm:g}" '
        'stroke-linecap="round"/>'
    )


def _land(one: Land, colour: str) -> str:
    (x, y), (width, height) = one.at, one.size_mm
    if one.is_round:
        shape = f'<circle cx="{x:g}" cy="{y:g}" r="{width / 2:g}" fill="{colour}"/>'
    else:
        shape = (
            f'<rect x="{x - width / 2:g}" y="{y - height / 2:g}" width="{width:g}" height="{height:g}" '
            f'fill="{colour}" transform="rotate({-one.angle_deg:g} {x:g} {y:g})"/>'
        )
    hole = f'<circle cx="{x:g}" cy="{y:g}" r="{one.drill_mm / 2:g}" fill="#ffffff"/>' if one.drill_mm else ""
    return shape + hole
