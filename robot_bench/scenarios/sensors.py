"""The goal of `sensors.toml`: that program prints `sensor N on` and `sensor N off` for what stands before sonar N.

A kind of goal as any package may offer one: its entry point stands under `robot_bench.goals`.
"""

import re
from typing import cast

from robot_bench.events.kinds import Event, Text, WorldChange
from robot_bench.scenario.goals.text import Printed
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, seconds
from simbase.timing import Nanos

_SENSOR = re.compile(r"^sensor (\d+) (on|off)$")


class SensorNamed(Printed):
    """What is printed between two things placed before a sonar names the first one's sonar, and no other."""

    STATE = ("_placed", "_said")
    kinds = (Text, WorldChange)

    def __init__(self) -> None:
        super().__init__()
        self._placed: list[tuple[Nanos, int]] = []
        self._said: list[tuple[Nanos, str]] = []

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, WorldChange) and event.op == "place" and "sonar" in event.fields:
            self._placed.append((event.t, int(cast("int", event.fields["sonar"]))))
        elif isinstance(event, Text):
            line = self.read(event)
            if line is not None and event.data.endswith(b"\n") and _SENSOR.match(line):
                self._said.append((event.t, line))
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        says = self._failure(end)
        return GoalOutcome(met=not says, says=says)

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


GOAL = GoalKind(
    keys=(), wanted=lambda _: "names the sensor before which something stands, and no other",
    watch=lambda _: SensorNamed(), needs_world=True, is_scripted=True,
)  # fmt: skip
