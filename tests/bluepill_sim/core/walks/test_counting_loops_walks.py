"""Loops at random that poll a counter, on all cores, against traces that were approved.

A loop is a block: it loads what counts, computes with it, and goes round by some condition, or not. What C works out at
once (`polling.c`) is what going round gives: where the core stands then, when, and with what in its registers.
"""

import random
import zlib
from collections.abc import Iterator
from functools import partial

from bluepill_sim.core import Reg
from bluepill_sim.core.unicorn_core import GENERAL
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.native.engine import NativeEngine
from tests.bluepill_sim.machine import COUNTER_ON, Machine
from tests.tools.suite.approved import judge_alike, judge_of

LOOPS = 90
#: The cores that go from block to block, and so show the same.
CORES = ("native", "python", "own")
#: Time that a loop has, ns: some end before it, and it ends within the round of others.
SPANS_NS = (7_000, 21_000, 40_125)
#: What is read: TIM2's counter and its reload value, the cycle counter, SysTick.
_CNT, _ARR, _CYCCNT, _VAL = 0x4000_0024, 0x4000_002C, 0xE000_1004, 0xE000_E018
#: Of TIM2, the prescaler, the reload value and CR1: up, down, both ways, and with time for each count.
_TIMERS = ((0, 99, 1), (0, 0xFFFF, 1), (6, 60, 0x11), (15, 37, 0x61), (30, 20, 1), (3, 7, 9))
#: Of SysTick, the reload value and CTRL: by the core's clock, and by an eighth of it.
_TICKS = ((999, 5), (0xFF_FFFF, 5), (14, 1))
#: r2 and r3 hold small numbers, and such as reach one of these with what is counted: there a flag changes.
_BOUNDS = (0, 0, 0x8000_0000, 0x8000_0000, 1 << 31 | 1 << 16)
#: Conditions that look at C, and at N and V, more often than the others.
_CONDITIONS = (*range(14), 2, 3, 3, 3, 8, 9, 9, 10, 11, 12, 13, 11, 13)
#: Steps whose flags hang on both operands: ADDS, SUBS and CMP of r0 with r2, r3 and small numbers.
_LAST = (
    0x1880, 0x1880, 0x1880, 0x1A80, 0x1A80, 0x1A10, 0x4298, 0x4298, 0x4283, *(0x2800 | n for n in (4, 9, 15, 30)),
    0x3004, 0x3804, 0x3809, 0x380F,
)  # fmt: skip
#: ADDS, SUBS, CMP, LSLS, LSRS, ANDS, TST and UXTH of r0, with r2, r3 and small numbers.
_STEPS = (
    *(0x3000 | n for n in (1, 3, 200, 255)), *(0x3800 | n for n in (1, 9, 255)), *(0x2800 | n for n in (0, 5, 40, 255)),
    *(n << 6 for n in (1, 20, 28, 31)), *(0x0800 | n << 6 for n in (1, 2, 5, 31)), 0x1C40, 0x1DC0, 0x1E40, 0x1FC0,
    0x1880, 0x1880, 0x1A80, 0x1A80, 0x1A10, 0x1A10, 0x4298, 0x4298, 0x4283, 0x4283, 0x4010, 0x4218, 0xB280,
)  # fmt: skip


def _loop(dice: random.Random) -> str:
    """Return a block that may poll, and what stands behind it."""
    load = dice.choice((0x6808, 0x6808, 0x8808))
    body = [load, *(dice.choice(_STEPS) for _ in range(dice.choice((0, 0, 1, 1, 2, 3, 5))))]
    body.append(dice.choice(dice.choice((_LAST, _LAST, _LAST, _STEPS))))
    back = 0xD000 | dice.choice(_CONDITIONS) << 8 | (0x100 - len(body) - 2)
    return f".half {', '.join(map(str, (*body, back)))}\nb stop\n"


def _set_up(timer: tuple[int, int, int], tick: tuple[int, int]) -> str:
    words = [(0x4002_101C, 1), *zip((0x4000_0028, 0x4000_002C, 0x4000_0000), timer, strict=True)]
    words += zip((0xE000_E014, 0xE000_E018, 0xE000_E010), (tick[0], 0, tick[1]), strict=True)
    return COUNTER_ON + "".join(f"mov32 r0, #{at}\nmov32 r1, #{word}\nstr r1, [r0, #0]\n" for at, word in words)


def _walk(core: str, _: random.Random, *, shows_rows: bool = False) -> Iterator[str]:
    dice = random.Random("loops that count")
    for number, timer in enumerate(_TIMERS):
        tick = _TICKS[number % len(_TICKS)]
        loops = "".join(f"loop{n}: {_loop(dice)}" for n in range(LOOPS))
        with core_chosen(core):
            machine = Machine(f"{_set_up(timer, tick)}b stop\n{loops}", {}).deafen()
        board, engine = machine.board, machine.board.chip.engine
        board.advance_to(board.now_ns + 100_000)
        for n in range(LOOPS):
            values = [0, dice.choice((_CNT, _CNT, _CNT, _CYCCNT, _CYCCNT, _VAL, _ARR))]
            values += (
                dice.choice((dice.randrange(60), dice.choice(_BOUNDS) - dice.randrange(60) & 0xFFFF_FFFF)) for _ in "23"
            )
            for register, value in zip(GENERAL[:4], values, strict=True):
                engine.registers[register] = value
            if values[1] == _CYCCNT and n % 2:  # near what it counts to
                engine.registers[GENERAL[2]] = engine.registers[GENERAL[3]] = board.chip.system.count_at(engine.cycle)
            engine.jump(machine.label(f"loop{n}") | 1)
            board.advance_to(board.now_ns + dice.choice(SPANS_NS))
            seen = [engine.registers[register] for register in (*GENERAL[:4], Reg.XPSR)]
            if shows_rows and isinstance(engine, NativeEngine):  # C writes the last rows alone of what it worked out
                yield f"{number} {n} {engine.shared.logged}"
                continue
            rows = zlib.crc32(str(board.last_rows).encode())
            yield f"{number} {n} {board.pc:x} {engine.cycle} {' '.join(f'{value:x}' for value in seen)} {rows:x}"


TRACES = {core: partial(_walk, core) for core in (*CORES, "exact")} | {"rows": partial(_walk, "own", shows_rows=True)}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
test_cores_that_go_from_block_to_block_show_the_same = judge_alike(__file__, CORES)
