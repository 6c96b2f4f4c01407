"""When a VEL+RVEL pair goes out.

On a change at once, unless the last pair is nearer than `pair_spacing_ns`: then
the newest speeds wait for that border, and what they overtake is never sent.
Unchanged speeds go out again `refresh_ns` after the last pair, for P2OS
acknowledges nothing and a lost frame must not last.
"""

from typing import TypeAlias

from adapter_sim.mixing import STILL, Speeds
from p2os.timing import Nanos

#: Forward and turn wanted, forward and turn sent, time of the last pair or None.
PacerSnapshot: TypeAlias = tuple[int, int, int, int, Nanos | None]


class Pacer:
    """The newest speeds, and when to send them."""

    def __init__(self, *, spacing_ns: Nanos, refresh_ns: Nanos) -> None:
        self._spacing_ns = spacing_ns
        self._refresh_ns = refresh_ns
        self.wanted = STILL
        self.sent = STILL
        self._sent_at: Nanos | None = None

    def begin(self, speeds: Speeds) -> None:
        """Start with a first pair that is due at once."""
        self.wanted = speeds
        self.sent = STILL
        self._sent_at = None

    def due_at(self, now: Nanos) -> Nanos:
        """Return when the next pair is due; `now` for at once."""
        if self._sent_at is None:
            return now
        if self.wanted != self.sent:
            return max(now, self._sent_at + self._spacing_ns)
        return self._sent_at + self._refresh_ns

    def take(self, now: Nanos) -> Speeds:
        """Return the speeds to send at `now`, as sent."""
        self.sent = self.wanted
        self._sent_at = now
        return self.sent

    def snapshot(self) -> PacerSnapshot:
        """Return all of it as plain values."""
        return (
            self.wanted.forward_mm_s, self.wanted.turn_deg_s,
            self.sent.forward_mm_s, self.sent.turn_deg_s, self._sent_at,
        )  # fmt: skip

    def restore(self, snapshot: PacerSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.wanted = Speeds(snapshot[0], snapshot[1])
        self.sent = Speeds(snapshot[2], snapshot[3])
        self._sent_at = snapshot[4]
