"""Coverage, profile, waits, stack and last blocks of programs whose figures are worked out by hand."""

import itertools
from collections import Counter
from xml.etree import ElementTree as ET

import pytest

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.cycle_profile import ASLEEP, CycleProfile
from bluepill_sim.analysis.flame_graph import flame_svg
from bluepill_sim.analysis.interrupts.latency import LatencyProbe
from bluepill_sim.analysis.observation import HANDLER_LEFT, BlockWalk, Observation
from bluepill_sim.analysis.stack import StackGauge
from bluepill_sim.board import BluePill
from bluepill_sim.core import BLOCK, EXCEPTION_RETURN
from bluepill_sim.program.functions import UNKNOWN, FunctionTable
from bluepill_sim.program.image import SymbolTable
from bluepill_sim.program.last_blocks import lines_of, shortened
from bluepill_sim.program.line_table import LineTable
from bluepill_sim.program.static_code import StaticCode
from simbase.timing import NS_PER_MS

SYSTICK = "mov32 r1, #0xE000E010\nmov32 r2, #799\nstr r2, [r1, #4]\nstr r2, [r1, #8]\nmovs r2, #7\nstr r2, [r1, #0]\n"
CALLS = "movs r5, #3\nloop: bl work\nsubs r5, #1\nbne loop\nb stop\nwork: cmp r5, #2\nbne out\nadds r6, #1\nout: bx lr"
IT_CODE = "movs r5, #4\nagain: cmp r5, #2\nite eq\nmoveq: mov r1, r5\nmovne: mov r2, r5\nsubs r5, #1\nbne again\nb stop"


def observed(machine, us=100, **options):
    """Return (coverage, profile, latency) of a run."""
    code = StaticCode(machine.board.chip.memory)
    coverage = Coverage(machine.image, LineTable(), code)
    profile = CycleProfile(FunctionTable(machine.image), code)
    latency = LatencyProbe(machine.board)
    with Observation(machine.board, [coverage, profile, latency]):
        machine.run(us, **options)
    latency.detach()
    return coverage, profile, latency


def stepped(machine, end):
    """Return how often each instruction runs, one step at a time, until `end` is next."""
    counts = Counter()
    for _ in range(10_000):
        if machine.board.pc == end:
            return counts
        counts[machine.board.pc] += 1
        machine.board.chip.step(machine.board.now_ns + NS_PER_MS)
    raise AssertionError("the program does not end")


def test_instructions_are_counted_as_single_steps_count_them(boot) -> None:
    machine = boot(CALLS)
    coverage, _, _ = observed(machine)
    single = boot(CALLS)
    expected = stepped(single, single.label("stop"))
    found = coverage.instructions()
    assert found.pop(machine.label("stop")) >= 1
    assert found == dict(expected)


def test_what_an_it_block_skips_counts_as_run(boot) -> None:
    machine = boot(IT_CODE)
    counts = observed(machine)[0].instructions()
    assert counts[machine.label("moveq")] == counts[machine.label("movne")] == 4


def test_both_ways_of_a_branch_are_distinguished(boot) -> None:
    machine = boot(CALLS)
    branches = observed(machine)[0].branches()
    loop, work = machine.label("loop"), machine.label("work")
    assert branches[loop + 6] == (2, 1)  # bne loop: 3 turns
    assert branches[work + 2] == (2, 1)  # bne out: not with R5 = 2
    assert set(branches) == {loop + 6, work + 2}


def test_all_cycles_are_somebodys(boot) -> None:
    machine = boot(SYSTICK + "spin: wfi\nb spin\ntick: adds r6, #1\nbx lr", {15: "tick"})
    _, profile, latency = observed(machine, 1000)
    assert profile.total_cycles == machine.board.cycle
    (tick,) = latency.by_name
    assert tick.entries == len(tick.waits) == 9
    # From sleep: 12 cycles of entry, and nothing that would have to end first.
    assert (tick.least_wait, tick.worst_wait, tick.mean_wait) == (12, 12, 12)
    # adds, bx lr as an exception return without its refill: 2.
    assert tick.worst_duration == 14
    # 9 handlers of 2 cycles with 12 in and 12 out.
    assert sum(n for names, n in profile.stacks.items() if names[0] == "<SysTick>") == 9 * (2 + 12 + 12)
    asleep = sum(n for names, n in profile.stacks.items() if names[-1] == ASLEEP)
    # A turn is WFI and a branch of 3 cycles; the start is 20 instructions at most.
    assert machine.board.cycle - 9 * 26 - 10 * 4 - 40 <= asleep < machine.board.cycle - 9 * (26 + 4)


