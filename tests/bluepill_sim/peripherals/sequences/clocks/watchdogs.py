"""IWDG and WWDG: keys, what nothing takes back, and when they are fed."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CHIBIOS, HAL, LOCM3, ours, rm

IWDG, WWDG = Sequences("IWDG"), Sequences("WWDG")
FEED, START, UNLOCK = 0xAAAA, 0xCCCC, 0x5555
#: A cycle of LSI, and five of them: an update.
LSI_NS = 25_000
UPDATE_NS = 5 * LSI_NS
#: A count of WWDG at 8 MHz: 4096 cycles.
COUNT_NS = 512_000
WDGA, EWI = 0x80, 1 << 9


def start(chip: Bench, prescaler: int = 0, reload: int = 99) -> None:
    """The order of ST: start, unlock, set, wait, feed."""
    for register, value in (("KR", START), ("KR", UNLOCK), ("PR", prescaler), ("RLR", reload)):
        chip[f"IWDG.{register}"] = value
    chip.run(UPDATE_NS)
    chip["IWDG.KR"] = FEED


@IWDG.row(
    "unlock-first",
    "PR and RLR take nothing until 0x5555 has been written to KR; any other key locks them again.",
    HAL("iwdg", 183),
    CHIBIOS("LLD/xWDGv1/hal_wdg_lld", 89),
    LOCM3("common/iwdg_common_all", 106),
    rm("19.3.2"),
    values=st.sampled_from([FEED, START]),
)
def _(chip: Bench, key: int) -> None:
    chip["IWDG.PR"], chip["IWDG.RLR"] = 3, 5
    assert (chip["IWDG.PR"], chip["IWDG.RLR"]) == (0, 0xFFF)
    chip["IWDG.KR"] = UNLOCK
    chip["IWDG.PR"], chip["IWDG.RLR"] = 3, 5
    chip.run(UPDATE_NS)
    chip["IWDG.KR"] = key
    chip["IWDG.PR"], chip["IWDG.RLR"] = 4, 6
    assert (chip["IWDG.PR"], chip["IWDG.RLR"]) == (3, 5)


@IWDG.row(
    "wait-for-update",
    "PVU and RVU stand for five cycles of LSI behind a write; another before they fall is lost.",
    HAL("iwdg", 193),
    LOCM3("common/iwdg_common_all", 107),
    CHIBIOS("LLD/xWDGv1/hal_wdg_lld", 96),
    rm("19.4.4"),
)
def _(chip: Bench) -> None:
    chip["IWDG.KR"] = UNLOCK
    chip["IWDG.PR"] = 1
    chip["IWDG.PR"] = 2
    chip["IWDG.RLR"] = 9
    assert chip["IWDG.SR"] == 3
    chip.run(UPDATE_NS - 1)
    assert chip["IWDG.SR"] == 3
    chip.run(1)
    assert (chip["IWDG.SR"], chip["IWDG.PR"], chip["IWDG.RLR"]) == (0, 1, 9)


@IWDG.row(
    "reload-by-feed",
    "A new RLR counts only from the next feed on: drivers feed behind it.",
    HAL("iwdg", 205),
    LOCM3("common/iwdg_common_all", 112),
    rm("19.3"),
)
def _(chip: Bench) -> None:
    chip["IWDG.KR"] = START
    chip["IWDG.KR"] = UNLOCK
    chip["IWDG.RLR"] = 9
    chip.run(UPDATE_NS + 20 * 4 * LSI_NS)
    assert chip.expired == []
    chip["IWDG.KR"] = FEED
    chip.run(10 * 4 * LSI_NS - 1)
    assert chip.expired == []
    chip.run(1)
    assert len(chip.expired) == 1


@IWDG.row(
    "starts-from-fff",
    "It counts down from 0xFFF when it is started, whatever was or was not written before.",
    HAL("iwdg", 34),
    rm("19.3"),
)
def _(chip: Bench) -> None:
    chip["IWDG.KR"] = START
    chip.run(0x1000 * 4 * LSI_NS - 1)
    assert chip.expired == []
    chip.run(1)
    assert [name for name, _ in chip.expired] == ["IWDG"]


@IWDG.row(
    "feed-without-start",
    "A feed before the start starts nothing.",
    LOCM3("common/iwdg_common_all", 16),
    rm("19.3"),
)
def _(chip: Bench) -> None:
    chip["IWDG.KR"] = FEED
    chip["IWDG.KR"] = UNLOCK
    chip.run(100_000_000_000)
    assert chip.expired == []


@IWDG.row(
    "not-stopped",
    "Once started it is stopped by a reset alone, and it keeps LSI on.",
    HAL("iwdg", 33),
    rm("19.3"),
)
def _(chip: Bench) -> None:
    start(chip)
    chip["RCC.CSR.LSION"] = 0
    assert chip["RCC.CSR.LSION"]
    for key in (START, UNLOCK, 0):
        chip["IWDG.KR"] = key
    chip.run(100 * 4 * LSI_NS)
    assert len(chip.expired) == 1
    chip.parts.reset(ResetCause.IWDG)
    chip.run(10_000_000_000)
    assert (len(chip.expired), chip["RCC.CSR.LSION"], chip["RCC.CSR.IWDGRSTF"]) == (1, 0, 1)


@IWDG.row(
    "fed-in-time",
    "A feed before the count is out puts the reset off by the whole time of PR and RLR.",
    HAL("iwdg", 38),
    rm("19.3"),
    values=st.integers(0, 6),
)
def _(chip: Bench, prescaler: int) -> None:
    start(chip, prescaler, 9)
    span_ns = 10 * (4 << prescaler) * LSI_NS
    chip.run(span_ns - 1)
    chip["IWDG.KR"] = FEED
    chip.run(span_ns - 1)
    assert chip.expired == []
    chip.run(1)
    assert len(chip.expired) == 1


@IWDG.row(
    "started-by-option",
    "The option byte can have it started with the chip, before any program.",
    LOCM3("common/iwdg_common_all", 14),
    ours("IWDG"),
)
def _(chip: Bench) -> None:
    options = bytearray(chip.array.options)
    options[2:4] = b"\xfe\x01"
    chip.array.options = bytes(options)
    chip.parts.reset(ResetCause.PIN)
    chip.run(0x1000 * 4 * LSI_NS)
    assert len(chip.expired) == 1


@WWDG.row(
    "clock-first",
    "WWDG takes nothing until its clock is on, and counts nothing until WDGA is set.",
    HAL("wwdg", 66),
    rm("20.3"),
)
def _(chip: Bench) -> None:
    chip["WWDG.CR"] = 0xFF
    chip.run(100 * COUNT_NS)
    assert chip.expired == []
    chip.clock("WWDG")
    chip["WWDG.CR"] = 0x45
    chip.run(100 * COUNT_NS)
    assert (chip.expired, chip["WWDG.CR"]) == ([], 0x45)
    chip["WWDG.CR"] = WDGA | 0x45
    chip.run(6 * COUNT_NS)
    assert len(chip.expired) == 1


@WWDG.row(
    "t6-set",
    "T6 is set with WDGA, else the reset comes at once.",
    HAL("wwdg", 71),
    rm("20.3"),
    values=st.integers(0, 0x7F),
)
def _(chip: Bench, count: int) -> None:
    chip.clock("WWDG")
    chip["WWDG.CR"] = WDGA | count
    assert bool(chip.expired) is (count < 0x40)


@WWDG.row(
    "rolls-to-3f",
    "The reset comes when the counter goes from 0x40 to 0x3F.",
    HAL("wwdg", 29),
    rm("20.3"),
    values=st.integers(0x40, 0x7F),
)
def _(chip: Bench, count: int) -> None:
    chip.clock("WWDG")
    chip["WWDG.CR"] = WDGA | count
    chip.run((count - 0x3F) * COUNT_NS - 1)
    assert (chip.expired, chip["WWDG.CR"]) == ([], WDGA | 0x40)
    chip.run(1)
    assert len(chip.expired) == 1


@WWDG.row(
    "window-only",
    "It is fed only once the counter is at the window or below: earlier is a reset.",
    HAL("wwdg", 31),
    HAL("wwdg", 79),
    rm("20.4"),
)
def _(chip: Bench) -> None:
    chip.clock("WWDG")
    chip["WWDG.CFR"] = 0x50
    chip["WWDG.CR"] = 0xFF
    chip.run((0x7F - 0x50) * COUNT_NS)
    chip["WWDG.CR"] = 0xFF
    assert chip.expired == []
    chip.run((0x7F - 0x50) * COUNT_NS - 1)
    chip["WWDG.CR"] = 0xFF
    assert len(chip.expired) == 1


@WWDG.row(
    "not-disabled",
    "WDGA and EWI, once set, are cleared by a reset alone.",
    HAL("wwdg", 34),
    HAL("wwdg", 40),
    rm("20.6"),
)
def _(chip: Bench) -> None:
    chip.clock("WWDG")
    chip["WWDG.CFR"] = EWI | 0x7F
    chip["WWDG.CR"] = 0xFF
    chip["WWDG.CFR"], chip["WWDG.CR"] = 0x7F, 0x7F
    assert (chip["WWDG.CFR"], chip["WWDG.CR"]) == (EWI | 0x7F, 0xFF)
    chip.parts.reset(ResetCause.WWDG)
    chip.clock("WWDG")
    assert (chip["WWDG.CFR"], chip["WWDG.CR"]) == (0x7F, 0x7F)


@WWDG.row(
    "early-wake-up",
    "EWIF rises at 0x40, a count before the reset; it interrupts with EWI and is cleared by 0, not by 1.",
    HAL("wwdg", 358),
    rm("20.6.3"),
    HAL("wwdg", 373),
)
def _(chip: Bench) -> None:
    chip.clock("WWDG")
    chip["WWDG.CFR"] = EWI | 0x7F
    chip["WWDG.CR"] = WDGA | 0x42
    chip.run(2 * COUNT_NS - 1)
    assert not chip.irqs[0]
    chip.run(1)
    assert (chip.irqs[0], chip["WWDG.SR"], chip.expired) == (True, 1, [])
    chip["WWDG.SR"] = 1
    assert chip.irqs[0]
    chip["WWDG.SR"] = 0
    assert not chip.irqs[0]


@WWDG.row(
    "prescaler",
    "WDGTB makes each count twice as long with each step; a count follows PCLK1.",
    HAL("wwdg", 44),
    rm("20.4"),
    values=st.integers(0, 3),
)
def _(chip: Bench, step: int) -> None:
    chip.clock("WWDG")
    chip["RCC.CFGR.PPRE1"] = 4
    chip["WWDG.CFR"] = step << 7 | 0x7F
    chip["WWDG.CR"] = WDGA | 0x40
    chip.run(2 * (COUNT_NS << step) - 1)
    assert chip.expired == []
    chip.run(1)
    assert len(chip.expired) == 1


IWDG.not_modelled(
    "debug-stop",
    "DBG_IWDG_STOP decides whether it counts while a debugger halts the core.",
    HAL("iwdg", 49),
    why="checked with the debugger's tests, not by registers alone: test_stopped_clocks.py",
)
WWDG.not_modelled(
    "counts-before-wdga",
    "The counter runs before WDGA too, so that its value is written with it.",
    rm("20.3"),
    ours("WWDG"),
    why="nothing counts before WDGA, as peripherals.md says",
)
