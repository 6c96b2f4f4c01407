"""SysTick: the 24-bit down counter of the core.

The value is worked out from the clock when it is read; the counter itself
costs nothing between two wraps. The reference clock is HCLK / 8, as an
STM32F103 wires it (RM0008 7.2, clock tree).

Source: ARMv7-M Architecture Reference Manual B3.3.
Invariant: the value follows from the (value, cycle) pair of the last change alone.
"""

from collections.abc import Callable

from simbase.state import Stateful

ENABLE, TICKINT, CLKSOURCE, COUNTFLAG = 1, 2, 4, 1 << 16
#: STCALIB of an STM32F103: 9000 ticks of HCLK / 8 at 72 MHz are 1 ms (PM0056 4.5.4).
CALIBRATION = 0x4000_0000 | 9000
#: Width of counter and reload value.
_MASK = 0xFF_FFFF
_CONTROL_BITS = ENABLE | TICKINT | CLKSOURCE
#: Core cycles a tick of the reference clock.
_REFERENCE_DIVIDER = 8


class SysTick(Stateful):
    """The system timer; `now` is always a time in core cycles."""

    STATE = ("_control", "_reload", "_count_flag", "_value", "_base", "next_cycle")

    def __init__(self, pend: Callable[[], None]) -> None:
        """Make the timer.

        Args:
            pend: makes the SysTick exception pending.
        """
        self._pend = pend
        #: Called when the program sets it, with (cycle of that, of the next exception or None, cycles between two).
        self.schedule_listeners: list[Callable[[int, int | None, int], None]] = []
        self._control = 0
        self._reload = 0
        self._count_flag = False
        #: The value at cycle `_base`.
        self._value = 0
        self._base = 0
        #: When the counter next comes to 0; None while it stands still.
        self.next_cycle: int | None = None

    def reset(self) -> None:
        """Go back to the state after a reset."""
        self._control = self._reload = self._value = self._base = 0
        self._count_flag = False
        self.next_cycle = None

    def advance_to(self, now: int) -> None:
        """Act on every wrap up to and including `now`."""
        due = self.next_cycle
        if due is None or now < due:
            return
        self._count_flag = True
        if self._control & TICKINT:
            self._pend()
        period = (self._reload + 1) * self._divider()
        if not self._reload:
            # A reload value of 0 stops the counter at its next wrap.
            self._value, self._base, self.next_cycle = 0, due, None
            return
        wraps = (now - due) // period
        self._value, self._base = 0, due + wraps * period
        self.next_cycle = self._base + period

    def read_control(self, now: int) -> int:
        """Return STCSR; reading it clears COUNTFLAG."""
        self.advance_to(now)
        value = self._control | (COUNTFLAG if self._count_flag else 0)
        self._count_flag = False
        return value

    def write_control(self, value: int, now: int) -> None:
        """Write STCSR."""
        self.advance_to(now)
        self._rebase(now)
        self._control = value & _CONTROL_BITS
        self._schedule()

    def read_reload(self) -> int:
        """Return STRVR."""
        return self._reload

    def write_reload(self, value: int, now: int) -> None:
        """Write STRVR; the running count goes on to 0 first."""
        self.advance_to(now)
        self._rebase(now)
        self._reload = value & _MASK
        self._schedule()

    def read_value(self, now: int) -> int:
        """Return STCVR."""
        self.advance_to(now)
        return self._value_at(now)

    def write_value(self, now: int) -> None:
        """Write STCVR: any value clears counter and COUNTFLAG, and causes no exception."""
        self.advance_to(now)
        self._value, self._base = 0, now
        self._count_flag = False
        self._schedule()

    def _divider(self) -> int:
        return 1 if self._control & CLKSOURCE else _REFERENCE_DIVIDER

    def _value_at(self, now: int) -> int:
        """Return the counter; `now` is before the next wrap."""
        if not self._control & ENABLE:
            return self._value
        ticks = (now - self._base) // self._divider()
        if not ticks:
            return self._value
        # From 0 the next tick loads the reload value.
        return self._value - ticks if self._value else max(0, self._reload + 1 - ticks)

    def _rebase(self, now: int) -> None:
        value = self._value_at(now)
        if self._control & ENABLE:
            # Keep the phase of the reference clock.
            now -= (now - self._base) % self._divider()
        self._value, self._base = value, now

    def _schedule(self) -> None:
        """Work out the next wrap from (value, base)."""
        if not self._control & ENABLE or not (self._value or self._reload):
            self.next_cycle = None
        else:
            ticks = self._value or self._reload + 1
            self.next_cycle = self._base + ticks * self._divider()
        following = self.next_cycle if self._control & TICKINT else None
        for listener in self.schedule_listeners:
            listener(self._base, following, (self._reload + 1) * self._divider() if self._reload else 0)
