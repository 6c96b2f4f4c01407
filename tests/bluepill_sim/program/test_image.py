"""Firmware files: what is accepted, and the one line that every other file gets."""

import contextlib
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.board import BluePill
from bluepill_sim.errors import BluePillError, ImageError
from bluepill_sim.program.elf_file import file_offset
from bluepill_sim.program.image import Image, Symbol, SymbolTable, load_image, parse_image
from simbase.errors import MissingDependencyError
from tests.tools.examples import EXAMPLES

FIRMWARE = EXAMPLES / "motors.elf"
PROGRAM = struct.pack("<II", 0x2000_5000, 0x0800_0009) + b"\xfe\xe7" * 4


def hex_record(kind: int, address: int, data: bytes) -> str:
    body = bytes([len(data), address >> 8, address & 0xFF, kind]) + data
    return ":" + (body + bytes([-sum(body) & 0xFF])).hex().upper() + "\n"


def hex_file(base: int, data: bytes) -> bytes:
    text = hex_record(4, 0, (base >> 16).to_bytes(2, "big")) + hex_record(0, base & 0xFFFF, data)
    return (text + hex_record(1, 0, b"")).encode()


def test_a_plain_binary_stands_at_the_start_of_the_flash() -> None:
    image = parse_image(PROGRAM, "a.bin")
    assert image.segments == ((0x0800_0000, PROGRAM),)
    assert image.vector_table == 0x0800_0000
    assert len(image.sha256) == 64


def test_an_elf_brings_its_symbols() -> None:
    image = load_image(FIRMWARE)
    assert image.vector_table == 0x0800_0000
    main = image.symbols.address_of("main")
    assert main is not None
    assert image.symbols.where(main + 2) == f"main+0x2 ({main + 2:#010x})"
    assert image.symbols.address_of("no such name") is None


def test_of_the_names_of_one_address_a_weak_alias_is_the_last_to_be_told() -> None:
    symbols = load_image(FIRMWARE).symbols
    default = symbols.address_of("Default_Handler")
    assert default is not None
    assert symbols.where(default) == f"Default_Handler+0x0 ({default:#010x})"


def test_what_a_file_holds_is_read_once_whatever_it_is_called() -> None:
    one, other, again = (parse_image(FIRMWARE.read_bytes(), name) for name in ("a.elf", "b.elf", "a.elf"))
    assert (one.name, other.name) == ("a.elf", "b.elf")
    assert other.symbols is one.symbols
    assert again == one
    with pytest.raises(ImageError, match=r"^a\.bin: "):
        parse_image(b"\xff" * 64, "a.bin")
    with pytest.raises(ImageError, match=r"^b\.bin: "):
        parse_image(b"\xff" * 64, "b.bin")


def test_an_intel_hex_file_may_start_behind_a_boot_loader() -> None:
    program = struct.pack("<II", 0x2000_5000, 0x0800_2009) + b"\xfe\xe7" * 4
    image = parse_image(hex_file(0x0800_2000, program), "a.hex")
    assert image.segments == ((0x0800_2000, program),)
    assert image.vector_table == 0x0800_2000


def test_a_hex_file_linked_at_zero_stands_in_the_flash() -> None:
    program = struct.pack("<II", 0x2000_5000, 9) + b"\xfe\xe7" * 4
    image = parse_image(hex_file(0, program), "a.hex")
    assert (image.segments, image.vector_table, image.linked_at) == (((0x0800_0000, program),), 0x0800_0000, 0)


def test_the_same_program_runs_from_every_format(tmp_path: Path) -> None:
    image = load_image(FIRMWARE)
    base = image.segments[0][0]
    plain = bytearray(max(a + len(d) for a, d in image.segments) - base)
    for address, data in image.segments:
        plain[address - base : address - base + len(data)] = data
    records = "".join(
        hex_record(0, (base & 0xFFFF) + at, bytes(plain[at : at + 16])) for at in range(0, len(plain), 16)
    )
    as_hex = hex_record(4, 0, b"\x08\x00") + records + hex_record(1, 0, b"")
    (tmp_path / "a.bin").write_bytes(plain)
    (tmp_path / "a.hex").write_text(as_hex)
    sent = []
    for file in (FIRMWARE, tmp_path / "a.bin", tmp_path / "a.hex"):
        board, text = BluePill(file), bytearray()
        board.usart1.subscribe(lambda rows, text=text: text.extend(word for word, _ in rows))
        board.advance_to(10_000_000)
        sent.append(bytes(text))
    assert sent == [b"motors: ready\n"] * 3


