"""Carries a campaign out: asks the search, has the runs done, confirms what fails, and tells the search.

Theory of operation. A batch of points is asked for. Their runs of the cheap stage are done, in any order, by any
number of workers; then, in the order of the points, each one that failed is run in full, as far as the budget of
confirmations goes. A run in full that failed is done once more in another process, from its very beginning, and counts
as a failure only where its hash is the same. Then the search is told. When no batch follows, what is left of the
confirmations goes to the nearest misses of all batches, the nearest first: a search learns of cheap runs alone, so
nothing is lost by that, and no near miss takes what a failure needs. Since every step is taken in the order of the
points and depends on their outcomes alone, the same campaign comes to the same runs on any machine of the same version.

A campaign that goes on begins anew and finds what was done in its journal, so a kill at any instant loses the runs
that were under way and nothing else.

Invariant: the rows, their order and all in them but the seconds depend on the campaign alone; a limit of minutes cuts
them after a whole batch, and the near misses after the first batch of them.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Protocol

from robot_bench.campaign.campaign_file import Campaign
from robot_bench.campaign.journal import Journal
from robot_bench.campaign.margin import margin
from robot_bench.campaign.search import SEARCHES, PointResult, Problem
from robot_bench.campaign.space import Proposal, Space
from robot_bench.campaign.trial import Done, Outcome, Trial, TrialVerdict
from simbase.timing import NS_PER_S, Nanos
from simbase.units import ranges_text

NS_PER_HOUR = 3600 * NS_PER_S
#: What a search gets of a run without a verdict: nothing to go towards.
NO_VERDICT = 1.0


class RunPurpose(Enum):
    """What a run is for."""

    #: Proposes: the cheap fidelity.
    CHEAP = "cheap"
    #: Confirms: the given body, through the adapter.
    FULL = "full"
    #: Proves: the same again in another process.
    REPLAY = "replay"


class PointFinding(Enum):
    """What came of a point, both fidelities considered."""

    PASSED = "passed"
    #: Passed, and missed a goal that does not judge it, for what disturbed it.
    EXCUSED = "excused"
    #: Both failed.
    CONFIRMED = "confirmed"
    #: The run in full failed, and the cheap one passed.
    FULL_ONLY = "full only"
    #: The cheap run failed, and the one in full passed: no failure.
    CHEAP_ONLY = "cheap only"
    #: The cheap run failed, and the budget had no confirmation left.
    UNCONFIRMED = "unconfirmed"
    #: The run in full failed once, and not again with the same hash: a bug of the bench, never reported as a failure.
    NOT_REPEATED = "not repeated"
    #: There is no verdict.
    ERROR = "error"


#: What is reported as a failure.
FAILURES = frozenset({PointFinding.CONFIRMED, PointFinding.FULL_ONLY})


@dataclass(frozen=True, slots=True)
class Run:
    """A run that was done."""

    stage: RunPurpose
    trial: Trial
    outcome: Outcome
    cpu_s: float

    @property
    def margin(self) -> float | None:
        """As of `margin`."""
        return margin(self.outcome)


@dataclass(frozen=True, slots=True)
class PointRow:
    """A point with all that was run of it."""

    number: int
    proposal: Proposal
    cheap: Run
    full: Run | None = None
    replay: Run | None = None
    #: How many blocks and states it reached that none before it had.
    new: int = 0
    #: Whether it was drawn from the whole space, as of `Search.is_drawn`.
    is_drawn: bool = False

    @property
    def runs(self) -> Sequence[Run]:
        """Those that were done."""
        return [run for run in (self.cheap, self.full, self.replay) if run is not None]

    @property
    def finding(self) -> PointFinding:
        """What came of it."""
        cheap = self.cheap.outcome.verdict
        passed = PointFinding.EXCUSED if self.cheap.outcome.excused_goals else PointFinding.PASSED
        if self.full is None:
            return {
                TrialVerdict.PASSED: passed, TrialVerdict.FAILED: PointFinding.UNCONFIRMED,
                TrialVerdict.ERROR: PointFinding.ERROR,
            }[cheap]  # fmt: skip
        if self.full.outcome.verdict is TrialVerdict.ERROR:
            return PointFinding.ERROR
        if self.full.outcome.verdict is TrialVerdict.PASSED:
            return PointFinding.CHEAP_ONLY if cheap is TrialVerdict.FAILED else passed
        if self.replay is None or self.replay.outcome.sha256 != self.full.outcome.sha256:
            return PointFinding.NOT_REPEATED
        return PointFinding.CONFIRMED if cheap is TrialVerdict.FAILED else PointFinding.FULL_ONLY

    @property
    def failing(self) -> Run | None:
        """The run that is reported, where it is a failure."""
        return self.full if self.finding in FAILURES else None


class Workers(Protocol):
    """Who carries trials out: `Processes`, `DaskWorkers`."""

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        """Run all; call `on_done` with the place of each and what came of it, in any order.

        With `anew` each from its very beginning, even where several share it.
        """

    def close(self) -> None:
        """End what was begun."""


@dataclass(slots=True)
class CampaignProgress:
    """Where a campaign stands."""

    rows: list[PointRow] = field(default_factory=list)
    runs: int = 0
    #: Of these, how many were cheap ones: points that have an answer.
    answered: int = 0
    #: Of all runs, how many were in the journal.
    resumed: int = 0
    #: Lines of the journal that do not count, by number, and why.
    left_out: Mapping[int, str] = field(default_factory=dict)
    virtual_ns: Nanos = 0
    cpu_s: float = 0.0
    blocks: set[int] = field(default_factory=set)
    states: set[str] = field(default_factory=set)
    #: As of `Outcome.ways` and `transitions`.
    ways: set[int] = field(default_factory=set)
    transitions: set[str] = field(default_factory=set)
    #: Of what has to be reached the numbers of the points that did, by what it is called.
    reached: dict[str, list[int]] = field(default_factory=dict)

    def left_out_words(self) -> list[str]:
        """Return which lines of the journal do not count, a text for each reason."""
        numbers: dict[str, list[int]] = {}
        for number, why in self.left_out.items():
            numbers.setdefault(why, []).append(number)
        return [f"line{'s' if len(lines) > 1 else ''} {ranges_text(lines)}: {why}" for why, lines in numbers.items()]

    @property
    def failures(self) -> list[PointRow]:
        """The points that failed."""
        return [row for row in self.rows if row.finding in FAILURES]


class Conduct:
    """One campaign, from its beginning or from where its journal ends.

    Args:
        campaign: What to do.
        folder: Where the journal is.
        workers: Who does it.
        clock: Wall clock, nanoseconds.
        on_run: Called after each run.

    Raises:
        MissingDependencyError: The search's library is not installed.
        FileError: The journal cannot be read or written.
    """

    def __init__(
        self,
        campaign: Campaign,
        folder: Path,
        workers: Workers,
        *,
        clock: Callable[[], Nanos],
        on_run: Callable[[CampaignProgress], None] = lambda _: None,
    ) -> None:
        self.campaign, self._workers, self._clock, self._on_run = campaign, workers, clock, on_run
        self.space = Space(campaign)
        spans = [dimension.span for dimension in self.space.dimensions]
        self._search = SEARCHES[campaign.search](Problem(
            counts=tuple(span.count for span in spans), is_ordered=tuple(not span.choices for span in spans),
            runs=campaign.budget.runs, batch=campaign.batch, seed=campaign.seed,
            corpus=tuple(map(self.space.point, campaign.corpus)),
        ))  # fmt: skip
        self._journal = Journal(folder)
        self.progress = CampaignProgress(left_out=self._journal.left_out)
        self.progress.reached = {reach.said: [] for reach in campaign.reaches}
        self._confirmed = 0
        #: Places of rows that passed, those of the least margin of each batch.
        self._near: list[int] = []

    def run(self) -> CampaignProgress:
        """Do all of it; arguments and errors as of `within_minutes`."""
        for _ in self.within_minutes():
            pass
        return self.progress

    def within_minutes(self) -> Iterator[Sequence[PointRow]]:
        """Do one batch after the other, as long as the budget's minutes last; yield the rows of each.

        After them come the near misses, again in batches: rows that were there before, now with their run in full.

        Raises:
            KeyboardInterrupt: A worker's `look` has; what was done is in the journal.
            FileError: The disk is full.
        """
        began, minutes = self._clock(), self.campaign.budget.minutes
        for batches in (self.batches(), self.near_misses()):
            for rows in batches:
                yield rows
                if minutes is not None and self._clock() - began >= minutes * 60 * NS_PER_S:
                    break

    def batches(self) -> Iterator[Sequence[PointRow]]:
        """Do one batch after the other, whatever time it takes; yield the rows of each."""
        budget, done = self.campaign.budget, self.progress
        while len(done.rows) < budget.runs and not self._is_spent():
            points = self._search.ask(min(self.campaign.batch, budget.runs - len(done.rows)))
            if not points:
                return
            rows = self._rows(points)
            self._search.tell([self._answer(row) for row in rows])
            done.rows += rows
            yield rows

    def near_misses(self) -> Iterator[Sequence[PointRow]]:
        """Run in full what came nearest to a failure, as far as confirmations are left; yield the rows, by batches."""
        done, left = self.progress, max(self.campaign.budget.confirmations - self._confirmed, 0)
        nearest = sorted(self._near, key=lambda at: (done.rows[at].cheap.margin or 0.0, at))[:left]
        for first in range(0, len(nearest), self.campaign.batch):
            if first and self._is_spent():
                return
            chosen = sorted(nearest[first : first + self.campaign.batch])
            rows = self._in_full([done.rows[at] for at in chosen])
            for at, row in zip(chosen, rows, strict=True):
                done.rows[at] = row
            yield rows

    def close(self) -> None:
        """Close the journal."""
        self._journal.close()

    def _is_spent(self) -> bool:
        hours = self.campaign.budget.virtual_hours
        return hours is not None and self.progress.virtual_ns >= hours * NS_PER_HOUR

    def _rows(self, points: Sequence[tuple[float, ...]]) -> list[PointRow]:
        proposals = [self.space.proposal(point) for point in points]
        first = len(self.progress.rows) + 1
        cheap = self._do(RunPurpose.CHEAP, [one.trial(self.campaign.trial, self.campaign.cheap) for one in proposals])
        rows = [
            PointRow(
                number,
                proposal,
                run,
                new=self._learn(number, run.outcome),
                is_drawn=self._search.is_drawn(proposal.point),
            )
            for number, (proposal, run) in enumerate(zip(proposals, cheap, strict=True), first)
        ]
        left = max(self.campaign.budget.confirmations - self._confirmed, 0)
        failed = [at for at, row in enumerate(rows) if row.cheap.outcome.verdict is TrialVerdict.FAILED][:left]
        self._confirmed += len(failed)
        for at, row in zip(failed, self._in_full([rows[at] for at in failed]), strict=True):
            rows[at] = row
        passed = [row for row in rows if row.cheap.outcome.verdict is TrialVerdict.PASSED]
        nearest = sorted(passed, key=lambda row: (row.cheap.margin or 0.0, row.number))[: self.campaign.near_misses]
        self._near += [row.number - 1 for row in nearest]
        return rows

    def _in_full(self, rows: Sequence[PointRow]) -> list[PointRow]:
        """Return rows with their run in full, and where that failed the one that proves it."""
        full = self._do(RunPurpose.FULL, [row.proposal.trial(self.campaign.trial, self.campaign.full) for row in rows])
        found = [replace(row, full=run) for row, run in zip(rows, full, strict=True)]
        failed = [at for at, run in enumerate(full) if run.outcome.verdict is TrialVerdict.FAILED]
        again = self._do(RunPurpose.REPLAY, [full[at].trial for at in failed])
        for at, run in zip(failed, again, strict=True):
            found[at] = replace(found[at], replay=run)
        return found

    def _do(self, stage: RunPurpose, trials: Sequence[Trial]) -> list[Run]:
        """Return the runs of trials, in their order; those in the journal are not done again."""
        keys = [f"{stage.value}:{trial.sha256}" for trial in trials]
        places = {key: place for place, key in enumerate(keys) if self._journal.get(key) is None}
        missing = list(places.values())
        self.progress.resumed += len(set(keys)) - len(missing)

        def on_done(number: int, done: Done) -> None:
            self._journal.add(keys[missing[number]], *done)
            self._count(stage, *done)

        for key in set(keys) - places.keys():
            self._count(stage, *self._kept(key))
        self._workers.run([trials[place] for place in missing], on_done, anew=stage is RunPurpose.REPLAY)
        return [Run(stage, trial, *self._kept(key)) for trial, key in zip(trials, keys, strict=True)]

    def _kept(self, key: str) -> Done:
        found = self._journal.get(key)
        if found is None:
            raise RuntimeError(f"the workers have left out {key}")
        return found

    def _count(self, stage: RunPurpose, outcome: Outcome, cpu_s: float) -> None:
        self.progress.runs += 1
        self.progress.answered += stage is RunPurpose.CHEAP
        self.progress.virtual_ns += outcome.virtual_ns
        self.progress.cpu_s += cpu_s
        self._on_run(self.progress)

    def _learn(self, number: int, outcome: Outcome) -> int:
        """Add what a point's run has reached; return how much of it is new."""
        done = self.progress
        new = sum(
            len(found - held) for found, held in (
                (outcome.blocks, done.blocks), (outcome.ways, done.ways), (outcome.lines, done.states),
                (outcome.transitions, done.transitions),
            )
        )  # fmt: skip
        done.blocks |= outcome.blocks
        done.ways |= outcome.ways
        done.states |= outcome.lines
        done.transitions |= outcome.transitions
        for reach in self.campaign.reaches:
            if reach.is_in(outcome):
                done.reached[reach.said].append(number)
        return new

    def _answer(self, row: PointRow) -> PointResult:
        outcome, found = row.cheap.outcome, row.cheap.margin
        x0, y0, x1, y1 = self.space.extent
        x_m, y_m = (at / 1000 for at in (outcome.way_mm or ((0, 0),))[-1])
        ended = min(max((x_m - x0) / (x1 - x0), 0.0), 1.0), min(max((y_m - y0) / (y1 - y0), 0.0), 1.0)
        ways = {("way", way) for way in outcome.ways}
        reached = frozenset[object](outcome.blocks | outcome.lines | outcome.transitions | ways)
        return PointResult(
            margin=NO_VERDICT if found is None else found, ended=ended, reached=reached,
            acting=self.space.acting(row.proposal), is_excused=bool(outcome.excused_goals),
        )  # fmt: skip
