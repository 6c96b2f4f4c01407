"""What a block is made into: flags that nobody can see are not set, and common sequences are one piece of code.

Micro-operations are told apart by their numbers, which are not known here: code is compared with other code.
"""

import random
import struct

import pytest

from bluepill_sim.extension.encodings import NARROW, WIDE
from bluepill_sim.extension.library import library
from tests.bluepill_sim.core.interpreter.lockstep import Case, Lockstep, any_value, flags_of
from tests.bluepill_sim.core.interpreter.test_against_unicorn import assert_same

CMP, BX_LR, NOP, MRS = 0x2A00, 0x4770, 0xBF00, 0xF3EF_8400  # CMP R2, #0; MRS R4, APSR
LDR, IT_NE, MSR = 0x681C, 0xBF18, 0xF384_8810  # LDR R4, [R3]; MSR PRIMASK, R4
#: MOV R0, R1, shifted: LSL #2, LSR #2, ASR #2, ROR #2, RRX; and data processing of R0 and R1 that is shifted so.
SHIFTS = (0x81, 0x91, 0xA1, 0xB1, 0x31)
#: Data processing with flags, to R0 of R0 and R1, or of constants; and what does the same without, one after the other.
WITH_FLAGS = tuple(
    pair
    for row in WIDE
    if "s" in row.fields and row.kind.name == "PLAIN"
    for word in [row.value | 1 << 20]
    for pair in (
        [(word | constant, (row.value | constant,)) for constant in (5, 0x405, 0x4000_0000 & ~row.mask | 0x405)]
        if "i" in row.fields and "m" not in row.fields
        else [(word | 1, (row.value | 1,))]
        + [(word | shift, (0xEA4F_0000 | shift, row.value | 1)) for shift in SHIFTS if "h" in row.fields]
    )
)
#: What only sets flags: of R1 and 5, of R1 and R0, shifted in each way.
ONLY_FLAGS = tuple(
    row.value | 1 << 16 | shifted
    for row in WIDE
    if row.operation[:3] in {"TST", "TEQ", "CMP", "CMN"}
    for shifted in ((5, 0x405) if row.operation.endswith("_I") else (0, 0x40, 0x50, 0x60, 0x70, 0x30))
)


def made_of(lockstep: Lockstep, *words: int) -> list[tuple[int, int]]:
    """Return the number and the code of each micro-operation of a block."""
    code = b"".join(
        struct.pack("<HH", word >> 16, word & 0xFFFF) if word >> 16 else struct.pack("<H", word) for word in words
    )
    room = (struct.Struct("<HH").size * b"\0") * 64
    count = library().interpreter_look(lockstep.own.core._handle, code, len(code), room, 64)
    assert count <= 64
    return list(struct.iter_unpack("<HH", room[: 4 * count]))


def numbers(lockstep: Lockstep, *words: int) -> list[int]:
    """Return the numbers of the micro-operations."""
    return [number for number, _ in made_of(lockstep, *words)]


def test_flags_are_set_where_they_may_be_seen_and_nowhere_else(lockstep: Lockstep) -> None:
    end = numbers(lockstep, CMP, BX_LR)
    for sets, plain in WITH_FLAGS:
        without = [number for word in plain for number in numbers(lockstep, word, BX_LR)[:1]]
        assert numbers(lockstep, sets, CMP, BX_LR) == without + end, f"{sets:x}: CMP sets all of them"
        assert numbers(lockstep, sets, NOP, CMP, BX_LR) == without + end, f"{sets:x}"
        alone = numbers(lockstep, sets, BX_LR)
        assert alone[:-1] != without, f"{sets:x}: the end of the block sees them"
        for sees in (MRS, LDR, MSR):
            seen = numbers(lockstep, sets, sees, CMP, BX_LR)
            assert seen[: len(alone) - 1] == alone[:-1], f"{sets:x}: {sees:x} sees them"
        skipped = numbers(lockstep, sets, IT_NE, 0x3001, CMP, BX_LR)
        assert skipped[: len(alone) - 1] == alone[:-1], f"{sets:x}: a condition sees them"


