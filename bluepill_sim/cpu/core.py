"""One Unicorn machine: a bare Cortex-M3 with memory maps, hooks and contexts.

This is the thin layer over the library: no time, no blocks, no exceptions of
the architecture. A Python exception inside a callback cannot pass through C:
it is handed to `on_failure` and the callback answers with a default.

Source: unicorn.h and uc_priv.h of Unicorn 2.1.
Invariant: whatever the library keeps a pointer to lives as long as this object.
"""

import ctypes
import weakref
from array import array
from collections.abc import Callable
from typing import TypeVar

from bluepill_sim.cpu import binding
from bluepill_sim.cpu.registers import RegisterFile

# Not MODE_MCLASS: that silently makes a Cortex-M33.
_ARCHITECTURE_ARM, _MODE_THUMB, _MODEL_CORTEX_M3 = 1, 16, 8
_HOOK_INTERRUPT, _HOOK_CODE, _HOOK_BLOCK, _HOOK_INVALID = 1, 4, 8, 0x4000
_HOOK_ACCESS, _HOOK_BAD_ACCESS, _HOOK_TLB_FILL = 0x400 | 0x800, 0x3F0, 0x20000
_NATIVE_HOOKS = {
    "block": _HOOK_BLOCK,
    "instruction": _HOOK_CODE,
    "interrupt": _HOOK_INTERRUPT,
    "invalid": _HOOK_INVALID,
}
_PROTECTION_READ, _PROTECTION_WRITE, _PROTECTION_EXECUTE = 1, 2, 4
#: uc_ctl numbers: item | argument count << 26 | direction (write = 1) << 30.
_CONTROL_MODEL = 7 | 1 << 26 | 1 << 30
_CONTROL_DROP_CODE = 9 | 2 << 26 | 1 << 30
_CONTROL_DROP_ALL_CODE = 10 | 1 << 30
_CONTROL_TLB = 12 | 1 << 26 | 1 << 30
_TLB_OF_HOOKS = 1
#: No instruction stands at an odd address, so a run never ends there; the page is one that executes (`scratch.py`).
_NOWHERE = 0x9FFF_FFFF

#: Size, mode, architecture, level, flag and two pointers come before the registers of a context (uc_priv.h).
_CONTEXT_HEADER_BYTES = 24 + 2 * ctypes.sizeof(ctypes.c_void_p)

#: Registers of the other instruction set (X0 to X30, PC), which Unicorn leaves as it likes.
_AARCH64_WORDS = range(16, 82)
#: Syndrome, status, address and level of Unicorn's own last exception, which nothing reads again.
_LAST_EXCEPTION_WORDS = range(756, 761)
_UNSAVED_WORDS = {*_AARCH64_WORDS, *_LAST_EXCEPTION_WORDS}

#: Kind of a good access that is not a write.
READ_ACCESS = 16
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

#: (index, word) of each word of the registers that differs from a new core's.
CoreSnapshot = tuple[tuple[int, int], ...]

_Result = TypeVar("_Result")


