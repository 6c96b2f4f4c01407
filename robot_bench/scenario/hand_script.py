r"""What a hand does at the board during a run: types into a USART, puts a level or volts on a pin.

    [[when]]                          [[when]]                        [[when]]
    event = "usart1 sends ready"      event = "robot moves"           event = "time 5"
    do = "type"                       do = "set_pin"                  do = "set_volts"
    text = "go\\n"                     pin = "bumper_front"            pin = "PA0"
                                      level = "low"                   volts = 2.6
                                      for_s = 0.2                     for_s = 1.0

A level is held as hard as a wire to 3.3 V or to ground does: where a part drives the same wire hard, the trace notes
a contention. After `for_s` the hand lets go.

Invariant: an action at t acts on everything after t, and each is noted in the trace.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.toml_record import Record
from p2os.toml_schema import Key, Where
from robot_bench.events.selection import Wires, wire_named
from robot_bench.scenario.fault_script import Span
from robot_bench.scenario.timeline import Timeline
from simbase.errors import UsageError
from simbase.timing import Nanos, nanos

LEVELS = {"high": True, "low": False}
_Pin = Annotated[str, Key(doc="a wire's name, or a pin of the BluePill")]


class TypeTable(Record):
    """Characters come in at a USART of the BluePill."""

    text: Annotated[str, Key(doc="the characters")]
    port: Annotated[Literal["usart1", "usart2", "usart3"], Key(doc="where they come in")] = "usart1"


class SetPinTable(Record):
    """A level on a wire or a free pin, held as a wire to 3.3 V or ground; where a part drives it hard too, low wins."""

    pin: _Pin
    level: Annotated[Literal["high", "low"], Key(doc="what it is held at")]
    for_s: Span = None


class SetVoltsTable(Record):
    """Volts on a pin of the BluePill, for its ADC."""

    pin: _Pin
    volts: Annotated[float, Key(least=0, most=25.5, doc="what it is held at")]
    for_s: Span = None


#: What can be done → its table.
ACTIONS: Mapping[str, type[TypeTable | SetPinTable | SetVoltsTable]] = {
    "type": TypeTable, "set_pin": SetPinTable, "set_volts": SetVoltsTable,
}  # fmt: skip
#: A pin of the chip that may be on no wire.
_CHIP_PIN = re.compile(r"P(A([0-9]|1[0-5])|B([0-9]|1[0-5])|C1[345])$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One thing that a hand does; a level or volts of None let go."""

    at: Nanos
    do: str
    #: The USART, the wire, or the chip's pin.
    place: str
    text: bytes = b""
    level: bool | None = None
    volts: float | None = None
    #: Whose hand it is: what the trace calls it.
    who: str = "hand"

    @property
    def words(self) -> str:
        """What the trace notes."""
        if self.do == "type":
            return f"{self.place} {self.text.decode('utf-8', 'replace')!r}"
        if self.do == "set_volts":
            return f"{self.place} {'lets go' if self.volts is None else f'{self.volts:g} V'}"
        return f"{self.place} {'lets go' if self.level is None else 'high' if self.level else 'low'}"


def actions_of(
    row: TypeTable | SetPinTable | SetVoltsTable, do: str, where: Where, wires: Wires | None
) -> tuple[Action, ...]:
    """Return what a table asks for, counted from 0.

    Raises:
        ScenarioError: There is no such pin.
    """
    if isinstance(row, TypeTable):
        return (Action(at=0, do=do, place=row.port, text=row.text.encode()),)
    is_pin, place = _CHIP_PIN.match(row.pin), row.pin
    if isinstance(row, SetPinTable) or not is_pin:
        try:
            place = wire_named(row.pin, wires)
        except UsageError as error:
            if not is_pin:
                raise ScenarioError(f"{where}: {error}", hint=error.hint) from error
    if isinstance(row, SetPinTable):
        begin = Action(at=0, do=do, place=place, level=LEVELS[row.level])
    elif _CHIP_PIN.match(place):
        begin = Action(at=0, do=do, place=place, volts=row.volts)
    else:
        raise ScenarioError(f"{where}: volts are put on a pin of the BluePill", hint='such as pin = "PA0"')
    return (begin,) if row.for_s is None else (begin, Action(at=nanos(row.for_s), do=do, place=place))


class HandScript(Timeline[Action]):
    """Does each action at its time.

    Args:
        bring_to: Brings the robot to an instant.
        do: Carries an action out.
    """

    def __init__(self, *, bring_to: Callable[[Nanos], None], do: Callable[[Action], None]) -> None:
        super().__init__((), self._apply)
        self._bring_to = bring_to
        self._do = do

    def _apply(self, action: Action) -> None:
        self._bring_to(action.at)
        self._do(action)