def test_what_only_sets_flags_that_nobody_sees_is_taken_out(lockstep: Lockstep) -> None:
    end = numbers(lockstep, CMP, BX_LR)
    for word in ONLY_FLAGS:
        alone = numbers(lockstep, word, BX_LR)[:-1]
        is_shifted = word >> 27 == 0x1D and word & 0x70F0 != 0
        left = numbers(lockstep, word, CMP, BX_LR)
        assert left[-2:] == end, f"{word:x}"
        assert len(left) == 2 + is_shifted, f"{word:x}: but a shift stays"
        assert numbers(lockstep, word, IT_NE, 0x3001, CMP, BX_LR)[: len(alone)] == alone, f"{word:x}: IT NE sees them"


@pytest.mark.parametrize(("word", "reads_carry"), [(0xEB41_0003, True), (0xEB61_0003, True), (0xEA4F_0033, True),
                                                   (0xEB01_0003, False), (0xEA4F_0073, False)])  # fmt: skip
def test_a_carry_that_is_read_is_set_before(lockstep: Lockstep, word: int, *, reads_carry: bool) -> None:
    """ADC, SBC and RRX read C; ADD and ROR do not: ADDS R0, R1 and LSRS R0, R1, #2, then it, and CMP."""
    for sets in (0x1840, 0x0888):
        alone, without = numbers(lockstep, sets, BX_LR)[0], numbers(lockstep, sets, CMP, BX_LR)[0]
        assert numbers(lockstep, sets, word, CMP, BX_LR)[0] == (alone if reads_carry else without)


def test_what_was_done_last_is_not_read_again(lockstep: Lockstep) -> None:
    """The code is another where R1 is what the instruction before has made, by either operand, and only then."""
    # ADDS R1, R2, #1; MOV R1, R2; LDR R1, [R2]; UXTB R1, R2; MOVS R1, #1; LDRSB, LDRSH R1, [R2, R1]; LDR R1, label
    # of 16 and 32 bits; USAT R1, #5, R2; BFI R1, R2; MLS R1
    makes = (0x1C51, 0x4611, 0x6811, 0xB2D1, 0x5651, 0x5E51, 0x4900, 0xF8DF_1004, 0xF382_0105, 0xF362_0143, 0xFB02_2112)
    # CMP R1, #0; TST R1, R2; ADD SP, #4; STR R1; MRS R1; TST, CMN R1, #5; CMN R1, R2; SMULL, UMLAL R1, R3, R2, R2;
    # LDRD R1, R3, [R2]; LDREX R1; SDIV R1, R2, R2; MSR; CPSIE i
    makes_not = (
        0x2900, 0x4211, 0xB001, 0x6011, 0xF3EF_8110, 0xF011_0F05, 0xF111_0F05, 0x42D1, 0xFB82_1302, 0xFBE2_1302,
        0xE9D2_1300, 0xE852_1F00, 0xFB92_F1F2,
    )  # fmt: skip
    reads = (0x6808, 0x4408, 0x4608, 0xEA01_0003, 0xEA03_0001)  # LDR R0, [R1]; ADD R0, R1; MOV R0, R1; AND R0, R1, R3
    for second in reads:
        number, code = made_of(lockstep, second, BX_LR)[0]
        assert code == number
        for first in makes:
            assert made_of(lockstep, first, second, BX_LR)[1][0] == number
            assert made_of(lockstep, first, second, BX_LR)[1][1] != number, f"{first:x} {second:x}"
            of_r5 = first + 4 * (0x1000 if first >> 20 == 0xF8D else 0x100 if first >> 16 or first == 0x4900 else 1)
            assert made_of(lockstep, of_r5, second, BX_LR)[1][1] == number, f"of R5: {first:x} {second:x}"
        for first in makes_not:
            assert made_of(lockstep, first, second, BX_LR)[1] == (number, number), f"{first:x} {second:x}"
    by_n, by_m = (made_of(lockstep, 0x4611, word, BX_LR)[1][1] for word in (0xEA01_0003, 0xEA03_0001))
    assert by_n != by_m
    skipped = made_of(lockstep, IT_NE, 0x3101, 0x4408, BX_LR)  # ADDNE R1, #1; ADD R0, R1
    assert skipped[2][0] == skipped[2][1], "what may be skipped has made nothing"


