"""USART and a far end of another speed: which flag each damage raises, and what has no rate."""

from typing import Any

import pytest

from bluepill_sim.fabric.line_speed import Heard
from bluepill_sim.peripherals.usart import FE, NE, PCE, PE, PS, RXNE, M
from tests.bluepill_sim.peripherals.usart.usart_line import CHARACTER_NS, set_up, status


@pytest.mark.parametrize(("control", "word"), [(0, 0x55), (PCE, 0x55), (PCE, 0xD5), (PCE | PS, 0xD5), (M | PCE, 0x55)])
@pytest.mark.parametrize("is_framed", [False, True])
@pytest.mark.parametrize("is_noisy", [False, True])
def test_each_flag_of_a_character_has_its_own_cause(
    fake_chip: Any, control: int, word: int, is_framed: bool, is_noisy: bool
) -> None:
    set_up(fake_chip, control)
    one = Heard(word, has_framing_error=is_framed, has_noise=is_noisy)
    flags = fake_chip.parts.usart(1)._flags(one)
    is_odd = word.bit_count() & 1
    is_wrong = bool(control & PCE) and bool(is_odd) is not bool(control & PS)
    assert flags == (FE if is_framed else 0) | (NE if is_noisy else 0) | (PE if is_wrong else 0)


def test_what_arrives_whole_raises_no_error(fake_chip: Any) -> None:
    set_up(fake_chip, PCE)
    usart = fake_chip.parts.usart(1)
    usart.far_baud = 115_200
    usart.receive(b"\x11")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert status(fake_chip) & 0x3F == RXNE
    assert fake_chip.read("USART1.DR") == 0x11


def test_a_character_whose_rate_is_taken_away_goes_out_as_it_is(fake_chip: Any) -> None:
    usart = fake_chip.parts.usart(1)
    sent = set_up(fake_chip)
    usart.far_baud = 115_200
    fake_chip.write("USART1.DR", 0x41)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS // 2)
    fake_chip.write("USART1.BRR", 0)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    usart.deliver()
    assert [word for word, _ in sent] == [0x41]
    assert "USART1:far:0" not in fake_chip.warnings
