"""SPI: the order of DR, SR, CR1 and the select pin."""

from hypothesis import strategies as st

from bluepill_sim.peripherals.spi import Loopback
from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import (
    HAL,
    HAL_H,
    KLIPPER,
    LOCM3,
    LOCM3_H,
    RIOT,
    RUST,
    RUST_PAC,
    rm,
)

SPI = Sequences("SPI")
#: 8 MHz / 2: a bit takes 250 ns, a word of eight 2 us.
WORD_NS = 2_000
SPE, MSTR, SSI, SSM = 1 << 6, 1 << 2, 1 << 8, 1 << 9
MASTER = SPE | MSTR | SSI | SSM
IRQ = 35


def set_up(chip: Bench, control: int = MASTER, *, looped: bool = True) -> list[int]:
    """SPI1 at PA5 to PA7; returns the words that go out."""
    chip.clock("GPIOA", "SPI1")
    chip["GPIOA.CRL"] = 0xB4B4_4444
    sent: list[int] = []
    part = chip.parts.by_name["SPI1"]
    part.subscribe(lambda rows: sent.extend(row[1] for row in rows))
    if looped:
        part.attach(Loopback())
    chip["SPI1.CR1"] = control
    return sent


def flags(chip: Bench) -> int:
    """Return SR without reading it."""
    return int(chip.parts.by_name["SPI1"].words[2])


@SPI.row("after-reset", "After a reset SR is TXE alone, and CRCPR is 7.", rm("25.5.3"), rm("25.5.5"))
def _(chip: Bench) -> None:
    chip.clock("SPI1")
    assert (chip["SPI1.SR"], chip["SPI1.CRCPR"]) == (2, 7)


@SPI.row(
    "spe-first",
    "DR that is written before SPE is set waits, and goes out when it is.",
    HAL("spi", 853),
    rm("25.3.3"),
    choice="a master begins with the word that it has once it is enabled",
)
def _(chip: Bench) -> None:
    sent = set_up(chip, MASTER & ~SPE)
    chip["SPI1.DR"] = 0x12
    chip.run(10 * WORD_NS)
    chip.deliver()
    assert sent == []
    chip["SPI1.CR1.SPE"] = 1
    chip.run(2 * WORD_NS)
    assert sent[:1] == [0x12]


@SPI.row(
    "remap-moves",
    "A remapped SPI1 leaves PA5 to PA7 and has PB3 to PB5.",
    LOCM3_H("stm32/f1/gpio", 454),
    rm("9.3.10", looked_up=False),
    values=st.integers(0, 1),
)
def _(chip: Bench, is_remapped: int) -> None:
    chip.clock("AFIO", "GPIOA", "GPIOB", "SPI1")
    chip["AFIO.MAPR"] = 2 << 24 | is_remapped
    chip["GPIOA.CRL"] = 0xB4B4_4444
    chip["GPIOB.CRL"] = 0x44B4_B444
    chip["SPI1.CR1"] = MASTER | 1 << 1
    assert (chip.level("PA5"), chip.level("PB3")) == (not is_remapped, bool(is_remapped))


