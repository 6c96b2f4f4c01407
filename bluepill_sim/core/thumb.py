"""What the timing and fault models need to know of a Thumb instruction.

This is not a disassembler and not an executor: it sorts each encoding into a
kind, and names the registers that matter for pipelining and for traps.

Source: ARMv7-M Architecture Reference Manual, chapters A5 and A7; which bits are
which instruction stands in `extension/encodings.py`.
Invariant: every halfword pair has exactly one kind.
"""

from dataclasses import dataclass

from bluepill_sim.extension.encodings import FIRST_WIDE, Kind, find

PC_REGISTER = 15
SP_REGISTER = 13


@dataclass(frozen=True, slots=True)
class Instruction:
    """One decoded instruction."""

    address: int
    #: 2 or 4 bytes.
    size: int
    kind: Kind
    #: Registers that a multiple transfer moves; 0 for all others.
    count: int = 0
    #: Whether it writes the PC although its kind does not say so (POP and LDM with PC).
    loads_pc: bool = False
    #: Base register of an access, or the divisor of a divide; None where it does not matter.
    base: int | None = None
    #: Index register of an access; None for an immediate offset.
    index: int | None = None
    #: Register that a load fills.
    target: int | None = None
    #: Target address of a direct branch.
    destination: int | None = None
    #: Whether a direct branch is always taken, but for an IT before it.
    always_branches: bool = False
    #: What an IT makes of ITSTATE.
    it_state: int = 0


#: The upper five bits of a B of 16 bits without a condition.
_PLAIN_BRANCH = 0b11100
#: Accesses of one register.
_SINGLE = frozenset({Kind.LOAD, Kind.LOAD_LITERAL, Kind.LOAD_PC, Kind.STORE, Kind.STORE_INDEXED})


def decode(code: bytes, offset: int, address: int) -> Instruction:
    """Return the instruction at `offset` of `code`, which stands at `address`."""
    first = code[offset] | code[offset + 1] << 8
    if first < FIRST_WIDE or offset + 4 > len(code):
        return _decode_narrow(first, address)
    return _decode_wide(first << 16 | code[offset + 2] | code[offset + 3] << 8, address)


def decode_all(code: bytes, address: int) -> list[Instruction]:
    """Return every instruction of a straight run of code."""
    found = []
    offset = 0
    while offset + 2 <= len(code):
        found.append(decode(code, offset, address + offset))
        offset += found[-1].size
    return found


def _kind_of(word: int, *, is_wide: bool) -> Kind:
    row = find(word, is_wide=is_wide)
    return Kind.PLAIN if row is None else row.kind


def _signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def _decode_narrow(word: int, address: int) -> Instruction:  # noqa: PLR0911 - one return a kind
    kind = _kind_of(word, is_wide=False)
    if kind is Kind.LOAD_LITERAL:
        return Instruction(address, 2, kind, base=PC_REGISTER, target=word >> 8 & 7)
    if kind in (Kind.LOAD, Kind.STORE, Kind.STORE_INDEXED):
        if word & 0xF000 == 0x9000:
            return Instruction(address, 2, kind, base=SP_REGISTER, target=word >> 8 & 7)
        index = word >> 6 & 7 if word & 0xF000 == 0x5000 else None
        return Instruction(address, 2, kind, base=word >> 3 & 7, index=index, target=word & 7)
    if kind in (Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE):
        if word & 0xF000 == 0xB000:
            is_pop = kind is Kind.LOAD_MULTIPLE
            count = (word & 0x1FF).bit_count()
            return Instruction(address, 2, kind, count=count, loads_pc=is_pop and bool(word & 0x100), base=SP_REGISTER)
        return Instruction(address, 2, kind, count=(word & 0xFF).bit_count(), base=word >> 8 & 7)
    if kind is Kind.BRANCH:
        is_plain = word >> 11 == _PLAIN_BRANCH
        return Instruction(
            address, 2, kind, destination=address + 4 + _narrow_displacement(word), always_branches=is_plain
        )
    if kind is Kind.IF_THEN:
        return Instruction(address, 2, kind, it_state=word & 0xFF)
    return Instruction(address, 2, kind)


def _narrow_displacement(word: int) -> int:
    if word & 0xF500 == 0xB100:
        return (word >> 3 & 0x1F) << 1 | (word >> 9 & 1) << 6
    if word & 0xF000 == 0xD000:
        return _signed(word & 0xFF, 8) * 2
    return _signed(word & 0x7FF, 11) * 2


def _decode_wide(word: int, address: int) -> Instruction:  # noqa: PLR0911 - one return a kind
    kind = _kind_of(word, is_wide=True)
    base = word >> 16 & 15
    if kind in (Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE):
        is_load = kind is Kind.LOAD_MULTIPLE
        loads_pc = is_load and bool(word & 1 << PC_REGISTER)
        return Instruction(address, 4, kind, count=(word & 0xFFFF).bit_count(), loads_pc=loads_pc, base=base)
    if kind in (Kind.LOAD_DUAL, Kind.STORE_DUAL, Kind.TABLE_BRANCH):
        return Instruction(address, 4, kind, count=2, base=base)
    if kind in _SINGLE:
        return _decode_wide_single(word, address, kind)
    if kind is Kind.DIVIDE:
        return Instruction(address, 4, kind, base=word & 15)
    if kind is Kind.EXCLUSIVE:
        return Instruction(address, 4, kind, base=base)
    if kind in (Kind.BRANCH, Kind.CALL):
        target = address + 4 + _wide_displacement(word)
        return Instruction(address, 4, kind, destination=target, always_branches=bool(word & 1 << 12))
    return Instruction(address, 4, kind)


def _decode_wide_single(word: int, address: int, kind: Kind) -> Instruction:
    base = word >> 16 & 15
    target = word >> 12 & 15
    has_index = base != PC_REGISTER and not word & 0x0080_0800
    index = word & 15 if has_index else None
    if kind in {Kind.LOAD, Kind.LOAD_LITERAL} and target == PC_REGISTER:
        kind = Kind.LOAD_PC
    return Instruction(address, 4, kind, base=base, index=index, target=target)


def _wide_displacement(word: int) -> int:
    first, second = word >> 16, word & 0xFFFF
    sign = first >> 10 & 1
    j1, j2 = second >> 13 & 1, second >> 11 & 1
    if second & 0x1000:  # B.W and BL: 25 bits
        i1, i2 = 1 - (j1 ^ sign), 1 - (j2 ^ sign)
        return _signed(sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1, 25)
    return _signed(sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1, 21)
