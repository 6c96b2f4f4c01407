"""Two versions of a program: where their code and their source lines differ, whatever has moved."""

import shutil
import subprocess
from pathlib import Path

import pytest

from bluepill_sim.program.image import Image, load_image
from bluepill_sim.program.version_difference import code_differences, line_differences
from robot_bench.firmware.build import COMPILER, HERE, PROGRAMS, build_elf

DODGE = HERE / "dodge.elf"
SOURCE = "dodge_fsm.c"


@pytest.fixture(scope="module")
def good() -> Image:
    return load_image(DODGE)


def built(folder: Path, right: str, wrong: str, file: str = SOURCE, program: str = "dodge") -> Image:
    """Return a program with a piece of text of a source changed."""
    if shutil.which(COMPILER) is None:
        pytest.skip(f"no {COMPILER}")
    sources = folder / "sources"
    shutil.copytree(HERE, sources)
    path = sources / file
    text = path.read_text()
    assert text.count(right) == 1
    path.write_text(text.replace(right, wrong))
    output = folder / "changed.elf"
    build_elf(
        PROGRAMS[program], folder=sources, linker_script="f103c8.ld", output=output, more_flags=("-w", "-Wno-error")
    )
    return load_image(output)


def line_of(text: str, file: str = SOURCE) -> int:
    source = (HERE / file).read_text()
    assert source.count(text) == 1
    return source[: source.index(text)].count("\n") + 1


def test_a_program_does_not_differ_from_itself(good: Image) -> None:
    assert code_differences(good, good) == []
    assert line_differences(good, good) == []


def test_what_moves_in_the_flash_is_no_difference(good: Image, tmp_path: Path) -> None:
    # A text that is longer moves every address behind it; the function that names it differs by the text alone.
    moved = built(tmp_path, '"dodge: ready\\n"', '"dodge: ready, and longer than it was before\\n"', "dodge.c")
    assert {one.function for one in code_differences(moved, good)} == {"main"}
    assert [line for one in line_differences(moved, good) for _, line in one.theirs] == [
        line_of("dodge: ready\\n", "dodge.c")
    ]


@pytest.mark.parametrize(
    ("right", "wrong", "at"),
    [
        ("dodge->unseen_ticks[i] >= RELEASE_TICKS", "dodge->unseen_ticks[i] > RELEASE_TICKS", 0),  # a neighbour
        ("dodge->futile_turns = 0;\n        dodge->turn_side = lighter", "dodge->turn_side = lighter", 0),  # left out
        ("return dodge->seen & LEFT_SHUT && dodge->seen & RIGHT_SHUT;", "return dodge->seen & RIGHT_SHUT;", 0),
        ("        dodge->back_way = way - free_way_behind(dodge, way);\n", "", 0),
    ],
)
def test_a_change_is_in_its_line_and_in_no_function_but_its_own(
    right: str, wrong: str, at: int, good: Image, tmp_path: Path
) -> None:
    bad = built(tmp_path, right, wrong)
    found = line_differences(bad, good)
    assert len({one.function for one in found}) == 1
    assert line_of(right) + at in {line for one in found for _, line in one.theirs}
    assert {one.function for one in code_differences(good, bad)} == {found[0].function}


SUM = "way = left_steps + right_steps, twist = right_steps - left_steps;"
PARAMETERS = "int32_t left_steps, int32_t right_steps)\n"


@pytest.mark.parametrize(
    ("right", "wrong", "named"),
    [
        ("back_on(dodge, way, twist);", "back_on(dodge, twist, twist);", "back_on(dodge, way, twist);"),
        (SUM, "way = left_steps + right_steps, twist = left_steps - right_steps;", SUM),
        (PARAMETERS, "int32_t right_steps, int32_t left_steps)\n", SUM),  # a parameter where it is used
        ("back_on(struct dodge *dodge, int32_t way, int32_t twist)",
         "back_on(struct dodge *dodge, int32_t twist, int32_t way)", ""),  # in more than one
    ],
)  # fmt: skip
def test_a_line_that_takes_another_variable_is_known_where_it_is_the_only_one(
    right: str, wrong: str, named: str, good: Image, tmp_path: Path
) -> None:
    bad = built(tmp_path, right, wrong)
    assert code_differences(bad, good)
    lines = [place for one in line_differences(bad, good) for place in one.theirs]
    assert lines == ([(SOURCE, line_of(named))] if named else [])


