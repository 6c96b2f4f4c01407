"""Stores whose bus error comes later: the write buffer, as PM0056 4.4.15 and TRM r2p0 3.5 have it; on both cores.

The handler logs what was stacked as PC, less that of the store; CFSR; and BFAR.
"""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.core.faults import FaultKind
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_core import state

ACTLR, SHCSR, SHPR1, SHPR2, ICSR = 0xE000_E008, 0xE000_ED24, 0xE000_ED18, 0xE000_ED1C, 0xE000_ED04
CFSR, HFSR, BFAR = 0xE000_ED28, 0xE000_ED2C, 0xE000_ED38
IMPRECISERR, PRECISERR, BFARVALID, FORCED = 1 << 10, 1 << 9, 1 << 15, 1 << 30
BUSFAULTENA, BUSFAULTPENDED = 1 << 17, 1 << 14
NOWHERE, END_OF_SRAM = 0x7000_0000, 0x2000_5000
DMB = ".half 0xF3BF, 0x8F5F"
HANDLERS = f"""
hard: log #9
bus: ldr r0, [sp, #24]
mov32 r1, #bad
subs r0, r0, r1
log r0
mov32 r1, #{CFSR}
ldr r0, [r1, #0]
log r0
str r0, [r1, #0]
bx lr
svc: log #11
bx lr
pendsv: log #14
bx lr
"""
VECTORS: dict[int, str | int] = {3: "hard", 5: "bus", 11: "svc", 14: "pendsv"}


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


ENABLED = store(SHCSR, BUSFAULTENA)
POINTED = f"movs r2, #7\nmov32 r3, #{NOWHERE}\n"
BAD = POINTED + "bad: str r2, [r3, #0]\n"


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return lambda source, vectors=VECTORS: boot(source + HANDLERS, vectors)


#: What follows the store, and how far behind it the stacked PC is. The error comes three cycles after the store began:
#: in front of the first instruction that begins then or later.
FOLLOWED = [
    ("nop\n" * 8, 2 + 4),  # at 1 and 2 cycles: the third one begins at 3
    ("muls r4, r4\nnop\nnop\nnop\n", 2 + 4),
    ("nop\nmla r4, r4, r4, r4\nnop\n", 2 + 2 + 4),  # it begins at 2, and the next one at 4
    ("mla r4, r4, r4, r4\nnop\nnop\n", 2 + 4),  # from 1 to 3
    ("nop\nnop\nmla r4, r4, r4, r4\nnop\n", 2 + 4),
    ("udiv r4, r4, r2\nnop\n", 2 + 4),
    ("dsb\nnop\nnop\nnop\n", 2 + 4), ("isb\nnop\nnop\nnop\n", 2 + 4), (DMB + "\nnop\nnop\nnop\n", 2 + 4),
    ("nop\ndsb\nnop\nnop\nnop\n", 2 + 2 + 4),
    ("b further\nnop\nfurther: nop\nnop\n", 2 + 4),  # a taken branch: 1, and 1 to refill
]  # fmt: skip


@pytest.mark.parametrize(("following", "distance"), FOLLOWED)
def test_the_error_comes_some_instructions_later_and_leaves_no_address(
    make: Any, following: str, distance: int
) -> None:
    machine = make(ENABLED + store(BFAR, 0x1234) + BAD + following + "log #1\nb stop").run(100)
    assert machine.log == [distance, IMPRECISERR, 1]
    assert machine.board.chip.processor.bfar == 0x1234
    assert machine.board.fault is None


def test_without_the_write_buffer_every_error_is_precise(make: Any) -> None:
    machine = make(store(ACTLR, 2) + ENABLED + BAD + "log #1\nb stop").run(30)
    assert machine.log[:2] == [0, PRECISERR | BFARVALID]
    assert machine.board.chip.processor.bfar == NOWHERE


