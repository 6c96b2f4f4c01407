"""A source file changed in one place.

Invariant: a mutant is its file's text before and after; it is the same mutant wherever in the file its lines stand.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """One piece of a source that another text replaces; offsets in bytes of UTF-8."""

    start: int
    end: int
    text: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceMutant:
    """One change of one file.

    Args:
        path: The file, from the project's folder.
        kind: What sort of change it is, a word of the reports.
        first_line: The first line that it changes, from 1.
        last_line: The last.
        before: Those lines as they stand, stripped, one space between two.
        after: What stands in their place.
        source: The whole file as it stands, one object for all its mutants.
        edits: What is replaced in it, in the order of their places.
    """

    path: str
    kind: str
    first_line: int
    last_line: int
    before: str
    after: str
    source: bytes
    edits: tuple[Edit, ...]

    @property
    def text(self) -> bytes:
        """Return the whole file, changed."""
        return _with_edits(self.source, self.edits)

    @property
    def name(self) -> str:
        """Return where and what the change is."""
        return f"{self.path}:{self.first_line}: {self.before}  ->  {self.after}"

    @property
    def package(self) -> str:
        """Return what a figure is given for: the two upper folders, or three where two hold several packages."""
        folders = self.path.split("/")[:-1]
        return "/".join(folders[: 3 if folders[1:2] in (["pioneer"], ["core"], ["extension"]) else 2])

    @property
    def row(self) -> tuple[str, str, str]:
        """Return what names it in the list of survivors, which outlives a change of other lines."""
        return self.path, self.before, self.after

    @property
    def key(self) -> str:
        """Return a name of the change in this file as it stands."""
        return hashlib.sha256(self.path.encode() + b"\0" + self.text).hexdigest()


def edited(path: str, source: bytes, kind: str, edits: Iterable[Edit]) -> SourceMutant:
    """Return the mutant that some edits of a file make."""
    ordered = tuple(sorted(edits, key=lambda edit: edit.start))
    start = source.rfind(b"\n", 0, ordered[0].start) + 1
    end = source.find(b"\n", ordered[-1].end)
    end = len(source) if end < 0 else end
    moved = [Edit(start=edit.start - start, end=edit.end - start, text=edit.text) for edit in ordered]
    before = source[start:end]
    return SourceMutant(
        path=path, kind=kind, first_line=source.count(b"\n", 0, start) + 1, last_line=source.count(b"\n", 0, end) + 1,
        before=_on_one_line(before), after=_on_one_line(_with_edits(before, moved)), source=source, edits=ordered,
    )  # fmt: skip


def _with_edits(text: bytes, edits: Sequence[Edit]) -> bytes:
    for edit in reversed(edits):
        text = text[: edit.start] + edit.text + text[edit.end :]
    return text


def _on_one_line(text: bytes) -> str:
    return " ".join(text.decode().split())
