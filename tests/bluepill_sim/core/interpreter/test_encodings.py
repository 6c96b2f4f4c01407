"""The table of encodings, against what binutils reads in the same bits."""

import random
import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from bluepill_sim.extension.encodings import FIRST_WIDE, NARROW, UNDEFINED, WIDE, Encoding, Kind, find

OBJDUMP = shutil.which("arm-none-eabi-objdump")
#: How the table's mnemonics are spelt there; and what it prints in words of its own.
_ALIASES = {
    "pop": "ldmia", "push": "stmdb", "stm": "stmia", "ldm": "ldmia", "adr": "add addw sub subw", "ldr": "pop",
    "mov": "lsl lsr asr ror rrx nop", "str": "push", "stmdb": "push", "ldmia": "pop", "rsb": "neg", "movw": "mov",
    "addw": "add", "subw": "sub", "dsb": "ssbb pssbb dfb", "ldmdb": "ldmea", "cpsie": "cpsid",
}  # fmt: skip
_CONDITIONS = "eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|al|hs|lo"
_REGISTERS = {f"r{n}": n for n in range(13)} | {"sl": 10, "fp": 11, "ip": 12, "sp": 13, "lr": 14, "pc": 15}

pytestmark = pytest.mark.skipif(OBJDUMP is None, reason="no disassembler")


