"""Results and flags derived by hand from the manual's pseudocode: ours and QEMU's engine share their ancestry.

Source: ARMv7-M Architecture Reference Manual, A2.2.1 (AddWithCarry, shifts), A5.3.2 (ThumbExpandImm_C), A7.7.
"""

import pytest

#: What R0 holds where an instruction does not write it.
UNTOUCHED = 0xA5A5_A5A5
M, TOP, MAX = 0xFFFF_FFFF, 0x8000_0000, 0x7FFF_FFFF

ADDS, ADCS, SUBS, SBCS = (0xEB11, 0x0002), (0xEB51, 0x0002), (0xEBB1, 0x0002), (0xEB71, 0x0002)
NEGS, CMP, CMN = (0xF1D1, 0x0000), (0x4291,), (0x42D1,)
LSLS, LSRS, ASRS, RORS = (0xFA11, 0xF002), (0xFA31, 0xF002), (0xFA51, 0xF002), (0xFA71, 0xF002)
RRXS = (0xEA5F, 0x0031)
SSAT8, USAT8, SSAT16_ASR4 = (0xF301, 0x0007), (0xF381, 0x0008), (0xF321, 0x100F)

#: Name, instruction (R0 from R1 and R2; R3 is 0), R1, R2, flags before, R0 and flags after.
VECTORS = [
    ("adds overflows", ADDS, MAX, 1, "", TOP, "NV"),
    ("adds carries", ADDS, M, 1, "", 0, "ZC"),
    ("adds of two negatives", ADDS, TOP, TOP, "", 0, "ZCV"),
    ("adcs takes the carry in", ADCS, M, 0, "C", 0, "ZC"),
    ("adcs overflows by the carry", ADCS, MAX, 0, "C", TOP, "NV"),
    ("adcs of two negatives", ADCS, TOP, TOP, "", 0, "ZCV"),
    ("adcs of all ones", ADCS, M, M, "C", M, "NC"),
    ("adcs of nothing", ADCS, 0, 0, "", 0, "Z"),
    ("adcs over zero is no overflow", ADCS, MAX, TOP, "C", 0, "ZC"),
    ("subs borrows", SUBS, 0, 1, "", M, "N"),
    ("subs of equals", SUBS, 1, 1, "NV", 0, "ZC"),
    ("subs overflows", SUBS, TOP, 1, "", MAX, "CV"),
    ("subs of the smallest from itself", SUBS, TOP, TOP, "", 0, "ZC"),
    ("sbcs without carry borrows", SBCS, 0, 0, "", M, "N"),
    ("sbcs with carry does not", SBCS, 0, 0, "C", 0, "ZC"),
    ("sbcs overflows by the borrow", SBCS, TOP, 0, "", MAX, "CV"),
    ("sbcs into the sign", SBCS, MAX, M, "C", TOP, "NV"),
    ("sbcs of equals borrows", SBCS, 5, 5, "", M, "N"),
    ("sbcs over both ends", SBCS, TOP, MAX, "", 0, "ZCV"),
    ("rsbs of zero", NEGS, 0, 0, "", 0, "ZC"),
    ("rsbs of the smallest", NEGS, TOP, 0, "C", TOP, "NV"),
    ("rsbs of one", NEGS, 1, 0, "C", M, "N"),
    ("cmp with the smallest", CMP, 0, TOP, "ZC", UNTOUCHED, "NV"),
    ("cmn of minus one and one", CMN, M, 1, "", UNTOUCHED, "ZC"),
    ("lsl 1 shifts the top out", (0x0048,), TOP, 0, "V", 0, "ZCV"),
    ("lsl 1 clears the carry", (0x0048,), 1 << 30, 0, "C", TOP, "N"),
    ("lsl 31 carries bit 1", (0x07C8,), 3, 0, "", TOP, "NC"),
    ("lsr 32 carries the top", (0x0808,), TOP, 0, "", 0, "ZC"),
    ("lsr 32 without the top", (0x0808,), MAX, 0, "C", 0, "Z"),
    ("asr 32 of a negative", (0x1008,), TOP, 0, "", M, "NC"),
    ("asr 32 of a positive", (0x1008,), MAX, 0, "C", 0, "Z"),
    ("lsl by register 0 keeps the carry", LSLS, 1, 0, "C", 1, "C"),
    ("lsl by register 256 is by 0", LSLS, 5, 0x100, "C", 5, "C"),
    ("lsl by register 32 carries bit 0", LSLS, 1, 32, "", 0, "ZC"),
    ("lsl by register 33 carries nothing", LSLS, M, 33, "C", 0, "Z"),
    ("lsr by register 32", LSRS, TOP, 32, "", 0, "ZC"),
    ("lsr by register 33", LSRS, M, 33, "C", 0, "Z"),
    ("asr by register 40", ASRS, TOP, 40, "", M, "NC"),
    ("asr by register 255", ASRS, MAX, 255, "C", 0, "Z"),
    ("ror by register 32 carries the top", RORS, TOP | 1, 32, "", TOP | 1, "NC"),
    ("ror by register 0 keeps the carry", RORS, TOP, 0, "C", TOP, "NC"),
    ("ror by register 4", RORS, 0xF, 4, "", 0xF000_0000, "NC"),
    ("ror by register 64 clears the carry", RORS, 1, 64, "C", 1, ""),
    ("rrx shifts out", RRXS, 1, 0, "", 0, "ZC"),
    ("rrx shifts the carry in", RRXS, 0, 0, "C", TOP, "N"),
    ("rrx does both", RRXS, 3, 0, "C", TOP | 1, "NC"),
    ("movs of a rotated constant carries its top", (0xF05F, 0x4000), 0, 0, "", TOP, "NC"),
    ("ands of a plain constant keeps the carry", (0xF011, 0x00FF), 0, 0, "C", 0, "ZC"),
    ("ands of a rotated constant clears it", (0xF011, 0x5080), M, 0, "C", 0x1000_0000, ""),
    ("ssat leaves what fits", SSAT8, 127, 0, "NZCV", 127, "NZCV"),
    ("ssat from above", SSAT8, 128, 0, "", 127, "Q"),
    ("ssat from below", SSAT8, -129 & M, 0, "C", -128 & M, "CQ"),
    ("ssat after a shift", SSAT16_ASR4, 0x0010_0000, 0, "", 0x7FFF, "Q"),
    ("usat leaves what fits", USAT8, 255, 0, "", 255, ""),
    ("usat from above", USAT8, 256, 0, "", 255, "Q"),
    ("usat from below", USAT8, M, 0, "", 0, "Q"),
    ("q stays", SSAT8, 0, 0, "Q", 0, "Q"),
    ("udiv by zero", (0xFBB1, 0xF0F2), 7, 0, "NZCV", 0, "NZCV"),
    ("sdiv of the smallest by minus one", (0xFB91, 0xF0F2), TOP, M, "", TOP, ""),
    ("sdiv rounds toward zero", (0xFB91, 0xF0F2), -7 & M, 2, "", -3 & M, ""),
    ("smull, low word", (0xFB81, 0x0302), M, M, "", 1, ""),
    ("umull, high word", (0xFBA1, 0x3002), M, M, "", 0xFFFF_FFFE, ""),
    ("smull, high word", (0xFB81, 0x3002), TOP, 2, "", M, ""),
    ("mls", (0xFB01, 0x3012), 3, 4, "C", -12 & M, "C"),
    ("sbfx", (0xF341, 0x1003), 0x80, 0, "", -8 & M, ""),
    ("ubfx", (0xF3C1, 0x1003), 0x80, 0, "", 8, ""),
    ("bfi keeps the rest", (0xF361, 0x1007), 0xB, 0, "", 0xA5A5_A5B5, ""),
    ("clz of zero", (0xFAB1, 0xF081), 0, 0, "", 32, ""),
    ("clz of one", (0xFAB1, 0xF081), 1, 0, "", 31, ""),
    ("rbit", (0xFA91, 0xF0A1), 1, 0, "", TOP, ""),
    ("revsh", (0xBAC8,), 0x80, 0, "", 0xFFFF_8000, ""),
    ("rev16", (0xBA48,), 0x1122_3344, 0, "", 0x2211_4433, ""),
    ("sxtb of a rotated word", (0xFA4F, 0xF091), 0x8000, 0, "", 0xFFFF_FF80, ""),
]  # fmt: skip


