"""Timed changes of the world: things placed, moved and removed while a run goes on.

Positions are those of the world, or relative to the robot ("before sonar 3, at
0.45 m"): these are worked out at their moment. A thing that is held before a
sonar is placed there anew every 50 ms, so that it stays while the robot moves,
and is taken away at the end.

Invariant: a change at t is seen by everything that happens after t, and by
nothing that happened up to t.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from p2os.parameters import RobotParameters
from p2os.pioneer.body import RobotBody
from p2os.pioneer.scenery import Obstacle
from p2os.timing import NS_PER_MS, Nanos
from testbench.timeline import Timeline

#: chosen: the robot moves 10 mm at most in between.
FOLLOW_NS: Nanos = 50 * NS_PER_MS


class Op(Enum):
    """What is done to a thing."""

    PLACE = "place"
    MOVE = "move"
    REMOVE = "remove"


@dataclass(frozen=True, slots=True, kw_only=True)
class BeforeSonar:
    """A place in front of a sonar, counted from 1 at the left."""

    number: int
    distance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One change of the world at a given time."""

    at: Nanos
    op: Op
    name: str
    #: What to place, and only then; its position is that of the change.
    obstacle: Obstacle | None = None
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    before: BeforeSonar | None = None


#: Told of each change: (operation, name, ns, what the trace shall say).
ChangeListener = Callable[[str, str, Nanos, Mapping[str, object]], None]


class Script(Timeline[Change]):
    """Applies changes at their times.

    Args:
        changes: In any order.
        body: Where they are applied.
        parameters: Where the sonar sit.
        bring_to: Brings the body to an instant.
        on_change: Told of each change.
    """

    def __init__(
        self,
        changes: Sequence[Change],
        body: RobotBody,
        parameters: RobotParameters,
        *,
        bring_to: Callable[[Nanos], None],
        on_change: ChangeListener | None = None,
    ) -> None:
        super().__init__(changes, self._apply)
        self._body = body
        self._parameters = parameters
        self._bring_to = bring_to
        self._on_change = on_change

    def _apply(self, change: Change) -> None:
        self._bring_to(change.at)
        x_m, y_m, heading_rad = change.x_m, change.y_m, change.heading_rad
        if change.before is not None:
            x_m, y_m, heading_rad = self._place_before(change.before)
        fields: dict[str, object] = {}
        if change.op is Op.REMOVE:
            self._body.remove(change.name)
        elif change.op is Op.MOVE:
            self._body.move(change.name, x_m, y_m, heading_rad)
            fields = {"x": _rounded(x_m), "y": _rounded(y_m), "heading": _rounded(heading_rad)}
        elif change.obstacle is not None:
            obstacle = replace(change.obstacle, x_m=x_m, y_m=y_m, heading_rad=heading_rad)
            self._body.place(obstacle)
            fields = {key: _rounded(value) for key, value in obstacle.to_plain().items() if key != "name"}
        if change.before is not None and change.op is Op.PLACE:
            fields["sonar"] = change.before.number
        if self._on_change is not None:
            self._on_change(change.op.value, change.name, change.at, fields)

    def _place_before(self, before: BeforeSonar) -> tuple[float, float, float]:
        state = self._body.state
        sonar = self._parameters.sonar[before.number - 1]
        direction = state.heading_rad + math.radians(sonar.heading_deg)
        cosine, sine = math.cos(state.heading_rad), math.sin(state.heading_rad)
        x_m = state.x_m + (cosine * sonar.x_mm - sine * sonar.y_mm) / 1000 + before.distance_m * math.cos(direction)
        y_m = state.y_m + (sine * sonar.x_mm + cosine * sonar.y_mm) / 1000 + before.distance_m * math.sin(direction)
        return x_m, y_m, direction


def _rounded(value: object) -> object:
    """Return a length or an angle to a micrometre or microradian, anything else as it is."""
    return round(value, 6) if isinstance(value, float) else value
