"""A piece of work in a process of its own, of which nothing is left: not what it started, nor what those did.

Theory of operation. The work runs in a forked child with a session of its own. A process that leaves that session, as
a daemon does, becomes a child of ours as whoever started it ends, for we are their subreaper (prctl(2),
PR_SET_CHILD_SUBREAPER, Linux); so all that is left when the work has ended, or its time is over, is killed.
Invariant: when `isolated` returns or raises, this process has the children that it had before.
"""

import contextlib
import ctypes
import json
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from tools.foreign.row import RowError

_SUBREAPER = 36
_READ_BYTES = 65536


class LeftError(Exception):
    """The work died, or its time was over; the message says which."""


def isolated(work: Callable[[], str], limit_s: float, log: Path) -> str:
    """Do a piece of work in a child; return what it returns.

    Args:
        work: What to do.
        limit_s: Seconds that it may take.
        log: Where what it and its children print goes.

    Raises:
        RowError: It raised this.
        LeftError: It ended otherwise than by returning, or its time was over.
    """
    reading, writing = os.pipe()
    sys.stdout.flush()
    sys.stderr.flush()
    with nothing_left():
        if os.fork() == 0:
            os.close(reading)
            _work_and_end(work, writing, log)
        os.close(writing)
        try:
            return _answer(reading, limit_s)
        finally:
            os.close(reading)


@contextlib.contextmanager
def nothing_left() -> Iterator[None]:
    """Kill in the end what was started meanwhile, and what that has started."""
    before = children(os.getpid())
    _adopt(is_on=True)
    try:
        yield
    finally:
        while left := children(os.getpid()) - before:
            for pid in left:
                kill_tree(pid)
        _adopt(is_on=False)


def _work_and_end(work: Callable[[], str], writing: int, log: Path) -> None:
    """Do it, say what came of it, and end this process, whatever happens."""
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
        nothing = os.open(os.devnull, os.O_RDONLY)
        for number, target in ((0, nothing), (1, output), (2, output)):
            os.dup2(target, number)
        sys.stdout = sys.stderr = os.fdopen(1, "w", buffering=1, errors="replace", closefd=False)
        try:
            said = {"returned": work()}
        except RowError as failure:
            said = {"failed": str(failure)}
        except BaseException as error:  # noqa: BLE001  # whatever it was, the parent hears of it
            traceback.print_exc()
            said = {"died": f"{type(error).__name__}: {error}"}
        os.write(writing, json.dumps(said).encode())
    finally:
        sys.stderr.flush()
        os._exit(0)


def _answer(reading: int, limit_s: float) -> str:
    end, data = time.monotonic() + limit_s, bytearray()
    while True:
        left = end - time.monotonic()
        if left <= 0 or not select.select([reading], [], [], left)[0]:
            raise LeftError(f"not done within {limit_s:g} s")
        read = os.read(reading, _READ_BYTES)
        data += read
        if not read:
            break
        with contextlib.suppress(ValueError):  # it is not whole yet; who it started may hold the pipe open
            json.loads(data)
            break
    if not data:
        raise LeftError("its process died")
    said = json.loads(data)
    if "failed" in said:
        raise RowError(said["failed"])
    if "died" in said:
        raise LeftError(said["died"])
    return str(said["returned"])


def _adopt(*, is_on: bool) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, int(is_on), 0, 0, 0)


def children(pid: int) -> set[int]:
    """Return the processes that a process has as its children now."""
    found = set[int]()
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found |= {int(word) for word in (task / "children").read_text().split()}
    return found


def kill_tree(pid: int) -> None:
    """Kill a child of ours and wait for it; those of its own come to us, or are killed with it."""
    for child in children(pid):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(child, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(pid, signal.SIGKILL)
    with contextlib.suppress(ChildProcessError):
        os.waitpid(pid, 0)
