"""Runs that share a beginning: it is run once, saved on the way, and each of them goes on from there.

Theory of operation. Until the first thing happens that only one of two trials has (a thing is placed or moved, a
fault begins), they are one run. So a trial has a *beginning* for each time at which something happens in it: the same
trial without what happens then and later. Where two of a batch have one in common, or where it is kept from a batch
before, it is run as far as is wanted and saved each `EACH_NS`; a trial then goes on from the newest state before what
is its own. What is saved is a value of some 50 kB, so that it goes to any worker.

Invariant: what comes of a trial is what comes of it from its beginning, hash and all; only what it costs is less.
"""

import pickle
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias, cast

from p2os.toml_record import number_of, tables_of
from p2os.toml_schema import Table
from robot_bench.bench import Bench, run_of
from robot_bench.campaign.trial import Done, Outcome, SeenSoFar, Trial, bench_of, run_trial, unpacked
from simbase.errors import P2osError
from simbase.timing import NS_PER_S, Nanos, nanos

#: What happens in a scenario at a time of its own, each a list of tables with `at_s`.
EVENTS = ("obstacle", "fault")
#: chosen: a state each so often; saving one costs as much as a third of a second of the run.
EACH_NS: Nanos = 2 * NS_PER_S
#: chosen: to go on from a state costs as much as 2 s of the run.
LEAST_NS: Nanos = 4 * NS_PER_S
#: chosen: so many beginnings are kept for the batches to come, some megabytes each.
MOST_KEPT = 16


@dataclass(frozen=True, slots=True)
class SavedBeginning:
    """A state on the way: it can be carried to any process, and a bench at its beginning goes on from it."""

    at: Nanos
    packed: bytes

    @classmethod
    def of(cls, bench: Bench, seen: SeenSoFar) -> "SavedBeginning":
        """Return the present state of a run, with what it has shown."""
        return cls(bench.now, zlib.compress(pickle.dumps((bench.snapshot(), seen.so_far(bench))), 1))

    def __call__(self, bench: Bench) -> SeenSoFar:
        """Put a bench into this state; return what the run had shown until then.

        Raises:
            UsageError: Its run is another until then.
        """
        snapshot, seen = pickle.loads(zlib.decompress(self.packed))  # noqa: S301 - of this campaign
        run_of(bench).begin_as(snapshot, self.at)
        return cast("SeenSoFar", seen)


