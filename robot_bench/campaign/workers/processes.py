"""Workers of this machine: forks of this process, each of which does one trial after the other within limits.

What every trial needs (the programs, the firmware's image, the world) is loaded once, here; a fork has it and begins
at once. To make one, and to have it copy what it writes to, costs as much as 4 s of a run, so it does some trials of a
batch before it ends. So a hundred thousand leave no more behind than these few, but for the states that others go on
from (`beginnings`).

A trial whose process was killed from outside is done again; one that takes more than its limits is an outcome of its
own, `ERROR`. A fork whose parent is gone ends at its next slice.

Invariant: what comes of a trial depends on the trial alone, not on how many run at a time, nor on their order.
"""

import gc
import math
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
from robot_bench.campaign.workers.beginnings import Beginnings, SavedBeginning, Work, Worked
from robot_bench.running.forks import LOOK_S, begin, how_it_ended
from simbase.files import writing_temporary
from simbase.user_classes import unforeseen

#: chosen: so often a trial is begun whose process or worker is killed from outside.
MOST_TRIES = 4
#: chosen: so many trials, or beginnings, a fork does before it ends.
MOST_WORKS = 16
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
        """Do all, in as many forks as run at a time."""
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
                        process, pipe = begin(_serve, works, place, self._limits, os.getpid(), Path(folder))
                        running[pipe] = place, tries, process
                    ready = wait(list(running), timeout=LOOK_S)
                    for pipe in [pipe for pipe in running if pipe in ready]:
                        place, tries, process = running.pop(pipe)
                        worked, goes_on = _result(process, pipe, self._limits)
                        if goes_on and waiting:
                            running[pipe] = (*waiting.pop(), process)
                        try:
                            pipe.send(running[pipe][0] if pipe in running else None)
                        except OSError:  # it has ended, and its result tells why; or it would wait forever
                            process.kill()
                        if pipe not in running:
                            pipe.close()
                            process.join()
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


def _serve(
    pipe: Connection, works: Sequence[Work], place: int | None, limits: RunLimits, parent: int, folder: Path
) -> None:
    """Do pieces of work in this fork, the first one and those that are asked for then.

    Sends after each what came of it, and whether it goes on.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal: the parent ends us
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGXCPU, signal.SIG_DFL)  # the command line's own handler would end it with a code
    tempfile.tempdir = str(folder)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    def look() -> None:
        if os.getppid() != parent:
            raise RunFailedError("the program that began it has ended")

    spent_s, left = 0.0, MOST_WORKS
    while place is not None:
        left -= 1
        found, is_sound = _limited(works[place], limits, look)
        before_s, spent_s = spent_s, _cpu_s()
        goes_on = is_sound and left > 0
        try:
            pipe.send(((found, round(spent_s - before_s, 3)), goes_on))
        except OSError:  # nobody waits for it any more; or the system does not take it, and it is done again
            os.kill(os.getpid(), signal.SIGKILL)
        place = _next_place(pipe, parent) if goes_on else None
    pipe.close()


def _limited(work: Work, limits: RunLimits, look: Callable[[], None]) -> tuple[Outcome | list[SavedBeginning], bool]:
    """Do a piece of work within limits; return what came of it, and whether this process may do another one."""
    _limit(resource.RLIMIT_CPU, math.ceil(_cpu_s()) + max(round(limits.cpu_s), 1))
    _limit(resource.RLIMIT_AS, _mapped_bytes() + limits.memory_mb * MB)
    try:
        return work(look), True
    except MemoryError:  # by that limit, or by the system
        return _error(f"it was refused memory; it may take {limits.memory_mb} MB"), False
    except Exception as error:  # noqa: BLE001  # a bug there is an error of this trial, told by its name
        return _error(unforeseen(error)), False


def _limit(what: int, most: int) -> None:
    """Set a limit of this process that a later piece of work may raise again."""
    hard = resource.getrlimit(what)[1]
    resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def _next_place(pipe: Connection, parent: int) -> int | None:
    """Wait for what is to be done next; None: nothing, or nobody waits for it any more."""
    gc.collect()  # what the last one has left
    try:
        while not pipe.poll(LOOK_S):
            if os.getppid() != parent:
                return None
        place: int | None = pipe.recv()
    except (EOFError, OSError):
        return None
    return place


def _result(process: ForkProcess, pipe: Connection, limits: RunLimits) -> tuple[Worked | None, bool]:
    """Return what came of the work of a fork, None where it was killed from outside; and whether it goes on."""
    try:
        worked, goes_on = pipe.recv()
    except (EOFError, OSError):  # an OSError without a number where it was killed in the middle of sending
        process.join()
        return _how_it_ended(process, limits), False
    return worked, goes_on


def _how_it_ended(process: ForkProcess, limits: RunLimits) -> Worked | None:
    """Return what came of work in which its process ended; None where that was killed from outside."""
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
