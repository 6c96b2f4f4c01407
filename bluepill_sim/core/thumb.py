"""What the timing and fault models need to know of a Thumb instruction.

This is not a disassembler and not an executor: it sorts each encoding into a
kind, and names the registers that matter for pipelining and for traps.

Source: ARMv7-M Architecture Reference Manual, chapters A5 and A7.
Invariant: every halfword pair has exactly one kind; the tables are read from
the top and the first match wins.
"""

from dataclasses import dataclass
from enum import Enum

PC_REGISTER = 15
SP_REGISTER = 13


class Kind(Enum):
    """Classes of instructions that cost alike or need the emulator's attention."""

    #: Data processing, and whatever has no line of its own: one cycle.
    PLAIN = "plain"
    MULTIPLY_ACCUMULATE = "multiply-accumulate"
    MULTIPLY_LONG = "multiply-long"
    MULTIPLY_ACCUMULATE_LONG = "multiply-accumulate-long"
    DIVIDE = "divide"
    LOAD = "load"
    #: Load relative to the PC: from flash, when the code is there.
    LOAD_LITERAL = "load-literal"
    LOAD_PC = "load-pc"
    #: Store with an immediate offset.
    STORE = "store"
    #: Store with a register offset.
    STORE_INDEXED = "store-indexed"
    LOAD_MULTIPLE = "load-multiple"
    STORE_MULTIPLE = "store-multiple"
    LOAD_DUAL = "load-dual"
    STORE_DUAL = "store-dual"
    EXCLUSIVE = "exclusive"
    #: Branch whose target stands in the instruction.
    BRANCH = "branch"
    #: BL: the same, with a link.
    CALL = "call"
    #: Branch to a register, or a write of the PC by MOV or ADD.
    BRANCH_REGISTER = "branch-register"
    TABLE_BRANCH = "table-branch"
    #: CPS and MSR: may change what may interrupt.
    MASK_CHANGE = "mask-change"
    READ_SPECIAL = "read-special"
    BARRIER = "barrier"
    #: ISB: a barrier that refills the pipeline.
    SYNCHRONISE = "synchronise"
    SEND_EVENT = "send-event"
    WAIT_EVENT = "wait-event"
    WAIT_INTERRUPT = "wait-interrupt"
    YIELD = "yield"
    #: IT: makes the next one to four instructions conditional.
    IF_THEN = "if-then"
    SUPERVISOR_CALL = "supervisor-call"
    BREAKPOINT = "breakpoint"


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
    #: What an IT makes of ITSTATE.
    it_state: int = 0


#: (mask, value, kind) of 16-bit encodings.
_NARROW: tuple[tuple[int, int, Kind], ...] = (
    (0xF800, 0x4800, Kind.LOAD_LITERAL),
    (0xFF00, 0x4700, Kind.BRANCH_REGISTER),  # BX, BLX
    (0xFF87, 0x4487, Kind.BRANCH_REGISTER),  # ADD PC, Rm
    (0xFF87, 0x4687, Kind.BRANCH_REGISTER),  # MOV PC, Rm
    (0xFE00, 0x5600, Kind.LOAD),  # LDRSB register
    (0xF800, 0x5800, Kind.LOAD),  # LDR, LDRH, LDRB, LDRSH register
    (0xF800, 0x5000, Kind.STORE_INDEXED),
    (0xF800, 0x6000, Kind.STORE),
    (0xF800, 0x7000, Kind.STORE),
    (0xF800, 0x8000, Kind.STORE),
    (0xF800, 0x9000, Kind.STORE),
    (0xF800, 0x6800, Kind.LOAD),
    (0xF800, 0x7800, Kind.LOAD),
    (0xF800, 0x8800, Kind.LOAD),
    (0xF800, 0x9800, Kind.LOAD),
    (0xFE00, 0xB400, Kind.STORE_MULTIPLE),  # PUSH
    (0xFE00, 0xBC00, Kind.LOAD_MULTIPLE),  # POP
    (0xF500, 0xB100, Kind.BRANCH),  # CBZ, CBNZ
    (0xFFE8, 0xB660, Kind.MASK_CHANGE),  # CPS
    (0xFFFF, 0xBF10, Kind.YIELD),
    (0xFFFF, 0xBF20, Kind.WAIT_EVENT),
    (0xFFFF, 0xBF30, Kind.WAIT_INTERRUPT),
    (0xFFFF, 0xBF40, Kind.SEND_EVENT),
    (0xFF0F, 0xBF00, Kind.PLAIN),  # NOP and reserved hints
    (0xFF00, 0xBF00, Kind.IF_THEN),
    (0xFF00, 0xBE00, Kind.BREAKPOINT),
    (0xF800, 0xC000, Kind.STORE_MULTIPLE),
    (0xF800, 0xC800, Kind.LOAD_MULTIPLE),
    (0xFF00, 0xDE00, Kind.PLAIN),  # UDF
    (0xFF00, 0xDF00, Kind.SUPERVISOR_CALL),
    (0xF000, 0xD000, Kind.BRANCH),
    (0xF800, 0xE000, Kind.BRANCH),
)