def test_waits_of_a_masked_interrupt_are_long(boot) -> None:
    source = SYSTICK + "cpsid i\nmov32 r3, #2000\nloop: subs r3, #1\nbne loop\ncpsie i\nb stop\ntick: bx lr"
    machine = boot(source, {15: "tick"})
    _, _, latency = observed(machine, 780)
    (tick,) = latency.by_name
    # 2000 turns of 3 cycles and the rest of a period of 800: it has been due from the first wrap on.
    assert tick.entries == 1
    assert 5200 <= tick.worst_wait <= 5260
    assert (latency.by_name[0].least_wait, latency.by_name[0].worst_duration) == (tick.worst_wait, 13)


def test_functions_are_called_and_charged_by_hand_count(boot) -> None:
    machine = boot(CALLS)
    names = dict(machine.assembled.labels)
    table = [s for s in machine.image.symbols.symbols if s.name in {"start", "work", "stop"}]
    image = machine.image.__class__("test", machine.image.segments, SymbolTable(tuple(table)))
    code = StaticCode(machine.board.chip.memory)
    profile = CycleProfile(FunctionTable(image), code)
    with Observation(machine.board, [profile]):
        machine.run(8)
    costs = {cost.name: cost for cost in profile.functions()}
    # work: cmp, bne taken 2, bx lr 3 = 6 twice; cmp, bne not taken, adds, bx lr = 6 once.
    assert (costs["work"].calls, costs["work"].exclusive_cycles) == (3, 2 * 6 + 6)
    assert costs["start"].inclusive_cycles >= costs["work"].inclusive_cycles
    assert names["work"] == FunctionTable(image).at(names["out"]).address
    assert FunctionTable(image).name(0x0800_0000) == UNKNOWN


def test_a_walk_tells_blocks_with_what_follows() -> None:
    reported = []

    class Ear:
        def block(self, *words) -> None:
            reported.append(words)

        def enter(self, *words) -> None:
            reported.append(("enter", *words))

        def leave(self, *words) -> None:
            reported.append(("leave", *words))

    walk = BlockWalk([Ear()])
    walk.take([(0, 10, BLOCK), (5, 20, BLOCK), (9, 24, 15), (21, 50, BLOCK), (30, 24, EXCEPTION_RETURN)])
    walk.take([(42, 24, BLOCK)])
    walk.finish(50)
    assert reported == [
        (10, 20, 0, 5), (20, 24, 5, 4), ("enter", 15, 9), (50, HANDLER_LEFT, 21, 9), ("leave", 30), (24, None, 42, 8),
    ]  # fmt: skip


def test_the_stack_is_measured_to_the_word(boot) -> None:
    machine = boot("push {r0-r6}\npush {r1}\npop {r1}\nb stop")
    machine.image = machine.board.image
    gauge = StackGauge.__new__(StackGauge)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("bluepill_sim.analysis.stack.variables_end", lambda _image: 0x2000_0200)
        gauge.__init__(machine.board)
        assert gauge.measure().used_bytes == 0
        machine.run(100)
    use = gauge.measure()
    assert use.used_bytes == 8 * 4
    assert use.room_bytes == 0x4E00
    assert str(use) == "stack: 32 of 19968 bytes used (0.2%), down to 0x20004fe0"


FAULT = SYSTICK + "mov32 r4, #2000\nloop: subs r4, #1\nbne loop\nmov32 r1, #0x60000000\nnop\nldr r0, [r1, #0]\nb stop"


