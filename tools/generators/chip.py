"""Write what C and docs take from declarations in Python: shared structs, and the registers of each peripheral.

From `extension/layout.py`: `source/fabric/layout.h`. From `extension/encodings.py`: `source/interpreter/encodings.h`,
and `docs/instructions.md`. From `REGISTERS` and its neighbours of each peripheral on the
chip's page: `source/registers/KIND.h` of each kind of device in C, and `docs/registers.md`.
A test holds the committed files to what comes out here; a file that is no longer made is removed.
Usage: python -m tools.generators.chip
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from itertools import groupby
from pathlib import Path
from textwrap import wrap

from bluepill_sim.extension.encodings import CYCLES, GIVEN_UP, NARROW, REFILL, UNDEFINED, WIDE, Encoding, Kind
from bluepill_sim.extension.layout import header
from bluepill_sim.fabric.registers import LISTENER, BitField, Peripheral, Register, fields_of
from bluepill_sim.stm32f103 import BASES, PERIPHERALS

ROOT = Path(__file__).resolve().parents[2]
SOURCE = Path("bluepill_sim/extension/source")
HEADERS = SOURCE / "registers"
PAGE, INSTRUCTIONS = Path("docs/registers.md"), Path("docs/instructions.md")
#: Registers alike that are more than these are named by the first alone, in C.
_MOST_ALIKE = 32
_WIDTH = 118


@dataclass(frozen=True)
class _Name:
    """A name in C, and what it gets in front where another thing of the device has it too."""

    group: str
    short: str
    #: What decides whether two are the same thing.
    key: tuple[object, ...]
    value: int
    #: How the value is written, and what stands behind the name.
    text: str
    suffix: str = ""


def files() -> dict[Path, str]:
    """Return each file that is made, below the root of the repository, and its text."""
    made = {SOURCE / "fabric" / "layout.h": header(), SOURCE / "interpreter" / "encodings.h": encodings_header()}
    kinds: dict[str, list[type[Peripheral]]] = {}
    for peripheral, _ in peripherals():
        if peripheral.KIND not in {None, LISTENER} and peripheral not in kinds.setdefault(str(peripheral.KIND), []):
            kinds[str(peripheral.KIND)].append(peripheral)
    taken = frozenset(_fabric_names())
    return made | {HEADERS / f"{kind}.h": registers_header(kind, them, taken) for kind, them in kinds.items()} | {
        PAGE: page(peripherals()), INSTRUCTIONS: instructions_page(),
    }  # fmt: skip


def peripherals() -> Iterator[tuple[type[Peripheral], str]]:
    """Yield the class and the name of each peripheral of the chip."""
    for maker, name in PERIPHERALS:
        kind = maker.func if isinstance(maker, partial) else maker
        if not isinstance(kind, type):
            raise TypeError(f"{name}: the chip's page makes it by {kind}, not by its class")
        yield kind, name


# C.


def registers_header(kind: str, them: list[type[Peripheral]], taken: frozenset[str] = frozenset()) -> str:
    """Return the header of a kind of device: registers, fields, hidden words, outputs, questions and commands.

    A name that means two things in a device, or that `fabric.h` has, gets that of its register or group in front.
    """
    module = them[0].__module__.rpartition(".")[2]
    registers = {register.name: register for one in them for register in one.REGISTERS}
    sections: list[tuple[str, list[_Name]]] = [("Registers by offset / 4.", list(_register_names(registers.values())))]
    hidden = list(_numbers("HIDDEN", them[0].hidden().items()))
    if hidden:
        sections.append(("The words behind them.", hidden))
    seen: set[tuple[object, ...]] = set()
    for register in _without_runs(registers.values()):
        of_all = {field: None for one in them for each in one.REGISTERS if each.name == register.name
                  for field in fields_of(each.fields)}  # fmt: skip
        names = [name for field in of_all for name in _field_names(register, field) if name.key not in seen]
        seen |= {name.key for name in names}
        if names:
            sections.append((f"Of {register.name}.", names))
    outputs = dict.fromkeys(pair for one in them for pair in enumerate(one.OUTPUTS))
    sections += [
        ("Its outputs.", list(_numbers("OUTPUT", ((name, n) for n, name in sorted(outputs))))),
        *((_first_line(enum), list(_numbers(enum.__name__.upper(), _members(enum)))) for enum in them[0].ENUMS),
    ]
    counts = Counter(name.short for _, names in sections for name in names if not name.suffix)
    lines = [
        f"/* {HEADERS}/{kind}.h: {_source(them)}; made from peripherals/{module}.py. */",
        f"#ifndef BLUEPILL_REGISTERS_{kind.upper()}_H",
        f"#define BLUEPILL_REGISTERS_{kind.upper()}_H",
    ]
    for title, names in sections:
        if names:
            lines += ["", f"/* {title} */", *_enum(names, counts, taken)]
    return "\n".join([*lines, "", "#endif", ""])


def _source(them: Iterable[type[Peripheral]]) -> str:
    return ", ".join(dict.fromkeys(one.SOURCE for one in them if one.SOURCE)) or "No manual"


def _first_line(enum: type[IntEnum]) -> str:
    return (enum.__doc__ or enum.__name__).partition("\n")[0]


def _members(enum: type[IntEnum]) -> Iterator[tuple[str, int]]:
    yield from ((member.name, member.value) for member in enum)


def _numbers(group: str, pairs: Iterable[tuple[str, int]]) -> Iterator[_Name]:
    for name, number in pairs:
        short = name.upper() if name[0].isalpha() else f"{group}_{name.upper()}"
        yield _Name(group, short, (group, short), number, str(number))


def _register_names(registers: Iterable[Register]) -> Iterator[_Name]:
    for register in _without_runs(registers):
        yield _Name("", register.name, ("", register.name), register.offset // 4, str(register.offset // 4))


def _without_runs(registers: Iterable[Register]) -> Iterator[Register]:
    for _, run in groupby(sorted(registers, key=lambda one: one.offset), lambda one: (one.fields, one.masks)):
        alike = list(run)
        yield from alike if len(alike) <= _MOST_ALIKE else alike[:1]


def _field_names(register: Register, field: BitField) -> Iterator[_Name]:
    """Yield the field's bits in place, and of a field of several where they begin, NAME_AT."""
    name, key = field.name.upper(), (field.name.upper(), field.high, field.low)
    if (field.high, field.low) == (31, 0):
        return
    ones = (1 << field.high - field.low + 1) - 1
    yield _Name(
        register.name, name, key, ones << field.low, f"{ones:#x} << {field.low}" if ones > 1 else f"1 << {field.low}"
    )
    if ones > 1:
        yield _Name(register.name, name, (*key, "at"), field.low, str(field.low), "_AT")


