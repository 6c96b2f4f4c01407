"""The STM32F103C8T6 on one page: memory map, peripherals, interrupts, pins.

Source: RM0008 sections 3.1 (memory map), 7.3 (enable registers) and 10.1.2
(vector table), data sheet DS5319 tables 3 and 5 (LQFP48).
Invariant: every modelled peripheral stands in `PERIPHERALS`; what is only
named stands in `BASES`, so that a warning can name what was touched.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from itertools import count
from typing import TypeAlias, cast

from bluepill_sim.fabric.fabric import Fabric, FabricPorts
from bluepill_sim.fabric.pins import PinBank
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import ClockBit, Peripheral, PeripheralMapping, fields_of
from bluepill_sim.peripherals import flash
from bluepill_sim.peripherals.adc import Adc, Adc2
from bluepill_sim.peripherals.afio import Afio
from bluepill_sim.peripherals.bkp import Bkp
from bluepill_sim.peripherals.can import Can
from bluepill_sim.peripherals.crc import Crc
from bluepill_sim.peripherals.dma import Dma
from bluepill_sim.peripherals.exti import Exti
from bluepill_sim.peripherals.flash import Flash
from bluepill_sim.peripherals.gpio import Gpio
from bluepill_sim.peripherals.i2c import I2c
from bluepill_sim.peripherals.iwdg import Iwdg
from bluepill_sim.peripherals.pwr import Pwr
from bluepill_sim.peripherals.rcc import Rcc, ResetCause
from bluepill_sim.peripherals.rtc import Rtc
from bluepill_sim.peripherals.spi import Spi
from bluepill_sim.peripherals.tim import AdvancedTimer, GeneralTimer
from bluepill_sim.peripherals.usart import Usart
from bluepill_sim.peripherals.usb import Usb
from bluepill_sim.peripherals.wwdg import Wwdg
from simbase.state import Stateful

FLASH_BASE = flash.FLASH_BASE
#: The C8 is sold with 64 KiB and carries 128 KiB; programs that use the upper half run on most boards.
FLASH_BYTES = 64 * 1024
FLASH_BYTES_FITTED = 128 * 1024
SRAM_BASE = 0x2000_0000
SRAM_BYTES = 20 * 1024
#: Boot loader ROM; the option bytes follow it.
SYSTEM_MEMORY_BASE = 0x1FFF_F000
#: Unique id (12 bytes) and flash size in KiB (2 bytes): in system memory, after the boot loader.
FLASH_SIZE_REGISTER, UNIQUE_ID_REGISTER = 0x1FFF_F7E0, 0x1FFF_F7E8
OPTION_BYTES_BASE = 0x1FFF_F800
PERIPHERAL_BASE, PERIPHERAL_END = 0x4000_0000, 0x4002_3400
#: Interrupt lines of a medium-density part: 0 to 42.
IRQ_COUNT = 43
#: Pins with a leg on LQFP48; PB2 is BOOT1, PD0/PD1 the crystal.
BONDED_PINS = frozenset(
    [f"PA{n}" for n in range(16)] + [f"PB{n}" for n in range(16)] + ["PC13", "PC14", "PC15", "PD0", "PD1"]
)
#: Pins that bear 5 V (DS5319 table 5, column "FT").
FIVE_VOLT_PINS = frozenset([f"PA{n}" for n in range(8, 16)] + [f"PB{n}" for n in (2, 3, 4, *range(6, 16))])

#: Base of every peripheral of the F103 family, for warnings by name (RM0008 table 3).
BASES = {
    "TIM2": 0x4000_0000,
    "TIM3": 0x4000_0400,
    "TIM4": 0x4000_0800,
    "TIM5": 0x4000_0C00,
    "TIM6": 0x4000_1000,
    "TIM7": 0x4000_1400,
    "TIM12": 0x4000_1800,
    "TIM13": 0x4000_1C00,
    "TIM14": 0x4000_2000,
    "RTC": 0x4000_2800,
    "WWDG": 0x4000_2C00,
    "IWDG": 0x4000_3000,
    "SPI2": 0x4000_3800,
    "SPI3": 0x4000_3C00,
    "USART2": 0x4000_4400,
    "USART3": 0x4000_4800,
    "UART4": 0x4000_4C00,
    "UART5": 0x4000_5000,
    "I2C1": 0x4000_5400,
    "I2C2": 0x4000_5800,
    "USB": 0x4000_5C00,
    "USB/CAN SRAM": 0x4000_6000,
    "CAN": 0x4000_6400,
    "BKP": 0x4000_6C00,
    "PWR": 0x4000_7000,
    "DAC": 0x4000_7400,
    "AFIO": 0x4001_0000,
    "EXTI": 0x4001_0400,
    "GPIOA": 0x4001_0800,
    "GPIOB": 0x4001_0C00,
    "GPIOC": 0x4001_1000,
    "GPIOD": 0x4001_1400,
    "GPIOE": 0x4001_1800,
    "GPIOF": 0x4001_1C00,
    "GPIOG": 0x4001_2000,
    "ADC1": 0x4001_2400,
    "ADC2": 0x4001_2800,
    "TIM1": 0x4001_2C00,
    "SPI1": 0x4001_3000,
    "TIM8": 0x4001_3400,
    "USART1": 0x4001_3800,
    "ADC3": 0x4001_3C00,
    "TIM9": 0x4001_4C00,
    "TIM10": 0x4001_5000,
    "TIM11": 0x4001_5400,
    "SDIO": 0x4001_8000,
    "DMA1": 0x4002_0000,
    "DMA2": 0x4002_0400,
    "RCC": 0x4002_1000,
    "FLASH": 0x4002_2000,
    "CRC": 0x4002_3000,
    "ETH": 0x4002_8000,
    "USB OTG": 0x5000_0000,
    "FSMC": 0xA000_0000,
    "DBGMCU": 0xE004_2000,
}
_NAMES = sorted((base, name) for name, base in BASES.items())
#: The blocks that are larger than 1 KiB; that of USB has its packets.
_LARGE_BYTES = {"USB": 0x800, "ETH": 0x2000, "USB OTG": 0x4_0000, "FSMC": 0x1000}

#: Enable bit by peripheral, modelled or not, as RCC's fields name them (GPIOA is IOPA there); who is missing is always
#: clocked. FLITF and SRAM, whose bits count in sleep alone, are no peripherals.
CLOCK_GATES = {
    name: ClockBit(register.name, field.high)
    for register in Rcc.REGISTERS
    if register.name.endswith("ENR")
    for field in fields_of(register.fields)
    if (name := field.name.replace("IOP", "GPIO")) in BASES
}

_Maker: TypeAlias = Callable[[ChipPorts, PeripheralMapping], Peripheral]


#: The modelled peripherals, in the order in which they are made, reset and act.
PERIPHERALS: tuple[tuple[_Maker, str], ...] = (
    (partial(Rcc, gates=CLOCK_GATES), "RCC"),
    (Flash, "FLASH"),
    (Afio, "AFIO"),
    (Gpio, "GPIOA"),
    (Gpio, "GPIOB"),
    (Gpio, "GPIOC"),
    (Gpio, "GPIOD"),
    (Gpio, "GPIOE"),
    (Exti, "EXTI"),
    (Dma, "DMA1"),
    (Adc, "ADC1"),
    (Adc2, "ADC2"),
    (Usart, "USART1"),
    (Usart, "USART2"),
    (Usart, "USART3"),
    (Spi, "SPI1"),
    (Spi, "SPI2"),
    (I2c, "I2C1"),
    (I2c, "I2C2"),
    (Can, "CAN"),
    (Usb, "USB"),
    (Iwdg, "IWDG"),
    (Wwdg, "WWDG"),
    (AdvancedTimer, "TIM1"),
    (GeneralTimer, "TIM2"),
    (GeneralTimer, "TIM3"),
    (GeneralTimer, "TIM4"),
    (Crc, "CRC"),
    (Bkp, "BKP"),
    (Rtc, "RTC"),
    (Pwr, "PWR"),
)


#: The requests of each channel of DMA1 (RM0008 table 78).
_REQUESTS = {
    1: ("ADC1.dma", "TIM2.cc3_dma", "TIM4.cc1_dma"),
    2: ("SPI1.rx_dma", "USART3.tx_dma", "TIM1.cc1_dma", "TIM2.up_dma", "TIM3.cc3_dma"),
    3: ("SPI1.tx_dma", "USART3.rx_dma", "TIM1.cc2_dma", "TIM3.cc4_dma", "TIM3.up_dma"),
    4: (
        "SPI2.rx_dma", "USART1.tx_dma", "I2C2.tx_dma",
        "TIM1.cc4_dma", "TIM1.trig_dma", "TIM1.com_dma", "TIM4.cc2_dma",
    ),
    5: ("SPI2.tx_dma", "USART1.rx_dma", "I2C2.rx_dma", "TIM1.up_dma", "TIM2.cc1_dma", "TIM4.cc3_dma"),
    6: ("USART2.rx_dma", "I2C1.tx_dma", "TIM1.cc3_dma", "TIM3.cc1_dma", "TIM3.trig_dma"),
    7: ("USART2.tx_dma", "I2C1.rx_dma", "TIM2.cc2_dma", "TIM2.cc4_dma", "TIM4.up_dma"),
}  # fmt: skip
_DMA1_REQUESTS = {output: (f"DMA1.ch{n}",) for n, outputs in _REQUESTS.items() for output in outputs}

#: Where each output leads: interrupts by their numbers (RM0008 10.1.2), inputs of devices by their names. Outputs
#: that lead to the same are one line, which is their OR; the source may be a device that is not modelled.
WIRING: dict[str, tuple[int | str, ...]] = {
    "WWDG.irq": (0,),
    "EXTI.pvd_irq": (1,),
    "BKP.irq": (2,),
    "RTC.irq": (3,),
    "FLASH.irq": (4,),
    "RCC.irq": (5,),
    "EXTI.0": (6,),
    "EXTI.1": (7,),
    "EXTI.2": (8,),
    "EXTI.3": (9,),
    "EXTI.4": (10,),
    **{f"DMA1.ch{n}_irq": (10 + n,) for n in range(1, 8)},
    "ADC1.irq": (18,),
    "ADC2.irq": (18,),
    "CAN.tx_irq": (19,),
    "USB.hp_irq": (19,),
    "CAN.rx0_irq": (20,),
    "USB.lp_irq": (20,),
    "CAN.rx1_irq": (21,),
    "CAN.sce_irq": (22,),
    "EXTI.9_5": (23,),
    "TIM1.brk_irq": (24,),
    "TIM1.up_irq": (25,),
    "TIM1.trg_com_irq": (26,),
    "TIM1.cc_irq": (27,),
    "TIM2.irq": (28,),
    "TIM3.irq": (29,),
    "TIM4.irq": (30,),
    "I2C1.event_irq": (31,),
    "I2C1.error_irq": (32,),
    "I2C2.event_irq": (33,),
    "I2C2.error_irq": (34,),
    "SPI1.irq": (35,),
    "SPI2.irq": (36,),
    "USART1.irq": (37,),
    "USART2.irq": (38,),
    "USART3.irq": (39,),
    "EXTI.15_10": (40,),
    "EXTI.rtc_alarm_irq": (41,),
    "EXTI.usb_wakeup_irq": (42,),
    # EXTI 16 to 18 (RM0008 10.2.5).
    "PWR.pvd": ("EXTI.pvd",),
    "RTC.alarm": ("EXTI.rtc_alarm", "BKP.alarm", "PWR.alarm"),
    "RTC.second": ("BKP.second",),
    "IWDG.lsi": ("RCC.lsi",),
    "RCC.css": ("TIM1.css",),
    "USB.wakeup": ("EXTI.usb_wakeup",),
    "CAN.packets": ("USB.can",),
    **_DMA1_REQUESTS,
    # Triggers: of other timers (RM0008 tables 82 and 86), of both ADCs' regular and injected groups (67 and 68).
    "TIM1.trgo": ("TIM2.itr0", "TIM3.itr0", "TIM4.itr0", "ADC1.tim1_trgo", "ADC2.tim1_trgo"),
    "TIM2.trgo": ("TIM1.itr1", "TIM3.itr1", "TIM4.itr1", "ADC1.tim2_trgo", "ADC2.tim2_trgo"),
    "TIM3.trgo": ("TIM1.itr2", "TIM2.itr2", "TIM4.itr2", "ADC1.tim3_trgo", "ADC2.tim3_trgo"),
    "TIM4.trgo": ("TIM1.itr3", "TIM2.itr3", "TIM3.itr3", "ADC1.tim4_trgo", "ADC2.tim4_trgo"),
    "TIM1.cc1": ("ADC1.tim1_cc1", "ADC2.tim1_cc1"),
    "TIM1.cc2": ("ADC1.tim1_cc2", "ADC2.tim1_cc2"),
    "TIM1.cc3": ("ADC1.tim1_cc3", "ADC2.tim1_cc3"),
    "TIM2.cc2": ("ADC1.tim2_cc2", "ADC2.tim2_cc2"),
    "TIM4.cc4": ("ADC1.tim4_cc4", "ADC2.tim4_cc4"),
    "EXTI.line11": ("ADC1.exti_line11", "ADC2.exti_line11"),
    "TIM1.cc4": ("ADC1.tim1_cc4", "ADC2.tim1_cc4"),
    "TIM2.cc1": ("ADC1.tim2_cc1", "ADC2.tim2_cc1"),
    "TIM3.cc4": ("ADC1.tim3_cc4", "ADC2.tim3_cc4"),
    "EXTI.line15": ("ADC1.exti_line15", "ADC2.exti_line15"),
}
#: The interrupts that end Stop, as a mask: those of EXTI.
WAKING_IRQS = sum(
    1 << end for output, ends in WIRING.items() for end in ends if output.startswith("EXTI.") and isinstance(end, int)
)
#: The bits of DBGMCU_CR that freeze a peripheral while a debugger halts the core (RM0008 31.16.3).
FREEZE_BITS = {
    "IWDG": 8, "WWDG": 9, "TIM1": 10, "TIM2": 11, "TIM3": 12, "TIM4": 13, "CAN": 14, "I2C1": 15, "I2C2": 16,
}  # fmt: skip
#: The first line that is no interrupt.
_FIRST_INNER_LINE = 64


@dataclass(frozen=True, slots=True)
class ChipParts(Stateful):
    """The peripherals of one chip."""

    #: All of them by name, in the order of `PERIPHERALS`.
    by_name: dict[str, Peripheral]

    @property
    def rcc(self) -> Rcc:
        """Reset and clock control."""
        return cast("Rcc", self.by_name["RCC"])

    @property
    def flash(self) -> Flash:
        """Flash memory interface."""
        return cast("Flash", self.by_name["FLASH"])

    @property
    def exti(self) -> Exti:
        """External interrupt/event controller."""
        return cast("Exti", self.by_name["EXTI"])

    @property
    def pwr(self) -> Pwr:
        """Power control."""
        return cast("Pwr", self.by_name["PWR"])

    @property
    def rtc(self) -> Rtc:
        """The real-time clock."""
        return cast("Rtc", self.by_name["RTC"])

    @property
    def has_running_watchdog(self) -> bool:
        """Whether a watchdog will reset the chip unless it is fed."""
        iwdg, wwdg = cast("Iwdg", self.by_name["IWDG"]), cast("Wwdg", self.by_name["WWDG"])
        return iwdg.is_running or wwdg.is_running

    def usart(self, number: int) -> Usart:
        """USART 1, 2 or 3."""
        return cast("Usart", self.by_name[f"USART{number}"])

    def reset(self, cause: ResetCause) -> None:
        """Reset every peripheral; the clocks first, so that the old ones are not taken for too fast."""
        self.rcc.reset(cause)
        if cause is ResetCause.POWER:
            self.reset_backup_domain()
            self.pwr.forget_flags()
        for part in self.by_name.values():
            if part is not self.rcc:
                part.reset()

    def stop(self) -> None:
        """Have what the core's clocks drive stand still."""
        self.rcc.stop()
        for part in self.by_name.values():
            part.clock_stopped()

    def resume(self, stopped_ns: int) -> None:
        """Have it go on, after so long."""
        for part in self.by_name.values():
            part.clock_resumed(stopped_ns)

    def stand_by(self) -> None:
        """Forget what Standby forgets: all but the backup domain, IWDG, the flags and the pin of PWR."""
        self.rcc.stand_by()
        for name, part in self.by_name.items():
            if name not in {"RCC", "PWR", "IWDG"}:
                part.reset()
        self.pwr.note_standby()

    def reset_backup_domain(self) -> None:
        """Reset what VBAT keeps."""
        for part in self.by_name.values():
            part.backup_reset()

    def clock_changed(self) -> None:
        """Notify every peripheral that the frequencies have changed."""
        self.rcc.fabric.clocks_changed()
        for part in self.by_name.values():
            part.clock_changed()

    def next_deadline(self) -> int | None:
        """Return when the first of them next acts by itself, in ns, or None for never."""
        return self.rcc.fabric.next_ns


