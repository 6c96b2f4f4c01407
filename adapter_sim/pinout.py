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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, cast

from p2os.toml_file import TomlSource, read_toml, read_user_text
from p2os.toml_schema import Key, Kind, Table, TablePlace, filled, within
from simbase.errors import FileError, shown, shown_name


class PinoutError(FileError):
    """A pin-out file is missing or contradicts itself."""


class WireDirection(StrEnum):
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
    direction: WireDirection
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


#: Version of the file format.
SCHEMA = 1
#: The chip has ports A to E; the BluePill brings out A to C.
_BLUEPILL_PIN = re.compile(r"P[A-C]([0-9]|1[0-5])")
_ESP32_PIN = re.compile(r"IO([0-9]|[12][0-9]|3[0-9])|EN|HC595\.Q[A-H]")
#: Who drives the wires of a role.
_DRIVEN = {
    WireRole.DISTANCE: WireDirection.TO_BLUEPILL,
    WireRole.ENCODER: WireDirection.TO_BLUEPILL,
    WireRole.MOTOR: WireDirection.TO_ADAPTER,
    WireRole.CONNECT: WireDirection.TO_ADAPTER,
    WireRole.RESET: WireDirection.TO_ADAPTER,
}
#: Values that the adapter cannot do without, with their roles and sides.
_NEEDED_VALUES = {
    "encoder1": (WireRole.ENCODER, "left"),
    "encoder2": (WireRole.ENCODER, "right"),
    "motor1": (WireRole.MOTOR, "left"),
    "motor2": (WireRole.MOTOR, "right"),
}


def _key(name: str, kind: Kind = "text", choices: type[StrEnum] | None = None, *, required: bool = True) -> Key:
    """Return a key; more wires than a number may be no ESP32 has pins for."""
    least, most = _RANGES.get(name, (None, None))
    return Key(name=name, kind=kind, required=required, least=least, most=most, choices=tuple(choices or ()))


_RANGES = {"schema": (SCHEMA, SCHEMA), "idle": (0, 1), "bit": (0, 31), "number": (1, 32), "width": (1, 32)}
OF_VALUE, OF_DISTANCE = (_key("value"), _key("bit", "whole")), (_key("number", "whole"),)
#: What a wire has beside the keys of all, by its role.
_OF_ROLE: Mapping[str, tuple[Key, ...]] = {
    WireRole.ENCODER: OF_VALUE, WireRole.MOTOR: OF_VALUE, WireRole.DISTANCE: OF_DISTANCE,
    WireRole.CONNECT: (), WireRole.RESET: (),
}  # fmt: skip
KEYS: Mapping[str, tuple[Key, ...]] = {
    "": (
        _key("schema", "whole"), _key("default_revision"),
        *(_key(name, "tables") for name in ("revision", "wire", "value")), _key("auxiliary", "tables", required=False),
    ),
    "revision": (_key("name"), _key("status", choices=Status), _key("note")),
    "wire": (
        _key("name"), _key("role", choices=WireRole), _key("direction", choices=WireDirection), _key("bluepill"),
        _key("pull", choices=Pull), _key("idle", "whole"), _key("safe", "any"), _key("esp32", "table"),
    ),
    "value": (_key("name"), _key("role", choices=WireRole), _key("width", "whole"), _key("side")),
    "auxiliary": (
        _key("name"), Key(name="direction", kind="text", required=True, choices=("in", "out")),
        _key("shares", required=False), _key("esp32", "table"),
    ),
}  # fmt: skip
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
    if path is None:
        return _shipped()
    try:
        text = read_user_text(Path(path), "a pin-out", PinoutError)
    except (OSError, UnicodeDecodeError) as error:
        raise PinoutError(f"cannot read pin-out {path}: {error}") from error
    return parse_pinout(text, str(path))


@cache
def _shipped() -> Pinout:
    text = resources.files("adapter_sim").joinpath("pinout.toml").read_text(encoding="utf-8")
    return parse_pinout(text, "pinout.toml")


def parse_pinout(text: str, where: str = "pinout") -> Pinout:
    """Check the text of a pin-out file; `where` names it in messages."""
    table, places = read_toml(text, where, "a pin-out", PinoutError)
    place = TablePlace(TomlSource(where, places), error=PinoutError)
    top = filled(table, KEYS[""], place)
    default = top["default_revision"]
    revisions = tuple(
        Revision(name=row["name"], status=Status(row["status"]), note=row["note"])
        for _, row in _rows(top, "revision", place)
    )
    names = [revision.name for revision in revisions]
    wires = tuple(_wire(row, at, names) for at, row in _rows(top, "wire", place))
    values = tuple(_value(row, at, wires) for at, row in _rows(top, "value", place))
    auxiliaries = tuple(_auxiliary(row, at, names, wires) for at, row in _rows(top, "auxiliary", place))
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


