"""The machine as the debugger sees it: what runs the chip, and why it is halted.

`bluepill_sim` alone runs a lone chip; a bench runs the chip with a robot. The
debugger does not see the difference: it asks for time to go on, and for
snapshots.

Invariant: a machine is halted as a whole.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from bluepill_sim.board import BluePill
from bluepill_sim.core import Watchpoint
from bluepill_sim.core.halts import ChipReached
from simbase.state import Stateful
from simbase.timing import Nanos


class StopKind(Enum):
    """Why the chip is halted."""

    #: Before the instruction at a breakpoint.
    BREAKPOINT = "breakpoint"
    #: After an instruction that accessed a watched address.
    WATCHPOINT = "watchpoint"
    STEP = "step"
    #: Ctrl-C.
    INTERRUPT = "interrupt"
    #: BKPT in the program.
    BKPT = "bkpt"
    #: A fault that the program does not handle by itself, or a lockup.
    FAULT = "fault"
    #: The program ended by semihosting.
    EXIT = "exit"
    #: The run is over: its scenario's time is up.
    END = "end"
    #: Backwards: nothing older is known.
    BEGIN = "begin"


@dataclass(frozen=True, slots=True)
class HaltReason:
    """Why and where."""

    kind: StopKind
    #: The address that was accessed, of a WATCHPOINT.
    address: int | None = None
    #: Exit code of the program, of an EXIT.
    code: int = 0


class Machine(Protocol):
    """What runs the chip and everything connected to it."""

    @property
    def board(self) -> BluePill:
        """The chip on its board."""

    @property
    def end_ns(self) -> Nanos | None:
        """When the run is over; None for never."""

    @property
    def can_rewind(self) -> bool:
        """Whether `restore` is possible: not with a real robot."""

    def advance_to(self, limit_ns: Nanos, *, by_step: bool = False) -> ChipReached:
        """Bring everything to a time; less far where the chip halts, or by one instruction of the chip."""

    def snapshot(self) -> object:
        """Return all that decides the future."""

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; only where `can_rewind`."""

    def halted(self) -> None:
        """Act on a halt of the chip: a real robot is stopped here."""


class DebugTarget(Protocol):
    """A machine that a debugger runs; where another one runs it, what runs it returns None: the halt comes later."""

    @property
    def machine(self) -> Machine:
        """What is run."""

    @property
    def read_only(self) -> str:
        """Why nothing of it is written to, in a line; empty: it is."""

    def go_on(self) -> HaltReason | None:
        """Run until something stops the chip."""

    def step(self) -> HaltReason | None:
        """Run one instruction of the program."""

    def step_back(self) -> HaltReason | None:
        """Go to the state before the last instruction."""

    def go_back(self) -> HaltReason | None:
        """Go to the last stop before this state."""

    def set_point(self, point: int | Watchpoint, *, is_set: bool) -> None:
        """Halt before the instruction at an address, or at an access; or no longer."""

    def changed(self) -> None:
        """Take that the machine has been written to."""


class LoneChip(Stateful):
    """A board by itself."""

    STATE = ("board",)

    end_ns: Nanos | None = None
    can_rewind = True

    def __init__(self, board: BluePill) -> None:
        self.board = board

    def advance_to(self, limit_ns: Nanos, *, by_step: bool = False) -> ChipReached:
        """Bring the board to a time, or one instruction on."""
        return self.board.step(limit_ns) if by_step else self.board.advance_to(limit_ns)

    def halted(self) -> None:
        """Nothing else is connected."""
