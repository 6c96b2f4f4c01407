"""Robots' time: the clock's, times a factor, less what was left out.

Robots do not run while no client is connected and they have come to rest, nor through a pause of
the machine longer than `LONGEST_PAUSE_NS`. So waiting costs no processor time and a long wait no
burst of steps. What pauses have left out is counted: for a robot's watchdog it is silence. Robots
that share a world share their time: it goes on while any of them has a client.
"""

from collections.abc import Callable

from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: three SIP cycles; a machine that lags more is reported rather than chased.
LONGEST_PAUSE_NS: Nanos = 300 * NS_PER_MS
#: chosen: how long the bodies run on after the last client has left, to come to rest.
SETTLE_NS: Nanos = 1 * NS_PER_S


class RobotTime:
    """The time of one robot, or of several that share a world.

    Args:
        clock: Nanoseconds; never goes back.
        speed: Robot seconds a second of the clock.
    """

    def __init__(self, clock: Callable[[], Nanos], speed: float = 1.0) -> None:
        self.speed = speed
        #: Nanoseconds of the robots' time.
        self.now: Nanos = 0
        #: Nanoseconds of the robots' time that pauses would have been, all in all.
        self.left_out: Nanos = 0
        self.clock = clock
        self._clock_read: Nanos = clock()
        self._clients = 0
        self._settled_at: Nanos = 0

    @property
    def stands(self) -> bool:
        """Tell whether it does not go on: nobody is there, and all has come to rest."""
        return not self._clients and self.now >= self._settled_at

    def client_came(self) -> None:
        """Note that a client is connected from now on."""
        self._clients += 1

    def client_left(self) -> None:
        """Note that one of them is gone."""
        self._clients -= 1
        self.go_on()

    def go_on(self) -> None:
        """Run on for `SETTLE_NS`, also without a client."""
        self._settled_at = self.now + SETTLE_NS

    def read(self) -> Nanos:
        """Bring the time up to the clock's; return how long a pause of the clock was left out, 0 for none."""
        read = self.clock()
        passed, self._clock_read = read - self._clock_read, read
        if self.stands:
            return 0
        counted = passed if self.speed == 1.0 else round(passed * self.speed)
        if passed > LONGEST_PAUSE_NS:
            self.left_out += counted
            return passed
        self.now += counted
        return 0
