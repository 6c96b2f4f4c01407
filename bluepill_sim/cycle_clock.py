"""Cycles of the core and nanoseconds of the world, one from the other.

Both are integers, tied together at one point (base_ns, base_cycle) that moves
only when the frequency changes; nothing is accumulated.

Invariant: `cycle_at(ns)` is the first cycle whose `ns_of` is at or after `ns`.
"""

from bluepill_sim.timing import NS_PER_S, Nanos


class CycleClock:
    """The relation between cycles and nanoseconds at the present frequency."""

    def __init__(self, frequency_hz: int) -> None:
        self.frequency_hz = frequency_hz
        self._base_ns = 0
        self._base_cycle = 0

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

    def snapshot(self) -> tuple[int, int, int]:
        """Return the state as plain values."""
        return self.frequency_hz, self._base_ns, self._base_cycle

    def restore(self, snapshot: tuple[int, int, int]) -> None:
        """Put back what `snapshot` returned."""
        self.frequency_hz, self._base_ns, self._base_cycle = snapshot
