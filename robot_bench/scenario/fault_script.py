"""Timed faults of the robot: the `[[fault]]` tables of a scenario, and what carries them out.

    [[fault]]
    at_s = 5.0
    fault = "sonar-stuck 3 1.2"
    for_s = 2.0                  # then it is cleared; without it stays

The words are those of `p2os.pioneer.controller.faults`, and `link-down`: both directions of the P2OS line are
broken. They act on the robot's controller and its line, so they need mode B; which bits a noisy line turns is decided
by the scenario's seed.

Invariant: a fault at t affects everything that happens after t, and
nothing that happened up to t.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated

from p2os.errors import ScenarioError
from p2os.pioneer.controller.faults import MOMENTARY, read_fault
from p2os.robots.parameters import RobotParameters
from p2os.toml_record import Record, read
from p2os.toml_schema import LONGEST_S, Key, Table, Where, placed, within
from robot_bench.scenario.timeline import Timeline
from simbase.timing import Nanos, nanos

#: The fault of the line itself.
LINK_DOWN = "link-down"
#: Of a fault, or of what a hand holds.
Span = Annotated[float | None, Key(above=0, most=LONGEST_S, doc="it ends after so long; without it stays")]


class FaultTable(Record):
    """`[[fault]]`: what goes wrong at a time."""

    at_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="when")]
    fault: Annotated[str, Key(doc='the words of [pioneer.md](pioneer.md#faults), or `"link-down"`')]
    for_s: Span = None


@dataclass(frozen=True, slots=True)
class FaultChange:
    """What is ordered at a time: "fault WORDS" or "clear WORDS"."""

    at: Nanos
    words: str


def load_faults(tables: Sequence[Table], parameters: RobotParameters, where: Where) -> tuple[FaultChange, ...]:
    """Return what a scenario's `[[fault]]` tables ask for, in order of time.

    Raises:
        ScenarioError: A table breaks the schema, or names no fault.
    """
    found: list[FaultChange] = []
    for number, table in enumerate(tables):
        place = within(where, "fault", number)
        found += faults_of(read(FaultTable, table, place), parameters, place)
    return tuple(sorted(found, key=lambda change: change.at))


def faults_of(row: FaultTable, parameters: RobotParameters, place: Where) -> tuple[FaultChange, ...]:
    """Return what one fault's table asks for, in order of time.

    Raises:
        ScenarioError: It names no fault, or ends one that happens once.
    """
    name, begin = row.fault, nanos(row.at_s)
    if row.fault != LINK_DOWN:
        with placed(place):
            name = read_fault(row.fault, sonar=parameters.sonar_fitted).name
    if row.for_s is None:
        return (FaultChange(begin, f"fault {row.fault}"),)
    if name in MOMENTARY:
        raise ScenarioError(f"{place}: for_s, but {name} happens once", hint="leave for_s out")
    return FaultChange(begin, f"fault {row.fault}"), FaultChange(begin + nanos(row.for_s), f"clear {row.fault}")


class FaultScript(Timeline[FaultChange]):
    """Injects and clears each fault at its time.

    Args:
        changes: In order of time.
        bring_to: Brings the robot to an instant, and its words onto the line.
        do: Carries out the words.
    """

    def __init__(
        self, changes: Sequence[FaultChange], *, bring_to: Callable[[Nanos], None], do: Callable[[str, Nanos], None]
    ) -> None:
        super().__init__(changes, self._apply)
        self._bring_to = bring_to
        self._do = do

    def _apply(self, change: FaultChange) -> None:
        self._bring_to(change.at)
        self._do(change.words, change.at)
        self._bring_to(change.at)
