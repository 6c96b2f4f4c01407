"""A program's variables by name: what shipped programs have, and how any name and any bytes are read."""

import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.errors import ImageError
from bluepill_sim.program.image import Image, Symbol, SymbolTable, load_image
from bluepill_sim.program.variables import NumberForm, Variable, VariableTable, read_variables
from simbase.errors import UsageError

DODGE = Path(__file__).parents[3] / "robot_bench" / "firmware" / "dodge.elf"
SOURCE = """
struct inner { signed char small; unsigned bits : 3; signed low : 5; };
struct outer { struct inner rows[2]; float half; double whole; union { int word; short halves[2]; }; int *to; };
enum mode { IDLE, DRIVE = 4, BACK = -1 };
volatile struct outer state = {{{-3, 5, -2}}, 0.5f, 2.25, {7}, 0};
static volatile unsigned short table[2][3] = {{1, 2, 3}, {4, 5, 6}};
enum mode mode = BACK;
long long far = -5;
_Bool flag = 1;
int *use(void) { static int count = 9; return &count + table[0][0] + flag; }
"""


@pytest.fixture(scope="module")
def dodge() -> VariableTable:
    return read_variables(load_image(DODGE))


def test_globals_statics_of_functions_struct_fields_and_elements_have_names(dodge: VariableTable) -> None:
    ticks = dodge.variable("ticks")
    assert (ticks.type_name, ticks.size, ticks.encoding) == ("uint32_t", 4, NumberForm.UNSIGNED)
    state = dodge.variable(" main::dodge.state")
    assert state.type_name.startswith("enum dodge_state: 0 DODGE_CRUISE, 1 ")
    row = dodge.variable("main::dodge.unseen_ticks[3]")
    first = dodge.variable("main::dodge.unseen_ticks[0]")
    assert row.address == first.address + 3 * first.size
    # Where one function alone has the name, it may be left out.
    assert dodge.variable("odometer.left.steps") == dodge.variable("main::odometer.left.steps")


@pytest.mark.parametrize(("name", "says"), [
    ("tick", "did you mean 'ticks'"), ("", "no variable"), ("ticks.low", "no struct"), ("ticks[0]", "no array"),
    ("main::dodge", "such as main::dodge.state"), ("ring", "such as ring[0]"), ("ring[256]", "256 elements"),
    ("ring[-1]", "no name"), ("main::dodge.stat", "did you mean 'state'"), ("ring[1", "no name"),
    ("ring..x", "no name"),
])  # fmt: skip
def test_what_is_no_number_is_refused_with_what_there_is(dodge: VariableTable, name: str, says: str) -> None:
    with pytest.raises(UsageError) as refused:
        dodge.variable(name)
    assert says in f"{refused.value} {refused.value.hint}"


def test_what_was_typed_is_completed_by_its_beginning_or_else_by_a_part(dodge: VariableTable) -> None:
    assert dodge.offered("main::dodge.turn_") == ["main::dodge.turn_side", "main::dodge.turn_twist",
                                                  "main::dodge.turn_way"]  # fmt: skip
    assert dodge.offered("ring[25")[:2] == ["ring[25]", "ring[250]"]
    assert dodge.offered("TWIST") == ["main::dodge.least_twist", "main::dodge.turn_twist"]
    assert dodge.offered("nothing of that") == []
    assert all(dodge.variable(name).name == name for name in dodge.offered(""))


@settings(max_examples=20)
@given(st.text(max_size=40))
def test_any_name_is_a_number_or_refused(dodge: VariableTable, name: str) -> None:
    dodge.offered(name)
    try:
        found = dodge.variable(name)
    except UsageError:
        return
    assert found.size in {1, 2, 4, 8}


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 7), st.integers(1, 8))
def test_bytes_are_the_number_that_their_type_says(value: int, first: int, bits: int) -> None:
    def of(encoding: NumberForm, size: int = 4, **field: int) -> Variable:
        return Variable(name="x", type_name="", address=0, size=size, encoding=encoding, **field)

    data = struct.pack("<i", value)
    assert of(NumberForm.SIGNED).number(data) == value
    assert of(NumberForm.UNSIGNED).number(data) == value % 2**32
    assert of(NumberForm.FLOAT, 8).number(struct.pack("<d", value / 3)) == value / 3
    low = value >> first & (1 << bits) - 1
    assert of(NumberForm.UNSIGNED, first_bit=first, bits=bits).number(data) == low
    assert of(NumberForm.SIGNED, first_bit=first, bits=bits).number(data) == low - (low >> bits - 1 << bits)


