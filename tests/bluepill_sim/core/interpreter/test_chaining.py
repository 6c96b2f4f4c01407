"""`P2OS_CORE=exact`: late arrival, tail-chaining, and returns that are given up, to the cycle.

Each vector is derived by hand: entry 12 cycles, return 12, tail-chain 6 (TRM r1p1 5.6 to 5.8, ARM B1.5.9). A handler
logs the cycle at which it begins; LDR, mov32 and B cost 2 there, all others 1. The refill of `bx lr` is the return's.
"""

from collections.abc import Callable
from operator import itemgetter

import pytest

from tests.bluepill_sim.machine import COUNTER_ON, Machine

Boot = Callable[..., Machine]
SVCALL, PENDSV, SYSTICK = 11, 14, 15
#: From a handler's start up to its return, of those below.
PEND_BODY, TICK_BODY = 9, 14


@pytest.fixture(autouse=True)
def _exact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")


#: SysTick comes `load` + 1 cycles behind the start S of the last store; SVC's handler begins at S + 1 + 1 + 12.
CHAINED = (
    """
mov32 r6, #0xE0001000
mov32 r4, #0xE000ED04
mov32 r5, #0x10000000
mov32 r1, #0xE000ED1C
mov32 r2, #0x80000000
str r2, [r1, #0]
mov32 r2, #{priorities}
str r2, [r1, #4]
mov32 r1, #0xE000ED00
mov32 r2, #{grouping}
str r2, [r1, #12]
mov32 r1, #0xE000E010
movs r2, #{load}
str r2, [r1, #4]
movs r2, #7
str r2, [r1, #0]
{does}
"""
    + "nop\n" * 8
    + """b stop
call: {call}
bx lr
pend: ldr r0, [r6, #4]
movs r3, #14
b put
tick: ldr r0, [r6, #4]
movs r3, #15
mov32 r1, #0xE000E010
movs r2, #0
str r2, [r1, #0]
mov32 r2, #0x02000000
str r2, [r4, #0]
put: str r3, [r7, #0]
str r0, [r7, #4]
adds r7, #8
bx lr
"""
)


def chained(
    boot: Boot, load: int, *, tick: int, call: str = "nop", does: str = "svc #0", grouping: int = 0
) -> list[tuple[int, int]]:
    """Return (exception, when its handler began) of PendSV and SysTick, the earlier one first.

    Args:
        load: SysTick's, so that it comes `load` + 1 cycles behind S.
        tick: its priority; PendSV's is 0xC0, SVC's 0x80.
        call: what SVC's handler does.
        does: what stands behind the store, at S + 1.
        grouping: PRIGROUP.
    """
    source = COUNTER_ON + CHAINED.format(
        priorities=tick << 24 | 0xC0 << 16, load=load, call=call, does=does, grouping=0x05FA_0000 | grouping << 8
    )  # fmt: skip
    log = boot(source, {SVCALL: "call", PENDSV: "pend", SYSTICK: "tick"}).run(40).log
    return sorted(zip(log[::2], log[1::2], strict=True), key=itemgetter(1))


def test_an_exception_that_comes_while_the_frame_is_read_is_chained_at_once(boot: Boot) -> None:
    """Two nops, bx lr: the return begins at S + 17, and is over twelve cycles later."""
    begins = {load: chained(boot, load, tick=0xC0, call="nop\nnop")[0][1] for load in range(10, 31)}
    first = begins[10]  # 6 behind the return
    assert [begins[load] - first for load in range(10, 17)] == [0] * 7
    assert [begins[load] - first for load in range(17, 28)] == list(range(1, 12)), "6 behind its arrival"
    assert [begins[load] - first for load in (28, 29, 30)] == [18, 19, 20], "the thread has gone on: a new frame, 12"


def test_an_exception_of_higher_priority_that_comes_in_a_tail_chain_is_served_first(boot: Boot) -> None:
    """str, bx lr: the return begins at S + 16; PendSV's handler, or what is late, six cycles on."""
    rows = {load: chained(boot, load, tick=0x10, call="str r5, [r4, #0]") for load in range(15, 24)}
    first = rows[15][0][1]
    assert [row[0] for row in rows.values()] == [(SYSTICK, first)] * 7 + [(PENDSV, first)] * 2
    # PendSV's handler has begun its load of two cycles: a frame of 12 behind that.
    assert [rows[load][1] for load in (22, 23)] == [(SYSTICK, first + 2 + 12)] * 2


