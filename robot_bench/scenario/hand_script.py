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
from collections.abc import Callable
from dataclasses import dataclass

from p2os.errors import ScenarioError
from p2os.toml_schema import LONGEST_S, Key, Table, Where
from robot_bench.events.selection import Wires, wire_named
from robot_bench.scenario.timeline import Timeline
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

PORTS = ("usart1", "usart2", "usart3")
LEVELS = {"high": True, "low": False}
_FOR = Key(name="for_s", kind="number", above=0, most=LONGEST_S)
_PIN = Key(name="pin", kind="text", required=True)
#: What can be done → the keys of its table.
ACTIONS = {
    "type": (Key(name="text", kind="text", required=True), Key(name="port", kind="text", choices=PORTS)),
    "set_pin": (_PIN, Key(name="level", kind="text", required=True, choices=tuple(LEVELS)), _FOR),
    "set_volts": (_PIN, Key(name="volts", kind="number", required=True, least=0, most=25.5), _FOR),
}
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


def load_actions(do: str, table: Table, where: Where, wires: Wires | None) -> tuple[Action, ...]:
    """Return what a checked table asks for, counted from 0.

    Raises:
        ScenarioError: There is no such pin.
    """
    if do == "type":
        return (Action(at=0, do=do, place=str(table.get("port", PORTS[0])), text=str(table["text"]).encode()),)
    pin = str(table["pin"])
    try:
        place = pin if do == "set_volts" and _CHIP_PIN.match(pin) else wire_named(pin, wires)
    except UsageError as error:
        if not _CHIP_PIN.match(pin):
            raise ScenarioError(f"{where}: {error}", hint=error.hint) from error
        place = pin
    if do == "set_volts" and not _CHIP_PIN.match(place):
        raise ScenarioError(f"{where}: volts are put on a pin of the BluePill", hint='such as pin = "PA0"')
    level, volts = table.get("level"), table.get("volts")
    begin = Action(
        at=0, do=do, place=place, level=None if level is None else LEVELS[str(level)],
        volts=float(volts) if isinstance(volts, (int, float)) else None,
    )  # fmt: skip
    span = table.get("for_s")
    if not isinstance(span, (int, float)):
        return (begin,)
    return begin, Action(at=round(span * NS_PER_S), do=do, place=place)


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
