"""A Cortex-M3 that runs basic blocks and counts their cycles.

Theory of operation. Unicorn translates a basic block at a time and calls
`_enter_block` before each. There the cost of the block *before* is added,
since only now it is known whether its branch was taken; and there, and nowhere
else, a run ends when its time is up. So a run always stops at a block border,
unless an instruction itself ends it: WFI, WFE, SVC, BKPT, exception return, or
a fault.

This is not the processor: exceptions, priorities, sleeping and the meaning of
faults are the business of `processor.py`. What Unicorn gets wrong is put right
here: an access to a peripheral never stops the engine (Unicorn would run it
twice), it moves `stop_at`; divisions by zero and unaligned multiple transfers,
which Unicorn lets pass, are caught by hooks on just those addresses.

Invariant: between runs `cycle` is the time of the border that stands at `pc`.
"""

import ctypes
from collections.abc import Callable

from bluepill_sim.block_cost import NO_BLOCK, Block
from bluepill_sim.cpu import core
from bluepill_sim.cpu.core import Core, CoreSnapshot
from bluepill_sim.cpu.halt import Halt, HaltKind
from bluepill_sim.cpu.registers import GENERAL, Register
from bluepill_sim.thumb import Kind

#: Reads (offset, size) of an I/O region, writes (offset, size, value).
ReadAccess = Callable[[int, int], int]
WriteAccess = Callable[[int, int, int], None]
#: Takes (address, size, value) written to read-only memory; False refuses it.
WriteToReadOnly = Callable[[int, int, int], bool]
#: Returns the costs of the block of `size` bytes at `address`.
Measure = Callable[[int, int], Block]

#: What Unicorn's interrupt numbers mean; 3 and 8 are told apart by the PC.
_INTERRUPTS = {
    2: HaltKind.SUPERVISOR_CALL,
    3: HaltKind.EXECUTE_NEVER,
    4: HaltKind.UNALIGNED,
    7: HaltKind.BREAKPOINT,
    8: HaltKind.EXECUTE_NEVER,
    17: HaltKind.NO_COPROCESSOR,
}

#: Chosen: a page where an STM32F103C has nothing, outside the regions that never execute; holds CLREX and WFI.
_SCRATCH, _SCRATCH_BYTES = 0x9FFF_FC00, 0x400
_SCRATCH_CODE = bytes.fromhex("bff32f8f 30bf")
_SCRATCH_BLOCK = Block(_SCRATCH, _SCRATCH + len(_SCRATCH_CODE), 0, 0, {})
#: Branches to these addresses are exception returns in handler mode (ARMv7-M B1.5.8).
FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0
#: Flash and SRAM lie below; peripherals above have rules of their own.
_LAST_NORMAL_ADDRESS = 0x21FF_FFFF
#: Later than any run.
_NEVER = 1 << 62

_T_BIT = 1 << 24
#: ITSTATE in CPSR.
_IT_BITS = 0x0600_FC00

#: Registers, cycle, PC, T bit, whether exclusive accesses are used.
EngineSnapshot = tuple[CoreSnapshot, int, int, bool, bool]


