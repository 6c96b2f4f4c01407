r"""Parameters by least squares: values, 95 % intervals, and which of them the data cannot show.

Intervals are those of the linearised model with a covariance that needs no noise of one size, nor independent
neighbours (Newey and West, Econometrica 55, 1987): residuals come in clusters in order of time, and clusters up to
`LAGS` apart may depend on each other. With J the Jacobian and u_c the sum of J'r over cluster c,

    cov = (J'J)^-1 S (J'J)^-1 n/(n-p),   S = sum_c u_c u_c' + sum_l (1 - l/(LAGS+1)) sum_c (u_c u_(c+l)' + transposed)

with n clusters and p parameters, and Student's quantile for n - p. Where clusters are known to be independent, a
variance is never less than that of residuals of one size: of few that tell of a parameter, S comes out small by chance.

What cannot be seen: the Jacobian, each column times how much that parameter could plausibly be off and divided by the
residuals' size, is decomposed into singular values. Along a singular vector whose value is below 1 the data know less
than was plausible before; the parameters that make it up are named and not given.

Invariant: a parameter that is not seen keeps its start, and does not move those that are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize, special

from robot_bench.drives.drive import Floats
from robot_bench.events.codec import Json
from simbase.errors import FileError

#: chosen: a second of packets, where clusters are packets; three steps of a way.
LAGS = 3
CONFIDENCE = 0.95
#: chosen: a parameter with no more than this part of a singular vector is no part of it.
LEAST_PART = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """What is to be estimated.

    Args:
        name: With its unit, as files have it.
        start: Where the search begins, and what it stays at where it is not seen.
        scale: How much it could plausibly be off.
        least: Of the search.
        most: Of the search.
    """

    name: str
    start: float
    scale: float
    least: float
    most: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A parameter's value and its 95 % interval."""

    name: str
    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half of the interval."""
        return (self.high - self.low) / 2

    def as_plain(self) -> Json:
        """Return it for JSON."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """What came of one: estimates by name, and what cannot be seen, each group with why."""

    estimates: dict[str, Estimate]
    unseen: dict[str, str]
    #: The root of the mean square of the residuals, in their unit.
    residual: float
    count: int

    def as_plain(self) -> Json:
        """Return it for JSON."""
        return {
            "estimates": {name: one.as_plain() for name, one in self.estimates.items()},
            "unseen": dict(self.unseen), "residual": self.residual, "count": self.count,
        }  # fmt: skip


def fit(
    residuals: Callable[[Floats], Floats],
    parameters: Sequence[Parameter],
    clusters: npt.NDArray[np.int64],
    *,
    floor: float,
    why: str,
    are_independent: bool = True,
) -> Fit:
    """Estimate parameters.

    Args:
        residuals: Of the parameters' values, always as many; their squares are made least.
        parameters: What is estimated.
        clusters: Of each residual, the number of its cluster, in order of time.
        floor: The residuals' size is taken as no less, in their unit: the grain of what was recorded.
        why: What the data lack where a parameter cannot be seen.
        are_independent: Whether neighbouring clusters tell nothing of each other.

    Raises:
        FileError: There are no more clusters than parameters.
    """
    count = len(np.unique(clusters))
    if count <= len(parameters):
        raise FileError(
            f"{count} pieces of the drive are too few for {len(parameters)} parameters", hint="a longer drive"
        )
    seen = list(parameters)
    unseen: dict[str, str] = {}
    while seen:
        solution = _solve(residuals, parameters, seen)
        hidden = _hidden(solution.jac, solution.fun, seen, floor)
        if not hidden:
            return _result(solution, seen, unseen, clusters, count, are_independent=are_independent)
        names = " and ".join(one.name for one in hidden)
        unseen |= {
            one.name: why if len(hidden) == 1 else f"only together with the others of {names}: {why}" for one in hidden
        }
        seen = [one for one in seen if one not in hidden]
    return Fit(estimates={}, unseen=unseen, residual=0.0, count=count)


def _solve(
    residuals: Callable[[Floats], Floats], parameters: Sequence[Parameter], seen: Sequence[Parameter]
) -> "optimize.OptimizeResult":
    """Return the least-squares solution of the parameters that are seen, the others at their starts."""
    places = [number for number, one in enumerate(parameters) if one in seen]
    whole = np.array([one.start for one in parameters])

    def partly(values: Floats) -> Floats:
        filled = whole.copy()
        filled[places] = values
        return residuals(filled)

    return optimize.least_squares(
        partly, [one.start for one in seen], bounds=([one.least for one in seen], [one.most for one in seen]),
        x_scale=[one.scale for one in seen], xtol=1e-12, ftol=1e-12, gtol=1e-12,
    )  # fmt: skip


def _hidden(jacobian: Floats, residual: Floats, seen: Sequence[Parameter], floor: float) -> list[Parameter]:
    """Return what makes up the least visible direction, where the data say less of it than was plausible before."""
    size = max(float(np.sqrt(np.mean(residual**2))), floor)
    _, values, vectors = np.linalg.svd(jacobian * [one.scale for one in seen] / size, full_matrices=False)
    if values[-1] >= 1.0:
        return []
    return [one for one, part in zip(seen, vectors[-1], strict=True) if abs(part) > LEAST_PART]


def _result(
    solution: "optimize.OptimizeResult", seen: Sequence[Parameter], unseen: dict[str, str],
    clusters: npt.NDArray[np.int64], count: int, *, are_independent: bool,
) -> Fit:  # fmt: skip
    inverse = np.linalg.inv(solution.jac.T @ solution.jac)
    sums = np.zeros((int(clusters.max()) + 1, len(seen)))
    np.add.at(sums, clusters, solution.jac * solution.fun[:, None])
    middle = sums.T @ sums
    for lag in range(1, LAGS + 1):
        across = sums[:-lag].T @ sums[lag:]
        middle += (1 - lag / (LAGS + 1)) * (across + across.T)
    covariance = inverse @ middle @ inverse * count / (count - len(seen))
    variances = np.maximum(np.diag(covariance), 0.0)
    if are_independent:
        plain = inverse * float(solution.fun @ solution.fun) / (len(solution.fun) - len(seen))
        variances = np.maximum(variances, np.diag(plain))
    half = special.stdtrit(count - len(seen), (1 + CONFIDENCE) / 2) * np.sqrt(variances)  # Student's quantile
    estimates = {
        one.name: Estimate(name=one.name, value=float(value), low=float(value - width), high=float(value + width))
        for one, value, width in zip(seen, solution.x, half, strict=True)
    }
    residual = float(np.sqrt(np.mean(solution.fun**2)))
    return Fit(estimates=estimates, unseen=unseen, residual=residual, count=count)
