"""The parts by name, and how words become one: of `--attach`, and of [[part]] in a scenario.

    ssd1306,on=I2C1,address=0x3D        a part that ships, or one of the entry points `p2os.parts`
    ./mine.py:Thermometer,on=I2C1       a class in a Python file

A part's settings are the arguments of its class by their names and types; `on`, `select`, `name` and the names of its
pins are not among them.
Invariant: a `PartSpec` can be built again from itself alone, in another process too.
"""

import importlib
import inspect
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol, cast

from bluepill_sim.parts.attached import PartError, Use
from simbase.errors import FileError, shown, shown_name
from simbase.files import read_bytes, refuse_elsewhere
from simbase.trust import own_code
from simbase.user_classes import find_class, said

#: The entry points of others.
GROUP = "p2os.parts"
_HINT = "NAME,KEY=VALUE,... such as ssd1306,on=I2C1 or ./mine.py:Class,on=I2C1"
#: chosen: the largest card.
LARGEST_FILE_BYTES = 1024 * 1024 * 1024
_FLAGS = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True, slots=True)
class ShippedPart:
    """A part that ships: its class as "module:Class", and what it is."""

    target: str
    what: str


_OWN = "bluepill_sim.parts"
PARTS: Mapping[str, ShippedPart] = {
    "24c02": ShippedPart(f"{_OWN}.eeprom_24c02:Eeprom24C02", "I2C EEPROM, 256 bytes"),
    "button": ShippedPart(f"{_OWN}.panel:Button", "push button that bounces"),
    "can-node": ShippedPart(f"{_OWN}.can_talker:CanTalker", "node on a CAN: sends at a period, echoes"),
    "gps": ShippedPart(f"{_OWN}.gps:Gps", "GPS receiver on a USART: GGA and RMC"),
    "hc-sr04": ShippedPart(f"{_OWN}.hc_sr04:HcSr04", "ultrasonic distance sensor"),
    "leds": ShippedPart(f"{_OWN}.panel:LedPanel", "up to eight LEDs"),
    "mpu6050": ShippedPart(f"{_OWN}.mpu6050:Mpu6050", "gyroscope and accelerometer on I2C"),
    "potentiometer": ShippedPart(f"{_OWN}.panel:Potentiometer", "volts for the ADC"),
    "sd-card": ShippedPart(f"{_OWN}.sd_card:SdCard", "SD card on an SPI"),
    "servo": ShippedPart(f"{_OWN}.servo:Servo", "hobby servo"),
    "ssd1306": ShippedPart(f"{_OWN}.ssd1306:Ssd1306", "OLED, 128 by 64, on I2C or SPI"),
    "w25q16": ShippedPart(f"{_OWN}.spi_flash:SpiFlash", "SPI flash, 2 MiB"),
    "ws2812": ShippedPart(f"{_OWN}.ws2812:Ws2812", "string of LEDs on a pin or an SPI"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PartSpec:
    """What part is wanted, where, and how it is set."""

    #: A name, or "FILE.py:CLASS" as an admitted `simbase.trust.Code`.
    kind: str
    #: Keys and values: `on`, `select`, `name`, pins, and arguments of its class; texts, numbers, flags, lists.
    settings: tuple[tuple[str, object], ...] = ()
    #: Where its files are, or below; empty: anywhere, seen from the current folder.
    folder: str = ""


class Board(Protocol):
    """What a part is attached to."""

    def attach(
        self, part: object, *, on: str | None = None, select: str | None = None, name: str = "", **pins: str
    ) -> None:  # fmt: skip
        """Attach a part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """A part, and where it goes."""

    part: Any
    name: str
    on: str | None
    select: str | None
    pins: Mapping[str, str]


def parse_part(words: str) -> PartSpec:
    """Return what `--attach` asks for.

    Raises:
        PartError: It is not understood.
    """
    kind, *rest = words.split(",")
    settings: dict[str, object] = {}
    for pair in rest:
        key, equals, value = pair.partition("=")
        if not equals or not key or key in settings:
            raise PartError(
                f"--attach {shown(words)}: {shown(pair)} is no KEY=VALUE, or stands there twice", hint=_HINT
            )
        settings[key] = value
    if not kind:
        raise PartError(f"--attach {shown(words)} names no part", hint=_HINT)
    return PartSpec(kind=own_code(kind), settings=tuple(settings.items()))


def build(spec: PartSpec) -> Wiring:
    """Make a part.

    Raises:
        PartError: There is no such part, or it cannot be set so.
    """
    made = part_class(spec.kind)
    settings = dict(spec.settings)
    pins = {
        key: str(settings.pop(key)) for key in cast("Mapping[str, Use]", getattr(made, "PINS", {})) if key in settings
    }
    on, select = settings.pop("on", None), settings.pop("select", None)
    name = str(settings.pop("name", spec.kind.rpartition(":")[2] if ":" in spec.kind else spec.kind))
    arguments = _arguments_of(made, spec.kind)
    values = {}
    for key, value in settings.items():
        if key not in arguments:
            known = [*arguments, *getattr(made, "PINS", {}), "on", "select", "name"]
            raise PartError(
                f"the part {shown(spec.kind)} has no setting {shown(key)}", hint=f"known are {', '.join(known)}"
            )
        values[key] = _converted(value, arguments[key], f"{spec.kind}: {key}", spec.folder)
    try:
        part = made(**values)
    except PartError:
        raise
    except FileError as error:
        raise PartError(f"{spec.kind}: {error}", hint=error.hint) from error
    except OSError as error:
        raise PartError(f"{spec.kind}: {error.filename}: {error.strerror or error}") from error
    except Exception as error:  # whatever a class of the user's raises is one line here
        raise PartError(f"{spec.kind}: {said(error)}") from error
    return Wiring(part=part, name=name, on=_text(on), select=_text(select), pins=pins)


def attach(board: Board, spec: PartSpec) -> None:
    """Make a part and attach it to a board.

    Raises:
        PartError: There is no such part, or it cannot be set or attached so.
    """
    wiring = build(spec)
    board.attach(wiring.part, on=wiring.on, select=wiring.select, name=wiring.name, **wiring.pins)


def part_class(kind: str) -> Callable[..., Any]:
    """Return the class of a part.

    Raises:
        PartError: There is none, or its file cannot be loaded.
        UntrustedError: It is in a file, and was not admitted.
    """
    row = PARTS.get(kind.lower())
    if row is not None:
        module, _, name = row.target.partition(":")
        return cast("Callable[..., Any]", getattr(importlib.import_module(module), name))
    return find_class(kind, what="part", group=GROUP, known=list(PARTS), error=PartError)


def _arguments_of(made: Callable[..., Any], kind: str) -> dict[str, Any]:
    """Return the arguments of a part's class and their types."""
    try:
        signature = inspect.signature(made, eval_str=True)
    except (TypeError, ValueError, NameError) as error:
        raise PartError(f"{kind}: its arguments cannot be read: {error}") from error
    return {name: argument.annotation for name, argument in signature.parameters.items()}


def _converted(value: object, wanted: Any, where: str, folder: str) -> object:
    """Return a value as an argument's type: a text as it is typed, else what TOML holds."""
    if isinstance(wanted, types.UnionType) or typing.get_origin(wanted) is typing.Union:
        wanted = next(one for one in typing.get_args(wanted) if one is not type(None))
    try:
        if typing.get_origin(wanted) in {tuple, list}:
            inner = typing.get_args(wanted)[0]
            items = (
                value.split("+") if isinstance(value, str) else value if isinstance(value, list | tuple) else [value]
            )
            return tuple(_converted(item, inner, where, folder) for item in items)
        if wanted is bool:
            return value if isinstance(value, bool) else _FLAGS[str(value).lower()]
        if wanted is int:
            return int(value, 0) if isinstance(value, str) else _whole(value)
        if wanted is float:
            return float(cast("float | str", _no_flag(value)))
        if wanted in {Path, bytes}:
            path = _file(str(value), folder, where)
            return path if wanted is Path else read_bytes(path)
    except FileError as error:
        raise PartError(f"{where}: {error}", hint=error.hint) from error
    except (ValueError, KeyError, TypeError) as error:
        name = {bool: "true or false", int: "a whole number", float: "a number"}.get(wanted, "what it is to be")
        raise PartError(f"{where}: {shown(value)} is not {name}") from error
    return value


def _file(name: str, folder: str, where: str) -> Path:
    """Return the path of a file of a part; one that a scenario names is in the scenario's folder or below."""
    refused = partial(_refused, where)
    path = refuse_elsewhere(Path(folder), name, refused) if folder else Path(name)
    if path.exists() and not path.is_file():
        raise refused(f"{shown_name(name)} is no file")
    if path.exists() and path.stat().st_size > LARGEST_FILE_BYTES:
        raise refused(f"{shown_name(name)} is larger than {LARGEST_FILE_BYTES >> 20} MiB")
    return path


def _refused(where: str, message: str, *, hint: str | None = None) -> PartError:
    return PartError(f"{where}: {message}", hint=hint)


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(value)
    return value


def _no_flag(value: object) -> object:
    if isinstance(value, bool):
        raise TypeError(value)
    return value


def _text(value: object) -> str | None:
    return None if value is None else str(value)