def test_the_switch_of_the_write_buffer_counts_from_the_next_store_on(make: Any) -> None:
    machine = make(
        ENABLED + f"mov32 r4, #{ACTLR}\nmovs r5, #2\n" + POINTED + "str r5, [r4, #0]\nbad: str r2, [r3, #0]\nb stop"
    ).run(30)
    assert machine.log[:2] == [0, PRECISERR | BFARVALID]


def test_a_disabled_bus_fault_is_a_hard_fault_whose_report_names_the_store(make: Any) -> None:
    machine = make(BAD + "nop\nnop\nnop\nlog #1\nb stop").run(100)
    assert machine.log == [9, 6, IMPRECISERR, 1]
    assert machine.board.chip.processor.hfsr == FORCED
    report = machine.board.fault
    assert (report.kind, report.pc, report.address) == (FaultKind.IMPRECISE_WRITE, machine.label("bad"), NOWHERE)
    assert str(report).startswith("BusFault: imprecise write to nothing at bad+0x0 (0x")
    assert not machine.board.has_died


def test_of_two_stores_that_fail_the_first_counts(make: Any) -> None:
    machine = make(BAD + "str r2, [r3, #4]\nnop\nnop\nnop\nlog #1\nb stop").run(100)
    assert machine.log == [9, 6, IMPRECISERR, 1]
    assert (machine.board.fault.pc, machine.board.fault.address) == (machine.label("bad"), NOWHERE)


@pytest.mark.parametrize(("before", "after"), [("cpsid i", "cpsie i"), ("cpsid f", "cpsie f")])
def test_the_error_waits_behind_a_mask(make: Any, before: str, after: str) -> None:
    """A precise fault would be a HardFault, or a lockup."""
    read = f"mov32 r1, #{SHCSR}\nldr r0, [r1, #0]\nlog r0\n"
    machine = make(ENABLED + before + "\n" + BAD + "nop\nnop\nnop\n" + read + f"{after}\nlog #2\nb stop").run(100)
    assert machine.log[0] == BUSFAULTENA | BUSFAULTPENDED
    assert machine.log[2:] == [IMPRECISERR, 2]
    assert machine.board.fault is None


def test_a_hard_fault_waits_behind_faultmask(make: Any) -> None:
    machine = make("cpsid f\n" + BAD + "nop\nnop\nnop\nlog #1\ncpsie f\nlog #2\nb stop").run(100)
    assert [machine.log[0], machine.log[1], *machine.log[3:]] == [1, 9, IMPRECISERR, 2]
    assert machine.board.fault.kind is FaultKind.IMPRECISE_WRITE


def test_an_error_in_the_hard_fault_handler_is_no_lockup(make: Any) -> None:
    """It is pending until the handler returns, and then follows it at once."""
    machine = make(
        POINTED + f"mov32 r5, #{CFSR}\nmovs r4, #0\nudf\nlog #5\nb stop\n"
        "first: adds r4, #1\ncmp r4, #1\nbne again\nbad: str r2, [r3, #0]\nldr r1, [sp, #24]\nadds r1, #2\n"
        "str r1, [sp, #24]\nlog #3\nbx lr\nagain: log #4\nldr r0, [r5, #0]\nlog r0\nbx lr\n",
        {3: "first"},
    ).run(100)
    assert machine.log == [3, 4, 1 << 16 | IMPRECISERR, 5]
    assert not machine.board.chip.processor.is_locked_up


@pytest.mark.parametrize(
    ("bus", "svc", "order"), [(0x40, 0x40, "bus"), (0x40, 0x80, "bus"), (0x80, 0x40, "svc"), (0, 0, "bus")]
)
def test_an_svc_empties_the_write_buffer_and_priorities_decide(make: Any, bus: int, svc: int, order: str) -> None:
    source = ENABLED + store(SHPR1, bus << 8) + store(SHPR2, svc << 24) + BAD + "svc #0\nlog #1\nb stop"
    log = make(source).run(100).log
    # Of the same priority: SVCall is entered, BusFault with the lower number follows it.
    expected = {"bus": [[11, 4, IMPRECISERR, 1], [4, IMPRECISERR, 11, 1]], "svc": [[11, 4, IMPRECISERR, 1]]}[order]
    assert log in expected
    is_first = order == "bus" and bus < svc
    assert (log[0] == 4) is is_first


