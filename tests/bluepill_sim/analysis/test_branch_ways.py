"""Ways of branches at the places where they are easily miscounted: IT blocks, interrupts, faults, resets, SRAM."""

from collections import Counter
from dataclasses import replace

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.coverage_page import coverage_page
from bluepill_sim.analysis.coverage_text import coverage_lines
from bluepill_sim.analysis.cycle_profile import CycleProfile
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Symbol, SymbolTable
from bluepill_sim.program.line_table import LineRow, LineTable
from bluepill_sim.program.static_code import StaticCode
from simbase.timing import NS_PER_MS

SYSTICK = "mov32 r1, #0xE000E010\nmov32 r2, #{0}\nstr r2, [r1, #4]\nstr r2, [r1, #8]\nmovs r2, #7\nstr r2, [r1, #0]\n"
NEVER_ONCE_BOTH = """movs r5, #3
once: cmp r5, #0
first: beq unseen
second: bne third
unseen: cmp r5, #9
never: beq unseen
third: subs r5, #1
both: bne third
b stop"""
#: An IT block whose conditional instruction is the branch itself.
IT_BRANCH = (
    "movs r5, #3\nagain: bl work\nsubs r5, #1\nbne again\nb stop\nwork: cmp r5, #2\nit eq\nout: bx lr\nback: bx lr"
)
#: Resets itself three times (AIRCR.SYSRESETREQ); a word of SRAM counts them.
RESETS = """mov32 r1, #0x20000000
ldr r2, [r1, #0]
adds r2, #1
str r2, [r1, #0]
cmp r2, #4
last: beq stop
mov32 r1, #0xE000ED0C
mov32 r2, #0x05FA0004
str r2, [r1, #0]
wait: cmp r2, #0
way: bne wait"""


def covered(machine, us=100):
    """Return the coverage of a run of an assembled program, every label of which is a function's."""
    coverage = Coverage(machine.image, LineTable(), StaticCode(machine.board.chip.memory))
    with Observation(machine.board, [coverage]):
        machine.run(us)
    return coverage


def test_a_branch_is_taken_never_once_or_both_ways(boot) -> None:
    machine = boot(NEVER_ONCE_BOTH)
    functions = (Symbol("start", machine.label("start"), 0x100, is_function=True),)
    machine.image = replace(machine.image, symbols=SymbolTable(functions))
    coverage = covered(machine)
    ways = coverage.branches()
    named = {name: ways[machine.label(name)] for name in ("first", "second", "never", "both")}
    assert named == {"first": (0, 1), "second": (1, 0), "never": (0, 0), "both": (2, 1)}
    one_way = {branch.address: branch for branch in coverage.one_way()}
    assert set(one_way) == {machine.label("first"), machine.label("second")}
    first = one_way[machine.label("first")]
    assert (first.gone, first.missed) == (machine.label("second"), machine.label("unseen"))
    assert (one_way[machine.label("second")].missed, coverage.unreached) == (machine.label("unseen"), 1)


def test_a_branch_in_an_it_block_has_two_ways(boot) -> None:
    machine = boot(IT_BRANCH)
    assert covered(machine).branches()[machine.label("out")] == (1, 2)


def test_a_conditional_return_from_a_handler_is_a_way(boot) -> None:
    handler = "tick: adds r6, #1\ncmp r6, #2\nit eq\nout: bx lr\nbx lr"
    machine = boot(SYSTICK.format(799) + f"spin: wfi\nb spin\n{handler}", {15: "tick"})
    coverage = covered(machine, 450)
    assert coverage.branches()[machine.label("out")] == (1, 3)  # 4 ticks of 100 µs at 8 MHz, once with R6 = 2


