"""DMA1: seven channels that move data between peripherals and memory without the core.

What it does is `extension/source/devices/dma.c`; here are its registers, and what it warns of. Which request
leads to which channel is a table on the chip's page (RM0008 table 78).

Source: RM0008 section 13.
Invariant: CNDTR of a channel counts the transfers that are left, at any time.
"""

from enum import IntEnum

from bluepill_sim.extension.layout import DMA
from bluepill_sim.fabric.fabric import CLOCK
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, PeripheralMapping, Register, bits

CHANNELS = range(1, 8)
#: Of CCRx, RM0008 13.4.3.
_CONTROL = "MEM2MEM 14, PL 13:12, MSIZE 11:10, PSIZE 9:8, MINC 7, PINC 6, CIRC 5, DIR 4, TEIE 3, HTIE 2, TCIE 1, EN 0"


class DmaQuestion(IntEnum):
    """What the device warns of, with the number of the channel from 0 on."""

    LOCKED = 0
    FAILED = 1
    CIRCLES = 2


_WARNINGS = {
    DmaQuestion.LOCKED: "CNDTR, CPAR or CMAR written while the channel is enabled: ignored",
    DmaQuestion.FAILED: "an access to nothing, or to what has no clock: the channel is disabled, TEIF set",
    DmaQuestion.CIRCLES: "MEM2MEM and CIRC exclude each other: it ends at 0",
}


def _flags(names: str) -> str:
    """Return the fields of ISR or IFCR: four a channel, the last channel's first."""
    return ", ".join(
        f"{name}{n} {4 * (n - 1) + 3 - place}" for n in reversed(CHANNELS) for place, name in enumerate(names.split())
    )


class Dma(Peripheral):
    """Direct memory access controller."""

    KIND, HOLDS = "dma", DMA
    HAS_BYTE_LANES = True
    ENUMS = (DmaQuestion,)
    OUTPUTS = tuple(f"ch{n}_irq" for n in CHANNELS)
    INPUTS = tuple(f"ch{n}" for n in CHANNELS)
    SOURCE = "RM0008 13.4"
    REGISTERS = (
        Register(name="ISR", offset=0x00, readable=bits((27, 0)), writable=0, fields=_flags("TEIF HTIF TCIF GIF")),
        Register(
            name="IFCR",
            offset=0x04,
            mask=0,
            write_one_to_clear=bits((27, 0)),
            on_write=NATIVE,
            fields=_flags("CTEIF CHTIF CTCIF CGIF"),
        ),
        *(
            Register(name=f"{name}{n}", offset=offset + 20 * n, on_write=NATIVE, fields=fields)
            for n in CHANNELS
            for name, offset, fields in (
                ("CCR", -0x0C, _CONTROL),
                ("CNDTR", -0x08, "NDT 15:0"),
                ("CPAR", -0x04, "PA 31:0"),
                ("CMAR", 0x00, "MA 31:0"),
            )
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self.command(CLOCK, self.clock_hz())

    def clock_name(self) -> str:
        """Return that of HCLK."""
        return "hclk_hz"

    def answer(self, what: int, value: int) -> None:
        """Warn."""
        question = DmaQuestion(what)
        self.chip.warn(f"{self.name} channel {value + 1}: {_WARNINGS[question]}", once=f"{self.name}:{value}:{what}")