def make_pins(chip: FabricPorts) -> PinBank:
    """Return the pins of the chip in its 48-pin package."""
    return PinBank(chip, BONDED_PINS, FIVE_VOLT_PINS)


def make_parts(chip: ChipPorts) -> ChipParts:
    """Return the peripherals of one chip, in their state after power-on; `chip.pins` and `chip.clocks` come first."""
    by_name: dict[str, Peripheral] = {}
    for make, name in PERIPHERALS:
        size = _LARGE_BYTES.get(name, 0x400)
        by_name[name] = make(
            chip, PeripheralMapping(name=name, base=BASES[name], clock=CLOCK_GATES.get(name), size=size)
        )
    _wire(by_name, chip.pins.fabric)
    return ChipParts(by_name)


def line_of(output: str) -> int:
    """Return the number of the line that an output is on, such as "RTC.alarm".

    Raises:
        KeyError: The table does not have it.
    """
    return _lines()[WIRING[output]]


def _lines() -> dict[tuple[int | str, ...], int]:
    """Return the number of each line by where it leads: that of its interrupt, or the next one inside the chip."""
    numbers: dict[tuple[int | str, ...], int] = {}
    inner = count(_FIRST_INNER_LINE)
    for ends in WIRING.values():
        if ends not in numbers:
            irqs = [end for end in ends if isinstance(end, int)]
            numbers[ends] = irqs[0] if irqs else next(inner)
    return numbers


