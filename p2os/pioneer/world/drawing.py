"""A world as a drawing: the shapes that all pictures share, an SVG picture, and characters for a terminal.

`shapes` is the one list; `svg` and `text` draw it without any dependency. A character
of `text` is two square points, one above the other.

Invariant: what is drawn depends on the world alone, so that pictures can be compared.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from html import escape
from itertools import pairwise

from p2os.pioneer.world.geometry import Footprint, point_polygon, point_segment
from p2os.pioneer.world.model import CUT_M, Obstacle, ObstacleKind, Point, World, cut, shadow


class Look(Enum):
    """How a shape is drawn: its fill colour."""

    FLOOR = "#e6e9de"
    RAMP = "#d3dac2"
    #: Above the hull, like a table's top: passed beneath.
    OVERHEAD = "#dcd3ea"
    THING = "#b9a66b"
    PUSHED = "#d9944a"
    WALL = "#4a5560"
    WALKING = "#1b6ca8"
    #: A scripted path.
    PATH = "#7fb2d6"
    #: A line or an area that programs keep out of.
    FORBIDDEN = "#d98c8c"
    REFLECTOR = "#b04ab0"
    GOAL = "#5a9367"
    #: Where a robot went.
    WAY = "#1b6ca9"
    #: Where it touched something.
    HIT = "#b3261e"


#: Kinds of marks that are not drawn as a goal is.
MARKED = {"forbidden": Look.FORBIDDEN, "reflector": Look.REFLECTOR}
#: What is drawn later covers what is drawn before.
ORDER = tuple(Look)
#: Of the dot that is drawn for a goal.
MARK_RADIUS_M = 0.08
#: What is thinner is drawn as a line, as that of a map is.
THIN_M = 1e-3
#: What begins higher is passed beneath by a Pioneer 2.
OVERHEAD_M = 0.22


@dataclass(frozen=True, slots=True)
class DrawnShape:
    """A polygon of some points, a line (open), or a circle (one point and a radius); metres."""

    look: Look
    name: str
    points: tuple[Point, ...]
    radius_m: float = 0.0
    is_open: bool = False


def shapes(world: World) -> list[DrawnShape]:
    """Return what there is to draw, the lowest first."""
    found = [shape for item in world.obstacles for shape in shapes_of(item)]
    for mark in world.marks:
        look = MARKED.get(mark.kind, Look.GOAL)
        is_open, radius = len(mark.points_m) > 1, 0.0 if len(mark.points_m) > 1 else MARK_RADIUS_M
        points = (*mark.points_m, mark.points_m[0]) if len(mark.points_m) > 2 else mark.points_m
        found.append(DrawnShape(look, mark.name or mark.kind, points, radius, is_open=is_open))
    for mesh in world.meshes:
        found += [
            DrawnShape(Look.THING, mesh.name, polygon) for polygon in shadow(mesh, CUT_M / 4, CUT_M) if len(polygon) > 2
        ]
        found += [DrawnShape(Look.WALL, mesh.name, segment, is_open=True) for segment in cut(mesh, CUT_M)]
    return _lowest_first(found)


def _lowest_first(found: Sequence[DrawnShape]) -> list[DrawnShape]:
    return sorted(found, key=lambda shape: ORDER.index(shape.look))


def shapes_of(item: Obstacle) -> list[DrawnShape]:
    """Return a thing as it is drawn, with the path that it walks."""
    path = [] if item.walk is None else [DrawnShape(Look.PATH, f"{item.name}'s path", item.walk.points_m, is_open=True)]
    return [_thing(item), *path]


def start_label(world: World) -> str:
    """Return what is written beside the start's arrow."""
    return f"start, heading {_degrees(world):g}°"


def _degrees(world: World) -> int:
    return round(math.degrees(world.start.heading_rad))


def start_arrow(world: World, length_m: float) -> tuple[Point, ...]:
    """Return an arrowhead at the start that looks where the robot looks."""
    start, outline = world.start, ((1.0, 0.0), (-0.7, 0.6), (-0.4, 0.0), (-0.7, -0.6))
    c, s = length_m * math.cos(start.heading_rad), length_m * math.sin(start.heading_rad)
    return tuple((start.x_m + x * c - y * s, start.y_m + x * s + y * c) for x, y in outline)


def _thing(item: Obstacle) -> DrawnShape:
    at = (item.x_m, item.y_m) if item.walk is None else item.walk.points_m[0]
    if item.is_cylinder:
        return DrawnShape(look_of(item), item.name, (at,), item.radius_m)
    if item.width_m < THIN_M:
        c, s = item.length_m / 2 * math.cos(item.heading_rad), item.length_m / 2 * math.sin(item.heading_rad)
        return DrawnShape(look_of(item), item.name, ((at[0] - c, at[1] - s), (at[0] + c, at[1] + s)), is_open=True)
    return DrawnShape(look_of(item), item.name, Footprint(item).polygon)


