"""PNG plots of a run, for a paper, a README or a CI page.

Drawn with Matplotlib's object interface (no global state, no display).
"""

import math
from pathlib import Path
from typing import Any, cast

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator
from matplotlib.transforms import Affine2D

from robot_bench.events.codec import Json
from robot_bench.report.plan import things_at_the_end
from simbase.files import replacing

LEFT, RIGHT, WALL, BOX, FLOOR, HIT = "#1b6ca8", "#c8553d", "#4a5560", "#b9a66b", "#dfe3d8", "#b00020"
LABEL_COLOURS = {"hit": HIT, "time": LEFT, "start": LEFT, "thing": "#1d2327"}
DOTS_PER_INCH = 110
#: 12 pixels, as on the page.
SMALL_PT = 12 * 72 / DOTS_PER_INCH
POINTS_PER_PX = 72 / DOTS_PER_INCH
#: Inches of the plan's width that the drawn world takes.
PLAN_INCHES = 6.4
#: What stays free around axes for their names, inches: left, bottom, right, top. A layout found by Matplotlib costs
#: half of a report's time.
PLAN_EDGES, CHART_EDGES = (0.7, 0.75, 0.15, 0.4), (1.25, 0.5, 0.15, 0.4)
#: Two curves on one another are both seen: one is broad, the other dashed and drawn on it; of the two curves of what
#: is asked, the dots of one lie between those of the other.
WHEELS = (
    ("left", LEFT, 1, {"linewidth": 2.6}, (0, (2, 6))),
    ("right", RIGHT, 2, {"linewidth": 1.4, "linestyle": (0, (5, 3))}, (4, (2, 6))),
)

#: Matplotlib ships no types: its axes are what they are.
Axes = Any


def write_plots(data: Json, folder: Path) -> tuple[Path, ...]:
    """Write `path.png`, `speeds.png` and `pins.png` from what `drawn_of` returned; return their paths."""
    plots = {"path.png": _path_figure, "speeds.png": _speeds_figure, "pins.png": _pins_figure}
    written = []
    for name, draw in plots.items():
        _paint(draw(cast("Any", data)), folder / name)
        written.append(folder / name)
    return tuple(written)


def write_scene(data: Json, path: Path) -> None:
    """Write `path.png` alone, under any name."""
    _paint(_path_figure(data), path)


def _paint(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    with replacing(path) as part:
        figure.savefig(part, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})


def _path_figure(data: Any) -> Figure:
    """Draw the path over the world as it was at the end."""
    plan = data["plan"]
    x0, y0, x1, y1 = plan["bounds"]
    figure, axes = _figure(PLAN_INCHES, PLAN_INCHES * (y1 - y0) / (x1 - x0), PLAN_EDGES)
    axes.set_aspect("equal")
    things = things_at_the_end(data["obstacles"], data["changes"])
    for thing in things:
        axes.add_patch(_patch(thing, axes))
    poses, size = data["poses"], (x1 - x0) / 90
    axes.plot([row[1] for row in poses], [row[2] for row in poses], color=LEFT, linewidth=1.6)
    for _, x, y, heading, _ in plan["times"]:
        axes.add_patch(Polygon(_arrowhead(x, y, heading, size), color=LEFT, zorder=3))
    if poses:
        _, x, y, heading = poses[0][:4]
        axes.add_patch(Polygon(_arrowhead(x, y, heading, size * 1.6), fc="white", ec=LEFT, lw=1.5, zorder=3))
        axes.add_patch(_hull(data, axes))
    hits = data["hits"]
    axes.plot([hit[1] for hit in hits], [hit[2] for hit in hits], "x", color=HIT, markersize=9, mew=2.4, zorder=4)
    _write_labels(plan["labels"], {str(thing["name"]): thing for thing in things}, axes)
    _scale_bar(axes, plan)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x, m →  (heading 0°)", ylabel="y, m →  (heading 90°)")
    axes.xaxis.set_major_locator(MultipleLocator(plan["step"]))
    axes.yaxis.set_major_locator(MultipleLocator(plan["step"]))
    axes.grid(alpha=0.3)
    axes.set_axisbelow(True)
    axes.set_title(data["title"])
    return figure


def _figure(width: float, height: float, edges: tuple[float, float, float, float]) -> tuple[Figure, Axes]:
    """Return a figure with axes of some inches, and edges around them."""
    left, bottom, right, top = edges
    whole = (width + left + right, height + bottom + top)
    figure = Figure(figsize=whole)
    return figure, figure.add_axes((left / whole[0], bottom / whole[1], width / whole[0], height / whole[1]))


def _write_labels(labels: list[Json], things: dict[str, Json], axes: Axes) -> None:
    """Write the labels of what is there at the end, where it stands then."""
    for label in cast("Any", labels):
        place = things.get(label["name"]) if label["kind"] == "thing" else label
        if place is None:
            continue
        axes.annotate(
            label["text"], (place["x"], place["y"]), (label["dx"] * POINTS_PER_PX, -label["dy"] * POINTS_PER_PX),
            textcoords="offset points", ha=label["align"], va="center", fontsize=SMALL_PT, zorder=5,
            color=LABEL_COLOURS[label["kind"]], path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )  # fmt: skip


