"""Variables of programs by name: every kind of type that debug information has, as approved."""

import random
import struct
import sys
from collections.abc import Iterator
from unittest.mock import patch

from bluepill_sim.program import variables
from bluepill_sim.program.image import Image, Symbol, SymbolTable
from bluepill_sim.program.variables import NumberForm, Variable, VariableTable, read_variables
from bluepill_sim.stm32f103 import FLASH_BASE, SRAM_BASE, SRAM_BYTES
from tests.bluepill_sim.program.walks.dwarf import Die, FakeElf, die, place
from tests.tools.suite.approved import Trace, judge_of, said, tried


def types_of(draw: random.Random) -> tuple[dict[str, Die], Die]:
    """Return entries of types by name, the base types and what is made of them, and a unit that holds them."""
    base = {
        name: die("base_type", name=name, byte_size=size, encoding=encoding)
        for name, size, encoding in (
            ("int", 4, 5),
            ("char", 1, 8),
            ("signed char", 1, 6),
            ("short", 2, 5),
            ("float", 4, 4),
            ("double", 8, 4),
            ("long double", 12, 4),
            ("bool", 1, 2),
            ("long long", 8, 5),
            ("fixed", 2, 13),
        )
    }
    anonymous = die(
        "structure_type",
        die("member", name="word", type=base["int"], data_member_location=0),
        die("member", name="low", type=base["short"], data_member_location=[0x23, 0x82, 0x01]),
        byte_size=8,
    )
    bits = die(
        "structure_type",
        die("member", name="two", type=base["int"], data_member_location=0, byte_size=4, bit_offset=30, bit_size=2),
        die("member", name="old", type=base["short"], data_member_location=2, bit_offset=1, bit_size=5),
        die("member", name="new", type=base["int"], data_bit_offset=19, bit_size=9),
        die("member", name="far", type=base["char"], data_bit_offset=64, bit_size=8),
        die("member", name="bare", type=base["int"], data_member_location=12, bit_size=3),
        die("member", name="record", type=anonymous, data_member_location=16, bit_size=3),
        die("member", name="typeless", data_member_location=1),
        die("member", type=anonymous, data_member_location=20),
        die("member", type=base["int"], data_member_location=20),
        die("inheritance", type=anonymous, data_member_location=40),
        die("subprogram", name="method", type=base["int"]),
        name="bits",
        byte_size=48,
    )
    rows = [die("enumerator", name=f"V{n}", const_value=n) for n in range(14)]
    made = {
        "bits": bits,
        "anonymous": anonymous,
        "union": die(
            "union_type",
            die("member", name="i", type=base["int"]),
            die("member", name="f", type=base["float"]),
            name="both",
            byte_size=4,
        ),
        "class": die(
            "class_type", die("member", name="x", type=bits, data_member_location=8), name="klass", byte_size=64
        ),
        "enum": die("enumeration_type", *rows, name="mode", byte_size=1),
        "negative": die("enumeration_type", die("enumerator", name="N", const_value=-1), byte_size=2),
        "zero": die(
            "enumeration_type",
            die("enumerator", name="Z", const_value=0),
            die("other", name="O", const_value=-4),
            byte_size=2,
        ),
        "pointer": die("pointer_type", byte_size=4),
        "bare pointer": die("pointer_type"),
        "reference": die("reference_type"),
        "array": die(
            "array_type",
            die("subrange_type", upper_bound=1),
            die("subrange_type", count=3),
            die("x"),
            type=base["short"],
        ),
        "open": die("array_type", die("subrange_type"), type=base["int"]),
        "computed": die("array_type", die("subrange_type", upper_bound=[1, 2]), type=base["int"]),
        "typeless array": die("array_type", die("subrange_type", count=2)),
        "rows": die("array_type", die("subrange_type", count=2), type=bits),
        "typeless": die("typedef", name="nothing"),
        "function": die("subroutine_type"),
        "of function": die("array_type", die("subrange_type", count=2), type=die("subroutine_type")),
        "bad place": die(
            "structure_type", die("member", name="m", type=base["int"], data_member_location=[0x10, 1]), name="s"
        ),
    }
    found = base | made
    for name in [*found]:
        found[f"typedef {name}"] = die("typedef", name=f"{name}_t", type=found[name])
        found[f"const {name}"] = die(draw.choice(("const_type", "volatile_type", "atomic_type")), type=found[name])
    deep = base["int"]
    for n in range(17):
        deep = found[f"deep {n}"] = die("typedef", name=f"d{n}", type=deep)
    return found, die("compile_unit", name="C:\\src\\a.c")


