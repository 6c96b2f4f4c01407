"""Time: block costs, exact stamps, counters read inside a block, and slices that change nothing."""

import hashlib

import pytest

from bluepill_sim.core.block_cost import measure_block

RCC_CR, RCC_CFGR, RCC_APB2ENR, FLASH_ACR = 0x40021000, 0x40021004, 0x40021018, 0x40022000
GPIOA_CRL, GPIOA_CRH, GPIOA_BSRR = 0x40010800, 0x40010804, 0x40010810
USART1_SR, USART1_DR, USART1_BRR, USART1_CR1 = 0x40013800, 0x40013804, 0x40013808, 0x4001380C
SYSTICK_CTRL, SYSTICK_LOAD, SYSTICK_VAL = 0xE000E010, 0xE000E014, 0xE000E018
DEMCR, DWT_CTRL, DWT_CYCCNT = 0xE000EDFC, 0xE0001000, 0xE0001004
#: HSI after reset: one cycle in ns.
CYCLE_NS = 125


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


PORT_A = store(RCC_APB2ENR, 1 << 2) + store(GPIOA_CRL, 0x22222222)
COUNT_CYCLES = store(DEMCR, 1 << 24) + store(DWT_CTRL, 1) + f"mov32 r6, #{DWT_CYCCNT}\n"

#: Source, cycles when it falls through, cycles when it branches; 0 wait states, TRM r1p1 chapter 18.
KERNELS = [
    ("nop\nnop\nnop", 3, 3),
    ("movs r0, #1\nadds r0, r0, r1\nmuls r0, r1", 3, 3),
    ("mla r0, r1, r2, r3", 2, 2),
    ("udiv r0, r1, r2", 7, 7),
    ("ldr r0, [r1, #0]", 2, 2),
    ("ldr r0, [r1, #0]\nldr r2, [r3, #0]\nldr r4, [r5, #0]", 4, 4),  # loads in a row overlap
    ("ldr r0, [r1, #0]\nldr r2, [r0, #0]", 4, 4),  # the address needs the value
    ("ldr r0, [r1, #0]\nldr r2, [r3, r0]", 4, 4),
    ("str r0, [r1, #0]\nstr r0, [r1, #4]", 2, 2),
    ("str r0, [r1, r2]", 2, 2),
    ("ldr r0, [r1, #0]\nstr r0, [r2, r3]", 3, 3),
    ("push {r0-r3, lr}", 6, 6),
    ("pop {r0-r3}", 5, 5),
    ("pop {r0-r3, pc}", 6, 9),
    ("ldmia r1!, {r2-r5}", 5, 5),
    ("ldrd r0, r1, [r2]", 3, 3),
    ("ldrex r0, [r1]", 2, 2),
    ("bx lr", 1, 3),
    ("bl 0", 1, 2),
    ("subs r0, #1\nbne 0", 2, 3),  # 2000 loops are about 6000 cycles
    ("isb", 4, 4),
    ("cpsid i", 2, 2),
    ("it eq\nnop", 2, 2),
    (".half 0xE8DF, 0xF001", 3, 6),  # TBB: at least six cycles
    (".half 0xF8DF, 0xF004", 2, 5),  # LDR PC: at least five cycles
]


@pytest.mark.parametrize(("source", "straight", "taken"), KERNELS)
def test_a_block_costs_what_the_manual_says(assemble, source: str, straight: int, taken: int) -> None:
    block = measure_block(assemble(source, 0).code, 0, 0, has_prefetch=True)
    assert (block.straight, block.taken) == (straight, taken)


def test_offsets_inside_a_block_are_the_cycles_before_each_instruction(assemble) -> None:
    block = measure_block(assemble("ldr r0, [r1, #0]\nnop\nudiv r0, r1, r2\nnop", 0).code, 0x100, 0, has_prefetch=True)
    assert block.offsets == {0x100: 0, 0x102: 2, 0x104: 3, 0x108: 10}
    assert [block.cycles_until(address) for address in (0x104, 0x10A, 0x500)] == [3, 11, 11]


