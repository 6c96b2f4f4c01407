"""A Cortex-M3 that runs basic blocks and counts their cycles.

This is not the processor: exceptions, priorities, sleeping and the meaning of
faults are the business of `processor.py`.

Theory of operation. Unicorn translates a basic block at a time and calls
`_enter_block` before each. There the cost of the block *before* is added,
since only now it is known whether its branch was taken; and there, and nowhere
else, a run ends when its time is up. So a run always stops at a block boundary,
unless an instruction itself ends it: WFI, WFE, SVC, BKPT, exception return, or
a fault.

What Unicorn gets wrong is put right here. An access to a peripheral never stops
the engine (Unicorn would run it twice), it moves `stop_at`. Divisions by zero
and unaligned multiple transfers, which Unicorn lets pass, are caught by hooks on
just those addresses (`Traps`). A hook that ends a run has what ran after it
undone, since Unicorn goes on to the end of an IT block (`stop_before`).

Source: ARMv7-M Architecture Reference Manual A3.2.1, B1.5.8, B3.2.8 (CCR);
unicorn.h, and target/arm of Unicorn 2.1 for the numbers with which a run ends.
Invariant: between runs `cycle` is the time of the boundary that stands at `pc`,
or of the instruction there where `is_inside_block`.
"""

import ctypes
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import ClassVar

from bluepill_sim.core.block_cost import NO_BLOCK, BasicBlock
from bluepill_sim.core.blocks import (
    IT_BITS,
    BlockTable,
    Frozen,
    HostMemory,
    Measure,
    RestOfBlock,
    copy_of,
    it_state_of,
)
from bluepill_sim.core.debugging.debug_unit import DebugUnit, Watchpoint
from bluepill_sim.core.debugging.flash_patch import FlashPatch, View
from bluepill_sim.core.halts import DEBUG_HALTS, Halt, HaltKind
from bluepill_sim.core.recorder import BLOCK, BlockLog, BlockRecorder, KeptRows, LastRows
from bluepill_sim.core.unicorn_core import (
    FETCH_ACCESS,
    FETCH_PROTECTED,
    FETCH_UNMAPPED,
    GENERAL,
    READ_ACCESS,
    SCRATCH_BASE,
    SCRATCH_END,
    WRITE_PROTECTED,
    WRITE_UNMAPPED,
    ReadAccess,
    Reg,
    UnicornCore,
    WriteAccess,
    WriteToReadOnly,
    io_callbacks,
)
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.extension.layout import SHARED, VIEW_BYTES, VIEWS_BASE, VIEWS_BYTES, structure
from bluepill_sim.extension.library import library
from bluepill_sim.extension.windows import NO_TIME
from simbase.state import Stateful
from simbase.timing import Nanos

#: Stops the engine before the instruction at an address: (kind, PC, address of the data).
StopBefore = Callable[[HaltKind, int, int | None], None]
#: Flash and SRAM lie below; peripherals above have rules of their own.
_LAST_NORMAL_ADDRESS = 0x21FF_FFFF

#: BASEPRI has its upper four bits (PM0056 2.1.3), a stack pointer is a multiple of 4 (ARM B1.4.1).
_KEPT_BITS = ((Reg.BASEPRI, 0xF0), (Reg.MSP, 0xFFFF_FFFC), (Reg.PSP, 0xFFFF_FFFC))
#: Branches to these addresses are exception returns in handler mode (ARMv7-M B1.5.8).
FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0

#: The scratch page as a block: it costs nothing.
_SCRATCH_BLOCK = BasicBlock(SCRATCH_BASE, SCRATCH_END, 0, 0, {})

#: Later than any run.
_NEVER = 1 << 62
#: Of an access in a part of the block that ran before a halt: no instruction of the rest has it.
_AN_EARLIER_PC = 0

_T_BIT = 1 << 24
#: Unicorn finds what is mapped here in a hook only after that.
_LAST_PAGE = 0xFFFF_FC00
#: ACTLR: stores are not buffered.
DISDEFWBUF = 1 << 1

#: UC_ERR_EXCEPTION, and the number of the interrupt that it stands for.
_DENIED, _PREFETCH_ABORT = 21, 3