def look_of(item: Obstacle) -> Look:
    """Return how a thing is drawn."""
    if item.kind.is_driven_on:
        return Look.RAMP if item.kind is ObstacleKind.RAMP else Look.FLOOR
    if item.walk is not None:
        return Look.WALKING
    if item.base_m - item.floor_m >= OVERHEAD_M:
        return Look.OVERHEAD
    if item.kind in {ObstacleKind.WALL, ObstacleKind.RAIL}:
        return Look.WALL
    return Look.PUSHED if item.mass_kg else Look.THING


# SVG ------------------------------------------------------------------------------------

#: The longer side of the plan, in pixels.
SIDE_PX = 760
EDGE_PX = 44
INK, GRID, START = "#22303c", "#e3e6ea", "#c8553d"
#: The names of the axes: of a world x is to the right and y is up, and headings count from x towards y.
X_AXIS, Y_AXIS = "x, m →  (heading 0°)", "y, m →  (heading 90°)"


def svg(world: World, *, over: Sequence[DrawnShape] = (), side_px: float = SIDE_PX) -> str:
    """Return the picture: plan, start with its heading, axes in metres, a scale bar and the world's name.

    Args:
        world: What to draw.
        over: What is drawn besides, the lowest of a world's shapes first.
        side_px: The longer side of the plan.
    """
    x0, y0, x1, y1 = world.extent
    scale = side_px / max(x1 - x0, y1 - y0)
    width, height = (x1 - x0) * scale + 2 * EDGE_PX, (y1 - y0) * scale + 2 * EDGE_PX

    def at(x: float, y: float) -> str:
        return f"{EDGE_PX + (x - x0) * scale:.1f},{EDGE_PX + (y1 - y) * scale:.1f}"

    def drawn(shape: DrawnShape) -> str:
        title = f"<title>{escape(shape.name)}</title>"
        if shape.radius_m:
            x, y = at(*shape.points[0]).split(",")
            radius = max(shape.radius_m * scale, 1.0)
            return f'<circle cx="{x}" cy="{y}" r="{radius:.1f}" fill="{shape.look.value}">{title}</circle>'
        points = " ".join(at(*point) for point in shape.points)
        if shape.is_open:
            style = f'fill="none" stroke="{shape.look.value}" stroke-width="2"'
            return f'<polyline points="{points}" {style}>{title}</polyline>'
        return f'<polygon points="{points}" fill="{shape.look.value}">{title}</polygon>'

    step = grid_step(max(x1 - x0, y1 - y0))
    size, font = f'width="{width:.0f}" height="{height:.0f}"', 'font-family="sans-serif" font-size="12"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width:.0f} {height:.0f}" {font} fill="{INK}">',
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="white"/>',
    ]
    for x in ticks(x0, x1, step):
        (px, top), (_, bottom) = at(x, y1).split(","), at(x, y0).split(",")
        lines.append(f'<line x1="{px}" y1="{top}" x2="{px}" y2="{bottom}" stroke="{GRID}"/>')
        lines.append(f'<text x="{px}" y="{float(bottom) + 16:.1f}" text-anchor="middle">{x:g}</text>')
    for y in ticks(y0, y1, step):
        (left, py), (right, _) = at(x0, y).split(","), at(x1, y).split(",")
        lines.append(f'<line x1="{left}" y1="{py}" x2="{right}" y2="{py}" stroke="{GRID}"/>')
        lines.append(f'<text x="{float(left) - 6:.1f}" y="{float(py) + 4:.1f}" text-anchor="end">{y:g}</text>')
    lines += [drawn(shape) for shape in _lowest_first([*shapes(world), *over])]
    arrow = " ".join(at(*point) for point in start_arrow(world, arrow_length(world)))
    lines.append(f'<polygon points="{arrow}" fill="{START}"><title>start</title></polygon>')
    lines.append(f'<text x="{EDGE_PX}" y="26" font-size="16" font-weight="bold">{escape(world.name)}</text>')
    start_x, start_y = map(float, at(world.start.x_m, world.start.y_m).split(","))
    halo = 'stroke="white" stroke-width="3" paint-order="stroke"'
    below = start_y + arrow_length(world) * scale + 14
    lines.append(f'<text x="{start_x:.1f}" y="{below:.1f}" text-anchor="middle" {halo}>{start_label(world)}</text>')
    lines.append(f'<text x="{EDGE_PX}" y="{height - 8:.0f}">{X_AXIS}</text>')
    turn = f'transform="translate(14,{height - EDGE_PX:.0f}) rotate(-90)"'
    lines.append(f"<text {turn}>{Y_AXIS}</text>")
    bar_px, end_px = step * scale, width - EDGE_PX
    lines.append(f'<rect x="{end_px - bar_px:.1f}" y="{height - 14:.0f}" width="{bar_px:.1f}" height="3"/>')
    lines.append(f'<text x="{end_px - bar_px - 6:.1f}" y="{height - 8:.0f}" text-anchor="end">{step:g} m</text></svg>')
    return "\n".join(lines) + "\n"


