"""Every encoding of Thumb that a Cortex-M3 has: its bits, what it does, what it costs, how it is written.

This is the only place where the bits of an instruction stand. From it come the decoder of the interpreter in C
(`source/interpreter/encodings.h`), the classes of `core/thumb.py` by which blocks are timed, and the table of
instructions in docs/core.md (`python -m tools.generators.chip`).

A pattern is written as the manual draws it, from bit 15 of the first halfword on: 0 and 1 are fixed, a letter is a bit
of a field, and a field's bits are joined from left to right wherever they stand:

    d n m t   registers Rd, Rn, Rm, Rt          a   Ra; Rt2 or RdHi where two are written
    i         immediate, shift amount, lsb      j   its upper bits where they stand apart; J1, J2 of a branch
    h         type of a shift                   b   width or msb of a bit field; mask of an MSR
    s         sets flags; sign of a branch      p u w   index, add, write back
    c         condition                         r   list of registers
    -         a bit that nothing looks at

Source: ARMv7-M Architecture Reference Manual, chapters A5 and A7; cycles by kind are those of the TRM (r1p1, 18).
Invariant: the rows are read from the top and the first match wins; what matches none is undefined.
"""

import re
from dataclasses import dataclass, field
from enum import Enum
from functools import cache


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


#: TRM table 18-1: cycles without pipeline refill and per-register cycles.
CYCLES = {
    Kind.PLAIN: 1,
    Kind.MULTIPLY_ACCUMULATE: 2,
    Kind.MULTIPLY_LONG: 4,  # chosen: 3 to 5 by operands
    Kind.MULTIPLY_ACCUMULATE_LONG: 5,  # chosen: 4 to 7 by operands
    Kind.DIVIDE: 7,  # chosen: 2 to 12 by operands
    Kind.LOAD: 2,
    Kind.LOAD_LITERAL: 2,
    Kind.LOAD_PC: 2,
    Kind.STORE: 1,
    Kind.STORE_INDEXED: 2,
    Kind.LOAD_MULTIPLE: 1,
    Kind.STORE_MULTIPLE: 1,
    Kind.LOAD_DUAL: 1,
    Kind.STORE_DUAL: 1,
    Kind.EXCLUSIVE: 2,
    Kind.BRANCH: 1,
    Kind.CALL: 1,
    Kind.BRANCH_REGISTER: 1,
    Kind.TABLE_BRANCH: 1,  # with count = 2: three cycles for the load and the addition
    Kind.MASK_CHANGE: 2,  # chosen: 1 or 2
    Kind.READ_SPECIAL: 1,
    Kind.BARRIER: 1,
    Kind.SYNCHRONISE: 4,  # chosen: 1 and a refill
    Kind.SEND_EVENT: 1,
    Kind.WAIT_EVENT: 1,
    Kind.WAIT_INTERRUPT: 1,
    Kind.YIELD: 1,
    Kind.IF_THEN: 1,
    Kind.SUPERVISOR_CALL: 1,
    Kind.BREAKPOINT: 1,
}

#: Pipeline refill of a taken branch: P of the TRM is 1 to 3, by how early the target is known.
REFILL = {
    Kind.BRANCH: 1,
    Kind.CALL: 1,
    Kind.BRANCH_REGISTER: 2,
    Kind.TABLE_BRANCH: 3,
    Kind.LOAD_PC: 3,
    Kind.LOAD_MULTIPLE: 3,
}

#: What takes so long that an exception need not wait for it (TRM 18.2, ARM B1.5.10). LDM and STM go on behind it with
#: the word at which they were left; the others begin anew.
GIVEN_UP = frozenset(
    {Kind.MULTIPLY_LONG, Kind.MULTIPLY_ACCUMULATE_LONG, Kind.DIVIDE, Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE}
)


