"""The channel of a variable that is looked at while a run goes on, is set back, and goes on from there.

What is seen comes in stretches of time without gaps. A run is repeatable: what a stretch has of a time that is known is
known. Between stretches nothing is known, and the channel has a row of no number there.

Invariant: rows are in the order of time, and say what was seen, whatever order it was seen in.
"""

import math
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from p2os.view.recording import ChannelTrack
from simbase.timing import Nanos


class VariableTrack:
    """Brings stretches into one channel.

    Args:
        track: The channel, without rows.
    """

    def __init__(self, track: ChannelTrack) -> None:
        self._track = track
        #: Times that are known, in their order.
        self._spans: list[tuple[Nanos, Nanos]] = []

    def forked(self, track: ChannelTrack, until_ns: Nanos) -> "VariableTrack":
        """Return that of another future, whose channel has the same rows up to a time."""
        other = VariableTrack(track)
        other._spans = [(begin, min(end, until_ns)) for begin, end in self._spans if begin <= until_ns]
        return other

    def take(self, begins_ns: Nanos, until_ns: Nanos, rows: Sequence[tuple[Nanos, float]]) -> None:
        """Take what was seen from one time to another: rows where it was another value than before."""
        spans = self._spans
        if any(begin <= begins_ns and until_ns <= end for begin, end in spans):
            return
        goes_on = any(begin <= begins_ns <= end for begin, end in spans)
        new = [row for row in rows if row[0] > begins_ns or not goes_on]
        if spans and begins_ns > spans[-1][1] + 1:
            new.insert(0, (spans[-1][1] + 1, math.nan))
        is_known_behind = any(begin <= until_ns + 1 and until_ns <= end for begin, end in spans)
        if spans and until_ns < spans[-1][0] and not is_known_behind:
            new.append((until_ns + 1, math.nan))
        times = self._track.times
        first = bisect_right(times, begins_ns) if goes_on else bisect_left(times, begins_ns)
        if first and new and new[0][1] == self._track.column("value")[first - 1]:
            del new[0]  # it has that value already
        if first == len(times):
            for at, value in new:
                self._track.append(at, value)
        else:
            columns = array("q", [at for at, _ in new]), array("d", [value for _, value in new])
            self._track.replace_rows(first, bisect_right(times, until_ns), columns)
        self._spans = _united([*spans, (begins_ns, until_ns)])


def _united(spans: Sequence[tuple[Nanos, Nanos]]) -> list[tuple[Nanos, Nanos]]:
    found: list[tuple[Nanos, Nanos]] = []
    for begin, end in sorted(spans):
        if found and begin <= found[-1][1] + 1:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found
