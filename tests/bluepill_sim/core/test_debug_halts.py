"""Breakpoints, watchpoints and single steps: exact places, and a run that does not notice them."""

import hashlib

import pytest

from bluepill_sim.core import Halt, HaltKind, WatchKind, Watchpoint
from simbase.timing import Reason

GPIOA_CRL, GPIOA_BSRR, RCC_APB2ENR = 0x40010800, 0x40010810, 0x40021018
SYSTICK_CTRL, SYSTICK_LOAD, SYSTICK_VAL = 0xE000E010, 0xE000E014, 0xE000E018
DATA = 0x2000_0800
MS = 1_000_000


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


#: Pins, a tick, IT blocks, calls, divisions, sleep.
BUSY = (
    store(RCC_APB2ENR, 1 << 2)
    + store(GPIOA_CRL, 0x22222222)
    + store(SYSTICK_LOAD, 799)
    + store(SYSTICK_VAL, 0)
    + store(SYSTICK_CTRL, 7)
    + f"""
        mov32 r4, #{GPIOA_BSRR}
        mov32 r6, #{DATA}
        movs r5, #40
loop:   cmp r5, #20
        itte cs
        movcs: adds r2, #1
        str r5, [r4, #0]
        str r5, [r6, #0]
        bl work
        ldr r3, [r6, #0]
        subs r5, #1
        bne loop
        b stop
work:   push {{r4, lr}}
        udiv r3, r2, r5
        mov32 r3, #65537
        str r3, [r4, #0]
        log #3
        wfi
        pop {{r4, pc}}
tick:   mov32 r1, #{DATA}
        ldr r2, [r1, #4]
        adds r2, #1
        str r2, [r1, #4]
        bx lr"""
)


def result_of(machine) -> tuple[object, ...]:
    board = machine.board
    registers = tuple(board.register(f"R{n}") for n in range(8))
    memory = hashlib.sha256(board.read_memory(0x2000_0000, 0x5000)).hexdigest()
    return machine.edges, registers, memory, board.cycle, board.pc


def run_through(machine, end_ns: int, slice_ns: int | None = None) -> list[Halt]:
    """Run to a time, going on after every halt."""
    halts = []
    while machine.board.now_ns < end_ns:
        limit = end_ns if slice_ns is None else min(end_ns, machine.board.now_ns + slice_ns)
        reached = machine.board.advance_to(limit)
        if reached.halt is not None:
            assert reached.reason is Reason.HALT
            assert reached.halt.pc == machine.board.pc
            halts.append(reached.halt)
    return halts


def test_a_breakpoint_stops_before_its_instruction_inside_a_block(boot) -> None:
    machine = boot("movs r0, #1\nmovs r1, #2\nhere: movs r2, #3\nmovs r3, #4")
    machine.board.chip.engine.breakpoints.add(machine.label("here"))
    reached = machine.board.advance_to(MS)
    assert reached.halt == Halt(HaltKind.BREAKPOINT, machine.label("here"))
    assert [machine.board.register(f"R{n}") for n in range(4)] == [1, 2, 0, 0]
    assert machine.board.cycle == 4  # two instructions set R7 up
    machine.board.advance_to(MS)
    assert [machine.board.register(f"R{n}") for n in range(4)] == [1, 2, 3, 4]


def test_a_breakpoint_inside_an_it_block_stops_there_and_the_rest_keeps_its_conditions(boot) -> None:
    machine = boot("movs r0, #0\ncmp r0, #0\nitte eq\nadds r1, #1\nhere: adds r2, #1\nother: adds r3, #1\nadds r4, #1")
    engine = machine.board.chip.engine
    engine.breakpoints |= {machine.label("here"), machine.label("other")}
    halts = run_through(machine, 100_000)
    assert [halt.pc for halt in halts] == [machine.label("here")]  # what is skipped breaks nothing
    assert [machine.board.register(f"R{n}") for n in range(1, 5)] == [1, 1, 0, 1]


