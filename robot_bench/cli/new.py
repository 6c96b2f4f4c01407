"""`p2os new`: a project of the user's own that builds and drives at once."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.help_pages import BENCH
from p2os.pioneer.body.factory import BEST, resolve_body
from robot_bench.firmware.build import COMPILER
from robot_bench.project.files import project_files, write_project

HELP = """Write a project of your own: a BluePill program that drives.

FOLDER is new or empty. It gets one C file to change, start-up code, linker
script, register names, a Makefile, a scenario without goals, and a README.

\b
Examples:
  p2os new my-robot        then: cd my-robot && make run
  p2os new .               the folder you are in, if it is empty
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("new", help=HELP, rich_help_panel=BENCH)(new)


def new(folder: Annotated[Path, typer.Argument(help="A folder that is new or empty.", metavar="FOLDER")]) -> None:
    """Write a project."""
    body = resolve_body(BEST)
    contents = project_files(body)
    write_project(folder, contents)
    typer.echo(f"{folder}: {len(contents)} files; main.c is yours, README.md says the rest (body {body})")
    if shutil.which(COMPILER) is None:
        typer.echo(f"{COMPILER} is not installed: sudo apt-get install gcc-arm-none-eabi make", err=True)
    change = "" if folder.resolve() == Path.cwd() else f"cd {folder} && "
    typer.echo(f"next: {change}make run")
