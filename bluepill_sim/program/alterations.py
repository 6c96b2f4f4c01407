"""What can be made wrong in one instruction: the changes of mutation testing, for Thumb-2.

A row a shape of an encoding: its fixed bits, and what makes the changes. Each change keeps the instruction's length,
so nothing else of the program moves. Both sides of a change are said as the assembler takes them.

    branch      the condition inverted; gone always; gone never
    condition   the neighbour at the boundary: hi for hs, gt for ge, ls for lo, le for lt, and back
    immediate   the next greater and the next smaller number that the encoding has, of CMP, CMN, MOV, ADD, SUB
    sign        ADD for SUB, MOV of -n for n, and what RSB negates left as it is

Not changed: additions to the stack pointer and the PC, and MOVW beside its MOVT: they make addresses, and a program
with a wrong one crashes. Constants in literal pools and tables are data, and stay.

Source: ARM DDI 0403E.e (ARMv7-M) A5.2, A5.3, A6.7.
Invariant: a change is a legal instruction where the one that it stands for was.
"""

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

#: Kinds of changes, in the order in which they are told.
OPERATORS = ("branch", "condition", "immediate", "sign")
#: DDI 0403E table A6-1; 14 is "always".
CONDITIONS = ("eq", "ne", "hs", "lo", "mi", "pl", "vs", "vc", "hi", "ls", "ge", "lt", "gt", "le")
_ALWAYS = 14
#: The condition that differs at one value alone: unsigned and signed, strict or not.
_AT_BOUNDARY = {2: 8, 8: 2, 3: 9, 9: 3, 10: 12, 12: 10, 11: 13, 13: 11}
_NOP, _NOP_WIDE = 0xBF00, 0xF3AF_8000
_SP, _PC = 13, 15
_WORD = 0xFFFF_FFFF
#: First halfwords from here on begin a 32-bit instruction.
_FIRST_WIDE = 0xE800


@dataclass(frozen=True, slots=True)
class Alteration:
    """One change of one instruction."""

    #: One of `OPERATORS`.
    operator: str
    #: The instruction in its place; as long as the one that stood there.
    code: bytes
    #: Both in the assembler's words.
    before: str
    after: str


@dataclass(frozen=True, slots=True)
class Site:
    """An instruction, and what around it decides how it may be changed."""

    word: int
    address: int
    #: An IT before it makes it conditional: there narrow arithmetic leaves the flags alone.
    is_in_it: bool = False
    #: Of an IT: how many bytes the instructions take that it makes conditional.
    it_bytes: int = 0
    #: Of a MOVW: the upper half of a number that MOVT completes is its neighbour.
    is_half: bool = False


#: (operator, the instruction in its place, before, after)
_Change = tuple[str, int, str, str]
_Make = Callable[[Site], Iterator[_Change]]


def alterations(code: bytes, site: Site) -> list[Alteration]:
    """Return every change of an instruction, those of one operator beside each other.

    Args:
        code: The instruction's bytes, 2 or 4.
        site: The same as a word (the first halfword in the upper half of 32 bits), with its surroundings.
    """
    found = [
        Alteration(operator, _bytes(word, len(code)), before, after)
        for operator, word, before, after in _changes(site, _WIDE if len(code) == 4 else _NARROW)
        if word != site.word
    ]
    return sorted(found, key=lambda one: OPERATORS.index(one.operator))


def word_of(code: bytes) -> int:
    """Return an instruction of 2 or 4 bytes as a word, the first halfword in the upper half."""
    first = int.from_bytes(code[:2], "little")
    return first if len(code) == 2 else first << 16 | int.from_bytes(code[2:], "little")


def size_at(first: int) -> int:
    """Return the bytes of an instruction that begins with a halfword."""
    return 4 if first >= _FIRST_WIDE else 2


def _bytes(word: int, size: int) -> bytes:
    if size == 2:
        return word.to_bytes(2, "little")
    return (word >> 16).to_bytes(2, "little") + (word & 0xFFFF).to_bytes(2, "little")