def _wire(parts: dict[str, Peripheral], fabric: Fabric) -> None:
    """Wire the devices as the table says.

    Raises:
        ValueError: The table has a name that there is not, or two lines that lead to one end.
    """
    outputs, inputs = _wires(tuple(WIRING.items()), tuple((name, type(part)) for name, part in parts.items()))
    for device, number, line in outputs:
        fabric.put_output(parts[device].slot, number, line)
    for device, number, line in inputs:
        fabric.wire(line, parts[device].slot, number)


#: Name of a device, number of its output or input, and the line.
_Wires: TypeAlias = list[tuple[str, int, int]]


@cache
def _wires(
    wiring: tuple[tuple[str, tuple[int | str, ...]], ...], parts: tuple[tuple[str, type[Peripheral]], ...]
) -> tuple[_Wires, _Wires]:
    """Return the outputs that are on lines, and the inputs, of these devices by a table such as `WIRING`."""
    lines, kinds = _lines(), dict(parts)
    outputs, inputs = [], []
    for output, ends in wiring:
        found = _find(output, kinds, "output", lambda kind: kind.OUTPUTS)
        if found is not None:
            outputs.append((*found, lines[ends]))
    led: set[int | str] = set()
    for ends, line in lines.items():
        for end in ends:
            if end in led:
                raise ValueError(f"WIRING: two lines lead to {end}")
            led.add(end)
            if isinstance(end, int):
                if end != line or end >= IRQ_COUNT:
                    raise ValueError(f"WIRING: {end} is no interrupt that can be on line {line}")
            elif (found := _find(end, kinds, "input", lambda kind: kind.INPUTS)) is not None:
                inputs.append((*found, line))
    return outputs, inputs


