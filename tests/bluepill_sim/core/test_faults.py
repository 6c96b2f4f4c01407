"""Faults: found at the right instruction, reported, escalated, handled, or the end of all."""

import pytest

from bluepill_sim.core.faults import FAULT_ROWS, MOST_RETURNS, FaultKind, FaultReport
from bluepill_sim.peripherals.rcc import ResetCause
from simbase.timing import Reason

CCR, SHCSR, CFSR, HFSR, BFAR = 0xE000ED14, 0xE000ED24, 0xE000ED28, 0xE000ED2C, 0xE000ED38
ACTLR, DISDEFWBUF = 0xE000E008, 2
FORCED = 1 << 30
ALL_HANDLERS = 7 << 16
DIV_0_TRP, UNALIGN_TRP = 1 << 4, 1 << 3


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


#: Stores without the write buffer: test_imprecise_faults.py has those with it.
UNBUFFERED = store(ACTLR, DISDEFWBUF)
#: Kind, exception, program with the label `bad` at the failing instruction (None: elsewhere), address of the access.
CASES = [
    (FaultKind.READ_ERROR, "mov32 r1, #0x70000000\nbad: ldr r0, [r1, #4]", "bad", 0x70000004),
    (FaultKind.READ_ERROR, "mov32 r1, #0x20004FF8\nbad: ldmia.w r1, {r2-r4}", "bad", 0x20005000),
    (FaultKind.WRITE_ERROR, UNBUFFERED + "mov32 r1, #0x1FFFFFFC\nbad: str r0, [r1, #0]", "bad", 0x1FFFFFFC),
    (FaultKind.WRITE_ERROR, UNBUFFERED + "mov32 r1, #0x1FFFF000\nbad: str r0, [r1, #0]", "bad", 0x1FFFF000),
    (FaultKind.FETCH_ERROR, "mov32 r1, #0x70000001\nblx r1", 0x70000000, 0x70000000),
    (FaultKind.EXECUTE_NEVER, "mov32 r1, #0xE0000001\nblx r1", 0xE0000000, None),
    (FaultKind.EXECUTE_NEVER, "mov32 r1, #0xFFFFFFF9\nbx r1", 0xFFFFFFF8, None),
    (FaultKind.INVALID_STATE, "mov32 r1, #target\nbx r1\ntarget: nop\nnop", "target", None),
    (FaultKind.UNDEFINED_INSTRUCTION, "bad: udf", "bad", None),
    (FaultKind.UNDEFINED_INSTRUCTION, "wfe_first: sev\nwfe\nbad: udf", "bad", None),
    (FaultKind.UNDEFINED_INSTRUCTION, "bad: .half 0xFA90, 0xF000", "bad", None),  # SADD16: a Cortex-M4's
    (FaultKind.NO_COPROCESSOR, "bad: .half 0xEE00, 0x0A10", "bad", None),
    (FaultKind.BREAKPOINT, "bad: bkpt #3", "bad", None),
    (FaultKind.UNALIGNED, "mov32 r1, #0x20000802\nbad: ldrd r2, r3, [r1]", "bad", 0x20000802),
    (FaultKind.UNALIGNED, "mov32 r1, #0x20000801\nbad: strd r2, r3, [r1]", "bad", 0x20000801),
    (FaultKind.UNALIGNED, "mov32 r1, #0x20000802\nbad: ldmia r1!, {r2, r3}", "bad", 0x20000802),
    (FaultKind.UNALIGNED, "mov32 r1, #0x20000803\nbad: stmia r1!, {r2, r3}", "bad", 0x20000803),
    (FaultKind.UNALIGNED, "mov32 r1, #0x20000802\nbad: ldrex r2, [r1]", "bad", None),
    (FaultKind.UNALIGNED, store(CCR, UNALIGN_TRP) + "isb\nmov32 r1, #0x20000802\nbad: ldr r0, [r1, #0]", "bad",
     0x20000802),
    (FaultKind.UNALIGNED, store(CCR, UNALIGN_TRP) + "isb\nmov32 r1, #0x20000801\nbad: strh r0, [r1, #0]", "bad",
     0x20000801),
    (FaultKind.DIVIDE_BY_ZERO, store(CCR, DIV_0_TRP) + "isb\nmovs r1, #7\nmovs r2, #0\nbad: udiv r0, r1, r2", "bad",
     None),
    (FaultKind.DIVIDE_BY_ZERO, store(CCR, DIV_0_TRP) + "isb\nmovs r1, #7\nmovs r2, #0\nbad: sdiv r0, r1, r2", "bad",
     None),
    # Where the memory map lets nothing be executed, and beside it, where nothing is fitted.
    *((FaultKind.EXECUTE_NEVER, f"mov32 r1, #{address + 1}\nblx r1", address, None)
      for address in (0x40000000, 0x5FFFFFFC, 0xA0000000)),
    *((FaultKind.FETCH_ERROR, f"mov32 r1, #{address + 1}\nblx r1", address, address)
      for address in (0x3FFFFFFC, 0x60000000, 0x9FFFF000)),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "source", "place", "address"), CASES)
