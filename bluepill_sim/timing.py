"""The contract for time that the emulated chip keeps.

The shapes are those of the rest of the project, defined here once more because
this package knows nothing of robots or their protocol and imports none of it.

Invariant: `advance_to(limit)` leaves the chip with every deadline at or before
the time reached already acted on.
"""

from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from bluepill_sim.cpu.halt import Halt

#: A point in virtual time, or a span of it, in nanoseconds.
Nanos: TypeAlias = int

NS_PER_US = 1_000
NS_PER_MS = 1_000_000
NS_PER_S = 1_000_000_000


class Reason(Enum):
    """Why the chip stopped where it did."""

    #: The limit was reached.
    DEADLINE = "deadline"
    #: A watched pin changed.
    EDGE = "edge"
    #: The firmware is locked up, or a debugger stands the chip still: `Reached.halt` tells which.
    HALT = "halt"
    #: The outcome of the run is decided; the chip itself never says so.
    VERDICT = "verdict"


@dataclass(frozen=True, slots=True)
class Reached:
    """How far the chip came, and why it stopped there."""

    now: Nanos
    reason: Reason = Reason.DEADLINE
    #: What a debugger asked for: BREAKPOINT, WATCHPOINT, STEP or BKPT; None for all else.
    halt: Halt | None = None
