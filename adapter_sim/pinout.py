"""The pin-out, read from pinout.toml and checked, and what of it an ESP32's pins can bear.

Source of the rules: reference of the ESP32 D1 mini's pins as the board review found
them: GPIO6..11 carry the module's flash, GPIO34..39 are inputs only, GPIO0, 2, 5, 12
and 15 are straps that decide how the chip boots.

Not here: series resistors, voltages, rise times (the board's own checks).

Invariant: a `Pinout` that exists names every wire once, gives every pin of the
BluePill to one wire only, and has for each value all bits from 0 to width − 1. Whether
a revision of the board can work is another question: `faults_of` answers it.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import TypeVar

from p2os.toml_file import TomlPlaces, read_toml, read_user_text
from simbase.errors import FileError, shown, shown_name


class PinoutError(FileError):
    """A pin-out file is missing or contradicts itself."""


class Direction(StrEnum):
    """Who drives a wire."""

    #: The adapter drives, the BluePill reads.
    TO_BLUEPILL = "to_bluepill"
    #: The BluePill drives, the adapter reads.
    TO_ADAPTER = "to_adapter"


class WireRole(StrEnum):
    """What a wire is for."""

    #: High: an obstacle nearer than the threshold.
    DISTANCE = "distance"
    #: One bit of a wheel's absolute position.
    ENCODER = "encoder"
    #: One bit of a motor's command.
    MOTOR = "motor"
    #: High: the BluePill wants the robot.
    CONNECT = "connect"
    #: High: the adapter is held in reset.
    RESET = "reset"


class Pull(StrEnum):
    """The resistor on the adapter's side of a wire."""

    UP = "up"
    DOWN = "down"
    NONE = "none"


class Safe(StrEnum):
    """What an output shows while the adapter knows nothing."""

    LOW = "low"
    HIGH = "high"
    #: The last level stays.
    HOLD = "hold"


class Status(StrEnum):
    """Whether a revision of the board can work."""

    USABLE = "usable"
    FAULTY = "faulty"
    PROPOSED = "proposed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """One of the wires between BluePill and adapter."""

    name: str
    role: WireRole
    direction: Direction
    #: Pin of the BluePill, for example "PA4".
    bluepill: str
    pull: Pull
    #: Level while nobody drives.
    idle: bool
    safe: Safe
    #: (revision, pin of the ESP32 or None for not connected), one for each revision.
    esp32: tuple[tuple[str, str | None], ...]
    #: Multi-bit value that the wire belongs to, and its weight as a power of two.
    value: str | None = None
    bit: int | None = None
    #: Number of the distance sensor, from 1.
    number: int | None = None

    def esp32_pin(self, revision: str) -> str | None:
        """Return the ESP32's pin in a revision, None where nothing is connected."""
        return dict(self.esp32)[revision]


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """A number carried by several wires."""

    name: str
    role: WireRole
    side: str
    width: int
    #: Names of its wires, least significant first.
    wires: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Revision:
    """A version of the adapter board."""

    name: str
    status: Status
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Auxiliary:
    """A pin of the ESP32 that reaches no BluePill pin."""

    name: str
    direction: str
    esp32: tuple[tuple[str, str], ...]
    #: Wire whose pin it uses too, before that becomes an output.
    shares: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinout:
    """The whole table."""

    wires: tuple[Wire, ...]
    values: tuple[Value, ...]
    revisions: tuple[Revision, ...]
    auxiliaries: tuple[Auxiliary, ...]
    default_revision: str

    def wire(self, name: str) -> Wire:
        """Return a wire by its name; KeyError where there is none."""
        return {wire.name: wire for wire in self.wires}[name]

    def value(self, name: str) -> Value:
        """Return a value by its name; KeyError where there is none."""
        return {value.name: value for value in self.values}[name]

    def with_role(self, role: WireRole) -> tuple[Wire, ...]:
        """Return the wires of a role, in the order of the table."""
        return tuple(wire for wire in self.wires if wire.role is role)