def test_the_prefetch_buffer_feeds_narrow_code_and_stalls_wide_code(assemble) -> None:
    """At 2 wait states a line of 8 bytes comes every 3 cycles: four narrow instructions take 4, two wide ones 3."""
    narrow = assemble("nop\n" * 32, 0).code
    wide = assemble("mov32 r0, #1\n" * 16, 0).code  # 32 instructions
    assert measure_block(narrow, 0, 2, has_prefetch=True).straight == 32
    # The first line is there; each of the 15 others comes 3 cycles after the one before, and runs 2 cycles.
    assert measure_block(wide, 0, 2, has_prefetch=True).straight == 15 * 3 + 2
    assert measure_block(narrow, 0, 2, has_prefetch=False).straight == 32 + 7 * 2
    assert measure_block(narrow, 0, 1, has_prefetch=False).straight == 32 + 7


def test_a_taken_branch_waits_for_the_flash_unless_it_stays_in_its_line(assemble) -> None:
    far = measure_block(assemble("nop\n" * 7 + "bne 0", 0).code, 0, 2, has_prefetch=True)
    near = measure_block(assemble("subs r0, #1\nbne 0", 0).code, 0, 2, has_prefetch=True)
    assert far.taken - far.straight == 1 + 2
    assert near.taken - near.straight == 1


def test_a_literal_load_waits_for_the_flash(assemble) -> None:
    code = assemble(".half 0x4801", 0).code
    assert measure_block(code, 0, 2, has_prefetch=True).straight == 4


def test_a_delay_loop_takes_three_cycles_a_round(run) -> None:
    machine = run(
        COUNT_CYCLES + "mov32 r4, #2000\nisb\nldr r5, [r6, #0]\nloop: subs r4, #1\nbne loop\nldr r0, [r6, #0]\n"
        "subs r0, r0, r5\nlog r0"
    )
    (cycles,) = machine.log
    assert cycles == 2 + 2000 * 3 - 1  # the load; the last branch falls through


def test_block_costs_agree_with_single_instructions(assemble) -> None:
    """Without overlap of loads, a block is the sum of its instructions."""
    lines = ["movs r0, #1", "mla r0, r1, r2, r3", "udiv r1, r2, r3", "str r0, [r1, #0]", "push {r0-r2}", "cpsid i"]
    single = [measure_block(assemble(line, 0).code, 0, 0, has_prefetch=True).straight for line in lines]
    assert measure_block(assemble("\n".join(lines), 0).code, 0, 0, has_prefetch=True).straight == sum(single)


def test_counters_move_inside_a_straight_run_of_code(run) -> None:
    machine = run(
        COUNT_CYCLES + "isb\nldr r3, [r6, #0]\nnop\nnop\nnop\nldr r4, [r6, #0]\nsubs r0, r4, r3\nlog r0\n"
        + store(SYSTICK_LOAD, 1000) + store(SYSTICK_VAL, 0) + store(SYSTICK_CTRL, 5)
        + f"mov32 r6, #{SYSTICK_VAL}\nisb\nldr r3, [r6, #0]\nnop\nnop\nnop\nldr r4, [r6, #0]\nsubs r0, r3, r4\nlog r0"
    )  # fmt: skip
    assert machine.log == [5, 5]  # a load of two cycles and three nops


def test_cyccnt_can_be_set_stopped_and_needs_trcena(run) -> None:
    load = "ldr r0, [r6, #0]\nlog r0\n"
    machine = run(
        f"mov32 r6, #{DWT_CYCCNT}\n" + store(DWT_CTRL, 1) + load + COUNT_CYCLES + "movs r0, #0\nstr r0, [r6, #0]\n"
        + load + store(DEMCR, 0) + load + load + store(DWT_CYCCNT, 5) + load + store(DWT_CTRL, 0)
        + f"mov32 r1, #{DWT_CTRL}\nldr r0, [r1, #0]\nlog r0\nmov32 r1, #{DEMCR}\nldr r0, [r1, #0]\nlog r0"
    )  # fmt: skip
    off, after_write, stopped, still, set_to, control, demcr = machine.log
    assert off == 0
    assert after_write == 1  # the cycle of the store
    assert stopped == still > after_write
    assert (set_to, control, demcr) == (5, 0x40000000, 0)