def test_a_late_one_of_higher_priority_starts_in_the_place_of_the_one_that_is_entered(boot: Boot) -> None:
    """The store at S + 1 makes PendSV pending; its entry begins at S + 2, and a handler at T = S + 14."""
    rows = {load: chained(boot, load, tick=0x10, does="str r5, [r4, #0]") for load in range(1, 17)}
    start = rows[1][0][1]
    # From the first cycle of the entry up to the start of the handler; one frame, and then PendSV's by tail-chaining.
    for load in range(1, 14):
        assert rows[load] == [(SYSTICK, start), (PENDSV, start + TICK_BODY + 6)], load
    # PendSV's has begun: its load of two cycles is done, and a frame of 12 comes.
    assert rows[14] == rows[15] == [(PENDSV, start), (SYSTICK, start + 2 + 12)]
    assert rows[16] == [(PENDSV, start), (SYSTICK, start + 3 + 12)]


def test_one_that_comes_before_the_entry_is_not_late(boot: Boot) -> None:
    """Two nops, and the store at S + 3: in front of it, and right behind it."""
    before, behind = (chained(boot, load, tick=0x10, does="nop\nnop\nstr r5, [r4, #0]") for load in (2, 3))
    start = before[0][1]  # S + 3 + 12
    assert before == [(SYSTICK, start), (PENDSV, start + TICK_BODY + 12 + 1 + 12)], "the store is made behind it"
    assert behind == [(SYSTICK, start + 1), (PENDSV, start + 1 + TICK_BODY + 6)]


@pytest.mark.parametrize(
    ("tick", "grouping"), [(0xC0, 0), (0xD0, 0), (0x10, 7), (0x80, 6)],
    ids=["of equal priority", "of a lower one", "one group for all", "of one group, and a higher one in it"],
)  # fmt: skip
def test_one_that_may_not_preempt_is_never_late(boot: Boot, tick: int, grouping: int) -> None:
    """With PRIGROUP 6, 0xC0 and 0x80 are one group: bit 7 alone."""
    for load in (2, 7, 13, 14):
        rows = chained(boot, load, tick=tick, does="str r5, [r4, #0]", grouping=grouping)
        assert [row[0] for row in rows] == [PENDSV, SYSTICK], load
        assert rows[1][1] - rows[0][1] == PEND_BODY + 6, load


def test_one_that_may_not_preempt_waits_behind_the_chained_one(boot: Boot) -> None:
    """PendSV is chained at S + 16; SysTick of its priority comes before, within, and at the end of the six cycles."""
    for load in (15, 16, 20, 21, 22):
        rows = chained(boot, load, tick=0xC0, call="str r5, [r4, #0]")
        assert [row[0] for row in rows] == [PENDSV, SYSTICK], load
        assert rows[1][1] - rows[0][1] == PEND_BODY + 6, load


def test_what_is_left_undone_is_left_once_for_the_late_one_too(boot: Boot) -> None:
    """SysTick (0xC0, below PendSV's here) comes in a division of seven cycles, and SVC in none: one frame for both."""
    rows = {load: chained(boot, load, tick=0x10, does="udiv r0, r4, r5\nstr r5, [r4, #0]") for load in range(1, 11)}
    start = rows[1][0][1]  # S + 2, one cycle into the division, and 12
    for load in range(1, 7):
        # The division, left after `load` cycles, begins anew behind the return: 7, the store 1, PendSV's entry 12.
        came = start + load - 1
        assert rows[load] == [(SYSTICK, came), (PENDSV, came + TICK_BODY + 12 + 7 + 1 + 12)], load
    assert rows[7] == [(SYSTICK, start + 6), (PENDSV, start + 6 + TICK_BODY + 12 + 1 + 12)], "behind it: it is done"
    assert rows[8] == [(SYSTICK, start + 7), (PENDSV, start + 7 + TICK_BODY + 6)], "late: the store is done"
