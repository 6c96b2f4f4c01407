"""Between what bounds a share of a whole lies of which a sample was looked at, without replacement.

The bounds are those of Clopper and Pearson (Biometrika 26, 1934), with the hypergeometric distribution of a finite
whole in place of the binomial: a share is within them that gives so many hits or more, and so many or fewer, each with
more than half of what may be missed.

Invariant: they hold the true share in at least `CONFIDENCE` of all samples, and are it where the sample is the whole.
"""

from bisect import bisect_left
from math import exp, lgamma

#: How many of all intervals hold the true share at least.
CONFIDENCE = 0.95


def share_interval(hits: int, sample: int, whole: int, *, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Return the least and the greatest share of hits in a whole, 0 to 1.

    Args:
        hits: Of the sample.
        sample: How many were looked at, 1 to `whole`.
        whole: How many there are.
        confidence: As of `CONFIDENCE`, above 0 and below 1.
    """
    tail = (1 - confidence) / 2
    # With more hits in the whole so many or more come more often, and so many or fewer more seldom.
    possible = range(hits, whole - (sample - hits) + 1)
    least = bisect_left(possible, True, key=lambda of: _at_most(sample - hits, sample, whole - of, whole) > tail)
    above = bisect_left(possible, True, key=lambda of: _at_most(hits, sample, of, whole) <= tail)
    return possible[least] / whole, possible[above - 1] / whole


def _at_most(hits: int, sample: int, of: int, whole: int) -> float:
    """Return how probable so many hits or fewer are in a sample of a whole that has `of`."""
    first = max(0, sample - (whole - of))
    if hits >= min(sample, of):
        return 1.0
    every = _log_ways(whole, sample)
    return sum(
        exp(_log_ways(of, count) + _log_ways(whole - of, sample - count) - every) for count in range(first, hits + 1)
    )


def _log_ways(things: int, chosen: int) -> float:
    return lgamma(things + 1) - lgamma(chosen + 1) - lgamma(things - chosen + 1)
