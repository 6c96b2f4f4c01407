"""`P2OS_CORE=exact`: an LDM, STM, PUSH or POP that an exception interrupts goes on behind it with the next word.

Sources: TRM r2p0 3.9.1 (which ones go on, and which begin anew), ARM B1.4.2 and PM0056 2.1.3 (EPSR.ICI: the next
register in bits 15:12, the others 0). Each vector is derived by hand, at 0 wait states: four words take 1 + 4 cycles
(TRM r1p1, 18.2); where `behind` cycles of them have gone when SysTick comes, `behind` - 1 words have been moved, and
the rest takes 1 and one each. The handler writes down what it finds, and puts 9 into the four words unless they may be
in its frame.
"""

import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from tests.bluepill_sim.machine import COUNTER_ON, FLASH, STACK, Machine

Boot = Callable[..., Machine]
SYSTICK, CYCLE_NS, FRAME_BYTES = 15, 125, 32
WORDS, PORT_A = 0x2000_0800, 0x4001_0800
ICI_BITS = 0x0600_FC00
#: At the first, second and third instruction of ITTTT AL, ITSTATE ends in 001, 010, 100: its bits 1:0 are at 26:25.
FOUR_IN_IT = (0xE000 | 1 << 25, 0xE000 | 1 << 26, 0xE000 | 1 << 10)


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """A transfer of four words."""

    name: str
    code: str
    is_load: bool
    #: Its registers; R8 to R11 hold 0x58 on where it stores.
    registers: tuple[int, ...] = (8, 9, 10, 11)
    #: Where its words stand, its base before it, and after it.
    at: int = WORDS
    base: int = WORDS
    after: int = WORDS
    #: Words that are moved before an exception, at most.
    most: int = 4


CASES = (
    Moved(name="ldmia r5", code=".half 0xE895, 0x0F00", is_load=True),
    Moved(name="ldmia r5!", code=".half 0xE8B5, 0x0F00", is_load=True, after=WORDS + 16),
    Moved(name="ldmdb r5!", code=".half 0xE935, 0x0F00", is_load=True, base=WORDS + 16),
    Moved(name="ldmdb r5", code=".half 0xE915, 0x0F00", is_load=True, base=WORDS + 16, after=WORDS + 16),
    Moved(name="stmia r5", code=".half 0xE885, 0x0F00", is_load=False),
    Moved(name="stmia r5!", code=".half 0xE8A5, 0x0F00", is_load=False, after=WORDS + 16),
    Moved(name="stmdb r5!", code=".half 0xE925, 0x0F00", is_load=False, base=WORDS + 16),
    Moved(name="push", code=".half 0xE92D, 0x0F00", is_load=False, at=STACK - 16, base=STACK, after=STACK - 16),
    Moved(name="pop", code=".half 0xE8BD, 0x0F00", is_load=True, at=STACK - 16, base=STACK - 16, after=STACK),
    # "If an LDM has completed a base load, it is continued from before the base load."
    Moved(name="ldmia r5, of r5", code=".half 0xE895, 0x0330", is_load=True, registers=(4, 5, 8, 9), after=2, most=1),
    Moved(name="ldmia r3, of r3", code=".half 0xE893, 0x0708", is_load=True, registers=(3, 8, 9, 10), after=1, most=0),
    # Inside an IT block it begins anew.
    Moved(name="it eq, ldmia r5", code=".half 0xE895, 0x0F00", is_load=True, most=0),
    Moved(name="it al, ldmia r5", code=".half 0xE895, 0x0F00", is_load=True, most=0),
    Moved(name="itttt al, ldmia r5", code=".half 0xE895, 0x0F00", is_load=True, most=0),
    # chosen: a 16-bit STM with its base in the list, and what reaches for no memory, begin anew.
    Moved(name="stmia r5!, of r5", code=".half 0xC560", is_load=False, registers=(5, 6), after=WORDS + 8, most=0),
)
NAMES = {case.name: case for case in CASES}