#: Key → least and most; more wires than this no ESP32 has pins for.
RANGES: Mapping[str, tuple[int, int]] = {
    "schema": (0, 1000), "idle": (0, 1), "bit": (0, 31), "number": (1, 32), "width": (1, 32),
}  # fmt: skip
#: Version of the file format.
SCHEMA = 1
#: The chip has ports A to E; the BluePill brings out A to C.
_BLUEPILL_PIN = re.compile(r"P[A-C]([0-9]|1[0-5])")
_ESP32_PIN = re.compile(r"IO([0-9]|[12][0-9]|3[0-9])|EN|HC595\.Q[A-H]")
#: Who drives the wires of a role.
_DRIVEN = {
    WireRole.DISTANCE: Direction.TO_BLUEPILL,
    WireRole.ENCODER: Direction.TO_BLUEPILL,
    WireRole.MOTOR: Direction.TO_ADAPTER,
    WireRole.CONNECT: Direction.TO_ADAPTER,
    WireRole.RESET: Direction.TO_ADAPTER,
}
#: Values that the adapter cannot do without, with their roles and sides.
_NEEDED_VALUES = {
    "encoder1": (WireRole.ENCODER, "left"),
    "encoder2": (WireRole.ENCODER, "right"),
    "motor1": (WireRole.MOTOR, "left"),
    "motor2": (WireRole.MOTOR, "right"),
}
#: Pins of the module's own flash chip.
FLASH_GPIO = frozenset(range(6, 12))
#: Pins without an output driver.
INPUT_ONLY_GPIO = frozenset(range(34, 40))
#: Pins read at boot; a BluePill that drives one can keep the ESP32 from booting.
STRAP_GPIO = frozenset({0, 2, 5, 12, 15})
#: Pins of the second input register: read together, they are one atomic sample.
SECOND_REGISTER_GPIO = frozenset(range(32, 40))


def load_pinout(path: str | Path | None = None) -> Pinout:
    """Read and check a pin-out file.

    Args:
        path: A TOML file; None takes the shipped one.

    Raises:
        PinoutError: The file is missing, is no TOML or contradicts itself.
    """
    where = "pinout.toml" if path is None else str(path)
    try:
        if path is None:
            text = resources.files("adapter_sim").joinpath("pinout.toml").read_text(encoding="utf-8")
        else:
            text = read_user_text(Path(path), "a pin-out", PinoutError)
    except (OSError, UnicodeDecodeError) as error:
        raise PinoutError(f"cannot read pin-out {where}: {error}") from error
    return parse_pinout(text, where)


def parse_pinout(text: str, where: str = "pinout") -> Pinout:
    """Check the text of a pin-out file; `where` names it in messages."""
    table, places = read_toml(text, where, "a pin-out", PinoutError)
    top = _Row(where, table, places)
    if top.integer("schema") != SCHEMA:
        raise top.fault("schema", table["schema"], str(SCHEMA))
    default = top.text("default_revision")
    revisions = tuple(_revision(row) for row in top.rows("revision"))
    names = [revision.name for revision in revisions]
    wires = tuple(_wire(row, names) for row in top.rows("wire"))
    values = tuple(_value(row, wires) for row in top.rows("value"))
    auxiliaries = tuple(_auxiliary(row, names, wires) for row in top.rows("auxiliary", optional=True))
    top.finish()
    _refuse_duplicates(where, "revision", names)
    _refuse_duplicates(where, "wire", [wire.name for wire in wires])
    _refuse_duplicates(where, "BluePill pin", [wire.bluepill for wire in wires])
    _refuse_duplicates(where, "value", [value.name for value in values])
    _refuse_duplicates(where, "auxiliary", [auxiliary.name for auxiliary in auxiliaries])
    if default not in names:
        raise PinoutError(f"{where}: default_revision {shown(default)} is none of {', '.join(names)}")
    _check_roles(where, wires, values)
    return Pinout(
        wires=wires, values=values, revisions=revisions, auxiliaries=auxiliaries, default_revision=default
    )  # fmt: skip


def faults_of(pinout: Pinout, revision: str) -> list[str]:
    """Return why a revision of the board cannot work, one line each, in the order of the table.

    Raises:
        KeyError: The pin-out has no such revision.
    """
    faults: list[str] = []
    taken: dict[str, str] = {}
    for wire in pinout.wires:
        pin = wire.esp32_pin(revision)
        faults += _wire_faults(wire, pin)
        if pin is not None and pin in taken:
            faults.append(f"{wire.name}: {pin} is {taken[pin]} already")
        elif pin is not None:
            taken[pin] = wire.name
    for auxiliary in pinout.auxiliaries:
        pin = dict(auxiliary.esp32).get(revision)
        if pin is None:
            continue
        if pin in taken and taken[pin] != auxiliary.shares:
            faults.append(f"{auxiliary.name}: {pin} is {taken[pin]} already")
        taken.setdefault(pin, auxiliary.name)
    motors = [_gpio(wire.esp32_pin(revision)) for wire in pinout.with_role(WireRole.MOTOR)]
    if any(gpio not in SECOND_REGISTER_GPIO for gpio in motors):
        faults.append("motor wires: not all in IO32..IO39, so no one read samples them at one instant")
    return faults


