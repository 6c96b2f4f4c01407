"""An engine whose blocks are entered in C: the same runs, without Python at each boundary.

Theory of operation. The state of a run stands in a struct of the C core, and
the attributes of `Engine` are windows on it. C charges blocks, ends runs,
answers plain registers and does exceptions of the ordinary kind; it calls
Python for a block that it does not know, for a register with side effects, and
for an instruction that traps.

A debugger's watchpoints and steps, and the rest of a block after a halt, are
Python's business: for those runs the hooks are exchanged, and this is `Engine`.

Invariant: `shared.is_python` tells whose hooks are in place; between runs all
state is in `shared`, whichever of them ran last.
"""

import ctypes
import re
import weakref
from collections.abc import Callable
from typing import Any

from bluepill_sim.core.accesses import Access, accesses_of, is_ambiguous, may_end_in_it
from bluepill_sim.core.block_cost import NO_BLOCK, BasicBlock
from bluepill_sim.core.engine import Engine, StopBefore, Traps
from bluepill_sim.core.halts import Halt, HaltKind
from bluepill_sim.core.recorder import RECORD, BlockRecorder, KeptRows
from bluepill_sim.core.unicorn_core import (
    GENERAL,
    SCRATCH_BASE,
    RawRead,
    RawWrite,
    ReadAccess,
    Reg,
    UnicornCore,
    WriteAccess,
    io_callbacks,
)
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.extension.library import (
    ACCESS_CYCLE,
    ACCESS_PC,
    BAD_ACCESS,
    READ,
    RECORDED,
    TRAPPED,
    UNICORN_FUNCTIONS,
    UNKNOWN_BLOCK,
    WRITE,
    WRITE_AT_ONCE,
    Callbacks,
    UnicornApi,
    address_of,
    is_exact_wanted,
    is_interpreter_wanted,
    library,
    made,
)
from bluepill_sim.extension.windows import NO_TIME, field, flag
from bluepill_sim.native.interpreter_core import InterpreterCore
from bluepill_sim.native.polling import loop_of
from bluepill_sim.native.state import (
    BOUNDARY,
    DELIVER,
    FAILED,
    FROZEN,
    HALT_KINDS,
    HALT_NUMBERS,
    STALE,
    UNEXPLAINED,
    InstructionRow,
    NativeLastRows,
    Shared,
)
from simbase.c_library import guarded
from simbase.timing import Nanos

#: Flags of a row (`enum row_flag`).
_CHANGES_MASKS, _SENDS_EVENT, _SELF_LOOP, _WRITABLE, _NOTED, _AMBIGUOUS = 1, 2, 4, 8, 128, 256
_ENDS = {Kind.WAIT_INTERRUPT: 16, Kind.WAIT_EVENT: 32, Kind.YIELD: 64}
_NO_BLOCK_START = 0xFFFF_FFFF
#: IT and the four instructions that may follow in its block.
_IT_BLOCK_BYTES = 2 + 4 * 4
#: Chosen: a block up to this size is never cut by Unicorn's buffer, so that its rest ends where it does.
_WHOLE_BYTES = 256
#: Chosen: at least so often Python handles signals, such as Ctrl-C.
_SLICE_CYCLES = 20_000_000
#: Later than any run.
_NEVER = 1 << 62
#: The flash stands at 0 too; a page of it.
_FLASH_ALIAS, _PAGE_SHIFT = 0x0800_0000, 10
#: Chosen: rows that C keeps before Python takes them.
#: As of core.h: half-words of 128 KB.
_FLASH_SLOTS = 65536
_RECORD_ROOM = 4096
#: A place at which a way was gone: most were never reached.
_GONE = re.compile(rb"[^\0]")


