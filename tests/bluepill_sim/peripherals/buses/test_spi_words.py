"""SPI: what is told of a word, who hears it, and what takes no write."""

from typing import Any

import pytest

from bluepill_sim.peripherals.spi import SpiWord
from tests.bluepill_sim.peripherals.buses.test_spi import DFF, MASTER, SPE, SSM, WORD_NS, Recorder, set_up


@pytest.mark.parametrize(("control", "count"), [(0, 8), (DFF, 16)])
@pytest.mark.parametrize("rate", [0, 3])
def test_a_word_tells_its_end_both_directions_its_width_and_its_span(
    fake_chip: Any, control: int, count: int, rate: int
) -> None:
    rows: list[SpiWord] = []
    set_up(fake_chip, MASTER | control | rate << 3, Recorder(b"\xa5\x5a"))
    fake_chip.parts.by_name["SPI1"].subscribe(rows.extend)
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0x1234)
    span_ns = count * (250 << rate)
    fake_chip.advance(start_ns + span_ns)
    fake_chip.parts.by_name["SPI1"].deliver()
    sent, got = (0x34, 0xA5) if count == 8 else (0x1234, 0xA55A)
    assert rows == [SpiWord(start_ns + span_ns, sent, got, count, span_ns)]
    assert fake_chip.parts.by_name["SPI1"].bit_hz == 4_000_000 >> rate


@pytest.mark.parametrize("register", ["TXCRCR", "RXCRCR", "I2SPR"])
def test_what_is_read_only_takes_no_write(fake_chip: Any, register: str) -> None:
    fake_chip.write(f"SPI1.{register}", 0xFFFF)
    assert fake_chip.read(f"SPI1.{register}") == 0


@pytest.mark.parametrize("select", ["PA4", "PA15", "PB0", "PB12", "PB15", "PC13"])
def test_a_part_is_selected_by_its_pin_of_any_port(fake_chip: Any, select: str) -> None:
    part = Recorder()
    set_up(fake_chip)
    fake_chip.parts.by_name["SPI1"].attach(part, select)
    for level in (1, 0, 1):
        fake_chip.pins[select].drive(level)
        fake_chip.write("SPI1.DR", 0x10 + level)
        fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert [row[0] for row in part.heard] == ["select", 0x10, "deselect"]


def test_the_remap_and_a_reset_move_where_parts_send(fake_chip: Any) -> None:
    part = fake_chip.parts.by_name["SPI1"]
    part.attach(Recorder())
    for word, pin, other in ((0, "PA6", "PB4"), (1, "PB4", "PA6"), (0, "PA6", "PB4")):
        fake_chip.write("AFIO.MAPR", word)
        assert (part.sends_at(pin), part.sends_at(other)) == (True, False)


def test_a_reset_drops_the_words_of_a_master_outside(fake_chip: Any) -> None:
    set_up(fake_chip, SPE | SSM)
    part = fake_chip.parts.by_name["SPI1"]
    part.clock_in([1, 2, 3], hz=1_000_000)
    fake_chip.advance(fake_chip.now_ns + 4_000)
    part.reset()
    fake_chip.write("SPI1.CR1", SPE | SSM)
    fake_chip.advance(fake_chip.now_ns + 100_000)
    assert part.words[2] & 1 == 0
    part.clock_in([9], hz=1_000_000)
    fake_chip.advance(fake_chip.now_ns + 8_000)
    assert fake_chip.read("SPI1.DR") == 9
