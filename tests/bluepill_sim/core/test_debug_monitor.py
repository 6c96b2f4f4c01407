"""DebugMonitor, the comparators of FPB and DWT, and the trace of the ITM, as firmware uses them; on both cores."""

from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim.core.halts import HaltKind

DEMCR, DFSR, HFSR, FP_CTRL, FP_COMP0 = 0xE000_EDFC, 0xE000_ED30, 0xE000_ED2C, 0xE000_2000, 0xE000_2008
DWT, ITM, SHPR2, SHPR3 = 0xE000_1000, 0xE000_0000, 0xE000_ED1C, 0xE000_ED20
COMP0, MASK0, FUNCTION0 = DWT + 0x20, DWT + 0x24, DWT + 0x28
MON_EN, MON_PEND, MON_STEP, TRCENA = 1 << 16, 1 << 17, 1 << 18, 1 << 24
HALTED, BKPT, DWTTRAP, DEBUGEVT = 1, 2, 4, 1 << 31
LOWER, UPPER = 1 << 30, 2 << 30
WORD = 0x2000_2000
VECTORS: dict[int, str | int] = {12: "monitor", 3: "hard"}
#: Handlers that log (the stacked PC less that of `main`) and DFSR, or HFSR + 1; `monitor` may go on with `more`.
HANDLERS = """
hard: mov32 r0, #0xE000ED2C
ldr r1, [r0, #0]
adds r1, #1
str r1, [r7, #0]
adds r7, #4
b stop
monitor: ldr r0, [sp, #24]
mov32 r1, #main
subs r0, r0, r1
str r0, [r7, #0]
mov32 r1, #0xE000ED30
ldr r0, [r1, #0]
str r0, [r7, #4]
str r0, [r1, #0]
adds r7, #8
"""


def store(address: int, value: int | str) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


#: Goes on behind the BKPT, or with no breakpoint any more.
PAST = "ldr r0, [sp, #24]\nadds r0, #2\nstr r0, [sp, #24]\nbx lr\n"
NO_POINTS = store(FP_CTRL, 2) + store(FUNCTION0, 0) + "bx lr\n"


def test_bkpt_calls_the_monitor_with_its_own_address(make: Any) -> None:
    machine = make(store(DEMCR, MON_EN) + "main: nop\nbkpt #1\nlog #5\nb stop\n" + HANDLERS + PAST, VECTORS).run(100)
    assert machine.log == [2, BKPT, 5]
    assert machine.board.chip.system.read(0xED2C, 4) == 0
    assert machine.board.chip.system.read(0xED30, 4) == 0, "ones clear DFSR"
    assert machine.board.fault is None


@pytest.mark.parametrize("control", [0, MON_PEND | 1])
def test_without_the_monitor_bkpt_is_a_hard_fault(make: Any, control: int) -> None:
    machine = make("cpsid i\n" + store(DEMCR, control) + "main: bkpt #1\nb stop\n" + HANDLERS + PAST, VECTORS).run(100)
    assert machine.log == [DEBUGEVT + 1]
    assert machine.board.chip.system.read(0xED30, 4) == BKPT


@pytest.mark.parametrize(("own", "calls"), [(0x40, True), (0x50, False), (0x60, False)])
def test_a_breakpoint_in_a_handler_that_the_monitor_may_not_interrupt_is_a_hard_fault(
    make: Any, own: int, calls: bool
) -> None:
    """SVCall has priority 0x50, the monitor one that is higher, the same, or lower."""
    machine = make(
        store(DEMCR, MON_EN) + store(SHPR2, 0x50 << 24) + store(SHPR3, own) + "svc #0\nlog #7\nb stop\n"
        + "call: main: bkpt #0\nbx lr\n" + HANDLERS + PAST, {**VECTORS, 11: "call"},
    ).run(100)  # fmt: skip
    assert machine.log == ([0, BKPT, 7] if calls else [DEBUGEVT + 1])


