"""The clocks of the chip as every part sees them: frequencies, and the flash wait states set for them.

This holds them only. RCC decides the frequencies and FLASH the wait
states (each calls `ChipPorts.clock_changed`); USARTs, timers and the CPU read
them. Sources: RM0008 sections 3.3.3 and 7.2, data sheet DS5319 table 9.
Invariant: every frequency is a whole number of hertz, and `hclk_hz` > 0.
"""

from typing import Any

from bluepill_sim.extension.layout import CLOCKS, structure
from bluepill_sim.extension.windows import field, flag
from simbase.state import Stateful

#: Highest SYSCLK/HCLK/PCLK2, in Hz (DS5319 table 9).
MAX_SYSCLK_HZ = 72_000_000
#: Highest PCLK1, in Hz (DS5319 table 9).
MAX_PCLK1_HZ = 36_000_000
#: HSI after reset, in Hz (RM0008 7.2.2).
HSI_HZ = 8_000_000
#: The crystal of a BluePill on OSC_IN and OSC_OUT, as its can says.
CRYSTAL_HZ = 8_000_000
#: chosen: a crystal is off by a thousandth at most; the data sheet's limits are for what its can says.
CRYSTAL_TOLERANCE = 1000
#: The crystal on PC14 and PC15.
LSE_HZ = 32_768
#: LSI, typical, and its range, in Hz (DS5319 table 25).
LSI_HZ, LEAST_LSI_HZ, MOST_LSI_HZ = 40_000, 30_000, 60_000
#: Highest SYSCLK for 0, 1, 2 wait states, in Hz (RM0008 3.3.3, FLASH_ACR).
MAX_SYSCLK_BY_WAIT_STATES = (24_000_000, 48_000_000, 72_000_000)
_ClocksStruct = structure(CLOCKS)


class Clocks(Stateful):
    """The clock tree's outputs, kept up to date by RCC and FLASH; C sees the same struct."""

    STATE = (
        "sysclk_hz", "hclk_hz", "pclk1_hz", "pclk2_hz", "timer1_hz", "timer2_hz", "usb_hz", "adc_divider", "lsi_hz",
        "rtcclk_hz", "rtc_calibration", "rtc_seconds_shown", "flash_wait_states", "flash_prefetch",
    )  # fmt: skip

    sysclk_hz: int = field("sysclk_hz", "SYSCLK.")
    hclk_hz: int = field("hclk_hz", "HCLK, the clock of the core.")
    pclk1_hz: int = field("pclk1_hz", "PCLK1.")
    pclk2_hz: int = field("pclk2_hz", "PCLK2.")
    timer1_hz: int = field("timer1_hz", "Clock of TIM2-7: PCLK1, doubled when its prescaler is not 1.")
    timer2_hz: int = field("timer2_hz", "The same of TIM1/8 and PCLK2.")
    usb_hz: int = field("usb_hz", "The clock of USB: that of the PLL, or two thirds of it; 0 while the PLL is off.")
    adc_divider: int = field("adc_divider", "What PCLK2 is divided by for the ADCs.")
    lsi_hz: int = field("lsi_hz", "The independent watchdog's clock: LSI, whether or not it runs for others.")
    rtcclk_hz: int = field("rtcclk_hz", "RTCCLK; 0: it stands still.")
    rtc_calibration: int = field("rtc_calibration", "BKP_RTCCR CAL: so many of 2**20 cycles of RTCCLK do not count.")
    rtc_seconds_shown: bool = flag("rtc_seconds_shown", "Whether BKP puts the pulse of each second on PC13.")
    flash_wait_states: int = field("flash_wait_states", "FLASH_ACR LATENCY, 0 to 2 wait states.")
    flash_prefetch: bool = flag("flash_prefetch", "FLASH_ACR PRFTBE.")

    def __init__(self, **changed: int) -> None:
        """Take the clocks as they are after a reset, but for what is given by name."""
        rates = dict.fromkeys(("sysclk_hz", "hclk_hz", "pclk1_hz", "pclk2_hz", "timer1_hz", "timer2_hz"), HSI_HZ)
        #: `struct clocks`, which stays the same for ever.
        self.shared: Any = _ClocksStruct(adc_divider=2, lsi_hz=LSI_HZ, flash_prefetch=1, **rates)
        for name, value in changed.items():
            setattr(self.shared, name, value)

    def __eq__(self, other: object) -> bool:
        """Tell whether all of them are the same."""
        return isinstance(other, Clocks) and bytes(self.shared) == bytes(other.shared)

    __hash__ = None  # type: ignore[assignment]  # they change


def illegal_settings(clocks: Clocks) -> list[tuple[str, str]]:
    """Return what the data sheet forbids in the present setting, as (key, sentence) pairs."""
    found = []
    if _is_above(clocks.sysclk_hz, MAX_SYSCLK_HZ):
        found.append(("clock:sysclk", f"SYSCLK is {clocks.sysclk_hz} Hz, above {MAX_SYSCLK_HZ} Hz"))
    if _is_above(clocks.pclk1_hz, MAX_PCLK1_HZ):
        found.append(("clock:pclk1", f"PCLK1 is {clocks.pclk1_hz} Hz, above {MAX_PCLK1_HZ} Hz"))
    highest = MAX_SYSCLK_BY_WAIT_STATES[min(clocks.flash_wait_states, 2)]
    if _is_above(clocks.sysclk_hz, highest) and not _is_above(clocks.sysclk_hz, MAX_SYSCLK_HZ):
        states = clocks.flash_wait_states
        what = f"FLASH_ACR LATENCY is {states} at a SYSCLK of {clocks.sysclk_hz} Hz: good up to {highest} Hz"
        found.append(("clock:latency", what))
    if not clocks.flash_prefetch and clocks.hclk_hz != clocks.sysclk_hz:
        found.append(("clock:prefetch", "FLASH_ACR PRFTBE is off while the AHB prescaler is not 1"))
    return found


def _is_above(hz: int, limit_hz: int) -> bool:
    return hz > limit_hz + limit_hz // CRYSTAL_TOLERANCE