def test_a_fault_without_a_handler_is_a_hard_fault_that_names_its_place(
    boot, kind: FaultKind, source: str, place: str | int, address: int | None
) -> None:
    machine = boot(source)
    machine.run(100)
    report = machine.board.fault
    assert report is not None
    expected_pc = place if isinstance(place, int) else machine.label(place)
    assert (report.kind, report.pc, report.address) == (kind, expected_pc, address)
    assert machine.board.pc == machine.label("default")
    assert not report.is_lockup
    assert dict(report.registers)["PC"] == expected_pc
    row = FAULT_ROWS[kind]
    core = machine.board.chip.processor
    assert core.cfsr == row.cfsr
    assert core.hfsr == (row.hfsr or FORCED)


@pytest.mark.parametrize(("kind", "source", "place", "address"), CASES)
def test_an_enabled_handler_gets_the_fault_with_the_failing_pc_stacked(
    boot, kind: FaultKind, source: str, place: str | int, address: int | None
) -> None:
    row = FAULT_ROWS[kind]
    machine = boot(
        store(SHCSR, ALL_HANDLERS) + source + "\nb stop\nhandler: ldr r0, [sp, #24]\nlog r0\nmrs r0, ipsr\nlog r0\n"
        "b stop",
        {row.exception: "handler"},
    ).run(100)
    expected_pc = place if isinstance(place, int) else machine.label(place)
    assert machine.log == [expected_pc, row.exception]
    assert (machine.board.fault is None) == (row.exception != 3)


def test_a_handler_can_step_over_the_failing_instruction(run) -> None:
    machine = run(
        store(SHCSR, ALL_HANDLERS)
        + "udf\nlog #2\nb stop\nhandler: log #1\nldr r0, [sp, #24]\nadds r0, #2\nstr r0, [sp, #24]\nbx lr",
        {6: "handler"},
    )
    assert machine.log == [1, 2]
    assert machine.board.fault is None


def test_the_fault_status_registers_tell_and_are_cleared_by_ones(run) -> None:
    machine = run(
        "mov32 r1, #0x70000000\nbad: ldr r0, [r1, #0]\nb stop\n"
        f"handler: mov32 r1, #{CFSR}\nldr r0, [r1, #0]\nlog r0\nldr r0, [r1, #4]\nlog r0\nldr r0, [r1, #16]\nlog r0\n"
        "ldr r0, [r1, #0]\nstr r0, [r1, #0]\nldr r0, [r1, #0]\nlog r0\nb stop",
        {3: "handler"},
    )
    assert machine.log == [1 << 15 | 1 << 9, FORCED, 0x70000000, 0]


#: Asks for a reset three times; what stands behind the store is no code (Forth's `reset`: jjonethal/mecrisp-stellaris
#: a36d6d3, mecrisp-stellaris-source/common/interrupts-common.s:69).
NOTHING_BEHIND_A_RESET = """mov32 r1, #0x20000000
ldr r2, [r1, #0]
adds r2, #1
str r2, [r1, #0]
cmp r2, #4
beq stop
mov32 r1, #0xE000ED0C
mov32 r2, #0x05FA0004
mov32 r3, #0x70000000
str r2, [r1, #0]
{}
b stop"""


@pytest.mark.parametrize("behind", ["ldr r0, [r3, #0]", "udf", "cpsid f\nudf", "bkpt #1", "cpsid i\nsvc #1"])
def test_what_stands_behind_a_request_of_a_reset_is_no_fault(boot, behind: str) -> None:
    board = boot(NOTHING_BEHIND_A_RESET.format(behind)).run(100).board
    assert board.fault is None
    assert board.resets == {ResetCause.SOFTWARE: 3}
    assert not board.chip.processor.is_locked_up


