"""A Cortex-M3 that runs basic blocks and counts their cycles.

Theory of operation. Unicorn translates a basic block at a time and calls
`_enter_block` before each. There the cost of the block *before* is added,
since only now it is known whether its branch was taken; and there, and nowhere
else, a run ends when its time is up. So a run always stops at a block border,
unless an instruction itself ends it: WFI, WFE, SVC, BKPT, exception return, or
a fault.

This is not the processor: exceptions, priorities, sleeping and the meaning of
faults are the business of `processor.py`. What Unicorn gets wrong is put right here:
a callback of a peripheral never stops the engine (Unicorn would run the
access twice), it moves `stop_at`; divisions by zero and unaligned multiple
transfers, which Unicorn lets pass, are caught by hooks on just those addresses.

Invariant: between runs `cycle` is the time of the border that stands at `pc`.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from bluepill_sim.block_cost import NO_BLOCK, Block
from bluepill_sim.cpu import binding
from bluepill_sim.cpu.registers import GENERAL, Register, RegisterFile
from bluepill_sim.thumb import Kind

#: Reads (offset, size) of an I/O region, writes (offset, size, value).
ReadAccess = Callable[[int, int], int]
WriteAccess = Callable[[int, int, int], None]
#: Takes (address, size, value) written to read-only memory; False refuses it.
WriteToReadOnly = Callable[[int, int, int], bool]
#: Returns the costs of the block of `size` bytes at `address`.
Measure = Callable[[int, int], Block]

# Numbers of unicorn.h, 2.1.
_ARCHITECTURE_ARM, _MODE_THUMB = 1, 16  # not MODE_MCLASS: that silently makes a Cortex-M33
_MODEL_CORTEX_M3 = 8
_HOOK_INTERRUPT, _HOOK_CODE, _HOOK_BLOCK, _HOOK_INVALID = 1, 4, 8, 0x4000
_HOOK_ACCESS, _HOOK_BAD_ACCESS = 0x400 | 0x800, 0x3F0
_ACCESS_WRITE_UNMAPPED, _ACCESS_FETCH_UNMAPPED, _ACCESS_WRITE_PROTECTED, _ACCESS_FETCH_PROTECTED = 20, 21, 22, 24
_PROTECTION_READ, _PROTECTION_WRITE, _PROTECTION_EXECUTE = 1, 2, 4
#: uc_ctl numbers: item | argument count << 26 | direction (write = 1) << 30.
_CONTROL_MODEL = 7 | 1 << 26 | 1 << 30
_CONTROL_DROP_CODE = 9 | 2 << 26 | 1 << 30
_CONTROL_DROP_ALL_CODE = 10 | 1 << 30

#: No instruction stands at an odd address, so a run never ends there.
_NOWHERE = 0xFFFF_FFFF
#: Chosen: a page that no STM32F103 has, executable only; holds CLREX and WFI.
_SCRATCH = 0xF000_0000
_SCRATCH_CODE = bytes.fromhex("bff32f8f 30bf")
#: Branches to these addresses are exception returns in handler mode (ARMv7-M B1.5.8).
FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0
#: Flash and SRAM lie below; peripherals above have rules of their own.
_LAST_NORMAL_ADDRESS = 0x21FF_FFFF
#: Later than any run.
_NEVER = 1 << 62

_T_BIT = 1 << 24


class HaltKind(Enum):
    """Why a run ended."""

    #: At a block border, because `stop_at` was reached.
    BORDER = "border"
    EXCEPTION_RETURN = "exception return"
    SUPERVISOR_CALL = "SVC"
    BREAKPOINT = "BKPT"
    WAIT_INTERRUPT = "WFI"
    WAIT_EVENT = "WFE"
    UNDEFINED = "undefined instruction"
    NO_COPROCESSOR = "no coprocessor"
    INVALID_STATE = "not in Thumb state"
    READ_ERROR = "read of nothing"
    WRITE_ERROR = "write to nothing"
    FETCH_ERROR = "fetch from nothing"
    EXECUTE_NEVER = "fetch from a region that must not be executed"
    DIVIDE_BY_ZERO = "division by zero"
    UNALIGNED = "unaligned access"


@dataclass(frozen=True, slots=True)
class Halt:
    """Why and where a run ended."""

    kind: HaltKind
    #: The next instruction to run; for a fault, the one that failed.
    pc: int
    #: What a failed access was to.
    address: int | None = None


#: What Unicorn's interrupt numbers mean; 3 and 8 are told apart by the PC.
_INTERRUPTS = {
    2: HaltKind.SUPERVISOR_CALL,
    3: HaltKind.EXECUTE_NEVER,
    4: HaltKind.UNALIGNED,
    7: HaltKind.BREAKPOINT,
    8: HaltKind.EXECUTE_NEVER,
    17: HaltKind.NO_COPROCESSOR,
}


class Engine:
    """Runs instructions between block borders; see the module's text.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    def __init__(self, measure: Measure) -> None:
        self._library = library = binding.load_library()
        handle = ctypes.c_void_p()
        self._check(library.open(_ARCHITECTURE_ARM, _MODE_THUMB, ctypes.addressof(handle)), "open")
        self._handle = handle.value or 0
        self._control(_CONTROL_MODEL, ctypes.c_int(_MODEL_CORTEX_M3))
        self._measure = measure
        self.registers = RegisterFile(library, self._handle)
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
        #: Whether UDIV and SDIV by zero end the run (CCR.DIV_0_TRP).
        self.traps_division = False
        #: Called when the firmware executes SEV.
        self.on_event: Callable[[], None] | None = None
        #: Called with writes to read-only memory.
        self.on_read_only_write: WriteToReadOnly | None = None
        self._uses_exclusive = False
        self._traps_unaligned = False
        self._traps_changed = False
        self._watches_alignment = False
        self._table: dict[int, Block] = {}
        self._special: dict[int, Block] = {}
        self._writable_code: dict[int, tuple[bytes, Block]] = {}
        self._writable: list[tuple[int, int, int]] = []
        self._trapped: set[tuple[int, int, HaltKind]] = set()
        self._armed: set[tuple[int, tuple[tuple[int, int], ...]]] = set()
        self._stale: list[Block] = []
        self._halt: Halt | None = None
        self._failure: BaseException | None = None
        self._keep: list[object] = []
        self._add_hooks()
        self._map_scratch()

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", *, is_writable: bool) -> None:
        """Map a buffer as executable memory; it may be mapped more than once."""
        protection = _PROTECTION_READ | _PROTECTION_EXECUTE | (_PROTECTION_WRITE if is_writable else 0)
        size, at = len(buffer), ctypes.addressof(buffer)
        self._check(self._library.map_pointer(self._handle, address, size, protection, at), f"map {address:#x}")
        self._keep.append(buffer)  # Unicorn keeps no reference of its own
        if is_writable:
            self._writable.append((address, address + size, at))

    def map_io(self, address: int, size: int, read: ReadAccess, write: WriteAccess) -> None:
        """Map a region whose accesses are calls; `offset` counts from `address`."""

        def on_read(_uc: int, offset: int, count: int, _user: int) -> int:
            try:
                return read(offset, count)
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller: run() raises it again
                self._fail(error)
                return 0

        def on_write(_uc: int, offset: int, count: int, value: int, _user: int) -> None:
            try:
                write(offset, count, value)
            except BaseException as error:  # noqa: BLE001 - as above
                self._fail(error)

        reader = self._pointer(binding.READ_CALLBACK(on_read))
        writer = self._pointer(binding.WRITE_CALLBACK(on_write))
        self._check(self._library.map_io(self._handle, address, size, reader, None, writer, None), f"map {address:#x}")
        # Only a memory hook makes Unicorn bring the PC up to date before an access; this one costs nothing else.
        self._hook(_HOOK_ACCESS, self._library.no_operation, address, address + size - 1)

    def drop_code(self, address: int, size: int) -> None:
        """Forget what was translated and measured from bytes that have changed; not during a run."""
        self._control(_CONTROL_DROP_CODE, ctypes.c_uint64(address), ctypes.c_uint64(address + size))
        self.forget_costs()

    def set_traps(self, *, division: bool, unaligned: bool) -> None:
        """Choose whether divisions by zero and unaligned single accesses end a run (CCR); holds from the next block."""
        if division == self.traps_division and unaligned == self._traps_unaligned:
            return
        self.traps_division, self._traps_unaligned = division, unaligned
        self._traps_changed = True
        self.stop_at = 0

    def forget_costs(self) -> None:
        """Measure every block again when it is next entered."""
        self._table.clear()
        self._special.clear()
        self._writable_code.clear()

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
            error = self._library.start(self._handle, self.pc | self.is_thumb, _NOWHERE, 0, 0)
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

    def clear_exclusive(self) -> None:
        """Break the exclusive reservation, as an exception does; leaves `pc` alone."""
        if not self._uses_exclusive:
            return
        saved = self.cycle, self.stop_at
        self.stop_at = _NEVER
        self._table[_SCRATCH] = self._scratch_block
        self._library.start(self._handle, _SCRATCH | 1, _NOWHERE, 0, 0)
        self.cycle, self.stop_at = saved
        self.block = NO_BLOCK

    # Snapshots.

    def snapshot(self) -> tuple[bytes, int, int, bool, bool]:
        """Return the core's state: registers as the library keeps them, cycle, PC, T bit, reservation."""
        size = self._library.context_size(self._handle)
        context = self._allocate_context()
        self._check(self._library.context_save(self._handle, context), "save")
        data = ctypes.string_at(context, size)
        self._library.context_free(context)
        return data, self.cycle, self.pc, self.is_thumb, self._uses_exclusive

    def restore(self, snapshot: tuple[bytes, int, int, bool, bool]) -> None:
        """Put back what `snapshot` returned; memory is the caller's business, before this call."""
        data, self.cycle, self.pc, self.is_thumb, self._uses_exclusive = snapshot
        context = self._allocate_context()
        ctypes.memmove(context, data, len(data))
        self._check(self._library.context_restore(self._handle, context), "restore")
        self._library.context_free(context)
        self.block = NO_BLOCK
        if self._writable_code:
            self._control(_CONTROL_DROP_ALL_CODE)
            self._writable_code.clear()

    # What Unicorn calls.

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
            self._writable_code[address] = code, block
        elif block.needs_attention:
            self._special[address] = block
        else:
            self._table[address] = block
        if self._traps_of(block) and self._key_of(block) not in self._armed:
            self._stale.append(block)
            return None
        return block

    def _traps_of(self, block: Block) -> tuple[tuple[int, int], ...]:
        return block.aligned + block.divides if self.traps_division else block.aligned

    def _key_of(self, block: Block) -> tuple[int, tuple[tuple[int, int], ...]]:
        return block.start, self._traps_of(block)

    def _writable_bytes(self, address: int, size: int) -> bytes | None:
        """Return the bytes of a block in writable memory; None elsewhere."""
        for first, end, at in self._writable:
            if first <= address < end:
                return ctypes.string_at(at + address - first, size)
        return None

    def _stop_at_border(self, address: int) -> None:
        self.block = NO_BLOCK
        self.pc = address
        self._halt = Halt(HaltKind.BORDER, address)
        self._library.stop(self._handle)

    def _fail(self, error: BaseException) -> None:
        """Keep an exception until the run has ended; peripherals' accesses are not stopped half-way."""
        self._failure = error
        self.stop_at = 0

    def _interrupted(self, _uc: int, number: int, _user: int) -> None:
        pc = self.registers[Register.PC]
        kind = _INTERRUPTS.get(number, HaltKind.UNDEFINED)
        if kind is HaltKind.EXECUTE_NEVER and pc >= FIRST_EXCEPTION_RETURN:
            kind = HaltKind.EXCEPTION_RETURN
        self._halt = Halt(kind, pc)
        self._library.stop(self._handle)

    def _invalid(self, _uc: int, _user: int) -> bool:
        """Unicorn takes WFE and YIELD for undefined, with the PC already past them; the rest stands at the PC."""
        pc = self.registers[Register.PC]
        if pc == self.block.end and self.block.last in (Kind.YIELD, Kind.WAIT_EVENT):
            if self.block.last is Kind.YIELD:
                return True
            self._halt = Halt(HaltKind.WAIT_EVENT, pc)
        else:
            is_thumb = self.registers[Register.XPSR] & _T_BIT
            self._halt = Halt(HaltKind.UNDEFINED if is_thumb else HaltKind.INVALID_STATE, pc)
        self._library.stop(self._handle)
        return True

    def _bad_access(self, _uc: int, access: int, address: int, size: int, value: int, _user: int) -> bool:
        pc = self.registers[Register.PC]
        if access == _ACCESS_WRITE_PROTECTED and self.on_read_only_write is not None:
            try:
                if self.on_read_only_write(address, size, value & (1 << 8 * size) - 1):
                    return True
            except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
                self._fail(error)
                return True
        if access in (_ACCESS_WRITE_PROTECTED, _ACCESS_WRITE_UNMAPPED):
            kind = HaltKind.WRITE_ERROR
        elif access in (_ACCESS_FETCH_UNMAPPED, _ACCESS_FETCH_PROTECTED):
            kind = HaltKind.FETCH_ERROR
        else:
            kind = HaltKind.READ_ERROR
        self._halt = Halt(kind, pc, address)
        return False

    # Plumbing.

    def _halt_without_reason(self, error: int) -> Halt:
        """Tell why Unicorn came back without having called anything."""
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

    def _change_traps(self) -> None:
        """Look at every block again, with the traps now chosen."""
        self._traps_changed = False
        self.forget_costs()
        if not self._traps_unaligned or self._watches_alignment:
            return
        self._watches_alignment = True

        def on_access(_uc: int, _access: int, address: int, size: int, _value: int, _user: int) -> bool:
            if self._traps_unaligned and address % size:
                self._halt = Halt(HaltKind.UNALIGNED, self.registers[Register.PC], address)
                self._library.stop(self._handle)
            return True

        callback = self._pointer(binding.MEMORY_CALLBACK(on_access))
        self._hook(_HOOK_ACCESS, callback, 0, _LAST_NORMAL_ADDRESS)
        self._control(_CONTROL_DROP_ALL_CODE)

    def _trap_stale_blocks(self) -> None:
        """Put hooks on the instructions that may trap, and have their blocks translated anew with them."""
        for block in self._stale:
            self._armed.add(self._key_of(block))
            for address, register in block.aligned:
                self._trap(address, register, HaltKind.UNALIGNED)
            for address, register in block.divides if self.traps_division else ():
                self._trap(address, register, HaltKind.DIVIDE_BY_ZERO)
            self._control(_CONTROL_DROP_CODE, ctypes.c_uint64(block.start), ctypes.c_uint64(block.end))
        self._stale.clear()

    def _trap(self, address: int, register: int, kind: HaltKind) -> None:
        if (address, register, kind) in self._trapped:
            return
        self._trapped.add((address, register, kind))
        general = GENERAL[register]

        def before(_uc: int, _address: int, _size: int, _user: int) -> None:
            value = self.registers[general]
            if kind is HaltKind.UNALIGNED:
                if value & 3:
                    self._halt = Halt(kind, address, value)
                    self._library.stop(self._handle)
            elif not value and self.traps_division:
                self._halt = Halt(kind, address)
                self._library.stop(self._handle)

        self._hook(_HOOK_CODE, self._pointer(binding.BLOCK_CALLBACK(before)), address, address)

    def _add_hooks(self) -> None:
        callbacks = (
            (_HOOK_BLOCK, binding.BLOCK_CALLBACK(self._enter_block)),
            (_HOOK_INTERRUPT, binding.INTERRUPT_CALLBACK(self._interrupted)),
            (_HOOK_INVALID, binding.INVALID_CALLBACK(self._invalid)),
            (_HOOK_BAD_ACCESS, binding.MEMORY_CALLBACK(self._bad_access)),
        )
        for kind, callback in callbacks:
            self._hook(kind, self._pointer(callback), 1, 0)  # first > last: everywhere

    def _map_scratch(self) -> None:
        buffer = ctypes.create_string_buffer(_SCRATCH_CODE, 0x400)
        self._keep.append(buffer)
        at = ctypes.addressof(buffer)
        self._check(self._library.map_pointer(self._handle, _SCRATCH, 0x400, _PROTECTION_EXECUTE, at), "map scratch")
        self._scratch_block = Block(_SCRATCH, _SCRATCH + len(_SCRATCH_CODE), 0, 0, {})

    def _pointer(self, callback: "ctypes._FuncPointer") -> ctypes.c_void_p:
        self._keep.append(callback)
        return ctypes.cast(callback, ctypes.c_void_p)

    def _hook(self, kind: int, callback: ctypes.c_void_p, first: int, last: int) -> None:
        hook = ctypes.c_size_t()
        at = ctypes.addressof(hook)
        self._check(self._library.add_hook(self._handle, at, kind, callback, None, first, last), "hook")

    def _control(self, item: int, *arguments: object) -> None:
        number = item - (1 << 32) if item >> 31 else item
        self._check(self._library.control(ctypes.c_void_p(self._handle), ctypes.c_int(number), *arguments), "control")

    def _allocate_context(self) -> int:
        context = ctypes.c_void_p()
        self._check(self._library.context_alloc(self._handle, ctypes.addressof(context)), "allocate")
        return context.value or 0

    @staticmethod
    def _check(error: int, what: str) -> None:
        if error:
            raise RuntimeError(f"Unicorn cannot {what}: error {error}")
