"""Loops that wait: the native core lets their time pass at once, and stands where the Python executor stands."""

import random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.stm32f103 import BASES
from tests.bluepill_sim.machine import COUNTER_ON, Machine
from tests.bluepill_sim.native.test_native_core import state

SYSTICK = 15
#: SysTick each 1000 cycles counts a word of SRAM up; port A has its clock, USART1 sends at 8 MHz / 69; the cycle
#: counter runs.
SET_UP = f"""
mov32 r0, #0x40021018
mov32 r1, #0x4004
str r1, [r0, #0]
mov32 r0, #0x40013800
movs r1, #69
str r1, [r0, #8]
mov32 r1, #0x2008
str r1, [r0, #12]
{COUNTER_ON}mov32 r0, #0xE000E014
mov32 r1, #999
str r1, [r0, #0]
movs r1, #0
str r1, [r0, #4]
mov32 r6, #0x20000800
mov32 r0, #0xE000E010
movs r1, #7
str r1, [r0, #0]
movs r5, #0
b main
tick: mov32 r0, #0x20000800
ldr r1, [r0, #0]
adds r1, #1
str r1, [r0, #0]
bx lr
main: nop
"""
#: Loops that wait for something; `@` is the number of the loop. The halfwords compare r3 with r4 and shift r3
#: (lsls #31, lsls #24, lsls #20, lsrs #9).
WAITS = {
    "a tick": "ldr r4, [r6, #0]\nb w@\nw@: ldr r3, [r6, #0]\n.half 0x42A3\nbeq w@",
    "some ticks": "ldr r4, [r6, #0]\nadds r4, #3\nb w@\nw@: ldr r3, [r6, #0]\n.half 0x42A3\nbne w@",
    "a pin": "mov32 r4, #0x40010808\nb w@\nw@: ldr r3, [r4, #0]\n.half 0x07DB\nbpl w@",
    "the cycle counter": "mov32 r4, #0xE0001004\nb w@\nw@: ldr r3, [r4, #0]\n.half 0x051B\nbpl w@",
    "a bit of the time": "mov32 r4, #0xE000E018\nb w@\nw@: ldr r3, [r4, #0]\n.half 0x0A5B\nbne w@",
    "a count": "movs r3, #200\nb w@\nw@: ldr r4, [r6, #0]\nsubs r3, #1\nbne w@",
    "room for a character": (
        "mov32 r4, #0x40013800\nstr r4, [r4, #4]\nb w@\nw@: nop\nnop\nldr r3, [r4, #0]\n.half 0x061B\nbpl w@"
    ),
    "two things": "ldr r4, [r6, #0]\nb w@\nw@: ldr r3, [r6, #0]\n.half 0x42A3\nbne x@\nb w@\nx@: nop",
    "with a store": "ldr r4, [r6, #0]\nb w@\nw@: str r3, [r6, #4]\nldr r3, [r6, #0]\n.half 0x42A3\nbeq w@",
    "a delay with a call": (
        "ldr r4, [r6, #0]\nb w@\nget@: push {r1, lr}\nldr r3, [r6, #0]\npop {r1, pc}\n"
        "w@: bl get@\nsubs r3, r3, r4\ncmp r3, #3\nbne w@"
    ),
    "a count in SRAM": "movs r3, #250\nstr r3, [r6, #8]\nb w@\nw@: ldr r3, [r6, #8]\nsubs r3, #1\nb x@\n"
    "x@: str r3, [r6, #8]\ncmp r3, #0\nbne w@",
    "a count in SRAM alone": (
        "mov32 r3, #900\nstr r3, [r6, #8]\nb w@\nw@: ldr r3, [r6, #8]\nsubs r3, #1\nstr r3, [r6, #8]\ncmp r3, #0\n"
        "beq x@\nmovs r3, #0\ncmp r3, #0\nb w@\nx@: nop"
    ),
    "a mask that toggles": (
        "ldr r4, [r6, #0]\nb w@\nw@: mrs r1, primask\nmovs r2, #1\n.half 0x4051\nmsr primask, r1\nmovs r1, #0\n"
        "movs r2, #0\nldr r3, [r6, #0]\n.half 0x42A3\nbeq w@\ncpsie i"
    ),
    "an output that toggles": (
        "ldr r4, [r6, #0]\nmov32 r2, #0x4001080C\nb w@\nw@: ldr r3, [r2, #0]\nmovs r1, #1\n.half 0x404B\n"
        "str r3, [r2, #0]\nb x@\nx@: ldr r3, [r6, #0]\n.half 0x42A3\nbeq w@"
    ),
    "a tick with the interrupts off in between": (
        "ldr r4, [r6, #0]\nb w@\nw@: cpsid i\nldr r3, [r6, #0]\ncpsie i\n.half 0x42A3\nbeq w@"
    ),
    "a pin or three ticks": (
        "ldr r2, [r6, #0]\nadds r2, #3\nmov32 r4, #0x40010808\nb w@\nw@: ldr r3, [r4, #0]\n.half 0x07DB\nbmi x@\n"
        "ldr r3, [r6, #0]\n.half 0x4293\nbne w@\nx@: nop"
    ),
    "a moving bit and a tick": (
        "ldr r2, [r6, #0]\nmov32 r4, #0xE0001004\nb w@\nw@: ldr r3, [r4, #0]\nb x@\nx@: ldr r3, [r6, #0]\n"
        ".half 0x4293\nbeq w@"
    ),
    "a lock": (
        "ldr r4, [r6, #0]\nadds r6, #4\nb w@\nw@: ldrex r3, [r6]\nstrex r2, r3, [r6]\nmov32 r1, #0x20000800\n"
        "ldr r3, [r1, #0]\n.half 0x42A3\nbeq w@\nsubs r6, #4"
    ),
}


