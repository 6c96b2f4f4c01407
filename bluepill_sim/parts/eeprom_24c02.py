"""A serial EEPROM: 24C02, 256 bytes behind an I2C.

A write sets the address, then bytes of one page of 8, where it wraps; the STOP begins the write cycle, in which the
part
acknowledges nothing: a driver polls it. A read goes on from the address, over the end of the memory to its start.

Not modelled: wear, the write-protect pin. Chosen: a START in place of the STOP drops what was to be written (as
Microchip's do).
Source: Microchip 24C02C, data sheet, sections 5 to 8; the cycle is the longest of its table 1-2.
Invariant: cells change at a STOP only.
"""

from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos

SIZE_BYTES, PAGE_BYTES = 256, 8
WRITE_NS: Nanos = 5 * NS_PER_MS
_BASE_ADDRESS = 0x50


class Eeprom24C02(Stateful):
    """256 bytes at one of eight addresses."""

    STATE = ("memory", "_at", "_page", "_has_word", "_busy_until_ns")

    def __init__(self, address: int = _BASE_ADDRESS, contents: bytes = b"") -> None:
        """Make one, erased behind its contents.

        Args:
            address: 0x50 to 0x57, by its pins A0 to A2.
            contents: at most 256 bytes.

        Raises:
            ValueError: It cannot have this address, or so much in it.
        """
        if not _BASE_ADDRESS <= address < _BASE_ADDRESS + 8:
            raise ValueError(f"a 24C02 is at 0x50 to 0x57, not at {address:#04x}")
        if len(contents) > SIZE_BYTES:
            raise ValueError(f"{len(contents)} bytes do not fit into a 24C02 of {SIZE_BYTES}")
        self.address = address
        #: What it holds.
        self.memory = bytearray(contents.ljust(SIZE_BYTES, b"\xff"))
        self._at = 0
        #: What is to be written: byte by place in the page.
        self._page: dict[int, int] = {}
        self._has_word = False
        self._busy_until_ns: Nanos = 0

    def start(self, address: int, is_read: bool, at_ns: Nanos) -> bool:
        """Acknowledge its own address, but for the write cycle."""
        self._page.clear()
        self._has_word = is_read
        return address == self.address and at_ns >= self._busy_until_ns

    def write(self, byte: int, at_ns: Nanos) -> bool:
        """Take the address in the memory, then what goes there."""
        if not self._has_word:
            self._at, self._has_word = byte, True
            return True
        self._page[self._at] = byte
        self._at = self._at // PAGE_BYTES * PAGE_BYTES + (self._at + 1) % PAGE_BYTES
        return True

    def read(self, at_ns: Nanos) -> int:
        """Return the next byte."""
        byte = self.memory[self._at]
        self._at = (self._at + 1) % SIZE_BYTES
        return byte

    def stop(self, at_ns: Nanos) -> None:
        """Begin the write cycle, if there is something to write."""
        if self._page:
            for place, byte in self._page.items():
                self.memory[place] = byte
            self._page.clear()
            self._busy_until_ns = at_ns + WRITE_NS
