"""The private peripheral bus (`extension/source/core/scs.c`): registers of SCB, NVIC, SysTick, DWT, DEMCR, DBGMCU.

Here stands what C leaves to its caller: requests to the chip, warnings, what traps, and who is told of what.
Not modelled: the MPU (MPU_TYPE reads 0), FPB, ITM, TPIU.

Source: ARMv7-M Architecture Reference Manual B3.2 to B3.4 and C1; PM0056
chapter 4; RM0008 31.6 for DBGMCU.
Invariant: an access to an address without a register reads 0 and is warned of once.
"""

import ctypes
from typing import Protocol

from bluepill_sim.core.nvic import SYSTICK
from bluepill_sim.core.processor import Processor
from bluepill_sim.extension.library import library
from bluepill_sim.extension.windows import field, packed
from simbase.state import Stateful

#: The whole region, as the engine maps it.
PPB_BASE, PPB_BYTES = 0xE000_0000, 0x10_0000

#: Bits of an answer (`enum system_answer`).
_KNOWN, _WRITTEN, _TICKED, _RESET, _DEBUGGER, _TRAPS = (1 << n for n in range(6))
_STK_CTRL, _STK_VAL = 0xE000_E010, 0xE000_E018
_STIR, _USERSETMPEND = 0xE000_EF00, 1 << 1


class SystemControlPorts(Protocol):
    """What these registers need of the chip."""

    @property
    def access_cycle(self) -> int:
        """The time of the accessing instruction, in cycles."""
        ...

    def request_reset(self) -> None:
        """Reset the chip at the next block boundary (SYSRESETREQ)."""
        ...

    def warn(self, message: str, *, once: str) -> None:
        """Warn of what is not modelled."""
        ...


class SystemControl(Stateful):
    """Reads and writes of the private peripheral bus."""

    STATE = ("_demcr", "_dbgmcu_cr", "_cyccnt")

    _demcr = field("demcr", "DEMCR.")
    _dbgmcu_cr: int = field("dbgmcu_cr", "DBGMCU_CR.")
    _cyccnt = packed("cyccnt", "CYCCNT.")

    def __init__(self, processor: Processor, chip: SystemControlPorts) -> None:
        self._core = processor
        self._chip = chip
        self.shared = processor.shared
        self._at = ctypes.addressof(self.shared)
        self._word = ctypes.c_uint32()

    @property
    def dbgmcu_cr(self) -> int:
        """DBGMCU_CR."""
        return self._dbgmcu_cr

    def reset(self) -> None:
        """Go back to the state after a reset; DBGMCU and DEMCR belong to the debugger and stay."""
        library().system_reset(self._at)

    def read(self, offset: int, size: int) -> int:
        """Return what the core reads; `offset` counts from PPB_BASE."""
        address = PPB_BASE + (offset & ~3)
        answer = library().system_read(self._at, address, self._chip.access_cycle, ctypes.addressof(self._word))
        if not answer:
            self._warn(address)
        self._act_on(answer)
        return self._word.value >> 8 * (offset & 3) & (1 << 8 * size) - 1

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the core writes."""
        address, shift = PPB_BASE + (offset & ~3), 8 * (offset & 3)
        mask = ((1 << 8 * size) - 1) << shift
        answer = library().system_write(self._at, address, value << shift & mask, mask, self._chip.access_cycle)
        if not answer:
            self._warn(address)
        self._act_on(answer)
        if not answer & _WRITTEN:
            return
        if _STK_CTRL <= address <= _STK_VAL:
            self._core.systick.was_set()
        self._core.pending_changed()
        self._core.stop_at_boundary()

    def is_modelled(self, offset: int) -> bool:
        """Tell whether there is a register to be read."""
        known: bool = library().system_has(PPB_BASE + (offset & ~3))
        return known

    def is_open_to_all(self, offset: int) -> bool:
        """Tell whether a thread without privilege may write there: STIR, if CCR.USERSETMPEND is set (ARM B3.2.26)."""
        return PPB_BASE + (offset & ~3) == _STIR and bool(self._core.ccr & _USERSETMPEND)

    def _act_on(self, answer: int) -> None:
        if answer & _TICKED:
            self._core.pend(SYSTICK)
        if answer & _RESET:
            self._chip.request_reset()
        if answer & _DEBUGGER:
            self._chip.warn("AIRCR: VECTCLRACTIVE and VECTRESET are a debugger's: ignored", once="AIRCR:debugger")
        if answer & _TRAPS:
            self._core.set_ccr(self._core.ccr)

    def _warn(self, address: int) -> None:
        self._chip.warn(f"{address:#010x} of the system control space is not modelled", once=f"PPB:{address:#x}")