def _changes(site: Site, table: "tuple[tuple[int, int, _Make], ...]") -> Iterator[_Change]:
    for mask, value, make in table:
        if site.word & mask == value:
            yield from make(site)
            return


# Branches.


def _conditional(condition: int, replaced: Callable[[int], int], always: int, never: int, suffix: str, to: str
                 ) -> Iterator[_Change]:  # fmt: skip
    if condition >= _ALWAYS:
        return
    before = f"b{CONDITIONS[condition]}{suffix} {to}"
    yield "branch", replaced(condition ^ 1), before, f"b{CONDITIONS[condition ^ 1]}{suffix} {to}"
    yield "branch", always, before, f"b{suffix} {to}"
    yield "branch", never, before, f"nop{suffix}"
    other = _AT_BOUNDARY.get(condition)
    if other is not None:
        yield "condition", replaced(other), before, f"b{CONDITIONS[other]}{suffix} {to}"


def _narrow_branch(site: Site) -> Iterator[_Change]:
    offset = _signed(site.word & 0xFF, 8)
    return _conditional(
        site.word >> 8 & 15, lambda condition: site.word & 0xF0FF | condition << 8, 0xE000 | offset & 0x7FF, _NOP, "",
        _target(site, 2 * offset),
    )  # fmt: skip


def _wide_branch(site: Site) -> Iterator[_Change]:
    word = site.word
    sign, j1, j2 = word >> 26 & 1, word >> 13 & 1, word >> 11 & 1
    offset = _signed(sign << 20 | j2 << 19 | j1 << 18 | (word >> 16 & 0x3F) << 12 | (word & 0x7FF) << 1, 21)
    far = offset & 0x1FF_FFFF
    i1, i2 = far >> 23 & 1, far >> 22 & 1
    always = (
        0xF000_9000 | sign << 26 | (far >> 12 & 0x3FF) << 16 | (i1 ^ 1 ^ sign) << 13 | (i2 ^ 1 ^ sign) << 11
        | far >> 1 & 0x7FF
    )  # fmt: skip
    return _conditional(
        word >> 22 & 15, lambda condition: word & ~(15 << 22) | condition << 22, always, _NOP_WIDE, ".w",
        _target(site, offset),
    )  # fmt: skip


def _compare_and_branch(site: Site) -> Iterator[_Change]:
    word = site.word
    offset = (word >> 3 & 0x1F) << 1 | (word >> 9 & 1) << 6
    names, operands = ("cbz", "cbnz"), f"{_r(word & 7)}, {_target(site, offset)}"
    is_inverted = word >> 11 & 1
    before = f"{names[is_inverted]} {operands}"
    yield "branch", word ^ 0x800, before, f"{names[1 - is_inverted]} {operands}"
    yield "branch", 0xE000 | offset >> 1, before, f"b {_target(site, offset)}"
    yield "branch", _NOP, before, "nop"


def _if_then(site: Site) -> Iterator[_Change]:
    condition, mask = site.word >> 4 & 15, site.word & 15
    if condition >= _ALWAYS or not mask:
        return
    lowest = mask & -mask
    before = _it_words(condition, mask)
    flipped = mask ^ (15 & ~(lowest - 1) & ~lowest)
    yield "branch", 0xBF00 | (condition ^ 1) << 4 | flipped, before, _it_words(condition ^ 1, flipped)
    if mask & ~lowest & 15 == (15 & ~(lowest - 1) & ~lowest if condition & 1 else 0):  # all of them "then"
        yield "branch", 0xBF00 | _ALWAYS << 4 | lowest, before, _it_words(_ALWAYS, lowest)
        yield "branch", 0xE000 | (site.it_bytes - 2) // 2 & 0x7FF, before, f"b {_target(site, site.it_bytes - 2)}"
    other = _AT_BOUNDARY.get(condition)
    if other is not None:
        yield "condition", 0xBF00 | other << 4 | mask, before, _it_words(other, mask)