class Core:
    """A bare Cortex-M3.

    Raises:
        MissingDependencyError: Unicorn is not installed.
    """

    def __init__(self, on_failure: Callable[[BaseException], None]) -> None:
        """Make a machine without memory.

        Args:
            on_failure: told of exceptions inside callbacks.
        """
        self._library = library = binding.load_library()
        self._on_failure = on_failure
        handle = ctypes.c_void_p()
        self._check(library.open(_ARCHITECTURE_ARM, _MODE_THUMB, ctypes.addressof(handle)), "open")
        self._handle = handle.value or 0
        self._control(_CONTROL_MODEL, ctypes.c_int(_MODEL_CORTEX_M3))
        context = ctypes.c_void_p()
        self._check(library.context_alloc(self._handle, ctypes.addressof(context)), "allocate a context")
        self._context = context.value or 0
        #: The registers of a new core.
        self._new = self._context_words()
        self._keep: list[object] = []
        #: Apart from the callbacks, which refer back to this object: these must outlive the library's handle.
        self._buffers: list[object] = []
        weakref.finalize(self, _close, library, self._handle, self._context, self._buffers)
        self.registers = RegisterFile(library, self._handle)

    # Running.

    def start(self, address: int) -> int:
        """Run from an address (bit 0: Thumb) until something stops it; return the library's error number."""
        return self._library.start(self._handle, address, _NOWHERE, 0, 0)

    def stop(self) -> None:
        """End the run; only from a hook, never from an access to I/O, which would be run again."""
        self._library.stop(self._handle)

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", protection: str) -> None:
        """Map a buffer; `protection` is made of the letters r, w and x."""
        letters = {"r": _PROTECTION_READ, "w": _PROTECTION_WRITE, "x": _PROTECTION_EXECUTE}
        bits = sum(letters[letter] for letter in protection)
        self._buffers.append(buffer)
        self._check(
            self._library.map_pointer(self._handle, address, len(buffer), bits, ctypes.addressof(buffer)),
            f"map {address:#010x}",
        )

    def allow_execution(self, address: int, size: int) -> None:
        """Let code run from a region that is mapped without x: with it, each store looks for code to forget."""
        bits = _PROTECTION_READ | _PROTECTION_WRITE | _PROTECTION_EXECUTE
        self._check(self._library.protect(self._handle, address, size, bits), f"change {address:#010x}")

    def map_io(self, address: int, size: int, read: RawRead, write: RawWrite) -> None:
        """Map a region whose accesses are calls, straight from C: they must not raise.

        Unicorn brings the PC up to date before each of them, and by that leaves
        ITSTATE as if the IT block had been left there: see `Engine`.
        """
        reader = self._pointer(binding.READ_CALLBACK(read))
        writer = self._pointer(binding.WRITE_CALLBACK(write))
        self._check(
            self._library.map_io(self._handle, address, size, reader, None, writer, None), f"map {address:#010x}"
        )
        # Only a memory hook makes Unicorn bring the PC up to date before an access; this one does nothing else.
        self.note_pc(address, size)

    def drop_code(self, address: int, size: int) -> None:
        """Forget what was translated from bytes that have changed; not during a run."""
        self._control(_CONTROL_DROP_CODE, ctypes.c_uint64(address), ctypes.c_uint64(address + size))

    def drop_all_code(self) -> None:
        """Forget every translation; not during a run."""
        self._control(_CONTROL_DROP_ALL_CODE)

    # Hooks.

    def on_block(self, call: Callable[[int, int, int, int], None]) -> int:
        """Call (uc, address, size, user) before each basic block; the callback must not raise; return the hook."""
        return self._hook(_HOOK_BLOCK, self._pointer(binding.BLOCK_CALLBACK(call)), 1, 0)

    def on_instruction(self, address: int, call: Callable[[], None]) -> None:
        """Call before the instruction at an address, in blocks that are translated from now on."""
        self.hook_instructions(self.instruction_callback(lambda _address: call()), address, address)

    def on_interrupt(self, call: Callable[[int], None]) -> int:
        """Call (number) when the core raises an exception of Unicorn's own numbering; return the hook."""
        return self._hook(_HOOK_INTERRUPT, self._pointer(binding.INTERRUPT_CALLBACK(self._guard(call, None))), 1, 0)

    def on_invalid(self, call: Callable[[], bool]) -> int:
        """Call at an instruction that Unicorn does not know; True goes on after it; return the hook."""
        return self._hook(_HOOK_INVALID, self._pointer(binding.INVALID_CALLBACK(self._guard(call, True))), 1, 0)

    def on_bad_access(self, call: Callable[[int, int, int, int], bool], first: int = 1, last: int = 0) -> int:
        """Call (kind, address, size, value) at an access to no memory or against its protection; return the hook.

        True lets the access pass; first > last is everywhere.
        """
        return self._hook(
            _HOOK_BAD_ACCESS, self._pointer(binding.MEMORY_CALLBACK(self._guard(call, True))), first, last
        )

    def on_access(self, first: int, last: int, call: Callable[[int, int, int, int], bool]) -> None:
        """Call (kind, address, size, value) before every access in a range; slow."""
        self.hook_accesses(self.access_callback(call), first, last)
        self.drop_all_code()

    # Hooks that come and go. Code that is already translated does not have them: `drop_code`.

    def instruction_callback(self, call: Callable[[int], None]) -> ctypes.c_void_p:
        """Return what `hook_instructions` takes for a function of an instruction's address."""
        return self._pointer(binding.BLOCK_CALLBACK(self._guard(lambda address, _size: call(address), None)))

    def access_callback(self, call: Callable[[int, int, int, int], bool]) -> ctypes.c_void_p:
        """Return what `hook_accesses` takes for a function of (kind, address, size, value)."""
        return self._pointer(binding.MEMORY_CALLBACK(self._guard(call, True)))

    def hook_instructions(self, callback: ctypes.c_void_p, first: int, last: int) -> int:
        """Call before each instruction in a range, everywhere if first > last; return the hook."""
        return self._hook(_HOOK_CODE, callback, first, last)

    def hook_accesses(self, callback: ctypes.c_void_p, first: int, last: int) -> int:
        """Call before each access that begins in a range; return the hook."""
        return self._hook(_HOOK_ACCESS, callback, first, last)

    def remove_hook(self, hook: int) -> None:
        """Take a hook away; not during a run."""
        self._check(self._library.delete_hook(self._handle, hook), "remove a hook")

    # Contexts.

    def save(self) -> CoreSnapshot:
        """Return all registers, hidden ones included: what differs from a new core, as (index, word).

        What the library calls a context holds pointers too, which must not go to
        another machine: they never change, and so are never among the differences.
        """
        words = self._context_words()
        return tuple(
            (n, word)
            for n, (word, new) in enumerate(zip(words, self._new, strict=True))
            if word != new and n not in _UNSAVED_WORDS
        )

    def load(self, snapshot: CoreSnapshot) -> None:
        """Put back what `save` returned, in this process or another with the same library."""
        words = self._new[:]
        for index, word in snapshot:
            words[index] = word
        data = words.tobytes()
        ctypes.memmove(self._context + _CONTEXT_HEADER_BYTES, data, len(data))
        self._check(self._library.context_restore(self._handle, self._context), "restore")

    def _context_words(self) -> "array[int]":
        self._check(self._library.context_save(self._handle, self._context), "save")
        size = self._library.context_size(self._handle) - _CONTEXT_HEADER_BYTES
        return array("I", ctypes.string_at(self._context + _CONTEXT_HEADER_BYTES, size))

    # Plumbing.

    def _guard(self, call: Callable[..., _Result], default: _Result) -> Callable[..., _Result]:
        """Return a callback for C: it drops the handle before and the user pointer after the arguments."""

        def guarded(_uc: int, *arguments: int) -> _Result:
            try:
                return call(*arguments[:-1])
            except BaseException as error:  # noqa: BLE001 - see the module's text
                self._on_failure(error)
                return default

        return guarded

    def _pointer(self, callback: "ctypes._FuncPointer") -> ctypes.c_void_p:
        self._keep.append(callback)
        return ctypes.cast(callback, ctypes.c_void_p)

    # For an engine in C.

    @property
    def handle(self) -> int:
        """What the library calls this machine."""
        return self._handle

    @property
    def library(self) -> binding.Library:
        """The library itself."""
        return self._library

    def hook_native(self, kind: str, callback: ctypes.c_void_p, user: int, first: int = 1, last: int = 0) -> int:
        """Call a C function with `user`: before a "block" or an "instruction", at an "interrupt", at "invalid" code."""
        return self._hook(_NATIVE_HOOKS[kind], callback, first, last, user)

    def fill_tlb_native(self, callback: ctypes.c_void_p, user: int) -> None:
        """Have a C function say what may be done with each page, in place of the core's own memory map."""
        self._control(_CONTROL_TLB, ctypes.c_int(_TLB_OF_HOOKS))
        self._hook(_HOOK_TLB_FILL, callback, 1, 0, user)

    def map_io_native(self, address: int, size: int, read: ctypes.c_void_p, write: ctypes.c_void_p, user: int) -> None:
        """Map a region whose accesses are C functions."""
        error = self._library.map_io(self._handle, address, size, read, user, write, user)
        self._check(error, f"map {address:#010x}")

    def note_pc(self, address: int, size: int) -> int:
        """Have the PC brought up to date before each access of a range, which is slow; return the hook."""
        return self._hook(_HOOK_ACCESS, self._library.no_operation, address, address + size - 1)

    def _hook(self, kind: int, callback: ctypes.c_void_p, first: int, last: int, user: int | None = None) -> int:
        """Add a hook; first > last is everywhere."""
        hook = ctypes.c_size_t()
        at = ctypes.addressof(hook)
        self._check(self._library.add_hook(self._handle, at, kind, callback, user, first, last), "hook")
        return hook.value

    def _control(self, item: int, *arguments: object) -> None:
        number = ctypes.c_int(item - (1 << 32) if item >> 31 else item)
        self._check(self._library.control(ctypes.c_void_p(self._handle), number, *arguments), "control")

    @staticmethod
    def _check(error: int, what: str) -> None:
        if error:
            raise RuntimeError(f"Unicorn cannot {what}: error {error}")


def _close(library: binding.Library, handle: int, context: int, buffers: list[object]) -> None:
    """Free a machine whose `Core` is gone."""
    library.context_free(context)
    library.close(handle)
    buffers.clear()
