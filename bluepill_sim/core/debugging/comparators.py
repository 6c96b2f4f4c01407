"""What the comparators of FPB and DWT look out for, and DebugMonitor, which firmware has them call.

A breakpoint of the FPB is a BKPT in front of its instruction: DebugMonitor, where MON_EN and its priority allow, else
HardFault. A comparator of the DWT makes DebugMonitor pending behind the instruction that it was about; without MON_EN
it does nothing. Where a debugger has the same point, it is the debugger's.

Chosen: comparators count from the next block on; an access meets one if any byte of it does; events that
DebugMonitor's priority does not allow wait, as those of the DWT do.
What the FPB remaps is `flash_patch.py`'s.
Not modelled, and warned of: the DWT's data values and the packets that it puts into the trace.

Source: ARMv7-M Architecture Reference Manual C1.4 (DebugMonitor), C1.8 (DWT), C1.11 (FPB).
Invariant: the points are those that the registers say, since `Processor.look_out` was called last.
"""

from dataclasses import dataclass
from enum import IntFlag
from typing import Any

from bluepill_sim.core.debugging.debug_unit import WatchKind, Watchpoint
from bluepill_sim.core.debugging.flash_patch import Remapped
from bluepill_sim.stm32f103 import SRAM_BASE

#: DEMCR.
MON_EN, MON_STEP, TRCENA = 1 << 16, 1 << 18, 1 << 24
MATCHED = 1 << 24
_ENABLE, _FUNCTION, _CYCMATCH, _DATAVMATCH, _PC_MATCH = 1, 15, 1 << 7, 1 << 8, 4
_WATCHES = {5: WatchKind.READ, 6: WatchKind.WRITE, 7: WatchKind.ACCESS}
_CODE_COMPARATORS, _LOWER, _UPPER, _ADDRESS = 6, 1, 2, 0x1FFF_FFFC
#: chosen: the largest range of instructions of a comparator of the DWT, by its mask; larger ones are cut to it.
_MOST_MASK = 10
_COUNTS = 1 << 32


class DebugEvent(IntFlag):
    """DFSR."""

    #: MON_STEP.
    HALTED = 1 << 0
    BKPT = 1 << 1
    DWTTRAP = 1 << 2


@dataclass(frozen=True, slots=True)
class Points:
    """What is looked out for."""

    #: Of the FPB, and of the DWT with the number of the comparator.
    breakpoints: frozenset[int]
    instructions: dict[int, int]
    accesses: dict[Watchpoint, int]
    remapped: Remapped
    #: What of it is not modelled.
    unmodelled: tuple[str, ...] = ()


def points_of(shared: Any) -> Points:
    """Return what the registers in `struct shared` have the core look out for."""
    unmodelled: list[str] = []
    comparators = tuple(shared.fp_comp) if shared.fp_control & _ENABLE else ()
    instructions: dict[int, int] = {}
    accesses: dict[Watchpoint, int] = {}
    if shared.demcr & MON_EN and shared.demcr & TRCENA:
        for n, function in enumerate(shared.dwt_function):
            size = 1 << min(shared.dwt_mask[n], _MOST_MASK)
            at, kind = shared.dwt_comp[n] & ~(size - 1), function & _FUNCTION
            if function & _DATAVMATCH or (kind and kind not in {_PC_MATCH, *_WATCHES}):
                unmodelled.append("DWT_FUNCTION: data values and trace packets")
            elif n == 0 and function & _CYCMATCH:
                continue
            elif kind == _PC_MATCH:
                instructions |= dict.fromkeys(range(at & ~1, at + size, 2), n)
            elif kind:
                accesses[Watchpoint(at, size, _WATCHES[kind])] = n
    # The FPB's table is in SRAM (ARM C1.11.4: bits 31 to 29 of FP_REMAP are 001).
    remapped = _remapped(comparators, SRAM_BASE + shared.fp_remap)
    return Points(_breakpoints(comparators), instructions, accesses, remapped, tuple(unmodelled))


def _breakpoints(comparators: tuple[int, ...]) -> frozenset[int]:
    return frozenset(
        (word & _ADDRESS) + 2 * (half - 1)
        for word in comparators[:_CODE_COMPARATORS]
        for half in (_LOWER, _UPPER)
        if word & _ENABLE and word >> 30 & half
    )


def _remapped(comparators: tuple[int, ...], table: int) -> Remapped:
    words = [(word & _ADDRESS, n) for n, word in enumerate(comparators) if word & _ENABLE and not word >> 30]
    if not words:
        return Remapped()
    return Remapped(
        table,
        tuple(row for row in words if row[1] < _CODE_COMPARATORS),
        tuple(row for row in words if row[1] >= _CODE_COMPARATORS),
    )


def cycles_to_match(shared: Any, count: int) -> int | None:
    """Return in how many cycles CYCCNT, which reads `count`, comes to COMP0; None where nobody looks out for it."""
    function = shared.dwt_function[0]
    is_wanted = function & _CYCMATCH and function & _FUNCTION == _PC_MATCH
    if not is_wanted or not shared.demcr & MON_EN or not shared.demcr & TRCENA or not shared.cyccnt.runs:
        return None
    return int(shared.dwt_comp[0] - count - 1) % _COUNTS + 1
