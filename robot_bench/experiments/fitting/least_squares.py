r"""Parameters by least squares: values, 95 % intervals, and which of them the data cannot show.

Residuals come in clusters in order of time: pieces of a way, manoeuvres, seconds of readings. Within a cluster they may
depend on each other as they like; clusters are independent, or those up to `lags` apart depend on each other too (Liang
and Zeger, Biometrika 73, 1986; Newey and West, Econometrica 55, 1987). With A = (J'J)^-1 J', J the Jacobian, and e_c
the part of A r that cluster c has, a parameter's variance is

    ( sum_c e_c^2 + 2 sum_l (1 - l/(lags+1)) sum_c e_c e_(c+l) ) n/(n-p)

with n clusters and p parameters. Of few clusters that tell of a parameter this comes out small by chance, which two
things make good where clusters are independent: it is never less than with residuals of one size, and the quantile is
Student's for as many clusters as tell of that parameter, (sum w_c)^2 / sum w_c^2 with w_c the sum of the squares of A
over the cluster (Satterthwaite, Biometrics Bulletin 2, 1946), less one.

What no cluster sees: readings that are rounded err alike wherever the same speed is held, be it minutes later. So the
readings of robots near the solution are rounded anew, of which one group of parameters differs at a time (what is known
of the others ties the roundings together); the error that comes of that, beyond what clusters see of it, is added to
the variance.

What cannot be seen: the Jacobian, each column times how much that parameter could plausibly be off and divided by the
residuals' size, is decomposed into singular values. Along a singular vector whose value is below 1 the data know less
than was plausible before; the parameters that make it up are named and not given.

Invariant: a parameter that is not seen keeps its start, and does not move those that are; the same residuals give the
same intervals.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import optimize, special

from robot_bench.drives.drive import Floats
from robot_bench.events.codec import Json
from simbase.errors import FileError

CONFIDENCE = 0.95
#: chosen: of each group so many robots are drawn, whose parameters are off by this part at most: some grains at each
#: speed.
DRAWN, DRAWN_PART = 100, 0.05
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """How readings are rounded.

    Args:
        redrawn: Residuals of a robot with some values at these values, of nothing but its rounding.
        groups: Names of parameters of which each decides by itself at which part of a grain readings lie.
    """

    redrawn: Callable[[Floats, np.random.Generator], Floats]
    groups: Sequence[Sequence[str]]


def fit(
    residuals: Callable[[Floats], Floats],
    parameters: Sequence[Parameter],
    clusters: npt.NDArray[np.int64],
    *,
    floor: float,
    why: str,
    lags: int = 0,
    rounding: Rounding | None = None,
) -> Fit:
    """Estimate parameters.

    Args:
        residuals: Of the parameters' values, always as many; their squares are made least.
        parameters: What is estimated.
        clusters: Of each residual, the number of its cluster, in order of time.
        floor: The residuals' size is taken as no less, in their unit: the grain of what was recorded.
        why: What the data lack where a parameter cannot be seen.
        lags: How far apart clusters may be that depend on each other.
        rounding: Of readings whose grain is no small part of the residuals; None: it is.

    Raises:
        FileError: There are no more clusters than parameters that they show.
    """
    _, clusters = np.unique(clusters, return_inverse=True)
    count = int(clusters.max(initial=-1)) + 1
    seen = list(parameters)
    unseen: dict[str, str] = {}
    while seen:
        part = _Part(residuals, parameters, seen)
        solution = part.solved()
        hidden = _hidden(solution.jac, solution.fun, seen, floor)
        if not hidden:
            if count <= len(seen):
                raise FileError(
                    f"{count} pieces of the drive are too few for {len(seen)} parameters",
                    hint="a longer drive, with more speeds and turns",
                )
            return _result(part, solution, unseen, _Clusters(clusters, count, len(seen), lags), rounding)
        names = " and ".join(one.name for one in hidden)
        unseen |= {
            one.name: why if len(hidden) == 1 else f"only together with the others of {names}: {why}" for one in hidden
        }
        seen = [one for one in seen if one not in hidden]
    return Fit(estimates={}, unseen=unseen, residual=0.0, count=count)


class _Part:
    """The residuals as a function of the parameters that are seen, the others at their starts."""

    def __init__(
        self, residuals: Callable[[Floats], Floats], parameters: Sequence[Parameter], seen: Sequence[Parameter]
    ) -> None:
        self.seen = seen
        self._residuals = residuals
        self._places = [number for number, one in enumerate(parameters) if one in seen]
        self._whole = np.array([one.start for one in parameters])

    def filled(self, values: Floats) -> Floats:
        """Return the values of all parameters."""
        whole = self._whole.copy()
        whole[self._places] = values
        return whole

    def solved(self) -> "optimize.OptimizeResult":
        """Return the least-squares solution."""
        seen = self.seen
        return optimize.least_squares(
            lambda values: self._residuals(self.filled(values)), [one.start for one in seen],
            bounds=([one.least for one in seen], [one.most for one in seen]),
            x_scale=[one.scale for one in seen], xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip


def _hidden(jacobian: Floats, residual: Floats, seen: Sequence[Parameter], floor: float) -> list[Parameter]:
    """Return what makes up the least visible direction, where the data say less of it than was plausible before."""
    size = max(float(np.sqrt(np.mean(residual**2))), floor)
    _, values, vectors = np.linalg.svd(jacobian * [one.scale for one in seen] / size, full_matrices=False)
    if values[-1] >= 1.0:
        return []
    return [one for one, part in zip(seen, vectors[-1], strict=True) if abs(part) > LEAST_PART]


class _Clusters:
    """Residuals in clusters: what they say of the variance of estimates."""

    def __init__(self, numbers: npt.NDArray[np.int64], count: int, parameters: int, lags: int) -> None:
        self.numbers, self.count, self.parameters, self.lags = numbers, count, parameters, lags

    def sums(self, rows: Floats) -> Floats:
        """Return the sums of rows over each cluster: of shape (p, residuals), shape (p, clusters)."""
        return np.stack([np.bincount(self.numbers, row, self.count) for row in rows])

    def variances(self, influence: Floats, residual: Floats) -> Floats:
        """Return each parameter's variance.

        Args:
            influence: Of each residual on each parameter, shape (p, residuals).
            residual: Shape (residuals,).
        """
        parts = self.sums(influence * residual)
        found = np.sum(parts**2, axis=1)
        for lag in range(1, self.lags + 1):
            found += 2 * (1 - lag / (self.lags + 1)) * np.sum(parts[:, :-lag] * parts[:, lag:], axis=1)
        found = np.maximum(found * self.count / (self.count - self.parameters), 0.0)
        if self.lags:
            return np.asarray(found)
        plain = float(residual @ residual) / (len(residual) - self.parameters)
        return np.asarray(np.maximum(found, plain * np.sum(influence**2, axis=1)), dtype=np.float64)

    def quantiles(self, influence: Floats) -> Floats:
        """Return Student's quantile of each parameter."""
        degrees = np.full(len(influence), float(self.count - self.parameters))
        if not self.lags:
            weights = self.sums(influence**2)
            telling = np.sum(weights, axis=1) ** 2 / np.sum(weights**2, axis=1)
            degrees = np.clip(telling - 1, 1.0, degrees)
        return np.asarray(special.stdtrit(degrees, (1 + CONFIDENCE) / 2), dtype=np.float64)


