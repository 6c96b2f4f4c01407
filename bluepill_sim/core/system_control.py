"""The private peripheral bus: SCB, NVIC and SysTick registers, DWT, DEMCR, DBGMCU.

Registers are declared in tables; the state behind them is the processor's.
Not modelled: the MPU (MPU_TYPE reads 0), FPB, ITM, TPIU, unprivileged access
(on silicon a BusFault).

Source: ARMv7-M Architecture Reference Manual B3.2 to B3.4 and C1; PM0056
chapter 4; RM0008 31.6 for DBGMCU.
Invariant: an access to an address without a register reads 0 and is warned of once.
"""

from collections.abc import Callable
from typing import Protocol

from bluepill_sim.core.nvic import FIRST_IRQ, MEM_MANAGE, NMI, PENDSV, SYSTICK
from bluepill_sim.core.processor import Processor
from bluepill_sim.core.systick import CALIBRATION
from bluepill_sim.stm32f103 import IRQ_COUNT
from simbase.state import Stateful

#: The whole region, as the engine maps it.
PPB_BASE, PPB_BYTES = 0xE000_0000, 0x10_0000

#: Cortex-M3 r1p1 (PM0056 4.4.1).
CPUID = 0x411F_C231
#: Medium density, revision "X" (RM0008 31.6.1).
DBGMCU_IDCODE = 0x2003_6410

_VECTKEY, _VECTKEY_READ = 0x05FA, 0xFA05 << 16
_SYSRESETREQ, _VECTCLRACTIVE, _VECTRESET = 1 << 2, 1 << 1, 1 << 0
_NMIPENDSET, _PENDSVSET, _PENDSVCLR, _PENDSTSET, _PENDSTCLR = (1 << n for n in (31, 28, 27, 26, 25))
_RETTOBASE, _ISRPENDING = 1 << 11, 1 << 22
_CCR_BITS, _SCR_BITS, _SHCSR_ENABLE_BITS = 0x31B, 0x16, 0x7 << 16
_STIR, _USERSETMPEND = 0xE000_EF00, 1 << 1
#: VTOR bits that exist (PM0056 4.4.4).
_VTOR_BITS = 0x3FFF_FF80
_TRCENA, _CYCCNTENA = 1 << 24, 1
#: DWT_CTRL: four comparators, cycle counter present.
_DWT_CTRL = 0x4000_0000
#: SHCSR active and pending bits by exception number.
_SHCSR_ACTIVE = {4: 0, 5: 1, 6: 3, 11: 7, 12: 8, 14: 10, 15: 11}
_SHCSR_PENDING = {6: 12, 4: 13, 5: 14, 11: 15}
_IRQS = (1 << IRQ_COUNT) - 1
_WORD = 0xFFFF_FFFF


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


#: ISER, ICER, ISPR, ICPR, IABR.
_LINE_BASES = (0xE000E100, 0xE000E180, 0xE000E200, 0xE000E280, 0xE000E300)

_Read = Callable[[], int]
#: Takes the word written and the mask of the bytes written.
_Write = Callable[[int, int], None]


