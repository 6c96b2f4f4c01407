"""`UnicornCore` with the interpreter of our own in Unicorn's place: the same hooks, maps and registers.

The interpreter is `source/interpreter/` of the emulator's library: its functions have the signatures of Unicorn's, so
that what stands above cannot tell them apart, but for what is better here: the PC of each access is known, a run ends
inside an IT block too, and no register of the M-profile is hidden from a thread without privilege.

Invariant: as of `UnicornCore`.
"""

import ctypes
import weakref
from collections.abc import Callable
from typing import Any, ClassVar

from bluepill_sim.core.unicorn_core import (
    ANOTHER_CORE,
    PROTECTION_OF,
    CoreContext,
    RawRead,
    RawWrite,
    RegisterFile,
    UnicornCore,
)
from bluepill_sim.extension.layout import NOWHERE, VIEWS_BASE
from bluepill_sim.extension.library import UNICORN_FUNCTIONS, library, made

_EVERYWHERE = 1 << 32


class InterpreterFunctions:
    """The functions of Unicorn that the interpreter has, by Unicorn's names."""

    def __init__(self) -> None:
        for name in UNICORN_FUNCTIONS:
            setattr(self, name, getattr(library(), name.replace("uc_", "interpreter_")))

    def __getattr__(self, name: str) -> Any:
        """Refuse what it does not have."""
        raise AttributeError(f"the interpreter has no {name}")


class InterpreterCore(UnicornCore):
    """A bare Cortex-M3 of our own.

    Raises:
        MissingDependencyError: the emulator's library is not built.
    """

    BLOCK_HOOK: ClassVar[str] = "core_on_known_block"
    TELLS_PC: ClassVar[bool] = True

    def __init__(self, on_failure: Callable[[BaseException], None]) -> None:
        """Make a core without memory, but for the scratch page."""
        self._library: Any = InterpreterFunctions()
        self._on_failure = on_failure
        self._handle = handle = made(library().interpreter_new(), "the interpreter")
        self._keep: list[object] = []
        self._buffers: list[object] = []
        self._sinks: dict[int, object] = {}
        weakref.finalize(self, _close, handle, self._buffers)
        self.registers = RegisterFile(self._library, handle)
        self._map_scratch()

    def start(self, address: int) -> int:
        """As of `UnicornCore`."""
        error: int = self._library.uc_emu_start(self._handle, address, NOWHERE, 0, 0)
        return error

    # Memory.

    def map_memory(self, address: int, buffer: "ctypes.Array[ctypes.c_char]", protection: str) -> None:
        """As of `UnicornCore`; what may be executed is not looked at."""
        self._buffers.append(buffer)
        bits = sum(PROTECTION_OF[letter] for letter in protection)
        self._map(address, len(buffer), bits, ctypes.addressof(buffer))
        if address == VIEWS_BASE:
            library().interpreter_find_pages(self._handle, True)

    def _map(self, address: int, size: int, bits: int, at: int) -> None:
        self._check(library().interpreter_map(self._handle, address, size, bits, at), f"map {address:#010x}")

    def _unmap(self, address: int, size: int) -> None:
        self._check(library().interpreter_unmap(self._handle, address, size), f"unmap {address:#010x}")

    def allow_execution(self, address: int, size: int) -> None:
        """As of `UnicornCore`: it may be executed."""

    def map_io(self, address: int, size: int, read: RawRead, write: RawWrite) -> None:
        """As of `UnicornCore`."""
        reader, writer = self._io_pointers(read, write)
        error = library().interpreter_map_io(self._handle, address, size, reader, None, writer, None)
        self._check(error, f"map {address:#010x}")

    def map_io_native(self, address: int, size: int, read: ctypes.c_void_p, write: ctypes.c_void_p, user: int) -> None:
        """As of `UnicornCore`."""
        error = library().interpreter_map_io(self._handle, address, size, read, user, write, user)
        self._check(error, f"map {address:#010x}")

    def drop_code(self, address: int, size: int) -> None:
        """As of `UnicornCore`."""
        library().interpreter_drop(self._handle, address, address + size)

    def drop_all_code(self) -> None:
        """As of `UnicornCore`."""
        library().interpreter_drop(self._handle, 0, _EVERYWHERE)

    def drop_pages(self) -> None:
        """As of `UnicornCore`: the page hook is asked each time."""

    # Hooks.

    def remove_hook(self, hook: int) -> None:
        """As of `UnicornCore`."""
        library().interpreter_unhook(self._handle, hook)

    def note_pc(self, address: int, size: int) -> int:  # noqa: ARG002 - it is known anywhere
        """As of `UnicornCore`, which costs nothing here: the hook is none."""
        return 0

    def _hook(self, kind: int, callback: ctypes.c_void_p, first: int, last: int, user: int | None = None) -> int:
        hook: int = library().interpreter_hook(self._handle, kind, callback, user, first, last)
        if not hook:
            raise RuntimeError("the interpreter has no room for another hook")
        return hook

    def _find_pages_by_hooks(self) -> None:
        """As of `UnicornCore`: where there is a page hook, it is asked."""

    # Contexts.

    @property
    def context(self) -> CoreContext:
        """All registers, hidden ones included."""
        buffer = ctypes.create_string_buffer(library().interpreter_context_bytes())
        library().interpreter_save(self._handle, ctypes.addressof(buffer))
        return buffer.raw

    @context.setter
    def context(self, context: CoreContext) -> None:
        if len(context) != library().interpreter_context_bytes():
            raise ValueError(ANOTHER_CORE)
        library().interpreter_restore(self._handle, ctypes.c_char_p(context))


def _close(handle: int, buffers: list[object]) -> None:
    library().interpreter_free(handle)
    buffers.clear()
