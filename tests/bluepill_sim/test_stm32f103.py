"""The chip's page: it agrees with itself and with the manual's numbers."""

from typing import Any

import pytest

from bluepill_sim import stm32f103
from bluepill_sim.fabric.registers import ClockBit, fields_of
from bluepill_sim.peripherals.rcc import Rcc, ResetCause
from bluepill_sim.stm32f103 import (
    BASES,
    BONDED_PINS,
    CLOCK_GATES,
    PERIPHERAL_BASE,
    PERIPHERAL_END,
    PERIPHERALS,
    name_at,
)


def test_blocks_do_not_overlap_and_lie_on_kilobytes() -> None:
    bases = sorted(BASES.values())
    assert len(set(bases)) == len(bases)
    assert all(base % 0x400 == 0 for base in bases)


def test_modelled_peripherals_lie_in_the_peripheral_region() -> None:
    for _, name in PERIPHERALS:
        assert PERIPHERAL_BASE <= BASES[name] < PERIPHERAL_END, name


def test_outputs_that_lead_to_one_end_are_one_line_which_is_their_or(
    make_fake_chip: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stm32f103, "WIRING", {"USART1.irq": (37,), "USART2.irq": (37,)})
    chip = make_fake_chip()
    one, other = (chip.parts.usart(number) for number in (1, 2))
    one.set_output("irq", True)
    other.set_output("irq", True)
    one.set_output("irq", False)
    assert chip.irqs[37]
    other.set_output("irq", False)
    assert not chip.irqs[37]


@pytest.mark.parametrize(
    ("wiring", "message"),
    [
        ({"USART1.irqq": (37,)}, "USART1.irqq: USART1 has no output 'irqq'; it has irq"),
        ({"USART9.irq": (37,)}, "USART9.irq: the chip has no USART9"),
        ({"PWR.pvd": ("EXTI.pwd",)}, "EXTI.pwd: EXTI has no input 'pwd'; it has pvd, rtc_alarm, usb_wakeup"),
        ({"PWR.pvd": ("IWDG.pvd",)}, "IWDG has no input 'pvd'; it has none"),
        ({"USART1.irq": (60,)}, "60 is no interrupt"),
        ({"USART1.irq": (37, 38)}, "38 is no interrupt that can be on line 37"),
        ({"PWR.pvd": ("EXTI.pvd",), "RTC.alarm": ("EXTI.pvd", 41)}, "two lines lead to EXTI.pvd"),
    ],
)
def test_a_table_of_wires_with_a_mistake_is_refused_at_the_start(
    wiring: dict[str, Any], message: str, make_fake_chip: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stm32f103, "WIRING", wiring)
    with pytest.raises(ValueError, match=message):
        make_fake_chip()


def test_every_gate_has_its_own_bit() -> None:
    gates = list(CLOCK_GATES.values())
    assert len(set(gates)) == len(gates)
    fields = [field.name for one in Rcc.REGISTERS if one.name.endswith("ENR") for field in fields_of(one.fields)]
    assert {name for name in fields if name.replace("IOP", "GPIO") not in CLOCK_GATES} == {"FLITF", "SRAM"}
    assert CLOCK_GATES["GPIOA"] == ClockBit("APB2ENR", 2)


@pytest.mark.parametrize(
    ("address", "name"),
    [
        (0x4001_0C0C, "GPIOB"),
        (0x4002_13FF, "RCC"),
        (0x4002_1400, None),
        (0x4001_2C24, "TIM1"),
        (0x3FFF_FFFF, None),
        (0xE004_2000, "DBGMCU"),
        (0x5000_1000, "USB OTG"),
    ],
)
def test_an_address_has_a_name(address: int, name: str | None) -> None:
    assert name_at(address) == name


def test_the_package_has_37_io_pins() -> None:
    assert len(BONDED_PINS) == 37


def test_parts_stand_at_their_places(fake_chip: Any) -> None:
    parts = fake_chip.parts
    assert list(parts.by_name) == [name for _, name in PERIPHERALS]
    assert parts.by_name["GPIOC"].base == 0x4001_1000
    assert parts.by_name["USART1"].place.clock == CLOCK_GATES["USART1"]
    assert (parts.rcc.name, parts.flash.name, parts.exti.name) == ("RCC", "FLASH", "EXTI")
    assert parts.usart(3).name == "USART3"


def test_deadlines_are_met_in_order_of_time(fake_chip: Any) -> None:
    fake_chip.write("RCC.CSR", 1)
    fake_chip.write("GPIOA.CRH", 0x4444_44B4)
    fake_chip.write("USART1.BRR", 69)
    fake_chip.write("USART1.CR1", 0x2008)
    assert fake_chip.parts.next_deadline() == 85_000
    fake_chip.now_ns = 10**6
    met = []
    while (due := fake_chip.parts.next_deadline()) is not None:
        met.append(due)
        fake_chip.pins.fabric.run_events(due)
    assert met == sorted(met)
    assert met[0] == 85_000
    assert met[-1] <= 10**6
    assert fake_chip.parts.next_deadline() is None
    assert fake_chip.read("RCC.CSR") & 2


def test_everything_is_as_new_after_a_power_reset(make_fake_chip: Any) -> None:
    chip, fresh = make_fake_chip(), make_fake_chip()
    chip.run_at_72_mhz()
    chip.write("AFIO.MAPR", 2 << 24 | 1 << 2)
    chip.write("GPIOB.CRL", 0x1111_1111)
    chip.write("EXTI.IMR", 0xFFFF)
    chip.write("USART1.BRR", 69)
    chip.write("USART1.CR1", 0x200C)
    chip.parts.reset(ResetCause.POWER)
    fresh.parts.reset(ResetCause.POWER)
    assert chip.parts.snapshot() == fresh.parts.snapshot()
    assert chip.pins.snapshot() == fresh.pins.snapshot()
    assert chip.clocks == fresh.clocks
    assert not any(chip.irqs.values())
