"""Faults: what can go wrong in the core, which exception it raises, and the report of it.

Source: ARMv7-M Architecture Reference Manual B1.5.14 and B3.2.15 to B3.2.18.
Invariant: every kind has one row in `FAULT_ROWS`.
"""

from dataclasses import dataclass, replace
from enum import Enum

from bluepill_sim.core.halts import HaltKind
from bluepill_sim.core.nvic import BUS_FAULT, HARD_FAULT, MEM_MANAGE, USAGE_FAULT
from bluepill_sim.core.recorder import BlockRow
from simbase.timing import Nanos

#: HFSR bits.
HFSR_VECTTBL, HFSR_FORCED, HFSR_DEBUGEVT = 1 << 1, 1 << 30, 1 << 31
#: CFSR bits that say that BFAR and MMFAR hold an address.
CFSR_BFARVALID = 1 << 15


class FaultKind(Enum):
    """What went wrong, in words for a person."""

    UNDEFINED_INSTRUCTION = "undefined instruction"
    INVALID_STATE = "branch to an even address (not Thumb)"
    INVALID_RETURN = "invalid exception return"
    NO_COPROCESSOR = "coprocessor instruction"
    UNALIGNED = "unaligned access"
    DIVIDE_BY_ZERO = "division by zero"
    FETCH_ERROR = "instruction fetch from nothing"
    READ_ERROR = "read of nothing"
    WRITE_ERROR = "write to nothing"
    IMPRECISE_WRITE = "imprecise write to nothing"
    STACKING = "stack outside memory at exception entry"
    UNSTACKING = "stack outside memory at exception return"
    EXECUTE_NEVER = "instruction fetch from a region that must not be executed"
    VECTOR_READ = "vector table outside memory"
    BREAKPOINT = "BKPT without a debugger"
    MASKED_SVC = "SVC that its priority does not allow"


@dataclass(frozen=True, slots=True)
class FaultRow:
    """What a fault raises and which status bits it sets."""

    exception: int
    cfsr: int = 0
    hfsr: int = 0


FAULT_ROWS = {
    FaultKind.UNDEFINED_INSTRUCTION: FaultRow(USAGE_FAULT, cfsr=1 << 16),
    FaultKind.INVALID_STATE: FaultRow(USAGE_FAULT, cfsr=1 << 17),
    FaultKind.INVALID_RETURN: FaultRow(USAGE_FAULT, cfsr=1 << 18),
    FaultKind.NO_COPROCESSOR: FaultRow(USAGE_FAULT, cfsr=1 << 19),
    FaultKind.UNALIGNED: FaultRow(USAGE_FAULT, cfsr=1 << 24),
    FaultKind.DIVIDE_BY_ZERO: FaultRow(USAGE_FAULT, cfsr=1 << 25),
    FaultKind.FETCH_ERROR: FaultRow(BUS_FAULT, cfsr=1 << 8),
    FaultKind.READ_ERROR: FaultRow(BUS_FAULT, cfsr=1 << 9 | CFSR_BFARVALID),
    FaultKind.WRITE_ERROR: FaultRow(BUS_FAULT, cfsr=1 << 9 | CFSR_BFARVALID),
    FaultKind.IMPRECISE_WRITE: FaultRow(BUS_FAULT, cfsr=1 << 10),
    FaultKind.UNSTACKING: FaultRow(BUS_FAULT, cfsr=1 << 11),
    FaultKind.STACKING: FaultRow(BUS_FAULT, cfsr=1 << 12),
    FaultKind.EXECUTE_NEVER: FaultRow(MEM_MANAGE, cfsr=1 << 0),
    FaultKind.VECTOR_READ: FaultRow(HARD_FAULT, hfsr=HFSR_VECTTBL),
    FaultKind.BREAKPOINT: FaultRow(HARD_FAULT, hfsr=HFSR_DEBUGEVT),
    FaultKind.MASKED_SVC: FaultRow(HARD_FAULT, hfsr=HFSR_FORCED),
}

_EXCEPTION_NAMES = {HARD_FAULT: "HardFault", MEM_MANAGE: "MemManage", BUS_FAULT: "BusFault", USAGE_FAULT: "UsageFault"}


