"""A row of the table, what it stands on in the cache, and what became of it."""

import re
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Protocol

#: chosen: longer than any row here takes on a busy machine, seconds of the clock.
LIMIT_S = 180.0


class ProgramKind(Enum):
    """What the foreign program is to us."""

    #: It runs on the emulated BluePill.
    FIRMWARE = "firmware"
    #: It drives a virtual robot.
    CLIENT = "client"
    #: It maps and plans for a virtual robot by ROS 2.
    STACK = "stack"


class RowStatus(Enum):
    """What became of a row."""

    PASSED = "passed"
    FAILED = "failed"
    #: Something that it needs is not there.
    MISSING = "missing"


class RowError(Exception):
    """What came back is not what must; the message says what did."""


@dataclass(frozen=True, kw_only=True)
class Source:
    """Where a program is from.

    Args:
        folder: Its folder in the cache.
        url: Of the public repository, or of the package's page.
        commit: 40 hexadecimal digits, or a package's version.
    """

    folder: str
    url: str
    commit: str


@dataclass(frozen=True, kw_only=True)
class RowPlace:
    """Where a row runs: the cache, and a folder of its own that is removed after it."""

    cache: Path
    scratch: Path

    def path(self, name: str) -> Path:
        """Return a file of the cache.

        Raises:
            RowError: there is none, though the row was begun.
        """
        found = matching(name, self.cache)
        if not found:
            raise RowError(f"no {name} in the cache")
        return found[0]

    def filled(self, text: str, **values: str) -> str:
        """Return a text whose {cache}, {scratch} and further {names} are filled in; other braces stay."""
        known = {"cache": str(self.cache), "scratch": str(self.scratch), **values}
        return re.sub(r"\{(\w+)\}", lambda found: known.get(found[1], found[0]), text)


def matching(pattern: str, cache: Path) -> list[Path]:
    """Return the files of the cache that a pattern means; an absolute path means itself."""
    if Path(pattern).is_absolute():
        return [Path(pattern)] if Path(pattern).exists() else []
    return sorted(cache.glob(pattern))


class ProgramJudge(Protocol):
    """What brings a program to speak and looks at what it says."""

    @property
    def needs(self) -> tuple[str, ...]:
        """What has to be there: with a slash a pattern of files in the cache, without one a program on PATH."""

    def run(self, place: RowPlace) -> str:
        """Return what came back.

        Raises:
            RowError: it is not what must come back.
        """


@dataclass(frozen=True, kw_only=True)
class Row:
    """A foreign program and its judge.

    Args:
        name: As `ROWS=` has it.
        kind: What it is to us.
        source: Where it is from.
        program: What has to be built of it, in words: chip, clock, pins, ports.
        said: What is said to it and what must come back, in words.
        judge: What does so.
        needs: What has to be there beside what the judge itself needs.
        limit_s: Seconds of the clock that it may take.
        tried: Why it does not run where this table was made: what was tried, and the error.
        found: Faults of ours that it has found.
    """

    name: str
    kind: ProgramKind
    source: Source
    program: str
    said: str
    judge: ProgramJudge
    needs: tuple[str, ...] = ()
    limit_s: float = LIMIT_S
    tried: str = ""
    found: str = ""

    @property
    def all_needs(self) -> tuple[str, ...]:
        """What has to be there."""
        return (*self.judge.needs, *self.needs)


@dataclass(frozen=True)
class Result:
    """What became of a row."""

    name: str
    status: RowStatus
    #: What came back, what did instead, or what is missing; one line.
    text: str
    seconds: float = 0.0
    notes: tuple[str, ...] = field(default=())
    #: What became of it the time before, where both were noted: how it ended and in how many seconds.
    before: str = ""
