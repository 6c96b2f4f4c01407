"""Two cores side by side: the first instruction that differs is named, and nothing where they are the same.

A fault is planted as another instruction at one place of one board's flash; what runs before it is the same.
"""

import ctypes
import json
from collections.abc import Callable

import pytest

from bluepill_sim import BluePill
from bluepill_sim.__main__ import run
from bluepill_sim.core import Reg
from bluepill_sim.debug.cores.comparison import compare_boundaries, values_apart
from bluepill_sim.debug.cores.judge import compare_instructions
from bluepill_sim.extension.library import core_chosen
from tests.bluepill_sim.machine import FLASH, Machine
from tests.bluepill_sim.native.test_native_core import PROGRAMS

Boot = Callable[..., Machine]
SYSTICK, MS = 15, 1_000_000
#: Rounds of work, with a SysTick each 100 cycles, a call of SVC, IT blocks, several words, and a store to a peripheral.
PROGRAM = """
mov32 r1, #0xE000E010
movs r2, #99
str r2, [r1, #4]
movs r2, #7
str r2, [r1, #0]
mov32 r5, #0x20000800
mov32 r6, #0x40021018
movs r4, #0
again: adds r4, #1
cmp r4, #40
ite cs
movs r3, #1
movs r3, #2
muls r3, r4
push {r3, r4}
ldmia r5, {r2, r3}
here: adds r3, #3
stmia r5!, {r2, r3}
subs r5, #16
pop {r3, r4}
ldr r2, [r6, #0]
svc #0
b again
tick: adds r0, #1
bx lr
call: adds r0, #2
bx lr
"""
VECTORS = {SYSTICK: "tick", 11: "call"}


def board_of(boot: Boot, core: str, source: str = PROGRAM) -> BluePill:
    with core_chosen(core):
        return boot(source, VECTORS).board


def test_cores_that_are_the_same_are_said_to_be(boot: Boot) -> None:
    for core in ("own", "python"):
        compared = compare_boundaries((board_of(boot, core), board_of(boot, "native")), 3 * MS)
        assert compared.difference is None
        assert compared.end_ns >= 3 * MS
        assert compared.cycles >= 24_000