def _enum(names: Iterable[_Name], counts: Counter[str], taken: frozenset[str]) -> Iterator[str]:
    """Yield the lines; what has bit 31 is a macro, since an enumerator is an int."""
    entries = []
    for name in names:
        is_alone = not name.group or (counts[name.short] == 1 and name.short not in taken)
        full = f"{name.short if is_alone else f'{name.group}_{name.short}'}{name.suffix}"
        if name.value >> 31:
            yield f"#define {full} {name.value:#x}u"
        else:
            entries.append(f"{full} = {name.text}".replace(" ", "\0"))
    if entries:
        whole = f"enum {{ {', '.join(entries)}\0}};"
        for line in wrap(whole, _WIDTH, subsequent_indent=" " * 7, break_on_hyphens=False, break_long_words=False):
            yield line.replace("\0", " ")


def _fabric_names() -> Iterator[str]:
    """Yield the names that every device sees, from the headers of the fabric."""
    text = re.sub(
        r"/\*.*?\*/", "", (ROOT / SOURCE / "fabric" / "fabric.h").read_text(encoding="utf-8"), flags=re.DOTALL
    )
    for body in re.findall(r"\benum\b\s*\w*\s*\{(.*?)\}", text, flags=re.DOTALL):
        yield from re.findall(r"(?:^|,)\s*([A-Z]\w*)", body)
    yield from re.findall(r"#define (\w+)", text + header())