class NativeEngine(Engine):
    """`Engine`, with its hot half in C.

    Raises:
        MissingDependencyError: Unicorn or the native core is not installed.
    """

    DERIVED = (
        # Shared with C, which has all of the state but what `Engine` declares.
        "shared", "_state", "_calls", "_kept", "_regions", "_code", "_is_joined",
        # Hooks, and what is known of the program.
        "_native_hooks", "_pc_hooks", "_known", "_code_pages", "_noted", "_held",
    )  # fmt: skip

    cycle = field("cycle", "As of `Engine`.")
    stop_at = field("stop_at", "As of `Engine`.")
    pc = field("pc", "As of `Engine`.")
    is_thumb = flag("is_thumb", "As of `Engine`.")
    it_state = field("it_state", "As of `Engine`.")
    stops_after_mask_change = flag("mask_stop", "As of `Engine`.")
    _run_from = field("run_from", "As of `Engine`.")

    def _make_core(self) -> UnicornCore:
        return InterpreterCore(self._fail) if is_interpreter_wanted() else UnicornCore(self._fail)

    def _make_state(self) -> None:
        self._regions: list[tuple[int, int, RawRead, RawWrite]] = []
        self._code: list[tuple[int, int, int]] = []
        self._known: dict[int, BasicBlock] = {}
        #: Pages of flash from which something was translated.
        self._code_pages: set[int] = set()
        self._noted: set[int] = set()
        #: The block that Python has entered, in place of the one of C; None: ask C.
        self._held: BasicBlock | None = NO_BLOCK
        self._native_hooks: tuple[int, ...] = ()
        self._pc_hooks: tuple[int, ...] = ()
        self._kept: list[object] = []
        self._is_joined = False
        unicorn = self._core.library
        api = UnicornApi(*(ctypes.cast(getattr(unicorn, name), ctypes.c_void_p) for name in UNICORN_FUNCTIONS))
        #: Keeps the callbacks alive.
        self._calls = Callbacks(
            UNKNOWN_BLOCK(self._measure_block), READ(self._read_io), WRITE(self._write_io),
            TRAPPED(guarded(self._trapped, None, self._fail)), RECORDED(guarded(self._take_records, None, self._fail)),
            ACCESS_CYCLE(lambda: self.access_cycle), ACCESS_PC(lambda: self.access_pc),
            BAD_ACCESS(guarded(self._bad_access, True, self._fail)),
            WRITE_AT_ONCE(guarded(self._write_at_once, False, self._fail)),
        )  # fmt: skip
        core = library().core_new(self._core.handle, ctypes.addressof(api), ctypes.addressof(self._calls))
        self._state = state = ctypes.c_void_p(made(core, "the native core"))
        self.shared = Shared.from_address(core)
        self.shared.scratch = SCRATCH_BASE
        if isinstance(self._core, InterpreterCore):
            library().core_use_interpreter(state, self._core.handle, is_exact_wanted())
        weakref.finalize(self, library().core_free, state)

    @property
    def state(self) -> ctypes.c_void_p:
        """The C core, for what else is shared with it (registers, USARTs)."""
        return self._state

    def join(self, fabric: ctypes.c_void_p) -> bool:
        """As of `Engine`: this one does, and runs nothing before."""
        library().core_join(self._state, fabric)
        self._is_joined = True
        return True

    def _demand_fabric(self) -> None:
        """Raise RuntimeError where no fabric was joined: every run asks for its next event."""
        if not self._is_joined:
            raise RuntimeError("the native core runs on a fabric alone: join one first")

    def keep(self, *buffers: object) -> None:
        """Keep what C has pointers to."""
        self._kept.extend(buffers)

    def region_at(self, address: int) -> int:
        """Return the number of the I/O region that begins at an address."""
        return next(number for number, region in enumerate(self._regions) if region[0] == address)

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", *, is_writable: bool) -> None:
        """As of `Engine`; the writable memory is where C stacks, that at 0 is where it looks for vectors."""
        super().map_memory(address, buffer, is_writable=is_writable)
        shared, host = self.shared, ctypes.addressof(buffer)
        if is_writable:
            self._store_inline(address, len(buffer))
            shared.sram, shared.sram_base, shared.sram_bytes = host, address, len(buffer)
        elif address == 0:
            shared.flash, shared.flash_bytes = host, len(buffer)
            shared.flash_base = next((first for first, _, at in self._code if at == host), 0)
        self._code.append((address, address + len(buffer), host))

    def _store_inline(self, address: int, size: int) -> None:
        """Let stores to a memory run in translated code: no hook on it, and no page of it for code until a fetch."""
        core = self._core
        core.allow_execution(address, size)
        core.remove_hook(self._bad_access_hook)
        for first, last in ((0, address - 1), (address + size, 0xFFFF_FFFF)):
            core.hook_native("bad access", address_of("core_on_bad_access"), self._state.value or 0, first, last)
        core.fill_tlb_native(address_of("core_on_tlb_fill"), self._state.value or 0)

    def _apply_patch(self) -> None:
        """As of `Engine`."""
        super()._apply_patch()
        rows = (ctypes.c_uint32 * (3 * len(self._views)))(*(n for v in self._views for n in (v.page, v.code, v.data)))
        library().core_set_views(self._state, ctypes.addressof(rows), len(self._views))

    def _show_pages(self) -> None:
        """As of `Engine`, which the native core does anyway."""

    def map_io(self, address: int, size: int, read: ReadAccess, write: WriteAccess) -> None:
        """As of `Engine`."""
        number = len(self._regions)
        self._regions.append((address, size, *io_callbacks(read, write, self._is_denied, self._fail)))
        user = made(library().core_region(self._state, number, address), "a region of the chip")
        self._core.map_io_native(address, size, address_of("core_read_io"), address_of("core_write_io"), user)

    def declare_zero(self, address: int) -> None:
        """As of `Engine`; until a state is restored, whose warnings may be others."""
        library().core_declare_zero(self._state, address)

    def declare_unclocked(self, address: int, *, is_write: bool, until_ns: Nanos | None = None) -> None:
        """As of `Engine`; until a state is restored."""
        until = NO_TIME if until_ns is None else until_ns
        library().core_declare_unclocked(self._state, address, is_write, until)

    def forget_unclocked(self) -> None:
        """As of `Engine`."""
        library().core_forget_unclocked(self._state)

    def declare_duplicated(self, address: int) -> None:
        """As of `Engine`; until a state is restored."""
        library().core_declare_duplicated(self._state, address)

    def drop_code(self, address: int, size: int) -> None:
        """As of `Engine`."""
        super().drop_code(address, size)
        library().core_forget_range(self._state, address, address + size)

    def forget_costs(self) -> None:
        """As of `Engine`."""
        super().forget_costs()
        library().core_forget_rows(self._state)

    def set_traps(self, *, division: bool, unaligned: bool) -> None:
        """As of `Engine`."""
        self.shared.traps_division = division
        super().set_traps(division=division, unaligned=unaligned)

    # Running.

    def run(self, stop_at: int) -> Halt:
        """As of `Engine`."""
        self.use_python(True)
        return super().run(stop_at)

    def step(self, stop_at: int) -> Halt:
        """As of `Engine`."""
        self.use_python(True)
        return super().step(stop_at)

    @property
    def needs_python(self) -> bool:
        """Whether the next run is one that C does not do."""
        return bool(self.watchpoints or self._debug.own_watchpoints) or self._rest.block is not None

    def go_on(self, limit: int) -> tuple[bool, Halt | None]:
        """Run, sleep and take exceptions up to the first boundary at or after `limit` cycles, or less far.

        Returns:
            Whether an exception waits that C leaves to Python, and what ended
            the run: None for a boundary.

        Raises:
            Exception: whatever a peripheral's callback raised.
        """
        self.use_python(False)
        debug, traps, shared = self._debug, self._traps, self.shared
        if (debug.has_points or debug.has_hooks) and not debug.is_armed:
            debug.arm()
        if traps.have_changed:
            traps.apply()
            self.forget_costs()
        if self.flash_patch.has_changed or self._waits_for_views:
            self._apply_patch()
        kind = library().core_run(self._state, min(limit, shared.cycle + _SLICE_CYCLES))
        if self._failure is not None:
            failure, self._failure = self._failure, None
            self._frozen = None
            raise failure
        if kind == STALE:
            traps.arm()
            return False, None
        halt = self._halt_of(kind)
        if halt is not None and halt.kind is HaltKind.TAKEN_WRITE:
            self.use_python(True)
            halt = self._step_over_write(halt, limit)
        return kind == DELIVER, None if halt is not None and halt.kind is HaltKind.STEP else halt

    def _halt_of(self, kind: int) -> Halt | None:
        """Return what ended a run in C; None where only its time was up, or Python is to go on."""
        shared = self.shared
        if kind in (BOUNDARY, DELIVER):
            return None
        if kind == FROZEN and self._frozen is not None:
            halt = self._thaw(self._frozen)
            return None if halt.kind is HaltKind.BOUNDARY else halt
        if kind == UNEXPLAINED:
            raise RuntimeError(f"Unicorn stopped at {shared.halt_pc:#010x} with error {shared.halt_address}")
        return Halt(HALT_KINDS[kind], shared.halt_pc, shared.halt_address if shared.halt_has_address else None)

    def use_python(self, wanted: bool) -> None:
        """Exchange the hooks, if they are not those that are wanted."""
        self._demand_fabric()
        shared, core = self.shared, self._core
        if bool(shared.is_python) is wanted:
            return
        shared.is_python = wanted
        around = library().core_block_around(self._state) if wanted else _NO_BLOCK_START
        if around != _NO_BLOCK_START and not self.is_inside_block and around in self._known:
            self._rest.keep(self._known[around], self.pc, _NEVER, has_raised=False)
        for hook in (*self._native_hooks, *self._pc_hooks):
            core.remove_hook(hook)
        self._native_hooks = self._pc_hooks = ()
        if wanted:
            self._held = NO_BLOCK
            self._pc_hooks = tuple(core.note_pc(address, size) for address, size, _, _ in self._regions)
            self._native_hooks = (*super()._install_hooks(), self._block_hook)
        else:
            self._native_hooks = self._install_hooks()
            self._held = None
        core.drop_all_code()

    @property
    def block(self) -> BasicBlock:
        """As of `Engine`."""
        if self._held is not None:
            return self._held
        start = library().core_block_start(self._state)
        if start == _NO_BLOCK_START:
            return NO_BLOCK
        block, begins = self._known[start], library().core_block_from(self._state)
        return block if begins == start else block.rest(begins)

    @block.setter
    def block(self, block: BasicBlock) -> None:
        if self.shared.is_python:
            self._held = block
        else:
            self._held = None if block is NO_BLOCK else block
            library().core_leave_block(self._state)

    @property
    def access_cycle(self) -> int:
        """As of `Engine`."""
        shared = self.shared
        if shared.in_access:
            return int(shared.access_cycle)
        return super().access_cycle

    @property
    def access_pc(self) -> int:
        """As of `Engine`."""
        return self.shared.access_pc if self.shared.in_access else super().access_pc

    def clear_exclusive(self) -> None:
        """As of `Engine`."""
        if self.shared.is_python:
            super().clear_exclusive()
        else:
            library().core_clear_exclusive(self._state)

    def _set_recorder(self, recorder: BlockRecorder | None) -> None:
        super()._set_recorder(recorder)
        room = 0 if recorder is None else _RECORD_ROOM
        made(library().core_start_recording(self._state, room), "a record of blocks")

    @property
    def gone_ways(self) -> frozenset[tuple[int, bool]]:
        """As of `Engine`; of blocks in flash alone."""
        ways = ctypes.string_at(library().core_ways(self._state), _FLASH_SLOTS)
        base = self.shared.flash_base
        found = {
            (base + 2 * slot, is_elsewhere)
            for slot in (place.start() for place in _GONE.finditer(ways))
            for is_elsewhere in (False, True) if ways[slot] & 1 << is_elsewhere
        }  # fmt: skip
        return super().gone_ways | found

    @property
    def next_event(self) -> int:
        """The cycle at which SysTick or the fabric's queue next acts."""
        self._demand_fabric()
        cycle: int = library().core_next_event(self._state)
        return cycle

    @property
    def _raised_by(self) -> tuple[int, int] | None:
        shared = self.shared
        return None if shared.raised_cycle == NO_TIME else (shared.raised_cycle, shared.raised_pc)

    @_raised_by.setter
    def _raised_by(self, raised: tuple[int, int] | None) -> None:
        self.shared.raised_cycle, self.shared.raised_pc = raised or (NO_TIME, 0)

    def _fail(self, error: BaseException) -> None:
        super()._fail(error)
        self.shared.attention = 1

    def _restored(self) -> None:
        super()._restored()
        library().core_forget_zeros(self._state)
        self.shared.uses_exclusive = self._blocks.uses_exclusive

    def stop_before(self, kind: HaltKind, pc: int, address: int | None = None) -> None:
        """As of `Engine`."""
        super().stop_before(kind, pc, address)
        self.shared.halt_kind = FROZEN

    # What C calls.

    def _install_hooks(self) -> tuple[int, ...]:
        core, user = self._core, self._state.value or 0
        self._held = None
        self._native_hooks = (
            core.hook_native("block", address_of(core.BLOCK_HOOK), user),
            core.hook_native("interrupt", address_of("core_on_interrupt"), user),
            core.hook_native("invalid", address_of("core_on_invalid"), user),
        )
        return self._native_hooks

    def _make_last_rows(self) -> KeptRows:
        return NativeLastRows(self.shared)

    def _make_traps(self) -> Traps:
        return NativeTraps(self._core, self.stop_before, self._leave_it_block, lambda: self.block, self._state)

    def _measure_block(self, address: int, size: int) -> None:
        """Give C the row of a block that it does not know."""
        try:
            block = self._blocks.at(address, size)
            self.shared.uses_exclusive = self._blocks.uses_exclusive
            self._waits_for_views = self.flash_patch.is_stale() and self.flash_patch.concerns(address, size)
            if self._waits_for_views or self._traps.needs_hooks(block):
                self.shared.halt_kind = STALE
            else:
                self._add_row(block)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            self._fail(error)
            self.shared.halt_kind = FAILED

    def _add_row(self, block: BasicBlock) -> None:
        start, size = block.start, block.end - block.start
        self._code_pages.update(at >> _PAGE_SHIFT for at in (start & ~_FLASH_ALIAS, (block.end - 1) & ~_FLASH_ALIAS))
        memory = self._blocks.writable_at(start)
        host = None if memory is None else memory[2] + start - memory[0]
        first, _, at = next(memory for memory in self._code if memory[0] <= start < memory[1])
        code = self.flash_patch.fetched(start, ctypes.string_at(at + start - first, size))
        looks = self.flash_patch.concerns(start, size)
        before = min(_IT_BLOCK_BYTES, start - first)
        led = self.flash_patch.fetched(start - before, ctypes.string_at(at + start - first - before, before))
        accesses = {access.address: access for access in accesses_of(code, start)}
        flags = _ENDS.get(block.last, 0)
        flags |= (
            _CHANGES_MASKS * block.changes_masks | _SENDS_EVENT * block.sends_event | _SELF_LOOP * block.is_self_loop
        )
        # What is compared each time: the code itself, or the table of the FPB.
        compared = (
            (host, size)
            if host is not None
            else (self.flash_patch.table_at, len(self.flash_patch.table))
            if looks
            else (None, 0)
        )
        flags |= _WRITABLE * (compared[0] is not None)
        if flags & _WRITABLE and start in self._known:  # C keeps what stood there before until it is to forget it
            library().core_forget_range(self._state, start, start + 1)
        self._known[start] = block
        if self._core.TELLS_PC:
            flags |= _NOTED
        elif not is_ambiguous(code, start):
            pass
        elif size <= _WHOLE_BYTES and not may_end_in_it(led) and not _has_like_access_under_it(block, accesses):
            flags |= _AMBIGUOUS
        else:
            flags |= _NOTED
            if not accesses.keys() <= self._noted:
                self._note(accesses)
                self._traps.stale.append(block)
                self.shared.halt_kind = STALE
                return
        rows = (InstructionRow * len(block.offsets))()
        for row, (at, cycle) in zip(rows, block.offsets.items(), strict=True):
            row.address, row.cycle, row.gives_up = at, cycle, at in block.given_up
            _fill(row, accesses.get(at))
        added = library().core_add_row(
            self._state,
            start,
            block.end,
            block.straight,
            block.taken,
            flags,
            ctypes.addressof(rows),
            len(rows),
            *compared,
        )
        made(added, f"the block at {start:#010x}")
        loop = loop_of(code, block.offsets, start)
        if loop is not None:
            made(library().core_set_loop(self._state, start, ctypes.addressof(loop)), "a loop")

    def _note(self, accesses: dict[int, Access]) -> None:
        """Hook these instructions so that C notes their PC, in code that is translated from now on."""
        for address in accesses.keys() - self._noted:
            self._noted.add(address)
            self._core.hook_native("instruction", address_of("core_on_note"), self._state.value or 0, address, address)

    def _read_io(self, region: int, offset: int, size: int) -> int:
        return self._regions[region][2](0, offset, size, 0)

    def _write_io(self, region: int, offset: int, size: int, value: int) -> None:
        self._regions[region][3](0, offset, size, value, 0)

    def _is_denied(self) -> bool:
        """Prepare an access; return whether the run has ended before it."""
        shared = self.shared
        if shared.is_python:
            return super()._is_denied()
        return self._frozen is not None or (not shared.stop_at and self._is_interrupted_here())

    def _trapped(self, kind: int, pc: int, value: int) -> None:
        halt = HALT_KINDS[kind]
        if self._traps.may_trap(halt, pc, value):
            self.stop_before(halt, pc, value if halt is HaltKind.UNALIGNED else None)

    def _take_records(self, rows: int, count: int) -> None:
        if self.recorder is not None:
            self.recorder.put_packed(ctypes.string_at(rows, count * RECORD.size))

    def _write_at_once(self, address: int, size: int, stop: int) -> bool:
        """Have a store to read-only memory made where it leaves what it stores, and let the time pass that it takes."""
        take, shared, block, pc = self.on_read_only_write_at_once, self.shared, self.block, self.registers[Reg.PC]
        offset = address & ~_FLASH_ALIAS
        if take is None or self._frozen is not None or block.has_it or offset >> _PAGE_SHIFT in self._code_pages:
            return False
        after = next((cycles for at, cycles in block.offsets.items() if at > pc), block.straight)
        cycle = shared.cycle
        done = take(address, size, pc, cycle + block.cycles_until(pc), stop)
        if done is not None:
            shared.cycle = cycle + max(0, done - (cycle + after))
        return done is not None

    def _bad_access(self, access: int, address: int, size: int, value: int) -> bool:
        self._halt = None
        goes_on = super()._bad_access(access, address, size, value)
        halt: Halt | None = self._halt
        if not goes_on and halt is not None and self._frozen is None:
            shared = self.shared
            shared.halt_kind, shared.halt_pc = HALT_NUMBERS[halt.kind], halt.pc
            shared.halt_address, shared.halt_has_address = address, 1
        return goes_on