@pytest.mark.parametrize("halves", [LOWER, UPPER, LOWER | UPPER])
@pytest.mark.parametrize("has_monitor", [True, False])
def test_the_fpb_breaks_before_its_instruction(make: Any, halves: int, has_monitor: bool) -> None:
    source = (
        store(DEMCR, MON_EN * has_monitor) + store(FP_COMP0 + 20, "main+4")
        + f"mov32 r3, #{halves | 1}\nadds r2, r2, r3\n"
        + "str r2, [r1, #0]\n" + store(FP_CTRL, 3)
        + "b main\n.half 0xbf00\nmain: movs r3, #0\nadds r3, #1\nadds r3, #1\n"
        "adds r3, #1\nmov r0, r3\nlog r0\nb stop\n" + HANDLERS + NO_POINTS
    )  # fmt: skip
    machine = make(source, VECTORS)
    if machine.label("main") % 4:
        machine = make("nop\n" + source, VECTORS)
    machine.run(200)
    assert machine.label("main") % 4 == 0
    first = 4 if halves & LOWER else 6
    assert machine.log == ([first, BKPT, 3] if has_monitor else [DEBUGEVT + 1])


@pytest.mark.parametrize(("control", "comparator"), [(1, 1), (2, 1), (3, 0)])
def test_a_breakpoint_needs_key_enables_and_a_comparator_that_is_on(make: Any, control: int, comparator: int) -> None:
    machine = make(
        store(FP_COMP0, "main") + f"mov32 r3, #{LOWER | UPPER | comparator}\nadds r2, r2, r3\nstr r2, [r1, #0]\n"
        + store(FP_CTRL, control) + "b main\nmain: nop\nlog #1\nb stop\n" + HANDLERS + NO_POINTS, VECTORS,
    ).run(200)  # fmt: skip
    assert machine.log == [1]


@pytest.mark.parametrize(
    ("function", "mask", "at", "text", "meets"),
    [
        (6, 0, WORD, "str r3, [r1, #0]", True), (6, 0, WORD, "ldr r3, [r1, #0]", False),
        (5, 0, WORD, "ldr r3, [r1, #0]", True), (5, 0, WORD, "str r3, [r1, #0]", False),
        (7, 0, WORD, "ldr r3, [r1, #0]", True), (7, 0, WORD, "strb r3, [r1, #0]", True),
        (6, 0, WORD + 4, "str r3, [r1, #0]", False), (6, 3, WORD + 4, "str r3, [r1, #0]", True),
        (6, 2, WORD + 4, "str r3, [r1, #0]", False), (6, 0, WORD - 1, "str r3, [r1, #0]", False),
        (6, 0, WORD + 3, "str r3, [r1, #0]", True), (0, 0, WORD, "str r3, [r1, #0]", False),
    ],
)  # fmt: skip
def test_the_dwt_sees_accesses_by_address_and_kind(
    make: Any, function: int, mask: int, at: int, text: str, meets: bool
) -> None:
    machine = make(
        store(DEMCR, MON_EN | TRCENA) + store(COMP0 + 48, at) + store(MASK0 + 48, mask) + store(FUNCTION0
        + 48, function)
        + f"mov32 r1, #{WORD}\nb main\nmain: {text}\nnop\nb on\non: log #9\nb stop\n"
        + HANDLERS + store(FUNCTION0 + 48, 0) + "bx lr\n", VECTORS,
    ).run(200)  # fmt: skip
    assert machine.log[1:] == ([DWTTRAP, 9] if meets else [])
    assert machine.log[0] in ({2, 4, 6} if meets else {9})


def test_a_match_waits_for_primask_and_matched_is_cleared_by_reading_the_function(make: Any) -> None:
    machine = make(
        store(DEMCR, MON_EN | TRCENA) + "cpsid i\n" + store(COMP0, WORD) + store(FUNCTION0, 6) + "b main\nmain: "
        + store(WORD, 1) + "b last\nlast: nop\nb stop\n" + HANDLERS + NO_POINTS, VECTORS,
    ).run(200)  # fmt: skip
    read = machine.board.chip.system.read
    assert machine.log == [], "PRIMASK holds the monitor back"
    assert read(0xEDFC, 4) & MON_PEND
    assert [read(0x1028, 4) for _ in range(2)] == [6 | 1 << 24, 6]
    machine.board.chip.system.write(0xEDFC, 4, MON_EN)
    assert not read(0xEDFC, 4) & MON_PEND


@pytest.mark.parametrize("enables", [MON_EN, TRCENA, 0])
def test_the_dwt_does_nothing_without_monitor_or_trace(make: Any, enables: int) -> None:
    machine = make(
        store(DEMCR, enables) + store(COMP0, WORD) + store(FUNCTION0, 7) + store(WORD, 1)
        + "b main\nmain: log #1\nb stop\n"
        + HANDLERS + NO_POINTS, VECTORS,
    ).run(200)  # fmt: skip
    assert machine.log == [1]


