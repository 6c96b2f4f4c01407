"""A capture's time in a run's: when the capture began, and by how much the two clocks differ.

Time of the run = offset + (1 + error) x time of the capture. Neither is known, wires may be swapped or inverted, edges
lost or added, and the capture may begin late or end early. So alignments are *proposed* where a few intervals in a row
agree, the rarest intervals first, on every pair of a channel and a pin and on all declared pairs together. Each is
*followed* outwards from there: in a window twice as wide each time, edges that meet are fitted by least squares, so
that the error is always known well enough to tell neighbours apart. The alignment that explains most is taken, and its
line is at last the one whose largest residual is smallest: edges that are sampled are off by at most a sample, so the
worst counts, not the mean.

Invariant: the same two files give the same alignment.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

from bluepill_sim.analysis.waveforms.levels import LevelEdge

#: Part by which clocks may differ where nobody says otherwise; a crystal and an analyser have some 100 ppm together.
MOST_ERROR = 500e-6
#: chosen: intervals that are looked for, places at which each is, and alignments that are followed.
_RAREST, _PLACES, _FOLLOWED = 12, 40, 48
#: chosen: edges that are looked at in all while alignments are followed, some seconds.
_MOST_LOOKS, _LEAST_FOLLOWED = 2_000_000, 4
#: chosen: so many intervals in a row are compared around a place.
_ROW = 8
#: chosen: alignments less apart than this many tolerances are one.
_SAME = 3.0


@dataclass(frozen=True, slots=True)
class ChannelPair:
    """A channel of the capture beside a pin of the run."""

    channel: str
    pin: str
    capture: Sequence[LevelEdge]
    run: Sequence[LevelEdge]
    is_inverted: bool = False


@dataclass(frozen=True, slots=True)
class Clock:
    """Where a time of the capture is in the run."""

    #: ns of the run at the capture's 0.
    offset_ns: float
    #: By which part the board's clock is faster than the analyser's.
    error: float
    #: Twice the standard error of that.
    error_within: float = math.inf

    def in_run(self, ns: float) -> float:
        """Return the run's time of a time of the capture."""
        return self.offset_ns + ns * (1.0 + self.error)

    def in_capture(self, ns: float) -> float:
        """Return the capture's time of a time of the run."""
        return (ns - self.offset_ns) / (1.0 + self.error)


@dataclass(frozen=True, slots=True)
class Tolerance:
    """What is taken for the same edge."""

    #: An edge that is explained is this near at most.
    near_ns: float
    #: Part by which clocks may differ.
    most_error: float
    #: From when to when the run is known, and the capture, each in its own time.
    run_ns: tuple[float, float]
    capture_ns: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Met:
    """Edges of a track, met by a clock: pairs of their numbers, and those that are alone, of what both can know."""

    track: ChannelPair
    pairs: Sequence[tuple[int, int]]
    added: Sequence[int]
    missing: Sequence[int]

    @property
    def gain(self) -> float:
        """How much speaks for the clock: what is explained less what is not."""
        return len(self.pairs) - 0.5 * (len(self.added) + len(self.missing))


@dataclass(frozen=True, slots=True)
class Alignment:
    """The clock that explains most."""

    clock: Clock
    #: How many edges of the declared pairs it explains.
    explained: int
    #: Another offset, less this one, in ns, that explains as much: the signals repeat themselves. None: there is none.
    as_good_ns: float | None


def meet(track: ChannelPair, clock: Clock, limits: Tolerance, near_ns: float | None = None) -> Met:
    """Lay the edges of a track beside each other: each meets one of the same direction that is near, or none.

    At the ends of what both know an edge may be in one of them only: there those that meet count, and those alone not.
    """
    near = limits.near_ns if near_ns is None else near_ns
    first = max(limits.run_ns[0], clock.in_run(limits.capture_ns[0]))
    last = min(limits.run_ns[1], clock.in_run(limits.capture_ns[1]))
    slack = near + min(clock.error_within, limits.most_error) * max(last - first, 0.0)
    capture, run, flip = track.capture, track.run, int(track.is_inverted)
    i = bisect_left(capture, (clock.in_capture(first - slack), -1))
    j = bisect_left(run, (first - slack, -1))
    end_i, end_j = bisect_right(capture, (clock.in_capture(last + slack), 2)), bisect_right(run, (last + slack, 2))
    pairs: list[tuple[int, int]] = []
    added: list[int] = []
    missing: list[int] = []
    offset, rate = clock.offset_ns, 1.0 + clock.error
    while i < end_i and j < end_j:
        apart = offset + rate * capture[i][0] - run[j][0]
        if -near <= apart <= near and capture[i][1] ^ flip == run[j][1]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif apart < 0:
            added.append(i)
            i += 1
        else:
            missing.append(j)
            j += 1
    added += range(i, end_i)
    missing += range(j, end_j)
    first, last = first + slack, last - slack
    return Met(
        track, pairs, [i for i in added if first <= clock.in_run(capture[i][0]) <= last],
        [j for j in missing if first <= run[j][0] <= last],
    )  # fmt: skip


