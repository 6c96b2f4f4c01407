"""The Cortex-M3 that Unicorn emulates, through the few functions of its C interface that the engine uses.

`UnicornCore` is a thin layer over the library: no time, no costs of blocks, no
exceptions of the architecture; those are the business of `engine.py` and
`processor.py`. This is the only module that imports Unicorn, and only when a
core is made, so that the rest of the package works without it.

Theory of operation. The Python binding that ships with Unicorn wraps each call
and each callback; going to the library directly, by ctypes, halves the price of
both, and they are what a run spends its time in. A call costs a microsecond
whatever it carries, so registers that belong together move in one call
(`Batch`). Accesses to peripherals are calls of Python, straight from C. A
Python exception cannot pass through C: each callback hands it to `on_failure`
and answers with a default. What only an instruction can do (CLREX) is run on a
scratch page of our own.

Source: unicorn.h, arm.h and uc_priv.h of Unicorn 2.1.
Invariant: whatever the library keeps a pointer to lives as long as its
`UnicornCore`, and never moves.
"""

import ctypes
import sys
import weakref
from collections.abc import Callable
from enum import Enum
from functools import cache
from typing import Any, ClassVar, TypeVar

from bluepill_sim.extension.layout import NOWHERE
from simbase.c_library import guarded, loaded
from simbase.errors import MissingDependencyError
from simbase.state import Stateful


class Reg(Enum):
    """A register of the core, by the number that the library gives it (arm.h of Unicorn 2.1)."""

    R0 = 66
    R1 = 67
    R2 = 68
    R3 = 69
    R4 = 70
    R5 = 71
    R6 = 72
    R7 = 73
    R8 = 74
    R9 = 75
    R10 = 76
    R11 = 77
    R12 = 78
    SP = 12
    LR = 10
    PC = 11
    #: Flags, T bit, ITSTATE; writing it also rebuilds the engine's idea of mode and privilege.
    CPSR = 3
    #: Flags, T bit, ITSTATE and IPSR; writing it sets the flags only.
    XPSR = 120
    IPSR = 114
    MSP = 115
    PSP = 116
    CONTROL = 117
    BASEPRI = 124
    FAULTMASK = 126
    PRIMASK = 123


#: R0 to R15 in order.
GENERAL = (
    Reg.R0, Reg.R1, Reg.R2, Reg.R3, Reg.R4, Reg.R5, Reg.R6, Reg.R7,
    Reg.R8, Reg.R9, Reg.R10, Reg.R11, Reg.R12, Reg.SP, Reg.LR, Reg.PC,
)  # fmt: skip

#: Kind of a good access that is not a write.
READ_ACCESS = 16
FETCH_ACCESS = 18
#: Kinds of bad accesses.
WRITE_UNMAPPED, FETCH_UNMAPPED, WRITE_PROTECTED, FETCH_PROTECTED = 20, 21, 22, 24

#: (uc, offset, size, user) and (uc, offset, size, value, user): accesses to an I/O region.
RawRead = Callable[[int, int, int, int], int]
RawWrite = Callable[[int, int, int, int, int], None]
#: Reads (offset, size) of an I/O region, writes (offset, size, value).
ReadAccess = Callable[[int, int], int]
WriteAccess = Callable[[int, int, int], None]
#: Takes (address, size, value) written to read-only memory; False refuses it.
WriteToReadOnly = Callable[[int, int, int], bool]
#: Why the registers of another library's core are refused.
ANOTHER_CORE = "the state is of another core: P2OS_CORE chooses it"
#: All registers: the bits of their memory that differ from a new core's.
CoreContext = bytes

#: The scratch page. chosen: where an STM32F103C has nothing, outside the regions that never execute.
SCRATCH_BASE, _SCRATCH_BYTES = 0x9FFF_FC00, 0x400
#: What the library maps at once.
_PAGE_BYTES = 0x400
#: CLREX, WFI.
_SCRATCH_CODE = bytes.fromhex("bff32f8f 30bf")
#: Address after it.
SCRATCH_END = SCRATCH_BASE + len(_SCRATCH_CODE)

