"""What a shell has of a house's verbs: a page of the manual each, and what completes a line in bash, zsh and fish.

All of it is made of the verbs' own help, so there is nothing to keep up.
"""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import cast

import typer
from typer.core import TyperGroup

from p2os.cli.main import make_app
from simbase.command_line.help_pages import first_sentence

PROGRAM = "p2os"
MANUAL = "share/man/man1"
#: Shell → where it looks for a completion.
COMPLETIONS: Mapping[str, str] = {
    "bash": f"share/bash-completion/completions/{PROGRAM}",
    "zsh": f"share/zsh/site-functions/_{PROGRAM}",
    "fish": f"share/fish/vendor_completions.d/{PROGRAM}.fish",
}
#: Of a page's literal text, columns.
WIDTH = 76


def pages(verbs: list[str], version: str) -> Iterator[tuple[str, str]]:
    """Yield name and text of the page of each verb, and of the verbs below it."""
    command = _program()
    root = typer.Context(command, info_name=PROGRAM)
    for verb in verbs:
        found = command.get_command(root, verb)
        if found is not None and not found.hidden:
            yield from _pages(found, typer.Context(found, info_name=verb, parent=root, terminal_width=WIDTH), version)


def program_page(version: str) -> str:
    """Return the page of the program itself: what it is, without the verbs, which depend on what is installed."""
    command = _program()
    context = typer.Context(command, info_name=PROGRAM, terminal_width=WIDTH)
    lines = command.get_help(context).splitlines()
    heads = [number for number, line in enumerate(lines) if line and line[0] != " " and line.endswith(":")]
    last = next((number for number in heads if lines[number] != "Options:"), len(lines))
    return _roff(PROGRAM, command.help or "", "\n".join(lines[:last]), version)


def completions() -> dict[str, str]:
    """Return the completion of each shell, by its path."""
    found = {}
    for shell, path in COMPLETIONS.items():
        done = subprocess.run(
            [sys.executable, "-m", PROGRAM], env=os.environ | {f"_{PROGRAM.upper()}_COMPLETE": f"source_{shell}"},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        found[path] = done.stdout
    return found


def written(place: Path, verbs: list[str], version: str, *, is_program: bool) -> dict[str, list[str]]:
    """Write the files of a house below a folder; return what goes where, as setuptools' data-files.

    Args:
        place: The house's sources.
        verbs: Its own.
        version: Of the house.
        is_program: The house has the program itself, and so what completes its lines.
    """
    files = {f"{MANUAL}/{name}.1": text for name, text in pages(verbs, version)}
    if is_program:
        files |= {f"{MANUAL}/{PROGRAM}.1": program_page(version)} | completions()
    for name, text in files.items():
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    folders: dict[str, list[str]] = {}
    for name in sorted(files):
        folders.setdefault(name.rpartition("/")[0], []).append(name)
    return folders


def _program() -> TyperGroup:
    return cast("TyperGroup", typer.main.get_command(make_app()))


def _pages(command: typer.core.TyperCommand, context: typer.Context, version: str) -> Iterator[tuple[str, str]]:
    name = context.command_path.replace(" ", "-")
    yield name, _roff(name, command.help or "", command.get_help(context), version)
    if isinstance(command, TyperGroup):
        for below in command.list_commands(context):
            found = command.get_command(context, below)
            if found is not None and not found.hidden:
                inner = typer.Context(found, info_name=below, parent=context, terminal_width=WIDTH)
                yield from _pages(found, inner, version)


def _roff(name: str, about: str, text: str, version: str) -> str:
    usage, _, rest = text.strip().partition("\n\n")
    lines = [
        f'.TH "{name.upper()}" "1" "" "{PROGRAM} {version}" "User Commands"',
        ".SH NAME", f"{_plain(name)} \\- {_plain(first_sentence(about))}",
        ".SH SYNOPSIS", ".nf", _plain(usage.removeprefix("Usage: ")),
        ".fi", ".SH DESCRIPTION", ".nf",
    ]  # fmt: skip
    for line in rest.splitlines():
        if line and not line.startswith(" ") and line.endswith(":"):
            lines += [".fi", f".SH {_plain(line.removesuffix(':').upper())}", ".nf"]
        else:
            lines.append(_plain(line.removeprefix("  ")))
    return "\n".join([*lines, ".fi", ""])


def _plain(line: str) -> str:
    text = line.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")
    return f"\\&{text}" if text.startswith(".") else text
