"""The supply of the chip as every part sees it, and what the option bytes make of its low-power modes and watchdog.

This holds it only. The bench sets the voltage, PWR the lock of the backup domain, FLASH what its option byte USER says.

Source: RM0008 section 5; PM0075 section 2.2; data sheet DS5319 section 5.3.1.
Invariant: the voltage is one that the chip works at.
"""

from dataclasses import dataclass

from simbase.state import Stateful

#: The supply on a BluePill, and the range that the chip works in, in mV (DS5319 table 9).
SUPPLY_MV, LEAST_SUPPLY_MV, MOST_SUPPLY_MV = 3_300, 2_000, 3_600


@dataclass(slots=True)
class Power(Stateful):
    """The supply."""

    #: VDD in mV.
    supply_mv: int = SUPPLY_MV
    #: PWR_CR DBP: RTC, BKP and RCC_BDCR take writes.
    is_backup_open: bool = False
    #: Whether the clocks of the core stand still: Stop or Standby.
    is_stopped: bool = False
    #: Whether IWDG starts with the chip.
    starts_watchdog: bool = False
    #: Whether the entry of a low-power mode resets the chip.
    resets_at_stop: bool = False
    resets_at_standby: bool = False
