"""RCC: what has to be ready, off or open before something else is taken."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, HAL, LOCM3, ours, rm

RCC = Sequences("RCC")
HSE_NS, PLL_NS, LSI_NS, LSE_NS = 2_000_000, 200_000, 85_000, 1_500_000_000


def start_hse(chip: Bench) -> None:
    chip["RCC.CR.HSEON"] = 1
    chip.run(HSE_NS)


def run_by_pll_of_hse(chip: Bench) -> None:
    start_hse(chip)
    chip["RCC.CFGR.PLLSRC"] = 1
    chip["RCC.CR.PLLON"] = 1
    chip.run(PLL_NS)
    chip["RCC.CFGR.SW"] = 2


def open_backup(chip: Bench) -> None:
    chip.clock("PWR", "BKP")
    chip["PWR.CR.DBP"] = 1


@RCC.row(
    "switch-waits",
    "SYSCLK goes to a source only once that is ready; chosen earlier, the switch comes when it is.",
    HAL("rcc", 803),
    rm("7.2.6"),
)
def _(chip: Bench) -> None:
    chip["RCC.CR.HSEON"] = 1
    chip["RCC.CFGR.SW"] = 1
    chip.run(HSE_NS - 1)
    assert chip["RCC.CFGR.SWS"] == 0
    chip.run(1)
    assert chip["RCC.CFGR.SWS"] == 1


@RCC.row(
    "hsi-at-start",
    "After a reset HSI is on, ready and SYSCLK, and all dividers are 1.",
    HAL("rcc", 798),
    rm("7.3.1"),
)
def _(chip: Bench) -> None:
    assert (chip["RCC.CR"] & 3, chip["RCC.CFGR"]) == (3, 0)
    assert chip.clocks.sysclk_hz == chip.clocks.pclk1_hz == chip.clocks.pclk2_hz == 8_000_000


@RCC.row(
    "pll-fixed",
    "Source, divider and factor of the PLL are written only while it is off.",
    HAL("rcc", 713),
    LOCM3("f1/rcc", 487),
    rm("7.3.2"),
    values=st.integers(0, 15),
)
def _(chip: Bench, factor: int) -> None:
    chip["RCC.CFGR.PLLMUL"] = 2
    chip["RCC.CR.PLLON"] = 1
    chip["RCC.CFGR"] = factor << 18 | 3 << 16
    assert chip["RCC.CFGR"] == 2 << 18
    chip["RCC.CR.PLLON"] = 0
    chip["RCC.CFGR"] = factor << 18 | 3 << 16
    assert chip["RCC.CFGR"] == factor << 18 | 3 << 16


@RCC.row(
    "pll-locks-after-source",
    "The PLL gets ready only after the oscillator that feeds it.",
    CHIBIOS("STM32F1xx/hal_lld", 194),
    rm("7.2.3"),
)
def _(chip: Bench) -> None:
    chip["RCC.CFGR.PLLSRC"] = 1
    chip["RCC.CR.PLLON"] = 1
    chip.run(PLL_NS)
    assert not chip["RCC.CR.PLLRDY"]
    start_hse(chip)
    chip.run(PLL_NS - 1)
    assert not chip["RCC.CR.PLLRDY"]
    chip.run(1)
    assert chip["RCC.CR.PLLRDY"]


@RCC.row(
    "pll-off-waits",
    "PLLRDY is 0 again once PLLON has been cleared; drivers wait for it before they set the PLL anew.",
    HAL("rcc", 703),
)
def _(chip: Bench) -> None:
    chip["RCC.CR.PLLON"] = 1
    chip.run(PLL_NS)
    assert chip["RCC.CR.PLLRDY"]
    chip["RCC.CR.PLLON"] = 0
    assert not chip["RCC.CR.PLLRDY"]


@RCC.row(
    "in-use-stays-on",
    "The oscillator that is SYSCLK is not switched off.",
    HAL("rcc", 369),
    rm("7.3.1"),
    choice="the write is ignored and warned of",
)
def _(chip: Bench) -> None:
    chip["RCC.CR.HSION"] = 0
    assert chip["RCC.CR"] & 3 == 3
    start_hse(chip)
    chip["RCC.CFGR.SW"] = 1
    chip["RCC.CR.HSEON"] = 0
    assert chip["RCC.CR.HSERDY"]
    chip["RCC.CR.HSION"] = 0
    assert chip["RCC.CR"] & 3 == 0


@RCC.row(
    "pll-source-in-use",
    "HSE, and the PLL that it feeds, stay on while the PLL is SYSCLK.",
    HAL("rcc", 335),
    rm("7.3.1"),
)
def _(chip: Bench) -> None:
    run_by_pll_of_hse(chip)
    assert chip["RCC.CFGR.SWS"] == 2
    for name in ("HSEON", "PLLON"):
        chip[f"RCC.CR.{name}"] = 0
        assert chip[f"RCC.CR.{name}"]
    chip["RCC.CR.HSION"] = 0
    assert not chip["RCC.CR.HSION"]


@RCC.row(
    "bypass-while-off",
    "HSEBYP changes only while HSE is off: off first, then on or bypassed.",
    HAL("rcc", 341),
    LOCM3("common/rcc_common_all", 201),
    rm("7.3.1"),
    choice="ST and libopencm3 both want HSE off; a write while it is on leaves HSEBYP",
)
def _(chip: Bench) -> None:
    chip["RCC.CR.HSEON"] = 1
    chip["RCC.CR.HSEBYP"] = 1
    assert not chip["RCC.CR.HSEBYP"]
    chip["RCC.CR.HSEON"] = 0
    chip["RCC.CR.HSEBYP"] = 1
    chip["RCC.CR.HSEON"] = 1
    assert chip["RCC.CR.HSEBYP"]


@RCC.row(
    "rtcsel-once",
    "RTCSEL takes a first choice; another needs BDRST before.",
    HAL("rcc_ex", 148),
    CHIBIOS("STM32F1xx/hal_lld", 60),
    rm("7.3.9"),
    values=st.integers(1, 3),
)
def _(chip: Bench, first: int) -> None:
    open_backup(chip)
    chip["RCC.BDCR.RTCSEL"] = first
    chip["RCC.BDCR.RTCSEL"] = first % 3 + 1
    assert chip["RCC.BDCR.RTCSEL"] == first
    chip["RCC.BDCR"] = 1 << 16
    chip["RCC.BDCR"] = 0
    chip["RCC.BDCR.RTCSEL"] = first % 3 + 1
    assert chip["RCC.BDCR.RTCSEL"] == first % 3 + 1


@RCC.row(
    "bdrst-clears-backup",
    "A reset of the backup domain takes RTC and backup registers with it.",
    HAL("rcc_ex", 88),
    rm("6.1"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["BKP.DR3"] = 0x1234
    chip["RCC.BDCR.RTCSEL"] = 2
    chip["RCC.BDCR.BDRST"] = 1
    chip["RCC.BDCR"] = 0
    assert (chip["BKP.DR3"], chip["RCC.BDCR"]) == (0, 0)


@RCC.row(
    "bdcr-needs-dbp",
    "BDCR takes a write only after PWR has its clock and DBP is set.",
    HAL("rcc", 529),
    rm("7.3.9"),
)
def _(chip: Bench) -> None:
    chip["RCC.BDCR"] = 1
    assert chip["RCC.BDCR"] == 0
    chip["PWR.CR.DBP"] = 1
    chip["RCC.BDCR"] = 1
    assert chip["RCC.BDCR"] == 0
    open_backup(chip)
    chip["RCC.BDCR"] = 1
    assert chip["RCC.BDCR"] == 1


@RCC.row(
    "lse-ready-late",
    "LSERDY follows LSEON by more than a second, and no reset of the system stops LSE.",
    CHIBIOS("STM32F1xx/hal_lld", 77),
    rm("7.2.4"),
    choice="1.5 s, the data sheet's typical value",
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["RCC.BDCR.LSEON"] = 1
    chip.run(LSE_NS - 1)
    assert not chip["RCC.BDCR.LSERDY"]
    chip.parts.reset(ResetCause.SOFTWARE)
    chip.run(1)
    assert chip["RCC.BDCR"] == 3


@RCC.row(
    "lse-takes-its-pins",
    "PC14 and PC15 are GPIO's until LSEON is set, and again once it is cleared.",
    rm("9.3.1"),
    ours("RCC"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    for level in (0, 1, 0):
        chip["RCC.BDCR.LSEON"] = level
        for mco in (4, 0):
            chip["RCC.CFGR.MCO"] = mco
            assert {chip.pins[pin].holder is not None for pin in ("PC14", "PC15")} == {bool(level)}


@RCC.row(
    "lsi-ready-later",
    "LSIRDY follows LSION after a start-up time, and is 0 at once when LSION goes.",
    CHIBIOS("STM32F1xx/hal_lld", 201),
    rm("7.2.5"),
)
def _(chip: Bench) -> None:
    chip["RCC.CSR.LSION"] = 1
    chip.run(LSI_NS - 1)
    assert not chip["RCC.CSR.LSIRDY"]
    chip.run(1)
    assert chip["RCC.CSR.LSIRDY"]
    chip["RCC.CSR.LSION"] = 0
    assert not chip["RCC.CSR.LSIRDY"]


@RCC.row(
    "ready-interrupt",
    "A ready flag of CIR stays until its clear bit is written, and interrupts only with its enable.",
    rm("7.3.3"),
    LOCM3("f1/rcc", 193),
)
def _(chip: Bench) -> None:
    start_hse(chip)
    assert (chip["RCC.CIR.HSERDYF"], chip.irqs[5]) == (1, False)
    chip["RCC.CIR.HSERDYIE"] = 1
    assert chip.irqs[5]
    chip["RCC.CIR.HSERDYF"] = 0
    assert chip.irqs[5]
    chip["RCC.CIR"] = 1 << 11 | 1 << 19
    assert (chip["RCC.CIR"], chip.irqs[5]) == (1 << 11, False)


@RCC.row(
    "css-falls-to-hsi",
    "With CSSON a failure of HSE under SYSCLK takes the chip to HSI, HSE and its PLL off.",
    HAL("rcc", 799),
    rm("7.2.7"),
)
def _(chip: Bench) -> None:
    run_by_pll_of_hse(chip)
    chip["RCC.CR.HSION"] = 0
    chip["RCC.CR.CSSON"] = 1
    chip.parts.rcc.fail_crystal()
    assert (chip["RCC.CFGR.SWS"], chip["RCC.CR"] & 3) == (0, 3)
    assert (chip["RCC.CR.HSEON"], chip["RCC.CR.PLLON"], chip["RCC.CIR.CSSF"]) == (0, 0, 1)


@RCC.row(
    "css-nmi-until-cleared",
    "The NMI of CSS comes until CSSC has been written: its handler must do that.",
    HAL("rcc", 1353),
    rm("7.2.7"),
)
def _(chip: Bench) -> None:
    start_hse(chip)
    chip["RCC.CR.CSSON"] = 1
    chip.parts.rcc.fail_crystal()
    chip.run(5_000)
    assert chip.signals.count("nmi") > 2
    chip["RCC.CIR"] = 1 << 23
    before = chip.signals.count("nmi")
    chip.run(50_000)
    assert (chip["RCC.CIR.CSSF"], chip.signals.count("nmi")) == (0, before)


@RCC.row(
    "clock-first",
    "A peripheral reads 0 and takes nothing until its clock is on; what it holds outlives its gate.",
    rm("7.3.7"),
    ours("Peripherals of the emulated STM32F103C8"),
    values=st.integers(1, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip["TIM2.ARR"] = word
    assert chip["TIM2.ARR"] == 0
    chip.clock("TIM2")
    assert chip["TIM2.ARR"] == 0xFFFF
    chip["TIM2.ARR"] = word
    chip["RCC.APB1ENR"] = 0
    assert chip["TIM2.ARR"] == 0
    chip.clock("TIM2")
    assert chip["TIM2.ARR"] == word


@RCC.row(
    "reset-bit",
    "A peripheral is at its reset values after its bit of APBxRSTR has been 1.",
    LOCM3("common/rcc_common_all", 75),
    rm("7.3.4"),
)
def _(chip: Bench) -> None:
    chip.clock("SPI1", "USART1")
    chip["SPI1.CR2"] = 0x40
    chip["USART1.BRR"] = 69
    chip["RCC.APB2RSTR.SPI1"] = 1
    chip["RCC.APB2RSTR.SPI1"] = 0
    assert (chip["SPI1.CR2"], chip["USART1.BRR"]) == (0, 69)


@RCC.row(
    "reset-flags-stay",
    "The flags of a reset's cause gather in CSR until RMVF is written.",
    rm("7.3.10"),
    ours("RCC"),
)
def _(chip: Bench) -> None:
    chip.parts.reset(ResetCause.SOFTWARE)
    chip.parts.reset(ResetCause.IWDG)
    assert chip["RCC.CSR"] >> 26 == 0b001111
    chip["RCC.CSR.RMVF"] = 1
    assert chip["RCC.CSR"] >> 26 == 0


@RCC.row(
    "flag-by-cause",
    "Each cause of a reset has its flag in CSR, beside that of the pin, which every reset pulls.",
    HAL("wwdg", 42),
    HAL("iwdg", 44),
    rm("7.3.10"),
    values=st.sampled_from(
        [(ResetCause.LOW_POWER, 31), (ResetCause.WWDG, 30), (ResetCause.IWDG, 29), (ResetCause.SOFTWARE, 28)]
    ),
)
def _(chip: Bench, case: tuple[ResetCause, int]) -> None:
    cause, bit = case
    chip["RCC.CSR.RMVF"] = 1
    chip.parts.reset(cause)
    assert chip["RCC.CSR"] >> 26 << 26 == 1 << bit | 1 << 26


@RCC.row(
    "mco-needs-af",
    "MCO shows on PA8 only where that is an alternate-function output.",
    HAL("rcc", 971),
    rm("7.2.10"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA")
    chip["RCC.CFGR.MCO"] = 5
    chip["GPIOA.CRH.MODE8"] = 3
    assert chip.pins["PA8"].wave is None
    chip["GPIOA.CRH.CNF8"] = 2
    assert chip.pins["PA8"].wave is not None
