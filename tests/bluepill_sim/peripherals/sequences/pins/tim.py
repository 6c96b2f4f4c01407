"""TIM: shadow registers and their update event, counting, flags, and what an output waits for."""

from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.sequences.bench import CYCLE_NS, Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, HAL, HAL_EX, LOCM3, RIOT, RUST, ours, rm

TIM = Sequences("TIM")
CEN, UDIS, URS, OPM, DIR, ARPE = 1, 2, 4, 8, 16, 128
UIF, CC1IF, CC1OF = 1, 2, 0x200
PWM1, PRELOAD = 6 << 4, 8


def set_up(chip: Bench, name: str = "TIM3", **registers: int) -> None:
    """Clock a timer and write registers in the order given."""
    chip.clock(name)
    for register, value in registers.items():
        chip[f"{name}.{register}"] = value


def ticks(chip: Bench, count: int) -> None:
    chip.run(count * CYCLE_NS)


def flags(chip: Bench, name: str = "TIM3") -> int:
    """Return SR without what a read of it causes."""
    return int(chip.parts.by_name[name].look(0x10))


@TIM.row(
    "psc-by-update",
    "PSC counts from the next update event on: drivers make one by UG before they start.",
    HAL("tim", 6813),
    LOCM3("common/timer_common_all", 1624),
    rm("15.4.11"),
    values=st.integers(1, 50),
)
def _(chip: Bench, prescaler: int) -> None:
    set_up(chip, ARR=9, PSC=prescaler, CR1=CEN)
    ticks(chip, 11)
    assert flags(chip) & UIF
    set_up(chip, CR1=0, EGR=1, SR=0)
    chip["TIM3.CR1"] = CEN
    ticks(chip, 10 * (prescaler + 1))
    assert not flags(chip) & UIF
    ticks(chip, prescaler + 2)
    assert flags(chip) & UIF


@TIM.row(
    "ug-sets-uif",
    "UG raises UIF, so that a driver clears it before it lets the interrupt come.",
    HAL("tim", 6817),
    CHIBIOS("LLD/TIMv1/hal_gpt_lld", 1143),
    rm("15.4.5"),
)
def _(chip: Bench) -> None:
    set_up(chip, EGR=1)
    assert flags(chip) & UIF
    chip["TIM3.DIER"] = 1
    assert chip.irqs[29]
    chip["TIM3.SR"] = 0
    assert not chip.irqs[29]


