"""Firmware files: ELF, Intel HEX and plain binaries, checked before they are run.

Not modelled: initial contents of SRAM (a loaded chip starts from flash alone),
and option bytes.

Invariant: an `Image` has bytes inside the flash only, and a vector table whose
stack pointer and reset handler are those of a program for this chip.
"""

import hashlib
import io
from bisect import bisect_right
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

from bluepill_sim.errors import ImageError
from bluepill_sim.program.wrong_files import wrong_kind
from bluepill_sim.stm32f103 import FLASH_BASE, FLASH_BYTES_FITTED, SRAM_BASE, SRAM_BYTES, without_alias
from simbase.errors import MissingDependencyError
from simbase.files import read_bytes

FLASH_END = FLASH_BASE + FLASH_BYTES_FITTED
#: The stack may start at the very end of the SRAM, not beyond.
_STACK_END = SRAM_BASE + SRAM_BYTES
#: Vector tables stand at multiples of this (ARMv7-M B3.2.5, rounded up to the size of this chip's table).
VECTOR_ALIGNMENT = 0x200
#: chosen: a stack pointer and a reset vector are the least that a program can have.
_SMALLEST_BYTES = 8
_SHF_ALLOC = 2
_ERASED_WORD = 0xFFFF_FFFF
#: chosen: of so many files it is known what is in them; a campaign or a session of tests boots the same ones.
_KEPT = 8
ELF_MAGIC = b"\x7fELF"
#: Types of ELF files that are no programs.
_NOT_LINKED = {
    "ET_REL": "a compiled source that is not linked (object file)",
    "ET_DYN": "a shared object or a position-independent program",
    "ET_CORE": "a core dump",
}
_MACHINES = {"EM_ARM": "ARM", "EM_AARCH64": "ARM (AArch64)", "EM_RISCV": "RISC-V", "EM_386": "x86"}
_HINT = "an ELF, HEX or BIN file built for an STM32F103 at 0x08000000 is needed"
#: chosen: so far a symbol without a size reaches; longer than any function that assembly holds.
_UNSIZED_REACH_BYTES = 0x1_0000
#: Names that the linker makes up inside functions: mapping symbols of the ARM ELF.
_MAPPING_PREFIXES = ("$",)


@dataclass(frozen=True, slots=True)
class Symbol:
    """A name at an address."""

    name: str
    address: int
    #: Bytes; 0 where the file does not say.
    size: int = 0
    #: Whether the file says that it is a function.
    is_function: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class SymbolTable:
    """Names of addresses, sorted by address."""

    symbols: tuple[Symbol, ...] = ()
    _addresses: tuple[int, ...] = field(init=False, repr=False, compare=False, default=())

    def __post_init__(self) -> None:
        """Index the symbols."""
        object.__setattr__(self, "_addresses", tuple(symbol.address for symbol in self.symbols))

    def where(self, address: int) -> str:
        """Return "symbol+0x12 (0x08000123)", or the address alone where no symbol reaches."""
        index = bisect_right(self._addresses, address) - 1
        if index >= 0:
            symbol = self.symbols[index]
            offset = address - symbol.address
            if offset < (symbol.size or _UNSIZED_REACH_BYTES):
                return f"{symbol.name}+{offset:#x} ({address:#010x})"
        return f"{address:#010x}"

    def address_of(self, name: str) -> int | None:
        """Return the address of a symbol, or None."""
        return next((symbol.address for symbol in self.symbols if symbol.name == name), None)