#: 3 and 8 are told apart by the PC.
_INTERRUPTS = {
    2: HaltKind.SUPERVISOR_CALL,
    3: HaltKind.EXECUTE_NEVER,
    4: HaltKind.UNALIGNED,
    7: HaltKind.BKPT,
    8: HaltKind.EXECUTE_NEVER,
    17: HaltKind.NO_COPROCESSOR,
}

_BAD_ACCESSES = {
    WRITE_UNMAPPED: HaltKind.WRITE_ERROR,
    WRITE_PROTECTED: HaltKind.WRITE_ERROR,
    FETCH_UNMAPPED: HaltKind.FETCH_ERROR,
    FETCH_PROTECTED: HaltKind.FETCH_ERROR,
}


class Engine(Stateful):
    """Runs instructions between block boundaries; see the theory of operation above.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    STATE = ("_core", "cycle", "pc", "is_thumb", "has_branched_to_return", "_blocks", "_rest", "log")
    DERIVED: ClassVar[tuple[str, ...]] = (
        "shared",  # its fields are the processor's
        "it_state", "block", "stop_at", "_run_from", "_halt", "_failure", "_frozen", "_table",
        # What a run or a block has for itself alone.
        "_is_stepping", "_lets_writes_through", "_raised_by", "_spoiled", "_ways",
        # Where things are.
        "_read_only", "flash_patch", "_views", "_has_views", "_waits_for_views",
        # Whom it calls, and what it is made of.
        "_log_row", "_block_hook", "registers", "own_points",
    )  # fmt: skip

    def __init__(self, measure: Measure) -> None:
        self._core = self._make_core()
        self._make_state()
        self.registers = self._core.registers
        #: Time of the present boundary, or of the start of the running block, in cycles.
        self.cycle = 0
        #: The run ends at the first boundary at or after this time; 0 ends it at the next one.
        self.stop_at = 0
        #: The next instruction, and whether the T bit is set.
        self.pc = 0
        self.is_thumb = True
        #: The block that is running.
        self.block = NO_BLOCK
        #: Whether a block that may unmask an interrupt ends the run at its boundary.
        self.stops_after_mask_change = False
        #: Tells whether an exception may interrupt now.
        self.is_interrupted: Callable[[], bool] = lambda: False
        # The access that raised the last one: the cycle at which its block began, and its instruction.
        self._raised_by: tuple[int, int] | None = None
        #: Called when the firmware executes SEV.
        self.on_event: Callable[[], None] | None = None
        #: Called with writes to read-only memory, and after the instruction that made them.
        self.on_read_only_write: WriteToReadOnly | None = None
        #: Called with (address, bytes, PC, cycle, when the run ends) of a store to read-only memory: where that
        #: stores what it says and nothing acts meanwhile, returns the cycle at which the core goes on; else None.
        self.on_read_only_write_at_once: Callable[[int, int, int, int, int], int | None] | None = None
        self.on_read_only_written: Callable[[], None] | None = None
        #: Called with a store whose bus error does not stop it: (cycle, PC, address).
        self.on_bus_error: Callable[[int, int, int], None] = lambda _cycle, _pc, _address: None
        self._lets_writes_through = False
        #: Read-only memory, and what such a store has changed there: its address, its place in the host, what it held.
        self._read_only: list[HostMemory] = [self._core.scratch]
        self._spoiled: list[tuple[int, int, bytes]] = []
        #: What the FPB remaps.
        self.flash_patch = FlashPatch()
        self._views: tuple[View, ...] = ()
        self._has_views = self._waits_for_views = False
        self._blocks = BlockTable(measure)
        self._blocks.must_look = self.flash_patch.concerns
        self._table = self._blocks.plain
        self._ways = self._blocks.ways
        self._halt: Halt | None = None
        #: Where the run started: its first block may start inside an IT block.
        self._run_from = 0
        #: Whether a run that failed ended in a branch to an EXC_RETURN value: the next one acts on it.
        self.has_branched_to_return = False
        self._failure: BaseException | None = None
        #: ITSTATE at the start of the next run.
        self.it_state = 0
        self._frozen: Frozen | None = None
        self._rest = RestOfBlock()
        self._is_stepping = False
        #: What ran last; the processor adds the exceptions.
        self.log = BlockLog(self._make_last_rows(), self._fail)
        self._log_row = self.log.add
        self._traps = self._make_traps()
        self._debug = DebugUnit(self._core, self.stop_before)
        #: Addresses that a run halts before; change it between runs as you like.
        self.breakpoints: set[int] = self._debug.breakpoints
        #: Accesses that a run halts after; likewise.
        self.watchpoints: set[Watchpoint] = self._debug.watchpoints
        #: The firmware's, and which of them an access has met.
        self.own_points = self._debug
        self._block_hook = 0
        self._install_hooks()
        self._bad_access_hook = self._core.on_bad_access(self._bad_access)

    def _make_core(self) -> UnicornCore:
        """Make what runs the instructions."""
        return UnicornCore(self._fail)

    def _make_state(self) -> None:
        """Make what holds the state, for an engine that keeps it elsewhere."""
        #: What C sees of the core's state: the system registers.
        self.shared = structure(SHARED)()
        library().system_init(ctypes.addressof(self.shared))

    def _make_last_rows(self) -> KeptRows:
        return LastRows()

    def _make_traps(self) -> "Traps":
        return Traps(self._core, self.stop_before, self._leave_it_block, lambda: self.block)

    def _install_hooks(self) -> tuple[int, ...]:
        """Hook blocks and what ends a run; return the hooks but that of the blocks."""
        self._block_hook = self._core.on_block(self._enter_block)
        return self._core.on_interrupt(self._interrupted), self._core.on_invalid(self._invalid)

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", *, is_writable: bool) -> None:
        """Map a buffer, which may be mapped more than once; writable memory is executable from its first fetch on."""
        self._core.map_memory(address, buffer, "rw" if is_writable else "rx")
        memories = self._blocks.writable if is_writable else self._read_only
        memories.append((address, address + len(buffer), ctypes.addressof(buffer)))

    def map_io(self, address: int, size: int, read: ReadAccess, write: WriteAccess) -> None:
        """Map a region whose accesses are calls; their offsets count from `address`."""
        self._core.map_io(address, size, *io_callbacks(read, write, self._is_denied, self._fail))

    def declare_unclocked(self, address: int, *, is_write: bool, until_ns: Nanos | None = None) -> None:
        """Have a peripheral without its clock read 0 up to a time, None for ever, or ignore writes; without asking.

        That ends with `forget_unclocked`.
        """

    def forget_unclocked(self) -> None:
        """Ask again at each access without a clock."""

    def declare_duplicated(self, address: int) -> None:
        """Have narrow writes to a register duplicated over its word without asking."""

    def declare_zero(self, address: int) -> None:
        """Take note that a word of I/O reads 0 and ignores writes, and that whoever is to hear of it has."""

    def drop_code(self, address: int, size: int) -> None:
        """Forget what was translated and measured from bytes that have changed; not during a run."""
        self.flash_patch.touch(address, size)
        self._core.drop_code(address, size)
        self._blocks.forget_in(address, address + size)

    @property
    def entered_blocks(self) -> frozenset[int]:
        """The first address of every block that was ever entered, whatever a snapshot has taken back."""
        return frozenset(self._blocks.entered)

    @property
    def gone_ways(self) -> frozenset[tuple[int, bool]]:
        """Of each block that was ever left the address at which it ends, and whether it went on elsewhere.

        One that an exception cut, or that it came right after, does not count then.
        """
        return frozenset(self._ways)

    def forget_costs(self) -> None:
        """Measure every block again when it is next entered."""
        self._blocks.forget()

    def set_traps(self, *, division: bool, unaligned: bool) -> None:
        """Choose whether divisions by zero and unaligned single accesses end a run; holds from the next block."""
        if self._traps.choose(division=division, unaligned=unaligned):
            self.stop_at = 0

    # Running.

    def join(self, _fabric: ctypes.c_void_p) -> bool:
        """Take the fabric's events in the engine itself, where it does so; return whether it does."""
        return False

    def run(self, stop_at: int) -> Halt:
        """Run from `pc` to the first block boundary at or after `stop_at` cycles, or to what ends the run before.

        Raises:
            Exception: whatever a peripheral's callback raised.
        """
        halt = self._run(stop_at)
        while halt.kind is HaltKind.TAKEN_WRITE:
            halt = self._step_over_write(halt, stop_at)
            if halt.kind is HaltKind.STEP:
                must_look = self.shared.waits or self.shared.bus_error_cycle != NO_TIME
                halt = Halt(HaltKind.BOUNDARY, halt.pc) if must_look else self._run(stop_at)
        return halt if halt.kind is not HaltKind.WATCHPOINT else self._step_over_access(halt, stop_at)

    def step(self, stop_at: int) -> Halt:
        """Run one instruction: a STEP, or whatever else ends it; what an IT block skips is stepped over."""
        halt = self._step(stop_at)
        if halt.kind is HaltKind.TAKEN_WRITE:
            halt = self._step_over_write(halt, stop_at)
        elif halt.kind is HaltKind.WATCHPOINT:
            halt = self._step_over_access(halt, stop_at)
        self._trim_registers()
        return Halt(HaltKind.STEP, halt.pc) if halt.kind is HaltKind.BOUNDARY else halt

    def jump(self, target: int) -> None:
        """Go on at an address, with its bit 0 as the T bit; leaves the block and the IT block where the core stood."""
        self.pc = target & ~1
        self.is_thumb = bool(target & 1)
        self.it_state = 0
        self._rest.block = None

    @property
    def is_inside_block(self) -> bool:
        """Whether a debugger halted the core inside a block: no boundary, so nothing may interrupt here."""
        return self._rest.is_at(self.pc)

    @property
    def recorder(self) -> BlockRecorder | None:
        """Who is notified of each block and each exception; None for nobody. Set it between runs."""
        return self.log.recorder

    @recorder.setter
    def recorder(self, recorder: BlockRecorder | None) -> None:
        self._set_recorder(recorder)

    def record_accesses(self, points: Iterable[Watchpoint], add: Callable[[int, int], None]) -> None:
        """Call with cycle and PC at each access that one of the points waits for, from now on; no points end it.

        Nothing halts. Between runs; while no blocks are recorded, not all rounds of a loop that waits are run.
        """

        def at_access() -> None:
            if self._frozen is None:
                add(self.access_cycle, self.access_pc)

        self._debug.record(points, at_access)

    def _set_recorder(self, recorder: BlockRecorder | None) -> None:
        self.log.recorder = recorder
        self._log_row = self.log.add

    def _run(self, stop_at: int) -> Halt:
        self.stop_at = stop_at
        debug, traps = self._debug, self._traps
        if (debug.has_points or debug.has_hooks) and not debug.is_armed:
            debug.arm()
        if traps.have_changed:
            traps.apply()
            self.forget_costs()
        if self.flash_patch.has_changed:
            self._apply_patch()
        if self._rest.block is not None:
            self._resume(stop_at)
        while True:
            self._halt = None
            self._run_from = self.pc
            error = self._core.start(self.pc | self.is_thumb)
            self._rest.resumed = None
            if self._failure is not None:
                failure, self._failure = self._failure, None
                self._frozen = None
                self._settle(self.registers[Reg.PC])
                self.has_branched_to_return = self.pc >= FIRST_EXCEPTION_RETURN
                raise failure
            if not traps.stale and not self._waits_for_views:
                break
            self._settle(self.pc)
            traps.arm()
            if self._waits_for_views:
                self._apply_patch()
        if self._frozen is not None:
            return self._thaw(self._frozen)
        self.it_state = 0
        halt = self._halt or _halt_without_reason(error, self.block, self.registers[Reg.PC])
        self._settle(halt.pc)
        return halt

    def _apply_patch(self) -> None:
        """Show fetches and loads what the FPB remaps, between runs."""
        self._waits_for_views = False
        self._views = self.flash_patch.apply([*self._read_only, *self._blocks.writable])
        if self._views and not self._has_views:
            self._has_views = True
            self._core.map_memory(VIEWS_BASE, self.flash_patch.buffer, "rx")
            self._show_pages()
        self._core.drop_pages()
        self._core.drop_all_code()
        self.forget_costs()

    def _show_pages(self) -> None:
        """Have the library ask where each page is."""
        self._core.on_page(self._find_page)

    def _find_page(self, address: int, access: int) -> tuple[int, int] | None:
        if access != FETCH_ACCESS:
            self._leave_it_block()
        for view in self._views:
            if view.page == address & -VIEW_BYTES:
                place = {FETCH_ACCESS: (view.code, 4), READ_ACCESS: (view.data, 1)}
                return place.get(access, (address, 2))
        is_never_executed = 0x4000_0000 <= address < 0x6000_0000 or address >= 0xA000_0000
        if access == FETCH_ACCESS and is_never_executed:
            return None
        hides = VIEWS_BASE <= address < VIEWS_BASE + VIEWS_BYTES
        return (address - VIEWS_BYTES if hides else address), 3 if is_never_executed else 7

    def _step(self, stop_at: int) -> Halt:
        hook = self._debug.begin_step(self.pc)
        self._is_stepping = True
        try:
            return self._run(stop_at)
        finally:
            self._is_stepping = False
            self._debug.end_step(hook)

    def _step_over_access(self, halt: Halt, stop_at: int) -> Halt:
        """Let the instruction make the watched access that it was stopped before."""
        self._debug.ignores_accesses = True
        try:
            after = self.step(stop_at)
        finally:
            self._debug.ignores_accesses = False
        if after.kind is HaltKind.STEP:
            return Halt(HaltKind.WATCHPOINT, after.pc, halt.address)
        return replace(after, watched=halt.address)

    def _step_over_write(self, halt: Halt, stop_at: int) -> Halt:
        """Let the instruction write where it may not, and have put right at once what Unicorn stores there."""
        self._lets_writes_through = True
        if halt.address is not None and halt.address >= _LAST_PAGE:
            self._core.add_sink(halt.address)
            self.on_bus_error(self.cycle, halt.pc, halt.address)
        try:
            return self._step(stop_at)
        finally:
            self._lets_writes_through = False
            self._core.remove_sinks()
            for address, at, data in reversed(self._spoiled):
                ctypes.memmove(at, data, len(data))
                self.drop_code(address, len(data))
            self._spoiled.clear()
            if self.on_read_only_written is not None:
                self.on_read_only_written()

    @property
    def access_cycle(self) -> int:
        """The time of the instruction that is accessing a peripheral, in cycles; the boundary's between runs."""
        block = self.block
        if block is NO_BLOCK:
            return self.cycle
        return self.cycle + block.cycles_until(self.registers[Reg.PC])

    @property
    def access_pc(self) -> int:
        """The instruction that is accessing a peripheral; the next one between runs."""
        return self.pc if self.block is NO_BLOCK else self.registers[Reg.PC]

    def note_raised(self) -> None:
        """Note that the instruction that is accessing a peripheral has raised an exception."""
        self._raised_by = self.cycle, self.access_pc

    def _has_raised(self, cycle: int) -> bool:
        """Whether an access of the block that began at `cycle` has raised an exception."""
        return self._raised_by is not None and self._raised_by[0] == cycle

    def clear_exclusive(self) -> None:
        """Break the exclusive reservation, as an exception does; leaves `pc` alone."""
        if not self._blocks.uses_exclusive:
            return
        saved = self.cycle, self.stop_at, self._log_row
        self.stop_at, self._log_row = _NEVER, lambda row: None  # noqa: ARG005 - the scratch page is not recorded
        self._table[SCRATCH_BASE] = _SCRATCH_BLOCK
        self._core.clear_exclusive()
        self.cycle, self.stop_at, self._log_row = saved
        self.block = NO_BLOCK

    def _restored(self) -> None:
        """Follow the registers; memory was restored before, so that code in it may be another."""
        self.it_state = it_state_of(self.registers[Reg.CPSR])
        self.block = NO_BLOCK
        if self._blocks.ran_writable:
            self._core.drop_all_code()
        if self._blocks.ran_writable or self._blocks.holds_exclusive > self._blocks.uses_exclusive:
            self.forget_costs()

    # Entering blocks.

    def _enter_block(self, _uc: int, address: int, size: int, _user: int) -> None:
        """Charge the block that has ended, then end the run or go on with the block at `address`."""
        try:
            block = self.block
            goes_on = address == block.end
            cycle = self.cycle + (block.straight if goes_on else block.taken)
            self._ways.add((block.end, not goes_on))
            self.cycle = cycle
            if block.changes_masks:
                self._trim_registers()
            if cycle >= self.stop_at:
                self._stop_at_boundary(address)
                return
            known = self._table.get(address)
            if known is None:
                self._enter_special(address, size)
            else:
                self.block = known
                self._log_row((cycle, address, BLOCK))
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller; Ctrl-C arrives here
            self._fail(error)
            self._stop_at_boundary(address)

    def _trim_registers(self) -> None:
        """After an MSR, which ends its block: clear what Unicorn keeps of it and the chip does not have."""
        for register, kept in _KEPT_BITS:
            value = self.registers[register]
            if value & ~kept:
                self.registers[register] = value & kept

    def _enter_special(self, address: int, size: int) -> None:
        """Enter a block that is new, stands in writable memory, or needs attention."""
        if self._rest.block is not None:
            rest, self.stop_at = self._rest.enter(self._table, address, size)
            if rest is not None:
                self.block = rest
                return
        block = self._blocks.at(address, size)
        self._waits_for_views = self.flash_patch.is_stale() and self.flash_patch.concerns(address, size)
        if self._waits_for_views or self._traps.needs_hooks(block):
            self._stop_at_boundary(address)
            return
        if block.is_self_loop and block is self.block and not self._is_stepping:
            # It has gone round once: nothing but an interrupt ends it, so go round until the time is up.
            rounds = max(0, -((self.cycle - self.stop_at) // block.taken))
            self.cycle += rounds * block.taken
            self._stop_at_boundary(address)
            return
        self.block = block
        if block.changes_masks and self.stops_after_mask_change:
            self.stop_at = 0
        if block.sends_event and self.on_event is not None:
            self.on_event()
        if block.is_self_loop:
            self.log.add_spin(self.cycle, address)
        else:
            self._log_row((self.cycle, address, BLOCK))

    def _resume(self, stop_at: int) -> None:
        """Prepare a run that goes on inside a block."""
        if not self.is_inside_block:
            self._rest.block = None
            return
        self._debug.passes = self.pc
        self._raised_by = (self.cycle, _AN_EARLIER_PC) if self._rest.has_raised else None
        self._rest.resume(self._table, stop_at)
        self.stop_at = _NEVER  # this is no boundary

    # Ending runs.

    def _stop_at_boundary(self, address: int) -> None:
        self.block = NO_BLOCK
        self.pc = address
        self._end(HaltKind.BOUNDARY, address)

    def _end(self, kind: HaltKind, pc: int, address: int | None = None) -> None:
        self._halt = Halt(kind, pc, address)
        self._core.stop()

    def _fail(self, error: BaseException) -> None:
        """Keep an exception until the next boundary; an access to a peripheral is never stopped half-way."""
        self._failure = error
        self.stop_at = 0

    def _interrupted(self, number: int) -> None:
        pc = self.registers[Reg.PC]
        self._end(_kind_of_interrupt(number, pc), pc)

    def _invalid(self) -> bool:
        pc = self.registers[Reg.PC]
        kind = _kind_of_invalid(self.block, pc, is_thumb=bool(self.registers[Reg.XPSR] & _T_BIT))
        if kind is not None:
            self._end(kind, pc)
        return True

    def _bad_access(self, access: int, address: int, size: int, value: int) -> bool:
        if self._frozen is not None:
            return False
        may_be_taken = access == WRITE_PROTECTED and self.on_read_only_write is not None
        is_buffered = access in {WRITE_PROTECTED, WRITE_UNMAPPED} and not self.shared.actlr & DISDEFWBUF
        if may_be_taken or is_buffered:
            if not self._lets_writes_through:
                self.stop_before(HaltKind.TAKEN_WRITE, self.registers[Reg.PC], address)
                return False
            taken = self.on_read_only_write if may_be_taken else None
            if taken is not None and taken(address, size, value & (1 << 8 * size) - 1):
                return True
            if is_buffered:
                self._let_fail(access, address, size)
                return True
        if access == FETCH_PROTECTED and (memory := self._blocks.writable_at(address)) is not None:
            self._core.allow_execution(memory[0], memory[1] - memory[0])
            return True
        self._halt = Halt(_BAD_ACCESSES.get(access, HaltKind.READ_ERROR), self.registers[Reg.PC], address)
        return False

    def _let_fail(self, access: int, address: int, size: int) -> None:
        """Let a store pass that changes nothing but is answered by a bus error, later."""
        if access == WRITE_UNMAPPED:
            self._core.add_sink(address)
        else:
            first, _, host = next(memory for memory in self._read_only if memory[0] <= address < memory[1])
            at = host + address - first
            self._spoiled.append((address, at, ctypes.string_at(at, size)))
        self.on_bus_error(self.access_cycle, self.registers[Reg.PC], address)

    def stop_before(self, kind: HaltKind, pc: int, address: int | None = None) -> None:
        """End the run before the instruction at `pc`, from a hook of it; what runs after that is undone."""
        if self._frozen is not None:
            return
        begins_in_it = self.it_state if self.block.start == self._run_from else 0
        self._frozen = Frozen(
            Halt(kind, pc, address),
            self.block,
            self.cycle,
            self.stop_at,
            self.block.it_state_at(pc, begins_in_it),
            self._core.context,
            copy_of(self._blocks.writable),
        )
        self._run_from = self.block.start  # so that accesses to peripherals look, and are not made
        self.stop_at = 0
        self._core.stop()

    def _thaw(self, frozen: Frozen) -> Halt:
        """Put the state back that a hook froze."""
        self._frozen = None
        frozen.put_back(self._core, self._blocks.writable)
        self.block, self.cycle = frozen.block, frozen.cycle
        self.stop_at, self.it_state = frozen.stop_at, frozen.it_state
        halt = frozen.halt
        if halt.kind in DEBUG_HALTS or halt.kind is HaltKind.TAKEN_WRITE:
            self._rest.keep(frozen.block, halt.pc, frozen.stop_at, has_raised=self._has_raised(frozen.cycle))
        self._settle(halt.pc)
        return halt

    def _is_denied(self) -> bool:
        """Prepare an access to a peripheral; return whether it is not to be made."""
        if (self.block.has_it or self.block.start == self._run_from) and self._leave_it_block():
            return True
        return not self.stop_at and self._is_interrupted_here()

    def _is_interrupted_here(self) -> bool:
        """End the run before an access, as at a boundary, where an exception comes before it.

        Else what one block raises several times would be served once. The words of one instruction stay together.
        """
        if self.block is NO_BLOCK or self._frozen is not None or not self.is_interrupted():
            return False
        pc = self.access_pc
        # What came at a halt waits for the boundary, as it would without the halt.
        is_rest = self.block is self._rest.resumed
        must_wait = not self._has_raised(self.cycle) if is_rest else pc == self.block.start
        if (self.cycle, pc) == self._raised_by or must_wait:
            return False
        self.stop_before(HaltKind.BOUNDARY, pc)
        return True

    def _leave_it_block(self) -> bool:
        """Put right what a memory hook does to ITSTATE; return whether the run has ended and access is to be denied.

        To find the PC of an access Unicorn restores the state at that instruction,
        ITSTATE included; but translated code keeps ITSTATE clear while a block runs,
        and the next block would start in the middle of an IT block.
        """
        state = self.registers[Reg.CPSR]
        if state & IT_BITS:
            self.registers[Reg.CPSR] = state & ~IT_BITS
        return self._frozen is not None

    def _settle(self, pc: int) -> None:
        """Charge what of the running block has been run when the core stands at `pc`."""
        block, self.block = self.block, NO_BLOCK
        if block is not NO_BLOCK:
            is_return = pc >= FIRST_EXCEPTION_RETURN  # the refill is part of the exception's exit
            self.cycle += block.straight if is_return else block.cycles_until(pc)
        self.pc = pc
        self.is_thumb = bool(self.registers[Reg.XPSR] & _T_BIT)


def _kind_of_interrupt(number: int, pc: int) -> HaltKind:
    """Return what an exception of Unicorn's own numbering is."""
    kind = _INTERRUPTS.get(number, HaltKind.UNDEFINED)
    if kind is HaltKind.EXECUTE_NEVER and pc >= FIRST_EXCEPTION_RETURN:
        return HaltKind.EXCEPTION_RETURN
    return kind


def _kind_of_invalid(block: BasicBlock, pc: int, *, is_thumb: bool) -> HaltKind | None:
    """Return what an instruction is that Unicorn does not know; None for one that does nothing.

    It takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC.
    """
    last = block.last if pc == block.end else None
    if last is Kind.YIELD:
        return None
    if last is Kind.WAIT_EVENT:
        return HaltKind.WAIT_EVENT
    return HaltKind.UNDEFINED if is_thumb else HaltKind.INVALID_STATE


def _halt_without_reason(error: int, block: BasicBlock, pc: int) -> Halt:
    """Return why Unicorn came back without having called a hook: WFI, or a fetch that its TLB denied.

    Raises:
        RuntimeError: it was neither; a bug here.
    """
    if error == 0 and block.last is Kind.WAIT_INTERRUPT and pc == block.end:
        return Halt(HaltKind.WAIT_INTERRUPT, pc)
    if error == _DENIED:
        return Halt(_kind_of_interrupt(_PREFETCH_ABORT, pc), pc)
    raise RuntimeError(f"Unicorn stopped at {pc:#010x} with error {error}")


class Traps:
    """Hooks on the instructions that may trap; see the theory of operation above.

    A block that has such instructions is translated again with the hooks, the first
    time that it is entered; one in `_armed` was translated with its hooks in place.
    Code that is replaced keeps them.
    """

    def __init__(
        self, core: UnicornCore, stop_before: StopBefore, leave_it_block: Callable[[], object],
        running: Callable[[], BasicBlock],
    ) -> None:  # fmt: skip
        self._core = core
        self._stop_before = stop_before
        self._leave_it_block = leave_it_block
        self._running = running
        #: What is wanted.
        self._division = self._unaligned = False
        #: Whether that has changed since the last run.
        self.have_changed = False
        #: Blocks to be translated again.
        self.stale: list[BasicBlock] = []
        self._watches_alignment = False
        self._trapped: set[tuple[int, int, HaltKind]] = set()
        self._armed: set[tuple[int, tuple[tuple[int, int], ...]]] = set()

    def choose(self, *, division: bool, unaligned: bool) -> bool:
        """Choose what traps; return whether that is new."""
        if division == self._division and unaligned == self._unaligned:
            return False
        self._division, self._unaligned = division, unaligned
        self.have_changed = True
        return True

    def apply(self) -> None:
        """Apply what was chosen, between runs."""
        self.have_changed = False
        if self._unaligned and not self._watches_alignment:
            self._watches_alignment = True
            self._core.on_access(0, _LAST_NORMAL_ADDRESS, self._watch_alignment)

    def needs_hooks(self, block: BasicBlock) -> bool:
        """Tell whether a block must be translated again before it runs, and remember that."""
        if not block.aligned and not block.divides:
            return False
        wanted = self._of(block)
        if not wanted or (block.start, wanted) in self._armed:
            return False
        self.stale.append(block)
        return True

    def arm(self) -> None:
        """Put hooks into the stale blocks, between runs."""
        for block in self.stale:
            self._armed.add((block.start, self._of(block)))
            for address, register in block.aligned:
                self._trap(address, register, HaltKind.UNALIGNED)
            for address, register in self._divides_of(block):
                self._trap(address, register, HaltKind.DIVIDE_BY_ZERO)
            self._core.drop_code(block.start, block.end - block.start)
        self.stale.clear()

    def _of(self, block: BasicBlock) -> tuple[tuple[int, int], ...]:
        return block.aligned + self._divides_of(block)

    def _divides_of(self, block: BasicBlock) -> tuple[tuple[int, int], ...]:
        """Return the divisions to look at: all while the trap is on, else those that may come just after its switch."""
        return block.divides if self._division else block.late_divides

    def may_trap(self, kind: HaltKind, address: int, value: int) -> bool:
        """Tell whether the running block has such an instruction at an address, with this value in its register.

        Hooks stay where code was replaced: what stands there now may be something else.
        """
        block = self._running()
        rows = block.aligned if kind is HaltKind.UNALIGNED else block.divides
        return any(at == address and self._core.registers[GENERAL[number]] == value for at, number in rows)

    def _watch_alignment(self, _access: int, address: int, size: int, _value: int) -> bool:
        if self._unaligned and address % size:
            self._stop_before(HaltKind.UNALIGNED, self._core.registers[Reg.PC], address)
        else:
            self._leave_it_block()
        return True

    def _trap(self, address: int, number: int, kind: HaltKind) -> None:
        """Look at a register each time before the instruction at `address`."""
        if (address, number, kind) in self._trapped:
            return
        self._trapped.add((address, number, kind))
        register = GENERAL[number]

        def look_at_base() -> None:
            value = self._core.registers[register]
            if value & 3 and self.may_trap(kind, address, value):
                self._stop_before(kind, address, value)

        def look_at_divisor() -> None:
            value = self._core.registers[register]
            if self._division and not value and self.may_trap(kind, address, value):
                self._stop_before(kind, address, None)

        self._core.on_instruction(address, look_at_base if kind is HaltKind.UNALIGNED else look_at_divisor)
