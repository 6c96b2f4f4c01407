"""Which source line makes trials fail, without a version that passes: by changing the program back.

Theory of operation. Each instruction that ran before the failure is changed, one at a time, as `mutation` does. A
change that undoes the fault makes the failing trial pass. So does one that leads the robot round what showed it, so
what remains is put to every other trial: all that failed have to pass, and none that passed may fail. Only where all
such changes are of one source line is that line named; as soon as there are two, nothing is. The first failing trial
costs least: it runs once, and a change begins at the state before it first ran, up to the goal that is missed again.

Invariant: what is not shown by runs is said to be unknown, and never named as a line.
"""

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import cast

from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import Mutant, mutants, mutated_file
from p2os.toml_schema import Table
from p2os.transport.wall_clock import Clock
from robot_bench.campaign.conduct import PointRow, Workers
from robot_bench.campaign.trial import Trial, TrialVerdict, unpacked
from robot_bench.campaign.variants.fault_line import FaultLine, image_of
from robot_bench.campaign.variants.mutation.base_run import BaseRun, base_run
from robot_bench.campaign.variants.mutation.trial import Fate, MostCost, try_mutant
from robot_bench.running.forks import in_fork
from simbase.errors import UsageError
from simbase.timing import NS_PER_S

#: chosen: of each kind so many trials judge a change.
MOST_FAILING = MOST_PASSING = 8
#: chosen: fewer trials show nothing of a change, nor do fewer that failed: one is led round by many a change.
LEAST, LEAST_FAILING = 8, 3
#: chosen: what costs more than so many times what the program costs in that time, and so much more, only waits.
MOST_TIMES, MOST_MORE_NS = 3, NS_PER_S // 2


class FailingRun:
    """The failing trial that is soonest over, run once: tells of a change whether it makes it pass.

    Args:
        trial: It fails.
        clock: What a run's cost is measured by.
        look: Called often; may raise to end it.
    """

    def __init__(self, trial: Trial, clock: Clock, look: Callable[[], None]) -> None:
        self._clock, self._look = clock, look
        with unpacked(trial.files) as folder:
            self._base: BaseRun = base_run(_ends_when_missed(trial).scenario(folder), clock, look, is_sound=False)

    @property
    def ran(self) -> Sequence[int]:
        """The instructions that ran."""
        return sorted(self._base.first_ns)

    def __call__(self, change: Mutant) -> bool:
        """Tell whether it passes with a change; in a fork, since the bench is left changed."""
        return in_fork(partial(self._passes, change)) is True

    def _passes(self, change: Mutant) -> bool:
        cost = MostCost(MOST_TIMES, MOST_MORE_NS)
        return try_mutant(change, [self._base], self._clock, self._look, cost).fate is Fate.SURVIVED