def test_an_edge_is_stamped_with_the_time_of_its_instruction(boot) -> None:
    """Two stores in one block, five nops between them: six cycles of 125 ns."""
    machine = boot(PORT_A + "mov32 r1, #0x40010810\nmovs r2, #1\nisb\nmov32 r3, #65536\nstr r2, [r1, #0]\n"
                   + "nop\n" * 5 + "str r3, [r1, #0]").run(100)  # fmt: skip
    high, low = [at for name, drive, at in machine.edges if name == "PA0"][-2:]
    assert low - high == 6 * CYCLE_NS


def test_the_first_handler_instruction_comes_twelve_cycles_after_the_boundary(boot) -> None:
    """SysTick wraps at a known cycle while the core sleeps: entry takes 12 cycles, movs 1, then the edge."""
    machine = boot(
        PORT_A + "mov32 r1, #0x40010810\nmovs r2, #1\n" + "mov32 r4, #0xE000E010\nmov32 r5, #999\nstr r5, [r4, #4]\n"
        "movs r5, #7\nstr r5, [r4, #8]\nstr r5, [r4, #0]\nwfi\nb stop\ntick: movs r3, #1\nstr r2, [r1, #0]\nbx lr",
        {15: "tick"},
    ).run(10)  # fmt: skip
    assert machine.board.is_asleep
    tick = machine.board.chip.processor.systick.next_cycle
    machine.run(500)
    (edge,) = [at for name, drive, at in machine.edges if drive == "high"]
    assert edge == (tick + 12 + 1) * CYCLE_NS


PLL = (
    store(FLASH_ACR, 0x12)
    + store(RCC_CR, 0x10081)
    + "hse: ldr r2, [r1, #0]\n.half 0x0392\nbpl hse\n"  # lsls r2, r2, #14
    + store(RCC_CFGR, 1 << 16 | 7 << 18 | 4 << 8)
    + store(RCC_CR, 0x1010081)
    + "pll: ldr r2, [r1, #0]\n.half 0x0192\nbpl pll\n"  # lsls r2, r2, #6
    + store(RCC_CFGR, 1 << 16 | 7 << 18 | 4 << 8 | 2)
)

#: Everything at once: PLL, a tick, a serial line by polling, an input by EXTI, pins, divisions, sleep.
BUSY = (
    PLL
    + store(RCC_APB2ENR, 0x4005)
    + store(GPIOA_CRL, 0x22242222)
    + store(GPIOA_CRH, 0x444444A4)
    + store(USART1_BRR, 625)
    + store(USART1_CR1, 0x2008)
    + store(0x40010408, 1 << 4)
    + store(0x40010400, 1 << 4)
    + store(0xE000E100, 1 << 10)
    + store(SYSTICK_LOAD, 7199)
    + store(SYSTICK_VAL, 0)
    + store(SYSTICK_CTRL, 7)
    + """
        movs r5, #0
loop:   mov32 r1, #0x40013800
        movs r3, #128
full:   ldr r2, [r1, #0]
        .half 0x421A
        beq full
        adds r5, #1
        str r5, [r1, #4]
        mov32 r1, #0x40010810
        movs r2, #1
        str r2, [r1, #0]
        mov32 r3, #65536
        udiv r2, r3, r5
        str r3, [r1, #0]
        cpsid i
        wfi
        cpsie i
        isb
        b loop
tick:   mov32 r1, #0x4001080C
        ldr r2, [r1, #0]
        movs r3, #2
        .half 0x405A
        str r2, [r1, #0]
        bx lr
irq:    mov32 r1, #0x40010414
        movs r2, #16
        str r2, [r1, #0]
        mov32 r1, #0x40010810
        movs r2, #4
        str r2, [r1, #0]
        mov32 r2, #0x40000
        str r2, [r1, #0]
        bx lr"""
)


