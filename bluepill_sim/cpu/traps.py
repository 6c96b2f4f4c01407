"""What a Cortex-M3 traps and Unicorn lets pass: divisions by zero, and accesses that must be aligned.

Hooks stand on just the instructions that may trap; a block that has some is
translated again with them, the first time that it is entered.

Source: ARMv7-M Architecture Reference Manual A3.2.1, B3.2.8 (CCR).
Invariant: a block in `_armed` was translated with its hooks in place.
"""

from collections.abc import Callable

from bluepill_sim.block_cost import Block
from bluepill_sim.cpu.core import Core
from bluepill_sim.cpu.halt import HaltKind
from bluepill_sim.cpu.registers import GENERAL, Register

#: Stops the engine before the instruction at an address: (kind, PC, address of the data).
StopBefore = Callable[[HaltKind, int, int | None], None]
#: Flash and SRAM lie below; peripherals above have rules of their own.
_LAST_NORMAL_ADDRESS = 0x21FF_FFFF


class Traps:
    """Watches the instructions that may trap."""

    def __init__(self, core: Core, stop_before: StopBefore, leave_it_block: Callable[[], object]) -> None:
        self._core = core
        self._stop_before = stop_before
        self._leave_it_block = leave_it_block
        #: What is wanted.
        self._division = self._unaligned = False
        #: Whether that has changed since the last run.
        self.have_changed = False
        #: Blocks to be translated again.
        self.stale: list[Block] = []
        self._watches_alignment = False
        self._trapped: set[tuple[int, int, HaltKind]] = set()
        self._armed: set[tuple[int, tuple[tuple[int, int], ...]]] = set()

    def choose(self, *, division: bool, unaligned: bool) -> bool:
        """Choose what traps; return whether that is new."""
        if division == self._division and unaligned == self._unaligned:
            return False
        self._division, self._unaligned = division, unaligned
        self.have_changed = True
        return True

    def begin(self) -> None:
        """Take up what was chosen, between runs."""
        self.have_changed = False
        if self._unaligned and not self._watches_alignment:
            self._watches_alignment = True
            self._core.on_access(0, _LAST_NORMAL_ADDRESS, self._watch_alignment)

    def needs_hooks(self, block: Block) -> bool:
        """Tell whether a block must be translated again before it runs, and remember that."""
        if not block.aligned and not block.divides:
            return False
        wanted = self._of(block)
        if not wanted or (block.start, wanted) in self._armed:
            return False
        self.stale.append(block)
        return True

    def arm(self) -> None:
        """Put hooks into the stale blocks, between runs."""
        for block in self.stale:
            self._armed.add((block.start, self._of(block)))
            for address, register in block.aligned:
                self._trap(address, register, HaltKind.UNALIGNED)
            for address, register in self._divides_of(block):
                self._trap(address, register, HaltKind.DIVIDE_BY_ZERO)
            self._core.drop_code(block.start, block.end - block.start)
        self.stale.clear()

    def _of(self, block: Block) -> tuple[tuple[int, int], ...]:
        return block.aligned + self._divides_of(block)

    def _divides_of(self, block: Block) -> tuple[tuple[int, int], ...]:
        """Return the divisions to look at: all while the trap is on, else those that may come just after its switch."""
        return block.divides if self._division else block.late_divides

    def _watch_alignment(self, _access: int, address: int, size: int, _value: int) -> bool:
        if self._unaligned and address % size:
            self._stop_before(HaltKind.UNALIGNED, self._core.registers[Register.PC], address)
        else:
            self._leave_it_block()
        return True

    def _trap(self, address: int, number: int, kind: HaltKind) -> None:
        """Look at a register each time before the instruction at `address`."""
        if (address, number, kind) in self._trapped:
            return
        self._trapped.add((address, number, kind))
        register = GENERAL[number]

        def look_at_base() -> None:
            value = self._core.registers[register]
            if value & 3:
                self._stop_before(kind, address, value)

        def look_at_divisor() -> None:
            if self._division and not self._core.registers[register]:
                self._stop_before(kind, address, None)

        self._core.on_instruction(address, look_at_base if kind is HaltKind.UNALIGNED else look_at_divisor)
