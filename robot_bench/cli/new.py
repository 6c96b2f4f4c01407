"""`p2os new`: a project of the user's own that builds and drives at once."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.pioneer.body.factory import BEST, resolve_body
from robot_bench.firmware.build import COMPILER
from robot_bench.project.files import BUILDS, ROBOTS, project_files, write_project
from simbase.errors import UsageError

HELP = """Write a project of your own: a BluePill program that drives.

FOLDER is new or empty. It gets one C file to change, start-up code, linker
script, register names, what builds it, a scenario, tests, what CI services
and a debugger in an editor need, and a README.

\b
Examples:
  p2os new my-robot        then: cd my-robot && make run
  p2os new my-robot --build cmake
  p2os new my-rover --robot rover   PWM, encoders and ADC on own pins
  p2os new .               the folder you are in, if it is empty
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("new", help=HELP, rich_help_panel=BENCH)(new)


def new(
    folder: Annotated[Path, typer.Argument(help="A folder that is new or empty.", metavar="FOLDER")],
    build: Annotated[str, typer.Option(help="What builds it.", metavar="make|cmake|platformio")] = "make",
    robot: Annotated[
        str, typer.Option(help="A Pioneer behind the adapter, or a rover on own pins.", metavar="p2dx|rover")
    ] = "p2dx",
) -> None:
    """Write a project."""
    for option, value, known in (("build", build, BUILDS), ("robot", robot, ROBOTS)):
        if value not in known:
            raise UsageError(
                f"there is no --{option} {value!r}", hint=" or ".join(f"--{option} {one}" for one in known)
            )
    body = resolve_body(BEST) if robot == "p2dx" else "kinematic"
    contents = project_files(body, build=build, robot=robot)
    write_project(folder, contents)
    typer.echo(f"{folder}: {len(contents)} files; main.c is yours, README.md says the rest (body {body})")
    if shutil.which(COMPILER) is None:
        typer.echo(f"{COMPILER} is not installed: sudo apt-get install gcc-arm-none-eabi make", err=True)
    change = "" if folder.resolve() == Path.cwd() else f"cd {folder} && "
    then = "make run" if build == "make" else f"{BUILDS[build].commands} && p2os run just-drive.toml"
    typer.echo(f"next: {change}{then}")
