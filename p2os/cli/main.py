"""The command line: finds its verbs, runs one, and reports what went wrong.

Verbs are modules with `register(app)`, found by the entry points of the group
`p2os.verbs`, so that packages above this one add theirs without being imported
here. A verb whose module cannot be imported is still listed, with what it lacks.

Results go to stdout, all else to stderr. An error is one line and one hint.
Exit codes: 0 done, 1 the operation failed, 2 wrong usage, 130 interrupted, by whatever signal.
"""

import contextlib
import difflib
import gc
import os
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint
from typing import Annotated

import typer

from p2os.cli.help_pages import VerbList, dress
from p2os.cli.printing import restored_output
from p2os.cli.refused_connections import shown_refusals
from p2os.cli.signals import end_on_signals, ignore_signals, restored_signals
from simbase.errors import MissingDependencyError
from simbase.files import MAKE_ROOM, REFUSALS, reason_of
from simbase.installation import installed_version
from simbase.trust import installed_points
from simbase.user_classes import unforeseen

GROUP = "p2os.verbs"
EXIT_FAILED = 1
EXIT_INTERRUPTED = 130

#: chosen: objects made between two searches for garbage; a capture's are tuples by the thousand, and none is garbage.
COLLECTED_AFTER = 20_000

#: What the scripts of `--install-completion` set, and why this program was called then.
COMPLETE_VARIABLE = "_P2OS_COMPLETE"

HELP = """A test bench for the firmware of mobile robots, and tools for Pioneers that speak P2OS.

It runs BluePill programs on an emulated board that drives a virtual or a real robot, serves virtual
Pioneers to other programs, drives, watches and records robots, and reads recordings.
"""

EPILOG = """Examples:

\b
  p2os demo                         watch a BluePill program drive a Pioneer
  p2os run dodge --world arena      run one scenario and write a report
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
    words = list(sys.argv[1:] if arguments is None else arguments)
    trace = "--trace" in words
    end_on_signals()
    code = run([word for word in words if word != "--trace"], trace=trace)
    ignore_signals()  # a robot that was not released before is when Python ends, and the exit code stands
    sys.exit(code)


def run(words: list[str], *, trace: bool = False) -> int:
    """Run the command line and return its exit code.

    Args:
        words: what follows `p2os`.
        trace: show where in the program an error arose.
    """
    try:
        with restored_signals(), restored_output(), shown_refusals():
            end_on_signals()
            return _run(words, trace=trace)
    except KeyboardInterrupt:  # while the last lines were being written
        return EXIT_INTERRUPTED


def report(error: Exception, *, trace: bool = False) -> int:
    """Print on stderr what went wrong and what to try, and return the exit code.

    Our own errors, those of the emulator and those of the option parser carry
    `exit_code`, and a `hint` or a way to get help; anything else is a bug.
    """
    if trace:
        traceback.print_exception(error)
    code = getattr(error, "exit_code", None)
    if isinstance(error, OSError) and error.errno in REFUSALS:  # of a file that is named, an error of ours tells
        where = "standard output" if error.filename is None else str(error.filename)
        _print_error(f"p2os: {_one_line(f'cannot write {where}: {reason_of(error)}')}")
        _print_error(f"hint: {MAKE_ROOM}")
        return EXIT_FAILED
    if not isinstance(code, int):
        says = unforeseen(error)
        _print_error(f"p2os: {_one_line(says)}")
        is_bug = says.startswith("this is a bug")
        _print_error(f"hint: run it again with --trace{' and report the output' if is_bug else ''}")
        return EXIT_FAILED
    format_message = getattr(error, "format_message", None)
    if callable(format_message):  # the option parser's
        _print_error(f"p2os: {_usage_message(error, _one_line(format_message())).removesuffix('.')}")
        path = getattr(getattr(error, "ctx", None), "command_path", None)
        _print_error(f"hint: {path or 'p2os'} --help")
        return code
    _print_error(f"p2os: {_one_line(str(error))}")
    if hint := getattr(error, "hint", None):
        _print_error(f"hint: {_one_line(hint)}")
    return code


def verbs() -> list[EntryPoint]:
    """Return every verb that an installed package offers, by name; what is installed is looked up once a process."""
    return list(_installed_verbs())


@cache
def _installed_verbs() -> tuple[EntryPoint, ...]:
    return tuple(sorted(installed_points(GROUP).values(), key=lambda entry: entry.name))


def make_app(words: Sequence[str] = ()) -> typer.Typer:
    """Return the application with the verb that `words` name, or with all when they name none."""
    app = typer.Typer(
        help=HELP, epilog=EPILOG, rich_markup_mode=None, cls=VerbList,
        pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]},
    )  # fmt: skip
    app.callback()(_options)
    found = verbs()
    completed = completed_words(os.environ)
    first = next((word for word in (words if completed is None else completed) if not word.startswith("-")), None)
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
    """Register each verb, or in its place a command that shows what it lacks."""
    for entry in entries:
        try:
            module = entry.load()
        except ImportError as error:
            _add_missing(app, entry.name, error)
        else:
            module.register(app)


def _run(words: list[str], *, trace: bool) -> int:
    try:
        command = typer.main.get_command(make_app(words))
        if not gc.isenabled():
            gc.freeze()
            gc.set_threshold(COLLECTED_AFTER, 10, 10)
            gc.enable()
        result = command.main(words, prog_name="p2os", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        result = EXIT_INTERRUPTED
    except Exception as error:  # noqa: BLE001 - the one place where every error becomes a line
        return report(error, trace=trace)
    if result == EXIT_INTERRUPTED:  # the option parser makes it of a KeyboardInterrupt, too
        _print_error("p2os: interrupted")
    return result if isinstance(result, int) else 0


def _add_missing(app: typer.Typer, name: str, error: ImportError) -> None:
    lacking = error.name or str(error)

    @app.command(
        name, help=f"(missing: needs {lacking}; p2os doctor)",
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    )  # fmt: skip
    def missing() -> None:
        raise MissingDependencyError(f"`p2os {name}` needs {lacking}", hint="p2os doctor") from error


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


def _usage_message(error: Exception, message: str) -> str:
    """Return what the option parser complains of, beginning with the option or argument that it is about."""
    name = getattr(error, "option_name", None)
    context = getattr(error, "ctx", None)
    if name is not None and context is not None and message.startswith("No such option"):
        options = [
            option for parameter in context.command.params for option in (*parameter.opts, *parameter.secondary_opts)
        ]
        near = difflib.get_close_matches(name, [option for option in options if option.startswith("--")], n=1)
        return f"No such option: {name}" + (f". Did you mean {near[0]}?" if near else "")
    parameter = getattr(error, "param", None)
    if parameter is None or not isinstance(error, typer.BadParameter) or message.startswith("Missing"):
        return message
    is_option = parameter.param_type_name == "option"
    name = max(parameter.opts, key=len) if is_option else parameter.metavar or parameter.name.upper()
    return f"{name} {_one_line(error.message).removeprefix('Value error, ')}"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _print_error(line: str) -> None:
    with contextlib.suppress(OSError):  # nobody reads it: the exit code remains
        sys.stderr.write(f"{line}\n")
