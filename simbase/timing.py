"""The contract for time that every part of the project keeps.

Time is an integer of nanoseconds that is passed in. A part says when it next
wants to act (`next_deadline`) and is brought forward (`advance_to`); it reads
no clock, sleeps never and starts no thread.

Invariant: `advance_to(limit)` leaves the part with every deadline at or before
the time reached already acted on.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeAlias

#: A point in virtual time, or a span of it, in nanoseconds.
Nanos: TypeAlias = int

NS_PER_US = 1_000
NS_PER_MS = 1_000_000
NS_PER_S = 1_000_000_000


def nanos(span_s: float) -> Nanos:
    """Return seconds as the nearest nanosecond."""
    return round(span_s * NS_PER_S)


class Reason(Enum):
    """Why a part stopped where it did."""

    #: The limit was reached.
    DEADLINE = "deadline"
    #: A watched net changed.
    EDGE = "edge"
    #: A debugger or a fault stands the part still.
    HALT = "halt"


@dataclass(frozen=True, slots=True)
class Reached:
    """How far a part came, and why it stopped there."""

    now: Nanos
    reason: Reason = Reason.DEADLINE


class Timed(Protocol):
    """A passive state machine in virtual time."""

    def next_deadline(self) -> Nanos | None:
        """Return when this part next wants to act, or None for never."""

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit` nanoseconds."""

    def snapshot(self) -> object:
        """Return all that decides this part's future, as a value that can be pickled."""

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
