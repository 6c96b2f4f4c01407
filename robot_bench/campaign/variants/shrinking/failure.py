"""How a trial fails: which goal, in what way, and when. Two failures of one way are one failure for who mends it.

A run is looked at only as far as its failure: what comes after the missed goal is not run.

Invariant: a failure depends on the trial alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

from robot_bench.bench import Bench
from robot_bench.campaign.trial import Trial, bench_of, blocks_of, unpacked
from robot_bench.events.kinds import Contact, Event, Pose, Verdict, WorldChange
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, Nanos

#: chosen: how often a run looks whether it may end.
_LOOK_NS: Nanos = 500 * NS_PER_MS
#: chosen: what stands in the way for so short a time no program answers.
SUDDEN_NS: Nanos = 200 * NS_PER_MS
#: chosen: a robot that has come so far has moved, micrometres.
_MOVED_UM = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class FailureMode:
    """What two failures have in common that are the same to a person."""

    #: The goal as a sentence; of a program that died the kind of fault.
    what: str
    #: Of several robots, whose.
    robot: str = ""
    #: The part of the hull that touched something first, where it is about touching; empty else.
    part: str = ""
    #: The program ended in a fault.
    is_fault: bool = False
    #: The robot could do nothing: it had not moved yet, or something had come `SUDDEN_NS` before at most.
    is_sudden: bool = False

    def __str__(self) -> str:
        whose = f"{self.robot}: " if self.robot else ""
        return f"{whose}{'' if self.is_fault else 'not met: '}{self.what}{f' ({self.part})' if self.part else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A run that failed."""

    way: FailureMode
    #: When that was decided, and whether before the run's end.
    at_ns: Nanos
    is_early: bool
    #: In words, with figures.
    says: str
    #: The first address of each block of the firmware that had run then.
    blocks: frozenset[int]


def failure_of(
    trial: Trial, way: FailureMode | None = None, until_ns: Nanos | None = None, look: Callable[[], None] = lambda: None
) -> Failure | None:
    """Run a trial until it fails.

    Args:
        trial: What to run.
        way: The failure that is looked for; None: the first one.
        until_ns: A failure later than this is not waited for; None waits to the run's end.
        look: Called between slices; may raise to end it.

    Returns:
        None where it passes, fails in another way only, or cannot be run.
    """
    with unpacked(trial.files) as folder:
        try:
            return _run(bench_of(trial.scenario(folder)), way, until_ns, look)
        except P2osError:
            return None


def _run(bench: Bench, way: FailureMode | None, until_ns: Nanos | None, look: Callable[[], None]) -> Failure | None:
    witnesses = [_Witness(name if len(bench.robots) > 1 else "", one) for name, one in bench.robots.items()]

    def found(end: Nanos | None) -> Failure | None:
        failures = [failure for witness in witnesses for failure in witness.failures()]
        return next(
            (
                Failure(way=one, at_ns=when, is_early=end is None or when < end, says=says, blocks=blocks_of(bench))
                for one, when, says in sorted(failures, key=lambda row: row[1])
                if way is None or one == way
            ),
            None,
        )

    while bench.now < bench.end:
        look()
        bench.run_until(bench.now + _LOOK_NS)
        failure = found(None)
        if failure is not None:
            return failure
        if until_ns is not None and bench.now >= until_ns:
            return None
    return found(bench.finish())


class _Witness:
    """Notes of one robot what it misses, what it touches, when it moved, and when something came."""

    def __init__(self, robot: str, bench: Bench) -> None:
        self._robot, self._bench = robot, bench
        self._verdicts: list[Verdict] = []
        self._contact: Contact | None = None
        self._began: Pose | None = None
        self._moved_ns: Nanos | None = None
        self._came: list[Nanos] = []
        bench.events.subscribe(self._take, Verdict, Contact, Pose, WorldChange)

    def _take(self, event: Event) -> None:
        if isinstance(event, Contact):
            self._contact = self._contact or event
        elif isinstance(event, Verdict):
            self._verdicts += [] if event.met else [event]
        elif isinstance(event, WorldChange):
            self._came += [] if event.op == "remove" else [event.t]
        elif isinstance(event, Pose) and self._moved_ns is None:
            first = self._began = self._began or event
            if abs(event.x - first.x) + abs(event.y - first.y) > _MOVED_UM or event.heading != first.heading:
                self._moved_ns = event.t

    def failures(self) -> list[tuple[FailureMode, Nanos, str]]:
        """Return what was missed so far, each with its time and in words."""
        found = [self._missed(verdict) for verdict in self._verdicts]
        return [*found, *([self._died()] if self._bench.chip.has_died else [])]

    def _missed(self, verdict: Verdict) -> tuple[FailureMode, Nanos, str]:
        contact = self._contact
        part = contact.part.partition(" ")[0] if contact is not None and contact.t == verdict.t else ""
        is_sudden = self._is_sudden(verdict.t)
        return (
            FailureMode(what=verdict.goal, robot=self._robot, part=part, is_sudden=is_sudden),
            verdict.t,
            verdict.says,
        )

    def _is_sudden(self, at: Nanos) -> bool:
        is_at_rest = self._moved_ns is None or self._moved_ns >= at
        return is_at_rest or any(0 <= at - change <= SUDDEN_NS for change in self._came)

    def _died(self) -> tuple[FailureMode, Nanos, str]:
        died_ns, verdict = self._bench.chip.died_ns, self._bench.chip.verdict
        at = self._bench.now if died_ns is None else died_ns
        return FailureMode(what=verdict.partition(" at ")[0], robot=self._robot, is_fault=True), at, verdict
