"""Files of users, written and read with one line where the system refuses them; what is read is read within bounds.

A name may lead to anything: to a device or a pipe that never ends, to a sparse file of terabytes. `read_bytes` and
`read_text` read no more than they may hold, `lines_of` no line that is longer, and what a file says of its own size
is believed only where it is too large. What has no end is read to the bound.

Invariant: no reader here holds more of a file than its bound and one block.
"""

import codecs
import errno
import io
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from os import fstat
from pathlib import Path
from typing import BinaryIO, NoReturn, TextIO

from simbase.errors import FileError, P2osError, shown, shown_name

#: chosen: a world of 100 000 things is below it, and a program with all its debug information; no person writes more.
LARGEST_FILE_BYTES = 64 << 20
#: chosen: what is read at a time.
_BLOCK_BYTES = 1 << 20
#: The first line of a trace has its whole world, and that is the longest that there is.
LONGEST_LINE = LARGEST_FILE_BYTES
#: What the system refuses for want of room or of a right, whatever the program: never a bug of it.
REFUSALS = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO, errno.EROFS, errno.EMFILE, errno.ENFILE})
MAKE_ROOM = "make room, or name another place"
_MORE_FILES = "end other programs, or allow more open files: ulimit -n"
#: What to try where it is not for want of room.
_HINTS = {
    errno.EMFILE: _MORE_FILES,
    errno.ENFILE: _MORE_FILES,
    errno.EIO: "is the disk sound, and the terminal still there?",
}
#: What was refused where it need not be a write, and of what.
_REFUSED = {
    errno.EMFILE: ("open", "a file"),
    errno.ENFILE: ("open", "a file"),
    errno.EIO: ("read or write", "a file or standard output"),
}
_IS_IT = "is this the file that you mean?"


@dataclass(frozen=True, slots=True)
class VersionedFormat:
    """A kind of file of ours whose form has a version; a file that says none is of the first."""

    #: With its article: "a world".
    name: str
    #: What is written; every version up to it is read.
    newest: int = 1

    def version_of(self, said: object, where: object = "", error: type[FileError] = FileError) -> int:
        """Return the version that a file says, from 1 to `newest`.

        Args:
            said: What stands in it; None where nothing does.
            where: What a message calls the place.
            error: What to raise.

        Raises:
            FileError: One of `error`: it is no version, or a later p2os has written the file.
        """
        place = f"{where}: " if where else ""
        if said is None:
            return 1
        if isinstance(said, bool) or not isinstance(said, int) or said < 1:
            raise error(f"{place}version = {shown(said)} is no version of {self.name}", hint=f"1 to {self.newest}")
        if said > self.newest:
            raise error(
                f"{place}{self.name} of version {shown(said)}, and this program reads up to {self.newest}",
                hint="install a newer version",
            )
        return said


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
        elif hint is None and isinstance(error, PermissionError):
            hint = "name a place that you may write to"
        elif hint is None or error.errno in _HINTS:
            hint = hint_of(error)
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
        what = f"cannot read {shown_name(place)}: {reason_of(error)}"
        raise FileError(what, hint=hint_of(error) or hint) from error


def read_bytes(
    path: Path,
    error_type: type[P2osError] = FileError,
    *,
    most: int = LARGEST_FILE_BYTES,
    hint: str | None = None,
) -> bytes:
    """Return what a file of a user's holds.

    Args:
        path: The file; a device or a pipe is read until it ends.
        error_type: What to raise.
        most: How many bytes it may have.
        hint: What to try where it cannot be read.

    Raises:
        P2osError: One of `error_type`: it cannot be read, or is larger.
    """
    found, size = [], 0
    try:
        with path.open("rb", buffering=0) as file:
            if fstat(file.fileno()).st_size > most:
                _refuse_size(path, error_type, most)
            while block := file.read(_BLOCK_BYTES):
                found.append(block)
                size += len(block)
                if size > most:
                    _refuse_size(path, error_type, most)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        _refuse_reading(path, error_type, error, hint)
    return b"".join(found)


def read_text(
    path: Path,
    error_type: type[P2osError] = FileError,
    *,
    most: int = LARGEST_FILE_BYTES,
    hint: str | None = None,
    errors: str = "strict",
) -> str:
    """Return the text of a user's file in UTF-8, without a byte order mark, however its lines end.

    Args:
        path: As of `read_bytes`.
        error_type: As there.
        most: As there.
        hint: What to try where it cannot be read.
        errors: What becomes of bytes that are no UTF-8, as `bytes.decode` has it.

    Raises:
        P2osError: One of `error_type`: as of `read_bytes`, or it is no text.
    """
    data = read_bytes(path, error_type, most=most, hint=hint).removeprefix(codecs.BOM_UTF8)
    try:
        text = data.decode("utf-8", errors)
    except UnicodeDecodeError as error:
        raise error_type(f"{shown_name(path)}: not a text file", hint=hint) from error
    return with_plain_ends(text)