PROGRAM = """
mov32 r6, #{sp}
mov sp, r6
mov32 r4, #{at}
movs r0, #1
str r0, [r4, #0]
movs r0, #2
str r0, [r4, #4]
movs r0, #3
str r0, [r4, #8]
movs r0, #4
str r0, [r4, #12]
movs r0, #0x58
mov r8, r0
movs r0, #0x59
mov r9, r0
movs r0, #0x5A
mov r10, r0
movs r0, #0x5B
mov r11, r0
mov32 r5, #{base}
mov r3, r5
mov32 r1, #0xE000E010
movs r2, #{load}
str r2, [r1, #4]
movs r2, #7
cmp r2, #7
str r2, [r1, #0]
nop
{it}
here: {code}
next: nop
movs r2, #1
mov32 r6, #0xE0001000
ldr r0, [r6, #4]
log r0
b stop
tick: ldr r0, [sp, #24]
log r0
ldr r0, [sp, #28]
log r0
mov r0, sp
log r0
mov r0, r5
log r0
mov32 r2, #{at}
ldr r0, [r2, #0]
log r0
ldr r0, [r2, #4]
log r0
ldr r0, [r2, #8]
log r0
ldr r0, [r2, #12]
log r0
{put}
mov32 r1, #0xE000E010
movs r0, #0
str r0, [r1, #0]
mov32 r1, #0xE000ED04
mov32 r2, #0x02000000
str r2, [r1, #0]
bx lr
"""
PUTS_NINES = "movs r0, #9\nstr r0, [r2, #0]\nstr r0, [r2, #4]\nstr r0, [r2, #8]\nstr r0, [r2, #12]"


@pytest.fixture(autouse=True)
def _exact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")


def booted(boot: Boot, case: Moved, behind: int) -> Machine:
    """Return a board where SysTick comes so many cycles behind the beginning of the transfer."""
    it = case.name.partition(",")[0] if case.name.startswith("it") else ""
    put, sp = (PUTS_NINES, STACK) if case.at == WORDS else ("", case.base)
    source = PROGRAM.format(
        at=case.at, base=case.base, sp=sp, load=1 + bool(it) + behind, it=it, code=case.code, put=put
    )  # fmt: skip
    return boot(COUNTER_ON + source, {SYSTICK: "tick"})


@pytest.mark.parametrize("name", NAMES)
def test_it_goes_on_with_the_word_at_which_it_was(boot: Boot, name: str) -> None:
    case = NAMES[name]
    count, uses_sp = len(case.registers), case.at != WORDS
    ends = {}
    for behind in range(count + 3):
        machine = booted(boot, case, behind).run(40)
        pc, xpsr, sp, base, *found, end = machine.log
        is_within = 0 < behind < 1 + count
        moved = min(behind - 1, case.most) if is_within else count * (behind > 0)
        assert pc == machine.label("here" if behind < 1 + count else "next") + 2 * max(0, behind - 1 - count), behind
        # ICI is 0 where nothing has been moved: it begins anew.
        state = case.registers[moved] << 12 if is_within and moved else 0
        if name.startswith("it") and behind < 1 + count:
            state = 0xE800 if "al" in name else 0x0800  # ITSTATE 1110 1000 or 0000 1000, its bits 7:2 at 15:10
        if name.startswith("itttt"):
            state = FOUR_IN_IT[max(0, behind - count)]
        assert xpsr & ICI_BITS == state, behind
        # chosen: a base that is written back holds its new value from the first word stored, from the last word loaded.
        changed = case.after if moved == count or (moved and not case.is_load) else case.base
        assert case.registers[0] == 3 or (sp + FRAME_BYTES if uses_sp else base) == changed, behind
        if uses_sp:
            assert machine.board.register("SP") == case.after
            ends[behind] = end
            values = [machine.board.register(f"R{number}") for number in case.registers]
            assert values == ([1, 2, 3, 4] if case.is_load else [0x58, 0x59, 0x5A, 0x5B])
            words = machine.board.read_memory(case.at, 16)
            assert case.is_load or words == struct.pack("<4I", *values), behind
            assert not moved or case.is_load or found[:moved] == values[:moved]
            continue
        old, stored = [1, 2, 3, 4], [WORDS if number == 5 else 0x50 + number for number in case.registers]
        if case.is_load:
            assert found == old, behind
            values = [old[n] if n < moved or behind > count else 9 for n in range(4)]
            assert [machine.board.register(f"R{number}") for number in case.registers] == values, behind
        elif count == 4:
            assert found == [*stored[:moved], *old[moved:]], behind
            words = machine.board.read_memory(case.at, 16)
            assert words == struct.pack("<4I", *(9 if n < moved else stored[n] for n in range(4))), behind
        ends[behind] = end
        if case.registers[0] == 8:
            assert machine.board.register("R5") == case.after
    # Nothing is lost but what begins again: one cycle before the words, or all that had gone.
    lost = [min(behind, 1 + max(0, behind - 1 - case.most)) for behind in range(1 + count)]
    assert [ends[behind] - ends[0] for behind in range(count + 3)] == [*lost, 0, 0]


