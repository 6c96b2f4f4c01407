"""Motor commands as duty: how a capture unit measures a wire, and what both wheels' wires ask for.

With `MotorCommand.DUTY` each wheel has a sign and a magnitude, as H-bridges with a
phase and an enable input take them: the least significant wire carries the magnitude
as the share of a period at which it is high, the most significant one is high for
backward, the wires between are not looked at. The wires, their pins and the board are
those of the three bits.

Theory of operation
-------------------
A period lasts from one rising edge to the next, and its duty is known at its end. A
wire without an edge for `timeout_ns` has a level: 0 or all of it. Until then the last
duty stays, also at the first edges after a level. The duty is rounded to 1/1000, and a
value is taken as the median of the last samples: an outlier, or a sign that changes
a sample before its magnitude does, passes without effect, as a glitch of the three
bits does by majority.

A wire that was not looked at for more than `COURSE_NS` is measured anew.

Invariant: what a meter shows depends on the edges and on when it is read, not on how
the edges were reported: as edges, or as a wave.
"""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

from adapter_sim.codec import divide_half_away
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: What a wire shows that is always high: the unit of duties and of the values made of them.
FULL = 1_000
#: A wire without an edge for this long has a level, not a duty. # chosen: PWM of 50 Hz, a servo's, fits
DUTY_TIMEOUT_NS: Nanos = 25 * NS_PER_MS
#: For how long before the present a wire's course can be read. # chosen: twice the longest time-out that makes sense
COURSE_NS: Nanos = 50 * NS_PER_MS


class PeriodicLevel(Protocol):
    """A level that goes up every `period` ticks and down `high` ticks later; tick `at` is at `ns`."""

    @property
    def ns(self) -> Nanos:
        """Return when tick `at` is."""

    @property
    def at(self) -> int:
        """Return the ticks from a rising edge to `ns`."""

    @property
    def period(self) -> int:
        """Return the ticks from a rising edge to the next."""

    @property
    def high(self) -> int:
        """Return the ticks at level 1."""

    @property
    def ticks_hz(self) -> int:
        """Return the ticks a second."""

    def level(self, at_ns: Nanos, /) -> bool:
        """Return the level at a time, which is at or after `ns`."""


#: What a wire does from one time on until before another: when, and the level or wave from then on. It is known for
#: `COURSE_NS` before the present.
Course: TypeAlias = Callable[[Nanos, Nanos], Sequence[tuple[Nanos, "bool | PeriodicLevel"]]]


class DutyMeter(Stateful):
    """One channel of a capture unit.

    Args:
        timeout_ns: A wire without an edge for this long has a level.
    """

    STATE = ("_level", "_rose_at", "_fell_at", "_edge_at", "_duty")

    def __init__(self, timeout_ns: Nanos = DUTY_TIMEOUT_NS) -> None:
        self._timeout_ns = timeout_ns
        self._level = False
        self._rose_at: Nanos | None = None
        self._fell_at: Nanos = 0
        self._edge_at: Nanos | None = None
        self._duty = 0

    def restart(self, level: bool) -> None:
        """Forget all edges; the wire counts as having been at `level` for long."""
        self._level, self._duty = level, FULL if level else 0
        self._rose_at = self._edge_at = None

    def edge(self, level: bool, at: Nanos) -> None:
        """Take a change of the wire, in the order of time; the same level again is none."""
        if level == self._level:
            return
        self._expire(at)
        self._level, self._edge_at = level, at
        if not level:
            self._fell_at = at
            return
        if self._rose_at is not None:
            self._duty = divide_half_away((self._fell_at - self._rose_at) * FULL, at - self._rose_at)
        self._rose_at = at

    def duty(self, at: Nanos) -> int:
        """Return the share of a period at level 1 as known at `at`, 0 to `FULL`."""
        self._expire(at)
        return self._duty

    def _expire(self, at: Nanos) -> None:
        if self._edge_at is not None and at - self._edge_at >= self._timeout_ns:
            self.restart(self._level)


class DutyWire(Stateful):
    """A wire with a meter on it.

    Args:
        course: What the wire does in a span.
        timeout_ns: A wire without an edge for this long has a level.
    """

    STATE = ("_meter", "_read_at")

    def __init__(self, course: Course, *, timeout_ns: Nanos = DUTY_TIMEOUT_NS) -> None:
        self._course = course
        self._meter = DutyMeter(timeout_ns)
        self._read_at: Nanos | None = None

    def duty(self, now: Nanos) -> int:
        """Return the share of a period at level 1 as known at `now`, 0 to `FULL`; `now` never goes back."""
        begin, self._read_at = self._read_at, now
        if begin is None or now - begin > COURSE_NS:
            ((_, shown),) = self._course(now, now + 1)
            self._meter.restart(shown if isinstance(shown, bool) else shown.level(now))
        elif now > begin:
            course = self._course(begin, now + 1)
            for (at, shown), end in zip(course, [*(at for at, _ in course[1:]), now + 1], strict=True):
                if isinstance(shown, bool):
                    self._meter.edge(shown, at)
                else:
                    _take_wave(self._meter, shown, at, end)
        return self._meter.duty(now)


def _take_wave(meter: DutyMeter, wave: PeriodicLevel, begin: Nanos, end: Nanos) -> None:
    """Tell a meter what a wave does from `begin` until before `end`: its last periods, for a meter knows no older."""
    hz, period, high = wave.ticks_hz, wave.period, wave.high

    def time_of(ticks: int) -> Nanos:
        return wave.ns + (ticks - wave.at) * NS_PER_S // hz

    def turn_at(at: Nanos) -> int:
        return (wave.at + ((at - wave.ns + 1) * hz - 1) // NS_PER_S) // period

    first, last = turn_at(begin), turn_at(end - 1)
    meter.edge(wave.level(begin), begin)
    for turn in range(max(first, last - 2), last + 1):
        for edge, level in ((turn * period, True), (turn * period + high, False)):
            if begin < (at := time_of(edge)) < end:
                meter.edge(level, at)
