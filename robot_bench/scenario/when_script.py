"""Something is done when something happens: the `[[when]]` tables of a scenario, and what carries them out.

    [[when]]                                  [[when]]
    event = "usart1 sends ready"              event = "robot near 2.0 1.0 0.3"
    do = "place"                              do = "inject"
    name = "crate"                            fault = "sonar-dead 3"
    before_sonar = 4                          for_s = 2.0
    distance_m = 0.8                          every = true
    (and the other keys of [[obstacle]])

With `after = "ID"` an event counts from when the table with `id = "ID"` has had its own.

It is done `after_s` after the event, to the nanosecond. Events are told each 50 ms, at a pose: what is due before
its event is told is done then, up to 50 ms late.

Invariant: when it is done depends on the events of the run alone, not on the slices of the loop.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import cast

from p2os.errors import ScenarioError
from p2os.robots.parameters import RobotParameters
from p2os.toml_schema import LONGEST_S, Key, Table, Where, check_table, placed, within
from robot_bench.events.kinds import Event
from robot_bench.events.selection import Wires, select
from robot_bench.events.stream import EventStream
from robot_bench.scenario import world_script
from robot_bench.scenario.fault_script import LINK_DOWN, FaultChange, load_faults
from robot_bench.scenario.hand_script import DEEDS, Deed, load_deeds
from robot_bench.scenario.world_script import ScriptedChange, load_changes
from simbase.errors import nearest, shown
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

_WORLD, _FAULTS = ("place", "move", "remove"), ("inject", "clear")
_SPAN = Key(name="for_s", kind="number", above=0, most=LONGEST_S)
#: What is a fault in other words → the keys of its table, and the words.
_AS_FAULTS: Mapping[str, tuple[tuple[Key, ...], Callable[[Table], str]]] = {
    "press": ((Key(name="button", kind="text", required=True), _SPAN), lambda table: str(table["button"])),
    "drop_link": ((_SPAN,), lambda _: LINK_DOWN),
    "sag_battery": (
        (Key(name="volts", kind="number", required=True, least=0, most=25.5), _SPAN),
        lambda table: f"low-battery {table['volts']}",
    ),
}
_BUTTONS = ("stop-button", "bumper")
_OWN = (
    Key(name="event", kind="text", required=True),
    Key(name="do", kind="text", required=True, choices=(*_WORLD, *_FAULTS, *_AS_FAULTS, *DEEDS, "end")),
    Key(name="id", kind="text"),
    Key(name="after", kind="text"),
    Key(name="after_s", kind="number", least=0, most=LONGEST_S),
    Key(name="every", kind="flag"),
)
_FAULT = (Key(name="fault", kind="text", required=True), _SPAN)
_THING = tuple(key for key in world_script.KEYS if key.name not in {"at_s", "op"})
#: All that may stand in a table.
KEYS = tuple(
    {
        key.name: replace(key, required=key.required and key in _OWN)
        for keys in (_THING, *(row[0] for row in _AS_FAULTS.values()), *DEEDS.values(), _FAULT, _OWN)
        for key in keys
    }.values()
)


@dataclass(frozen=True, slots=True, kw_only=True)
class When:
    """What is done at an event; times of changes and faults are counted from it."""

    event: str
    do: str
    after_ns: Nanos = 0
    #: At each such event, not at the first one only.
    every: bool = False
    changes: tuple[ScriptedChange, ...] = ()
    faults: tuple[FaultChange, ...] = ()
    deeds: tuple[Deed, ...] = ()
    name: str = ""
    #: The name of another one whose event has to have happened; empty for none.
    after: str = ""
    #: Names that events may have wires by; None: those of the pin-out.
    wires: Wires | None = None


def load_whens(
    tables: Sequence[Table], parameters: RobotParameters, where: Where, wires: Wires | None = None
) -> tuple[When, ...]:
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


def _load(table: Table, parameters: RobotParameters, place: Where, wires: Wires | None) -> When:
    own = {key.name for key in _OWN}
    mine, rest = ({key: value for key, value in table.items() if (key in own) is is_own} for is_own in (True, False))
    check_table(mine, _OWN, place)
    do = str(mine["do"])
    as_fault, _ = _AS_FAULTS.get(do, ((), None))
    check_table(rest, _THING if do in _WORLD else _FAULT if do in _FAULTS else as_fault or DEEDS.get(do, ()), place)
    with placed(place):
        select(str(mine["event"]), wires)
    changes: tuple[ScriptedChange, ...] = ()
    faults: tuple[FaultChange, ...] = ()
    if do in _WORLD:
        changes = load_changes([{"at_s": 0, "op": do, **rest}], parameters, f"{place}", are_later=True)
    elif do == "inject":
        faults = load_faults([{"at_s": 0, **rest}], parameters, f"{place}")
    elif do in _AS_FAULTS:
        words = _AS_FAULTS[do][1](rest)
        if do == "press" and words.split()[:1] not in [[button] for button in _BUTTONS]:
            raise ScenarioError(
                f"{place}: there is no button {shown(words)}", hint='"stop-button", or "bumper front 1"'
            )
        span = {"for_s": rest["for_s"]} if "for_s" in rest else {}
        faults = load_faults([{"at_s": 0, "fault": words, **span}], parameters, f"{place}")
    elif do == "clear":
        faults = (FaultChange(0, f"clear {rest['fault']}"),)
    after_ns = round(float(cast("float", mine.get("after_s", 0))) * NS_PER_S)
    return When(
        event=str(mine["event"]), do=do, after_ns=after_ns, every=bool(mine.get("every", False)),
        changes=changes, faults=faults, deeds=load_deeds(do, rest, place, wires) if do in DEEDS else (),
        name=str(mine.get("id", "")), after=str(mine.get("after", "")), wires=wires,
    )  # fmt: skip


class WhenScript(Stateful):
    """Does what is asked for when its event has happened.

    Args:
        whens: What is asked for.
        on_change: Takes changes of the world, with their times.
        on_fault: Takes faults, with their times.
        on_deed: Takes what a hand does, with its times.
        on_end: Ends the run at a time.
    """

    STATE = ("_selectors", "_done", "_first", "_happened")

    def __init__(
        self,
        whens: Sequence[When],
        *,
        on_change: Callable[[Sequence[ScriptedChange]], None],
        on_fault: Callable[[Sequence[FaultChange]], None],
        on_deed: Callable[[Sequence[Deed]], None],
        on_end: Callable[[Nanos], None],
    ) -> None:
        self._whens = tuple(whens)
        self._selectors = [select(when.event, when.wires) for when in self._whens]
        #: Which one has to have had its event, by place; None where none has.
        self._before = [
            next((n for n, other in enumerate(self._whens) if when.after and other.name == when.after), None)
            for when in self._whens
        ]
        self._done = [False] * len(self._whens)
        #: When each had its first event; -1: not yet.
        self._first: list[Nanos] = [-1] * len(self._whens)
        #: Places whose event has happened in the batch that is handed on, and when.
        self._happened: list[tuple[int, Nanos]] = []
        self._on_change, self._on_fault, self._on_deed, self._on_end = on_change, on_fault, on_deed, on_end

    def subscribe(self, stream: EventStream) -> None:
        """Have the events of a run looked at."""
        for place, selector in enumerate(self._selectors):
            stream.subscribe(self._watcher(place), *selector.kinds, wires=selector.wires)
        if self._whens:
            stream.at_limit(self._act)

    def _watcher(self, place: int) -> Callable[[Event], None]:
        def watch(event: Event) -> None:
            is_meant, before = self._selectors[place].takes(event), self._before[place]
            if before is not None and not 0 <= self._first[before] < event.t:
                return
            if is_meant and (self._whens[place].every or not self._done[place]):
                if not self._done[place]:
                    self._done[place], self._first[place] = True, event.t
                self._happened.append((place, event.t))

        return watch

    def _act(self, limit: Nanos) -> None:
        """Do what is due after all events up to `limit`: at its time, but not before the instant after `limit`."""
        happened, self._happened = self._happened, []
        for place, since in happened:
            when = self._whens[place]
            at = max(limit + 1, since + when.after_ns)
            if when.changes:
                self._on_change([replace(change, at=at + change.at) for change in when.changes])
            if when.faults:
                self._on_fault([FaultChange(at + fault.at, fault.words) for fault in when.faults])
            if when.deeds:
                self._on_deed([replace(deed, at=at + deed.at) for deed in when.deeds])
            if when.do == "end":
                self._on_end(at)
