"""The section of a run's page with its figures: way, smoothness, clearance, work, goals, and the latency of its loop.

What is measured, and how, is `robot_bench.drives`; needs NumPy. A latency is drawn as it is distributed, all on one
scale, so that the steps of the loop can be compared.
"""

import html
from collections.abc import Sequence

from robot_bench.drives.drive import Floats
from robot_bench.drives.latency_budget import STEPS, WHOLE, quantiles
from robot_bench.drives.metrics import SHOWN, Metrics, metrics
from robot_bench.drives.of_run import drive_of_record
from robot_bench.recording.run_record import RunRecord
from simbase.errors import FileError

#: Bars of a distribution, and its size in the units of its drawing.
BARS, WIDTH, HEIGHT = 60, 240, 22
#: chosen: the scale ends at the whole's greatest, rounded up to such a step, ms.
SCALE_MS = 50
#: Quantiles in the order of the table.
COLUMNS = ("median", "p90", "p99", "max")


def measures_section(record: RunRecord) -> str:
    """Return the section; empty for a run without two poses."""
    try:
        found = metrics(drive_of_record("run", record))
    except FileError:
        return ""
    rows = [
        f"<tr><td>{html.escape(words)}</td><td>{value:.{decimals}f} {html.escape(unit)}</td></tr>"
        for name, (words, unit, decimals) in SHOWN.items()
        if (value := getattr(found, name)) is not None
    ]
    return (
        "<section><h2>Figures <small>formulas: docs/experiments.md</small></h2>"
        f'<table class="figures measures"><tbody>{"".join(rows)}</tbody></table>{_latency(found)}</section>'
    )


def _latency(found: Metrics) -> str:
    """Return the table of the loop's latency; empty where none was seen."""
    rows = {name: 1000 * found.latency.of(name) for name in (*STEPS, WHOLE) if found.latency.steps[name]}
    if not rows:
        return ""
    scale_ms = (int(max(values.max() for values in rows.values())) // SCALE_MS + 1) * SCALE_MS
    body = "".join(_row(name, values, scale_ms) for name, values in rows.items())
    head = "".join(f"<th>{column}</th>" for column in ("seen", "median", "90 %", "99 %", "max"))
    return (
        f"<h2>Latency of the loop by part <small>ms; drawn from 0 to {scale_ms} ms, a line at the median</small></h2>"
        f'<div class="wide"><table class="latency"><tr><th></th>{head}<th></th></tr>{body}</table></div>'
    )


def _row(name: str, values: Floats, scale_ms: float) -> str:
    figures = quantiles(values)
    cells = "".join(f"<td>{float(str(figures[column])):.2f}</td>" for column in COLUMNS)
    median = float(str(figures["median"]))
    return (
        f"<tr><td>{html.escape(name)}</td><td>{figures['count']}</td>{cells}"
        f"<td>{_distribution(name, values.tolist(), median, scale_ms)}</td></tr>"
    )


def _distribution(name: str, values: Sequence[float], median: float, scale_ms: float) -> str:
    """Return how values are distributed, as bars whose greatest fills the height."""
    counts = [0] * BARS
    for value in values:
        counts[min(BARS - 1, int(value / scale_ms * BARS))] += 1
    width, top = WIDTH / BARS, max(counts)
    bars = "".join(
        f'<rect x="{place * width:.1f}" y="{HEIGHT * (1 - count / top):.1f}" width="{width:.1f}"'
        f' height="{HEIGHT * count / top:.1f}"/>'
        for place, count in enumerate(counts) if count
    )  # fmt: skip
    at = median / scale_ms * WIDTH
    return (
        f'<svg class="distribution" viewBox="0 0 {WIDTH} {HEIGHT}" preserveAspectRatio="none" role="img"'
        f' aria-label="{html.escape(name)}: median {median:.1f} ms, greatest {max(values):.1f} ms">{bars}'
        f'<line x1="{at:.1f}" x2="{at:.1f}" y1="0" y2="{HEIGHT}"/></svg>'
    )
