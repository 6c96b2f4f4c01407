"""Robots on a firmware engineer's own pins: which kinds there are, and how a scenario's file names one.

A robot file is TOML and says its kind; its [pins] say which pin of the BluePill each signal is on, and a scenario's own
[pins] may say otherwise. A Pioneer, whose wires are those of the pin-out, is none of these.

Invariant: of a robot that was read, each signal is on one pin that the BluePill has, and no pin has two.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path
from typing import Protocol, cast

from bluepill_sim.stm32f103 import BONDED_PINS
from p2os.errors import ScenarioError
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters
from p2os.toml_file import TomlSource, is_file, read_toml, read_user_text
from p2os.toml_record import table_of
from p2os.toml_schema import Table, TablePlace, Where, within
from robot_bench.direct.differential.robot import DifferentialRobot
from robot_bench.direct.differential.robot_file import load_differential
from robot_bench.direct.wired import AnalogPin, RobotWire
from robot_bench.events.selection import wire_named
from robot_bench.wires.nets import Harness
from simbase.errors import nearest, shown, shown_name
from simbase.timing import Nanos, Timed

#: Pins that the ADC can measure on this package.
ANALOG_PINS = frozenset([*(f"PA{number}" for number in range(8)), "PB0", "PB1"])


class WiredRobot(Protocol):
    """What a kind's file says of a robot; a frozen dataclass, so that a scenario can be compared and pickled."""

    @property
    def signals(self) -> tuple[RobotWire, ...]:
        """Its wires to the chip."""

    @property
    def parameters(self) -> RobotParameters:
        """What bodies and worlds need."""


class WiredPart(Timed, Protocol):
    """A robot in the bench: it owns the body."""

    on_event: Callable[[Nanos, str, str], None] | None
    on_ranges: Callable[[Nanos, Sequence[float]], None] | None


#: The kind of what is no robot: the pins of a board by itself.
NO_ROBOT = "none"
#: Where nothing is.
NOWHERE = World(
    name="", source="", description="", start=Pose(0.0, 0.0, 0.0), extent=(-1.0, -1.0, 1.0, 1.0), obstacles=()
)


@dataclass(frozen=True, slots=True)
class _Kind:
    #: Reads a file's table: (table, place, pins).
    load: Callable[[Table, TablePlace, Mapping[str, str]], WiredRobot]
    #: Makes the part of the bench: (robot, body, harness, pins of analog signals).
    build: Callable[[object, RobotBody, Harness, Callable[[str], AnalogPin]], WiredPart]


#: Kind of a robot file → what reads and builds it.
KINDS: Mapping[str, _Kind] = {
    "differential": _Kind(load_differential, cast("Callable[..., WiredPart]", DifferentialRobot)),
}


@dataclass(frozen=True, slots=True)
class OwnRobot:
    """A robot that hangs on the chip's own pins."""

    kind: str
    robot: WiredRobot

    def wire_named(self, name: str) -> str:
        """Return the name of a wire that has a level, by itself or by the BluePill's pin.

        Raises:
            UsageError: There is no such wire.
        """
        return wire_named(name, self.wires)

    @property
    def wires(self) -> dict[str, str]:
        """The name of each wire that has a level, by itself and by the BluePill's pin."""
        wires = {wire.pin: wire.name for wire in self.robot.signals if not wire.is_analog}
        return wires | {wire: wire for wire in wires.values()}

    def build(self, body: RobotBody, harness: Harness, analog_pin: Callable[[str], AnalogPin]) -> WiredPart:
        """Return the part of the bench."""
        return KINDS[self.kind].build(self.robot, body, harness, analog_pin)


def known_own_robots() -> tuple[str, ...]:
    """Return the names of the robots that ship."""
    folder = files("robot_bench.direct").joinpath("robots")
    return tuple(sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml")))


def find_own_robot(name: str, folder: Path) -> Path | None:
    """Return the file of a robot on own pins, by its name or its path beside a scenario; None: it is none of these."""
    if name in known_own_robots():
        with as_file(files("robot_bench.direct").joinpath("robots", f"{name}.toml")) as path:
            return path
    path = folder / name
    if path.suffix != ".toml" or not is_file(path):
        return None
    table, _ = read_toml(
        read_user_text(path, "a robot", ScenarioError), shown_name(path.name), "a robot", ScenarioError
    )
    return path if "kind" in table else None


def load_own_robot(path: Path, pins: Table, where: Where, *, charge: float | None = None) -> OwnRobot:
    """Return the robot of a file.

    Args:
        path: The file.
        pins: What a scenario says otherwise of the pins.
        where: Where it says so.
        charge: What it says of the battery's charge, in place of the file's.

    Raises:
        ScenarioError: The file breaks the schema, or signals and pins do not go together.
    """
    name = shown_name(path.name)
    table, places = read_toml(read_user_text(path, "a robot", ScenarioError), name, "a robot", ScenarioError)
    at = TablePlace(TomlSource(name, places))
    kind, own = table.get("kind"), table_of(table, "pins")
    if kind not in KINDS:
        raise ScenarioError(f"{at.at('kind')}: there is no kind of robot {shown(kind)}", hint=nearest(str(kind), KINDS))
    if charge is not None:
        table = {**table, "battery": {**table_of(table, "battery"), "charge": charge}}
    asked = {signal: str(pin) for signal, pin in {**own, **pins}.items()}
    robot = KINDS[str(kind)].load(table, at, asked)
    for part, its_place in ((own, within(at, "pins")), (pins, within(where, "pins"))):
        _check_pins(part, robot.signals, its_place)
    missing = next((wire.name for wire in robot.signals if wire.name not in asked), None)
    if missing is not None:
        raise ScenarioError(f"{within(at, 'pins')}: the pin of {missing} is missing", hint=f'{missing} = "PA8"')
    _refuse_twice(asked, within(where if pins else at, "pins"))
    return OwnRobot(str(kind), robot)


def _check_pins(pins: Table, signals: Sequence[RobotWire], where: Where) -> None:
    """Refuse signals that the robot has not, and pins that the chip has not, or that cannot measure."""
    wires = {wire.name: wire for wire in signals}
    for signal, pin in pins.items():
        at = where.at(signal) if isinstance(where, TablePlace) else where
        if signal not in wires:
            raise ScenarioError(f"{at}: unknown signal {shown(signal)}", hint=nearest(signal, wires))
        if pin not in BONDED_PINS:
            raise ScenarioError(f"{at}: {signal} = {shown(pin)} is no pin of the BluePill", hint='such as "PA8"')
        if wires[signal].is_analog and pin not in ANALOG_PINS:
            raise ScenarioError(
                f"{at}: {signal} = {shown(pin)} cannot measure volts", hint="PA0 to PA7, PB0 and PB1 can"
            )


def _refuse_twice(pins: Mapping[str, str], where: Where) -> None:
    seen: dict[str, str] = {}
    for signal, pin in pins.items():
        if pin in seen:
            at = where.at(signal) if isinstance(where, TablePlace) else where
            raise ScenarioError(f"{at}: {pin} is {seen[pin]} already, and cannot be {signal} too")
        seen[pin] = signal
