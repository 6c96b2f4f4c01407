"""EXTI: from the edge that was chosen to the flag that software clears."""

from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.sequences.bench import Bench, program, store
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, LOCM3, RIOT, ours, rm

EXTI = Sequences("EXTI")


def listen(chip: Bench, line: int, rising: int = 1, falling: int = 0) -> None:
    chip["EXTI.RTSR"] = rising << line
    chip["EXTI.FTSR"] = falling << line
    chip["EXTI.IMR"] = 1 << line


@EXTI.row(
    "edge-first",
    "No edge counts until RTSR or FTSR has chosen it, for one line both if both are set.",
    HAL("exti", 57),
    LOCM3("common/exti_common_all", 45),
    rm("10.2.1"),
    values=st.integers(0, 3),
)
def _(chip: Bench, edges: int) -> None:
    listen(chip, 1, edges & 1, edges >> 1)
    chip.drive("PA1", True)
    assert chip["EXTI.PR"] == (2 if edges & 1 else 0)
    chip["EXTI.PR"] = 2
    chip.drive("PA1", False)
    assert chip["EXTI.PR"] == (2 if edges & 2 else 0)


@EXTI.row(
    "cleared-by-1",
    "A pending bit stands until 1 is written to it; 0 leaves it.",
    LOCM3("common/exti_common_all", 82),
    RIOT("gpio_f1", 245),
    HAL("exti", 513),
    rm("10.3.6"),
)
def _(chip: Bench) -> None:
    listen(chip, 0)
    chip["EXTI.RTSR"] = 0x21
    chip.drive("PA0", True)
    chip.drive("PA5", True)
    chip.drive("PA0", False)
    chip["EXTI.PR"] = 0
    assert (chip["EXTI.PR"], chip.irqs[6]) == (0x21, True)
    chip["EXTI.PR"] = 1
    assert (chip["EXTI.PR"], chip.irqs[6]) == (0x20, False)


@EXTI.row(
    "pending-while-masked",
    "PR is set by an edge of a masked line too; the interrupt comes when IMR lets it through.",
    RIOT("gpio_f1", 248),
    rm("10.2.1"),
    ours("EXTI"),
    choice="RIOT filters what it reads of PR by IMR, which is of use only so; ST's diagram agrees",
)
def _(chip: Bench) -> None:
    chip["EXTI.RTSR"] = 1 << 3
    chip.drive("PA3", True)
    assert (chip["EXTI.PR"], chip.irqs[9]) == (1 << 3, False)
    chip["EXTI.IMR"] = 1 << 3
    assert chip.irqs[9]


@EXTI.row(
    "mask-holds-back",
    "An interrupt of EXTI stands only while its line is pending and unmasked.",
    RIOT("gpio_f1", 226),
    rm("10.3.1"),
    values=st.sampled_from([(0, 6), (4, 10), (5, 23), (9, 23), (10, 40), (15, 40)]),
)
def _(chip: Bench, line: tuple[int, int]) -> None:
    number, irq = line
    chip.clock("AFIO")
    chip["AFIO.MAPR"] = 4 << 24
    listen(chip, number)
    chip.drive(f"PA{number}", True)
    assert [n for n, level in chip.irqs.items() if level] == [irq]
    chip["EXTI.IMR"] = 0
    assert not chip.irqs[irq]


@EXTI.row(
    "port-by-exticr",
    "Line n is the pin n of one port alone, that which EXTICR names.",
    HAL("exti", 45),
    HAL("gpio", 292),
    rm("9.4.3"),
    values=st.integers(5, 12),
)
def _(chip: Bench, line: int) -> None:
    chip.clock("AFIO")
    listen(chip, line)
    chip[f"AFIO.EXTICR{line // 4 + 1}"] = 1 << 4 * (line % 4)
    chip.drive(f"PA{line}", True)
    assert chip["EXTI.PR"] == 0
    chip.drive(f"PB{line}", True)
    assert chip["EXTI.PR"] == 1 << line


@EXTI.row(
    "software-unmasked",
    "A software request makes its line pending only if IMR has it.",
    HAL("exti", 533),
    rm("10.3.5"),
    values=st.integers(0, 18),
)
def _(chip: Bench, line: int) -> None:
    chip["EXTI.SWIER"] = 1 << line
    assert chip["EXTI.PR"] == 0
    chip["EXTI.PR"] = 1 << line
    chip["EXTI.IMR"] = 1 << line
    chip["EXTI.SWIER"] = 1 << line
    assert chip["EXTI.PR"] == 1 << line


@EXTI.row(
    "software-again",
    "A bit of SWIER asks once; it is cleared by its bit of PR, and can ask again then.",
    rm("10.3.5"),
)
def _(chip: Bench) -> None:
    chip["EXTI.IMR"] = 4
    chip["EXTI.SWIER"] = 4
    assert (chip["EXTI.SWIER"], chip["EXTI.PR"], chip.irqs[8]) == (4, 4, True)
    chip["EXTI.PR"] = 4
    assert (chip["EXTI.SWIER"], chip["EXTI.PR"], chip.irqs[8]) == (0, 0, False)
    chip["EXTI.SWIER"] = 4
    assert chip["EXTI.PR"] == 4


@EXTI.row(
    "event-is-no-interrupt",
    "A line of EMR wakes by an event, at each of its edges, and makes no interrupt.",
    LOCM3("common/exti_common_all", 68),
    HAL("gpio", 73),
    rm("10.2.3"),
)
def _(chip: Bench) -> None:
    chip["EXTI.RTSR"] = 2
    chip.drive("PA1", True)
    assert chip.signals == []
    chip["EXTI.EMR"] = 2
    for level in (False, True):
        chip.drive("PA1", level)
    assert (chip.signals, chip.irqs[7]) == (["event"], False)


@EXTI.row(
    "no-edge-at-set-up",
    "To choose an edge on a pin that has that level already requests nothing.",
    rm("10.2.2"),
    ours("EXTI"),
)
def _(chip: Bench) -> None:
    chip.drive("PA7", True)
    listen(chip, 7, 1, 1)
    assert chip["EXTI.PR"] == 0
    chip.drive("PA7", False)
    assert chip["EXTI.PR"] == 1 << 7


@EXTI.row(
    "edge-without-clock",
    "An edge is seen without any clock of GPIO or AFIO: EXTI works in Stop.",
    rm("10.2.3"),
)
def _(chip: Bench) -> None:
    listen(chip, 0)
    chip.drive("PA0", True)
    assert (chip["RCC.APB2ENR"], chip["EXTI.PR"]) == (0, 1)


@EXTI.row(
    "clear-in-handler",
    "A handler that does not clear PR is entered again at once.",
    RIOT("gpio_f1", 245),
    rm("10.3.6"),
)
def _(_: Bench) -> None:
    source = (
        store(0x4001_0400, 1)
        + store(0xE000_E100, 1 << 6)
        + store(0x4001_0410, 1)
        + """b stop
    handler: log #1
    mov32 r1, #0x40010414
    ldr r2, [r6, #0]
    adds r2, #1
    str r2, [r6, #0]
    cmp r2, #3
    bcc again
    movs r2, #1
    str r2, [r1, #0]
    again: bx lr"""
    )
    assert program("mov32 r6, #0x20000080\n" + source, {22: "handler"}).log == [1, 1, 1]
