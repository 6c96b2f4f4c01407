"""Why and where a run of the core ended, and how far the chip came with it.

Invariant: `advance_to(limit)` of the chip leaves it with every deadline at or before the time reached acted on.
"""

from dataclasses import dataclass
from enum import Enum

from simbase.timing import Reached


class HaltKind(Enum):
    """Why a run of the engine ended."""

    #: At a block boundary, because `stop_at` was reached.
    BOUNDARY = "boundary"
    EXCEPTION_RETURN = "exception return"
    SUPERVISOR_CALL = "SVC"
    BKPT = "BKPT"
    WAIT_INTERRUPT = "WFI"
    WAIT_EVENT = "WFE"
    UNDEFINED = "undefined instruction"
    NO_COPROCESSOR = "no coprocessor"
    INVALID_STATE = "not in Thumb state"
    READ_ERROR = "read of nothing"
    WRITE_ERROR = "write to nothing"
    FETCH_ERROR = "fetch from nothing"
    EXECUTE_NEVER = "fetch from a region that must not be executed"
    #: The engine's own: before a write to read-only memory that `on_read_only_write` takes.
    TAKEN_WRITE = "write to flash"
    DIVIDE_BY_ZERO = "division by zero"
    UNALIGNED = "unaligned access"
    #: A debugger's: before the instruction at a breakpoint.
    BREAKPOINT = "breakpoint"
    #: A debugger's: after the instruction that made a watched access, to `address`.
    WATCHPOINT = "watchpoint"
    #: A debugger's: after one instruction.
    STEP = "step"


#: Halts that only a debugger asks for; BKPT is one of them while a debugger is attached.
DEBUG_HALTS = frozenset({HaltKind.BREAKPOINT, HaltKind.WATCHPOINT, HaltKind.STEP})


@dataclass(frozen=True, slots=True)
class Halt:
    """Why and where a run of the engine ended."""

    kind: HaltKind
    #: The next instruction to run; for a fault, the one that failed.
    pc: int
    #: What a failed or watched access was to.
    address: int | None = None
    #: A watched access that the instruction made before it ended the run for a reason of its own.
    watched: int | None = None


@dataclass(frozen=True, slots=True)
class ChipReached(Reached):
    """How far the chip came, and why it stopped there."""

    #: What a debugger asked for: BREAKPOINT, WATCHPOINT, STEP or BKPT; None for all else.
    halt: Halt | None = None
