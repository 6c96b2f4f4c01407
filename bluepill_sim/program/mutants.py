"""A program with one instruction changed: which there are, and how its files look.

Only instructions that ran are changed, and only in the flash: what a program copies to the SRAM is data to it.
Each `Mutant` differs from the program in one instruction, at one address.

Invariant: the same program and the same addresses give the same mutants, in the same order.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from bluepill_sim.program.alterations import Alteration, Site, alterations, it_count, size_at, word_of
from bluepill_sim.program.elf_file import file_offset
from bluepill_sim.program.image import ELF_MAGIC, Image
from bluepill_sim.stm32f103 import FLASH_BASE, without_alias

#: chosen: so far behind a MOVW its MOVT is looked for; compilers put others between the two.
_MOVT_WITHIN = 4
_MOVT = (0xFBF0_8000, 0xF2C0_0000)


@dataclass(frozen=True, slots=True)
class Mutant:
    """One changed instruction."""

    #: Where the program runs it.
    address: int
    alteration: Alteration

    @property
    def flash_offset(self) -> int:
        """Where it stands in the flash array."""
        return without_alias(self.address) - FLASH_BASE

    def patched(self, flash: bytes) -> bytes:
        """Return the contents of the flash array with the change."""
        at, code = self.flash_offset, self.alteration.code
        return flash[:at] + code + flash[at + len(code) :]

    def image(self, image: Image) -> Image:
        """Return a program with the change."""
        at, code = self.flash_offset + FLASH_BASE, self.alteration.code
        segments = tuple(
            (start, _put(data, at - start, code)) if start <= at < start + len(data) else (start, data)
            for start, data in image.segments
        )
        return replace(image, segments=segments)


def mutants(image: Image, ran: Iterable[int]) -> list[Mutant]:
    """Return every change of the instructions that begin at some addresses, by address."""
    read = _Reader(image)
    addresses = sorted({address for address in ran if read.code(address)})
    conditional = _conditional(read, addresses)
    found = []
    for address in addresses:
        code = read.code(address)
        site = Site(
            word_of(code), address, is_in_it=address in conditional, it_bytes=_it_bytes(read, address),
            is_half=_has_upper_half(read, address),
        )  # fmt: skip
        found += [Mutant(address, one) for one in alterations(code, site)]
    return found


def mutated_file(data: bytes, mutant: Mutant, image: Image) -> bytes:
    """Return a firmware file with a change: the ELF patched; of HEX and BIN a plain binary for 0x08000000."""
    if not data.startswith(ELF_MAGIC):
        end = max(start + len(content) for start, content in image.segments) - FLASH_BASE
        flash = bytearray(b"\xff" * end)
        for start, content in image.segments:
            flash[start - FLASH_BASE : start - FLASH_BASE + len(content)] = content
        return mutant.patched(bytes(flash))
    return _put(data, file_offset(data, mutant.flash_offset), mutant.alteration.code)


class _Reader:
    """Instructions of a program as it stands in the flash."""

    def __init__(self, image: Image) -> None:
        self._segments = image.segments

    def code(self, address: int) -> bytes:
        """Return the bytes of the instruction at an address; nothing where the program has none there."""
        at = without_alias(address)
        for start, data in self._segments:
            offset = at - start
            if 0 <= offset <= len(data) - 2:
                size = size_at(int.from_bytes(data[offset : offset + 2], "little"))
                return data[offset : offset + size] if offset + size <= len(data) else b""
        return b""


def _conditional(read: _Reader, addresses: Iterable[int]) -> Mapping[int, int]:
    """Return the instructions that an IT makes conditional, each with the address of that."""
    found: dict[int, int] = {}
    for address in addresses:
        for inside in _inside(read, address):
            found[inside] = address
    return found


def _inside(read: _Reader, address: int) -> list[int]:
    """Return the addresses of the instructions that the one at an address makes conditional, if it is an IT."""
    code = read.code(address)
    word = word_of(code)
    if len(code) != 2 or word & 0xFF00 != 0xBF00 or not word & 15:
        return []
    found, at = [], address + 2
    for _ in range(it_count(word & 15)):
        found.append(at)
        at += len(read.code(at)) or 2
    return found


def _it_bytes(read: _Reader, address: int) -> int:
    inside = _inside(read, address)
    return sum(len(read.code(at)) or 2 for at in inside)


def _has_upper_half(read: _Reader, address: int) -> bool:
    """Tell whether a MOVT to the same register follows soon."""
    code = read.code(address)
    if len(code) != 4:
        return False
    target, at = word_of(code) >> 8 & 15, address + 4
    for _ in range(_MOVT_WITHIN):
        code = read.code(at)
        word = word_of(code) if len(code) == 4 else 0
        if word & _MOVT[0] == _MOVT[1] and word >> 8 & 15 == target:
            return True
        at += len(code) or 2
    return False


def _put(data: bytes, at: int, code: bytes) -> bytes:
    return data[:at] + code + data[at + len(code) :]
