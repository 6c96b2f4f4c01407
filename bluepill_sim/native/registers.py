"""The declared registers, handed to the native core: those that only store or are of devices in C need no Python.

    reads plain, writes plain    the register has no `on_read`, or no `on_write`; what is read may be latched
    reads, writes native         the device's file in C does it
    byte lanes                   a narrow write touches only its bytes; else the APB bridge duplicates it over the word
    duplicates                   it stores nothing that is read back: what a bus master's narrow write is duplicated to
                                 changes nothing that would be warned of

An access goes to Python when a device in Python is due before the block ends, when
something is to be warned of for the first time (no clock, a duplicated write), and
for everything else.
"""

import ctypes
from collections.abc import Iterable
from functools import cache
from typing import Any

from bluepill_sim.core import Engine
from bluepill_sim.core.system_control import PPB_BASE
from bluepill_sim.extension.library import library
from bluepill_sim.fabric.registers import NATIVE, WORD, Peripheral, Register
from bluepill_sim.memory.bus import PERIPHERAL_ALIAS, SRAM_ALIAS
from bluepill_sim.native.engine import NativeEngine
from bluepill_sim.peripherals.rcc import Rcc
from bluepill_sim.stm32f103 import CLOCK_GATES, PERIPHERAL_BASE

#: Bits of a register's behaviour (`enum behaviour`); the word that latches stands above them, 0 for none.
_READS_PLAIN, _WRITES_PLAIN, _READS_NATIVE, _WRITES_NATIVE, _BYTE_LANES, _DUPLICATES, _IS_REGISTER = (
    1 << n for n in range(7)
)
_LATCH_SHIFT = 7
#: Masks of a word: `Register.masks`, and the bits that set what a reset leaves at 0.
_MASKS = 5
_PAGE_SHIFT = 10
_PAGE_WORDS = 1 << _PAGE_SHIFT - 2


def share_registers(engine: Engine, parts: Iterable[Peripheral], rcc: Rcc) -> None:
    """Hand the registers of a chip to its engine, if it is a native one."""
    if not isinstance(engine, NativeEngine):
        return
    state, calls = engine.state, library()
    regions = (PERIPHERAL_BASE, PERIPHERAL_ALIAS, SRAM_ALIAS, PPB_BASE)
    calls.core_set_regions(state, *(engine.region_at(base) for base in regions))
    for part in parts:
        kind: Any = type(part)  # a class is hashable, whatever its instances are
        behaviour, masks = _table_of(kind)
        count = len(behaviour)
        gate = CLOCK_GATES.get(part.name)
        at, mask = rcc.gate_address(part.name) if gate is not None else (None, 0)
        words = ctypes.addressof((ctypes.c_uint32 * len(part.words)).from_buffer(part.words))
        first_page = part.base - PERIPHERAL_BASE >> _PAGE_SHIFT
        for first in range(0, count, _PAGE_WORDS):
            calls.core_set_page(
                state, first_page + first // _PAGE_WORDS, words + 4 * first, min(count - first, _PAGE_WORDS), at, mask,
                ctypes.byref(behaviour, 2 * first), ctypes.byref(masks, 4 * _MASKS * first), part.slot,
            )  # fmt: skip


@cache
def _table_of(kind: type[Peripheral]) -> tuple["ctypes.Array[ctypes.c_uint16]", "ctypes.Array[ctypes.c_uint32]"]:
    """Return the behaviour and the masks of each word up to the last register, which the cores of all chips read."""
    count = len(kind.REGISTERS) and max(register.offset for register in kind.REGISTERS) // 4 + 1
    behaviour = (ctypes.c_uint16 * count)()
    masks = (ctypes.c_uint32 * (_MASKS * count))()
    # What looks at each write itself does so for registers that only store, too.
    decided = 0 if kind.write is Peripheral.write else _WRITES_PLAIN
    for register in kind.REGISTERS:
        index = register.offset // 4
        latch = kind.latch_of(register) or 0
        behaviour[index] = (_behaviour(register, has_byte_lanes=kind.HAS_BYTE_LANES) | latch << _LATCH_SHIFT) & ~decided
        masks[_MASKS * index : _MASKS * (index + 1)] = [*register.masks, register.setting & ~register.reset & WORD]
    return behaviour, masks


def _behaviour(register: Register, *, has_byte_lanes: bool) -> int:
    takes = register.writable | register.write_one_to_clear | register.write_zero_to_clear
    return (
        _READS_PLAIN * (register.on_read is None)
        | _WRITES_PLAIN * (register.on_write is None)
        | _READS_NATIVE * (register.on_read == NATIVE)
        | _WRITES_NATIVE * (register.on_write == NATIVE)
        | _BYTE_LANES * has_byte_lanes
        | _DUPLICATES * (not has_byte_lanes and not takes & register.readable)
        | _IS_REGISTER
    )
