"""`P2OS_CORE=exact`: what is due is acted on before the first instruction that begins then or later.

Each vector is derived by hand: SysTick is set going by a store, and comes so many cycles behind it; the handler writes
down what was stacked. Cycles are those of the Cortex-M3 TRM r1p1, table 18-1, at 0 wait states (HSI, 125 ns).
"""

from collections.abc import Callable
from itertools import accumulate

import pytest

from bluepill_sim import BluePill
from tests.bluepill_sim.core.interpreter.test_boards import live, state
from tests.bluepill_sim.machine import COUNTER_ON, Machine
from tests.bluepill_sim.native.test_native_core import PROGRAMS, story

CYCLE_NS = 125
SYSTICK, PENDSV, EXTI0 = 15, 14, 22
Z_FLAG, IT_BITS = 1 << 30, 0x0600_FC00

#: The store that ends this takes one cycle, and the tick comes `load` cycles behind it.
START = """
mov32 r5, #0x20000800
movs r3, #9
mov32 r4, #k2+1
mov32 r1, #0xE000E010
movs r2, #{load}
str r2, [r1, #4]
movs r2, #7
str r2, [r1, #0]
"""
HANDLER = """
b stop
tick: ldr r0, [sp, #24]
str r0, [r7, #0]
ldr r0, [sp, #28]
str r0, [r7, #4]
adds r7, #8
mov32 r1, #0xE000E010
movs r2, #0
str r2, [r1, #0]
mov32 r1, #0xE000ED04
mov32 r2, #0x0A000000
str r2, [r1, #0]
bx lr
"""
#: Name, and instructions with their cycles.
PAYLOADS: list[tuple[str, list[tuple[str, int]]]] = [
    ("one cycle each", [("nop", 1), ("adds r4, #1", 1), ("mov r6, r4", 1), ("nop", 1), ("muls r4, r3", 1), ("nop", 1)]),
    # The second load overlaps the first (1), a store behind a load does so only where its offset is a register.
    ("memory", [("ldr r3, [r5, #0]", 2), ("ldr r4, [r5, #4]", 1), ("str r3, [r5, #8]", 1), ("strb r3, [r5, r4]", 2),
                ("nop", 1)]),
    # Left undone: long multiplications (chosen 4; 5 with accumulation), divisions (chosen 7), several words (1 and one
    # each).
    ("left undone", [("nop", 1), (".half 0xFBA3, 0x4603", 4), (".half 0xFBC3, 0x4603", 5), ("udiv r4, r3, r3", 7)]),
    ("several words", [("push {r2-r4}", 4), ("stmia r5!, {r2, r3}", 3), ("pop {r2-r4}", 4), ("nop", 1)]),
    # pop {r3, pc}, over a nop: 3, and a refill of 3 in which it is done.
    ("returning", [("push {r3, r4}", 3), (".half 0xBD08\nnop", 6), ("nop", 1)]),
    ("two cycles", [("mla r4, r3, r3, r4", 2), ("mla r4, r3, r3, r4", 2), ("nop", 1)]),
    # A branch taken: 1 and a refill of 1; one that is not: 1.
    ("branches", [("b k1", 2), ("cbz r5, k4", 1), ("nop", 1), ("bl k4", 2), ("nop", 1)]),
    ("pairs of words", [("strd r3, r4, [r5, #16]", 3), ("ldrd r3, r4, [r5, #16]", 3), ("nop", 1)]),
    ("conditional", [("cmp r3, #9", 1), ("ite eq", 1), ("movs r4, #1", 1), ("movs r4, #2", 1), ("nop", 1)]),
    # Flags that the block overwrites are stacked where the exception comes before.
    ("flags", [("movs r4, #0", 1), ("adds r4, #1", 1), ("movs r4, #0", 1), ("adds r4, #2", 1), ("cmp r4, #2", 1)]),
]  # fmt: skip

#: Those whose instructions of several cycles are left undone.
UNDONE = {"left undone", "several words", "returning"}

Boot = Callable[..., Machine]


