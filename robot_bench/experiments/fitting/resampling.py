"""Values with which readings are off least, of every resample of blocks of them: for models that jump.

Where a thing comes into a sonar's cone or leaves it, its reading jumps: sums of squares are no smooth function of the
cone, slopes at one place say nothing, and the best value follows single readings. So all values of a grid are tried,
and the whole search is done again with blocks of readings drawn with replacement (the block bootstrap: Künsch, Annals
of Statistics 17, 1989). The mean over resamples errs less than the best value of all readings, as what jumps does
(bagging: Bühlmann and Yu, Annals of Statistics 30, 2002), and resamples lie about it as it does about the truth.

Invariant: the same readings give the same resamples.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from robot_bench.drives.drive import Floats
from robot_bench.experiments.fitting.least_squares import CONFIDENCE, Estimate

#: chosen: the interval's ends then are off by a twentieth of the interval.
RESAMPLES = 400
#: Rounds in which the offset is found without those that are too far off.
_ROUNDS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Best:
    """What is best in each resample.

    Args:
        cells: Of the grid, by number; shape (resamples,).
        offsets: By how much readings are larger than the model says, there.
    """

    cells: npt.NDArray[np.int64]
    offsets: Floats


def best_of_resamples(off: Floats, most: Floats, blocks: npt.NDArray[np.int64], *, has_offset: bool = True) -> Best:
    """Return which cell of a grid is best in each resample.

    Args:
        off: By how much each reading is off in each cell, shape (cells, n).
        most: Beyond its most, counted from the offset, a reading is as far off as any, shape (n,).
        blocks: The number of each reading's block, from 0, rising without a gap.
        has_offset: Whether readings may be off by the same in common, which does not count.
    """
    middle = np.median(off, axis=1) if has_offset else np.zeros(len(off))
    for _ in range(_ROUNDS if has_offset else 0):
        near = np.abs(off - middle[:, None]) < most
        middle = np.sum(off * near, axis=1) / np.maximum(near.sum(axis=1), 1)
    left = off - middle[:, None]
    near = np.abs(left) < most
    left *= near
    begins = np.flatnonzero(np.diff(blocks, prepend=-1))
    counts = np.add.reduceat(near.astype(np.float64), begins, axis=1)
    sums = np.add.reduceat(left, begins, axis=1)
    squares = np.add.reduceat(left**2 + ~near * most**2, begins, axis=1)
    weights = np.random.default_rng(0).multinomial(
        len(begins), np.full(len(begins), 1 / len(begins)), size=RESAMPLES
    ).T.astype(np.float64)  # fmt: skip
    means = (sums @ weights) / np.maximum(counts @ weights, 1) if has_offset else np.zeros((len(off), RESAMPLES))
    cells = np.argmin(squares @ weights - means * (sums @ weights), axis=0)
    return Best(cells, means[cells, np.arange(RESAMPLES)] + middle[cells])


def estimate_of(name: str, values: Floats, blocks: int) -> Estimate:
    """Return the mean of resamples and its interval, wider by Student's quantile where blocks are few.

    Args:
        name: Of the parameter.
        values: In each resample.
        blocks: How many there are, two at least.
    """
    mean, level = float(values.mean()), (1 + CONFIDENCE) / 2
    half = float(np.quantile(np.abs(values - mean), CONFIDENCE))
    half *= float(special.stdtrit(blocks - 1, level) / special.ndtri(level))
    return Estimate(name=name, value=mean, low=mean - half, high=mean + half)