def _scale_bar(axes: Axes, plan: Any) -> None:
    """Draw a step of the grid as a bar with its length, below the plan on the right."""
    (x0, y0, x1, y1), step = plan["bounds"], plan["step"]
    inch = (x1 - x0) / PLAN_INCHES / (y1 - y0)
    share, across, down = step / (x1 - x0), axes.transAxes, -0.45 * inch
    axes.plot([1 - share, 1], [down, down], color=WALL, linewidth=3, transform=across, clip_on=False, zorder=4,
              solid_capstyle="butt")  # fmt: skip
    axes.text(1 - share / 2, down - 0.06 * inch, f"{step:g} m", transform=across, ha="center", va="top",
              fontsize=SMALL_PT)  # fmt: skip


def _arrowhead(x: float, y: float, heading: float, size: float) -> list[tuple[float, float]]:
    c, s = size * math.cos(heading), size * math.sin(heading)
    return [(x + c * u - s * v, y + s * u + c * v) for u, v in ((1, 0), (-0.7, 0.7), (-0.3, 0), (-0.7, -0.7))]


def _patch(item: Any, axes: Axes) -> Patch:
    """Return a thing's outline in the plan."""
    x, y = item["x"], item["y"]
    colour = WALL if item["wall"] else FLOOR if item["floor"] else BOX
    order = 0.5 if colour == FLOOR else 1.5
    if item.get("shape") == "cylinder":
        return Circle((x, y), item["radius"], color=colour, zorder=order)
    length, width = item["length"], item["width"]
    turn = Affine2D().rotate(item.get("heading") or 0.0).translate(x, y)
    return Rectangle(
        (-length / 2, -width / 2), length, width, color=colour, zorder=order, transform=turn + axes.transData
    )


def _hull(data: Any, axes: Axes) -> Patch:
    """Return the robot's hull where the run ended."""
    robot, (_, x, y, heading) = data["robot"], data["poses"][-1][:4]
    front, rear, width = robot["front"], robot["rear"], robot["width"]
    turn = Affine2D().rotate(heading).translate(x, y)
    return Rectangle(
        (-rear, -width / 2), front + rear, width, fill=False, linewidth=1.6, zorder=3, transform=turn + axes.transData
    )


def _speeds_figure(data: Any) -> Figure:
    """Draw both wheels' rim speeds, what the motor pins ask for, and the heading."""
    figure = Figure(figsize=(10, 5))
    speeds, heading = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    figure.subplots_adjust(left=0.075, right=0.985, top=0.92, bottom=0.1, hspace=0.08)
    times, end = [row[0] for row in data["poses"]], data["duration"]
    for name, colour, motor, style, asked_style in WHEELS:
        speeds.plot(times, [row[3 + motor] for row in data["poses"]], color=colour, label=name, **style)
        steps = data["motors"][motor - 1]
        if not steps:  # a robot on own pins has no such wires
            continue
        speeds.step(
            [row[0] for row in steps] + [end], [row[1] for row in steps] + [steps[-1][1]], where="post", color=colour,
            linewidth=1.1, linestyle=asked_style, label=f"{name}, asked by the pins",
        )  # fmt: skip
    speeds.set_ylabel("rim speed, m/s")
    heading.plot(times, [math.degrees(row[3]) for row in data["poses"]], color=WALL, linewidth=1.1)
    heading.set(xlabel="time, s", ylabel="heading, °", xlim=(0, end), ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    for axes in (speeds, heading):
        axes.grid(alpha=0.3)
        for number, hit in enumerate(data["hits"]):
            axes.axvline(hit[0], color=HIT, linewidth=0.9, label=None if number else "collision")
    # Above the axes: within them it would lie on the curves.
    handles, names = speeds.get_legend_handles_labels()
    figure.legend(handles, names, loc="upper right", ncols=5, frameon=False)
    return figure


def _pins_figure(data: Any) -> Figure:
    """Draw each net's level over time, grouped as a person reads them."""
    rows: list[tuple[str, str, list[list[float]]]] = []
    for title, nets in reversed(data["pins"]):
        rows += [(title, label, edges) for label, edges in reversed(nets)]
        rows.append(("", title, []))
    figure, axes = _figure(8.6, 0.25 * max(4, len(rows)), CHART_EDGES)
    end = data["duration"]
    for row, (title, _, edges) in enumerate(rows):
        times, levels = [edge[0] for edge in edges] + [end], [row + 0.7 * edge[1] for edge in edges]
        if levels:
            colour = RIGHT if "right" in title else LEFT
            axes.step(times, [*levels, levels[-1]], where="post", color=colour, linewidth=1)
    for number, hit in enumerate(data["hits"]):
        axes.axvline(hit[0], color=HIT, linewidth=0.9, label=None if number else "collision")
    axes.set_yticks([row + 0.35 for row in range(len(rows))], [label for _, label, _ in rows], fontsize=SMALL_PT)
    for label, (title, _, _) in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_fontweight("normal" if title else "bold")
    axes.tick_params(axis="y", length=0)
    axes.set(xlabel="time, s", xlim=(0, end), ylim=(-0.5, max(4, len(rows))), title="pins: of the BluePill, and signal")
    axes.grid(axis="x", alpha=0.3)
    if data["hits"]:
        figure.legend(loc="upper right", frameon=False)
    return figure
