"""What a kind of goal is made of: its keys, its sentence, and a watch that is fed events.

Invariant: what a watch has decided stands: `finish` says the same, in more words perhaps.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from p2os.toml_record import Record
from p2os.toml_schema import LONGEST_S, Key
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


From = Annotated[float | None, Key(least=0, most=LONGEST_S, doc="where its window begins")]
To = Annotated[float | None, Key(above=0, most=LONGEST_S, doc="where its window ends")]
Within = Annotated[float | None, Key(above=0, most=LONGEST_S, doc="in so many seconds")]
InTime = Annotated[float, Key(above=0, most=LONGEST_S, doc="in so many seconds")]
IfAny = Annotated[bool, Key(doc="whether a run in which it does not happen meets it")]


class NoKeys(Record):
    """Of a kind of goal without keys of its own."""


class OfEvents(Record):
    """Of a kind of goal with events or wires in words: it learns which wires they may name."""

    #: Those of a robot on own pins; None: those of the pin-out. No key of a file.
    wires: Wires | None = None

    def selected(self, words: str) -> Selector:
        """Return what picks the events that words of the goal mean.

        Raises:
            UsageError: They mean none.
        """
        return select(words, self.wires)


T = TypeVar("T", bound=Record)


class GoalKind:
    """A kind of goal: a row of the table.

    Args:
        table: Declares the keys of its table beside `kind`, see `p2os.toml_record`.
        wanted: The goal as a sentence, of its table.
        watch: Makes what watches one run, of its table; a `UsageError` refuses the table.
        doc: When it is met, a line of Markdown for schema and page.
        any_of: Keys of which its table has one at least; without them any run would meet the goal, or none.
        needs_world: A robot at a port cannot tell; there the goal is not judged.
        is_scripted: It is on what a program does in an order of its own, which from another start, or with other things
            in the way, it need not meet.
        holds_anywhere: It is on what a program makes of its inputs, so a sound one meets it in any world and from any
            start.
    """

    def __init__(
        self, table: type[T], wanted: Callable[[T], str], watch: Callable[[T], Watch], *, doc: str = "",
        any_of: tuple[str, ...] = (), needs_world: bool = False, is_scripted: bool = False,
        holds_anywhere: bool = False,
    ) -> None:  # fmt: skip
        self.table: type[Record] = table
        self.wanted: Callable[[Any], str] = wanted
        self.watch: Callable[[Any], Watch] = watch
        self.doc, self.any_of, self.needs_world, self.is_scripted = doc, any_of, needs_world, is_scripted
        self.holds_anywhere = holds_anywhere


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


def given_in_words(*parts: tuple[str, float | None, str]) -> list[str]:
    """Return words, number and unit of those that are given."""
    return [f"{words}{number:g}{unit}" for words, number, unit in parts if number is not None]


def window_in_words(
    after: str | None = None, *, from_s: float | None = None, to_s: float | None = None, within_s: float | None = None
) -> str:
    """Return the window of a goal as the end of its sentence."""
    times = given_in_words((" from ", from_s, " s"), (" to ", to_s, " s"), (" within ", within_s, " s"))
    return "".join([*([] if after is None else [f" after {after!r}"]), *times])