class NativeTraps(Traps):
    """`Traps` whose hooks look at the register in C; Python is called only when one traps."""

    def __init__(
        self, core: UnicornCore, stop_before: StopBefore, leave_it_block: Callable[[], object],
        running: Callable[[], BasicBlock], state: ctypes.c_void_p,
    ) -> None:  # fmt: skip
        super().__init__(core, stop_before, leave_it_block, running)
        self._state = state

    def needs_hooks(self, block: BasicBlock) -> bool:
        """As of `Traps`; a core of our own looks itself."""
        return not self._core.TELLS_PC and super().needs_hooks(block)

    def may_trap(self, kind: HaltKind, address: int, value: int) -> bool:
        """As of `Traps`."""
        return self._core.TELLS_PC or super().may_trap(kind, address, value)

    def _trap(self, address: int, number: int, kind: HaltKind) -> None:
        if (address, number, kind) in self._trapped:
            return
        trap = library().core_trap(self._state, address, GENERAL[number].value, HALT_NUMBERS[kind])
        user = made(trap, f"a look at {address:#010x}")
        self._trapped.add((address, number, kind))
        self._core.hook_native("instruction", address_of("core_on_trap"), user, address, address)


def _has_like_access_under_it(block: BasicBlock, accesses: dict[int, Access]) -> bool:
    """Tell whether an access under IT has the kind and the width of another one of its block."""
    kinds = [(access.is_load, access.bytes) for access in accesses.values()]
    return any(kinds.count(kind) > 1 for at, kind in zip(accesses, kinds, strict=True) if block.it_state_at(at, 0))


def _fill(row: Any, access: Access | None) -> None:
    """Fill in which memory an instruction accesses."""
    if access is None:
        return
    row.kind = 1 if access.is_load else 2
    row.bytes, row.base, row.offset = access.bytes, access.base, access.offset
    row.index, row.shift, row.count = 255 if access.index is None else access.index, access.shift, access.count
