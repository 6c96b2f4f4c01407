"""DMA1: what is set before EN, and which flag follows which transfer."""

from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.sequences.bench import CYCLE_NS, FLASH_SAMPLE, Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, LOCM3, RIOT, ours, rm

DMA = Sequences("DMA")
SRAM, FLASH = 0x2000_0000, 0x0800_0000
EN, TCIE, HTIE, TEIE, DIR, CIRC, PINC, MINC, MEM2MEM = (1 << n for n in (0, 1, 2, 3, 4, 5, 6, 7, 14))
COPY = EN | MEM2MEM | PINC | MINC
#: One byte from memory to memory: arbitration and two accesses.
BYTE_NS = 5 * CYCLE_NS


def set_up(
    chip: Bench, control: int, count: int = 4, channel: int = 1, source: int = FLASH, target: int = SRAM
) -> None:
    """Configure a channel; its control comes last."""
    chip.clock("DMA1")
    for name, value in (("CPAR", source), ("CMAR", target), ("CNDTR", count), ("CCR", control)):
        chip[f"DMA1.{name}{channel}"] = value


@DMA.row(
    "en-last",
    "Addresses and count are written before EN: memory to memory it begins with EN, and without a request.",
    HAL("dma", 35),
    rm("13.3.3"),
    values=st.integers(1, 40),
)
def _(chip: Bench, count: int) -> None:
    set_up(chip, COPY & ~EN, count)
    chip.run(1_000_000)
    assert chip.got(SRAM, 1) == b"\0"
    chip["DMA1.CCR1.EN"] = 1
    chip.run(count * BYTE_NS - 1)
    assert chip["DMA1.CNDTR1"] == 1
    chip.run(1)
    assert (chip["DMA1.CNDTR1"], chip.got(SRAM, count + 1)) == (0, FLASH_SAMPLE[:count] + b"\0")


@DMA.row(
    "locked-while-on",
    "CPAR, CMAR and CNDTR are not written while the channel is enabled.",
    LOCM3("common/dma_common_l1f013", 387),
    LOCM3("common/dma_common_l1f013", 437),
    RIOT("dma", 443),
    rm("13.4.4"),
    choice="such a write is ignored and warned of; libopencm3 guards the addresses and not the count",
)
def _(chip: Bench) -> None:
    set_up(chip, EN | MINC, 9)
    for name in ("CPAR1", "CMAR1", "CNDTR1"):
        before = chip[f"DMA1.{name}"]
        chip[f"DMA1.{name}"] = 0x44
        assert chip[f"DMA1.{name}"] == before
    chip["DMA1.CCR1"] = 0
    for name in ("CPAR1", "CMAR1", "CNDTR1"):
        chip[f"DMA1.{name}"] = 0x44
        assert chip[f"DMA1.{name}"] == 0x44