# Not MODE_MCLASS: that silently makes a Cortex-M33.
_ARCHITECTURE_ARM, _MODE_THUMB, _MODEL_CORTEX_M3 = 1, 16, 8
_HOOK_INTERRUPT, _HOOK_CODE, _HOOK_BLOCK, _HOOK_INVALID = 1, 4, 8, 0x4000
_HOOK_ACCESS, _HOOK_BAD_ACCESS, _HOOK_TLB_FILL = 0x400 | 0x800, 0x3F0, 0x20000
#: First and last address of a hook that is called everywhere: the first is behind the last.
EVERYWHERE = 1, 0
_NATIVE_HOOKS = {
    "block": _HOOK_BLOCK,
    "instruction": _HOOK_CODE,
    "interrupt": _HOOK_INTERRUPT,
    "invalid": _HOOK_INVALID,
    "bad access": _HOOK_BAD_ACCESS,
}
_PROTECTION_READ, _PROTECTION_WRITE, _PROTECTION_EXECUTE = 1, 2, 4
#: The letters of what may be done with memory.
PROTECTION_OF = {"r": _PROTECTION_READ, "w": _PROTECTION_WRITE, "x": _PROTECTION_EXECUTE}
#: uc_ctl numbers: item | argument count << 26 | direction (write = 1) << 30.
_CONTROL_EXITS = 4 | 1 << 26 | 1 << 30
_CONTROL_MODEL = 7 | 1 << 26 | 1 << 30
_CONTROL_DROP_CODE = 9 | 2 << 26 | 1 << 30
_CONTROL_DROP_ALL_CODE = 10 | 1 << 30
_CONTROL_DROP_PAGES = 11 | 1 << 30
_CONTROL_TLB = 12 | 1 << 26 | 1 << 30
_TLB_OF_HOOKS = 1

#: Size, mode, architecture, level, flag and two pointers come before the registers of a context (uc_priv.h).
_CONTEXT_HEADER_BYTES = 24 + 2 * ctypes.sizeof(ctypes.c_void_p)
_WORD = 0xFFFF_FFFF
#: Registers of the other instruction set (X0 to X30, PC), which Unicorn leaves as it likes.
_AARCH64_WORDS = range(16, 82)
#: Syndrome, status, address and level of Unicorn's own last exception, which nothing reads again.
_LAST_EXCEPTION_WORDS = range(756, 761)
_UNSAVED_WORDS = {*_AARCH64_WORDS, *_LAST_EXCEPTION_WORDS}

#: void (*)(uc, address, size, user): a basic block is about to run, or an instruction.
BLOCK_CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32, ctypes.c_void_p)
#: void (*)(uc, intno, user)
INTERRUPT_CALLBACK = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p)
#: bool (*)(uc, user)
INVALID_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_void_p)
#: bool (*)(uc, type, address, size, value, user)
MEMORY_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_bool, ctypes.c_void_p, ctypes.c_int, ctypes.c_uint64, ctypes.c_int, ctypes.c_int64, ctypes.c_void_p
)
#: uint64_t (*)(uc, offset, size, user)
READ_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_void_p)
#: void (*)(uc, offset, size, value, user)
WRITE_CALLBACK = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_uint64, ctypes.c_void_p
)


class TlbEntry(ctypes.Structure):
    """`uc_tlb_entry` of unicorn.h."""

    _fields_ = (("address", ctypes.c_uint64), ("may", ctypes.c_int))


#: bool (*)(uc, address, type, entry, user)
PAGE_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_bool, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_int, ctypes.POINTER(TlbEntry), ctypes.c_void_p
)

_Result = TypeVar("_Result")