def units(draw: random.Random) -> Iterator[str]:
    image = Image(
        "v",
        ((FLASH_BASE, struct.pack("<II", 0x2000_5000, 0x0800_0009)),),
        SymbolTable(
            (
                Symbol("plain", SRAM_BASE + 0x800, 4),
                Symbol("one", SRAM_BASE + 0x804, 1),
                Symbol("three", SRAM_BASE + 0x808, 3),
                Symbol("code", 0x0800_0100, 4, True),
                Symbol("int", SRAM_BASE + 0x80C, 2),
                Symbol("known", SRAM_BASE, 4),
            )
        ),
    )
    found, _ = types_of(draw)
    for name, of in found.items():
        unit = die("compile_unit", die("variable", name="v", type=of, location=place(SRAM_BASE)), name="C:\\src\\a.c")
        yield f"{name}: {tried(lambda each: said(table_of(image, each).roots), (unit,))}"
        yield said([each.name for each in leaves_of(image, unit)[:40]])
    number = found["int"]
    outer = die("namespace", name="space")
    declared = die("variable", name="declared", type=number)
    klass = die("class_type", declared, name="Klass")
    outer.children = (klass,)
    klass.parent = outer
    abstract = die("subprogram", name="inlined")
    inner = die("variable", name="inner", type=number, location=place(SRAM_BASE + 16))
    top = die(
        "compile_unit",
        die("variable", name="global", type=number, location=place(SRAM_BASE)),
        die("variable", name="nowhere", type=number),
        die("variable", name="short", type=number, location=[3, 1, 2, 3]),
        die("variable", name="computed", type=number, location=[4, 0, 0, 0, 0x20]),
        die("variable", name="text", type=number, location=b"12345"),
        die("variable", name="typeless", location=place(SRAM_BASE + 4)),
        die("variable", type=number, location=place(SRAM_BASE + 4)),
        die("variable", specification=declared, location=place(SRAM_BASE + 8)),
        die("variable", abstract_origin=die("variable", name="lone"), type=number, location=place(SRAM_BASE + 12)),
        die(
            "subprogram",
            inner,
            die("lexical_block", die("variable", name="deep", type=number, location=place(SRAM_BASE + 20))),
            name="tick",
        ),
        die(
            "subprogram",
            die("variable", name="of_inlined", type=number, location=place(SRAM_BASE + 24)),
            abstract_origin=abstract,
        ),
        die("namespace", die("variable", name="unnamed", type=number, location=place(SRAM_BASE + 28))),
        die("namespace", die("variable", name="named", type=number, location=place(SRAM_BASE + 32)), name="space"),
        outer,
        name="dir/one.c",
    )
    other = die(
        "compile_unit",
        die("variable", name="global", type=number, location=place(SRAM_BASE + 0x40)),
        die("variable", name="shared", type=number, location=place(SRAM_BASE + 0x44)),
        name="two.c",
    )
    third = die(
        "compile_unit",
        die("variable", name="shared", type=number, location=place(SRAM_BASE + 0x44)),
        die("variable", name="top", type=number, location=place(SRAM_BASE + SRAM_BYTES - 4)),
        die("variable", name="above", type=number, location=place(SRAM_BASE + SRAM_BYTES)),
        die("variable", name="in_flash", type=number, location=place(FLASH_BASE)),
    )
    whole = table_of(image, (top, other, third))
    yield said([whole.roots, whole.ambiguous, whole.offered(""), whole.offered("two.c::g"), whole.offered("GLOBAL")])
    yield said([table_of(image, ()).roots])
    mixed = die(
        "compile_unit",
        *[
            die("variable", name=name.replace(" ", "_"), type=of, location=place(SRAM_BASE + 0x100 * n))
            for n, (name, of) in enumerate(found.items())
            if n < 29 and "bad" not in name
        ],
        name="m.c",
    )
    table = table_of(image, (mixed, top, other))
    for name in (
        "int",
        " int ",
        "int.x",
        "int[0]",
        "rows[1].two",
        "rows[2]",
        "rows[0]",
        "rows",
        "rows[1",
        "rows[1].",
        "rows[0].tow",
        "array[1][2]",
        "array[2]",
        "array[1][3]",
        "array[0]",
        "array",
        "union.f",
        "union.i.x",
        "class.x.new",
        "class.x",
        "class",
        "class.y",
        "enum",
        "negative",
        "long_double",
        "double",
        "bits.word",
        "bits.low",
        "bits.record",
        "bits.record.low",
        "pointer",
        "open",
        "open[0]",
        "inner",
        "tick::inner",
        "deep",
        "tick::deep",
        "space::named",
        "named",
        "two.c::global",
        "global",
        "one.c::global",
        "one.c::globl",
        "glob",
        "",
        ".",
        "[0]",
        "int..x",
        "int[1234567890]",
        "array[0000000001][0]",
        "bits",
        "x::y",
        "space::Klass::declared",
        "declared",
        "lone",
    ):
        yield f"{name}: {tried(table.variable, name)}"
        yield said(
            [table.offered(name)[:9], table.offered(name.upper(), 2), tried(lambda each: table.place(each)[0], name)]
        )
    yield said([len(table.offered("")), tried(VariableTable().variable, "x")])


