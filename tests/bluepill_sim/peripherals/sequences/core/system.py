"""NVIC, SysTick and SCB: what is written before an exception comes, and which order exceptions have."""

from hypothesis import strategies as st

from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.peripherals.sequences.bench import Bench, load, program, store
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import CMSIS, HAL, LOCM3_CORE, RUST, arm

NVIC, SYSTICK, SCB = Sequences("NVIC"), Sequences("SysTick"), Sequences("SCB")
ISER, ICER, ISPR, ICPR, IABR, IPR = 0xE000_E100, 0xE000_E180, 0xE000_E200, 0xE000_E280, 0xE000_E300, 0xE000_E400
CTRL, LOAD, VAL = 0xE000_E010, 0xE000_E014, 0xE000_E018
ICSR, VTOR, AIRCR, SCR, CCR, SHPR3, SHCSR = (0xE000_ED00 + at for at in (4, 8, 0xC, 0x10, 0x14, 0x20, 0x24))
EXTI_IMR, EXTI_RTSR = 0x4001_0400, 0x4001_0408
VECTKEY = 0x05FA_0000
HANDLERS = "b stop\none: log #1\nbx lr\ntwo: log #2\nbx lr\n"
VECTORS: dict[int, str | int] = {16 + 6: "one", 16 + 7: "two"}


@NVIC.row(
    "enable-first",
    "A pending interrupt is not taken until its bit of ISER is set; it waits for that.",
    HAL("cortex", 179),
    CMSIS("core_cm3", 1547),
    arm("B3.4"),
)
def _(_: Bench) -> None:
    source = store(ISPR, 1 << 6) + "log #5\n" + store(ISER, 1 << 6) + "isb\nlog #6\n" + HANDLERS
    assert program(source, VECTORS).log == [5, 1, 6]


@NVIC.row(
    "disable-by-icer",
    "ISER and ICER act where 1 is written; a 0 changes nothing.",
    CMSIS("core_cm3", 1547),
    arm("B3.4.4"),
)
def _(_: Bench) -> None:
    source = store(ISER, 0xC0) + store(ISER, 0) + load(ISER) + store(ICER, 0x40) + load(ISER) + load(ICER)
    assert program(source).log == [0xC0, 0x80, 0x80]


@NVIC.row(
    "pending-cleared",
    "ICPR takes a request back before it is taken; one that was taken is not pending any more.",
    CMSIS("core_cm3", 1637),
    arm("B3.4.7"),
)
def _(_: Bench) -> None:
    source = store(ISPR, 0xC0) + store(ICPR, 0x40) + store(ISER, 0xC0) + "isb\n" + load(ISPR) + HANDLERS
    assert program(source, VECTORS).log == [2, 0]


@NVIC.row(
    "lower-is-first",
    "Of pending interrupts the lower number of priority goes first, of equals the lower interrupt.",
    HAL("cortex", 158),
    arm("B1.5.4"),
    values=st.sampled_from([(0x10, 0x20), (0x20, 0x10), (0x10, 0x10)]),
)
def _(_: Bench, priorities: tuple[int, int]) -> None:
    six, seven = priorities
    source = (
        "cpsid i\n" + store(IPR + 4, six << 16 | seven << 24) + store(ISER, 0xC0) + store(ISPR, 0xC0) + "cpsie i\nisb\n"
    )
    assert program(source + HANDLERS, VECTORS).log == ([2, 1] if seven < six else [1, 2])


@NVIC.row(
    "four-bits",
    "A priority has its upper four bits only; the lower ones read 0.",
    LOCM3_CORE("nvic", 134),
    arm("B3.4.9"),
)
def _(_: Bench) -> None:
    assert program(store(IPR, 0x12_3F_0F_FF) + load(IPR)).log == [0x1030_00F0]


@NVIC.row(
    "group-before-priorities",
    "PRIGROUP says how much of a priority preempts: with group 7 none does, and it is set before priorities are.",
    HAL("cortex", 138),
    HAL("cortex", 179),
    LOCM3_CORE("nvic", 136),
    arm("B1.5.4"),
    values=st.sampled_from([3, 7]),
)
def _(_: Bench, group: int) -> None:
    handlers = f"b stop\none: log #1\n{store(ISPR, 1 << 7)}isb\nlog #3\nbx lr\ntwo: log #2\nbx lr\n"
    source = store(AIRCR, VECTKEY | group << 8) + store(IPR + 4, 0x1020_0000) + store(ISER, 0xC0)
    log = program(source + store(ISPR, 1 << 6) + "isb\n" + handlers, VECTORS).log
    assert log == ([1, 2, 3] if group == 3 else [1, 3, 2])


