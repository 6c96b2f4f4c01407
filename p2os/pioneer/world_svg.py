"""A world as an SVG picture; no dependency."""

import math
from html import escape

from p2os.pioneer.drawing import Shape, shapes, start_arrow
from p2os.pioneer.scenery import World

#: The longer side of the plan, in pixels.
SIDE_PX = 760
EDGE_PX = 44
INK, GRID, START = "#22303c", "#e3e6ea", "#c8553d"


def svg(world: World) -> str:
    """Return the picture: plan, start, a grid of metres and the world's name."""
    x0, y0, x1, y1 = world.extent
    scale = SIDE_PX / max(x1 - x0, y1 - y0)
    width, height = (x1 - x0) * scale + 2 * EDGE_PX, (y1 - y0) * scale + 2 * EDGE_PX

    def at(x: float, y: float) -> str:
        return f"{EDGE_PX + (x - x0) * scale:.1f},{EDGE_PX + (y1 - y) * scale:.1f}"

    def drawn(shape: Shape) -> str:
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
    lines += [drawn(shape) for shape in shapes(world)]
    arrow = " ".join(at(*point) for point in start_arrow(world, arrow_length(world)))
    lines.append(f'<polygon points="{arrow}" fill="{START}"><title>start</title></polygon>')
    lines.append(f'<text x="{EDGE_PX}" y="26" font-size="16" font-weight="bold">{escape(world.name)}</text>')
    lines.append(f'<text x="{width - EDGE_PX:.0f}" y="26" text-anchor="end">metres</text></svg>')
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
