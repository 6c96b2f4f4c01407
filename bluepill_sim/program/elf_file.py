"""What a firmware's ELF file contains: sections, symbols, vectors, stack.

Not what is loaded (`image.py`) and not its lines (`line_table.py`).
Invariant: works on any image; what its file does not tell is simply missing.
"""

import io
from dataclasses import dataclass
from pathlib import Path

from bluepill_sim.core.nvic import VECTOR_COUNT, exception_name
from bluepill_sim.errors import ImageError
from bluepill_sim.program.image import ELF_MAGIC, FLASH_END, Image
from bluepill_sim.stm32f103 import FLASH_BASE, FLASH_BYTES, SRAM_BASE, SRAM_BYTES, is_in_sram, without_alias
from simbase.files import read_bytes

_SHF_ALLOC = 2
#: Behind the stack pointer and the reset vector.
_LEAST_TARGET = 8


@dataclass(frozen=True, slots=True)
class Section:
    """A section that takes memory on the chip."""

    name: str
    address: int
    size: int
    #: Whether its bytes stand in the flash, and whether it stands in SRAM while the program runs.
    in_flash: bool
    in_sram: bool


@dataclass(frozen=True, slots=True)
class Vector:
    """An entry of the vector table."""

    number: int
    name: str
    #: The handler's address, bit 0 stripped.
    target: int


@dataclass(frozen=True, slots=True)
class MemoryLayout:
    """How a program lies in the chip's memories."""

    sections: tuple[Section, ...]
    flash_bytes: int
    #: Variables, without the stack.
    sram_bytes: int

    @property
    def flash_share(self) -> float:
        """How much of the flash that is sold (64 KiB) it takes."""
        return self.flash_bytes / FLASH_BYTES

    @property
    def sram_share(self) -> float:
        """How much of the SRAM its variables take."""
        return self.sram_bytes / SRAM_BYTES


def file_bytes(image: Image) -> bytes:
    """Return the bytes of the file that an image came from.

    Raises:
        ImageError: the file is gone or unreadable.
    """
    path = Path(image.name)
    if path.exists() and not path.is_file():
        raise ImageError(f"{image.name}: no file that can be read again", hint="copy it into a file first")
    return read_bytes(path, ImageError, hint="check the path")


def layout(image: Image) -> MemoryLayout:
    """Return the sections of an image and what they add up to; HEX and BIN have no sections."""
    flash_bytes = sum(len(data) for _, data in image.segments)
    data = file_bytes(image)
    if not data.startswith(ELF_MAGIC):
        return MemoryLayout((), flash_bytes, 0)
    sections = tuple(_sections(data))
    sram = sum(section.size for section in sections if section.in_sram)
    return MemoryLayout(sections, flash_bytes, sram)


def file_offset(data: bytes, flash_offset: int) -> int:
    """Return where in an ELF file a byte of the flash stands.

    Raises:
        ImageError: No piece that is loaded holds it.
    """
    from elftools.elf.elffile import ELFFile

    for segment in ELFFile(io.BytesIO(data)).iter_segments():
        at = flash_offset - segment["p_paddr"] % FLASH_BASE
        if segment["p_type"] == "PT_LOAD" and 0 <= at < segment["p_filesz"]:
            return int(segment["p_offset"] + at)
    raise ImageError(f"nothing is loaded at {FLASH_BASE + flash_offset:#010x}", hint="give the ELF that was linked")


def _sections(data: bytes) -> "list[Section]":
    from elftools.elf.elffile import ELFFile

    found = []
    for section in ELFFile(io.BytesIO(data)).iter_sections():
        address, size, flags = section["sh_addr"], section["sh_size"], section["sh_flags"]
        if not flags & _SHF_ALLOC or not size:
            continue
        has_bytes = section["sh_type"] != "SHT_NOBITS"
        found.append(Section(section.name, address, size, has_bytes, is_in_sram(address)))
    return found


def vectors(image: Image) -> list[Vector]:
    """Return the vectors that lead into the flash, by number."""
    found = []
    for number in range(1, VECTOR_COUNT):
        word = image.word(image.vector_table + 4 * number)
        target = word & ~1
        if word & 1 and target >= _LEAST_TARGET and FLASH_BASE <= without_alias(target) < FLASH_END:
            found.append(Vector(number, exception_name(number), target))
    return found


def stack_top(image: Image) -> int:
    """Return the initial stack pointer."""
    return image.word(image.vector_table) & ~3


def variables_end(image: Image) -> int:
    """Return the address after the last variable: where the stack may grow down to."""
    return max((s.address + s.size for s in layout(image).sections if s.in_sram), default=SRAM_BASE)