def test_the_exact_core_is_judged_instruction_by_instruction(boot: Boot) -> None:
    compared = compare_instructions(board_of(boot, "exact"), MS // 2)
    assert compared.difference is None
    assert compared.cycles >= 4000
    # Most are judged, those in IT blocks too; not what reaches the RCC, SVC, IT, entries and returns.
    assert compared.instructions > 800
    assert compared.passed_over < compared.instructions / 2


@pytest.mark.parametrize("program", ["dodge", "unoptimised"])
@pytest.mark.slow  # 1 s
def test_programs_are_judged_and_the_same(program: str) -> None:
    with core_chosen("exact"):
        compared = compare_instructions(BluePill(str(PROGRAMS[program])), 2 * MS)
    assert compared.difference is None
    assert compared.instructions > 5000


@pytest.mark.parametrize("wrong", ["adds r3, #4", "nop", "subs r3, #3"])
def test_the_first_instruction_that_differs_is_named(boot: Boot, wrong: str) -> None:
    machine = boot(PROGRAM, VECTORS)
    changed = PROGRAM.replace("here: adds r3, #3", f"here: {wrong}")
    boards = board_of(boot, "own"), board_of(boot, "native", changed)
    difference = compare_boundaries(boards, 3 * MS).difference
    assert difference is not None
    assert difference.is_instruction
    assert difference.address == machine.label("here")
    assert "R3" in [value.name for value in difference.values]
    row = next(value for value in difference.values if value.name == "R3")
    theirs = {"adds r3, #4": "0x00000004", "nop": "0x00000000", "subs r3, #3": "0xfffffffd"}
    assert (row.one, row.other) == ("0x00000003", theirs[wrong])
    # The first time that the place is reached: 13 cycles up to `again` (five mov32 of 2), 6 of single cycles, two of
    # two words (3 each).
    assert (difference.cycle, difference.at_ns) == (25, 25 * 125)


def test_a_difference_late_in_a_run_is_found_where_it_begins(boot: Boot) -> None:
    """R4 counts rounds; in the 300th another value is kept. 0x4294: cmp r4, r2."""
    counted = "muls r3, r4\nmov32 r2, #300\n.half 0x4294\nbne same\nplace: movs r3, #5\nstr r3, [r5, #16]\nsame: nop"
    source = PROGRAM.replace("muls r3, r4", counted)
    boards = board_of(boot, "own", source), board_of(boot, "native", source.replace("movs r3, #5", "movs r3, #6"))
    difference = compare_boundaries(boards, 10 * MS).difference
    assert difference is not None
    assert (difference.address, difference.is_instruction) == (boot(source, VECTORS).label("place"), True)
    assert difference.at_ns > MS


def test_cycles_alone_are_a_difference(boot: Boot) -> None:
    """A multiplication of two cycles more, with the same results."""
    changed = PROGRAM.replace("muls r3, r4", ".half 0xFB04, 0xF303")  # mul r3, r4, r3: no flags, which none reads
    boards = board_of(boot, "own"), board_of(boot, "native", changed.replace("here: adds", "here: adds"))
    assert compare_boundaries(boards, MS).difference is not None


def test_the_judge_names_the_first_instruction(boot: Boot) -> None:
    machine = boot(PROGRAM, VECTORS)
    board = board_of(boot, "exact")
    place = machine.label("here") - FLASH

    def plant(chosen: BluePill) -> None:
        ctypes.memmove(ctypes.addressof(chosen.chip.memory.flash) + place, b"\x04\x33", 2)  # adds r3, #4

    # Behind the first passing over of an instruction the judge has the same flash again: it is planted right before.
    board.advance_to(2000)
    difference = compare_instructions(board, MS, [(board.now_ns, plant)]).difference
    assert difference is not None
    assert (difference.address, difference.is_instruction) == (machine.label("here"), True)
    rows = {value.name: (value.one, value.other) for value in difference.values}
    assert rows["R3"] == ("0x00000004", "0x00000003")


@pytest.mark.parametrize("name", ["R0", "R12", "SP", "LR", "PRIMASK", "CONTROL"])
def test_each_register_is_compared(boot: Boot, name: str) -> None:
    boards = board_of(boot, "own"), board_of(boot, "native")
    assert values_apart(boards) == ()
    registers = boards[1].chip.engine.registers
    registers[Reg[name]] = registers[Reg[name]] ^ (1 if name in {"PRIMASK", "CONTROL"} else 8)
    assert name in [value.name for value in values_apart(boards)]


def test_memory_and_peripherals_are_compared(boot: Boot) -> None:
    boards = board_of(boot, "own"), board_of(boot, "native")
    boards[1].chip.memory.write(0x2000_0123, b"\x07")
    (value,) = values_apart(boards)
    assert (value.name, value.one, value.other) == ("memory.sram+0x120", "0x00000000", "0x07000000")
    boards[0].chip.memory.write(0x2000_0123, b"\x07")
    boards[0].pin("PA0").drive(1)
    assert values_apart(boards)


def test_as_a_user_runs_it(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    file = str(PROGRAMS["motors"])
    assert run(["compare-cores", file, "--for", "2ms", "--drive", "PA6=1@1ms"]) == 0
    assert "own and unicorn: the same over 0.00200" in capfd.readouterr().out
    assert run(["compare-cores", file, "--core", "exact", "--for", "100us"]) == 0
    assert "instructions judged" in capfd.readouterr().out
    for wrong in (["--core", "none"], ["--for", "soon"], ["--drive", "PA99=1"], []):
        words = ["compare-cores", *([file] if wrong else ["missing.elf"]), *wrong]
        assert run(words) == 2, wrong
        assert "Traceback" not in capfd.readouterr().err

    from bluepill_sim.cli.comparisons import compare_cores as command

    make = command._board
    monkeypatch.setattr(command, "_board", lambda firmware, core: make(
        firmware if core == "own" else str(PROGRAMS["dodge"]), core))  # fmt: skip
    assert run(["compare-cores", file, "--for", "1ms"]) == 1
    out = capfd.readouterr().out
    assert out.startswith("own and unicorn differ ")
    assert all(len(line) <= 160 for line in out.splitlines())
    assert run(["compare-cores", file, "--for", "1ms", "--json"]) == 1
    found = json.loads(capfd.readouterr().out)
    assert found["difference"]["values"]


def test_an_input_is_put_on_both(boot: Boot) -> None:
    """A program whose wait ends at PA0: the acts come to both boards, at their time."""
    source = (
        "mov32 r1, #0x40021018\nmovs r2, #4\nstr r2, [r1, #0]\nmov32 r1, #0x40010800\nmovs r3, #1\n"
        "wait: ldr r2, [r1, #8]\nmuls r2, r3\nadds r0, r2, r3\nb wait\ntick: nop\ncall: nop\n"
    )
    boards = board_of(boot, "own", source), board_of(boot, "native", source)
    compared = compare_boundaries(boards, 4 * MS, [(2 * MS, lambda board: board.pin("PA0").drive(1))])
    assert compared.difference is None
    assert [board.pin("PA0").level for board in boards] == [1, 1]


def test_a_lockup_ends_the_comparison_where_nothing_more_is_done_to_it() -> None:
    locked = "cpsid f\nudf"
    assert compare_boundaries(_locked(locked), 3 * MS).end_ns == MS
    late = [(2 * MS, lambda board: board.pin("PA0").drive(1))]
    assert compare_boundaries(_locked(locked), 4 * MS, late).end_ns == 3 * MS
    assert compare_boundaries(_locked("cpsid f\nstay: b stay"), 3 * MS).end_ns == 3 * MS


def _locked(source: str) -> tuple[BluePill, BluePill]:
    boards = []
    for core in ("own", "native"):
        with core_chosen(core):
            boards.append(Machine(source, {}).board)
    return boards[0], boards[1]
