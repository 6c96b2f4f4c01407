"""USART, receiving: when a character is there, overruns, idle lines, parity."""

from collections.abc import Callable
from typing import Any

import pytest

from tests.bluepill_sim.peripherals.usart.usart_line import (
    CHARACTER_NS,
    IDLE,
    IDLEIE,
    IRQ,
    ORE,
    PCE,
    PS,
    RXNE,
    RXNEIE,
    TE,
    UE,
    M,
    set_up,
    status,
)


def test_a_character_is_in_dr_when_its_stop_bit_has_ended(fake_chip: Any) -> None:
    set_up(fake_chip, RXNEIE)
    start_ns = fake_chip.now_ns
    fake_chip.parts.usart(1).receive(b"Q")
    fake_chip.advance(start_ns + CHARACTER_NS - 1)
    assert not status(fake_chip) & RXNE
    assert not fake_chip.irqs[IRQ]
    fake_chip.advance(start_ns + CHARACTER_NS)
    assert status(fake_chip) & RXNE
    assert fake_chip.irqs[IRQ]
    assert fake_chip.read("USART1.DR") == ord("Q")
    assert not status(fake_chip) & RXNE
    assert not fake_chip.irqs[IRQ]


def test_characters_queue_at_the_speed_of_the_line(fake_chip: Any) -> None:
    set_up(fake_chip)
    start_ns = fake_chip.now_ns
    usart = fake_chip.parts.usart(1)
    usart.receive(b"ab")
    usart.receive(b"c")
    for number, expected in enumerate(b"abc"):
        fake_chip.advance(start_ns + (number + 1) * CHARACTER_NS - 1)
        assert not status(fake_chip) & RXNE
        fake_chip.advance(start_ns + (number + 1) * CHARACTER_NS)
        assert fake_chip.read("USART1.DR") == expected


def test_an_unread_character_stays_and_the_next_one_is_an_overrun(fake_chip: Any) -> None:
    set_up(fake_chip, RXNEIE)
    fake_chip.parts.usart(1).receive(b"ab")
    fake_chip.advance(fake_chip.now_ns + 2 * CHARACTER_NS)
    assert status(fake_chip) & (ORE | RXNE) == ORE | RXNE
    assert fake_chip.read("USART1.DR") == ord("a")
    # DR alone clears RXNE; ORE needs a read of SR first, and keeps the interrupt up.
    assert status(fake_chip) & (ORE | RXNE) == ORE
    assert fake_chip.irqs[IRQ]
    fake_chip.read("USART1.SR")
    assert fake_chip.read("USART1.DR") == ord("a")
    assert not status(fake_chip) & ORE
    assert not fake_chip.irqs[IRQ]


def test_rxne_is_cleared_by_writing_0_too(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.parts.usart(1).receive(b"a")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    fake_chip.write("USART1.SR", ~RXNE & 0x3FF)
    assert not status(fake_chip) & RXNE


def test_a_line_that_stays_idle_for_a_character_says_so_once(fake_chip: Any) -> None:
    set_up(fake_chip, IDLEIE)
    start_ns = fake_chip.now_ns
    fake_chip.parts.usart(1).receive(b"a")
    fake_chip.advance(start_ns + 2 * CHARACTER_NS - 1)
    assert not status(fake_chip) & IDLE
    fake_chip.advance(start_ns + 2 * CHARACTER_NS)
    assert status(fake_chip) & IDLE
    assert fake_chip.irqs[IRQ]
    fake_chip.read("USART1.SR")
    fake_chip.read("USART1.DR")
    fake_chip.advance(start_ns + 20 * CHARACTER_NS)
    assert not status(fake_chip) & IDLE
    assert not fake_chip.irqs[IRQ]


def test_more_characters_put_the_idle_flag_off(fake_chip: Any) -> None:
    set_up(fake_chip)
    usart = fake_chip.parts.usart(1)
    usart.receive(b"a")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS * 3 // 2)
    usart.receive(b"b")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert not status(fake_chip) & IDLE


@pytest.mark.parametrize(
    "before",
    [
        lambda c: c.write("USART1.CR1", TE),
        lambda c: c.write("USART1.BRR", 0),
    ],
)
def test_a_receiver_that_is_not_set_up_loses_characters(fake_chip: Any, before: Callable[[Any], None]) -> None:
    set_up(fake_chip)
    before(fake_chip)
    fake_chip.parts.usart(1).receive(b"a")
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert not status(fake_chip) & RXNE
    assert list(fake_chip.warnings) == ["USART1:rx-off"]


def heard_with(chip: Any, nibble: int, odr: int) -> bool:
    """Tell whether RXNE rises with PA10 in a mode of GPIO."""
    set_up(chip)
    chip.write("GPIOA.ODR", odr << 10)
    chip.write("GPIOA.CRH", 0x4444_40B4 | nibble << 8)
    chip.parts.usart(1).receive(b"a")
    chip.advance(chip.now_ns + CHARACTER_NS)
    return bool(status(chip) & RXNE)


@pytest.mark.parametrize(
    ("nibble", "odr"),
    [(0x4, 0), (0x8, 0), (0x8, 1), (0x5, 1), (0x6, 1), (0x7, 1), (0x9, 0), (0xB, 0), (0xD, 0), (0xF, 1)],
)
def test_a_pin_that_the_chip_lets_go_is_heard_in_every_mode_but_analog(fake_chip: Any, nibble: int, odr: int) -> None:
    assert heard_with(fake_chip, nibble, odr)
    assert not fake_chip.warnings


@pytest.mark.parametrize(("nibble", "odr"), [(0x0, 0), (0x0, 1), (0x1, 0), (0x1, 1), (0x3, 1), (0x5, 0), (0x7, 0)])
def test_an_analog_pin_or_one_that_the_chip_drives_hears_nothing(fake_chip: Any, nibble: int, odr: int) -> None:
    assert not heard_with(fake_chip, nibble, odr)
    assert list(fake_chip.warnings) == ["USART1:rx-pin"]


def test_a_receiver_switched_off_meanwhile_loses_the_rest(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.parts.usart(1).receive(b"ab")
    fake_chip.write("USART1.CR1", UE)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert not status(fake_chip) & (RXNE | IDLE)
    assert list(fake_chip.warnings) == ["USART1:rx-off"]


@pytest.mark.parametrize(
    ("control", "word", "reads"),
    [
        (PCE, 0x41, 0x41),
        (PCE, 0x43, 0xC3),
        (PCE | PS, 0x41, 0xC1),
        (M | PCE, 0x81, 0x081),
        (M | PCE | PS, 0x81, 0x181),
        (M, 0x81, 0x081),
    ],
)
def test_parity_takes_the_top_bit(fake_chip: Any, control: int, word: int, reads: int) -> None:
    sent = set_up(fake_chip, control)
    fake_chip.parts.usart(1).receive(bytes([word]))
    fake_chip.write("USART1.DR", 0x1FF)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.read("USART1.DR") == reads
    assert sent[0][0] == {PCE: 0x7F, PCE | PS: 0x7F, M: 0x1FF}.get(control, 0xFF)
