"""Exceptions by hand: entry, return, priorities, and the state that they save."""

import pytest

from bluepill_sim.core import Reg
from bluepill_sim.extension.library import library_path
from tests.bluepill_sim.machine import STACK

ICSR, AIRCR, SHPR3, ISER0, ISPR0, IPR0, STIR = (
    0xE000ED04,
    0xE000ED0C,
    0xE000ED20,
    0xE000E100,
    0xE000E200,
    0xE000E400,
    0xE000EF00,
)
PENDSV = 1 << 28
CORES = ["python", pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="not built"))]


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def test_svc_enters_its_handler_and_returns_after_it(run) -> None:
    machine = run("log #1\nsvc #5\nlog #3\nb stop\nsvc_handler: log #2\nbx lr", {11: "svc_handler"})
    assert machine.log == [1, 2, 3]


def test_every_way_of_returning_from_a_handler_works(run) -> None:
    machine = run(
        """
        svc #0
        log #2
        svc #1
        log #4
        b stop
handler: log #1
        push {lr}
        cmp r5, #0
        bne other
        movs r5, #1
        pop {pc}
other:  .half 0xF85D, 0xFB04   ; ldr pc, [sp], #4
        """,
        {11: "handler"},
    )
    assert machine.log == [1, 2, 1, 4]


def test_svc_to_pendsv_tail_chains_without_unstacking(run) -> None:
    """SVC pends PendSV of lower priority: PendSV runs right after it, on the same frame, 6 cycles later."""
    machine = run(
        store(SHPR3, 0xF0 << 16)
        + """svc #0
        log #4
        b stop
handler: log #1
        mov r5, sp
        mov32 r1, #0xE000ED04
        mov32 r2, #0x10000000
        str r2, [r1, #0]
        isb
        log #2
        bx lr
pendsv: mov r0, sp
        subs r0, r5, r0
        log r0
        bx lr""",
        {11: "handler", 14: "pendsv"},
    )
    assert machine.log == [1, 2, 0, 4]


def test_a_higher_priority_preempts_and_a_lower_one_waits(run) -> None:
    """IRQ 0 at 0x80 pends IRQ 1 at 0x40 (preempts at once) and IRQ 2 at 0xC0 (waits)."""
    machine = run(
        store(IPR0, 0x00C04080)
        + store(ISER0, 7)
        + store(STIR, 0)
        + """isb
        log #6
        b stop
irq0:   push {lr}
        log #1
        movs r2, #1
        str r2, [r1, #0]
        isb
        log #3
        movs r2, #2
        str r2, [r1, #0]
        isb
        log #4
        pop {pc}
irq1:   log #2
        bx lr
irq2:   log #5
        bx lr""",
        {16: "irq0", 17: "irq1", 18: "irq2"},
    )
    assert machine.log == [1, 2, 3, 4, 5, 6]


def test_priority_grouping_keeps_subpriorities_from_preempting(run) -> None:
    """With PRIGROUP = 7 no bit preempts: the handler ends first, then the higher subpriority comes."""
    machine = run(
        store(AIRCR, 0x05FA0700)
        + store(IPR0, 0x4080)
        + store(ISER0, 3)
        + store(STIR, 0)
        + """isb
        log #4
        b stop
irq0:   log #1
        movs r2, #1
        str r2, [r1, #0]
        isb
        log #2
        bx lr
irq1:   log #3
        bx lr""",
        {16: "irq0", 17: "irq1"},
    )
    assert machine.log == [1, 2, 3, 4]


def test_of_equal_priorities_the_lower_number_comes_first(run) -> None:
    machine = run(
        "cpsid i\n"
        + store(ISER0, 7)
        + store(ISPR0, 6)
        + "cpsie i\nlog #3\nb stop\nirq1: log #1\nbx lr\nirq2: log #2\nbx lr",
        {17: "irq1", 18: "irq2"},
    )
    assert machine.log == [1, 2, 3]


def test_an_svc_inside_an_it_block_puts_itstate_aside_and_back(run) -> None:
    """The handler must not start inside the interrupted IT block, and the rest of it must still be conditional."""
    machine = run(
        """
        movs r4, #1
        cmp r4, #1
        ittte eq
        .half 0xDF00
        .half 0x2502
        .half 0x2603
        .half 0x2504
        mov r0, r5
        log r0
        mov r0, r6
        log r0
        b stop
handler: movs r0, #9
        cmp r0, #1
        log #1
        bx lr""",
        {11: "handler"},
    )
    assert machine.log == [1, 2, 3]


def test_an_interrupt_between_two_instructions_of_an_it_block_keeps_its_state(run) -> None:
    """A store inside an IT block pends PendSV; the block ends first, then it comes, and nothing is lost."""
    machine = run(
        """
        mov32 r1, #0xE000ED04
        mov32 r2, #0x10000000
        cmp r5, #0
        itte eq
        .half 0x600A
        .half 0x2502
        .half 0x2609
        isb
        mov r0, r5
        log r0
        mov r0, r6
        log r0
        b stop
pendsv: log #1
        bx lr""",
        {14: "pendsv"},
    )
    assert machine.log == [1, 2, 0]