def test_the_registers_of_the_report_are_those_of_the_fault(boot) -> None:
    machine = boot("movs r4, #44\nmovs r0, #10\nmov32 r1, #0x70000000\nldr r0, [r1, #0]").run(100)
    registers = dict(machine.board.fault.registers)
    assert (registers["R0"], registers["R1"], registers["R4"]) == (10, 0x70000000, 44)
    assert registers["SP"] == 0x2000_5000
    assert "R12" in machine.board.fault.register_dump
    text = str(machine.board.fault)
    assert "BusFault: read of nothing at start+" in text
    assert "address 0x70000000" in text


def test_division_by_zero_gives_zero_while_the_trap_is_off_and_traps_once_it_is_on(boot) -> None:
    """The same division is run before and after the trap is switched on: its block is translated anew."""
    machine = boot(
        "movs r4, #0\nloop: movs r1, #9\nmovs r2, #0\nbad: udiv r0, r1, r2\nlog r0\nmovs r2, #2\nudiv r0, r1, r2\n"
        "log r0\n" + store(CCR, DIV_0_TRP) + "b loop"
    ).run(200)
    assert machine.log == [0, 4]
    assert machine.board.fault.kind is FaultKind.DIVIDE_BY_ZERO
    assert machine.board.fault.pc == machine.label("bad")


def test_a_division_that_follows_the_switch_in_its_own_block_traps(boot) -> None:
    machine = boot("movs r3, #0\n" + store(CCR, DIV_0_TRP) + "bad: sdiv r0, r1, r3\nlog r0").run(50)
    assert machine.board.fault.kind is FaultKind.DIVIDE_BY_ZERO
    assert machine.board.fault.pc == machine.label("bad")


def test_unaligned_single_accesses_pass_while_the_trap_is_off(run) -> None:
    machine = run("mov32 r1, #0x20000801\nmovs r0, #77\nstr r0, [r1, #0]\nldr r0, [r1, #0]\nlog r0")
    assert machine.log == [77]


def test_an_aligned_multiple_transfer_passes_and_a_later_unaligned_one_traps(boot) -> None:
    machine = boot(
        "mov32 r1, #0x20000800\nmovs r4, #5\nloop: bad: ldmia.w r1, {r2, r3}\nlog #1\nadds r1, #4\nsubs r4, #1\n"
        "bne loop\nadds r1, #2\nb loop"
    ).run(200)
    assert machine.log == [1] * 5
    assert machine.board.fault.pc == machine.label("bad")


def test_a_conditional_multiple_transfer_that_is_skipped_does_not_trap(run) -> None:
    machine = run("mov32 r1, #0x20000801\nmovs r0, #1\ncmp r0, #0\nit eq\n.half 0xE891, 0x000C\nlog #1")
    assert machine.log == [1]


def test_a_fault_in_the_hard_fault_handler_locks_up(boot) -> None:
    machine = boot("first: udf\nhard: mov32 r1, #0x70000000\nsecond: ldr r0, [r1, #0]\nb stop", {3: "hard"})
    reached = machine.board.advance_to(1_000_000)
    assert reached.reason is Reason.HALT
    assert reached.now == 1_000_000
    report = machine.board.fault
    assert report.is_lockup
    assert report.pc == machine.label("first"), "the first fault tells the cause"
    assert "locked up" in str(report)
    assert machine.board.advance_to(2_000_000).reason is Reason.HALT


def test_an_svc_in_the_hard_fault_handler_locks_up(boot) -> None:
    assert boot("udf\nhard: svc #0\nb stop", {3: "hard"}).board.advance_to(1_000_000).reason is Reason.HALT


def test_a_reset_ends_a_lockup(boot) -> None:
    machine = boot("log #1\nudf\nhard: udf", {3: "hard"}).run(100)
    assert machine.board.fault.is_lockup
    machine.board.reset()
    assert machine.board.fault is None
    machine.run(100)
    assert machine.board.fault.is_lockup


def test_a_stack_that_grows_below_the_sram_faults_at_the_push_and_locks_up(boot) -> None:
    """The handler cannot be stacked either: nothing is left but a lockup."""
    machine = boot("bl deeper\nb stop\ndeeper: bad: push {r0-r6, lr}\nbl deeper", stack=0x2000_0800).run(1000)
    report = machine.board.fault
    assert (report.kind, report.pc) == (FaultKind.IMPRECISE_WRITE, machine.label("bad"))
    assert report.address < 0x2000_0000
    assert report.is_lockup
    assert machine.board.advance_to(machine.board.now_ns + 1000).reason is Reason.HALT


