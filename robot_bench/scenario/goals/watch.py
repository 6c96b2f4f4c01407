"""What a kind of goal is made of: its keys, its sentence, and a watch that is fed events.

Invariant: what a watch has decided stands: `finish` says the same, in more words perhaps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from p2os.toml_schema import Key, Table
from robot_bench.events.kinds import Event
from robot_bench.events.selection import Selector, Wires, select
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalOutcome:
    """What became of a goal.

    `robustness` is by how much it was met, in `unit`, negative where it was missed; None where there is no measure.
    """

    met: bool
    says: str = ""
    robustness: float | None = None
    unit: str = ""


class Watch(Stateful):
    """Watches a run for one goal. Its `STATE` is saved with the bench."""

    #: The kinds of events that it wants to be fed, and of which wires the edges; None means of all.
    kinds: tuple[type, ...] = ()
    wires: tuple[str, ...] | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        """Take the next event in order of time; return what is decided by it, None where nothing is."""
        raise NotImplementedError

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        """Take notice that all events up to `limit` were fed; return what is decided by that."""
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        """Return what became of the goal in a run that ended at `end`.

        A run that was cut leaves open what was not decided until then: what holds so far may be missed later. So a
        watch decides as soon as nothing can change the outcome any more, at the end of its window for one.
        """
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalKind:
    """A kind of goal: a row of the table.

    Args:
        keys: What its table may have beside `kind`.
        wanted: The goal as a sentence, of its table.
        any_of: Keys of which its table has one at least; without them any run would meet the goal, or none.
        watch: Makes what watches one run, of its table; a `UsageError` refuses the table.
        needs_world: A robot at a port cannot tell; there the goal is not judged.
        is_scripted: It is on what a program does in an order of its own, which from another start, or with other things
            in the way, it need not meet.
    """

    keys: tuple[Key, ...]
    wanted: Callable[[Table], str]
    watch: Callable[[Table], Watch]
    any_of: tuple[str, ...] = ()
    needs_world: bool = False
    is_scripted: bool = False


#: Where a goal's table has the wires of a robot on own pins; no key of a file can be called so.
WIRES = "wires of the robot"


def wires_of(table: Table) -> Wires | None:
    """Return the wires that a goal's words may name; None: those of the pin-out."""
    return cast("Wires | None", table.get(WIRES))


def selected(table: Table, words: object) -> Selector:
    """Return what picks the events that words of a goal mean.

    Raises:
        UsageError: They mean none.
    """
    return select(str(words), wires_of(table))


class SelectorFeed(Stateful):
    """Watches that wait for events in words: each is fed what it wants."""

    STATE = ("_selectors",)

    def __init__(self, *selectors: Selector) -> None:
        self._selectors = selectors
        self.kinds = tuple({kind: None for item in selectors for kind in item.kinds})
        wires = [item.wires for item in selectors if item.wires is not None]
        self.wires = tuple({wire: None for some in wires for wire in some}) if wires else None

    def taken(self, event: Event) -> list[bool]:
        """Return which of them mean an event."""
        return [type(event) in item.kinds and item.takes(event) for item in self._selectors]


def seconds(at: Nanos) -> str:
    """Return a time in words."""
    return f"{at / NS_PER_S:.3f} s"


def number(table: Table, name: str, default: float = 0.0) -> float:
    """Return a number of a goal's table."""
    value = table.get(name, default)
    return float(value) if isinstance(value, (int, float)) else default


def nanos(table: Table, name: str, default: float = 0.0) -> Nanos:
    """Return a key in seconds as nanoseconds."""
    return round(number(table, name, default) * NS_PER_S)