class SystemControl(Stateful):
    """Reads and writes of the private peripheral bus."""

    STATE = ("_demcr", "_dbgmcu_cr", "_counts_cycles", "_cycle_base")
    #: Tables that are filled in once.
    DERIVED = ("_readers", "_writers")

    def __init__(self, processor: Processor, chip: SystemControlPorts) -> None:
        self._core = core = processor
        self._nvic = processor.nvic
        self._chip = chip
        #: DEMCR, DBGMCU_CR, and the cycle at which CYCCNT was 0, or its value while it stands still.
        self._demcr = 0
        self._dbgmcu_cr = 0
        self._counts_cycles = False
        self._cycle_base = 0
        self._readers: dict[int, _Read] = {
            0xE0001000: lambda: _DWT_CTRL | self._counts_cycles,
            0xE0001004: self._read_cyccnt,
            0xE000E004: lambda: 1,  # ICTR: 33 to 64 lines
            0xE000E008: lambda: 0,  # ACTLR
            0xE000E010: lambda: core.systick.read_control(chip.access_cycle),
            0xE000E014: core.systick.read_reload,
            0xE000E018: lambda: core.systick.read_value(chip.access_cycle),
            0xE000E01C: lambda: CALIBRATION,
            0xE000ED00: lambda: CPUID,
            0xE000ED04: self._read_icsr,
            0xE000ED08: lambda: core.vector_table,
            0xE000ED0C: lambda: _VECTKEY_READ | self._nvic.priority_grouping << 8,
            0xE000ED10: lambda: core.scr,
            0xE000ED14: lambda: core.ccr,
            0xE000ED24: self._read_shcsr,
            0xE000ED28: lambda: core.cfsr,
            0xE000ED2C: lambda: core.hfsr,
            0xE000ED30: lambda: 0,  # DFSR
            0xE000ED34: lambda: core.mmfar,
            0xE000ED38: lambda: core.bfar,
            0xE000ED90: lambda: 0,  # MPU_TYPE: none
            0xE000EDF0: lambda: 0,  # DHCSR: no debugger
            0xE000EDFC: lambda: self._demcr,
            0xE0042000: lambda: DBGMCU_IDCODE,
            0xE0042004: lambda: self._dbgmcu_cr,
        }
        self._writers: dict[int, _Write] = {
            0xE0001000: self._write_dwt_ctrl,
            0xE0001004: self._write_cyccnt,
            0xE000E008: lambda _value, _mask: None,
            0xE000E010: lambda value, _: core.systick.write_control(value, chip.access_cycle),
            0xE000E014: lambda value, _: core.systick.write_reload(value, chip.access_cycle),
            0xE000E018: lambda _value, _mask: core.systick.write_value(chip.access_cycle),
            0xE000ED04: self._write_icsr,
            0xE000ED08: lambda value, _: setattr(core, "vector_table", value & _VTOR_BITS),
            0xE000ED0C: self._write_aircr,
            0xE000ED10: lambda value, _: setattr(core, "scr", value & _SCR_BITS),
            0xE000ED14: lambda value, _: core.set_ccr(value & _CCR_BITS),
            0xE000ED24: lambda value, _: setattr(core, "shcsr", value & _SHCSR_ENABLE_BITS),
            0xE000ED28: lambda value, mask: setattr(core, "cfsr", core.cfsr & ~(value & mask)),
            0xE000ED2C: lambda value, mask: setattr(core, "hfsr", core.hfsr & ~(value & mask)),
            0xE000ED30: lambda _value, _mask: None,
            0xE000ED34: lambda value, _: setattr(core, "mmfar", value),
            0xE000ED38: lambda value, _: setattr(core, "bfar", value),
            0xE000EDFC: lambda value, _: self._write_demcr(value),
            0xE000EF00: self._write_stir,
            0xE0042004: lambda value, _: setattr(self, "_dbgmcu_cr", value),
        }
        self._add_nvic()

    def reset(self) -> None:
        """Go back to the state after a reset; DBGMCU and DEMCR belong to the debugger and stay."""
        self._counts_cycles = False
        self._cycle_base = 0

    def read(self, offset: int, size: int) -> int:
        """Return what the core reads; `offset` counts from PPB_BASE."""
        address = PPB_BASE + (offset & ~3)
        reader = self._readers.get(address)
        if reader is None:
            self._warn(address)
            return 0
        return reader() >> 8 * (offset & 3) & (1 << 8 * size) - 1

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the core writes."""
        address = PPB_BASE + (offset & ~3)
        writer = self._writers.get(address)
        if writer is None:
            if address not in self._readers:
                self._warn(address)
            return
        shift = 8 * (offset & 3)
        mask = ((1 << 8 * size) - 1) << shift
        value = value << shift & mask
        if mask != _WORD and address not in _WRITE_ONE_REGISTERS:
            value |= self.read(offset & ~3, 4) & ~mask
        writer(value, mask)
        self._core.pending_changed()
        self._core.stop_at_boundary()

    def is_open_to_all(self, offset: int) -> bool:
        """Tell whether a thread without privilege may write there: STIR, if CCR.USERSETMPEND is set (ARM B3.2.26)."""
        return PPB_BASE + (offset & ~3) == _STIR and bool(self._core.ccr & _USERSETMPEND)

    # NVIC.

    def _add_nvic(self) -> None:
        """Put the arrays of registers into the tables: words of lines, and a byte of priority each."""
        for word in range(2):
            self._add_lines(4 * word, 32 * word)
        # What is there for more lines than the chip has reads 0 and ignores writes (ARM B3.4.3); ST's code writes it.
        beyond = [base + 4 * word for base in _LINE_BASES for word in range(2, 8)]
        beyond += range(0xE000E400 + (IRQ_COUNT + 3) // 4 * 4, 0xE000E4F0, 4)
        for address in beyond:
            self._readers[address] = lambda: 0
            self._writers[address] = lambda _value, _mask: None
        for first in range(0, IRQ_COUNT, 4):
            self._add_priorities(0xE000E400 + first, FIRST_IRQ + first)
        for first in range(MEM_MANAGE, FIRST_IRQ, 4):
            self._add_priorities(0xE000ED18 + first - MEM_MANAGE, first)

    def _add_lines(self, offset: int, shift: int) -> None:
        """Add the registers of 32 interrupt lines: ISER, ICER, ISPR, ICPR, IABR."""
        nvic = self._nvic

        def enabled() -> int:
            return nvic.enabled >> shift & _WORD

        def pending() -> int:
            return nvic.pending >> FIRST_IRQ >> shift & _WORD

        def enable(value: int, _mask: int) -> None:
            nvic.enabled |= value << shift & _IRQS

        def disable(value: int, _mask: int) -> None:
            nvic.enabled &= ~(value << shift)

        def pend(value: int, _mask: int) -> None:
            nvic.pending |= (value << shift & _IRQS) << FIRST_IRQ

        def unpend(value: int, _mask: int) -> None:
            nvic.clear_pending_irqs(value << shift & _IRQS)

        for base, reader, writer in (
            (0xE000E100, enabled, enable),
            (0xE000E180, enabled, disable),
            (0xE000E200, pending, pend),
            (0xE000E280, pending, unpend),
        ):
            self._readers[base + offset] = reader
            self._writers[base + offset] = writer
        self._readers[0xE000E300 + offset] = lambda: nvic.active >> FIRST_IRQ >> shift & _WORD

    def _add_priorities(self, address: int, first: int) -> None:
        """Add one word of four priority bytes."""
        nvic = self._nvic

        def read() -> int:
            return int.from_bytes(bytes(nvic.priorities[first : first + 4]), "little")

        def write(value: int, _mask: int) -> None:
            for lane in range(4):
                nvic.set_priority(first + lane, value >> 8 * lane & 0xFF)

        self._readers[address] = read
        self._writers[address] = write

    def _write_stir(self, value: int, _mask: int) -> None:
        """Pend an interrupt by its number; one that the chip does not have is ignored."""
        if value & 0x1FF < IRQ_COUNT:
            self._nvic.pend(FIRST_IRQ + (value & 0x1FF))

    # System control block.

    def _read_icsr(self) -> int:
        nvic, core = self._nvic, self._core
        value = core.exception_number
        following = nvic.first_pending()
        if following is not None:
            value |= following << 12
        if nvic.active.bit_count() <= 1:
            value |= _RETTOBASE
        if nvic.pending >> FIRST_IRQ:
            value |= _ISRPENDING
        for number, bit in ((NMI, _NMIPENDSET), (PENDSV, _PENDSVSET), (SYSTICK, _PENDSTSET)):
            if nvic.pending >> number & 1:
                value |= bit
        return value

    def _write_icsr(self, value: int, _mask: int) -> None:
        nvic = self._nvic
        for bit, number in ((_NMIPENDSET, NMI), (_PENDSVSET, PENDSV), (_PENDSTSET, SYSTICK)):
            if value & bit:
                nvic.pend(number)
        for bit, number in ((_PENDSVCLR, PENDSV), (_PENDSTCLR, SYSTICK)):
            if value & bit:
                nvic.unpend(number)

    def _write_aircr(self, value: int, _mask: int) -> None:
        if value >> 16 != _VECTKEY:
            return
        self._nvic.priority_grouping = value >> 8 & 7
        if value & _SYSRESETREQ:
            self._chip.request_reset()
        if value & (_VECTCLRACTIVE | _VECTRESET):
            self._chip.warn("AIRCR: VECTCLRACTIVE and VECTRESET are a debugger's: ignored", once="AIRCR:debugger")

    def _read_shcsr(self) -> int:
        value = self._core.shcsr
        for number, bit in _SHCSR_ACTIVE.items():
            value |= (self._nvic.active >> number & 1) << bit
        for number, bit in _SHCSR_PENDING.items():
            value |= (self._nvic.pending >> number & 1) << bit
        return value

    # Debug.

    def _read_cyccnt(self) -> int:
        if not self._counts_cycles:
            return self._cycle_base
        return self._chip.access_cycle - self._cycle_base & _WORD

    def _write_cyccnt(self, value: int, _mask: int) -> None:
        self._cycle_base = self._chip.access_cycle - value if self._counts_cycles else value

    def _write_dwt_ctrl(self, value: int, _mask: int) -> None:
        self._set_counting(bool(value & _CYCCNTENA and self._demcr & _TRCENA))

    def _write_demcr(self, value: int) -> None:
        self._demcr = value
        if not value & _TRCENA:
            self._set_counting(False)

    def _set_counting(self, on: bool) -> None:
        """Start or stop CYCCNT at its present value."""
        if on is not self._counts_cycles:
            value = self._read_cyccnt()
            self._counts_cycles = on
            self._write_cyccnt(value, _WORD)

    def _warn(self, address: int) -> None:
        self._chip.warn(f"{address:#010x} of the system control space is not modelled", once=f"PPB:{address:#x}")


#: Registers where a 0 written changes nothing: a narrow write needs no merging.
_WRITE_ONE_REGISTERS = frozenset(
    [base + 4 * word for base in (0xE000E100, 0xE000E180, 0xE000E200, 0xE000E280) for word in range(2)]
    + [0xE000ED04, 0xE000ED28, 0xE000ED2C]
)