@dataclass(frozen=True, slots=True)
class Encoding:
    """One encoding of one instruction."""

    #: As the class of this docstring's module draws it; blanks are for the reader.
    pattern: str
    #: What it does, by its name in `source/interpreter/lower.c`.
    operation: str
    #: How it is written, as the manual has it, with the letters of the pattern as registers.
    syntax: str
    kind: Kind = Kind.PLAIN
    mask: int = field(init=False)
    value: int = field(init=False)

    def __post_init__(self) -> None:
        bits = self.pattern.replace(" ", "")
        if len(bits) not in (_NARROW_BITS, _WIDE_BITS):
            raise ValueError(f"{self.pattern}: {len(bits)} bits")
        object.__setattr__(self, "mask", int("".join("1" if bit in "01" else "0" for bit in bits), 2))
        object.__setattr__(self, "value", int("".join("1" if bit == "1" else "0" for bit in bits), 2))

    @property
    def is_wide(self) -> bool:
        """Whether it has 32 bits."""
        return self.value >> _NARROW_BITS != 0

    @property
    def fields(self) -> dict[str, tuple[tuple[int, int], ...]]:
        """Its fields: letter → the runs of bits from left to right, each as (lowest bit, bits)."""
        bits = self.pattern.replace(" ", "")
        runs: dict[str, list[tuple[int, int]]] = {}
        for at, letter in enumerate(bits):
            if letter in "01-":
                continue
            low = len(bits) - 1 - at
            of_letter = runs.setdefault(letter, [])
            if at and bits[at - 1] == letter and of_letter:
                of_letter[-1] = low, of_letter[-1][1] + 1
            else:
                of_letter.append((low, 1))
        return {letter: tuple(found) for letter, found in runs.items()}

    def values(self, word: int) -> dict[str, int]:
        """Return what each field holds in an instruction."""
        found = {}
        for letter, runs in self.fields.items():
            value = 0
            for low, bits in runs:
                value = value << bits | word >> low & ((1 << bits) - 1)
            found[letter] = value
        return found

    def written(self, word: int) -> str:
        """Return an instruction as its syntax has it, with its registers and its condition."""
        values = self.values(word)
        words = {letter: _CONDITIONS[value] if letter == "c" else f"R{value}" for letter, value in values.items()}
        return re.sub(r"<(\w)>", lambda found: words[found[1]], self.syntax)


_NARROW_BITS, _WIDE_BITS = 16, 32
#: By their numbers (A7.3.1); 14 and 15 are other instructions.
_CONDITIONS = ("EQ", "NE", "CS", "CC", "MI", "PL", "VS", "VC", "HI", "LS", "GE", "LT", "GT", "LE", "AL", "AL")
#: First halfwords from here on begin a 32-bit instruction.
FIRST_WIDE = 0xE800

_E, _K = Encoding, Kind
UNDEFINED = "UNDEFINED"


#: S, Rn and Rd where they are no fields: CMP and its like have no Rd and always set flags, MOV and MVN have no Rn.
_FIXED = dict.fromkeys(("TST", "TEQ", "CMN", "CMP"), ("1", "nnnn", "1111")) | dict.fromkeys(
    ("MOV", "MVN"), ("s", "1111", "dddd")
)


def _data(opcode: str, name: str, operands: str) -> tuple[Encoding, ...]:
    """Return a data-processing instruction with a modified immediate, and with a shifted register (A5.3.1, A5.3.11)."""
    operation = name.partition(" ")[0]
    sets, rn, rd = _FIXED.get(operation, ("s", "nnnn", "dddd"))
    suffix = "" if sets == "1" else "{S}"
    return (
        _E(
            f"11110 i 0 {opcode} {sets} {rn} 0 iii {rd} iiiiiiii", f"{operation}_I",
            f"{operation}{suffix} {operands}, #const",
        ),
        _E(
            f"1110101 {opcode} {sets} {rn} 0 iii {rd} ii hh mmmm", f"{operation}_R",
            f"{operation}{suffix} {operands}, <m>, shift #i",
        ),
    )  # fmt: skip


def _stores(size: str, name: str) -> tuple[Encoding, ...]:
    """Return the 32-bit stores of a width (A5.3.10)."""
    return (
        _E(f"111110001 {size} 0 nnnn tttt iiiiiiiiiiii", f"{name}_I", f"{name} <t>, [<n>, #i]", _K.STORE),
        _E(f"111110000 {size} 0 nnnn tttt 1 110 iiiiiiii", f"{name}T", f"{name}T <t>, [<n>, #i]", _K.STORE),
        _E(
            f"111110000 {size} 0 nnnn tttt 1 p u 1 iiiiiiii", f"{name}_X", f"{name} <t>, [<n>], #i or [<n>, #i]!",
            _K.STORE,
        ),
        _E(f"111110000 {size} 0 nnnn tttt 1 1 0 0 iiiiiiii", f"{name}_N", f"{name} <t>, [<n>, #-i]", _K.STORE),
        _E(
            f"111110000 {size} 0 nnnn tttt 000000 ii mmmm", f"{name}_R", f"{name} <t>, [<n>, <m>, LSL #i]",
            _K.STORE_INDEXED,
        ),
    )  # fmt: skip


