"""EXTI: edges on pins become interrupts and events.

Modelled: lines 0 to 18, both edges, software triggers, events (they set the
event register that WFE waits for). An edge is seen without any clock, as on
silicon. Lines 16 (PVD), 17 (RTC alarm) and 18 (USB wake-up) are driven
through `set_line` by the model of their source.

Source: RM0008 section 10.
Invariant: an IRQ is raised exactly while one of its lines is pending and unmasked.
"""

from bluepill_sim.fabric.pins import Pin
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import Peripheral, Place, Register, bits

IMR, EMR, RTSR, FTSR, SWIER, PR = range(6)

_LINES = bits((18, 0))
#: Lines that share one interrupt, in the order of the place's `irqs`: 6 to 10, 23, 40, 1, 41, 42.
LINES_BY_IRQ = (bits(0), bits(1), bits(2), bits(3), bits(4), bits((9, 5)), bits((15, 10)), bits(16), bits(17), bits(18))


class Exti(Peripheral):
    """External interrupt/event controller."""

    STATE = ("_levels",)
    REGISTERS = (
        Register(name="IMR", offset=0x00, readable=_LINES, writable=_LINES, on_write="_write_mask"),
        Register(name="EMR", offset=0x04, readable=_LINES, writable=_LINES),
        Register(name="RTSR", offset=0x08, readable=_LINES, writable=_LINES, on_write="_write_edges"),
        Register(name="FTSR", offset=0x0C, readable=_LINES, writable=_LINES, on_write="_write_edges"),
        Register(name="SWIER", offset=0x10, readable=_LINES, writable=0, on_write="_write_swier"),
        Register(name="PR", offset=0x14, readable=_LINES, writable=0, write_one_to_clear=_LINES, on_write="_write_pr"),
    )

    def __init__(self, chip: ChipPorts, place: Place) -> None:
        super().__init__(chip, place)
        #: Level of each line, by bit.
        self._levels = 0
        self._ports = chip.pins.exti_ports
        for pin in chip.pins:
            pin.listeners.append(self._input_changed)
        chip.pins.route_listeners.append(self._route_changed)
        self._levels = self._pin_levels()

    def on_reset(self) -> None:
        """Drop every request."""
        self._levels = (self._levels & ~bits((15, 0))) | self._pin_levels()
        self._publish_edges()
        self._update_irqs()

    def set_line(self, line: int, level: bool) -> None:
        """Set the level of a line; the edges that RTSR and FTSR choose make a request."""
        bit = 1 << line
        if bool(self._levels & bit) is level:
            return
        self._levels ^= bit
        if self.words[RTSR if level else FTSR] & bit:
            self._request(bit)

    def _input_changed(self, pin: Pin) -> None:
        if self._ports[pin.number] == pin.port:
            self.set_line(pin.number, pin.input)

    def _route_changed(self) -> None:
        levels = self._pin_levels()
        for line in range(16):
            self.set_line(line, bool(levels >> line & 1))

    def _pin_levels(self) -> int:
        pins = self.chip.pins
        return sum(pins.port(port)[line].input << line for line, port in enumerate(pins.exti_ports))

    def _request(self, lines: int) -> None:
        self.words[PR] |= lines
        self._update_irqs()
        if lines & self.words[EMR]:
            self.chip.signal("event")

    def _write_edges(self, _written: int, _previous: int) -> None:
        self._publish_edges()

    def _publish_edges(self) -> None:
        self.chip.pins.edge_lines = self.words[RTSR] | self.words[FTSR]
        self.chip.pins.simple_is_known = False

    def _write_mask(self, _written: int, _previous: int) -> None:
        self._update_irqs()

    def _write_swier(self, written: int, previous: int) -> None:
        new = written & _LINES & ~previous
        self.words[SWIER] = previous | new
        # Only an unmasked line becomes pending by software (RM0008 10.3.5).
        self.words[PR] |= new & self.words[IMR]
        self._update_irqs()
        if new & self.words[EMR]:
            self.chip.signal("event")

    def _write_pr(self, written: int, _previous: int) -> None:
        self.words[SWIER] &= ~written
        self._update_irqs()

    def _update_irqs(self) -> None:
        active = self.words[PR] & self.words[IMR]
        for irq, lines in zip(self.place.irqs, LINES_BY_IRQ, strict=True):
            self.chip.set_irq(irq, bool(active & lines))
