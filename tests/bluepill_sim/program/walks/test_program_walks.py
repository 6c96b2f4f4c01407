"""Changed instructions, firmware files, blocks and versions of programs, as approved."""

import random
import struct
import sys
import tempfile
from collections.abc import Iterable, Iterator
from importlib import resources
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

from bluepill_sim.core import BLOCK, EXCEPTION_RETURN
from bluepill_sim.core.thumb import Instruction, Kind
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.program import line_table
from bluepill_sim.program.alterations import Site, alterations, expanded, size_at, word_of
from bluepill_sim.program.elf_file import file_bytes, file_offset, layout, stack_top, variables_end, vectors
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Image, Symbol, SymbolTable, load_image, parse_image
from bluepill_sim.program.last_blocks import lines_of, shortened
from bluepill_sim.program.line_table import LineRow, LineTable, read_lines, source_lines
from bluepill_sim.program.mutants import mutants, mutated_file
from bluepill_sim.program.reset_loop import LEAST_NS, MOST_RESETS, ResetRow
from bluepill_sim.program.static_code import StaticBlock, StaticCode
from bluepill_sim.program.variables import read_variables
from bluepill_sim.program.version_difference import code_differences, line_differences
from bluepill_sim.program.wrong_files import wrong_kind
from bluepill_sim.stm32f103 import FLASH_BASE, FLASH_BYTES_FITTED, SRAM_BASE, SRAM_BYTES
from tests.bluepill_sim.program.test_image import BAD_FILES, hex_file, hex_record
from tests.bluepill_sim.program.walks.dwarf import FakeElf, die
from tests.tools.suite.approved import Trace, judge_of, said, tried

HERE = 0x0800_0100
FOLDERS = Path(__file__).resolve().parents[4]
FIRMWARE = FOLDERS / "robot_bench" / "firmware"
PROGRAMS = (FIRMWARE / "board_test.elf", FOLDERS / "tests" / "bluepill_sim" / "firmware" / "parts.elf")


def changes_of(word: int, size: int, **site: object) -> str:
    halves = (word,) if size == 2 else (word >> 16, word & 0xFFFF)
    code = b"".join(half.to_bytes(2, "little") for half in halves)
    found = alterations(code, Site(word_of(code), HERE, **site))  # type: ignore[arg-type]
    return " | ".join(f"{one.operator} {one.code.hex()} {one.before} > {one.after}" for one in found)


def narrow(draw: random.Random) -> Iterator[str]:
    for high in range(0xE8):
        low = sorted({0, 1, 2, 0x3F, 0x40, 0x7F, 0x80, 0xFE, 0xFF, *draw.sample(range(256), 24)})
        yield "\n".join(changes_of(high << 8 | byte, 2) for byte in low)
    for high in (0x20, 0x28, 0x30, 0x39, 0x1C, 0x1F, 0x18, 0x1A, 0x42, 0xD0, 0xB1):
        yield "\n".join(changes_of(high << 8 | byte, 2, is_in_it=True) for byte in draw.sample(range(256), 16))
    yield "\n".join(changes_of(0xBF00 | low, 2, it_bytes=size) for low in range(256) for size in (2, 4, 10, 16))
    yield said([(first, size_at(first)) for first in (0, 0xE7FF, 0xE800, 0xFFFF)])


#: Fixed bits of each wide shape that is changed, and which bits are free.
WIDE = {
    "branch": (0xF000_8000, 0x07FF_2FFF),
    "cmp": (0xF1B0_0F00, 0x040F_70FF),
    "cmn": (0xF110_0F00, 0x040F_70FF),
    "add": (0xF100_0000, 0x041F_7FFF),
    "sub": (0xF1A0_0000, 0x041F_7FFF),
    "addw": (0xF200_0000, 0x040F_7FFF),
    "subw": (0xF2A0_0000, 0x040F_7FFF),
    "mov": (0xF04F_0000, 0x0410_7FFF),
    "mvn": (0xF06F_0000, 0x0410_7FFF),
    "movw": (0xF240_0000, 0x040F_7FFF),
    "rsb": (0xF1C0_0000, 0x041F_7FFF),
    "add r": (0xEB00_0000, 0x001F_7FFF),
    "sub r": (0xEBA0_0000, 0x001F_7FFF),
}
#: Twelve bits: i, imm3, imm8.
FIELDS = (
    0,
    1,
    2,
    0xFE,
    0xFF,
    0x100,
    0x101,
    0x1FF,
    0x200,
    0x2FF,
    0x300,
    0x3FF,
    0x400,
    0x47F,
    0x480,
    0x7FF,
    0x800,
    0x8FF,
    0xF7F,
    0xF80,
    0xFFE,
    0xFFF,
)