def _find(
    name: str, parts: dict[str, type[Peripheral]], what: str, names_of: Callable[[type[Peripheral]], tuple[str, ...]]
) -> tuple[str, int] | None:
    """Return device and number of an output or input; None of a device that is not modelled."""
    device, _, end = name.partition(".")
    if device not in BASES:
        raise ValueError(f"WIRING: {name}: the chip has no {device}")
    if device not in parts:
        return None
    names = names_of(parts[device])
    if end not in names:
        raise ValueError(f"WIRING: {name}: {device} has no {what} {end!r}; it has {', '.join(names) or 'none'}")
    return device, names.index(end)


def is_in_sram(address: int) -> bool:
    """Tell whether an address is in the SRAM."""
    return SRAM_BASE <= address < SRAM_BASE + SRAM_BYTES


def may_hold_code(address: int, flash: int = FLASH_BASE) -> bool:
    """Tell whether an address is in the flash, which a program's file has at 0x08000000 or 0, or in the SRAM."""
    return flash <= address < flash + FLASH_BYTES_FITTED or is_in_sram(address)


def without_alias(address: int) -> int:
    """Return where in the flash an address is that may be in its alias at 0; any other address as it is."""
    return address + FLASH_BASE if address < FLASH_BYTES_FITTED else address


def name_at(address: int) -> str | None:
    """Return which peripheral of the family an address belongs to, modelled or not; None: of none."""
    index = bisect_right(_NAMES, (address, "\U0010ffff")) - 1
    if index < 0:
        return None
    base, name = _NAMES[index]
    return name if address - base < _LARGE_BYTES.get(name, 0x400) else None
