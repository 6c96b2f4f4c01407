"""Small kernels with cycle counts derived by hand, measured by the program itself with CYCCNT.

Each count follows from the Cortex-M3 TRM r1p1, table 18-1, at 0 wait states
(the chip runs from HSI after reset). Notation of the derivations:

    P     refill of the pipeline: 1 for a branch whose target stands in the instruction, 2 for BX and
          writes of the PC by MOV, 3 for a PC that is loaded
    L     a load: 2; 1 for the second and further of loads in a row (they overlap)
    M     LDM, STM, PUSH, POP: 1 + registers
"""

import pytest

DEMCR, DWT_CTRL, DWT_CYCCNT = 0xE000EDFC, 0xE0001000, 0xE0001004
DATA = 0x2000_0800

#: Sets the counter going; R6 is its address from here on.
START = (
    f"mov32 r1, #{DEMCR}\nmov32 r2, #{1 << 24}\nstr r2, [r1, #0]\n"
    f"mov32 r1, #{DWT_CTRL}\nmovs r2, #1\nstr r2, [r1, #0]\nmov32 r6, #{DWT_CYCCNT}\n"
)
#: Name, set-up, kernel, subroutines, cycles.
KERNELS = [
    # 1 each.
    ("nops", "", "nop\n" * 10, "", 10),
    # 1000 x (1 + 1 + P), the last branch falls through: -P.
    ("delay loop", "mov32 r4, #1000", "k: subs r4, #1\nbne k", "", 1000 * 3 - 1),
    # movs 1; 100 x (nop 1 + subs 1 + bne 1 + P) - P.
    ("delay loop with a nop", "", "movs r4, #100\nk: nop\nsubs r4, #1\nbne k", "", 1 + 100 * 4 - 1),
    # 10 x (5 x (1 + 1 + P) - P + movs 1 + subs 1 + bne 1 + P) - P.
    ("nested loops", "movs r5, #10", "o: movs r4, #5\nk: subs r4, #1\nbne k\nsubs r5, #1\nbne o", "",
     10 * (5 * 3 - 1 + 4) - 1),
    # 64 x (ldrb 2 + strb indexed 1 (behind a load that its address does not need) + subs 1 + bne 1 + P) - P.
    ("copy bytes, indexed", f"mov32 r1, #{DATA}\nmov32 r2, #{DATA + 256}\nmovs r4, #64",
     "k: ldrb r3, [r1, r4]\nstrb r3, [r2, r4]\nsubs r4, #1\nbne k", "", 64 * (2 + 1 + 1 + 2) - 1),
    # 16 x (ldr 2 + str immediate 1 + adds 1 + adds 1 + subs 1 + bne 1 + P) - P.
    ("copy words", f"mov32 r1, #{DATA}\nmov32 r2, #{DATA + 256}\nmovs r4, #16",
     "k: ldr r3, [r1, #0]\nstr r3, [r2, #0]\nadds r1, #4\nadds r2, #4\nsubs r4, #1\nbne k", "",
     16 * (2 + 1 + 1 + 1 + 1 + 2) - 1),
    # movs 1; 4 x (M of 3: 4 + M of 3: 4 + subs 1 + bne 1 + P) - P.
    ("copy by LDM and STM", f"mov32 r1, #{DATA}\nmov32 r2, #{DATA + 256}",
     "movs r0, #4\nk: ldmia r1!, {r3-r5}\nstmia r2!, {r3-r5}\nsubs r0, #1\nbne k", "", 1 + 4 * (4 + 4 + 1 + 2) - 1),
    # 32 x (str 1 + adds 1 + subs 1 + bne 1 + P) - P.
    ("fill words", f"mov32 r2, #{DATA}\nmovs r4, #32\nmovs r3, #0",
     "k: str r3, [r2, #0]\nadds r2, #4\nsubs r4, #1\nbne k", "", 32 * (1 + 1 + 1 + 2) - 1),
    # Eight bytes, the last 0: 8 x (ldrb 2 + adds 1 + cmp 1 + bne 1 + P) - P.
    ("length of a string",
     f"mov32 r1, #{DATA}\nmov32 r2, #0x41414141\nstr r2, [r1, #0]\nmov32 r2, #0x414141\nstr r2, [r1, #4]",
     "k: ldrb r3, [r1, #0]\nadds r1, #1\ncmp r3, #0\nbne k", "", 8 * (2 + 1 + 1 + 2) - 1),
    # Loads in a row: 2 + 1 + 1 + 1; then 2 adds.
    ("sum of four words", f"mov32 r1, #{DATA}",
     "ldr r2, [r1, #0]\nldr r3, [r1, #4]\nldr r4, [r1, #8]\nldr r5, [r1, #12]\nadds r2, r2, r3\nadds r2, r2, r4", "",
     2 + 1 + 1 + 1 + 2),
    # A chain of pointers: each load needs the one before: 3 x 2.
    ("linked list", f"mov32 r1, #{DATA}\nstr r1, [r1, #0]", "ldr r1, [r1, #0]\nldr r1, [r1, #0]\nldr r1, [r1, #0]\nnop",
     "", 3 * 2 + 1),
    # bl 1 + P, bx 1 + P(2).
    ("empty call", "", "bl f", "f: bx lr", 1 + 1 + 1 + 2),
    # bl 1 + P; push {r4, lr} M = 3; nop 1; pop {r4, pc} M + P(3) = 6.
    ("call with a frame", "", "bl f", "f: push {r4, lr}\nnop\npop {r4, pc}", 2 + 3 + 1 + 6),
    # bl f 2, push {lr} 2, bl g 2, bx 3, pop {pc} 2 + 3.
    ("two calls deep", "", "bl f", "f: push {lr}\nbl g\npop {pc}\ng: bx lr", 2 + 2 + 2 + 3 + 5),
    # Branches to the very next instruction: 1 + P each; one that its IT skips: IT 1, B 1.
    ("branches to what comes next", "cmp r6, #0", "b k\nk: bl l\nl: nop\nit eq\nb m\nm: nop", "",
     2 + 2 + 1 + 1 + 1 + 1),
    # Not taken 1, taken 1 + P.
    ("compare and branch on zero", "movs r3, #0", "cbnz r3, k\ncbz r3, k\nnop\nk: nop", "", 1 + 2 + 1),
    # TBB 1 + the load and the addition 2 + P(3), then the case: b 1 + P. Table of two: the second case.
    ("jump table", "movs r3, #1", ".half 0xE8DF, 0xF003\n.half 0x0201\nc: b k\nd: b k\nnop\nk: nop", "", 6 + 2 + 1),
    # Dot product of 8: movs 1; 8 x (ldr 2 + ldr 1 + mla 2 + adds 1 + adds 1 + subs 1 + bne 1 + P) - P.
    ("dot product", f"mov32 r1, #{DATA}\nmov32 r2, #{DATA + 64}",
     ("movs r0, #8\nk: ldr r3, [r1, #0]\nldr r4, [r2, #0]\nmla r5, r3, r4, r5\n"
      "adds r1, #4\nadds r2, #4\nsubs r0, #1\nbne k"), "",
     1 + 8 * (2 + 1 + 2 + 1 + 1 + 1 + 2) - 1),
    # Power by squaring: 5 x (muls 1 + subs 1 + bne 1 + P) - P.
    ("multiplications", "movs r3, #3\nmovs r4, #5", "k: muls r3, r3\nsubs r4, #1\nbne k", "", 5 * 4 - 1),
    # Chosen: a division takes 7 whatever its operands (2 to 12); 3 x (7 + 1 + 1 + P) - P.
    ("divisions", "mov32 r3, #100000\nmovs r5, #3\nmovs r4, #3",
     "k: udiv r3, r3, r5\nsubs r4, #1\nbne k", "", 3 * 10 - 1),
    # Long multiplications, chosen: UMULL 4, SMLAL 5.
    ("long multiplications", "", ".half 0xFBA3, 0x4503\n.half 0xFBC3, 0x4503", "", 4 + 5),
    # Indexed stores 2 each; overlapped behind a load 1.
    ("indexed stores", f"mov32 r1, #{DATA}\nmovs r2, #4",
     "str r3, [r1, r2]\nstr r3, [r1, r2]\nldr r4, [r1, #0]\nstr r3, [r1, r2]", "", 2 + 2 + 2 + 1),
    # LDRD and STRD 1 + 2 each; LDREX and STREX 2 each.
    ("pairs and exclusives", f"mov32 r1, #{DATA}",
     "ldrd r2, r3, [r1]\nstrd r2, r3, [r1]\nldrex r2, [r1]\nstrex r3, r2, [r1]", "", 3 + 3 + 2 + 2),
    # IT 1, and both instructions, run or skipped, 1 each.
    ("conditional instructions", "movs r3, #1", "cmp r3, #1\nite eq\nmovs r4, #1\nmovs r4, #2", "", 1 + 1 + 1 + 1),
    # A literal at 0 wait states: 2 each, overlapped 1.
    ("literals", "", ".half 0x4B01\n.half 0x4C01\nb k\nnop\n.word 1\n.word 2\nk: nop", "", 2 + 1 + 2 + 1),
    # Chosen: CPS and MSR 2; MRS 1; ISB 1 and a refill of 3; DSB 1.
    ("masks and barriers", "", "cpsid i\ncpsie i\nmrs r3, primask\ndsb\nisb", "", 2 + 2 + 1 + 1 + 4),
    # SVC 1, entry 12, the handler's movs 1 and bx 1 (its refill is part of the return), return 12.
    ("supervisor call", "", "svc #0", "call: movs r3, #0\nbx lr", 1 + 12 + 1 + 1 + 12),
    # bx r3 1 + P(2), mov pc 1 + P(2).
    ("computed branches", "mov32 r3, #k+1\nmov32 r4, #m", "bx r3\nnop\nk: mov pc, r4\nnop\nm: nop", "", 3 + 3 + 1),
]  # fmt: skip


