"""The private peripheral bus (`extension/source/core/scs.c`): registers of SCB, NVIC, SysTick, DWT, DEMCR, DBGMCU.

Here stands what C leaves to its caller: requests to the chip, warnings, what traps, and who is notified of what.
The MPU is absent, as on the part: its registers read 0.

Source: ARMv7-M Architecture Reference Manual B3.2 to B3.4 and C1; PM0056
chapter 4; RM0008 31.6 for DBGMCU.
Invariant: an access to an address without a register reads 0 and is warned of once.
"""

import ctypes
from collections.abc import Callable
from typing import Protocol

from bluepill_sim.core.nvic import SYSTICK
from bluepill_sim.core.processor import Processor
from bluepill_sim.extension.library import library
from bluepill_sim.extension.windows import field, packed
from bluepill_sim.fabric.fabric import FabricPorts
from simbase.state import Stateful

#: The whole region, as the engine maps it.
PPB_BASE, PPB_BYTES = 0xE000_0000, 0x10_0000

#: Bits of an answer (`enum system_answer`).
_KNOWN, _WRITTEN, _TICKED, _RESET, _DEBUGGER, _TRAPS, _STIMULUS, _LOOK_OUT = (1 << n for n in range(8))
_CYCCNT = 0xE000_1004
_STK_CTRL, _STK_VAL = 0xE000_E010, 0xE000_E018
_STIR, _USERSETMPEND = 0xE000_EF00, 1 << 1
#: The stimulus ports of the ITM, from PPB_BASE on: a word each, eight share a bit of TPR.
_PORTS_END, _PORTS_A_BIT = 0x80, 8
TRCENA, ITMENA, TSENA, ALL_PORTS = 1 << 24, 1, 2, 0xFFFF_FFFF

#: Takes what was written to a stimulus port: (time in ns, cycle, port, bytes).
StimulusSink = Callable[[int, int, int, bytes], None]


class SystemControlPorts(FabricPorts, Protocol):
    """What these registers need of the chip."""

    def plan_match(self) -> None:
        """Work out when CYCCNT next comes to what the DWT compares it with."""

    def request_reset(self) -> None:
        """Reset the chip at the next block boundary (SYSRESETREQ)."""


#: What else `struct shared` holds of these registers.
_WORDS = (
    "dfsr", "actlr", "dwt_control", "fp_control", "fp_remap", "itm_enables", "itm_privileges", "itm_control",
    "itm_is_open", "tpiu_size", "tpiu_prescaler", "tpiu_protocol", "tpiu_formatter",
)  # fmt: skip
_ARRAYS = ("dwt_counts", "dwt_comp", "dwt_mask", "dwt_function", "fp_comp")


class SystemControl(Stateful):
    """Reads and writes of the private peripheral bus."""

    STATE = ("_demcr", "_dbgmcu_cr", "_cyccnt", *_WORDS, *_ARRAYS)

    for _name in _WORDS:
        locals()[_name] = field(_name, _name)
    for _name in _ARRAYS:
        locals()[_name] = packed(_name, _name)
    _demcr = field("demcr", "DEMCR.")
    _dbgmcu_cr: int = field("dbgmcu_cr", "DBGMCU_CR.")
    _cyccnt = packed("cyccnt", "CYCCNT.")

    def __init__(self, processor: Processor, chip: SystemControlPorts) -> None:
        self._core = processor
        self._chip = chip
        self.shared = processor.shared
        self._at = ctypes.addressof(self.shared)
        self._word = ctypes.c_uint32()
        #: Who listens to the stimulus ports.
        self.stimulus_sinks: list[StimulusSink] = []

    @property
    def dbgmcu_cr(self) -> int:
        """DBGMCU_CR."""
        return self._dbgmcu_cr

    def reset(self) -> None:
        """Go back to the state after a reset; DBGMCU, DEMCR, DWT, FPB, ITM and TPIU belong to the debugger and stay."""
        library().system_reset(self._at)

    def lose_power(self) -> None:
        """Forget what belongs to the debugger, too."""
        library().system_power_up(self._at)
        self._core.look_out()

    def enable_trace(self) -> None:
        """Do what a probe does that wants the trace: TRCENA, ITM and all its ports on, with time stamps."""
        self._demcr |= TRCENA
        self.shared.itm_control |= ITMENA | TSENA
        self.shared.itm_enables = ALL_PORTS

    def read(self, offset: int, size: int) -> int:
        """Return what the core reads; `offset` counts from PPB_BASE."""
        address, cycle = PPB_BASE + (offset & ~3), self._chip.access_cycle
        if address == _CYCCNT:  # as of SysTick's own registers
            self._core.systick.advance_to(cycle)
        answer = library().system_read(self._at, address, cycle, ctypes.addressof(self._word))
        if not answer:
            self._warn(address)
        self._act_on(answer)
        return self._word.value >> 8 * (offset & 3) & (1 << 8 * size) - 1

    def write(self, offset: int, size: int, value: int) -> bool:
        """Take what the core writes; return whether it is modelled."""
        address, shift = PPB_BASE + (offset & ~3), 8 * (offset & 3)
        mask, cycle = ((1 << 8 * size) - 1) << shift, self._chip.access_cycle
        if self.is_modelled(offset) or address == _STIR:  # what is made pending here comes behind a tick before it
            self._core.systick.advance_to(cycle)
        answer = library().system_write(self._at, address, value << shift & mask, mask, cycle)
        if not answer:
            self._warn(address)
        self._act_on(answer)
        if answer & _STIMULUS:
            data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
            for sink in self.stimulus_sinks:
                sink(self._chip.now_ns, self._chip.access_cycle, (offset & ~3) >> 2, data)
        if not answer & _WRITTEN:
            return bool(answer)
        if _STK_CTRL <= address <= _STK_VAL:
            self._core.systick.was_set()
        self._core.pending_changed()
        self._core.stop_at_boundary()
        return True

    def is_modelled(self, offset: int) -> bool:
        """Tell whether there is a register to be read."""
        known: bool = library().system_has(PPB_BASE + (offset & ~3))
        return known

    def is_open_to_all(self, offset: int) -> bool:
        """Tell whether a thread without privilege may write there.

        STIR, if CCR.USERSETMPEND is set (ARM B3.2.26), and stimulus ports whose bit of ITM_TPR is 0 (ARM C1.7.4).
        """
        if offset < _PORTS_END:
            return not self.shared.itm_privileges >> offset // 4 // _PORTS_A_BIT & 1
        return PPB_BASE + (offset & ~3) == _STIR and bool(self._core.ccr & _USERSETMPEND)

    def count_at(self, cycle: int) -> int:
        """Return what CYCCNT reads at a cycle."""
        library().system_read(self._at, _CYCCNT, cycle, ctypes.addressof(self._word))
        return self._word.value

    def _restored(self) -> None:
        self._core.look_out()
        self._chip.plan_match()

    def _act_on(self, answer: int) -> None:
        if answer & _TICKED:
            self._core.pend(SYSTICK)
        if answer & _RESET:
            self._chip.request_reset()
        if answer & _DEBUGGER:
            self._chip.warn("AIRCR: VECTCLRACTIVE and VECTRESET are a debugger's: ignored", once="AIRCR:debugger")
        if answer & _TRAPS:
            self._core.set_ccr(self._core.ccr)
        if answer & _LOOK_OUT:
            self._core.look_out()
            self._chip.plan_match()

    def _warn(self, address: int) -> None:
        self._chip.warn(f"{address:#010x} of the system control space is not modelled", once=f"PPB:{address:#x}")
