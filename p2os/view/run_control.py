"""What a page may ask of a run that goes on, and how the run stands: small typed messages.

A page whose link may control sends one command at a time as JSON, known from a request by its `do`; the types of the
page in TypeScript are made of these classes (`tools/generators/page_types.py`). Times are ns of the run.

Invariant: a command is one of `COMMANDS`, with the fields that its row names and no others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast, get_args

from simbase.timing import NS_PER_MS, Nanos

#: What one step goes by.
StepUnit: TypeAlias = Literal["instruction", "line", "edge", "packet", "event", "millisecond"]
#: What is done.
Doing: TypeAlias = Literal[
    "run", "pause", "go", "step", "back", "speed", "fork", "choose", "drop", "compare", "halt_at", "halt_not_at",
    "watch", "watch_not", "hand", "drive", "stop", "save", "open",
]  # fmt: skip
#: chosen: words of a person in one line.
MOST_LETTERS = 400
#: chosen: virtual seconds a second; 0 stands for as fast as it goes.
SLOWEST, FASTEST = 0.01, 1000.0
#: chosen: a robot that is driven stands when nothing was heard of who drives it for so long: three messages of a page.
DRIVE_HOLD_NS: Nanos = 400 * NS_PER_MS
#: More is no speed of a small robot, m/s and deg/s.
MOST_MPS, MOST_DPS = 2.0, 360.0
_MOST_NS = 2**62


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCommand:
    """What a page asks of a run."""

    do: Doing
    #: From when on, ns; absent (None): from where the run stands.
    at_ns: Nanos | None = None
    unit: StepUnit = "event"
    #: Virtual seconds a second; 0: as fast as it goes.
    speed: float = 1.0
    #: Of `halt_at`: where; of `fork` and `hand`: what is done; of a step by edges: the wire; of `watch`: the variable;
    #: of `save`: as what.
    words: str = ""
    #: A future's name; of `fork` the one that it leaves, empty: the chosen one.
    future: str = ""
    #: Of several robots the one that `hand` and `drive` are for; empty: the only one, or the first.
    robot: str = ""
    #: Of a place to halt at, or of what is opened.
    number: int = 0
    #: Of `drive`: m/s ahead, and degrees a second counter-clockwise. It has to come again and again (`DRIVE_HOLD_NS`).
    forward_mps: float = 0.0
    turn_dps: float = 0.0


#: What is done → the fields that it may have.
COMMANDS: Mapping[str, frozenset[str]] = {
    "run": frozenset({"at_ns"}),
    "pause": frozenset(),
    "go": frozenset({"at_ns"}),
    "step": frozenset({"at_ns", "unit", "words"}),
    "back": frozenset({"at_ns", "unit", "words"}),
    "speed": frozenset({"speed"}),
    "fork": frozenset({"at_ns", "words"}),
    "choose": frozenset({"future"}),
    "drop": frozenset({"future"}),
    "compare": frozenset({"future"}),
    "hand": frozenset({"at_ns", "words", "robot"}),
    "drive": frozenset({"forward_mps", "turn_dps", "robot"}),
    "stop": frozenset(),
    "save": frozenset({"words"}),
    "halt_at": frozenset({"words"}),
    "halt_not_at": frozenset({"number"}),
    "watch": frozenset({"words"}),
    "watch_not": frozenset({"words"}),
    "open": frozenset({"number"}),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class HaltState:
    """A place where the run halts: a line, a variable, or an event in words."""

    number: int
    words: str
    #: How often it was halted at.
    count: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class HandState:
    """What a hand did, and when."""

    at_ns: Nanos
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PartingState:
    """Where a signal of two futures differs first."""

    signal: str
    at_ns: Nanos
    one: str
    other: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FutureState:
    """A future of the run."""

    name: str
    #: The `source` of its channels.
    source: str
    #: The one that it has left, and when; empty: it is the run itself.
    parent: str = ""
    at_ns: Nanos = 0
    #: Where it stands, and until when it is known.
    head_ns: Nanos = 0
    end_ns: Nanos = 0
    #: What was done where it begins.
    words: str = ""
    is_over: bool = False
    #: The one that it was compared with, until when, and the first differences, the earliest first.
    against: str = ""
    until_ns: Nanos = 0
    parting: Sequence[PartingState] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedRun:
    """A run that was made of what a report shows: how it stands, and where it is seen; empty: not yet, or nowhere."""

    number: int
    words: str
    url: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunState:
    """How a run stands."""

    is_running: bool = False
    #: Virtual seconds a second; 0: as fast as it goes.
    speed: float = 1.0
    #: Where the chosen future stands.
    head_ns: Nanos = 0
    #: Why it stands still, in a line.
    why: str = ""
    #: The source line that comes next, or the function; empty while it runs.
    place: str = ""
    #: What could not be done, and how many commands were done by then.
    trouble: str = ""
    done: int = 0
    #: The chosen future's name.
    future: str = ""
    futures: Sequence[FutureState] = ()
    halts: Sequence[HaltState] = ()
    #: Names of the program's variables that are watched: each is a channel.
    variables: Sequence[str] = ()
    #: How much was done by hand in the chosen future, and the last of it, the earliest first.
    hand_count: int = 0
    hands: Sequence[HandState] = ()
    #: Where hands were written down, in a line.
    saved: str = ""
    #: Of a report: what was opened of it.
    opened: Sequence[OpenedRun] = ()


class CommandError(Exception):
    """What a page sends is no command."""


def command_of(found: Mapping[str, object]) -> RunCommand:
    """Return a command out of JSON.

    Raises:
        CommandError: It is none.
    """
    do = found.get("do")
    if not isinstance(do, str) or do not in COMMANDS:
        raise CommandError(f"a command is one of {', '.join(COMMANDS)}")
    if unknown := found.keys() - COMMANDS[do] - {"do"}:
        raise CommandError(f"{do} has no {min(unknown)}")
    for key, value in found.items():
        if not _CHECKS[key](value):
            raise CommandError(f"{key} of {do} is out of its range")
    return RunCommand(**cast("dict[str, int]", dict(found)))  # type: ignore[arg-type]  # checked by now


def _is_text(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MOST_LETTERS and "\n" not in value


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < _MOST_NS


def _is_speed(value: object) -> bool:
    return _is_within(value, FASTEST) and (value == 0 or value >= SLOWEST)  # type: ignore[operator]  # a number by now


def _is_within(value: object, most: float) -> bool:
    """Tell whether it is a number no further from 0 than that."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= most


_CHECKS: Mapping[str, Callable[[object], bool]] = {
    "do": _is_text, "words": _is_text, "future": _is_text, "robot": _is_text, "speed": _is_speed,
    "at_ns": _is_count, "number": _is_count,
    "forward_mps": lambda value: _is_within(value, MOST_MPS), "turn_dps": lambda value: _is_within(value, MOST_DPS),
    "unit": lambda value: value in get_args(StepUnit),
}  # fmt: skip

__all__ = [
    "Doing",
    "FutureState",
    "HaltState",
    "HandState",
    "OpenedRun",
    "PartingState",
    "RunCommand",
    "RunState",
    "StepUnit",
]