def test_a_pop_of_the_pc_goes_on_with_it(boot: Boot) -> None:
    """pop {r4, pc}: at R4 (nothing moved), at the PC (ICI 15), and in its refill, in which it is done."""
    source = PROGRAM.replace("str r0, [r4, #4]", "mov32 r0, #there+1\nstr r0, [r4, #4]")
    source = source.replace("next: nop", "next: udf\nthere: nop")
    for behind, state, place in ((0, 0, "here"), (1, 0, "here"), (2, 15 << 12, "here"), (3, 0, "there")):
        text = source.format(
            at=STACK - 16, base=STACK - 16, sp=STACK - 16, load=1 + behind, it="", code=".half 0xBD10", put=""
        )  # fmt: skip
        machine = boot(COUNTER_ON + text, {SYSTICK: "tick"}).run(40)
        assert machine.is_done
        assert (machine.log[0], machine.log[1] & ICI_BITS) == (machine.label(place), state), behind
        assert (machine.board.register("R4"), machine.board.register("SP")) == (1, STACK - 8)


def test_one_that_faults_behind_the_exception_begins_anew(boot: Boot) -> None:
    """Two words are there, and behind them ends the SRAM: the fault has no ICI, and the base its old value."""
    source = """
mov32 r0, #0x20004000
mov sp, r0
mov32 r5, #0x20004FF8
mov32 r1, #0xE000E010
movs r2, #4
str r2, [r1, #4]
movs r2, #7
str r2, [r1, #0]
nop
here: .half 0xE8B5, 0x0F00
b stop
tick: ldr r0, [sp, #28]
log r0
mov32 r1, #0xE000E010
movs r0, #0
str r0, [r1, #0]
mov32 r1, #0xE000ED04
mov32 r2, #0x02000000
str r2, [r1, #0]
bx lr
fault: ldr r0, [sp, #24]
log r0
ldr r0, [sp, #28]
log r0
mov r0, r5
log r0
b stop
"""
    machine = boot(source, {SYSTICK: "tick", 3: "fault"}).run(40)
    ticked, pc, faulted, base = machine.log
    assert ticked & ICI_BITS == 10 << 12
    assert (pc, faulted & ICI_BITS, base) == (machine.label("here"), 0, 0x2000_4FF8)


def test_words_of_the_flash_are_moved_one_by_one(boot: Boot) -> None:
    """The first four vectors; two are moved in three cycles."""
    source = PROGRAM.format(at=WORDS, base=FLASH, sp=STACK, load=4, it="", code=".half 0xE895, 0x0F00", put="")
    machine = boot(COUNTER_ON + source, {SYSTICK: "tick"}).run(40)
    assert (machine.log[0], machine.log[1] & ICI_BITS) == (machine.label("here"), 10 << 12)
    vectors = struct.unpack("<4I", machine.board.read_memory(FLASH, 16) or b"")
    assert tuple(machine.board.register(f"R{n}") for n in range(8, 12)) == vectors


def test_words_of_a_peripheral_are_moved_all_or_none(boot: Boot) -> None:
    case = Moved(name="port", code=".half 0xE895, 0x0F00", is_load=True, base=PORT_A, after=PORT_A, most=0)
    machine = booted(boot, case, 4).run(40)
    assert (machine.log[0], machine.log[1] & ICI_BITS) == (machine.label("here"), 0)