@dataclass(frozen=True, slots=True)
class Task:
    """How far a beginning is to be run."""

    trial: Trial
    until: Nanos
    #: Where it is already; None: nowhere.
    start: SavedBeginning | None

    def __call__(self, look: Callable[[], None]) -> list[SavedBeginning]:
        """Run it; return the states on the way, none where it cannot be run.

        Args:
            look: Called between slices; may raise to end it.
        """
        found: list[SavedBeginning] = []
        with unpacked(self.trial.files) as folder:
            try:
                bench = bench_of(self.trial.scenario(folder))
                bench.on_slice = lambda _now: look()
                seen = SeenSoFar() if self.start is None else self.start(bench)
                seen.subscribe(bench, self.trial.looks_for)
                at = 0 if self.start is None else self.start.at
                while (at := at // EACH_NS * EACH_NS + EACH_NS) <= self.until:
                    bench.run_until(at)
                    if bench.now < at:  # it has ended
                        break
                    found.append(SavedBeginning.of(bench, seen))
            except P2osError:  # each trial tells it
                return []
        return found


#: What a worker does, given what it calls between slices: a trial, or a beginning.
Work: TypeAlias = Callable[[Callable[[], None]], Outcome | list[SavedBeginning]]
#: What came of it, and the seconds of a processor that it took.
Worked: TypeAlias = tuple[Outcome | list[SavedBeginning], float]
#: Does all, and hands on the place of each and what came of it.
Do: TypeAlias = Callable[[Sequence[Work], Callable[[int, Worked], None]], None]
#: Place of a trial → the hash of the beginning that it shares, and until when that lasts.
Shared: TypeAlias = dict[int, tuple[str, Nanos]]


class Beginnings:
    """The beginnings that the trials of a campaign have in common."""

    def __init__(self) -> None:
        #: The hash of a beginning → its states, oldest first; the beginning that was wanted last is the last one.
        self._kept: dict[str, list[SavedBeginning]] = {}

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], do: Do, *, anew: bool) -> None:
        """Have trials run by workers, what they share once; what that costs counts with those that go on from it.

        Args:
            trials: What to run.
            on_done: Called with the place of each and what came of it.
            do: The workers.
            anew: Each from its very beginning.
        """
        shared = {} if anew else self._shared(trials)
        begun_s = self._begin(trials, shared, do)
        starts = self._starts(shared)
        share_s = begun_s / max(len(starts), 1)

        def on_worked(place: int, worked: Worked) -> None:
            found, cpu_s = worked
            if isinstance(found, Outcome):
                on_done(place, (found, round(cpu_s + (share_s if place in starts else 0.0), 3)))

        do([partial(run_trial, trial, start=starts.get(place)) for place, trial in enumerate(trials)], on_worked)

    def _begin(self, trials: Sequence[Trial], shared: Shared, do: Do) -> float:
        """Have run what trials have in common; return the seconds of a processor that it took."""
        tasks = self._missing(trials, shared)
        spent_s = 0.0

        def on_worked(place: int, worked: Worked) -> None:
            nonlocal spent_s
            found, cpu_s = worked
            spent_s += cpu_s
            if isinstance(found, list):  # else it took too much, as each trial will
                key = list(tasks)[place]
                self._kept[key] = [*self._kept.get(key, []), *found]

        if tasks:
            do(list(tasks.values()), on_worked)
        return spent_s

    def _missing(self, trials: Sequence[Trial], shared: Shared) -> dict[str, Task]:
        """Return what is to be run before trials can go on from what they share: hash of a beginning → task."""
        found: dict[str, Task] = {}
        for trial, (key, until) in shared.items():
            states = self._kept.get(key, [])
            start = states[-1] if states else None
            known = found[key].until if key in found else start.at if start else 0
            if until // EACH_NS * EACH_NS > known:
                found[key] = Task(_before(trials[trial], until + 1), until, start)
        return found

    def _starts(self, shared: Shared) -> Mapping[int, SavedBeginning]:
        """Return where trials go on, by their places; those that are not in it begin at the beginning."""
        found: dict[int, SavedBeginning] = {}
        for place, (key, until) in shared.items():
            kept = self._kept.pop(key, [])
            self._kept[key] = kept
            if states := [state for state in kept if state.at <= until]:
                found[place] = states[-1]
        for key in list(self._kept)[:-MOST_KEPT]:
            del self._kept[key]
        return found

    def _shared(self, trials: Sequence[Trial]) -> Shared:
        """Return of each trial that has one the latest beginning that another one has too, and until when it lasts."""
        all_of = [[(_before(trial, at).sha256, at - 1) for at in _times(trial) if at > LEAST_NS] for trial in trials]
        counts = Counter(key for each in all_of for key, _ in each)
        return {
            place: shared[-1]
            for place, each in enumerate(all_of)
            if (shared := [one for one in each if counts[one[0]] > 1 or one[0] in self._kept])
        }


def _times(trial: Trial) -> list[Nanos]:
    """Return the times at which something happens in a trial; none where several robots share its world."""
    if isinstance(trial.table.get("robot"), list):
        return []
    return sorted({_at(table) for name in EVENTS for table in _events(trial, name)})


def _before(trial: Trial, at: Nanos) -> Trial:
    """Return a trial without what happens at a time and later."""
    return trial.with_lists(**{name: [one for one in _events(trial, name) if _at(one) < at] for name in EVENTS})


def _events(trial: Trial, name: str) -> list[Table]:
    return list(tables_of(trial.table, name))


def _at(table: Table) -> Nanos:
    return nanos(number_of(table, "at_s"))