def bad_elf(**changes: int) -> bytes:
    """The real ELF with fields of its header changed: offset by name."""
    data = bytearray(FIRMWARE.read_bytes())
    for name, value in changes.items():
        data[{"elf_class": 4, "byte_order": 5, "machine": 18}[name]] = value
    return bytes(data)


def elf_header(*, elf_class: int = 1, byte_order: int = 1, machine: int) -> bytes:
    """The header of a program for another machine, and nothing behind it."""
    order, word = "<>"[byte_order - 1], "I" if elf_class == 1 else "Q"
    start = b"\x7fELF" + bytes([elf_class, byte_order, 1]) + bytes(9)
    size, entry = (52, 32) if elf_class == 1 else (64, 56)
    fields = struct.pack(f"{order}HHI3{word}IHHHHHH", 2, machine, 1, 0, size, 0, 0, size, entry,
                         0, 40, 0, 0)  # fmt: skip
    return start + fields + bytes(64)


def elf_of_type(number: int) -> bytes:
    """The real ELF saying that it is something else than a program."""
    data = bytearray(FIRMWARE.read_bytes())
    data[16] = number
    return bytes(data)


HOST_ELF = Path(sys.executable).resolve()
BAD_FILES = [
    (b"", "the file is empty"),
    (b"abc", "3 bytes are too few"),
    (bytes(range(256)) * 16, "the initial stack pointer 0x03020100 at 0x08000000 is not in the SRAM"),
    (b"\xff" * 1024, "no stack pointer and no reset vector at 0x08000000: 0xffffffff is erased flash"),
    (struct.pack("<II", 0x2000_5000, 0xFFFF_FFFF) * 8, "no reset vector at 0x08000000: 0xffffffff is erased flash"),
    (struct.pack("<II", 0x2000_0003, 0x0800_0009) * 8, "stack pointer 0x20000003 at 0x08000000 is not in the SRAM"),
    (struct.pack("<II", 0x2000_5004, 0x0800_0009) * 8, "stack pointer 0x20005004 at 0x08000000 is not in the SRAM"),
    (b"\0" * 1024, "the initial stack pointer 0x00000000"),
    (struct.pack("<II", 0x2000_5000, 0x0800_0008) * 8, "the reset vector 0x08000008 is not a Thumb address"),
    (struct.pack("<II", 0x2000_5000, 0x2000_0001) * 8, "the reset vector 0x20000001 is not a Thumb address"),
    (PROGRAM + bytes(128 * 1024), "131088 bytes at 0x08000000 are outside the flash"),
    (hex_file(0x0900_0000, PROGRAM), "16 bytes at 0x09000000 are outside the flash"),
    (hex_file(0x2000_0000, PROGRAM), "16 bytes at 0x20000000 are outside the flash"),
    (hex_file(0x0800_0000, PROGRAM)[:-12], "no end record: cut off?"),
    (b":1000000000500020zz\n", "the Intel HEX file is damaged"),
    (b":020000040800F3\n:00000001FF\n", "the Intel HEX file is damaged"),
    (hex_record(1, 0, b"").encode(), "no code or data in it"),
    (bad_elf(machine=62), "built for 32-bit little-endian x86-64, and the BluePill is a Cortex-M3, a 32-bit"),
    (bad_elf(machine=243), "built for 32-bit little-endian RISC-V, and"),
    (elf_header(elf_class=2, machine=183), "built for 64-bit little-endian ARM (AArch64), and the BluePill"),
    (elf_header(elf_class=2, machine=40), "built for 64-bit little-endian ARM, and the BluePill is a Cortex-M3"),
    (elf_header(byte_order=2, machine=40), "built for 32-bit big-endian ARM, and"),
    (FIRMWARE.read_bytes()[:64], "the ELF file is damaged"),
    (FIRMWARE.read_bytes()[:0x200], "damaged"),
    (b"\x7fELF", "the ELF file is damaged"),
    (b"root:x:0:0:root:/root:/bin/bash\n" * 4, "a text file, no firmware"),
    ("#!/bin/sh\necho Grüße\n".encode() * 4, "a text file, no firmware"),
    (b"int main(void) { return 0; }\n", "a text file, no firmware"),
    (b"S00600004844521B\nS1130000285F245F2212226A000424290008237C2A\n", "Motorola S-record"),
    (b"!<arch>\n" + bytes(80), "a library (ar archive)"),
    (b"UF2\n\x57\x51\x5d\x9e" + bytes(504), "a UF2 file"),
    (b"\x1f\x8b\x08\0" + bytes(60), "a gzip file"),
    (b"PK\x03\x04" + bytes(60), "a ZIP archive"),
    (elf_of_type(1), "a compiled source that is not linked (object file)"),
]


