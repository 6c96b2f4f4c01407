"""Which loops of one block may poll a counter: `source/core/polling.c` works out the round that leaves them.

Such a block loads one word through a register that it does not write, computes with it and with what it does not
write, and branches to its own start by the flags of the last step. So whether it goes round depends on the word alone,
and each round overwrites all that the one before has written.

Source: ARMv7-M Architecture Reference Manual A5.2, A7.7.
Invariant: in doubt, a block is no such loop.
"""

import ctypes
from typing import Any

from bluepill_sim.extension.layout import LOOP, structure

#: Operations of a step (`enum operation`).
_ADD, _SUBTRACT, _SUBTRACT_FROM, _SHIFT_LEFT, _SHIFT_RIGHT, _AND = range(6)
_STEPS = 6
_NOP, _UXTH, _LDRH, _HALFWORD = 0xBF00, 0xB280, 0x8800, 0xFFFF
#: LDR and LDRH with an immediate.
_LOADS = frozenset({0x6800, _LDRH})
#: Conditions that look at N and Z alone: eq, ne, mi, pl.
_OF_RESULT = frozenset({0, 1, 4, 5})
_ALWAYS = 14
#: (operation, operand, whether that is a register, register of the result or None for flags alone)
_Step = tuple[int, int, bool, int | None]


def loop_of(code: bytes, offsets: dict[int, int], start: int) -> "ctypes.Structure | None":
    """Return the loop that a block is; None where it is none.

    Args:
        code: the block.
        offsets: the cycles at which its instructions begin, by address.
        start: where it stands.
    """
    words = [code[at] | code[at + 1] << 8 for at in range(0, len(code), 2)]
    branch, condition = words[-1], words[-1] >> 8 & 15
    body = [(start + 2 * n, word) for n, word in enumerate(words[:-1]) if word != _NOP]
    goes_back = branch & 0xF000 == 0xD000 and condition < _ALWAYS and (branch & 0xFF) + len(words) + 1 == 0x100
    if not goes_back or not body or body[0][1] & 0xF800 not in _LOADS:
        return None
    at, load = body[0]
    base, held, is_half = load >> 3 & 7, load & 7, load & 0xF800 == _LDRH
    offset = (load >> 6 & 31) * (2 if is_half else 4)
    steps = _steps([word for _, word in body[1:]], base, held)
    if is_half:
        steps = [(_AND, _HALFWORD, False, held), *steps]
    if offset % 4 or not 0 < len(steps) - is_half <= _STEPS - is_half:
        return None
    if body[-1][1] & 0xFFC0 == _UXTH or (steps[-1][0] > _SUBTRACT_FROM and condition not in _OF_RESULT):
        return None
    loop: Any = structure(LOOP)()
    loop.read_cycle, loop.offset, loop.base = offsets[at], offset, base
    loop.condition, loop.count = condition, len(steps)
    for row, (operation, operand, is_register, result) in zip(loop.steps, steps, strict=False):
        row.operation, row.operand, row.is_register, row.is_flags_only = operation, operand, is_register, result is None
    return loop  # type: ignore[no-any-return]  # ctypes


def _steps(words: list[int], base: int, held: int) -> list[_Step]:
    """Return what instructions make of the value in the register `held`; none where one does anything else."""
    constants = {*range(8)} - {held}
    steps: list[_Step] = []
    for word in words:
        step = _step(word, held)
        if step is None:
            return []
        steps.append(step)
        if step[3] is not None:
            held = step[3]
            constants.discard(held)
    used = {operand for _, operand, is_register, _ in steps if is_register}
    return steps if len(steps) <= _STEPS and {base} | used <= constants else []


def _step(word: int, held: int) -> _Step | None:  # noqa: PLR0911 - one return an encoding
    """Return what an instruction makes of the value that is in the register `held`; None: another one."""
    low, middle, high, wide = word & 7, word >> 3 & 7, word >> 6 & 7, word >> 8 & 7
    if word & 0xF000 == 0x0000:  # LSLS, LSRS
        shift = word >> 6 & 31
        is_plain = shift and middle == held
        return (_SHIFT_RIGHT if word & 0x800 else _SHIFT_LEFT, shift, False, low) if is_plain else None
    if word & 0xFC00 == 0x1800:  # ADDS, SUBS of registers
        return _of_two(_SUBTRACT if word & 0x200 else _ADD, middle, high, held, low)
    if word & 0xFC00 == 0x1C00:  # with 3 bits
        return (_SUBTRACT if word & 0x200 else _ADD, high, False, low) if middle == held else None
    if word & 0xF800 in (0x2800, 0x3000, 0x3800) and wide == held:  # CMP, ADDS, SUBS with 8 bits
        is_sum, is_kept = word & 0xF800 == 0x3000, word & 0x1000
        return _ADD if is_sum else _SUBTRACT, word & 0xFF, False, wide if is_kept else None
    if word & 0xFFC0 == _UXTH and middle == held:  # the only step that leaves the flags alone
        return _AND, _HALFWORD, False, low
    if word & 0xFFC0 == 0x4280:  # CMP
        return _of_two(_SUBTRACT, low, middle, held, None)
    if word & 0xFFC0 in (0x4000, 0x4200):  # ANDS, TST
        return _of_two(_AND, low, middle, held, None if word & 0x200 else low)
    return None


def _of_two(operation: int, first: int, second: int, held: int, result: int | None) -> _Step | None:
    """Return an operation of the value with the other one of two registers."""
    if (first == held) is (second == held):
        return None
    if first == held:
        return operation, second, True, result
    return _SUBTRACT_FROM if operation == _SUBTRACT else operation, first, True, result
