"""Core cycles and nanoseconds, one from the other; the engine counts the former, nothing here keeps time.

Invariant: both are integers, and nothing is accumulated.
"""

from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos


class CycleClock(Stateful):
    """Cycles of the core and nanoseconds of the world, one from the other.

    They are tied together at one point (base_ns, base_cycle), which moves only when
    the frequency changes; `cycle_at(ns)` is the first cycle whose `ns_of` is at or after `ns`.
    """

    STATE = ("frequency_hz", "_base_ns", "_base_cycle")

    def __init__(self, frequency_hz: int) -> None:
        self.frequency_hz = frequency_hz
        self._base_ns = 0
        self._base_cycle = 0

    @property
    def base(self) -> tuple[int, Nanos, int]:
        """The frequency in Hz, and the time in ns and the cycle from which it counts."""
        return self.frequency_hz, self._base_ns, self._base_cycle

    def ns_of(self, cycle: int) -> Nanos:
        """Return when a cycle begins, rounded down."""
        return self._base_ns + (cycle - self._base_cycle) * NS_PER_S // self.frequency_hz

    def cycle_at(self, at_ns: Nanos) -> int:
        """Return the first cycle that begins at or after a time."""
        return self._base_cycle - (self._base_ns - at_ns) * self.frequency_hz // NS_PER_S

    def set_frequency(self, frequency_hz: int, cycle: int) -> None:
        """Go on at another frequency from `cycle` on."""
        self._base_ns = self.ns_of(cycle)
        self._base_cycle = cycle
        self.frequency_hz = frequency_hz
