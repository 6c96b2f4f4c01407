"""What the timing and fault models need to know of a Thumb instruction.

This is not a disassembler and not an executor: it sorts each encoding into a
kind, and names the registers that matter for pipelining and for traps. It is done in
C, where blocks are measured too (`extension/source/core/measure.c`).

Source: ARMv7-M Architecture Reference Manual, chapters A5 and A7; which bits are
which instruction stands in `extension/encodings.py`.
Invariant: every halfword pair has exactly one kind.
"""

import ctypes
from dataclasses import dataclass
from typing import Any

from bluepill_sim.extension.encodings import Kind
from bluepill_sim.extension.layout import MEASURED, structure
from bluepill_sim.extension.library import library

PC_REGISTER = 15
SP_REGISTER = 13

#: By their numbers in C.
KINDS = tuple(Kind)
#: A register that there is not, in C.
_NONE = 255
MeasuredRow = structure(MEASURED)


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


def decode(code: bytes, offset: int, address: int) -> Instruction:
    """Return the instruction at `offset` of `code`, which stands at `address`."""
    return decode_all(code[offset : offset + _size(code, offset)], address)[0]


def decode_all(code: bytes, address: int) -> list[Instruction]:
    """Return every instruction of a straight run of code."""
    rows = (MeasuredRow * (len(code) // 2))()
    count = library().measure_decode(code, len(code), address, ctypes.addressof(rows))
    return [_instruction(rows[n]) for n in range(count)]


def register_or_none(number: int) -> int | None:
    """Return the number of a register of a row; None where it has none."""
    return None if number == _NONE else number


def _size(code: bytes, offset: int) -> int:
    return 4 if code[offset + 1] >> 3 > _LAST_NARROW and offset + 4 <= len(code) else 2


#: The upper five bits of the last first halfword that is an instruction by itself.
_LAST_NARROW = 0b11100


def _instruction(row: Any) -> Instruction:
    return Instruction(
        row.address,
        row.bytes,
        KINDS[row.kind],
        row.count,
        bool(row.loads_pc),
        register_or_none(row.base),
        register_or_none(row.index),
        register_or_none(row.target),
        row.destination if row.has_destination else None,
        bool(row.always_branches),
        row.sets_it,
    )
