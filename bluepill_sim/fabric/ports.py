"""What a peripheral needs of the chip around it.

Peripherals never import each other: they meet at pins, at lines, at the
clocks, at the supply, and at nothing else. The chip (`chip.py`) implements this protocol;
the tests have a fake that passes the same contract test.
"""

from typing import Protocol

from bluepill_sim.fabric.clocks import Clocks
from bluepill_sim.fabric.fabric import FabricPorts
from bluepill_sim.fabric.pins import PinBank
from bluepill_sim.fabric.power import Power


class ChipPorts(FabricPorts, Protocol):
    """The chip, as one of its peripherals sees it."""

    @property
    def clocks(self) -> Clocks:
        """The one shared object of frequencies; RCC and FLASH write it."""

    @property
    def power(self) -> Power:
        """The one shared object of the supply; PWR writes it."""

    @property
    def pins(self) -> PinBank:
        """The one shared bank of pins; GPIO, AFIO and the alternate functions write it."""

    def clock_changed(self) -> None:
        """Notify that `clocks` has new values: re-base cycles, and call each peripheral's `clock_changed`."""

    def flash_began(self) -> None:
        """Have the core wait where it needs the flash, which is programmed or erased from now on."""

    def reset_peripheral(self, name: str) -> None:
        """Call `reset` of the peripheral `name`, if it is modelled (RCC's APBxRSTR)."""

    def reset_backup_domain(self) -> None:
        """Call `backup_reset` of every peripheral (BDRST of RCC_BDCR)."""

    def watchdog_expired(self, name: str) -> None:
        """Reset the chip at the boundary of the running block, because of the watchdog `name`: "IWDG" or "WWDG"."""
