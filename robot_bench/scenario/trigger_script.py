"""Something is done when something happens: the `[[when]]` tables of a scenario, and what carries them out.

    [[when]]                                  [[when]]
    event = "usart1 sends ready"              event = "robot near 2.0 1.0 0.3"
    do = "place"                              do = "inject"
    name = "crate"                            fault = "sonar-dead 3"
    before_sonar = 4                          for_s = 2.0
    distance_m = 0.8                          every = true
    (and the other keys of [[obstacle]])

With `after = "ID"` an event counts from when the table with `id = "ID"` has had its own.

It is done `after_s` after the event, to the nanosecond. Events are reported each 50 ms, at a pose: what is due before
its event is reported is done then, up to 50 ms late.

Invariant: when it is done depends on the events of the run alone, not on the slices of the loop.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from p2os.errors import ScenarioError
from p2os.robots.parameters import RobotParameters
from p2os.toml_record import Record, read_part
from p2os.toml_schema import LONGEST_S, Key, Table, Where, placed, within
from robot_bench.events.kinds import Event
from robot_bench.events.selection import Wires, select
from robot_bench.events.stream import EventStream
from robot_bench.scenario.hands.doing import ACTION_TABLES, Doing, doing_of
from simbase.errors import nearest, shown
from simbase.state import Stateful
from simbase.timing import Nanos, nanos


class WhenTable(Record):
    """`[[when]]`: what is done when something happens."""

    event: Annotated[str, Key(doc="in the words of goals")]
    do: Annotated[str, Key(choices=tuple(ACTION_TABLES), doc="what is done")]
    id: Annotated[str, Key(doc="what `after` of another table calls it")] = ""
    after: Annotated[str, Key(doc="the event counts from when the table with that `id` has had its own")] = ""
    after_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="how long after the event it is done")] = 0.0
    every: Annotated[bool, Key(doc="at each such event, not at the first one only")] = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """What is done at an event; its times are counted from that."""

    event: str
    do: str
    after_ns: Nanos = 0
    #: At each such event, not at the first one only.
    every: bool = False
    doing: Doing = field(default_factory=Doing)
    name: str = ""
    #: The name of another one whose event has to have happened; empty for none.
    after: str = ""
    #: Names that events may have wires by; None: those of the pin-out.
    wires: Wires | None = None


def load_triggers(
    tables: Sequence[Table], parameters: RobotParameters, where: Where, wires: Wires | None = None
) -> tuple[Trigger, ...]:
    """Return what a scenario's `[[when]]` tables ask for; `wires` are those of a robot on own pins.

    Raises:
        ScenarioError: A table breaks the schema, its event or its fault is none, or it waits for one that is not there.
    """
    found = tuple(_load(table, parameters, within(where, "when", n), wires) for n, table in enumerate(tables))
    names_of = [when.name for when in found]
    names = list(filter(None, names_of))
    for number, when in enumerate(found):
        place = within(where, "when", number)
        if when.name and names.count(when.name) > 1:
            raise ScenarioError(f"{place}: there are two with the id {shown(when.name)}")
        if when.after and when.after not in names:
            raise ScenarioError(f"{place}: after: there is none with the id {shown(when.after)}",
                                hint=nearest(when.after, names) if names else 'id = "..." names one')  # fmt: skip
        before, seen = when.after, {when.name} - {""}
        while before and before not in seen:
            seen.add(before)
            before = found[names_of.index(before)].after
        if before:
            raise ScenarioError(f"{place}: after: {shown(when.after)} waits for this one in turn: neither happens")
    return found


def _load(table: Table, parameters: RobotParameters, place: Where, wires: Wires | None) -> Trigger:
    row, rest = read_part(WhenTable, table, place)
    with placed(place):
        select(row.event, wires)
    return Trigger(
        event=row.event, do=row.do, after_ns=nanos(row.after_s), every=row.every,
        doing=doing_of(row.do, rest, parameters, place, wires), name=row.id, after=row.after, wires=wires,
    )  # fmt: skip


class TriggerScript(Stateful):
    """Does what is asked for when its event has happened.

    Args:
        triggers: What is asked for.
        on_doing: Takes what is done, with its times.
        on_end: Ends the run at a time.
    """

    STATE = ("_selectors", "_done", "_first", "_happened")

    def __init__(
        self,
        triggers: Sequence[Trigger],
        *,
        on_doing: Callable[[Doing], None],
        on_end: Callable[[Nanos], None],
    ) -> None:
        self._triggers = tuple(triggers)
        self._selectors = [select(when.event, when.wires) for when in self._triggers]
        #: Which one has to have had its event, by place; None where none has.
        self._before = [
            next((n for n, other in enumerate(self._triggers) if when.after and other.name == when.after), None)
            for when in self._triggers
        ]
        self._done = [False] * len(self._triggers)
        #: When each had its first event; -1: not yet.
        self._first: list[Nanos] = [-1] * len(self._triggers)
        #: Places whose event has happened in the batch that is handed on, and when.
        self._happened: list[tuple[int, Nanos]] = []
        self._on_doing, self._on_end = on_doing, on_end

    def subscribe(self, stream: EventStream) -> None:
        """Have the events of a run looked at."""
        for place, selector in enumerate(self._selectors):
            stream.subscribe(self._watcher(place), *selector.kinds, wires=selector.wires)
        if self._triggers:
            stream.at_limit(self._act)

    def _watcher(self, place: int) -> Callable[[Event], None]:
        def watch(event: Event) -> None:
            is_meant, before = self._selectors[place].takes(event), self._before[place]
            if before is not None and not 0 <= self._first[before] < event.t:
                return
            if is_meant and (self._triggers[place].every or not self._done[place]):
                if not self._done[place]:
                    self._done[place], self._first[place] = True, event.t
                self._happened.append((place, event.t))

        return watch

    def _act(self, limit: Nanos) -> None:
        """Do what is due after all events up to `limit`: at its time, but not before the instant after `limit`."""
        happened, self._happened = self._happened, []
        for place, since in happened:
            when = self._triggers[place]
            at = max(limit + 1, since + when.after_ns)
            self._on_doing(when.doing.begun_at(at))
            if when.do == "end":
                self._on_end(at)
