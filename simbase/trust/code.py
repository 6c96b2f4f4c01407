"""A class in a Python file by its name, and whether it may be executed.

Invariant: a `Code` that is admitted holds the hash of what was admitted; `user_classes` loads nothing else.
"""

from pathlib import Path
from typing import Self

from simbase.trust.fingerprint import Fingerprint, fingerprint_of


class Code(str):
    """FILE.py:CLASS with the file's whole path, which a file of a user or the user has named.

    A text, so that it stands wherever the name of what ships does; it is pickled with what is said of it.
    """

    __slots__ = ("admitted", "named", "where")

    #: Where it is named: `mine.toml:5: body`; empty where the user named it.
    where: str
    #: As it is named there.
    named: str
    #: What can be imported from the file's folder; None: it may not be executed.
    admitted: Fingerprint | None

    def __new__(cls, text: str, *, where: str = "", named: str = "", admitted: Fingerprint | None = None) -> Self:
        """Return a name; `text` has the whole path."""
        made = super().__new__(cls, text)
        made.where, made.named, made.admitted = where, named or text, admitted
        return made

    def __getnewargs_ex__(self) -> tuple[tuple[str], dict[str, object]]:
        """Return what a copy is made of."""
        return (str(self),), {"where": self.where, "named": self.named, "admitted": self.admitted}

    @property
    def file(self) -> Path:
        """The file."""
        return Path(self.rpartition(":")[0])

    @property
    def is_there(self) -> bool:
        """Whether there is such a file."""
        try:
            return self.file.is_file()
        except (OSError, ValueError):  # longer than the system allows, or with a NUL in it
            return False

    @property
    def is_unread(self) -> bool:
        """Whether its file is there and may not be executed: what is in it is not known."""
        return self.admitted is None and self.is_there

    @property
    def kind(self) -> str:
        """The name of the class."""
        return self.rpartition(":")[2]

    @property
    def key(self) -> str:
        """What an answer is remembered by: the hash of all that can be imported, and the file among it."""
        return "" if self.admitted is None else key_of(self.admitted, self.file)

    def to_plain(self) -> dict[str, object]:
        """Return what a recording says of it: name, hash, and the hash of each file of its folder."""
        found = self.admitted
        return {
            "name": str(self), "named": self.named, "where": self.where,
            "sha256": None if found is None else found.sha256, "files": {} if found is None else dict(found.files),
        }  # fmt: skip


def key_of(found: Fingerprint, file: Path) -> str:
    """Return what an answer about a file of a folder is remembered by; it holds wherever the folder stands."""
    return f"{found.sha256}/{file.name}"


def is_in_file(name: str) -> bool:
    """Tell whether a name is FILE.py:CLASS."""
    path, colon, _ = name.rpartition(":")
    return bool(colon) and path.endswith(".py")


def located(name: str, folder: Path) -> str:
    """Return FILE.py:CLASS with the file's whole path, as seen from a folder; another name as it is."""
    if not is_in_file(name):
        return name
    path, _, kind = name.rpartition(":")
    try:
        whole = (folder / path).resolve()
    except (OSError, ValueError):  # as above: who loads it says that there is none
        whole = folder / path
    return f"{whole}:{kind}"


def own_code(name: str, folder: Path | None = None) -> str:
    """Return a name that a command line or a program gives itself: it may be executed. Others stay as they are.

    Args:
        name: FILE.py:CLASS, or another name.
        folder: Where the file is looked for; None: the current one.

    Raises:
        FileError: A file of its folder cannot be read.
        UsageError: There are too many files in its folder.
    """
    if isinstance(name, Code) or not is_in_file(name):
        return name
    whole = Code(located(name, folder or Path()), named=name)
    if not whole.is_there:
        return whole  # who loads it says so
    return Code(whole, named=name, admitted=fingerprint_of(whole.file.parent))
