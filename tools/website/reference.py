"""The page of all commands: what `--help` prints of each verb, and a line of docs/ that uses it, with its output.

Lines are those of console blocks of docs/, which tests/test_docs.py runs: what is shown here has come.
"""

import os
import shlex
from collections.abc import Iterator
from pathlib import Path

import typer
from typer.core import TyperCommand, TyperGroup

from p2os.cli.main import NAME, make_app
from tests.documentation.page import ROOT, Page, pages

#: Columns of the terminal whose help is shown.
COLUMNS = 80
#: Most lines of output that are shown of a use.
MOST_LINES = 12
_HEAD = """# Every command

What `p2os VERB --help` prints, for each verb and what stands below it; made from the program itself when this site is
built. Below it stands a use of it from these pages, with what it printed: the tests run each of these lines.
[The command line](../cli.md) says what the verbs have in common.

"""


def page() -> str:
    """Return the page."""
    uses = _uses()
    parts = [_HEAD]
    for path, command in commands(typer.main.get_command(make_app())):
        words = " ".join(path)
        parts.append(f"{'#' * len(path)} {words}\n\n```text\n{_help(command, words)}\n```\n")
        if use := uses.get(words):
            where, line, shown = use
            away = os.path.relpath(where, ROOT / "docs" / "reference")
            more = "…" if len(shown) > MOST_LINES else ""
            block = "\n".join([f"$ {line}", *shown[:MOST_LINES], *([more] if more else [])])
            parts.append(f"As it is used in [{where.stem}]({away}):\n\n```console\n{block}\n```\n")
    return "\n".join(parts)


def commands(
    command: TyperCommand | TyperGroup, above: tuple[str, ...] = (NAME,)
) -> Iterator[tuple[tuple[str, ...], TyperCommand | TyperGroup]]:
    """Yield what stands below a command by the words that call it, and after each what stands below that."""
    for name, below in sorted(command.commands.items() if isinstance(command, TyperGroup) else ()):
        if not below.hidden:
            path = (*above, name)
            yield path, below
            yield from commands(below, path)


def _help(command: TyperCommand | TyperGroup, words: str) -> str:
    names = {"help_option_names": ["-h", "--help"]}
    context = typer.Context(command, info_name=words, terminal_width=COLUMNS, max_content_width=COLUMNS, **names)
    return command.get_help(context).rstrip()


def _uses() -> dict[str, tuple[Path, str, list[str]]]:
    """Return for each verb a line of docs/ that uses it: the one that shows most of what is printed."""
    found: dict[str, tuple[Path, str, list[str]]] = {}
    for one in pages():
        if one.path.is_relative_to(ROOT / "docs"):
            for words, line, shown in _typed(one):
                if words not in found or len(found[words][2]) < len(shown):
                    found[words] = one.path, line, shown
    return found


def _typed(one: Page) -> Iterator[tuple[str, str, list[str]]]:
    for block in one.blocks:
        for line, shown in block.entries if block.language == "console" and block.is_run else ():
            words = shlex.split(line, comments=True)
            if words[0] == NAME:
                for length in (2, 3):
                    yield " ".join(words[:length]), line, shown
