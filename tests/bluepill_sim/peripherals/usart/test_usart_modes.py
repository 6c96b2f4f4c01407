"""USART: mute mode, LIN breaks, flow control, one wire, the synchronous clock, damage on purpose, bits on the pin."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE, HIGH
from bluepill_sim.peripherals.usart import ReceiveError
from tests.bluepill_sim.peripherals.usart.usart_line import (
    BRR,
    CHARACTER_NS,
    IDLE,
    IRQ,
    ORE,
    PCE,
    PS,
    RE,
    RXNE,
    SBK,
    TC,
    TE,
    TXE,
    UE,
    M,
    set_up,
    status,
)

PE, FE, NE, LBD, CTS = 1, 2, 4, 1 << 8, 1 << 9
RWU, WAKE = 1 << 1, 1 << 11
ON = UE | TE | RE


def bits_ns(bits: int) -> int:
    return bits * BRR * 125


def hear(chip: Any, data: bytes, damage: ReceiveError = ReceiveError(0)) -> None:  # noqa: B008 - it is frozen
    chip.parts.usart(1).receive(data, damage)
    chip.advance(chip.now_ns + len(data) * CHARACTER_NS)


@pytest.mark.parametrize(
    "damage", [ReceiveError.FRAMING, ReceiveError.NOISE, ReceiveError.FRAMING | ReceiveError.NOISE]
)
def test_damage_rises_with_its_character_and_clears_by_sr_then_dr(fake_chip: Any, damage: ReceiveError) -> None:
    set_up(fake_chip)
    hear(fake_chip, b"Q", damage)
    assert fake_chip.read("USART1.SR") & (FE | NE | PE | RXNE) == damage | RXNE
    assert fake_chip.read("USART1.DR") == ord("Q")
    assert not status(fake_chip) & (FE | NE)


@pytest.mark.parametrize("parity", [0, PS])
def test_a_parity_that_is_wrong_reads_so(fake_chip: Any, parity: int) -> None:
    set_up(fake_chip, PCE | M | parity)
    hear(fake_chip, b"Q", ReceiveError.PARITY)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert status(fake_chip) & PE
    odd = ord("Q").bit_count() & 1
    assert fake_chip.read("USART1.DR") == ord("Q") | (1 ^ odd ^ bool(parity)) << 8


def test_muted_by_idle_it_hears_nothing_up_to_an_idle_line(fake_chip: Any) -> None:
    set_up(fake_chip, RWU)
    fake_chip.parts.usart(1).receive(b"ab")
    fake_chip.advance(fake_chip.now_ns + 3 * CHARACTER_NS - 1)
    assert (status(fake_chip) & (RXNE | IDLE | ORE), fake_chip.read("USART1.CR1") & RWU) == (0, RWU)
    fake_chip.advance(fake_chip.now_ns + 1)
    assert not fake_chip.read("USART1.CR1") & RWU
    assert not status(fake_chip) & IDLE
    hear(fake_chip, b"c")
    assert fake_chip.read("USART1.DR") == ord("c")


def test_an_address_mutes_and_wakes(fake_chip: Any) -> None:
    set_up(fake_chip, WAKE)
    fake_chip.write("USART1.CR2", 5)
    hear(fake_chip, b"\x84x")
    assert fake_chip.read("USART1.CR1") & RWU
    assert not status(fake_chip) & RXNE
    hear(fake_chip, b"\x85")
    assert not fake_chip.read("USART1.CR1") & RWU
    assert fake_chip.read("USART1.DR") == 0x85
    hear(fake_chip, b"x")
    assert fake_chip.read("USART1.DR") == ord("x")


@pytest.mark.parametrize(("long", "low_bits", "is_seen"), [(0, 10, 1), (1, 10, 0), (1, 11, 1)])
def test_a_break_is_a_framing_error_and_in_lin_mode_more(
    fake_chip: Any, long: int, low_bits: int, is_seen: int
) -> None:
    set_up(fake_chip)
    for is_lin in (False, True):
        fake_chip.write("USART1.CR2", is_lin << 14 | 1 << 6 | long << 5)
        fake_chip.parts.usart(1).receive_break(low_bits)
        fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
        is_break = bool(is_lin and is_seen)
        assert status(fake_chip) & (FE | RXNE | LBD) == FE | RXNE | LBD * is_break
        assert fake_chip.irqs[IRQ] is is_break
        assert fake_chip.read("USART1.SR") & FE
        assert fake_chip.read("USART1.DR") == 0
    fake_chip.write("USART1.SR", 0xFFFF & ~LBD)
    assert not fake_chip.irqs[IRQ]
    with pytest.raises(ValueError, match="9 bits at 0 are no break"):
        fake_chip.parts.usart(1).receive_break(9)


def test_nothing_goes_out_while_cts_is_high(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.pins["PA11"].drive(1)
    fake_chip.write("USART1.CR3", 1 << 9 | 1 << 10)
    fake_chip.write("USART1.DR", 7)
    fake_chip.advance(fake_chip.now_ns + 10 * CHARACTER_NS)
    assert (sent, status(fake_chip) & TXE) == ([], 0)
    fake_chip.pins["PA11"].drive(0)
    assert status(fake_chip) & (CTS | TXE) == CTS | TXE
    assert fake_chip.irqs[IRQ]
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 8)
    fake_chip.pins["PA11"].drive(1)
    fake_chip.advance(start_ns + 10 * CHARACTER_NS)
    assert sent == [(7, start_ns + CHARACTER_NS)], "what has begun goes out"
    fake_chip.pins["PA11"].drive(0)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert [word for word, _ in sent] == [7, 8]


def test_rts_holds_the_far_end_while_a_character_is_unread(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRL", 0x4444_4BB4)
    fake_chip.write("USART2.BRR", BRR)
    fake_chip.write("USART2.CR3", 1 << 8)
    fake_chip.write("USART2.CR1", ON)
    pin, usart = fake_chip.pins["PA1"], fake_chip.parts.usart(2)
    assert (pin.function, pin.level) == ("USART2_RTS", False)
    fake_chip.advance(2 * CHARACTER_NS)
    start_ns = fake_chip.now_ns
    usart.receive(b"abc")
    for expected in b"abc":
        fake_chip.advance(start_ns + CHARACTER_NS - 1)
        assert not pin.level
        fake_chip.advance(start_ns + 10 * CHARACTER_NS)
        assert pin.level
        assert not usart.words[0] & ORE
        assert fake_chip.read("USART2.DR") == expected
        start_ns = fake_chip.now_ns
    assert not pin.level


def test_on_one_wire_it_hears_itself_and_the_other_end(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.write("GPIOA.CRH", 0x4444_44F4)
    fake_chip.write("USART1.CR3", 1 << 3)
    fake_chip.write("USART1.DR", 0x55)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert (sent[0][0], fake_chip.read("USART1.DR")) == (0x55, 0x55)
    fake_chip.pins["PA10"].short("GND")
    hear(fake_chip, b"z")
    assert fake_chip.read("USART1.DR") == ord("z")
    fake_chip.write("USART1.CR1", UE | TE)
    fake_chip.write("USART1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert not status(fake_chip) & RXNE


def test_in_synchronous_mode_each_character_brings_one_in(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("USART1.CR2", 1 << 11)
    usart = fake_chip.parts.usart(1)
    for expected in (0x1FF, 0):
        fake_chip.pins["PA10"].drive(bool(expected))
        fake_chip.write("USART1.DR", 1)
        fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
        assert fake_chip.read("USART1.DR") == expected
    heard: list[tuple[int, int]] = []
    usart.exchange = lambda word, at_ns: heard.append((word, at_ns)) or 0x42
    fake_chip.write("USART1.DR", 0x99)
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert (heard, fake_chip.read("USART1.DR")) == ([(0x99, fake_chip.now_ns)], 0x42)


def seen(rows: bytes) -> list[tuple[int, bool]]:
    return [(row[0], row[3] == HIGH) for row in EDGE.iter_unpack(rows)]


@settings(max_examples=25)
@given(st.lists(st.integers(0, 0xFF), min_size=1, max_size=3), st.sampled_from([0, PCE, PCE | PS, M | PCE]))
def test_bits_show_on_the_pin_while_somebody_looks(make_fake_chip: Any, data: list[int], control: int) -> None:
    chip = make_fake_chip()
    sent = set_up(chip, control)
    chip.advance(chip.now_ns + CHARACTER_NS)
    rows: list[bytes] = []
    levels: list[tuple[int, bool]] = []
    subscription = chip.pins.subscribe_pins(["PA9"], rows.append)
    start_ns, data_bits = chip.now_ns, 9 if control & M else 8
    line, last = [], True
    for word in data:
        top = data_bits - 1
        value = word & (1 << top) - 1 if control & PCE else word
        parity = (value.bit_count() + bool(control & PS) & 1) << top if control & PCE else 0
        line += [0, *((value | parity) >> n & 1 for n in range(data_bits)), 1]
    for n, bit in enumerate(line):
        if bool(bit) is not last:
            levels.append((start_ns + bits_ns(n), bool(bit)))
            last = bool(bit)
    for word in data:
        chip.write("USART1.DR", word)
        chip.advance(chip.now_ns + bits_ns(1))
        while not status(chip) & TXE:
            chip.advance(chip.now_ns + bits_ns(1))
    chip.advance(start_ns + bits_ns(len(line) + 1))
    assert seen(b"".join(rows)) == levels
    assert len(sent) == len(data)
    assert status(chip) & TC
    subscription.close()


def test_bits_cost_nothing_while_nobody_looks(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("USART1.DR", 0x55)
    assert fake_chip.parts.usart(1).native.bits == 0
    assert fake_chip.pins["PA9"].level


def test_a_lin_break_is_thirteen_bits_on_the_pin(fake_chip: Any) -> None:
    set_up(fake_chip)
    rows: list[bytes] = []
    fake_chip.pins.subscribe_pins(["PA9"], rows.append)
    fake_chip.write("USART1.CR2", 1 << 14)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.CR1", ON | SBK)
    fake_chip.advance(start_ns + bits_ns(14))
    assert [(at_ns - start_ns, level) for at_ns, level in seen(b"".join(rows))] == [(0, False), (bits_ns(13), True)]
    assert not fake_chip.read("USART1.CR1") & SBK
