"""Workers of Dask distributed: on this machine, or of a scheduler somewhere.

The unit of work is one trial, which brings its firmware and world along, and the state that it goes on from where it
shares its beginning with others; what comes back is its outcome. Nothing needs
a disk that is shared. A worker needs p2os of the same version, and one thread.

Theory of operation. All trials of a batch are submitted, and looked at every `LOOK_S`. What a dead worker had is given
to another by the scheduler; what a dead scheduler had is submitted again as soon as one answers at its address.

Invariant: what comes of a trial depends on the trial alone; it is handed on exactly once.
"""

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import Any

from p2os.errors import RunFailedError
from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Done, Outcome, Trial, TrialVerdict
from robot_bench.campaign.workers.beginnings import Beginnings, SavedBeginning, Work, Worked
from robot_bench.campaign.workers.processes import MB, MOST_TRIES
from robot_bench.running.forks import LOOK_S
from simbase.errors import MissingDependencyError, UsageError
from simbase.installation import installed_version
from simbase.user_classes import unforeseen

#: chosen: so long a scheduler may be away, and workers may be missing, seconds.
PATIENCE_S = 120.0
#: chosen: so long one waits for a scheduler at first, seconds.
BEGIN_S = 10.0
#: chosen: how long one attempt to connect may take, seconds.
ATTEMPT_S = 5.0


class DaskWorkers:
    """Runs trials on workers of Dask.

    Args:
        address: Of the scheduler; None begins one here, with workers.
        count: How many workers are begun here.
        limits: What a trial may take; of memory only workers that are begun here know.
        look: Called often; what it raises ends all.

    Raises:
        MissingDependencyError: Dask is not installed.
        UsageError: Nothing answers at the address, or it has another version of p2os.
    """

    def __init__(
        self, address: str | None, count: int, limits: RunLimits, look: Callable[[], None] = lambda: None
    ) -> None:
        try:
            import distributed
        except ImportError as error:
            raise MissingDependencyError("workers of Dask need distributed", extra="campaign") from error
        self._limits, self._look = limits, look
        self._beginnings = Beginnings()
        self._cluster: Any = None
        if address is None:
            make: Any = distributed.LocalCluster
            self._cluster = make(
                n_workers=count, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0",
                memory_limit=limits.memory_mb * MB, host="127.0.0.1",
            )  # fmt: skip
        self._address = address or self._cluster.scheduler_address
        self._client = self._connected(patience_s=BEGIN_S)

    @property
    def where(self) -> str:
        """Where the scheduler is, and its dashboard."""
        return f"{self._address}, dashboard {self._client.dashboard_link or 'not there'}"

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        """Run all; call `on_done` with the place of each and what came of it, in the order in which they end.

        Args:
            trials: What to run.
            on_done: As said.
            anew: Each from its very beginning, whatever they share.

        Raises:
            KeyboardInterrupt: `look` has.
            UsageError: The scheduler, or its workers, stayed away, or have another version of p2os.
        """
        self._beginnings.run(trials, on_done, self._do, anew=anew)

    def _do(self, works: Sequence[Work], on_worked: Callable[[int, Worked], None]) -> None:
        """Do all, each on some worker."""
        tries = dict.fromkeys(range(len(works)), 0)
        running: dict[int, Any] = {}
        waits_since = time.monotonic()
        try:
            while tries:
                self._look()
                if self._client.status != "running":
                    running.clear()
                    with contextlib.suppress(Exception):  # what is gone cannot be closed
                        self._client.close(timeout=1)
                    self._client = self._connected(patience_s=PATIENCE_S)
                for place in [place for place in tries if place not in running]:
                    running[place] = self._client.submit(run_limited, works[place], self._limits, pure=False, retries=0)
                found = self._ended(running, tries)
                for place, done in found.items():
                    del tries[place]
                    on_worked(place, done)
                if found:
                    waits_since = time.monotonic()
                elif time.monotonic() - waits_since > PATIENCE_S + self._limits.cpu_s:
                    raise UsageError(f"no worker of {self._address} does anything", hint="are there any? dask worker")
                time.sleep(0 if found else LOOK_S)
        finally:
            with contextlib.suppress(Exception):  # nobody waits for them any more
                self._client.cancel(list(running.values()))

    def close(self) -> None:
        """End what was begun here."""
        with contextlib.suppress(Exception):  # as above
            self._client.close(timeout=2)
        if self._cluster is not None:
            self._cluster.close(timeout=5)

    def _ended(self, running: dict[int, Any], tries: dict[int, int]) -> dict[int, Worked]:
        """Return what has come, and forget what has to be submitted again."""
        found: dict[int, Worked] = {}
        for place, future in list(running.items()):
            if future.status == "finished":
                del running[place]
                try:
                    outcome, cpu_s, there = future.result(timeout=10)
                except Exception:  # noqa: BLE001, S112  # the worker that held it has died: once more
                    continue
                _refuse_other(there)
                found[place] = outcome, cpu_s
            elif future.status in {"error", "cancelled", "lost"}:
                del running[place]
                tries[place] += future.status == "error"
                if tries[place] >= MOST_TRIES:
                    why = f"its workers died, again and again: {future.exception(timeout=1)}"
                    found[place] = Outcome(verdict=TrialVerdict.ERROR, failures=(why,)), 0.0
        return found

    def _connected(self, *, patience_s: float) -> Any:
        """Return a client of the scheduler, as soon as it answers.

        Raises:
            UsageError: It does not.
        """
        from distributed import Client

        connect: Any = Client
        until = time.monotonic() + patience_s
        while True:
            self._look()
            try:
                return connect(self._address, timeout=ATTEMPT_S, set_as_default=False)
            except (OSError, ValueError) as error:
                if time.monotonic() >= until:
                    raise UsageError(
                        f"no scheduler answers at {self._address}",
                        hint="dask scheduler, and --scheduler tcp://HOST:8786",
                    ) from error
                time.sleep(LOOK_S)


def run_limited(work: Work, limits: RunLimits) -> tuple[Outcome | list[SavedBeginning], float, str]:
    """Do a piece of work in a worker; return what came of it, the seconds of a processor, and the version of p2os."""
    began = time.thread_time()

    def look() -> None:
        if time.thread_time() - began > limits.cpu_s:
            raise RunFailedError(f"it took more than {limits.cpu_s:g} s of a processor")

    try:
        outcome = work(look)
    except Exception as error:  # noqa: BLE001  # a bug there is an error of this trial, told by its name
        outcome = Outcome(verdict=TrialVerdict.ERROR, failures=(unforeseen(error),))
    return outcome, round(time.thread_time() - began, 3), installed_version()


def _refuse_other(there: str) -> None:
    if there != installed_version():
        raise UsageError(
            f"a worker has p2os {there}, and this is {installed_version()}", hint="install the same one there"
        )
