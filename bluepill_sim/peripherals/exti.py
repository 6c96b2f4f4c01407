"""EXTI: edges on pins become interrupts and events.

Modelled: lines 0 to 18, both edges, software triggers, events (they set the
event register that WFE waits for). An edge is seen without any clock, as on
silicon. Lines 16 (PVD), 17 (RTC alarm) and 18 (USB wake-up) are inputs 0 to 2
of the device, for the line of their source. What it does is `extension/source/devices/exti.c`.

Source: RM0008 section 10.
Invariant: an IRQ is raised exactly while one of its lines is pending and unmasked.
"""

from bluepill_sim.extension.layout import EXTI
from bluepill_sim.fabric.fabric import ROUTE
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits, indices, numbered

_LINES = bits((18, 0))
#: From the left.
_DOWN = range(18, -1, -1)


class Exti(Peripheral):
    """External interrupt/event controller."""

    KIND, HOLDS = "exti", EXTI
    #: Lines that share an interrupt, `lines_by_irq` of exti.c; and events that trigger ADCs, `trigger_lines`.
    OUTPUTS = (
        "0", "1", "2", "3", "4", "9_5", "15_10", "pvd_irq", "rtc_alarm_irq", "usb_wakeup_irq", "line11", "line15",
    )  # fmt: skip
    INPUTS = ("pvd", "rtc_alarm", "usb_wakeup")
    SOURCE = "RM0008 10.3"
    REGISTERS = (
        Register(name="IMR", offset=0x00, mask=_LINES, on_write=NATIVE, fields=numbered("MRn", _DOWN)),
        Register(name="EMR", offset=0x04, mask=_LINES, fields=numbered("MRn", _DOWN)),
        Register(name="RTSR", offset=0x08, mask=_LINES, on_write=NATIVE, fields=numbered("TRn", _DOWN)),
        Register(name="FTSR", offset=0x0C, mask=_LINES, on_write=NATIVE, fields=numbered("TRn", _DOWN)),
        Register(
            name="SWIER", offset=0x10, readable=_LINES, writable=0, on_write=NATIVE, fields=numbered("SWIERn", _DOWN)
        ),
        Register(
            name="PR",
            offset=0x14,
            readable=_LINES,
            writable=0,
            write_one_to_clear=_LINES,
            on_write=NATIVE,
            fields=numbered("PRn", _DOWN),
        ),
    )

    @property
    def pending(self) -> int:
        """The lines that are pending, and would make an interrupt or an event, as a mask."""
        return self.words[PR] & (self.words[IMR] | self.words[EMR])

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        chip.pins.route_listeners.append(self._route_changed)
        self._route_changed()

    def _route_changed(self) -> None:
        pins = self.chip.pins
        self.native.routes[:] = [pins.PORTS.index(port) for port in pins.exti_ports]
        self.command(ROUTE)

    def _restored(self) -> None:
        self.command(ROUTE)


IMR, EMR, PR = indices(Exti.REGISTERS, "IMR EMR PR")