class Engine:
    """Runs instructions between block borders; see the module's text.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    def __init__(self, measure: Measure) -> None:
        self._core = Core(self._fail)
        self._measure = measure
        self.registers = self._core.registers
        #: Time of the present border, or of the start of the running block, in cycles.
        self.cycle = 0
        #: The run ends at the first border at or after this time; 0 ends it at the next one.
        self.stop_at = 0
        #: The next instruction, and whether the T bit is set.
        self.pc = 0
        self.is_thumb = True
        #: The block that is running.
        self.block = NO_BLOCK
        #: Whether a block that may unmask an interrupt ends the run at its border.
        self.stops_after_mask_change = False
        #: Called when the firmware executes SEV.
        self.on_event: Callable[[], None] | None = None
        #: Called with writes to read-only memory.
        self.on_read_only_write: WriteToReadOnly | None = None
        # Costs: of blocks that take no attention, of those that do, and of those whose bytes may change.
        self._table: dict[int, Block] = {}
        self._special: dict[int, Block] = {}
        self._writable_code: dict[int, tuple[bytes, Block]] = {}
        #: First address, address after, place in the host's memory.
        self._writable: list[tuple[int, int, int]] = []
        self._ran_writable = False
        self._uses_exclusive = False
        # Traps: what is wanted, hooks that exist, blocks that have them, blocks to be translated again.
        self._traps_division = self._traps_unaligned = self._traps_changed = self._watches_alignment = False
        self._trapped: set[tuple[int, int, HaltKind]] = set()
        self._armed: set[tuple[int, tuple[tuple[int, int], ...]]] = set()
        self._stale: list[Block] = []
        self._halt: Halt | None = None
        #: Where the run started: its first block may start inside an IT block.
        self._run_from = 0
        self._failure: BaseException | None = None
        self._core.on_block(self._enter_block)
        self._core.on_interrupt(self._interrupted)
        self._core.on_invalid(self._invalid)
        self._core.on_bad_access(self._bad_access)
        self._core.map_memory(_SCRATCH, ctypes.create_string_buffer(_SCRATCH_CODE, _SCRATCH_BYTES), "x")

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", *, is_writable: bool) -> None:
        """Map a buffer as executable memory; it may be mapped more than once."""
        self._core.map_memory(address, buffer, "rwx" if is_writable else "rx")
        if is_writable:
            self._writable.append((address, address + len(buffer), ctypes.addressof(buffer)))

    def map_io(self, address: int, size: int, read: ReadAccess, write: WriteAccess) -> None:
        """Map a region whose accesses are calls; their offsets count from `address`."""

        def on_read(_uc: int, offset: int, count: int, _user: int) -> int:
            try:
                if self.block.has_it or self.block.start == self._run_from:
                    self._leave_it_block()
                return read(offset, count)
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
                self._fail(error)
                return 0

        def on_write(_uc: int, offset: int, count: int, value: int, _user: int) -> None:
            try:
                if self.block.has_it or self.block.start == self._run_from:
                    self._leave_it_block()
                write(offset, count, value)
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
                self._fail(error)

        self._core.map_io(address, size, on_read, on_write)

    def drop_code(self, address: int, size: int) -> None:
        """Forget what was translated and measured from bytes that have changed; not during a run."""
        self._core.drop_code(address, size)
        self.forget_costs()

    def forget_costs(self) -> None:
        """Measure every block again when it is next entered."""
        self._table.clear()
        self._special.clear()
        self._writable_code.clear()

    def set_traps(self, *, division: bool, unaligned: bool) -> None:
        """Choose whether divisions by zero and unaligned single accesses end a run; holds from the next block."""
        if division != self._traps_division or unaligned != self._traps_unaligned:
            self._traps_division, self._traps_unaligned = division, unaligned
            self._traps_changed = True
            self.stop_at = 0

    # Running.

    def run(self, stop_at: int) -> Halt:
        """Run from `pc` to the first block border at or after `stop_at` cycles, or to what ends the run before.

        Raises:
            Exception: whatever a peripheral's callback raised.
        """
        self.stop_at = stop_at
        if self._traps_changed:
            self._change_traps()
        while True:
            self._halt = None
            self._run_from = self.pc
            error = self._core.start(self.pc | self.is_thumb)
            if self._failure is not None:
                failure, self._failure = self._failure, None
                self._settle(self.registers[Register.PC])
                raise failure
            if not self._stale:
                break
            self._settle(self.pc)
            self._trap_stale_blocks()
        halt = self._halt or self._halt_without_reason(error)
        self._settle(halt.pc)
        return halt

    @property
    def access_cycle(self) -> int:
        """The time of the instruction that is accessing a peripheral, in cycles; the border's between runs."""
        block = self.block
        if block is NO_BLOCK:
            return self.cycle
        return self.cycle + block.cycles_until(self.registers[Register.PC])

    @property
    def access_pc(self) -> int:
        """The instruction that is accessing a peripheral; the next one between runs."""
        return self.pc if self.block is NO_BLOCK else self.registers[Register.PC]

    def clear_exclusive(self) -> None:
        """Break the exclusive reservation, as an exception does; leaves `pc` alone."""
        if not self._uses_exclusive:
            return
        saved = self.cycle, self.stop_at
        self.stop_at = _NEVER
        self._table[_SCRATCH] = _SCRATCH_BLOCK
        self._core.start(_SCRATCH | 1)
        self.cycle, self.stop_at = saved
        self.block = NO_BLOCK

    # Snapshots.

    def snapshot(self) -> EngineSnapshot:
        """Return the core's state, memory left aside."""
        return self._core.save(), self.cycle, self.pc, self.is_thumb, self._uses_exclusive

    def restore(self, snapshot: EngineSnapshot) -> None:
        """Put back what `snapshot` returned; memory is the caller's business, before this call."""
        registers, self.cycle, self.pc, self.is_thumb, self._uses_exclusive = snapshot
        self._core.load(registers)
        self.block = NO_BLOCK
        if self._ran_writable:
            self._core.drop_all_code()
            self._writable_code.clear()

    # Entering blocks.

    def _enter_block(self, _uc: int, address: int, size: int, _user: int) -> None:
        """Charge the block that has ended, then end the run or go on with the block at `address`."""
        try:
            block = self.block
            cycle = self.cycle + (block.straight if address == block.end else block.taken)
            self.cycle = cycle
            if cycle >= self.stop_at:
                self._stop_at_border(address)
                return
            known = self._table.get(address)
            if known is None:
                self._enter_special(address, size)
            else:
                self.block = known
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller; Ctrl-C arrives here
            self._fail(error)
            self._stop_at_border(address)

    def _enter_special(self, address: int, size: int) -> None:
        """Enter a block that is new, stands in writable memory, or needs attention."""
        block = self._special.get(address) or self._block_at(address, size)
        if block is None:
            self._stop_at_border(address)
            return
        if block.is_self_loop and block is self.block:
            # It has gone round once: nothing but an interrupt ends it, so go round until the time is up.
            rounds = max(0, -((self.cycle - self.stop_at) // block.taken))
            self.cycle += rounds * block.taken
            self._stop_at_border(address)
            return
        self.block = block
        if block.changes_masks and self.stops_after_mask_change:
            self.stop_at = 0
        if block.sends_event and self.on_event is not None:
            self.on_event()

    def _block_at(self, address: int, size: int) -> Block | None:
        """Return the block at `address`; None where it has to be translated again with traps in it."""
        code = self._writable_bytes(address, size)
        if code is not None:
            known = self._writable_code.get(address)
            if known is not None and known[0] == code:
                return known[1]
        block = self._measure(address, size)
        self._uses_exclusive |= block.has_exclusive
        if code is not None:
            self._ran_writable = True
            self._writable_code[address] = code, block
        elif block.needs_attention:
            self._special[address] = block
        else:
            self._table[address] = block
        traps = self._traps_of(block)
        if traps and (address, traps) not in self._armed:
            self._stale.append(block)
            return None
        return block

    def _writable_bytes(self, address: int, size: int) -> bytes | None:
        """Return the bytes of a block in writable memory; None elsewhere."""
        for first, end, at in self._writable:
            if first <= address < end:
                return ctypes.string_at(at + address - first, size)
        return None

    # Ending runs.

    def _stop_at_border(self, address: int) -> None:
        self.block = NO_BLOCK
        self.pc = address
        self._end(HaltKind.BORDER, address)

    def _end(self, kind: HaltKind, pc: int, address: int | None = None) -> None:
        self._halt = Halt(kind, pc, address)
        self._core.stop()

    def _fail(self, error: BaseException) -> None:
        """Keep an exception until the next border; an access to a peripheral is never stopped half-way."""
        self._failure = error
        self.stop_at = 0

    def _interrupted(self, number: int) -> None:
        pc = self.registers[Register.PC]
        kind = _INTERRUPTS.get(number, HaltKind.UNDEFINED)
        if kind is HaltKind.EXECUTE_NEVER and pc >= FIRST_EXCEPTION_RETURN:
            kind = HaltKind.EXCEPTION_RETURN
        self._end(kind, pc)

    def _invalid(self) -> bool:
        """Unicorn takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC."""
        pc = self.registers[Register.PC]
        last = self.block.last if pc == self.block.end else None
        if last is Kind.YIELD:
            return True
        if last is Kind.WAIT_EVENT:
            self._end(HaltKind.WAIT_EVENT, pc)
        else:
            is_thumb = self.registers[Register.XPSR] & _T_BIT
            self._end(HaltKind.UNDEFINED if is_thumb else HaltKind.INVALID_STATE, pc)
        return True

    def _bad_access(self, access: int, address: int, size: int, value: int) -> bool:
        is_protected = access == core.WRITE_PROTECTED
        if is_protected and self.on_read_only_write is not None:
            word = value & (1 << 8 * size) - 1
            if self.on_read_only_write(address, size, word):
                return True
        if is_protected or access == core.WRITE_UNMAPPED:
            kind = HaltKind.WRITE_ERROR
        elif access in (core.FETCH_UNMAPPED, core.FETCH_PROTECTED):
            kind = HaltKind.FETCH_ERROR
        else:
            kind = HaltKind.READ_ERROR
        self._halt = Halt(kind, self.registers[Register.PC], address)
        return False

    def _leave_it_block(self) -> None:
        """Put right what a memory hook does to ITSTATE.

        To find the PC of an access Unicorn restores the state at that instruction,
        ITSTATE included; but translated code keeps ITSTATE clear while a block runs,
        and the next block would start in the middle of an IT block.
        """
        state = self.registers[Register.CPSR]
        if state & _IT_BITS:
            self.registers[Register.CPSR] = state & ~_IT_BITS

    def _halt_without_reason(self, error: int) -> Halt:
        """Tell why Unicorn came back without having called anything: WFI is the only way."""
        pc = self.registers[Register.PC]
        if error == 0 and self.block.last is Kind.WAIT_INTERRUPT and pc == self.block.end:
            return Halt(HaltKind.WAIT_INTERRUPT, pc)
        raise RuntimeError(f"Unicorn stopped at {pc:#010x} with error {error}")

    def _settle(self, pc: int) -> None:
        """Charge what of the running block has been run when the core stands at `pc`."""
        block, self.block = self.block, NO_BLOCK
        if block is not NO_BLOCK:
            is_return = pc >= FIRST_EXCEPTION_RETURN  # the refill is part of the exception's exit
            self.cycle += block.straight if is_return else block.cycles_until(pc)
        self.pc = pc
        self.is_thumb = bool(self.registers[Register.XPSR] & _T_BIT)

    # Traps.

    def _traps_of(self, block: Block) -> tuple[tuple[int, int], ...]:
        return block.aligned + self._divides_of(block)

    def _divides_of(self, block: Block) -> tuple[tuple[int, int], ...]:
        """Return the divisions to look at: all while the trap is on, else those that may come just after its switch."""
        return block.divides if self._traps_division else block.late_divides

    def _change_traps(self) -> None:
        """Look at every block again, with the traps now chosen."""
        self._traps_changed = False
        self.forget_costs()
        if self._traps_unaligned and not self._watches_alignment:
            self._watches_alignment = True
            self._core.on_access(0, _LAST_NORMAL_ADDRESS, self._watch_alignment)

    def _watch_alignment(self, _access: int, address: int, size: int, _value: int) -> bool:
        if self._traps_unaligned and address % size:
            self._end(HaltKind.UNALIGNED, self.registers[Register.PC], address)
        elif self.block.has_it or self.block.start == self._run_from:
            self._leave_it_block()
        return True

    def _trap_stale_blocks(self) -> None:
        """Put hooks on the instructions that may trap, and have their blocks translated anew with them."""
        for block in self._stale:
            self._armed.add((block.start, self._traps_of(block)))
            for address, register in block.aligned:
                self._trap(address, register, HaltKind.UNALIGNED)
            for address, register in self._divides_of(block):
                self._trap(address, register, HaltKind.DIVIDE_BY_ZERO)
            self._core.drop_code(block.start, block.end - block.start)
        self._stale.clear()

    def _trap(self, address: int, number: int, kind: HaltKind) -> None:
        """Look at a register each time before the instruction at `address`."""
        if (address, number, kind) in self._trapped:
            return
        self._trapped.add((address, number, kind))
        register = GENERAL[number]

        def look_at_base() -> None:
            value = self.registers[register]
            if value & 3:
                self._end(kind, address, value)

        def look_at_divisor() -> None:
            if self._traps_division and not self.registers[register]:
                self._end(kind, address)

        self._core.on_instruction(address, look_at_base if kind is HaltKind.UNALIGNED else look_at_divisor)