#: (mask, value, kind) of 32-bit encodings, first halfword in the upper half.
_WIDE: tuple[tuple[int, int, Kind], ...] = (
    (0xFE40_0000, 0xE800_0000, Kind.STORE_MULTIPLE),  # told from a load by bit 20
    (0xFFF0_0F00, 0xE850_0F00, Kind.EXCLUSIVE),  # LDREX
    (0xFFF0_0000, 0xE840_0000, Kind.EXCLUSIVE),  # STREX
    (0xFFF0_FFE0, 0xE8D0_F000, Kind.TABLE_BRANCH),
    (0xFFE0_0FE0, 0xE8C0_0F40, Kind.EXCLUSIVE),  # LDREXB/H, STREXB/H
    (0xFE40_0000, 0xE840_0000, Kind.STORE_DUAL),  # told from a load by bit 20
    (0xF800_D000, 0xF000_D000, Kind.CALL),
    (0xF800_D000, 0xF000_9000, Kind.BRANCH),
    (0xFFE0_D000, 0xF380_8000, Kind.MASK_CHANGE),  # MSR
    (0xFFFF_FFFF, 0xF3AF_8001, Kind.YIELD),
    (0xFFFF_FFFF, 0xF3AF_8002, Kind.WAIT_EVENT),
    (0xFFFF_FFFF, 0xF3AF_8003, Kind.WAIT_INTERRUPT),
    (0xFFFF_FFFF, 0xF3AF_8004, Kind.SEND_EVENT),
    (0xFFF0_D0F0, 0xF3B0_8060, Kind.SYNCHRONISE),
    (0xFFF0_D000, 0xF3B0_8000, Kind.BARRIER),  # DSB, DMB, CLREX
    (0xFFE0_D000, 0xF3E0_8000, Kind.READ_SPECIAL),
    (0xFB80_D000, 0xF380_8000, Kind.PLAIN),  # the rest of the control space, no branch
    (0xF800_D000, 0xF000_8000, Kind.BRANCH),
    (0xFFF0_00F0, 0xFB00_0000, Kind.MULTIPLY_ACCUMULATE),  # MUL is known by Ra = 15
    (0xFFF0_00F0, 0xFB00_0010, Kind.MULTIPLY_ACCUMULATE),  # MLS
    (0xFFD0_00F0, 0xFB90_00F0, Kind.DIVIDE),
    (0xFFD0_00F0, 0xFB80_0000, Kind.MULTIPLY_LONG),
    (0xFFD0_00F0, 0xFBC0_0000, Kind.MULTIPLY_ACCUMULATE_LONG),
    (0xFE10_0000, 0xF810_0000, Kind.LOAD),
    (0xFE10_0000, 0xF800_0000, Kind.STORE),
)

_LOADS_OF_STORES = {Kind.STORE_MULTIPLE: Kind.LOAD_MULTIPLE, Kind.STORE_DUAL: Kind.LOAD_DUAL}
#: First halfwords from here on begin a 32-bit instruction.
_FIRST_WIDE = 0xE800


def decode(code: bytes, offset: int, address: int) -> Instruction:
    """Return the instruction at `offset` of `code`, which stands at `address`."""
    first = code[offset] | code[offset + 1] << 8
    if first < _FIRST_WIDE or offset + 4 > len(code):
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


def _kind_of(word: int, table: tuple[tuple[int, int, Kind], ...]) -> Kind:
    for mask, value, kind in table:
        if word & mask == value:
            return kind
    return Kind.PLAIN


def _signed(value: int, bits: int) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def _decode_narrow(word: int, address: int) -> Instruction:  # noqa: PLR0911 - one return a kind
    kind = _kind_of(word, _NARROW)
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
        return Instruction(address, 2, kind, destination=address + 4 + _narrow_displacement(word))
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
    kind = _kind_of(word, _WIDE)
    base = word >> 16 & 15
    target = word >> 12 & 15
    if word >> 20 & 1:
        kind = _LOADS_OF_STORES.get(kind, kind)
    if kind is Kind.MULTIPLY_ACCUMULATE and target == PC_REGISTER and not word & 0xF0:
        kind = Kind.PLAIN  # MUL
    if kind in (Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE):
        is_load = kind is Kind.LOAD_MULTIPLE
        loads_pc = is_load and bool(word & 1 << PC_REGISTER)
        return Instruction(address, 4, kind, count=(word & 0xFFFF).bit_count(), loads_pc=loads_pc, base=base)
    if kind in (Kind.LOAD_DUAL, Kind.STORE_DUAL, Kind.TABLE_BRANCH):
        return Instruction(address, 4, kind, count=2, base=base)
    if kind in (Kind.LOAD, Kind.STORE):
        return _decode_wide_single(word, address, kind)
    if kind is Kind.DIVIDE:
        return Instruction(address, 4, kind, base=word & 15)
    if kind is Kind.EXCLUSIVE:
        return Instruction(address, 4, kind, base=base)
    if kind in (Kind.BRANCH, Kind.CALL):
        return Instruction(address, 4, kind, destination=address + 4 + _wide_displacement(word))
    return Instruction(address, 4, kind)


def _decode_wide_single(word: int, address: int, kind: Kind) -> Instruction:
    base = word >> 16 & 15
    target = word >> 12 & 15
    is_word = word >> 21 & 3 == 2
    if kind is Kind.LOAD and target == PC_REGISTER and not is_word:
        return Instruction(address, 4, Kind.PLAIN)  # PLD, PLI
    has_index = base != PC_REGISTER and not word & 0x0080_0800
    index = word & 15 if has_index else None
    if kind is Kind.STORE:
        return Instruction(address, 4, Kind.STORE_INDEXED if has_index else kind, base=base, index=index, target=target)
    if target == PC_REGISTER:
        kind = Kind.LOAD_PC
    elif base == PC_REGISTER:
        kind = Kind.LOAD_LITERAL
    return Instruction(address, 4, kind, base=base, index=index, target=target)


def _wide_displacement(word: int) -> int:
    first, second = word >> 16, word & 0xFFFF
    sign = first >> 10 & 1
    j1, j2 = second >> 13 & 1, second >> 11 & 1
    if second & 0x1000:  # B.W and BL: 25 bits
        i1, i2 = 1 - (j1 ^ sign), 1 - (j2 ^ sign)
        return _signed(sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1, 25)
    return _signed(sign << 20 | j2 << 19 | j1 << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1, 21)