@TIM.row(
    "urs-only-overflow",
    "With URS only an overflow raises UIF: UG loads and resets without it.",
    LOCM3("common/timer_common_all", 388),
    CHIBIOS("LLD/TIMv1/hal_gpt_lld", 1149),
    rm("15.4.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, CR1=URS, ARR=9, CNT=5, EGR=1)
    assert (flags(chip) & UIF, chip["TIM3.CNT"]) == (0, 0)
    chip["TIM3.CR1"] = URS | CEN
    ticks(chip, 11)
    assert flags(chip) & UIF


@TIM.row(
    "udis-keeps-shadows",
    "With UDIS no update event comes and the shadow registers keep their values; UG still resets the counter.",
    LOCM3("common/timer_common_all", 413),
    rm("15.4.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=9, PSC=3, CR1=UDIS, CNT=5, EGR=1)
    assert (flags(chip) & UIF, chip["TIM3.CNT"]) == (0, 0)
    chip["TIM3.CR1"] = UDIS | CEN
    ticks(chip, 6)
    assert chip["TIM3.CNT"] == 5
    ticks(chip, 100)
    assert not flags(chip) & UIF


@TIM.row(
    "arr-preload",
    "With ARPE a new ARR counts from the next update event, without it at once.",
    LOCM3("common/timer_common_all", 273),
    LOCM3("common/timer_common_all", 288),
    rm("15.3.2"),
    values=st.integers(0, 1),
)
def _(chip: Bench, is_preloaded: int) -> None:
    set_up(chip, ARR=9, EGR=1, SR=0, CR1=CEN | is_preloaded * ARPE)
    ticks(chip, 4)
    chip["TIM3.ARR"] = 19
    ticks(chip, 7)
    assert flags(chip) & UIF == is_preloaded
    ticks(chip, 9)
    chip["TIM3.SR"] = 0
    ticks(chip, 1 + 10 * is_preloaded)
    assert flags(chip) & UIF


@TIM.row(
    "ccr-preload",
    "With OCxPE a new CCR counts from the next update event, so that no pulse is cut.",
    CHIBIOS("LLD/TIMv1/hal_pwm_lld", 844),
    CHIBIOS("LLD/TIMv1/hal_pwm_lld", 1130),
    RUST("timer/pwm", 322),
    rm("15.4.13"),
    values=st.integers(0, 1),
)
def _(chip: Bench, is_preloaded: int) -> None:
    chip.clock("GPIOA")
    chip["GPIOA.CRL"] = 0x4B44_4444
    set_up(chip, ARR=99, CCMR1=PWM1 | is_preloaded * PRELOAD, CCR1=50, CCER=1, EGR=1, CR1=CEN)
    ticks(chip, 20)
    chip["TIM3.CCR1"] = 10
    assert chip.level("PA6") is bool(is_preloaded)
    ticks(chip, 90)
    assert not chip.level("PA6") or chip["TIM3.CNT"] < 10
    ticks(chip, 10)
    assert not chip.level("PA6")


@TIM.row(
    "enable-last",
    "Counting begins with CEN, one clock after it, and ends when that is cleared; the count stays.",
    LOCM3("common/timer_common_all", 429),
    rm("15.3.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=0xFFFF)
    ticks(chip, 50)
    assert chip["TIM3.CNT"] == 0
    chip["TIM3.CR1"] = CEN
    ticks(chip, 1)
    assert chip["TIM3.CNT"] == 0
    ticks(chip, 20)
    assert chip["TIM3.CNT"] == 20
    chip["TIM3.CR1"] = 0
    ticks(chip, 50)
    assert chip["TIM3.CNT"] == 20


@TIM.row(
    "arr-0-stops",
    "An ARR of 0 holds the counter, so that drivers refuse it.",
    RUST("timer", 466),
    CHIBIOS("LLD/TIMv1/hal_gpt_lld", 1128),
    rm("15.4.12"),
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=0, CR1=CEN)
    ticks(chip, 100)
    assert (chip["TIM3.CNT"], flags(chip) & UIF) == (0, 0)
    chip["TIM3.ARR"] = 1
    ticks(chip, 4)
    assert flags(chip) & UIF


@TIM.row(
    "dir-read-only-when-centred",
    "In centre-aligned modes DIR is the hardware's and a write leaves it: to leave such a mode the timer is reset.",
    LOCM3("common/timer_common_all", 224),
    HAL("tim", 259),
    rm("15.4.1"),
    values=st.integers(1, 3),
)
def _(chip: Bench, mode: int) -> None:
    set_up(chip, ARR=100, CR1=mode << 5)
    chip["TIM3.CR1"] = mode << 5 | DIR
    assert not chip["TIM3.CR1"] & DIR
    chip["TIM3.CR1"] = mode << 5 | CEN
    ticks(chip, 110)
    assert chip["TIM3.CR1"] & DIR
    chip["TIM3.CR1"] = mode << 5 | CEN
    assert chip["TIM3.CR1"] & DIR


@TIM.row(
    "one-pulse-stops",
    "With OPM the counter stops at the next update event, and CEN falls.",
    HAL("tim", 2624),
    rm("15.3.10"),
    values=st.integers(1, 60),
)
def _(chip: Bench, limit: int) -> None:
    set_up(chip, ARR=limit, CR1=CEN | OPM)
    ticks(chip, limit + 1)
    assert chip["TIM3.CR1"] == CEN | OPM
    ticks(chip, 1)
    assert (chip["TIM3.CR1"], chip["TIM3.CNT"]) == (OPM, 0)
    ticks(chip, 3 * limit)
    assert chip["TIM3.CNT"] == 0


@TIM.row(
    "flags-by-zero",
    "A flag of SR is cleared by 0; 1 leaves it, so that a handler writes the complement of what it serves.",
    RIOT("timer", 308),
    RUST("timer", 822),
    rm("15.4.5"),
)
def _(chip: Bench) -> None:
    set_up(chip, EGR=0x1F)
    assert flags(chip) & 0x1F == 0x1F
    chip["TIM3.SR"] = 0xFFFF
    assert flags(chip) & 0x1F == 0x1F
    chip["TIM3.SR"] = 0xFFFF & ~4
    assert flags(chip) & 0x1F == 0x1B


@TIM.row(
    "pending-before-enable",
    "A flag of a running timer stands already when its interrupt is enabled: it is cleared before.",
    CHIBIOS("LLD/TIMv1/hal_pwm_lld", 1193),
    RIOT("timer", 196),
    rm("15.4.4"),
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=9, CCR1=5, CR1=CEN)
    ticks(chip, 7)
    assert not chip.irqs[29]
    chip["TIM3.DIER"] = 2
    assert chip.irqs[29]
    chip["TIM3.DIER"] = 0
    chip["TIM3.SR"] = 0
    chip["TIM3.DIER"] = 2
    assert not chip.irqs[29]


@TIM.row(
    "match-is-counting",
    "CCxIF rises when the counter comes to CCR.",
    rm("15.3.8"),
    RIOT("timer", 233),
    ours("TIM1 to TIM4"),
    choice="by counting alone; RIOT waits for a flag that its write of CNT makes, which ours is not; CCxG makes one",
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=99, CCR1=7, CR1=CEN)
    ticks(chip, 7)
    assert not flags(chip) & CC1IF
    ticks(chip, 1)
    assert flags(chip) & CC1IF
    chip["TIM3.SR"] = 0
    chip["TIM3.CR1"] = 0
    chip["TIM3.CNT"] = 7
    assert not flags(chip) & CC1IF
    chip["TIM3.EGR"] = 2
    assert flags(chip) & CC1IF


@TIM.row(
    "capture-direction-while-off",
    "CCxS is written only while its channel is off in CCER.",
    LOCM3("common/timer_common_all", 1749),
    rm("15.4.7"),
    values=st.integers(1, 3),
)
def _(chip: Bench, selection: int) -> None:
    set_up(chip, CCER=1)
    chip["TIM3.CCMR1"] = selection
    assert chip["TIM3.CCMR1"] & 3 == 0
    chip["TIM3.CCER"] = 0
    chip["TIM3.CCMR1"] = selection
    assert chip["TIM3.CCMR1"] & 3 == selection


@TIM.row(
    "capture-flag-by-ccr",
    "CCxIF of a capture is cleared by a read of CCR, or by 0; one that is not read before the next raises CCxOF.",
    rm("15.4.5"),
    ours("TIM1 to TIM4"),
)
def _(chip: Bench) -> None:
    set_up(chip, CCMR1=1, CCER=1, ARR=0xFFFF, CR1=CEN)
    ticks(chip, 10)
    chip.drive("PA6", True)
    assert flags(chip) & (CC1IF | CC1OF) == CC1IF
    chip.drive("PA6", False)
    ticks(chip, 10)
    chip.drive("PA6", True)
    assert flags(chip) & (CC1IF | CC1OF) == CC1IF | CC1OF
    assert chip["TIM3.CCR1"] == 19
    assert flags(chip) & (CC1IF | CC1OF) == CC1OF
    chip["TIM3.SR"] = 0
    assert not flags(chip) & CC1OF


@TIM.row(
    "output-needs-ccer",
    "A channel shows on its pin only with CCxE, and where the pin is an alternate function.",
    LOCM3("common/timer_common_all", 28),
    rm("15.4.9"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA")
    set_up(chip, ARR=99, CCMR1=5 << 4)
    chip["GPIOA.CRL"] = 0x4B44_4444
    assert not chip.level("PA6")
    chip["TIM3.CCER"] = 1
    assert chip.level("PA6")
    chip["GPIOA.CRL"] = 0x4344_4444
    assert not chip.level("PA6")


@TIM.row(
    "main-output-enable",
    "TIM1 shows nothing until MOE is set, with or without a break.",
    LOCM3("common/timer_common_all", 1372),
    LOCM3("common/timer_common_all", 43),
    rm("14.4.18"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA")
    chip["GPIOA.CRH"] = 0x4444_444B
    set_up(chip, "TIM1", CCMR1=5 << 4, CCER=1)
    assert not chip.level("PA8")
    chip["TIM1.BDTR"] = 1 << 15
    assert chip.level("PA8")


@TIM.row(
    "break-clears-moe",
    "A break clears MOE and raises BIF; MOE stays 0 until software sets it, unless AOE.",
    HAL_EX("tim", 836),
    rm("14.3.12"),
)
def _(chip: Bench) -> None:
    set_up(chip, "TIM1", BDTR=1 << 15)
    chip["TIM1.EGR"] = 1 << 7
    assert (chip["TIM1.BDTR"] >> 15, flags(chip, "TIM1") & 0x80, chip.irqs[24]) == (0, 0x80, False)
    chip["TIM1.DIER"] = 1 << 7
    assert chip.irqs[24]
    chip["TIM1.SR"] = 0
    assert not chip.irqs[24]
    set_up(chip, "TIM1", ARR=9, CR1=CEN)
    ticks(chip, 100)
    assert chip["TIM1.BDTR"] >> 15 == 0
    chip["TIM1.BDTR"] = 1 << 14
    ticks(chip, 20)
    assert chip["TIM1.BDTR"] >> 15 == 1


@TIM.row(
    "lock-once",
    "LOCK is written once after a reset; what its level covers is not written any more.",
    LOCM3("common/timer_common_all", 1578),
    rm("14.4.18"),
    values=st.integers(1, 3),
)
def _(chip: Bench, level: int) -> None:
    set_up(chip, "TIM1", BDTR=level << 8 | 0x12)
    chip["TIM1.BDTR"] = 0x34
    assert chip["TIM1.BDTR"] & 0x3FF == level << 8 | 0x12
    chip["RCC.APB2RSTR.TIM1"] = 1
    chip["RCC.APB2RSTR.TIM1"] = 0
    chip["TIM1.BDTR"] = 0x34
    assert chip["TIM1.BDTR"] & 0x3FF == 0x34


@TIM.row(
    "repetitions-first",
    "TIM1's update event comes only after RCR + 1 overflows.",
    LOCM3("common/timer_common_all", 658),
    HAL("tim", 6814),
    rm("14.3.3"),
    values=st.integers(0, 5),
)
def _(chip: Bench, repetitions: int) -> None:
    set_up(chip, "TIM1", ARR=9, RCR=repetitions, EGR=1, SR=0, CR1=CEN)
    ticks(chip, 10 * (repetitions + 1))
    assert not flags(chip, "TIM1") & UIF
    ticks(chip, 1)
    assert flags(chip, "TIM1") & UIF


@TIM.row(
    "com-loads-preloads",
    "With CCPC the enables and modes of TIM1's channels are taken over by COM alone.",
    HAL_EX("tim", 1809),
    rm("14.4.2"),
)
def _(chip: Bench) -> None:
    chip.clock("GPIOA")
    chip["GPIOA.CRH"] = 0x4444_444B
    set_up(chip, "TIM1", CR2=1, BDTR=1 << 15, CCMR1=5 << 4, CCER=1)
    assert not chip.level("PA8")
    chip["TIM1.EGR"] = 1 << 5
    assert chip.level("PA8")
    assert flags(chip, "TIM1") & 0x20


@TIM.row(
    "encoder-counts-edges",
    "In encoder mode the counter follows the edges of TI1 and TI2, in the direction of their phase, once CEN is set.",
    HAL("tim", 3009),
    RIOT("qdec", 74),
    rm("15.3.12"),
)
def _(chip: Bench) -> None:
    set_up(chip, SMCR=3, CCMR1=0x0101, ARR=0xFFFF)
    chip.drive("PA6", True)
    assert chip["TIM3.CNT"] == 0
    chip.drive("PA6", False)
    chip["TIM3.CR1"] = CEN
    for pin, level in (("PA6", True), ("PA7", True), ("PA6", False), ("PA7", False)):
        ticks(chip, 10)
        chip.drive(pin, level)
    ticks(chip, 10)
    assert (chip["TIM3.CNT"], chip["TIM3.CR1"] & DIR) == (4, 0)
    chip.drive("PA7", True)
    ticks(chip, 1)
    assert (chip["TIM3.CNT"], chip["TIM3.CR1"] & DIR) == (3, DIR)


@TIM.row(
    "beyond-the-limit",
    "An ARR below the count is missed, without preload: the counter goes on to 65535.",
    ours("TIM1 to TIM4"),
    LOCM3("common/timer_common_all", 288),
    RIOT("timer", 189),
)
def _(chip: Bench) -> None:
    set_up(chip, ARR=0xFFFF, CNT=100, CR1=CEN)
    chip["TIM3.ARR"] = 50
    ticks(chip, 0x10000 - 100)
    assert (chip["TIM3.CNT"], flags(chip) & UIF) == (0xFFFF, 0)


@TIM.row(
    "dma-request-by-dier",
    "An update asks for DMA only with UDE.",
    rm("15.4.4"),
    HAL("tim", 4477),
)
def _(chip: Bench) -> None:
    chip.clock("DMA1")
    for name, value in (("CPAR3", 0x4000_042C), ("CMAR3", 0x2000_0000), ("CNDTR3", 5), ("CCR3", 1)):
        chip[f"DMA1.{name}"] = value
    set_up(chip, EGR=1)
    chip.run(2_000)
    assert chip["DMA1.CNDTR3"] == 5
    set_up(chip, DIER=1 << 8, EGR=1)
    chip.run(2_000)
    assert chip["DMA1.CNDTR3"] == 4


TIM.not_modelled(
    "uif-late",
    "After UG it takes some clocks until UIF reads 1.",
    CHIBIOS("LLD/TIMv1/hal_gpt_lld", 1143),
    why="UIF rises with the write, so that a clear right behind it finds it",
)
TIM.not_modelled(
    "fast-enable",
    "OCxFE shortens the way from a trigger to an output in the PWM modes only.",
    LOCM3("common/timer_common_all", 767),
    rm("15.4.7"),
    why="triggers have no delay that could be shortened",
)