#: chosen: a handler that has come back so often to the same instruction with the same registers mends nothing.
MOST_RETURNS = 16
#: chosen: a handler that takes longer is seen at work, and may wait for something that will change.
LONGEST_ROUND_NS: Nanos = 5_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenFault:
    """The core as it was at a fault, before anything was stacked."""

    at_ns: Nanos
    #: R0 to R12, SP, LR and xPSR.
    registers: tuple[int, ...]
    #: The handler that ran, and its entry in the vector table.
    exception_number: int
    vector: int | None
    last_rows: tuple[BlockRow, ...]
    #: As of `FaultReport`, since a fault was last reported.
    returns: int = 0
    last_ns: Nanos
    round_ns: Nanos = 0
    #: Whether another fault came between the one reported last and this one.
    is_other: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultReport:
    """A fault that the firmware did not handle by itself: a HardFault taken, or a lockup."""

    kind: FaultKind
    #: The exception that the fault belongs to, before it was escalated to HardFault.
    exception: int
    #: The failing instruction; of an imprecise write the store, which has long been left.
    pc: int
    #: Where that is: "symbol+0x12 (0x08000123)".
    where: str
    #: What the failed access was to; None where no access failed.
    address: int | None
    #: Name and value of R0 to R12, SP, LR, PC and xPSR at the fault.
    registers: tuple[tuple[str, int], ...]
    at_ns: Nanos
    #: Whether the core has locked up: nothing but a reset moves it.
    is_lockup: bool = False
    #: Whether a reset has ended it: the firmware did not come back from it by itself.
    ended_in_reset: bool = False
    #: What the vector table has to do with it; empty where nothing.
    vector: str = ""
    #: How often its handler came back to it with nothing changed, when last, and how long that took.
    returns: int = 0
    last_ns: Nanos = 0
    round_ns: Nanos = 0
    #: What ran up to the fault, oldest first: rows of `BlockRecorder`, at most 32.
    last_rows: tuple[BlockRow, ...] = ()

    def __str__(self) -> str:
        """Return one line for a person."""
        access = "" if self.address is None else f", address {self.address:#010x}"
        end = "; the core locked up" if self.is_lockup and self.ended_in_reset else ""
        end = "; the core is locked up" if self.is_lockup and not self.ended_in_reset else end
        end += "; its handler came back to it again and again" if self.returns >= MOST_RETURNS else ""
        end += "; a reset ended it" if self.ended_in_reset else ""
        name = _EXCEPTION_NAMES.get(self.exception, f"exception {self.exception}")
        vector = f" ({self.vector})" if self.vector else ""
        return f"{name}: {self.kind.value} at {self.where}{access}{vector}, t = {self.at_ns / 1e9:.6f} s{end}"

    def again(self, seen: SeenFault) -> "FaultReport":
        """Return it with one more return of its handler, and those that were seen with it."""
        round_ns = seen.round_ns or seen.at_ns - self.last_ns
        return replace(self, returns=self.returns + 1 + seen.returns, last_ns=seen.last_ns, round_ns=round_ns)

    def repeats_at(self, now_ns: Nanos) -> bool:
        """Whether its handler comes back to it for ever, as far as anybody can tell: not two rounds ago it did."""
        is_quick = self.round_ns <= LONGEST_ROUND_NS
        return self.returns >= MOST_RETURNS and is_quick and now_ns - self.last_ns <= 2 * self.round_ns

    @property
    def register_dump(self) -> str:
        """The registers in four columns, for a person."""
        cells = [f"{name:>4} {value:08x}" for name, value in self.registers]
        return "\n".join("  ".join(cells[n : n + 4]) for n in range(0, len(cells), 4))


#: What a halt of the engine means to the architecture.
FAULT_OF_HALT = {
    HaltKind.UNDEFINED: FaultKind.UNDEFINED_INSTRUCTION,
    HaltKind.NO_COPROCESSOR: FaultKind.NO_COPROCESSOR,
    HaltKind.INVALID_STATE: FaultKind.INVALID_STATE,
    HaltKind.READ_ERROR: FaultKind.READ_ERROR,
    HaltKind.WRITE_ERROR: FaultKind.WRITE_ERROR,
    HaltKind.FETCH_ERROR: FaultKind.FETCH_ERROR,
    HaltKind.EXECUTE_NEVER: FaultKind.EXECUTE_NEVER,
    HaltKind.DIVIDE_BY_ZERO: FaultKind.DIVIDE_BY_ZERO,
    HaltKind.UNALIGNED: FaultKind.UNALIGNED,
    HaltKind.BKPT: FaultKind.BREAKPOINT,
}
