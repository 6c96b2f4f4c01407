"""SPI at 18 MHz and I2C at 400 kHz by DMA: `python tools/bench/buses.py`, times real time of processor time.

The program sleeps while DMA serves the bus. Needs arm-none-eabi-gcc, and DMA1 in the chip.
"""

import tempfile
import time
from pathlib import Path

from bluepill_sim import BluePill
from bluepill_sim.parts import Eeprom24C02
from bluepill_sim.peripherals.spi import Loopback
from robot_bench.firmware import build

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "tests" / "bluepill_sim" / "peripherals" / "buses" / "firmware" / "dma_buses.c"
#: Of virtual time.
SPAN_NS = 200_000_000


class Wire:
    """A part in Python that answers what it hears."""

    spi_modes = frozenset(range(4))
    max_hz = 36_000_000

    def select(self, at_ns: int) -> None:
        """Nothing selects it."""

    def deselect(self, at_ns: int) -> None:
        """Nothing selects it."""

    def exchange(self, byte: int, at_ns: int) -> int:  # noqa: ARG002 - the interface's
        """Return the byte."""
        return byte


class Teller(Wire):
    """One that says ahead what it sends, as a flash does that is read."""

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what it sends next, whatever it is sent."""
        return bytes(count), None

    def went(self, count: int) -> None:
        """Keep nothing."""


def main() -> None:
    """Build the program, and print a line a bus."""
    with tempfile.TemporaryDirectory() as scratch:
        elf = Path(scratch).resolve() / "dma_buses.elf"
        sources, flags = ("startup.c", "memory.c", "board.c", str(PROGRAM)), (f"-I{build.HERE}",)
        build.build_elf(sources, folder=build.HERE, linker_script="f103c8.ld", output=elf, more_flags=flags)
        for name, device, is_i2c in (
            ("SPI at 18 MHz, MISO tied to MOSI", Loopback(), False),
            ("SPI at 18 MHz, a part in Python", Wire(), False),
            ("SPI at 18 MHz, a part in Python that says ahead", Teller(), False),
            ("I2C at 400 kHz, the EEPROM", Loopback(), True),
        ):
            board = BluePill(elf)
            board.spi("SPI1", device)
            board.i2c("I2C1", Eeprom24C02())
            board.pin("PB0").drive(is_i2c)
            board.usart1.expect(b"end\n")
            before_s = time.process_time()
            board.run_for(SPAN_NS)
            print(f"{name}: {SPAN_NS / 1e9 / (time.process_time() - before_s):.2f} times real time")


if __name__ == "__main__":
    main()