@pytest.mark.parametrize(("data", "message"), BAD_FILES)
def test_a_bad_file_is_one_line_with_a_hint(data: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "firmware.elf"
    path.write_bytes(data)
    with pytest.raises(ImageError) as error:
        BluePill(path)
    text = str(error.value)
    assert message in text or ("cut off" in text and "damaged" in message)
    assert text.startswith(str(path))
    assert "\n" not in text
    assert error.value.exit_code == 2
    assert error.value.hint


@pytest.mark.parametrize("core", ["native", "python"])
@pytest.mark.parametrize(("word", "stack"), [(0x2000_4FFF, 0x2000_4FFC), (0x2000_0004, 0x2000_0004)])
def test_the_core_drops_the_lowest_bits_of_the_first_stack_pointer(
    word: int, stack: int, core: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As linker scripts of ST once had it: the last byte of the SRAM."""
    monkeypatch.setenv("P2OS_CORE", core)
    path = tmp_path / "firmware.bin"
    path.write_bytes(struct.pack("<II", word, 0x0800_0009) + PROGRAM[8:])
    assert BluePill(path).register("SP") == stack


def test_a_missing_file_and_a_folder_are_one_line(tmp_path: Path) -> None:
    for path, message in ((tmp_path / "none.elf", "no such file"), (tmp_path, "is a directory")):
        with pytest.raises(ImageError, match=message):
            load_image(path)


@pytest.mark.skipif(not HOST_ELF.read_bytes().startswith(b"\x7fELF"), reason="this machine's programs are no ELF")
def test_a_program_of_this_very_machine_is_refused() -> None:
    with pytest.raises(ImageError, match="built for"):
        load_image(HOST_ELF)


def test_an_elf_cut_off_anywhere_never_runs_damaged() -> None:
    whole = FIRMWARE.read_bytes()
    for length in range(0, len(whole), 97):
        try:
            image = parse_image(whole[:length], "cut.elf")
        except BluePillError:
            continue
        # Only what follows the program, such as debug information, may be missing.
        assert image.segments == load_image(FIRMWARE).segments


@given(st.binary(max_size=2000))
def test_random_bytes_raise_nothing_but_our_errors(data: bytes) -> None:
    for prefix in (b"", b"\x7fELF\x01\x01\x01", b":"):
        with contextlib.suppress(BluePillError):
            parse_image(prefix + data, "random")


def test_where_without_a_symbol_is_the_address() -> None:
    table = SymbolTable((Symbol("main", 0x0800_0100, 0x10), Symbol("label", 0x0800_0200)))
    assert table.where(0x0800_0000) == "0x08000000"
    assert table.where(0x0800_010F) == "main+0xf (0x0800010f)"
    assert table.where(0x0800_0110) == "0x08000110"
    assert table.where(0x0800_0300) == "label+0x100 (0x08000300)"


@pytest.mark.parametrize("module", ["elftools.elf.elffile", "intelhex", "unicorn"])
def test_a_missing_library_is_named_with_its_remedy(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    data = hex_file(0x0800_0000, PROGRAM) if module == "intelhex" else FIRMWARE.read_bytes() + b"\0"  # read by none
    with pytest.raises(MissingDependencyError) as error:
        BluePill(parse_image(data, "a"))
    assert "unicorn" in str(error.value.hint)
    assert error.value.exit_code == 2


def test_an_image_needs_bytes() -> None:
    with pytest.raises(ImageError, match="no code or data"):
        Image("none", ())


@pytest.mark.skipif(shutil.which("arm-none-eabi-strip") is None, reason="arm-none-eabi-strip is not installed")
def test_a_stripped_elf_runs_without_names(tmp_path: Path) -> None:
    stripped = tmp_path / "stripped.elf"
    subprocess.run(["arm-none-eabi-strip", "-o", stripped, FIRMWARE], check=True)
    image = load_image(stripped)
    assert image.symbols == SymbolTable()
    assert image.segments == load_image(FIRMWARE).segments


def test_a_place_of_the_flash_is_found_in_the_file_and_one_behind_the_program_is_not() -> None:
    data = FIRMWARE.read_bytes()
    ((start, held),) = load_image(FIRMWARE).segments
    for offset in (0, 1, 0x134, len(held) - 1):
        at = file_offset(data, start - 0x0800_0000 + offset)
        assert data[at : at + 1] == held[offset : offset + 1]
        assert data[at - offset : at - offset + len(held)] == held
    with pytest.raises(ImageError, match=f"nothing is loaded at {start + len(held):#010x}") as refused:
        file_offset(data, len(held))
    assert refused.value.hint == "give the ELF that was linked"
