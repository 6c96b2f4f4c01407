r"""What a hand does during a run: types into a USART, puts a level or volts on a pin, carries or drives the robot.

    [[when]]                          [[when]]                        [[when]]
    event = "usart1 sends ready"      event = "robot moves"           event = "time 5"
    do = "type"                       do = "set_pin"                  do = "set_volts"
    text = "go\\n"                     pin = "bumper_front"            pin = "PA0"
                                      level = "low"                   volts = 2.6
                                      for_s = 0.2                     for_s = 1.0

A level is held as hard as a wire to 3.3 V or to ground does: where a part drives the same wire hard, the trace notes
a contention. After `for_s` the hand lets go, or where `let_go` says so. A robot that is driven by hand turns its wheels
as the hand wants, whatever its motors are told, until it is let go.

Invariant: an action at t acts on everything after t, and each is noted in the trace.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.pioneer.world import Pose
from p2os.pioneer.world.file import in_range
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


class LetGoTable(Record):
    """What a hand holds is let go: a pin, or the `wheels`."""

    what: Annotated[str, Key(doc="a wire's name, a pin of the BluePill, or `wheels`")]


class CarryTable(Record):
    """The robot is carried elsewhere, where there is room; its wheels do not turn meanwhile."""

    x_m: Annotated[float, in_range("x_m", doc="its place in the world")]
    y_m: Annotated[float, in_range("y_m", doc="its place in the world")]
    heading_deg: Annotated[float, in_range("heading_deg", doc="counter-clockwise")] = 0.0


class DriveTable(Record):
    """The robot's wheels turn as a hand wants, whatever its motors are told."""

    forward_mps: Annotated[float, Key(least=-2, most=2, doc="speed ahead")]
    turn_dps: Annotated[float, Key(least=-360, most=360, doc="turning speed, counter-clockwise, deg/s")] = 0.0
    for_s: Span = None


HandTable = TypeTable | SetPinTable | SetVoltsTable | LetGoTable | CarryTable | DriveTable
#: What can be done → its table.
ACTIONS: Mapping[str, type[HandTable]] = {
    "type": TypeTable, "set_pin": SetPinTable, "set_volts": SetVoltsTable, "let_go": LetGoTable, "carry": CarryTable,
    "drive": DriveTable,
}  # fmt: skip
#: What `let_go` calls the wheels of a robot that is driven.
WHEELS = "wheels"
#: A pin of the chip that may be on no wire.
_CHIP_PIN = re.compile(r"P(A([0-9]|1[0-5])|B([0-9]|1[0-5])|C1[345])$")


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """One thing that a hand does; a level, volts or speeds of None let go."""

    at: Nanos
    do: str
    #: The USART, the wire, or the chip's pin; `wheels`, or `robot` where that is carried.
    place: str
    text: bytes = b""
    level: bool | None = None
    volts: float | None = None
    #: Ahead, m/s, and counter-clockwise, rad/s.
    speeds: tuple[float, float] | None = None
    pose: Pose | None = None
    #: Whose hand it is: what the trace calls it.
    who: str = "hand"

    @property
    def words(self) -> str:
        """What the trace notes."""
        if self.do == "type":
            return f"{self.place} {self.text.decode('utf-8', 'replace')!r}"
        if self.pose is not None:
            x_m, y_m, heading_deg = self.pose.x_m, self.pose.y_m, math.degrees(self.pose.heading_rad)
            return f"{self.place} to x {x_m:g} m, y {y_m:g} m, {heading_deg:g}°"
        if self.speeds is not None:
            return f"{self.place} {self.speeds[0]:g} m/s, {math.degrees(self.speeds[1]):g} deg/s"
        if self.place == WHEELS:
            return f"{self.place} lets go"
        if self.do == "set_volts":
            return f"{self.place} {'lets go' if self.volts is None else f'{self.volts:g} V'}"
        return f"{self.place} {'lets go' if self.level is None else 'high' if self.level else 'low'}"


def actions_of(row: HandTable, do: str, where: Where, wires: Wires | None) -> tuple[Action, ...]:
    """Return what a table asks for, counted from 0.

    Raises:
        ScenarioError: There is no such pin.
    """
    if isinstance(row, TypeTable):
        return (Action(at=0, do=do, place=row.port, text=row.text.encode()),)
    if isinstance(row, CarryTable):
        pose = Pose(x_m=row.x_m, y_m=row.y_m, heading_rad=math.radians(row.heading_deg))
        return (Action(at=0, do=do, place="robot", pose=pose),)
    if isinstance(row, DriveTable):
        begin = Action(at=0, do=do, place=WHEELS, speeds=(row.forward_mps, math.radians(row.turn_dps)))
    elif isinstance(row, LetGoTable):
        return _let_go(row.what, where, wires)
    elif isinstance(row, SetPinTable):
        begin = Action(at=0, do=do, place=_wire(row.pin, where, wires), level=LEVELS[row.level])
    else:
        begin = Action(at=0, do=do, place=_analog_pin(row.pin, where, wires), volts=row.volts)
    return (begin,) if row.for_s is None else (begin, Action(at=nanos(row.for_s), do=do, place=begin.place))


def _let_go(what: str, where: Where, wires: Wires | None) -> tuple[Action, ...]:
    if what == WHEELS:
        return (Action(at=0, do="drive", place=WHEELS),)
    levels = (Action(at=0, do="set_pin", place=_wire(what, where, wires)),)
    return (*levels, Action(at=0, do="set_volts", place=what)) if _CHIP_PIN.match(what) else levels


def _wire(pin: str, where: Where, wires: Wires | None) -> str:
    """Return the wire on a pin; the pin itself where it is free."""
    try:
        return wire_named(pin, wires)
    except UsageError as error:
        if _CHIP_PIN.match(pin):
            return pin
        raise ScenarioError(f"{where}: {error}", hint=error.hint) from error


def _analog_pin(pin: str, where: Where, wires: Wires | None) -> str:
    place = pin if _CHIP_PIN.match(pin) else _wire(pin, where, wires)
    if _CHIP_PIN.match(place):
        return place
    raise ScenarioError(f"{where}: volts are put on a pin of the BluePill", hint='such as pin = "PA0"')


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
