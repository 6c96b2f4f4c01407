"""The speed that the robot is to have now, and when it is said.

P2OS acknowledges nothing, so the present speed is sent on change and again at
least every `refresh_ns`. Changes that come faster than `speed_spacing_ns` wait,
and what they overtake is never sent.

Invariant: nothing is sent until a speed was first set, nor after `release`.
"""

import math
from dataclasses import dataclass

from p2os.commands import Command, rvel, vel
from p2os.timing import Nanos


@dataclass(frozen=True, slots=True)
class Speeds:
    """What VEL and RVEL carry: whole mm/s forward and deg/s counter-clockwise."""

    forward_mm_s: int = 0
    turn_deg_s: int = 0

    @classmethod
    def of(cls, forward_mps: float, turn_radps: float) -> "Speeds":
        """Round SI units to what the wire can carry."""
        return cls(round(forward_mps * 1000), round(math.degrees(turn_radps)))

    @property
    def forward_mps(self) -> float:
        """Metres a second."""
        return self.forward_mm_s / 1000

    @property
    def turn_radps(self) -> float:
        """Radians a second."""
        return math.radians(self.turn_deg_s)

    @property
    def are_zero(self) -> bool:
        """Whether the robot is to stand."""
        return self == STILL


STILL = Speeds()


class SpeedKeeper:
    """The newest speeds, and when to say them."""

    def __init__(self, *, spacing_ns: Nanos, refresh_ns: Nanos) -> None:
        self._spacing_ns = spacing_ns
        self._refresh_ns = refresh_ns
        self.wanted = STILL
        self.is_held = False
        self._said: Speeds | None = None
        self._said_at: Nanos = 0

    def hold(self, speeds: Speeds) -> None:
        """Keep the robot at these speeds from now on."""
        self.wanted = speeds
        self.is_held = True

    def release(self) -> None:
        """Say nothing more: something else moves the robot, or nothing does."""
        self.wanted = STILL
        self.is_held = False
        self._said = None

    def next_deadline(self) -> Nanos | None:
        """Return when the speeds are to be said, or None while none are held; 0 for at once."""
        if not self.is_held:
            return None
        if self._said is None:
            return self._said_at + self._spacing_ns if self._said_at else 0
        return self._said_at + (self._spacing_ns if self.wanted != self._said else self._refresh_ns)

    def take(self, now: Nanos) -> tuple[Command, Command]:
        """Return the two commands to send at `now`."""
        self._said, self._said_at = self.wanted, now
        return vel(self.wanted.forward_mm_s), rvel(self.wanted.turn_deg_s)
