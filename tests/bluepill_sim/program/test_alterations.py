"""Changed instructions, held against the GNU assembler where it is installed."""

import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.core.thumb import Kind, decode
from bluepill_sim.program.alterations import CONDITIONS, Alteration, Site, alterations, expanded, size_at, word_of

ASSEMBLER = "arm-none-eabi-as"
needs_assembler = pytest.mark.skipif(shutil.which(ASSEMBLER) is None, reason=f"{ASSEMBLER} is not installed")
HERE = 0x0800_0100

#: One of each shape, as the assembler takes it. `.+n` counts from the instruction.
SHAPES = (
    "beq .+8", "bhi .-20", "bgt .+254", "ble .-252", "bvs .+4", "bhs.w .+4000", "blt.w .-100000", "bne.w .+1048574",
    "cbz r3, .+4", "cbnz r7, .+130", "movs r1, #0", "movs r1, #255", "movs r2, #7", "cmp r0, #0", "cmp r7, #255",
    "adds r0, #1", "adds r3, #0", "subs r0, #200", "adds r1, r2, #7", "subs r1, r2, #3", "adds r1, r2, r3",
    "subs r4, r5, r6", "rsbs r1, r2, #0", "cmp.w r9, #1000", "cmp.w r0, #0", "cmp.w r0, #0xffffffff", "cmn.w r3, #4",
    "cmp.w r1, #0x00ff00ff", "add.w r0, r1, #1000", "adds.w r8, r1, #4", "sub.w r8, r8, #0xff000000",
    "subs.w r1, r2, #5",
    "addw r1, r2, #4095", "subw r1, r2, #0", "mov.w r9, #5", "movs.w r9, #0x400", "mvn.w r9, #4", "mov.w r9, #0",
    "mvn.w r0, #0", "movw r3, #1000", "movw r3, #0", "movw r3, #65535", "rsb.w r8, r1, #100", "rsbs.w r8, r1, #0",
    "add.w r8, r9, r10", "adds.w r8, r9, r1, lsl #2", "sub.w r8, r9, r10, asr #32", "subs.w r1, r2, r3, rrx",
)  # fmt: skip
#: What is left alone, each for a reason: the stack pointer, an address, no condition, no number.
UNCHANGED = (
    "add sp, #8", "sub sp, #8", "add.w sp, sp, #256", "sub.w r7, sp, #8", "add r0, sp, #4", "adr r0, .+8", "b .+8",
    "b.w .+4000", "bl .+400", "nop", "ldr r0, [r1, #4]", "cmp r0, r1", "tst.w r0, #1", "orr.w r0, r0, #1", "svc #1",
    "bx lr", "mov r0, r1", "lsls r0, r1, #3", "movt r3, #5", "mov.w r0, r1",
)  # fmt: skip


def assembled(lines: list[str], tmp_path: Path) -> list[bytes]:
    """Return the bytes of each piece of assembly, put at an even place of its own."""
    source = ".syntax unified\n.cpu cortex-m3\n.thumb\n" + "".join(
        f'.section .text.n{n},"ax"\nbegin{n}:\n{line}\nend{n}:\n' for n, line in enumerate(lines)
    ) + '.section .sizes,"a"\n' + "".join(f".word end{n}-begin{n}\n" for n in range(len(lines)))  # fmt: skip
    text, out = tmp_path / "it.s", tmp_path / "it.o"
    text.write_text(source)
    subprocess.run([ASSEMBLER, "-o", out, text], check=True, timeout=60, capture_output=True)
    from elftools.elf.elffile import ELFFile

    with out.open("rb") as file:
        elf = ELFFile(file)
        sizes = struct.unpack(f"<{len(lines)}I", elf.get_section_by_name(".sizes").data())
        return [elf.get_section_by_name(f".text.n{n}").data()[:size] for n, size in enumerate(sizes)]


def relative(words: str) -> str:
    """Return an instruction with its target counted from itself, which the assembler can place anywhere."""
    return re.sub(r"0x0[0-9a-f]{7}\b", lambda found: f".{int(found[0], 16) - HERE:+d}", words)


def changes(code: bytes, *, is_in_it: bool = False, it_bytes: int = 0) -> list[Alteration]:
    return alterations(code, Site(word_of(code), HERE, is_in_it=is_in_it, it_bytes=it_bytes))


@needs_assembler
def test_both_sides_of_every_change_are_what_the_assembler_makes_of_their_words(tmp_path: Path) -> None:
    sources = assembled([*SHAPES], tmp_path)
    found = [(shape, code, one) for shape, code in zip(SHAPES, sources, strict=True) for one in changes(code)]
    assert {shape for shape, _, _ in found} == set(SHAPES), "every shape has a change"
    before = assembled([relative(one.before) for _, _, one in found], tmp_path)
    after = assembled([relative(one.after) for _, _, one in found], tmp_path)
    wrong = [
        (shape, one.before, one.after, got_before.hex(), got_after.hex())
        for (shape, code, one), got_before, got_after in zip(found, before, after, strict=True)
        if (got_before, got_after) != (code, one.code)
    ]
    assert wrong == []


@needs_assembler
def test_what_makes_addresses_or_has_no_condition_is_left_alone(tmp_path: Path) -> None:
    codes = assembled([*UNCHANGED], tmp_path)
    assert [words for words, code in zip(UNCHANGED, codes, strict=True) if changes(code)] == []


