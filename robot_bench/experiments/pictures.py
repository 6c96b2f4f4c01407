"""Pictures of experiments, drawn by Matplotlib's object interface: no display, no global state.

Invariant: the same figures give the same bytes.
"""

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from robot_bench.experiments.comparison import Comparison
from robot_bench.experiments.comparison_page import names_of
from robot_bench.experiments.parting import motion_parts_s
from robot_bench.experiments.sensitivity import ParameterEffect
from simbase.files import writing

#: The colours of the report's plots.
ONE, OTHER, MARK = "#1b6ca8", "#c8553d", "#4a5560"
DOTS_PER_INCH = 110
#: Matplotlib ships no types: its axes are what they are.
Axes = Any


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file's bytes."""
    FigureCanvasAgg(figure)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return file.getvalue()


def write_png(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG file.

    Raises:
        FileError: It cannot be written.
    """
    with writing(path):
        path.write_bytes(png(figure))


def comparison_figure(found: Comparison) -> Figure:
    """Draw both ways over one another, and speeds, distance and headings over time, with where they part."""
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.0, 1.15))
    plan = figure.add_subplot(grid[:, 0])
    ours, theirs = found.ours, found.theirs
    names = names_of(found)
    plan.plot(ours.x_m, ours.y_m, color=ONE, linewidth=2.4, label=names[0])
    plan.plot(theirs.x_m, theirs.y_m, color=OTHER, linewidth=1.4, linestyle=(0, (5, 3)), label=names[1])
    plan.plot(ours.x_m[0], ours.y_m[0], "o", color=ONE)
    plan.set_aspect("equal", adjustable="datalim")
    plan.set(xlabel="x, m", ylabel="y, m")
    plan.legend(loc="upper left", bbox_to_anchor=(0.0, 1.12), ncols=1, frameon=False)
    rows: list[Axes] = []
    for place in range(3):
        rows.append(figure.add_subplot(grid[place, 1], sharex=rows[0] if rows else None))
    (at, speed, _), (_, their_speed, _) = ours.speeds(), theirs.speeds()
    rows[0].plot(at, speed, color=ONE, linewidth=1.8)
    rows[0].plot(at, their_speed, color=OTHER, linewidth=1.1, linestyle=(0, (5, 3)))
    rows[0].set_ylabel("speed, m/s")
    apart = [math.hypot(a - b, c - d) for a, b, c, d in zip(theirs.x_m, ours.x_m, theirs.y_m, ours.y_m, strict=True)]
    rows[1].plot(ours.t_s, apart, color=MARK)
    rows[1].set_ylabel("apart, m")
    rows[2].plot(ours.t_s, (theirs.heading_rad - ours.heading_rad) * 180 / math.pi, color=MARK)
    rows[2].set(ylabel="heading differs, deg", xlabel=f"time of {names[0]}, s")
    came = found.origin
    for axes in rows:
        axes.grid(visible=True, color="#e3e3e3")
        axes.margins(x=0)
        if came is not None:
            axes.axvline(came[1], color=OTHER, linewidth=1.0)
    if came is not None:
        part, begin = came
        says = "parts" if motion_parts_s(found.parts) is not None else "the motion does not part; differs"
        rows[0].set_title(f"{says} at {begin:.2f} s: {part.signal} ({part.bound.stage})", fontsize=10, color=OTHER)
    return figure


def latency_figure(title: str, rows: Sequence[tuple[str, Sequence[float]]]) -> Figure:
    """Draw the share of each step's times that are no longer than so many ms; the last row broader: it is the whole."""
    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for number, (name, seconds) in enumerate(rows):
        times = sorted(1000 * value for value in seconds)
        shares = [100 * place / len(times) for place in range(len(times) + 1)]
        is_whole = number == len(rows) - 1
        axes.step(
            [times[0], *times], shares, where="post", label=f"{name}, {len(times)}",
            linewidth=2.6 if is_whole else 1.6, color=MARK if is_whole else None,
        )  # fmt: skip
    axes.set_xscale("symlog", linthresh=1.0)
    axes.set_xticks([0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000], ["0", "1", "2", "5", "10", "20", "50", "100", "200",
                    "500", "1000"])  # fmt: skip
    axes.set_xlim(left=0)
    axes.set(xlabel="ms", ylabel="% no longer", title=title)
    axes.grid(visible=True, color="#e3e3e3")
    axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def effects_figure(title: str, effects: Mapping[str, Sequence[ParameterEffect]]) -> Figure:
    """Draw, for each outcome, each parameter's mu* with its interval, what it does alone, and Sobol's indices."""
    counts = [len(rows) for rows in effects.values()]
    has_indices = any(one.ST is not None for rows in effects.values() for one in rows)
    figure = Figure(
        figsize=(12.0 if has_indices else 8.0, 1.0 + sum(0.9 + 0.36 * count for count in counts)), layout="constrained"
    )
    grid = figure.subplots(
        len(counts), 1 + has_indices, squeeze=False, gridspec_kw={"height_ratios": [1.0 + n for n in counts]}
    )
    for axes, (name, rows) in zip(grid[:, 0], effects.items(), strict=True):
        places = [*range(len(rows))]
        axes.barh(
            places, [one.mu_star or 0.0 for one in rows], xerr=[one.mu_star_conf or 0.0 for one in rows],
            color="#9dbdd6", ecolor=MARK, capsize=3, label="mu*, with its 95 % interval",
        )  # fmt: skip
        axes.plot([one.spread or 0.0 for one in rows], places, "o", color=OTHER, label="alone")
        axes.set_yticks(places, [one.key for one in rows])
        axes.invert_yaxis()
        axes.set_xlim(left=0)
        axes.set_title(name, loc="left", fontsize=10)
        axes.grid(visible=True, axis="x", color="#e3e3e3")
        axes.set_axisbelow(True)
    grid[0, 0].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=9)
    if has_indices:
        for axes, rows in zip(grid[:, 1], effects.values(), strict=True):
            _draw_indices(axes, rows)
        grid[0, 1].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=9)
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_indices(axes: Axes, rows: Sequence[ParameterEffect]) -> None:
    """Draw each parameter's shares of the variance: by itself, and below it together with the others."""
    places = [*range(len(rows))]
    for aside, colour, name, label in ((-0.2, OTHER, "S1", "S1, alone"), (0.2, "#dccfc4", "ST", "ST, with the others")):
        axes.barh(
            [place + aside for place in places], [max(getattr(one, name) or 0.0, 0.0) for one in rows], height=0.36,
            xerr=[getattr(one, f"{name}_conf") or 0.0 for one in rows], color=colour, ecolor=MARK, capsize=3,
            label=label,
        )  # fmt: skip
    axes.set_yticks(places, [one.key for one in rows])
    axes.invert_yaxis()
    axes.set_xlim(0.0, max(1.0, *(one.ST or 0.0 for one in rows)) * 1.02)
    axes.set_title("share of the variance", loc="left", fontsize=10)
    axes.grid(visible=True, axis="x", color="#e3e3e3")
    axes.set_axisbelow(True)