def test_a_sequence_is_one_code_and_the_longest_that_there_is(lockstep: Lockstep) -> None:
    """LDRB R0, [R1]; ADDS R1, #1 has one; STR, STR, STR three in one, and of a fourth it is begun anew."""
    store = 0x6008
    three = made_of(lockstep, store, store, store, BX_LR)
    two = made_of(lockstep, store, store, BX_LR)
    one = made_of(lockstep, store, BX_LR)
    assert one[0][0] == one[0][1]
    assert len({one[0][1], two[0][1], three[0][1]}) == 3
    assert two[1] == one[0]
    assert three[1:] == two
    assert made_of(lockstep, store, store, store, store, BX_LR)[1:] == three
    branch = made_of(lockstep, 0x3001, 0x2905, 0xD0F0)  # ADDS R0, #1; CMP R1, #5; BEQ
    assert branch[-2][1] != branch[-2][0]
    assert branch[-1][1] == branch[-1][0]


#: What the sequences are made of, by R0 to R3 alone, so that each reads what the one before has made.
OFTEN = tuple(
    row
    for row in (*NARROW, *WIDE)
    if row.operation in {
        "ADD_R3", "SUB_R3", "ADD_I3", "SUB_I3", "ADD_I8", "SUB_I8", "CMP_I8", "MOV_I8", "LSL_T1", "LSR_T1", "ASR_T1",
        "AND_T1", "EOR_T1", "ORR_T1", "BIC_T1", "ADC_T1", "SBC_T1", "TST_T1", "CMP_T1", "MUL_T1", "MVN_T1", "RSB_T1",
        "LSL_RT1", "LSR_RT1", "ASR_RT1", "ROR_RT1", "UXTB_T1", "UXTH_T1", "SXTB_T1", "SXTH_T1", "LDR_I5", "LDRB_I5",
        "LDRH_I5", "STR_I5", "STRB_I5", "STRH_I5", "LDR_LITERAL_T1", "MOV_T1", "ADD_R", "SUB_R", "AND_R", "EOR_R",
        "ORR_R", "BIC_R", "RSB_R", "ADC_R", "SBC_R", "MOV_R", "MVN_R", "TST_R", "CMP_R", "UBFX", "SBFX", "MLA",
        "AND_I", "EOR_I", "ADD_I", "SUB_I", "TST_I", "CMP_I", "BIC_I", "RSB_I", "ORR_I", "MOV_I",
    }
)  # fmt: skip


def word_of_few(dice: random.Random) -> int:
    """Return one of `OFTEN` with registers R0 to R3, and a shift or a place in memory that is often at a bound."""
    row = dice.choice(OFTEN)
    bits = 32 if row.is_wide else 16
    word = row.value | dice.getrandbits(bits) & ~row.mask & (1 << bits) - 1
    for letter, runs in row.fields.items():
        for low, count in runs:
            if letter in "dnmta" and count >= 3:
                word = word & ~(((1 << count) - 1) << low) | dice.randrange(4) << low
            elif letter in "dh" and count == 1:
                word &= ~(1 << low)
            elif letter == "i" and row.is_wide and "m" in row.fields and dice.random() < 0.5:
                word &= ~(((1 << count) - 1) << low)  # by 0, or by 32
    return word


@pytest.mark.parametrize("count", [1_500, pytest.param(10_000, marks=pytest.mark.soak)])
def test_what_reads_what_was_done_last_does_what_it_does_on_unicorn(lockstep: Lockstep, count: int) -> None:
    dice = random.Random(40)
    cases = []
    for _ in range(count):
        registers = [any_value(dice) for _ in range(13)]
        registers[dice.randrange(4)] = 0x2000_0400 + 4 * dice.randrange(64)
        words = tuple(word_of_few(dice) for _ in range(8))
        cases.append(Case(words, (*registers, 0x2000_0800, 0), flags_of(dice), dice.getrandbits(4)))
    assert_same(lockstep, cases)
