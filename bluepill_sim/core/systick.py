"""SysTick: the 24-bit down counter of the core, as `extension/source/core/systick.c` has it.

Source: ARMv7-M Architecture Reference Manual B3.3.
Invariant: all state is in the struct that C shares.
"""

import ctypes
from collections.abc import Callable
from typing import Any

from bluepill_sim.extension.library import library
from bluepill_sim.extension.windows import field, flag, packed, time
from simbase.state import Stateful

ENABLE, TICKINT, CLKSOURCE, COUNTFLAG = 1, 2, 4, 1 << 16

#: Takes (cycle at which the program has set it, of the next exception or None, cycles between two or 0).
ScheduleListener = Callable[[int, int | None, int], None]


class SysTick(Stateful):
    """The system timer; `now` is always a time in core cycles."""

    STATE = ("control", "_count_flag", "_counter", "next_cycle")
    #: Who listens.
    DERIVED = ("_listeners",)

    control: int = field("tick_control", "Bits 2 to 0 of STCSR.")
    _count_flag = flag("tick_count_flag", "COUNTFLAG.")
    _counter = packed("tick", "Counter and reload value.")
    next_cycle: int | None = time("tick_next", "When the counter next comes to 0; None while it stands still.")

    def __init__(self, pend: Callable[[], None], shared: Any) -> None:
        """Make the timer.

        Args:
            pend: makes the SysTick exception pending.
            shared: the struct that holds the state.
        """
        self._pend = pend
        self.shared = shared
        self._at = ctypes.addressof(shared)
        self._listeners: list[ScheduleListener] = []

    def listen(self, listener: ScheduleListener) -> None:
        """Call when the program sets it."""
        self._listeners.append(listener)
        self.shared.hears_ticks = True

    def unlisten(self, listener: ScheduleListener) -> None:
        """Call no more."""
        self._listeners.remove(listener)
        self.shared.hears_ticks = bool(self._listeners)

    def advance_to(self, now: int) -> None:
        """Act on every wrap up to and including `now`."""
        if library().systick_advance(self._at, now):
            self._pend()

    def was_set(self) -> None:
        """Tell the listeners what the program has set."""
        tick = self.shared.tick
        following = self.next_cycle if self.shared.tick_control & TICKINT else None
        for listener in self._listeners:
            listener(tick.base, following, (tick.top + 1) * tick.divider if tick.top else 0)
