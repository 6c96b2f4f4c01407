"""The text of a file that a user names: bounded, and every error a `WorldError`."""

from pathlib import Path

from p2os.errors import WorldError

#: chosen: a world of 100 000 things is below it; more is no world file.
LARGEST_FILE_BYTES = 64 * 1024 * 1024


def read_text(path: Path) -> str:
    """Return a file's text.

    Raises:
        WorldError: It cannot be read, is too large or is no text.
    """
    try:
        if path.stat().st_size > LARGEST_FILE_BYTES:
            raise WorldError(f"{path}: larger than {LARGEST_FILE_BYTES >> 20} MiB")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise WorldError(f"{path}: not a text file", hint="a world is a TOML file") from error