def wide(draw: random.Random) -> Iterator[str]:
    for value, free in WIDE.values():
        words = {value | draw.getrandbits(32) & free for _ in range(60)} | {value, value | free}
        words |= {
            (value | field >> 11 << 26 | (field >> 8 & 7) << 12 | field & 0xFF)
            | draw.getrandbits(32) & free & 0x001F_0F00
            for field in FIELDS
        }
        words |= {(word & ~0x000F_0000 | 13 << 16) if free & 0x000F_0000 else word for word in (value, value | free)}
        words |= {word ^ 1 << draw.randrange(27) for word in sorted(words)[::4]}
        for word in sorted(word for word in words if word >= 0xE800_0000):
            yield changes_of(word, 4)
    yield "\n".join(changes_of(word, 4, is_half=True) for word in (0xF240_0305, 0xF04F_0305))
    yield " ".join(str(expanded(field)) for field in range(0x1000))


def unsized(_draw: random.Random) -> Iterator[str]:
    """Yield where functions end whose sizes no file says, or says of some."""
    data = struct.pack("<II", SRAM_BASE + SRAM_BYTES, HERE | 1).ljust(0x400, b"\0")
    for sizes in ((0, 0, 0), (0, 4, 0), (4, 0, 6), (0, 0, 8)):
        rows = zip(("one", "two", "three"), (HERE, HERE + 0x10, HERE + 0x30), sizes, strict=True)
        symbols = SymbolTable(tuple(Symbol(name, at, size, is_function=True) for name, at, size in rows))
        functions = FunctionTable(Image("unsized", ((FLASH_BASE, data),), symbols))
        edges = sorted({at + n for at in (*functions._addresses, HERE + 0x1030) for n in (-1, 0, 1, 3, 4, 5, 6, 7, 8)})
        yield said([(at, functions.name(at), functions.start_of(at), functions.end_of(at)) for at in edges])


def files(draw: random.Random) -> Iterator[str]:
    for path in PROGRAMS:
        image = load_image(path)
        data, functions, lines = path.read_bytes(), FunctionTable(image), read_lines(image)
        yield said(
            [[(at, len(held)) for at, held in image.segments], image.linked_at, image.sha256, image.vector_table]
        )
        yield said([image.word(address) for address in range(FLASH_BASE, FLASH_BASE + 8, 4)])
        yield said(image.symbols)
        yield said([(one.name, one.size) for one in functions.functions])
        edges = sorted({one.address + n for one in image.symbols.symbols for n in (-1, 0, 1, one.size - 1, one.size)})
        for at in edges:
            yield said((image.symbols.where(at), functions.name(at), functions.start_of(at), functions.end_of(at)))
        yield said([image.symbols.address_of(name) for name in ("main", "none")])
        yield said(
            [
                layout(image),
                layout(image).flash_share,
                layout(image).sram_share,
                vectors(image),
                stack_top(image),
                variables_end(image),
            ]
        )
        yield "\n".join(f"{row.address:x} {row.end:x} {row.file.rpartition('/')[2]} {row.line}" for row in lines.rows)
        edges = sorted({at + n for row in lines.rows for at in (row.address, row.end) for n in (-1, 0)})
        yield " ".join(lines.place(at) or "-" for at in edges)
        start, held = image.segments[0]
        yield "\n".join(tried(file_offset, data, start - FLASH_BASE + n) for n in (-1, 0, 1, len(held) - 1, len(held)))
        table = read_variables(image)
        yield said([table.roots, table.ambiguous, table.offered("")])


