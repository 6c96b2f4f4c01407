"""The few functions of Unicorn's C interface that the engine uses, by ctypes.

The Python binding that ships with Unicorn wraps each call and each callback;
going to the library directly halves the price of both, and they are what a run
spends its time in. Unicorn is imported here only, and only when an engine is
made, so that the rest of the package works without it.

Source: unicorn.h of Unicorn 2.1.
"""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from bluepill_sim.errors import MissingDependencyError

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


#: What C functions take here.
_Argument = ctypes.c_void_p | ctypes.c_int | ctypes.c_uint32 | ctypes.c_uint64 | ctypes.c_size_t


@dataclass(frozen=True, slots=True)
class Library:
    """The loaded library: each attribute is one C function."""

    open: Callable[..., int]
    close: Callable[..., int]
    control: Callable[..., int]
    start: Callable[..., int]
    stop: Callable[..., int]
    read_register: Callable[..., int]
    write_register: Callable[..., int]
    read_registers: Callable[..., int]
    write_registers: Callable[..., int]
    map_pointer: Callable[..., int]
    map_io: Callable[..., int]
    protect: Callable[..., int]
    add_hook: Callable[..., int]
    delete_hook: Callable[..., int]
    context_size: Callable[..., int]
    context_save: Callable[..., int]
    context_restore: Callable[..., int]
    context_alloc: Callable[..., int]
    context_free: Callable[..., int]
    #: A C function without effect, to be given as a callback that costs nothing.
    no_operation: ctypes.c_void_p
    version: str


def load_library() -> Library:
    """Load Unicorn.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        import unicorn
        from unicorn.unicorn_py3.unicorn import uclib
    except ImportError as error:
        raise MissingDependencyError(
            f"the BluePill needs the unicorn library: {error}", hint="pip install 'p2os[sim]'"
        ) from error
    # PyDLL keeps the interpreter lock: the engine calls back into Python at each
    # block, and taking the lock there costs as much as the callback.
    library = ctypes.PyDLL(uclib._name)  # noqa: SLF001 - the only place where the binding keeps the path
    word = ctypes.c_void_p

    def function(name: str, *arguments: type[_Argument]) -> Callable[..., int]:
        result = library[name]
        result.argtypes = arguments
        result.restype = ctypes.c_int
        return cast("Callable[..., int]", result)

    no_operation = ctypes.cast(library["uc_arch_supported"], ctypes.c_void_p)  # looks at a number, returns a flag
    return Library(
        open=function("uc_open", ctypes.c_int, ctypes.c_int, word),
        close=function("uc_close", word),
        control=library["uc_ctl"],  # variadic: its arguments are wrapped at the call
        start=function("uc_emu_start", word, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_size_t),
        stop=function("uc_emu_stop", word),
        read_register=function("uc_reg_read", word, ctypes.c_int, word),
        write_register=function("uc_reg_write", word, ctypes.c_int, word),
        read_registers=function("uc_reg_read_batch", word, word, word, ctypes.c_int),
        write_registers=function("uc_reg_write_batch", word, word, word, ctypes.c_int),
        map_pointer=function("uc_mem_map_ptr", word, ctypes.c_uint64, ctypes.c_size_t, ctypes.c_uint32, word),
        map_io=function("uc_mmio_map", word, ctypes.c_uint64, ctypes.c_size_t, word, word, word, word),
        protect=function("uc_mem_protect", word, ctypes.c_uint64, ctypes.c_size_t, ctypes.c_uint32),
        add_hook=function("uc_hook_add", word, word, ctypes.c_int, word, word, ctypes.c_uint64, ctypes.c_uint64),
        delete_hook=function("uc_hook_del", word, ctypes.c_size_t),
        context_size=function("uc_context_size", word),
        context_save=function("uc_context_save", word, word),
        context_restore=function("uc_context_restore", word, word),
        context_alloc=function("uc_context_alloc", word, word),
        context_free=function("uc_context_free", word),
        no_operation=no_operation,
        version=str(getattr(unicorn, "__version__", "unknown")),
    )
