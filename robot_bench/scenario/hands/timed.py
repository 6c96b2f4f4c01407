"""Something is done at a time: the `[[hand]]` tables of a scenario, which the page of a run writes down, too.

    [[hand]]                          [[hand]]                        [[hand]]
    at_s = 2.5                        at_s = 4.050000001              at_s = 6.0
    do = "move"                       do = "inject"                   do = "drive"
    name = "crate"                    fault = "sonar-dead 3"          forward_mps = 0.2
    x_m = 1.5                         for_s = 2.0                     for_s = 1.0
    y_m = 0.0

What is done is as of `[[when]]`. Whether it can be done is known at its time: things may have come and gone by then.

Invariant: a hand at t acts on everything after t.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from p2os.robots.parameters import RobotParameters
from p2os.toml_record import Record, read_part
from p2os.toml_schema import LONGEST_S, Key, Table, Where, within
from robot_bench.events.selection import Wires
from robot_bench.scenario.hands.doing import ACTION_TABLES, Doing, doing_of
from simbase.timing import NS_PER_S, Nanos, nanos

#: What a hand can do → the table of its keys; a run is ended by an event, or is over.
HAND_TABLES = {name: table for name, table in ACTION_TABLES.items() if name != "end"}


class TimedHandTable(Record):
    """`[[hand]]`: what is done at a time."""

    at_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="when, to the nanosecond")]
    do: Annotated[str, Key(choices=tuple(HAND_TABLES), doc="what is done")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hand:
    """What a hand does at a time."""

    at: Nanos
    do: str
    #: The rest of its table.
    keys: Mapping[str, object]
    #: With times counted from the beginning of the run.
    doing: Doing
    #: Of several robots the one that it is done to; empty: the only one, or the first.
    robot: str = ""
    #: As a person said it; empty: a file did.
    words: str = field(default="", compare=False)

    @property
    def table(self) -> dict[str, object]:
        """Its table in a file."""
        whose = {"robot": self.robot} if self.robot else {}
        return {"at_s": self.at / NS_PER_S, **whose, "do": self.do, **self.keys}


def hand_at(
    at: Nanos, do: str, keys: Table, parameters: RobotParameters, place: Where, wires: Wires | None = None
) -> Hand:
    """Return what a hand does at a time; arguments as of `doing_of`.

    Raises:
        ScenarioError: As of `doing_of`.
    """
    return Hand(at=at, do=do, keys=keys, doing=doing_of(do, keys, parameters, place, wires).begun_at(at))


def load_hands(
    tables: Sequence[Table], parameters: RobotParameters, where: Where, wires: Wires | None = None
) -> tuple[Hand, ...]:
    """Return what a scenario's `[[hand]]` tables ask for, in order of time; `wires` are those of a robot on own pins.

    Raises:
        ScenarioError: A table breaks the schema, or its fault or pin is none.
    """
    found: list[Hand] = []
    for number, table in enumerate(tables):
        place = within(where, "hand", number)
        row, keys = read_part(TimedHandTable, table, place)
        found.append(hand_at(nanos(row.at_s), row.do, keys, parameters, place, wires))
    return tuple(sorted(found, key=lambda hand: hand.at))
