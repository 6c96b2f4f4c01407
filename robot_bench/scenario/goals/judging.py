"""Judges the goals of a run while it runs: feeds their watches, publishes verdicts, and may end the run early.

What a watch has decided is decided. The rest is judged by a run as long as the scenario plans: one that was cut
before, by a fault, a signal, a debugger or a shorter duration, leaves it open, also what held so far. Where the
scenario itself ended the run, by a verdict or a `[[when]]`, what held is met, and what was to be reached yet is open.
What is unknown of a real robot (a collision) is not judged there.

Invariant: a verdict depends on the events of the run alone; played back from its trace they give the same.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.toml_record import Record, read, read_part
from p2os.toml_schema import Key, Table, Where, placed
from robot_bench.events.kinds import Event, PinEdge, Verdict
from robot_bench.events.selection import Wires
from robot_bench.events.stream import EventStream
from robot_bench.scenario.goals.kinds import kind_named, known_kinds
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, OfEvents, Watch
from simbase.errors import nearest, shown
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos


class GoalTable(Record):
    """`[[goal]]`: what every goal may say, beside the keys of its kind."""

    kind: Annotated[str, Key(doc="which")]
    ends_run: Annotated[Literal["met", "missed", "decided"] | None, Key(doc="the verdict that ends the run")] = None
    excused_by: Annotated[tuple[str, ...], Key(
        kind="list", doc="names of what a campaign draws or disturbs by: a run with one of these it does not judge"
    )] = ()  # fmt: skip
    excused: Annotated[bool, Key(doc="whether it is such a run, as the scenario of a campaign's failure says")] = False

    def __post_init__(self) -> None:
        if not all(isinstance(one, str) for one in self.excused_by):
            raise ScenarioError("excused_by must be a list of names in quotes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """One thing that a run must show; `load_goal` makes one of a table."""

    kind: str
    #: What its table says: the record of its kind.
    table: Record
    #: Which verdict ends the run: `met`, `missed`, `decided` (either), or none.
    ends_run: str | None = None
    #: Names of what excuses from it, in a campaign.
    excused_by: frozenset[str] = frozenset()
    #: Whether it does not judge the run, for one of these.
    is_excused: bool = False

    @property
    def definition(self) -> GoalKind:
        """The row of its kind.

        Raises:
            ScenarioError: There is no such kind here.
        """
        found = kind_named(self.kind)
        if found is None:
            raise ScenarioError(f"there is no goal {shown(self.kind)}", hint=nearest(self.kind, known_kinds()))
        return found

    @property
    def wanted(self) -> str:
        """Return the goal as a sentence."""
        return self.definition.wanted(self.table)

    def watch(self) -> Watch:
        """Return what watches one run for it."""
        return self.definition.watch(self.table)


@dataclass(frozen=True, slots=True)
class Judgement:
    """What became of a run's goals, each as a sentence."""

    met: list[str]
    missed: list[str]
    #: The run was too short to judge them, or has what excuses from them.
    not_judged: list[str]


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended: when, when it was to end (0: then), and whether the scenario itself ended it."""

    at_ns: Nanos
    planned_ns: Nanos = 0
    by_scenario: bool = False

    def leaves_open(self, outcome: GoalOutcome) -> bool:
        """Tell whether a run that ended so is too short for what became of a goal that was not decided in it."""
        return self.at_ns < self.planned_ns and not (self.by_scenario and outcome.met)


@dataclass(frozen=True, slots=True)
class GoalAtEnd:
    """What became of a goal; `is_open` where the run was too short to judge it, and `outcome` says how far it got."""

    goal: Goal
    outcome: GoalOutcome
    is_open: bool


def load_goal(table: Table, where: Where, wires: Wires | None = None) -> Goal:
    """Return the goal that a TOML table asks for; `wires` are those of a robot on own pins.

    Raises:
        ScenarioError: The kind or a key is unknown, or a value is wrong.
    """
    common, rest = read_part(GoalTable, table, where)
    kind = kind_named(common.kind)
    if kind is None:
        raise ScenarioError(f"{where}: there is no goal {shown(common.kind)}", hint=nearest(common.kind, known_kinds()))
    made = read(kind.table, rest, f"{where} ({common.kind})" if isinstance(where, str) else where)
    if kind.any_of and not any(key in rest for key in kind.any_of):
        raise ScenarioError(f"{where}: a goal {common.kind} needs {' or '.join(kind.any_of)}", hint="docs/scenarios.md")
    with placed(where):
        _check(rest)
        if wires is not None and isinstance(made, OfEvents):
            made = replace(made, wires=wires)
        kind.watch(made)
    excused_by = frozenset(common.excused_by)
    return Goal(
        kind=common.kind, table=made, ends_run=common.ends_run, excused_by=excused_by, is_excused=common.excused
    )  # fmt: skip


def _check(rest: Table) -> None:
    """Check that texts and lists hold something, and that bounds and windows leave something."""
    numbers = {key: value for key, value in rest.items() if isinstance(value, (int, float))}
    for key, value in rest.items():
        if value in ("", []):
            raise ScenarioError(f"{key} is empty")
        most = f"most{key.removeprefix('least')}"
        if key.startswith("least") and numbers.get(key, -math.inf) > numbers.get(most, math.inf):
            raise ScenarioError(f"{key} is above {most}")
    if numbers.get("to_s", math.inf) < numbers.get("from_s", 0):
        raise ScenarioError("to_s lies before from_s: the goal would look at nothing")


class GoalJudge(Stateful):
    """Feeds the goals of a run; subscribes to its events.

    Args:
        goals: What the run has to show.
        can_tell_world: Whether collisions and the like are known; not of a real robot.
    """

    STATE = ("_watches", "_decided")
    DERIVED = ("_last", "_publish", "is_behind")

    def __init__(self, goals: Sequence[Goal], *, can_tell_world: bool = True) -> None:
        self.goals = tuple(goal for goal in goals if can_tell_world or not goal.definition.needs_world)
        self._watches = [goal.watch() for goal in self.goals]
        #: What is decided, in the order of the goals; None where nothing is.
        self._decided: list[GoalOutcome | None] = [None] * len(self.goals)
        self._begun = super().snapshot()
        self._publish: Callable[[Verdict], object] = _nowhere
        #: The run's end, once it is known.
        self._last: RunEnd | None = None
        #: Whether it was restored from a run with other goals, and waits for `catch_up`.
        self.is_behind = False
        #: Called when a verdict ends the run.
        self.on_end: Callable[[], None] = _nothing

    def snapshot(self) -> PartState:
        """Return the goals and what is known of them."""
        return PartState(goals=self.goals, judged=super().snapshot())

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; of a run with other goals nothing, and `catch_up` has to follow.

        Raises:
            TypeError: It is no snapshot of goals.
        """
        if not isinstance(snapshot, PartState) or set(snapshot) != {"goals", "judged"}:
            raise TypeError("not a snapshot of goals")
        self.is_behind = snapshot["goals"] != self.goals
        super().restore(self._begun if self.is_behind else snapshot["judged"])
        self._last = None

    def catch_up(self, events: Iterable[Event], until: Nanos) -> None:
        """Take what was recorded up to a time, as `subscribe` would have brought it; verdicts are not published."""
        publish, self._publish = self._publish, _nowhere
        try:
            self.feed(events)
            self.advance_to(until)
        finally:
            self._publish, self.is_behind = publish, False

    def subscribe(self, stream: EventStream) -> None:
        """Have every watch fed what it wants, and verdicts published."""
        self._publish = stream.publish
        for place, watch in enumerate(self._watches):
            if watch.kinds:
                stream.subscribe(self._feeder(place), *watch.kinds, wires=watch.wires)
        if self._watches:
            stream.at_limit(self.advance_to)

    def _feeder(self, place: int) -> Callable[[Event], None]:
        watch = self._watches[place]

        def feed(event: Event) -> None:
            outcome = watch.feed(event)
            if outcome is not None:
                self._decide(place, outcome, event.t)

        return feed

    def feed(self, events: Iterable[Event]) -> None:
        """Take events in order of time."""
        feeders: dict[type, list[tuple[tuple[str, ...] | None, Callable[[Event], None]]]] = {}
        for place, watch in enumerate(self._watches):
            for kind in watch.kinds:
                feeders.setdefault(kind, []).append((watch.wires, self._feeder(place)))
        for event in events:
            for wires, feed in feeders.get(type(event), ()):
                if wires is None or not isinstance(event, PinEdge) or event.wire in wires:
                    feed(event)

    def advance_to(self, limit: Nanos) -> None:
        """Take notice that all events up to `limit` were fed; at the run's end publish what is open."""
        for place, watch in enumerate(self._watches):
            outcome = watch.advance_to(limit)
            if outcome is not None:
                self._decide(place, outcome, limit)
        if self._last is not None and self._last.at_ns == limit:
            for found, decided in zip(self.at_end(self._last), self._decided, strict=True):
                if decided is None and not found.is_open:
                    self._publish(_verdict(found.goal, found.outcome, limit))

    def end_at(self, end: RunEnd) -> None:
        """Take notice of how the run ends."""
        self._last = end

    @property
    def has_ended_run(self) -> bool:
        """Whether a verdict has ended the run."""
        pairs = zip(self.goals, self._decided, strict=True)
        return any(one is not None and _ends_run(goal, one) for goal, one in pairs)

    @property
    def missed(self) -> Mapping[int, str]:
        """The goals that were decided to be missed, each by its place, and what was wrong."""
        pairs = enumerate(zip(self.goals, self._decided, strict=True))
        return {at: f"{goal.kind}: {one.says}" for at, (goal, one) in pairs if one is not None and not one.met}

    def finish(self, end: RunEnd) -> Judgement:
        """Return what became of the goals in a run that ended so."""
        found = Judgement([], [], [])
        for one in self.at_end(end):
            if one.is_open:
                found.not_judged.append(f"{one.goal.wanted}: not judged before {end.planned_ns / NS_PER_S:g} s")
            elif one.outcome.met:
                found.met.append(one.goal.wanted)
            elif one.goal.is_excused:
                found.not_judged.append(f"{one.goal.wanted}: excused, {one.outcome.says}")
            else:
                found.missed.append(f"{one.goal.kind}: {one.outcome.says}")
        return found

    def margins(self, end: Nanos) -> list[float | None]:
        """Return by how much each goal was met in a run that ended at `end`, negative where it was missed.

        Of a goal that was met at once and has no measure then, how far it got until the end; None where it has none.
        """
        rows = zip(self._decided, (watch.finish(end) for watch in self._watches), strict=True)
        return [
            last.robustness if decided is None or decided.robustness is None else decided.robustness
            for decided, last in rows
        ]

    def at_end(self, end: RunEnd) -> list[GoalAtEnd]:
        """Return each goal with what became of it in a run that ended so."""
        rows = zip(self.goals, (watch.finish(end.at_ns) for watch in self._watches), self._decided, strict=True)
        return [
            GoalAtEnd(goal, outcome, decided is None and end.leaves_open(outcome)) for goal, outcome, decided in rows
        ]

    def _decide(self, place: int, outcome: GoalOutcome, at: Nanos) -> None:
        if self._decided[place] is not None:
            return
        self._decided[place] = outcome
        goal = self.goals[place]
        self._publish(_verdict(goal, outcome, at))
        if _ends_run(goal, outcome):
            self.on_end()


