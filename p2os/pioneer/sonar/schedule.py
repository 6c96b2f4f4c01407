"""Which sonar fires when, and the readings that wait for the next packet.

A Pioneer 2 fires its ring in turn and each packet carries only what is new: two
readings a cycle on a P2-DX (the SIP captured from one carries two). The real
order of firing is settable (POLLING); the default here is the ring's.

Pings stand a half and a whole cycle after the last packet, or as SONARCYCLE
sets; a bank that reports every sonar in every packet takes all readings at the
end of the cycle.

Sonar stand in arrays of eight, by their numbers; SONAR switches all of them, or one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import Nanos

#: What a Pioneer 2 reports when no echo came, in counts: 8,576 mm at 0.268 mm a count (a P2-DX's captured SIP).
NO_ECHO_COUNTS = 32_000
#: How many arrays SONAR and the flags of the packet know, and sonar in each.
ARRAYS, ARRAY_SONAR = 4, 8
#: The packet has 16 bits for a range.
LARGEST_COUNTS = 0xFFFF


@dataclass(frozen=True, slots=True)
class Ping:
    """When to fire, and which sonar (0-based)."""

    at: Nanos
    numbers: tuple[int, ...]


class SonarSchedule(Stateful):
    """The firing order of a robot's sonar."""

    STATE = ("order", "arrays", "_firing", "_next_index", "_cycle_start", "_pings_done", "_readings", "_interval_ns")

    def __init__(self, fitted: int, *, pings_per_cycle: int | None, cycle_ns: Nanos) -> None:
        """Start with every fitted sonar on, in ring order.

        Args:
            fitted: how many sonar the robot has, numbered from 0.
            pings_per_cycle: readings a packet, or None for all of them.
            cycle_ns: time between packets.
        """
        self._fitted = fitted
        self._pings_per_cycle = pings_per_cycle
        self._cycle_ns = cycle_ns
        self.order: tuple[int, ...] = tuple(range(fitted))
        #: Which arrays are on, counted from 1; of those that are fitted.
        self.arrays: frozenset[int] = self.fitted_arrays
        #: What of the order is on.
        self._firing = self.order
        self._next_index = 0
        self._cycle_start: Nanos = 0
        self._pings_done = 0
        self._readings: list[tuple[int, int]] = []
        #: SONARCYCLE; None spreads the usual pings over the cycle.
        self._interval_ns: Nanos | None = None

    def set_interval(self, interval_ns: Nanos, now: Nanos) -> None:
        """Fire one sonar each so often (SONARCYCLE), as many as the cycle has room for."""
        if self._pings_per_cycle is None:
            return
        self._interval_ns = interval_ns
        self._pings_done = 0
        self._skip_passed(now)

    def start_cycle(self, now: Nanos) -> None:
        """Begin the cycle that ends with the packet at `now` + the cycle's length."""
        self._cycle_start = now
        self._pings_done = 0

    def switch(self, *, on: bool, now: Nanos, array: int | None = None) -> None:
        """Turn all sonar, or one array, on or off (SONAR); pings of this cycle that have passed stay silent.

        Args:
            on: On or off.
            now: When.
            array: From 1; None: all.
        """
        if on and not self._firing:
            self._skip_passed(now)
        which = self.fitted_arrays if array is None else self.fitted_arrays & {array}
        self.arrays = self.arrays | which if on else self.arrays - which
        self._find_firing()

    def poll(self, numbers: Sequence[int], now: Nanos) -> None:
        """Fire these sonar in this order (POLLING); those that are not fitted do not fire, none at all is silence.

        Args:
            numbers: 0-based, repeats allowed.
            now: pings of this cycle that have passed stay silent.
        """
        if not self._firing:
            self._skip_passed(now)
        self.order = tuple(number for number in numbers if 0 <= number < self._fitted)
        self._next_index = 0
        self._find_firing()

    @property
    def fitted_arrays(self) -> frozenset[int]:
        """Return the arrays in which there are sonar."""
        return frozenset(map(_array_of, range(self._fitted)))

    @property
    def is_on(self) -> bool:
        """Tell whether any array is on."""
        return bool(self.arrays)

    def next_ping(self) -> Ping | None:
        """Return the next ping of this cycle, or None when there is none left."""
        if not self._firing or self._pings_done >= self._per_cycle:
            return None
        at = self._ping_time(self._pings_done)
        if self._pings_per_cycle is None:
            return Ping(at, self._firing)
        return Ping(at, (self._firing[self._next_index % len(self._firing)],))

    def take_ping(self, raw_ranges: Sequence[tuple[int, int]]) -> None:
        """Keep the readings of the ping that `next_ping` returned, as (number, counts)."""
        self._readings += raw_ranges
        self._pings_done += 1
        self._next_index = (self._next_index + len(raw_ranges)) % len(self._firing)

    def take_readings(self) -> tuple[tuple[int, int], ...]:
        """Return the readings since the last packet, oldest first, and forget them."""
        readings = tuple(reading for reading in self._readings if self._is_of_array_on(reading[0]))
        self._readings.clear()
        return readings

    def _find_firing(self) -> None:
        self._firing = tuple(number for number in self.order if self._is_of_array_on(number))

    def _is_of_array_on(self, number: int) -> bool:
        return _array_of(number) in self.arrays

    @property
    def _per_cycle(self) -> int:
        if self._interval_ns is not None:
            return max(self._cycle_ns // self._interval_ns, 1)
        return self._pings_per_cycle or 1

    def _ping_time(self, index: int) -> Nanos:
        if self._interval_ns is not None:
            return self._cycle_start + min((index + 1) * self._interval_ns, self._cycle_ns)
        return self._cycle_start + (index + 1) * self._cycle_ns // self._per_cycle

    def _skip_passed(self, now: Nanos) -> None:
        while self._pings_done < self._per_cycle and self._ping_time(self._pings_done) <= now:
            self._pings_done += 1


def _array_of(number: int) -> int:
    """Return the array of a sonar, from 1; what a robot has beyond the last goes with that."""
    return min(number // ARRAY_SONAR + 1, ARRAYS)


def raw_range(range_m: float, parameters: RobotParameters, profile: Profile) -> int:
    """Return a range in the packet's counts.

    Nearer than the shortest range reads as the shortest. Without an echo a P2OS
    robot reports `NO_ECHO_COUNTS` (captured), later firmware its longest range (assumed).
    """
    if range_m >= parameters.sonar_range_m:
        if profile is Profile.P2OS:
            return NO_ECHO_COUNTS
        range_m = parameters.sonar_range_m
    return min(round(max(range_m, parameters.sonar_min_range_m) * 1e6 / parameters.range_um_per_count), LARGEST_COUNTS)
