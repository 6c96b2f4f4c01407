"""The clocks of the chip as every part sees them: frequencies, and the flash wait states set for them.

This holds them only. RCC decides the frequencies and FLASH the wait
states (each calls `ChipPorts.clock_changed`); USARTs, timers and the CPU read
them. Sources: RM0008 sections 3.3.3 and 7.2, data sheet DS5319 table 9.
Invariant: every frequency is a whole number of hertz, and `hclk_hz` > 0.
"""

from dataclasses import dataclass

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


@dataclass(slots=True)
class Clocks(Stateful):
    """The clock tree's outputs, kept up to date by RCC and FLASH."""

    sysclk_hz: int = HSI_HZ
    hclk_hz: int = HSI_HZ
    pclk1_hz: int = HSI_HZ
    pclk2_hz: int = HSI_HZ
    #: Clock of TIM2-7 and TIM1/8: PCLKx, doubled when its prescaler is not 1.
    timer1_hz: int = HSI_HZ
    timer2_hz: int = HSI_HZ
    #: The clock of USB: that of the PLL, or two thirds of it; 0 while the PLL is off.
    usb_hz: int = 0
    #: What PCLK2 is divided by for the ADCs.
    adc_divider: int = 2
    #: The independent watchdog's clock: LSI, whether or not it runs for others.
    lsi_hz: int = LSI_HZ
    #: RTCCLK; 0: it stands still.
    rtcclk_hz: int = 0
    #: BKP_RTCCR CAL: so many of 2**20 cycles of RTCCLK do not count.
    rtc_calibration: int = 0
    #: Whether BKP puts the pulse of each second on PC13, so that RTC has to make it.
    rtc_seconds_shown: bool = False
    #: FLASH_ACR LATENCY, 0 to 2 wait states.
    flash_wait_states: int = 0
    #: FLASH_ACR PRFTBE.
    flash_prefetch: bool = True


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
