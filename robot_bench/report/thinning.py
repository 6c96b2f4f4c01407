"""Takes as much of a long recording as a plot can show, without hiding what stands out.

A curve has no more pixels than its canvas is wide: of the rows that fall into one
bucket of time the first, the last, and the least and greatest of each value are
kept, so that the curve looks as that of all rows.

Invariant: whatever is kept is a row of the recording, in its order; what fits is kept whole.
"""

from bisect import bisect_right
from collections.abc import Sequence

from robot_bench.wires.edges import Edges

#: chosen: one a pixel of the plots.
BUCKETS = 1200


def extremes(times: Sequence[float], columns: Sequence[Sequence[float]], *, buckets: int = BUCKETS) -> list[int]:
    """Return which rows show the least and the greatest of each column in each bucket of time.

    Args:
        times: Of the rows, ascending; no more than four rows a bucket are all returned.
        columns: The values of the rows, one sequence a column.
        buckets: Into how many equal times the whole is cut.
    """
    if len(times) <= 4 * buckets:
        return list(range(len(times)))
    kept: list[int] = []
    for first, last in _buckets(times, buckets):
        chosen = {first, last - 1}
        for column in columns:
            part = column[first:last]
            chosen |= {first + part.index(min(part)), first + part.index(max(part))}
        kept += sorted(chosen)
    return kept


def pulses(edges: Sequence[tuple[int, int]], *, buckets: int) -> list[tuple[int, int]]:
    """Return edges (ns, level) that show in each bucket of time whether a wire changed, and how it was left.

    Of more than three edges in a bucket the first two and the last are kept, so that both levels are seen.
    """
    if len(edges) <= 3 * buckets:
        return list(edges)
    kept = []
    times = edges.times if isinstance(edges, Edges) else [at for at, _ in edges]
    for first, last in _buckets(times, buckets):
        kept += [edges[n] for n in sorted({first, min(first + 1, last - 1), last - 1})]
    return kept


def _buckets(times: Sequence[float], buckets: int) -> list[tuple[int, int]]:
    """Return the first row and that after the last of each bucket of time that holds rows."""
    begin, width = times[0], (times[-1] - times[0]) / buckets or 1.0
    found, first = [], 0
    while first < len(times):
        bucket = int((times[first] - begin) / width)
        last = bisect_right(times, bucket, lo=first, key=lambda at: int((at - begin) / width))
        found.append((first, last))
        first = last
    return found
