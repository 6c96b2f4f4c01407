"""Stop and Standby, and the loss of the clock: what stands still, what ends it, and how long that takes.

Theory of operation. WFI, WFE or a return from a handler with SLEEPDEEP begins a mode, once the flash is done. In Stop
the core runs no more, HSI is what clocks are derived from afterwards, and devices that have a clock of the core's
stand still: on the way out they are told how long that was, and what they count from moves by it. An interrupt of EXTI
that may wake the core, or the event of a WFE, ends it. In Standby all but the backup domain, IWDG and PWR's flags is
lost; WKUP and the RTC's alarm end it with a reset, as others do.

    RUN -> ENTERING -> STOP or STANDBY -> WAKING -> RUN

Time passes by itself from deadline to deadline: a long mode costs nothing.

Chosen: a mode that may not begin (WUF for Standby, a pending line of EXTI or ALRF for Stop) is passed over and warned
of.
Not modelled: DBG_SLEEP, DBG_STOP and DBG_STANDBY of DBGMCU_CR.

Source: RM0008 section 5.3; wake-up times from the data sheet DS5319 table 20.
Invariant: in RUN nothing here decides anything.
"""

from enum import Enum
from typing import Protocol

from bluepill_sim.fabric.fabric import FabricPorts
from simbase.state import Stateful
from simbase.timing import Nanos

#: From the wake-up event to the next instruction: Stop by LPDS, Standby (typical).
STOP_WAKE_NS: tuple[Nanos, Nanos] = 3_600, 5_400
STANDBY_WAKE_NS: Nanos = 50_000


class PowerMode(Enum):
    """How the chip's clocks run."""

    RUN = "run"
    #: SLEEPDEEP is on its way; the flash may still be at work.
    ENTERING = "entering"
    STOP = "stop"
    STANDBY = "standby"
    #: Without a clock, until a reset.
    UNCLOCKED = "unclocked"
    #: Back to where the program runs.
    WAKING = "waking"


class LowPowerPorts(FabricPorts, Protocol):
    """What this needs of the chip."""

    @property
    def flash_is_busy(self) -> bool:
        """Whether the flash is programmed or erased."""

    @property
    def wants_standby(self) -> bool:
        """Whether SLEEPDEEP means Standby."""

    @property
    def stop_wake_ns(self) -> Nanos:
        """How long the end of Stop takes."""

    @property
    def resets_instead(self) -> bool:
        """Whether the option bytes make a reset of the mode that SLEEPDEEP means."""

    def refusal(self) -> str | None:
        """Return what forbids the mode that SLEEPDEEP means, in words; None for nothing."""

    def is_woken_from_stop(self) -> bool:
        """Whether an interrupt or event that ends Stop is there."""

    def enter_stop(self) -> None:
        """Have everything that Stop stops stand still."""

    def leave_stop(self, stopped_ns: Nanos) -> None:
        """Have it go on, after so long."""

    def reset_instead(self) -> None:
        """Reset the chip because of the option bytes."""

    def enter_standby(self) -> None:
        """Forget all that Standby forgets."""

    def leave_standby(self) -> None:
        """Reset the chip."""

    def pass_over(self, why: str) -> None:
        """Go on behind the instruction, and warn."""


class LowPower(Stateful):
    """The chip's low-power mode."""

    STATE = ("mode", "_since_ns", "wake_ns", "_is_standby")

    def __init__(self, chip: LowPowerPorts) -> None:
        self._chip = chip
        self.mode = PowerMode.RUN
        self._since_ns: Nanos = 0
        #: While WAKING: when the program goes on.
        self.wake_ns: Nanos | None = None
        self._is_standby = False

    def lose_clock(self) -> None:
        """Stop until a reset: what SYSCLK came from has failed."""
        self._is_standby = False
        self.mode = PowerMode.UNCLOCKED
        self._chip.enter_stop()

    def begin(self) -> None:
        """Take up a sleep with SLEEPDEEP."""
        self.mode = PowerMode.ENTERING

    def end(self) -> None:
        """Forget the mode: the chip is reset."""
        self.mode, self.wake_ns = PowerMode.RUN, None

    def wake(self) -> None:
        """Take a wake-up event of PWR."""
        if self.mode is PowerMode.STANDBY:
            self._wake_after(STANDBY_WAKE_NS)

    def holds(self) -> bool:
        """Follow the mode at a boundary; return whether the core stands still."""
        if self.mode is PowerMode.ENTERING and not self._chip.flash_is_busy:
            self._enter()
        if self.mode is PowerMode.STOP and self._chip.is_woken_from_stop():
            self._wake_after(self._chip.stop_wake_ns)
        if self.mode is PowerMode.WAKING and self.wake_ns is not None and self._chip.now_ns >= self.wake_ns:
            self.end()
            if self._is_standby:
                self._chip.leave_standby()
            else:
                self._chip.leave_stop(self._chip.now_ns - self._since_ns)
        return self.mode is not PowerMode.RUN

    def _enter(self) -> None:
        chip = self._chip
        self._is_standby, self._since_ns = chip.wants_standby, chip.now_ns
        refusal = chip.refusal()
        if refusal is not None:
            self.end()
            chip.pass_over(refusal)
        elif chip.resets_instead:
            self.end()
            chip.reset_instead()
        elif self._is_standby:
            self.mode = PowerMode.STANDBY
            chip.enter_standby()
        else:
            self.mode = PowerMode.STOP
            chip.enter_stop()

    def _wake_after(self, span_ns: Nanos) -> None:
        self.mode, self.wake_ns = PowerMode.WAKING, self._chip.now_ns + span_ns