def bits(flags: str) -> int:
    """Flags as they stand in APSR."""
    return sum(1 << 31 - "NZCVQ".index(letter) for letter in flags)


@pytest.mark.parametrize(
    ("code", "r1", "r2", "before", "r0", "after"), [row[1:] for row in VECTORS], ids=[row[0] for row in VECTORS]
)
def test_an_instruction_does_what_the_manual_says(
    run, code: tuple[int, ...], r1: int, r2: int, before: str, r0: int, after: str
) -> None:
    halves = ", ".join(hex(half) for half in code)
    machine = run(
        f"mov32 r4, #{bits(before)}\nmsr apsr, r4\nmov32 r0, #{UNTOUCHED}\nmov32 r1, #{r1}\nmov32 r2, #{r2}\n"
        f"mov32 r3, #0\n.half {halves}\nmrs r5, apsr\nstr r0, [r7, #0]\nstr r5, [r7, #4]\nadds r7, #8"
    )
    result, flags = machine.log
    assert (hex(result), hex(flags)) == (hex(r0), hex(bits(after)))


def or_bit(number: int) -> str:
    """ORR.W R0, R0, #1 << number: leaves the flags alone."""
    turn = 39 - number  # 0x80 turned right by this is the bit; up to bit 7 it stands as it is
    if number < 8:
        return f".half 0xF040, {1 << number}\n"
    return f".half {0xF040 | (turn >> 4) << 10}, {(turn >> 1 & 7) << 12 | (turn & 1) << 7}\n"


def holds(condition: int, nzcv: int) -> bool:
    """The manual's table of conditions (A7.3)."""
    n, z, c, v = (bool(nzcv >> bit & 1) for bit in (3, 2, 1, 0))
    table = (z, c, n, v, c and not z, n == v, n == v and not z)
    return table[condition >> 1] is not bool(condition & 1)


def test_conditions_follow_the_flags(run) -> None:
    """Each of fourteen conditions under each of sixteen settings of NZCV, by IT and by a branch."""
    by_it = "".join(f".half {0xBF08 | condition << 4}\n" + or_bit(condition) for condition in range(14))
    # A branch over the instruction, under the opposite condition, two halfwords on.
    by_branch = "".join(f".half {0xD001 | (condition ^ 1) << 8}\n" + or_bit(condition) for condition in range(14))
    expected = [sum(holds(condition, nzcv) << condition for condition in range(14)) for nzcv in range(16)]
    for way in (by_it, by_branch):
        begin = "msr apsr, r4\nmov32 r0, #0\n"
        source = "".join(f"mov32 r4, #{n << 28}\n{begin}{way}str r0, [r7, #0]\nadds r7, #4\n" for n in range(16))
        assert run(source).log == expected
