"""PNG plots of a run, for a paper, a README or a CI page.

Drawn with Matplotlib's object interface: no global state, no display.
"""

import math
from pathlib import Path
from typing import Any, cast

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle
from matplotlib.transforms import Affine2D

from robot_bench.recording.run_record import Json, RunRecord
from robot_bench.recording.signals import grouped, motor_steps
from robot_bench.recording.summary import verdict
from simbase.timing import NS_PER_S

LEFT, RIGHT, WALL, BOX, FLOOR, HIT = "#1b6ca8", "#c8553d", "#4a5560", "#b9a66b", "#dfe3d8", "#b00020"
#: chosen: more names than these would cover the plan; each collision has its mark.
NAMED_HITS = 8
DOTS_PER_INCH = 110
DEFAULT_STEP_MPS = 0.0625

#: Matplotlib ships no types: its axes are what they are.
Axes = Any


def write_plots(record: RunRecord, folder: Path) -> tuple[Path, ...]:
    """Write `path.png`, `speeds.png` and `pins.png`; return their paths."""
    plots = {"path.png": _path_figure, "speeds.png": _speeds_figure, "pins.png": _pins_figure}
    written = []
    for name, draw in plots.items():
        figure = draw(record)
        FigureCanvasAgg(figure)
        figure.savefig(folder / name, dpi=DOTS_PER_INCH, metadata={"Software": None})
        written.append(folder / name)
    return tuple(written)


def _path_figure(record: RunRecord) -> Figure:
    """Draw the path over the world as it was at the end."""
    figure = Figure(figsize=(7.2, 7.2), layout="constrained")
    axes = figure.add_subplot(aspect="equal")
    world = cast("Json", record.meta.get("world") or {})
    x0, y0, x1, y1 = cast("list[float]", world.get("extent") or [-3, -3, 3, 3])
    for obstacle in _final_obstacles(record, world):
        axes.add_patch(_patch(obstacle, axes))
    xs, ys = [p.x / 1e6 for p in record.poses], [p.y / 1e6 for p in record.poses]
    axes.plot(xs, ys, color=LEFT, linewidth=1.6)
    hits = record.collisions()
    if hits:
        axes.plot([hit.x for hit in hits], [hit.y for hit in hits], "X", color=HIT, markersize=9, zorder=4)
        for hit in hits[:NAMED_HITS]:
            text = f"{hit.what}, {hit.t / NS_PER_S:.1f} s"
            axes.annotate(text, (hit.x, hit.y), (6, 6), textcoords="offset points", color=HIT, fontsize=8, zorder=4)
    if record.poses:
        axes.plot(xs[0], ys[0], "o", color=LEFT, markersize=7, markerfacecolor="white")
        axes.add_patch(_hull(record, axes))
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x, m", ylabel="y, m")
    axes.set_title(f"{record.meta.get('scenario', 'run')} in {world.get('name', '?')}: {verdict(record)}")
    return figure


def _final_obstacles(record: RunRecord, world: Json) -> list[Json]:
    """Return the obstacles after every change that the run made."""
    now = {str(item["name"]): item for item in cast("list[Json]", world.get("obstacles") or [])}
    for change in record.obstacles:
        name = str(change["name"])
        if change.get("op") == "remove":
            now.pop(name, None)
        else:
            now[name] = {**now.get(name, {}), **change}
    return list(now.values())


def _patch(item: Json, axes: Axes) -> Patch:
    """Return an obstacle's outline in the plan."""
    x, y = cast("float", item["x"]), cast("float", item["y"])
    kind = str(item.get("kind", ""))
    colour = {"wall": WALL, "rail": WALL, "floor": FLOOR, "ramp": FLOOR}.get(kind, BOX)
    order = 0.5 if colour == FLOOR else 1.5
    if item.get("shape") == "cylinder":
        return Circle((x, y), cast("float", item["radius"]), color=colour, zorder=order)
    length, width = cast("float", item["length"]), cast("float", item["width"])
    turn = Affine2D().rotate(cast("float", item.get("heading") or 0.0)).translate(x, y)
    return Rectangle(
        (-length / 2, -width / 2), length, width, color=colour, zorder=order, transform=turn + axes.transData
    )


def _hull(record: RunRecord, axes: Axes) -> Patch:
    """Return the robot's hull where the run ended."""
    robot = cast("Json", record.meta.get("robot") or {})
    front, rear = cast("float", robot.get("front_m", 0.18)), cast("float", robot.get("rear_m", 0.26))
    width, last = cast("float", robot.get("width_m", 0.38)), record.poses[-1]
    turn = Affine2D().rotate(last.heading / 1e6).translate(last.x / 1e6, last.y / 1e6)
    return Rectangle(
        (-rear, -width / 2), front + rear, width, fill=False, linewidth=1.6, zorder=3, transform=turn + axes.transData
    )


def _speeds_figure(record: RunRecord) -> Figure:
    """Draw both wheels' rim speeds, what the motor pins ask for, and the heading."""
    figure = Figure(figsize=(10, 5), layout="constrained")
    speeds, heading = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    times = [p.t / NS_PER_S for p in record.poses]
    step = float(cast("float", record.meta.get("step_mps") or DEFAULT_STEP_MPS))
    for motor, colour, name in ((1, LEFT, "left"), (2, RIGHT, "right")):
        rim = [(p.left if motor == 1 else p.right) / 1e6 for p in record.poses]
        speeds.plot(times, rim, color=colour, linewidth=1.3, label=name)
        asked = motor_steps(record.pins, motor)
        if asked:
            ts = [t / NS_PER_S for t, _ in asked] + [record.last_ns / NS_PER_S]
            vs = [value * step for _, value in asked]
            speeds.step(ts, [*vs, vs[-1]], where="post", color=colour, linewidth=0.8, linestyle="--", alpha=0.7)
    speeds.set_ylabel("rim speed, m/s")
    speeds.legend(loc="upper right", ncols=2, frameon=False)
    heading.plot(times, [math.degrees(p.heading / 1e6) for p in record.poses], color=WALL, linewidth=1.1)
    heading.set(xlabel="time, s", ylabel="heading, °")
    for axes in (speeds, heading):
        axes.grid(alpha=0.3)
    return figure


def _pins_figure(record: RunRecord) -> Figure:
    """Draw each net's level over time, grouped as a person reads them."""
    rows = [(title, net) for title, nets in grouped(sorted(record.pins)) for net in nets]
    figure = Figure(figsize=(10, 0.5 + 0.28 * max(4, len(rows))), layout="constrained")
    axes = figure.add_subplot()
    end = record.last_ns / NS_PER_S
    for row, (title, net) in enumerate(reversed(rows)):
        edges = [(t / NS_PER_S, level) for t, level in record.pins[net]]
        times = [t for t, _ in edges] + [end]
        levels = [row + 0.7 * level for _, level in edges]
        colour = RIGHT if "right" in title else LEFT
        axes.step(times, [*levels, levels[-1]], where="post", color=colour, linewidth=1)
    axes.set_yticks([row + 0.35 for row in range(len(rows))], [net for _, net in reversed(rows)], fontsize=8)
    axes.set(xlabel="time, s", xlim=(0, max(end, 1e-6)), title="pins")
    axes.grid(axis="x", alpha=0.3)
    return figure