def test_the_state_at_a_halt_inside_an_it_block_is_that_before_the_instruction(boot) -> None:
    machine = boot(f"mov32 r6, #{DATA}\nmovs r0, #0\ncmp r0, #0\nitt eq\nstr r6, [r6, #0]\nhere: str r6, [r6, #4]\nnop")
    machine.board.chip.engine.breakpoints.add(machine.label("here"))
    machine.board.advance_to(MS)
    assert machine.board.read_memory(DATA, 8) == DATA.to_bytes(4, "little") + bytes(4)
    assert machine.board.register("XPSR") >> 10 & 0x3F == 0x08 >> 2  # ITSTATE: EQ (0), last of the block
    assert machine.board.pc == machine.label("here")


@pytest.mark.parametrize("slice_ns", [None, 7_000])
def test_halts_change_nothing(boot, slice_ns: int | None) -> None:
    whole = boot(BUSY, {15: "tick"})
    run_through(whole, 5 * MS)
    halted = boot(BUSY, {15: "tick"})
    start, end = halted.label("loop"), halted.label("tick") + 14
    halted.board.chip.engine.breakpoints.update(range(start, end, 2))
    halted.board.chip.engine.watchpoints.add(Watchpoint(DATA, 8, WatchKind.ACCESS))
    halts = run_through(halted, 5 * MS, slice_ns)
    assert len(halts) > 600
    assert {halt.kind for halt in halts} == {HaltKind.BREAKPOINT, HaltKind.WATCHPOINT}
    assert result_of(halted) == result_of(whole)


def test_steps_change_nothing(boot) -> None:
    whole, stepped = boot(BUSY, {15: "tick"}), boot(BUSY, {15: "tick"})
    run_through(whole, 2 * MS)
    places = set()
    while stepped.board.now_ns < 2 * MS:
        reached = stepped.board.chip.step(2 * MS)
        assert reached.halt is None or reached.halt.kind is HaltKind.STEP
        places.add(stepped.board.pc)
    assert {stepped.label("tick"), stepped.label("work") + 2} <= places
    assert result_of(stepped) == result_of(whole)


def test_a_step_runs_one_instruction_wherever_it_goes(boot) -> None:
    machine = boot(
        "movs r0, #1\nb over\nnop\nover: cmp r0, #1\nite eq\nmovs r1, #1\nmovs r2, #1\nend: nop\nspin: b spin"
    )
    board, label = machine.board, machine.label
    seen = []
    for _ in range(11):
        assert board.chip.step(MS).halt == Halt(HaltKind.STEP, board.pc)
        seen.append(board.pc)
    start, over = label("start"), label("over")
    # Two for R7, then one by one; what IT skips is stepped over; a branch to itself goes round.
    assert seen == [start + 4, start + 8, start + 10, over, over + 2, over + 4, label("end"),
                    label("spin"), label("spin"), label("spin"), label("spin")]  # fmt: skip
    assert board.cycle == 2 + 1 + 2 + 1 + 1 + 2 + 1 + 2 * 3


def test_a_step_enters_the_exception_that_is_pending(boot) -> None:
    machine = boot(store(0xE000ED04, 1 << 28) + "isb\nnop\nb stop\nhandler: movs r5, #9\nbx lr", {14: "handler"})
    board = machine.board
    places = [board.pc]
    while places[-1] != machine.label("stop"):
        board.chip.step(MS)
        places.append(board.pc)
    at = places.index(machine.label("handler"))
    assert board.register("R5") == 9
    assert places[at + 1] == machine.label("handler") + 2
    assert places[at + 2] == places[at - 1]  # the return goes back to where it was taken


def test_a_step_over_sleep_ends_at_the_limit_or_where_it_wakes(boot) -> None:
    machine = boot(
        store(SYSTICK_LOAD, 7999) + store(SYSTICK_VAL, 0) + store(SYSTICK_CTRL, 7) + "wfi\nb stop\ntick: bx lr",
        {15: "tick"},
    )
    board = machine.board
    while not board.is_asleep:
        board.chip.step(MS)
    assert board.chip.step(500_000).halt is None
    assert board.now_ns == 500_000
    assert board.chip.step(5 * MS).halt == Halt(HaltKind.STEP, machine.label("tick"))