@dataclass(frozen=True, slots=True)
class Image:
    """A firmware as it goes into the flash."""

    #: What the user called it, for messages.
    name: str
    #: (address, bytes) of each piece, inside the flash.
    segments: tuple[tuple[int, bytes], ...]
    symbols: SymbolTable = field(default_factory=SymbolTable)
    #: SHA-256 of the file.
    sha256: str = ""
    #: Where the file has the flash: 0x08000000, or 0, where the chip shows it again.
    linked_at: int = FLASH_BASE

    def __post_init__(self) -> None:
        """Check that this can be a program for the chip.

        Raises:
            ImageError: It cannot.
        """
        if not any(data for _, data in self.segments):
            raise ImageError(f"{self.name}: no code or data in it", hint=_HINT)
        for address, data in self.segments:
            if not FLASH_BASE <= address <= FLASH_END - len(data):
                raise ImageError(
                    f"{self.name}: {len(data)} bytes at {address:#010x} are outside the flash "
                    f"({FLASH_BASE:#010x} to {FLASH_END - 1:#010x})",
                    hint="check the linker script: FLASH is at 0x08000000, 64 KiB",
                )
        stack, entry = self.word(self.vector_table), self.word(self.vector_table + 4)
        erased = [name for name, word in (("stack pointer", stack), ("reset vector", entry)) if word == _ERASED_WORD]
        if erased:
            raise ImageError(
                f"{self.name}: no {' and no '.join(erased)} at {self.vector_table:#010x}: "
                f"{_ERASED_WORD:#010x} is erased flash",
                hint="a program begins with its vector table: check the linker script, and where the file is put",
            )
        # The core drops the two lowest bits (ARM B1.5.5); linker scripts of ST once had 0x20004FFF.
        if not SRAM_BASE < stack & ~3 <= _STACK_END:
            raise ImageError(
                f"{self.name}: the initial stack pointer {stack:#010x} at {self.vector_table:#010x} "
                f"is not in the SRAM ({SRAM_BASE:#010x} to {_STACK_END:#010x})",
                hint="the first word of the flash must be the top of the stack",
            )
        if not entry & 1 or not FLASH_BASE <= without_alias(entry) < FLASH_END:
            raise ImageError(
                f"{self.name}: the reset vector {entry:#010x} is not a Thumb address in the flash",
                hint="the second word of the flash must be the address of Reset_Handler, bit 0 set",
            )

    @property
    def vector_table(self) -> int:
        """Where in the flash the vectors are: at its lowest address, which a boot loader may have moved up."""
        lowest = min(address for address, data in self.segments if data)
        return lowest // VECTOR_ALIGNMENT * VECTOR_ALIGNMENT

    def word(self, address: int) -> int:
        """Return a word of the program; what it does not hold reads as erased flash.

        Args:
            address: in the flash, a multiple of 4.
        """
        result = bytearray(b"\xff" * 4)
        for start, data in self.segments:
            for n in range(4):
                if 0 <= address + n - start < len(data):
                    result[n] = data[address + n - start]
        return int.from_bytes(result, "little")


def load_image(path: str | Path) -> Image:
    """Read a firmware file; its kind is known by its contents.

    Raises:
        ImageError: it is missing, damaged, empty, too large, or not for this chip.
        MissingDependencyError: a reader for its format is not installed.
    """
    return parse_image(read_bytes(Path(path), ImageError, hint="check the path"), name=str(path))


def parse_image(data: bytes, name: str) -> Image:
    """Return the image in the bytes of a file; errors as of `load_image`."""
    known = _known(data)
    if not known:
        known.append(_parse(data, name))
    return known[0] if known[0].name == name else replace(known[0], name=name)


@lru_cache(maxsize=_KEPT)
def _known(data: bytes) -> list[Image]:  # noqa: ARG001 - the cache's key
    """Return the place for the one image that is made of a file's bytes, whatever the file is called."""
    return []


def _parse(data: bytes, name: str) -> Image:
    if not data:
        raise ImageError(f"{name}: the file is empty", hint=_HINT)
    digest = hashlib.sha256(data).hexdigest()
    if data.startswith(ELF_MAGIC):
        return _parse_elf(data, name, digest)
    if data.startswith(b":") and _is_text(data):
        return _parse_hex(data, name, digest)
    if len(data) < _SMALLEST_BYTES:
        raise ImageError(f"{name}: {len(data)} bytes are too few for a program", hint=_HINT)
    wrong = wrong_kind(data)
    if wrong is not None:
        what, hint = wrong
        raise ImageError(f"{name}: {what}", hint=hint)
    return Image(name, ((FLASH_BASE, data),), sha256=digest)


def _is_text(data: bytes) -> bool:
    return all(byte in b"\r\n\t" or 0x20 <= byte < 0x7F for byte in data[:64])


