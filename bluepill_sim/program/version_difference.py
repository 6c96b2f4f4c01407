"""Where two versions of a program differ, by instruction, whatever else has moved in the flash.

Functions are paired by name, and their instructions aligned. What follows from an address alone (the offset of a
branch or a call, a pointer in a literal pool) is compared by what it leads to: the instruction, the symbol, the text.

Of a difference the source lines are known by what each line of a function came to: a line whose instructions are the
same but for the registers that the compiler chose has not changed, whatever has changed around it. Where all lines are
the same in that sense, one with other registers differs if it is the only one: it takes another variable.

Invariant: a program does not differ from itself, nor from itself linked elsewhere.
"""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher

from bluepill_sim.core.thumb import Instruction, decode
from bluepill_sim.extension.encodings import Kind, find
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Image, Symbol
from bluepill_sim.program.line_table import LineRow, LineTable, read_lines
from bluepill_sim.stm32f103 import SRAM_BASE, may_hold_code

#: Bits of a branch that are no offset, by its size and what marks it.
_CBZ, _CONDITIONAL = (0xF500, 0xB100), (0xF000, 0xD000)
#: What a compiler leaves out where nothing takes its result.
_COMPUTES = frozenset({
    Kind.PLAIN, Kind.MULTIPLY_ACCUMULATE, Kind.MULTIPLY_LONG, Kind.MULTIPLY_ACCUMULATE_LONG, Kind.DIVIDE, Kind.LOAD,
    Kind.LOAD_LITERAL, Kind.LOAD_DUAL, Kind.IF_THEN,
})  # fmt: skip
#: chosen: so much of a text tells it from others.
_TEXT_BYTES = 24


@dataclass(frozen=True, slots=True)
class CodeDifference:
    """A place where two versions of a function differ: the addresses of its instructions in each; empty where none."""

    function: str
    ours: tuple[int, ...]
    theirs: tuple[int, ...]
    #: Where it stands, in the version that has no instruction there: the address of what comes next.
    before: int = 0


@dataclass(frozen=True, slots=True)
class LineDifference:
    """Lines of a function, in a row, that came to other code in two versions."""

    function: str
    #: (file, line) of each with code, in our version and in theirs.
    ours: tuple[tuple[str, int], ...]
    theirs: tuple[tuple[str, int], ...]
    #: Whether one of their lines that has no code in ours does more than compute. One that only computes may have none
    #: because what takes its result is another.
    missing_acts: bool = True
    #: Whether they are the function's first and last alone: which registers are saved follows from all between.
    is_edge: bool = False
    #: Whether the same instructions take other numbers, be they written there or in a macro that is used there.
    is_number: bool = False

    @property
    def missing(self) -> int:
        """How many of their lines have no code in ours."""
        return len(set(self.theirs) - set(self.ours))


def line_differences(ours: Image, theirs: Image) -> list[LineDifference]:
    """Return the lines that differ, of functions that both have; none where one has no debug information.

    A function that ours has no code of is among them where some of its lines have code elsewhere: it is not left out
    but empty, or part of others.

    Raises:
        ImageError: The debug information of one is damaged.
    """
    mine, other, tables = _Version(ours), _Version(theirs), (read_lines(ours), read_lines(theirs))
    found, differences = [], _differences(mine, other)
    for name in dict.fromkeys(one.function for one in differences):
        pair = mine.functions.get(name), other.functions.get(name)
        if pair[0] is None and pair[1] is not None and (gone := _emptied(pair[1], tables)):
            found.append(LineDifference(name, (), gone))
        if pair[0] is None or pair[1] is None:
            continue
        one, two = (_by_line(version, table) for version, table in zip(pair, tables, strict=True) if version)
        edges = {rows[end][0] for rows in (one, two) for end in (0, -1) if rows}
        acting = {_place(tables[1], at) for at in pair[1].acts}
        matcher = SequenceMatcher(None, [code for _, code in one], [code for _, code in two], autojunk=False)
        for tag, i0, i1, j0, j1 in matcher.get_opcodes():
            if tag != "equal":
                at, there = (tuple(place for place, _ in rows) for rows in (one[i0:i1], two[j0:j1]))
                missing_acts = not acting.isdisjoint(set(there) - set(at))
                is_number = _without_numbers(one[i0:i1]) == _without_numbers(two[j0:j1])
                found.append(LineDifference(name, at, there, missing_acts, edges.issuperset(at + there), is_number))
    return found or _by_registers(differences, tables)