def program(waits: list[str]) -> str:
    loops = [WAITS[name].replace("@", str(number)) + "\nadds r5, #1" for number, name in enumerate(waits)]
    return "\n".join([SET_UP, *loops, "b main"])


def make(source: str, core: str) -> BluePill:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        return Machine(source, {SYSTICK: "tick"}).deafen().board


def live(board: BluePill, seed: int, slices: int) -> list[dict[str, Any]]:
    dice = random.Random(seed)
    states = []
    for _ in range(slices):
        board.pin("PA0").drive(dice.random() < 0.5)
        board.advance_to(board.now_ns + dice.choice([1, 999, 20_000, 130_000, 700_000]))
        states.append(state(board) | {"r5": board.register("R5")})
    return states


@pytest.mark.slow
@settings(max_examples=30)
@given(waits=st.lists(st.sampled_from(sorted(WAITS)), min_size=1, max_size=4), seed=st.integers(0, 1000))
def test_every_slice_ends_alike(waits: list[str], seed: int) -> None:
    source = program(waits)
    native, python = (live(make(source, core), seed, 14) for core in ("native", "python"))
    for number, (one, other) in enumerate(zip(native, python, strict=True)):
        for name in one:
            assert one[name] == other[name], (number, name)


def test_a_flag_that_rises_within_a_round_is_seen_by_that_round() -> None:
    native, python = (live(make(program(["room for a character"]), core), 0, 14) for core in ("native", "python"))
    assert native == python


@pytest.mark.parametrize("wait", sorted(WAITS))
def test_every_wait_ends(wait: str) -> None:
    board = make(program([wait]), "native")
    for step in range(40):
        board.pin("PA0").drive(step % 2)
        board.advance_to(board.now_ns + 1_000_000)
    assert board.register("R5") > 20


def test_rounds_that_are_recorded_are_all_run() -> None:
    rows: dict[str, list[Any]] = {}
    for core in ("native", "python"):
        board = make(program(["a tick", "a pin"]), core)
        rows[core] = []
        recorder = board.chip.record_blocks(1000, lambda recorder, core=core: rows[core].extend(recorder.drain()))
        live(board, 5, 10)
        rows[core] += recorder.drain()
    assert rows["native"] == rows["python"]
    assert len(rows["native"]) > 1000


@pytest.mark.parametrize("loop", ["one block", "four blocks"])
def test_an_hour_of_waiting_for_a_pin_is_over_at_once(loop: str) -> None:
    source = program(["a pin"]).replace("movs r1, #7", "movs r1, #0")
    if loop == "four blocks":
        source = source.replace("w0: ", "w0: bl get\n").replace("tick:", "get: push {r1, lr}\npop {r1, pc}\ntick:")
    board = make(source, "native")
    board.pin("PA0").drive(0)
    board.advance_to(3600 * 10**9)  # round by round this takes a quarter of an hour
    assert board.register("R5") == 0
    board.pin("PA0").drive(1)
    board.advance_to(board.now_ns + 1_000_000)
    assert board.register("R5") > 100


def test_a_restored_board_waits_no_longer_round_by_round_than_one_that_came_there() -> None:
    board = make(program(["a pin"]).replace("movs r1, #7", "movs r1, #0"), "native")
    board.pin("PA0").drive(0)
    board.advance_to(1_000_000)
    saved = board.snapshot()
    board.advance_to(3600 * 10**9)
    board.restore(saved)
    before = board.chip.engine.shared.logged
    board.advance_to(101_000_000)
    assert board.register("R5") == 0
    assert board.chip.engine.shared.logged - before < 1_000  # of 100,000 rounds


#: Computes for a while, in which no round is found that waits; then TIM2 counts a millisecond, and its flag is polled.
LATE = f"""mov32 r0, #{BASES["RCC"]}
movs r1, #1
str r1, [r0, #28]
mov32 r0, #{BASES["TIM2"]}
mov32 r1, #7999
str r1, [r0, #44]
mov32 r5, #60000
compute: subs r5, #1
bne compute
movs r1, #1
str r1, [r0, #0]
poll: ldr r2, [r0, #16]
cmp r2, #0
beq poll
end: b end"""


def test_a_register_that_is_polled_is_waited_for_at_once(monkeypatch: pytest.MonkeyPatch, watchdog: None) -> None:
    monkeypatch.setenv("P2OS_CORE", "native")
    machine = Machine(LATE, {})
    board = machine.board
    board.chip.engine.breakpoints.add(machine.label("poll"))
    assert board.run_for("1 s").halt is not None
    board.chip.engine.breakpoints.clear()
    before = board.chip.engine.shared.logged
    board.run_for("900 us")
    assert board.register("R2") == 0
    assert board.chip.engine.shared.logged - before < 150  # of 900 rounds


def test_the_rounds_of_a_loop_that_polls_a_counter_pass_at_once(watchdog: None) -> None:
    source = program(["the cycle counter"]).replace("movs r1, #7", "movs r1, #0")
    board = make(source.replace("bpl w0", "bpl w0\nmovs r3, #0\nstr r3, [r4, #0]"), "native")
    board.advance_to(1_000_000)
    before = board.chip.engine.shared.logged
    board.advance_to(9_000_000)
    assert board.register("R5") > 10
    assert board.chip.engine.shared.logged - before < 3_000  # of 12,000 rounds
