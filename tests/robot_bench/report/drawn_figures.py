"""A Matplotlib figure as lines of text.

What a reader sees is in it: axes in inches, limits, ticks, and of each curve, patch and text its points and its look.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

#: What each kind of artist looks like, by its getters.
LOOKS = {
    "Line2D": ("color", "linewidth", "linestyle", "drawstyle", "marker", "markersize", "markeredgewidth", "zorder",
               "clip_on", "solid_capstyle"),
    "Text": ("color", "fontsize", "fontweight", "ha", "va", "zorder"),
    "Patch": ("facecolor", "edgecolor", "linewidth", "fill", "zorder"),
    "LineCollection": ("color",),
    "Axes": ("aspect", "adjustable", "xscale", "yscale", "axisbelow"),
}  # fmt: skip


def lines_of(figure: Any) -> Iterator[str]:
    """Go through what is drawn."""
    yield f"figure {_plain(figure.get_size_inches())}"
    for legend in figure.legends:
        yield from _of_legend(legend)
    for text in figure.texts:
        yield f"text {text.get_text()!r} {text.get_fontsize():g}"
    for axes in figure.axes:
        inches = axes.get_position(original=True).bounds * np.array([*figure.get_size_inches()] * 2)
        yield f"axes {_plain(inches)} {_looks(axes, 'Axes')}"
        yield from _of_axis("x", axes.xaxis, axes.get_xlim())
        yield from _of_axis("y", axes.yaxis, axes.get_ylim())
        yield from _of_what_is_on(axes)
        if axes.get_legend() is not None:
            yield from _of_legend(axes.get_legend())


def _of_axis(name: str, axis: Any, limits: tuple[float, float]) -> Iterator[str]:
    yield f"  {name} {_plain(limits)} {axis.get_label().get_text()!r}{_ticks(axis)}"
    tick = axis.get_major_ticks(1)[0]
    line, length = tick.gridline, tick.tick1line.get_markersize()
    yield f"    grid {line.get_visible()} {line.get_color()} {line.get_alpha()} length {length:g}"


def _of_what_is_on(axes: Any) -> Iterator[str]:
    for title in (axes._left_title, axes.title, axes._right_title):
        if title.get_text():
            yield f"  title {title.get_text()!r} {_looks(title, 'Text')}"
    for line in axes.lines:
        points = line.get_xydata()
        if line.get_transform() is axes.transAxes:
            points = line.get_transform().transform(points)
        dashes = _plain(line._unscaled_dash_pattern)
        yield f"  line {line.get_label()!r} {_plain(points)} {_looks(line, 'Line2D')} {dashes}"
    for patch in axes.patches:
        shape = patch.get_path().transformed(patch.get_transform() - axes.transData).vertices
        yield f"  {type(patch).__name__} {_plain(shape[:8])} {_looks(patch, 'Patch')}"
    for each in axes.collections:
        yield f"  {type(each).__name__} {_plain(each.get_segments())} {_looks(each, 'LineCollection')}"
    for text in axes.texts:
        offset = text.get_position() if getattr(text, "xy", None) is not None else ()
        effects = [each._gc for each in text.get_path_effects()]
        at = getattr(text, "xy", text.get_position())
        yield f"  text {text.get_text()!r} {_plain(at)} {_plain(offset)} {_looks(text, 'Text')} {effects}"


def _of_legend(legend: Any) -> Iterator[str]:
    names = [(text.get_text(), text.get_fontsize()) for text in legend.get_texts()]
    box = legend.get_bbox_to_anchor().bounds
    yield f"legend {names} frame {legend.get_frame_on()} at {legend._loc} columns {legend._ncols} {_plain(box)}"


def _ticks(axis: Any) -> str:
    """Return the ticks that are said; where Matplotlib finds them itself they are none of the picture's."""
    locator = type(axis.get_major_locator()).__name__
    if locator not in {"FixedLocator", "MultipleLocator"}:
        return ""
    labels = [(each.get_text(), each.get_fontsize(), each.get_fontweight()) for each in axis.get_ticklabels()]
    return f" {locator} {_plain(axis.get_ticklocs())} {labels}"


def _looks(artist: Any, kind: str) -> str:
    return " ".join(f"{name}={_plain(getattr(artist, f'get_{name}')())}" for name in LOOKS[kind])


def _plain(value: Any) -> str:
    """Return a value with numbers of six digits."""
    if isinstance(value, str | bool | None):
        return str(value)
    if isinstance(value, np.ndarray | list | tuple):
        return f"[{' '.join(map(_plain, value))}]"
    return f"{round(float(value), 9) + 0.0:.6g}"