def test_an_interrupt_that_cannot_be_stacked_is_a_hard_fault(boot) -> None:
    machine = boot(
        "mov32 r1, #0x20000004\nmov sp, r1\n" + store(0xE000ED04, 1 << 28) + "isb\nb stop\n"
        "pendsv: log #1\nbx lr\nhard: log #2\nb stop",
        {14: "pendsv", 3: "hard"},
    ).run(100)
    assert machine.board.fault.kind is FaultKind.STACKING
    assert machine.log == [2]


def test_an_enabled_bus_fault_handler_gets_a_stacking_error(boot) -> None:
    machine = boot(
        store(SHCSR, ALL_HANDLERS) + store(0xE000ED20, 0xF0 << 16) + "mov32 r1, #0x20000004\nmov sp, r1\n"
        + store(0xE000ED04, 1 << 28) + "isb\nb stop\npendsv: log #1\nbx lr\nbus: log #3\nb stop",
        {14: "pendsv", 5: "bus"},
    ).run(100)  # fmt: skip
    assert machine.log == [3]


def test_a_return_from_a_stack_outside_memory_faults(boot) -> None:
    machine = boot("svc #0\nb stop\nhandler: mov32 r1, #0x20004FF8\nmov sp, r1\nbx lr", {11: "handler"}).run(100)
    assert (machine.board.fault.kind, machine.board.fault.address) == (FaultKind.UNSTACKING, 0x20004FF8)
    core = machine.board.chip.processor
    assert core.cfsr & FAULT_ROWS[FaultKind.UNSTACKING].cfsr


@pytest.mark.parametrize("link", [0xFFFFFFF1, 0xFFFFFFF5])
def test_an_impossible_return_is_a_usage_fault(boot, link: int) -> None:
    machine = boot(f"svc #0\nb stop\nhandler: mov32 r1, #{link}\nbx r1", {11: "handler"}).run(100)
    assert machine.board.fault.kind is FaultKind.INVALID_RETURN


def test_a_frame_that_contradicts_its_return_is_a_usage_fault(boot) -> None:
    machine = boot("svc #0\nb stop\nhandler: movs r1, #5\nstr r1, [sp, #28]\nbx lr", {11: "handler"}).run(100)
    assert machine.board.fault.kind is FaultKind.INVALID_RETURN


def test_a_handler_vector_outside_memory_faults(boot) -> None:
    machine = boot(store(0xE000ED08, 0x30000000) + "svc #0\nb stop").run(100)
    assert machine.board.fault.kind is FaultKind.VECTOR_READ
    assert machine.board.fault.is_lockup


def test_a_handler_vector_that_leads_nowhere_faults(boot) -> None:
    machine = boot("svc #0\nb stop", {11: 0x70000001}).run(100)
    assert (machine.board.fault.kind, machine.board.fault.pc) == (FaultKind.FETCH_ERROR, 0x70000000)


def test_a_handler_vector_without_its_thumb_bit_is_an_invalid_state(boot) -> None:
    machine = boot("svc #0\nb stop\nhandler: bx lr", {11: 0x08000200}).run(100)
    assert (machine.board.fault.kind, machine.board.fault.pc) == (FaultKind.INVALID_STATE, 0x08000200)


def test_running_off_the_end_of_the_code_faults(boot) -> None:
    """Erased flash is 0xFFFF: an undefined 32-bit instruction."""
    machine = boot("mov32 r1, #0x08008001\nbx r1").run(100)
    assert (machine.board.fault.kind, machine.board.fault.pc) == (FaultKind.UNDEFINED_INSTRUCTION, 0x08008000)