@pytest.mark.parametrize(
    ("before", "kernel", "after", "cycles"), [row[1:] for row in KERNELS], ids=[k[0] for k in KERNELS]
)
def test_a_kernel_takes_what_the_manual_says(run, before: str, kernel: str, after: str, cycles: int) -> None:
    """The counter is read by a load of 2 cycles before; an ISB and a nop keep it from overlapping."""
    source = (
        START + before + "\nmov32 r0, #0\nisb\nldr r0, [r6, #0]\nmov r8, r0\n" + kernel
        + "\nnop\nldr r6, [r6, #0]\nmov r1, r8\nsubs r0, r6, r1\nlog r0\nb stop\n" + after
    )  # fmt: skip
    machine = run(source, {11: "call"} if "call:" in after else {})
    assert machine.log == [2 + 1 + cycles + 1]


@pytest.mark.parametrize("prefetch", [0, 0x10])
@pytest.mark.parametrize("wait_states", [0, 1, 2])
def test_wait_states_never_make_a_kernel_faster(run, wait_states: int, prefetch: int) -> None:
    """A bound that holds for any prefetch buffer: between no waits at all and one wait for each line and branch."""
    rounds, halves = 50, 14
    body = "k: " + "adds r3, #1\n" * (halves - 2) + "subs r4, #1\nbne k"
    machine = run(
        START
        + f"mov32 r1, #0x40022000\nmovs r2, #{prefetch | wait_states}\nstr r2, [r1, #0]\nmovs r4, #{rounds}\nisb\n"
        f"ldr r5, [r6, #0]\n{body}\nldr r6, [r6, #0]\nsubs r0, r6, r5\nlog r0"
    )
    (cycles,) = machine.log
    without = 2 + rounds * (halves + 1) - 1
    waits = wait_states * (rounds * (halves // 4 + 2) + 2)
    assert without <= cycles <= without + waits
    assert (cycles == without) == (wait_states == 0)
