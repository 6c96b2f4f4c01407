"""TIM1, the advanced-control timer, and TIM2 to TIM4, the general-purpose ones: what their registers are.

What they do is `extension/source/devices/tim.c` (which has the theory of operation), `tim_counter.c`, `tim_outputs.c`
and `tim_inputs.c`; here are the registers, the pins that AFIO gives them, and their clocks.

Source: RM0008 sections 14 and 15; 9.3.7 (remaps).
Invariant: the struct's pins are those that AFIO has given.
"""

from enum import IntEnum
from typing import ClassVar

from bluepill_sim.extension.layout import TIM
from bluepill_sim.fabric.fabric import CLOCK, OWN_COMMANDS, ROUTE
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits, fields_of

#: The alternate functions, in the order of `outputs` in the struct.
_OUTPUTS = ("CH1", "CH2", "CH3", "CH4", "CH1N", "CH2N", "CH3N")
#: Pins by the value of the remap field: CH1 to CH4, CH1N to CH3N, ETR, BKIN (RM0008 tables 43 to 46).
PINS = {
    "TIM1": {
        0: "PA8 PA9 PA10 PA11 PB13 PB14 PB15 PA12 PB12",
        1: "PA8 PA9 PA10 PA11 PA7 PB0 PB1 PA12 PA6",
        3: "PE9 PE11 PE13 PE14 PE8 PE10 PE12 PE7 PE15",
    },
    "TIM2": {
        0: "PA0 PA1 PA2 PA3 - - - PA0 -",
        1: "PA15 PB3 PA2 PA3 - - - PA15 -",
        2: "PA0 PA1 PB10 PB11 - - - PA0 -",
        3: "PA15 PB3 PB10 PB11 - - - PA15 -",
    },
    "TIM3": {
        0: "PA6 PA7 PB0 PB1 - - - PD2 -",
        2: "PB4 PB5 PB0 PB1 - - - PD2 -",
        3: "PC6 PC7 PC8 PC9 - - - PD2 -",
    },
    "TIM4": {
        0: "PB6 PB7 PB8 PB9 - - - PE0 -",
        1: "PD12 PD13 PD14 PD15 - - - PE0 -",
    },
}

_EVENTS = (
    "trgo",
    "cc1",
    "cc2",
    "cc3",
    "cc4",
    "up_dma",
    "cc1_dma",
    "cc2_dma",
    "cc3_dma",
    "cc4_dma",
    "com_dma",
    "trig_dma",
)


class TimCommand(IntEnum):
    """A command of its own."""

    #: Put one of `pins` on another pin.
    MOVE = OWN_COMMANDS
    #: Listen again after a state was put back.
    RESUME = OWN_COMMANDS + 1
    #: Make CNT known.
    INTRODUCE = OWN_COMMANDS + 2


def _register(name: str, index: int, fields: str, **more: object) -> Register:
    """Return a register that takes and reads its fields, and of which each write matters."""
    mask = bits(*((field.high, field.low) for field in fields_of(fields)))
    options = {"readable": mask, "writable": mask, "on_write": NATIVE, "fields": fields} | more
    return Register(name=name, offset=4 * index, **options)  # type: ignore[arg-type]  # options of Register


def _modes(first: int) -> str:
    """Return the fields of CCMRx for outputs; those for inputs stand at the same places."""
    high, low = first + 1, first
    return (
        f"OC{high}CE 15, OC{high}M 14:12, OC{high}PE 11, OC{high}FE 10, CC{high}S 9:8, "
        f"OC{low}CE 7, OC{low}M 6:4, OC{low}PE 3, OC{low}FE 2, CC{low}S 1:0"
    )


