"""What can be done to a run, whether at an event, at a time, or by a hand on the page: a table a kind.

Invariant: what a table asks for is counted from the moment at which it is done.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from p2os.errors import ScenarioError
from p2os.robots.parameters import RobotParameters
from p2os.toml_record import Record, read
from p2os.toml_schema import Key, Table, Where
from robot_bench.events.selection import Wires
from robot_bench.scenario.fault_script import LINK_DOWN, FaultChange, FaultTable, Span, faults_of
from robot_bench.scenario.hands.actions import ACTIONS, Action, HandTable, actions_of
from robot_bench.scenario.world_script import Op, ScriptedChange, ThingTable, changes_of
from simbase.errors import shown
from simbase.timing import Nanos

_BUTTONS = ("stop-button", "bumper")


class FaultActionTable(Record):
    """A [fault](#fault-faults-injected-during-the-run-mode-b)."""

    fault: Annotated[str, Key(doc="the words of a fault")]
    for_s: Span = None

    @property
    def words(self) -> str:
        """The fault in words."""
        return self.fault


class PressTable(Record):
    """A button of a Pioneer (mode B)."""

    button: Annotated[str, Key(doc='`"stop-button"`, or `"bumper front 1"`')]
    for_s: Span = None

    def __post_init__(self) -> None:
        if self.button.split()[:1] not in [[button] for button in _BUTTONS]:
            raise ScenarioError(f"there is no button {shown(self.button)}", hint='"stop-button", or "bumper front 1"')

    @property
    def words(self) -> str:
        """The fault in words."""
        return self.button


class DropLinkTable(Record):
    """The P2OS line is broken, both ways (mode B)."""

    for_s: Span = None
    words: ClassVar[str] = LINK_DOWN


class SagBatteryTable(Record):
    """A Pioneer's battery shows so much (mode B)."""

    volts: Annotated[int | float, Key(kind="number", least=0, most=25.5, doc="what it shows")]
    for_s: Span = None

    @property
    def words(self) -> str:
        """The fault in words."""
        return f"low-battery {self.volts}"


class EndTable(Record):
    """The run ends."""


ActionTable = ThingTable | FaultActionTable | PressTable | DropLinkTable | SagBatteryTable | HandTable | EndTable
#: What is done → the table of its keys.
ACTION_TABLES: Mapping[str, type[ActionTable]] = {
    "place": ThingTable, "move": ThingTable, "remove": ThingTable, "inject": FaultActionTable,
    "clear": FaultActionTable, "press": PressTable, "drop_link": DropLinkTable, "sag_battery": SagBatteryTable,
    **ACTIONS, "end": EndTable,
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Doing:
    """What is done: changes of the world, faults, and what a hand does, each with its time."""

    changes: tuple[ScriptedChange, ...] = ()
    faults: tuple[FaultChange, ...] = ()
    actions: tuple[Action, ...] = ()

    def begun_at(self, at: Nanos) -> "Doing":
        """Return it, counted from the beginning of the run, where it begins at a time."""
        return Doing(
            changes=tuple(replace(one, at=at + one.at) for one in self.changes),
            faults=tuple(replace(one, at=at + one.at) for one in self.faults),
            actions=tuple(replace(one, at=at + one.at) for one in self.actions),
        )


def doing_of(do: str, keys: Table, parameters: RobotParameters, place: Where, wires: Wires | None) -> Doing:
    """Return what a table asks for; nothing where that is the end of the run.

    Args:
        do: One of `ACTION_TABLES`.
        keys: The rest of the table.
        parameters: Of the robot.
        place: The table's, for messages.
        wires: Those of a robot on own pins; None: those of the pin-out.

    Raises:
        ScenarioError: The table breaks the schema, or its fault or pin is none.
    """
    action = read(ACTION_TABLES[do], keys, place)
    if isinstance(action, ThingTable):
        changes = changes_of(action, Op(do), 0, parameters, str(place))
        return Doing(changes=tuple(changes))
    if isinstance(action, EndTable):
        return Doing()
    if not isinstance(action, FaultActionTable | PressTable | DropLinkTable | SagBatteryTable):
        return Doing(actions=actions_of(action, do, place, wires))
    if do == "clear":
        return Doing(faults=(FaultChange(0, f"clear {action.words}"),))
    fault = FaultTable(at_s=0, fault=action.words, for_s=action.for_s)
    return Doing(faults=faults_of(fault, parameters, place))