def with_plain_ends(text: str) -> str:
    """Return a text whose lines end with a line feed, however they ended."""
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hex.

    Raises:
        FileError: As of `read_bytes`.
    """
    return sha256(read_bytes(path)).hexdigest()


def lines_of(
    path: Path,
    error_type: type[P2osError] = FileError,
    *,
    hint: str | None = None,
    errors: str = "replace",
    newline: str | None = None,
    longest: int = LONGEST_LINE,
    most: int | None = None,
) -> Iterator[str]:
    """Yield the lines of a user's file in UTF-8, each with its end, as they are read.

    Args:
        path: The file.
        error_type: What to raise.
        hint: What to try where it cannot be read.
        errors: What becomes of bytes that are no UTF-8, as `open` has it.
        newline: What ends a line, as `open` has it.
        longest: How many characters a line may have.
        most: How many characters all of them may have, for who holds them; None: any number.

    Raises:
        P2osError: One of `error_type`: it cannot be read, is no text, or it or a line of it is longer.
    """
    try:
        with path.open(encoding="utf-8-sig", errors=errors, newline=newline) as file:
            number, left = 0, most
            while line := file.readline(longest + 1):
                number += 1
                if len(line) > longest:
                    raise error_type(f"{shown_name(path)}:{number}: a line longer than {_size(longest)}", hint=_IS_IT)
                if left is not None and (left := left - len(line)) < 0:
                    _refuse_size(path, error_type, most or 0)
                yield line
    except UnicodeDecodeError as error:
        raise error_type(f"{shown_name(path)}: not a text file", hint=hint) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        _refuse_reading(path, error_type, error, hint)


class _Written(io.FileIO):
    """A file that is written for long: whatever the system has against a later write names it."""

    def write(self, data: bytes | memoryview, /) -> int:  # type: ignore[override]  # what BufferedWriter gives it
        with writing(self.name, hint=MAKE_ROOM):
            return super().write(data)

    def close(self) -> None:
        with writing(self.name, hint=MAKE_ROOM):
            super().close()


def open_to_write(path: Path) -> BinaryIO:
    """Open a file to be written over a time; each later write, and its end, raise as its opening does.

    Raises:
        FileError: It cannot be written.
    """
    with writing(path):
        raw: io.FileIO = _Written(str(path), "w")
    return io.BufferedWriter(raw)


def open_to_write_text(path: Path, *, newline: str = "\n") -> TextIO:
    """Open a file of text in UTF-8, as `open_to_write` does."""
    return io.TextIOWrapper(open_to_write(path), encoding="utf-8", newline=newline)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield where a file is to be written that takes the place of another only once it is whole.

    It is written beside it, with `.part` after its name; what is no plain file (a link, a pipe) is written itself.

    Raises:
        OSError: It cannot be written; what was there is there.
    """
    if path.is_symlink() or (path.exists() and not path.is_file()):
        yield path
        return
    part = path.with_name(f"{path.name}.part")
    try:
        yield part
        part.replace(path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise


def replace_text(path: Path, text: str) -> None:
    """Write a file of text in UTF-8, as `replacing` does."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def writing_temporary() -> AbstractContextManager[None]:
    """Raise, as `writing` does, what the system has against a folder where it keeps what is temporary."""
    return writing("a temporary folder", hint="make room there, or have TMPDIR name another place")


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


def refusal_of(error: BaseException) -> str | None:
    """Return what the system refuses for want of room or of a right, and why, in one line; None: it is not that."""
    if not isinstance(error, OSError) or error.errno not in REFUSALS:
        return None
    what, where = _REFUSED.get(error.errno, ("write", "standard output"))
    return f"cannot {what} {where if error.filename is None else error.filename}: {reason_of(error)}"


def hint_of(error: OSError) -> str | None:
    """Return what to try where the system refuses something for want of room or of a right; None: it is not that."""
    return _HINTS.get(error.errno or 0, MAKE_ROOM) if error.errno in REFUSALS else None


def _refuse_reading(path: Path, error_type: type[P2osError], error: OSError | ValueError, hint: str | None) -> NoReturn:
    if isinstance(error, OSError):
        why, hint = reason_of(error), hint_of(error) or hint
    else:
        why = str(error)
    raise error_type(f"cannot read {shown_name(path)}: {why}", hint=hint) from error


def _refuse_size(path: Path, error_type: type[P2osError], most: int) -> NoReturn:
    raise error_type(f"{shown_name(path)}: larger than {_size(most)}", hint=_IS_IT)


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count} bytes"
