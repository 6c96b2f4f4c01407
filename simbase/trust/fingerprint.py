"""What can be imported from the folder of a Python file, and the hash of it all.

Counted are source files, extension modules and bytecode without its source, in the folder and below it in folders
that a package can be: their names are identifiers. `__pycache__` is not counted, since nothing is read from there
(`sources`).
Invariant: two folders of one hash import the same code under the same names.
"""

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.machinery import all_suffixes
from pathlib import Path

from simbase.errors import UsageError, shown_name
from simbase.files import sha256_of

#: chosen: what a folder of somebody's classes holds, ten times; a whole environment is more.
MOST_FILES = 2_000
#: chosen: a large extension module, ten times.
MOST_BYTES = 256 * 1024 * 1024
#: chosen: so many entries are looked at, so that `/` or a home folder is refused within a second.
MOST_ENTRIES = 50_000
_SUFFIXES = tuple(all_suffixes())
_CACHE = "__pycache__"
_HINT = "put the class into a folder of its own"


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """The files that can be imported from a folder."""

    #: Name as seen from the folder, with `/` → SHA-256 of its content, by name.
    files: Mapping[str, str]

    @property
    def sha256(self) -> str:
        """The hash of all names and contents."""
        text = "".join(f"{digest} {name}\0" for name, digest in sorted(self.files.items()))
        return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()


def fingerprint_of(folder: Path) -> Fingerprint:
    """Return what can be imported from a folder.

    Raises:
        FileError: A file cannot be read.
        UsageError: There are too many of them.
    """
    found = {}
    for name, path in sorted(importable(folder)):  # all are counted before the first is read
        found[name] = sha256_of(path)
    return Fingerprint(found)


def importable(folder: Path) -> Iterator[tuple[str, Path]]:
    """Yield the files that can be imported from a folder: the name as seen from there, and the path.

    Raises:
        UsageError: There are too many of them.
    """
    files = entries = size = 0
    seen = {folder.resolve()}
    for place, folders, names in os.walk(folder, followlinks=True):
        here = Path(place)
        folders[:] = sorted(name for name in folders if is_package_name(name) and _is_new(here / name, seen))
        entries += len(folders) + len(names)
        for name in names:
            if name.endswith(_SUFFIXES) and (here / name).is_file():
                files += 1
                size += (here / name).stat().st_size
                if size > MOST_BYTES:
                    what = f"{shown_name(folder)} has more than {MOST_BYTES >> 20} MiB that can be imported"
                    raise UsageError(what, hint=_HINT)
                yield (here / name).relative_to(folder).as_posix(), here / name
        if files > MOST_FILES or entries > MOST_ENTRIES:
            what = f"{MOST_FILES} files that can be imported" if files > MOST_FILES else f"{MOST_ENTRIES} entries"
            raise UsageError(f"{shown_name(folder)} has more than {what}", hint=_HINT)


def is_package_name(name: str) -> bool:
    """Tell whether a folder of that name can be a package."""
    return name.isidentifier() and name != _CACHE


def _is_new(folder: Path, seen: set[Path]) -> bool:
    """Tell whether a folder was not seen by another of its names: links may lead in a circle."""
    real = folder.resolve()
    is_new = real not in seen
    seen.add(real)
    return is_new
