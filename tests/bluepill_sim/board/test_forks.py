"""A snapshot anywhere, gone on from on the same board, on another, or in another process: one and the same future."""

import hashlib
import pickle
import random

import pytest

from bluepill_sim.core import BlockRow

RCC_APB2ENR, GPIOA_CRL, GPIOA_CRH = 0x40021018, 0x40010800, 0x40010804
USART1_BRR, USART1_CR1 = 0x40013808, 0x4001380C
EXTI_IMR, EXTI_RTSR = 0x40010400, 0x40010408
END_NS = 5_500_000


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


#: A tick, a sender by interrupt, pins, a thread on PSP without privilege, IT blocks, exclusives, code in SRAM, IWDG.
EVERYTHING = (
    store(RCC_APB2ENR, 0x4005) + store(GPIOA_CRL, 0x22242222) + store(GPIOA_CRH, 0x444444A4)
    + store(USART1_BRR, 69) + store(USART1_CR1, 0x20AC) + store(0xE000E104, 1 << 5)
    + store(0x40003000, 0xCCCC)
    + store(0xE000E014, 1999) + store(0xE000E018, 0) + store(0xE000E010, 7)
    + store(0x2000_0800, 0x4770_3001)  # adds r0, #1; bx lr
    + """
        mov32 r0, #0x20003000
        msr psp, r0
        movs r0, #3
        msr control, r0
        isb
        mov32 r4, #0x40010810
        mov32 r5, #0x20000900
loop:   ldrex r0, [r5]
        adds r0, #1
        strex r1, r0, [r5]
        cmp r1, #0
        ite eq
        moveq1: adds r2, #1
        adds r3, #1
        movs r1, #1
        str r1, [r4, #0]
        mov32 r6, #0x20000801
        blx r6
        mov32 r1, #65536
        str r1, [r4, #0]
        udiv r0, r1, r0
        svc #0
        b loop
call:   mov32 r1, #0xE000ED04
        mov32 r2, #0x10000000
        str r2, [r1, #0]
        bx lr
sv:     movs r1, #1
        bx lr
tick:   mov32 r1, #0x40003000
        mov32 r2, #0xAAAA
        str r2, [r1, #0]
        bx lr
uart:   mov32 r1, #0x40013800
        ldr r2, [r1, #0]
        ldr r3, [r5, #0]
        str r3, [r1, #4]
        bx lr"""
)  # fmt: skip
VECTORS = {11: "call", 14: "sv", 15: "tick", 16 + 37: "uart"}


def future(machine, end_ns: int) -> str:
    """Go on to a time, with an input on the way; return a hash of all that happens, and of what is then."""
    rows: list[BlockRow] = []
    machine.edges.clear()
    machine.sent.clear()
    machine.board.chip.record_blocks(10_000, lambda recorder: rows.extend(recorder.drain()))
    machine.board.advance_to(max(machine.board.now_ns, 5_000_000))
    machine.board.pin("PA4").drive(True)
    machine.board.usart1.receive(b"x")
    machine.board.advance_to(end_ns)
    rows += machine.board.chip.engine.recorder.drain()
    machine.board.chip.stop_recording()
    assert len(rows) > 100
    assert machine.board.fault is None
    all_of_it = (rows, machine.edges, bytes(machine.sent), machine.board.snapshot())
    return hashlib.sha256(repr(all_of_it).encode()).hexdigest()


def revived(data: bytes) -> object:
    return pickle.loads(data)  # noqa: S301 - our own bytes


@pytest.mark.parametrize("seed", range(6))
def test_a_fork_has_the_same_future(boot, seed: int) -> None:
    """The moment is any: in a handler, asleep, in the middle of a character, at a breakpoint inside a block."""
    machine = boot(EVERYTHING, VECTORS)
    rng = random.Random(seed)
    machine.board.advance_to(rng.randrange(300_000, 4_900_000))
    if seed % 3 == 0:
        breakpoints = machine.board.chip.engine.breakpoints
        breakpoints.update(range(machine.label("loop") + 4, machine.label("uart") + 8, 6))
        for _ in range(rng.randrange(1, 9)):
            machine.board.advance_to(4_900_000)
        breakpoints.clear()
    kept = pickle.dumps(machine.board.snapshot())
    first = future(machine, END_NS)
    machine.board.restore(revived(kept))
    assert future(machine, END_NS) == first
    other = boot(EVERYTHING, VECTORS)
    other.run(seed * 100)
    other.board.restore(revived(kept))
    assert future(other, END_NS) == first