@NVIC.row(
    "active-until-return",
    "IABR is 1 from the entry of a handler to its return.",
    arm("B3.4.8"),
    CMSIS("core_cm3", 1654),
)
def _(_: Bench) -> None:
    handlers = f"b stop\none: {load(IABR)}bx lr\n"
    source = store(ISER, 1 << 6) + load(IABR) + store(ISPR, 1 << 6) + "isb\n" + load(IABR) + handlers
    assert program(source, {22: "one"}).log == [0, 1 << 6, 0]


@NVIC.row(
    "basepri-holds",
    "BASEPRI holds back its own priority and all below it until it is 0 again.",
    arm("B1.4.3"),
)
def _(_: Bench) -> None:
    source = store(IPR + 4, 0x1020_0000) + store(ISER, 0xC0) + "movs r1, #32\nmsr basepri, r1\n" + store(ISPR, 0xC0)
    source += "isb\nlog #5\nmovs r1, #0\nmsr basepri, r1\nisb\nlog #6\n"
    assert program(source + HANDLERS, VECTORS).log == [2, 5, 1, 6]


@SYSTICK.row(
    "clear-before-enable",
    "VAL is cleared, by a write of anything, after LOAD and before ENABLE: counting then begins at LOAD.",
    LOCM3_CORE("systick", 49),
    CMSIS("core_cm3", 1879),
    arm("B3.3.5"),
)
def _(_: Bench) -> None:
    source = store(LOAD, 0xFFFF) + store(VAL, 0x1234) + load(VAL) + store(CTRL, 5) + load(VAL) + load(CTRL)
    first, later, control = program(source).log
    assert (first, control) == (0, 5)
    assert 0xFF00 < later <= 0xFFFF


@SYSTICK.row(
    "reload-plus-one",
    "Ticks come each LOAD + 1 cycles: a driver writes one less.",
    CMSIS("core_cm3", 1877),
    arm("B3.3.4"),
    values=st.integers(199, 2_000),
)
def _(_: Bench, reload: int) -> None:
    source = store(LOAD, reload) + store(VAL, 0) + store(CTRL, 7) + "here: b here\ntick: log #1\nbx lr"
    machine = Machine(source, {15: "tick"}).run(1_000)
    before = len(machine.log)
    machine.run(125 * (reload + 1) * 10 / 1_000)
    assert len(machine.log) - before == 10


@SYSTICK.row(
    "countflag-by-read",
    "COUNTFLAG rises at 0 and is cleared by a read of CTRL, or by a write of VAL.",
    arm("B3.3.3"),
)
def _(_: Bench) -> None:
    wait = "movs r3, #100\n{0}: subs r3, #1\nbne {0}\n"
    source = store(LOAD, 99) + store(VAL, 0) + store(CTRL, 5) + wait.format("x") + load(CTRL)
    source += store(LOAD, 0xFFFFFF) + store(VAL, 0) + load(CTRL)
    log = program(source).log
    assert log == [0x1_0005, 5]


@SYSTICK.row(
    "write-makes-no-tick",
    "A write of VAL makes no tick: one comes only where counting goes from 1 to 0.",
    RUST("timer", 279),
    arm("B3.3.5"),
)
def _(_: Bench) -> None:
    source = store(LOAD, 0xFFFF) + store(CTRL, 7) + store(VAL, 0) * 5 + "isb\n" + load(ICSR)
    (state,) = program(source + "b stop\ntick: log #9\nbx lr", {15: "tick"}).log
    assert not state & 1 << 26


@SYSTICK.row(
    "tickint-for-exception",
    "Without TICKINT it counts and makes no exception.",
    CMSIS("core_cm3", 1881),
    arm("B3.3.3"),
)
def _(_: Bench) -> None:
    wait = "movs r3, #100\nx: subs r3, #1\nbne x\n"
    for control, log in ((5, []), (7, [9])):
        source = store(LOAD, 0xFFFFFF) + store(VAL, 0) + store(LOAD, 60) + store(VAL, 0) + store(CTRL, control) + wait
        source += store(CTRL, 0) + "b stop\ntick: log #9\nbx lr"
        assert program(source, {15: "tick"}).log[:1] == log


@SCB.row(
    "key-first",
    "AIRCR takes a write only with its key in the upper half.",
    CMSIS("core_cm3", 1519),
    arm("B3.2.6"),
    values=st.integers(0, 0xFFFF).filter(lambda key: key != 0x5FA),
)
def _(_: Bench, key: int) -> None:
    source = store(AIRCR, key << 16 | 0x300) + load(AIRCR) + store(AIRCR, VECTKEY | 0x300) + load(AIRCR)
    assert program(source).log == [0xFA05_0000, 0xFA05_0300]