@SPI.row(
    "crc-read-only",
    "RXCRCR and TXCRCR are read only.",
    RUST_PAC("spi1/rxcrcr", 29),
    rm("25.5.6", looked_up=False),
    rm("25.5.7", looked_up=False),
    values=st.integers(1, 0xFFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("SPI1")
    chip["SPI1.RXCRCR"], chip["SPI1.TXCRCR"] = word, word
    assert (chip["SPI1.RXCRCR"], chip["SPI1.TXCRCR"]) == (0, 0)


@SPI.row(
    "txe-before-rxne",
    "TXE rises when a word begins, RXNE when it has ended: both are waited for before the next is read.",
    RIOT("spi", 545),
    LOCM3("common/spi_common_all", 149),
    rm("25.3.5"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["SPI1.DR"] = 0x9F
    assert flags(chip) & 0x83 == 0x82
    chip["SPI1.DR"] = 0x9E
    assert flags(chip) & 0x83 == 0x80
    chip.run(WORD_NS - 1)
    assert flags(chip) & 0x83 == 0x80
    chip.run(1)
    assert flags(chip) & 0x83 == 0x83


@SPI.row(
    "bsy-last",
    "BSY falls after TXE has risen for the last time: a select is let go, or SPE cleared, only after both.",
    KLIPPER("spi", 370),
    RUST("spi", 565),
    RIOT("spi", 552),
    LOCM3("common/spi_common_all", 114),
    rm("25.3.8"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["SPI1.DR"] = 1
    assert flags(chip) & 0x82 == 0x82
    chip.run(WORD_NS - 1)
    assert flags(chip) & 0x80
    chip.run(1)
    assert not flags(chip) & 0x80


@SPI.row(
    "rxne-by-dr",
    "RXNE is cleared by a read of DR, which has the word that came in; so a driver empties DR before it goes on.",
    RIOT("spi", 556),
    LOCM3("common/spi_common_all", 106),
    rm("25.5.3"),
    values=st.integers(0, 255),
)
def _(chip: Bench, byte: int) -> None:
    set_up(chip)
    chip["SPI1.DR"] = byte
    chip.run(WORD_NS)
    assert flags(chip) & 1
    assert (chip["SPI1.DR"], flags(chip) & 1) == (byte, 0)


@SPI.row(
    "ovr-dr-then-sr",
    "A second word while RXNE stands is lost: OVR, cleared by a read of DR and then of SR, in this order.",
    RUST("spi", 567),
    HAL_H("spi", 426),
    HAL("spi", 932),
    rm("25.3.10"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    for word in (1, 2):
        chip["SPI1.DR"] = word
        chip.run(WORD_NS)
    assert flags(chip) & 0x40
    _sr = chip["SPI1.SR"]
    assert flags(chip) & 0x40
    assert chip["SPI1.DR"] == 1
    assert flags(chip) & 0x40
    _sr = chip["SPI1.SR"]
    assert not flags(chip) & 0x40


@SPI.row(
    "mode-fault",
    "A master whose NSS is low loses MSTR and SPE: MODF, cleared by a read of SR and then a write of CR1.",
    HAL_H("spi", 413),
    LOCM3("common/spi_common_all", 593),
    rm("25.3.10"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["SPI1.CR1"] = MASTER & ~SSI
    assert (chip["SPI1.CR1"] & (SPE | MSTR), flags(chip) & 0x20) == (0, 0x20)
    chip["SPI1.CR1"] = MASTER
    assert flags(chip) & 0x20
    _sr = chip["SPI1.SR"]
    chip["SPI1.CR1"] = MASTER
    assert not flags(chip) & 0x20
    chip["SPI1.CR1"] = MASTER
    assert chip["SPI1.CR1"] & (SPE | MSTR) == SPE | MSTR


@SPI.row(
    "ssi-before-master",
    "With SSM a master sets SSI before MSTR and SPE, or with them, else a mode fault is there at once.",
    LOCM3("common/spi_common_all", 364),
    rm("25.3.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, SSM | SSI)
    chip["SPI1.CR1"] = MASTER
    assert not flags(chip) & 0x20
    chip["SPI1.CR1"] = 0
    chip["SPI1.CR1"] = SPE | MSTR | SSM
    assert flags(chip) & 0x20


@SPI.row(
    "ssoe-no-fault",
    "With SSOE a master drives NSS low while SPE is set, and has no mode fault.",
    LOCM3("common/spi_common_all", 579),
    rm("25.3.1"),
)
def _(chip: Bench) -> None:
    set_up(chip, 0)
    chip["GPIOA.CRL"] = 0xB4BB_4444
    chip["SPI1.CR2"] = 4
    chip["SPI1.CR1"] = SPE | MSTR
    assert (chip.level("PA4"), chip["SPI1.CR1"], flags(chip)) == (False, SPE | MSTR, 2)


@SPI.row(
    "idle-level-first",
    "SCK has the level of CPOL from the moment when SPE is set; the mode is changed with SPE 0.",
    KLIPPER("spi", 334),
    rm("25.3.3"),
    values=st.integers(0, 1),
)
def _(chip: Bench, cpol: int) -> None:
    set_up(chip, MASTER | cpol << 1)
    assert chip.level("PA5") is bool(cpol)
    chip["SPI1.CR1"] = MASTER & ~SPE | (1 - cpol) << 1
    chip["SPI1.CR1.SPE"] = 1
    assert chip.level("PA5") is not bool(cpol)


@SPI.row(
    "crcnext-before-last",
    "CRCNEXT is set after the last word was written and before it has gone: the CRC follows, and the bit falls.",
    LOCM3("common/spi_common_all", 299),
    HAL("spi", 1085),
    rm("25.3.6"),
)
def _(chip: Bench) -> None:
    sent = set_up(chip, MASTER | 1 << 13)
    chip["SPI1.DR"] = 0x31
    chip["SPI1.CR1.CRCNEXT"] = 1
    chip.run(WORD_NS)
    assert chip["SPI1.CR1.CRCNEXT"] == 1
    chip.run(WORD_NS)
    chip.deliver()
    assert (len(sent), chip["SPI1.CR1.CRCNEXT"]) == (2, 0)


@SPI.row(
    "crc-restarts",
    "The CRC registers begin anew only when CRCEN goes from 0 to 1 while SPE is 0.",
    HAL("spi", 1006),
    rm("25.3.6"),
)
def _(chip: Bench) -> None:
    set_up(chip, MASTER | 1 << 13)
    chip["SPI1.DR"] = 0x31
    chip.run(WORD_NS)
    crc = chip["SPI1.TXCRCR"]
    assert crc != 0
    chip["SPI1.CR1.SPE"] = 0
    chip["SPI1.CR1.SPE"] = 1
    assert chip["SPI1.TXCRCR"] == crc
    chip["SPI1.CR1"] = MASTER & ~SPE
    chip["SPI1.CR1"] = MASTER & ~SPE | 1 << 13
    assert chip["SPI1.TXCRCR"] == 0


@SPI.row(
    "crcerr-by-zero",
    "CRCERR rises where the CRC that came in is another, and is cleared by writing 0.",
    HAL_H("spi", 406),
    rm("25.5.3"),
)
def _(chip: Bench) -> None:
    set_up(chip, MASTER | 1 << 13, looped=False)
    chip.drive("PA6", True)
    chip["SPI1.DR"] = 0x31
    chip["SPI1.CR1.CRCNEXT"] = 1
    chip.run(2 * WORD_NS)
    assert flags(chip) & 0x10
    chip["SPI1.SR"] = 0x10
    assert flags(chip) & 0x10
    chip["SPI1.SR"] = 0
    assert not flags(chip) & 0x10


@SPI.row(
    "receive-only-clocks",
    "A master that only receives clocks from SPE on, word after word, until SPE is cleared.",
    HAL("spi", 66),
    rm("25.3.8"),
)
def _(chip: Bench) -> None:
    set_up(chip, MASTER & ~SPE | 1 << 10)
    chip["SPI1.CR1.SPE"] = 1
    for _ in range(3):
        chip.run(WORD_NS)
        assert flags(chip) & 1
        _dr = chip["SPI1.DR"]
    chip["SPI1.CR1.SPE"] = 0
    chip.run(WORD_NS)
    _dr = chip["SPI1.DR"]
    chip.run(5 * WORD_NS)
    assert not flags(chip) & 1


@SPI.row(
    "one-wire-direction",
    "On one wire BIDIOE says whether DR goes out; its direction is set with SPE 0.",
    HAL("spi", 837),
    rm("25.3.4"),
)
def _(chip: Bench) -> None:
    sent = set_up(chip, MASTER | 1 << 15 | 1 << 14, looped=False)
    chip["SPI1.DR"] = 0x5A
    chip.run(2 * WORD_NS)
    chip.deliver()
    assert (sent, flags(chip) & 1) == ([0x5A], 0)


@SPI.row(
    "spe-off-ends-word",
    "SPE that is cleared during a word lets the word end.",
    LOCM3("common/spi_common_all", 96),
    rm("25.3.8"),
    choice="the word under way goes on to its end; libopencm3 waits for that before it clears SPE",
)
def _(chip: Bench) -> None:
    sent = set_up(chip)
    chip["SPI1.DR"] = 0x77
    chip.run(WORD_NS // 2)
    chip["SPI1.CR1.SPE"] = 0
    chip.run(WORD_NS)
    chip.deliver()
    assert sent == [0x77]


@SPI.row(
    "error-interrupt",
    "ERRIE interrupts for OVR, MODF and CRCERR, TXEIE while TXE stands, RXNEIE while RXNE does.",
    RUST("spi", 598),
    rm("25.3.11"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip["SPI1.CR2"] = 1 << 7
    assert chip.irqs[IRQ]
    chip["SPI1.CR2"] = 1 << 6
    assert not chip.irqs[IRQ]
    chip["SPI1.DR"] = 1
    chip.run(WORD_NS)
    assert chip.irqs[IRQ]
    chip["SPI1.CR2"] = 1 << 5
    assert not chip.irqs[IRQ]
    chip["SPI1.DR"] = 1
    chip.run(WORD_NS)
    assert chip.irqs[IRQ]


@SPI.row(
    "dma-requests",
    "RXDMAEN asks while RXNE stands, TXDMAEN while TXE does; the receiving channel is on before the sending one.",
    RIOT("spi", 449),
    rm("25.3.9"),
)
def _(chip: Bench) -> None:
    set_up(chip)
    chip.clock("DMA1")
    chip.put(0x2000_0000, b"abcd")
    for n, memory, control in ((2, 0x2000_0010, 0x81), (3, 0x2000_0000, 0x91)):
        chip[f"DMA1.CPAR{n}"] = 0x4001_300C
        chip[f"DMA1.CMAR{n}"] = memory
        chip[f"DMA1.CNDTR{n}"] = 4
        chip[f"DMA1.CCR{n}"] = control
    chip["SPI1.CR2"] = 1
    chip.run(WORD_NS)
    assert chip["DMA1.CNDTR2"] == 4
    chip["SPI1.CR2"] = 3
    chip.run(6 * WORD_NS)
    assert chip.got(0x2000_0010, 4) == b"abcd"


SPI.not_modelled(
    "i2s",
    "I2SE is set only after I2SMOD and the rest of I2SCFGR.",
    rm("25.5.8"),
    why="this part has no I2S: its registers read 0, and I2SMOD is warned of",
)
SPI.not_modelled(
    "crc-after-dma",
    "With CRCEN the CRC goes out by itself behind the last word that DMA brings.",
    rm("25.3.9"),
    HAL("spi", 61),
    why="CRCNEXT has to be set, as peripherals.md says",
)
