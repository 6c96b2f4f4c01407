"""Which source line an instruction comes from: the DWARF line programs of an ELF.

Versions 2 to 5 are read. Code that the linker has thrown away is left out: its
addresses are neither in the flash nor in the SRAM. Without debug information the table is empty.

Source: DWARF Debugging Information Format 5, section 6.2.
Invariant: rows are sorted by address and do not overlap.
"""

import io
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from bluepill_sim.errors import ImageError
from bluepill_sim.program.elf_file import file_bytes
from bluepill_sim.program.image import ELF_MAGIC, Image
from bluepill_sim.stm32f103 import may_hold_code
from simbase.errors import FileError, MissingDependencyError
from simbase.files import read_text


@dataclass(frozen=True, slots=True)
class LineRow:
    """A run of instructions that come from one line."""

    address: int
    #: The address after it.
    end: int
    file: str
    line: int


@dataclass(frozen=True)
class LineTable:
    """All rows of a program."""

    rows: tuple[LineRow, ...] = ()

    @cached_property
    def _addresses(self) -> list[int]:
        return [row.address for row in self.rows]

    def at(self, address: int) -> LineRow | None:
        """Return the row that an address is in; None where no line is known."""
        index = bisect_right(self._addresses, address) - 1
        if index >= 0 and address < self.rows[index].end:
            return self.rows[index]
        return None

    def place(self, address: int) -> str:
        """Return "file.c:12", or nothing where no line is known."""
        row = self.at(address)
        return "" if row is None else f"{row.file.rsplit('/', 1)[-1]}:{row.line}"


def read_lines(image: Image) -> LineTable:
    """Return the line table of a program; an empty one for HEX, BIN, and ELF without debug information.

    Raises:
        ImageError: the file is gone, or its debug information is damaged.
        MissingDependencyError: pyelftools is not installed.
    """
    data = file_bytes(image)
    if not data.startswith(ELF_MAGIC):
        return LineTable()
    try:
        from elftools.common.exceptions import DWARFError, ELFError
        from elftools.construct.core import ConstructError
    except ImportError as error:
        raise MissingDependencyError(f"source lines need pyelftools: {error}", extra="sim") from error
    try:
        return _lines_of(data, image.linked_at)
    except (ELFError, DWARFError, ConstructError, KeyError, ValueError, IndexError, AttributeError, TypeError) as error:
        # pyelftools has no one error for a damaged file.
        raise ImageError(f"{image.name}: the debug information is damaged: {error}", hint="build it again") from error


@lru_cache(maxsize=4)  # of one program are asked for the board's, the coverage's and each replay's: 50 ms each
def _lines_of(elf_bytes: bytes, flash: int) -> LineTable:
    from elftools.elf.elffile import ELFFile

    elf = ELFFile(io.BytesIO(elf_bytes))
    if not elf.has_dwarf_info():
        return LineTable()
    rows: list[LineRow] = []
    dwarf = elf.get_dwarf_info()
    for unit in dwarf.iter_CUs():
        program = dwarf.line_program_for_CU(unit)
        if program is not None:
            rows += _rows_of(program, _Files(program, unit), flash)
    return LineTable(_without_overlaps(rows))


def source_lines(name: str, sources: Path | None) -> list[str]:
    """Return the lines of a source file: where it was built, or in the folder given, or nothing."""
    candidates = [Path(name)] if Path(name).is_absolute() else []
    if sources is not None:
        candidates += [sources / name, sources / Path(name).name]
    for path in candidates:
        try:
            return read_text(path, errors="replace").splitlines()
        except FileError:
            continue
    return []


class _Files:
    """Names of the files of one line program."""

    def __init__(self, program: Any, unit: Any) -> None:  # pyelftools has no types
        header = program.header
        self._entries = header["file_entry"]
        self._folders = [_text(folder) for folder in header["include_directory"]]
        #: Version 5 counts files and folders from 0, where the folder of the compilation stands.
        self._is_new = header["version"] >= 5
        attribute = unit.get_top_DIE().attributes.get("DW_AT_comp_dir")
        self._compiled_in = "" if attribute is None else _text(attribute.value)

    def name(self, index: int) -> str:
        entry = self._entries[index if self._is_new else index - 1]
        name, number = _text(entry.name), entry.dir_index
        if name.startswith("/"):
            return name
        folders = self._folders if self._is_new else ["", *self._folders]
        folder = folders[number]
        if not folder.startswith("/"):
            folder = f"{self._compiled_in}/{folder}" if folder not in ("", self._compiled_in) else self._compiled_in
        parts = [part for part in f"{folder}/{name}".split("/") if part != "."]
        return "/".join(parts)


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _rows_of(program: Any, files: _Files, flash: int) -> list[LineRow]:  # pyelftools has no types
    rows = []
    last = None
    for entry in program.get_entries():
        state = entry.state
        if state is None:
            continue
        if last is not None and state.address > last.address and last.line:
            row = LineRow(last.address, state.address, files.name(last.file), last.line)
            if may_hold_code(row.address, flash):
                rows.append(row)
        last = None if state.end_sequence else state
    return rows


def _without_overlaps(rows: list[LineRow]) -> tuple[LineRow, ...]:
    found: list[LineRow] = []
    for row in sorted(rows, key=lambda r: (r.address, r.end)):
        if not found or row.address >= found[-1].end:
            found.append(row)
    return tuple(found)