def tables(draw: random.Random) -> Iterator[str]:
    """Symbols and rows as no linker puts them: without a size, at the ends of the memories."""
    names = (
        Symbol("low", 0x10),
        Symbol("code", 0x0800_0100, 0x10, True),
        Symbol("open", 0x0800_0200, 0, True),
        Symbol("label", 0x0800_0300),
        Symbol("last", 0x0801_FFF0, 0, True),
        Symbol("ahead", 0x0802_0000, 4, True),
        Symbol("before", 0x1FFF_FFFF, 1, True),
        Symbol("ram", SRAM_BASE, 8, True),
        Symbol("end", SRAM_BASE + SRAM_BYTES - 2, 0, True),
        Symbol("past", SRAM_BASE + SRAM_BYTES, 4, True),
    )
    program = struct.pack("<II", 0x2000_5000, 0x0800_0009) + b"\xfe\xe7" * 4
    for linked_at in (0, FLASH_BASE):
        image = Image("a", ((FLASH_BASE, program),), SymbolTable(names), linked_at=linked_at)
        functions = FunctionTable(image)
        yield said([one.name for one in functions.functions])
        for one in names:
            around = (-1, 0, 1, one.size, 0xFFF, 0x1000, 0xFFFF, 0x1_0000)
            at = [one.address + n for n in around]
            yield said(
                [(image.symbols.where(n), functions.name(n), functions.end_of(n), functions.start_of(n)) for n in at]
            )
    rows = (LineRow(8, 12, "/a/b.c", 3), LineRow(12, 14, "c.c", 4), LineRow(20, 22, "d.c", 5))
    table = LineTable(rows)
    yield said([(at, table.at(at), table.place(at)) for at in range(6, 24)])
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "x.c").write_text("one\ntwo")
        (Path(folder) / "sub").mkdir()
        (Path(folder) / "sub" / "x.c").write_text("three")
        whole = Path(folder)
        for name in ("x.c", "sub/x.c", "none.c", "other/x.c", f"{folder}/sub/x.c", "/none/x.c"):
            yield said([source_lines(name, each) for each in (None, whole, whole / "sub")])
        yield tried(file_bytes, Image("/dev/null", ((FLASH_BASE, program),)))
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "a.hex"
        kept.write_bytes(hex_file(FLASH_BASE, program + bytes(8)))
        image = load_image(kept)
        yield said([layout(image), variables_end(image), len(read_lines(image).rows), read_variables(image).roots])


