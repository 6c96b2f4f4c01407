"""Goals on what the firmware prints: that it is there, that it is not, in which order, and counts that are right."""

import math
import re
from typing import ClassVar, cast

from adapter_sim.pinout import load_pinout
from p2os.toml_schema import Table
from robot_bench.events.kinds import Event, Pose, Text, WorldChange
from robot_bench.events.selection import Lines
from robot_bench.scenario.goals.watch import Outcome, Watch, number, seconds
from simbase.timing import Nanos


class _Printed(Watch):
    """Keeps the last line, for what a failure says."""

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


class InOrder(_Printed):
    """Texts follow each other in what is printed, anything in between."""

    STATE = ("_place", "_tail")

    def __init__(self, texts: list[str], missing: str) -> None:
        super().__init__()
        self._texts = texts
        self._missing = missing
        self._place = 0
        self._tail = b""

    def feed(self, event: Event) -> Outcome | None:
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
        return Outcome(met=True)

    def finish(self, end: Nanos) -> Outcome:
        if self._place == len(self._texts):
            return Outcome(met=True)
        return Outcome(met=False, says=f"{self._texts[self._place]!r} {self._missing}; {self.last}")


_COUNTS = re.compile(r"left=(-?\d+) right=(-?\d+)")


class EncoderCounts(_Printed):
    """The counts that are printed equal the wheels' turns at the nearest pose."""

    STATE = ("_pending", "_pose", "_has_counts", "_wrong")
    kinds = (Text, Pose)

    def __init__(self, table: Table) -> None:
        super().__init__()
        self._allowed = int(number(table, "steps", 1))
        self._positions = 1 << len(load_pinout().value("encoder1").wires)
        #: Counts that wait for the pose after them: ns, left, right.
        self._pending: list[tuple[Nanos, int, int]] = []
        self._pose: Pose | None = None
        self._has_counts = False
        self._wrong = ""

    def feed(self, event: Event) -> Outcome | None:
        if isinstance(event, Pose):
            return self._compare(event)
        line = self.read(event) if isinstance(event, Text) else None
        if line is not None and isinstance(event, Text) and event.data.endswith(b"\n") and (m := _COUNTS.search(line)):
            self._has_counts = True
            self._pending.append((event.t, int(m[1]), int(m[2])))
        return None

    def finish(self, end: Nanos) -> Outcome:
        if self._pose is not None:
            self._compare(self._pose)
        if not self._has_counts or self._pose is None:
            return Outcome(met=False, says=f"no counts were printed; {self.last}")
        return Outcome(met=not self._wrong, says=self._wrong)

    def _compare(self, pose: Pose) -> Outcome | None:
        before, self._pose = self._pose, pose
        pending, self._pending = self._pending, []
        for at, *counts in pending:
            near = before if before is not None and at - before.t <= pose.t - at else pose
            for side, printed, angle in zip(
                ("left", "right"), counts, (near.left_angle, near.right_angle), strict=True
            ):
                turned = math.floor(angle * 1e-6 / math.tau * self._positions)
                if abs(printed - turned) > self._allowed and not self._wrong:
                    self._wrong = (
                        f"{side} was printed as {printed} at {seconds(at)}, the wheel had turned {turned} steps"
                    )
                    return Outcome(met=False, says=self._wrong)
        return None


_SENSOR = re.compile(r"^sensor (\d+) (on|off)$")


class SensorNamed(_Printed):
    """What is printed between two things placed before a sonar names the first one's sonar, and no other."""

    STATE = ("_placed", "_said")
    kinds = (Text, WorldChange)

    def __init__(self) -> None:
        super().__init__()
        self._placed: list[tuple[Nanos, int]] = []
        self._said: list[tuple[Nanos, str]] = []

    def feed(self, event: Event) -> Outcome | None:
        if isinstance(event, WorldChange) and event.op == "place" and "sonar" in event.fields:
            self._placed.append((event.t, int(cast("int", event.fields["sonar"]))))
        elif isinstance(event, Text):
            line = self.read(event)
            if line is not None and event.data.endswith(b"\n") and _SENSOR.match(line):
                self._said.append((event.t, line))
        return None

    def finish(self, end: Nanos) -> Outcome:
        says = self._failure(end)
        return Outcome(met=not says, says=says)

    def _failure(self, end: Nanos) -> str:
        if not self._placed:
            return "nothing was placed before a sonar"
        first = self._placed[0][0]
        early = next((line for at, line in self._said if at < first), None)
        if early is not None:
            return f"{early!r} was printed before anything was placed"
        ends = [at for at, _ in self._placed[1:]] + [end + 1]
        for (begin, sonar), until in zip(self._placed, ends, strict=True):
            said = [line for at, line in self._said if begin <= at < until]
            if said != [f"sensor {sonar} on", f"sensor {sonar} off"]:
                return f"with something before sonar {sonar} from {seconds(begin)} on it printed {said}"
        return ""