def test_an_ldm_fault_leaves_its_base_register_alone(boot) -> None:
    machine = boot("mov32 r1, #0x20004FFC\nldmia r1!, {r2-r4}").run(100)
    assert dict(machine.board.fault.registers)["R1"] == 0x20004FFC


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("vector", [0xFFFF_FFFF, 0xFFFF_FFF9, 0xFFFF_FFF1, 0xFFFF_FFFD])
def test_a_vector_that_looks_like_a_return_is_an_address(boot, vector, core, monkeypatch) -> None:
    # Only a branch in a handler returns (ARM B1.5.8); a vector is fetched from, and nothing executes up there.
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot("svc #0\nlog #1", {11: vector})
    machine.run(100)
    assert machine.board.chip.processor.cfsr == 1
    fault = str(machine.board.fault)
    assert fault.startswith(f"MemManage: instruction fetch from a region that must not be executed at {vector & ~1:#x}")
    assert f"(the vector of SVCall at 0x0000002c is {vector:#010x}" in fault
    assert ("erased flash" in fault) is (vector == 0xFFFF_FFFF)
    assert machine.log == []


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("store", ["str r2, [r1, #0]", "strb r2, [r1, #0]", "strh r2, [r1, #0]"])
def test_flash_is_programmed_by_halfwords_and_the_rest_is_a_bus_error(boot, store, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        "mov32 r1, #0x40022000\nmov32 r2, #0x45670123\nstr r2, [r1, #4]\nmov32 r2, #0xCDEF89AB\nstr r2, [r1, #4]\n"
        f"movs r2, #1\nstr r2, [r1, #16]\nmov32 r1, #0x08010000\nmov32 r2, #0x1234\n{store}\nlog #1"
    )
    machine.run(300)
    is_halfword = store.startswith("strh")
    assert machine.log == ([1] if is_halfword else [])
    assert machine.board.read_memory(0x0801_0000, 4) == (b"\x34\x12\xff\xff" if is_halfword else b"\xff" * 4)
    fault = machine.board.fault
    assert (fault is None) is is_halfword
    assert fault is None or (fault.kind.name, fault.address) == ("IMPRECISE_WRITE", 0x0801_0000)


@pytest.mark.parametrize("core", ["python", "native"])
@pytest.mark.parametrize("access", ["ldr r2, [r1, #0]", "str r2, [r1, #0]", "strb r2, [r1, #0]"])
def test_a_thread_without_privilege_faults_in_the_system_control_space(boot, access, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        "mov32 r1, #0xE000E014\nmov32 r2, #0x1234\nstr r2, [r1, #0]\nmovs r4, #1\nmsr control, r4\nisb\n"
        f"movs r2, #9\nmovs r5, #5\nwrong: {access}\nmovs r5, #6\nlog #1"
    ).run(300)
    board = machine.board
    assert machine.log == []
    assert (board.fault.pc, board.fault.address) == (machine.label("wrong"), 0xE000_E014)
    assert board.fault.kind.name == ("READ_ERROR" if access.startswith("ldr") else "WRITE_ERROR")
    assert board.register("R5") == 5
    assert board.register("R2") == 9
    assert board.chip.system.read(0xE014, 4) == 0x1234
    assert board.chip.processor.exception_number == 3


@pytest.mark.parametrize("core", ["python", "native"])
def test_a_handler_of_a_thread_without_privilege_has_it(boot, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        "movs r4, #1\nmsr control, r4\nisb\nsvc #0\nlog #2\nb stop\n"
        "svc: mov32 r1, #0xE000E014\nldr r0, [r1, #0]\nlog #1\nbx lr",
        {11: "svc"},
    ).run(300)
    assert machine.log == [1, 2]
    assert machine.board.fault is None


def came_back(returns: int, *, round_ns: int = 1_000, last_ns: int = 10_000) -> FaultReport:
    return FaultReport(
        kind=FaultKind.BREAKPOINT, exception=3, pc=0, where="main", address=None, registers=(), at_ns=0,
        returns=returns, last_ns=last_ns, round_ns=round_ns,
    )  # fmt: skip


@pytest.mark.parametrize(("returns", "repeats"), [(0, False), (15, False), (16, True), (17, True)])
def test_a_handler_comes_back_for_ever_from_its_sixteenth_return_on(returns: int, repeats: bool) -> None:
    assert MOST_RETURNS == 16
    report = came_back(returns)
    assert report.repeats_at(10_000) is repeats
    assert ("again and again" in str(report)) is repeats


@pytest.mark.parametrize(("now_ns", "repeats"), [(10_000, True), (12_000, True), (12_001, False)])
def test_what_has_not_come_back_for_two_rounds_has_ended(now_ns: int, repeats: bool) -> None:
    assert came_back(16).repeats_at(now_ns) is repeats


@pytest.mark.parametrize(("round_ns", "repeats"), [(5_000_000, True), (5_000_001, False)])
def test_a_handler_that_takes_long_is_seen_at_work(round_ns: int, repeats: bool) -> None:
    assert came_back(16, round_ns=round_ns).repeats_at(10_000) is repeats