class UnicornCore(Stateful):
    """A bare Cortex-M3: registers, memory maps, hooks and contexts.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    STATE = ("context",)
    #: The native core's function that is called before each block, and whether it learns the PC of an access to I/O.
    BLOCK_HOOK: ClassVar[str] = "core_on_block"
    TELLS_PC: ClassVar[bool] = False
    #: What the library has pointers to.
    DERIVED = ("scratch", "_keep", "_buffers", "_sinks")

    def __init__(self, on_failure: Callable[[BaseException], None]) -> None:
        """Make a core without memory, but for the scratch page.

        Args:
            on_failure: called with each exception inside a callback.
        """
        self._library = library = load_library()
        self._on_failure = on_failure
        handle = ctypes.c_void_p()
        self._check(library.uc_open(_ARCHITECTURE_ARM, _MODE_THUMB, ctypes.addressof(handle)), "open")
        self._handle = handle.value or 0
        self._control(_CONTROL_MODEL, ctypes.c_int(_MODEL_CORTEX_M3))
        # A list of addresses that end a run, which stays empty: with a single one, what was translated there is looked
        # for after each run, which takes longer than a short run.
        self._control(_CONTROL_EXITS, ctypes.c_int(1))
        context = ctypes.c_void_p()
        self._check(library.uc_context_alloc(self._handle, ctypes.addressof(context)), "allocate a context")
        self._context = context.value or 0
        self._context_bytes = library.uc_context_size(self._handle) - _CONTEXT_HEADER_BYTES
        #: The registers of a new core.
        self._new = self._read_context()
        #: The bits that `context` has.
        self._saved_bits = _saved_bits(self._context_bytes // 4)
        self._keep: list[object] = []
        #: Apart from the callbacks, which refer back to this object: these must outlive the library's handle.
        self._buffers: list[object] = []
        self._sinks: dict[int, object] = {}
        weakref.finalize(self, _close, library, self._handle, self._context, self._buffers)
        self.registers = RegisterFile(library, self._handle)
        self._map_scratch()

    def _map_scratch(self) -> None:
        scratch = ctypes.create_string_buffer(_SCRATCH_CODE, _SCRATCH_BYTES)
        #: Where the scratch page is: first address, address after, place in the host's memory.
        self.scratch = SCRATCH_BASE, SCRATCH_BASE + _SCRATCH_BYTES, ctypes.addressof(scratch)
        self.map_memory(SCRATCH_BASE, scratch, "x")

    # Running.

    def start(self, address: int) -> int:
        """Run from an address (bit 0: Thumb) until something stops it; return the library's error number."""
        error: int = self._library.uc_emu_start(self._handle, address, NOWHERE, 0, 0)
        return error

    def stop(self) -> None:
        """End the run; only from a hook, never from an access to I/O, which would be run again."""
        self._library.uc_emu_stop(self._handle)

    def clear_exclusive(self) -> None:
        """Run CLREX on the scratch page, between runs; the block hook is called for it."""
        self.start(SCRATCH_BASE | 1)

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", protection: str) -> None:
        """Map a buffer; `protection` is made of the letters r, w and x."""
        bits = sum(PROTECTION_OF[letter] for letter in protection)
        self._buffers.append(buffer)
        self._map(address, len(buffer), bits, ctypes.addressof(buffer))

    def _map(self, address: int, size: int, bits: int, at: int) -> None:
        self._check(self._library.uc_mem_map_ptr(self._handle, address, size, bits, at), f"map {address:#010x}")

    def _unmap(self, address: int, size: int) -> None:
        self._check(self._library.uc_mem_unmap(self._handle, address, size), f"unmap {address:#010x}")

    def add_sink(self, address: int) -> None:
        """Have writes to the page of an address, where nothing is, go nowhere, until `remove_sinks`."""
        page = address & ~(_PAGE_BYTES - 1)
        buffer = ctypes.create_string_buffer(_PAGE_BYTES)
        self._sinks[page] = buffer
        self._map(page, _PAGE_BYTES, _PROTECTION_READ | _PROTECTION_WRITE, ctypes.addressof(buffer))

    def remove_sinks(self) -> None:
        """Have nothing be where sinks were; not during a run."""
        for page in self._sinks:
            self._unmap(page, _PAGE_BYTES)
        self._sinks.clear()

    def allow_execution(self, address: int, size: int) -> None:
        """Let code run from a region that is mapped without x: with it, each store looks for code to forget."""
        bits = _PROTECTION_READ | _PROTECTION_WRITE | _PROTECTION_EXECUTE
        self._check(self._library.uc_mem_protect(self._handle, address, size, bits), f"change {address:#010x}")

    def map_io(self, address: int, size: int, read: RawRead, write: RawWrite) -> None:
        """Map a region whose accesses are calls, straight from C: they must not raise.

        Unicorn brings the PC up to date before each of them, and by that leaves
        ITSTATE as if the IT block had been left there: see `Engine`.
        """
        reader, writer = self._io_pointers(read, write)
        self._check(
            self._library.uc_mmio_map(self._handle, address, size, reader, None, writer, None), f"map {address:#010x}"
        )
        # Only a memory hook makes Unicorn bring the PC up to date before an access; this one does nothing else.
        self.note_pc(address, size)

    def _io_pointers(self, read: RawRead, write: RawWrite) -> tuple[ctypes.c_void_p, ctypes.c_void_p]:
        return self._pointer(READ_CALLBACK(read)), self._pointer(WRITE_CALLBACK(write))

    def drop_code(self, address: int, size: int) -> None:
        """Forget what was translated from bytes that have changed; not during a run."""
        self._control(_CONTROL_DROP_CODE, ctypes.c_uint64(address), ctypes.c_uint64(address + size))

    def drop_all_code(self) -> None:
        """Forget every translation; not during a run."""
        self._control(_CONTROL_DROP_ALL_CODE)

    def drop_pages(self) -> None:
        """Forget which pages are where; not during a run."""
        self._control(_CONTROL_DROP_PAGES)

    # Hooks.

    def on_block(self, call: Callable[[int, int, int, int], None]) -> int:
        """Call (uc, address, size, user) before each basic block; the callback must not raise; return the hook."""
        return self._hook(_HOOK_BLOCK, self._pointer(BLOCK_CALLBACK(call)), *EVERYWHERE)

    def on_instruction(self, address: int, call: Callable[[], None]) -> None:
        """Call before the instruction at an address, in blocks that are translated from now on."""
        self.hook_instructions(self.instruction_callback(lambda _address: call()), address, address)

    def on_interrupt(self, call: Callable[[int], None]) -> int:
        """Call (number) when the core raises an exception of Unicorn's own numbering; return the hook."""
        return self._hook(_HOOK_INTERRUPT, self._pointer(INTERRUPT_CALLBACK(self._for_c(call, None))), *EVERYWHERE)

    def on_invalid(self, call: Callable[[], bool]) -> int:
        """Call at an instruction that Unicorn does not know; True goes on after it; return the hook."""
        return self._hook(_HOOK_INVALID, self._pointer(INVALID_CALLBACK(self._for_c(call, True))), *EVERYWHERE)

    def on_bad_access(self, call: Callable[[int, int, int, int], bool], first: int = 1, last: int = 0) -> int:
        """Call (kind, address, size, value) at an access to no memory or against its protection; return the hook.

        True lets the access pass; first > last is everywhere.
        """
        return self._hook(_HOOK_BAD_ACCESS, self._pointer(MEMORY_CALLBACK(self._for_c(call, True))), first, last)

    def on_access(self, first: int, last: int, call: Callable[[int, int, int, int], bool]) -> None:
        """Call (kind, address, size, value) before every access in a range; slow."""
        self.hook_accesses(self.access_callback(call), first, last)
        self.drop_all_code()

    # Hooks that come and go. Code that is already translated does not have them: `drop_code`.

    def instruction_callback(self, call: Callable[[int], None]) -> ctypes.c_void_p:
        """Return what `hook_instructions` takes for a function of an instruction's address."""
        return self._pointer(BLOCK_CALLBACK(self._for_c(lambda address, _size: call(address), None)))

    def access_callback(self, call: Callable[[int, int, int, int], bool]) -> ctypes.c_void_p:
        """Return what `hook_accesses` takes for a function of (kind, address, size, value)."""
        return self._pointer(MEMORY_CALLBACK(self._for_c(call, True)))

    def hook_instructions(self, callback: ctypes.c_void_p, first: int, last: int) -> int:
        """Call before each instruction in a range, everywhere if first > last; return the hook."""
        return self._hook(_HOOK_CODE, callback, first, last)

    def hook_accesses(self, callback: ctypes.c_void_p, first: int, last: int) -> int:
        """Call before each access that begins in a range; return the hook."""
        return self._hook(_HOOK_ACCESS, callback, first, last)

    def remove_hook(self, hook: int) -> None:
        """Take a hook away; not during a run."""
        self._check(self._library.uc_hook_del(self._handle, hook), "remove a hook")

    # Contexts.

    @property
    def context(self) -> CoreContext:
        """All registers, hidden ones included, for this process or another with the same library.

        What the library calls a context holds pointers too, which must not go to
        another machine: they never change, and so are never among the differences.
        """
        changed = (self._read_context() ^ self._new) & self._saved_bits
        return changed.to_bytes(self._context_bytes, sys.byteorder)

    @context.setter
    def context(self, context: CoreContext) -> None:
        if len(context) != self._context_bytes:
            raise ValueError(ANOTHER_CORE)
        words = int.from_bytes(context, sys.byteorder) ^ self._new
        data = words.to_bytes(self._context_bytes, sys.byteorder)
        ctypes.memmove(self._context + _CONTEXT_HEADER_BYTES, data, len(data))
        self._check(self._library.uc_context_restore(self._handle, self._context), "restore")

    def _read_context(self) -> int:
        self._check(self._library.uc_context_save(self._handle, self._context), "save")
        at = self._context + _CONTEXT_HEADER_BYTES
        return int.from_bytes(ctypes.string_at(at, self._context_bytes), sys.byteorder)

    # Internals.

    def _for_c(self, call: Callable[..., _Result], default: _Result) -> Callable[..., _Result]:
        """Return a callback for C: it drops the handle before and the user pointer after the arguments."""
        return guarded(lambda _uc, *arguments: call(*arguments[:-1]), default, self._on_failure)

    def _pointer(self, callback: "ctypes._FuncPointer") -> ctypes.c_void_p:
        self._keep.append(callback)
        return ctypes.cast(callback, ctypes.c_void_p)

    # For the native core.

    @property
    def handle(self) -> int:
        """The library's handle of this core."""
        return self._handle

    @property
    def library(self) -> Any:
        """The library itself."""
        return self._library

    def hook_native(self, kind: str, callback: ctypes.c_void_p, user: int, first: int = 1, last: int = 0) -> int:
        """Call a C function with `user`: before a "block" or an "instruction", at an "interrupt", at "invalid" code.

        Or at a "bad access", as `on_bad_access`.
        """
        return self._hook(_NATIVE_HOOKS[kind], callback, first, last, user)

    def on_page(self, call: Callable[[int, int], tuple[int, int] | None]) -> None:
        """Call (address, kind of access) for a page, for (where it is, what may be done there); None: nothing executes.

        What may be done: 1 read, 2 write, 4 execute.
        """

        def fill(address: int, access: int, entry: "ctypes._Pointer[TlbEntry]") -> bool:
            found = call(address, access)
            if found is not None:
                entry.contents.address, entry.contents.may = found
            return found is not None

        self._find_pages_by_hooks()
        self._hook(_HOOK_TLB_FILL, self._pointer(PAGE_CALLBACK(self._for_c(fill, False))), *EVERYWHERE)

    def fill_tlb_native(self, callback: ctypes.c_void_p, user: int) -> None:
        """Have a C function say what may be done with each page, in place of the core's own memory map."""
        self._find_pages_by_hooks()
        self._hook(_HOOK_TLB_FILL, callback, *EVERYWHERE, user)

    def _find_pages_by_hooks(self) -> None:
        self._control(_CONTROL_TLB, ctypes.c_int(_TLB_OF_HOOKS))

    def map_io_native(self, address: int, size: int, read: ctypes.c_void_p, write: ctypes.c_void_p, user: int) -> None:
        """Map a region whose accesses are C functions."""
        error = self._library.uc_mmio_map(self._handle, address, size, read, user, write, user)
        self._check(error, f"map {address:#010x}")

    def note_pc(self, address: int, size: int) -> int:
        """Have the PC brought up to date before each access of a range, which is slow; return the hook."""
        nothing = ctypes.cast(self._library.uc_arch_supported, ctypes.c_void_p)  # looks at a number, returns a flag
        return self._hook(_HOOK_ACCESS, nothing, address, address + size - 1)

    def _hook(self, kind: int, callback: ctypes.c_void_p, first: int, last: int, user: int | None = None) -> int:
        """Add a hook; first > last is everywhere."""
        hook = ctypes.c_size_t()
        at = ctypes.addressof(hook)
        self._check(self._library.uc_hook_add(self._handle, at, kind, callback, user, first, last), "hook")
        return hook.value

    def _control(self, item: int, *arguments: object) -> None:
        number = ctypes.c_int(item - (1 << 32) if item >> 31 else item)
        self._check(self._library.uc_ctl(ctypes.c_void_p(self._handle), number, *arguments), "control")

    @staticmethod
    def _check(error: int, what: str) -> None:
        if error:
            raise RuntimeError(f"Unicorn cannot {what}: error {error}")


