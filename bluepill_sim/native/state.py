"""What the native core and Python both see: one struct in the C core's memory, declared in `extension/layout.py`."""

import ctypes
from typing import Any

from bluepill_sim.core.halts import HaltKind
from bluepill_sim.core.recorder import BLOCK, RECORD, BlockRow
from bluepill_sim.extension.layout import INSTRUCTION, LAST_ROWS, SHARED, structure
from bluepill_sim.extension.windows import flag
from simbase.state import Stateful

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

Shared, InstructionRow = structure(SHARED), structure(INSTRUCTION)


def ordered_rows(holder: Any) -> bytes:
    """Return the rows of a struct with the fields `logged` and `last`, oldest first."""
    logged, rows = holder.logged, bytes(holder.last)
    first = logged % LAST_ROWS * RECORD.size
    return rows[:first] if logged < LAST_ROWS else rows[first:] + rows[:first]


class NativeLastRows(Stateful):
    """`KeptRows` in the shared struct."""

    STATE = ("packed",)

    is_first = flag("is_first", "As of `KeptRows`.")

    def __init__(self, shared: Any) -> None:
        self.shared = shared

    def append(self, row: BlockRow) -> None:
        """As of `KeptRows`."""
        shared = self.shared
        shared.last[shared.logged % LAST_ROWS] = row
        shared.logged += 1

    @property
    def packed(self) -> bytes:
        """As of `KeptRows`."""
        return ordered_rows(self.shared)

    @packed.setter
    def packed(self, packed: bytes) -> None:
        ctypes.memmove(self.shared.last, packed, len(packed))
        self.shared.logged = len(packed) // RECORD.size

    def ends_with_block(self, address: int) -> bool:
        """As of `KeptRows`."""
        shared = self.shared
        last = shared.last[(shared.logged - 1) % LAST_ROWS]
        return bool(shared.logged) and last.kind == BLOCK and last.address == address
