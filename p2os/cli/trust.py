"""`--trust`: the option of verbs that may load code which a file names."""

from typing import Annotated

import typer

from simbase.trust import Trust

#: The option, as a verb declares it.
Trusted = Annotated[bool, typer.Option("--trust", help="Run the Python code that the files name.")]


def said(trust: bool) -> Trust:
    """Return what a command line means: with the option all, without it a person at the terminal is asked."""
    return Trust(everything=trust, asks=True)