def _it_words(condition: int, mask: int) -> str:
    """Return an IT as the assembler writes it: "ite hi"."""
    count = it_count(mask)
    letters = "".join("t" if mask >> (3 - n) & 1 == condition & 1 else "e" for n in range(count - 1))
    return f"it{letters} {'al' if condition == _ALWAYS else CONDITIONS[condition]}"


def it_count(mask: int) -> int:
    """Return how many instructions an IT with this mask, 1 to 15, makes conditional."""
    return 4 - ((mask & -mask).bit_length() - 1)


# Numbers in narrow instructions.


def _narrow_number(name: str, most: int, at: int, registers: Callable[[int], str], flips: tuple[str, int] | None = None
                   ) -> _Make:  # fmt: skip
    """Return what changes a plain number of a narrow instruction, and adds for subtracts where `flips` says how."""

    def make(site: Site) -> Iterator[_Change]:
        word, number = site.word, site.word >> at & most
        flags = "" if site.is_in_it or name == "cmp" else "s"
        head = registers(word)
        before = f"{name}{flags} {head}, #{number}"
        for other in (number + 1, number - 1):
            if 0 <= other <= most:
                yield "immediate", word & ~(most << at) | other << at, before, f"{name}{flags} {head}, #{other}"
        if flips is not None and number:
            yield "sign", word ^ flips[1], before, f"{flips[0]}{flags} {head}, #{number}"

    return make


def _narrow_sum(name: str, other: str) -> _Make:
    def make(site: Site) -> Iterator[_Change]:
        word, flags = site.word, "" if site.is_in_it else "s"
        operands = f"{_r(word & 7)}, {_r(word >> 3 & 7)}, {_r(word >> 6 & 7)}"
        yield "sign", word ^ 0x200, f"{name}{flags} {operands}", f"{other}{flags} {operands}"

    return make


def _narrow_negate(site: Site) -> Iterator[_Change]:
    target, source = site.word & 7, site.word >> 3 & 7
    flags = "" if site.is_in_it else "s"
    # MOVS of two low registers is not allowed where an IT is in force.
    moved = 0x4600 | source << 3 | target if site.is_in_it else source << 3 | target
    operands = f"{_r(target)}, {_r(source)}"
    yield "sign", moved, f"rsb{flags} {operands}, #0", f"mov{flags} {operands}"


# Numbers in wide instructions: "modified" ones, a byte turned or repeated.


@cache
def _modified() -> tuple[tuple[int, ...], dict[int, int]]:
    """Return every number that such an instruction can hold, in order, and how each is encoded (DDI 0403E A5.3.2)."""
    found: dict[int, int] = {}
    for field in range(0x1000):
        number = expanded(field)
        if number is not None:
            found.setdefault(number, field)
    return tuple(sorted(found)), found


def expanded(field: int) -> int | None:
    """Return the number that the twelve bits i:imm3:imm8 mean; None where they mean none."""
    byte, how = field & 0xFF, field >> 8 & 3
    if field >> 10:
        turned, by = 0x80 | field & 0x7F, field >> 7
        return (turned >> by | turned << (32 - by)) & _WORD
    if how and not byte:
        return None
    return (byte, byte << 16 | byte, byte << 24 | byte << 8, byte * 0x0101_0101)[how]


def _neighbours(number: int) -> list[int]:
    """Return the next greater and the next smaller number that a modified immediate has."""
    numbers, _ = _modified()
    at = bisect_left(numbers, number)
    return [numbers[n] for n in (at + 1, at - 1) if 0 <= n < len(numbers)]


def _field(word: int) -> int:
    return (word >> 26 & 1) << 11 | (word >> 12 & 7) << 8 | word & 0xFF


def _with_field(word: int, field: int) -> int:
    return word & ~0x0400_70FF | (field >> 11) << 26 | (field >> 8 & 7) << 12 | field & 0xFF


