"""Makes a failing trial as small as it can be while it still fails in the same way.

    1  of the goals only the one that is missed
    2  the fewest things: obstacles, events, faults, robots, by delta debugging
    3  round numbers: all at once where that goes, then each, the roundest first
    4  once more the fewest things, until nothing changes
    5  the shortest run, in whole seconds

Each question is one trial; none is asked twice. When the budget is spent, the smallest trial so far is what comes out.

Invariant: what is returned fails in the same way as what was given; the same trial gives the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from p2os.toml_record import number_of, tables_of
from robot_bench.campaign.trial import Trial
from robot_bench.campaign.variants.shrinking.failure import Failure, FailureMode, failure_of
from robot_bench.campaign.variants.shrinking.reduction import ANGLE_STEPS, STEPS, fewest, rounded, rounder
from robot_bench.campaign.variants.shrinking.things import (
    ListedThing,
    Number,
    numbers,
    things,
    with_numbers,
    with_things,
    with_world,
)
from robot_bench.scenario.included_files import Setting
from simbase.errors import P2osError
from simbase.timing import NS_PER_S, Nanos

#: chosen: so many trials a failure is worth; some minutes.
BUDGET = 400
#: What finds out how a trial fails: as `failure_of`, without what it looks at meanwhile.
Judge = Callable[[Trial, FailureMode | None, Nanos | None], Failure | None]
#: chosen: a smaller trial may fail this much later, no more: else each that does not fail would be run to its end.
_LATER = 1.25


class NoFailureError(P2osError):
    """There is nothing to shrink: the trial does not fail."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shrunk:
    """A failing trial made small."""

    trial: Trial
    failure: Failure
    #: How many things the trial had, and has.
    things_before: int
    things_after: int
    #: How many trials were run.
    trials: int
    #: The budget sufficed: nothing can be left out any more.
    is_complete: bool


class _SpentError(Exception):
    """The budget is spent."""


class _Shrinker:
    """Asks whether ever smaller trials still fail, and remembers the smallest that did."""

    def __init__(self, trial: Trial, failure: Failure, judge: Judge, budget: int) -> None:
        self.trial, self.failure = trial, failure
        self._judge, self._budget = judge, budget
        self._asked: dict[str, Failure | None] = {}

    @property
    def trials(self) -> int:
        return len(self._asked)

    def takes(self, candidate: Trial) -> bool:
        """Tell whether a candidate fails in the same way; it is the smallest then."""
        key = candidate.sha256
        if key == self.trial.sha256:
            return True
        if key not in self._asked:
            if self.trials >= self._budget:
                raise _SpentError
            self._asked[key] = self._judge(candidate, self.failure.way, self._until_ns)
        found = self._asked[key]
        if found is None:
            return False
        self.trial, self.failure = candidate, found
        return True

    @property
    def _until_ns(self) -> Nanos | None:
        """How long a failure is waited for."""
        return round(self.failure.at_ns * _LATER) if self.failure.is_early else None

    def run(self) -> bool:
        """Shrink; tell whether the budget sufficed."""
        try:
            self._goals()
            size = -1
            while size != (size := self._fewest_things()):
                self._round_numbers()
            self._shortest()
        except _SpentError:
            return False
        return True

    def _goals(self) -> None:
        """Keep the goal that is missed alone, in each list that has it."""
        way = self.failure.way
        if way.is_fault:
            self.takes(self.trial.with_lists(goal=[]))
            return
        for number in range(len(tables_of(self.trial.table, "goal"))):
            if self.takes(self.trial.with_lists(goal=[tables_of(self.trial.table, "goal")[number]])):
                return

    def _fewest_things(self) -> int:
        whole = self.trial

        def still_fails(kept: Sequence[ListedThing]) -> bool:
            return self.takes(with_things(whole, kept))

        return len(fewest(things(whole), still_fails))

    def _round_numbers(self) -> None:
        for level in range(len(STEPS)):
            whole = {number: _steps(number) for number in numbers(self.trial)}
            coarse = {number: rounded(number.value, steps[level], steps) for number, steps in whole.items()}
            if self.takes(with_numbers(self.trial, coarse)):
                break
        for number in numbers(self.trial):
            for value in rounder(number.value, _steps(number)):
                if self.takes(with_numbers(self.trial, {number: value})):
                    break

    def _shortest(self) -> None:
        """Let the run end with the second in which it fails, where the goal is missed before its end."""
        if not self.failure.is_early:
            return
        for more_s in (0, 1, 2):
            wanted_s = float(-(-self.failure.at_ns // NS_PER_S) + more_s)
            if 0 < wanted_s < number_of(self.trial.table, "duration_s") and self.takes(
                self.trial.set(("duration_s", wanted_s))
            ):
                return


def shrink(
    trial: Trial, *, way: FailureMode | None = None, quick: Sequence[Setting] = (), budget: int = BUDGET,
    judge: Judge = failure_of,
) -> Shrunk:  # fmt: skip
    """Return the smallest trial that is found which fails in the same way.

    Args:
        trial: One that fails.
        way: Which of its failures; None: the first.
        quick: What makes a trial cheap (`("body", "kinematic")`). Where it fails in the same way so, that is shrunk,
            and the small trial has to fail as it was meant to run, too; else all is done at that cost.
        budget: Most trials, without the first one.
        judge: Finds out how a trial fails, by a run of it.

    Raises:
        NoFailureError: The trial does not fail, or not in that way.
    """
    failure = judge(trial, way, None)
    if failure is None:
        raise NoFailureError(f"{trial.name} does not fail{f': {way}' if way else ''}", hint="p2os run shows it")
    way, spent = failure.way, 0
    if quick and (cheap := judge(trial.set(*quick), way, None)) is not None:
        small = _shrunk(trial.set(*quick), cheap, judge, budget)
        spent = small.trials + 2
        meant = _as_meant(small.trial, trial, quick)
        confirmed = judge(meant, way, None)
        if confirmed is not None:
            return replace(small, trial=meant, failure=confirmed, trials=spent)
    small = _shrunk(trial, failure, judge, max(0, budget - spent))
    return replace(small, trials=small.trials + spent)


def _shrunk(trial: Trial, failure: Failure, judge: Judge, budget: int) -> Shrunk:
    own = with_world(trial)
    state = _Shrinker(trial, failure, judge, budget)
    try:
        is_own = state.takes(own)
    except _SpentError:
        is_own = False
    is_complete = state.run() and is_own  # a world that cannot be written down stays as it is
    return Shrunk(
        trial=state.trial, failure=state.failure, things_before=len(things(own)), things_after=len(things(state.trial)),
        trials=state.trials, is_complete=is_complete,
    )  # fmt: skip


def _as_meant(small: Trial, trial: Trial, quick: Sequence[Setting]) -> Trial:
    """Return a small trial with the values of the original where `quick` has others."""
    keys = dict.fromkeys(key for key, _ in quick)
    table = {key: value for key, value in small.table.items() if key not in keys}
    return replace(small, table=table | {key: trial.table[key] for key in keys if key in trial.table})


def _steps(number: Number) -> Sequence[float]:
    return ANGLE_STEPS if number.is_angle else STEPS
