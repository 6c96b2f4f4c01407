"""The Cortex-M3 around its instructions: exceptions, priorities, faults, sleep.

Theory of operation. The engine runs blocks and says why it ended; here the
rest of the architecture is done by hand, always at a block boundary:

    pending, enabled, and of a higher priority than what runs  -> enter
    branch to EXC_RETURN  -> tail-chain if something is pending, else unstack
    SVC, fault            -> enter at once, escalated to HardFault if it may not
    HardFault that faults -> lockup: only a reset helps
    WFI, WFE              -> asleep: time jumps to what wakes the core
    buffered store that failed -> one instruction at a time until its error comes

Not modelled: the MPU, which the part lacks; lazy stacking (no FPU).

Source: ARMv7-M Architecture Reference Manual B1.5; TRM r1p1 chapter 5 for cycles.
Invariant: `exception_number` is what IPSR holds in the engine.
"""

import struct
from collections.abc import Callable
from enum import Enum
from typing import Any

from bluepill_sim.core.blocks import it_state_of
from bluepill_sim.core.debugging.comparators import MATCHED, MON_EN, MON_STEP, DebugEvent, points_of
from bluepill_sim.core.engine import FIRST_EXCEPTION_RETURN, Engine
from bluepill_sim.core.faults import FAULT_OF_HALT, FAULT_ROWS, HFSR_FORCED, FaultKind, SeenFault
from bluepill_sim.core.halts import DEBUG_HALTS, Halt, HaltKind
from bluepill_sim.core.nvic import (
    BUS_FAULT,
    DEBUG_MONITOR,
    FIRST_IRQ,
    HARD_FAULT,
    MEM_MANAGE,
    NMI,
    SVCALL,
    SYSTICK,
    Nvic,
    numbers_of,
)
from bluepill_sim.core.recorder import EXCEPTION_RETURN
from bluepill_sim.core.systick import SysTick
from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.extension.windows import field, flag, time
from bluepill_sim.memory.arrays import Memory
from simbase.state import Stateful

#: TRM r1p1 5.7 and 5.9: cycles from the boundary to the first instruction of the handler, and back.
ENTRY_CYCLES, EXIT_CYCLES, TAIL_CHAIN_CYCLES = 12, 12, 6

#: chosen: a cycle of the store, and two of the bus, whose answer ERROR takes two (AMBA 3 AHB-Lite 5.1.3).
_BUS_ERROR_CYCLES = 3
#: DSB and DMB, which wait for the write buffer (TRM r2p0 3.5); an ISB takes longer than it.
_BARRIERS = {bytes((0xBF, 0xF3, option << 4 | 15, 0x8F)) for option in (4, 5)}

#: SHCSR enable bits.
MEMFAULTENA = 1 << 16
#: SCR bits.
SLEEPONEXIT, SLEEPDEEP, SEVONPEND = 1 << 1, 1 << 2, 1 << 4
#: CCR bits; reset value of an STM32F10x (PM0056 4.4.6).
UNALIGN_TRP, DIV_0_TRP, STKALIGN = 1 << 3, 1 << 4, 1 << 9

_FRAME = struct.Struct("<8I")
_FRAME_BYTES = 32
_T_BIT, _IT_BITS, _FLAG_BITS = 1 << 24, 0x0600_FC00, 0xF800_0000
_ALIGN_BIT = 1 << 9
#: T is elsewhere in CPSR than in xPSR; the engine needs its other bits as they are.
_CPSR_T = 1 << 5
_SPSEL, _NPRIV = 2, 1
#: EXC_RETURN without its lowest bit, which a branch strips: to handler, to thread on MSP, to thread on PSP.
_TO_HANDLER, _TO_THREAD_MSP, _TO_THREAD_PSP = 0xFFFF_FFF0, 0xFFFF_FFF8, 0xFFFF_FFFC


