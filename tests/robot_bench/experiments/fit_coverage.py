"""How often the 95 % intervals of `p2os fit` hold, and whether they are as wide as they need be.

    python -m tests.robot_bench.experiments.fit_coverage                # 200 robots as P2OS tells of them
    python -m tests.robot_bench.experiments.fit_coverage --robots 50 --make rays
    python -m tests.robot_bench.experiments.fit_coverage --make all     # each of MAKES

A fresh robot with planted errors drives a minute; its intervals hold or do not. A line has how many hold, the median
half width, the 95 % error of the estimates over all robots, and the first over the second: an interval that is honest
and no wider than it need be has 95 % and about 1.

Ends with 1 where a parameter's intervals hold in less than 90 or more than 99 %, or are 1.5 times too wide.
"""

import argparse
import random
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from p2os.robots.parameters import load_parameters
from robot_bench.experiments.fitting.least_squares import Fit
from robot_bench.experiments.fitting.ramps import fit_ramps
from robot_bench.experiments.fitting.sonar import fit_sonar
from robot_bench.experiments.fitting.wheels import fit_wheels
from tests.robot_bench.experiments.synthetic_robots import MAKES, WALLS, Planted, drive

ROBOTS = 200
#: Of the intervals hold at least and at most; half widths over the 95 % error at most.
LEAST, MOST, WIDEST = 0.90, 0.99, 1.5


@dataclass(slots=True)
class Parameter:
    """What came of one parameter."""

    group: str
    name: str
    #: Of each robot that shows it: by how much the estimate is off, and half the interval.
    off: list[float] = field(default_factory=list)
    half: list[float] = field(default_factory=list)

    @property
    def covered(self) -> float:
        """The part of the intervals that hold."""
        return float(np.mean(np.abs(self.off) <= np.array(self.half)))

    @property
    def error(self) -> float:
        """The 95 % error of the estimates."""
        return float(np.quantile(np.abs(self.off), 0.95))

    @property
    def width(self) -> float:
        """Median half width over the 95 % error."""
        return float(np.median(self.half)) / self.error

    @property
    def is_true(self) -> bool:
        """Whether intervals hold as often as they say, and are not much wider than they need be."""
        return LEAST <= self.covered <= MOST and self.width <= WIDEST

    def line(self) -> str:
        """Return its line of the table, of no more than 80 columns."""
        figures = f"{100 * self.covered:6.1f} %{np.median(self.half):12.4g}{self.error:12.4g}{self.width:7.2f}"
        return f"{self.group:8}{self.name:18}{len(self.off):5}{figures}{'' if self.is_true else '  <-'}"


def fits_of(make: str, seed: int) -> tuple[Planted, dict[str, Fit]]:
    """Return a robot and what its drive comes to, by group."""
    source = random.Random(f"{make} {seed}")
    robot, parameters = Planted.drawn(source), load_parameters("p2dx")
    drives = [drive(parameters, robot, source, make=MAKES[make])]
    return robot, {"wheels": fit_wheels(drives), "ramps": fit_ramps(drives), "sonar": fit_sonar(drives, WALLS)}


def coverage(make: str, seeds: Iterable[int]) -> list[Parameter]:
    """Return what came of each parameter over robots of one make."""
    found: dict[str, Parameter] = {}
    for seed in seeds:
        robot, fits = fits_of(make, seed)
        for group, fitted in fits.items():
            for name, one in fitted.estimates.items():
                row = found.setdefault(name, Parameter(group, name))
                row.off.append(one.value - robot.truth(name))
                row.half.append(one.half_width)
    return list(found.values())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=ROBOTS)
    parser.add_argument("--make", choices=[*MAKES, "all"], default=next(iter(MAKES)))
    chosen = parser.parse_args(arguments)
    are_true = True
    for make in MAKES if chosen.make == "all" else [chosen.make]:
        sys.stdout.write(f"{make}: {chosen.robots} robots\n")
        titles = f"{'group':8}{'parameter':18}{'seen':>5}{'covered':>8}{'half width':>12}{'95 % error':>12}{'ratio':>7}"
        sys.stdout.write(f"{titles}\n")
        for row in coverage(make, range(chosen.robots)):
            sys.stdout.write(f"{row.line()}\n")
            are_true &= row.is_true
    return 0 if are_true else 1


if __name__ == "__main__":
    sys.exit(main())
