"""One mutant on the scenarios that run the changed instruction: who notices it.

A run ends with the first goal that is missed. A program that loops forever costs no more than the rest of the run: its
time is virtual. What costs far more than the unchanged program (a pin that toggles without end) is stopped, and counts
as noticed: so would a test be that does not come to its end.

Invariant: what comes of a mutant depends on the program, the change and the scenarios alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import cast

from bluepill_sim.program.mutants import Mutant
from p2os.transport.wall_clock import Clock
from robot_bench.bench import run_of
from robot_bench.campaign.variants.mutation.base_run import BaseRun
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Event, Verdict
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how often a run looks whether it may end.
_LOOK_NS: Nanos = 500 * NS_PER_MS
#: chosen: no mutant that still behaves costs so many times what the unchanged program costs, and so much more.
MOST_TIMES, MOST_MORE_NS = 20, 10 * NS_PER_S


@dataclass(frozen=True, slots=True)
class MostCost:
    """What a mutant may cost: so many times what the program costs in that time, and so much more."""

    times: int = MOST_TIMES
    more_ns: int = MOST_MORE_NS

    def of(self, base: BaseRun, ran_ns: Nanos) -> int:
        """Return it of so much virtual time; no less than for the time of the program's own run."""
        return round(self.times * base.cost_ns * max(ran_ns / base.ran_ns, 1)) + self.more_ns


class Fate(StrEnum):
    """What became of a mutant."""

    #: A goal was missed.
    MISSED = "missed"
    #: The program ended in a fault.
    CRASHED = "crashed"
    #: It was stopped: it cost too much.
    STOPPED = "stopped"
    #: A run went otherwise than that of the unchanged program, and no goal was missed.
    SURVIVED = "survived"
    #: Every run left the same trace, byte for byte: no goal can notice it on these runs.
    SAME = "same"


#: What counts as noticed.
NOTICED = frozenset({Fate.MISSED, Fate.CRASHED, Fate.STOPPED})


@dataclass(frozen=True, slots=True)
class MutantResult:
    """What became of a mutant, and what told."""

    fate: Fate
    #: The scenario that noticed it; empty where none did.
    scenario: str = ""
    #: In words: the goal that was missed, or how the program ended.
    says: str = ""
    #: When that was seen.
    at_ns: Nanos = 0

    @property
    def is_noticed(self) -> bool:
        """Whether a scenario told it from the unchanged program."""
        return self.fate in NOTICED

    def to_plain(self) -> Json:
        """Return it as JSON has it."""
        return {"fate": str(self.fate), "scenario": self.scenario, "says": self.says, "at_s": self.at_ns / NS_PER_S}

    @classmethod
    def from_plain(cls, found: Json) -> "MutantResult":
        """Return what `to_plain` had."""
        at_ns = round(cast("float", found["at_s"]) * NS_PER_S)
        return cls(Fate(str(found["fate"])), str(found["scenario"]), str(found["says"]), at_ns)


def try_mutant(
    mutant: Mutant, bases: Sequence[BaseRun], clock: Clock, look: Callable[[], None], most: MostCost = MostCost()
) -> MutantResult:  # fmt: skip
    """Run a mutant on each scenario that executes it, until one notices it.

    Each bench is left where its run ended, with the changed program: to be called in a process of its own.

    Args:
        mutant: The change.
        bases: The runs of the unchanged program.
        clock: As of `base_run`.
        look: Called often; may raise to end it.
        most: What it may cost.
    """
    fates = []
    for base in bases:
        if mutant.address in base.first_ns:
            found = _run(mutant, base, clock, look, most)
            if found.is_noticed:
                return found
            fates.append(found)
    different = [found for found in fates if found.fate is Fate.SURVIVED]
    return different[0] if different else MutantResult(Fate.SAME)


def _run(
    mutant: Mutant, base: BaseRun, clock: Clock, look: Callable[[], None], most: MostCost
) -> MutantResult:  # fmt: skip
    bench, board, name = base.bench, base.board, base.bench.scenario.name
    bench.restore(base.states[base.first_ns[mutant.address]])
    memory = board.chip.memory
    memory.reprogrammed = mutant.patched(memory.flash.raw)
    missed: list[Verdict] = []

    def take(event: Event) -> None:
        if isinstance(event, Verdict) and not event.met:
            missed.append(event)

    bench.events.subscribe(take, Verdict)
    began, since = clock(), bench.now

    def after_slice(now: Nanos) -> None:
        look()
        if clock() - began > most.of(base, now - since):
            raise _TooCostlyError(f"it costs more than {most.times} times the unchanged one, at {now / NS_PER_S:g} s")

    bench.on_slice = after_slice
    try:
        while bench.now < bench.end and not missed and not board.has_died:
            bench.run_until(bench.now + _LOOK_NS)
    except P2osError as error:
        return MutantResult(Fate.STOPPED, name, str(error), bench.now)
    if board.has_died:
        return MutantResult(Fate.CRASHED, name, board.verdict, bench.now)
    if missed:
        return MutantResult(Fate.MISSED, name, f"{missed[0].goal}: {missed[0].says}", missed[0].t)
    return _judged(base)


def _judged(base: BaseRun) -> MutantResult:
    """Return what became of a mutant whose run came to its end."""
    bench, name = base.bench, base.bench.scenario.name
    end = bench.finish()
    for one in run_of(bench).goals.at_end(run_of(bench).ended(end)):
        if not one.is_open and not one.outcome.met:
            return MutantResult(Fate.MISSED, name, f"{one.goal.wanted}: {one.outcome.says}", end)
    return MutantResult(Fate.SAME if bench.trace.sha256 == base.trace_sha256 else Fate.SURVIVED, name)


class _TooCostlyError(P2osError):
    """A run is stopped for what it costs."""
