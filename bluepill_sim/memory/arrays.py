"""The memories of the chip as bytes: flash, SRAM, system memory.

Not who may access them when (the engine maps them), and not the registers.

Source: RM0008 section 3.1 and 30.2 (device electronic signature).
Invariant: a buffer lives as long as this object and never moves.
"""

import ctypes
import struct
from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.peripherals.flash import DELIVERED, OPTION_BYTES
from bluepill_sim.stm32f103 import (
    FLASH_BASE,
    FLASH_BYTES,
    FLASH_BYTES_FITTED,
    FLASH_SIZE_REGISTER,
    OPTION_BYTES_BASE,
    SRAM_BASE,
    SRAM_BYTES,
    SYSTEM_MEMORY_BASE,
    UNIQUE_ID_REGISTER,
)
from simbase.state import Stateful

#: What the flash shows where nothing is programmed.
ERASED = 0xFF
#: System memory and the option bytes after it, in whole pages of the engine.
_SYSTEM_BYTES = 0xC00
#: Chosen: a unique id that says what it is.
_UNIQUE_ID = b"P2OS-BLUEPIL"

_CharBuffer = ctypes.Array[ctypes.c_char]


@dataclass(frozen=True, slots=True)
class Region:
    """One memory at one address."""

    base: int
    buffer: _CharBuffer
    is_writable: bool = False

    @property
    def end(self) -> int:
        """The address after it."""
        return self.base + len(self.buffer)


class Memory(Stateful):
    """All memories of one chip."""

    STATE = ("sram", "reprogrammed", "options")
    #: What it was built with.
    DERIVED = ("_program",)

    def __init__(self) -> None:
        self.flash = ctypes.create_string_buffer(bytes([ERASED]) * FLASH_BYTES_FITTED, FLASH_BYTES_FITTED)
        self.sram = ctypes.create_string_buffer(SRAM_BYTES)
        system = bytearray([ERASED]) * _SYSTEM_BYTES
        _place(system, FLASH_SIZE_REGISTER, struct.pack("<H", FLASH_BYTES // 1024))
        _place(system, UNIQUE_ID_REGISTER, _UNIQUE_ID)
        _place(system, OPTION_BYTES_BASE, DELIVERED)
        self.system = ctypes.create_string_buffer(bytes(system), _SYSTEM_BYTES)
        self._program = self.flash.raw
        #: Called when `reprogrammed` has changed the flash.
        self.on_reprogrammed: Callable[[], None] = lambda: None
        #: Where each memory appears; the flash twice.
        self.regions = (
            Region(SRAM_BASE, self.sram, is_writable=True),
            Region(FLASH_BASE, self.flash),
            Region(0, self.flash),
            Region(SYSTEM_MEMORY_BASE, self.system),
        )

    def read(self, address: int, size: int) -> bytes | None:
        """Return bytes, or None where not all of them are in one memory."""
        region = self._region(address, size)
        if region is None:
            return None
        at = address - region.base
        return ctypes.string_at(ctypes.addressof(region.buffer) + at, size)

    def read_word(self, address: int) -> int | None:
        """Return a word, or None where there is no memory."""
        data = self.read(address, 4)
        return None if data is None else int.from_bytes(data, "little")

    def write(self, address: int, data: bytes) -> bool:
        """Write to SRAM; return False where there is none."""
        region = self._region(address, len(data))
        if region is None or not region.is_writable:
            return False
        ctypes.memmove(ctypes.addressof(region.buffer) + address - region.base, data, len(data))
        return True

    def load_flash(self, offset: int, data: bytes) -> None:
        """Put bytes into the flash array, as a programmer does."""
        ctypes.memmove(ctypes.addressof(self.flash) + offset, data, len(data))

    def read_flash(self, offset: int, size: int) -> bytes:
        """Return bytes of the flash array."""
        return ctypes.string_at(ctypes.addressof(self.flash) + offset, size)

    @property
    def options(self) -> bytes:
        """The option bytes, with their complements."""
        return ctypes.string_at(self._options_at, OPTION_BYTES)

    @options.setter
    def options(self, options: bytes) -> None:
        ctypes.memmove(self._options_at, options, OPTION_BYTES)

    @property
    def _options_at(self) -> int:
        return ctypes.addressof(self.system) + OPTION_BYTES_BASE - SYSTEM_MEMORY_BASE

    def lose_power(self) -> None:
        """Forget what the SRAM holds."""
        ctypes.memset(self.sram, 0, len(self.sram))

    def seal(self) -> None:
        """Take the flash as it is now for the program that snapshots need not carry."""
        self._program = self.flash.raw

    @property
    def reprogrammed(self) -> bytes | None:
        """The flash; None where it is the program that was sealed."""
        flash = self.flash.raw
        return None if flash == self._program else flash

    @reprogrammed.setter
    def reprogrammed(self, flash: bytes | None) -> None:
        self.load_flash(0, self._program if flash is None else flash)
        self.on_reprogrammed()

    def _region(self, address: int, size: int) -> Region | None:
        for region in self.regions:
            if region.base <= address <= address + size <= region.end:
                return region
        return None


def _place(system: bytearray, address: int, data: bytes) -> None:
    at = address - SYSTEM_MEMORY_BASE
    system[at : at + len(data)] = data
