"""What drivers identify a part by: each part's identification and revision registers, as the part's own bus reads them.

The expected values are written here from the sources that the parts' modules name, not taken from the modules.
"""

import pytest

from bluepill_sim.parts import Mpu6050, SdCard, SpiFlash, Ssd1306
from bluepill_sim.parts.registry import PARTS

#: Parts that have no identification register: nothing on their pins, line or bus says what they are.
WITHOUT = frozenset(
    {"24c02", "button", "can-node", "gps", "hc-sr04", "leds", "potentiometer", "servo", "ws2812"}
)  # fmt: skip
#: The W25Q16JV's parameters: header, and the sixteen words at 0x80.
HEADER = "53464450 050100ff 00050110 800000ff"
WORDS = (
    "e520f9ff ffffff00 44eb086b 083b42bb feffffff ffff0000 ffff40eb 0c200f52"
    "10d80000 3602a600 82ea14b3 e9637633 7a757a75 f7bdd55c 19f75dff e930f880"
)
#: Part, what it is sent, how many bytes it sends before the answer, the answer.
SPI = [
    ("w25q16", "9f", 0, "ef4015"),
    ("w25q16", "90000000", 0, "ef14ef14"),
    ("w25q16", "90000001", 0, "14ef"),
    ("w25q16", "ab000000", 0, "1414"),
    ("w25q16", "4b", 4, "d1629c7803330a55"),
    ("w25q16", "5a000000", 1, HEADER),
    ("w25q16", "5a000080", 1, WORDS),
    ("w25q16", "5a0000fe", 1, "ffff5346"),
    ("w25q16", "05", 0, "0000"),
    ("w25q16", "35", 0, "0202"),
    ("w25q16", "15", 0, "6060"),
]
#: Part, the first register, what it and those behind it read.
I2C = [
    ("mpu6050", 0x06, "fb82025106980100"),
    ("mpu6050", 0x75, "6800"),
]


def flash_reads(sent: str, skipped: int, count: int) -> bytes:
    flash = SpiFlash()
    flash.select(0)
    for byte in bytes.fromhex(sent):
        flash.exchange(byte, 0)
    answer = bytes(flash.exchange(0, 0) for _ in range(skipped + count))
    flash.deselect(0)
    assert flash.ignored == 0
    return answer[skipped:]


def imu_reads(imu: Mpu6050, number: int, count: int) -> bytes:
    imu.start(0x68, False, 0)
    imu.write(number, 0)
    imu.start(0x68, True, 0)
    return bytes(imu.read(0) for _ in range(count))


def imu_writes(imu: Mpu6050, number: int, *data: int) -> None:
    imu.start(0x68, False, 0)
    for byte in (number, *data):
        imu.write(byte, 0)
    imu.stop(0)


def card_reads(command: int, count: int) -> bytes:
    """Start a card and return the data block that a command reads, without its CRC."""
    card = SdCard()
    at_ns = 0
    block = b""
    for number, argument in ((0, 0), (8, 0x1AA), (55, 0), (41, 1 << 30), (55, 0), (41, 1 << 30), (command, 0)):
        frame = bytes((0x40 | number, *argument.to_bytes(4, "big")))
        crc = {0: 0x95, 8: 0x87}.get(number, 0xFF)
        for byte in (*frame, crc):
            card.exchange(byte, at_ns)
        block = bytes(card.exchange(0xFF, at_ns) for _ in range(count + 20))
        at_ns += 3_000_000
    return block[block.index(0xFE) + 1 :][:count]


def test_each_part_says_who_it_is_or_has_nothing_that_could() -> None:
    identified = {row[0] for row in (*SPI, *I2C)} | {"sd-card", "ssd1306"}
    assert identified.isdisjoint(WITHOUT)
    assert identified | WITHOUT == set(PARTS), "a new part: a row here, or among those without"


