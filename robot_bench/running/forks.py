"""A piece of work in a fork of this process, and what comes of it through a pipe.

A fork has all that this process has loaded and read, so it begins at once; and what it does to itself (a crash of a
library too) is seen by nobody else.
"""

import gc
import signal
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from typing import Any

#: chosen: how long a signal may wait for this process to look, seconds.
LOOK_S = 0.1


def begin(work: Callable[..., None], *arguments: object) -> tuple[ForkProcess, Connection]:
    """Begin `work(pipe, *arguments)` in a fork, which sends what comes of it; return it, and the pipe's other end.

    It may ask for more by the same pipe.
    """
    ours, theirs = get_context("fork").Pipe()
    process = get_context("fork").Process(target=_begun, args=(work, theirs, *arguments), daemon=True)
    process.start()
    theirs.close()
    return process, ours


def _begun(work: Callable[..., None], *arguments: object) -> None:
    """Do the work, without ever searching for garbage in what was there before the fork: that would copy it."""
    gc.freeze()
    work(*arguments)


def received(process: ForkProcess, pipe: Connection) -> Any:  # whatever was sent
    """Return what came of a fork that has sent it or ended, and wait for its end; None where it has not sent all."""
    try:
        return pipe.recv()
    except (EOFError, OSError):  # an OSError without a number where it was killed in the middle of sending
        return None
    finally:
        pipe.close()
        process.join()


def in_fork(work: Callable[[], object]) -> Any:  # what the work returns
    """Do a piece of work in a fork, and return what it returns; None where the fork ended before."""
    return received(*begin(_sent, work))


def _sent(pipe: Connection, work: Callable[[], object]) -> None:
    pipe.send(work())
    pipe.close()


def how_it_ended(process: ForkProcess) -> str:
    """Return how a fork ended that has sent nothing, in words."""
    code = process.exitcode or 0
    how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
    return f"its process ended {how}"
