"""Time of the emulated chip: spans in words, core cycles, and why a run stopped.

Nothing here keeps time; the chip (`chip.py`) and the engine (`core/engine.py`)
do.

Invariant: all times are integers, and nothing is accumulated; `advance_to(limit)`
of the chip leaves it with every deadline at or before the time reached acted on.
"""

from dataclasses import dataclass
from enum import Enum

from bluepill_sim.errors import BluePillError
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos, Reached
from simbase.units import TIME


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


class CycleClock(Stateful):
    """Cycles of the core and nanoseconds of the world, one from the other.

    They are tied together at one point (base_ns, base_cycle), which moves only when
    the frequency changes; `cycle_at(ns)` is the first cycle whose `ns_of` is at or after `ns`.
    """

    STATE = ("frequency_hz", "_base_ns", "_base_cycle")

    def __init__(self, frequency_hz: int) -> None:
        self.frequency_hz = frequency_hz
        self._base_ns = 0
        self._base_cycle = 0

    @property
    def base(self) -> tuple[int, Nanos, int]:
        """The frequency in Hz, and the time in ns and the cycle from which it counts."""
        return self.frequency_hz, self._base_ns, self._base_cycle

    def ns_of(self, cycle: int) -> Nanos:
        """Return when a cycle begins, rounded down."""
        return self._base_ns + (cycle - self._base_cycle) * NS_PER_S // self.frequency_hz

    def cycle_at(self, at_ns: Nanos) -> int:
        """Return the first cycle that begins at or after a time."""
        return self._base_cycle - (self._base_ns - at_ns) * self.frequency_hz // NS_PER_S

    def set_frequency(self, frequency_hz: int, cycle: int) -> None:
        """Go on at another frequency from `cycle` on."""
        self._base_ns = self.ns_of(cycle)
        self._base_cycle = cycle
        self.frequency_hz = frequency_hz


#: A span: nanoseconds, or a number with its unit.
Span = int | str
#: chosen: longer than anybody waits, and far inside what the chip counts.
LONGEST = "8784h"
_LONGEST_NS = TIME.read(LONGEST)


def to_nanos(span: Span) -> Nanos:
    """Return a span in nanoseconds: exactly, for no binary fraction stands between the text and its value.

    Args:
        span: nanoseconds as an integer, or a number with one of ns, us, ms, s, min, h.

    Raises:
        BluePillError: it has no unit, a negative or absurd length, or is no span at all.
    """
    nanos = TIME.read(span, BluePillError) if isinstance(span, str) else span
    if isinstance(nanos, bool) or not isinstance(nanos, int):
        raise BluePillError(f"{span!r} is no span of time", hint='nanoseconds as an integer, or "10 ms"')
    if not 0 <= nanos <= _LONGEST_NS:
        raise BluePillError(f"{span!r} is negative or longer than a year", hint="give a span such as 10ms")
    return nanos
