"""ADC1 and ADC2: registers, clock, and what is warned of; what they do is `extension/source/devices/adc.c`.

What an ADC samples are volts on pins (`fabric/signals.py`), worked out at the instant of sampling.

Source: RM0008 section 11, DS5319 tables 46 and 50.
Invariant: SR shows every conversion that has ended by the time of the read.
"""

from enum import IntEnum
from typing import ClassVar

from bluepill_sim.extension.layout import ADC
from bluepill_sim.fabric.fabric import OWN_COMMANDS, RESET
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits, numbered

#: Inputs by EXTSEL and by JEXTSEL, 0 to 6 (RM0008 tables 67 and 68); 7 is software.
REGULAR_TRIGGERS = ("tim1_cc1", "tim1_cc2", "tim1_cc3", "tim2_cc2", "tim3_trgo", "tim4_cc4", "exti_line11")
INJECTED_TRIGGERS = ("tim1_trgo", "tim1_cc4", "tim2_trgo", "tim2_cc1", "tim3_cc4", "tim4_trgo", "exti_line15")
_PINS = (*(f"PA{n}" for n in range(8)), "PB0", "PB1")


class AdcQuestion(IntEnum):
    """What the device warns of, with the number of the channel."""

    NOT_ANALOG = 0
    NO_PIN = 1
    NOT_ENABLED = 2
    TOO_FAST = 3
    CAL_OFF = 4


class AdcCommand(IntEnum):
    """A command of its own."""

    #: What is on the pins is about to change.
    INPUTS_CHANGE = OWN_COMMANDS


_WARNINGS = {
    AdcQuestion.NOT_ANALOG: "{pin} is converted (channel {channel}) and is no analog input ({mode})",
    AdcQuestion.NO_PIN: "channel {channel} leads to no pin of this package: it reads 0",
    AdcQuestion.NOT_ENABLED: "channel {channel} is converted while TSVREFE is 0: it reads 0",
    AdcQuestion.TOO_FAST: "ADCCLK is {mhz:g} MHz, above 14 MHz: RCC_CFGR ADCPRE divides PCLK2 by {divider}",
    AdcQuestion.CAL_OFF: "calibrated while ADON is 0",
}
#: Bits of CR1 and CR2 that ADC1 alone has: DUALMOD; DMA and TSVREFE.
_MASTER_CR1, _MASTER_CR2 = bits((19, 16)), bits(8, 23)
#: Bits of CR2 that start something and read 0.
_STARTS = bits(22, 21)


def _stored(name: str, offset: int, fields: str, reset: int = 0) -> Register:
    return Register(name=name, offset=offset, reset=reset, on_write=NATIVE, fields=fields)


def _registers(cr1: int, cr2: int) -> tuple[Register, ...]:
    """Return the registers, with the bits that CR1 and CR2 store."""
    return (
        Register(
            name="SR",
            offset=0x00,
            readable=bits((4, 0)),
            writable=0,
            write_zero_to_clear=bits((4, 0)),
            on_write=NATIVE,
            fields="STRT 4, JSTRT 3, JEOC 2, EOC 1, AWD 0",
        ),
        Register(
            name="CR1",
            offset=0x04,
            mask=cr1,
            on_write=NATIVE,
            fields="AWDEN 23, JAWDEN 22, DUALMOD 19:16, DISCNUM 15:13, JDISCEN 12, DISCEN 11, JAUTO 10, AWDSGL 9, "
            "SCAN 8, JEOCIE 7, AWDIE 6, EOCIE 5, AWDCH 4:0",
        ),
        Register(
            name="CR2",
            offset=0x08,
            readable=cr2,
            writable=cr2 | _STARTS,
            on_write=NATIVE,
            fields="TSVREFE 23, SWSTART 22, JSWSTART 21, EXTTRIG 20, EXTSEL 19:17, JEXTTRIG 15, JEXTSEL 14:12, "
            "ALIGN 11, DMA 8, RSTCAL 3, CAL 2, CONT 1, ADON 0",
        ),
        _stored("SMPR1", 0x0C, numbered("SMPn", range(17, 9, -1), 3, 10)),
        _stored("SMPR2", 0x10, numbered("SMPn", range(9, -1, -1), 3, 0)),
        *(_stored(f"JOFR{n}", 0x10 + 4 * n, f"JOFFSET{n} 11:0") for n in (1, 2, 3, 4)),
        _stored("HTR", 0x24, "HT 11:0", 0xFFF),
        _stored("LTR", 0x28, "LT 11:0"),
        _stored("SQR1", 0x2C, "L 23:20, " + numbered("SQn", range(16, 12, -1), 5, 13)),
        _stored("SQR2", 0x30, numbered("SQn", range(12, 6, -1), 5, 7)),
        _stored("SQR3", 0x34, numbered("SQn", range(6, 0, -1), 5, 1)),
        _stored("JSQR", 0x38, "JL 21:20, " + numbered("JSQn", range(4, 0, -1), 5, 1)),
        *(
            Register(
                name=f"JDR{n}",
                offset=0x38 + 4 * n,
                readable=bits((15, 0)),
                writable=0,
                on_read=NATIVE,
                fields="JDATA 15:0",
            )
            for n in (1, 2, 3, 4)
        ),
        Register(name="DR", offset=0x4C, writable=0, on_read=NATIVE, fields="ADC2DATA 31:16, DATA 15:0"),
    )


_CR1, _CR2 = bits((23, 22), (15, 0)), bits(20, (19, 17), (15, 11), (3, 0))


class Adc(Peripheral):
    """ADC1, the master of the two."""

    KIND, HOLDS = "adc", ADC
    OUTPUTS: ClassVar[tuple[str, ...]] = ("irq", "dma")
    INPUTS = REGULAR_TRIGGERS + INJECTED_TRIGGERS
    ENUMS = (AdcQuestion, AdcCommand)
    SOURCE = "RM0008 11.12"
    REGISTERS = _registers(_CR1 | _MASTER_CR1, _CR2 | _MASTER_CR2)

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self.native.number = int(place.name[-1])
        self.native.hz, self.native.divider = chip.clocks.pclk2_hz, chip.clocks.adc_divider
        self.command(RESET)
        chip.pins.route_listeners.append(self._route_changed)
        chip.pins.fabric.input_listeners.append(lambda: self.command(AdcCommand.INPUTS_CHANGE))

    def clock_name(self) -> str:
        """Return that of PCLK2."""
        return "pclk2_hz"

    def answer(self, what: int, value: int) -> None:
        """Warn."""
        question, divider = AdcQuestion(what), self.native.divider
        has_pin = question is AdcQuestion.NOT_ANALOG
        mode = self.chip.pins[_PINS[value]].mode.value if has_pin else ""
        text = _WARNINGS[question].format(
            pin=_PINS[value] if has_pin else "", mode=mode, channel=value, divider=divider,
            mhz=self.native.hz / divider / 1e6,
        )  # fmt: skip
        self.chip.warn(f"{self.name}: {text}", once=f"{self.name}:{question.name}:{value}")

    def _route_changed(self) -> None:
        remaps = self.chip.pins.remaps
        regular, injected = (remaps.get(f"{self.name}_ETRG{group}", 0) for group in ("REG", "INJ"))
        self.native.remapped = regular | injected << 1


class Adc2(Adc):
    """ADC2, which has no DMA, no internal channels and no DUALMOD of its own."""

    OUTPUTS = ("irq",)
    REGISTERS = _registers(_CR1, _CR2)