#: A loop without exclusives, the same one with two wait states, then one with an exclusive pair that ticks come into.
LATER_OTHERWISE = (
    store(0xE000E014, 299) + store(0xE000E018, 0) + store(0xE000E010, 7)
    + """
        movs r7, #0
        mov32 r4, #0x40022000
        mov32 r5, #0x20000900
again:  mov32 r3, #1000
loop:   adds r2, #1
        adds r2, r2, r7
        subs r3, #1
        bne loop
        movs r1, #2
        str r1, [r4, #0]
        adds r7, #1
        cmp r7, #2
        bne again
pair:   ldrex r0, [r5]
        movs r3, #20
wait:   subs r3, #1
        bne wait
        adds r0, #1
        strex r1, r0, [r5]
        adds r6, r6, r1
        b pair
tick:   bx lr"""
)  # fmt: skip


@pytest.mark.parametrize("back_to_us", [300, 1_000])
def test_what_was_worked_out_of_blocks_later_does_not_hold_after_a_restore(boot, back_to_us: int) -> None:
    """Back at a moment with other wait states, and before the first exclusive, on the board that has run on."""
    machine = boot(LATER_OTHERWISE, {15: "tick"}).run(back_to_us)
    kept = machine.board.snapshot()
    first = future(machine, END_NS)
    assert machine.board.chip.clocks.flash_wait_states == 2
    assert machine.board.register("r6") > 10  # stores that a tick has kept from being made
    machine.board.restore(kept)
    assert machine.board.chip.clocks.flash_wait_states == 2 * (back_to_us > 300)
    assert future(machine, END_NS) == first


def test_two_forks_with_different_inputs_part_and_do_not_touch_each_other(boot) -> None:
    machine, other = boot(EVERYTHING, VECTORS), boot(EVERYTHING, VECTORS)
    machine.board.advance_to(2_000_000)
    kept = machine.board.snapshot()
    other.board.restore(kept)
    other.board.usart1.receive(b"y")
    assert future(other, END_NS) != future(machine, END_NS)
    machine.board.restore(kept)
    assert machine.board.snapshot() == kept


def test_taking_snapshots_changes_nothing(boot) -> None:
    plain, watched = boot(EVERYTHING, VECTORS), boot(EVERYTHING, VECTORS)
    plain.board.advance_to(3_000_000)
    while watched.board.now_ns < 3_000_000:
        watched.board.advance_to(min(3_000_000, watched.board.now_ns + 50_000))
        watched.board.snapshot()
    assert future(watched, END_NS) == future(plain, END_NS)


#: EXTI0 by a rising PA0; its handler logs what the program has put out by then.
THREE_STORES = (
    store(RCC_APB2ENR, 0x4) + store(EXTI_IMR, 1) + store(EXTI_RTSR, 1) + store(0xE000E100, 1 << 6)
    + """
        mov32 r4, #0x4001080C
loop:   adds r2, #1
        str r2, [r4, #0]
        adds r2, #1
second: str r2, [r4, #0]
        adds r2, #1
        str r2, [r4, #0]
        b loop
pin:    mov32 r0, #0x40010414
        movs r1, #1
        str r1, [r0, #0]
        ldr r0, [r4, #0]
        log r0
        bx lr"""
)  # fmt: skip


@pytest.mark.parametrize("core", ["python", "native"])
def test_a_fork_inside_a_block_with_an_interrupt_just_raised_has_the_same_future(boot, core, monkeypatch) -> None:
    """The pin rises at a breakpoint: the interrupt waits for the boundary, as it would without the breakpoint."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine, other = (boot(THREE_STORES, {16 + 6: "pin"}) for _ in range(2))
    machine.board.chip.engine.breakpoints.add(machine.label("second"))
    machine.board.advance_to(100_000)
    machine.board.chip.engine.breakpoints.clear()
    machine.board.pin("PA0").drive(True)
    other.board.restore(machine.board.snapshot())
    logs = [each.run(10).log for each in (machine, other)]
    put_out = (1 << 6) + 3  # r2 held the bit of EXTI0
    assert logs == [[put_out], [put_out]]
    assert machine.board.snapshot() == other.board.snapshot()


@pytest.mark.parametrize("core", ["python", "native"])
def test_an_interrupt_raised_before_a_halt_inside_a_block_comes_before_the_next_access(boot, core, monkeypatch) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    source = THREE_STORES.replace("loop: ", "mov32 r5, #0xE000E200\nloop: str r2, [r5, #0]\n")
    plain, machine, other = (boot(source, {16 + 6: "pin"}) for _ in range(3))
    machine.board.chip.engine.breakpoints.add(machine.label("loop") + 2)
    machine.board.advance_to(100_000)
    machine.board.chip.engine.breakpoints.clear()
    other.board.restore(machine.board.snapshot())
    plain.run(110)
    logs = [each.run(10).log[:2] for each in (machine, other)]
    assert logs == [plain.log[:2]] * 2
    assert logs[0] == [0, (1 << 6) + 3]  # nothing was put out when it first came
