"""Workers of this machine: each trial in a process of its own, a fork of this one, within limits of time and memory.

What every trial needs (the programs, the firmware's image, the world) is loaded once, here; a fork has it and begins
at once. Nothing of a trial outlives its process, so a hundred thousand leave no more behind than one, but for the
states that others go on from (`beginnings`).

A process that was killed from outside is done again; one that takes more than its limits is an outcome of its own,
`ERROR`. A fork whose parent is gone ends at its next slice.

Invariant: what comes of a trial depends on the trial alone, not on how many run at a time, nor on their order.
"""

import contextlib
import os
import resource
import signal
import tempfile
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from pathlib import Path

from p2os.errors import RunFailedError
from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Done, Outcome, Trial, TrialVerdict, warm_up
from robot_bench.campaign.workers.beginnings import Beginnings, Work, Worked
from robot_bench.running.forks import LOOK_S, begin, how_it_ended, received
from simbase.files import writing_temporary
from simbase.user_classes import unforeseen

#: chosen: so often a trial is begun whose process or worker is killed from outside.
MOST_TRIES = 4
#: Between the soft and the hard limit of the processor's time, seconds.
_GRACE_S = 5
MB = 1 << 20


class Processes:
    """Runs trials in processes of this machine.

    Args:
        at_once: How many run at a time.
        limits: What one may take.
        look: Called often; what it raises ends all.
    """

    def __init__(self, at_once: int, limits: RunLimits, look: Callable[[], None] = lambda: None) -> None:
        self._at_once, self._limits, self._look = at_once, limits, look
        self._beginnings = Beginnings()
        #: What this process has loaded: files, body and mode of trials.
        self._warm: set[object] = set()

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        """Run all; call `on_done` with the place of each and what came of it, in the order in which they end.

        Args:
            trials: What to run.
            on_done: As said.
            anew: Each from its very beginning, whatever they share.

        Raises:
            KeyboardInterrupt: `look` has; what was running is gone.
        """
        for trial in trials:
            needs = tuple(sorted(trial.files.items())), trial.table.get("body"), trial.table.get("mode")
            if needs not in self._warm:
                self._warm.add(needs)
                warm_up(trial)
        self._beginnings.run(trials, on_done, self._do, anew=anew)

    def _do(self, works: Sequence[Work], on_worked: Callable[[int, Worked], None]) -> None:
        """Do all, each in a process of its own."""
        waiting = [(place, 1) for place in range(len(works))][::-1]
        running: dict[Connection, tuple[int, int, ForkProcess]] = {}
        with writing_temporary():
            made = tempfile.TemporaryDirectory(prefix="p2os-campaign-")
        with made as folder:
            try:
                while running or waiting:
                    self._look()
                    while waiting and len(running) < self._at_once:
                        place, tries = waiting.pop()
                        process, pipe = begin(_work, works[place], self._limits, os.getpid(), Path(folder))
                        running[pipe] = place, tries, process
                    ready = wait(list(running), timeout=LOOK_S)
                    for pipe in [pipe for pipe in running if pipe in ready]:
                        place, tries, process = running.pop(pipe)
                        worked = _result(process, pipe, self._limits)
                        if worked is None and tries < MOST_TRIES:
                            waiting.append((place, tries + 1))
                        else:
                            on_worked(place, worked or (_error("its process was killed, again and again"), 0.0))
            finally:
                for _, _, process in running.values():
                    process.kill()
                    process.join()

    def close(self) -> None:
        """Nothing is kept between runs."""


def _work(pipe: Connection, work: Work, limits: RunLimits, parent: int, folder: Path) -> None:
    """Do a piece of work in this fork, and send what came of it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal: the parent ends us
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGXCPU, signal.SIG_DFL)  # the command line's own handler would end it with a code
    tempfile.tempdir = str(folder)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    seconds = max(round(limits.cpu_s), 1)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + _GRACE_S))
    most = _mapped_bytes() + limits.memory_mb * MB
    resource.setrlimit(resource.RLIMIT_AS, (most, most))

    def look() -> None:
        if os.getppid() != parent:
            raise RunFailedError("the program that began it has ended")

    try:
        found = work(look)
    except MemoryError:
        found = _error(f"it was refused memory; it may take {limits.memory_mb} MB")  # by that limit, or by the system
    except Exception as error:  # noqa: BLE001  # a bug there is an error of this trial, told by its name
        found = _error(unforeseen(error))
    with contextlib.suppress(OSError):  # nobody waits for it any more
        pipe.send((found, round(_cpu_s(), 3)))
    pipe.close()


def _result(process: ForkProcess, pipe: Connection, limits: RunLimits) -> Worked | None:
    """Return what came of a process that has ended; None where it was killed from outside."""
    done: Worked | None = received(process, pipe)
    if done is not None:
        return done
    code = process.exitcode or 0
    if code in {-signal.SIGKILL, -signal.SIGTERM}:
        return None
    if code == -signal.SIGXCPU:
        return _error(f"it took more than {limits.cpu_s:g} s of a processor"), limits.cpu_s
    return _error(how_it_ended(process)), 0.0


def _error(why: str) -> Outcome:
    return Outcome(verdict=TrialVerdict.ERROR, failures=(why,))


def _mapped_bytes() -> int:
    """Return how much memory this process has mapped; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except OSError:
        return 0
    return pages * resource.getpagesize()


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
