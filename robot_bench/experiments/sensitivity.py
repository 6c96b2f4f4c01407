"""On which parameters a scenario's outcome depends: one at a time, by Morris' effects, and by Sobol's indices.

A parameter is a key of the scenario with the range that it may have. One at a time, each takes values over its range
while the others stay in the middle of theirs: what is seen is exact there, and blind to what several do together.
Morris' method (Technometrics 33, 1991) goes through the whole box in random trajectories that change one parameter a
step: mu* is the mean size of the effect of a parameter over its whole range, sigma its spread: large where the effect
is not linear, or depends on the others. Sobol's indices (Mathematics and Computers in Simulation 55, 2001) share out
the outcome's variance over the whole box: S1 is a parameter's part by itself, ST its part together with the others.
Samples and analyses are SALib's.

An outcome is a goal's margin (its robustness: what was left, negative where it was missed) or a figure of the run.

Invariant: the runs and their order depend on the ranges, the counts and the seed alone.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from p2os.errors import ScenarioError
from robot_bench.bench import Bench
from robot_bench.drives.drive import Drive, Floats
from robot_bench.drives.metrics import metrics
from robot_bench.drives.of_run import trajectory_of
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Pose, Verdict
from robot_bench.scenario.included_files import Setting
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError, shown
from simbase.timing import Nanos

#: chosen: levels of Morris' grid, as the literature's usual.
LEVELS = 4
#: Figures of a run that can be outcomes.
FIGURES = (
    "path_m", "mean_mps", "standing_share", "mean_square_jerk_m2_s6", "log_dimensionless_jerk", "clearance_m",
    "contacts", "energy_j", "energy_j_per_m", "time_to_goal_s",
)  # fmt: skip
_RANGE = re.compile(r"(?P<key>[^=]+)=(?P<low>[^=]+?)\.\.(?P<high>[^=]+)")
#: What SALib calls what it finds, and so are the fields of `ParameterEffect`.
MORRIS, SOBOL = ("mu", "mu_star", "mu_star_conf", "sigma"), ("S1", "S1_conf", "ST", "ST_conf")
#: One point of the box: a value for each parameter.
Point = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Range:
    """A key of a scenario and between what it is varied; whole numbers where both ends are written as such."""

    key: str
    low: float
    high: float
    is_whole: bool

    def at(self, share: float) -> float:
        """Return the value at a share of the range."""
        value = self.low + share * (self.high - self.low)
        return round(value) if self.is_whole else value


def read_range(text: str) -> Range:
    """Return what `KEY=LOW..HIGH` says.

    Raises:
        UsageError: It says nothing, or the ends are no rising numbers.
    """
    found = _RANGE.fullmatch(text.strip())
    try:
        low, high = (float(found[name]) for name in ("low", "high")) if found else (math.nan, math.nan)
    except ValueError:
        low = high = math.nan
    if found is None or not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise UsageError(f"--vary {shown(text)} is no KEY=LOW..HIGH", hint="such as --vary threshold_m=0.4..1.0")
    whole = all(re.fullmatch(r"\s*[+-]?\d+\s*", found[name]) for name in ("low", "high"))
    return Range(found["key"].strip(), low, high, whole)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleDesign:
    """Which points are run: those of one at a time, Morris' trajectories, Saltelli's sample for Sobol's indices.

    Args:
        ranges: Of each parameter.
        steps: Values of each, one at a time; 0: none.
        trajectories: Of Morris' method; 0: none.
        seed: Of the trajectories and the sample.
        samples: Base samples of Sobol's method, a power of two; parameters + 2 runs for each. 0: none.

    Raises:
        UsageError: `samples` is no power of two.
    """

    ranges: tuple[Range, ...]
    steps: int
    trajectories: int
    seed: int
    samples: int = 0

    def __post_init__(self) -> None:
        if self.samples < 0 or self.samples & (self.samples - 1):
            raise UsageError(f"{self.samples} samples are no power of two", hint="--samples 64; 0 for none")

    @property
    def single(self) -> list[list[Point]]:
        """For each parameter, the points in which it alone is varied."""
        middle = [one.at(0.5) for one in self.ranges]
        return [
            [
                tuple(one.at(step / (self.steps - 1)) if number == place else middle[number]
                      for number in range(len(self.ranges)))
                for step in range(self.steps)
            ]
            for place, one in enumerate(self.ranges)
        ] if self.steps > 1 else []  # fmt: skip

    def _problem(self) -> Json:
        return {
            "num_vars": len(self.ranges), "names": [one.key for one in self.ranges],
            "bounds": [[0.0, 1.0] for _ in self.ranges],
        }  # fmt: skip

    def morris_shares(self) -> Floats:
        """Return Morris' points as shares of the ranges, shape (n, parameters)."""
        if not self.trajectories:
            return np.zeros((0, len(self.ranges)))
        from SALib.sample import morris

        shares = morris.sample(self._problem(), self.trajectories, num_levels=LEVELS, seed=self.seed)
        return np.asarray(shares, dtype=np.float64)

    def sobol_shares(self) -> Floats:
        """Return Saltelli's points as shares of the ranges, shape (n, parameters)."""
        if not self.samples:
            return np.zeros((0, len(self.ranges)))
        from SALib.sample import sobol

        shares = sobol.sample(self._problem(), self.samples, calc_second_order=False, seed=self.seed)
        return np.asarray(shares, dtype=np.float64)

    def point(self, shares: Floats) -> Point:
        """Return the point at shares of the ranges."""
        return tuple(one.at(float(share)) for one, share in zip(self.ranges, shares, strict=True))

    def points(self) -> list[Point]:
        """Return every point that has to be run, each once."""
        shares = [*self.morris_shares(), *self.sobol_shares()]
        every = [point for row in self.single for point in row] + [self.point(row) for row in shares]
        return list(dict.fromkeys(every))

    def settings(self, point: Point) -> list[Setting]:
        """Return a point as settings of the scenario."""
        return [(one.key, int(value) if one.is_whole else value) for one, value in zip(self.ranges, point, strict=True)]

    def effects(self, of: Callable[[Point], float]) -> "list[ParameterEffect]":
        """Return each parameter's effect on an outcome.

        Args:
            of: The outcome at a point.
        """
        alone = [[of(point) for point in row] for row in self.single]
        shares = self.morris_shares()
        found: dict[str, Sequence[float]] = {}
        if len(shares):
            from SALib.analyze import morris

            outcomes = np.array([of(self.point(row)) for row in shares])
            found |= morris.analyze(self._problem(), shares, outcomes, num_levels=LEVELS, seed=self.seed)
        if self.samples:
            found |= self._indices(np.array([of(self.point(row)) for row in self.sobol_shares()]))
        return [
            ParameterEffect(
                key=one.key,
                alone=tuple(alone[number]) if alone else (),
                **{name: float(found[name][number]) if name in found else None for name in (*MORRIS, *SOBOL)},
            )
            for number, one in enumerate(self.ranges)
        ]

    def _indices(self, outcomes: Floats) -> dict[str, Sequence[float]]:
        """Return Sobol's indices; all 0 where the outcome is always the same."""
        from SALib.analyze import sobol

        if float(np.ptp(outcomes)) == 0.0:
            return dict.fromkeys(SOBOL, [0.0] * len(self.ranges))
        found = sobol.analyze(self._problem(), outcomes, calc_second_order=False, seed=self.seed)
        return {name: found[name] for name in SOBOL}


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterEffect:
    """What one parameter does to one outcome, in the outcome's unit."""

    key: str
    #: The outcome over the parameter's range, the others in the middle.
    alone: tuple[float, ...]
    mu: float | None
    mu_star: float | None
    #: Half of the 95 % interval of mu*, by resampling the trajectories.
    mu_star_conf: float | None
    sigma: float | None
    #: Shares of the outcome's variance, alone and with the others, and halves of their 95 % intervals.
    S1: float | None = None
    S1_conf: float | None = None
    ST: float | None = None
    ST_conf: float | None = None

    @property
    def spread(self) -> float | None:
        """The outcome's greatest difference, one at a time."""
        return max(self.alone) - min(self.alone) if self.alone else None

    @property
    def size(self) -> float:
        """What parameters are ordered by: mu*, else ST, else the spread."""
        return next((value for value in (self.mu_star, self.ST, self.spread) if value is not None), 0.0)

    def as_plain(self) -> Json:
        """Return it for JSON."""
        return {
            "parameter": self.key, "alone": list(self.alone), "spread": self.spread,
            **{name: getattr(self, name) for name in (*MORRIS, *SOBOL)},
        }  # fmt: skip


