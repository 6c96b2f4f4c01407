"""What a command line or a program may set otherwise than a scenario, and what the names stand for that both may give.

Invariant: options that were checked are of their types and in their ranges; whether one scenario can have them is its
own affair.
"""

import math
import numbers
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypedDict, get_args

from p2os.errors import ScenarioError
from p2os.pioneer.body.factory import body_class, may_ship
from p2os.pioneer.world import known_worlds, world_suffixes
from p2os.toml_file import is_file
from robot_bench.events.selection import BUSES
from robot_bench.scenario.sweep import LARGEST_SEED
from robot_bench.scenario.tables import Mode
from robot_bench.wires.line_ends import ENDS
from simbase.errors import UsageError, nearest, shown, shown_name
from simbase.trust import Code, own_code

MODES: tuple[str, ...] = get_args(Mode)


class ScenarioOptions(TypedDict, total=False):
    """What a command line or a program may set otherwise than a scenario; None keeps it as it is."""

    #: An ELF, HEX or BIN file.
    firmware: str | Path | None
    #: `adapter` or `direct`.
    mode: str | None
    #: `model`, `firmware`, or one of the user's.
    adapter_core: str | None
    #: `kinematic`, `bullet`, `mujoco`, `best`, or one of the user's.
    body: str | None
    #: A shipped world's name or a file.
    world: str | None
    #: Of everything random.
    seed: int | None
    #: Virtual time of the run, seconds.
    duration_s: float | None
    #: Speed of USART1's far end, bit/s.
    usart_baud: int | None
    #: Buses of the chip that are recorded besides: names of `selection.BUSES`, or one text with commas.
    record: str | Sequence[str] | None


_TEXT, _FILE, _WHOLE = ((str,), "text"), ((str, os.PathLike), "text or path"), ((numbers.Integral,), "whole number")
#: Option → what its value is, as types and in words.
_OPTION_TYPES: Mapping[str, tuple[tuple[type, ...], str]] = {
    "firmware": _FILE, "mode": _TEXT, "adapter_core": _TEXT, "body": _TEXT, "world": _FILE, "seed": _WHOLE,
    "duration_s": ((numbers.Real,), "number"), "usart_baud": _WHOLE,
}  # fmt: skip


def check_options(options: ScenarioOptions) -> None:
    """Refuse what no scenario can have.

    Raises:
        UsageError: There is no such option, or a value is of another type or out of range.
    """
    _check_types(options)
    mode, duration_s, seed = options.get("mode"), options.get("duration_s"), options.get("seed")
    if mode is not None and mode not in MODES:
        raise UsageError(f"there is no mode {mode!r}", hint=" or ".join(f"--mode {word}" for word in MODES))
    for what, key in (("body", options.get("body")), ("adapter", options.get("adapter_core"))):
        if key is not None:
            known_code(what, own_code(key))
    if duration_s is not None and not 0 < duration_s < math.inf:
        raise UsageError(f"a run of {duration_s:g} s cannot be", hint="--duration takes more than 0, such as 10s")
    if seed is not None and not 0 <= seed <= LARGEST_SEED:
        raise UsageError(f"{shown(seed)} is no seed", hint=f"a whole number from 0 to {LARGEST_SEED}")
    if (firmware := options.get("firmware")) and not Path(firmware).is_file():
        raise UsageError(f"there is no firmware file {firmware}", hint="give an ELF, HEX or BIN file")


def _check_types(options: ScenarioOptions) -> None:
    for name, value in options.items():
        if name not in ScenarioOptions.__annotations__:
            raise UsageError(f"there is no option {shown(name)}", hint=nearest(name, ScenarioOptions.__annotations__))
        if value is None or name not in _OPTION_TYPES:
            continue
        types, what = _OPTION_TYPES[name]
        if not isinstance(value, types) or isinstance(value, bool):
            raise UsageError(f"{name} = {shown(value)} is no {what}")


def resolve_world(
    world: str, folder: Path, where: str, *, error: type[ScenarioError | UsageError] = ScenarioError
) -> str:
    """Return a shipped world's name or the path of a world file.

    Raises:
        ScenarioError: There is no such world.
        UsageError: Likewise, where `error` says so.
    """
    if world in known_worlds():
        return world
    path = world_file(world, folder)
    if path is None:
        raise error(f"{where}: there is no world {shown(world)}", hint=nearest(world, known_worlds()))
    if not is_file(path):
        raise error(
            f"{where}: there is no world file {shown_name(path)}", hint=f"worlds that ship: {', '.join(known_worlds())}"
        )
    return str(path)


def world_file(world: str, folder: Path) -> Path | None:
    """Return the file that a world names, there or not; None where it is a word."""
    is_word = world in known_worlds() or Path(world).suffix.lower() not in world_suffixes()
    return None if is_word else folder / world


def listed(names: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return names that are given as a list, or as a text with commas."""
    if isinstance(names, str):
        return tuple(filter(None, (name.strip() for name in names.split(","))))
    return tuple(map(str, names or ()))


def buses(names: Sequence[str], where: str, error: type[ScenarioError | UsageError]) -> tuple[str, ...]:
    """Return buses, each once, in the order of the table; the error names one that there is not."""
    for name in names:
        if name not in BUSES:
            raise error(f"{where}: there is no bus {shown(name)}", hint=f"one of {', '.join(BUSES)}")
    return tuple(bus for bus in BUSES if bus in names)


def known_code(what: str, name: str) -> str:
    """Return the name of a body, adapter or controller; code that is only read is not looked into.

    Raises:
        UsageError: There is none, or its class lacks a method.
    """
    if is_of_users(what, name) and not (isinstance(name, Code) and name.is_unread):
        class_of_users(what, name)
    return name


def is_of_users(what: str, name: str) -> bool:
    """Tell whether a name is none of what ships."""
    return not may_ship(name) if what == "body" else name not in ENDS[what].ships


def class_of_users(what: str, name: str) -> Callable[..., object]:
    """Return the class that a name stands for.

    Raises:
        UsageError: There is none, or it lacks a method.
    """
    return body_class(name) if what == "body" else ENDS[what].check(name)
