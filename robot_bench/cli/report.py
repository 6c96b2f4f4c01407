"""`p2os report`: makes everything in a run folder anew from its trace."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, cast

import typer

from p2os.cli.groups import BENCH
from robot_bench.recording.event_files import write_named_events
from robot_bench.recording.run_record import read_events, read_meta
from robot_bench.recording.together import named_events, robots_in, scenario_of
from robot_bench.report.make import Files, make_artefacts, make_artefacts_of_all
from simbase.entry_points import installed_points
from simbase.errors import UsageError, shown
from simbase.installation import way_to_plug_in
from simbase.user_classes import loaded

#: Entry points that write the events of a run as a bag, each by the name of its storage.
BAGS = "robot_bench.bags"

HELP = """Rebuild a run's report and other files from its trace.

trace.jsonl is the source. --events writes the events to a file instead: one per
line (.jsonl) or row (.parquet), or a scene with plots for Foxglove and Lichtblick
(.mcap); with --ros2, a rosbag2 folder. Several robots share one report and one
order of events. A killed run has its trace up to the last virtual second.

\b
Examples:
  p2os report runs/dodge-001          report.html, plots, pins.vcd, pins.sr, summary.json
  p2os report runs/dodge-001 --json   print the summary as well
  p2os report runs/dodge-001 --events all.parquet    only what happened, as a table
  p2os report runs/dodge-001 --events dodge.mcap     as a scene with plots
  p2os report runs/dodge-001 --events bag --ros2 mcap    as a rosbag2
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("report", help=HELP, rich_help_panel=BENCH)(report)


def report(
    folder: Annotated[Path, typer.Argument(help="A run folder.", metavar="FOLDER")],
    json_output: Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")] = False,
    events: Annotated[
        Path | None, typer.Option(help="Write its events, .jsonl, .parquet or .mcap, and no report.", metavar="FILE")
    ] = None,
    ros2: Annotated[
        str,
        typer.Option(
            "--ros2",
            help="With --events: a rosbag2 of this storage.",
            metavar="|".join(installed_points(BAGS)) or "STORAGE",
        ),
    ] = "",
) -> None:
    """Make a run's report."""
    names = robots_in(folder)
    if ros2:
        if events is None:
            raise UsageError("--ros2 goes with --events FOLDER", hint="--events bag --ros2 mcap")
        if names:
            raise UsageError(f"{folder} is of several robots; a bag is of one", hint=f"p2os report {folder / names[0]}")
        bags = installed_points(BAGS)
        if ros2 not in bags:
            raise UsageError(f"there is no storage {shown(ros2)}", hint=" or ".join(bags) or way_to_plug_in(BAGS))
        write = cast("Callable[..., int]", loaded(bags[ros2]))
        count = write(read_events(folder), events, read_meta(folder), ros2)
        typer.echo(f"{events}: {count} messages")
        return
    if events is not None:
        count = write_named_events(named_events(folder), events, None if names else read_meta(folder))
        typer.echo(f"{events}: {count} events")
        return
    if names:
        made = make_artefacts_of_all(folder, names, scenario_of(folder), Files.PLOTS)
    else:
        made = make_artefacts(folder, Files.PLOTS)
    if json_output:
        typer.echo(json.dumps(made.outcome, sort_keys=True))
        return
    for failure in cast("list[str]", made.outcome["failures"]):
        typer.echo(f"failed  {failure}")
    typer.echo(f"report: {made.report}")
