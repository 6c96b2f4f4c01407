"""The committed ELFs: made from the sources beside them, free of this machine, and sane for the chip."""

import importlib.util
import re
import struct
from pathlib import Path
from types import ModuleType

import pytest
from elftools.elf.elffile import ELFFile

from adapter_sim.pinout import load_pinout
from robot_bench.firmware import build

FOREIGN = Path(__file__).parents[2] / "firmware_foreign"
UNOPTIMISED = Path(__file__).parents[2] / "bluepill_sim" / "firmware"
OTHERS = [
    FOREIGN / "foreign.elf",
    UNOPTIMISED / "unoptimised.elf",
    UNOPTIMISED / "parts.elf",
    *(build.SILICON / f"{name}.elf" for name in build.SILICON_PROGRAMS),
]
ELFS = [*(build.HERE / f"{name}.elf" for name in build.PROGRAMS), *OTHERS]
FLASH_START, FLASH_END = 0x0800_0000, 0x0801_0000
SRAM_START, SRAM_END = 0x2000_0000, 0x2000_5000
#: 16 of the core and 60 of an STM32F103.
VECTORS = 76


def builder_in(folder: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("other_build", folder / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def _same_compiler() -> None:
    version = build.compiler_version()
    if version != build.COMPILER_VERSION:
        pytest.skip(f"the committed ELFs are of {build.COMPILER_VERSION}; here is {version or 'no cross compiler'}")


@pytest.mark.usefixtures("_same_compiler")
def test_a_program_comes_out_of_the_same_compiler_as_it_is_committed(tmp_path: Path) -> None:
    output = tmp_path / "motors.elf"
    build.build_elf(build.PROGRAMS["motors"], folder=build.HERE, linker_script="f103c8.ld", output=output)
    assert output.read_bytes() == (build.HERE / output.name).read_bytes()


@pytest.mark.slow
@pytest.mark.usefixtures("_same_compiler")
def test_the_same_compiler_builds_the_same_bytes(tmp_path: Path) -> None:
    built = [
        *build.build_programs(tmp_path),
        builder_in(FOREIGN).build_foreign(tmp_path),
        builder_in(UNOPTIMISED).build_program(tmp_path / "unoptimised.elf"),
        builder_in(UNOPTIMISED).build_program(tmp_path / "parts.elf"),
        *(build.build_silicon(name, tmp_path / f"{name}.elf") for name in build.SILICON_PROGRAMS),
    ]
    assert [path.name for path in built] == [path.name for path in ELFS]
    stale = [
        committed.name
        for committed, fresh in zip(ELFS, built, strict=True)
        if committed.read_bytes() != fresh.read_bytes()
    ]
    assert stale == [], "rebuild them: make firmware, and the build.py beside each of the others"


def test_a_missing_compiler_is_one_line_and_a_hint(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(build, "COMPILER", "no-such-compiler")
    monkeypatch.setattr("sys.argv", ["build.py"])
    assert build.main() == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == "build: no-such-compiler is not installed\nhint: apt-get install gcc-arm-none-eabi\n"


def test_the_builder_says_the_sizes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    if build.compiler_version() is None:
        pytest.skip("no cross compiler")
    monkeypatch.setattr(build, "PROGRAMS", {"motors": build.PROGRAMS["motors"]})
    monkeypatch.setattr(build, "COMPILER_VERSION", "another")
    monkeypatch.setattr("sys.argv", ["build.py", "--out", str(tmp_path)])
    assert build.main() == 0
    said = capsys.readouterr()
    assert re.fullmatch(r"motors\.elf: \d+ bytes\nkit\.elf: \d+ bytes\npins\.elf: \d+ bytes\n", said.out)
    assert "gives other bytes than another" in said.err


@pytest.mark.parametrize("path", ELFS, ids=lambda path: path.stem)
def test_no_path_of_the_building_machine_is_left(path: Path) -> None:
    assert re.findall(rb"(?:^|\x00)/[\w.]+/[^\x00]*", path.read_bytes()) == []
    with path.open("rb") as stream:
        dwarf = ELFFile(stream).get_dwarf_info()
        for unit in dwarf.iter_CUs():
            attributes = unit.get_top_DIE().attributes
            assert attributes["DW_AT_comp_dir"].value == b"."
            assert not attributes["DW_AT_name"].value.startswith(b"/")


@pytest.mark.parametrize("path", ELFS, ids=lambda path: path.stem)
def test_the_vector_table_is_sane(path: Path) -> None:
    with path.open("rb") as stream:
        elf = ELFFile(stream)
        assert elf["e_machine"] == "EM_ARM"
        text = elf.get_section_by_name(".text")
        assert text["sh_addr"] == FLASH_START
        stack, *handlers = struct.unpack(f"<{VECTORS}I", text.data()[: 4 * VECTORS])
        symbols = {s.name: s["st_value"] for s in elf.get_section_by_name(".symtab").iter_symbols()}
    assert stack == SRAM_END
    assert handlers[0] == symbols["Reset_Handler"] == elf["e_entry"]
    assert handlers[14] == symbols["SysTick_Handler"]
    assert handlers[15 + 37] == symbols["USART1_IRQHandler"]
    reserved = {6, 7, 8, 9, 12}  # entries 7 to 10 and 13 of the table
    for number, handler in enumerate(handlers):
        if number in reserved:
            assert handler == 0
        else:
            assert handler & 1, f"vector {number + 1} lacks the Thumb bit"
            assert FLASH_START + 4 * VECTORS <= handler < text["sh_addr"] + text["sh_size"]


@pytest.mark.parametrize("path", ELFS, ids=lambda path: path.stem)
def test_a_program_fits_the_chip(path: Path) -> None:
    with path.open("rb") as stream:
        segments = [s for s in ELFFile(stream).iter_segments() if s["p_type"] == "PT_LOAD" and s["p_memsz"]]
    for segment in segments:
        start, end = segment["p_vaddr"], segment["p_vaddr"] + segment["p_memsz"]
        assert FLASH_START <= start < end <= FLASH_END or SRAM_START <= start < end <= SRAM_END
        assert FLASH_START <= segment["p_paddr"] < FLASH_END or segment["p_filesz"] == 0


def test_the_board_header_has_the_wires_of_the_pinout() -> None:
    header = (build.HERE / "board.h").read_text()
    in_header = {name: f"P{port}{bit}" for name, port, bit in re.findall(r"X\((\w+), ([A-C]), (\d+)\)", header)}
    assert in_header == {wire.name: wire.bluepill for wire in load_pinout().wires}