def _registers(is_advanced: bool) -> tuple[Register, ...]:
    """Return the registers of TIM1, or of the others, which have fewer fields."""

    def only(advanced: str, general: str = "") -> str:
        return advanced if is_advanced else general

    flags = only(
        "CC4OF 12, CC3OF 11, CC2OF 10, CC1OF 9, BIF 7, TIF 6, COMIF 5, ",
        "CC4OF 12, CC3OF 11, CC2OF 10, CC1OF 9, TIF 6, ",
    )
    flags += "CC4IF 4, CC3IF 3, CC2IF 2, CC1IF 1, UIF 0"
    events = only("BG 7, TG 6, COMG 5, ", "TG 6, ") + "CC4G 4, CC3G 3, CC2G 2, CC1G 1, UG 0"
    flag_bits = bits(*((field.high, field.low) for field in fields_of(flags)))
    event_bits = bits(*((field.high, field.low) for field in fields_of(events)))
    outputs = only(
        "CC4P 13, CC4E 12, CC3NP 11, CC3NE 10, CC3P 9, CC3E 8, CC2NP 7, CC2NE 6, CC2P 5, CC2E 4, "
        "CC1NP 3, CC1NE 2, CC1P 1, CC1E 0",
        "CC4P 13, CC4E 12, CC3P 9, CC3E 8, CC2P 5, CC2E 4, CC1P 1, CC1E 0",
    )
    enables = only("TDE 14, COMDE 13, ", "TDE 14, ") + "CC4DE 12, CC3DE 11, CC2DE 10, CC1DE 9, UDE 8, "
    enables += only("BIE 7, TIE 6, COMIE 5, ", "TIE 6, ") + "CC4IE 4, CC3IE 3, CC2IE 2, CC1IE 1, UIE 0"
    idle = "OIS4 14, OIS3N 13, OIS3 12, OIS2N 11, OIS2 10, OIS1N 9, OIS1 8, TI1S 7, MMS 6:4, CCDS 3, CCUS 2, CCPC 0"
    made = [
        _register("CR1", 0, "CKD 9:8, ARPE 7, CMS 6:5, DIR 4, OPM 3, URS 2, UDIS 1, CEN 0", on_read=NATIVE),
        _register("CR2", 1, only(idle, "TI1S 7, MMS 6:4, CCDS 3")),
        _register("SMCR", 2, "ETP 15, ECE 14, ETPS 13:12, ETF 11:8, MSM 7, TS 6:4, SMS 2:0"),
        _register("DIER", 3, enables),
        _register("SR", 4, flags, writable=0, write_zero_to_clear=flag_bits, on_read=NATIVE),
        _register("EGR", 5, events, readable=0, writable=event_bits),
        _register("CCMR1", 6, _modes(1)),
        _register("CCMR2", 7, _modes(3)),
        _register("CCER", 8, outputs),
        _register("CNT", 9, "CNT 15:0", on_read=NATIVE),
        _register("PSC", 10, "PSC 15:0"),
        _register("ARR", 11, "ARR 15:0", reset=0xFFFF),
        *(_register(f"CCR{n + 1}", 13 + n, f"CCR{n + 1} 15:0", on_read=NATIVE) for n in range(4)),
        _register("DCR", 18, "DBL 12:8, DBA 4:0"),
        _register("DMAR", 19, "DMAB 15:0", readable=0, on_read=NATIVE),
    ]
    if is_advanced:
        made.append(_register("RCR", 12, "REP 7:0"))
        made.append(_register("BDTR", 17, "MOE 15, AOE 14, BKP 13, BKE 12, OSSR 11, OSSI 10, LOCK 9:8, DTG 7:0"))
    return tuple(sorted(made, key=lambda register: register.offset))


class GeneralTimer(Peripheral):
    """TIM2, TIM3 or TIM4."""

    KIND, HOLDS = "tim", TIM
    ENUMS: ClassVar[tuple[type[IntEnum], ...]] = (TimCommand,)
    OUTPUTS: ClassVar[tuple[str, ...]] = (*_EVENTS, "irq")
    INPUTS: ClassVar[tuple[str, ...]] = ("itr0", "itr1", "itr2", "itr3")
    SOURCE: ClassVar[str] = "RM0008 15.4"
    REGISTERS = _registers(is_advanced=False)

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self._pins = PINS[place.name]
        self.native.base = place.base
        self.native.is_advanced = place.name == "TIM1"
        for number, name in enumerate(_OUTPUTS[: 7 if self.native.is_advanced else 4]):
            self.native.sources[number] = ALTERNATE_FUNCTIONS.index(f"{place.name}_{name}")
        self.native.pins[:] = self._routed_pins()
        self.command(CLOCK, self.clock_hz())
        self.command(TimCommand.INTRODUCE)
        self.reset()
        chip.pins.route_listeners.append(self._route_changed)

    def clock_name(self) -> str:
        """Return that of CK_INT: PCLK1, doubled where its prescaler is not 1."""
        return "timer1_hz"

    def fields_now(self, register: Register, word: int) -> str:
        """Return the fields of a register: those of CCMRx are others for a channel that is an input."""
        if not register.name.startswith("CCMR"):
            return register.fields
        fields = register.fields.split(", ")
        first = 2 * int(register.name[-1]) - 1
        high = f"IC{first + 1}F 15:12, IC{first + 1}PSC 11:10, {fields[4]}" if word & 0x300 else ", ".join(fields[:5])
        low = f"IC{first}F 7:4, IC{first}PSC 3:2, {fields[9]}" if word & 3 else ", ".join(fields[5:])
        return f"{high}, {low}"

    def _routed_pins(self) -> list[int]:
        """Return the pins that AFIO now gives; PA0 where a timer has no such pin."""
        names = self._pins.get(self.chip.pins.remaps.get(self.name, 0), self._pins[0])
        return [0 if name == "-" else self.chip.pins[name].index for name in names.split()]

    def _route_changed(self) -> None:
        """Move to the pins that AFIO now gives."""
        wanted = self._routed_pins()
        if wanted != list(self.native.pins):
            for number, pin in enumerate(wanted):
                self.command(TimCommand.MOVE, number, pin)
            self.command(ROUTE)

    def _restored(self) -> None:
        self.command(TimCommand.RESUME)


class AdvancedTimer(GeneralTimer):
    """TIM1."""

    INPUTS = (*GeneralTimer.INPUTS, "css")
    OUTPUTS: ClassVar[tuple[str, ...]] = (*_EVENTS, "brk_irq", "up_irq", "trg_com_irq", "cc_irq")
    SOURCE: ClassVar[str] = "RM0008 14.4"
    REGISTERS = _registers(is_advanced=True)

    def clock_name(self) -> str:
        """Return that of CK_INT: PCLK2, doubled where its prescaler is not 1."""
        return "timer2_hz"