def _nowhere(_verdict: Verdict) -> None:
    """Take a verdict that nobody has asked for."""


def _nothing() -> None:
    """Let the run go on."""


def _ends_run(goal: Goal, outcome: GoalOutcome) -> bool:
    return goal.ends_run in {"decided", "met" if outcome.met else "missed"}


def _verdict(goal: Goal, outcome: GoalOutcome, at: Nanos) -> Verdict:
    by = outcome.robustness
    return Verdict(
        t=at, goal=goal.wanted, met=outcome.met, says=outcome.says, robustness=None if by is None else round(by, 9),
        unit=outcome.unit if by is not None else "",
    )  # fmt: skip


def judge(
    events: Iterable[Event], goals: Sequence[Goal], *, end_ns: Nanos, planned_ns: Nanos = 0, can_tell_world: bool = True
) -> Judgement:
    """Judge a run by its recorded events.

    Args:
        events: Of the run, in order of time.
        goals: What it has to show.
        end_ns: When it ended.
        planned_ns: How long the scenario plans it to be; 0 judges all.
        can_tell_world: As of `GoalJudge`.
    """
    found = GoalJudge(goals, can_tell_world=can_tell_world)
    found.feed(events)
    found.advance_to(end_ns)
    return found.finish(RunEnd(end_ns, planned_ns, by_scenario=found.has_ended_run))
