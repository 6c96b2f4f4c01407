"""The picture of `p2os compare-pins`: the levels of each pin in the run and in the capture around one edge.

Invariant: the same comparison gives the same bytes, PNG and SVG.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bluepill_sim.analysis.waveforms.alignment import Met
from bluepill_sim.analysis.waveforms.comparison import PinComparison
from robot_bench.report.plots import DOTS_PER_INCH, HIT, LEFT, RIGHT
from simbase.errors import UsageError
from simbase.files import writing

#: By the ending of the file: the format's name, and what is written into it.
FORMATS: dict[str, dict[str, Any]] = {".png": {"Software": None}, ".svg": {"Date": None, "Creator": None}}
#: chosen: so many edges of the pin are seen on each side of the one that is shown, and at most so many pins.
_AROUND, MOST_PINS = 6, 16
#: Of a row of a pin: the run is drawn above the capture.
_HEIGHT, _RUN, _CAPTURE = 2.6, 1.3, 0.0


def refuse_other_formats(path: Path) -> None:
    """Refuse a name that ends in no format.

    Raises:
        UsageError: It does.
    """
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"{path}: a picture ends in {' or '.join(FORMATS)}")


def write_edge_picture(found: PinComparison, path: Path, title: str) -> None:
    """Draw both around the first edge that is not explained, or around the first that is.

    Raises:
        UsageError: The name has the ending of no format.
        FileError: The file cannot be written.
    """
    refuse_other_formats(path)
    suffix = path.suffix.lower()
    figure = _figure(found, title)
    FigureCanvasAgg(figure)
    with writing(path), mpl.rc_context({"svg.hashsalt": "p2os", "svg.fonttype": "none"}):
        figure.savefig(path, format=suffix[1:], dpi=DOTS_PER_INCH, metadata=FORMATS[suffix])


def _figure(found: PinComparison, title: str) -> Figure:
    first = found.first
    shown = [one for one in found.met if one.track.run or one.track.capture]
    if first is not None:
        shown.sort(key=lambda one: one.track.channel != first.channel)
    shown = shown[:MOST_PINS]
    at_ns = first.run_ns if first is not None else min(
        (one.track.run[one.pairs[0][1]][0] for one in shown if one.pairs), default=0.0
    )  # fmt: skip
    begin, end = _window(shown, found, at_ns)
    unit, scale = next((unit, scale) for unit, scale in (("s", 1e9), ("ms", 1e6), ("µs", 1e3), ("ns", 1.0))
                       if end - begin >= scale or scale == 1.0)  # fmt: skip
    figure = Figure(figsize=(9.0, 1.1 + 0.62 * len(shown)), layout="constrained")
    axes: Any = figure.add_subplot()
    for place, one in enumerate(shown):
        base: float = _HEIGHT * (len(shown) - 1 - place)
        in_run = [(found.alignment.clock.in_run(at), level) for at, level in one.track.capture]
        for levels, height, colour in ((one.track.run, _RUN, LEFT), (in_run, _CAPTURE, RIGHT)):
            at_edges, steps = _steps(levels, (begin, end))
            axes.step([(at - at_ns) / scale for at in at_edges], [base + height + level for level in steps],
                      where="post", color=colour, linewidth=1.2)  # fmt: skip
        for number in one.missing:
            _mark(axes, (one.track.run[number][0], base + _RUN), (begin, end), (at_ns, scale))
        for number in one.added:
            _mark(axes, (in_run[number][0], base + _CAPTURE), (begin, end), (at_ns, scale))
    names = [f"{one.track.pin}\n{one.track.channel}" for one in shown]
    axes.set_yticks([_HEIGHT * (len(shown) - 1 - n) + 1.15 for n in range(len(shown))], names, fontsize=8)
    axes.tick_params(axis="y", length=0)
    axes.axvline(0, color=HIT if first else "#b0b8bf", linewidth=0.8)
    axes.set(xlim=((begin - at_ns) / scale, (end - at_ns) / scale), ylim=(-0.3, _HEIGHT * len(shown)),
             xlabel=f"{unit} from {at_ns / 1e9:.9f} s of the run")  # fmt: skip
    axes.grid(axis="x", alpha=0.3)
    axes.set_title(title, fontsize=9)
    for label, colour, across in (("run", LEFT, 0.88), ("capture", RIGHT, 0.94)):
        axes.text(across, 1.01, label, color=colour, fontsize=8, transform=axes.transAxes)
    return figure


def _window(shown: Sequence[Met], found: PinComparison, at_ns: float) -> tuple[float, float]:
    """Return from when to when is shown: some edges of the first pin on both sides."""
    track = shown[0].track if shown else None
    times = [] if track is None else sorted(
        [at for at, _ in track.run] + [found.alignment.clock.in_run(at) for at, _ in track.capture]
    )  # fmt: skip
    before, behind = (
        [at for at in times if at < at_ns][-2 * _AROUND :],
        [at for at in times if at > at_ns][: 2 * _AROUND],
    )
    least = 8 * found.limits.near_ns
    begin, end = min([*before, at_ns - least]), max([*behind, at_ns + least])
    edge = 0.05 * (end - begin)
    return begin - edge, end + edge


def _steps(edges: Sequence[tuple[float, int]], window: tuple[float, float]) -> tuple[list[float], list[int]]:
    """Return times and levels within a window, with the level at its ends."""
    within = [edge for edge in edges if window[0] <= edge[0] <= window[1]]
    before = [level for at, level in edges if at < window[0]]
    first = before[-1] if before else within[0][1] ^ 1 if within else 1 - edges[0][1] if edges else 0
    levels = [first, *(level for _, level in within)]
    return [window[0], *(at for at, _ in within), window[1]], [*levels, levels[-1]]


def _mark(
    axes: Any,
    place: tuple[float, float],
    window: tuple[float, float],
    units: tuple[float, float],
) -> None:
    if window[0] <= place[0] <= window[1]:
        axes.plot((place[0] - units[0]) / units[1], place[1] + 0.5, "x", color=HIT, markersize=7, mew=1.8)