def disassembled(words: list[int], folder: Path) -> list[str]:
    """Return what objdump makes of each word, which stands at a multiple of 8."""
    pad = struct.pack("<H", 0xBF00)
    code = b"".join(
        (struct.pack("<HH", word >> 16, word & 0xFFFF) if word >> 16 else struct.pack("<H", word) + pad) + pad * 2
        for word in words
    )
    path = folder / "code.bin"
    path.write_bytes(code)
    command = (str(OBJDUMP), "-D", "-b", "binary", "-marm", "-Mforce-thumb,reg-names-std", "-z", str(path))
    text = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout
    found = dict(re.findall(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t(.*)$", text, re.MULTILINE))
    lines = [found[f"{8 * n:x}"] for n in range(len(words))]
    return ["UNDEFINED" if "UNDEFINED" in line else line.partition("@")[0].partition(";")[0].strip() for line in lines]


def is_named(row: Encoding, text: str) -> bool:
    """Tell whether objdump's mnemonic is that of a row."""
    mnemonic = text.split(maxsplit=1)[0] if text else ""
    bare = re.sub(r"\.[nw]$", "", mnemonic)
    name = re.match("[A-Z0-9]+", row.syntax)
    spelt = "" if name is None else name[0].lower()
    plain = spelt.removesuffix("s") if spelt.endswith(("ls", "rs", "ds", "vs", "cs", "bs")) else spelt
    names = {spelt, plain, *_ALIASES.get(spelt, "").split(), *_ALIASES.get(plain, "").split()}
    return any(re.fullmatch(rf"{one}[st]?({_CONDITIONS})?", bare) for one in names)


def registers_of(text: str) -> list[int]:
    """Return the registers that objdump names, but for lists of them."""
    operands = text.partition("\t")[2].partition("{")[0]
    return [_REGISTERS[name] for name in re.findall(r"[a-z]+\d*", operands) if name in _REGISTERS]


def wanted(row: Encoding, word: int) -> list[int]:
    """Return the registers that a row's syntax names, in its order."""
    values = row.values(word)
    operands = row.syntax.partition(" ")[2].partition("{reg")[0].partition(" or ")[0]
    named = re.findall(r"<(\w)>|\b(SP|PC)\b", operands)
    return [values[letter] if letter else _REGISTERS[name.lower()] for letter, name in named]


@pytest.mark.parametrize("stride", [pytest.param(13), pytest.param(1, marks=pytest.mark.soak)])
def test_16_bit_words_are_the_instructions_that_binutils_reads(tmp_path: Path, stride: int) -> None:
    words = [word for word in range(0, 0xE800, stride) if word >> 8 not in {0xBF, 0xDE}]
    wrong = []
    for word, text in zip(words, disassembled(words, tmp_path), strict=True):
        row = find(word, is_wide=False)
        is_known = row is not None and "UNDEFINED" not in text
        fits = is_known and row is not None and is_named(row, text) and has_registers(row, word, text)
        if not fits and not (row is None and is_no_instruction(text)):
            wrong.append(f"{word:04x}: {row.syntax if row else 'undefined'}, binutils: {text}")
    assert not wrong, f"{len(wrong)}: " + "; ".join(wrong[:20])


@pytest.mark.parametrize(
    ("word", "text"),
    [
        (0x1888, "ADDS R0, R1, R2"), (0x44B9, "ADD R9, R7"), (0xD1FE, "BNE label"), (0xDDFE, "BLE label"),
        (0xF43F_AFFE, "BEQ.W label"), (0xFB92_F1F3, "SDIV R1, R2, R3"), (0xE890_0F00, "LDM R0{!}, {registers}"),
    ],
)  # fmt: skip
def test_an_instruction_is_written_with_its_registers_and_condition(word: int, text: str) -> None:
    row = find(word, is_wide=word >> 16 != 0)
    assert row is not None
    assert row.written(word) == text


def test_the_tables_are_of_one_width_each() -> None:
    assert not any(row.is_wide for row in NARROW)
    assert all(row.is_wide for row in WIDE)
    assert FIRST_WIDE == 0b11101 << 11, "A5.1"


def test_an_s_is_written_where_a_bit_chooses_flags() -> None:
    for row in (*NARROW, *WIDE):
        chooses = "s" in row.fields and row.kind is Kind.PLAIN
        assert ("{S}" in row.syntax) is chooses, row


def test_32_bit_words_are_the_instructions_that_binutils_reads(tmp_path: Path) -> None:
    dice = random.Random(3)
    words = [
        row.value | dice.getrandbits(32) & ~row.mask & 0xFFFF_FFFF
        for row in WIDE
        if row.operation not in {UNDEFINED, "NO_COPROCESSOR"}
        for _ in range(30)
    ]
    wrong = []
    for word, text in zip(words, disassembled(words, tmp_path), strict=True):
        row = find(word, is_wide=True)
        if row is None or is_open(row, word):
            continue
        if not is_named(row, text) or not has_registers(row, word, text):
            wrong.append(f"{word:08x}: {row.syntax}, binutils: {text}")
    assert not wrong, f"{len(wrong)}: " + "; ".join(wrong[:20])


def is_open(row: Encoding, word: int) -> bool:
    """Tell whether the manual leaves open what it is, or a later profile has filled it: R15 for Rn or Rt, a hint."""
    values = row.values(word)
    is_at_pc = (
        15 in (values.get("n"), values.get("t"), values.get("a"), values.get("d")) and row.kind is not Kind.LOAD_LITERAL
    )
    has_two_rm = "---- 1111 dddd 10" in row.pattern and word >> 16 & 15 != word & 15
    return has_two_rm or row.operation == "NO_COPROCESSOR" or is_at_pc or row.operation == "NOP"


def has_registers(row: Encoding, word: int, text: str) -> bool:
    """Tell whether the registers are the same: binutils leaves out what repeats, and prints some in other words."""
    seen, expected = registers_of(text), wanted(row, word)
    return (
        set(expected) <= set(seen) | {13, 15}
        or "{" in text.partition("\t")[2]
        or row.operation in {"NOP", "MRS", "MSR"}
    )


def is_no_instruction(text: str) -> bool:
    """Tell whether binutils knows no instruction, or one that no Cortex-M3 has."""
    return text.startswith(("UNDEFINED", "setend", "setpan", "cps", "hlt", "bx", "blx"))


def test_no_row_is_hidden_by_those_above_it() -> None:
    dice = random.Random(5)
    for table, bits in ((NARROW, 16), (WIDE, 32)):
        for row in table:
            drawn = (row.value | dice.getrandbits(bits) & ~row.mask & (1 << bits) - 1 for _ in range(2000))
            first = (next(other for other in table if word & other.mask == other.value) for word in drawn)
            assert any(other is row for other in first), row.syntax


def test_a_pattern_of_other_length_is_refused() -> None:
    with pytest.raises(ValueError, match="15 bits"):
        Encoding("0" * 15, "NOP", "NOP")
