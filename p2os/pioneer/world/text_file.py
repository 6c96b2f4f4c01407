"""The text of a world file: bounded, and every error a `WorldError`."""

from pathlib import Path

from p2os.errors import WorldError
from p2os.toml_file import read_user_text


def read_text(path: Path) -> str:
    """Return a file's text.

    Raises:
        WorldError: It cannot be read, is too large or is no text.
    """
    return read_user_text(path, "a world", WorldError)