class Sleep(Enum):
    """What the core waits for."""

    AWAKE = "awake"
    #: WFI: an interrupt that would be taken if PRIMASK were clear.
    INTERRUPT = "interrupt"
    #: WFE: the event register.
    EVENT = "event"


#: Called with each HardFault taken and each lockup: (kind, PC, address, whether it is a lockup, what was seen then or
#: None for the core as it is).
FaultListener = Callable[[FaultKind, int, int | None, bool, SeenFault | None], None]


class Processor(Stateful):
    """One core; `cycle` is its time."""

    STATE = (
        "engine",
        "nvic",
        "systick",
        "exception_number",
        "sleep",
        "event_register",
        "is_locked_up",
        "last_sleep_cycle",
        "vector_table",
        "scr",
        "ccr",
        "shcsr",
        "cfsr",
        "hfsr",
        "bfar",
        "mmfar",
        "is_stepping",
        "bus_error_cycle",
        "bus_error_pc",
        "bus_error_address",
    )
    #: Taken by the chip at once; what follows from registers.
    DERIVED = ("halt", "_points")

    exception_number: int = field("exception_number", "IPSR.")
    event_register: bool = flag("event_register", "What WFE waits for.")
    last_sleep_cycle: int | None = time("last_sleep_cycle", "When the core last slept; None before the first time.")
    vector_table: int = field("vector_table", "VTOR.")
    scr: int = field("scr", "SCR.")
    ccr: int = field("ccr", "CCR; `set_ccr` acts on it.")
    shcsr: int = field("shcsr", "The enable bits of SHCSR.")
    cfsr: int = field("cfsr", "CFSR.")
    hfsr: int = field("hfsr", "HFSR.")
    mmfar: int = field("mmfar", "MMFAR.")
    bfar: int = field("bfar", "BFAR.")
    bus_error_cycle: int | None = time("bus_error_cycle", "When the error of a buffered store comes; None: none does.")
    bus_error_pc: int = field("bus_error_pc", "The store of the last such error.")
    bus_error_address: int = field("bus_error_address", "What it was to.")
    halts_on_bkpt: bool = flag("has_debugger", "Whether BKPT halts for a debugger; without one it is a fault.")

    def __init__(self, engine: Engine, memory: Memory) -> None:
        self.engine = engine
        #: The state, shared with C.
        self.shared: Any = engine.shared
        self.nvic = Nvic(self.shared)
        self.systick = SysTick(lambda: self.pend(SYSTICK), self.shared)
        self.sleep = Sleep.AWAKE
        self.is_locked_up = False
        self.on_fault: FaultListener | None = None
        #: Called when the core falls asleep with SLEEPDEEP.
        self.on_deep_sleep: Callable[[], None] = lambda: None
        #: Tells whether the chip is to be reset at the next boundary.
        self.awaits_reset: Callable[[], bool] = lambda: False
        #: Called with the cycle to which the entry of an exception has come, to act on what is due by then.
        self.on_entry: Callable[[int], None] = lambda _cycle: None
        #: Why a debugger's halt ended the last run; None where none did.
        self.halt: Halt | None = None
        self.ccr = STKALIGN
        #: Whether DebugMonitor has returned with MON_STEP set: one instruction runs until it comes again.
        self.is_stepping = False
        self._points = points_of(self.shared)
        #: Called with what the registers of FPB and DWT want and is not modelled.
        self.on_unmodelled: Callable[[str], None] = lambda _what: None
        self._memory = memory
        engine.on_event = self.send_event
        engine.on_bus_error = self._expect_bus_error
        engine.is_interrupted = lambda: bool(self.shared.waits) or self.is_interrupted()
        r = Reg
        file = engine.registers
        self._masks = file.batch(r.PRIMASK, r.BASEPRI, r.FAULTMASK)
        self._entry_read = file.batch(r.R0, r.R1, r.R2, r.R3, r.R12, r.LR, r.XPSR, r.SP, r.CONTROL, r.CPSR)
        self._entry_write = file.batch(r.SP, r.IPSR, r.CPSR, r.LR)
        self._return_read = file.batch(r.CONTROL, r.CPSR, r.PSP, r.MSP)
        # CONTROL thrice: nPRIV would forbid the next writes, SPSEL is only taken in thread mode, nPRIV comes last.
        self._return_write = file.batch(
            r.CONTROL, r.IPSR, r.CONTROL, r.SP, r.R0, r.R1, r.R2, r.R3, r.R12, r.LR, r.CONTROL, r.CPSR
        )

    # Time.

    @property
    def cycle(self) -> int:
        """The time of the present boundary, in cycles."""
        return self.engine.cycle

    @property
    def is_asleep(self) -> bool:
        """Whether it waits in WFI or WFE."""
        return self.sleep is not Sleep.AWAKE

    def reset(self, vector_table: int) -> None:
        """Start at the vectors of `vector_table`."""
        self.nvic.reset()
        self.exception_number = 0
        self.sleep = Sleep.AWAKE
        self.event_register = self.is_locked_up = False
        self.bus_error_cycle = None
        self.vector_table = vector_table
        self.scr = self.shcsr = self.cfsr = self.hfsr = self.bfar = self.mmfar = 0
        self.set_ccr(STKALIGN)
        registers = self.engine.registers
        # A faulting handler may have left any of these; nPRIV goes in handler mode, SPSEL only in thread mode.
        registers[Reg.IPSR] = 3
        for register in (
            Reg.CONTROL, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK, Reg.IPSR, Reg.CONTROL
        ):  # fmt: skip
            registers[register] = 0
        registers[Reg.CPSR] = registers[Reg.CPSR] & ~(_IT_BITS | _FLAG_BITS) | _CPSR_T
        registers[Reg.LR] = 0xFFFF_FFFF
        self.engine.clear_exclusive()
        stack = self._memory.read_word(vector_table)
        entry = self._memory.read_word(vector_table + 4)
        if stack is None or entry is None:
            self._lock_up(FaultKind.VECTOR_READ, vector_table, vector_table)
            return
        registers[Reg.SP] = stack & ~3
        self._jump(entry)

    def run(self, stop_at: int) -> None:
        """Go on to the first boundary at or after `stop_at` cycles, or less far; never beyond an event of the core."""
        if self.sleep is not Sleep.AWAKE and not self._wakes():
            self.engine.cycle = max(self.engine.cycle, stop_at)
            return
        if self._bus_error_comes() and self._deliver():
            return
        is_inside = self.engine.is_inside_block
        if self.nvic.pending and not is_inside and self._deliver():
            return
        self.engine.stops_after_mask_change = self.nvic.deliverable() != 0
        if is_inside and self.engine.stops_after_mask_change:
            stop_at = 0  # what came at a halt waits for the boundary, and no longer
        if self._stands_at_return():
            return
        if self.is_stepping:
            self._step_for_monitor(stop_at)
            return
        if self.bus_error_cycle is not None:
            self._step_towards_bus_error(stop_at)
            return
        halt = self.engine.run(stop_at)
        if halt.kind is not HaltKind.BOUNDARY:
            self._act_on(halt)

    def step(self, stop_at: int) -> None:
        """Run one instruction, or enter the exception that comes before it; `halt` says that it is done.

        A core that sleeps goes on to `stop_at`, or wakes.
        """
        if self.sleep is not Sleep.AWAKE and not self._wakes():
            self.engine.cycle = max(self.engine.cycle, stop_at)
            return
        may_interrupt = self._bus_error_comes() or not self.engine.is_inside_block
        if self.nvic.pending and may_interrupt and self._deliver():
            self.halt = Halt(HaltKind.STEP, self.engine.pc)
            return
        self.engine.stops_after_mask_change = self.nvic.deliverable() != 0
        if not self._stands_at_return():
            before = self.engine.pc, self.engine.cycle
            self._act_on(self._step(stop_at))
            if before == (self.engine.pc, self.engine.cycle) and not self.engine.is_inside_block and self._deliver():
                self.halt = None  # the instruction waits for the exception, and that is the step
        if self.halt is None:
            self.halt = Halt(HaltKind.STEP, self.engine.pc)

    def stop_at_boundary(self) -> None:
        """End the running slice at the next block boundary."""
        self.engine.stop_at = 0

    # What others do to the core.

    def pend(self, number: int) -> None:
        """Make an exception pending."""
        self.nvic.pend(number)
        self.pending_changed()

    def pending_changed(self) -> None:
        """Look again at what may interrupt, at the next boundary."""
        if self.scr & SEVONPEND and self.nvic.pending:
            self.event_register = True
        if self.nvic.deliverable():
            self.engine.note_raised()
            self.stop_at_boundary()

    def is_interrupted(self) -> bool:
        """Tell whether an exception is pending that may interrupt what runs."""
        number = self.nvic.first_pending()
        return number is not None and self.nvic.can_preempt(number, self.execution_priority())

    def send_event(self) -> None:
        """Set the event register that WFE waits for."""
        self.event_register = True

    def set_ccr(self, value: int) -> None:
        """Write CCR."""
        self.ccr = value
        self.engine.set_traps(division=bool(value & DIV_0_TRP), unaligned=bool(value & UNALIGN_TRP))

    @property
    def is_privileged(self) -> bool:
        """Whether what runs is a handler, or a thread with CONTROL.nPRIV clear."""
        return bool(self.exception_number) or not self.engine.registers[Reg.CONTROL] & _NPRIV

    def execution_priority(self, *, ignores_primask: bool = False) -> int:
        """Return the priority of what runs, masks included."""
        primask, basepri, faultmask = self._masks.read()
        priority = self.nvic.active_priority()
        basepri &= 0xF0  # the engine keeps the low bits until the block has ended
        if basepri:
            priority = min(priority, self.nvic.group_priority(basepri))
        if primask & 1 and not ignores_primask:
            priority = min(priority, 0)
        if faultmask & 1:
            priority = min(priority, -1)
        return priority

    # Sleep.

    def _wakes(self) -> bool:
        """Wake the core if there is reason to, and tell whether it is awake."""
        number = self.nvic.first_pending()
        if number is not None:
            # An exception that PRIMASK alone holds back wakes WFI, but not WFE.
            priority = self.execution_priority(ignores_primask=self.sleep is Sleep.INTERRUPT)
            if self.nvic.can_preempt(number, priority):
                self.sleep = Sleep.AWAKE
        if self.sleep is Sleep.EVENT and self.event_register:
            self.event_register = False
            self.sleep = Sleep.AWAKE
        return self.sleep is Sleep.AWAKE

    def _fall_asleep(self, sleep: Sleep) -> None:
        self._drain()
        self.last_sleep_cycle = self.cycle
        if sleep is Sleep.EVENT and self.event_register:
            self.event_register = False
            return
        self.sleep = sleep
        if self.scr & SLEEPDEEP and not self._wakes():
            self.on_deep_sleep()

    def is_woken_by(self, lines: int) -> bool:
        """Tell whether one of these interrupt lines (a mask), or the event of a WFE, would wake it."""
        if self.sleep is Sleep.EVENT and self.event_register:
            return True
        priority = self.execution_priority(ignores_primask=self.sleep is Sleep.INTERRUPT)
        wanted = self.nvic.deliverable() & lines << FIRST_IRQ
        return any(self.nvic.can_preempt(number, priority) for number in numbers_of(wanted))

    def wake(self) -> None:
        """End the sleep."""
        self.sleep = Sleep.AWAKE

    def skip_cycles(self, cycles: int, next_tick: int | None) -> None:
        """Have SysTick and CYCCNT leave out cycles that have passed; with the cycle of the next tick before that."""
        self.shared.tick.base += cycles
        self.shared.cyccnt.base += cycles
        self.systick.next_cycle = None if next_tick is None else next_tick + cycles

    # Exceptions.

    def _deliver(self) -> bool:
        """Enter the pending exception that may interrupt, if there is one."""
        number = self.nvic.first_pending()
        if number is None or not self.is_interrupted():
            return False
        self._report_pending(number)
        self._enter(number, self.engine.pc)
        return True

    def _stands_at_return(self) -> bool:
        """Fault where a vector or a stacked PC, not a branch, led to an EXC_RETURN value: it is an address there."""
        engine = self.engine
        if engine.pc < FIRST_EXCEPTION_RETURN or engine.has_branched_to_return:
            engine.has_branched_to_return = False
            return False
        self._fault(FaultKind.EXECUTE_NEVER, self.engine.pc)
        return True

    # Buffered stores.

    def _expect_bus_error(self, cycle: int, pc: int, address: int) -> None:
        """Take that a store was let go that is answered by a bus error."""
        if self.bus_error_cycle is None:
            self.bus_error_cycle = cycle + _BUS_ERROR_CYCLES
            self.bus_error_pc, self.bus_error_address = pc, address

    def _bus_error_comes(self) -> bool:
        """Take the error of a buffered store whose time has come; return whether it has."""
        comes = self.bus_error_cycle is not None and self.cycle >= self.bus_error_cycle
        if comes:
            self._drain()
        return comes

    def _drain(self) -> None:
        """Have the write buffer emptied: the error of a store that is in it comes now (PM0056 4.4.15)."""
        if self.bus_error_cycle is None:
            return
        self.bus_error_cycle = None
        row = FAULT_ROWS[FaultKind.IMPRECISE_WRITE]
        self.cfsr |= row.cfsr
        if self.shcsr & _enable_bit(row.exception):
            self.nvic.pend(row.exception)
        else:
            self.hfsr |= HFSR_FORCED
            self.nvic.pend(HARD_FAULT)

    def _report_pending(self, number: int) -> None:
        """Report a HardFault that was pending: nothing but the error of a buffered store makes it so."""
        if number == HARD_FAULT:
            self._report(FaultKind.IMPRECISE_WRITE, self.bus_error_pc, self.bus_error_address, is_lockup=False)

    def _step(self, stop_at: int) -> Halt:
        """Run one instruction; a barrier waits for the write buffer."""
        if self.bus_error_cycle is None:
            return self.engine.step(stop_at)
        code = self._memory.read(self.engine.pc, 4) or b""
        is_barrier = self.engine.flash_patch.fetched(self.engine.pc, code) in _BARRIERS
        halt = self.engine.step(min(stop_at, self.cycle + 1))  # the error may come before the next block is entered
        if is_barrier and halt.kind is HaltKind.STEP:
            self._drain()
        return halt

    def _step_towards_bus_error(self, stop_at: int) -> None:
        before = self.engine.pc, self.cycle
        halt = self._step(stop_at)
        if halt.kind is not HaltKind.STEP:
            self._act_on(halt)
        elif self.bus_error_cycle is None or before == (self.engine.pc, self.cycle):
            self._deliver()

    # DebugMonitor.

    def look_out(self) -> None:
        """Look out for what the registers of FPB and DWT now say."""
        self._points = points = points_of(self.shared)
        own = self.engine.own_points
        own.own_breakpoints = {*points.breakpoints, *points.instructions}
        own.own_watchpoints = set(points.accesses)
        self.engine.flash_patch.choose(points.remapped)
        for what in points.unmodelled:
            self.on_unmodelled(what)
        self.stop_at_boundary()

    def comparator_matched(self, number: int) -> None:
        """Take that a comparator of the DWT has met what it looks out for."""
        self.shared.dwt_function[number] |= MATCHED
        self.shared.dfsr |= DebugEvent.DWTTRAP
        if self.shared.demcr & MON_EN:
            self.pend(DEBUG_MONITOR)

    def _step_for_monitor(self, stop_at: int) -> None:
        self.is_stepping = False
        halt = self.engine.step(stop_at)
        if halt.kind is not HaltKind.STEP:
            self._act_on(halt)
        self.shared.dfsr |= DebugEvent.HALTED
        self._monitor_now()

    def _monitor_now(self) -> None:
        """Enter DebugMonitor in front of the next instruction; make it pending where it must wait."""
        if not self.shared.demcr & MON_EN:
            return
        if self.sleep is Sleep.AWAKE and self.nvic.can_preempt(DEBUG_MONITOR, self.execution_priority()):
            self._enter(DEBUG_MONITOR, self.engine.pc)
        else:
            self.pend(DEBUG_MONITOR)

    def _take_own_point(self, halt: Halt) -> bool:
        """Act on a point of the firmware's; return whether it was one, and no debugger's."""
        if halt.kind is HaltKind.BREAKPOINT and halt.pc not in self.engine.breakpoints:
            if halt.pc in self._points.breakpoints:
                self._take_breakpoint(halt.pc)
                return True
            number = self._points.instructions.get(halt.pc)
            if number is not None:
                after = self.engine.step(self.engine.cycle)
                if after.kind is not HaltKind.STEP:
                    self._act_on(after)
                self.comparator_matched(number)
            return True  # one that was taken away meanwhile is none
        if halt.kind is HaltKind.WATCHPOINT:
            return self._take_watched()
        return False

    def _take_watched(self) -> bool:
        """Act on a watched access; return whether no debugger waits for it."""
        for point in self.engine.own_points.met:
            if point in self._points.accesses:
                self.comparator_matched(self._points.accesses[point])
        return not self.engine.own_points.is_debuggers

    def _take_breakpoint(self, pc: int) -> None:
        """Do what a BKPT does without a debugger (ARM C1.4.1)."""
        self.shared.dfsr |= DebugEvent.BKPT
        if self.shared.demcr & MON_EN and self.nvic.can_preempt(DEBUG_MONITOR, self.execution_priority()):
            self._enter(DEBUG_MONITOR, pc)
        else:
            self._fault(FaultKind.BREAKPOINT, pc)

    def _act_on(self, halt: Halt) -> None:
        kind = halt.kind
        if kind in DEBUG_HALTS or (kind is HaltKind.BKPT and self.halts_on_bkpt):
            if not self._take_own_point(halt):
                self.halt = halt
            return
        if kind is HaltKind.EXCEPTION_RETURN:
            self._leave(halt.pc)
        elif kind is HaltKind.WAIT_INTERRUPT:
            self._fall_asleep(Sleep.INTERRUPT)
        elif kind is HaltKind.WAIT_EVENT:
            self._fall_asleep(Sleep.EVENT)
        elif kind is HaltKind.BKPT:
            self._take_breakpoint(halt.pc)
        elif kind is HaltKind.SUPERVISOR_CALL:
            if self.nvic.can_preempt(SVCALL, self.execution_priority()):
                self._enter(SVCALL, halt.pc)
            else:
                self._fault(FaultKind.MASKED_SVC, halt.pc)
        else:
            self._fault(FAULT_OF_HALT[kind], halt.pc, halt.address)
        if halt.watched is not None and not self._take_watched():
            self.halt = Halt(HaltKind.WATCHPOINT, self.engine.pc, halt.watched)

    def _enter(self, number: int, return_address: int) -> None:
        """Stack, and start the handler of an exception."""
        r0, r1, r2, r3, r12, lr, xpsr, sp, control, cpsr = self._entry_read.read()
        in_thread = not self.exception_number
        frame_at = sp - _FRAME_BYTES
        xpsr = xpsr & ~(_T_BIT | _ALIGN_BIT) | (_T_BIT if self.engine.is_thumb else 0) | self.exception_number
        if self.ccr & STKALIGN and frame_at & 4:
            frame_at -= 4
            xpsr |= _ALIGN_BIT
        frame_at &= 0xFFFF_FFFF
        exc_return = _TO_HANDLER if not in_thread else _TO_THREAD_PSP if control & _SPSEL else _TO_THREAD_MSP
        frame = _FRAME.pack(r0, r1, r2, r3, r12, lr, return_address, xpsr)
        if not self._memory.write(frame_at, frame):
            number = self._stacking_failed(number, return_address, frame_at)
            if not number:
                return
        began = self.cycle
        self.engine.cycle += ENTRY_CYCLES
        number = self._latest(number)
        self.engine.log.add((began, return_address, number))
        self._start_handler(number, frame_at, exc_return | 1, cpsr)

    def _latest(self, number: int) -> int:
        """Act on what comes while the frame is written; return the exception whose handler starts.

        One that comes late and has a higher priority is it, while the other stays pending (ARM B1.5.9).
        """
        self.on_entry(self.engine.cycle)
        self._drain()
        first = self.nvic.first_pending()
        if first is None or not self._is_before(first, number):
            return number
        if not self._memory.read_word(self.vector_table + 4 * first):
            return number
        self.nvic.pend(number)
        self._report_pending(first)
        return first

    def _is_before(self, first: int, number: int) -> bool:
        return self.nvic.can_preempt(first, self.nvic.group_priority(self.nvic.priority(number)))

    def _stacking_failed(self, number: int, pc: int, frame_at: int) -> int:
        """Return the exception to take in place of one that cannot be stacked; 0 after a lockup."""
        self.cfsr |= FAULT_ROWS[FaultKind.STACKING].cfsr
        if number in {NMI, HARD_FAULT}:
            self._lock_up(FaultKind.STACKING, pc, frame_at)
            return 0
        if self.shcsr & _enable_bit(BUS_FAULT) and self.nvic.can_preempt(BUS_FAULT, self.execution_priority()):
            return BUS_FAULT
        self.hfsr |= HFSR_FORCED
        self._report(FaultKind.STACKING, pc, frame_at, is_lockup=False)
        return HARD_FAULT

    def _start_handler(self, number: int, sp: int, link: int, cpsr: int) -> None:
        """Go to the handler of an exception, with the frame in place."""
        self.nvic.activate(number)
        self.exception_number = number
        self.event_register = True
        self.sleep = Sleep.AWAKE
        self._entry_write.write((sp, number, cpsr & ~_IT_BITS | _CPSR_T, link))
        self.engine.clear_exclusive()
        vector = self._memory.read_word(self.vector_table + 4 * number)
        if vector is None:
            self._vector_failed(number)
        else:
            self._jump(vector)

    def _vector_failed(self, number: int) -> None:
        self.hfsr |= FAULT_ROWS[FaultKind.VECTOR_READ].hfsr
        address = self.vector_table + 4 * number
        if number == HARD_FAULT:
            self._lock_up(FaultKind.VECTOR_READ, self.engine.pc, address)
            return
        self._fault(FaultKind.VECTOR_READ, self.engine.pc, address)

    def _leave(self, exc_return: int) -> None:
        """Return from the handler that runs: chain to the next one, or unstack."""
        self._drain()
        number = self.exception_number
        if not number:
            self._fault(FaultKind.EXECUTE_NEVER, exc_return)
            return
        to_thread = exc_return in {_TO_THREAD_MSP, _TO_THREAD_PSP}
        is_last = self.nvic.active == 1 << number
        if not (to_thread or exc_return == _TO_HANDLER) or to_thread is not is_last:
            self.nvic.deactivate(number)
            self._fault(FaultKind.INVALID_RETURN, exc_return)
            return
        self.nvic.deactivate(number)
        if number != NMI:
            self.engine.registers[Reg.FAULTMASK] = 0
        self.event_register = True
        self.engine.clear_exclusive()
        control, cpsr, psp, msp = self._return_read.read()
        following = self.nvic.first_pending()
        if following is not None and self.nvic.can_preempt(following, self.execution_priority()):
            self._record(exc_return | 1, EXCEPTION_RETURN)
            self._record(exc_return | 1, following)
            self._report_pending(following)
            self._start_handler(following, msp, exc_return | 1, cpsr)
            self.engine.cycle += TAIL_CHAIN_CYCLES
            return
        self._unstack(exc_return, control, cpsr, psp if exc_return == _TO_THREAD_PSP else msp)
        self.engine.cycle += EXIT_CYCLES
        self.is_stepping = number == DEBUG_MONITOR and self.shared.demcr & (MON_STEP | MON_EN) == MON_STEP | MON_EN

    def _unstack(self, exc_return: int, control: int, cpsr: int, frame_at: int) -> None:
        data = self._memory.read(frame_at, _FRAME_BYTES)
        if data is None:
            self._fault(FaultKind.UNSTACKING, exc_return, frame_at)
            return
        r0, r1, r2, r3, r12, lr, pc, xpsr = _FRAME.unpack(data)
        number = xpsr & 0x1FF
        to_thread = exc_return != _TO_HANDLER
        if to_thread is not (number == 0):
            self._fault(FaultKind.INVALID_RETURN, exc_return)
            return
        self.exception_number = number
        stack_select = _SPSEL if exc_return == _TO_THREAD_PSP else 0
        sp = frame_at + _FRAME_BYTES + (4 if xpsr & _ALIGN_BIT else 0)
        kept = _FLAG_BITS | _IT_BITS
        flags = cpsr & ~kept | xpsr & kept | _CPSR_T
        last_control = control & _NPRIV | stack_select
        self._return_write.write((0, number, stack_select, sp, r0, r1, r2, r3, r12, lr, last_control, flags))
        self.engine.jump(pc & ~1 | bool(xpsr & _T_BIT))
        self.engine.it_state = it_state_of(xpsr)
        self._record(self.engine.pc, EXCEPTION_RETURN)
        if to_thread and self.scr & SLEEPONEXIT:
            self._fall_asleep(Sleep.INTERRUPT)

    def _jump(self, target: int) -> None:
        self.engine.jump(target)

    def _record(self, address: int, kind: int) -> None:
        self.engine.log.add((self.cycle, address, kind))

    # Faults.

    def _fault(self, kind: FaultKind, pc: int, address: int | None = None) -> None:
        """Take the exception of a fault, or HardFault where it may not be taken, or lock up."""
        if self.awaits_reset():
            return  # the rest of a block behind the store that asked for it; the chip would not come to it
        row = FAULT_ROWS[kind]
        self.cfsr |= row.cfsr
        self.hfsr |= row.hfsr
        if address is not None and kind in {FaultKind.READ_ERROR, FaultKind.WRITE_ERROR}:
            self.bfar = address
        number = row.exception
        priority = self.execution_priority()
        is_enabled = number == HARD_FAULT or self.shcsr & _enable_bit(number)
        if not is_enabled or not self.nvic.can_preempt(number, priority):
            self.hfsr |= HFSR_FORCED
            number = HARD_FAULT
        if not self.nvic.can_preempt(number, priority):
            self._lock_up(kind, pc, address)
            return
        if number == HARD_FAULT:
            self._report(kind, pc, address, is_lockup=False)
        self._enter(number, pc)

    def _lock_up(self, kind: FaultKind, pc: int, address: int | None) -> None:
        self.is_locked_up = True
        self._report(kind, pc, address, is_lockup=True)

    def _report(
        self, kind: FaultKind, pc: int, address: int | None, *, is_lockup: bool, seen: SeenFault | None = None
    ) -> None:
        if self.on_fault is not None:
            self.on_fault(kind, pc, address, is_lockup, seen)

    def _restored(self) -> None:
        self.set_ccr(self.ccr)


def _enable_bit(number: int) -> int:
    """Return the bit of SHCSR that enables the exception of a fault."""
    return MEMFAULTENA << number - MEM_MANAGE