# Instructions.


def encodings_header() -> str:
    """Return the header of all encodings: bits, instruction and form of each, and how each form is taken apart."""
    rows = (*NARROW, *WIDE)
    names = [name for name in dict.fromkeys(row.operation for row in rows) if name != UNDEFINED]
    forms = {_form(row): _extraction(row) for row in rows}
    gives_up = [str(kind in GIVEN_UP).lower() for kind in Kind]
    lines = [
        f"/* {SOURCE / 'interpreter' / 'encodings.h'}: every encoding; made from extension/encodings.py. */",
        "#ifndef BLUEPILL_ENCODINGS_H",
        "#define BLUEPILL_ENCODINGS_H",
        "",
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        *wrap(f"enum operation {{ {UNDEFINED}, {', '.join(names)} }};", _WIDTH, subsequent_indent=" " * 4),
        "",
        "/* Classes of instructions that cost alike: cycles, refill, and whether an exception may come in one. */",
        *wrap(f"enum kind {{ {', '.join(map(_kind, Kind))} }};", _WIDTH, subsequent_indent=" " * 4),
        f"static const uint8_t kind_cycles[] = {{{', '.join(str(CYCLES[kind]) for kind in Kind)}}};",
        f"static const uint8_t kind_refill[] = {{{', '.join(str(REFILL.get(kind, 0)) for kind in Kind)}}};",
        *wrap(f"static const bool kind_gives_up[] = {{{', '.join(gives_up)}}};", _WIDTH, subsequent_indent=" " * 4),
        "",
        "/* Where an instruction has its fields, as the table of encodings draws it. */",
        *wrap(f"enum form {{ {', '.join(forms)} }};", _WIDTH, subsequent_indent=" " * 4),
        "",
        "struct encoding {",
        "    uint32_t mask, value;",
        "    uint8_t operation, form, kind;",
        "};",
        "",
        "/* Takes an instruction of a row apart into its fields; `to` is a pointer to a struct that has them. */",
        "#define extract(row, word, to) \\",
        "    do { \\",
        "        switch ((enum form)(row)->form) { \\",
        *(f"        case {name}: {text}break; \\" for name, text in forms.items()),
        "        } \\",
        "    } while (0)",
    ]
    for name, table in (("narrow", NARROW), ("wide", WIDE)):
        lines += ["", f"static const struct encoding {name}[] = {{"]
        for row in table:
            lines.append(f"    {{{row.mask:#x}, {row.value:#x}, {row.operation}, {_form(row)}, {_kind(row.kind)}}},")
        lines += ["};"]
    return "\n".join([*lines, "", "#endif", ""])


def _kind(kind: Kind) -> str:
    return f"KIND_{kind.name}"


def _form(row: Encoding) -> str:
    """Return the name of a form: the letters of the pattern, from the first one on."""
    drawn = re.sub(r"[^a-z]", "_", row.pattern.replace(" ", "")).lstrip("_")
    return f"FORM_{drawn or 'NONE'}"


def _extraction(row: Encoding) -> str:
    """Return the statements that take an instruction apart."""
    text = ""
    for letter, runs in row.fields.items():
        parts, above = [], 0
        for low, bits in reversed(runs):
            shifted = f"(word) >> {low}" if low else "(word)"
            part = f"{shifted} & {(1 << bits) - 1:#x}"
            parts.append(f"({part}) << {above}" if above else f"({part})" if len(runs) > 1 else part)
            above += bits
        text += f"(to)->{letter} = {' | '.join(parts)}; "
    return text