@SCB.row(
    "reset-request",
    "SYSRESETREQ with the key resets the chip; stores before it are done.",
    CMSIS("core_cm3", 1800),
    HAL("flash", 740),
    arm("B3.2.6"),
)
def _(_: Bench) -> None:
    source = store(0x2000_0040, 77) + store(AIRCR, VECTKEY | 4) + "here: b here"
    machine = Machine(source, {})
    resets = machine.board.chip.resets
    machine.run(3)
    assert machine.board.chip.resets > resets
    assert machine.board.read_memory(0x2000_0040, 4) == b"\x4d\0\0\0"
    assert machine.board.registers("RCC")["CSR"]["SFTRSTF"] == 1


@SCB.row(
    "vtor-before-vectors",
    "VTOR is moved to SRAM, with the vectors there, before a vector is replaced; it counts for the next exception.",
    CMSIS("core_cm3", 1765),
    arm("B3.2.5"),
)
def _(_: Bench) -> None:
    source = "mov32 r1, #0x20001000\nmov32 r2, #two+1\nstr r2, [r1, #56]\n" + store(ICSR, 1 << 28) + "nop\n"
    source += store(VTOR, 0x2000_1000) + load(VTOR) + store(ICSR, 1 << 28) + "isb\n" + HANDLERS
    assert program(source, {14: "one"}).log == [1, 0x2000_1000 & 0xFFFF_FFFF, 2]


@SCB.row(
    "pendsv-last",
    "PendSV of the lowest priority runs behind every interrupt that is pending with it.",
    arm("B1.5.4"),
    HAL("cortex", 158),
)
def _(_: Bench) -> None:
    source = "cpsid i\n" + store(SHPR3, 0xF0 << 16) + store(ISER, 1 << 6) + store(ICSR, 1 << 28)
    source += store(ISPR, 1 << 6) + "cpsie i\nisb\nlog #6\n" + HANDLERS
    assert program(source, {22: "one", 14: "two"}).log == [1, 2, 6]


@SCB.row(
    "event-noted",
    "A SEV before WFE is noted, and that WFE goes on at once; the next one waits.",
    HAL("pwr", 486),
    arm("B1.5.18"),
)
def _(_: Bench) -> None:
    machine = Machine("sev\nwfe\nlog #1\nwfe\nlog #2\nb stop", {}).run(100)
    assert machine.log == [1]
    assert machine.board.is_asleep


@SCB.row(
    "sleep-on-exit",
    "With SLEEPONEXIT the core sleeps again behind each handler; the program goes on only when that is cleared.",
    HAL("pwr", 522),
    HAL("pwr", 537),
    arm("B3.2.7"),
)
def _(_: Bench) -> None:
    ticks = store(LOAD, 799) + store(VAL, 0) + store(CTRL, 7)
    handler = f"tick: log #1\nadds r6, #1\ncmp r6, #3\nbcc over\n{store(SCR, 0)}over: bx lr"
    source = f"movs r6, #0\n{store(SCR, 2)}{ticks}wfi\n{store(CTRL, 0)}log #2\nb stop\n{handler}"
    machine = Machine(source, {15: "tick"}).run(250)
    assert machine.log == [1, 1]
    assert machine.run(300).log == [1, 1, 1, 2]


@SCB.row(
    "sevonpend",
    "With SEVONPEND an interrupt that becomes pending ends WFE, even one that is disabled.",
    HAL("pwr", 562),
    arm("B3.2.7"),
)
def _(_: Bench) -> None:
    for control, log in ((0, []), (1 << 4, [1])):
        line = store(EXTI_RTSR, 1) + store(EXTI_IMR, 1)
        machine = Machine(line + store(SCR, control) + "wfe\nlog #1\nb stop", {}).run(100)
        assert machine.board.is_asleep
        machine.board.pin("PA0").drive(True)
        assert machine.run(100).log == log


@SCB.row(
    "faults-enabled-first",
    "A UsageFault is a HardFault until USGFAULTENA of SHCSR is set.",
    HAL("cortex", 286),
    arm("B1.5.2"),
)
def _(_: Bench) -> None:
    skip = "ldr r0, [sp, #24]\nadds r0, #2\nstr r0, [sp, #24]\nbx lr\n"
    handlers = f"b stop\nhard: log #3\n{skip}usage: log #6\n{skip}"
    source = "udf\n" + store(SHCSR, 1 << 18) + "udf\n" + handlers
    assert program(source, {3: "hard", 6: "usage"}).log == [3, 6]


@SCB.row(
    "cyccnt-after-trcena",
    "CYCCNT counts only with TRCENA set before CYCCNTENA is.",
    LOCM3_CORE("dwt", 63),
    LOCM3_CORE("dwt", 83),
    arm("C1.6.5"),
)
def _(_: Bench) -> None:
    count, control, demcr = 0xE000_1004, 0xE000_1000, 0xE000_EDFC
    source = store(control, 1) + load(count) + store(demcr, 1 << 24) + store(control, 1) + load(count) + load(count)
    first, second, third = program(source).log
    assert first == 0
    assert third > second
