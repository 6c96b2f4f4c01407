"""A hobby servo: the width of its pulses is the angle that it turns to.

Modelled: pulses by the times of their edges, the range, how fast it turns, that it holds still where no pulses come.
*Chosen*: a pulse that is more than half of its range outside is none, and without one for 100 ms it is not driven.
Not modelled: dead band, load, overshoot, current.
Source: SG90 data sheet: 1 ms is -90 degrees, 2 ms is 90, 0.1 s for 60 degrees at 4.8 V.
Invariant: between two pulses the angle is a straight line towards the target, then constant, in whole microdegrees.

"""

from collections.abc import Sequence
from typing import ClassVar

from bluepill_sim.parts.attached import Change, Socket, Use
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

_UDEG_PER_DEG = 1_000_000
_NS_PER_US = 1000
#: chosen: so long after the last pulse it is driven no more.
HOLD_NS: Nanos = 100 * NS_PER_MS


class Servo(Stateful):
    """A servo on one pin, `signal`."""

    PINS: ClassVar = {"signal": Use.HEARD}
    STATE = ("pulses", "ignored", "_udeg", "_since_ns", "_target_udeg", "_rise_ns")
    DERIVED = ("_socket",)

    def __init__(
        self, *, least_us: int = 1000, most_us: int = 2000, least_deg: float = -90.0, most_deg: float = 90.0,
        deg_per_s: float = 600.0,
    ) -> None:  # fmt: skip
        """Make one that stands in the middle.

        Args:
            least_us: The shortest pulse of its range.
            most_us: The longest one.
            least_deg: The angle at the shortest; it may be the greater one.
            most_deg: The angle at the longest.
            deg_per_s: How fast it turns.

        Raises:
            ValueError: It cannot turn.
        """
        if not 0 < least_us < most_us or least_deg == most_deg or not deg_per_s > 0:
            raise ValueError(f"no servo: {least_us} to {most_us} us, {least_deg} to {most_deg} degrees, {deg_per_s}/s")
        self._us = (least_us, most_us)
        self._ends_udeg = (round(least_deg * _UDEG_PER_DEG), round(most_deg * _UDEG_PER_DEG))
        self._udeg_per_s = round(deg_per_s * _UDEG_PER_DEG)
        #: Pulses that it took, and those that were none.
        self.pulses = self.ignored = 0
        #: Where it stood at a time, and where it turns to.
        self._udeg = self._target_udeg = sum(self._ends_udeg) // 2
        self._since_ns: Nanos = 0
        self._rise_ns: Nanos | None = None
        self._socket: Socket | None = None

    def plug(self, socket: Socket) -> None:
        """Take the pin."""
        socket.pin("signal")
        self._socket = socket

    def changed(self, rows: Sequence[Change]) -> None:
        """Take the ends of pulses."""
        for ns, _pin, level in rows:
            if level:
                self._rise_ns = ns
            elif self._rise_ns is not None:
                self._take(ns - self._rise_ns, ns)
                self._rise_ns = None

    @property
    def target_deg(self) -> float:
        """The angle that the last pulse asked for."""
        return self._target_udeg / _UDEG_PER_DEG

    @property
    def angle_deg(self) -> float:
        """Where it stands now."""
        return self.angle_at(self._socket.now_ns if self._socket is not None else self._since_ns)

    def angle_at(self, at_ns: Nanos) -> float:
        """Return where it stands at a time, which is not before the last pulse."""
        return self._udeg_at(at_ns) / _UDEG_PER_DEG

    def words(self) -> str:
        """Return where it stands."""
        return f"at {self.angle_deg:+.1f} deg, commanded {self.target_deg:+.1f} deg by {self.pulses} pulses"

    def _take(self, width_ns: Nanos, at_ns: Nanos) -> None:
        least_ns, most_ns = (us * _NS_PER_US for us in self._us)
        beyond_ns = (most_ns - least_ns) // 2
        if not least_ns - beyond_ns <= width_ns <= most_ns + beyond_ns:
            self.ignored += 1
            return
        first, last = self._ends_udeg
        held_ns = min(max(width_ns, least_ns), most_ns)
        target = first + (last - first) * (held_ns - least_ns) // (most_ns - least_ns)
        self._udeg, self._since_ns = self._udeg_at(at_ns), at_ns
        if self._socket is not None and abs(target - self._target_udeg) >= _UDEG_PER_DEG:
            self._socket.note(at_ns, "target", f"{target / _UDEG_PER_DEG:+.1f} deg")
        self._target_udeg = target
        self.pulses += 1

    def _udeg_at(self, at_ns: Nanos) -> int:
        if not self.pulses:
            return self._udeg
        way = self._target_udeg - self._udeg
        most = min(max(at_ns - self._since_ns, 0), HOLD_NS) * self._udeg_per_s // NS_PER_S
        return self._udeg + (min(way, most) if way > 0 else max(way, -most))