def require_usable(pinout: Pinout, revision: str) -> None:
    """Refuse a revision that cannot work.

    Raises:
        PinoutError: It does not exist, or has faults; the message has the first, the hint the number.
    """
    known = {entry.name: entry for entry in pinout.revisions}
    if revision not in known:
        raise PinoutError(f"board revision {revision!r} is unknown", hint="one of " + ", ".join(known))
    faults = faults_of(pinout, revision)
    if not faults and known[revision].status is Status.FAULTY:
        faults = [known[revision].note]
    if faults:
        raise PinoutError(
            f"board revision {revision!r} cannot work: {faults[0]}",
            hint=f"{len(faults)} such faults; {pinout.default_revision} has none",
        )


# Reading a file: each table asks for its keys, and what is left over is refused.

_Kind = TypeVar("_Kind", bound=StrEnum)


class _Row:
    """A table of the file, of which every key must be asked for."""

    def __init__(
        self, source: str, table: Mapping[str, object], places: TomlPlaces, name: str = "", number: int = 0
    ) -> None:
        self._source, self._places, self._name, self._number = source, places, name, number
        self._table = table
        self._asked: set[str] = set()

    @property
    def where(self) -> str:
        """File and line of the table, and what it is."""
        return self._at("")

    def _at(self, key: str) -> str:
        at = f"{self._source}:{self._places.line(self._name, self._number, key)}"
        return f"{at}: {self._name} {shown(self._table.get('name', self._number))}" if self._name else at

    def get(self, key: str) -> object:
        self._asked.add(key)
        return self._table.get(key)

    def text(self, key: str) -> str:
        value = self.get(key)
        if not isinstance(value, str):
            raise self.fault(key, value, "a text")
        return value

    def integer(self, key: str) -> int:
        value = self.get(key)
        least, most = RANGES[key]
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            raise self.fault(key, value, f"an integer of {least} to {most}")
        return value

    def choice(self, key: str, kind: type[_Kind]) -> _Kind:
        value = self.get(key)
        try:
            return kind(str(value))
        except ValueError:
            raise self.fault(key, value, "one of " + ", ".join(kind)) from None

    def rows(self, key: str, *, optional: bool = False) -> list["_Row"]:
        value = self.get(key)
        if value is None and optional:
            return []
        if not isinstance(value, list) or not value or not all(isinstance(row, dict) for row in value):
            raise self.fault(key, value, f"one [[{key}]] or more")
        return [_Row(self._source, row, self._places, key, index) for index, row in enumerate(value)]

    def pins(self, key: str, revisions: list[str]) -> dict[str, str]:
        value = self.get(key)
        if not isinstance(value, dict):
            raise self.fault(key, value, "a table of revision = pin")
        for revision, pin in value.items():
            if revision not in revisions:
                raise PinoutError(f"{self.where}: {key} names the unknown revision {shown(revision)}")
            if not isinstance(pin, str) or not (pin == "NC" or _ESP32_PIN.fullmatch(pin)):
                raise self.fault(f"{key}.{revision}", pin, "IO0..IO39, EN, HC595.QA..QH or NC")
        return value

    def fault(self, key: str, value: object, expected: str) -> PinoutError:
        if value is None:
            return PinoutError(f"{self.where}: key {key!r} is missing (expected {expected})")
        return PinoutError(
            f"{self._at(key.split('.', maxsplit=1)[0])}: {shown_name(key)} = {shown(value)}, expected {expected}"
        )

    def finish(self) -> None:
        unknown = sorted(set(self._table) - self._asked)
        if unknown:
            raise PinoutError(
                f"{self.where}: unknown key {shown(unknown[0])}", hint="known keys: " + ", ".join(sorted(self._asked))
            )


def _revision(row: _Row) -> Revision:
    result = Revision(name=row.text("name"), status=row.choice("status", Status), note=row.text("note"))
    row.finish()
    return result


