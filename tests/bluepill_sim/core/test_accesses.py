"""The instruction that accesses a peripheral is told by what its registers reach for."""

import pytest

from bluepill_sim.core.accesses import Access, accesses_of, is_ambiguous, may_write

AT = 0x0800_0100

#: (halfwords, what it accesses), encodings by hand from the ARMv7-M manual.
ENCODINGS = [
    ("6888", Access(AT, True, 4, 1, 8)),  # ldr r0, [r1, #8]
    ("6088", Access(AT, False, 4, 1, 8)),  # str r0, [r1, #8]
    ("7848", Access(AT, True, 1, 1, 1)),  # ldrb r0, [r1, #1]
    ("7048", Access(AT, False, 1, 1, 1)),
    ("8848", Access(AT, True, 2, 1, 2)),  # ldrh r0, [r1, #2]
    ("8048", Access(AT, False, 2, 1, 2)),
    ("5888", Access(AT, True, 4, 1, index=2)),  # ldr r0, [r1, r2]
    ("5088", Access(AT, False, 4, 1, index=2)),
    ("5288", Access(AT, False, 2, 1, index=2)),
    ("5488", Access(AT, False, 1, 1, index=2)),
    ("5688", Access(AT, True, 1, 1, index=2)),  # ldrsb
    ("5A88", Access(AT, True, 2, 1, index=2)),
    ("5C88", Access(AT, True, 1, 1, index=2)),
    ("5E88", Access(AT, True, 2, 1, index=2)),
    ("C90D", Access(AT, True, 4, 1, count=3)),  # ldmia r1!, {r0, r2, r3}
    ("C10D", Access(AT, False, 4, 1, count=3)),
    ("F8D1 0123", Access(AT, True, 4, 1, 0x123)),  # ldr.w r0, [r1, #0x123]
    ("F8C1 0123", Access(AT, False, 4, 1, 0x123)),
    ("F891 0001", Access(AT, True, 1, 1, 1)),
    ("F9B1 0002", Access(AT, True, 2, 1, 2)),  # ldrsh.w
    ("F851 0C04", Access(AT, True, 4, 1, -4)),  # ldr r0, [r1, #-4]
    ("F851 0F04", Access(AT, True, 4, 1, 4)),  # ldr r0, [r1, #4]!
    ("F851 0B04", Access(AT, True, 4, 1, 0)),  # ldr r0, [r1], #4
    ("F851 0032", Access(AT, True, 4, 1, index=2, shift=3)),  # ldr.w r0, [r1, r2, lsl #3]
    ("E8B1 000D", Access(AT, True, 4, 1, count=3)),  # ldmia.w r1!, ...
    ("E931 000D", Access(AT, True, 4, 1, -12, count=3)),  # ldmdb r1!, ...
    ("E9D1 0202", Access(AT, True, 4, 1, 8, count=2)),  # ldrd r0, r2, [r1, #8]
    ("E941 0202", Access(AT, False, 4, 1, -8, count=2)),  # strd r0, r2, [r1, #-8]
    ("E8F1 0202", Access(AT, True, 4, 1, 0, count=2)),  # ldrd r0, r2, [r1], #8
    ("E851 0F02", Access(AT, True, 4, 1, 8)),  # ldrex r0, [r1, #8]
    ("E8D1 0F4F", Access(AT, True, 1, 1)),  # ldrexb
    ("E8D1 0F5F", Access(AT, True, 2, 1)),  # ldrexh
    ("E8D1 F000", None),  # tbb
    ("9802", None),  # ldr r0, [sp, #8]
    ("4802", None),  # ldr r0, [pc, #8]
    ("B403", None),  # push
    ("1C48", None),  # adds r0, r1, #1
    ("F101 0001", None),  # add.w r0, r1, #1
    ("F871 0000", None),  # undefined: size 3
]  # fmt: skip


def code(text: str) -> bytes:
    return b"".join(int(word, 16).to_bytes(2, "little") for word in text.split())


@pytest.mark.parametrize(("text", "access"), ENCODINGS)
def test_each_encoding_reaches_where_the_manual_says(text: str, access: Access | None) -> None:
    assert accesses_of(code(text), AT) == (() if access is None else (access,))


def test_half_an_instruction_at_the_end_is_none() -> None:
    assert accesses_of(code("6888 F8D1"), AT) == (Access(AT, True, 4, 1, 8),)


@pytest.mark.parametrize(("text", "registers"), [
    ("6088", ()), ("7048", ()), ("5088", ()),  # stores
    ("6888", (0,)), ("1C48", (0,)), ("2505", (5,)), ("46A1", (9,)),
    ("C90D", (0, 1, 2, 3)), ("E8B1 000D", (0, 1, 2, 3)),
    ("F8C1 0123", ()), ("F841 0F04", (1,)), ("F851 0B04", (0, 1)), ("FB82 0134", (0, 1)),
])  # fmt: skip
def test_all_registers_that_are_written_are_named(text: str, registers: tuple[int, ...]) -> None:
    mask = may_write(code(text), 0)
    assert all(mask >> register & 1 for register in registers)
    assert registers or not mask


def test_two_accesses_that_look_alike_are_ambiguous_when_the_base_changes() -> None:
    assert is_ambiguous(code("6819 681B 681A"), AT), "ldr r1, [r3]; ldr r3, [r3]; ldr r2, [r3]"
    assert not is_ambiguous(code("6819 681A"), AT), "the same register twice is told by the order"
    assert not is_ambiguous(code("681B 685A"), AT), "other offsets are told by the address"
    assert is_ambiguous(code("6819 F103 0304 681A"), AT), "a wide instruction in between"
