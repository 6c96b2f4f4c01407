"""A question to the circuit simulator: circuit, measures, limits, and what the answer cannot say."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A measured figure and the range that it must lie in."""

    measure: str
    low: float
    high: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Deck:
    """One simulation."""

    name: str
    title: str
    #: Circuit lines; the analysis line last.
    circuit: str
    #: `meas` lines without the word itself. A measure becomes a vector: none may be named as a node.
    measures: tuple[str, ...]
    limits: tuple[Limit, ...]
    #: Plotted traces: expression and legend.
    traces: tuple[tuple[str, str], ...]
    x_label: str
    y_label: str
    cannot_say: str
    #: Multiplies the sweep's values for the plot's axis.
    x_scale: float = 1.0


def limits(*rows: tuple[str, float, float, str, str]) -> tuple[Limit, ...]:
    """Return limits from rows of measure, lowest, highest, unit and meaning."""
    return tuple(
        Limit(measure=measure, low=low, high=high, unit=unit, meaning=meaning)
        for measure, low, high, unit, meaning in rows
    )
