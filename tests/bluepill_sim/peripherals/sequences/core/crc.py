"""CRC: the unit is reset before a new value is begun."""

from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.sequences.bench import Bench
from tests.bluepill_sim.peripherals.sequences.row import Sequences
from tests.bluepill_sim.peripherals.sequences.sources import HAL, RUST, rm

CRC = Sequences("CRC")
_POLYNOMIAL = 0x04C1_1DB7


def crc_of(*words: int, crc: int = 0xFFFF_FFFF) -> int:
    """The manual's way, bit by bit."""
    for word in words:
        crc ^= word
        for _ in range(32):
            crc = (crc << 1 ^ (_POLYNOMIAL if crc >> 31 else 0)) & 0xFFFF_FFFF
    return crc


@CRC.row("clock-first", "CRC reads 0 and takes nothing until its AHB clock is on.", rm("7.3.6"))
def _(chip: Bench) -> None:
    chip["CRC.DR"] = 5
    assert chip["CRC.DR"] == 0
    chip.clock("CRC")
    assert chip["CRC.DR"] == 0xFFFF_FFFF


@CRC.row(
    "goes-on",
    "A word goes on from what stands in DR: without a RESET the next value is that of both.",
    HAL("crc", 221),
    rm("4.3"),
    values=st.integers(0, 0xFFFF_FFFF),
)
def _(chip: Bench, word: int) -> None:
    chip.clock("CRC")
    chip["CRC.DR"] = 0x1234_5678
    chip["CRC.DR"] = word
    assert chip["CRC.DR"] == crc_of(0x1234_5678, word)


@CRC.row(
    "reset-first",
    "RESET takes DR to 0xFFFFFFFF, so that a new value is independent; it reads 0 and leaves IDR.",
    HAL("crc", 265),
    RUST("crc", 36),
    rm("4.4.3"),
)
def _(chip: Bench) -> None:
    chip.clock("CRC")
    chip["CRC.DR"], chip["CRC.IDR"] = 5, 0x7E
    chip["CRC.CR"] = 0
    assert chip["CRC.DR"] == crc_of(5)
    chip["CRC.CR"] = 1
    assert (chip["CRC.DR"], chip["CRC.IDR"], chip["CRC.CR"]) == (0xFFFF_FFFF, 0x7E, 0)


@CRC.row(
    "read-is-result",
    "DR reads the result, not the word that was written, as often as it is read.",
    HAL("crc", 240),
    rm("4.3"),
)
def _(chip: Bench) -> None:
    chip.clock("CRC")
    chip["CRC.DR"] = 0
    assert chip["CRC.DR"] == chip["CRC.DR"] == crc_of(0)


@CRC.row("idr-apart", "IDR holds eight bits for the program and has no part in a value.", rm("4.4.2"))
def _(chip: Bench) -> None:
    chip.clock("CRC")
    chip["CRC.IDR"] = 0x1FF
    assert (chip["CRC.IDR"], chip["CRC.DR"]) == (0xFF, 0xFFFF_FFFF)


CRC.not_modelled(
    "nop-behind-reset",
    "A word right behind RESET does not count unless something stands between.",
    RUST("crc", 37),
    why="RESET acts at once; the manual knows of no delay",
)
