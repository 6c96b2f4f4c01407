"""What a wave does in a span of time: for how long it is high, and when it changes.

Its time is in ticks of the clock that makes it; a tick begins at whole nanoseconds, rounded down (`Wave`).
"""

from collections.abc import Iterator

from bluepill_sim.fabric.subscriptions import Wave
from simbase.timing import NS_PER_S, Nanos


def high_time_ns(wave: Wave, begin: Nanos, end: Nanos, dead_ns: int = 0) -> float:
    """Return for how long a wave is high between two times, its rising edges so much later.

    By fractions of a tick of 10**-9, in integers, from the wave's own beginning on; one division at the end.
    """
    hz, ns = wave.ticks_hz, wave.ns
    period, dead = wave.period * NS_PER_S, min(dead_ns * hz, wave.high * NS_PER_S)
    high, base = wave.high * NS_PER_S - dead, wave.at * NS_PER_S - dead
    first, first_part = divmod(base + (begin - ns) * hz, period)
    last, last_part = divmod(base + (end - ns) * hz, period)
    return ((last - first) * high + min(last_part, high) - min(first_part, high)) / hz


def edge_times(wave: Wave, begin: Nanos, end: Nanos, dead_ns: int = 0) -> Iterator[Nanos]:
    """Yield the times from `begin` until before `end` at which a wave changes, its rising edges so much later."""
    first = wave.at + (begin - dead_ns - wave.ns) * wave.ticks_hz // NS_PER_S
    for turn in range(first // wave.period, (wave.at + (end - wave.ns) * wave.ticks_hz // NS_PER_S) // wave.period + 1):
        for ticks, later in ((turn * wave.period, dead_ns), (turn * wave.period + wave.high, 0)):
            at = wave.ns + (ticks - wave.at) * NS_PER_S // wave.ticks_hz + later
            if begin <= at < end:
                yield at