@cache
def _saved_bits(words: int) -> int:
    """Return the bits of a context of so many words that are saved."""
    return sum(_WORD << 32 * n for n in range(words) if n not in _UNSAVED_WORDS)


def _close(library: Any, handle: int, context: int, buffers: list[object]) -> None:
    """Free what the library holds for a `UnicornCore` that is gone."""
    library.uc_context_free(context)
    library.uc_close(handle)
    buffers.clear()


class RegisterFile:
    """All registers, one at a time."""

    def __init__(self, library: Any, handle: int) -> None:
        self._handle = handle
        self._library = library
        self._value = ctypes.c_uint32()
        self._at = ctypes.addressof(self._value)
        self._read = library.uc_reg_read
        self._write = library.uc_reg_write

    def __getitem__(self, register: Reg) -> int:
        """Return one register."""
        self._read(self._handle, register._value_, self._at)  # `value` is a property, which takes as long as the call
        return self._value.value

    def __setitem__(self, register: Reg, value: int) -> None:
        """Set one register."""
        self._value.value = value
        self._write(self._handle, register._value_, self._at)

    def batch(self, *registers: Reg) -> "Batch":
        """Return a list of registers to be moved together."""
        return Batch(self._library, self._handle, registers)


class Batch:
    """A fixed list of registers, moved together."""

    def __init__(self, library: Any, handle: int, registers: tuple[Reg, ...]) -> None:
        count = len(registers)
        self.values = (ctypes.c_uint32 * count)()
        self._numbers = (ctypes.c_int * count)(*(r.value for r in registers))
        base = ctypes.addressof(self.values)
        self._pointers = (ctypes.c_void_p * count)(*(base + 4 * n for n in range(count)))
        self._count = count
        self._handle = handle
        self._read = library.uc_reg_read_batch
        self._write = library.uc_reg_write_batch
        self._at = (ctypes.addressof(self._numbers), ctypes.addressof(self._pointers))

    def read(self) -> tuple[int, ...]:
        """Return the registers' values, in order."""
        self._read(self._handle, *self._at, self._count)
        return tuple(self.values)

    def write(self, values: tuple[int, ...]) -> None:
        """Set the registers, in order."""
        self.values[:] = list(values)
        self._write(self._handle, *self._at, self._count)


