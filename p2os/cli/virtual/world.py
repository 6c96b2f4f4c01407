"""`p2os world`: list, draw, check, make, convert and export the places a robot can be in, and robots."""

import json
import shutil
import sys
from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import ROBOTS
from p2os.cli.kept_files import FORCE_HELP, refuse_to_overwrite
from p2os.cli.names import robots, worlds
from p2os.cli.quantities import option
from p2os.pioneer.export import FORMATS, Export, export
from p2os.pioneer.world import known_worlds, load_world
from p2os.pioneer.world.drawing import svg, text, text_key
from p2os.pioneer.world.makers import KINDS, make_world
from p2os.pioneer.world.model import World
from p2os.pioneer.world.placing import Placing
from p2os.pioneer.world.readers import read_placed
from p2os.pioneer.world.start_places import refuse_start
from p2os.pioneer.world.writer import write_world
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from simbase.files import write_text, writing
from simbase.units import SEED

HELP = """List, draw, check, generate and convert worlds.

A world is one that ships, a TOML file, or another program's file: an ARIA map,
an occupancy image with its YAML, SDF, URDF, OBJ, STL, COLLADA or glTF.

\b
Examples:
  p2os world list                                 those that ship
  p2os world show maze                            draw one in the terminal
  p2os world show room.dae --out room.svg         as a picture
  p2os world check my.toml                        find what is wrong, with its line
  p2os world new --kind maze --seed 7 --out my.toml
  p2os world convert floor.yaml --out floor.toml
  p2os world convert room --out room.sdf          for another program: .sdf, .urdf,
                                                  .xml (MuJoCo), .gltf, .glb
  p2os world convert room --robot p2dx --out room.sdf
  p2os world convert --robot p2dx --out p2dx.urdf
"""
LIST_HELP = """List the worlds that ship.

\b
Examples:
  p2os world list
"""
SHOW_HELP = """Draw a world in the terminal, or into a file.

\b
Examples:
  p2os world show maze
  p2os world show room --out room.svg
"""
CHECK_HELP = """Check a world and print its content; errors name their line.

A start where no p2dx can stand is an error too.

\b
Examples:
  p2os world check my.toml
"""
NEW_HELP = """Generate a world from a seed.

\b
Examples:
  p2os world new --kind maze --seed 7 --out my.toml
"""
CONVERT_HELP = """Write a world as TOML, or world and robot for another program.

The file's ending selects the format: .toml, .sdf, .urdf, .xml (MuJoCo's
MJCF), .gltf or .glb. What a format cannot hold is reported, a line each.

\b
Examples:
  p2os world convert floor.yaml --out floor.toml
  p2os world convert room --robot p2dx --out room.sdf
"""
#: Widest drawing in a terminal, in characters.
WIDEST_COLUMNS = 100
TOML = ".toml"
#: Files whose up axis may be named.
MESH_SUFFIXES = (".obj", ".stl", ".dae", ".gltf", ".glb")

WORLD = Annotated[
    str, typer.Argument(help="A world that ships, or a file.", metavar="WORLD|FILE", autocompletion=worlds)
]
CONVERTED = Annotated[
    str | None,
    typer.Argument(help="A world that ships, or a file.", metavar="WORLD|FILE", autocompletion=worlds),
]
FORCE = Annotated[bool, typer.Option("--force", help=FORCE_HELP)]
WORLD_SEED = Annotated[int, option(SEED, "--seed", purpose="Of a world that is made from one.", least="0", shown="0")]
UP = Annotated[
    str,
    typer.Option(
        help="Which axis is up in a mesh file; auto is what its format states or usually has.", metavar="auto|x|y|z"
    ),
]


def register(app: typer.Typer) -> None:
    """Add the verb."""
    world = typer.Typer(help=HELP, rich_markup_mode=None)
    world.callback(invoke_without_command=True)(_without_verb)
    world.command("list", help=LIST_HELP)(list_worlds)
    world.command("show", help=SHOW_HELP)(show)
    world.command("check", help=CHECK_HELP)(check)
    world.command("new", help=NEW_HELP)(new)
    world.command("convert", help=CONVERT_HELP)(convert)
    app.add_typer(world, name="world", help=HELP, rich_help_panel=ROBOTS)


def _without_verb(context: typer.Context) -> None:
    """List the worlds where nothing else is asked for."""
    if context.invoked_subcommand is None:
        list_worlds(json_output=False)


def list_worlds(
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON object.")] = False,
) -> None:
    """List them."""
    worlds = [load_world(name) for name in known_worlds()]
    if json_output:
        typer.echo(json.dumps({world.name: world.description for world in worlds}, indent=2))
        return
    for world in worlds:
        typer.echo(f"{world.name:<10}{_size(world):>14}  {world.description}")


def show(
    world: WORLD,
    out: Annotated[Path | None, typer.Option(help="Write a picture, an .svg.", metavar="FILE")] = None,
    seed: WORLD_SEED = 0,
    up: UP = "auto",
) -> None:
    """Draw one."""
    place = _load(world, seed, up)
    _print_skipped(place)
    if out is None:
        columns = min(shutil.get_terminal_size((80, 24)).columns, WIDEST_COLUMNS)
        typer.echo("\n".join([*text(place, columns), text_key(place, columns)]))
        typer.echo(_summary(place))
        return
    if out.suffix.lower() != ".svg":
        raise UsageError(f"no picture can be written to {out}", hint="--out FILE.svg")
    write_text(out, svg(place))
    typer.echo(f"{out}: {_summary(place)}")