def trace_of(boot, slice_us: float | None, watched: bool = False) -> tuple[str, int]:
    """Run the busy program for 5 ms with inputs at fixed times; return a hash of all that came out, and how much."""
    machine = boot(BUSY, {15: "tick", 16 + 10: "irq"})
    if watched:
        machine.board.subscribe_pins(["PA1"], lambda _rows: None, ends_slice=["PA1"])
    end, inputs = 5_000_000, [2_600_123, 3_000_000, 3_141_592, 4_000_001]
    level = False
    while machine.board.now_ns < end:
        now = machine.board.now_ns
        if inputs and now >= inputs[0]:
            inputs.pop(0)
            level = not level
            machine.board.pin("PA4").drive(level)
        limit = min([end, *inputs[:1]])
        machine.board.advance_to(limit if slice_us is None else min(limit, now + int(slice_us * 1000)))
    data = repr((machine.edges, bytes(machine.sent), machine.log)).encode()
    return hashlib.sha256(data).hexdigest(), len(machine.edges) + len(machine.sent)


def test_the_length_of_the_slices_changes_nothing(boot) -> None:
    whole, count = trace_of(boot, None)
    assert count > 100
    assert trace_of(boot, 1000) == (whole, count)
    assert trace_of(boot, 100) == (whole, count)
    assert trace_of(boot, 7) == (whole, count)
    assert trace_of(boot, 100, watched=True) == (whole, count)


def test_the_clock_tree_sets_the_speed_of_the_core(boot) -> None:
    machine = boot(PLL + "loop: nop\nb loop").run(5000)
    assert machine.board.hclk_hz == 72_000_000
    before, at = machine.board.cycle, machine.board.now_ns
    machine.run(1000)
    assert machine.board.cycle - before == pytest.approx((machine.board.now_ns - at) * 72 // 1000, abs=1)


def test_a_branch_to_itself_passes_time_without_running(boot) -> None:
    machine = boot("spin: b spin").run(1_000_000)
    assert machine.board.now_ns >= 1_000_000_000
    assert machine.board.pc == machine.label("spin")
    # Two cycles a round, from the boundary after the two instructions that set R7 up.
    assert machine.board.cycle % 2 == boot("spin: b spin").run(1).board.cycle % 2


def test_a_conditional_branch_to_itself_is_left_only_by_an_interrupt(boot) -> None:
    machine = boot(
        store(SYSTICK_LOAD, 799) + store(SYSTICK_VAL, 0) + store(SYSTICK_CTRL, 7)
        + "movs r4, #1\ncmp r4, #1\nspin: beq spin\nb stop\n"
        "tick: log #1\nmovs r1, #0\nldr r2, [sp, #28]\nmov32 r3, #0x01000000\nstr r3, [sp, #28]\nbx lr",
        {15: "tick"},
    ).run(500)  # fmt: skip
    assert machine.log[0] == 1
    assert machine.is_done


def test_code_costs_the_same_at_both_aliases_of_the_flash(run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each block ends where it does at its own alias: one that falls through is not taken for one that branches."""
    source = COUNT_CYCLES + (
        "movs r4, #3\nmov r5, pc\n.half 0x022D\n.half 0x0A2D\nadds r5, #7\nb loop\n"  # r5: f at 0x00000000 and up
        "f: cmp r0, #200\nbeq g\ng: bx lr\n"
        "loop: ldr r2, [r6, #0]\nbl f\nldr r3, [r6, #0]\nsubs r0, r3, r2\nlog r0\n"
        "ldr r2, [r6, #0]\nblx r5\nldr r3, [r6, #0]\nsubs r0, r3, r2\nlog r0\nsubs r4, #1\nbne loop"
    )
    logs = []
    for core in ("native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        logs.append(run(source).log)
    assert logs[0] == logs[1]
    assert len(set(logs[0][::2])) == len(set(logs[0][1::2])) == 1
