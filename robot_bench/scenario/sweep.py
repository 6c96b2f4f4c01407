"""Many runs of one scenario: its seeds, and parameters that take one value after the other.

    seeds = "0-99"

    [sweep]
    threshold_m = [0.4, 0.6, 0.8]
    start.heading_deg = { from = 0, to = 330, step = 30 }
    goal.2.least_m = [0.05, 0.1]

Every key that `--set` takes can be swept. Each value of the first goes with each of the second, and so on, and each of
these rows is run with each seed. Whoever runs the scenario once takes what its file says elsewhere.

Invariant: the rows and their order depend on the file and the options alone.
"""

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import cast

from p2os.errors import ScenarioError
from p2os.toml_schema import Key, Table, Where, check_table, within
from robot_bench.scenario.included_files import Setting
from simbase.errors import UsageError, shown

#: chosen: a night on one core with runs of a second; more is a mistake.
MOST_RUNS = 100_000
LARGEST_SEED = 2**63 - 1
_PART = re.compile(r"(\d+)(?:\s*-\s*(\d+))?", re.ASCII)
#: Keys of a range.
RANGE = (
    Key(name="from", kind="number", required=True),
    Key(name="to", kind="number", required=True),
    Key(name="step", kind="number", required=True, above=0),
)


@dataclass(frozen=True, slots=True)
class SweptParameter:
    """A parameter and the values that it takes."""

    key: str
    values: tuple[object, ...]


#: What a person should know whose hundred runs are one.
ALIKE = 'the seeds made no difference: nothing random acts here, as [controller] errors = "realistic" would'


def are_alike(hashes: Iterable[object]) -> bool:
    """Tell whether runs of several seeds, by the hashes of their traces, are one run; None is one without a trace."""
    found = list(hashes)
    return len(found) > 1 and len(set(found)) == 1 and None not in found


def read_seeds(text: str) -> tuple[int, ...]:
    """Return the seeds that a text names: "7", "0-99", "1, 5, 10-19", each once, in its order.

    Raises:
        UsageError: It names none, or too many.
    """
    found: dict[int, None] = {}
    for part in text.split(","):
        match = _PART.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match is not None else (0, -1)
        if not first <= last <= LARGEST_SEED:
            raise UsageError(f"{shown(text)} names no seeds", hint='such as "0-99", or "1,5,10-19"')
        if last - first + len(found) >= MOST_RUNS:
            raise UsageError(f"{shown(text)} are more than {MOST_RUNS} seeds", hint="take fewer")
        found |= dict.fromkeys(range(first, last + 1))
    return tuple(found)


def load_seeds(table: Table, where: str) -> tuple[int, ...]:
    """Return the seeds of a scenario, none where it names none.

    Raises:
        ScenarioError: Its text names none.
    """
    try:
        return read_seeds(str(table["seeds"])) if "seeds" in table else ()
    except UsageError as error:
        raise ScenarioError(f"{where}: seeds: {error}", hint=error.hint) from error


def load_axes(table: Table, where: Where) -> tuple[SweptParameter, ...]:
    """Return the parameters of a `[sweep]` table.

    Raises:
        ScenarioError: One has no values, or values that no list or range is.
    """
    axes = tuple(_axes(table, "", within(where, "sweep")))
    if math.prod(len(axis.values) for axis in axes) > MOST_RUNS:
        raise ScenarioError(f"{within(where, 'sweep')}: more than {MOST_RUNS} rows", hint="take a wider step")
    return axes


def rows(axes: tuple[SweptParameter, ...]) -> Iterator[tuple[Setting, ...]]:
    """Yield each row of a sweep: a value of each parameter; one empty row where there are no parameters."""
    for values in itertools.product(*(axis.values for axis in axes)):
        yield tuple((axis.key, value) for axis, value in zip(axes, values, strict=True))


def _axes(table: Table, above: str, where: Where) -> Iterator[SweptParameter]:
    for name, value in table.items():
        key = f"{above}.{name}".removeprefix(".")
        at = where if isinstance(where, str) else where.at(key)
        if isinstance(value, list) and value:
            if any(isinstance(item, dict) for item in value):
                raise ScenarioError(f"{at}: {key}: a table cannot be swept", hint="sweep a key of it")
            yield SweptParameter(key, tuple(value))
        elif isinstance(value, Mapping) and "from" in value:
            check_table(cast("Table", value), RANGE, f"{at}: {key}")
            yield SweptParameter(key, _range(cast("Mapping[str, float]", value), f"{at}: {key}"))
        elif isinstance(value, Mapping) and value:
            yield from _axes(cast("Table", value), key, where)
        else:
            raise ScenarioError(
                f"{at}: {key} = {shown(value)} is no list of values",
                hint="[0.4, 0.6], or { from = 0, to = 1, step = 0.25 }",
            )


def _range(table: Mapping[str, float], where: str) -> tuple[object, ...]:
    """Return the values of a range: in decimals, as they are written, both ends included."""
    try:
        first, last, step = (Fraction(str(table[key])) for key in ("from", "to", "step"))
    except ValueError:  # infinity
        raise ScenarioError(f"{where}: a range has ends") from None
    if last < first or (last - first) / step >= MOST_RUNS:
        wrong = "to is below from" if last < first else f"more than {MOST_RUNS} values"
        raise ScenarioError(f"{where}: {wrong}", hint="{ from = 0, to = 330, step = 30 }")
    values = [first + number * step for number in range(int((last - first) / step) + 1)]
    is_whole = all(isinstance(table[key], int) for key in ("from", "to", "step"))
    return tuple(int(value) if is_whole else float(value) for value in values)
