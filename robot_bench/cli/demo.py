"""`p2os demo`: the most useful thing to see first."""

from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.pioneer.body.factory import BEST
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.run import end_with
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.timing import NS_PER_S, Nanos
from simbase.units import TIME

HELP = """Watch a BluePill program drive a Pioneer around obstacles.

It runs the shipped program `dodge` for 120 s of virtual time on an emulated
BluePill, with adapter, P2OS line and virtual Pioneer. The body is the best that
is installed: PyBullet, else MuJoCo, else the plan view.

\b
Examples:
  p2os demo                    the whole run, with a report
  p2os demo --duration 20s     a shorter one
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("demo", help=HELP, rich_help_panel=BENCH)(demo)


def demo(
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/demo-NNN.", metavar="FOLDER")] = None,
    duration_ns: Annotated[
        Nanos | None, option(TIME, "--duration", purpose="How much virtual time.", above_zero=True)
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the run that the --out folder holds.")] = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Run the demonstration."""
    scenario = load_scenario("dodge").with_options(
        mode="adapter", world="room", body=BEST,
        duration_s=None if duration_ns is None else duration_ns / NS_PER_S,
    )  # fmt: skip
    folder = out or make_next_folder("demo")
    with RunDisplay() as display:
        result = run_scenario(scenario, folder, on_progress=display.update, force=force, files=Files.PLOTS)
    end_with(result, json_output=json_output)