def test_what_is_no_transfer_takes_no_notice_of_ici(boot: Boot) -> None:
    """A handler writes ICI itself: R9, R8, and R7, which is not loaded, of `ldmia r5, {r8-r11}`; and for a nop."""
    for place, number, loaded in (("here", 9, [0x58, 2, 3, 4]), ("here", 8, [1, 2, 3, 4]), ("here", 7, [1, 2, 3, 4]),
                                  ("next", 9, [0x58, 0x59, 0x5A, 0x5B])):  # fmt: skip
        source = PROGRAM.format(
            at=WORDS, base=WORDS, sp=STACK, load=200, it="", code=".half 0xE895, 0x0F00", put=""
        ).replace("here:", "svc #0\nhere:")  # fmt: skip
        source += (
            f"call: mov32 r0, #{place}\nstr r0, [sp, #24]\nmov32 r0, #{number << 12 | 1 << 24}\n"
            "str r0, [sp, #28]\nbx lr\n"
        )
        machine = boot(COUNTER_ON + source, {SYSTICK: "tick", 11: "call"}).run(20)
        assert [machine.board.register(f"R{n}") for n in range(8, 12)] == loaded, (place, number)


#: SysTick's handler sets it going again, so that it comes `ahead` cycles behind the return, `R12` times in all.
AGAIN = """
movs r4, #{times}
mov32 r6, #0xE000E010
movs r2, #3
str r2, [r6, #4]
movs r2, #7
str r2, [r6, #0]
here: .half 0xE895, 0x1F0F
next: nop
nop
nop
nop
nop
nop
log r0
b stop
tick: ldr r0, [sp, #28]
log r0
movs r0, #0
str r0, [r6, #0]
mov32 r1, #0xE000ED04
mov32 r2, #0x02000000
str r2, [r1, #0]
subs r4, #1
beq last
movs r0, #{load}
str r0, [r6, #4]
str r0, [r6, #8]
movs r0, #7
str r0, [r6, #0]
last: bx lr
"""


def again(boot: Boot, times: int, load: int) -> Machine:
    """Return a board that loads R0 to R3 and R8 to R12 from nine words, 1 to 9."""
    words = "".join(f"movs r0, #{n + 1}\nstr r0, [r5, #{4 * n}]\n" for n in range(9))
    return boot("mov32 r5, #0x20000800\n" + words + AGAIN.format(times=times, load=load), {SYSTICK: "tick"})


def test_it_may_be_interrupted_again(boot: Boot) -> None:
    """The first tick comes three cycles behind its beginning: two words are moved, and R2 is next.

    From the store that sets SysTick going again to the tick: `load` + 1 cycles; the store takes 1, bx lr 1 (its refill
    is the return's), the return 12. So the tick comes `load` - 13 cycles behind what goes on, in 1 + 7.
    """
    following = (2, 3, 8, 9, 10, 11, 12)
    for load in range(12, 24):
        behind = load - 13
        last = 0 if behind >= 8 else following[max(0, behind - 1)]
        machine = again(boot, 2, load).run(60)
        assert [word & ICI_BITS for word in machine.log[:2]] == [2 << 12, last << 12], load
        assert values_of(machine) == list(range(1, 10))


def values_of(machine: Machine) -> list[int]:
    """Return what it has loaded; R0 is logged, R1 to R3 are the handler's no more."""
    return [machine.log[-1], *(machine.board.register(f"R{n}") for n in (1, 2, 3, 8, 9, 10, 11, 12))]


@pytest.mark.parametrize("way", ["whole", "cut", "restored"])
def test_a_word_at_a_time_however_the_run_is_cut(boot: Boot, way: str) -> None:
    machine, end_ns = again(boot, 8, 15), 70_000
    for cycle in range(0 if way == "whole" else 30, 0 if way == "whole" else 500):
        machine.board.advance_to(cycle * CYCLE_NS)
        if way == "restored" and not cycle % 23:
            other = again(boot, 8, 15)
            other.board.restore(machine.board.snapshot())
            machine = other
    machine.board.advance_to(end_ns)
    assert machine.is_done
    assert [word >> 12 & 15 for word in machine.log[:8]] == [2, 3, 8, 9, 10, 11, 12, 0]
    assert values_of(machine) == list(range(1, 10))
    assert machine.board.last_rows[-1] == again(boot, 8, 15).run(70).board.last_rows[-1]


