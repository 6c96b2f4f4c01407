"""CRC: the remainder by Ethernet's polynomial, against one worked out bit by bit and a value that ST prints."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

POLYNOMIAL, WORD = 0x04C1_1DB7, 0xFFFF_FFFF
CRC, AHBENR, CRCEN = 0x4002_3000, 0x4002_1014, 1 << 6


def crc_of(words: list[int]) -> int:
    """Divide in the order of the manual: the words' bits from the left, after 32 ones."""
    remainder = WORD
    for word in words:
        for bit in range(31, -1, -1):
            top = remainder >> 31 ^ word >> bit & 1
            remainder = remainder << 1 & WORD ^ (POLYNOMIAL if top else 0)
    return remainder


@given(words=st.lists(st.integers(0, WORD), max_size=8), idr=st.integers(0, WORD))
def test_any_words_give_the_remainder_of_the_polynomial(
    make_fake_chip: Callable[[], Any], words: list[int], idr: int
) -> None:
    chip = make_fake_chip()
    chip.write("CRC.IDR", idr)
    for word in words:
        chip.write("CRC.DR", word)
        assert chip.read("CRC.IDR") == idr & 0xFF
    assert chip.read("CRC.DR") == crc_of(words)


def test_known_words_give_known_remainders(fake_chip: Any) -> None:
    """CRC-32/MPEG-2 of nothing, of four zeros, and of the bytes 00 01 02 03."""
    assert fake_chip.read("CRC.DR") == WORD
    fake_chip.write("CRC.DR", 0)
    assert fake_chip.read("CRC.DR") == 0xC704_DD7B
    fake_chip.write("CRC.CR", 1)
    fake_chip.write("CRC.DR", 0x0001_0203)
    assert fake_chip.read("CRC.DR") == crc_of([0x0001_0203])


def test_a_reset_begins_anew_and_leaves_the_byte_alone(fake_chip: Any) -> None:
    fake_chip.write("CRC.IDR", 0x1A5)
    fake_chip.write("CRC.DR", 5)
    fake_chip.write("CRC.CR", 0xFFFF_FFFE)  # no bit of it but the first does anything
    assert fake_chip.read("CRC.DR") == crc_of([5])
    fake_chip.write("CRC.CR", 1)
    assert (fake_chip.read("CRC.DR"), fake_chip.read("CRC.IDR"), fake_chip.read("CRC.CR")) == (WORD, 0xA5, 0)


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_program_checks_the_words_of_its_flash(
    boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, core: str
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        f"mov32 r1, #{AHBENR}\nmov32 r2, #{CRCEN | 0x14}\nstr r2, [r1, #0]\n"
        f"mov32 r1, #{CRC}\nmov32 r3, #0x08000000\nmov32 r4, #0x08000100\n"
        "next: ldr r2, [r3, #0]\nstr r2, [r1, #0]\nadds r3, #4\nsubs r5, r4, r3\nbne next\n"
        "ldr r0, [r1, #0]\nlog r0\nb stop"
    ).run(500)
    flash = machine.board.read_memory(0x0800_0000, 0x100)
    assert machine.log == [crc_of([int.from_bytes(flash[at : at + 4], "little") for at in range(0, 0x100, 4)])]
    saved = machine.board.snapshot()
    part = machine.board.chip.parts.by_name["CRC"]
    part.write(0, 4, 1)
    machine.board.restore(saved)
    assert part.read(0, 4) == machine.log[0]


def test_without_its_clock_nothing_counts(boot: Callable[..., Any]) -> None:
    machine = boot(f"mov32 r1, #{CRC}\nmovs r2, #5\nstr r2, [r1, #0]\nldr r0, [r1, #0]\nlog r0\nb stop").run(50)
    assert machine.log == [0]
    assert machine.board.chip.parts.by_name["CRC"].read(0, 4) == WORD