@pytest.mark.parametrize(
    ("right", "wrong", "is_number"),
    [
        ("if (way - dodge->turn_way >= SOON_WAY) {", "if (way - dodge->turn_way >= SOON_WAY + 5) {", True),
        ("if (way - dodge->turn_way >= SOON_WAY) {", "if (way - dodge->turn_way == SOON_WAY - 1) {", False),  # a branch
        ("begin_turn(dodge, twist, LONG_TWIST);", "begin_turn(dodge, -twist, LONG_TWIST);", False),
    ],
)
def test_a_line_that_takes_another_number_alone_is_known(
    right: str, wrong: str, is_number: bool, good: Image, tmp_path: Path
) -> None:
    found = line_differences(built(tmp_path, right, wrong), good)
    assert {one.is_number for one in found} == {is_number}


def test_of_lines_without_code_it_is_known_whether_they_only_compute(good: Image, tmp_path: Path) -> None:
    # Nothing takes `is_forward` any more, so the compiler leaves out the line before the one that was changed.
    rover = load_image(HERE / "rover.elf")
    found = line_differences(
        built(tmp_path, "is_forward && is_blocked()", "is_blocked()", "rover.c", "rover"), rover
    )  # fmt: skip
    unused, use = line_of("bool is_forward =", "rover.c"), line_of("is_forward && is_blocked()", "rover.c")
    first = next(one for one in found if ("rover.c", unused) in one.theirs)
    assert (first.missing, first.missing_acts, first.is_edge) == (1, False, False)
    assert any(("rover.c", use) in one.theirs and not one.is_edge for one in found)
    assert found[-1].is_edge
    assert [line for _, line in found[-1].theirs] == [line_of("} while (!has_arrived());", "rover.c") + 1]
    (tmp_path / "call").mkdir()
    *_, gone = line_differences(
        built(tmp_path / "call", "    note_ground(dodge, way);\n    return", "    return"), good
    )  # fmt: skip
    assert (gone.missing, gone.missing_acts) == (1, True)


def test_a_branch_that_leads_elsewhere_is_a_difference(good: Image) -> None:
    """Of two `beq` with other offsets the targets are compared, and not the offsets."""
    address = next(symbol.address for symbol in good.symbols.symbols if symbol.name == "left_danger")
    start, data = next((start, data) for start, data in good.segments if start <= address < start + len(data))
    code = bytearray(data)
    for offset in range(address - start, address - start + 40, 2):
        if code[offset + 1] & 0xF0 == 0xD0 and code[offset] < 0x80:
            code[offset] += 1
            break
    else:
        raise AssertionError("no conditional branch")
    changed = Image(**{
        **{name: getattr(good, name) for name in good.__dataclass_fields__},
        "segments": tuple((at, bytes(code) if at == start else held) for at, held in good.segments),
    })  # fmt: skip
    assert [one.function for one in code_differences(changed, good)] == ["left_danger"]


def test_a_function_that_one_version_lacks_is_named(good: Image, tmp_path: Path) -> None:
    bad = built(tmp_path, "            print_transition(before, &dodge);\n", "", "dodge.c")
    alone = [one for one in code_differences(bad, good) if one.function == "print_transition"]
    assert [(bool(one.ours), bool(one.theirs)) for one in alone] == [(False, True)]
    assert "print_transition" not in {one.function for one in line_differences(bad, good)}
    (tmp_path / "put").mkdir()
    no_put = built(tmp_path / "put", "        put(*text++);\n", "        text++;\n", "uart.c")  # begins in a header
    assert "put" not in {one.function for one in line_differences(no_put, good)}


def test_a_function_that_is_empty_now_differs_and_its_call_too(good: Image, tmp_path: Path) -> None:
    source = (HERE / SOURCE).read_text()
    body = source[source.index("    if (way <= dodge->back_way") : source.index("static struct dodge_command command")]
    bad = built(tmp_path, body, "}\n\n")
    assert {one.function for one in line_differences(bad, good)} == {"back_on", "dodge_tick"}


def test_without_debug_information_there_are_no_lines(good: Image, tmp_path: Path) -> None:
    if shutil.which("arm-none-eabi-strip") is None:
        pytest.skip("no binutils")
    plain = tmp_path / "plain.elf"
    subprocess.run(["arm-none-eabi-strip", "-g", "-o", plain, DODGE], check=True)
    assert line_differences(load_image(plain), good) == []
