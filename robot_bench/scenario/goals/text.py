"""Goals on what the firmware prints: that it is there or is not, in which order, and that its numbers are right."""

import re
from collections.abc import Mapping
from typing import Annotated, ClassVar

from p2os.toml_record import Record
from p2os.toml_schema import Key
from robot_bench.events.kinds import Event, Pose, Text
from robot_bench.events.selection import Lines
from robot_bench.scenario.goals.temporal import SIGNALS, never, refuse_other_than_texts
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, OfEvents, Watch, given_in_words, seconds
from simbase.errors import UsageError, shown
from simbase.timing import Nanos, nanos

#: What sums of decimals are off by.
TINY = 1e-9
#: Signals that a program may print, of the pose.
PRINTED = tuple(name for name, (kind, _, _) in SIGNALS.items() if kind is Pose and name != "apart_m")


class Printed(Watch):
    """Watches what the firmware prints; keeps the last line, for what a failure says."""

    STATE: ClassVar[tuple[str, ...]] = ("_lines", "_line")
    kinds: tuple[type, ...] = (Text,)

    def __init__(self) -> None:
        self._lines = Lines()
        self._line: str | None = None

    def read(self, text: Text) -> str | None:
        """Return the line so far; None for another port's text."""
        line = self._lines.take(text)
        self._line = self._line if line is None else line
        return line

    @property
    def last(self) -> str:
        """The last line in words."""
        return "nothing was printed" if self._line is None else f"the last line is {shown(self._line)}"


class InOrder(Printed):
    """Texts follow each other in what is printed, anything in between."""

    STATE = ("_place", "_tail")

    def __init__(self, texts: list[str], missing: str) -> None:
        super().__init__()
        self._texts = texts
        self._missing = missing
        self._place = 0
        self._tail = b""

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Text) or self.read(event) is None:
            return None
        self._tail += event.data
        while self._place < len(self._texts):
            wanted = self._texts[self._place].encode()
            at = self._tail.find(wanted)
            if at < 0:
                # The beginning of a text may stand at the end of what has come.
                self._tail = self._tail[max(0, len(self._tail) - len(wanted) + 1) :]
                return None
            self._tail = self._tail[at + len(wanted) :]
            self._place += 1
        self._tail = b""
        return GoalOutcome(met=True)

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._place == len(self._texts):
            return GoalOutcome(met=True)
        return GoalOutcome(met=False, says=f"{self._texts[self._place]!r} {self._missing}; {self.last}")


class PrintsTable(Record):
    """A text."""

    text: Annotated[str, Key(doc="what the firmware prints")]


class PrintsInOrderTable(Record):
    """Texts one after the other."""

    texts: Annotated[tuple[str, ...], Key(kind="list", doc="in this order")]

    def __post_init__(self) -> None:
        refuse_other_than_texts("texts", self.texts)


class PrintsNumbersTable(Record):
    """Numbers in what is printed, and what they have to be: within bounds, or those of a signal."""

    matches: Annotated[str, Key(doc="a regular expression of a line, with one group: the number")]
    times: Annotated[float, Key(least=-1e6, most=1e6, doc="the number so many times is the value")] = 1.0
    least: Annotated[float | None, Key(least=-1e9, most=1e9, doc="of the value")] = None
    most: Annotated[float | None, Key(least=-1e9, most=1e9, doc="of the value")] = None
    signal: Annotated[str | None, Key(choices=PRINTED, doc="which the value is of")] = None
    tolerance: Annotated[float, Key(least=0, most=1e6, doc="off the signal at most")] = 0.0
    over_s: Annotated[float, Key(above=0, most=3600, doc="of the signal what it was in so long before counts")] = 0.5

    def __post_init__(self) -> None:
        try:
            groups = re.compile(self.matches).groups
        except re.error as error:
            raise UsageError(f"matches = {self.matches!r}: {error}") from error
        if groups != 1:
            raise UsageError(f"matches = {self.matches!r} has not one group", hint=r"matches = 'left (-?\d+)'")


