"""Measured against expected: a figure has a unit, an uncertainty, and a bound whose formula is printed beside it.

A bound is worked out from the settings of the scenario as it stands, never from what was measured. It is as tight as
what the parts of the bench add up to: `loose` names those that would hold at half their size too.

Invariant: a figure is met where the difference is within its bound, both ends included.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from robot_bench.events.codec import Json

#: What a figure is about, in the order of a report.
GROUPS = ("pins", "wire", "motion")
#: chosen: a difference that equals its bound but for the last bits of a float is within it.
SLACK = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureTolerance:
    """How far measured and expected may be apart.

    `name` says what kind of bound it is; `formula` how `value` comes about, with the numbers of this variant.
    """

    name: str
    value: float
    formula: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One measured value.

    `uncertainty` is what the recording itself cannot resolve, in the same unit; `count` says of how many values this is
    the worst; `at` where that was.
    """

    group: str
    what: str
    expected: float
    measured: float
    uncertainty: float
    unit: str
    bound: FigureTolerance
    count: int = 1
    at: str = ""

    @property
    def difference(self) -> float:
        """Measured less expected."""
        return self.measured - self.expected

    @property
    def share(self) -> float:
        """The size of the difference in bounds: at most 1 where it is met; of a bound of 0, 0 or infinite."""
        size = abs(self.difference)
        return size / self.bound.value if self.bound.value else (float("inf") if size > SLACK else 0.0)

    @property
    def is_met(self) -> bool:
        """Whether the difference is within the bound."""
        return abs(self.difference) <= self.bound.value + SLACK

    def to_plain(self) -> Json:
        """Return it for JSON."""
        return asdict(self) | {"difference": self.difference, "met": self.is_met}


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """Something that had to be recorded and was not: it fails its experiment."""

    group: str
    what: str
    why: str


Finding = Figure | Missing


def worst(figures: Sequence[Figure]) -> Figure:
    """Return the figure that is furthest out by its own bound, counted as the worst of all.

    Raises:
        ValueError: There is none.
    """
    found = max(figures, key=lambda figure: (figure.share, abs(figure.difference)))
    return replace(found, count=len(figures))


def worst_or_missing(figures: Sequence[Figure], group: str, what: str, why: str) -> Finding:
    """Return the worst figure; where there is none, that it is missing and why."""
    return worst(figures) if figures else Missing(group=group, what=what, why=why)


def loose(findings: Iterable[Finding]) -> dict[str, float]:
    """Return the bounds that no figure would break at half their size: name → largest share that was seen."""
    shares: dict[str, float] = {}
    for figure in findings:
        if isinstance(figure, Figure) and figure.bound.value:
            shares[figure.bound.name] = max(shares.get(figure.bound.name, 0.0), figure.share)
    return {name: share for name, share in shares.items() if share <= 0.5}


def shown_value(value: float, unit: str) -> str:
    """Return a value as a person reads it: at most five digits, with its unit."""
    return f"{value:.5g} {unit}".strip()


#: Bounds that hold at half their size too: name → why they are not made tighter.
LOOSE_BECAUSE: Mapping[str, str] = {
    "rim speed, direct": "the motor of mode direct is exact; the bound is the trace's last digit",
    "rounding of RVEL": "half of the unit it is sent in; no pair of codes falls nearer to the middle",
    "watchdog": "a whole step of the body passes rarely before the ramp begins",
    "time to stop": "poses are 50 ms apart, and the delay to the wheels is rarely at its longest",
    "time to stop, direct": "poses are 50 ms apart",
    "rounding of VEL, at a port": "40 mm/s times whole codes are whole",
    "delay to the robot, at a port": "a pair waits for another only where two changes follow each other at once",
    "way in a time, at a port": "packets of a virtual robot come on time",
    "time to stop, at a port": "a packet is rarely at its oldest when the robot stands",
    "standing, at a port": "a virtual robot's wheels stand",
    "delay to the wheels, at a port": "a packet is rarely at its oldest when a ramp begins",
    "slope of a ramp, at a port": "what a real robot's ramp adds is not known yet",
    "rim speed, at a port": "what a real robot's wheels add is not known yet",
}
