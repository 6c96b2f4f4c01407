"""Files of users, written and read with one line for a person where the system refuses them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from simbase.errors import FileError, shown_name


@contextmanager
def writing(place: object, hint: str | None = None) -> Iterator[None]:
    """Raise what the system has against writing a file, or into a folder.

    Raises:
        FileError: It cannot be written.
    """
    try:
        yield
    except OSError as error:
        if hint is None and isinstance(error, (FileNotFoundError, IsADirectoryError, NotADirectoryError)):
            hint = "give a file in a folder that exists"
        raise FileError(f"cannot write {shown_name(place)}: {reason_of(error)}", hint=hint) from error


@contextmanager
def reading(place: object, hint: str | None = None) -> Iterator[None]:
    """Raise what the system has against reading a file.

    Raises:
        FileError: It cannot be read.
    """
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot read {shown_name(place)}: {reason_of(error)}", hint=hint) from error


def write_text(path: Path, text: str) -> None:
    """Write a file of text in UTF-8.

    Raises:
        FileError: It cannot be written.
    """
    with writing(path):
        path.write_text(text, encoding="utf-8")


def reason_of(error: OSError) -> str:
    """Return why the system refused something, in its own words."""
    return (error.strerror or str(error)).lower()