def _result(
    part: _Part, solution: "optimize.OptimizeResult", unseen: dict[str, str], clusters: _Clusters,
    rounding: Rounding | None,
) -> Fit:  # fmt: skip
    influence = np.linalg.pinv(solution.jac)
    squares = clusters.quantiles(influence) ** 2 * clusters.variances(influence, solution.fun)
    if rounding is not None:
        normal = float(special.ndtri((1 + CONFIDENCE) / 2))
        squares = squares + normal**2 * _of_rounding(part, solution.x, influence, clusters, rounding)
    half = np.sqrt(squares)
    estimates = {
        one.name: Estimate(name=one.name, value=float(value), low=float(value - width), high=float(value + width))
        for one, value, width in zip(part.seen, solution.x, half, strict=True)
    }
    residual = float(np.sqrt(np.mean(solution.fun**2)))
    return Fit(estimates=estimates, unseen=unseen, residual=residual, count=clusters.count)


def _of_rounding(
    part: _Part, values: Floats, influence: Floats, clusters: _Clusters, rounding: Rounding
) -> Floats:  # fmt: skip
    """Return the variance that rounding makes and no cluster sees; of what is in no group, the largest of any."""
    random = np.random.default_rng(0)
    own, any_ = np.zeros(len(values)), np.zeros(len(values))
    for group in rounding.groups:
        differs = np.array([one.name in group for one in part.seen])
        beyond = np.zeros(len(values))
        for _ in range(DRAWN):
            other = values * (1 + differs * random.uniform(-DRAWN_PART, DRAWN_PART, len(values)))
            rounded = rounding.redrawn(part.filled(other), random)
            beyond += (influence @ rounded) ** 2 - clusters.variances(influence, rounded)
        any_ = np.maximum(any_, beyond / DRAWN)
        own = np.where(differs, np.maximum(beyond / DRAWN, 0.0), own)
    in_none = np.array([not any(one.name in group for group in rounding.groups) for one in part.seen])
    return np.where(in_none, any_, own)
