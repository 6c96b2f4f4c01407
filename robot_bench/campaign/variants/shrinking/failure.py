"""How a trial fails: which goal, in what way, and when. Two failures of one way are one failure for who mends it.

A run is looked at only as far as its failure: what comes after the missed goal is not run.

Invariant: a failure depends on the trial alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.board import BluePill
from robot_bench.bench import Bench
from robot_bench.campaign.trial import Trial, bench_of, unpacked
from robot_bench.events.kinds import Contact, Event, Verdict
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, Nanos

#: chosen: how often a run looks whether it may end.
_LOOK_NS: Nanos = 500 * NS_PER_MS


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """What two failures have in common that are the same to a person."""

    #: The goal as a sentence; of a program that died the kind of fault.
    what: str
    #: Of several robots, whose.
    robot: str = ""
    #: The part of the hull that touched something first, where it is about touching; empty else.
    part: str = ""
    #: The program ended in a fault.
    is_fault: bool = False

    def __str__(self) -> str:
        whose = f"{self.robot}: " if self.robot else ""
        return f"{whose}{'' if self.is_fault else 'not met: '}{self.what}{f' ({self.part})' if self.part else ''}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A run that failed."""

    way: Way
    #: When that was decided, and whether before the run's end.
    at_ns: Nanos
    is_early: bool
    #: In words, with figures.
    says: str
    #: The first address of each block of the firmware that had run then.
    blocks: frozenset[int]


def failure_of(
    trial: Trial, way: Way | None = None, until_ns: Nanos | None = None, look: Callable[[], None] = lambda: None
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


def _run(bench: Bench, way: Way | None, until_ns: Nanos | None, look: Callable[[], None]) -> Failure | None:
    robots = bench.robots
    verdicts: list[tuple[str, Verdict]] = []
    contacts: dict[str, Contact] = {}

    def listener(name: str) -> Callable[[Event], None]:
        def take(event: Event) -> None:
            if isinstance(event, Contact):
                contacts.setdefault(name, event)
            elif isinstance(event, Verdict) and not event.met:
                verdicts.append((name, event))

        return take

    for name, one in robots.items():
        one.events.subscribe(listener(name if len(robots) > 1 else ""), Verdict, Contact)

    def found(end: Nanos | None) -> Failure | None:
        failures = [_missed(name, verdict, contacts.get(name)) for name, verdict in verdicts]
        failures += [_died(name if len(robots) > 1 else "", one) for name, one in robots.items() if one.chip.has_died]
        return next(
            (
                Failure(way=one, at_ns=when, is_early=end is None or when < end, says=says, blocks=_blocks(bench))
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


def _blocks(bench: Bench) -> frozenset[int]:
    chips = [one.chip for one in bench.robots.values()]
    return frozenset(block for chip in chips if isinstance(chip, BluePill) for block in chip.entered_blocks)


def _missed(robot: str, verdict: Verdict, contact: Contact | None) -> tuple[Way, Nanos, str]:
    is_of_contact = contact is not None and contact.t == verdict.t
    part = contact.part.partition(" ")[0] if contact is not None and is_of_contact else ""
    return Way(what=verdict.goal, robot=robot, part=part), verdict.t, verdict.says


def _died(robot: str, bench: Bench) -> tuple[Way, Nanos, str]:
    fault = bench.chip.fault
    at = bench.now if fault is None else fault.at_ns
    return Way(what=bench.chip.verdict.partition(" at ")[0], robot=robot, is_fault=True), at, bench.chip.verdict