def test_the_dwt_sees_an_instruction_and_lets_it_run_first(make: Any) -> None:
    machine = make(
        store(DEMCR, MON_EN | TRCENA) + store(COMP0, "main+2") + store(FUNCTION0, 4)
        + "movs r3, #0\nb main\nmain: nop\nadds r3, #1\nb past\npast: mov r0, r3\nlog r0\nb stop\n" + HANDLERS
        + "mov r0, r3\nstr r0, [r7, #0]\nadds r7, #4\n" + NO_POINTS, VECTORS,
    ).run(200)  # fmt: skip
    assert machine.log[0] >= 4
    assert machine.log[1:] == [DWTTRAP, 1, 1]


def test_mon_step_runs_one_instruction_at_a_time(make: Any) -> None:
    """The monitor lets the program go on until it has come four times, then takes MON_STEP away."""
    machine = make(
        store(DEMCR, MON_EN | MON_STEP | MON_PEND)
        + "b main\nmain: nop\nadds r3, #1\nb past\npast: nop\nnop\nlog #9\nb stop\n"
        + HANDLERS + f"mov32 r1, #0x20000110\nsubs r1, r7, r1\nbne on\n{store(DEMCR, MON_EN)}on: bx lr\n", VECTORS,
    ).run(300)  # fmt: skip
    assert len(machine.log) == 5
    first, *rest = machine.log[::2][:2]
    assert machine.log[1::2][:2] == [0, HALTED], "MON_PEND by itself is no debug event"
    assert rest[0] - first in {2, 0x10000_0000 - 2}
    assert machine.log[-1] == 9


def test_mon_step_goes_through_branches_and_each_instruction_once(make: Any) -> None:
    program = "b main\nmain: nop\nadds r3, #1\nb past\nnop\npast: adds r3, #1\nnop\nb main\n"
    machine = make(
        store(DEMCR, MON_EN | MON_STEP | MON_PEND) + program + HANDLERS
        + "ldr r0, [r7, #0]\nbx lr\n", VECTORS,
    ).run(200)  # fmt: skip
    places = [at - (1 << 32) if at >> 31 else at for at in machine.log[::2]]
    start = places.index(0)
    assert places[start : start + 13] == [0, 2, 4, 8, 10, 12, 0, 2, 4, 8, 10, 12, 0]
    assert set(machine.log[3::2]) == {HALTED}


@pytest.mark.parametrize("early", [0, 1, 2, 3])
def test_the_cycle_counter_is_compared(make: Any, early: int) -> None:
    """The monitor starts 12 cycles after the first boundary of a loop of one-cycle blocks at or after the match."""
    at = 1000 + early
    machine = make(
        store(DEMCR, MON_EN | TRCENA) + store(COMP0, at) + store(DWT, 1) + store(FUNCTION0, 4 | 1 << 7) + store(DWT
        + 4, 0)
        + "main: nop\nb main\n"
        + HANDLERS.replace(
            "ldr r0, [sp, #24]\nmov32 r1, #main\nsubs r0, r0, r1", f"mov32 r1, #{DWT + 4}\nldr r0, [r1, #0]"
        )
        + NO_POINTS, VECTORS,
    ).run(400)  # fmt: skip
    count, status = machine.log
    assert status == DWTTRAP
    assert at + 12 <= count < at + 12 + 4 + 8, (
        "a loop takes at most four cycles, and the handler reads the counter soon"
    )


def test_a_debugger_s_breakpoint_comes_before_the_firmware_s(make: Any) -> None:
    machine = make(
        store(DEMCR, MON_EN) + store(FP_COMP0, "main")
        + f"mov32 r3, #{LOWER | UPPER | 1}\nadds r2, r2, r3\nstr r2, [r1, #0]\n"
        + store(FP_CTRL, 3) + "b main\n.half 0xbf00\nmain: movs r3, #1\nlog #1\nb stop\n" + HANDLERS
        + NO_POINTS, VECTORS,
    )  # fmt: skip
    board = machine.board
    board.chip.engine.breakpoints.add(machine.label("main"))
    reached = board.advance_to(1_000_000)
    assert reached.halt is not None
    assert (reached.halt.kind, reached.halt.pc) == (HaltKind.BREAKPOINT, machine.label("main"))


