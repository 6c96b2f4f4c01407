"""`p2os metrics`: the figures of runs and captures: way, smoothness, clearance, energy, goals, latency by part."""

import json
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from p2os.cli.captures.reading import ProfileForLayouts, RobotForUnits, reading_of
from p2os.cli.groups import BENCH
from robot_bench.experiments import require
from simbase.errors import UsageError

if TYPE_CHECKING:  # NumPy is loaded when the verb runs
    from robot_bench.drives.metrics import Metrics

HELP = """Measure path, smoothness, clearance, energy, goals and latencies.

Loop latency is given by part: sonar ping, packet, sensor pin, motor pins,
command, wheels. Captures and tables give what they contain.

\b
Examples:
  p2os metrics runs/dodge-001
  p2os metrics runs/dodge-* --json
  p2os metrics runs/dodge-001 --picture latency.png
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("metrics", help=HELP, rich_help_panel=BENCH)(metrics)


def metrics(
    runs: Annotated[list[Path], typer.Argument(help="Run folders, recordings, tables.", metavar="RUN")],
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object a run.")] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Draw how the latencies of one run lie, PNG.", metavar="FILE")
    ] = None,
    robot: RobotForUnits = "",
    profile: ProfileForLayouts = None,
) -> None:
    """Measure drives."""
    require(*(["matplotlib"] if picture else []))
    from robot_bench.drives.metrics import metrics as measured
    from robot_bench.experiments.drive_files import read_drive

    if picture and len(runs) > 1:
        raise UsageError("a picture is of one run", hint="p2os metrics RUN --picture FILE")
    reader = partial(reading_of, robot=robot, profile=profile)
    for number, path in enumerate(runs):
        found = measured(read_drive(path, robot=robot, how=reader))
        if json_output:
            typer.echo(json.dumps(found.as_plain()))
        else:
            sys.stdout.writelines(f"{line}\n" for line in (*([""] if number else []), *lines_of(found)))
        if picture:
            _draw(found, picture)


def _draw(found: "Metrics", picture: Path) -> None:
    from robot_bench.drives.latency_budget import STEPS, WHOLE
    from robot_bench.experiments.pictures import latency_figure, write_png

    rows = [(name, found.latency.steps[name]) for name in (*STEPS, WHOLE) if found.latency.steps[name]]
    if not rows:
        raise UsageError(f"{found.name} shows no latencies", hint="a run with sensors, or a recording with commands")
    write_png(latency_figure(f"{found.name}: latency by part", rows), picture)


def lines_of(found: "Metrics") -> Iterator[str]:
    """Yield what a person reads, no line wider than 80 columns."""
    from robot_bench.drives.latency_budget import STEPS, WHOLE, quantiles
    from robot_bench.drives.metrics import SHOWN

    yield found.name
    for name, (words, unit, decimals) in SHOWN.items():
        value = getattr(found, name)
        if value is not None:
            yield f"  {words:31}{value:10.{decimals}f} {unit}".rstrip()
    for goal, met, at in found.goals:
        when = " " * 10 if at is None else f"{at:8.2f} s"
        yield f"  {'open' if met is None else 'met' if met else 'missed':7}{when}  {goal}"[:80]
    rows = [(name, quantiles(found.latency.of(name))) for name in (*STEPS, WHOLE)]
    if any(row["count"] for _, row in rows):
        yield f"  {'latency, ms':20}{'times':>8}{'median':>9}{'90 %':>9}{'99 %':>9}{'max':>9}"
        for name, row in rows:
            values = [float(str(row[key])) * 1000 for key in ("median", "p90", "p99", "max")] if row["count"] else []
            yield f"  {name:20}{row['count']:>8}" + "".join(f"{value:9.2f}" for value in values)
