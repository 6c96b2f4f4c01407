"""Which pings of other robots a sonar hears.

A sonar that fires takes the first sound for its echo, whoever has sent it. Each ping is kept with its
time; when another robot's sonar fires, the pings that are still under way to it arrive after
(sent + way / speed of sound - fired), and count as an echo from half as far as sound goes in that time. Both
sonar must stand in each other's beam, with nothing between them.

Not modelled: pings that are sent while the sonar listens already, and their echoes off walls.

Invariant: pings older than the longest way of sound are forgotten.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: At 20 °C.
SOUND_MPS = 343.0
#: chosen: as long as sound takes for 6.9 m; no sonar of a shipped model looks farther than 5 m.
KEPT_NS: Nanos = 20_000_000


class Seeing(Protocol):
    """A body whose sonar may face another's."""

    def sees(self, number: int, other: Any, its_number: int) -> float | None:
        """Return how far one of its sonar is from another's, metres; None where not each sees the other."""
        ...


#: Takes which sonar fire and when; returns the nearest echo that each takes another robot's ping for, metres, or None.
Ears = Callable[[Sequence[int], Nanos], "list[float | None]"]


@dataclass(frozen=True, slots=True)
class SentPing:
    """A ping that is perhaps still under way."""

    robot: int
    number: int
    at: Nanos


class PingTable(Stateful):
    """The pings of all robots of a world."""

    STATE = ("_sent",)
    #: Who they are is settled when a scene is made.
    DERIVED = ("_bodies",)

    def __init__(self, bodies: Sequence[Seeing]) -> None:
        self._bodies = tuple(bodies)
        self._sent: deque[SentPing] = deque()

    def enter_world(self, bodies: Sequence[Seeing]) -> None:
        """Go on with other bodies of the same robots; what was under way is gone."""
        self._bodies = tuple(bodies)
        self._sent.clear()

    def ears_of(self, robot: int) -> Ears:
        """Return what one robot, counted from 0, hears."""
        return lambda numbers, now: self._fire(robot, numbers, now)

    def _fire(self, robot: int, numbers: Sequence[int], now: Nanos) -> "list[float | None]":
        """Let some sonar of a robot fire; return what each hears of others."""
        while self._sent and self._sent[0].at < now - KEPT_NS:
            self._sent.popleft()
        others = [ping for ping in self._sent if ping.robot != robot and ping.at <= now]
        heard = [min((far for ping in others if (far := self._heard(robot, number, ping, now))), default=None)
                 for number in numbers]  # fmt: skip
        self._sent.extend(SentPing(robot, number, now) for number in numbers)
        return heard

    def _heard(self, robot: int, number: int, ping: SentPing, now: Nanos) -> float | None:
        far = self._bodies[robot].sees(number, self._bodies[ping.robot], ping.number)
        if far is None:
            return None
        arrives_s = far / SOUND_MPS - (now - ping.at) / NS_PER_S
        return arrives_s * SOUND_MPS / 2 if arrives_s > 0.0 else None
