"""When a wave changes in a span of time.

Its time is in ticks of the clock that makes it; a tick begins at whole nanoseconds, rounded down (`Wave`).
"""

from collections.abc import Iterator

from bluepill_sim.fabric.subscriptions import Wave
from simbase.timing import NS_PER_S, Nanos


def edge_times(wave: Wave, begin: Nanos, end: Nanos) -> Iterator[Nanos]:
    """Yield the times from `begin` until before `end` at which a wave changes."""
    first = wave.at + (begin - wave.ns) * wave.ticks_hz // NS_PER_S
    for turn in range(first // wave.period, (wave.at + (end - wave.ns) * wave.ticks_hz // NS_PER_S) // wave.period + 1):
        for ticks in (turn * wave.period, turn * wave.period + wave.high):
            at = wave.ns + (ticks - wave.at) * NS_PER_S // wave.ticks_hz
            if begin <= at < end:
                yield at