@needs_assembler
@pytest.mark.parametrize(
    ("block", "kept"),
    [
        ("it hi\nmovhi r0, #1", {"it ls", "it al", "b 0x08000104", "it hs"}),
        ("ite gt\nmovgt r0, #1\nmovle r0, #2", {"ite le", "ite ge"}),
        ("ittt eq\nmoveq.w r0, #1\nmoveq r1, #1\naddeq r2, #1", {"ittt ne", "ittt al", "b 0x0800010a"}),
        ("itett lo\nmovlo r0, #1\nmovhs r1, #1\nmovlo r2, #2\nmovlo r3, #3", {"itett hs", "itett ls"}),
    ],
)
def test_an_it_is_inverted_made_always_or_never_as_far_as_its_letters_allow(
    block: str, kept: set[str], tmp_path: Path
) -> None:
    (code,) = assembled([block], tmp_path)
    found = changes(code[:2], it_bytes=len(code) - 2)
    assert {one.after for one in found} == kept
    for one in found:
        source = relative(one.after) if one.after.startswith("b") else f"{one.after}\n{filled(one.after)}"
        assert one.code == assembled([source], tmp_path)[0][:2], one.after


def filled(words: str) -> str:
    """Return an instruction for each letter of an IT; the assembler takes "al" with none behind it only."""
    letters, condition = words.removeprefix("i").split()
    if condition == "al":
        return ""
    other = CONDITIONS[CONDITIONS.index(condition) ^ 1]
    return "\n".join(f"mov{condition if letter == 't' else other} r0, r0" for letter in letters)


@needs_assembler
def test_under_an_it_the_words_of_narrow_arithmetic_have_no_s(tmp_path: Path) -> None:
    body = ["addeq r0, #1", "rsbeq r1, r2, #0", "moveq r3, #9"]
    (code,) = assembled(["\n".join(["ittt eq", *body])], tmp_path)
    afters = [one.after for at in (2, 4, 6) for one in changes(code[at : at + 2], is_in_it=True)]
    assert afters == ["add r0, #2", "add r0, #0", "sub r0, #1", "mov r1, r2", "mov r3, #10", "mov r3, #8"]
    conditional = [re.sub(r"^(\w+)", r"\1eq", words) for words in ("mov r1, r2", "sub r0, #1", "mov r3, #10")]
    wanted = assembled(["\n".join(["ittt eq", *conditional])], tmp_path)[0]
    made = [one.code for at in (4, 2, 6) for one in changes(code[at : at + 2], is_in_it=True)
            if one.after in {"mov r1, r2", "sub r0, #1", "mov r3, #10"}]  # fmt: skip
    assert b"".join(made) == wanted[2:]


@given(st.integers(0, 0xFFFF))
def test_every_narrow_change_is_as_long_differs_and_is_no_other_kind_of_leaving(word: int) -> None:
    code = word.to_bytes(2, "little")
    if size_at(word) != 2:
        return
    kind = decode(code, 0, HERE).kind
    for one in changes(code, it_bytes=2):
        assert len(one.code) == 2
        assert one.code != code
        assert one.before != one.after
        assert decode(one.code, 0, HERE).kind in {kind, Kind.PLAIN, Kind.BRANCH}


@given(st.integers(0xE800_0000, 0xFFFF_FFFF))
def test_every_wide_change_is_as_long_and_differs(word: int) -> None:
    code = (word >> 16).to_bytes(2, "little") + (word & 0xFFFF).to_bytes(2, "little")
    for one in changes(code):
        assert len(one.code) == 4
        assert one.code != code
        assert size_at(int.from_bytes(one.code[:2], "little")) == 4


@given(st.integers(-(2**19), 2**19 - 1), st.integers(0, 13))
def test_a_wide_branch_made_unconditional_goes_where_it_went(halfwords: int, condition: int) -> None:
    offset = 2 * halfwords
    sign, j2, j1 = offset >> 20 & 1, offset >> 19 & 1, offset >> 18 & 1
    word = 0xF000_8000 | sign << 26 | condition << 22 | (offset >> 12 & 0x3F) << 16 | j1 << 13 | j2 << 11
    word |= offset >> 1 & 0x7FF
    code = (word >> 16).to_bytes(2, "little") + (word & 0xFFFF).to_bytes(2, "little")
    (always,) = [one for one in changes(code) if one.after.startswith("b.w")]
    assert decode(always.code, 0, HERE).destination == decode(code, 0, HERE).destination == HERE + 4 + offset


def test_the_numbers_that_twelve_bits_mean_are_those_of_the_manual() -> None:
    assert [expanded(field) for field in (0x0AB, 0x1AB, 0x2AB, 0x3AB)] == [0xAB, 0xAB00AB, 0xAB00AB00, 0xABABABAB]
    assert expanded(0x100) is None
    assert expanded(8 << 7) == 0x8000_0000  # the first that is turned
    assert expanded(31 << 7 | 0x7F) == 0x1FE


@pytest.mark.parametrize(
    ("word", "afters"),
    [
        (0xF5B9_7F7A, ["cmp.w r9, #1004", "cmp.w r9, #996"]),  # a byte turned: each fourth number
        (0xF1B0_0F00, ["cmp.w r0, #1"]),  # 0: there is none below
        (0xF1B0_3FFF, ["cmp.w r0, #4278255360"]),  # the greatest, and 0xff00ff00
    ],
)
def test_a_number_moves_to_the_next_that_the_encoding_has(word: int, afters: list[str]) -> None:
    code = (word >> 16).to_bytes(2, "little") + (word & 0xFFFF).to_bytes(2, "little")
    assert [one.after for one in changes(code)] == afters
