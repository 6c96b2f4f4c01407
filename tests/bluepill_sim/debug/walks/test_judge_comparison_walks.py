"""Cores compared, by instruction and at boundaries: what is judged and what differs, as approved.

Programs at random run on the exact core with Unicorn as the judge; now and then the board is changed behind its back.
"""

import ctypes
import random
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from unittest.mock import patch

from bluepill_sim import BluePill
from bluepill_sim.cli.comparisons import compare_cores
from bluepill_sim.core import Reg
from bluepill_sim.core.unicorn_core import GENERAL
from bluepill_sim.debug.cores.comparison import Acts, CoreValue, compare_boundaries, values_apart
from bluepill_sim.debug.cores.judge import UnicornJudge, compare_instructions
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.program.image import Image
from bluepill_sim.program.line_table import LineRow, LineTable
from tests.bluepill_sim.core.walks.programs import assembled
from tests.bluepill_sim.debug.cores.test_core_comparison import PROGRAM, VECTORS
from tests.bluepill_sim.machine import FLASH, STACK, Machine
from tests.tools.suite.approved import Trace, judge_of, said, tried

PROGRAMS, STEPS = 8, 110
#: Characters of a value that are shown.
SHOWN = 48
SRAM, MS = 0x2000_0000, 1_000_000
_CHANGED = (Reg.R3, Reg.R12, Reg.LR, Reg.SP, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK, Reg.XPSR, Reg.CONTROL)
#: One instruction of `PROGRAM`, and what stands there on the other board.
_OTHERS = (
    ("subs r5, #16", "subs r5, #8"),
    ("stmia r5!, {r2, r3}", "stmia r5!, {r2, r4}"), ("svc #0", "nop"), ("adds r0, #2", "adds r0, #1"),
)  # fmt: skip
#: What the line of every second instruction is taken to be.
_LINES = LineTable(tuple(LineRow(at, at + 2, "main.c", at % 1000) for at in range(FLASH, FLASH + 0x800, 4)))


@cache
def _image() -> tuple[Image, list[tuple[int, int]]]:
    return assembled(PROGRAMS, "judged")


def _begin(board: BluePill, base: int, dice: random.Random) -> None:
    board.chip.system.write(0xED08, 4, base)
    registers = board.chip.engine.registers
    registers[Reg.SP] = STACK
    for register in GENERAL[:13]:
        registers[register] = dice.getrandbits(32)
    board.chip.engine.jump(board.chip.memory.read_word(base + 4) or 0)


def _disturb(board: BluePill, dice: random.Random) -> str:
    """Change a register or a byte of the board's, which the judge has as they were."""
    if dice.random() < 0.3:
        at = SRAM + dice.randrange(0x5000)
        board.chip.memory.write(at, bytes([(board.read_memory(at, 1) or b"\0")[0] ^ 0x81]))
        return f"{at:x}"
    register = dice.choice(_CHANGED)
    bit = 1 << (31 if register is Reg.XPSR else 4 if register is Reg.BASEPRI else 3 if register.value < 0x60 else 0)
    board.chip.engine.registers[register] = board.chip.engine.registers[register] ^ bit
    return register.name


def _judged(_: random.Random) -> Iterator[str]:
    """Yield each instruction of programs at random: whether it was one to be judged, and what differs behind it."""
    with core_chosen("exact"):
        board = BluePill(_image()[0])
    fresh = board.snapshot()
    for number, (base, _stop) in enumerate(_image()[1]):
        dice = random.Random(f"judged {number}")
        board.restore(fresh)
        _begin(board, base, dice)
        judge, done = UnicornJudge(board), list[str]()
        for step in range(STEPS):
            if board.is_asleep:
                board.pin("PA0").drive(bool(step % 2))
            pc, cycle = board.pc, board.cycle
            is_judged = tried(judge.runs) == "True" if not board.is_asleep else False
            board.advance_to(max(board.chip.ns_of(cycle + 1), board.now_ns + 1))
            changed = _disturb(board, dice) if dice.random() < 0.12 else ""
            values = judge.values_apart()
            done.append(f"{pc:x} {is_judged:d} {changed} {[(one.name, one.one, one.other) for one in values[:3]]}")
            if values or not is_judged:
                judge.take_over()
        yield "\n".join([f"program {number}", *done, f"{board.cycle} {judge.values_apart()}"])


def _values(values: Iterable[CoreValue]) -> str:
    return said([[one.name, one.one[:SHOWN], one.other[:SHOWN]] for one in values])


def _planted(place: int, code: bytes) -> Callable[[BluePill], None]:
    def plant(board: BluePill) -> None:
        ctypes.memmove(ctypes.addressof(board.chip.memory.flash) + place, code, len(code))

    return plant


def _board(core: str, source: str = PROGRAM) -> BluePill:
    with core_chosen(core):
        return Machine(source, {**VECTORS}).board


def _instructions(_: random.Random) -> Iterator[str]:
    place = Machine(PROGRAM, {**VECTORS}).label("here") - FLASH
    high: Acts = [(9_000, lambda board: board.pin("PA0").drive(1))]
    for acts in ((), [(0, _planted(place, b"\x04\x33"))], [(30_000, _planted(place, b"\x00\xbf"))], high):
        for end_ns in (1, 60_000):
            yield said(compare_instructions(_board("exact"), end_ns, acts))
    for source in ("wfi\nb start\ntick: nop\ncall: nop", "udf\ntick: nop\ncall: nop", "bkpt #1\ntick: nop\ncall: nop"):
        yield said(compare_instructions(_board("exact", source), 20_000, [(5_000, lambda _board: None)]))


def _boundaries(_: random.Random) -> Iterator[str]:
    for before, after in _OTHERS:
        boards = _board("own"), _board("native", PROGRAM.replace(before, after))
        compared = compare_boundaries(boards, MS // 8)
        found = compared.difference
        where = said([found.at_ns, found.cycle, found.address, found.is_instruction]) if found else "the same"
        yield f"{after}: {compared.end_ns} {compared.cycles} {where} {_values(found.values if found else ())}"
        if found:
            with patch.object(compare_cores, "read_lines", lambda _image: _LINES):
                yield "\n".join(compare_cores.lines_of(boards[0], "own", found))
    high: Acts = [(9_000, lambda board: board.pin("PA0").drive(1)), (9_001, lambda board: board.pin("PA1").drive(1))]
    for end_ns in (1, 40_000, MS + 1):
        boards = _board("own"), _board("python")
        yield f"{said(compare_boundaries(boards, end_ns, high))} {[board.pin('PA0').level for board in boards]}"
    for first in ("udf", "bkpt #1", "cpsid f\nudf"):
        source = f"{first}\ntick: nop\ncall: nop"
        yield said(compare_boundaries((_board("own", source), _board("python", source)), 3 * MS))
    boards = _board("own"), _board("python")
    for end_ns in (1_000, 9_000):
        boards[end_ns // 9_000].advance_to(end_ns)
        yield _values(values_apart(boards))
    for board, words in zip(boards, ("odd", "even"), strict=True):
        board.chip.warn(words, once=words)
    yield said([[one.name, one.one, one.other] for one in values_apart(boards)[-4:]])
    dice, boards = random.Random("boundaries"), (_board("own"), _board("python"))
    for _number in range(20):
        yield f"{_disturb(boards[dice.randrange(2)], dice)} {_values(values_apart(boards))}"


TRACES: dict[str, Trace] = {"judged": _judged, "instructions": _instructions, "boundaries": _boundaries}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