def code_differences(ours: Image, theirs: Image) -> list[CodeDifference]:
    """Return where the functions of two versions differ, those of only one of them too, by our addresses."""
    return _differences(_Version(ours), _Version(theirs))


def _differences(mine: "_Version", other: "_Version") -> list[CodeDifference]:
    found: list[CodeDifference] = []
    for name in dict.fromkeys([*mine.functions, *other.functions]):
        pair = one, two = mine.functions.get(name), other.functions.get(name)
        if one is None or two is None:
            mine_alone, theirs_alone = (() if one is None else tuple(one.addresses) for one in pair)
            found.append(CodeDifference(name, mine_alone, theirs_alone))
        else:
            found += _within(name, one, two)
    return sorted(found, key=lambda one: (one.ours or (one.before,))[:1])


@dataclass(frozen=True, slots=True)
class _Function:
    """A function's instructions, each with what it is compared by, and where its branches lead."""

    addresses: Sequence[int]
    tokens: Sequence[object]
    #: The same, whichever registers they use.
    plain: Sequence[str]
    #: Address of a branch within it → that of its target.
    targets: dict[int, int]
    #: Addresses of instructions that do more than compute: stores, calls, what leaves the function or waits.
    acts: set[int]
    end: int


class _Version:
    """The functions of an image."""

    def __init__(self, image: Image) -> None:
        self._image, self._table = image, FunctionTable(image)
        self._symbols = sorted(image.symbols.symbols, key=lambda symbol: symbol.address)
        self._starts = [symbol.address for symbol in self._symbols]
        self.functions = {symbol.name: self._read(symbol) for symbol in self._table.functions}

    def _read(self, symbol: Symbol) -> _Function:
        start, end = symbol.address & ~1, self._table.end_of(symbol.address) or symbol.address
        code = self._bytes(start, end - start)
        pool = len(code)
        addresses, tokens, plain, targets = list[int](), list[object](), list[str](), dict[int, int]()
        acts = set[int]()
        offset = 0
        while offset + 2 <= pool:
            one = decode(code, offset, start + offset)
            word = int.from_bytes(code[offset : offset + 2], "little")
            if one.size == 4:
                word = word << 16 | int.from_bytes(code[offset + 2 : offset + 4], "little")
            literal = self._literal(one, word)
            if literal is not None:
                if start <= literal < start + len(code):
                    pool = min(pool, literal - start)
                tokens.append(("literal", one.target, self._meaning(literal)))
                plain.append(f"literal {self._meaning(literal)}")
            elif one.destination is not None:
                if start <= one.destination < end:
                    targets[one.address] = one.destination
                    tokens.append(("branch", _without_offset(one, word)))
                else:
                    tokens.append((_without_offset(one, word), self._table.name(one.destination)))
                plain.append(str(tokens[-1]))
            else:
                tokens.append(word)
                plain.append(_without_registers(one, word))
            if one.kind not in _COMPUTES and one.address not in targets:
                acts.add(one.address)
            addresses.append(one.address)
            offset += one.size
        return _Function(addresses, tokens, plain, targets, acts, start + pool)

    def _literal(self, one: Instruction, word: int) -> int | None:
        """Return the address that an instruction loads from beside the code; None where it does not."""
        if one.kind is not Kind.LOAD_LITERAL:
            return None
        base = (one.address + 4) & ~3
        if one.size == 2:
            return base + (word & 0xFF) * 4
        return base + (word & 0xFFF) * (1 if word >> 23 & 1 else -1)

    def _meaning(self, address: int) -> object:
        """Return what a word of a literal pool stands for: a symbol, a text, or the number itself."""
        value = int.from_bytes(self._bytes(address, 4), "little")
        if not may_hold_code(value):
            return value
        place = bisect_right(self._starts, value) - 1
        symbol = self._symbols[place] if place >= 0 else None
        if symbol is not None and value < symbol.address + max(symbol.size, 1):
            return symbol.name, value - symbol.address
        return self._bytes(value, _TEXT_BYTES).partition(b"\0")[0] if value < SRAM_BASE else "SRAM"

    def _bytes(self, address: int, size: int) -> bytes:
        for start, data in self._image.segments:
            if start <= address < start + len(data):
                return bytes(data[address - start : address - start + size])
        return b""