def test_a_watchpoint_halts_after_the_access(boot) -> None:
    machine = boot(
        f"mov32 r6, #{DATA}\nmovs r0, #5\nstr r0, [r6, #4]\nw: str r0, [r6, #0]\nnop\nr: ldr r1, [r6, #0]\nend: nop"
    )
    machine.board.chip.engine.watchpoints.add(Watchpoint(DATA, 4))
    (halt,) = run_through(machine, MS)
    assert halt == Halt(HaltKind.WATCHPOINT, machine.label("w") + 2, DATA)
    assert machine.board.read_memory(DATA, 1) == b"\5"


def test_watchpoints_tell_reads_from_writes_and_see_parts_of_words(boot) -> None:
    source = f"mov32 r6, #{DATA}\nmovs r0, #5\nstr r0, [r6, #0]\nldr r1, [r6, #0]\nldrb r2, [r6, #3]\nstrb r0, [r6, #2]"

    def halts(point: Watchpoint) -> int:
        machine = boot(source)
        machine.board.chip.engine.watchpoints.add(point)
        return len(run_through(machine, MS))

    assert halts(Watchpoint(DATA, 4, WatchKind.READ)) == 2
    assert halts(Watchpoint(DATA, 4, WatchKind.WRITE)) == 2
    assert halts(Watchpoint(DATA, 4, WatchKind.ACCESS)) == 4
    assert halts(Watchpoint(DATA + 3, 1, WatchKind.ACCESS)) == 3
    assert halts(Watchpoint(DATA + 4, 1, WatchKind.ACCESS)) == 0
    with pytest.raises(ValueError, match="1 byte or more"):
        Watchpoint(DATA, 0)


def test_a_step_over_a_watched_access_tells_of_it(boot) -> None:
    machine = boot(f"mov32 r6, #{DATA}\nw: str r6, [r6, #0]\nmovs r1, #1")
    engine = machine.board.chip.engine
    engine.breakpoints.add(machine.label("w"))
    machine.board.advance_to(MS)
    engine.watchpoints.add(Watchpoint(DATA, 4))
    halt = machine.board.chip.step(MS).halt
    assert halt == Halt(HaltKind.WATCHPOINT, machine.label("w") + 2, DATA)
    assert machine.board.chip.step(MS).halt == Halt(HaltKind.STEP, machine.label("w") + 4)


def test_a_watched_access_that_ends_the_block_by_itself_is_reported_too(boot) -> None:
    """POP {PC} of an exception return reads the watched word, then leaves the handler."""
    machine = boot("svc #0\nback: nop\nb stop\ncall: push {lr}\nnop\npop {pc}", {11: "call"})
    board = machine.board
    board.chip.engine.breakpoints.add(machine.label("call") + 2)
    board.advance_to(MS)
    board.chip.engine.watchpoints.add(Watchpoint(board.register("SP"), 4, WatchKind.READ))
    assert board.advance_to(MS).halt == Halt(HaltKind.WATCHPOINT, machine.label("back"), 0x2000_4FDC)


def test_a_step_over_a_write_to_flash_makes_it_once(boot) -> None:
    """Programmed twice, the halfword would be an error: only zero goes over what is not erased."""
    unlock = store(0x4002_2004, 0x45670123) + store(0x4002_2004, 0xCDEF89AB) + store(0x4002_2010, 1)
    machine = boot(unlock + "mov32 r1, #0x08008000\nmov32 r2, #0x1234\nw: strh r2, [r1, #0]\nldr r3, [r1, #0]\nnop")
    machine.board.chip.engine.breakpoints.add(machine.label("w"))
    machine.board.advance_to(MS)
    assert machine.board.chip.step(MS).halt == Halt(HaltKind.STEP, machine.label("w") + 2)
    assert machine.board.read_memory(0x0800_8000, 2) == b"\x34\x12"
    machine.board.advance_to(MS)
    assert machine.board.register("R3") == 0xFFFF_1234
    assert not machine.board.chip.parts.flash.words[3] & 1 << 2  # PGERR