def programs(draw: random.Random) -> Iterator[str]:
    for stack in (
        0,
        SRAM_BASE,
        SRAM_BASE + 3,
        SRAM_BASE + 4,
        0x2000_4FFF,
        0x2000_5000,
        0x2000_5003,
        0x2000_5004,
        0xFFFF_FFFF,
    ):
        yield made(struct.pack("<II", stack, 0x0800_0009))
    for entry in (0, 1, 8, 9, 0x1_FFFF, 0x2_0001, 0x07FF_FFFF, 0x0800_0001, 0x0801_FFFF, 0x0802_0001, 0xFFFF_FFFF):
        yield made(struct.pack("<II", 0x2000_5000, entry))
    program = struct.pack("<II", 0x2000_5000, 0x0800_0009) + b"\xfe\xe7" * 4
    for address in (
        FLASH_BASE - 4,
        FLASH_BASE,
        FLASH_BASE + 0x1FF,
        FLASH_BASE + 0x200,
        FLASH_BASE + 0x203,
        FLASH_BASE + FLASH_BYTES_FITTED - 16,
        FLASH_BASE + FLASH_BYTES_FITTED - 15,
        SRAM_BASE,
    ):
        yield tried(lambda at: seen(Image("i", ((at, program),))), address)
    yield tried(Image, "i", ((FLASH_BASE, b""),))
    pieces = (
        (FLASH_BASE + 0x400, b"\1\2\3"),
        (FLASH_BASE, program),
        (FLASH_BASE + 0x10, b""),
        (FLASH_BASE + 0x403, b"\4"),
    )
    image = Image("i", pieces)
    yield said([image.word(FLASH_BASE + at) for at in (0, 4, 8, 12, 14, 0x3FC, 0x3FE, 0x400, 0x401, 0x402, 0x404)])
    for data, _ in BAD_FILES[:14] + BAD_FILES[-10:]:
        yield tried(lambda each: seen(parse_image(each, "f")), data)
    for base in (0, 0x1_FFF0, 0x1_FFF1, 0x2_0000, FLASH_BASE, FLASH_BASE + 0x2000):
        yield tried(lambda at: seen(parse_image(hex_file(at, program), "f")), base)
    two = hex_record(4, 0, b"\x08\0") + hex_record(0, 0, program) + hex_record(0, 0x40, b"\1\2") + hex_record(1, 0, b"")
    yield tried(lambda each: seen(parse_image(each, "f")), two.encode())
    yield tried(lambda each: seen(parse_image(each, "f")), two.encode().lower() + b"\r\n")
    for text in (bytes(70), b"0" * 62 + b"\x80", b"0" * 63 + b"\x80", b"\t\r\n 0", b"0\x1f", b"0\x7f"):
        yield tried(lambda each: seen(parse_image(each, "f")), b":" + text)
    both = hex_record(4, 0, bytes(2)) + hex_record(0, 0x8000, b"\1\2") + hex_file(FLASH_BASE, program).decode()
    yield tried(lambda each: seen(parse_image(each, "f")), both.encode())
    for size in (7, 8, 9, 63, 64, 65):
        yield tried(lambda each: seen(parse_image(each, "f")), (program + bytes(80))[:size])


def headers(draw: random.Random) -> Iterator[str]:
    elf = bytearray(PROGRAMS[0].read_bytes())
    for at, values in ((4, (2,)), (5, (2,)), (16, (1, 2, 3, 4, 9)), (18, (3, 62, 243))):
        for value in values:
            changed = elf.copy()
            changed[at] = value
            yield tried(lambda each: seen(parse_image(bytes(each), "f")), changed).split(": damaged")[0][:120]
    (offset,), (count,) = struct.unpack_from("<I", elf, 28), struct.unpack_from("<H", elf, 44)
    for n in range(count):  # of each segment: type, place in the file, addresses, sizes
        for field in range(6):
            for value in (0, 1, 2, 0x1000, 0x0801_0000):
                changed = elf.copy()
                struct.pack_into("<I", changed, offset + 32 * n + 4 * field, value)
                yield tried(lambda each: seen(parse_image(bytes(each), "f")), changed)[:160]


def made(words: bytes) -> str:
    return tried(lambda data: seen(parse_image(data, "a.bin")), words + b"\xfe\xe7" * 4)


def seen(image: Image) -> str:
    return said(
        [
            image.name,
            [(at, len(data)) for at, data in image.segments],
            image.vector_table,
            image.linked_at,
            vectors(image),
            stack_top(image),
            len(image.symbols.symbols),
        ]
    )


def kinds(draw: random.Random) -> Iterator[str]:
    for opening in (
        b"!<arch>\n",
        b"UF2\n",
        b"\x1f\x8b",
        b"PK\3\4",
        b"BZh",
        b"\xfd7zXZ",
        b"MZ",
        b"DfuSe",
        b"\xcf\xfa\xed\xfe",
        b"\x89PNG",
        b"%PDF",
    ):
        for data in (opening + bytes(9), opening[:-1], opening[:-1] + b"\0", b" " + opening):
            yield said(wrong_kind(data))
    for text in (
        b"S0",
        b"S1\nA",
        b"S",
        b"SA23",
        b"S10G",
        b"S1" + b"A" * 13,
        b"S1" + b"A" * 14 + b"G",
        b"S1" + b"A" * 13 + b"G",
        b"S1" + b"A" * 14 + b"\xff",
        b"s1",
        b"T1",
        b"text",
        b"",
        b"a\0",
        b"a\x1f",
        b"a\x20\t\n\r\f",
        b"a\x7f",
        b"a\x0b",
        "ä".encode(),
        b"\xe4",
        b"S10\r\nf",
    ):
        yield said([wrong_kind(text)])


