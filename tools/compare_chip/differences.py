"""What two runs of a program saw, compared: the first item that differs of each kind, with what stood before it.

A run is a folder of text files, one item a line (`probe.py`). Of `state`, whose lines are `name = value`, each name is
compared for itself, and a name that only the second run has is no difference: a newer chip has more registers.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

STATE = "state"
#: chosen: items before the first difference, and differing names of a state, that are shown.
BEFORE, MOST_NAMES = 2, 8
#: What differs on purpose since an older chip, and why: it is not compared.
EXPLAINED = {
    "last_pin_ns": "the boundary of the block that drove a pin last; it was exact where somebody listened",
}
#: An address in the flash that stands without its symbol.
_ADDRESS = re.compile(r"(?<!\()0x080[0-9a-f]{5}\b")


@dataclass(frozen=True, slots=True)
class ChipDifference:
    """How one kind of what was seen differs."""

    kind: str
    #: "1,234 alike, then" and the like.
    summary: str
    #: Lines that begin with "  " for both, "- " for the first run and "+ " for the second.
    lines: tuple[str, ...]

    def text(self, name_of: Callable[[str], str] = lambda address: address) -> str:
        """Return it for a person; `name_of` gives an address its symbol."""
        named = (_ADDRESS.sub(lambda found: name_of(found[0]), line) for line in self.lines)
        return "\n".join([f"{self.kind}: {self.summary}", *(f"  {line}" for line in named)])

    def addresses(self) -> set[str]:
        """Return the addresses of code that its lines name."""
        return {found for line in self.lines for found in _ADDRESS.findall(line)}


def compare(first: Path, second: Path, kinds: Iterable[str]) -> list[ChipDifference]:
    """Return how two runs differ, in the order of the kinds."""
    found = []
    for kind in kinds:
        one, other = first / kind, second / kind
        if one.read_bytes() == other.read_bytes():
            continue
        difference = difference_of_states(_named(one), _named(other)) if kind == STATE else _of_rows(kind, one, other)
        if difference is not None:
            found.append(difference)
    return found


def difference_of_states(first: Mapping[str, str], second: Mapping[str, str]) -> ChipDifference | None:
    """Return which names have other values; None where all of the first are there and the same."""
    names = [name for name, value in first.items() if second.get(name) != value and name not in EXPLAINED]
    if not names:
        return None
    lines = []
    for name in names[:MOST_NAMES]:
        lines += [f"- {name} = {first[name]}", f"+ {name} = {second.get(name, 'is not there')}"]
    if len(names) > MOST_NAMES:
        lines.append(f"  and {len(names) - MOST_NAMES} more: {', '.join(names[MOST_NAMES : 2 * MOST_NAMES])}")
    return ChipDifference(STATE, f"{len(names)} of {len(first)} differ", tuple(lines))


def _of_rows(kind: str, first: Path, second: Path) -> ChipDifference:
    before: list[str] = []
    with first.open(encoding="utf-8") as one, second.open(encoding="utf-8") as other:
        for count, (row, twin) in enumerate(zip_longest(one, other)):
            if row != twin:
                lines = [f"  {line}" for line in before]
                lines += [
                    f"{sign} {'(no more)' if line is None else line.rstrip()}"
                    for sign, line in (("-", row), ("+", twin))
                ]
                return ChipDifference(kind, f"{count:,} alike, then", tuple(lines))
            before = [*before[1 - BEFORE :], row.rstrip()] if BEFORE else []
    raise ValueError(f"{first} and {second} differ in bytes, not in lines")


def _named(file: Path) -> dict[str, str]:
    return dict(
        line.rstrip("\n").split(" = ", 1) for line in file.read_text(encoding="utf-8").splitlines() if " = " in line
    )
