"""PWR: what is set before a core sleeps deeply, and what is there behind it."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.peripherals.sequences.bench import Bench, store
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, LOCM3, RIOT, ours, rm

PWR = Sequences("PWR")
RCC, PWR_BASE, EXTI, SCR, ISER0 = 0x4002_1000, 0x4000_7000, 0x4001_0400, 0xE000_ED10, 0xE000_E100
LPDS, PDDS, CWUF, CSBF, PVDE, DBP = 1, 2, 4, 8, 16, 1 << 8
WUF, SBF, PVDO, EWUP = 1, 2, 4, 1 << 8
SLEEPDEEP = 4
CLOCKS = store(RCC + 0x1C, 1 << 28) + store(RCC + 0x18, 5)
LINE_4 = store(EXTI + 8, 1 << 4) + store(EXTI, 1 << 4) + store(ISER0, 1 << 10)
HANDLER = "irq: mov32 r1, #0x40010414\nmovs r2, #16\nstr r2, [r1, #0]\nlog #1\nbx lr"


def sleep(source: str) -> Machine:
    """Run up to a WFI, after which the program notes 2."""
    return Machine(f"{CLOCKS}{LINE_4}{source}wfi\nlog #2\nb stop\n{HANDLER}", {26: "irq"}).run(500)


@PWR.row("clock-first", "PWR takes nothing until its clock is on.", HAL("pwr", 143), rm("7.3.8"))
def _(chip: Bench) -> None:
    chip["PWR.CR"] = DBP
    chip.clock("PWR")
    assert chip["PWR.CR"] == 0
    chip["PWR.CR"] = DBP
    assert chip["PWR.CR"] == DBP


@PWR.row(
    "dbp-after-reset",
    "The backup domain is locked behind every reset until DBP is set.",
    LOCM3("common/pwr_common_v1", 34),
    HAL("pwr", 139),
    rm("5.4.1"),
)
def _(chip: Bench) -> None:
    chip.clock("PWR")
    chip["PWR.CR"] = DBP
    chip.parts.reset(ResetCause.IWDG)
    chip.clock("PWR")
    assert (chip["PWR.CR"], chip.power.is_backup_open) == (0, False)


@PWR.row(
    "level-before-pvde",
    "The threshold is chosen before, or with, PVDE; without PVDE PVDO is 0 whatever the supply.",
    LOCM3("common/pwr_common_v1", 167),
    HAL("pwr", 321),
    rm("5.2.3"),
    values=st.integers(0, 7),
)
def _(chip: Bench, level: int) -> None:
    chip.clock("PWR")
    chip.power.supply_mv = 2079 + 100 * level
    chip.parts.pwr.supply_changed()
    chip["PWR.CR"] = level << 5
    assert not chip["PWR.CSR"] & PVDO
    chip["PWR.CR"] = level << 5 | PVDE
    assert chip["PWR.CSR"] & PVDO


@PWR.row(
    "pvd-by-exti",
    "The detector interrupts by line 16 of EXTI, whose edges are chosen first; its pending bit is cleared there.",
    HAL("pwr", 324),
    HAL("pwr", 587),
    rm("5.2.3"),
)
def _(chip: Bench) -> None:
    chip.clock("PWR")
    chip["PWR.CR"] = PVDE
    chip.power.supply_mv = 2_000
    chip.parts.pwr.supply_changed()
    assert (chip["PWR.CSR"] & PVDO, chip["EXTI.PR"]) == (PVDO, 0)
    chip["EXTI.FTSR"] = chip["EXTI.IMR"] = 1 << 16
    chip.power.supply_mv = 3_300
    chip.parts.pwr.supply_changed()
    assert (chip["PWR.CSR"] & PVDO, chip.irqs[1]) == (0, True)
    chip["EXTI.PR"] = 1 << 16
    assert not chip.irqs[1]


@PWR.row(
    "flags-by-their-bits",
    "WUF and SBF are cleared by CWUF and CSBF alone, which read 0; a write of CSR leaves them.",
    LOCM3("common/pwr_common_v1", 88),
    LOCM3("common/pwr_common_v1", 99),
    rm("5.4.2"),
)
def _(chip: Bench) -> None:
    chip.clock("PWR")
    chip.drive("PA0", False)
    chip["PWR.CSR"] = EWUP
    chip.drive("PA0", True)
    assert chip["PWR.CSR"] == EWUP | WUF
    chip["PWR.CSR"] = EWUP
    assert chip["PWR.CSR"] & WUF
    chip["PWR.CR"] = CWUF
    assert (chip["PWR.CSR"], chip["PWR.CR"]) == (EWUP, 0)


@PWR.row(
    "wkup-pin",
    "WKUP is an input with a pull-down only with EWUP, whatever GPIO says.",
    HAL("pwr", 499),
    LOCM3("common/pwr_common_v1", 148),
    rm("5.4.2"),
)
def _(chip: Bench) -> None:
    chip.clock("PWR")
    chip.drive("PA0", False)
    chip.drive("PA0", True)
    assert chip["PWR.CSR"] == 0
    chip.drive("PA0", None)
    chip["PWR.CSR"] = EWUP
    assert not chip.level("PA0")
    assert chip.pins["PA0"].holder is not None


@PWR.row(
    "sleepdeep-first",
    "WFI means Stop or Standby only with SLEEPDEEP; without it, it is Sleep, where clocks go on.",
    HAL("pwr", 425),
    HAL("pwr", 474),
    rm("5.3.2"),
)
def _(_: Bench) -> None:
    for deep, mode in ((0, "RUN"), (SLEEPDEEP, "STOP")):
        machine = sleep(store(SCR, deep))
        assert (machine.board.chip.low_power.mode.name, machine.log) == (mode, [])
        machine.board.pin("PA4").drive(True)
        assert machine.run(100).log == [1, 2]


@PWR.row(
    "hsi-behind-stop",
    "Behind Stop HSI is SYSCLK and HSE is off: a driver starts its clocks anew.",
    HAL("pwr", 446),
    RIOT("pm", 209),
    rm("5.3.4"),
)
def _(_: Bench) -> None:
    wait = "mov32 r1, #0x40021000\nmov32 r5, #0x30083\nwait: ldr r2, [r1, #0]\nsubs r2, r2, r5\nbne wait\n"
    source = store(RCC, 1 << 16 | 0x81) + wait + store(RCC + 4, 1) + store(SCR, SLEEPDEEP)
    machine = sleep(source).run(5_000)
    machine.board.pin("PA4").drive(True)
    machine.run(100)
    rcc = machine.board.registers("RCC")
    assert machine.log == [1, 2]
    assert (rcc["CFGR"]["SWS"], rcc["CFGR"]["SW"], rcc["CR"]["HSEON"]) == (0, 0, 0)


@PWR.row(
    "regulator-delay",
    "With LPDS it takes longer until the program goes on.",
    HAL("pwr", 448),
    rm("5.3.4"),
    choice="3.6 us, and 5.4 us with LPDS: the data sheet's typical values",
)
def _(_: Bench) -> None:
    for control, wake_ns in ((0, 3_600), (LPDS, 5_400)):
        machine = sleep(store(PWR_BASE, control) + store(SCR, SLEEPDEEP))
        at_ns = machine.board.now_ns
        machine.board.pin("PA4").drive(True)
        machine.board.advance_to(at_ns + wake_ns - 125)
        assert machine.board.chip.low_power.mode.name == "WAKING"
        machine.run(50)
        assert machine.log == [1, 2]


@PWR.row(
    "pins-in-stop",
    "In Stop every pin keeps its state.",
    HAL("pwr", 445),
    rm("5.3.4"),
)
def _(_: Bench) -> None:
    port = store(0x4001_1004, 0x4434_4444) + store(0x4001_1010, 1 << 13)
    machine = sleep(store(RCC + 0x18, 0x15) + port + store(SCR, SLEEPDEEP))
    assert machine.board.chip.low_power.mode.name == "STOP"
    assert machine.board.pin("PC13").level


@PWR.row(
    "pending-forbids-stop",
    "Stop does not begin while an unmasked line of EXTI is pending: it is cleared first.",
    rm("5.3.4"),
    ours("PWR"),
)
def _(_: Bench) -> None:
    held = store(ISER0 + 0x80, 1 << 10) + store(EXTI + 0x10, 1 << 4) + store(SCR, SLEEPDEEP)
    machine = sleep(held)
    assert machine.log == [2]
    machine = sleep(held + store(EXTI + 0x14, 1 << 4))
    assert (machine.log, machine.board.chip.low_power.mode.name) == ([], "STOP")


@PWR.row(
    "wuf-forbids-standby",
    "Standby does not begin while WUF is set: CWUF is written first.",
    rm("5.3.5"),
    LOCM3("common/pwr_common_v1", 97),
)
def _(_: Bench) -> None:
    woken = "mov32 r1, #0x40007004\nmov32 r5, #0x101\nwait: ldr r2, [r1, #0]\nsubs r2, r2, r5\nbne wait\n"
    for clear, is_asleep in ((0, False), (CWUF, True)):
        asks = store(PWR_BASE + 4, EWUP) + woken + store(PWR_BASE, PDDS | clear) + store(SCR, SLEEPDEEP)
        machine = Machine(CLOCKS + asks + "wfi\nlog #2\nb stop", {})
        machine.board.pin("PA0").drive(False)
        machine.run(50)
        machine.board.pin("PA0").drive(True)
        machine.run(500)
        assert (machine.board.chip.low_power.mode.name == "STANDBY") is is_asleep
        assert (machine.log == [2]) is not is_asleep


@PWR.row(
    "pins-in-standby",
    "In Standby pins are let go, and its end is a reset that SBF tells of.",
    HAL("pwr", 496),
    rm("5.3.5"),
)
def _(_: Bench) -> None:
    port = store(0x4001_0800, 0x4444_4434) + store(0x4001_0810, 2)
    asks = store(PWR_BASE + 4, EWUP) + store(PWR_BASE, PDDS | CWUF) + store(SCR, SLEEPDEEP)
    machine = Machine(store(RCC + 0x1C, 1 << 28) + store(RCC + 0x18, 5) + port + asks + "wfi\nb stop", {})
    machine.board.pin("PA0").drive(False)
    machine.run(500)
    board = machine.board
    assert board.chip.low_power.mode.name == "STANDBY"
    assert board.pin("PA1").is_floating
    resets = board.chip.resets
    board.pin("PA0").drive(True)
    machine.run(200)
    assert board.chip.resets == resets + 1
    assert board.registers("PWR")["CSR"]["SBF"] == 1


PWR.not_modelled(
    "two-wfe",
    "Stop by WFE is asked for behind a SEV and a first WFE, which takes what was noted before.",
    HAL("pwr", 487),
    why="the event register is checked with the core: SCB-event-noted; the second WFE of ST's is for an erratum",
)