def instructions_page() -> str:
    """Return the page of all instructions: syntax, bits and cycles of each encoding."""
    lines = [
        "# Instructions of the emulated Cortex-M3",
        "",
        "Made by `python -m tools.generators.chip` from `bluepill_sim/extension/encodings.py`, the table by which the",
        "interpreter decodes and blocks are timed. How they run, and what is chosen: [core.md](core.md). A letter is a",
        "bit of a field, `-` a bit that is ignored. The first row that fits applies; without one, UsageFault",
        "(UNDEFINSTR) is raised. LDR into the PC costs 3 more. Costs behind another load, and across lines of the",
        "flash, are [with the timing](core.md#time).",
        "",
        "| instruction | bits | cycles |",
        "| --- | --- | --- |",
    ]
    for row in (*NARROW, *WIDE):
        if row.operation != UNDEFINED:
            syntax = re.sub(r"<([^c])>", lambda found: f"R{found[1]}", row.syntax)
            lines.append(f"| {syntax.replace('|', ' ')} | `{_drawn(row)}` | {_cycles(row.kind)} |")
    return "\n".join([*lines, ""])


def _drawn(row: Encoding) -> str:
    bits = row.pattern.replace(" ", "")
    return " ".join(bits[at : at + 16] for at in range(0, len(bits), 16))


def _cycles(kind: Kind) -> str:
    refill = REFILL.get(kind)
    by_register = kind in {Kind.LOAD_MULTIPLE, Kind.STORE_MULTIPLE}
    count = 2 if kind in {Kind.LOAD_DUAL, Kind.STORE_DUAL, Kind.TABLE_BRANCH} else 0
    text = f"{CYCLES[kind] + count}{' + registers' if by_register else ''}"
    return text if refill is None else f"{text}, + {refill} where it branches"


# The page.


def page(rows: Iterable[tuple[type[Peripheral], str]]) -> str:
    """Return the page of all registers: a section a class."""
    lines = [
        "# Registers of the emulated STM32F103C8",
        "",
        "Made by `python -m tools.generators.chip` from the declarations in `bluepill_sim/peripherals/`, which the",
        "emulator executes. What the peripherals do with them: [peripherals.md](peripherals.md). Access is by RM0008's",
        "words (2.1): `rw`, `r`, `w`, `rc_w1` and `rc_w0` (cleared by writing 1, or 0); of two, each holds for some.",
        "`reserved` is a field of the manual that this peripheral does not have: it reads 0 and takes nothing.",
    ]
    for kind, pairs in groupby(sorted(rows, key=lambda row: row[0].__module__), lambda row: row[0]):
        names = sorted(name for _, name in pairs)
        bases = ", ".join(f"{name} {BASES[name]:#010x}" for name in names)
        lines += [
            "",
            f"## {' and '.join(names) if len(names) < 3 else ', '.join(names)}",
            "",
            f"{kind.SOURCE}. {bases}.",
            "",
        ]
        lines += ["| offset | register | reset | fields |", "| --- | --- | --- | --- |"]
        registers = sorted(kind.REGISTERS, key=lambda one: one.offset)
        lines += [_row(list(run)) for _, run in groupby(registers, _alike)]
    return "\n".join([*lines, ""])


def _alike(register: Register) -> tuple[object, ...]:
    """Return what registers of one row of the page share: all but a number, where they have one field."""
    fields = register.fields if "," in register.fields else re.sub(r"\d+ ", " ", register.fields)
    return re.sub(r"\d+|(?<=_)\w+", "", register.name), register.reset, register.masks, fields


def _row(run: list[Register]) -> str:
    first, last = run[0], run[-1]
    offset = f"{first.offset:#04x}" if first is last else f"{first.offset:#04x} to {last.offset:#04x}"
    name = first.name if first is last else f"{first.name} to {last.name}"
    fields = ", ".join(
        f"{field.name} {field.high}{f':{field.low}' if field.low != field.high else ''} {first.access(field)}"
        for field in fields_of(first.fields)
    )
    return f"| {offset} | {name} | {first.reset:#010x} | {fields or first.doc or 'a key: 31:0 w'} |"


def write() -> None:
    """Write them, and remove headers of devices that are gone."""
    made = files()
    for path, text in made.items():
        (ROOT / path).parent.mkdir(exist_ok=True)
        (ROOT / path).write_text(text, encoding="utf-8")
    for path in (ROOT / HEADERS).glob("*.h"):
        if path.relative_to(ROOT) not in made:
            path.unlink()


if __name__ == "__main__":
    write()