def test_a_return_from_a_handler_empties_the_write_buffer(make: Any) -> None:
    """It follows the handler by tail-chaining: what is stacked is where the thread was."""
    machine = make(
        ENABLED + POINTED + "svc #0\nbad: log #1\nb stop\ncall: str r2, [r3, #0]\nbx lr\n", {**VECTORS, 11: "call"}
    ).run(100)
    assert machine.log == [0, IMPRECISERR, 1]
    rows = [(address, kind) for _, address, kind in machine.board.chip.engine.log.rows() if kind]
    assert [kind for _, kind in rows] == [11, -1, 5, -1]
    assert rows[1][0] == 0xFFFF_FFF9, "no return to the thread in between"


@pytest.mark.parametrize("sleep", ["wfi", "wfe", "nop\nwfi"])
def test_the_error_comes_before_the_core_sleeps(make: Any, sleep: str) -> None:
    machine = make(ENABLED + BAD + f"{sleep}\nlog #1\nb stop").run(100)
    assert machine.log[1:] == [IMPRECISERR, 1]


def test_an_interrupt_that_is_entered_empties_the_write_buffer(make: Any) -> None:
    machine = make(
        ENABLED + store(SHPR1, 0x80 << 8) + POINTED + f"mov32 r4, #{ICSR}\nmov32 r5, #0x10000000\ncmp r2, #7\n"
        "str r5, [r4, #0]\nbad: str r2, [r3, #0]\nbne stop\nlog #1\nb stop"
    ).run(100)
    assert machine.log == [14, 4, IMPRECISERR, 1]


def test_a_precise_fault_in_between_is_seen_with_it(make: Any) -> None:
    machine = make(ENABLED + BAD + "second: ldr r0, [r3, #0]\nlog #1\nb stop")
    machine.board.advance_to(machine.board.now_ns + 3500)
    assert machine.log[:2] == [2, IMPRECISERR | PRECISERR | BFARVALID]
    assert machine.board.chip.processor.bfar == NOWHERE


@pytest.mark.parametrize("first", [END_OF_SRAM - 8, END_OF_SRAM - 4, END_OF_SRAM])
def test_a_store_of_several_words_is_made_where_there_is_memory(make: Any, first: int) -> None:
    machine = make(
        f"mov32 r4, #{END_OF_SRAM - 0x400}\nmov sp, r4\n" + ENABLED
        + f"movs r2, #5\nmovs r4, #6\nmovs r5, #7\nmov32 r3, #{first}\nmov r6, r3\n"
        "bad: stmia r3!, {r2, r4, r5}\nnop\nnop\nsubs r0, r3, r6\nlog r0\nb stop"
    ).run(100)  # fmt: skip
    assert machine.log == [2, IMPRECISERR, 12], "it takes four cycles, and its base is written back"
    there = (END_OF_SRAM - first) // 4
    held = machine.board.read_memory(first, 4 * there) or b""
    assert [held[n] for n in range(0, len(held), 4)] == [5, 6][:there]


@pytest.mark.parametrize("condition", ["eq", "ne"])
def test_a_store_under_it_is_made_or_not(make: Any, condition: str) -> None:
    machine = make(
        ENABLED
        + POINTED
        + f"cmp r2, #7\nitt {condition}\nbad: str r2, [r3, #0]\nmovs r2, #9\nmov r0, r2\nlog r0\nb stop"
    ).run(100)
    assert machine.log == ([6, IMPRECISERR, 9] if condition == "eq" else [7])


