"""An exception that comes while another one's frame is written: whose handler starts, and when; on both cores."""

from collections.abc import Callable
from typing import Any

import pytest

from tests.bluepill_sim.machine import COUNTER_ON

TAIL_CHAIN = 6
#: Cycles of the tick's handler: a load, 13 of one cycle (mov32 are two), the branch.
HANDLER = 16
SYSTICK, SHPR2, SHPR3, SVCALL, TICK = 0xE000_E010, 0xE000_ED1C, 0xE000_ED20, 11, 15


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


#: Each handler logs its number and the cycle counter, whose address is in r6; SysTick ticks once.
SOURCE = """
mov32 r6, #0xE0001000
mov32 r1, #0xE000E010
movs r2, #0
str r2, [r1, #8]
movs r2, #7
movs r3, #0
str r2, [r1, #0]
ldr r4, [r6, #4]
{wait}svc #0
ldr r0, [r6, #4]
str r0, [r7, #0]
adds r7, #4
b stop
call: ldr r0, [r6, #4]
movs r1, #1
b put
tick: ldr r0, [r6, #4]
movs r1, #2
mov32 r3, #0xE000E010
movs r2, #0
str r2, [r3, #0]
mov32 r3, #0xE000ED04
mov32 r2, #0x02000000
str r2, [r3, #0]
put: str r1, [r7, #0]
str r0, [r7, #4]
adds r7, #8
bx lr
"""


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


def play(make: Any, load: int, *, tick_priority: int, call_priority: int) -> list[tuple[int, int]]:
    """Return (1 for SVC or 2 for SysTick, cycle counter) of each handler; the tick comes `load` + 1 cycles on."""
    machine = make(
        COUNTER_ON + store(SHPR2, call_priority << 24) + store(SHPR3, tick_priority << 24) + store(SYSTICK + 4, load)
        + SOURCE.format(wait="nop\n" * 8), {SVCALL: "call", TICK: "tick"},
    ).run(300)  # fmt: skip
    log = machine.log
    return list(zip(log[:-1:2], log[1:-1:2], strict=True))


def test_a_tick_of_higher_priority_that_comes_during_the_entry_of_svc_is_served_first(make: Any) -> None:
    """The SVC's frame is written from 12 cycles after the counter's start on, for 12 cycles."""
    calls = {load: play(make, load, tick_priority=0x10, call_priority=0x80) for load in range(12, 30)}
    alone = play(make, 5000, tick_priority=0x10, call_priority=0x80)
    assert [kind for kind, _ in alone] == [1]
    late = [load for load, rows in calls.items() if rows[0] == (2, alone[0][1])]
    assert late == list(range(12, 24)), "it starts when the SVC's handler would have"
    assert all(calls[load][0][1] == alone[0][1] or calls[load][0][0] == 2 for load in range(24, 30))
    again = {calls[load][1] for load in late}
    assert len(again) == 1
    ((kind, at),) = again
    assert (kind, at - alone[0][1]) == (1, HANDLER + TAIL_CHAIN), "no second frame"


@pytest.mark.parametrize("tick_priority", [0x80, 0x90])
def test_a_tick_of_the_same_or_a_lower_priority_waits(make: Any, tick_priority: int) -> None:
    alone = play(make, 5000, tick_priority=tick_priority, call_priority=0x80)[0]
    rows = [play(make, load, tick_priority=tick_priority, call_priority=0x80) for load in range(18, 30)]
    assert {tuple(kind for kind, _ in row[:2]) for row in rows} <= {(1, 2), (2, 1)}
    assert any(row[0] == alone and row[1][0] == 2 for row in rows)
    assert not any(row[0] == (2, alone[1]) for row in rows)