class Words:
    """Memory of halfwords, and nothing around them."""

    def __init__(self, words: Iterable[int]) -> None:
        self._bytes = b"".join(word.to_bytes(2, "little") for word in words)

    def read(self, address: int, size: int) -> bytes | None:
        at = address - FLASH_BASE
        part = self._bytes[at : at + size] if at >= 0 else b""
        return part if len(part) == size else None


#: Halfwords out of which blocks are put together: what leaves, what does not, and the first halves of wide ones.
HALVES = (
    0xBF00,
    0xBF00,
    0x4770,
    0x4798,
    0x4718,
    0xBF08,
    0xBF0C,
    0xBF01,
    0xBF18,
    0xD001,
    0xDE00,
    0xDF01,
    0xDFFF,
    0xE001,
    0xB108,
    0xB908,
    0xBE00,
    0xBF30,
    0xBF20,
    0xBD10,
    0x4687,
    0x4487,
    0xF000,
    0xF800,
    0xF7FF,
    0x8001,
    0x9001,
    0xE8DF,
    0xF001,
    0xF8DF,
    0xF004,
    0xE8BD,
    0x8010,
    0xF5B0,
    0x7F80,
)


def shown(block: StaticBlock) -> str:
    return said([block, block.can_fall_through])


def blocks(draw: random.Random) -> Iterator[str]:
    for _ in range(40):
        code = StaticCode(Words(draw.choices(HALVES, k=12)))  # type: ignore[arg-type]
        for at in range(FLASH_BASE, FLASH_BASE + 26, 2):
            block = code.block(at)
            after = [None, *block.addresses, block.end, at + 2, at - 2]
            yield shown(block) + said([(block.ends_before(each), len(block.executed(each))) for each in after])
    endless = StaticCode(Words([0xBF00] * 1100))  # type: ignore[arg-type]
    yield said([endless.block(FLASH_BASE).end, len(endless.block(FLASH_BASE).addresses)])
    for last in (Kind.PLAIN, Kind.BRANCH, Kind.LOAD_PC, Kind.SUPERVISOR_CALL, Kind.BREAKPOINT, Kind.TABLE_BRANCH):
        for loads in (False, True):
            for to in (None, HERE, HERE + 2):
                one = StaticBlock(
                    HERE,
                    HERE + 4,
                    (HERE, HERE + 2),
                    Instruction(HERE + 2, 2, last, destination=to, loads_pc=loads),
                    False,
                    False,
                )
                yield said([one.can_fall_through, *[one.ends_before(at) for at in (None, HERE, HERE + 2, HERE + 4)]])
    for path in PROGRAMS:
        image, memory = load_image(path), Memory()
        for start, data in image.segments:
            memory.load_flash(start - FLASH_BASE, data)
        functions, code = FunctionTable(image), StaticCode(memory)
        for one in functions.functions:
            found = code.reachable([one.address], functions.end_of)
            yield said(
                [
                    one.name,
                    *[
                        (
                            f"{at:x}",
                            f"{each.end:x}",
                            len(each.addresses),
                            each.last.kind,
                            each.is_conditional,
                            each.is_call,
                        )
                        for at, each in sorted(found.items())
                    ],
                ]
            )
        yield said(sorted(code.reachable([0, SRAM_BASE - 2], lambda _: 1)))


