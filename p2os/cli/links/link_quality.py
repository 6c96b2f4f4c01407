"""How good a link is: the spacing of a robot's packets, and what was lost or damaged.

Passive: the times of packets are passed in.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from simbase.timing import NS_PER_MS, Nanos

#: chosen: ten seconds of a robot's packets.
KEPT = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Times in milliseconds: how many, and their least, middle, most and deviation."""

    count: int
    least_ms: float
    median_ms: float
    mean_ms: float
    p99_ms: float
    most_ms: float
    deviation_ms: float


def spread_of(times_ns: Sequence[Nanos]) -> Spread | None:
    """Return the spread of some times, None of none."""
    if not times_ns:
        return None
    sorted_ms = sorted(time / NS_PER_MS for time in times_ns)
    count, mean = len(sorted_ms), sum(sorted_ms) / len(sorted_ms)
    return Spread(
        count=count, least_ms=sorted_ms[0], median_ms=sorted_ms[count // 2], mean_ms=mean,
        p99_ms=sorted_ms[min(count - 1, math.ceil(count * 0.99) - 1)], most_ms=sorted_ms[-1],
        deviation_ms=math.sqrt(sum((time - mean) ** 2 for time in sorted_ms) / count),
    )  # fmt: skip


class LinkQuality:
    """Follows the packets of one session.

    Args:
        cycle_ns: The robot's cycle by its CONFIGpac; None: by the packets.
    """

    def __init__(self, cycle_ns: Nanos | None = None) -> None:
        self._cycle_ns = cycle_ns
        self._last_ns: Nanos | None = None
        self._gaps: deque[Nanos] = deque(maxlen=KEPT)
        #: Packets that should have come in longer pauses and did not.
        self.missed = 0
        self.packets = 0

    def packet(self, at_ns: Nanos) -> None:
        """Take the time of a packet."""
        self.packets += 1
        if self._last_ns is not None:
            gap = at_ns - self._last_ns
            self._gaps.append(gap)
            cycle = self.cycle_ns
            if cycle and len(self._gaps) > 2:
                self.missed += max(0, round(gap / cycle) - 1)
        self._last_ns = at_ns

    @property
    def cycle_ns(self) -> Nanos:
        """The robot's cycle: as given, else the median of the pauses so far; 0 before there are any."""
        if self._cycle_ns:
            return self._cycle_ns
        return sorted(self._gaps)[len(self._gaps) // 2] if self._gaps else 0

    @property
    def spread(self) -> Spread | None:
        """The spread of the last hundred pauses between packets."""
        return spread_of(self._gaps)
