"""Goals on what the firmware prints: that it is there, that it is not, and in which order."""

from typing import ClassVar

from robot_bench.events.kinds import Event, Text
from robot_bench.events.selection import Lines
from robot_bench.scenario.goals.watch import GoalOutcome, Watch
from simbase.timing import Nanos


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
        return "nothing was printed" if self._line is None else f"the last line is {self._line!r}"


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