def mutated(draw: random.Random) -> Iterator[str]:
    path = PROGRAMS[0]
    image, data = load_image(path), path.read_bytes()
    start, held = image.segments[0]
    flash = b"\xff" * (start - FLASH_BASE) + held
    ran = range(start - 4, start + len(held) + 4, 2)
    found = mutants(image, ran)
    yield said(
        [len(found), found == mutants(image, reversed(ran)), len(mutants(image, [at - FLASH_BASE for at in ran]))]
    )
    for one in found[::3]:
        made = one.alteration
        yield f"{one.address:x} {one.flash_offset:x} {made.operator} {made.before} > {made.after}"
    for one in draw.sample(found, 10):
        ((where, changed),) = one.image(image).segments
        whole, code = mutated_file(data, one, image), one.alteration.code
        at = next(n for n, (a, b) in enumerate(zip(data, whole, strict=True)) if a != b)
        yield said(
            [
                where,
                len(changed),
                changed[one.flash_offset - where + FLASH_BASE :][: len(code)] == code,
                at,
                one.patched(flash) == flash[: one.flash_offset] + code + flash[one.flash_offset + len(code) :],
                mutated_file(b"x", one, image)[one.flash_offset :][:4].hex(),
                len(mutated_file(b"x", one, image)),
                whole[at : at + 4].hex(),
                len(whole),
            ]
        )
    for _ in range(60):
        words = draw.choices(
            (
                0xBF08,
                0xBF0C,
                0xBF01,
                0xBF1C,
                0xBFE8,
                0xBF00,
                0x2001,
                0x3001,
                0x4240,
                0xF240,
                0x0301,
                0xF2C0,
                0x0302,
                0xF04F,
                0x0105,
                0xF2C0,
                0x0105,
            ),
            k=12,
        )
        held = struct.pack("<II", 0x2000_5000, 0x0800_0009) + b"".join(word.to_bytes(2, "little") for word in words)
        small = Image("m", ((FLASH_BASE + 0x200, held), (FLASH_BASE + 0x300, b"\1\2")))
        begins = draw.choice((FLASH_BASE, 0)) + 0x208
        for one in mutants(small, range(begins, begins + 26, 2)):
            yield f"{one.address:x} {one.flash_offset:x} {one.alteration.before} > {one.alteration.after} " + said(
                [(at, data.hex()) for at, data in one.image(small).segments]
            )


#: Instructions of small functions: plain ones, branches of each kind, calls, loads from beside the code.
CODE = (
    *(0x2001, 0x2102, 0x1840, 0x1881, 0x4608, 0xBF00, 0x3101, 0x4770, 0x681A, 0x6012),
    *(0xD001, 0xD1FC, 0xE002, 0xE7FA, 0xB118, 0xB911, 0xDF01, 0x4802, 0x4903),
    *(0xF000F803, 0xF7FFFFFA, 0xF0008002, 0xF47FAFFC, 0xF000B803, 0xF8DF1008, 0xF85F1004, 0xF1010105, 0xFB02F103),
)
#: What words of a literal pool may be: numbers, places of symbols and of texts, at the ends of the memories.
POOL = (
    7,
    0x07FF_FFFF,
    FLASH_BASE,
    0x0800_0141,
    0x0800_0300,
    0x0800_0308,
    0x0801_FFFF,
    0x0802_0000,
    0x1FFF_FFFF,
    SRAM_BASE,
    SRAM_BASE + 4,
    SRAM_BASE + 0x4FFF,
    SRAM_BASE + 0x5000,
)


def code_of(words: Iterable[int]) -> bytes:
    return b"".join(
        part.to_bytes(2, "little")
        for word in words
        for part in ((word >> 16, word & 0xFFFF) if word > 0xFFFF else (word,))
    )


def version(first: bytes, second: bytes, pool: bytes, *, names: tuple[str, str] = ("one", "two")) -> Image:
    """Return a program of two functions, the first with words behind it, with texts at 0x08000300."""
    one, start = first + bytes(len(first) % 4) + pool, FLASH_BASE + 0x140
    body = bytes(0x138) + one + second
    held = struct.pack("<II", 0x2000_5000, start | 1) + body.ljust(0x2F8, b"\xff") + b"hello, world and all of it\0x"
    symbols = (
        Symbol("low", FLASH_BASE, 4),
        Symbol(names[0], start, len(one), True),
        Symbol(names[1], start + len(one), len(second), True),
        Symbol("data", SRAM_BASE, 4),
        Symbol("more", SRAM_BASE + 4, 0),
    )
    return Image("version.elf", ((FLASH_BASE, held),), SymbolTable(symbols))