@dataclass(slots=True)
class ChangedBack:
    """Looks for the single changes of a program that make all failing trials pass, and no passing one fail.

    Args:
        failing: Trials; the first one is what `first` runs.
        passing: Others, that pass.
        ran: The instructions that the first one runs.
        first: Tells of a change whether it makes the first one pass.
        passes: Tells whether a trial passes; it runs it.
    """

    failing: Sequence[Trial]
    passing: Sequence[Trial]
    ran: Sequence[int]
    first: Callable[[Mutant], bool]
    passes: Callable[[Trial], bool]
    #: Every change, those that were found so far, and how many were tried.
    changes: Sequence[Mutant] = ()
    found: list[Mutant] = field(default_factory=list)
    tried: int = 0

    def __post_init__(self) -> None:
        """Find the changes: of what the first trial runs, in an order in which neighbours are far apart."""
        changes = mutants(image_of(self.failing[0]), self.ran)
        self.changes = random.Random(0).sample(changes, len(changes))

    @property
    def count(self) -> int:
        """How many changes there are."""
        return len(self.changes)

    def look(self) -> Iterator[int]:
        """Try one change after the other; yield how many were tried, so that the caller may end it.

        It ends where trials are too few, and where what was found is of more than one line.
        """
        if self._too_few():
            return
        image, content = image_of(self.failing[0]), self.failing[0].files[self.failing[0].firmware_name]
        for one in self.changes:
            if self.first(one) and self._mends(mutated_file(content, one, image)):
                self.found.append(one)
            self.tried += 1
            yield self.tried
            if len(self._lines()) > 1:
                return

    def _mends(self, changed: bytes) -> bool:
        return all(self.passes(trial.with_firmware(changed)) for trial in (*self.failing[1:], *self.passing))

    def _lines(self) -> set[str]:
        table = read_lines(image_of(self.failing[0]))
        return {table.place(one.address) for one in self.found}

    def _too_few(self) -> str:
        failing, passing = len(self.failing), len(self.passing)
        if failing >= LEAST_FAILING and failing + passing >= LEAST:
            return ""
        fail = "1 point fails" if failing == 1 else f"{failing} points fail"
        few = f"{fail} and {passing} pass, too few to judge a change by"
        return f"{few}: {LEAST_FAILING} that fail, {LEAST} in all are needed, so run more points"

    @property
    def result(self) -> FaultLine:
        """What is known."""
        if too_few := self._too_few():
            return FaultLine(line="", says=too_few)
        table = read_lines(image_of(self.failing[0]))
        also = tuple(
            f"{table.place(one.address) or hex(one.address)}: {one.alteration.before} -> {one.alteration.after}"
            for one in self.found
        )
        lines = self._lines()
        tried = f"{self.tried} of {self.count} changes of an instruction were tried"
        if len(lines) > 1 or "" in lines:
            return FaultLine(line="", says=f"{tried}, and those of more than one line make it pass", also=also)
        if self.tried < self.count:
            return FaultLine(line="", says=f"{tried}, and the time was over", also=also)
        if not lines:
            return FaultLine(line="", says=f"{tried}, and none makes it pass: a fault of omission, or of more than one")
        counts = f"{len(self.failing)} failing points pass and none of {len(self.passing)} passing ones fails"
        return FaultLine(line=lines.pop(), says=f"{tried}; only there a change makes that {counts}", also=also)


def passes(trial: Trial, workers: Workers) -> bool:
    """Tell whether a trial passes, run by workers: what never ends is ended by their limits."""
    found: list[TrialVerdict] = []
    workers.run([_ends_when_missed(trial)], lambda _, done: found.append(done[0].verdict))
    return found == [TrialVerdict.PASSED]


def failing_and_passing(rows: Sequence[PointRow]) -> tuple[list[Trial], list[Trial]]:
    """Return the failing trials of a campaign and the passing ones, of each those that are soonest over.

    Raises:
        UsageError: Nothing fails.
    """
    different = {row.cheap.outcome.sha256: row.cheap for row in reversed(rows)}.values()
    by_time = sorted(different, key=lambda run: (run.outcome.virtual_ns, run.trial.sha256))
    failing = [run.trial for run in by_time if run.outcome.verdict is TrialVerdict.FAILED]
    if not failing:
        raise UsageError("nothing fails in this campaign", hint="explain a run that fails")
    passing = [
        run.trial for run in by_time
        if run.outcome.verdict is TrialVerdict.PASSED and not run.outcome.excused_goals
    ]  # fmt: skip
    return failing[:MOST_FAILING], passing[:MOST_PASSING]


def _ends_when_missed(trial: Trial) -> Trial:
    """Return a trial that ends with the first goal that is missed; those that do not judge it are left out."""
    goals = cast("Sequence[Table]", trial.table.get("goal", ()))
    judging = [
        goal for goal in goals if not trial.disturbed_by & set(cast("Sequence[str]", goal.get("excused_by", ())))
    ]
    return replace(trial.with_lists(goal=[{**goal, "ends_run": "missed"} for goal in judging]))
