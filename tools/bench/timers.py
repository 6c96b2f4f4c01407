"""Has every timer of a chip run, for tables that are to hold with all of them at work (`--timers`)."""

from bluepill_sim import BluePill

#: Bits of the clocks of TIM1, and of TIM2 to TIM4.
RCC_APB2ENR, RCC_APB1ENR = 0x18, 0x1C
TIM1_ENABLE, OTHERS_ENABLE = 1 << 11, 0b111
TIMER_HZ, PERIOD = 72_000_000, 3600
#: PSC, ARR, CCMR1 and CCMR2 (PWM 1 with preload), CCR1 to CCR4, EGR, CR1, by offset: 20 kHz at 72 MHz, a quarter
#: of it high; no interrupt, and no pin is given over. Channel 2 of TIM1 stays off: its pin is USART1's TX.
SETTINGS = (
    (0x28, 0), (0x2C, PERIOD - 1), (0x18, 0x6868), (0x1C, 0x6868), (0x34, 900), (0x38, 900), (0x3C, 900), (0x40, 900),
    (0x14, 1), (0x00, 0x81),
)  # fmt: skip
CCER, ALL_ON, WITHOUT_SECOND, BDTR, MOE = 0x20, 0x1111, 0x1101, 0x44, 0x8000


def start_timer(board: BluePill, name: str, channels: int = ALL_ON) -> None:
    """Have one of them make PWM on some channels; its clock is on."""
    for offset, word in (*(((BDTR, MOE),) if name == "TIM1" else ()), (CCER, channels), *SETTINGS):
        board.chip.parts.by_name[name].write(offset, 4, word)


def start_timers(board: BluePill) -> None:
    """Have TIM1 to TIM4 make PWM on all their channels, but for those that the program has started.

    Raises:
        RuntimeError: One of them does not count.
    """
    rcc, parts = board.chip.parts.rcc, board.chip.parts.by_name
    rcc.write(RCC_APB2ENR, 4, rcc.read(RCC_APB2ENR, 4) | TIM1_ENABLE)
    rcc.write(RCC_APB1ENR, 4, rcc.read(RCC_APB1ENR, 4) | OTHERS_ENABLE)
    for name in ("TIM1", "TIM2", "TIM3", "TIM4"):
        if not parts[name].native.ramp.runs:
            start_timer(board, name, WITHOUT_SECOND if name == "TIM1" else ALL_ON)
        if not parts[name].native.ramp.runs:
            raise RuntimeError(f"{name} does not count")
