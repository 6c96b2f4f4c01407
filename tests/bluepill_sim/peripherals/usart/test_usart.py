"""USART, sending and set-up: true character times, double buffering, flags, interrupts."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bluepill_sim.peripherals.usart.usart_line import (
    BRR,
    CHARACTER_NS,
    IRQ,
    RE,
    RXNE,
    SBK,
    TC,
    TCIE,
    TE,
    TXE,
    TXEIE,
    UE,
    M,
    set_up,
    status,
)

QUICK = settings(max_examples=40)


def test_reset_values_are_the_manuals(fake_chip: Any) -> None:
    names = ("SR", "DR", "BRR", "CR1", "CR2", "CR3", "GTPR")
    assert [fake_chip.read(f"USART1.{name}") for name in names] == [0xC0, 0, 0, 0, 0, 0, 0]


def test_a_character_appears_at_the_end_of_its_stop_bit(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    assert fake_chip.read("USART1.SR") & (TXE | TC) == TXE | TC
    fake_chip.write("USART1.DR", 0x41)
    assert fake_chip.read("USART1.SR") & (TXE | TC) == TXE
    fake_chip.advance(start_ns + CHARACTER_NS - 1)
    assert sent == []
    assert not status(fake_chip) & TC
    fake_chip.advance(start_ns + CHARACTER_NS)
    assert sent == [(0x41, start_ns + CHARACTER_NS)]
    assert status(fake_chip) & TC


def test_enabling_the_transmitter_sends_an_idle_character_first(fake_chip: Any) -> None:
    sent = set_up(fake_chip, control=0)
    fake_chip.write("USART1.CR1", UE | RE)
    fake_chip.write("USART1.CR1", UE | RE | TE)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 0x55)
    assert not status(fake_chip) & TXE
    fake_chip.advance(start_ns + 2 * CHARACTER_NS)
    assert sent == [(0x55, start_ns + 2 * CHARACTER_NS)]


def test_characters_follow_without_a_gap(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    for number in range(4):
        fake_chip.read("USART1.SR")
        fake_chip.write("USART1.DR", number)
        fake_chip.advance(fake_chip.now_ns + (1 if number == 0 else CHARACTER_NS))
    fake_chip.advance(start_ns + 10 * CHARACTER_NS)
    assert sent == [(n, start_ns + (n + 1) * CHARACTER_NS) for n in range(4)]


@pytest.mark.parametrize(
    ("control", "stop", "half_bits"),
    [(0, 0, 20), (0, 1, 19), (0, 2, 22), (0, 3, 21), (M, 0, 22), (M, 2, 24)],
)
def test_frame_format_decides_the_length(fake_chip: Any, control: int, stop: int, half_bits: int) -> None:
    sent = set_up(fake_chip, control, stop)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 0x1FF)
    fake_chip.advance(start_ns + 10**6)
    assert sent == [(0x1FF if control else 0xFF, start_ns + half_bits * BRR * 125 // 2)]


@QUICK
@given(brr=st.integers(1, 0xFFFF), count=st.integers(1, 40))
def test_times_are_derived_and_never_accumulated(make_fake_chip: Callable[[], Any], brr: int, count: int) -> None:
    chip = make_fake_chip()
    sent = set_up(chip)
    chip.write("USART1.BRR", brr)
    start_ns = chip.now_ns
    chip.write("USART1.DR", 0)
    for _ in range(count):
        chip.write("USART1.DR", 0)
        chip.advance(chip.parts.next_deadline())
    bit_ns = Fraction(brr * 10**9, 8_000_000)
    assert [at for _, at in sent] == [int(start_ns + 10 * (n + 1) * bit_ns) for n in range(count)]


def test_a_third_character_overwrites_the_waiting_one(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    for word in (1, 2, 3):
        fake_chip.write("USART1.DR", word)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [word for word, _ in sent] == [1, 3]
    assert list(fake_chip.warnings) == ["USART1:txe"]


def test_tc_is_cleared_by_reading_sr_then_writing_dr_or_by_writing_0(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("USART1.DR", 1)
    assert status(fake_chip) & TC
    fake_chip.read("USART1.SR")
    fake_chip.write("USART1.DR", 2)
    assert not status(fake_chip) & TC
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert status(fake_chip) & TC
    fake_chip.write("USART1.SR", ~TC & 0x3FF)
    assert not status(fake_chip) & TC


def test_nothing_comes_out_of_a_pin_that_is_no_alternate_output(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.write("GPIOA.CRH", 0x4444_4434)
    fake_chip.write("USART1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert sent == []
    assert fake_chip.warnings == {
        "USART1:tx-pin": "USART1: nothing comes out, PA9 is no alternate-function output (output)"
    }


def test_nobody_need_listen(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.parts.usart(1).on_transmit = None
    fake_chip.write("USART1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert fake_chip.warnings == {}


@pytest.mark.parametrize(
    ("before", "key"), [(lambda c: c.write("USART1.CR1", UE), "tx-off"), (lambda c: c.write("USART1.BRR", 0), "brr")]
)
def test_a_write_that_cannot_be_sent_is_warned_of(fake_chip: Any, before: Callable[[Any], None], key: str) -> None:
    set_up(fake_chip)
    before(fake_chip)
    fake_chip.write("USART1.DR", 1)
    assert list(fake_chip.warnings) == [f"USART1:{key}"]


def test_the_tx_pin_is_high_while_the_transmitter_is_on(fake_chip: Any) -> None:
    set_up(fake_chip)
    pin = fake_chip.pins["PA9"]
    assert pin.level
    fake_chip.write("USART1.CR1", RE)
    assert pin.output.value == "none"


def test_ue_lets_the_character_end_and_te_cuts_it_off(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.write("USART1.DR", 1)
    fake_chip.write("USART1.DR", 2)
    fake_chip.write("USART1.CR1", TE)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [word for word, _ in sent] == [1]
    assert fake_chip.pins["PA9"].output.value == "none"
    fake_chip.write("USART1.CR1", UE | TE)
    fake_chip.write("USART1.CR1", UE)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [word for word, _ in sent] == [1]
    assert "USART1:te" in fake_chip.warnings
    assert status(fake_chip) & (TXE | TC) == TXE | TC


def test_te_may_cut_off_an_idle_character_and_a_break_which_say_nothing(fake_chip: Any) -> None:
    """Drivers clear TE while they change the format, often just after they have set it."""
    set_up(fake_chip)
    fake_chip.write("USART1.CR1", UE)
    fake_chip.write("USART1.CR1", UE | TE)
    fake_chip.write("USART1.CR1", UE)
    fake_chip.write("USART1.CR1", UE | TE)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    fake_chip.write("USART1.CR1", UE | TE | SBK)
    fake_chip.write("USART1.CR1", UE)
    assert fake_chip.warnings == {}
    fake_chip.write("USART1.CR1", UE | TE)
    fake_chip.write("USART1.DR", 1)  # behind the idle character
    fake_chip.write("USART1.CR1", UE)
    assert "USART1:te" in fake_chip.warnings


def test_a_break_takes_the_line_for_one_character_and_a_bit(fake_chip: Any) -> None:
    """Ten bits at 0, and one at 1 (RM0008 27.3.2)."""
    break_ns = CHARACTER_NS * 11 // 10
    sent = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.CR1", UE | TE | SBK)
    fake_chip.write("USART1.DR", 7)
    fake_chip.advance(start_ns + break_ns - 1)
    assert fake_chip.read("USART1.CR1") & SBK
    fake_chip.advance(start_ns + break_ns)
    assert not fake_chip.read("USART1.CR1") & SBK
    fake_chip.write("USART1.CR1", UE | TE | SBK)
    fake_chip.advance(start_ns + 4 * CHARACTER_NS)
    assert sent == [(7, start_ns + break_ns + CHARACTER_NS)]
    assert not fake_chip.read("USART1.CR1") & SBK


def test_remapped_usart1_uses_pb6_and_pb7(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.write("AFIO.MAPR", 1 << 2)
    assert fake_chip.pins["PA9"].output.value == "none"
    fake_chip.write("GPIOB.CRL", 0x4B44_4444)
    assert fake_chip.pins["PB6"].level
    fake_chip.write("USART1.DR", 9)
    fake_chip.advance(fake_chip.now_ns + 10**6)
    assert [word for word, _ in sent] == [9]


def test_a_restored_usart_sends_on_the_pins_that_it_was_remapped_to(
    fake_chip: Any, make_fake_chip: Callable[[], Any]
) -> None:
    set_up(fake_chip)
    fake_chip.write("AFIO.MAPR", 1 << 2)
    fake_chip.write("GPIOB.CRL", 0x4B44_4444)
    other = make_fake_chip()
    other.clocks.restore(fake_chip.clocks.snapshot())
    other.pins.restore(fake_chip.pins.snapshot())
    other.parts.restore(fake_chip.parts.snapshot())
    sent: list[int] = []
    other.parts.usart(1).sinks.append(lambda rows: sent.extend(word for word, _ in rows))
    other.write("USART1.DR", 9)
    other.advance(10**6)
    assert sent == [9]


def test_characters_come_in_one_go_as_many_as_were_sent_alike(fake_chip: Any) -> None:
    set_up(fake_chip)
    runs: list[tuple[list[tuple[int, int]], int, bytes]] = []
    usart = fake_chip.parts.usart(1)
    usart.deliver()
    usart.sinks[:] = [lambda rows: runs.append((list(rows), rows.bit_ns, rows.data))]
    sent = []
    for word, brr, control in (
        (0x41, BRR, 0),
        (0x42, BRR, 0),
        (0x143, BRR, M),
        (0x144, 2 * BRR, M),
        (0x45, 2 * BRR, 0),
    ):
        fake_chip.write("USART1.BRR", brr)
        fake_chip.write("USART1.CR1", UE | TE | control)
        fake_chip.write("USART1.DR", word)
        fake_chip.parts.usart(1).fabric.run_events(fake_chip.now_ns + 10**6)
        fake_chip.now_ns += 10**6
        sent.append(word)
    usart.deliver()
    assert [word for rows, *_ in runs for word, _ in rows] == sent
    bit_ns = BRR * 10**9 // usart.native.clock_hz
    assert [(bit, data) for _, bit, data in runs] == [
        (bit_ns, b"AB"), (bit_ns, b"C"), (2 * bit_ns, b"D"), (2 * bit_ns, b"E"),
    ]  # fmt: skip
    first, second = runs[0][0]
    assert (first[0], second[0]) == (0x41, 0x42)
    assert second[1] - first[1] == 10**6


def test_a_remap_before_the_start_connects_later(fake_chip: Any) -> None:
    fake_chip.write("AFIO.MAPR", 1 << 2)
    fake_chip.write("GPIOB.CRL", 0x4B44_4444)
    assert not fake_chip.pins["PB6"].level
    fake_chip.write("USART1.CR1", UE | TE)
    assert fake_chip.pins["PB6"].level


def test_other_usarts_run_on_pclk1(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    sent: list[int] = []
    fake_chip.parts.usart(2).sinks.append(lambda rows: sent.extend(at_ns for _, at_ns in rows))
    fake_chip.write("GPIOA.CRL", 0x4444_4B44)
    fake_chip.write("USART2.BRR", 360)
    fake_chip.write("USART2.CR1", UE | TE)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART2.DR", 1)
    fake_chip.advance(start_ns + 10**6)
    # The idle character, then ours: 20 bits of 360 cycles at 36 MHz.
    assert sent == [start_ns + 200_000]


def test_a_changed_clock_stretches_what_is_left(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 1)
    fake_chip.parts.usart(1).receive(b"a")
    fake_chip.advance(start_ns + CHARACTER_NS // 2)
    fake_chip.write("RCC.CFGR", 4 << 11)
    fake_chip.advance(start_ns + CHARACTER_NS * 3 // 2 - 1)
    assert sent == []
    assert not status(fake_chip) & RXNE
    fake_chip.advance(start_ns + CHARACTER_NS * 3 // 2)
    assert len(sent) == 1
    assert status(fake_chip) & RXNE


def test_a_changed_rate_begins_with_the_next_character(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 1)
    fake_chip.write("USART1.DR", 2)
    fake_chip.parts.usart(1).receive(b"ab")
    fake_chip.write("USART1.BRR", 2 * BRR)
    fake_chip.advance(start_ns + 10**6)
    assert [at - start_ns for _, at in sent] == [CHARACTER_NS, 3 * CHARACTER_NS]


# Reception.


@pytest.mark.parametrize(("enable", "flag"), [(TXEIE, TXE), (TCIE, TC)])
def test_transmit_interrupts_follow_their_flags(fake_chip: Any, enable: int, flag: int) -> None:
    set_up(fake_chip, enable)
    assert fake_chip.irqs[IRQ]
    fake_chip.read("USART1.SR")
    fake_chip.write("USART1.DR", 1)
    fake_chip.write("USART1.DR", 2)
    assert not status(fake_chip) & flag
    assert not fake_chip.irqs[IRQ]
    fake_chip.advance(fake_chip.now_ns + 2 * CHARACTER_NS)
    assert fake_chip.irqs[IRQ]
    fake_chip.write("USART1.CR1", UE | TE)
    assert not fake_chip.irqs[IRQ]


@pytest.mark.parametrize(
    ("register", "value"),
    [("CR3", 1 << 1), ("CR3", 1 << 5)],
)
def test_modes_that_are_not_modelled_are_warned_of(fake_chip: Any, register: str, value: int) -> None:
    fake_chip.write(f"USART1.{register}", value)
    assert len(fake_chip.warnings) == 1
    assert "is not modelled" in next(iter(fake_chip.warnings.values()))


def test_reset_drops_what_is_on_its_way(fake_chip: Any) -> None:
    sent = set_up(fake_chip)
    fake_chip.write("USART1.DR", 1)
    fake_chip.parts.usart(1).receive(b"abc")
    fake_chip.parts.usart(1).reset()
    assert fake_chip.parts.next_deadline() is None
    fake_chip.advance(fake_chip.now_ns + 10**7)
    assert sent == []
    assert fake_chip.pins["PA9"].output.value == "none"