def _loads(prefix: str, size: str, name: str, hint: str) -> tuple[Encoding, ...]:
    """Return the 32-bit loads of a width (A5.3.7 to A5.3.9); `hint`: what they are where Rt is the PC.

    A load of the PC is another kind, LOAD_PC, which `core/thumb.py` tells by Rt.
    """
    top = f"1111100{prefix}"
    hints = (
        _E(f"{top} - {size} 1 1111 1111 ------------", "NOP", f"{hint} [PC, #i]"),
        _E(f"{top} 1 {size} 1 nnnn 1111 ------------", "NOP", f"{hint} [<n>, #i]"),
        _E(f"{top} 0 {size} 1 nnnn 1111 1100 --------", "NOP", f"{hint} [<n>, #-i]"),
        _E(f"{top} 0 {size} 1 nnnn 1111 000000 -- mmmm", "NOP", f"{hint} [<n>, <m>]"),
    )
    return (
        *(hints if hint else ()),
        _E(f"{top} u {size} 1 1111 tttt iiiiiiiiiiii", f"{name}_LITERAL", f"{name} <t>, label", _K.LOAD_LITERAL),
        _E(f"{top} 1 {size} 1 nnnn tttt iiiiiiiiiiii", f"{name}_I", f"{name} <t>, [<n>, #i]", _K.LOAD),
        _E(f"{top} 0 {size} 1 nnnn tttt 1 110 iiiiiiii", f"{name}T", f"{name}T <t>, [<n>, #i]", _K.LOAD),
        _E(
            f"{top} 0 {size} 1 nnnn tttt 1 p u 1 iiiiiiii", f"{name}_X", f"{name} <t>, [<n>], #i or [<n>, #i]!",
            _K.LOAD,
        ),
        _E(f"{top} 0 {size} 1 nnnn tttt 1 1 0 0 iiiiiiii", f"{name}_N", f"{name} <t>, [<n>, #-i]", _K.LOAD),
        _E(f"{top} 0 {size} 1 nnnn tttt 000000 ii mmmm", f"{name}_R", f"{name} <t>, [<n>, <m>, LSL #i]", _K.LOAD),
    )  # fmt: skip


