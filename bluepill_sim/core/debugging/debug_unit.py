"""Breakpoints, watchpoints and single steps of an engine: the part that only debugging needs.

Theory of operation. Hooks stand on just the addresses that are wanted, so that
a run with breakpoints is as fast as one without; a single step hooks every
instruction for its own duration. A hook never lets the engine go on from a
half-done state: `Engine.stop_before` undoes what runs after it (Unicorn cannot
end a run inside an IT block), so that the core stands exactly before the
instruction. A watchpoint stops the same way, and then the instruction is
stepped over: the halt that is reported is one after the access.

A debugger has any number of breakpoints and watchpoints; those of the firmware, which come from the comparators of FPB
and DWT (`comparators.py`), have sets of their own. An instruction that its IT block skips breaks nothing. Stacking by
an exception is not watched.

Invariant: between runs the hooks are those of all four sets
as they were when the last run began.
"""

import ctypes
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum

from bluepill_sim.core.halts import HaltKind
from bluepill_sim.core.unicorn_core import EVERYWHERE, READ_ACCESS, Reg, UnicornCore


class WatchKind(Enum):
    """Which accesses a watchpoint waits for."""

    READ = "read"
    WRITE = "write"
    ACCESS = "access"


@dataclass(frozen=True, slots=True)
class Watchpoint:
    """Bytes whose accesses by the program halt the core.

    Raises:
        ValueError: it is empty.
    """

    address: int
    size: int
    kind: WatchKind = WatchKind.WRITE

    def __post_init__(self) -> None:
        if self.size < 1:
            raise ValueError(f"a watchpoint watches 1 byte or more, not {self.size}")

    def sees(self, address: int, size: int, *, is_read: bool) -> bool:
        """Tell whether an access is one that it waits for."""
        if self.kind is (WatchKind.WRITE if is_read else WatchKind.READ):
            return False
        return address < self.address + self.size and self.address < address + size


class DebugUnit:
    """The hooks of one core."""

    def __init__(self, core: UnicornCore, stop_before: Callable[[HaltKind, int, int | None], None]) -> None:
        self._core = core
        self._stop_before = stop_before
        #: Addresses of instructions that the core stops before; take effect with the next run.
        self.breakpoints: set[int] = set()
        #: Take effect with the next run.
        self.watchpoints: set[Watchpoint] = set()
        #: The same, of the firmware.
        self.own_breakpoints: set[int] = set()
        self.own_watchpoints: set[Watchpoint] = set()
        #: Those of the firmware that the last watched access has met, and whether a debugger waits for it too.
        self.met: tuple[Watchpoint, ...] = ()
        self.is_debuggers = False
        #: The instruction that a run starts with and that has already been stopped at; None for none.
        self.passes: int | None = None
        #: Whether accesses to watched bytes pass, for the step that makes one.
        self.ignores_accesses = False
        self._break_hooks: dict[int, int] = {}
        self._watch_hooks: dict[Watchpoint, int] = {}
        self._on_instruction = core.instruction_callback(self._at_breakpoint)
        self._on_step = core.instruction_callback(self._at_step)
        self._on_access = core.access_callback(self._at_access)
        self._step_from: int | None = None
        self._record_hooks: list[int] = []

    @property
    def has_hooks(self) -> bool:
        """Whether hooks are in place."""
        return bool(self._break_hooks) or bool(self._watch_hooks)

    @property
    def is_armed(self) -> bool:
        """Whether the hooks are those that are wanted."""
        return (
            self._break_hooks.keys() == self.breakpoints | self.own_breakpoints
            and self._watch_hooks.keys() == self.watchpoints | self.own_watchpoints
        )

    @property
    def has_points(self) -> bool:
        """Whether hooks are wanted."""
        return bool(self.breakpoints or self.watchpoints or self.own_breakpoints or self.own_watchpoints)

    def arm(self) -> None:
        """Put hooks where they are wanted and nowhere else, between runs."""
        core = self._core
        breakpoints, watchpoints = self.breakpoints | self.own_breakpoints, self.watchpoints | self.own_watchpoints
        for address in self._break_hooks.keys() - breakpoints:
            core.remove_hook(self._break_hooks.pop(address))
        for address in breakpoints - self._break_hooks.keys():
            self._break_hooks[address] = core.hook_instructions(self._on_instruction, address, address)
        for old in self._watch_hooks.keys() - watchpoints:
            core.remove_hook(self._watch_hooks.pop(old))
        for new in watchpoints - self._watch_hooks.keys():
            self._watch_hooks[new] = self._hook(new, self._on_access)
        core.drop_all_code()

    def record(self, points: Iterable[Watchpoint], add: Callable[[], None]) -> None:
        """Call before each access that one of the points waits for, instead of before those so far; between runs."""
        core, points = self._core, tuple(points)
        if not self._record_hooks and not points:
            return
        while self._record_hooks:
            core.remove_hook(self._record_hooks.pop())
        for point in points:

            def at_access(access: int, address: int, size: int, _value: int, point: Watchpoint = point) -> bool:
                if point.sees(address, size, is_read=access == READ_ACCESS):
                    add()
                return True

            self._record_hooks.append(self._hook(point, core.access_callback(at_access)))
        core.drop_all_code()

    def _hook(self, point: Watchpoint, callback: ctypes.c_void_p) -> int:
        # An access that begins up to three bytes before may reach into it.
        return self._core.hook_accesses(callback, max(0, point.address - 3), point.address + point.size - 1)

    def begin_step(self, pc: int) -> int:
        """Hook every instruction; return the hook for `end_step`."""
        self._step_from = pc
        hook = self._core.hook_instructions(self._on_step, *EVERYWHERE)
        self._core.drop_all_code()
        return hook

    def end_step(self, hook: int) -> None:
        """Take the hook of `begin_step` away."""
        self._core.remove_hook(hook)
        self._core.drop_all_code()

    def _at_breakpoint(self, address: int) -> None:
        if address == self.passes:
            self.passes = None
        elif address in self._break_hooks:
            self._stop_before(HaltKind.BREAKPOINT, address, None)

    def _at_step(self, address: int) -> None:
        if address != self._step_from:
            self._stop_before(HaltKind.STEP, address, None)
            return
        self._step_from = None  # the same instruction again is the next one

    def _at_access(self, access: int, address: int, size: int, _value: int) -> bool:
        is_read = access == READ_ACCESS
        if self.ignores_accesses:
            return True
        met = [point for point in self._watch_hooks if point.sees(address, size, is_read=is_read)]
        if met:
            self.met = tuple(point for point in met if point in self.own_watchpoints)
            self.is_debuggers = any(point in self.watchpoints for point in met)
            self._stop_before(HaltKind.WATCHPOINT, self._core.registers[Reg.PC], address)
        return True