def outcomes_of(scenario: Scenario, look: Callable[[Nanos], None] = lambda _now: None) -> dict[str, float]:
    """Run a scenario and return its outcomes: `goal 2 clearance` and so on, and figures; those that it has.

    Args:
        scenario: Of one robot.
        look: Called after each slice; may raise to end the run.

    Raises:
        ScenarioError: It has several robots.
    """
    if len(scenario.programmed) > 1:
        raise ScenarioError(f"{scenario.name} has several robots", hint="a scenario of one")
    bench = Bench(scenario, on_slice=look)
    bench.run_until(bench.end)
    end = bench.finish()
    record = bench.record()
    events: list[Pose | Verdict] = [*record.poses]
    drive = Drive(
        name=scenario.name, parameters=scenario.parameters, truth=trajectory_of(record.poses),
        events=[*events, *record.clearances, *record.contacts, *record.verdicts],
        open_goals=bench.judge().not_judged,
    )  # fmt: skip
    plain = metrics(drive).as_plain()
    found = {name: float(cast("float", plain[name])) for name in FIGURES if plain[name] is not None}
    for number, (goal, margin) in enumerate(zip(scenario.goals, bench.goals.margins(end), strict=True), 1):
        if margin is not None:
            found[f"goal {number} {goal.kind}"] = margin
    return found


def outcome_names(found: Sequence[Mapping[str, float]], wanted: Sequence[str]) -> list[str]:
    """Return which outcomes are looked at: those wanted, or every goal's margin that all runs have.

    Raises:
        UsageError: A run has not what is wanted, or none has a margin.
    """
    common = [name for name in found[0] if all(name in one for one in found)]
    if not wanted:
        goals = [name for name in common if name.startswith("goal ")]
        if not goals:
            raise UsageError("no goal of this scenario has a margin", hint=f"--outcome {' or '.join(FIGURES[:3])}")
        return goals
    for name in wanted:
        if name not in common:
            raise UsageError(f"not every run has an outcome {shown(name)}", hint=f"all have {', '.join(common)}")
    return list(wanted)