#: R0 to R12 and memory hold known words; LR and the base R5, R6 or SP stand in the middle of them.
ANY = """
mov32 r1, #0xE000E010
movs r2, #{load}
str r2, [r1, #4]
mov32 r5, #0x20000880
mov32 r6, #0x200008C0
mov32 r0, #0x20004F00
mov sp, r0
mov32 r0, #there+1
mov lr, r0
mov r12, r5
movs r3, #33
movs r4, #44
mov r8, r3
mov r9, r4
mov r10, r5
mov r11, r6
movs r0, #11
movs r2, #7
str r2, [r1, #0]
nop
.half {first}, {second}
there: nop
nop
b stop
tick: mov32 r1, #0xE000E010
movs r0, #0
str r0, [r1, #0]
bx lr
"""


def transfers(dice: random.Random, count: int) -> Iterator[tuple[int, int]]:
    """Yield any LDM, STM, PUSH and POP of ARMv7-M that the manual does not leave open, PC and SP in no list."""
    for _ in range(count):
        kind, base = dice.randrange(4), dice.choice((5, 6))
        low, wide = dice.getrandbits(8) or 1, dice.getrandbits(13) | 0x1001
        yield (
            (dice.choice((0xC000, 0xC800)) | base << 8 | low, 0xBF00),
            (dice.choice((0xB400, 0xBC00)) | low, 0xBF00),
            (dice.choice((0xE880, 0xE890, 0xE900, 0xE910)) | base, wide | dice.getrandbits(1) << 14),
            (dice.choice((0xE8A0, 0xE8B0, 0xE920, 0xE930)) | base, wide & ~(1 << base)),
        )[kind]


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_nothing_is_lost_of_any_transfer_wherever_it_is_interrupted(boot: Boot, count: int) -> None:
    """The handler changes nothing: registers and memory are those of a run in which it comes later."""
    dice = random.Random(count)
    for first, second in transfers(dice, count):
        ends = []
        for load in (40, *dice.sample(range(1, 18), 4)):
            machine = boot(ANY.format(load=load, first=first, second=second), {SYSTICK: "tick"})
            board = machine.board
            board.chip.memory.write(WORDS, bytes(n & 0xFC for n in range(0x200)))
            board.chip.memory.write(STACK - 0x100, bytes(n | 1 for n in range(0x100)))
            machine.run(30)
            assert machine.is_done, (hex(first), hex(second), load)
            registers = [board.register(f"R{n}") for n in range(13)] + [board.register("SP"), board.register("LR")]
            ends.append((registers, board.read_memory(WORDS, 0x200)))
        assert ends == ends[:1] * len(ends), (hex(first), hex(second))


@pytest.mark.parametrize("pad", range(4))
def test_a_load_of_r0_alone_begins_anew_however_long_the_next_fetch_takes(boot: Boot, pad: int) -> None:
    """At 2 wait states it has cycles left when its only word is there: that is never moved before the exception."""
    waits = "mov32 r6, #0x40022000\nmovs r0, #2\nstr r0, [r6, #0]\n"
    is_within = 0
    for behind in range(3, 10):
        source = PROGRAM.format(
            at=WORDS, base=WORDS, sp=STACK, load=1 + behind, it="nop\n" * pad, code=".half 0xCD01\nmov r8, r0", put=""
        )  # fmt: skip
        machine = boot(COUNTER_ON + waits + source, {SYSTICK: "tick"}).run(60)
        pc, xpsr, _, base, *_ = machine.log
        assert xpsr & 0x0EFF_FE00 == 0, "neither ICI nor what is no bit of it"
        assert base == WORDS + 4 * (pc > machine.label("here")), behind
        assert (machine.board.register("R8"), machine.board.register("R5")) == (1, WORDS + 4), behind
        is_within += pc == machine.label("here")
    assert is_within
