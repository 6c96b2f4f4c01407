"""The clock of everything that runs in real time, and the watch for gaps in it.

`time.monotonic` stands still on Linux while the machine sleeps, and so would every
deadman and timeout that is measured by it. `wall_clock` counts that time, where the
system has such a clock (CLOCK_BOOTTIME; macOS' and Windows' monotonic clocks are taken
as they are).

A gap is a wait that ends more than `GAP_NS` after its deadline: the machine slept, the
process was stopped, or its processor was busy elsewhere. Whoever moves a robot sends
it STOP before anything else then: what was asked before the gap is out of date.
"""

import time
from collections.abc import Callable

from p2os.protocol.times import LIVENESS_NS
from simbase.timing import Nanos

#: Nanoseconds that never go back, and go on while the machine sleeps.
Clock = Callable[[], Nanos]

#: chosen: as long as silence of the robot is tolerated.
GAP_NS: Nanos = LIVENESS_NS

if hasattr(time, "CLOCK_BOOTTIME"):

    def wall_clock() -> Nanos:
        """Return nanoseconds since the machine was started, sleep included."""
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

else:  # pragma: no cover - other systems than Linux
    wall_clock: Clock = time.monotonic_ns  # type: ignore[no-redef]  # the same name on every system


class GapWatch:
    """Finds waits that ended too late.

    Each time that it wakes, its owner calls `gap`; before it waits, `expect`.
    Time that passes between the two belongs to the wait: a machine can fall asleep
    in the middle of any line.
    """

    def __init__(self, now: Nanos) -> None:
        self._deadline = now

    def expect(self, deadline: Nanos) -> None:
        """Note when the next wait ends at the latest, counted from the time at which the work before it began."""
        self._deadline = deadline

    def gap(self, now: Nanos) -> Nanos:
        """Return how long after its deadline the wait has ended if that is a gap, else 0; each gap is returned once."""
        late, self._deadline = now - self._deadline, max(now, self._deadline)
        return late if late > GAP_NS else 0