def io_callbacks(
    read: ReadAccess, write: WriteAccess, is_denied: Callable[[], bool], fail: Callable[[BaseException], None]
) -> tuple[RawRead, RawWrite]:
    """Return the callbacks of an I/O region: they make no access that is denied, and never raise."""

    def on_read(_uc: int, offset: int, count: int, _user: int) -> int:
        try:
            return 0 if is_denied() else read(offset, count)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            fail(error)
            return 0

    def on_write(_uc: int, offset: int, count: int, value: int, _user: int) -> None:
        try:
            if not is_denied():
                write(offset, count, value)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            fail(error)

    return on_read, on_write


#: What is used of unicorn.h of Unicorn 2.1; result and arguments, as `simbase.c_library` spells them. Those of uc_ctl,
#: which is variadic, are wrapped at the call.
_FUNCTIONS = {
    "uc_open": "iiip",
    "uc_close": "ip",
    "uc_emu_start": "ipqqqz",
    "uc_emu_stop": "ip",
    "uc_reg_read": "ipip",
    "uc_reg_write": "ipip",
    "uc_reg_read_batch": "ipppi",
    "uc_reg_write_batch": "ipppi",
    "uc_mem_map_ptr": "ipqzup",
    "uc_mmio_map": "ipqzpppp",
    "uc_mem_unmap": "ipqz",
    "uc_mem_protect": "ipqzu",
    "uc_hook_add": "ippippqq",
    "uc_hook_del": "ipz",
    "uc_context_size": "ip",
    "uc_context_save": "ipp",
    "uc_context_restore": "ipp",
    "uc_context_alloc": "ipp",
    "uc_context_free": "ip",
}


def load_library() -> Any:
    """Load Unicorn.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        from unicorn import unicorn_py3
    except ImportError as error:
        raise MissingDependencyError(f"the BluePill needs the unicorn library: {error}", extra="sim") from error
    return _loaded(unicorn_py3.unicorn.uclib._name)  # noqa: SLF001 - the only place where the binding keeps it


@cache
def _loaded(path: str) -> Any:
    # PyDLL keeps the interpreter lock: the engine calls back into Python at each
    # block, and taking the lock there costs as much as the callback.
    return loaded(path, _FUNCTIONS, "Unicorn", "unicorn", ctypes.PyDLL)
