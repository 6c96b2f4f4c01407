"""The tests' own assembler against the GNU one, and the decoder against both."""

import shutil
import subprocess
from pathlib import Path

import pytest

from bluepill_sim.core.thumb import Kind, decode_all

PROGRAM = """
first: nop
movs r1, #200
adds r1, #3
subs r2, r1, r3
cmp r4, #7
mov r8, r1
muls r1, r2
udiv r0, r1, r2
sdiv r3, r4, r5
mla r0, r1, r2, r3
ldr r0, [r1, #8]
str r0, [r1, #124]
ldrb r0, [r1, #3]
strh r2, [r3, #6]
ldr r0, [r1, r2]
str r0, [sp, #8]
ldrd r0, r1, [r2, #8]
strd r0, r1, [r2]
ldrex r0, [r1]
strex r2, r0, [r1]
push {r0-r3, lr}
pop {r4, pc}
ldmia r1!, {r2-r4}
stmia r1!, {r2, r3}
ldmia.w r1, {r2-r4}
beq first
bne last
b last
bl first
cbz r1, last
bx lr
blx r3
svc #5
bkpt #1
mrs r0, primask
msr basepri, r1
msr control, r2
it eq
nop
itte ne
nop
nop
nop
cpsid i
cpsie f
wfi
wfe
sev
yield
isb
dsb
clrex
wfi.w
last: nop
"""


@pytest.mark.skipif(shutil.which("arm-none-eabi-as") is None, reason="arm-none-eabi-as is not installed")
def test_the_test_assembler_agrees_with_the_gnu_assembler(assemble, tmp_path: Path) -> None:
    spelling = {"stmia r1!, {r2, r3}": "stm r1!, {r2, r3}", "it eq\nnop": "it eq\nnopeq"}
    text = PROGRAM.replace("itte ne\nnop\nnop\nnop", "itte ne\nnopne\nnopne\nnopeq")
    for ours, theirs in spelling.items():
        text = text.replace(ours, theirs)
    source, result, plain = tmp_path / "a.s", tmp_path / "a.o", tmp_path / "a.bin"
    source.write_text(f".syntax unified\n.cpu cortex-m3\n.thumb\n{text}")
    subprocess.run(["arm-none-eabi-as", "-o", result, source], check=True)
    subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", result, plain], check=True)
    assert assemble(PROGRAM, 0).code == plain.read_bytes()


def test_the_decoder_finds_every_instruction_and_its_kind(assemble) -> None:
    lines = [line.split(":")[-1].strip() for line in PROGRAM.strip().splitlines()]
    instructions = decode_all(assemble(PROGRAM, 0).code, 0)
    assert len(instructions) == len(lines)
    kinds = {
        "udiv": Kind.DIVIDE, "sdiv": Kind.DIVIDE, "mla": Kind.MULTIPLY_ACCUMULATE, "ldr": Kind.LOAD,
        "ldrb": Kind.LOAD, "str": Kind.STORE, "strh": Kind.STORE, "ldrd": Kind.LOAD_DUAL, "strd": Kind.STORE_DUAL,
        "ldrex": Kind.EXCLUSIVE, "strex": Kind.EXCLUSIVE, "push": Kind.STORE_MULTIPLE, "pop": Kind.LOAD_MULTIPLE,
        "ldmia": Kind.LOAD_MULTIPLE, "ldmia.w": Kind.LOAD_MULTIPLE, "stmia": Kind.STORE_MULTIPLE,
        "b": Kind.BRANCH, "beq": Kind.BRANCH, "bne": Kind.BRANCH, "cbz": Kind.BRANCH, "bl": Kind.CALL,
        "bx": Kind.BRANCH_REGISTER, "blx": Kind.BRANCH_REGISTER, "svc": Kind.SUPERVISOR_CALL,
        "bkpt": Kind.BREAKPOINT, "mrs": Kind.READ_SPECIAL, "msr": Kind.MASK_CHANGE, "cpsid": Kind.MASK_CHANGE,
        "cpsie": Kind.MASK_CHANGE, "wfi": Kind.WAIT_INTERRUPT, "wfi.w": Kind.WAIT_INTERRUPT, "wfe": Kind.WAIT_EVENT,
        "sev": Kind.SEND_EVENT, "yield": Kind.YIELD, "isb": Kind.SYNCHRONISE, "dsb": Kind.BARRIER,
        "clrex": Kind.BARRIER, "it": Kind.IF_THEN, "itte": Kind.IF_THEN,
    }  # fmt: skip
    for line, instruction in zip(lines, instructions, strict=True):
        assert instruction.kind is kinds.get(line.split()[0], Kind.PLAIN), line


def test_the_decoder_knows_where_direct_branches_go(assemble) -> None:
    made = assemble(PROGRAM, 0x1000)
    targets = [i.destination for i in decode_all(made.code, 0x1000) if i.destination is not None]
    first, last = made.labels["first"], made.labels["last"]
    assert targets == [first, last, last, first, last]


@pytest.mark.parametrize(
    ("words", "kind", "destination"),
    [
        ((0xF000, 0xB801), Kind.BRANCH, 0x1006),  # b.w
        ((0xF43F, 0xAFFE), Kind.BRANCH, 0x1000),  # beq.w to itself
        ((0xE8DF, 0xF001), Kind.TABLE_BRANCH, None),
        ((0xF8DF, 0x0004), Kind.LOAD_LITERAL, None),
        ((0xF8DF, 0xF004), Kind.LOAD_PC, None),
        ((0xF851, 0x2003), Kind.LOAD, None),  # ldr.w r2, [r1, r3]
        ((0xF841, 0x2003), Kind.STORE_INDEXED, None),
        ((0xF8C1, 0x2004), Kind.STORE, None),
        ((0xF891, 0xF000), Kind.PLAIN, None),  # pld
        ((0xFBA1, 0x2300), Kind.MULTIPLY_LONG, None),
        ((0xFBE1, 0x2300), Kind.MULTIPLY_ACCUMULATE_LONG, None),
        ((0xFB01, 0xF203), Kind.PLAIN, None),  # mul r2, r1, r3
        ((0xFB01, 0x4213), Kind.MULTIPLY_ACCUMULATE, None),  # mls
        ((0xF3AF, 0x8004), Kind.SEND_EVENT, None),
        ((0xF3AF, 0x8001), Kind.YIELD, None),
        ((0xE8C1, 0x0F42), Kind.EXCLUSIVE, None),  # strexb
    ],
)
def test_the_decoder_knows_wide_encodings(words: tuple[int, int], kind: Kind, destination: int | None) -> None:
    code = b"".join(word.to_bytes(2, "little") for word in words)
    (instruction,) = decode_all(code, 0x1000)
    assert (instruction.kind, instruction.destination, instruction.size) == (kind, destination, 4)