def _parse_elf(data: bytes, name: str, digest: str) -> Image:
    try:
        from elftools.common.exceptions import ELFError
        from elftools.construct.core import ConstructError
        from elftools.elf.elffile import ELFFile
    except ImportError as error:
        raise MissingDependencyError(f"{name}: reading ELF needs pyelftools: {error}", extra="sim") from error
    try:
        elf = ELFFile(io.BytesIO(data))
        machine = elf["e_machine"]
        if machine != "EM_ARM" or elf.elfclass != 32 or not elf.little_endian:
            bits = f"{elf.elfclass}-bit {'little' if elf.little_endian else 'big'}-endian"
            raise ImageError(
                f"{name}: built for {bits} {_machine_name(machine)}, and the BluePill is a Cortex-M3, a 32-bit "
                "little-endian ARM",
                hint="build with arm-none-eabi-gcc -mcpu=cortex-m3 -mthumb",
            )
        if elf["e_type"] != "ET_EXEC":
            what = _NOT_LINKED.get(elf["e_type"], f"an ELF of type {elf['e_type']}")
            raise ImageError(f"{name}: {what}, no program", hint="link it for 0x08000000 and give the result")
        segments = []
        for segment in elf.iter_segments():
            if segment["p_type"] == "PT_LOAD" and segment["p_filesz"]:
                content = segment.data()
                if len(content) != segment["p_filesz"]:
                    raise ImageError(f"{name}: the file is cut off at {len(data)} bytes", hint="build or copy it again")
                skipped = _header_bytes(elf, segment["p_offset"], segment["p_filesz"])
                segments.append((segment["p_paddr"] + skipped, content[skipped:]))
        return _image_at(name, segments, _symbols(elf), digest)
    except (ELFError, ConstructError, KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        # pyelftools has no one error for a damaged file.
        raise ImageError(f"{name}: the ELF file is damaged: {error}", hint="build or copy it again") from error


def _header_bytes(elf: "ELFFile", offset: int, size: int) -> int:  # type: ignore[name-defined]  # noqa: F821 - late
    """Return how many bytes of a segment come before its first section: linkers may load the file's own headers."""
    starts = [section["sh_offset"] for section in elf.iter_sections() if section["sh_flags"] & _SHF_ALLOC]
    return min((start - offset for start in starts if offset <= start < offset + size), default=0)


def _machine_name(machine: object) -> str:
    """Return how the makers write the name of a machine of an ELF header, where that is known."""
    return _MACHINES.get(str(machine)) or str(machine).removeprefix("EM_").replace("_", "-").lower()


def _symbols(elf: "ELFFile") -> SymbolTable:  # type: ignore[name-defined]  # noqa: F821 - imported late
    table = elf.get_section_by_name(".symtab")
    if table is None:
        return SymbolTable()
    found: dict[int, Symbol] = {}
    weak: set[int] = set()
    for entry in table.iter_symbols():
        kind, name = entry["st_info"]["type"], entry.name
        if not name or name.startswith(_MAPPING_PREFIXES) or kind not in {"STT_FUNC", "STT_OBJECT", "STT_NOTYPE"}:
            continue
        if entry["st_shndx"] == "SHN_ABS":
            continue
        address = entry["st_value"] & ~1 if kind == "STT_FUNC" else entry["st_value"]
        symbol = Symbol(name, address, entry["st_size"], kind == "STT_FUNC")
        # Of several names at one address the sized one tells more; then one that is not weak, as the aliases of a
        # default handler are; then the first in the file.
        is_weak = entry["st_info"]["bind"] == "STB_WEAK"
        before = found.get(address)
        if before is None or (bool(symbol.size), not is_weak) > (bool(before.size), address not in weak):
            found[address] = symbol
            (weak.add if is_weak else weak.discard)(address)
    return SymbolTable(tuple(found[address] for address in sorted(found)))


def _parse_hex(data: bytes, name: str, digest: str) -> Image:
    try:
        from intelhex import IntelHex, IntelHexError
    except ImportError as error:
        raise MissingDependencyError(f"{name}: reading Intel HEX needs intelhex: {error}", extra="sim") from error
    reader = IntelHex()
    try:
        reader.loadhex(io.StringIO(data.decode("ascii")))
    except (IntelHexError, UnicodeDecodeError, ValueError) as error:
        raise ImageError(f"{name}: the Intel HEX file is damaged: {error}", hint="build or copy it again") from error
    if not data.rstrip().upper().endswith(b":00000001FF"):
        raise ImageError(f"{name}: the Intel HEX file has no end record: cut off?", hint="build or copy it again")
    segments = [(start, bytes(reader.tobinarray(start=start, end=end - 1))) for start, end in reader.segments()]
    return _image_at(name, segments, SymbolTable(), digest)


def _image_at(name: str, segments: list[tuple[int, bytes]], symbols: SymbolTable, digest: str) -> Image:
    """Return an image whose pieces may stand in the flash's alias at 0 (RM0008 3.4): the array is the same."""
    lowest = min((address for address, data in segments if data), default=FLASH_BASE)
    linked_at = 0 if lowest < FLASH_BYTES_FITTED else FLASH_BASE
    moved = ((without_alias(address), data) for address, data in segments)
    return Image(name, tuple(moved), symbols, digest, linked_at)
