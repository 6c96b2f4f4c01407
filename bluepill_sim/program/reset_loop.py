"""A program that resets for ever: one that starts anew again and again and does nothing in between.

So many resets in a row, each sooner after the one before than any watchdog that is set with care, and during all of
them no change at a pin and no character: such a program will never come further, and costs the wall clock a thousand
times what another does. A row ends with a reset from outside (the button, power), with a longer time between two
resets, and with anything that was seen outside meanwhile: a program that works between its resets is not meant.
"""

from dataclasses import dataclass

from simbase.timing import NS_PER_MS, Nanos

#: chosen: a boot loader that counts its tries gives up long before.
MOST_RESETS = 100
#: chosen: the least time between two resets in which a program is taken to have got on; as far as it costs no more
#: than a second of the clock for one of the chip.
LEAST_NS: Nanos = NS_PER_MS


@dataclass(slots=True)
class ResetRow:
    """Resets by the program itself or its watchdogs, one soon after the other."""

    #: How many there are, and when the first and the last of them came.
    count: int = 0
    first_ns: Nanos = 0
    last_ns: Nanos = 0
    #: When the row was found to have no end; None: it was not.
    endless_ns: Nanos | None = None

    def add(self, now_ns: Nanos) -> bool:
        """Count a reset; tell whether the row is as long as one without an end."""
        if self.count and now_ns - self.last_ns < LEAST_NS:
            self.count += 1
        else:
            self.count, self.first_ns = 1, now_ns
        self.last_ns = now_ns
        return self.count >= MOST_RESETS

    def begin_anew(self, now_ns: Nanos) -> None:
        """Count from this reset on: something was seen outside since the first."""
        self.count, self.first_ns = 1, now_ns

    def clear(self) -> None:
        """Forget all: the chip was reset from outside."""
        self.count, self.endless_ns = 0, None

    def __str__(self) -> str:
        span_ms = (self.last_ns - self.first_ns) / NS_PER_MS
        return f"it resets for ever: {self.count} times in {span_ms:.3f} ms, with no change at a pin and no character"