def table_of(image: Image, units: tuple[Die, ...]) -> VariableTable:
    variables._table_of.cache_clear()
    with (
        patch("elftools.elf.elffile.ELFFile", lambda _: FakeElf(units)),
        patch.object(variables, "file_bytes", lambda _: b"\x7fELF"),
    ):
        return read_variables(image)


def leaves_of(image: Image, unit: Die) -> list[Variable]:
    try:
        table = table_of(image, (unit,))
    except Exception:  # noqa: BLE001 - shown by the line before
        return []
    return [table.variable(name) for name in table.offered("v", 200) if name.startswith("v")]


def numbers(draw: random.Random) -> Iterator[str]:
    whole = Variable(name="x", type_name="int", address=1, size=4, encoding=NumberForm.SIGNED)
    yield f"{whole} {whole.number(bytes((1, 2, 3, 0x84)))}"
    with patch.dict(sys.modules, {"elftools.common.exceptions": None}):
        yield tried(table_of, Image("m", ((FLASH_BASE, struct.pack("<II", 0x2000_5000, 0x0800_0009)),)), ()).split(
            " ("
        )[0]
    for form in NumberForm:
        for size in (1, 2, 4, 8):
            for first, bits in ((0, 0), (0, 1), (3, 5), (7, 1), (1, 8 * size - 1), (0, 8 * size)):
                if form is NumberForm.FLOAT and (size < 4 or bits):
                    continue
                one = Variable(name="x", type_name="", address=0, size=size, encoding=form, first_bit=first, bits=bits)
                data = [bytes(size), b"\xff" * size, b"\x80" * size, b"\x7f" * size, draw.randbytes(size)]
                yield " ".join(repr(one.number(each)) for each in data)


TRACES: dict[str, Trace] = {"units": units, "numbers": numbers}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
