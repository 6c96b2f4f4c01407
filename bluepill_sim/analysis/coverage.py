"""Which lines and branches of a firmware have run, from its blocks and its DWARF.

A line has run when the first instruction of any of its rows has. A branch is
an instruction that leaves under a condition; its two ways are "taken" and
"fell through". What the compiler made conditional without a branch (IT blocks)
counts as one way.

Not shown: lines that gave no code, and branches of a jump table that nothing reached.
Invariant: counts only grow; watching changes nothing.
"""

from collections import Counter
from dataclasses import dataclass, field

from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Image
from bluepill_sim.program.line_table import LineTable
from bluepill_sim.program.static_code import StaticCode


@dataclass(frozen=True, slots=True)
class BranchCount:
    """One conditional branch of a line."""

    address: int
    taken: int
    not_taken: int


@dataclass(slots=True)
class FileCoverage:
    """What has run of one source file."""

    name: str
    #: Executions by line, for every line that has code.
    lines: dict[int, int] = field(default_factory=dict)
    #: Branches by line.
    branches: dict[int, list[BranchCount]] = field(default_factory=dict)
    #: (name, line, calls) of each function.
    functions: list[tuple[str, int, int]] = field(default_factory=list)

    @property
    def lines_hit(self) -> int:
        """How many lines have run."""
        return sum(1 for count in self.lines.values() if count)

    @property
    def ways(self) -> list[int]:
        """How often each way of each branch was gone."""
        return [count for rows in self.branches.values() for row in rows for count in (row.taken, row.not_taken)]

    @property
    def missed_lines(self) -> list[int]:
        """Lines that have code and did not run."""
        return sorted(line for line, count in self.lines.items() if not count)


class Coverage:
    """Counts what runs; a `BlockListener`."""

    def __init__(self, image: Image, lines: LineTable, code: StaticCode) -> None:
        self._table = lines
        self._code = code
        self._functions = FunctionTable(image)
        #: How often each block was followed by each other.
        self._edges: Counter[tuple[int, int | None]] = Counter()

    # As a `BlockListener`.

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:  # noqa: ARG002 - a listener
        """Count a block."""
        self._edges[address, following] += 1

    def enter(self, number: int, cycle: int) -> None:
        """Exceptions count for nothing here."""

    def leave(self, cycle: int) -> None:
        """Exceptions count for nothing here."""

    # The result.

    def instructions(self) -> dict[int, int]:
        """Return how often each instruction has run, by address."""
        counts: dict[int, int] = {}
        for (start, following), times in self._edges.items():
            for address in self._code.block(start).executed(following):
                counts[address] = counts.get(address, 0) + times
        return counts

    def branches(self) -> dict[int, tuple[int, int]]:
        """Return (taken, not taken) of every conditional branch, by address."""
        counts: dict[int, tuple[int, int]] = {}
        entries = [function.address for function in self._functions.functions]
        entries += [start for start, _ in self._edges]
        for block in self._code.reachable(entries, self._functions.end_of).values():
            if block.is_conditional:
                counts[block.last.address] = (0, 0)
        for (start, following), times in self._edges.items():
            block = self._code.block(start)
            if not block.is_conditional or following is None or block.ends_before(following):
                continue
            taken, not_taken = counts.get(block.last.address, (0, 0))
            if following == block.end:
                counts[block.last.address] = taken, not_taken + times
            else:
                counts[block.last.address] = taken + times, not_taken
        return counts

    def files(self) -> list[FileCoverage]:
        """Return what has run of each source file, by name."""
        found: dict[str, FileCoverage] = {}
        counts = self.instructions()
        for row in self._table.rows:
            file = found.setdefault(row.file, FileCoverage(row.file))
            file.lines[row.line] = max(file.lines.get(row.line, 0), counts.get(row.address, 0))
        for address, (taken, not_taken) in sorted(self.branches().items()):
            place = self._table.at(address)
            if place is not None:
                rows = found[place.file].branches.setdefault(place.line, [])
                rows.append(BranchCount(address, taken, not_taken))
        for function in self._functions.functions:
            place = self._table.at(function.address)
            if place is not None:
                calls = counts.get(function.address, 0)
                found[place.file].functions.append((function.name, place.line, calls))
        return [found[name] for name in sorted(found)]
