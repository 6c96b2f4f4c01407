"""What a sample says: how many of its mutants were noticed, by package, with the interval of 95 %."""

import math
from collections import defaultdict
from collections.abc import Iterable

from tools.mutants.judge import NOTICED, MutantOutcome
from tools.mutants.mutant import SourceMutant

#: Standard deviations of a normal distribution that hold 95 % of it.
Z = 1.959964


def interval(noticed: int, judged: int) -> tuple[float, float]:
    """Return between which shares the true one lies, with 95 % (Wilson's score interval).

    Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22 (1927), 209-212.
    """
    if not judged:
        return 0.0, 1.0
    share = noticed / judged
    middle = share + Z * Z / (2 * judged)
    half = Z * math.sqrt(share * (1 - share) / judged + Z * Z / (4 * judged * judged))
    scale = 1 + Z * Z / judged
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def table(judged: Iterable[tuple[SourceMutant, MutantOutcome]]) -> list[str]:
    """Return a line for each package, and one for all."""
    counts = defaultdict[str, list[int]](lambda: [0, 0])
    for mutant, judgement in judged:
        for name in (mutant.package, "all"):
            counts[name][0] += judgement.verdict in NOTICED
            counts[name][1] += 1
    rows = sorted(counts.items(), key=lambda row: (row[0] == "all", row[0]))
    return [_line(name, noticed, count) for name, (noticed, count) in rows]


def _line(name: str, noticed: int, count: int) -> str:
    low, high = interval(noticed, count)
    return (
        f"{name:40} {noticed:4} of {count:4}  {100 * noticed / count:5.1f} %  ({100 * low:.0f} to {100 * high:.0f} %)"
    )