@pytest.mark.parametrize(("part", "sent", "skipped", "answer"), SPI)
def test_identification_over_spi(part: str, sent: str, skipped: int, answer: str) -> None:
    expected = bytes.fromhex(answer)
    assert flash_reads(sent, skipped, len(expected)).hex() == expected.hex()


@pytest.mark.parametrize(("part", "number", "answer"), I2C)
def test_identification_over_i2c(part: str, number: int, answer: str) -> None:
    expected = bytes.fromhex(answer)
    assert imu_reads(Mpu6050(), number, len(expected)).hex() == expected.hex()


def test_parameters_say_what_the_flash_does() -> None:
    """JESD216's words, decoded: what the commands of this part do."""
    words = [int.from_bytes(bytes.fromhex(WORDS)[4 * n : 4 * n + 4], "little") for n in range(16)]
    assert words[1] + 1 == 16 * 1024 * 1024, "bits"
    assert [(1 << (words[7] >> 16 * n & 0xFF), words[7] >> 16 * n + 8 & 0xFF) for n in range(2)] == [
        (4096, 0x20),
        (32 * 1024, 0x52),
    ]
    assert (1 << (words[8] & 0xFF), words[8] >> 8 & 0xFF) == (64 * 1024, 0xD8)
    assert 1 << (words[10] >> 4 & 15) == 256, "bytes of a page"
    unit_ms = (16, 256, 4_000, 64_000)[words[10] >> 29 & 3]
    assert ((words[10] >> 24 & 31) + 1) * unit_ms == 5120, "to erase all, ms"


def test_drivers_of_both_ages_take_the_gyroscope_for_one_of_full_sensitivity() -> None:
    """The revision is in the lowest bits of the accelerometer's offsets; 1 and 2 are all that both drivers take."""
    offsets = imu_reads(Mpu6050(), 0x06, 6)
    revision = (offsets[5] & 1) << 2 | (offsets[3] & 1) << 1 | offsets[1] & 1
    assert revision == 2
    product = imu_reads(Mpu6050(), 0x0C, 1)[0] & 0x0F
    assert product not in {0, 4}, "0 is an MPU-3050, 4 one of half the sensitivity"


@pytest.mark.parametrize("number", [0x06, 0x0B, 0x13, 0x18])
def test_offsets_are_kept_as_written_until_a_reset(number: int) -> None:
    imu = Mpu6050()
    before = imu_reads(imu, number, 1)
    imu_writes(imu, number, 0x5A)
    assert (imu_reads(imu, number, 1), imu.ignored) == (b"\x5a", 1)
    imu_writes(imu, 0x6B, 0x80)
    assert imu_reads(imu, number, 1) == before


@pytest.mark.parametrize("number", [0x05, 0x0C, 0x12, 0x75])
def test_what_stands_beside_the_offsets_keeps_its_value(number: int) -> None:
    imu = Mpu6050()
    before = imu_reads(imu, number, 1)
    imu_writes(imu, number, 0x5A)
    assert (imu_reads(imu, number, 1), imu.ignored) == (before, 1)


@pytest.mark.parametrize(("height", "low"), [(64, 6), (32, 3)])
def test_an_oled_is_distinguished_from_an_sh1106_by_the_lower_half_of_its_status(height: int, low: int) -> None:
    oled = Ssd1306(height=height)
    assert oled.start(0x3C, True, 0)
    assert oled.read(0) == 0x40 | low
    oled.start(0x3C, False, 0)
    oled.write(0x00, 0)
    oled.write(0xAF, 0)
    assert oled.read(0) == low


def test_a_card_says_its_version_name_and_size() -> None:
    csd = card_reads(9, 16)
    assert csd[0] >> 6 == 1, "version 2.0: high capacity"
    assert (csd[7] & 0x3F) << 16 | csd[8] << 8 | csd[9] == 8 * 1024 // 512 - 1
    cid = card_reads(10, 16)
    assert (cid[1:3], cid[3:8]) == (b"P2", b"BENCH")
