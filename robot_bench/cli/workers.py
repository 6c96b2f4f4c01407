"""Work on several processes at once: each piece in a process of its own, which is a fork of this one.

What comes of a piece is a JSON object.

A signal ends all of them in good order: each gets SIGINT, and is waited for. A second one, later than three seconds,
kills what is left. A fork whose parent was killed ends at its next slice.

Invariant: what comes of a piece depends on its number alone, not on how many run at a time, nor on their order.
"""

import contextlib
import os
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Annotated

from p2os.cli.quantities import option
from p2os.pioneer.body.factory import load_engine
from robot_bench.bench.board import boot
from robot_bench.events.codec import Json
from robot_bench.recording.summary import INTERRUPTED
from robot_bench.running.forks import LOOK_S, begin, how_it_ended, received
from robot_bench.scenario.scenario import Scenario
from simbase.errors import P2osError
from simbase.units import COUNT
from simbase.user_classes import unforeseen

#: Called in the fork: (number of the piece, look), where `look` is to be called between slices.
Job = Callable[[int, Callable[[], None]], Json]
#: How many of them, as an option.
Jobs = Annotated[
    int | None,
    option(COUNT, "--jobs", "-j", purpose="Runs at a time; default as many as processors.", above_zero=True),
]


def core_count() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def load_once(scenario: Scenario) -> None:
    """Load the emulator, the program and the body's engine here, which takes longer than a short run: forks have them.

    What cannot be loaded each run tells of.
    """
    with contextlib.suppress(P2osError):
        boot(scenario)
        load_engine(scenario.body)


def run_in_processes(
    job: Job,
    count: int,
    *,
    at_once: int,
    on_done: Callable[[int, Json], None],
    raise_if_interrupted: Callable[[], None],
) -> bool:
    """Do `count` pieces of work; tell whether all were begun and nothing interrupted them.

    Args:
        job: Does one piece, in a process of its own.
        count: How many there are, numbered from 0.
        at_once: How many run at a time.
        on_done: Called with each piece's number and what came of it, in the order in which they end.
        raise_if_interrupted: Called often here and in the forks; raises KeyboardInterrupt where a signal has come.
    """
    running: dict[int, tuple[ForkProcess, Connection]] = {}
    waiting = list(range(count))[::-1]
    is_interrupted = False
    while running or (waiting and not is_interrupted):
        try:
            raise_if_interrupted()
            while waiting and len(running) < at_once and not is_interrupted:
                running[waiting[-1]] = begin(_work, job, waiting[-1], os.getpid(), raise_if_interrupted)
                waiting.pop()
            ready = wait([pipe for _, pipe in running.values()], timeout=LOOK_S)
        except KeyboardInterrupt:
            for process, _ in running.values():
                _send(process, signal.SIGKILL if is_interrupted else signal.SIGINT)
            is_interrupted = True
            continue
        for number in [number for number, (_, pipe) in running.items() if pipe in ready]:
            process, pipe = running.pop(number)
            found = received(process, pipe)
            on_done(number, failure(how_it_ended(process)) if found is None else found)
    return not is_interrupted


def _work(pipe: Connection, job: Job, number: int, parent: int, raise_if_interrupted: Callable[[], None]) -> None:
    """Do a piece of work in this fork, and send what came of it."""

    def look() -> None:
        raise_if_interrupted()
        if os.getppid() != parent:
            raise KeyboardInterrupt("the program that began it has ended")

    try:
        found = job(number, look)
    except KeyboardInterrupt:
        found = failure(INTERRUPTED)
    except P2osError as error:
        found = failure(str(error))
    except Exception as error:  # noqa: BLE001  # a bug there is a failure of this piece, told by its name
        found = failure(unforeseen(error))
    with contextlib.suppress(OSError):  # nobody waits for it any more
        pipe.send(found)
    pipe.close()


def failure(why: str) -> Json:
    """Return what comes of a piece that did not come to its end."""
    return {"passed": False, "failures": [why]}


def _send(process: ForkProcess, what: signal.Signals) -> None:
    with contextlib.suppress(OSError):  # it has ended meanwhile
        os.kill(process.pid or 0, what)
