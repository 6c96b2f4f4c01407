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
from typing import cast

from p2os.errors import ScenarioError
from p2os.pioneer.controller.faults import MOMENTARY, read_fault
from p2os.robots.parameters import RobotParameters
from p2os.toml_schema import LONGEST_S, Key, Table, Where, check_table, placed, within
from robot_bench.scenario.timeline import Timeline
from simbase.timing import NS_PER_S, Nanos

#: The fault of the line itself.
LINK_DOWN = "link-down"
KEYS = (
    Key(name="at_s", kind="number", required=True, least=0, most=LONGEST_S),
    Key(name="fault", kind="text", required=True),
    Key(name="for_s", kind="number", above=0, most=LONGEST_S),
)


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
        check_table(table, KEYS, place)
        words = str(table["fault"])
        name = words
        if words != LINK_DOWN:
            with placed(place):
                name = read_fault(words, sonar=parameters.sonar_fitted).name
        at = _nanos(table, "at_s")
        found.append(FaultChange(at, f"fault {words}"))
        if "for_s" in table:
            if name in MOMENTARY:
                raise ScenarioError(f"{place}: for_s, but {name} happens once", hint="leave for_s out")
            found.append(FaultChange(at + _nanos(table, "for_s"), f"clear {words}"))
    return tuple(sorted(found, key=lambda change: change.at))


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


def _nanos(table: Table, key: str) -> Nanos:
    return round(float(cast("float", table[key])) * NS_PER_S)
