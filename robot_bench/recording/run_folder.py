"""The folder that a run writes: whose it is while the run lasts, and what is kept of an earlier one.

A run holds a lock on its folder. The operating system gives the lock back when
the process ends, however it ends, so a run that was killed blocks nobody. Automatic
numbers are given out by making the folder, which succeeds for one run only.

Not covered: a file system that knows no locks (some network drives). There two runs
with one `--out` are told apart by the trace that the first has begun.

Invariant: what an earlier run has written is removed by `force` alone.
"""

import contextlib
import fcntl
import os
import re
from collections.abc import Iterator
from pathlib import Path

from simbase.errors import UsageError
from simbase.files import reason_of, refuse_elsewhere

#: Where run folders go by default, in the current directory.
RUNS = Path("runs")
#: What happened, an event a line: the record of the run.
TRACE_NAME = "trace.jsonl"
#: Values of the variables that were watched.
VARIABLES_NAME = "variables.jsonl"
#: How it came out.
SUMMARY_NAME = "summary.json"
#: What was done by hand in a run, as a scenario that is that run without a page.
HANDS_NAME = "hands.toml"
#: A long run as its page shows it (`robot_bench.view.kept_recording`).
KEPT_NAME = "page.p2vf"
#: All that a run leaves in its folder.
FILES = (
    TRACE_NAME, VARIABLES_NAME, SUMMARY_NAME, HANDS_NAME, KEPT_NAME, "report.html", "pins.vcd", "pins.sr", "wire.jsonl",
    "usart.txt",
    "path.png", "speeds.png", "pins.png",
    "coverage.txt", "coverage.html", "coverage.info", "profile.txt", "profile.folded", "profile.svg",
)  # fmt: skip


@contextlib.contextmanager
def reserved(folder: Path, *, force: bool = False) -> Iterator[None]:
    """Hold an empty run folder for a block; nobody else's `reserved` gets it meanwhile.

    Args:
        folder: Made where it is missing.
        force: Remove what an earlier run has written there.

    Raises:
        UsageError: It cannot be made, another run is writing into it, or it holds a run or something else.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise UsageError(f"cannot make the run folder {folder}: {error.strerror}") from error
    try:
        _lock(handle, folder)
        _clear(folder, force=force)
        yield
    finally:
        os.close(handle)  # gives the lock back


def make_next_folder(name: str, parent: Path = RUNS) -> Path:
    """Make the folder NAME-NNN with the first number above all that are there, and return it.

    Raises:
        UsageError: It cannot be made, or the name leads elsewhere.
    """
    refuse_elsewhere(parent, name, UsageError)
    pattern = re.compile(rf"{re.escape(name)}-(\d+)$")
    try:
        parent.mkdir(parents=True, exist_ok=True)
        while True:
            there = [int(found[1]) for item in parent.iterdir() if (found := pattern.match(item.name))]
            folder = parent / f"{name}-{max(there, default=0) + 1:03d}"
            with contextlib.suppress(FileExistsError):  # another run took that number at the same time
                folder.mkdir()
                return folder
    except OSError as error:
        raise UsageError(
            f"cannot make a run folder in {parent}: {reason_of(error)}",
            hint="--out FOLDER makes it elsewhere",
        ) from error


@contextlib.contextmanager
def used_folder(out: Path | None, name: str, parent: Path = RUNS) -> Iterator[Path]:
    """Yield the folder that was named, or the next; one that holds nothing where the block fails is taken away.

    Raises:
        UsageError: As of `make_next_folder`.
    """
    folder = out or make_next_folder(name, parent)
    try:
        yield folder
    except BaseException:
        with contextlib.suppress(OSError):
            folder.rmdir()
        raise


def remove_run(folder: Path) -> None:
    """Remove what a run has left, and its folder where that holds nothing else.

    Raises:
        UsageError: It cannot be removed.
    """
    try:
        for name in FILES:
            (folder / name).unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # somebody else's file
            folder.rmdir()
    except OSError as error:
        raise UsageError(f"cannot remove the run in {folder}: {error.strerror}") from error


def _lock(handle: int, folder: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(
            f"another run is writing into {folder}", hint="give each run its own --out, or none: runs are numbered"
        ) from None
    except OSError:  # this file system knows no locks
        return


def _clear(folder: Path, *, force: bool) -> None:
    holds_run = (folder / TRACE_NAME).is_file()
    if not holds_run and any(folder.iterdir()):
        raise UsageError(f"{folder} holds something that is no run", hint="--out takes a new or an empty folder")
    if holds_run and not force:
        raise UsageError(f"{folder} holds a run already", hint="--force overwrites it; without --out runs are numbered")
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
