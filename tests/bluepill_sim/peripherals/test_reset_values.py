"""Reset values of every modelled register, as the manuals print them; and that each exists.

Written from the manuals by hand: nothing here is made from the descriptions, which this judges.
Source: RM0008 (the register tables of each chapter), PM0056 chapter 4, PM0075 for FLASH, ARM C1 for DWT.
"""

import struct
from dataclasses import replace
from typing import Any

import pytest

from bluepill_sim import stm32f103
from bluepill_sim.board import BluePill
from bluepill_sim.core.system_control import PPB_BASE
from bluepill_sim.fabric import registers
from bluepill_sim.native import registers as native_registers
from bluepill_sim.peripherals.adc import Adc
from bluepill_sim.program.image import Image, SymbolTable

#: What is not 0, by peripheral and register; write-only registers read 0.
PERIPHERALS = {
    "RCC": {"CR": 0x0000_0083, "AHBENR": 0x14, "CSR": 0x0C00_0000},
    "FLASH": {"ACR": 0x30, "CR": 0x80, "OBR": 0x03FF_FFFC, "WRPR": 0xFFFF_FFFF},
    "AFIO": {},
    **{f"GPIO{port}": {"CRL": 0x4444_4444, "CRH": 0x4444_4444} for port in "CDE"},
    # The debug port's pulls show in IDR (RM0008 31.4.4).
    "GPIOA": {"CRL": 0x4444_4444, "CRH": 0x4444_4444, "IDR": 0xA000},
    "GPIOB": {"CRL": 0x4444_4444, "CRH": 0x4444_4444, "IDR": 0x0010},
    "EXTI": {},
    "DMA1": {},
    "ADC1": {"HTR": 0xFFF},
    "ADC2": {"HTR": 0xFFF},
    **{f"USART{number}": {"SR": 0xC0} for number in (1, 2, 3)},
    **{f"SPI{number}": {"SR": 0x02, "CRCPR": 7} for number in (1, 2)},
    **{f"I2C{number}": {"TRISE": 2} for number in (1, 2)},
    "CAN": {"MCR": 0x1_0002, "MSR": 0xC02, "TSR": 0x1C00_0000, "BTR": 0x0123_0000, "FMR": 0x2A1C_0E01},
    "USB": {"CNTR": 3},
    "IWDG": {"RLR": 0xFFF},
    "WWDG": {"CR": 0x7F, "CFR": 0x7F},
    **{f"TIM{number}": {"ARR": 0xFFFF} for number in (1, 2, 3, 4)},
    "CRC": {"DR": 0xFFFF_FFFF},
    "BKP": {},
    "RTC": {"CRL": 0x20, "DIVL": 0x8000, "ALRH": 0xFFFF, "ALRL": 0xFFFF},
    "PWR": {},
}
#: Reset values of the core's registers; GPIOA's IDR apart, nothing here depends on the outside.
CORE = {
    0xE000_E004: 1,  # ICTR
    0xE000_E010: 0, 0xE000_E014: 0, 0xE000_E018: 0, 0xE000_E01C: 0x4000_2328,  # SysTick
    **{0xE000_E100 + 0x80 * kind + 4 * word: 0 for kind in range(5) for word in (0, 1)},  # NVIC
    **{0xE000_E400 + 4 * word: 0 for word in range(11)},
    0xE000_ED00: 0x411F_C231,  # CPUID
    0xE000_ED08: 0,  # VTOR
    0xE000_ED0C: 0xFA05_0000,  # AIRCR
    0xE000_ED10: 0, 0xE000_ED14: 0x200,  # SCR, CCR
    0xE000_ED18: 0, 0xE000_ED1C: 0, 0xE000_ED20: 0, 0xE000_ED24: 0,  # SHPR1 to SHPR3, SHCSR
    0xE000_ED28: 0, 0xE000_ED2C: 0, 0xE000_ED34: 0, 0xE000_ED38: 0,  # CFSR, HFSR, MMFAR, BFAR
    0xE000_EDFC: 0,  # DEMCR
    0xE000_1000: 0x4000_0000, 0xE000_1004: 0,  # DWT_CTRL, CYCCNT
    0xE004_2000: 0x2003_6410, 0xE004_2004: 0,  # DBGMCU
}  # fmt: skip


NAMES = [name for _, name in stm32f103.PERIPHERALS]


def differences(part: Any) -> list[str]:
    """Return what a peripheral reads that the manual does not say; one without a row has zeros only."""
    manual = PERIPHERALS.get(part.name, {})
    found = []
    for register in part.REGISTERS:
        value, right = part.read(register.offset, 4), manual.get(register.name, 0)
        if value != right:
            found.append(f"{part.name}.{register.name} reads {value:#x}, the manual says {right:#x}")
    missing = sorted(manual.keys() - {register.name for register in part.REGISTERS})
    return found + [f"{part.name}.{name} is not there" for name in missing]


def test_no_row_is_for_a_peripheral_that_is_not_there() -> None:
    assert not PERIPHERALS.keys() - set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_registers_read_their_reset_values(fake_chip: Any, name: str) -> None:
    assert differences(fake_chip.parts.by_name[name]) == []


@pytest.mark.parametrize(
    ("name", "field", "wrong", "reported"),
    [
        ("HTR", "reset", 0xFFE, "ADC1.HTR reads 0xffe, the manual says 0xfff"),
        ("LTR", "reset", 1, "ADC1.LTR reads 0x1, the manual says 0x0"),
        ("HTR", "name", "HTX", "ADC1.HTR is not there"),
    ],
)
def test_a_wrong_value_in_a_description_is_named(
    fake_chip: Any, monkeypatch: pytest.MonkeyPatch, name: str, field: str, wrong: object, reported: str
) -> None:
    planted = tuple(replace(one, mask=0, **{field: wrong}) if one.name == name else one for one in Adc.REGISTERS)
    monkeypatch.setattr(Adc, "REGISTERS", planted)
    for table in (registers._table_of, native_registers._table_of):
        table.cache_clear()
    try:
        assert reported in differences(type(fake_chip)().parts.by_name["ADC1"])
    finally:
        for table in (registers._table_of, native_registers._table_of):
            table.cache_clear()


@pytest.mark.parametrize("name", NAMES)
def test_a_reset_brings_them_back(fake_chip: Any, name: str) -> None:
    """Whatever was written; BDCR and the flags of CSR have a test of their own, and USB's memory keeps what it has."""
    part = fake_chip.parts.by_name[name]
    for register in part.REGISTERS:
        is_memory = register.name.startswith("PMA_")
        if (name, register.name) not in {("RCC", "APB1RSTR"), ("RCC", "APB2RSTR")} and not is_memory:
            part.write(register.offset, 4, 0x5555_5555)
    part.reset()
    assert differences(part) == []


def test_the_cores_registers_read_their_reset_values() -> None:
    image = Image("idle", ((0x0800_0000, struct.pack("<IIH", 0x2000_5000, 0x0800_0009, 0xE7FE)),), SymbolTable(()))
    board = BluePill(image)
    for address, value in CORE.items():
        assert hex(board.chip.system.read(address - PPB_BASE, 4)) == hex(value), hex(address)
    assert board.warnings == []