#: Who raises a request by one store of a word, and what to set up before: (address, word, exception, set-up).
SOURCES = {
    "PendSV": (ICSR, PENDSV, 14, ""),
    "STIR": (STIR, 6, 16 + 6, store(ISER0, 1 << 6)),
    "ISPR": (ISPR0, 1 << 6, 16 + 6, store(ISER0, 1 << 6)),
    # SWIER sets its bit again only after PR has been cleared, which the handler does.
    "EXTI": (0x40010410, 1, 16 + 6, store(ISER0, 1 << 6) + store(0x40010400, 1)),
    # TXEIE while TXE is set; the handler clears it.
    "USART": (
        0x4001380C, 0x2080, 16 + 37, store(0x40021018, 0x4000) + store(0x40013808, 69) + store(0xE000E104, 1 << 5),
    ),
}  # fmt: skip
QUENCH = {"EXTI": "mov32 r3, #0x40010414\nmovs r0, #1\nstr r0, [r3, #0]\n",
          "USART": "mov32 r3, #0x4001380c\nmov32 r0, #0x2000\nstr r0, [r3, #0]\n"
    "mov32 r3, #0xe000e284\nmovs r0, #32\nstr r0, [r3, #0]\n"}  # fmt: skip
#: r1 is the address and r2 the word; r6 counts the stores, r5 the handler's runs.
BLOCKS = {
    "three stores under IT": "itttt eq\n.half 0x600A, 0x3601, 0x600A, 0x3601\nitt eq\n.half 0x600A, 0x3601\n",
    "an IT block with an else": (
        "ittet eq\n.half 0x600A, 0x3601, 0x3610, 0x600A\nittet eq\n.half 0x3601, 0x600A, 0x3610, 0x3601\n"
    ),
    "three stores in a row": "str r2, [r1, #0]\nadds r6, #1\n" * 3,
}


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("block", BLOCKS)
def test_each_request_of_one_block_is_served_before_the_next_is_raised(
    core: str, source: str, block: str, boot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    address, word, number, set_up = SOURCES[source]
    machine = boot(
        f"{set_up}mov32 r1, #{address}\nmov32 r2, #{word}\nmovs r6, #0\ncmp r6, #0\nb go\ngo: {BLOCKS[block]}"
        "mov r0, r6\nlog r0\nb stop\n"
        f"handler: adds r5, #1\n{QUENCH.get(source, '')}bx lr\n",
        {number: "handler"},
    ).run(200)
    assert machine.log == [3]
    assert machine.board.register("R5") == 3


@pytest.mark.parametrize("core", CORES)
def test_a_debugger_changes_nothing_where_a_request_ends_a_block(
    core: str, boot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    source = (
        f"{store(ISER0, 1 << 6)}mov32 r1, #{STIR}\nmovs r2, #6\ncmp r2, #6\nb go\n"
        f"go: {BLOCKS['an IT block with an else']}b stop\nhandler: adds r5, #1\nbx lr\n"
    )
    ends = []
    for way in ("free", "breakpoints", "steps"):
        machine = boot(source, {16 + 6: "handler"})
        chip, go, stop = machine.board.chip, machine.label("go"), machine.label("stop")
        if way == "breakpoints":
            chip.engine.breakpoints.update(range(go, stop, 2))
        chip.engine.breakpoints.add(stop)
        seen: list[tuple[int, int]] = []
        for _ in range(200):
            (chip.step if way == "steps" else chip.advance_to)(1_000_000)
            seen.append((chip.engine.pc, chip.engine.cycle))
            if chip.engine.pc == stop and not chip.processor.nvic.pending:
                break
        registers = chip.engine.registers
        ends.append((chip.engine.pc == stop, chip.engine.cycle, registers[Reg.R5], registers[Reg.R6]))
        assert len(seen) == len(set(seen)), "each step gets somewhere"
    assert ends[0] == ends[1] == ends[2]
    assert ends[0][2:] == (3, 3)


@pytest.mark.parametrize("pad", range(58, 68))
def test_an_it_block_across_a_page_boundary_survives_stops_and_interrupts(boot, pad: int) -> None:
    """Unicorn cuts blocks at 1 KiB, maybe inside an IT block: stop at every boundary, with a tick each 7 µs."""
    source = (
        store(0xE000E014, 55)
        + store(0xE000E018, 0)
        + store(0xE000E010, 7)
        + "movs r5, #0\nmovs r6, #0\nmovs r4, #100\nb go\n"
        + "nop\n" * (pad + 260)
        + "go: cmp r4, #0\nitete ne\n.half 0x3501\n.half 0x3601\n.half 0x3502\n.half 0x3601\n"
        "subs r4, #1\nbne go\nmov r0, r5\nlog r0\nmov r0, r6\nlog r0\nb stop\n"
        "tick: movs r0, #0\ncmp r0, #0\nbx lr"
    )
    machine = boot(source, {15: "tick"}).run(2000, slice_us=0.001 * 125)
    assert machine.log == [300, 0]


def test_an_interrupt_line_that_stays_high_interrupts_again(boot) -> None:
    machine = boot(store(ISER0, 1 << 6) + "loop: b loop\nirq: log #1\nbx lr", {16 + 6: "irq"})
    chip = machine.board.chip
    machine.run(10)
    chip.fabric.set_line(6, True)
    machine.run(30)
    assert len(machine.log) > 2
    chip.fabric.set_line(6, False)
    machine.run(10)
    settled = len(machine.log)
    machine.run(10)
    assert len(machine.log) == settled


@pytest.mark.parametrize(("pending", "bits"), [(PENDSV, 1 << 28 | 14 << 12), (1 << 26, 1 << 26 | 15 << 12)])
def test_icsr_tells_what_is_pending_and_clears_it(run, pending: int, bits: int) -> None:
    machine = run(
        "cpsid i\n" + store(ICSR, pending) + "ldr r0, [r1, #0]\nlog r0\n" + store(ICSR, pending >> 1)
        + "ldr r0, [r1, #0]\nlog r0"
    )  # fmt: skip
    assert machine.log == [bits | 1 << 11, 1 << 11]


def test_icsr_and_shcsr_tell_the_handler_that_runs(run) -> None:
    machine = run(
        "svc #0\nb stop\nhandler: mov32 r1, #0xE000ED04\nldr r0, [r1, #0]\nlog r0\n"
        "mov32 r1, #0xE000ED24\nldr r0, [r1, #0]\nlog r0\nmrs r0, ipsr\nlog r0\nbx lr",
        {11: "handler"},
    )
    assert machine.log == [11 | 1 << 11, 1 << 7, 11]


@pytest.mark.parametrize("number", [43, 45, 100, 0x1FF])
def test_a_software_request_for_an_interrupt_that_does_not_exist_is_ignored(run, number: int) -> None:
    machine = run(
        store(STIR, number) + f"isb\nmov32 r1, #{ISPR0}\nldr r0, [r1, #0]\nlog r0\nldr r0, [r1, #4]\nlog r0\n"
        f"mov32 r1, #{ICSR}\nldr r0, [r1, #0]\nmovs r2, #1\nmov32 r2, #0x7FF000\n.half 0x4010\nlog r0"
    )
    assert machine.log == [0, 0, 0]


def test_a_software_request_pends_the_interrupt_of_its_number(run) -> None:
    machine = run(store(STIR, 42) + f"isb\nmov32 r1, #{ISPR0}\nldr r0, [r1, #4]\nlog r0")
    assert machine.log == [1 << 10]


@pytest.mark.parametrize("control", [0, 1, 2, 3])
@pytest.mark.parametrize("core", ["native", "python"])
def test_a_reset_begins_privileged_on_the_main_stack(
    control: int, core: str, boot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(f"mov32 r0, #0x20001000\nmsr psp, r0\nmovs r0, #{control}\nmsr control, r0\nisb\nb stop").run(100)
    machine.board.reset()
    assert [machine.board.register(name) for name in ("CONTROL", "MSP", "SP")] == [0, STACK, STACK]


@pytest.mark.parametrize("bit", [1 << 0, 1 << 1])
def test_what_aircr_keeps_for_debuggers_is_ignored_and_warned_of(run, bit: int) -> None:
    machine = run(store(AIRCR, 0x05FA0000 | bit) + "log #1")
    assert machine.log == [1]
    assert len(machine.board.warnings) == 1


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_line_that_is_high_keeps_its_interrupt_pending(core: str, boot, monkeypatch: pytest.MonkeyPatch) -> None:
    """ICPR clears what no line holds; of an active interrupt the line comes again when its handler returns."""
    monkeypatch.setenv("P2OS_CORE", core)
    chip = boot("nop").board.chip
    ispr1, icpr1, usart1 = 0xE204, 0xE284, 37

    def pending() -> bool:
        return bool(chip.system.read(ispr1, 4) >> usart1 - 32 & 1)

    chip.fabric.set_line(usart1, True)
    chip.system.write(icpr1, 4, 1 << usart1 - 32)
    assert pending()
    chip.processor.nvic.activate(16 + usart1)
    chip.processor.nvic.pend(16 + usart1)
    chip.system.write(icpr1, 4, 1 << usart1 - 32)
    assert not pending(), "the handler runs"
    chip.processor.nvic.deactivate(16 + usart1)
    assert pending(), "and has returned"
    chip.fabric.set_line(usart1, False)
    chip.system.write(icpr1, 4, 1 << usart1 - 32)
    assert not pending()
