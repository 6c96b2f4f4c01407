"""`p2os new`: a project of the user's own that builds and drives at once, or the bench beside one that is there."""

import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.pioneer.body.factory import BEST, resolve_body
from robot_bench.cli.project.existing import (
    SCENARIO,
    TESTS,
    FoundProject,
    files_beside,
    find_project,
    layout_of,
    seen_tests,
)
from robot_bench.cli.project.files import BUILDS, ROBOTS, project_files, write_files, write_project
from robot_bench.firmware.build import COMPILER
from simbase.errors import P2osError, UsageError, shown_name
from simbase.files import read_text, write_text

HELP = """Write a new project, or a bench beside an existing one.

FOLDER is new or empty. It gets a C file to change, start-up code, linker
script, register names, a build, a scenario, tests, settings for CI and for a
debugger, and a README.

--from finds the program and sources of an existing project (PlatformIO,
STM32CubeIDE, STM32CubeMX, Arduino, CMake, Zephyr, Rust, make) and writes a
scenario and tests into its folder bench/. The project's files stay unchanged.

\b
Examples:
  p2os new my-robot        then: cd my-robot && make run
  p2os new my-robot --build cmake
  p2os new my-rover --robot rover   PWM, encoders and ADC on own pins
  p2os new .               the folder you are in, if it is empty
  p2os new --from .        beside the project you are in, which was built
  p2os new --from blinky --build 'pio run'   builds it first
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("new", help=HELP, rich_help_panel=BENCH)(new)


def new(
    folder: Annotated[Path | None, typer.Argument(help="A folder that is new or empty.", metavar="FOLDER")] = None,
    build: Annotated[
        str | None,
        typer.Option(help="What builds it; with --from a command of yours.", metavar="make|cmake|platformio"),
    ] = None,
    robot: Annotated[
        str, typer.Option(help="A Pioneer behind the adapter, or a rover on own pins.", metavar="p2dx|rover")
    ] = "p2dx",
    from_: Annotated[
        Path | None, typer.Option("--from", help="A project that is there.", metavar="FOLDER")
    ] = None,
) -> None:  # fmt: skip
    """Write a project, or the bench beside one."""
    if (folder is None) == (from_ is None):
        raise UsageError("one folder is needed", hint="p2os new my-robot, or p2os new --from a-project-of-yours")
    if from_ is not None:
        if robot != "p2dx":
            raise UsageError("--robot is for a new project", hint="docs/own-robot.md says how a scenario has its own")
        _beside(from_, build or "")
    elif folder is not None:
        _new(folder, "make" if build is None else build, robot)


def _new(folder: Path, build: str, robot: str) -> None:
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
    then = "make run" if build == "make" else f"{BUILDS[build].commands} && p2os run just-drive.toml"
    typer.echo(f"next: {_change_to(folder)}{then}")


def _beside(folder: Path, build: str) -> None:
    """Put the bench beside a project.

    Raises:
        UsageError: The folder is no project that is known, or it was not built.
        P2osError: Its build fails.
    """
    layout = layout_of(folder)
    if (folder / SCENARIO).exists():
        raise UsageError(f"{shown_name(folder / SCENARIO)} is there already", hint="nothing is overwritten: remove it")
    if build:
        done = subprocess.run(build, shell=True, cwd=folder, check=False)  # noqa: S602  # as the user typed it
        if done.returncode:
            raise P2osError(f"the build has failed: {build} (exit code {done.returncode})")
    found = find_project(folder, layout, build)
    contents = files_beside(found, resolve_body(BEST))
    there = [name for name in contents if (folder / name).exists()]
    new_ones = {name: text for name, text in contents.items() if name not in there}
    write_files(folder, new_ones)
    write_text(folder / TESTS, read_text(folder / TESTS) + seen_tests(folder / SCENARIO))
    _tell(found, list(new_ones), there)


def _tell(found: FoundProject, written: list[str], there: list[str]) -> None:
    sources = found.sources if found.sources.parts else "the folder itself"
    typer.echo(f"{found.name} ({found.layout.name}): program {found.program}, sources {sources}")
    for other in found.others:
        typer.echo(f"older   {other}")
    typer.echo(f"written {', '.join(written)}")
    if there:
        typer.echo(f"left    {', '.join(there)}: there already")
    if found.layout.add and not (found.layout.is_tied and set(found.layout.ties) <= set(written)):
        typer.echo(f"add     {found.layout.add}")
    change = _change_to(found.folder)
    typer.echo(f"next    {change}pytest {SCENARIO.partition('/')[0]}")
    if found.layout.then:
        typer.echo(f"or      {change}{found.layout.then.format(made=found.program.parent.as_posix())}")


def _change_to(folder: Path) -> str:
    return "" if folder.resolve() == Path.cwd() else f"cd {shlex.quote(str(folder))} && "