def test_interrupts_between_blocks_change_no_count(boot) -> None:
    source = SYSTICK.format(97) + "mov32 r5, #300\nloop: adds r3, #1\nsubs r5, #1\nway: bne loop\nb stop\ntick: bx lr"
    machine = boot(source, {15: "tick"})
    assert covered(machine, 500).branches()[machine.label("way")] == (299, 1)
    single = boot(source, {15: "tick"})
    counts: Counter[int] = Counter()
    while single.board.pc != single.label("stop"):
        counts[single.board.pc] += 1
        single.board.chip.step(single.board.now_ns + NS_PER_MS)
    assert counts[single.label("tick")] > 5
    assert counts[single.label("way")] == 300


def test_a_block_that_an_interrupt_cuts_is_counted_to_the_cut(boot) -> None:
    source = (
        "mov32 r1, #0xE000ED04\nmov32 r2, #0x10000000\ncpsid i\nstr r2, [r1, #0]\n"
        "block: cpsie i\ncut: adds r3, #1\ncmp r3, #1\nway: beq stop\nb stop\nhandler: mov32 r4, #0x60000000\nbx lr"
    )
    machine = boot(source, {14: "handler"})  # PendSV comes when CPSIE ends the translation
    coverage = covered(machine)
    counts = coverage.instructions()
    assert [counts[machine.label(name)] for name in ("block", "cut", "way", "handler")] == [1, 1, 1, 1]
    assert coverage.branches()[machine.label("way")] == (1, 0)


def test_a_fault_at_the_first_instruction_of_a_block_goes_no_way(boot) -> None:
    source = "mov32 r1, #0x60000000\nb bad\nbad: ldr r0, [r1, #0]\ncmp r0, #0\nway: bne stop\nb stop\ndead: b dead"
    machine = boot(source, {3: "dead"})
    coverage = covered(machine)
    assert coverage.branches().get(machine.label("way"), (0, 0)) == (0, 0)
    assert coverage.instructions().get(machine.label("way"), 0) == 0


def test_what_follows_a_branch_but_is_neither_of_its_ways_is_no_way(boot) -> None:
    machine = boot("cmp r5, #0\nway: bne stop\nb stop")
    coverage = Coverage(machine.image, LineTable(), StaticCode(machine.board.chip.memory))
    for following in (machine.label("start"), 0x0800_4000):  # a debugger has set the PC
        coverage.block(machine.label("way"), following, 0, 1)
    assert coverage.branches()[machine.label("way")] == (0, 0)


def test_counts_of_several_resets_add_up_and_a_reset_is_no_way(boot) -> None:
    machine = boot(RESETS)
    profile = CycleProfile(FunctionTable(machine.image), StaticCode(machine.board.chip.memory))
    coverage = Coverage(machine.image, LineTable(), StaticCode(machine.board.chip.memory))
    with Observation(machine.board, [coverage, profile]):
        machine.run(2000)
    assert machine.is_done
    assert machine.board.resets.total() == 3
    assert coverage.instructions()[machine.label("start")] == 4
    assert coverage.branches()[machine.label("last")] == (1, 3)
    assert coverage.branches().get(machine.label("way"), (0, 0)) == (0, 0)  # the reset comes first, each time
    assert profile.total_cycles == machine.board.cycle
    assert machine.board.chip.reset_listeners == []


def test_a_reset_out_of_a_handler_leaves_no_frame_of_it(boot) -> None:
    source = RESETS.replace("wait:", "svc #0\nwait:") + "\nhandler: mov32 r4, #0xE000ED0C\nhang: b hang"
    source = source.replace("str r2, [r1, #0]\nsvc", "svc").replace("handler:", "handler: str r2, [r1, #0]\n")
    machine = boot(source, {11: "handler"})
    profile = CycleProfile(FunctionTable(machine.image), StaticCode(machine.board.chip.memory))
    with Observation(machine.board, [profile]):
        machine.run(2000)
    assert machine.is_done
    assert {names[0] for names in profile.stacks if names and "stop" in names} == {"stop"}