def test_without_debug_information_symbols_of_a_words_size_are_numbers(tmp_path: Path) -> None:
    whole = load_image(DODGE)
    elf = tmp_path / "plain.elf"
    data = bytearray(DODGE.read_bytes())
    for name in (b".debug_info", b".debug_line"):
        data = data.replace(name, b".xebug" + name[6:])
    elf.write_bytes(data)
    plain = Image(
        str(elf), whole.segments, SymbolTable((Symbol("ticks", 0x2000_0000, 4), Symbol("ring", 0x2000_000C, 256)))
    )
    found = read_variables(plain)
    assert found.variable("ticks").type_name == "4 bytes"
    with pytest.raises(UsageError):
        found.variable("ring")
    assert read_variables(Image(__file__, whole.segments)).roots == {}


def test_damaged_debug_information_is_refused_in_a_line(tmp_path: Path) -> None:
    whole = load_image(DODGE)
    data = bytearray(DODGE.read_bytes())
    from io import BytesIO

    from elftools.elf.elffile import ELFFile

    section = ELFFile(BytesIO(data)).get_section_by_name(".debug_abbrev")
    assert section is not None
    data[section["sh_offset"] : section["sh_offset"] + 200] = b"\xee" * 200
    elf = tmp_path / "bad.elf"
    elf.write_bytes(data)
    with pytest.raises(ImageError, match="debug information is damaged"):
        read_variables(Image(str(elf), whole.segments))


def test_the_same_name_in_two_files_needs_its_file() -> None:
    number = read_variables(load_image(DODGE)).roots["ticks"][1]
    table = VariableTable({"a.c::n": (0x2000_0000, number), "b.c::n": (0x2000_0004, number)},
                          {"n": ("a.c::n", "b.c::n")})  # fmt: skip
    assert table.variable("b.c::n").address == 0x2000_0004
    with pytest.raises(UsageError, match="several files") as refused:
        table.variable("n")
    assert refused.value.hint == "a.c::n or b.c::n"


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 4, 5])
def test_types_of_a_compiler_of_each_version_of_dwarf(tmp_path: Path, version: int) -> None:
    compiler = shutil.which("arm-none-eabi-gcc")
    if compiler is None:
        pytest.skip("arm-none-eabi-gcc is not installed")
    source, elf = tmp_path / "kinds.c", tmp_path / "kinds.elf"
    source.write_text(SOURCE)
    subprocess.run([compiler, "-mcpu=cortex-m3", "-mthumb", f"-gdwarf-{version}", "-nostdlib", "-Wl,-Ttext=0x08000200",
                    "-Wl,-Tdata=0x20000000", "-Wl,-e,use", str(source), "-o", str(elf)], check=True)  # fmt: skip
    whole = load_image(DODGE)
    table = read_variables(Image(str(elf), whole.segments))
    from elftools.elf.elffile import ELFFile

    with elf.open("rb") as file:
        section = ELFFile(file).get_section_by_name(".data")
        assert section is not None
        data, base = section.data(), section["sh_addr"]

    def value(name: str) -> float:
        one = table.variable(name)
        return one.number(data[one.address - base : one.address - base + one.size])

    found = {name: value(name) for name in (
        "state.rows[0].small", "state.rows[0].bits", "state.rows[0].low", "state.half", "state.whole", "state.word",
        "state.halves[0]", "table[1][2]", "mode", "far", "flag", "use::count", "count",
    )}  # fmt: skip
    assert found == {
        "state.rows[0].small": -3, "state.rows[0].bits": 5, "state.rows[0].low": -2, "state.half": 0.5,
        "state.whole": 2.25, "state.word": 7, "state.halves[0]": 7, "table[1][2]": 6, "mode": -1, "far": -5, "flag": 1,
        "use::count": 9, "count": 9,
    }  # fmt: skip