def align(declared: Sequence[ChannelPair], others: Sequence[ChannelPair], limits: Tolerance) -> Alignment | None:
    """Return the clock that explains most edges of the declared pairs; None where no two edges agree.

    Args:
        declared: Each channel beside the pin that it is said to be at.
        others: Channels beside other pins, or inverted: what the clock may be found by where a wire is not as declared.
        limits: What is taken for the same.
    """
    best: tuple[float, int, Clock] | None = None
    tried: list[tuple[float, int, Clock]] = []
    edges = sum(len(track.capture) + len(track.run) for track in declared) + 1
    most = max(_LEAST_FOLLOWED, min(_FOLLOWED, _MOST_LOOKS // edges))
    for seen, (tracks, i_ns, j_ns) in enumerate(_proposals(declared, others, limits)):
        if seen >= most:
            break
        if any(abs(clock.in_run(i_ns) - j_ns) < _SAME * limits.near_ns for _, _, clock in tried):
            continue
        clock = _follow(tracks, i_ns, j_ns, limits)
        all_tracks = {id(track): track for track in (*declared, *tracks)}.values()
        agreeing = [track for track in all_tracks if meet(track, clock, limits, 3 * limits.near_ns).gain > 0]
        clock = _settle(agreeing or tracks, clock, limits)
        met = [meet(track, clock, limits) for track in all_tracks]
        by_channel: dict[str, float] = {}
        for one in met:
            by_channel[one.track.channel] = max(by_channel.get(one.track.channel, -math.inf), one.gain)
        row = (sum(by_channel.values()), sum(len(one.pairs) for one in met), clock)
        tried.append(row)
        if best is None or row[0] > best[0]:
            best = row
    if best is None or best[1] == 0:
        return None
    begun = _from_the_beginning(declared, best, tried, limits)
    clock = begun[2]
    rivals = [other.offset_ns - clock.offset_ns for gain, _, other in tried
              if gain >= begun[0] and abs(other.offset_ns - clock.offset_ns) > _SAME * limits.near_ns]  # fmt: skip
    return Alignment(clock, begun[1], min(rivals, key=abs) if rivals else None)


def _from_the_beginning(
    declared: Sequence[ChannelPair],
    best: tuple[float, int, Clock],
    tried: Sequence[tuple[float, int, Clock]],
    limits: Tolerance,
) -> tuple[float, int, Clock]:
    """Return the alignment that counts where time itself jumps: the one that explains the capture's beginning.

    A board that loses a millisecond has two good alignments, and what comes after the jump is what is to be named.
    """
    held = _explained_first(declared, best[2], limits)
    for row in tried:
        found = _explained_first(declared, row[2], limits)
        if found > max(2 * held, 7) and found >= 0.02 * best[1]:
            best, held = row, found
    return best


def _explained_first(declared: Sequence[ChannelPair], clock: Clock, limits: Tolerance) -> int:
    """Return how many edges are explained before the first that is not."""
    met = [meet(track, clock, limits) for track in declared]
    first = min((at for one in met for at in _alone_ns(one, clock)), default=math.inf)
    return sum(one.track.run[j][0] < first for one in met for _, j in one.pairs)


def _alone_ns(met: Met, clock: Clock) -> Iterator[float]:
    yield from (clock.in_run(met.track.capture[i][0]) for i in met.added[:1])
    yield from (met.track.run[j][0] for j in met.missing[:1])


# Proposing ----------------------------------------------------------------------------------------------------------

_Item = TypeVar("_Item")
_Keyed = Sequence[tuple[float, object]]
_Proposal = tuple[Sequence[ChannelPair], float, float]


def _proposals(
    declared: Sequence[ChannelPair], others: Sequence[ChannelPair], limits: Tolerance
) -> Iterator[_Proposal]:
    """Yield tracks with a time of the capture and one of the run that may be the same, the likeliest first."""
    merged = [
        sorted((at, (track.pin, level)) for track in declared for at, level in (track.capture, track.run)[which])
        for which in (0, 1)
    ]  # fmt: skip
    found = [(agreed, (declared, i, j)) for agreed, i, j in _seeds(merged[0], merged[1], limits)]
    for track in (*declared, *others):
        capture = [(at, level ^ int(track.is_inverted)) for at, level in track.capture]
        found += [(agreed, ([track], i, j)) for agreed, i, j in _seeds(capture, track.run, limits)]
    # The capture begins with the run, or ends with it: what is likeliest of signals that repeat themselves.
    ends = [(sequence[0][0], sequence[-1][0]) for sequence in merged if sequence]
    if len(ends) == 2:
        yield declared, ends[0][0], ends[1][0]
        yield declared, ends[0][1], ends[1][1]
    found.sort(key=lambda row: (-row[0], abs(row[1][2] - row[1][1])))
    yield from (proposal for _, proposal in found)


def _seeds(capture: _Keyed, run: _Keyed, limits: Tolerance) -> Iterator[tuple[int, float, float]]:
    """Yield (how many intervals in a row agree, a time of the capture, one of the run)."""
    if len(capture) < 4:
        for at, key in capture[:1]:
            places = [j for j, (_, other) in enumerate(run) if other == key]
            yield from ((_row(capture, run, (0, j), limits), at, run[j][0]) for j in _spread(places))
        return
    by_keys: dict[tuple[object, object], list[tuple[float, int]]] = {}
    for j, (one, other) in enumerate(pairwise(run)):
        by_keys.setdefault((one[1], other[1]), []).append((other[0] - one[0], j))
    for rows in by_keys.values():
        rows.sort()
    ranked: list[tuple[int, int, tuple[object, object], int]] = []
    for i, (one, other) in enumerate(pairwise(capture)):
        rows = by_keys.get((one[1], other[1]), [])
        length, slack = other[0] - one[0], _slack(other[0] - one[0], limits)
        low, high = bisect_left(rows, (length - slack, -1)), bisect_right(rows, (length + slack, len(run)))
        if high > low:
            ranked.append((high - low, i, (one[1], other[1]), low))
    ranked.sort(key=lambda row: row[:2])
    for count, i, keys, low in _spread(ranked[: 8 * _RAREST], _RAREST):
        for _, j in _spread(by_keys[keys][low : low + count]):
            yield _row(capture, run, (i, j), limits), capture[i][0], run[j][0]


def _spread(items: Sequence[_Item], most: int = _PLACES) -> list[_Item]:
    """Return so many of them, evenly."""
    if len(items) <= most:
        return list(items)
    return [items[n * len(items) // most] for n in range(most)]


def _slack(length_ns: float, limits: Tolerance) -> float:
    return 2 * limits.near_ns + limits.most_error * abs(length_ns)


def _row(capture: _Keyed, run: _Keyed, at: tuple[int, int], limits: Tolerance) -> int:
    """Return how many edges next to two agree in how far from them they are."""
    agreed = 0
    for step in (1, -1):
        for n in range(1, _ROW + 1):
            i, j = at[0] + n * step, at[1] + n * step
            if not (0 <= i < len(capture) and 0 <= j < len(run)) or capture[i][1] != run[j][1]:
                break
            length = capture[i][0] - capture[at[0]][0]
            if abs(run[j][0] - run[at[1]][0] - length) > _slack(length, limits):
                break
            agreed += 1
    return agreed


# Following ----------------------------------------------------------------------------------------------------------


def _follow(tracks: Sequence[ChannelPair], at_ns: float, run_ns: float, limits: Tolerance) -> Clock:
    """Return the clock that follows from two times that are the same, followed outwards to the ends of the capture."""
    near, within = limits.near_ns, limits.most_error
    clock = Clock(run_ns - at_ns, 0.0)
    width = near / within
    whole = max(at_ns - limits.capture_ns[0], limits.capture_ns[1] - at_ns, width)
    while True:
        width = min(width, whole)
        points = _points(tracks, clock, (at_ns - width, at_ns + width), (3 * near + within * width, limits))
        fitted = _trimmed(points, 3 * near)
        if fitted is not None and abs(fitted.error) <= limits.most_error:
            clock, within = fitted, min(within, max(4 * near / _span(points), 1e-12))
        if width >= whole:
            break
        width *= 2
    return clock


def _settle(tracks: Sequence[ChannelPair], clock: Clock, limits: Tolerance) -> Clock:
    """Return the clock of all tracks that agree, not only of those that were followed."""
    points = _points(tracks, clock, limits.capture_ns, (3 * limits.near_ns, limits))
    return _smallest_worst(points, clock, limits.near_ns, limits.most_error)


_Points = list[tuple[float, float]]


def _points(
    tracks: Sequence[ChannelPair], clock: Clock, window: tuple[float, float], how: tuple[float, Tolerance]
) -> _Points:
    """Return (time of the capture, time of the run less it) of the edges that meet within a window of the capture."""
    near, limits = how
    first, last = limits.capture_ns
    seen = max(window[0], first) - near, min(window[1], last) + near
    part = Tolerance(near, limits.most_error, limits.run_ns, seen)
    points: _Points = []
    for track in tracks:
        met = meet(track, clock, part, near)
        points += [(track.capture[i][0], track.run[j][0] - track.capture[i][0]) for i, j in met.pairs]
    return points


def _span(points: _Points) -> float:
    return max(at for at, _ in points) - min(at for at, _ in points)


def _trimmed(points: _Points, near: float) -> Clock | None:
    """Return the line of least squares through points, fitted again without those far from it; None for a few."""
    clock = _line(points)
    if clock is None:
        return None
    kept = [point for point in points if abs(clock.offset_ns + clock.error * point[0] - point[1]) <= near]
    return _line(kept) or clock


def _line(points: _Points) -> Clock | None:
    count = len(points)
    if count < 2:
        return None
    middle = sum(at for at, _ in points) / count
    height = sum(apart for _, apart in points) / count
    spread = sum((at - middle) ** 2 for at, _ in points)
    if spread == 0.0:
        return None
    error = sum((at - middle) * (apart - height) for at, apart in points) / spread
    return Clock(height - error * middle, error)


def _smallest_worst(points: _Points, clock: Clock, near: float, most_error: float) -> Clock:
    """Return the line whose largest residual is smallest, without points that no such line has near."""
    points, found = sorted(points), clock
    for _ in range(max(len(points) // 4, 1)):
        if not points:
            return clock
        found = _minimax(points, clock, most_error)
        worst = max(points, key=lambda point: abs(found.offset_ns + found.error * point[0] - point[1]))
        if abs(found.offset_ns + found.error * worst[0] - worst[1]) <= near or len(points) < 4:
            break
        line = _line(points) or found
        points.remove(max(points, key=lambda point: abs(line.offset_ns + line.error * point[0] - point[1])))
    middle = sum(at for at, _ in points) / len(points)
    spread = sum((at - middle) ** 2 for at, _ in points)
    off = sum((found.offset_ns + found.error * at - apart) ** 2 for at, apart in points)
    deviation = max(math.sqrt(off / len(points)), near / 3)
    within = 2 * deviation / math.sqrt(spread) if spread else math.inf
    if within >= most_error:  # too short to tell
        heights = [apart for _, apart in points]
        return Clock((max(heights) + min(heights)) / 2, 0.0)
    return Clock(found.offset_ns, found.error, within)


def _minimax(points: _Points, start: Clock, most_error: float) -> Clock:
    """Return, of the lines that clocks may have, the one whose largest residual is smallest."""
    upper, lower = _hull(points, 1.0), _hull(points, -1.0)

    def band(error: float) -> float:
        return max(apart - error * at for at, apart in upper) - min(apart - error * at for at, apart in lower)

    span = points[-1][0] - points[0][0]
    if span <= 0.0:
        heights = [apart - start.error * at for at, apart in points]
        return Clock((max(heights) + min(heights)) / 2, start.error)
    around = min(max((_line(points) or start).error, -most_error), most_error)
    half = 4 * band(around) / span + 1e-15
    low, high = max(around - half, -most_error), min(around + half, most_error)
    for _ in range(80):
        third = (high - low) / 3
        if band(low + third) <= band(high - third):
            high -= third
        else:
            low += third
    error = (low + high) / 2
    tops = max(apart - error * at for at, apart in upper), min(apart - error * at for at, apart in lower)
    return Clock(sum(tops) / 2, error)


def _hull(points: Iterable[tuple[float, float]], side: float) -> _Points:
    """Return the upper (1) or lower (-1) hull of points in order."""
    hull: _Points = []
    for point in points:
        while len(hull) > 1 and side * (
            (hull[-1][0] - hull[-2][0]) * (point[1] - hull[-2][1])
            - (hull[-1][1] - hull[-2][1]) * (point[0] - hull[-2][0])
        ) >= 0:  # fmt: skip
            hull.pop()
        hull.append(point)
    return hull
