"""Why a run of the engine ended.

Invariant: a `Halt` names the next instruction to run, or the one that failed.
"""

from dataclasses import dataclass
from enum import Enum


class HaltKind(Enum):
    """Why a run ended."""

    #: At a block border, because `stop_at` was reached.
    BORDER = "border"
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
    #: The engine's own: before a write to read-only memory that somebody takes.
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
    """Why and where a run ended."""

    kind: HaltKind
    #: The next instruction to run; for a fault, the one that failed.
    pc: int
    #: What a failed or watched access was to.
    address: int | None = None
    #: A watched access that the instruction made before it ended the run for a reason of its own.
    watched: int | None = None