def _wire(row: _Row, revisions: list[str]) -> Wire:
    name, role = row.text("name"), row.choice("role", WireRole)
    pins = row.pins("esp32", revisions)
    missing = [revision for revision in revisions if revision not in pins]
    if missing:
        raise PinoutError(f"{row.where}: esp32 has no pin for revision {shown(missing[0])}", hint='write "NC" for none')
    bluepill = row.text("bluepill")
    if not _BLUEPILL_PIN.fullmatch(bluepill):
        raise row.fault("bluepill", bluepill, "PA0..PC15")
    pull, idle = row.choice("pull", Pull), row.integer("idle")
    if idle not in {0, 1} or (pull is not Pull.NONE and bool(idle) != (pull is Pull.UP)):
        raise PinoutError(f"{row.where}: idle = {idle} contradicts pull = {pull.value!r}")
    direction = row.choice("direction", Direction)
    if direction is not _DRIVEN[role]:
        raise PinoutError(f"{row.where}: direction = {direction.value!r}, but a {role.value} wire is {_DRIVEN[role]}")
    safe = row.get("safe")
    if safe not in (0, 1, "hold") or not isinstance(safe, (int, str)) or isinstance(safe, bool):
        raise row.fault("safe", safe, '0, 1 or "hold"')
    of_value = role in {WireRole.ENCODER, WireRole.MOTOR}
    result = Wire(
        name=name,
        role=role,
        direction=direction,
        bluepill=bluepill,
        pull=pull,
        idle=bool(idle),
        safe=Safe.HOLD if safe == "hold" else Safe.HIGH if safe else Safe.LOW,
        esp32=tuple((revision, None if pins[revision] == "NC" else pins[revision]) for revision in revisions),
        value=row.text("value") if of_value else None,
        bit=row.integer("bit") if of_value else None,
        number=row.integer("number") if role is WireRole.DISTANCE else None,
    )
    row.finish()
    return result


def _value(row: _Row, wires: tuple[Wire, ...]) -> Value:
    name, role, width = row.text("name"), row.choice("role", WireRole), row.integer("width")
    own = sorted((wire for wire in wires if wire.value == name), key=lambda wire: wire.bit or 0)
    bits = [wire.bit for wire in own]
    if width < 1 or bits != list(range(width)):
        raise PinoutError(f"{row.where}: width = {width}, but its wires have the bits {bits}")
    odd = [wire.name for wire in own if wire.role is not role]
    if odd:
        raise PinoutError(f"{row.where}: role = {role.value!r}, but its wire {odd[0]} has another")
    result = Value(name=name, role=role, side=row.text("side"), width=width, wires=tuple(wire.name for wire in own))
    row.finish()
    return result


def _auxiliary(row: _Row, revisions: list[str], wires: tuple[Wire, ...]) -> Auxiliary:
    name, direction = row.text("name"), row.text("direction")
    if direction not in {"in", "out"}:
        raise row.fault("direction", direction, "in or out")
    shares = row.get("shares")
    if shares is not None and shares not in [wire.name for wire in wires]:
        raise row.fault("shares", shares, "the name of a wire")
    pins = row.pins("esp32", revisions)
    row.finish()
    return Auxiliary(
        name=name, direction=direction, esp32=tuple(pins.items()), shares=None if shares is None else str(shares)
    )


def _refuse_duplicates(where: str, what: str, names: list[str]) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise PinoutError(f"{where}: {what} {shown(name)} stands twice")
        seen.add(name)


def _check_roles(where: str, wires: tuple[Wire, ...], values: tuple[Value, ...]) -> None:
    for role in (WireRole.CONNECT, WireRole.RESET):
        count = sum(wire.role is role for wire in wires)
        if count != 1:
            raise PinoutError(f"{where}: {count} wires have the role {role.value!r}, expected 1")
    numbers = [wire.number for wire in wires if wire.role is WireRole.DISTANCE]
    if numbers != list(range(1, len(numbers) + 1)):
        raise PinoutError(f"{where}: distance wires are numbered {numbers}, expected 1, 2, 3 ... in order")
    found = {value.name: (value.role, value.side) for value in values}
    if found != _NEEDED_VALUES:
        raise PinoutError(
            f"{where}: values are {shown(sorted(found))}, expected {sorted(_NEEDED_VALUES)} with their sides"
        )
    widths = {value.width for value in values if value.role is WireRole.ENCODER}
    if len(widths) != 1:
        raise PinoutError(f"{where}: the encoders have {sorted(widths)} wires, expected as many each")
    stray = [wire.name for wire in wires if wire.value is not None and wire.value not in found]
    if stray:
        raise PinoutError(f"{where}: wire {shown(stray[0])} belongs to no [[value]]")


# Judging a revision, pin by pin.


def _wire_faults(wire: Wire, pin: str | None) -> list[str]:
    if pin is None:
        return [f"{wire.name}: no pin of the ESP32"]
    gpio = _gpio(pin)
    if gpio is None:
        return []
    faults = []
    if gpio in FLASH_GPIO:
        faults.append(f"{wire.name}: {pin} carries the module's flash")
    if wire.direction is Direction.TO_BLUEPILL and gpio in INPUT_ONLY_GPIO:
        faults.append(f"{wire.name}: {pin} is an input only, but must be driven")
    if wire.direction is Direction.TO_ADAPTER and gpio in STRAP_GPIO:
        faults.append(f"{wire.name}: {pin} is a boot strap, but the BluePill drives it")
    return faults


def _gpio(pin: str | None) -> int | None:
    return int(pin[2:]) if pin is not None and pin.startswith("IO") else None
