"""AFIO: which function has which pin, and which port feeds each EXTI line.

Modelled: SWJ_CFG (the debug port keeps PA13, PA14, PA15, PB3 and PB4 until it
is released), PD01_REMAP, the EXTI multiplexers; every remap field is
published in `PinBank.remaps`, and honoured by the peripherals that are
modelled. Not modelled: EVCR's event output.

The debug port's inputs can be read by GPIO, with their pulls: PB4 (NJTRST) reads 1 until something pulls it low.
Chosen: its output PB3 (JTDO) cannot, as long as the port has it (IDR and EXTI see 0).
Chosen: SWJ_CFG, whose value is undefined when read, reads 0; so a
read-modify-write of MAPR gives the pins back to the debug port, as it may on silicon.

Source: RM0008 sections 9.3 and 9.4.
Invariant: each debug pin is held exactly while SWJ_CFG (or reset) says so.
"""

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import Peripheral, PeripheralMapping, Register, bits

EVCR, MAPR, EXTICR1 = range(3)
_EXTICR_INDEXES = range(EXTICR1, EXTICR1 + 4)

#: The pins of the debug port after reset: what has them, and its pull (RM0008 31.4.4).
DEBUG_PINS = {
    "PA13": ("JTMS/SWDIO", PinDrive.PULL_UP),
    "PA14": ("JTCK/SWCLK", PinDrive.PULL_DOWN),
    "PA15": ("JTDI", PinDrive.PULL_UP),
    "PB3": ("JTDO", PinDrive.NONE),
    "PB4": ("NJTRST", PinDrive.PULL_UP),
}
#: The debug pins that each legal SWJ_CFG keeps (RM0008 table 35).
KEPT_BY_SWJ_CFG = {
    0b000: frozenset(DEBUG_PINS),
    0b001: frozenset(DEBUG_PINS) - {"PB4"},
    0b010: frozenset({"PA13", "PA14"}),
    0b100: frozenset(),
}
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
    "ADC2_ETRGREG 20, ADC2_ETRGINJ 19, ADC1_ETRGREG 18, ADC1_ETRGINJ 17, TIM5CH4_IREMAP 16, PD01_REMAP 15, CAN 14:13, "
    "TIM4 12, TIM3 11:10, TIM2 9:8, TIM1 7:6, USART3 5:4, USART2 3, USART1 2, I2C1 1, SPI1 0"
)
_PD01_REMAP = 1 << 15
_SWJ_SHIFT, _SWJ_MASK = 24, bits((26, 24))
#: What ST's own code writes to leave the debug port as it is (RM0008 9.4.2: other combinations have no effect).
_SWJ_UNCHANGED = 0b111
_CRYSTAL_PINS = {"PD0": "OSC_IN", "PD1": "OSC_OUT"}


class Afio(Peripheral):
    """Alternate-function I/O."""

    STATE = ("_swj_cfg",)
    SOURCE = "RM0008 9.4"
    REGISTERS = (
        Register(
            name="EVCR",
            offset=0x00,
            mask=bits((7, 0)),
            on_write="_write_evcr",
            fields="EVOE 7, PORT 6:4, PIN 3:0",
        ),
        Register(
            name="MAPR",
            offset=0x04,
            readable=bits((20, 0)),
            writable=bits((26, 24), (20, 0)),
            on_write="_route",
            fields=_MAPR,
        ),
        *(
            Register(
                name=f"EXTICR{n + 1}",
                offset=0x08 + 4 * n,
                mask=bits((15, 0)),
                on_write="_write_exticr",
                fields=", ".join(f"EXTI{4 * n + k} {4 * k + 3}:{4 * k}" for k in range(3, -1, -1)),
            )
            for n in range(4)
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self._swj_cfg = 0
        self._place_pins()

    def on_reset(self) -> None:
        """Give the debug port its pins back and undo every remap."""
        self._swj_cfg = 0
        self._place_pins()
        self._publish()

    def _write_evcr(self, written: int, _previous: int) -> None:
        if written & 1 << 7:
            self.chip.warn("AFIO_EVCR: the event output is not modelled", once="AFIO:evcr")

    def _route(self, written: int, _previous: int) -> None:
        swj_cfg = (written & _SWJ_MASK) >> _SWJ_SHIFT
        if swj_cfg not in KEPT_BY_SWJ_CFG:
            if swj_cfg != _SWJ_UNCHANGED:
                self.chip.warn(f"AFIO_MAPR: SWJ_CFG = {swj_cfg:03b} has no meaning: ignored", once="AFIO:swj")
            swj_cfg = self._swj_cfg
        taken_back = KEPT_BY_SWJ_CFG[swj_cfg] - KEPT_BY_SWJ_CFG[self._swj_cfg]
        if taken_back:
            names = ", ".join(sorted(taken_back))
            self.chip.warn(
                f"AFIO_MAPR: SWJ_CFG is write-only, and this write gives {names} back to the debug port",
                once="AFIO:swj-back",
            )
        self._swj_cfg = swj_cfg
        self._place_pins()
        self._publish()

    def _write_exticr(self, _written: int, _previous: int) -> None:
        self._publish()

    def _place_pins(self) -> None:
        """Hold and release the pins of the debug port and of the crystal."""
        pins = self.chip.pins
        kept = KEPT_BY_SWJ_CFG[self._swj_cfg]
        for name, (owner, drive) in DEBUG_PINS.items():
            if name in kept:
                pins[name].hold(owner, drive)
            elif pins[name].holder == owner:
                pins[name].release()
        for name, owner in _CRYSTAL_PINS.items():
            if not self.words[MAPR] & _PD01_REMAP:
                pins[name].hold(owner)
            elif pins[name].holder == owner:
                pins[name].release()

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