def _without_offset(one: Instruction, word: int) -> int:
    """Return a branch or call without how far it goes."""
    if one.size == 4:
        return word & (0xF800_D000 if word & 0x1000 or one.kind is Kind.CALL else 0xFBC0_D000)
    if word & _CBZ[0] == _CBZ[1]:
        return word & 0xFD07
    return word & 0xFF00 if word & _CONDITIONAL[0] == _CONDITIONAL[1] else word & 0xF800


def _without_registers(one: Instruction, word: int) -> str:
    """Return what an instruction does, whichever registers it uses."""
    row = find(word, is_wide=one.size == 4)
    if row is None:
        return hex(word)
    rest = {letter: value for letter, value in row.values(word).items() if f"<{letter}>" not in row.syntax}
    return f"{row.operation} {rest}"


def _by_line(version: _Function, table: LineTable) -> list[tuple[tuple[str, int], tuple[str, ...]]]:
    """Return the lines that a function has code of, in their order, each with what it came to."""
    found: dict[tuple[str, int], list[str]] = {}
    for address, plain in zip(version.addresses, version.plain, strict=True):
        place = _place(table, address)
        if place is not None:
            found.setdefault(place, []).append(plain)
    return sorted((place, tuple(sorted(code))) for place, code in found.items())


def _without_numbers(rows: Sequence[tuple[tuple[str, int], tuple[str, ...]]]) -> list[list[str]]:
    """Return what the lines came to, without the numbers of instructions that neither branch nor call."""
    return [[plain if plain.startswith("(") else plain.partition(" ")[0] for plain in code] for _, code in rows]


def _emptied(gone: _Function, tables: tuple[LineTable, LineTable]) -> tuple[tuple[str, int], ...]:
    """Return the lines of a function that ours lacks, where ours has code of a line of it; none where it has not."""
    places = [place for at in gone.addresses if (place := _place(tables[1], at)) is not None]
    if not places:
        return ()
    file = places[-1][0]  # where it ends; it may begin with what is inlined from a header
    own = sorted({line for name, line in places if name == file})
    ours = set(map(_place_of, tables[0].rows))
    is_there = any((file, line) in ours for line in range(own[0], own[-1] + 1))
    return tuple(sorted(set(places))) if is_there else ()


def _by_registers(differences: Sequence[CodeDifference], tables: tuple[LineTable, LineTable]) -> list[LineDifference]:
    """Return the line that all differences are of; none where they are of several, or one has none."""
    found = {
        (one.function, tuple({_place(table, at) for at in side}))
        for one in differences
        for side, table in zip((one.ours, one.theirs), tables, strict=True)
    }
    if len(found) != 1:
        return []
    function, places = found.pop()
    lines = tuple(place for place in places if place is not None)
    return [LineDifference(function, lines, lines)] if len(lines) == len(places) == 1 else []


def _place(table: LineTable, address: int) -> tuple[str, int] | None:
    row = table.at(address)
    return None if row is None else _place_of(row)


def _place_of(row: LineRow) -> tuple[str, int]:
    return row.file.rsplit("/", 1)[-1], row.line


def _within(name: str, one: _Function, two: _Function) -> Iterator[CodeDifference]:
    matcher = SequenceMatcher(None, one.tokens, two.tokens, autojunk=False)
    pairs: dict[int, int] = {one.end: two.end}
    for tag, i0, i1, j0, j1 in matcher.get_opcodes():
        if tag == "equal":
            pairs |= dict(zip(one.addresses[i0:i1], two.addresses[j0:j1], strict=True))
        else:
            before = one.addresses[i0] if i0 < len(one.addresses) else one.end
            yield CodeDifference(name, tuple(one.addresses[i0:i1]), tuple(two.addresses[j0:j1]), before)
            # What jumps over it lands behind it in both.
            pairs.setdefault(before, two.addresses[j0] if j0 < len(two.addresses) else two.end)
    for address, target in one.targets.items():
        other = pairs.get(address)
        if other in two.targets and target in pairs and pairs[target] != two.targets[other]:
            yield CodeDifference(name, (address,), (other,), address)