def grid_step(span_m: float) -> float:
    """Return the distance of grid lines: 1, 2 or 5 times a power of ten, for ten lines or fewer."""
    power = 10.0 ** math.floor(math.log10(span_m / 10))
    return next(power * factor for factor in (1, 2, 5, 10) if span_m / (power * factor) <= 10)


def ticks(low: float, high: float, step: float) -> list[float]:
    """Return the whole multiples of a step between two bounds."""
    return [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]


def arrow_length(world: World) -> float:
    """Return the half length of the start's arrow: a robot's, or enough to be seen in a large world."""
    x0, y0, x1, y1 = world.extent
    return max(0.22, max(x1 - x0, y1 - y0) / 60)


# Characters -----------------------------------------------------------------------------

#: Which looks are drawn in characters; what is driven on or beneath would hide the rest.
SOLID = (Look.THING, Look.PUSHED, Look.WALL, Look.WALKING)
#: Upper and lower point taken → character.
BLOCKS = {(False, False): " ", (True, False): "▀", (False, True): "▄", (True, True): "█"}
#: By eighths of a turn, from east counter-clockwise.
ARROWS = "→↗↑↖←↙↓↘"


def text(world: World, columns: int) -> list[str]:
    """Return the rows of the drawing, the northern first; the arrow is the start.

    Args:
        world: What to draw.
        columns: How wide it may be; at least 8.
    """
    x0, y0, x1, y1 = world.extent
    columns = max(8, columns)
    point_m = (x1 - x0) / columns
    rows = max(2, math.ceil((y1 - y0) / point_m))
    taken = [[False] * columns for _ in range(rows + rows % 2)]
    for shape in shapes(world):
        if shape.look in SOLID:
            for column, row in _points(shape, x0, y1, point_m):
                if 0 <= row < len(taken) and 0 <= column < columns:
                    taken[row][column] = True
    lines = [
        "".join(BLOCKS[upper, lower] for upper, lower in zip(taken[row], taken[row + 1], strict=True))
        for row in range(0, len(taken), 2)
    ]
    column, row = int((world.start.x_m - x0) / point_m), int((y1 - world.start.y_m) / point_m) // 2
    if 0 <= row < len(lines) and 0 <= column < columns:
        arrow = ARROWS[round(world.start.heading_rad / (math.pi / 4)) % 8]
        lines[row] = lines[row][:column] + arrow + lines[row][column + 1 :]
    return [line.rstrip() for line in lines]


def text_key(world: World, columns: int) -> str:
    """Return the line that says how to read `text`: directions, scale, start."""
    x0, _, x1, _ = world.extent
    wide_m, start = (x1 - x0) / max(8, columns), world.start
    return (
        f"x → right, y ↑ up; a character is {wide_m:.2g} m wide, {2 * wide_m:.2g} m high; "
        f"start {start.x_m:g}, {start.y_m:g}, {_degrees(world)}°"
    )


def _points(shape: DrawnShape, x0: float, y1: float, point_m: float) -> Iterator[tuple[int, int]]:
    """Yield column and row of each point that a shape covers, at least one."""
    xs, ys = [x for x, _ in shape.points], [y for _, y in shape.points]
    r = shape.radius_m
    first, last = int((min(xs) - r - x0) / point_m), int((max(xs) + r - x0) / point_m)
    top, bottom = int((y1 - max(ys) - r) / point_m), int((y1 - min(ys) + r) / point_m)
    for row in range(top, bottom + 1):
        for column in range(first, last + 1):
            if _covers(shape, x0 + (column + 0.5) * point_m, y1 - (row + 0.5) * point_m, point_m / 2):
                yield column, row


def _covers(shape: DrawnShape, x: float, y: float, slack_m: float) -> bool:
    points = shape.points
    if shape.radius_m:
        return math.hypot(x - points[0][0], y - points[0][1]) <= max(shape.radius_m, slack_m)
    if not shape.is_open:
        return point_polygon(x, y, points) <= slack_m
    return any(point_segment(x, y, *a, *b) <= slack_m for a, b in pairwise(points))