# Reading a file, table by table.


def _rows(top: Table, name: str, where: TablePlace) -> Iterator[tuple[TablePlace, dict[str, Any]]]:
    """Yield the tables `[[name]]` with their places, checked."""
    for number, row in enumerate(cast("Sequence[Table]", top[name] or ())):
        at = within(where, name, number)
        more = _OF_ROLE.get(str(row.get("role")), ()) if name == "wire" else ()
        yield at, filled(row, (*KEYS[name], *more), at)


def _fault(where: TablePlace, key: str, value: object, expected: str) -> PinoutError:
    return PinoutError(f"{where.at(key.partition('.')[0])}: {shown_name(key)} = {shown(value)}, expected {expected}")


def _pins(row: Table, where: TablePlace, revisions: list[str]) -> dict[str, str]:
    """Return the pin of each revision that the row names."""
    pins = cast("dict[str, str]", row["esp32"])
    for revision, pin in pins.items():
        if revision not in revisions:
            raise PinoutError(f"{where.at('esp32')}: esp32 names the unknown revision {shown(revision)}")
        if not isinstance(pin, str) or not (pin == "NC" or _ESP32_PIN.fullmatch(pin)):
            raise _fault(where, f"esp32.{revision}", pin, "IO0..IO39, EN, HC595.QA..QH or NC")
    return pins


def _wire(row: dict[str, Any], where: TablePlace, revisions: list[str]) -> Wire:
    role, pins = WireRole(row["role"]), _pins(row, where, revisions)
    pull, idle, safe = row["pull"], row["idle"], row["safe"]
    missing = [revision for revision in revisions if revision not in pins]
    if missing:
        raise PinoutError(f"{where}: esp32 has no pin for revision {shown(missing[0])}", hint='write "NC" for none')
    if not _BLUEPILL_PIN.fullmatch(row["bluepill"]):
        raise _fault(where, "bluepill", row["bluepill"], "PA0..PC15")
    if pull != Pull.NONE and bool(idle) != (pull == Pull.UP):
        raise PinoutError(f"{where}: idle = {idle} contradicts pull = {pull!r}")
    if row["direction"] != _DRIVEN[role]:
        raise PinoutError(f"{where}: direction = {row['direction']!r}, but a {role.value} wire is {_DRIVEN[role]}")
    if safe not in (0, 1, "hold") or not isinstance(safe, (int, str)) or isinstance(safe, bool):
        raise _fault(where, "safe", safe, '0, 1 or "hold"')
    return Wire(
        name=row["name"], role=role, direction=WireDirection(row["direction"]), bluepill=row["bluepill"],
        pull=Pull(pull),
        idle=bool(idle), safe=Safe.HOLD if safe == "hold" else Safe.HIGH if safe else Safe.LOW,
        esp32=tuple((revision, None if pins[revision] == "NC" else pins[revision]) for revision in revisions),
        value=row.get("value"), bit=row.get("bit"), number=row.get("number"),
    )  # fmt: skip


def _value(row: dict[str, Any], where: TablePlace, wires: tuple[Wire, ...]) -> Value:
    name, role, width = row["name"], WireRole(row["role"]), row["width"]
    own = sorted((wire for wire in wires if wire.value == name), key=lambda wire: wire.bit or 0)
    bits = [wire.bit for wire in own]
    if bits != list(range(width)):
        raise PinoutError(f"{where}: width = {width}, but its wires have the bits {bits}")
    odd = [wire.name for wire in own if wire.role is not role]
    if odd:
        raise PinoutError(f"{where}: role = {role.value!r}, but its wire {odd[0]} has another")
    return Value(name=name, role=role, side=row["side"], width=width, wires=tuple(wire.name for wire in own))


def _auxiliary(row: dict[str, Any], where: TablePlace, revisions: list[str], wires: tuple[Wire, ...]) -> Auxiliary:
    shares, pins = row["shares"], _pins(row, where, revisions)
    if shares is not None and shares not in [wire.name for wire in wires]:
        raise _fault(where, "shares", shares, "the name of a wire")
    return Auxiliary(name=row["name"], direction=row["direction"], esp32=tuple(pins.items()), shares=shares)


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
    if wire.direction is WireDirection.TO_BLUEPILL and gpio in INPUT_ONLY_GPIO:
        faults.append(f"{wire.name}: {pin} is an input only, but must be driven")
    if wire.direction is WireDirection.TO_ADAPTER and gpio in STRAP_GPIO:
        faults.append(f"{wire.name}: {pin} is a boot strap, but the BluePill drives it")
    return faults


def _gpio(pin: str | None) -> int | None:
    return int(pin[2:]) if pin is not None and pin.startswith("IO") else None