@pytest.mark.parametrize("before", ["", "cmp r2, #65\nit eq\n"])
def test_a_watched_access_to_a_peripheral_is_made_once(boot, before: str) -> None:
    """DR of USART1: written twice it would send two characters."""
    source = (
        store(RCC_APB2ENR, 0x4004) + store(0x40010804, 0x444444A4) + store(0x40013808, 16) + store(0x4001380C, 0x2008)
        + f"movs r2, #65\nmov r6, r6\n{before}str r2, [r1, #0]\nnop".replace("str r2, [r1", "str r2, [r3")
    ).replace("movs r2, #65", "mov32 r3, #0x40013804\nmovs r2, #65")  # fmt: skip
    machine = boot(source)
    machine.board.chip.engine.watchpoints.add(Watchpoint(0x40013804, 4, WatchKind.WRITE))
    (halt,) = run_through(machine, MS)
    assert halt.address == 0x40013804
    assert machine.sent == b"A"


def test_bkpt_halts_only_for_a_debugger(boot) -> None:
    machine = boot("movs r0, #4\nhere: bkpt #171\nmovs r1, #1")
    board = machine.board
    board.chip.processor.halts_on_bkpt = True
    assert board.advance_to(MS).halt == Halt(HaltKind.BKPT, machine.label("here"))
    board.chip.engine.jump(board.pc + 2 | 1)
    board.advance_to(MS)
    assert board.register("R1") == 1
    without = boot("bkpt #0").run(100)
    assert "BKPT" in str(without.board.fault)


def test_a_snapshot_inside_a_block_goes_on_as_the_original(boot) -> None:
    whole = boot(BUSY, {15: "tick"})
    run_through(whole, 3 * MS)
    machine = boot(BUSY, {15: "tick"})
    machine.board.chip.engine.breakpoints.add(machine.label("loop") + 4)  # inside the IT block
    machine.board.advance_to(3 * MS)
    snapshot = machine.board.snapshot()
    machine.board.chip.engine.breakpoints.clear()
    run_through(machine, 3 * MS)
    assert result_of(machine) == result_of(whole)
    machine.edges.clear()
    machine.board.restore(snapshot)
    assert machine.board.chip.engine.is_inside_block
    run_through(machine, 3 * MS)
    assert result_of(machine)[1:] == result_of(whole)[1:]


def test_breakpoints_that_are_taken_away_are_gone(boot) -> None:
    machine = boot("movs r5, #10\nloop: subs r5, #1\nbne loop")
    breakpoints = machine.board.chip.engine.breakpoints
    breakpoints.add(machine.label("loop"))
    machine.board.advance_to(MS)
    machine.board.advance_to(MS)
    assert machine.board.register("R5") == 9
    breakpoints.clear()
    machine.board.advance_to(MS)
    assert machine.is_done


@pytest.mark.parametrize(
    ("trap", "instruction"), [(1 << 4, "udiv r0, r1, r2"), (0, "ldrd r0, r1, [r4]"), (1 << 3, "ldr r0, [r4, #0]")]
)
def test_a_trap_inside_an_it_block_leaves_what_follows_undone(run, trap: int, instruction: str) -> None:
    machine = run(
        store(0xE000ED14, 1 << 9 | trap) + store(0xE000ED24, 1 << 18) + f"mov32 r4, #{DATA + 1}\nmovs r2, #0\n"
        f"movs r5, #0\nisb\ncmp r2, #0\nittt eq\nnop\nat: {instruction}\nadds r5, #1\nnop\nb stop\n"
        "fault: ldr r0, [sp, #24]\nlog r0\nldr r0, [sp, #28]\nlog r0\nmov r0, r5\nlog r0\nb stop",
        {6: "fault"},
    )
    pc, xpsr, following = machine.log
    assert pc == machine.label("at")
    assert xpsr >> 10 & 0x3F == 0x04 >> 2  # ITSTATE at the second of three under EQ
    assert following == 0
