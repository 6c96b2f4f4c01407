"""The bus between the core and the peripherals: routing, clock gates, bit-band.

Source: RM0008 sections 3.1, 3.3.2 (bit-band) and 7.3 (clock gates).
Invariant: a peripheral sees an access only while its clock is on.
"""

import ctypes
from typing import Protocol

from bluepill_sim.peripheral import Peripheral
from bluepill_sim.rcc import Rcc
from bluepill_sim.stm32f103 import CLOCK_GATES, PERIPHERAL_BASE, name_at

#: What is mapped as peripherals: APB1, APB2 and AHB up to the end of CRC and reserved pages.
PERIPHERAL_BYTES = 0x2_4000
_PAGE_SHIFT = 10


class Surroundings(Protocol):
    """What the bus needs of the chip."""

    def warn(self, message: str, *, once: str) -> None:
        """Warn of what the firmware does wrong, or of what is not modelled."""
        ...


class PeripheralBus:
    """Reads and writes of the peripheral region; offsets count from PERIPHERAL_BASE."""

    def __init__(self, parts: dict[str, Peripheral], rcc: Rcc, chip: Surroundings) -> None:
        self._pages = {
            (part.base - PERIPHERAL_BASE >> _PAGE_SHIFT) + page: part
            for part in parts.values()
            for page in range(part.place.size >> _PAGE_SHIFT)
        }
        self._rcc = rcc
        self._chip = chip

    def read(self, offset: int, size: int) -> int:
        """Return what the core reads."""
        part = self._pages.get(offset >> _PAGE_SHIFT)
        if part is None or not self._rcc.is_clocked(part.name):
            self._refuse(part, offset, "read of")
            return 0
        return part.read(PERIPHERAL_BASE + offset - part.base, size)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the core writes."""
        part = self._pages.get(offset >> _PAGE_SHIFT)
        if part is None or not self._rcc.is_clocked(part.name):
            self._refuse(part, offset, f"write of {value:#x} to")
            return
        part.write(PERIPHERAL_BASE + offset - part.base, size, value)

    def read_bit(self, offset: int, size: int) -> int:
        """Return a bit through its alias; `offset` counts from the alias region."""
        del size  # a narrow access reads the same bit
        bit = offset >> 2 & 31
        return self.read(offset >> 5 & ~3, 4) >> bit & 1

    def write_bit(self, offset: int, size: int, value: int) -> None:
        """Set a bit through its alias: the bus matrix reads the word, changes the bit, writes the word."""
        del size
        bit = 1 << (offset >> 2 & 31)
        word = self.read(offset >> 5 & ~3, 4)
        self.write(offset >> 5 & ~3, 4, word | bit if value & 1 else word & ~bit)

    def _refuse(self, part: Peripheral | None, offset: int, what: str) -> None:
        """Warn of an access to nothing: it reads 0, and a write is lost."""
        address = PERIPHERAL_BASE + offset
        if part is None:
            name = name_at(address)
            text = f"{name} is not modelled" if name else "no peripheral is here"
            self._chip.warn(f"{text} ({what} {address:#010x})", once=f"unmodelled:{name or address & ~0x3FF:}")
            return
        gate = CLOCK_GATES[part.name]
        self._chip.warn(
            f"{part.name} has no clock: RCC_{gate.register} bit {gate.bit} is 0 ({what} {address:#010x})",
            once=f"clock:{part.name}",
        )


class SramBitBand:
    """The alias region of the SRAM's bits."""

    def __init__(self, sram: "ctypes.Array[ctypes.c_char]") -> None:
        self._bytes = (ctypes.c_ubyte * len(sram)).from_buffer(sram)

    def read_bit(self, offset: int, size: int) -> int:
        """Return a bit through its alias."""
        del size
        return self._bytes[offset >> 5] >> (offset >> 2 & 7) & 1

    def write_bit(self, offset: int, size: int, value: int) -> None:
        """Set a bit through its alias."""
        del size
        bit = 1 << (offset >> 2 & 7)
        at = offset >> 5
        self._bytes[at] = self._bytes[at] | bit if value & 1 else self._bytes[at] & ~bit
