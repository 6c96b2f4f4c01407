"""A world as a PNG picture, drawn with Matplotlib (extra `sim`): no display, no global state."""

from pathlib import Path

from p2os.pioneer.world.drawing import (
    GRID,
    START,
    X_AXIS,
    Y_AXIS,
    Look,
    arrow_length,
    grid_step,
    shapes,
    start_arrow,
    start_label,
    ticks,
)  # fmt: skip
from p2os.pioneer.world.model import World

LONGER_SIDE_INCHES = 6.0
SHORTEST_SIDE_INCHES = 1.6
DOTS_PER_INCH = 100


def write_png(world: World, path: Path) -> None:
    """Write the picture of a world.

    Raises:
        ModuleNotFoundError: Matplotlib is not installed.
        OSError: The file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle, Polygon
    from matplotlib.patheffects import withStroke

    x0, y0, x1, y1 = world.extent
    scale = LONGER_SIDE_INCHES / max(x1 - x0, y1 - y0)
    size = ((x1 - x0) * scale + 0.6, max((y1 - y0) * scale, SHORTEST_SIDE_INCHES) + 0.7)
    white = [withStroke(linewidth=2.5, foreground="white")]
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal")
    for order, shape in enumerate(shapes(world), start=2):
        colour = shape.look.value
        if shape.radius_m:
            axes.add_patch(Circle(shape.points[0], shape.radius_m, color=colour, zorder=order))
        elif shape.is_open:
            style = "--" if shape.look is Look.PATH else "-"
            axes.plot(*zip(*shape.points, strict=True), style, color=colour, linewidth=1.4, zorder=order)
        else:
            axes.add_patch(Polygon(shape.points, closed=True, color=colour, linewidth=0, zorder=order))
    arrow = start_arrow(world, arrow_length(world))
    axes.add_patch(Polygon(arrow, closed=True, color=START, zorder=1_000_000))
    at, below = (world.start.x_m, world.start.y_m), -arrow_length(world) * scale * 72 - 4
    axes.annotate(
        start_label(world), at, (0, below), textcoords="offset points", ha="center", va="top", color=START, fontsize=9,
        zorder=1_000_001, path_effects=white,
    )  # fmt: skip
    step = grid_step(max(x1 - x0, y1 - y0))
    axes.set(
        xlim=(x0, x1), ylim=(y0, y1), xticks=ticks(x0, x1, step), yticks=ticks(y0, y1, step), xlabel=X_AXIS,
        ylabel=Y_AXIS,
    )  # fmt: skip
    axes.set_title(world.name, loc="left", fontweight="bold")
    axes.grid(color=GRID, zorder=0)
    axes.set_axisbelow(True)
    figure.savefig(path, dpi=DOTS_PER_INCH, metadata={"Software": None})
