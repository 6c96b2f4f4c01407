"""A verb whose N-th call of a kind fails, is short, or is its last: `tests/whole/failing_calls.c` loaded into it.

Calls are counted from the verb's first line on, in the verb's own process and those that it forks. What it imports
before that is there already; modules that it imports later are files that it opens, too.
"""

import os
import random
import shutil
import signal
import struct
import subprocess
import sys
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.tools.forked_python import forked_python
from tests.tools.made_once import made_once

SOURCE = Path(__file__).with_suffix(".c")
#: A verb that is not over then hangs, s.
LIMIT_S = 120
#: robot_bench stands here so that the server imports its verbs before it forks.
CHILD = """
import ctypes, io, sys, tempfile
import robot_bench
from p2os.cli.main import run
from simbase.command_line.help_pages import VerbPage
sys.dont_write_bytecode = True  # Python itself leaves half a file of code there
tempfile.tempdir = "tmp"
# With PYTHONUNBUFFERED a text is written to the descriptor itself, and Python forgets what a short write has left.
sys.stdout = io.TextIOWrapper(open(1, "wb", closefd=False), encoding="utf-8")
page, kind, number, outcome = sys.argv[1], *map(int, sys.argv[2:5])
calls, begin = ctypes.CDLL(None), VerbPage.invoke
def invoke(verb, context):
    if calls.failing_calls_arm(page.encode(), kind, ctypes.c_long(number), outcome):
        raise SystemExit(f"{page}: cannot be shared")
    return begin(verb, context)
VerbPage.invoke = invoke
sys.exit(run(sys.argv[5:]))
"""


class Kind(IntEnum):
    """What is called; as in the C source."""

    OPEN = 0
    READ = 1
    WRITE = 2
    FSYNC = 3
    RENAME = 4
    MALLOC = 5
    SOCKET = 6


class Outcome(IntEnum):
    """What becomes of the call; as in the C source."""

    COUNT = 0
    FAIL = 1
    SHORTEN = 2
    END = 3


#: Whose failing leaves no way to say so.
UNHEARD = ("write 1", "write 2")
#: Kinds that move bytes, and can move fewer.
SHORT = frozenset({Kind.READ, Kind.WRITE, Kind.SOCKET})
_PAGE = struct.Struct(f"{len(Kind)}q256s")


class FailedCall(NamedTuple):
    """Which call does not do what it is to."""

    kind: Kind = Kind.OPEN
    number: int = 0
    outcome: Outcome = Outcome.COUNT

    def __str__(self) -> str:
        """Return it as the name of a test."""
        return f"{self.kind.name.lower()}-{self.number}-{self.outcome.name.lower()}"


#: Nothing fails.
SOUND = FailedCall()


@dataclass(frozen=True, slots=True)
class Ended:
    """How a verb ended."""

    code: int
    out: str
    err: str
    #: Calls by kind.
    counts: dict[Kind, int]
    #: The call that was failed and what it was about; "" where it never came to it.
    failed: str

    @property
    def was_killed(self) -> bool:
        """Whether the call was its last."""
        return self.code == -signal.SIGKILL

    @property
    def was_killed_by_others(self) -> bool:
        """Whether memory was refused to a library that is not ours and that uses it all the same: Unicorn does."""
        return self.code < 0 and "alloc " in self.failed and "/site-packages/" in self.failed

    def wrong(self) -> list[str]:
        """Return what must not be of a verb that was not killed: how it ended, and what it said."""
        found = [] if self.code in {0, 1, 2} else [f"ended with {self.code}"]
        found += [word for word in ("Traceback", "bug", "ignored") if word in self.err]
        if self.code and self.failed not in UNHEARD:
            found += [] if "p2os: " in self.err or self.out else ["it said nothing"]
            found += [] if "hint: " in self.err or self.code == 1 else ["refused without a hint"]
        return found


def library(factory: pytest.TempPathFactory) -> str:
    """Return the path of the library, built once a run.

    Raises:
        pytest.skip.Exception: There is no C compiler.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")

    def build(folder: Path) -> Path:
        made = folder / "failing_calls.so"
        words = [compiler, "-shared", "-fPIC", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(made), str(SOURCE)]
        subprocess.run(words, check=True)
        return made

    return str(made_once(factory, "failing-calls", build))


@cache
def _program(path: str) -> str:
    return forked_python(path)


def page_in(folder: Path) -> Path:
    """Make the file in which a process counts."""
    page = folder / "page"
    page.write_bytes(bytes(_PAGE.size))
    return page


def counted(page: Path) -> tuple[dict[Kind, int], str]:
    """Return what stands in such a file: calls by kind, and which was failed."""
    *counts, failed = _PAGE.unpack(page.read_bytes())
    return dict(zip(Kind, counts, strict=True)), failed.rstrip(b"\0").decode(errors="replace")


def command(path: str, page: Path, call: FailedCall, *words: str) -> list[str]:
    """Return the command line of a verb in which this call fails.

    Args:
        path: Of the library.
        page: As of `page_in`.
        call: Which one, and how.
        words: Of the verb.
    """
    numbers = (str(int(number)) for number in call)
    kind, number, outcome = numbers
    return [_program(path), "-c", CHILD, str(page), kind, number, outcome, *words]


def run_verb(path: str, folder: Path, call: FailedCall, *words: str) -> Ended:
    """Run a verb in a folder, with this call failing; arguments as of `command`."""
    (folder / "tmp").mkdir(exist_ok=True)
    page = page_in(folder / "tmp")
    done = subprocess.run(
        command(path, page, call, *words), cwd=folder, capture_output=True, text=True, errors="replace",
        check=False, timeout=LIMIT_S,
    )  # fmt: skip
    return Ended(done.returncode, done.stdout, done.stderr, *counted(page))


def swept(name: str, ended: Ended, chooser: random.Random, most: int) -> list[FailedCall]:
    """Return the calls of a verb that a sweep tries, and print how many there are and how many of them it tries.

    P2OS_CALLS=3 takes three of a kind, for a look that does not take hours: `P2OS_CALLS=3 pytest -m soak -s FILE`.
    """
    calls = calls_of(ended, chooser, min(most, int(os.environ.get("P2OS_CALLS", str(most)))))
    counts = ", ".join(f"{count} {kind.name.lower()}" for kind, count in ended.counts.items() if count)
    sys.stderr.write(f"swept {name}: {sum(ended.counts.values())} calls ({counts}), {len(calls)} tried\n")
    return calls


def calls_of(ended: Ended, chooser: random.Random, most: int) -> list[FailedCall]:
    """Draw at most so many calls of each kind, each with all that may become of it."""
    found = []
    for kind, count in ended.counts.items():
        outcomes = [Outcome.FAIL, Outcome.END] + [Outcome.SHORTEN] * (kind in SHORT)
        numbers = range(1, count + 1)
        for number in sorted(chooser.sample(numbers, most)) if most < count else numbers:
            found += [FailedCall(kind, number, outcome) for outcome in outcomes]
    return found