def versions(draw: random.Random) -> Iterator[str]:
    for _ in range(70):
        words, others = draw.choices(CODE, k=9), draw.choices(CODE, k=4)
        pool = draw.choices(POOL, k=3)
        image = version(code_of(words), code_of(others), struct.pack("<3I", *pool))
        place = draw.randrange(len(words))
        changed = [*words]
        match draw.randrange(5):
            case 0:
                changed[place] ^= 1 << draw.randrange(12)
            case 1:
                del changed[place]
            case 2:
                changed.insert(place, draw.choice(CODE))
            case 3:
                pool[draw.randrange(3)] = draw.choice(POOL)
            case _:
                changed[place] = draw.choice(CODE)
        other = version(code_of(changed), code_of(others), struct.pack("<3I", *pool))
        yield said([(one.function, one.ours, one.theirs, one.before) for one in code_differences(other, image)])
    branches = [word for word in CODE if word in {0xD001, 0xE002, 0xB118, 0xB911} or word > 0xF000_0000]
    # B.W, whose second half looks like a CBZ.
    for word in (*branches, 0xF000_B918, 0xF3FF_B1A5):  # each bit of what leads elsewhere
        image = version(code_of([0xBF00, word, 0xBF00]), code_of([0x4770]), struct.pack("<I", 7))
        for bit in range(32 if word > 0xFFFF else 16):
            other = version(code_of([0xBF00, word ^ 1 << bit, 0xBF00]), code_of([0x4770]), struct.pack("<I", 7))
            yield f"{word:x} {bit} " + said(
                [(one.function, one.ours, one.theirs) for one in code_differences(other, image)]
            )
    for one in POOL:
        made = [
            version(code_of([0x4801, 0x4770]), code_of([0x4770]), struct.pack("<I", value)) for value in (one, *POOL)
        ]
        yield " ".join("same" if not code_differences(made[0], each) else "other" for each in made)
    one, two = (version(code_of([0x4770]), code_of([0x4770]), b"", names=("one", name)) for name in ("two", "three"))
    yield said(code_differences(one, two))


def lines_of_versions(draw: random.Random) -> Iterator[str]:
    with resources.as_file(resources.files("bluepill_sim.analysis.silicon") / "pins.elf") as path:
        image = load_image(path)
    start, held = image.segments[0]
    for one in draw.sample(mutants(image, range(start + 0x140, start + len(held), 2)), 6):
        other = one.image(image)
        yield f"{one.alteration.before} > {one.alteration.after} {said(code_differences(other, image))}"
        yield said([(each, each.missing) for each in line_differences(other, image)])
    for at in sorted(draw.sample(range(0x140, len(held) - 8, 4), 5)):
        for put in (b"\0\xbf", b"\xfe\xe7", bytes((held[at] ^ 8, held[at + 1]))):
            other = Image(image.name, ((start, held[:at] + put + held[at + len(put) :]),), image.symbols)
            yield said(line_differences(other, image))
    one, other = load_image(FIRMWARE / "usb_echo.elf"), load_image(FIRMWARE / "board_test.elf")
    for pair in ((one, other), (other, one)):
        yield "\n".join(map(said, [(each, each.missing) for each in line_differences(*pair)]))