def test_a_snapshot_keeps_what_comparators_look_out_for(make: Any) -> None:
    source = (
        store(DEMCR, MON_EN | TRCENA) + store(COMP0, WORD) + store(FUNCTION0, 6)
        + f"mov32 r3, #3000\nwait: subs r3, #1\nbne wait\nmov32 r1, #{WORD}\nb main\n"
        + "main: str r2, [r1, #0]\nb past\npast: log #9\nb stop\n" + HANDLERS + NO_POINTS
    )  # fmt: skip
    machine, other = make(source, VECTORS).run(100), make(source, VECTORS)
    other.board.restore(machine.board.snapshot())
    ends = []
    for one in (machine, other):
        one.run(3000)
        ends.append((one.log[1:], one.board.cycle))
    assert ends[0] == ends[1]
    assert ends[0][0] == [DWTTRAP, 9]


def test_the_mpu_is_absent(make: Any) -> None:
    machine = make(
        "".join(store(0xE000_ED90 + 4 * n, 0xFFFF_FFFF) + "ldr r0, [r1, #0]\nlog r0\n" for n in range(11)) + "b stop"
    ).run(100)
    assert machine.log == [0] * 11
    assert machine.board.warnings == []


ENABLE_ITM = store(DEMCR, TRCENA) + store(ITM + 0xFB0, 0xC5AC_CE55) + store(ITM + 0xE80, 1) + store(ITM + 0xE00, 0b101)


def listened(machine: Any) -> list[tuple[int, int, int, bytes]]:
    found: list[tuple[int, int, int, bytes]] = []
    machine.board.chip.system.stimulus_sinks.append(lambda *row: found.append(row))
    return found


def test_stimulus_ports_take_bytes_halfwords_and_words_where_they_are_enabled(make: Any) -> None:
    machine = make(
        ENABLE_ITM + "".join(
            f"mov32 r1, #{ITM + 4 * port}\nldr r0, [r1, #0]\nlog r0\nmov32 r2, #0x64636261\n{text} r2, [r1, #0]\n"
            for port, text in ((0, "strb"), (1, "strb"), (2, "strh"), (0, "str"))
        ) + "b stop"
    )  # fmt: skip
    found = listened(machine)
    machine.run(100)
    assert machine.log == [1, 0, 1, 1]
    assert [row[2:] for row in found] == [(0, b"a"), (2, b"ab"), (0, b"abcd")]
    assert [row[0] for row in found] == sorted({row[0] for row in found})


@pytest.mark.parametrize("lost", ["trace", "key", "enable"])
def test_the_itm_is_deaf_without_trace_key_or_enable(make: Any, lost: str) -> None:
    source = ENABLE_ITM
    source = source.replace(str(TRCENA), "0") if lost == "trace" else source
    source = source.replace(str(0xC5AC_CE55), "1") if lost == "key" else source
    source = source.replace(store(ITM + 0xE80, 1), store(ITM + 0xE80, 2)) if lost == "enable" else source
    machine = make(source + store(ITM, 65) + "ldr r0, [r1, #0]\nlog r0\nb stop")
    found = listened(machine)
    assert machine.run(100).log == [0]
    assert found == []


@pytest.mark.parametrize("privileges", [0, 1])
def test_a_thread_without_privilege_writes_ports_that_tpr_leaves_open(make: Any, privileges: int) -> None:
    machine = make(
        ENABLE_ITM
        + store(ITM + 0xE40, privileges)
        + f"movs r0, #1\nmsr control, r0\nisb\nmov32 r1, #{ITM}\nmovs r2, #65\nstrb r2, [r1, #0]\nb stop"
    )
    found = listened(machine)
    machine.run(100)
    assert [row[2:] for row in found] == ([] if privileges else [(0, b"A")])
    assert (machine.board.fault is not None) is bool(privileges)


def test_registers_of_the_debugger_outlive_a_reset_and_not_a_power_cut(make: Any) -> None:
    from bluepill_sim.peripherals.rcc import ResetCause

    machine = make(ENABLE_ITM + store(COMP0, 5) + store(FP_COMP0, 0x8000_0101) + "b stop").run(100)
    chip = machine.board.chip
    read = chip.system.read
    seen = [0xE00, 0xE80, 0x1020, 0x2008, 0xEDFC]
    before = [read(at, 4) for at in seen]
    assert 0 not in before
    chip.reset(ResetCause.PIN)
    assert [read(at, 4) for at in seen] == before
    chip.reset(ResetCause.POWER)
    assert [read(at, 4) for at in seen] == [0] * len(seen)
