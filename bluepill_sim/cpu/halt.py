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
