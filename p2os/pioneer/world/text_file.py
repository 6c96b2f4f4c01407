"""The text of a world file, and its size: bounded, and every error a `WorldError`."""

from pathlib import Path

from p2os.errors import WorldError
from p2os.toml_file import read_user_text
from simbase.files import LARGEST_FILE_BYTES, read_bytes, with_plain_ends


def read_text(path: Path) -> str:
    """Return a file's text.

    Raises:
        WorldError: It cannot be read, is too large or is no text.
    """
    return read_user_text(path, "a world", WorldError)


def read_foreign_text(path: Path) -> str:
    """Return the text of another program's file: UTF-8, else Latin-1, which gives each byte a character.

    Programs that knew no UTF-8 write names and comments in the code page of their machine; all else is ASCII. Lines
    may end with CR alone.

    Raises:
        WorldError: It cannot be read, or is too large.
    """
    data = read_bytes(path, WorldError)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return with_plain_ends(text)


def sized(path: Path) -> Path:
    """Return a path that may be read.

    Raises:
        WorldError: It is no file or folder, or a file that is too large.
    """
    if not path.is_file() and not path.is_dir():
        raise WorldError(f"{path}: neither a file nor a folder", hint="a pipe or a device is not read")
    if path.is_file() and path.stat().st_size > LARGEST_FILE_BYTES:
        raise WorldError(f"{path}: larger than {LARGEST_FILE_BYTES >> 20} MiB", hint="make it simpler first")
    return path
