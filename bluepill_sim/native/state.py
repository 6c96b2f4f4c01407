"""What the native core and Python both see: one struct in the C core's memory.

Invariant: `Shared` is `struct shared` of bluepill_sim/native/source/core.h, field by
field; `native/library.py` refuses a library that has another size of it.
"""

import ctypes
from typing import Any

from bluepill_sim.core.halts import HaltKind
from bluepill_sim.core.recorder import BLOCK, LAST_ROWS, RECORD, BlockRow
from simbase.state import Stateful

#: What stands for "never" and for "none" among times.
NO_TIME = (1 << 64) - 1

#: Kinds of halts in the order of `enum halt`.
HALT_KINDS = (
    HaltKind.BOUNDARY,
    HaltKind.EXCEPTION_RETURN,
    HaltKind.SUPERVISOR_CALL,
    HaltKind.BKPT,
    HaltKind.WAIT_INTERRUPT,
    HaltKind.WAIT_EVENT,
    HaltKind.UNDEFINED,
    HaltKind.NO_COPROCESSOR,
    HaltKind.INVALID_STATE,
    HaltKind.READ_ERROR,
    HaltKind.WRITE_ERROR,
    HaltKind.FETCH_ERROR,
    HaltKind.EXECUTE_NEVER,
    HaltKind.DIVIDE_BY_ZERO,
    HaltKind.UNALIGNED,
)
HALT_NUMBERS = {kind: number for number, kind in enumerate(HALT_KINDS)}
#: The kinds that follow them, for Python alone.
BOUNDARY = 0
DELIVER, FAILED, STALE, FROZEN, UNEXPLAINED = range(len(HALT_KINDS), len(HALT_KINDS) + 5)

_U8, _U32, _U64 = ctypes.c_uint8, ctypes.c_uint32, ctypes.c_uint64


class Record(ctypes.Structure):
    """`struct record`."""

    _fields_ = (("cycle", _U64), ("address", _U32), ("kind", ctypes.c_int32))


class Shared(ctypes.Structure):
    """`struct shared`."""

    _fields_ = (
        ("cycle", _U64),
        ("stop_at", _U64),
        ("access_cycle", _U64),
        ("last_sleep_cycle", _U64),
        ("tick_base", _U64),
        ("tick_next", _U64),
        ("pending_low", _U64),
        ("pending_high", _U64),
        ("active_low", _U64),
        ("active_high", _U64),
        ("enabled", _U64),
        ("levels", _U64),
        ("access_pc", _U32),
        ("in_access", _U32),
        ("pc", _U32),
        ("is_thumb", _U32),
        ("mask_stop", _U32),
        ("attention", _U32),
        ("halt_kind", _U32),
        ("halt_pc", _U32),
        ("halt_address", _U32),
        ("halt_has_address", _U32),
        ("run_from", _U32),
        ("uses_exclusive", _U32),
        ("exception_number", _U32),
        ("sleep", _U32),
        ("event_register", _U32),
        ("vector_table", _U32),
        ("scr", _U32),
        ("ccr", _U32),
        ("tick_control", _U32),
        ("tick_reload", _U32),
        ("tick_value", _U32),
        ("tick_count_flag", _U32),
        ("traps_division", _U32),
        ("grouping", _U32),
        ("it_state", _U32),
        ("is_python", _U32),
        ("dirty", _U32),
        ("is_first", _U32),
        ("last_pin_cycle", _U64),
        ("priorities", _U8 * 76),
        ("_priorities_end", _U8 * 4),
        ("sram", _U64),
        ("flash", _U64),
        ("sram_base", _U32),
        ("sram_bytes", _U32),
        ("flash_base", _U32),
        ("flash_bytes", _U32),
        ("scratch", _U32),
        ("has_irq_listeners", _U32),
        ("exact_stops", _U64),
        ("logged", _U64),
        ("last", Record * LAST_ROWS),
    )


class InstructionRow(ctypes.Structure):
    """`struct instruction`."""

    _fields_ = (
        ("address", _U32),
        ("cycle", _U32),
        ("offset", ctypes.c_int32),
        ("kind", _U8),
        ("bytes", _U8),
        ("base", _U8),
        ("index", _U8),
        ("shift", _U8),
        ("count", _U8),
        ("_padding", _U8 * 2),
    )


def field(name: str, doc: str) -> Any:
    """Return a property that is a field of `self.shared`."""

    def read(self: Any) -> int:
        return getattr(self.shared, name)  # type: ignore[no-any-return]  # a field of a ctypes struct

    def write(self: Any, value: int) -> None:
        setattr(self.shared, name, value)

    return property(read, write, doc=doc)


def flag(name: str, doc: str) -> Any:
    """Return a property that is a field of `self.shared`, as a bool."""

    def read(self: Any) -> bool:
        return getattr(self.shared, name) != 0  # type: ignore[no-any-return]  # as above

    def write(self: Any, value: bool) -> None:
        setattr(self.shared, name, value)

    return property(read, write, doc=doc)


def time(name: str, doc: str) -> Any:
    """Return a property that is a time in `self.shared`, or None."""

    def read(self: Any) -> int | None:
        value: int = getattr(self.shared, name)
        return None if value == NO_TIME else value

    def write(self: Any, value: int | None) -> None:
        setattr(self.shared, name, NO_TIME if value is None else value)

    return property(read, write, doc=doc)


class NativeLastRows(Stateful):
    """`KeptRows` in the shared struct."""

    STATE = ("packed",)

    is_first = flag("is_first", "As of `KeptRows`.")

    def __init__(self, shared: Shared) -> None:
        self.shared = shared

    def append(self, row: BlockRow) -> None:
        """As of `KeptRows`."""
        shared = self.shared
        shared.last[shared.logged % LAST_ROWS] = row
        shared.logged += 1

    @property
    def packed(self) -> bytes:
        """As of `KeptRows`."""
        logged, rows = self.shared.logged, bytes(self.shared.last)
        first = logged % LAST_ROWS * RECORD.size
        return rows[:first] if logged < LAST_ROWS else rows[first:] + rows[:first]

    @packed.setter
    def packed(self, packed: bytes) -> None:
        ctypes.memmove(self.shared.last, packed, len(packed))
        self.shared.logged = len(packed) // RECORD.size

    def ends_with_block(self, address: int) -> bool:
        """As of `KeptRows`."""
        shared = self.shared
        last = shared.last[(shared.logged - 1) % LAST_ROWS]
        return bool(shared.logged) and last.kind == BLOCK and last.address == address
