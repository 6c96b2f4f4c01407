"""Where a run halts: a source line, a variable, or an event in words; and what a step goes by.

    line dodge.c:42               before the first instruction of the line, each time
    variable state.count          after an instruction that writes to it (names as of `bluepill_sim.program.variables`)
    pin PB12 high                 any words of `robot_bench.events.selection`: pins, packets, goals, places, texts

Invariant: what a point says of a run depends on the run alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.core import Watchpoint
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.program.variables import read_variables
from robot_bench.events.kinds import (
    Contact,
    Event,
    Fault,
    Note,
    Packet,
    PinEdge,
    Text,
    Verdict,
    WorldChange,
)
from robot_bench.events.selection import SELECTORS, Selector, Wires, bus_of, select
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError, nearest, shown

USAGE = ("line FILE:LINE", "variable NAME")
#: What happens that a person calls an event.
_EVENTS = (Note, Contact, Fault, Verdict, WorldChange, Text)


@dataclass(frozen=True, slots=True, kw_only=True)
class HaltPoint:
    """One place: addresses that the chip stops before, bytes whose change stops it, or what picks events."""

    words: str
    breakpoints: frozenset[int] = frozenset()
    watched: frozenset[Watchpoint] = frozenset()
    selector: Callable[[], Selector] | None = None


def point_of(words: str, board: BluePill, scenario: Scenario, wires: Wires | None) -> HaltPoint:
    """Return the place that a line of words means.

    Raises:
        UsageError: There is no such line, variable or event; the hint says what is nearest.
    """
    first, _, rest = words.strip().partition(" ")
    if first == "line":
        return HaltPoint(words=words, breakpoints=_line(rest.strip(), read_lines(board.image)))
    if first == "variable":
        return HaltPoint(words=words, watched=frozenset({_variable(rest.strip(), board)}))
    if first not in SELECTORS:
        usages = {usage.split()[0]: usage for usage in USAGE} | {name: usage for name, (usage, _) in SELECTORS.items()}
        raise UsageError(f"there is no place {shown(words)}", hint=nearest(first, usages, "; ".join(usages.values())))
    select(words, wires)
    if (bus := bus_of(words)) and bus not in scenario.record:
        raise UsageError(f"{bus} is not recorded", hint=f"--record {bus}")
    return HaltPoint(words=words, selector=lambda: select(words, wires))


def _line(place: str, table: LineTable) -> frozenset[int]:
    """Return where the code of a line begins: of each run of its instructions the first one.

    Raises:
        UsageError: The program has none there.
    """
    name, _, number = place.rpartition(":")
    if not name or not number.isdecimal():
        raise UsageError(f"{shown(place)} is no line", hint="line FILE:LINE, such as line dodge.c:42")
    of_file = [row for row in table.rows if row.file == name or row.file.rsplit("/", 1)[-1] == name]
    if not of_file:
        files = {row.file.rsplit("/", 1)[-1]: 0 for row in table.rows}
        hint = nearest(name, files) if files else "the program has no debug information: build it with -g"
        raise UsageError(f"no source file {shown(name)}", hint=hint)
    found = frozenset(row.address for row in of_file if row.line == int(number))
    if not found:
        closest = min({row.line for row in of_file}, key=lambda line: (abs(line - int(number)), line))
        raise UsageError(f"{place} has no code", hint=f"line {name}:{closest} has")
    return found


def _variable(name: str, board: BluePill) -> Watchpoint:
    """Return what watches the writes to a variable of static duration, or to a part of one.

    Raises:
        UsageError: There is none of that name.
    """
    address, found, _ = read_variables(board.image).place(name)
    return Watchpoint(address, found.size)


def other_lines(board: BluePill) -> frozenset[int]:
    """Return where the code of each line begins but that of the one that the program stands in."""
    table = read_lines(board.image)
    here = table.at(board.pc)
    return frozenset(
        row.address for row in table.rows if here is None or (row.file, row.line) != (here.file, here.line)
    )


class _Any(Selector):
    """Picks every event of some kinds."""

    def __init__(self, words: str, *kinds: type) -> None:
        super().__init__(words)
        self.kinds = kinds

    def takes(self, event: Event) -> bool:
        return not isinstance(event, PinEdge) or event.t > 0


#: What one steps by → what picks the events.
STEPS: Mapping[str, Callable[[str, Wires | None], Selector]] = {
    "edge": lambda wire, wires: select(f"pin {wire} changes", wires) if wire else _Any("edge", PinEdge),
    "packet": lambda _wire, _wires: _Any("packet", Packet),
    "event": lambda _wire, _wires: _Any("event", *_EVENTS),
}