NARROW: tuple[Encoding, ...] = (
    # A5.2.1: shift, add, subtract, move, compare.
    _E("00000 00000 mmm ddd", "MOVS_T2", "MOVS <d>, <m>"),
    _E("00000 iiiii mmm ddd", "LSL_T1", "LSLS <d>, <m>, #i"),
    _E("00001 iiiii mmm ddd", "LSR_T1", "LSRS <d>, <m>, #i"),
    _E("00010 iiiii mmm ddd", "ASR_T1", "ASRS <d>, <m>, #i"),
    _E("0001100 mmm nnn ddd", "ADD_R3", "ADDS <d>, <n>, <m>"),
    _E("0001101 mmm nnn ddd", "SUB_R3", "SUBS <d>, <n>, <m>"),
    _E("0001110 iii nnn ddd", "ADD_I3", "ADDS <d>, <n>, #i"),
    _E("0001111 iii nnn ddd", "SUB_I3", "SUBS <d>, <n>, #i"),
    _E("00100 ddd iiiiiiii", "MOV_I8", "MOVS <d>, #i"),
    _E("00101 ddd iiiiiiii", "CMP_I8", "CMP <d>, #i"),
    _E("00110 ddd iiiiiiii", "ADD_I8", "ADDS <d>, #i"),
    _E("00111 ddd iiiiiiii", "SUB_I8", "SUBS <d>, #i"),
    # A5.2.2: data processing.
    _E("0100000000 mmm ddd", "AND_T1", "ANDS <d>, <m>"),
    _E("0100000001 mmm ddd", "EOR_T1", "EORS <d>, <m>"),
    _E("0100000010 mmm ddd", "LSL_RT1", "LSLS <d>, <m>"),
    _E("0100000011 mmm ddd", "LSR_RT1", "LSRS <d>, <m>"),
    _E("0100000100 mmm ddd", "ASR_RT1", "ASRS <d>, <m>"),
    _E("0100000101 mmm ddd", "ADC_T1", "ADCS <d>, <m>"),
    _E("0100000110 mmm ddd", "SBC_T1", "SBCS <d>, <m>"),
    _E("0100000111 mmm ddd", "ROR_RT1", "RORS <d>, <m>"),
    _E("0100001000 mmm ddd", "TST_T1", "TST <d>, <m>"),
    _E("0100001001 nnn ddd", "RSB_T1", "RSBS <d>, <n>, #0"),
    _E("0100001010 mmm ddd", "CMP_T1", "CMP <d>, <m>"),
    _E("0100001011 mmm ddd", "CMN_T1", "CMN <d>, <m>"),
    _E("0100001100 mmm ddd", "ORR_T1", "ORRS <d>, <m>"),
    _E("0100001101 mmm ddd", "MUL_T1", "MULS <d>, <m>, <d>"),
    _E("0100001110 mmm ddd", "BIC_T1", "BICS <d>, <m>"),
    _E("0100001111 mmm ddd", "MVN_T1", "MVNS <d>, <m>"),
    # A5.2.3: special data, branch and exchange.
    _E("01000100 1 mmmm 111", "ADD_PC", "ADD PC, <m>", _K.BRANCH_REGISTER),
    _E("01000100 d mmmm ddd", "ADD_T2", "ADD <d>, <m>"),
    _E("01000101 d mmmm ddd", "CMP_T1", "CMP <d>, <m>"),
    _E("01000110 1 mmmm 111", "MOV_PC", "MOV PC, <m>", _K.BRANCH_REGISTER),
    _E("01000110 d mmmm ddd", "MOV_T1", "MOV <d>, <m>"),
    _E("010001110 mmmm 000", "BX", "BX <m>", _K.BRANCH_REGISTER),
    _E("010001111 mmmm 000", "BLX", "BLX <m>", _K.BRANCH_REGISTER),
    # A5.2.4: loads and stores.
    _E("01001 ttt iiiiiiii", "LDR_LITERAL_T1", "LDR <t>, label", _K.LOAD_LITERAL),
    _E("0101000 mmm nnn ttt", "STR_RT1", "STR <t>, [<n>, <m>]", _K.STORE_INDEXED),
    _E("0101001 mmm nnn ttt", "STRH_RT1", "STRH <t>, [<n>, <m>]", _K.STORE_INDEXED),
    _E("0101010 mmm nnn ttt", "STRB_RT1", "STRB <t>, [<n>, <m>]", _K.STORE_INDEXED),
    _E("0101011 mmm nnn ttt", "LDRSB_RT1", "LDRSB <t>, [<n>, <m>]", _K.LOAD),
    _E("0101100 mmm nnn ttt", "LDR_RT1", "LDR <t>, [<n>, <m>]", _K.LOAD),
    _E("0101101 mmm nnn ttt", "LDRH_RT1", "LDRH <t>, [<n>, <m>]", _K.LOAD),
    _E("0101110 mmm nnn ttt", "LDRB_RT1", "LDRB <t>, [<n>, <m>]", _K.LOAD),
    _E("0101111 mmm nnn ttt", "LDRSH_RT1", "LDRSH <t>, [<n>, <m>]", _K.LOAD),
    _E("01100 iiiii nnn ttt", "STR_I5", "STR <t>, [<n>, #i*4]", _K.STORE),
    _E("01101 iiiii nnn ttt", "LDR_I5", "LDR <t>, [<n>, #i*4]", _K.LOAD),
    _E("01110 iiiii nnn ttt", "STRB_I5", "STRB <t>, [<n>, #i]", _K.STORE),
    _E("01111 iiiii nnn ttt", "LDRB_I5", "LDRB <t>, [<n>, #i]", _K.LOAD),
    _E("10000 iiiii nnn ttt", "STRH_I5", "STRH <t>, [<n>, #i*2]", _K.STORE),
    _E("10001 iiiii nnn ttt", "LDRH_I5", "LDRH <t>, [<n>, #i*2]", _K.LOAD),
    _E("10010 ttt iiiiiiii", "STR_SP", "STR <t>, [SP, #i*4]", _K.STORE),
    _E("10011 ttt iiiiiiii", "LDR_SP", "LDR <t>, [SP, #i*4]", _K.LOAD),
    # A5.2.5: addresses, and what stands alone.
    _E("10100 ddd iiiiiiii", "ADR_T1", "ADR <d>, label"),
    _E("10101 ddd iiiiiiii", "ADD_SP_T1", "ADD <d>, SP, #i*4"),
    _E("101100000 iiiiiii", "ADD_SP_T2", "ADD SP, SP, #i*4"),
    _E("101100001 iiiiiii", "SUB_SP_T1", "SUB SP, SP, #i*4"),
    _E("101100i1 iiiii nnn", "CBZ", "CBZ <n>, label", _K.BRANCH),
    _E("101110i1 iiiii nnn", "CBNZ", "CBNZ <n>, label", _K.BRANCH),
    _E("1011001000 mmm ddd", "SXTH_T1", "SXTH <d>, <m>"),
    _E("1011001001 mmm ddd", "SXTB_T1", "SXTB <d>, <m>"),
    _E("1011001010 mmm ddd", "UXTH_T1", "UXTH <d>, <m>"),
    _E("1011001011 mmm ddd", "UXTB_T1", "UXTB <d>, <m>"),
    _E("1011010 rrrrrrrrr", "PUSH", "PUSH {registers}", _K.STORE_MULTIPLE),
    _E("1011110 rrrrrrrrr", "POP", "POP {registers}", _K.LOAD_MULTIPLE),
    _E("10110110011 u 00 ii", "CPS", "CPSIE or CPSID flags", _K.MASK_CHANGE),
    _E("1011101000 mmm ddd", "REV", "REV <d>, <m>"),
    _E("1011101001 mmm ddd", "REV16", "REV16 <d>, <m>"),
    _E("1011101011 mmm ddd", "REVSH", "REVSH <d>, <m>"),
    _E("10111110 iiiiiiii", "BKPT", "BKPT #i", _K.BREAKPOINT),
    _E("10111111 00010000", "YIELD", "YIELD", _K.YIELD),
    _E("10111111 00100000", "WFE", "WFE", _K.WAIT_EVENT),
    _E("10111111 00110000", "WFI", "WFI", _K.WAIT_INTERRUPT),
    _E("10111111 01000000", "SEV", "SEV", _K.SEND_EVENT),
    _E("10111111 ---- 0000", "NOP", "NOP"),
    _E("10111111 iiiiiiii", "IT", "IT{x{y{z}}} condition", _K.IF_THEN),
    _E("11000 nnn rrrrrrrr", "STM_T1", "STM <n>!, {registers}", _K.STORE_MULTIPLE),
    _E("11001 nnn rrrrrrrr", "LDM_T1", "LDM <n>{!}, {registers}", _K.LOAD_MULTIPLE),
    # A5.2.6: conditional branch, supervisor call.
    _E("11011110 --------", "UDF", "UDF #i"),
    _E("11011111 iiiiiiii", "SVC", "SVC #i", _K.SUPERVISOR_CALL),
    _E("1101 cccc iiiiiiii", "B_T1", "B<c> label", _K.BRANCH),
    _E("11100 iiiiiiiiiii", "B_T2", "B label", _K.BRANCH),
)

