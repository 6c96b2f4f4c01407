"""Files of users, written and read with one line for a person where the system refuses them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from simbase.errors import FileError, P2osError, shown_name


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


def refuse_elsewhere(folder: Path, name: str, error: Callable[..., P2osError] = FileError) -> Path:
    """Return the path of a file in a folder, by a name that a file or a class gives; one that leads out is refused.

    Args:
        folder: Where it is to be, or below.
        name: As seen from there; links are followed.
        error: What is raised: (message, hint=…).

    Raises:
        FileError: It leads elsewhere, or is no name; of the type that `error` makes.
    """
    try:
        is_within = (folder / name).resolve().is_relative_to(folder.resolve()) and bool(name)
    except (OSError, ValueError):  # longer than the system allows, or with a NUL in it
        is_within = False
    if not is_within:
        what = f"{shown_name(name)} leads out of the folder {shown_name(folder)}"
        raise error(what, hint="name a file within that folder")
    return folder / name


def reason_of(error: OSError) -> str:
    """Return why the system refused something, in its own words."""
    return (error.strerror or str(error)).lower()
