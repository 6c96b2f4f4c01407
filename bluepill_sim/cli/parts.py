"""`p2os mcu parts`: which parts can be attached; and what `p2os mcu run --attach` does with them."""

import inspect
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import print_status
from bluepill_sim.parts.attached import buses_of, words_of
from bluepill_sim.parts.registry import PARTS, attach, parse_part, part_class
from simbase.files import refuse_elsewhere, writing
from simbase.trust import own_code

HELP = """List the parts that can be attached, with their pins and settings.

\b
Examples:
  {program} parts             all of them
  {program} parts ssd1306     the settings of one
"""


def parts(name: str | None = typer.Argument(None, help="One of them; all without it.", metavar="PART")) -> None:
    """List parts."""
    if name is None:
        for kind, row in PARTS.items():
            typer.echo(f"{kind:14} {row.what}")
        return
    made = part_class(own_code(name))
    typer.echo((inspect.getdoc(made) or name).splitlines()[0])
    for what, words in (("on", buses_of(made)), ("pins", getattr(made, "PINS", {}))):
        if words:
            typer.echo(f"  {what:5} {', '.join(words)}")
    for key, argument in inspect.signature(made).parameters.items():
        given = "" if argument.default is inspect.Parameter.empty else f" = {_written(argument.default)}"
        typer.echo(f"  {key}{given}")


def attach_parts(board: BluePill, words: Sequence[str]) -> None:
    """Attach what `--attach` asks for.

    Raises:
        PartError: One is not understood, or cannot be attached so.
    """
    for one in words:
        attach(board, parse_part(one))


def show_parts(board: BluePill, folder: Path | None) -> None:
    """Print what each part has come to, and its picture on a terminal; write pictures and files into a folder.

    Raises:
        FileError: The folder cannot be written.
    """
    found = board.attached.by_name
    for name, words in words_of(found):
        print_status(f"{name}: {words}")
    for name, part in found.items():
        if hasattr(part, "picture") and sys.stderr.isatty():
            print_status(part.picture().text())
        if folder is not None:
            _write(folder, name, part)


def _write(folder: Path, name: str, part: Any) -> None:
    files: dict[str, bytes] = dict(part.files()) if hasattr(part, "files") else {}
    if hasattr(part, "picture"):
        picture = part.picture()
        files["png"] = picture.png(picture.scale())
    with writing(folder):
        for kind, data in files.items():
            path = refuse_elsewhere(folder, f"{name}.{kind}")
            folder.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
            print_status(f"{name}: {path}")


def _written(value: object) -> str:
    """Return a default as it is typed."""
    return (
        str(value).lower()
        if isinstance(value, bool)
        else "+".join(map(str, value))
        if isinstance(value, tuple)
        else str(value)
    )
