"""RTC and BKP: the lock of the backup domain, configuration mode, synchronisation, flags, tamper."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, HAL, HAL_EX, LOCM3, RIOT, ours, rm

RTC, BKP = Sequences("RTC"), Sequences("BKP")
#: A cycle of LSI, 40 kHz.
CYCLE_NS = 25_000
SECF, ALRF, OWF, RSF, CNF, RTOFF = 1, 2, 4, 8, 16, 32
TPE, TPAL, CTE, CTI, TPIE, TEF, TIF = 1, 2, 1, 2, 4, 1 << 8, 1 << 9
CCO, ASOE = 1 << 7, 1 << 8


def open_backup(chip: Bench) -> None:
    chip.clock("PWR", "BKP")
    chip["PWR.CR.DBP"] = 1


def run_rtc(chip: Bench) -> None:
    """RTC from LSI, with its first prescaler of 0 loaded: a count each cycle, from 0."""
    open_backup(chip)
    chip["RCC.CSR.LSION"] = 1
    chip.run(100_000)
    chip["RCC.BDCR"] = 1 << 15 | 2 << 8
    chip.run(2 * CYCLE_NS)


def configure(chip: Bench, **values: int) -> None:
    """The order of every driver: RTOFF, CNF, words, CNF off, RTOFF."""
    assert chip["RTC.CRL.RTOFF"]
    chip["RTC.CRL"] = 0xF | CNF
    for name, value in values.items():
        chip[f"RTC.{name}H"] = value >> 16
        chip[f"RTC.{name}L"] = value & 0xFFFF
    chip["RTC.CRL"] = 0xF


def count(chip: Bench) -> int:
    return chip["RTC.CNTH"] << 16 | chip["RTC.CNTL"]


@RTC.row(
    "cnf-first",
    "PRL, CNT and ALR take a write only in configuration mode.",
    LOCM3("f1/rtc", 15),
    CHIBIOS("LLD/RTCv1/hal_rtc_lld", 82),
    HAL("rtc", 1715),
    rm("18.3.4"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip["RTC.ALRL"] = 5
    assert chip["RTC.ALRL"] == 0xFFFF
    chip["RTC.CRL"] = 0xF | CNF
    chip["RTC.ALRL"] = 5
    chip["RTC.CRL"] = 0xF
    chip.run(10 * CYCLE_NS)
    assert chip["RTC.ALRL"] == 5


@RTC.row(
    "rtoff-before-and-after",
    "RTOFF is 0 for three cycles behind CNF's fall; the next configuration waits for it.",
    LOCM3("f1/rtc", 132),
    RIOT("rtc_f1", 38),
    CHIBIOS("LLD/RTCv1/hal_rtc_lld", 69),
    rm("18.3.4"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    assert chip["RTC.CRL.RTOFF"]
    configure(chip, ALR=7)
    assert not chip["RTC.CRL.RTOFF"]
    chip["RTC.CRL"] = 0xF | CNF
    assert not chip["RTC.CRL.CNF"]
    chip.run(2 * CYCLE_NS)
    assert not chip["RTC.CRL.RTOFF"]
    chip.run(2 * CYCLE_NS)
    assert chip["RTC.CRL.RTOFF"]


@RTC.row(
    "written-when-left",
    "What was written in configuration mode counts once that is left.",
    LOCM3("f1/rtc", 149),
    HAL("rtc", 1733),
    rm("18.3.4"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip["RTC.CRL"] = 0xF | CNF
    chip["RTC.CNTH"], chip["RTC.CNTL"] = 1, 0
    chip.run(20 * CYCLE_NS)
    assert count(chip) < 0x1_0000
    chip["RTC.CRL"] = 0xF
    chip.run(4 * CYCLE_NS)
    assert count(chip) >= 0x1_0000


@RTC.row(
    "dbp-first",
    "Nothing of RTC is written until PWR has its clock and DBP is set.",
    LOCM3("f1/rtc", 377),
    RIOT("rtc_f1", 35),
    HAL("pwr", 140),
    rm("6.2"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip["PWR.CR.DBP"] = 0
    chip["RTC.CRH"] = 1
    chip["RTC.CRL"] = 0xF | CNF
    assert (chip["RTC.CRH"], chip["RTC.CRL.CNF"]) == (0, 0)
    chip["PWR.CR.DBP"] = 1
    chip["RTC.CRH"] = 1
    assert chip["RTC.CRH"] == 1


@RTC.row(
    "rsf-first",
    "Behind a reset CNT and DIV are read only after RSF has risen; until then they read 0.",
    HAL("rtc", 1535),
    CHIBIOS("LLD/RTCv1/hal_rtc_lld", 55),
    LOCM3("f1/rtc", 379),
    rm("18.3.3"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["RCC.BDCR.LSEON"] = 1
    chip.run(1_500_000_000)
    chip["RCC.BDCR"] = 1 << 15 | 1 << 8 | 1
    chip.run(100_000)
    configure(chip, CNT=0x1234_0000)
    chip.run(1_000_000)
    assert count(chip) == 0x1234_0000
    chip.parts.reset(ResetCause.SOFTWARE)
    assert (chip["RTC.CRL.RSF"], count(chip)) == (0, 0)
    chip.run(31_000)
    assert (chip["RTC.CRL.RSF"], count(chip)) == (1, 0x1234_0000)


@RTC.row(
    "rsf-by-zero",
    "RSF is cleared by 0 and rises with the next cycle of RTCCLK: who wants fresh registers clears it first.",
    CHIBIOS("LLD/RTCv1/hal_rtc_lld", 224),
    RIOT("rtc_f1", 98),
    rm("18.4.2"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    assert chip["RTC.CRL.RSF"]
    chip["RTC.CRL"] = 0xF & ~RSF
    assert not chip["RTC.CRL.RSF"]
    chip.run(CYCLE_NS)
    assert chip["RTC.CRL.RSF"]


@RTC.row(
    "flags-by-zero",
    "SECF, ALRF and OWF are cleared by 0, without configuration mode; 1 leaves them.",
    LOCM3("f1/rtc", 315),
    HAL("rtc", 756),
    rm("18.4.2"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip.run(0x8001 * CYCLE_NS)
    assert chip["RTC.CRL"] & SECF
    chip["RTC.CRL"] = 0xF
    assert chip["RTC.CRL"] & SECF
    chip["RTC.CRL"] = 0xF & ~SECF
    assert not chip["RTC.CRL"] & SECF


@RTC.row(
    "interrupt-by-enable",
    "A second interrupts only with SECIE, as long as SECF stands.",
    HAL_EX("rtc", 391),
    rm("18.4.1"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip.run(0x8001 * CYCLE_NS)
    assert not chip.irqs[3]
    chip["RTC.CRH"] = 1
    assert chip.irqs[3]
    chip["RTC.CRL"] = 0xF & ~SECF
    assert not chip.irqs[3]


@RTC.row(
    "alarm-at-count",
    "ALRF rises as the counter comes to ALR, and line 17 of EXTI with it, which has a pending bit of its own.",
    HAL("rtc", 1424),
    rm("18.3.5"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    configure(chip, PRL=1)
    chip.run(0x8010 * CYCLE_NS)
    chip["EXTI.RTSR"] = chip["EXTI.IMR"] = 1 << 17
    chip["RTC.CRL"] = 0xF & ~ALRF
    configure(chip, CNT=10, ALR=15)
    chip.run(5 * CYCLE_NS)
    assert (chip["RTC.CRL"] & ALRF, chip["EXTI.PR"] >> 17 & 1) == (0, 0)
    chip.run(20 * CYCLE_NS)
    assert (chip["RTC.CRL"] & ALRF, chip["EXTI.PR"] >> 17 & 1, chip.irqs[41]) == (ALRF, 1, True)
    chip["RTC.CRL"] = 0xF & ~ALRF
    assert chip.irqs[41]
    chip["EXTI.PR"] = 1 << 17
    assert not chip.irqs[41]


@RTC.row(
    "alarm-wakes",
    "An alarm sets WUF of PWR as it rises, once: what CWUF has cleared stays 0 until the next.",
    rm("5.4.2"),
    ours("PWR"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    configure(chip, PRL=1)
    chip.run(0x8010 * CYCLE_NS)
    configure(chip, CNT=10, ALR=15)
    chip["PWR.CR"] = 1 << 8 | 4
    while not chip["PWR.CSR"] & 1:
        chip.run(CYCLE_NS // 4)
    chip["PWR.CR"] = 1 << 8 | 4
    chip.run(20 * CYCLE_NS)
    assert not chip["PWR.CSR"] & 1


@RTC.row(
    "source-first",
    "RTC counts only once RTCSEL has chosen a source that runs, and RTCEN is set.",
    LOCM3("f1/rtc", 36),
    HAL("rtc", 325),
    rm("7.3.9"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["RCC.BDCR"] = 1 << 15
    chip.run(1_000_000_000)
    assert not chip["RTC.CRL.RSF"]
    chip["RCC.BDCR"] = 1 << 15 | 2 << 8
    chip.run(1_000_000_000)
    assert not chip["RTC.CRL.RSF"]
    chip["RCC.CSR.LSION"] = 1
    chip["RCC.BDCR.RTCEN"] = 0
    chip.run(1_000_000_000)
    assert not chip["RTC.CRL.RSF"]
    chip["RCC.BDCR.RTCEN"] = 1
    chip.run(200_000)
    assert chip["RTC.CRL.RSF"]


@RTC.row(
    "survives-reset",
    "The count and the prescaler outlive a reset of the system; CRH and the flags' enables do not.",
    LOCM3("f1/rtc", 28),
    CHIBIOS("LLD/RTCv1/hal_rtc_lld", 188),
    rm("18.3.2"),
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip["RTC.CRH"] = 7
    configure(chip, CNT=0x77_0000)
    chip.run(10 * CYCLE_NS)
    chip.parts.reset(ResetCause.PIN)
    open_backup(chip)
    chip["RCC.CSR.LSION"] = 1
    chip.run(200_000)
    assert (chip["RTC.CRH"], count(chip)) == (0, 0x77_0000)


RTC.not_modelled(
    "hse-needs-dbp",
    "With HSE / 128 as RTCCLK DBP stays set.",
    HAL("pwr", 164),
    rm("5.4.1"),
    why="RTC counts from HSE whatever DBP is: the manual does not say what stops",
)
RTC.not_modelled(
    "stale-after-stop",
    "CNT and DIV are old behind Stop until RSF has been cleared and has risen.",
    HAL("rtc", 1535),
    ours("RTC"),
    why="they are never old, as peripherals.md says",
)


@BKP.row(
    "clocks-then-dbp",
    "A backup register takes a write only with the clocks of PWR and BKP on and DBP set, in this order.",
    LOCM3("f1/rtc", 373),
    HAL("pwr", 139),
    rm("6.1"),
    values=st.integers(0, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip["PWR.CR.DBP"] = 1
    chip.clock("BKP")
    chip["BKP.DR4"] = word
    assert chip["BKP.DR4"] == 0
    open_backup(chip)
    chip["BKP.DR4"] = word
    assert chip["BKP.DR4"] == word


@BKP.row(
    "outlives-resets",
    "Backup registers keep their data over resets of the system, and DBP is 0 behind one.",
    rm("6.1"),
    LOCM3("common/pwr_common_v1", 34),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["BKP.DR1"] = 0x55AA
    chip.parts.reset(ResetCause.SOFTWARE)
    chip.clock("BKP", "PWR")
    assert (chip["BKP.DR1"], chip["PWR.CR.DBP"]) == (0x55AA, 0)
    chip["BKP.DR1"] = 1
    assert chip["BKP.DR1"] == 0x55AA


@BKP.row(
    "tamper-erases",
    "A tamper event clears all backup registers and keeps them 0 while TEF stands; CTE clears that.",
    HAL_EX("rtc", 285),
    rm("6.3.1"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["BKP.DR7"] = 0x1111
    chip.drive("PC13", False)
    chip["BKP.CR"] = TPE
    assert chip["BKP.DR7"] == 0x1111
    chip.drive("PC13", True)
    assert (chip["BKP.DR7"], chip["BKP.CSR"] & TEF) == (0, TEF)
    chip["BKP.DR7"] = 0x2222
    assert chip["BKP.DR7"] == 0
    chip["BKP.CR"] = 0
    chip["BKP.CSR"] = CTE
    chip["BKP.DR7"] = 0x3333
    assert (chip["BKP.CSR"] & TEF, chip["BKP.DR7"]) == (0, 0x3333)


@BKP.row(
    "tamper-level-first",
    "The polarity is set before TPE: a level that is there already is an event when TPE is set.",
    rm("6.3.1"),
    HAL_EX("rtc", 107),
    values=st.integers(0, 1),
)
def _(chip: Bench, level: int) -> None:
    open_backup(chip)
    chip["BKP.DR7"] = 0x1111
    chip.drive("PC13", bool(level))
    chip["BKP.CR"] = TPAL
    assert chip["BKP.DR7"] == 0x1111
    chip["BKP.CR"] = TPAL | TPE
    assert bool(chip["BKP.CSR"] & TEF) is not bool(level)


@BKP.row(
    "tamper-interrupt",
    "A tamper event interrupts only with TPIE; TIF is cleared by CTI.",
    HAL_EX("rtc", 198),
    rm("6.4.4"),
)
def _(chip: Bench) -> None:
    open_backup(chip)
    chip["BKP.CSR"] = TPIE
    chip.drive("PC13", False)
    chip["BKP.CR"] = TPE
    chip.drive("PC13", True)
    assert (chip["BKP.CSR"] & TIF, chip.irqs[2]) == (TIF, True)
    chip["BKP.CSR"] = TPIE | CTI
    assert (chip["BKP.CSR"] & TIF, chip.irqs[2]) == (0, False)


@BKP.row(
    "one-use-of-pc13",
    "TAMPER is switched on only while CCO and ASOE are 0: the pin has one use.",
    HAL_EX("rtc", 77),
    rm("6.4.2"),
    choice="ST's driver refuses; in the model TPE takes the pin from both",
)
def _(chip: Bench) -> None:
    run_rtc(chip)
    chip["BKP.RTCCR"] = CCO
    assert chip.pins["PC13"].holder is not None
    chip["BKP.CR"] = TPE
    assert chip.pins["PC13"].holder is None
    chip["BKP.CR"] = 0
    assert chip.pins["PC13"].holder is not None