@pytest.fixture(autouse=True)
def _exact(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")


def program(payload: list[tuple[str, int]], load: int) -> str:
    return START.format(load=load) + "\n".join(f"k{n}: {text}" for n, (text, _) in enumerate(payload)) + HANDLER


@pytest.mark.parametrize(("name", "payload"), PAYLOADS)
def test_an_interrupt_comes_before_the_first_instruction_that_begins_then_or_later(
    boot: Boot, name: str, payload: list[tuple[str, int]]
) -> None:
    begins = [0, *accumulate(cycles for _, cycles in payload)]
    undisturbed = boot(program(payload, 200), {SYSTICK: "tick"}).run(18)
    for load in range(1, begins[-1] + 1):
        machine = boot(program(payload, load), {SYSTICK: "tick"}).run(60)
        number = next(n for n, at in enumerate(begins) if at >= load)
        if name in UNDONE and load < begins[number] - (3 if "0xBD08" in payload[number - 1][0] else 0):
            number -= 1
        expected = machine.label(f"k{number}") if number < len(payload) else machine.label("tick") - 2
        assert machine.log[0] == expected, f"{name}: {load} cycles behind the store"
        for register in ("R3", "R4", "R5", "R6"):
            assert machine.board.register(register) == undisturbed.board.register(register), (name, load)
        xpsr = machine.log[1]
        if (
            name == "conditional"
        ):  # ITE: mask 1100 before the first of the two, 1000 with the condition's last bit 1 after it
            assert xpsr & IT_BITS == {2: 0x0C00, 3: 0x1800}.get(number, 0), load
        if name == "flags":
            assert bool(xpsr & Z_FLAG) == (number in {1, 3} or number == len(payload)), load


def test_an_interrupt_comes_at_its_instruction_in_a_loop_that_is_known(boot: Boot) -> None:
    """Rounds of 3 + 2 cycles, each of which counts, or their time would pass at once; some thirtieth is interrupted."""
    payload = [("adds r4, #1", 1), ("nop", 1), ("nop", 1), ("b k0", 2)]
    for load in range(150, 160):
        machine = boot(program(payload, load), {SYSTICK: "tick"}).run(60)
        assert machine.log[0] == machine.label(("k0", "k1", "k2", "k3", "k0")[load % 5]), load


def test_what_comes_in_the_midst_of_a_long_instruction_without_an_interrupt_takes_no_time(boot: Boot) -> None:
    source = (
        COUNTER_ON + "mov32 r6, #0xE0001000\n" + program([("udiv r4, r3, r3", 7), ("ldr r0, [r6, #4]\nlog r0", 4)], 200)
    )
    quiet = source.replace("movs r2, #7", "movs r2, #5")  # it counts, and no exception comes of it
    ends = [boot(quiet.replace("#200", f"#{load}")).run(40).log for load in (200, *range(1, 10))]
    assert ends == ends[:1] * 10


def test_an_instruction_is_left_undone_wherever_a_slice_ends(boot: Boot) -> None:
    """A division of seven cycles: the tick in its midst, and a deadline before, at and after that."""
    payload = [("udiv r4, r3, r3", 7), ("nop", 1)]
    for load in (2, 4, 6):
        whole = boot(program(payload, load), {SYSTICK: "tick"}).run(40)
        assert whole.log[0] == whole.label("k0")
        for cycle in range(10, 24):
            parts = boot(program(payload, load), {SYSTICK: "tick"})
            parts.board.advance_to(cycle * CYCLE_NS)
            assert parts.run(40 - parts.board.now_ns / 1000).log == whole.log, (load, cycle)


def test_a_deadline_ends_a_run_at_the_first_instruction_that_begins_then_or_later(boot: Boot) -> None:
    payload = PAYLOADS[1][1]
    source = "mov32 r5, #0x20000800\n" + "\n".join(f"k{n}: {text}" for n, (text, _) in enumerate(payload))
    begins = [4, *(4 + at for at in accumulate(cycles for _, cycles in payload))]  # behind two mov32
    for cycle in range(4, begins[-1]):
        for early_ns in (0, 1, CYCLE_NS - 1):
            machine = boot(source)
            machine.board.advance_to(cycle * CYCLE_NS - early_ns)
            number = next(n for n, at in enumerate(begins) if at >= cycle)
            expected = machine.label(f"k{number}" if number < len(payload) else "stop")
            assert (machine.board.cycle, machine.board.pc) == (begins[number], expected)


@pytest.mark.parametrize("before", range(3))
def test_what_a_store_makes_pending_comes_behind_it(boot: Boot, before: int) -> None:
    source = (
        "mov32 r1, #0xE000ED04\nmov32 r2, #0x10000000\nmovs r3, #0\n" + "nop\n" * before
        + "str r2, [r1, #0]\nhere: adds r3, #1\nadds r3, #1\nb stop\n"
        "pend: ldr r0, [sp, #24]\nstr r0, [r7, #0]\nstr r3, [r7, #4]\nadds r7, #8\nbx lr\n"
    )  # fmt: skip
    machine = boot(source, {PENDSV: "pend"}).run(20)
    assert machine.log == [machine.label("here"), 0]
    assert machine.board.register("R3") == 2


def test_a_store_that_writes_its_base_back_is_done_before_what_it_makes_pending(boot: Boot) -> None:
    source = (
        "mov32 r1, #0xE000ED00\nmov32 r2, #0x10000000\n.half 0xF841, 0x2F04\n"  # str r2, [r1, #4]!
        "here: nop\nb stop\npend: ldr r0, [sp, #24]\nstr r0, [r7, #0]\n"
        "ldr r0, [sp, #4]\nstr r0, [r7, #4]\nadds r7, #8\nbx lr\n"
    )
    machine = boot(source, {PENDSV: "pend"}).run(20)
    assert machine.log == [machine.label("here"), 0xE000_ED04]


def test_what_a_conditional_store_makes_pending_comes_inside_the_it_block(boot: Boot) -> None:
    source = (
        "mov32 r1, #0xE000ED04\nmov32 r2, #0x10000000\nmovs r3, #0\ncmp r3, #0\nitt eq\n"
        "str r2, [r1, #0]\nhere: adds r3, #1\nb stop\npend: ldr r0, [sp, #24]\nstr r0, [r7, #0]\n"
        "ldr r0, [sp, #28]\nstr r0, [r7, #4]\nadds r7, #8\nbx lr\n"
    )
    machine = boot(source, {PENDSV: "pend"}).run(20)
    assert machine.log[0] == machine.label("here")
    assert machine.log[1] & IT_BITS == 0x0800, "ITT EQ: mask 0100 before the store, 1000 behind it"
    assert machine.board.register("R3") == 1


def test_two_requests_of_one_block_are_served_one_by_one(boot: Boot) -> None:
    source = (
        "mov32 r1, #0xE000ED04\nmov32 r2, #0x10000000\nmovs r3, #0\n"
        "str r2, [r1, #0]\nadds r3, #1\nstr r2, [r1, #0]\nadds r3, #1\nnop\nb stop\n"
        "pend: str r3, [r7, #0]\nadds r7, #4\nbx lr\n"
    )
    assert boot(source, {PENDSV: "pend"}).run(20).log == [0, 1]


def test_an_input_interrupts_at_its_instruction(boot: Boot) -> None:
    """EXTI0 from PA0; the edge comes in the n-th of some instructions of one cycle, or one ns behind its start."""
    source = (
        "mov32 r1, #0x40021018\nmovs r2, #5\nstr r2, [r1, #0]\nmov32 r1, #0x40010400\nmovs r2, #1\nstr r2, [r1, #0]\n"
        "str r2, [r1, #8]\nmov32 r1, #0xE000E100\nmovs r2, #64\nstr r2, [r1, #0]\n"
        + "".join(f"k{n}: nop\n" for n in range(40))
        + "b stop\nedge: ldr r0, [sp, #24]\nstr r0, [r7, #0]\nadds r7, #4\n"
        "mov32 r1, #0x40010400\nmovs r2, #1\nstr r2, [r1, #20]\nbx lr\n"
    )  # fmt: skip
    first = boot(source, {EXTI0: "edge"})
    first.board.advance_to(30 * CYCLE_NS)
    ahead = (first.board.pc - first.label("k0")) // 2 - first.board.cycle  # of one instruction a cycle
    for cycle, late_ns in ((31, 0), (32, -1), (32, 1), (40, 0)):
        machine = boot(source, {EXTI0: "edge"})
        machine.board.pin("PA0").drive(False)
        machine.board.pin("PA0").drive_later([(cycle * CYCLE_NS + late_ns, 1)])
        machine.run(40)
        begins = cycle + (late_ns > 0)
        assert machine.log == [machine.label(f"k{begins + ahead}")], (cycle, late_ns)


@pytest.mark.parametrize("name", ["dodge", "foreign", "unoptimised"])
def test_a_run_is_the_same_however_it_is_cut(name: str) -> None:
    """Each slice's end stands inside some block; what is left of that goes on as it would have."""
    whole, parts = BluePill(str(PROGRAMS[name])), BluePill(str(PROGRAMS[name]))
    for number, step in enumerate(story(7, 6)):
        (one,) = live(whole, [step])
        end_ns, lengths = whole.now_ns, (1, 14, 125, 1000, 40_000)
        parts.pin(step[1]).drive(step[2])
        if step[3]:
            parts.usart1.receive(step[3])
        while parts.now_ns < end_ns:
            parts.advance_to(min(end_ns, parts.now_ns + lengths[parts.cycle % 5]))
        other = state(parts)
        one.pop(6), other.pop(6)  # warnings of what the pins are between two instructions depend on who looks when
        assert one == other, number


def test_a_snapshot_inside_a_block_goes_on_as_the_run_that_it_is_of(boot: Boot) -> None:
    source = program([("ldr r3, [r5, #0]", 2), ("ldr r4, [r5, #4]", 1), *[("adds r4, #1", 1)] * 6], 9)
    for cycle in range(8, 30):
        one, other = (boot(source, {SYSTICK: "tick"}) for _ in range(2))
        one.board.advance_to(cycle * CYCLE_NS)
        other.board.restore(one.board.snapshot())
        assert (one.board.cycle, one.board.pc) == (other.board.cycle, other.board.pc)
        assert one.run(20).log == other.run(20).log, cycle
        assert (one.board.cycle, one.board.pc) == (other.board.cycle, other.board.pc)
    assert one.log, "the tick came"


def test_blocks_are_as_they_were_where_nothing_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same rows and costs as at block boundaries, up to the first interrupt."""
    rows = {}
    for core in ("exact", "own"):
        monkeypatch.setenv("P2OS_CORE", core)
        board = BluePill(str(PROGRAMS["motors"]))
        recorder = board.chip.record_blocks(1 << 14)
        board.advance_to(900_000)
        rows[core] = recorder.drain()[:-2]
    assert rows["exact"] == rows["own"][: len(rows["exact"])]
    assert len(rows["exact"]) > 1000


#: The second return goes to where the first has been: nobody is asked about it any more.
TWICE_TO_ONE_PLACE = """
movs r4, #0
mov32 r0, #join+1
bx r0
join: adds r4, #1
cmp r4, #2
beq stop
b second
second: mov32 r0, #join+1
last: bx r0
"""


def test_a_way_to_a_block_that_is_known_already_is_noted(boot: Boot, monkeypatch: pytest.MonkeyPatch) -> None:
    found = {}
    for core in ("native", "own", "exact"):
        monkeypatch.setenv("P2OS_CORE", core)
        machine = boot(TWICE_TO_ONE_PLACE).run(60)
        found[core] = machine.board.gone_ways
        assert (machine.label("last") + 2, True) in found[core], core
    assert found["native"] == found["own"] == found["exact"]
