"""The root of the errors of the project, and what every package raises, sorted by who can act on it.

Whatever is raised here reaches a person as one line and one hint.
"""

import re
from collections.abc import Iterable


class P2osError(Exception):
    """The root: whatever p2os and the packages that come with it raise for a person.

    Args:
        message: What failed, with the values and the place.
        hint: What to try, as a command or a short sentence; None where there is nothing to say. It is a note of the
            exception too, so that Python's own traceback, in a script or a test, ends with it.
    """

    #: Exit code of a command that ends with this error: 1 it failed, 2 wrong usage or file.
    exit_code = 1

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(one_line(message))
        self.hint = None if hint is None else one_line(hint)
        if self.hint:
            self.add_note(f"hint: {self.hint}")


class UsageError(P2osError):
    """The command line asks for what cannot be."""

    exit_code = 2


class FileError(P2osError):
    """A file is missing, unreadable or not what it should be."""

    exit_code = 2


class MissingDependencyError(P2osError):
    """Something is not installed.

    Args:
        message: What needs it.
        extra: The extra of pyproject.toml that brings it, "" for what every verb needs; the hint then is the command
            that installs its packages.
        hint: What else to try.
    """

    exit_code = 2

    def __init__(self, message: str, *, extra: str | None = None, hint: str | None = None) -> None:
        from simbase.installation import install_command  # reads the installed metadata, which takes time

        ways = [] if extra is None else [install_command(extra)]
        super().__init__(message, hint=", or ".join([*ways, *([hint] if hint else [])]) or None)


#: chosen: what a person still reads of one message.
LONGEST_LINE = 500


def one_line(text: str) -> str:
    """Return a message on one line, without what no line can hold, and with its middle left out where it is long."""
    text = re.sub(r"\s*\n\s*", " ", text)
    if len(text) > LONGEST_LINE:
        text = f"{text[: LONGEST_LINE - 150]} ... {text[-145:]}"
    return text if text.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


#: chosen: what still fits a line of a terminal beside the rest of a message.
LONGEST_SHOWN = 60


def shown(value: object) -> str:
    """Return a value as a message shows it: as Python writes it, on one line, and cut where it is long."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of more digits than Python writes
        return "a huge number"
    return text if len(text) <= LONGEST_SHOWN else f"{text[: LONGEST_SHOWN - 3]}..."


def shown_name(name: object) -> str:
    """Return a key or the name of a file as a message shows it: as it is, but for what no line can hold."""
    text = str(name)
    if len(text) > 4 * LONGEST_SHOWN:
        text = f"{text[:LONGEST_SHOWN]}...{text[-LONGEST_SHOWN:]}"
    return text if text.isprintable() else ascii(text)[1:-1]


def nearest(word: str, known: Iterable[str], otherwise: str | None = None) -> str:
    """Return a hint: the nearest of the known words; where none is near, `otherwise`, or all of them."""
    from difflib import get_close_matches  # takes longer to load than most commands to fail

    words = [*map(str, known)]  # a member of a StrEnum is the word that is typed
    close = get_close_matches(word, words, n=1, cutoff=0.6)
    return f"did you mean {close[0]!r}?" if close else otherwise or f"known are {', '.join(sorted(words))}"
