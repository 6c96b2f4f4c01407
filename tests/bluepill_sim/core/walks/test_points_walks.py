"""Programs at random whose breakpoints, watched words and remapped code come and go, against what was approved.

FPB, DWT and DEMCR are written between slices, as firmware does, and a debugger sets points of its own; a line has what
the core looks out for, which code is remapped, what halted it, and all that decides what comes next.
"""

import random
from collections.abc import Iterator
from functools import cache, partial

from bluepill_sim import BluePill
from bluepill_sim.core import Reg, Watchpoint
from bluepill_sim.core.debugging.comparators import cycles_to_match, points_of
from bluepill_sim.core.debugging.debug_unit import WatchKind
from bluepill_sim.core.unicorn_core import GENERAL
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.program.image import Image
from tests.bluepill_sim.core.thumb_streams import SCRATCH
from tests.bluepill_sim.core.walks import test_program_walks
from tests.bluepill_sim.core.walks.programs import CODE_AT, NOTES, ROOM, assembled
from tests.bluepill_sim.machine import STACK
from tests.tools.suite.approved import judge_alike, judge_of, said

PROGRAMS, SLICES, SPANS_NS = 7, 24, (125, 1_000, 6_000, 25_000)
CORES = ("native", "python")
_VTOR, _DEMCR, _DFSR, _FP_CTRL, _FP_REMAP, _FP_COMP, _DWT = 0xED08, 0xEDFC, 0xED30, 0x2000, 0x2004, 0x2008, 0x1000
_TABLE = 0x2000_4800
#: Words that programs read and write, and the table.
_WORDS = (NOTES, NOTES + 8, SCRATCH + 0x140, STACK - 16, _TABLE)
#: MON_EN, MON_STEP and TRCENA; matches of an address, of reads, writes and both, of cycles, and what is not modelled.
_MONITOR = (0, 1 << 16, 0x0101_0000, 0x0101_0000, 0x0105_0000)
_FUNCTIONS = (0, 4, 5, 6, 7, 0x84, 0x104, 1)


@cache
def _image() -> tuple[Image, list[tuple[int, int]]]:
    return assembled(PROGRAMS, "break points")


def _code(board: BluePill, base: int, dice: random.Random) -> int:
    """Return a place in a program, most often one that it comes to soon."""
    is_inside = base <= board.pc < base + ROOM and dice.random() < 0.7
    return (board.pc & ~1 if is_inside else base + CODE_AT) + 2 * dice.randrange(20 if is_inside else 200)


def _change(board: BluePill, base: int, dice: random.Random) -> str:
    """Write a register of the debug units, or set a debugger's point."""
    system, number = board.chip.system, dice.randrange(8)
    match dice.randrange(9):
        case 0:
            offset, word = _DEMCR, dice.choice(_MONITOR)
        case 1:
            offset, word = _FP_CTRL, dice.choice((2, 3, 3, 3))
        case 2:
            offset, word = _FP_REMAP, dice.choice((_TABLE, 0x2000_0000, 0x2000_4FF0, _TABLE + 32))
        case 3 | 4:
            word = _code(board, base, dice) & ~3 | 1 | dice.choice((0, 0, 1, 2, 3)) << 30
            offset = _FP_COMP + 4 * number
        case 5:
            offset, word = _DWT + 0x20 + 16 * (number % 4), dice.choice((_code(board, base, dice), *_WORDS, 0x900))
        case 6:
            offset, word = _DWT + 0x24 + 16 * (number % 4), dice.choice((0, 1, 2, 5, 14))
        case 7:
            offset, word = _DWT + 0x28 + 16 * (number % 4), dice.choice(_FUNCTIONS)
        case _:
            return _set_point(board, base, dice)
    return f"{offset:x}={word:x} {system.write(offset, 4, word)}"


def _set_point(board: BluePill, base: int, dice: random.Random) -> str:
    engine, at = board.chip.engine, _code(board, base, dice)
    engine.breakpoints.clear()
    engine.watchpoints.clear()
    if dice.random() < 0.5:
        engine.breakpoints.add(at)
    else:
        engine.watchpoints.add(Watchpoint(dice.choice(_WORDS), dice.choice((1, 4)), dice.choice((*WatchKind,))))
    return said([[*engine.breakpoints], [*engine.watchpoints]])


def _lines(board: BluePill, number: int, base: int) -> Iterator[str]:
    dice, chip, shared = random.Random(f"points {number}"), board.chip, board.chip.processor.shared
    chip.system.write(_VTOR, 4, base)
    chip.engine.registers[Reg.SP] = STACK
    for register in GENERAL[:13]:
        chip.engine.registers[register] = dice.getrandbits(32)
    for n in range(8):
        chip.memory.write(_TABLE + 4 * n, dice.choice((b"\x00\xbf\x00\xbf", b"\x01\x30\x01\x31", b"\x00\xbe\x00\xbf")))
    for offset, word in ((_DEMCR, 0x0101_0000), (_FP_CTRL, 3), (_FP_REMAP, _TABLE)):
        chip.system.write(offset, 4, word)
    chip.engine.jump(chip.memory.read_word(base + 4) or 0)
    for turn in range(SLICES):
        done = " ".join(_change(board, base, dice) for _ in range(1 + 3 * (turn == 0)))
        if turn == SLICES // 2:
            saved = board.snapshot()
            board.advance_to(board.now_ns + 2_000)
            board.restore(saved)
        if dice.random() < 0.1:
            board.chip.memory.write(_TABLE + 4 * dice.randrange(8), bytes(4))
        advance = board.step if dice.random() < 0.2 else board.advance_to
        reached = advance(board.now_ns + dice.choice(SPANS_NS))
        points, patch = points_of(shared), chip.engine.flash_patch
        looked = [sorted(points.breakpoints), points.instructions, points.accesses, points.remapped, points.unmodelled]
        count = chip.system.count_at(chip.engine.cycle)
        at = _code(board, base, dice) & ~3
        code = chip.memory.read(at - 2, 64) or b""
        asked = [patch.is_on, patch.is_stale(), patch.fetched(at - 2, code).hex(), patch.concerns(at - 4, 8)]
        debug = [shared.dfsr, shared.demcr, list(shared.dwt_function), cycles_to_match(shared, count)]
        yield f"{done} | {said(reached)} {said(looked)} {said(asked)} {said(debug)} {test_program_walks._shown(board)}"
        shared.dfsr = 0


def _episodes(core: str, _: random.Random) -> Iterator[str]:
    with core_chosen(core):
        board = BluePill(_image()[0])
    heard: list[str] = []
    warn = board.chip.processor.on_unmodelled

    def hear(what: str) -> None:
        heard.append(what)
        warn(what)

    board.chip.processor.on_unmodelled = hear
    fresh = board.snapshot()
    for number, (base, _stop) in enumerate(_image()[1]):
        board.restore(fresh)
        yield "\n".join(
            [f"program {number}", *_lines(board, number, base), f"{heard} {board.warnings} {board.fault!r}"]
        )
        heard.clear()


TRACES = {core: partial(_episodes, core) for core in CORES}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
test_both_cores_show_the_same = judge_alike(__file__, CORES)