def test_code_in_sram_has_lines_and_branches(boot) -> None:
    copied = 0x2000_0400
    source = (
        f"mov32 r1, #{copied}\nmov32 r2, #code\nmovs r3, #12\ncopy: ldrh r0, [r2, #0]\nstrh r0, [r1, #0]\nadds r1, #2\n"
        f"adds r2, #2\nsubs r3, #2\nbne copy\nmov32 r4, #{copied + 1}\nblx r4\nb stop\n"
        "code: movs r5, #2\ninner: subs r5, #1\nbne inner\nbx lr\nnop\nnop"
    )
    machine = boot(source)
    symbols = (*machine.image.symbols.symbols, Symbol("in_sram", copied, 12, is_function=True))
    machine.image = replace(machine.image, symbols=SymbolTable(symbols))
    lines = LineTable((LineRow(copied, copied + 2, "a.c", 1), LineRow(copied + 2, copied + 8, "a.c", 2)))
    coverage = Coverage(machine.image, lines, StaticCode(machine.board.chip.memory))
    with Observation(machine.board, [coverage]):
        machine.run(200)
    (file,) = coverage.files()
    assert file.lines == {1: 1, 2: 2}
    assert [(row.address, row.taken, row.not_taken) for row in file.branches[2]] == [(copied + 4, 1, 1)]
    assert file.functions == [("in_sram", 1, 1)]


def test_without_debug_information_functions_are_reported_and_without_symbols_addresses(boot) -> None:
    machine = boot(NEVER_ONCE_BOTH)
    functions = (Symbol("start", machine.label("start"), 0x100, is_function=True),)
    machine.image = replace(machine.image, symbols=SymbolTable(functions))
    by_function = coverage_lines(covered(machine))
    assert by_function[0] == "no debug information: by function, in instructions (compile with -Og -g for lines)"
    # movw, movt, 9 of the source and `stop`; cmp and beq of `unseen` do not run.
    assert by_function[3].split() == ["start", "1", "10/12", "83.3%", "4/8", "50.0%"]
    first = machine.label("first")
    assert f"start+{first - machine.label('start'):#x} ({first:#010x})" in "\n".join(by_function)
    assert by_function[-1] == "1 branch did not run at all"
    machine = boot(NEVER_ONCE_BOTH)
    machine.image = replace(machine.image, symbols=SymbolTable())
    by_address = coverage_lines(covered(machine))
    assert by_address[0].startswith("no debug information and no symbols: by address")
    # All of it runs up to the branch that skips `unseen`, and on from there.
    skipped = machine.label("unseen"), machine.label("third")
    assert by_address[2:4] == [
        f"{machine.label('start'):#010x} to {skipped[0] - 1:#010x} ran",
        f"{skipped[1]:#010x} to {machine.label('stop') + 1:#010x} ran",
    ]


def test_a_page_of_coverage_shows_sources_with_counts_and_ways(boot, tmp_path) -> None:
    machine = boot(NEVER_ONCE_BOTH)
    first, third = machine.label("first"), machine.label("third")
    rows = ((machine.label("start"), first), (first, first + 2), (machine.label("unseen"), third), (third, third + 6))
    lines = LineTable(tuple(LineRow(at, end, "x/a.c", n) for n, (at, end) in enumerate(rows, 1)))
    machine.image = replace(machine.image, symbols=SymbolTable())
    coverage = Coverage(machine.image, lines, StaticCode(machine.board.chip.memory))
    with Observation(machine.board, [coverage]):
        machine.run(100)
    (tmp_path / "a.c").write_text("one();\nif (a < b)\nunseen();\nthird();\n")
    page = coverage_page(coverage, title="t<1>", sources=tmp_path)
    assert "<title>t&lt;1&gt;</title>" in page
    assert '<tr class="partial"><td>1</td><td>0/1</td><td>2</td><td>if (a &lt; b)</td></tr>' in page
    assert '<tr class="missed"><td>0</td><td></td><td>3</td><td>unseen();</td></tr>' in page
    assert '<tr class="ran"><td>3</td><td>2/1</td><td>4</td><td>third();</td></tr>' in page
    assert "x/a.c: the source is not here" in coverage_page(coverage, title="")