def _wide_compare(name: str) -> _Make:
    def make(site: Site) -> Iterator[_Change]:
        number, head = expanded(_field(site.word)), f"{name}.w {_r(site.word >> 16 & 15)}"
        if number is not None:
            for other in _neighbours(number):
                word = _with_field(site.word, _modified()[1][other])
                yield "immediate", word, f"{head}, #{number}", f"{head}, #{other}"

    return make


def _registers(word: int, suffix: str = ".w") -> str:
    """Return what follows a name: target and first source; empty where one is SP or PC, of which none is changed."""
    target, source = word >> 8 & 15, word >> 16 & 15
    flags = "s" if word >> 20 & 1 else ""
    return "" if {target, source} & {_SP, _PC} else f"{flags}{suffix} {_r(target)}, {_r(source)}"


def _wide_sum(name: str, other_name: str, *, is_plain: bool = False) -> _Make:
    """Return what changes ADD.W and SUB.W with a modified number, or ADDW and SUBW, whose number is the bits."""

    def make(site: Site) -> Iterator[_Change]:
        word, field = site.word, _field(site.word)
        number, registers = field if is_plain else expanded(field), _registers(word, "w" if is_plain else ".w")
        if number is None or not registers:
            return
        before = f"{name}{registers}, #{number}"
        if is_plain:
            others = {other: other for other in (number + 1, number - 1) if 0 <= other < 0x1000}
        else:
            others = {other: _modified()[1][other] for other in _neighbours(number)}
        for other, changed in others.items():
            yield "immediate", _with_field(word, changed), before, f"{name}{registers}, #{other}"
        if number:
            yield "sign", word ^ 0x00A0_0000, before, f"{other_name}{registers}, #{number}"

    return make


#: MOV and MVN differ in this bit.
_INVERTED = 0x0020_0000


def _wide_move(site: Site) -> Iterator[_Change]:
    """Change MOV.W and MVN.W: a number and its complement."""
    word, field = site.word, expanded(_field(site.word))
    target = word >> 8 & 15
    if field is None or target in {_SP, _PC}:
        return
    flags = "s" if word >> 20 & 1 else ""
    is_inverted = bool(word & _INVERTED)
    before = f"{'mvn' if is_inverted else 'mov'}{flags}.w {_r(target)}, #{field}"
    number = field ^ _WORD if is_inverted else field
    others = [("immediate", other ^ _WORD if is_inverted else other) for other in _neighbours(field)]
    for operator, other in [*others, *([("sign", -number & _WORD)] if number else [])]:
        encoded = _moved(word, other, f"{flags}.w {_r(target)}")
        if encoded is not None:
            yield operator, encoded[0], before, encoded[1]


def _moved(word: int, number: int, head: str) -> tuple[int, str] | None:
    """Return MOV.W of a number, or MVN.W of its complement, and its words; None where neither can hold it."""
    _, fields = _modified()
    if number in fields:
        return _with_field(word & ~_INVERTED, fields[number]), f"mov{head}, #{number}"
    if number ^ _WORD in fields:
        return _with_field(word | _INVERTED, fields[number ^ _WORD]), f"mvn{head}, #{number ^ _WORD}"
    return None


def _move_half(site: Site) -> Iterator[_Change]:
    word, target = site.word, site.word >> 8 & 15
    number = (word >> 16 & 15) << 12 | _field(word)
    if site.is_half or target in {_SP, _PC}:
        return
    for other in (number + 1, number - 1):
        if 0 <= other <= 0xFFFF:
            changed = _with_field(word & ~0x000F_0000 | (other >> 12) << 16, other & 0xFFF)
            yield "immediate", changed, f"movw {_r(target)}, #{number}", f"movw {_r(target)}, #{other}"


def _wide_reverse(site: Site) -> Iterator[_Change]:
    """Change n - x to x - n: the same number, its sign not changed."""
    number, registers = expanded(_field(site.word)), _registers(site.word)
    if number is not None and registers:
        operands = f"{registers}, #{number}"
        yield "sign", site.word ^ 0x0060_0000, f"rsb{operands}", f"sub{operands}"


