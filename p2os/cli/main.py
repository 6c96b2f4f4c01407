"""The command line `p2os`: finds its verbs, and runs one.

Verbs are modules with `register(app)`, found by the entry points of the group
`p2os.verbs`, so that packages above this one add theirs without being imported
here. A verb whose module cannot be imported is still listed, with what it lacks,
and one that fails otherwise with the package that it is of.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Annotated

import typer

from p2os.cli.groups import GroupedVerbs
from p2os.cli.printing import restored_output
from simbase.command_line import program
from simbase.command_line.help_pages import dress
from simbase.command_line.program import EXIT_INTERRUPTED
from simbase.entry_points import installed_points
from simbase.errors import MissingDependencyError, P2osError
from simbase.installation import installed_version
from simbase.user_classes import broken

NAME = "p2os"
GROUP = "p2os.verbs"

#: What the scripts of `--install-completion` set, and why this program was called then.
COMPLETE_VARIABLE = "_P2OS_COMPLETE"

EPILOG = """Examples:

\b
  p2os serve                        be a Pioneer on tcp:127.0.0.1:8101
  p2os scan                         find a robot, and identify it
  p2os monitor tcp:127.0.0.1:8101   watch it
  p2os drive URL --forward 0.5m     move it
  p2os decode fafb03000000          what bytes mean
  p2os doctor                       what is installed, what is missing

With --trace anywhere, an error shows where in the program it arose.
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and end the process with its exit code."""
    program.main(run, arguments)


def run(words: Sequence[str], *, trace: bool = False) -> int:
    """Run the command line and return its exit code.

    Args:
        words: what follows `p2os`.
        trace: show where in the program an error arose.
    """
    try:
        with restored_output():
            return program.run(NAME, make_app, words, trace=trace)
    except KeyboardInterrupt:  # while the last lines were being written
        return EXIT_INTERRUPTED


def verbs() -> list[EntryPoint]:
    """Return every verb that an installed package offers, by name; what is installed is looked up once a process."""
    return list(_installed_verbs())


@cache
def _installed_verbs() -> tuple[EntryPoint, ...]:
    return tuple(sorted(installed_points(GROUP).values(), key=lambda entry: entry.name))


def make_app(words: Sequence[str] = ()) -> typer.Typer:
    """Return the application with the verb that `words` name, or with all when they name none."""
    found = verbs()
    completed = completed_words(os.environ)
    first = next((word for word in (words if completed is None else completed) if not word.startswith("-")), None)
    app = typer.Typer(
        help=summary(found) if first is None and completed is None else None, epilog=EPILOG,
        rich_markup_mode=None, cls=GroupedVerbs,
        pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]},
    )  # fmt: skip
    app.callback()(_options)
    wanted = [entry for entry in found if entry.name == first]
    if first is None and "--version" in words:
        return app  # no verb is wanted
    if completed is not None and not wanted:
        for entry in found:  # only their names are wanted: a TAB is to be quick
            app.command(entry.name)(lambda: None)
        return app
    add_verbs(app, wanted or found)
    dress(app)
    return app


def summary(found: Iterable[EntryPoint]) -> str:
    """Return what the distributions that offer these verbs say of themselves, a paragraph each."""
    installed = dict.fromkeys(entry.dist for entry in found if entry.dist is not None)
    return "\n\n".join(f"{each.metadata['Summary']}." for each in installed)


def completed_words(environment: Mapping[str, str]) -> list[str] | None:
    """Return the whole words that stand before the one that a shell wants completed; None when none asks.

    Args:
        environment: What the scripts of `--install-completion` set.
    """
    if not environment.get(COMPLETE_VARIABLE, "").startswith("complete"):
        return None
    if "COMP_WORDS" in environment:  # bash
        return environment["COMP_WORDS"].split()[1 : int(environment.get("COMP_CWORD", "1"))]
    line = environment.get("_TYPER_COMPLETE_ARGS", "")
    words = line.split()[1:]
    return words if line.endswith(" ") else words[:-1]


def add_verbs(app: typer.Typer, entries: Iterable[EntryPoint]) -> None:
    """Register each verb, or in its place a command that tells what it lacks, or which package is broken."""
    for entry in entries:
        count = len(app.registered_commands), len(app.registered_groups)
        try:
            entry.load().register(app)
        except Exception as error:  # noqa: BLE001 - of another's package: the other verbs work on
            del app.registered_commands[count[0] :], app.registered_groups[count[1] :]
            if isinstance(error, ModuleNotFoundError):
                failure: P2osError = MissingDependencyError(
                    f"`{NAME} {entry.name}` needs {error.name}", hint=f"{NAME} doctor"
                )
                _add_failing(app, entry.name, f"missing: needs {error.name}; p2os doctor", failure, error)
            else:
                failure = broken(entry, error)
                _add_failing(app, entry.name, f"{failure}", failure, error)


def _add_failing(app: typer.Typer, name: str, why: str, failure: P2osError, cause: Exception) -> None:
    """Register, in place of a verb, what tells why it cannot be had."""

    @app.command(name, help=f"({why})", context_settings={"allow_extra_args": True, "ignore_unknown_options": True})
    def failing() -> None:
        raise failure from cause


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(installed_version())
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Take the options that stand before the verb."""
