"""Who decides whether code that a file names is executed: `Trust`, which each reader of such a file is given.

What was answered before and the user's configuration count always; a person is asked only where `asks` says that one
sits there, and no answer is a refusal.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from simbase.errors import P2osError, UsageError, shown_name
from simbase.trust import store
from simbase.trust.code import Code, is_in_file, key_of, located
from simbase.trust.fingerprint import fingerprint_of

#: How it is said on a command line.
_BY_OPTION = "read it, then --trust runs it; docs/trust.md"


class UntrustedError(UsageError):
    """A file names code, and nobody has said that it may be executed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trust:
    """What may be executed of the code that a file names."""

    #: All of it.
    everything: bool = False
    #: These files, and all in these folders.
    paths: tuple[Path, ...] = ()
    #: Code of these keys.
    keys: frozenset[str] = frozenset()
    #: A person who sits at a terminal may be asked.
    asks: bool = False
    #: Nothing is executed, and nothing refused: names are read only.
    only_reads: bool = False
    #: What a refusal tells to do.
    hint: str = _BY_OPTION

    @classmethod
    def of(cls, given: "bool | Trust") -> Self:
        """Return what an argument `trust=` of a program means: True is everything."""
        if isinstance(given, cls):
            return given
        return cls(everything=bool(given), hint="read it, then trust=True loads it; docs/trust.md")

    def admit(self, name: str, folder: Path, where: str) -> str:
        """Return a name out of a file, ready to be loaded.

        Args:
            name: FILE.py:CLASS, or another name, which stays as it is.
            folder: From where the file is seen.
            where: File, line and key, for messages.

        Raises:
            UntrustedError: Nobody has said that it may be executed.
            UsageError: There are too many files in its folder.
            FileError: A file of its folder or the configuration cannot be read.
        """
        if not is_in_file(name):
            return name
        whole = Code(located(name, folder), where=where, named=name)
        if self.only_reads or not whole.is_there:  # who loads what is not there says so
            return whole
        found = fingerprint_of(whole.file.parent)
        code = Code(whole, where=where, named=name, admitted=found)
        if not (self._holds(code) or (self.asks and _answer(code))):
            # Without a person no answer is a refusal.
            what = f"{where}: {shown_name(name)} is Python code, and nobody has said that it may run"
            raise UntrustedError(what, hint=self.hint)
        return code

    def _holds(self, code: Code) -> bool:
        """Tell whether it was said before that a file may be executed."""
        if self.everything or code.key in self.keys:
            return True
        file = code.file.resolve()
        return any(file.is_relative_to(path.resolve()) for path in (*self.paths, *store.configured())) or (
            code.key in store.answers()
        )


def _answer(code: Code) -> bool:
    """Ask the person at the terminal; yes is remembered."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        return False
    found = code.admitted
    count = len(found.files) if found is not None else 0
    others = f" and {count - 1} more file{'s' if count > 2 else ''} beside it" if count > 1 else ""
    sys.stderr.write(
        f"{shown_name(code.where)}: {shown_name(code.named)} is Python code: {shown_name(code.file)}{others}.\n"
        "It would run as you, with all that you may do. Has it been read, and may it run? [y/N] "
    )
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in {"y", "yes"}:
        return False
    try:
        store.remember(key_of(found, code.file) if found is not None else "", code.file)
    except P2osError as error:
        sys.stderr.write(f"{error}: the next time asks again\n")
    return True