def test_the_last_blocks_of_a_fault_are_those_before_it(boot) -> None:
    machine = boot(FAULT + "\ntick: bx lr\n", {15: "tick"})
    recorder = machine.board.chip.record_blocks(100_000)
    machine.run(1000)
    assert machine.board.fault is not None
    at_fault = machine.board.chip.cycle_at(machine.board.fault.at_ns)
    before = [row for row in recorder.drain() if row[0] < at_fault]
    assert machine.board.last_rows == tuple(before[-32:])
    assert machine.label("loop") in {row[1] for row in machine.board.last_rows}
    # The loop's 31 turns are one line.
    loop, after = machine.board.last_blocks()
    assert f"31 x {machine.board.image.symbols.where(machine.label('loop'))}" in loop
    assert " x " not in after


def test_the_last_blocks_of_a_spinning_program_are_those_up_to_now(boot) -> None:
    source = SYSTICK + "loop: adds r3, #1\nadds r3, #1\nb loop\ntick: bx lr\n"
    machine = boot(source, {15: "tick"})
    recorder = machine.board.chip.record_blocks(50)
    machine.run(500)
    assert machine.board.last_rows == tuple(recorder.last(32))
    cycle, _, _ = recorder.last(1)[0]
    assert machine.board.last_blocks()[-1].endswith(f" x {machine.board.where()}")
    assert int(machine.board.last_blocks()[-1].split()[0]) <= cycle


def test_a_loop_of_several_blocks_is_one_line_with_a_count() -> None:
    def addresses(text: str) -> list[tuple[int, int, int]]:
        return [(10 * n, 0x0800_0000 + ord(letter), BLOCK) for n, letter in enumerate(text)]

    def short(text: str) -> list[str]:
        return [" ".join(line.split()[1:]) for line in shortened(addresses(text), SymbolTable(()), LineTable())]

    a, b, c, x = (f"0x{0x0800_0000 + ord(letter):08x}" for letter in "abcx")
    assert short("") == []
    assert short("abc") == [a, b, c]
    assert short("xaab") == [x, f"2 x {a}", b]
    assert short("xabcabcabcx") == [x, f"3 x 3 blocks from {a}", x]
    assert short("abbbcabbbc") == [f"2 x 5 blocks from {a}"], "the loop that covers most"
    assert short("aaaaaa") == [f"6 x {a}"], "the shortest that covers as much"


def test_rows_read_as_sentences() -> None:
    rows = [(5, 0x0800_0100, 15), (20, 0xFFFF_FFF9, EXCEPTION_RETURN), (30, 0x0800_0100, EXCEPTION_RETURN)]
    words = [line.split(maxsplit=1)[1] for line in lines_of(rows, SymbolTable(), LineTable())]
    assert words == [
        "-> SysTick, interrupts 0x08000100", "<- chains to the next exception", "<- back to 0x08000100",
    ]  # fmt: skip


def test_a_flame_graph_is_well_formed_and_its_widths_are_cycles() -> None:
    stacks = {("main", "a<b"): 300, ("main",): 100, ("<SysTick>",): 100, ("main", ASLEEP): 10_000}
    tree = ET.fromstring(flame_svg(stacks, title="x & y", hz=8_000_000))  # noqa: S314 - our own
    space = "{http://www.w3.org/2000/svg}"
    boxes = {g.find(f"{space}title").text.split(":")[0]: g.find(f"{space}rect") for g in tree.iter(f"{space}g")}
    assert set(boxes) == {"all", "main", "a<b", "<SysTick>"}
    widths = {name: float(box.get("width")) for name, box in boxes.items()}
    assert widths["main"] / widths["all"] == pytest.approx(0.8, abs=0.01)
    assert widths["a<b"] / widths["main"] == pytest.approx(0.75, abs=0.01)
    assert ASLEEP not in boxes
    assert flame_svg({}, title="", hz=1).endswith("</svg>\n")


def test_observing_changes_nothing(boot) -> None:
    source = SYSTICK + "spin: wfi\nb spin\ntick: adds r6, #1\nbx lr"
    plain = boot(source, {15: "tick"}).run(500)
    for slice_us in (None, 7):
        watched = boot(source, {15: "tick"})
        found = observed(watched, 500, slice_us=slice_us)
        assert watched.board.snapshot() == plain.board.snapshot()
        assert found[2].by_name[0].entries == 4
    assert isinstance(plain.board, BluePill)
    assert list(itertools.islice(found[1].folded(), 1))
