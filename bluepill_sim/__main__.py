"""The emulator on the command line: `python -m bluepill_sim run mine.elf`."""

from collections.abc import Sequence

import typer

from bluepill_sim.cli import HELP, add_verbs
from simbase.command_line import program
from simbase.command_line.help_pages import VerbList, dress
from simbase.terminal import readable_output

NAME = "python -m bluepill_sim"


def make_app(_words: Sequence[str] = ()) -> typer.Typer:
    """Return the application with all its verbs."""
    app = typer.Typer(
        help=HELP, rich_markup_mode=None, cls=VerbList, pretty_exceptions_enable=False, add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )  # fmt: skip
    add_verbs(app)
    dress(app)
    return app


def run(words: Sequence[str], *, trace: bool = False) -> int:
    """Run the command line and return its exit code.

    Args:
        words: What follows the program's name.
        trace: Show where in the program an error arose.
    """
    with readable_output():
        return program.run(NAME, make_app, words, trace=trace)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and end the process with its exit code."""
    program.main(run, arguments)


if __name__ == "__main__":
    main()