WIDE: tuple[Encoding, ...] = (
    # A5.3.5: load and store multiple.
    _E("1110100010 w 0 nnnn rrrrrrrrrrrrrrrr", "STM_IA", "STM <n>{!}, {registers}", _K.STORE_MULTIPLE),
    _E("1110100010 w 1 nnnn rrrrrrrrrrrrrrrr", "LDM_IA", "LDM <n>{!}, {registers}", _K.LOAD_MULTIPLE),
    _E("1110100100 w 0 nnnn rrrrrrrrrrrrrrrr", "STM_DB", "STMDB <n>{!}, {registers}", _K.STORE_MULTIPLE),
    _E("1110100100 w 1 nnnn rrrrrrrrrrrrrrrr", "LDM_DB", "LDMDB <n>{!}, {registers}", _K.LOAD_MULTIPLE),
    # A5.3.6: load and store dual, exclusive; table branch.
    _E("111010000100 nnnn tttt dddd iiiiiiii", "STREX", "STREX <d>, <t>, [<n>, #i*4]", _K.EXCLUSIVE),
    _E("111010000101 nnnn tttt 1111 iiiiiiii", "LDREX", "LDREX <t>, [<n>, #i*4]", _K.EXCLUSIVE),
    _E("111010001100 nnnn tttt 1111 0100 dddd", "STREXB", "STREXB <d>, <t>, [<n>]", _K.EXCLUSIVE),
    _E("111010001100 nnnn tttt 1111 0101 dddd", "STREXH", "STREXH <d>, <t>, [<n>]", _K.EXCLUSIVE),
    _E("111010001101 nnnn 1111 0000 0000 mmmm", "TBB", "TBB [<n>, <m>]", _K.TABLE_BRANCH),
    _E("111010001101 nnnn 1111 0000 0001 mmmm", "TBH", "TBH [<n>, <m>, LSL #1]", _K.TABLE_BRANCH),
    _E("111010001101 nnnn tttt 1111 0100 1111", "LDREXB", "LDREXB <t>, [<n>]", _K.EXCLUSIVE),
    _E("111010001101 nnnn tttt 1111 0101 1111", "LDREXH", "LDREXH <t>, [<n>]", _K.EXCLUSIVE),
    _E("11101000 u 110 nnnn tttt aaaa iiiiiiii", "STRD_POST", "STRD <t>, <a>, [<n>], #i*4", _K.STORE_DUAL),
    _E("11101000 u 111 nnnn tttt aaaa iiiiiiii", "LDRD_POST", "LDRD <t>, <a>, [<n>], #i*4", _K.LOAD_DUAL),
    _E("11101001 u 1 w 0 nnnn tttt aaaa iiiiiiii", "STRD", "STRD <t>, <a>, [<n>, #i*4]{!}", _K.STORE_DUAL),
    _E("11101001 u 1 w 1 nnnn tttt aaaa iiiiiiii", "LDRD", "LDRD <t>, <a>, [<n>, #i*4]{!}", _K.LOAD_DUAL),
    # A5.3.1, A5.3.11: data processing; those that share an opcode, the narrower one first.
    *_data("0000", "TST", "<n>"),
    *_data("0000", "AND", "<d>, <n>"),
    *_data("0001", "BIC", "<d>, <n>"),
    *_data("0010", "MOV", "<d>"),
    *_data("0010", "ORR", "<d>, <n>"),
    *_data("0011", "MVN", "<d>"),
    *_data("0011", "ORN", "<d>, <n>"),
    *_data("0100", "TEQ", "<n>"),
    *_data("0100", "EOR", "<d>, <n>"),
    *_data("1000", "CMN", "<n>"),
    *_data("1000", "ADD", "<d>, <n>"),
    *_data("1010", "ADC", "<d>, <n>"),
    *_data("1011", "SBC", "<d>, <n>"),
    *_data("1101", "CMP", "<n>"),
    *_data("1101", "SUB", "<d>, <n>"),
    *_data("1110", "RSB", "<d>, <n>"),
    # A5.3.3: plain immediates.
    _E("11110 i 100000 1111 0 iii dddd iiiiiiii", "ADR_ADD", "ADR <d>, label"),
    _E("11110 i 101010 1111 0 iii dddd iiiiiiii", "ADR_SUB", "ADR <d>, label"),
    _E("11110 i 100000 nnnn 0 iii dddd iiiiiiii", "ADDW", "ADDW <d>, <n>, #i"),
    _E("11110 i 101010 nnnn 0 iii dddd iiiiiiii", "SUBW", "SUBW <d>, <n>, #i"),
    _E("11110 i 100100 jjjj 0 iii dddd iiiiiiii", "MOVW", "MOVW <d>, #j:i"),
    _E("11110 i 101100 jjjj 0 iii dddd iiiiiiii", "MOVT", "MOVT <d>, #j:i"),
    _E("111100110010 ---- 0 000 ---- 00-- ----", UNDEFINED, "SSAT16 (DSP)"),
    _E("111100111010 ---- 0 000 ---- 00-- ----", UNDEFINED, "USAT16 (DSP)"),
    _E("1111001100 h 0 nnnn 0 iii dddd ii 0 bbbbb", "SSAT", "SSAT <d>, #b+1, <n>, shift #i"),
    _E("1111001110 h 0 nnnn 0 iii dddd ii 0 bbbbb", "USAT", "USAT <d>, #b, <n>, shift #i"),
    _E("111100110100 nnnn 0 iii dddd ii 0 bbbbb", "SBFX", "SBFX <d>, <n>, #i, #b+1"),
    _E("111100111100 nnnn 0 iii dddd ii 0 bbbbb", "UBFX", "UBFX <d>, <n>, #i, #b+1"),
    _E("111100110110 1111 0 iii dddd ii 0 bbbbb", "BFC", "BFC <d>, #i, #b-i+1"),
    _E("111100110110 nnnn 0 iii dddd ii 0 bbbbb", "BFI", "BFI <d>, <n>, #i, #b-i+1"),
    # A5.3.4: branches and miscellaneous control.
    _E("111100111000 nnnn 1000 bb00 iiiiiiii", "MSR", "MSR special, <n>", _K.MASK_CHANGE),
    _E("111100111010 1111 1000 0000 00000001", "YIELD", "YIELD.W", _K.YIELD),
    _E("111100111010 1111 1000 0000 00000010", "WFE", "WFE.W", _K.WAIT_EVENT),
    _E("111100111010 1111 1000 0000 00000011", "WFI", "WFI.W", _K.WAIT_INTERRUPT),
    _E("111100111010 1111 1000 0000 00000100", "SEV", "SEV.W", _K.SEND_EVENT),
    _E("111100111010 1111 1000 0000 --------", "NOP", "NOP.W"),
    _E("111100111011 1111 1000 1111 0010 1111", "CLREX", "CLREX", _K.BARRIER),
    _E("111100111011 1111 1000 1111 0100 ----", "DSB", "DSB", _K.BARRIER),
    _E("111100111011 1111 1000 1111 0101 ----", "DMB", "DMB", _K.BARRIER),
    _E("111100111011 1111 1000 1111 0110 ----", "ISB", "ISB", _K.SYNCHRONISE),
    _E("111100111110 1111 1000 dddd iiiiiiii", "MRS", "MRS <d>, special", _K.READ_SPECIAL),
    _E("111101111111 ---- 1010 ------------", "UDF", "UDF.W #i"),
    _E("11110 - 111 ------- 10-0 ------------", UNDEFINED, "no control instruction"),
    _E("11110 s cccc iiiiii 10 j 0 j iiiiiiiiiii", "B_T3", "B<c>.W label", _K.BRANCH),
    _E("11110 s iiiiiiiiii 10 j 1 j iiiiiiiiiii", "B_T4", "B.W label", _K.BRANCH),
    _E("11110 s iiiiiiiiii 11 j 1 j iiiiiiiiiii", "BL", "BL label", _K.CALL),
    # A5.3.10: stores; none is relative to the PC.
    _E("11111000 -00 0 1111 ---------------- ", UNDEFINED, "no store relative to the PC"),
    _E("11111000 -01 0 1111 ---------------- ", UNDEFINED, "no store relative to the PC"),
    _E("11111000 -10 0 1111 ---------------- ", UNDEFINED, "no store relative to the PC"),
    *_stores("00", "STRB"),
    *_stores("01", "STRH"),
    *_stores("10", "STR"),
    # A5.3.7 to A5.3.9: loads and memory hints.
    *_loads("0", "00", "LDRB", "PLD"),
    *_loads("0", "01", "LDRH", "NOP"),
    *_loads("0", "10", "LDR", ""),
    *_loads("1", "00", "LDRSB", "PLI"),
    *_loads("1", "01", "LDRSH", "NOP"),
    # A5.3.12, A5.3.15: data processing with registers.
    _E("11111010000 s nnnn 1111 dddd 0000 mmmm", "LSL", "LSL{S} <d>, <n>, <m>"),
    _E("11111010001 s nnnn 1111 dddd 0000 mmmm", "LSR", "LSR{S} <d>, <n>, <m>"),
    _E("11111010010 s nnnn 1111 dddd 0000 mmmm", "ASR", "ASR{S} <d>, <n>, <m>"),
    _E("11111010011 s nnnn 1111 dddd 0000 mmmm", "ROR", "ROR{S} <d>, <n>, <m>"),
    _E("111110100000 1111 1111 dddd 1 0 ii mmmm", "SXTH", "SXTH <d>, <m>, ROR #i*8"),
    _E("111110100001 1111 1111 dddd 1 0 ii mmmm", "UXTH", "UXTH <d>, <m>, ROR #i*8"),
    _E("111110100100 1111 1111 dddd 1 0 ii mmmm", "SXTB", "SXTB <d>, <m>, ROR #i*8"),
    _E("111110100101 1111 1111 dddd 1 0 ii mmmm", "UXTB", "UXTB <d>, <m>, ROR #i*8"),
    _E("111110101001 ---- 1111 dddd 1000 mmmm", "REV", "REV <d>, <m>"),
    _E("111110101001 ---- 1111 dddd 1001 mmmm", "REV16", "REV16 <d>, <m>"),
    _E("111110101001 ---- 1111 dddd 1010 mmmm", "RBIT", "RBIT <d>, <m>"),
    _E("111110101001 ---- 1111 dddd 1011 mmmm", "REVSH", "REVSH <d>, <m>"),
    _E("111110101011 ---- 1111 dddd 1000 mmmm", "CLZ", "CLZ <d>, <m>"),
    # A5.3.16, A5.3.17: multiply and divide.
    _E("111110110000 nnnn 1111 dddd 0000 mmmm", "MUL", "MUL <d>, <n>, <m>"),
    _E("111110110000 nnnn aaaa dddd 0000 mmmm", "MLA", "MLA <d>, <n>, <m>, <a>", _K.MULTIPLY_ACCUMULATE),
    _E("111110110000 nnnn aaaa dddd 0001 mmmm", "MLS", "MLS <d>, <n>, <m>, <a>", _K.MULTIPLY_ACCUMULATE),
    _E("111110111000 nnnn dddd aaaa 0000 mmmm", "SMULL", "SMULL <d>, <a>, <n>, <m>", _K.MULTIPLY_LONG),
    _E("111110111001 nnnn 1111 dddd 1111 mmmm", "SDIV", "SDIV <d>, <n>, <m>", _K.DIVIDE),
    _E("111110111010 nnnn dddd aaaa 0000 mmmm", "UMULL", "UMULL <d>, <a>, <n>, <m>", _K.MULTIPLY_LONG),
    _E("111110111011 nnnn 1111 dddd 1111 mmmm", "UDIV", "UDIV <d>, <n>, <m>", _K.DIVIDE),
    _E("111110111100 nnnn dddd aaaa 0000 mmmm", "SMLAL", "SMLAL <d>, <a>, <n>, <m>", _K.MULTIPLY_ACCUMULATE_LONG),
    _E("111110111110 nnnn dddd aaaa 0000 mmmm", "UMLAL", "UMLAL <d>, <a>, <n>, <m>", _K.MULTIPLY_ACCUMULATE_LONG),
    # A5.3.18: there is no coprocessor.
    _E("111-110- -------- ----------------", "NO_COPROCESSOR", "LDC, MCRR, MRRC, STC"),
    _E("111-1110 -------- ----------------", "NO_COPROCESSOR", "CDP, MCR, MRC"),
)


@cache
def _rows_by(first: int, *, is_wide: bool) -> tuple[Encoding, ...]:
    """Return the rows that may match where that is the upper byte of the first halfword."""
    shift = _WIDE_BITS - 8 if is_wide else _NARROW_BITS - 8
    rows = WIDE if is_wide else NARROW
    return tuple(row for row in rows if not (first ^ row.value >> shift) & row.mask >> shift)


def find(word: int, *, is_wide: bool) -> Encoding | None:
    """Return the encoding of an instruction; None of one that is undefined.

    Args:
        word: 16 bits, or 32 with the first halfword in the upper half.
        is_wide: which of the two.
    """
    for row in _rows_by(word >> (_WIDE_BITS - 8 if is_wide else _NARROW_BITS - 8), is_wide=is_wide):
        if word & row.mask == row.value:
            return None if row.operation == UNDEFINED else row
    return None
