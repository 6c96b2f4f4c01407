"""Which lines, functions and branches of a firmware have run, from its blocks, its symbols and its DWARF.

A line has run when the first instruction of any of its rows has. A branch is
an instruction that leaves under a condition; its two ways are "taken" and
"fell through". What the compiler made conditional without a branch (IT blocks)
counts as one way. Branches are those of the machine: a `&&` of C is two of them.

Not shown: lines that gave no code, and branches of a jump table that nothing reached.
Code in SRAM is read when the counts are asked for, so what was written over since is not told apart.
Invariant: counts only grow; watching changes nothing.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from bluepill_sim.board import BluePill
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Image
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.program.static_code import StaticBlock, StaticCode
from simbase.timing import Nanos


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
    #: When each line that ran did so first, ns; 0 where that is not known.
    first_ns: dict[int, Nanos] = field(default_factory=dict)
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
    def one_way(self) -> list[tuple[int, BranchCount]]:
        """(line, branch) of what has run and always gone the same way."""
        rows = [(line, row) for line, found in sorted(self.branches.items()) for row in found]
        return [(line, row) for line, row in rows if bool(row.taken) is not bool(row.not_taken)]

    @property
    def missed_lines(self) -> list[int]:
        """Lines that have code and did not run."""
        return sorted(line for line, count in self.lines.items() if not count)


@dataclass(frozen=True, slots=True)
class OneWayBranch:
    """A conditional branch that has run and always gone the same way."""

    address: int
    times: int
    #: Where it went on; None through a register or the stack: a return.
    gone: int | None
    #: Where it never went on; None likewise.
    missed: int | None


@dataclass(frozen=True, slots=True)
class FunctionCoverage:
    """What has run of one function."""

    name: str
    address: int
    instructions: int
    instructions_hit: int
    calls: int
    ways: int
    ways_hit: int


class Coverage:
    """Counts what runs; a `BlockListener`.

    Args:
        image: The program.
        lines: Its lines.
        code: Its instructions.
        ns_of: Says when a cycle was, by the clock of now; None: when what ran first is not wanted.
    """

    def __init__(
        self, image: Image, lines: LineTable, code: StaticCode, ns_of: Callable[[int], Nanos] | None = None
    ) -> None:
        self._ns_of = ns_of
        self._image = image
        self._table = lines
        self._code = code
        self._functions = FunctionTable(image)
        #: How often each block was followed by each other.
        self._edges: Counter[tuple[int, int | None]] = Counter()
        #: When each was so first, ns.
        self._first_ns: dict[tuple[int, int | None], Nanos] = {}
        #: The block that ends with each conditional branch.
        self._conditional: dict[int, StaticBlock] = {}

    @classmethod
    def of_board(cls, board: BluePill, blocks: Iterable[int], ways: Iterable[tuple[int, bool]]) -> "Coverage":
        """Return what has run of a board's program where only that is known, not how often: each counts once.

        Args:
            board: Its program and its memory.
            blocks: As of `BluePill.entered_blocks`, of any number of runs.
            ways: As of `BluePill.gone_ways`.

        Raises:
            ImageError: As of `read_lines`.
        """
        found = cls(board.image, read_lines(board.image), StaticCode(board.chip.memory))
        by_end: dict[int, StaticBlock] = {}
        for start in blocks:
            block = found._code.block(start)
            found._edges[start, None] = 1
            if block.is_conditional:
                by_end[block.end] = block
        for end, is_elsewhere in ways:
            block_before = by_end.get(end)
            if block_before is not None:
                # Where it is a register that says where, any place but the end will do.
                following = (block_before.last.destination or 0) if is_elsewhere else end
                found._edges[block_before.start, following] = 1
        return found

    # As a `BlockListener`.

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:  # noqa: ARG002 - a listener
        """Count a block."""
        edge = address, following
        if self._ns_of is not None and edge not in self._edges:
            self._first_ns[edge] = self._ns_of(cycle)
        self._edges[edge] += 1

    def enter(self, number: int, cycle: int) -> None:
        """Exceptions count for nothing here."""

    def leave(self, cycle: int) -> None:
        """Exceptions count for nothing here."""

    def reset(self, cycle: int) -> None:
        """A reset goes on counting."""

    # The result.

    def instructions(self) -> dict[int, int]:
        """Return how often each instruction has run, by address."""
        counts: dict[int, int] = {}
        for (start, following), times in self._edges.items():
            for address in self._code.block(start).executed(following):
                counts[address] = counts.get(address, 0) + times
        return counts

    def first_ns(self) -> dict[int, Nanos]:
        """Return when each instruction that ran did so first, by address; 0 where that is not known."""
        found: dict[int, Nanos] = {}
        for edge in self._edges:
            at = self._first_ns.get(edge, 0)
            for address in self._code.block(edge[0]).executed(edge[1]):
                found[address] = min(at, found.get(address, at))
        return found

    def branches(self) -> dict[int, tuple[int, int]]:
        """Return (taken, not taken) of every conditional branch, by address."""
        counts: dict[int, tuple[int, int]] = {}
        for block in self._reachable().values():
            if block.is_conditional:
                counts[block.last.address] = (0, 0)
                self._conditional[block.last.address] = block
        for (start, following), times in self._edges.items():
            block = self._code.block(start)
            if not block.is_conditional or following is None or block.ends_before(following):
                continue
            taken, not_taken = counts.get(block.last.address, (0, 0))
            self._conditional[block.last.address] = block
            if following == block.end:
                counts[block.last.address] = taken, not_taken + times
            elif block.last.destination in (None, following):
                counts[block.last.address] = taken + times, not_taken
        return counts

    def one_way(self) -> list[OneWayBranch]:
        """Return the conditional branches that have run and gone one way only, by address."""
        found = []
        for address, (taken, not_taken) in sorted(self.branches().items()):
            if bool(taken) is not bool(not_taken):
                block = self._conditional[address]
                ways = (block.last.destination, block.end) if taken else (block.end, block.last.destination)
                found.append(OneWayBranch(address, taken + not_taken, *ways))
        return found

    @property
    def unreached(self) -> int:
        """How many conditional branches have not run at all."""
        return sum(1 for ways in self.branches().values() if not any(ways))

    def place(self, address: int) -> str:
        """Return "file.c:12", as far as is known: else "symbol+0x4 (0x08000100)", else the address alone."""
        return self._table.place(address) or self._image.symbols.where(address)

    def function_name(self, address: int) -> str:
        """Return the name of the function that an address is in."""
        return self._functions.name(address)

    @property
    def has_lines(self) -> bool:
        """Whether the program has debug information."""
        return bool(self._table.rows)

    def functions(self) -> list[FunctionCoverage]:
        """Return what has run of each function, by address; nothing where the file has no symbols."""
        counts, branches = self.instructions(), self.branches()
        there = {address for block in self._reachable().values() for address in block.addresses} | set(counts)
        inside: dict[int, list[int]] = {}
        for address in there:
            inside.setdefault(self._functions.start_of(address), []).append(address)
        found = []
        for function in self._functions.functions:
            own = inside.get(function.address, [])
            ways = [count for address in own for count in branches.get(address, ())]
            hit, ways_hit = (sum(1 for n in some if n) for some in ([counts.get(a, 0) for a in own], ways))
            calls = counts.get(function.address, 0)
            found.append(FunctionCoverage(function.name, function.address, len(own), hit, calls, len(ways), ways_hit))
        return found

    def blocks_of(self, file: str, line: int) -> frozenset[int]:
        """Return where blocks may start that execute the first instruction of a row of a line.

        Each instruction before it in its block may be a start: who has come from elsewhere begins there.
        """
        rows = {row.address for row in self._table.rows if (row.file, row.line) == (file, line)}
        found: set[int] = set()
        for block in self._reachable().values():
            for at in rows.intersection(block.addresses):
                found.update(address for address in block.addresses if address <= at)
        return frozenset(found)

    def pieces(self) -> list[tuple[int, int]]:
        """Return (first, address after) of each stretch of instructions that ran without a gap, by address."""
        found: list[tuple[int, int]] = []
        for start, following in sorted(self._edges, key=lambda edge: edge[0]):
            block = self._code.block(start)
            end = following if following is not None and block.ends_before(following) else block.end
            if found and start <= found[-1][1]:
                found[-1] = found[-1][0], max(end, found[-1][1])
            else:
                found.append((start, end))
        return found

    def _reachable(self) -> dict[int, StaticBlock]:
        entries = [function.address for function in self._functions.functions]
        entries += [start for start, _ in self._edges]
        return self._code.reachable(entries, self._functions.end_of)

    def files(self) -> list[FileCoverage]:
        """Return what has run of each source file, by name."""
        found: dict[str, FileCoverage] = {}
        counts, first_ns = self.instructions(), self.first_ns()
        for row in self._table.rows:
            file = found.setdefault(row.file, FileCoverage(row.file))
            file.lines[row.line] = max(file.lines.get(row.line, 0), counts.get(row.address, 0))
            if row.address in first_ns:
                at = first_ns[row.address]
                file.first_ns[row.line] = min(at, file.first_ns.get(row.line, at))
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