def _wide_register_sum(name: str, other_name: str) -> _Make:
    def make(site: Site) -> Iterator[_Change]:
        if registers := _registers(site.word):
            operands = f"{registers}, {_shifted(site.word)}"
            yield "sign", site.word ^ 0x00A0_0000, f"{name}{operands}", f"{other_name}{operands}"

    return make


def _shifted(word: int) -> str:
    """Return the last operand of a wide register instruction: a register, shifted perhaps (DDI 0403E A7.4.2)."""
    by, how = (word >> 12 & 7) << 2 | word >> 6 & 3, word >> 4 & 3
    name = _r(word & 15)
    if how == 3 and not by:
        return f"{name}, rrx"
    if not by and not how:
        return name
    return f"{name}, {('lsl', 'lsr', 'asr', 'ror')[how]} #{by or 32}"


def _target(site: Site, offset: int) -> str:
    return f"{site.address + 4 + offset:#010x}"


def _r(number: int) -> str:
    return {_SP: "sp", 14: "lr", _PC: "pc"}.get(number, f"r{number}")


def _signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def _d8(word: int) -> str:
    return _r(word >> 8 & 7)


def _d0_n3(word: int) -> str:
    return f"{_r(word & 7)}, {_r(word >> 3 & 7)}"


#: (mask, value, what makes the changes) of 16-bit encodings; the first row that fits counts.
_NARROW: tuple[tuple[int, int, _Make], ...] = (
    (0xF000, 0xD000, _narrow_branch),
    (0xF500, 0xB100, _compare_and_branch),
    (0xFF00, 0xBF00, _if_then),
    (0xF800, 0x2000, _narrow_number("mov", 0xFF, 0, _d8)),
    (0xF800, 0x2800, _narrow_number("cmp", 0xFF, 0, _d8)),
    (0xF800, 0x3000, _narrow_number("add", 0xFF, 0, _d8, ("sub", 0x800))),
    (0xF800, 0x3800, _narrow_number("sub", 0xFF, 0, _d8, ("add", 0x800))),
    (0xFE00, 0x1C00, _narrow_number("add", 7, 6, _d0_n3, ("sub", 0x200))),
    (0xFE00, 0x1E00, _narrow_number("sub", 7, 6, _d0_n3, ("add", 0x200))),
    (0xFE00, 0x1800, _narrow_sum("add", "sub")),
    (0xFE00, 0x1A00, _narrow_sum("sub", "add")),
    (0xFFC0, 0x4240, _narrow_negate),
)
#: The same of 32-bit encodings, the first halfword in the upper half.
_WIDE: tuple[tuple[int, int, _Make], ...] = (
    (0xF800_D000, 0xF000_8000, _wide_branch),
    (0xFBF0_8F00, 0xF1B0_0F00, _wide_compare("cmp")),
    (0xFBF0_8F00, 0xF110_0F00, _wide_compare("cmn")),
    (0xFBE0_8000, 0xF100_0000, _wide_sum("add", "sub")),
    (0xFBE0_8000, 0xF1A0_0000, _wide_sum("sub", "add")),
    (0xFBF0_8000, 0xF200_0000, _wide_sum("add", "sub", is_plain=True)),
    (0xFBF0_8000, 0xF2A0_0000, _wide_sum("sub", "add", is_plain=True)),
    (0xFBEF_8000, 0xF04F_0000, _wide_move),
    (0xFBEF_8000, 0xF06F_0000, _wide_move),
    (0xFBF0_8000, 0xF240_0000, _move_half),
    (0xFBE0_8000, 0xF1C0_0000, _wide_reverse),
    (0xFFE0_8000, 0xEB00_0000, _wide_register_sum("add", "sub")),
    (0xFFE0_8000, 0xEBA0_0000, _wide_register_sum("sub", "add")),
)