def line_programs(draw: random.Random) -> Iterator[str]:
    """Line programs of each version, with folders and files as compilers write them."""
    image = Image("l", ((FLASH_BASE, struct.pack("<II", 0x2000_5000, 0x0800_0009)),))
    at_zero = Image("l", image.segments, linked_at=0)
    for number in (2, 3, 4, 5):
        for compiled_in in ("/home/x", None):
            states: list[SimpleNamespace | None] = [None]
            for _ in range(40):
                base = draw.choice(
                    (0, FLASH_BASE, FLASH_BASE + 0x1_FFF0, SRAM_BASE, SRAM_BASE + SRAM_BYTES - 8, 0x0802_0000)
                )
                states += [
                    SimpleNamespace(
                        address=base + at, line=draw.choice((0, 1, 7)), file=draw.randint(1, 4), end_sequence=at == 12
                    )
                    for at in (0, draw.choice((0, 4)), draw.choice((4, 8)), 12)
                ]
            program = SimpleNamespace(
                header={
                    "version": number,
                    "include_directory": [b"/home/x", b"sub", b"/usr/include", b"."],
                    "file_entry": [
                        SimpleNamespace(name=name, dir_index=folder)
                        for name, folder in ((b"a.c", 0), (b"b.h", 1), (b"/abs/c.c", 2), (b"d.h", 2), (b"./e.c", 3))
                    ],
                },
                get_entries=lambda states=states: [SimpleNamespace(state=state) for state in states],
            )
            given = {} if compiled_in is None else {"comp_dir": compiled_in}
            elf = FakeElf((die("compile_unit", **given),), program)
            for each in (image, at_zero):
                yield said(
                    [(f"{row.address:x}", f"{row.end:x}", row.file, row.line) for row in lines_in(each, elf).rows]
                )
    yield said([lines_in(image, FakeElf((die("compile_unit"),), None)).rows, lines_in(image, FakeElf(())).rows])
    broken = SimpleNamespace(header={"version": 5})
    yield tried(lines_in, image, FakeElf((die("compile_unit"),), broken))
    elf = PROGRAMS[0].read_bytes() + bytes(3)  # no other test has read it
    for module, data in (("elftools.elf.elffile", elf), ("intelhex", b":00" + bytes(20).hex().encode())):
        with patch.dict(sys.modules, {module: None}):
            yield tried(parse_image, data, "a").split(" (")[0]
    with patch.dict(sys.modules, {"elftools.common.exceptions": None}):
        yield tried(lines_in, image, FakeElf(())).split(" (")[0]


def lines_in(image: Image, elf: FakeElf) -> LineTable:
    line_table._lines_of.cache_clear()
    with (
        patch("elftools.elf.elffile.ELFFile", lambda _: elf),
        patch.object(line_table, "file_bytes", lambda _: b"\x7fELF"),
    ):
        return read_lines(image)


def last(draw: random.Random) -> Iterator[str]:
    symbols = SymbolTable((Symbol("main", 0x100, 0x20), Symbol("loop", 0x120, 0x20)))
    table = LineTable((LineRow(0x100, 0x110, "/x/m.c", 7), LineRow(0x120, 0x130, "l.c", 9)))
    for _ in range(60):
        steps = [
            (
                draw.choice((0x100, 0x112, 0x120, 0x140, 0xFFFF_FFDF, 0xFFFF_FFE0, 0xFFFF_FFF9)),
                draw.choice((BLOCK, BLOCK, BLOCK, EXCEPTION_RETURN, 3, 15, 16 + 37)),
            )
            for _ in range(draw.randint(1, 4))
        ]
        steps = steps * draw.choice((1, 1, 2, 3, 7)) + steps[: draw.randint(0, 3)] * draw.randint(0, 2)
        rows = [(10 * n + 5, *step) for n, step in enumerate(steps)]
        yield "\n".join(shortened(rows, symbols, table))
        yield "\n".join(lines_of(rows[:5], symbols, table))


def resets(draw: random.Random) -> Iterator[str]:
    row, now, seen_so = ResetRow(), 0, list[object]()
    yield said([row, str(row)])
    for _ in range(MOST_RESETS + 3):
        now += LEAST_NS - 1
        seen_so.append(row.add(now))
    yield said([seen_so, row, str(row)])
    for gap in (LEAST_NS, LEAST_NS - 1, LEAST_NS + 1, 5):
        now += gap
        yield said([row.add(now), row, str(row)])
    row.begin_anew(now + 9)
    yield said([row, str(row)])
    row.endless_ns = 7
    row.clear()
    yield said([row, row.add(now + 10), row, row.add(now + 11), row])


TRACES: dict[str, Trace] = {
    "narrow": narrow,
    "wide": wide,
    "files": files,
    "unsized": unsized,
    "tables": tables,
    "programs": programs,
    "headers": headers,
    "kinds": kinds,
    "blocks": blocks,
    "mutated": mutated,
    "versions": versions,
    "lines_of_versions": lines_of_versions,
    "line_programs": line_programs,
    "last": last,
    "resets": resets,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