class PrintsNumbers(Printed):
    """Each number that a line tells is within bounds, or one that a signal had just before."""

    STATE = ("_values", "_count", "_failure")
    kinds = (Text, Pose)

    def __init__(self, table: PrintsNumbersTable) -> None:
        super().__init__()
        self._table, self._find = table, re.compile(table.matches).search
        self._value = None if table.signal is None else SIGNALS[table.signal][1]
        #: When the signal had which value, as far back as it counts.
        self._values: list[tuple[Nanos, float]] = []
        self._count = 0
        self._failure = ""

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Pose):
            if self._value is not None:
                since = event.t - nanos(self._table.over_s)
                self._values = [(t, value) for t, value in self._values if t >= since] + [(event.t, self._value(event))]
            return None
        if not isinstance(event, Text) or (line := self.read(event)) is None or not event.data.endswith(b"\n"):
            return None
        if (found := self._find(line)) is None:
            return None
        self._count += 1
        if self._failure or not (why := self._wrong(float(found.group(1)) * self._table.times)):
            return None
        self._failure = f"{shown(line)} at {seconds(event.t)}: {why}"
        return self.finish(event.t)

    def _wrong(self, value: float) -> str:
        table = self._table
        if (table.least is not None and value < table.least) or (table.most is not None and value > table.most):
            return f"{value:g} is out of bounds"
        values = [one for _, one in self._values]
        if values and not min(values) - table.tolerance - TINY <= value <= max(values) + table.tolerance + TINY:
            return f"{table.signal} was {min(values):.3g} to {max(values):.3g}"
        return ""

    def finish(self, end: Nanos) -> GoalOutcome:
        if not self._count:
            return GoalOutcome(met=False, says=f"no line matched {self._table.matches!r}; {self.last}")
        return GoalOutcome(met=not self._failure, says=self._failure)


class PrintsLinesTable(Record):
    """What the lines look like that a program prints."""

    matches: Annotated[tuple[str, ...], Key(kind="list", doc="regular expressions, one of which is a whole line")]
    first: Annotated[str | None, Key(doc="one that the first line is")] = None

    def __post_init__(self) -> None:
        refuse_other_than_texts("matches", self.matches)
        for one in [*self.matches, *([] if self.first is None else [self.first])]:
            try:
                re.compile(one)
            except re.error as error:
                raise UsageError(f"{one!r} is no regular expression: {error}") from error


class PrintsLines(Printed):
    """Each line that has come to its end is one that a program prints, and the first the one that it begins with."""

    STATE = ("_has_begun", "_failure")

    def __init__(self, table: PrintsLinesTable) -> None:
        super().__init__()
        self._is_known = re.compile("|".join(f"(?:{one})" for one in table.matches)).fullmatch
        self._is_first = re.compile(".*" if table.first is None else table.first).fullmatch
        self._has_begun = False
        self._failure = ""

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Text) or (line := self.read(event)) is None or not event.data.endswith(b"\n"):
            return None
        wrong = "it prints no such line" if not self._is_known(line) else ""
        if not self._has_begun and not self._is_first(line):
            wrong = "it begins with another line"
        self._has_begun = True
        if self._failure or not wrong:
            return None
        self._failure = f"{shown(line)} at {seconds(event.t)}: {wrong}"
        return self.finish(event.t)

    def finish(self, end: Nanos) -> GoalOutcome:
        if not self._has_begun:
            return GoalOutcome(met=False, says=f"no line was printed to its end; {self.last}")
        return GoalOutcome(met=not self._failure, says=self._failure)


def _bounded(table: PrintsNumbersTable) -> str:
    bounds = given_in_words((" of at least ", table.least, ""), (" of at most ", table.most, ""))
    return "".join(bounds) + ("" if table.signal is None else f" that {table.signal} had")


KINDS: Mapping[str, GoalKind] = {
    "usart_contains": GoalKind(
        PrintsTable, lambda table: f"prints {table.text!r}",
        lambda table: InOrder([table.text], "was not printed"), doc="the firmware printed it",
        holds_anywhere=True,
    ),
    "usart_lacks": GoalKind(
        PrintsTable, lambda table: f"never prints {table.text!r}",
        lambda table: never(f"usart1 sends {table.text}", OfEvents()), doc="the firmware never printed it",
        holds_anywhere=True,
    ),
    "usart_in_order": GoalKind(
        PrintsInOrderTable, lambda table: f"prints in order {', '.join(map(repr, table.texts))}",
        lambda table: InOrder(list(table.texts), "was not printed in its turn"),
        doc="the firmware printed these, in this order", is_scripted=True,
    ),
    "prints_numbers": GoalKind(
        PrintsNumbersTable, lambda table: f"prints {table.matches!r} with numbers{_bounded(table)}", PrintsNumbers,
        doc="each line that matches has a number within bounds, or one that the signal had in the time before; one "
        "line at least does", any_of=("least", "most", "signal"), holds_anywhere=True,
    ),
    "prints_lines": GoalKind(
        PrintsLinesTable, lambda table: f"prints lines {' or '.join(map(repr, table.matches))} alone"
        + ("" if table.first is None else f", {table.first!r} first"), PrintsLines,
        doc="each line is one that matches, from its beginning to its end, and the first matches `first`; one line at "
        "least is printed", holds_anywhere=True,
    ),
}  # fmt: skip
