"""AFIO: which function has which pin, and which port feeds each EXTI line.

Modelled: SWJ_CFG (the debug port keeps PA13, PA14, PA15, PB3 and PB4 until it
is released), PD01_REMAP, the EXTI multiplexers; every remap field is
published in `PinBank.remaps`, and honoured by the peripherals that are
modelled. Not modelled: EVCR's event output.

The debug port's inputs can be read by GPIO, with their pulls: PB4 (NJTRST) reads 1 until something pulls it low.
Chosen: its output PB3 (JTDO) cannot, as long as the port has it (IDR and EXTI see 0).
Chosen: SWJ_CFG, whose value is undefined when read, reads 0; so a
read-modify-write of MAPR gives the pins back to the debug port, as it may on silicon.

Which pins are held is `source/devices/afio.c`; here is who is notified of it, and of routes.

Source: RM0008 sections 9.3 and 9.4.
"""

from enum import IntEnum

from bluepill_sim.extension.layout import AFIO
from bluepill_sim.fabric.fabric import RESET
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, OWN_ANSWERS, Peripheral, PeripheralMapping, Register, bits

EVCR, MAPR, EXTICR1 = range(3)
_EXTICR_INDEXES = range(EXTICR1, EXTICR1 + 4)

#: What has the pins that AFIO holds: the debug port (RM0008 31.4.4), the crystal.
_OWNERS = {
    "PA13": "JTMS/SWDIO", "PA14": "JTCK/SWCLK", "PA15": "JTDI", "PB3": "JTDO", "PB4": "NJTRST",
    "PD0": "OSC_IN", "PD1": "OSC_OUT",
}  # fmt: skip
_CRYSTAL_PINS = frozenset({"PD0", "PD1"})
#: Shift and mask of each remap field of MAPR.
REMAP_FIELDS = {
    "SPI1": (0, 1),
    "I2C1": (1, 1),
    "USART1": (2, 1),
    "USART2": (3, 1),
    "USART3": (4, 3),
    "TIM1": (6, 3),
    "TIM2": (8, 3),
    "TIM3": (10, 3),
    "TIM4": (12, 1),
    "CAN": (13, 3),
    "ADC1_ETRGINJ": (17, 1),
    "ADC1_ETRGREG": (18, 1),
    "ADC2_ETRGINJ": (19, 1),
    "ADC2_ETRGREG": (20, 1),
}
_MAPR = (
    "SWJ_CFG 26:24, ADC2_ETRGREG 20, ADC2_ETRGINJ 19, ADC1_ETRGREG 18, ADC1_ETRGINJ 17, TIM5CH4_IREMAP 16, "
    "PD01_REMAP 15, CAN 14:13, TIM4 12, TIM3 11:10, TIM2 9:8, TIM1 7:6, USART3 5:4, USART2 3, USART1 2, I2C1 1, SPI1 0"
)


class AfioQuestion(IntEnum):
    """What Python is notified of."""

    #: Pins were held or released: by a write of MAPR, or else by a reset.
    PLACED = OWN_ANSWERS
    #: A register of routes, or a reset, may have changed what goes where.
    ROUTED = OWN_ANSWERS + 1
    #: SWJ_CFG of no meaning.
    MEANINGLESS = OWN_ANSWERS + 2


class Afio(Peripheral):
    """Alternate-function I/O."""

    KIND, HOLDS = "afio", AFIO
    ENUMS = (AfioQuestion,)
    SOURCE = "RM0008 9.4"
    REGISTERS = (
        Register(
            name="EVCR",
            offset=0x00,
            on_write="_write_evcr",
            fields="EVOE 7, PORT 6:4, PIN 3:0",
        ),
        Register(
            name="MAPR",
            offset=0x04,
            readable=bits((20, 0)),
            writable=bits((26, 24), (20, 0)),
            on_write=NATIVE,
            fields=_MAPR,
        ),
        *(
            Register(
                name=f"EXTICR{n + 1}",
                offset=0x08 + 4 * n,
                on_write=NATIVE,
                fields=", ".join(f"EXTI{4 * n + k} {4 * k + 3}:{4 * k}" for k in range(3, -1, -1)),
            )
            for n in range(4)
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self.command(RESET)

    def answer(self, what: int, value: int) -> None:
        """Tell of pins and routes, or warn."""
        if what == AfioQuestion.PLACED:
            self._name_holders(is_written=bool(value))
        elif what == AfioQuestion.ROUTED:
            self._publish()
        else:
            self.chip.warn(f"AFIO_MAPR: SWJ_CFG = {value:03b} has no meaning: ignored", once="AFIO:swj")

    def _write_evcr(self, written: int, _previous: int) -> None:
        if written & 1 << 7:
            self.chip.warn("AFIO_EVCR: the event output is not modelled", once="AFIO:evcr")

    def _name_holders(self, *, is_written: bool) -> None:
        """Say who has the pins that are held."""
        pins, taken_back = self.chip.pins, []
        for name, owner in _OWNERS.items():
            pin = pins[name]
            if self.native.held[pins.PORTS.index(pin.port)] >> pin.number & 1:
                if pin.holder != owner and name not in _CRYSTAL_PINS:
                    taken_back.append(name)
                pins.holders[name] = owner
            elif pin.holder == owner:
                del pins.holders[name]
        if taken_back and is_written:
            names = ", ".join(taken_back)
            text = f"AFIO_MAPR: SWJ_CFG is write-only, and this write gives {names} back to the debug port"
            self.chip.warn(text, once="AFIO:swj-back")

    def _publish(self) -> None:
        """Publish the routes, and notify the peripherals that use them."""
        pins = self.chip.pins
        mapr = self.words[MAPR]
        pins.remaps = {name: mapr >> shift & mask for name, (shift, mask) in REMAP_FIELDS.items()}
        for line in range(16):
            number = self.words[_EXTICR_INDEXES[line // 4]] >> (4 * (line % 4)) & 0xF
            if number >= len(pins.PORTS):
                self.chip.warn(f"AFIO_EXTICR: EXTI line {line} from port number {number}", once="AFIO:exticr")
                number = 0
            pins.exti_ports[line] = pins.PORTS[number]
        pins.route_changed()
