"""Wall-clock time for the bench: pacing of real-time runs, how often a run can be stopped, the measure of every run.

The only module of the bench, beside the command line, that reads a clock or
sleeps. The models never see it: it is called between two slices of the loop.

Invariant: a pacer never changes what a run computes, only when.
"""

import time
from collections.abc import Callable

from p2os.errors import LocalProtocolError
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: control comes back so often, at least: a Ctrl-C is followed at once, and progress is smooth.
GRAIN_NS: Nanos = 20 * NS_PER_MS
#: chosen: the first slice, before anything is known of the firmware's speed, and the shortest.
FIRST_SLICE_NS: Nanos = 1 * NS_PER_MS
SHORTEST_SLICE_NS: Nanos = 10_000
LONGEST_SLICE_NS: Nanos = 1 * NS_PER_S
#: chosen: the grain of pacing, fine enough for a line of 9600 bit/s.
PACED_SLICE_NS: Nanos = 2 * NS_PER_MS


class RealTimePacer:
    """Holds virtual time back to the wall clock, and measures how far it lags behind.

    Args:
        speed: Virtual seconds a wall second, above 0.
        clock: Wall clock in nanoseconds.
        sleep: Waits so many seconds.
    """

    def __init__(
        self,
        *,
        speed: float = 1.0,
        clock: Clock = wall_clock,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if speed <= 0:
            raise LocalProtocolError(f"a pacer needs a speed above 0, got {speed}")
        self.speed = speed
        self._clock = clock
        self._sleep = sleep
        self._began: Nanos = clock()
        self._base: Nanos = 0
        #: How far virtual time stands behind the wall clock, ns of virtual time; 0 when it keeps up.
        self.lag_ns: Nanos = 0
        self.worst_lag_ns: Nanos = 0

    def start(self, now: Nanos) -> None:
        """Begin pacing at virtual time `now`."""
        self._began, self._base = self._clock(), now
        self.lag_ns = self.worst_lag_ns = 0

    def keep_pace(self, now: Nanos) -> None:
        """Wait until the wall clock has come to virtual time `now`."""
        ahead = now - self.wall_ns()
        if ahead > 0:
            self._sleep(ahead / self.speed / NS_PER_S)
            ahead = min(now - self.wall_ns(), 0)  # a sleep can last longer: the machine may have slept too
        self.lag_ns = -ahead
        self.worst_lag_ns = max(self.worst_lag_ns, self.lag_ns)

    def wall_ns(self) -> Nanos:
        """Return the virtual time that the wall clock stands for."""
        return self._base + int((self._clock() - self._began) * self.speed)


class SliceLength:
    """How long a slice of virtual time may be, so that it takes `GRAIN_NS` of the wall clock or less.

    It is halved where one took longer, and doubled where one took less than a quarter.
    """

    def __init__(self, clock: Clock = wall_clock) -> None:
        self._clock = clock
        self._was: Nanos = clock()
        self.slice_ns: Nanos = FIRST_SLICE_NS

    def after_slice(self) -> Nanos:
        """Return how long the next slice may be."""
        now = self._clock()
        took, self._was = now - self._was, now
        if took > GRAIN_NS:
            self.slice_ns = max(SHORTEST_SLICE_NS, self.slice_ns // 2)
        elif took < GRAIN_NS // 4:
            self.slice_ns = min(LONGEST_SLICE_NS, self.slice_ns * 2)
        return self.slice_ns
