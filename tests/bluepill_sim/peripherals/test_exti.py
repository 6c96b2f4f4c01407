"""EXTI: from an edge on a pin to an interrupt line."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.stm32f103 import line_of

QUICK = settings(max_examples=40)

IRQ_OF_LINE = {0: 6, 1: 7, 2: 8, 3: 9, 4: 10, 5: 23, 9: 23, 10: 40, 12: 40, 15: 40}


def enable(chip: Any, line: int, *, rising: bool = False, falling: bool = False, port: int = 0) -> None:
    chip.write(f"AFIO.EXTICR{line // 4 + 1}", port << 4 * (line % 4))
    chip.write("EXTI.RTSR", rising << line)
    chip.write("EXTI.FTSR", falling << line)
    chip.write("EXTI.IMR", 1 << line)


@pytest.mark.parametrize("line", IRQ_OF_LINE)
def test_an_edge_raises_the_interrupt_of_its_line_until_cleared(fake_chip: Any, line: int) -> None:
    enable(fake_chip, line, rising=True, port=1)
    fake_chip.write("AFIO.MAPR", 0b100 << 24)
    irq = IRQ_OF_LINE[line]
    fake_chip.pins[f"PA{line}"].drive(True)
    assert not fake_chip.irqs[irq]
    fake_chip.pins[f"PB{line}"].drive(True)
    assert fake_chip.irqs[irq]
    assert fake_chip.read("EXTI.PR") == 1 << line
    assert [n for n, level in fake_chip.irqs.items() if level] == [irq]
    fake_chip.write("EXTI.PR", 1 << line)
    assert not fake_chip.irqs[irq]
    assert fake_chip.read("EXTI.PR") == 0


@pytest.mark.parametrize(("rising", "falling"), [(True, False), (False, True), (True, True), (False, False)])
def test_only_chosen_edges_count(fake_chip: Any, rising: bool, falling: bool) -> None:
    enable(fake_chip, 1, rising=rising, falling=falling)
    fake_chip.pins["PA1"].drive(True)
    assert fake_chip.irqs[7] is rising
    fake_chip.write("EXTI.PR", 2)
    fake_chip.pins["PA1"].drive(None)
    assert fake_chip.irqs[7] is falling


def test_a_masked_edge_is_pending_and_raises_when_unmasked(fake_chip: Any) -> None:
    enable(fake_chip, 0, rising=True)
    fake_chip.write("EXTI.IMR", 0)
    fake_chip.pins["PA0"].drive(True)
    assert not fake_chip.irqs[6]
    fake_chip.write("EXTI.IMR", 1)
    assert fake_chip.irqs[6]


def test_the_chips_own_output_makes_edges(fake_chip: Any) -> None:
    enable(fake_chip, 2, rising=True)
    fake_chip.write("GPIOA.CRL", 0x4444_4144)
    fake_chip.write("GPIOA.BSRR", 4)
    assert fake_chip.irqs[8]


def test_an_event_goes_to_the_core_without_interrupt(fake_chip: Any) -> None:
    enable(fake_chip, 0, rising=True)
    fake_chip.write("EXTI.IMR", 0)
    fake_chip.write("EXTI.EMR", 1)
    fake_chip.pins["PA0"].drive(True)
    assert fake_chip.signals == ["event"]
    assert not fake_chip.irqs[6]


def test_software_makes_requests(fake_chip: Any) -> None:
    fake_chip.write("EXTI.SWIER", 1 << 9)
    assert fake_chip.read("EXTI.PR") == 0
    fake_chip.write("EXTI.PR", 1 << 9)
    fake_chip.write("EXTI.IMR", 1 << 9)
    fake_chip.write("EXTI.EMR", 1 << 9)
    # Clearing a request that is not there also clears the software bit only where PR is written.
    fake_chip.write("EXTI.SWIER", 1 << 9)
    assert (fake_chip.read("EXTI.PR"), fake_chip.read("EXTI.SWIER")) == (1 << 9, 1 << 9)
    assert fake_chip.irqs[23]
    assert fake_chip.signals == ["event"]
    fake_chip.write("EXTI.PR", 1 << 9)
    assert (fake_chip.read("EXTI.PR"), fake_chip.read("EXTI.SWIER")) == (0, 0)


def test_two_lines_share_an_interrupt(fake_chip: Any) -> None:
    fake_chip.write("EXTI.IMR", 0x60)
    fake_chip.write("EXTI.RTSR", 0x60)
    fake_chip.pins["PA5"].drive(True)
    fake_chip.pins["PA6"].drive(True)
    fake_chip.write("EXTI.PR", 0x20)
    assert fake_chip.irqs[23]
    fake_chip.write("EXTI.PR", 0x40)
    assert not fake_chip.irqs[23]


def test_switching_a_line_to_a_high_port_is_a_rising_edge(fake_chip: Any) -> None:
    enable(fake_chip, 0, rising=True)
    fake_chip.pins["PB0"].drive(True)
    assert not fake_chip.irqs[6]
    fake_chip.write("AFIO.EXTICR1", 1)
    assert fake_chip.irqs[6]


@pytest.mark.parametrize(("line", "irq"), [(16, 1), (17, 41), (18, 42)])
def test_inner_lines_have_their_own_interrupts(fake_chip: Any, line: int, irq: int) -> None:
    enable(fake_chip, 0)
    fake_chip.write("EXTI.IMR", 1 << line)
    fake_chip.write("EXTI.RTSR", 1 << line)
    inner = line_of({16: "PWR.pvd", 17: "RTC.alarm", 18: "USB.wakeup"}[line])
    fake_chip.pins.fabric.set_line(inner, True)
    fake_chip.pins.fabric.set_line(inner, True)
    assert fake_chip.irqs[irq]
    fake_chip.parts.exti.reset()
    assert not fake_chip.irqs[irq]


@QUICK
@given(
    levels=st.lists(st.tuples(st.integers(0, 15), st.booleans()), max_size=30),
    rising=st.integers(0, 0xFFFF),
    falling=st.integers(0, 0xFFFF),
)
def test_pending_bits_are_the_lines_that_had_a_chosen_edge(
    make_fake_chip: Callable[[], Any], levels: Any, rising: int, falling: int
) -> None:
    chip = make_fake_chip()
    chip.write("AFIO.MAPR", 0b100 << 24)
    chip.write("EXTI.RTSR", rising)
    chip.write("EXTI.FTSR", falling)
    now = [False] * 16
    expected = 0
    for line, level in levels:
        if now[line] is not level and (rising if level else falling) >> line & 1:
            expected |= 1 << line
        now[line] = level
        chip.pins[f"PA{line}"].drive(level)
    assert chip.read("EXTI.PR") == expected