@DMA.row(
    "keeps-registers",
    "A channel that is disabled keeps its registers, and CNDTR what was left.",
    LOCM3("common/dma_common_l1f013", 369),
    rm("13.3.3"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 10)
    chip.run(4 * BYTE_NS)
    chip["DMA1.CCR1.EN"] = 0
    chip.run(100 * BYTE_NS)
    assert (chip["DMA1.CNDTR1"], chip["DMA1.CPAR1"], chip["DMA1.CMAR1"]) == (6, FLASH, SRAM)
    assert chip.got(SRAM, 5) == FLASH_SAMPLE[:4] + b"\0"


@DMA.row(
    "count-spent",
    "A channel that has counted down to 0 serves nothing until it is disabled, given a count, and enabled again.",
    LOCM3("common/dma_common_l1f013", 437),
    rm("13.3.3"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 2)
    chip.run(20 * BYTE_NS)
    assert chip["DMA1.CCR1.EN"]
    chip["DMA1.CNDTR1"] = 5
    chip.run(20 * BYTE_NS)
    assert (chip["DMA1.CNDTR1"], chip.got(SRAM, 3)) == (0, FLASH_SAMPLE[:2] + b"\0")
    chip["DMA1.CCR1"] = 0
    chip["DMA1.CNDTR1"] = 3
    chip["DMA1.CCR1"] = COPY
    chip.run(20 * BYTE_NS)
    assert chip.got(SRAM, 3) == FLASH_SAMPLE[:3]


@DMA.row(
    "zero-count",
    "With a count of 0 nothing is transferred, whatever asks.",
    rm("13.4.4"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 0)
    chip.run(20 * BYTE_NS)
    assert (chip["DMA1.ISR"], chip.got(SRAM, 4)) == (0, bytes(4))


@DMA.row(
    "half-then-complete",
    "HTIF rises at half of the count, TCIF at its end; GIF with either.",
    HAL("dma", 607),
    rm("13.4.1"),
    values=st.integers(1, 20),
)
def _(chip: Bench, half: int) -> None:
    set_up(chip, COPY, 2 * half)
    chip.run(half * BYTE_NS - 1)
    assert chip["DMA1.ISR"] == 0
    chip.run(1)
    assert chip["DMA1.ISR"] == 0b0101
    chip.run(half * BYTE_NS - 1)
    assert chip["DMA1.ISR"] == 0b0101
    chip.run(1)
    assert chip["DMA1.ISR"] == 0b0111


@DMA.row(
    "cleared-by-ifcr",
    "Flags stand until their bit of IFCR is written; ISR itself takes nothing.",
    HAL("dma", 616),
    rm("13.4.2"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 2)
    chip.run(10 * BYTE_NS)
    chip["DMA1.ISR"] = 0
    assert chip["DMA1.ISR"] == 0b0111
    chip["DMA1.IFCR"] = 0b0100
    assert chip["DMA1.ISR"] == 0b0011
    chip["DMA1.IFCR"] = 0b0010
    assert chip["DMA1.ISR"] == 0


@DMA.row(
    "gif-clears-all",
    "CGIF clears all flags of its channel, and of no other.",
    HAL("dma", 438),
    HAL("dma", 859),
    rm("13.4.2"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 2)
    set_up(chip, COPY, 2, channel=2, target=SRAM + 64)
    chip.run(20 * BYTE_NS)
    chip["DMA1.IFCR"] = 1
    assert chip["DMA1.ISR"] == 0b0111_0000


@DMA.row(
    "stale-flag",
    "A flag that was left is still there when a channel is enabled again: drivers clear it before.",
    HAL("dma", 859),
    rm("13.4.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 2)
    chip.run(10 * BYTE_NS)
    chip["DMA1.CCR1"] = 0
    chip["DMA1.CNDTR1"] = 2
    chip["DMA1.CCR1"] = COPY | TCIE
    assert (chip["DMA1.ISR"] & 2, chip.irqs[11]) == (2, True)
    chip["DMA1.IFCR"] = 0xF
    assert not chip.irqs[11]


@DMA.row(
    "circular-reloads",
    "With CIRC the count and both addresses begin anew behind the last transfer, and TCIF rises each time round.",
    LOCM3("common/dma_common_l1f013", 237),
    HAL("dma", 610),
    rm("13.3.3"),
)
def _(chip: Bench) -> None:
    chip.clock("TIM2")
    set_up(chip, EN | CIRC | MINC, 3, channel=2, source=0x4000_002C)
    for n, left in enumerate((2, 1, 3, 2, 1, 3)):
        chip["TIM2.ARR"] = 0x10 + n
        chip["TIM2.DIER"] = 1 << 8
        chip["TIM2.EGR"] = 1
        chip.run(2_000)
        assert chip["DMA1.CNDTR2"] == left
    assert chip.got(SRAM, 4) == bytes((0x13, 0x14, 0x15, 0))
    assert chip["DMA1.ISR"] == 0b0111 << 4


@DMA.row(
    "no-circular-copy",
    "Circular mode is not for memory to memory: that ends after its count.",
    LOCM3("common/dma_common_l1f013", 241),
    HAL("dma", 31),
    rm("13.3.3"),
    choice="MEM2MEM wins over CIRC, and is warned of",
)
def _(chip: Bench) -> None:
    set_up(chip, COPY | CIRC, 2)
    chip.run(100 * BYTE_NS)
    assert (chip["DMA1.CNDTR1"], chip.got(SRAM, 3)) == (0, FLASH_SAMPLE[:2] + b"\0")


@DMA.row(
    "error-disables",
    "An access that is no one's clears EN and raises TEIF; the interrupt comes only with TEIE.",
    HAL("dma", 653),
    HAL("dma", 541),
    rm("13.3.4"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 4, source=0x6000_0000)
    chip.run(20 * BYTE_NS)
    assert (chip["DMA1.CCR1.EN"], chip["DMA1.ISR"], chip.irqs[11]) == (0, 0b1001, False)
    chip["DMA1.CCR1"] = TEIE
    assert chip.irqs[11]


@DMA.row(
    "unclocked-peripheral",
    "The peripheral of a channel is clocked and set up before its channel is enabled.",
    HAL("dma", 16),
    ours("DMA1"),
    choice="without its clock the access is an error of the bus: TEIF",
)
def _(chip: Bench) -> None:
    set_up(chip, COPY, 1, source=0x4000_002C)
    chip.run(20 * BYTE_NS)
    assert chip["DMA1.ISR"] & 8
    chip["DMA1.IFCR"] = 0xF
    chip.clock("TIM2")
    set_up(chip, COPY, 1, source=0x4000_002C)
    chip.run(20 * BYTE_NS)
    assert (chip["DMA1.ISR"], chip.got(SRAM, 1)) == (0b0111, b"\xff")


@DMA.row(
    "dir-swaps",
    "DIR says which address is read: of 1 the memory's.",
    LOCM3("common/dma_common_l1f013", 255),
    rm("13.4.3"),
)
def _(chip: Bench) -> None:
    chip.put(SRAM + 32, b"xyz")
    set_up(chip, COPY | DIR, 3, source=SRAM, target=SRAM + 32)
    chip.run(20 * BYTE_NS)
    assert chip.got(SRAM, 4) == b"xyz\0"


@DMA.row(
    "priority-then-number",
    "Of channels that ask at once the one with the higher PL goes first, of equals the lower number.",
    rm("13.3.2"),
    HAL("dma", 23),
    values=st.integers(0, 3),
)
def _(chip: Bench, priority: int) -> None:
    set_up(chip, COPY | 1 << 12, 4, channel=1)
    set_up(chip, COPY | priority << 12, 4, channel=2, target=SRAM + 64)
    chip.run(5 * BYTE_NS)
    left = chip["DMA1.CNDTR1"], chip["DMA1.CNDTR2"]
    assert left == ((3, 0) if priority > 1 else (0, 3))


@DMA.row(
    "increments",
    "PINC and MINC let their address go on by their own width; without it stands.",
    LOCM3("common/dma_common_l1f013", 179),
    rm("13.4.3"),
    values=st.integers(0, 3),
)
def _(chip: Bench, increments: int) -> None:
    control = EN | MEM2MEM | (PINC if increments & 1 else 0) | (MINC if increments & 2 else 0)
    set_up(chip, control, 3, source=FLASH + 5)
    chip.run(20 * BYTE_NS)
    read = FLASH_SAMPLE[5:8] if increments & 1 else FLASH_SAMPLE[5:6] * 3
    assert chip.got(SRAM, 3) == (read if increments & 2 else read[-1:] + b"\0\0")


@DMA.row(
    "interrupt-per-flag",
    "HTIE and TCIE let their own flag interrupt, while it stands.",
    HAL("dma", 607),
    rm("13.3.6"),
)
def _(chip: Bench) -> None:
    set_up(chip, COPY | TCIE, 4)
    chip.run(2 * BYTE_NS)
    assert not chip.irqs[11]
    chip.run(2 * BYTE_NS)
    assert chip.irqs[11]
    chip["DMA1.CCR1"] = HTIE
    assert chip.irqs[11]
    chip["DMA1.IFCR"] = 4
    assert not chip.irqs[11]


DMA.not_modelled(
    "bus-share",
    "A transfer takes bus cycles from the core, half of them at most.",
    rm("13.3"),
    why="the core pays nothing for transfers: the bus matrix is not modelled",
)