def check(world: WORLD, seed: WORLD_SEED = 0, up: UP = "auto") -> None:
    """Check one."""
    place = _load(world, seed, up)
    _print_skipped(place)
    refuse_start(place, load_parameters("p2dx"), place.start, place.start_at)
    typer.echo(f"{place.source}: {_summary(place)}")


def new(
    out: Annotated[
        Path | None, typer.Option(help="The file to write; without it the text is printed.", metavar="FILE")
    ] = None,
    kind: Annotated[str, typer.Option(help="What to make.", metavar="|".join(KINDS))] = "arena",
    seed: Annotated[
        int, option(SEED, "--seed", purpose="The same seed makes the same world.", least="0", shown="0")
    ] = 0,
    force: FORCE = False,
) -> None:
    """Make one."""
    _write(make_world(kind, seed), out, force=force)


def convert(
    world: CONVERTED = None,
    out: Annotated[
        Path | None,
        typer.Option(help="The file to write; without it the text of a TOML file is printed.", metavar="FILE"),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Put this robot at the start; without a WORLD, the robot alone.",
            metavar="MODEL|FILE",
            autocompletion=robots,
        ),
    ] = None,
    seed: WORLD_SEED = 0,
    up: UP = "auto",
    force: FORCE = False,
) -> None:
    """Convert one."""
    place = None if world is None else _load(world, seed, up)
    if place is not None:
        _print_skipped(place)
    if place is not None and robot is None and (out is None or out.suffix.lower() == ".toml"):
        _write(place, out, force=force)
        return
    if place is None and robot is None:
        raise UsageError("neither a world nor a robot is named", hint="p2os world convert room --out room.sdf")
    if out is None or out.suffix.lower() not in FORMATS:
        raise UsageError(
            f"a {'world' if robot is None else 'robot'} cannot be written to {out or 'a terminal'}",
            hint=f"--out FILE with {', '.join((*[TOML] * (robot is None), *FORMATS))}",
        )
    parameters = None if robot is None else load_parameters(robot)
    if place is not None and parameters is not None:
        refuse_start(place, parameters, place.start, place.start_at)
    _write_files(export(out, place, parameters), out.parent, force=force)
    what = [] if place is None else [_summary(place)]
    typer.echo(f"{out}: {', with '.join([*what, *([] if parameters is None else [parameters.title])])}")


def _load(world: str, seed: int, up: str) -> World:
    """Return a world; only a mesh file takes an up axis."""
    if up == "auto":
        return load_world(world, seed)
    path = Path(world)
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise UsageError(f"--up is for a mesh file, not for {world}", hint=f"a file with {', '.join(MESH_SUFFIXES)}")
    return read_placed(path, Placing(up=up))


def _write(place: World, out: Path | None, *, force: bool) -> None:
    """Write a world as TOML."""
    if out is None:
        sys.stdout.write(write_world(place))
        return
    if out.suffix.lower() != TOML:
        raise UsageError(f"a world cannot be written to {out}", hint="--out FILE.toml")
    _write_files(Export(files={out.name: write_world(place).encode()}, losses=()), out.parent, force=force)
    typer.echo(f"{out}: {_summary(place)}")


def _write_files(made: Export, folder: Path, *, force: bool) -> None:
    """Write files into a folder, all or none where one is there already; say what they do not hold."""
    for name in made.files:
        refuse_to_overwrite(folder / name, force=force)
    for name, data in made.files.items():
        with writing(folder / name):
            (folder / name).write_bytes(data)
    for line in made.losses:
        sys.stderr.write(f"note: {line}\n")


def _summary(place: World) -> str:
    """Return what a world holds, in a line."""
    moving = sum(item.walk is not None for item in place.obstacles)
    pushed = sum(item.mass_kg > 0 for item in place.obstacles)
    counts = [
        (len(place.obstacles), "obstacle"), (len(place.meshes), "mesh"), (moving, "that walks"),
        (pushed, "that can be pushed"),
    ]  # fmt: skip
    counted = ", ".join(_count(number, what) for number, what in counts if number or what == "obstacle")
    kinds = Counter(mark.kind for mark in place.marks)
    marks = f"; marks: {', '.join(f'{number} {kind}' for kind, number in kinds.items())}" if kinds else ""
    return f"{place.name}, {_size(place)}: {counted}{marks}"


def _count(number: int, what: str) -> str:
    if what.startswith("that"):
        return f"{number} {what if number == 1 else what.replace('walks', 'walk')}"
    plural = {"mesh": "meshes"}.get(what, f"{what}s")
    return f"{number} {what if number == 1 else plural}"


def _size(place: World) -> str:
    x0, y0, x1, y1 = place.extent
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} m"


def _print_skipped(place: World) -> None:
    for line in place.skipped:
        sys.stderr.write(f"note: {line}\n")