@pytest.mark.parametrize(
    "address",
    [
        0x0800_8000,
        0x8000,
        0x1FFF_F000,
        0x1FFF_F7E0,
        0x9FFF_FC00,
        0x4002_4000,
        0xE010_0000,
        0xFFFF_FBFC,
        0xFFFF_FC00,
        0xFFFF_FFFC,
    ],
)
def test_memory_that_is_read_only_keeps_what_it_holds(make: Any, address: int) -> None:
    """Flash takes a halfword alone; where its controller refuses one it says so by a flag, and this is a word."""
    unlock = store(0x4002_2004, 0x4567_0123) + store(0x4002_2004, 0xCDEF_89AB) + store(0x4002_2010, 1)
    machine = make(
        unlock + ENABLED + f"movs r2, #7\nmov32 r3, #{address}\nbad: str r2, [r3, #0]\nnop\nnop\nnop\nb stop"
    )
    before = machine.board.chip.memory.read(address, 4)
    machine.run(100)
    assert machine.log[1:] == [IMPRECISERR]
    assert machine.board.chip.memory.read(address, 4) == before


def test_a_store_that_was_let_go_leaves_no_memory_behind(make: Any) -> None:
    machine = make(ENABLED + BAD + "nop\nnop\nnop\nldr r0, [r3, #0]\nb stop").run(30)
    assert machine.log[:2] == [6, IMPRECISERR]
    assert machine.board.chip.processor.bfar == NOWHERE


@settings(max_examples=10)
@given(
    st.lists(
        st.sampled_from(
            ["str r2, [r3, #0]", "str r2, [r6, #4]", "nop", "dsb", "mla r4, r4, r4, r4", "svc #0", "b @\n@: nop",
             "cpsid i", "cpsie i", "push {r0-r1}", "strb r2, [r3, #1]", "isb", "pend", "ldr r0, [r6, #4]"]
        ),
        min_size=1, max_size=14,
    ),
    st.integers(0, 40), st.booleans(),
)  # fmt: skip
def test_both_cores_agree_in_slices_of_any_length_and_from_snapshots(lines: list[str], cut: int, on: bool) -> None:
    body = "\n".join(line.replace("@", f"label{n}") for n, line in enumerate(lines)).replace("pend", "str r5, [r1, #4]")
    source = (
        (ENABLED if on else "") + POINTED + "bad: mov32 r6, #0x20000800\nmov32 r5, #0x10000000\n"
        + f"mov32 r1, #{ICSR - 4}\n" + body + "\ncpsie i\nlog #1\nb stop" + HANDLERS
    )  # fmt: skip
    ends = []
    for core, slice_us, cuts in [
        ("native", None, False),
        ("python", None, False),
        ("native", 0.125, False),
        ("python", 0.5, True),
    ]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            machine = Machine(source, VECTORS)
            machine.run(cut / 8 + 1, slice_us)
            if cuts:
                snapshot, machine = machine.board.snapshot(), Machine(source, VECTORS)
                machine.board.restore(snapshot)
            machine.board.advance_to(40_000)
            ends.append((machine.log, state(machine.board)))
    assert all(end == ends[0] for end in ends)


def test_a_reset_forgets_the_error_that_is_on_its_way(make: Any) -> None:
    """At the boundary behind a branch that is not taken, a cycle before the error."""
    machine = make(ENABLED + POINTED + "cmp r2, #7\nbad: str r2, [r3, #0]\nbne stop\nlog #1\nb stop")
    core = machine.board.chip.processor
    while core.bus_error_cycle is None:
        machine.run(0.125)
    assert core.bus_error_cycle == core.cycle + 1
    machine.board.reset()
    assert core.bus_error_cycle is None


def test_a_hard_fault_that_waited_for_nmi_is_reported(make: Any) -> None:
    machine = make(
        POINTED + f"mov32 r1, #{ICSR}\nmov32 r2, #0x80000000\nstr r2, [r1, #0]\nisb\nlog #1\nb stop\n"
        "nmi: str r2, [r3, #0]\nnop\nnop\nnop\nnop\nb on\nnop\non: log #2\nbx lr\nhardly: log #9\nbad: b bad",
        {2: "nmi", 3: "hardly"},
    ).run(100)  # fmt: skip
    assert machine.log == [2, 9]
    assert (machine.board.fault.kind, machine.board.fault.pc) == (FaultKind.IMPRECISE_WRITE, machine.label("nmi"))
