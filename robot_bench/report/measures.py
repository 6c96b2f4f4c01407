"""The section of a run's page with its figures: way, smoothness, clearance, work, goals, and the latency of its loop.

What is measured, and how, is `robot_bench.drives`; needs NumPy. Latencies are drawn as they are distributed, all on
one scale, so that the steps of the loop can be compared.
"""

from collections.abc import Iterator

from p2os.view.header import PageBlock, PageCell, PageCurve, PagePlot, PageSection, PageTable
from robot_bench.drives.drive import Floats
from robot_bench.drives.latency_budget import STEPS, WHOLE, quantiles
from robot_bench.drives.metrics import SHOWN, Metrics, metrics
from robot_bench.drives.of_run import drive_of_record
from robot_bench.recording.run_record import RunRecord
from simbase.errors import FileError

#: Bars of a distribution.
BARS = 60
#: chosen: the scale ends at the whole's greatest, rounded up to such a step, ms.
SCALE_MS = 50
#: Quantiles in the order of the table.
COLUMNS = ("median", "p90", "p99", "max")


def measures_section(record: RunRecord) -> Iterator[PageSection]:
    """Yield the sections; none for a run without two poses."""
    try:
        found = metrics(drive_of_record("run", record))
    except FileError:
        return
    rows = [
        [PageCell(text=words), PageCell(text=f"{value:.{decimals}f} {unit}".rstrip(), is_number=True)]
        for name, (words, unit, decimals) in SHOWN.items()
        if (value := getattr(found, name)) is not None
    ]
    yield PageSection(title="Drive", note="formulas: docs/experiments.md", blocks=[PageTable(rows=rows)])
    if blocks := _latency(found):
        yield PageSection(title="Latency of the loop by part", note="a line at the median", blocks=blocks)


def _latency(found: Metrics) -> list[PageBlock]:
    """Return the table of the loop's latency, and how each part of it is distributed; empty where none was seen."""
    rows = {name: 1000 * found.latency.of(name) for name in (*STEPS, WHOLE) if found.latency.steps[name]}
    if not rows:
        return []
    scale_ms = (int(max(values.max() for values in rows.values())) // SCALE_MS + 1) * SCALE_MS
    head = ("", "seen", "median, ms", "90 %, ms", "99 %, ms", "max, ms")
    table = PageTable(head=head, rows=[_row(name, values) for name, values in rows.items()])
    return [table, *(_distribution(name, values, scale_ms) for name, values in rows.items())]


def _row(name: str, values: Floats) -> list[PageCell]:
    figures = quantiles(values)
    cells = [str(figures["count"]), *(f"{float(str(figures[column])):.2f}" for column in COLUMNS)]
    return [PageCell(text=name), *(PageCell(text=cell, is_number=True) for cell in cells)]


def _distribution(name: str, values: Floats, scale_ms: float) -> PagePlot:
    """Return how often a part of the loop took how long."""
    counts = [0.0] * BARS
    for value in values.tolist():
        counts[min(BARS - 1, int(value / scale_ms * BARS))] += 1
    middles = [(place + 0.5) * scale_ms / BARS for place in range(BARS)]
    return PagePlot(
        title=name, x_name="latency", x_unit="ms", y_name="seen",
        curves=[PageCurve(name=name, x=middles, y=counts, style="bars")],
        marks=[float(str(quantiles(values)["median"]))],
    )  # fmt: skip
