"""Faults of every kind, where handlers are there, missing or faulty themselves, on every core, as approved.

Each program sets up what faults go by (SHCSR, CCR, priorities, masks, privilege, stack, vector table), makes one or two
faults or calls, and has handlers that return, skip what failed, fault, or return wrongly. In every third a debugger
halts the core at a BKPT.
"""

import random
import struct
from collections.abc import Iterator
from functools import cache, partial

from bluepill_sim.debug.inspector import Inspector
from bluepill_sim.extension.library import core_chosen
from tests.bluepill_sim.core.test_faults import CASES, store
from tests.bluepill_sim.core.walks.test_program_walks import _shown
from tests.bluepill_sim.machine import CODE, FLASH, STACK, VECTORS, Assembler, Machine
from tests.tools.suite.approved import judge_alike, judge_of, said

PROGRAMS, SPANS_NS = 48, (1_500, 9_000, 60_000)
#: The cores that go from block to block, and so show the same.
CORES = ("native", "python", "own")
_VTOR, _ICSR, _AIRCR, _SCR, _CCR, _SHPR1, _SHCSR, _STIR = (
    0xE000_ED08, 0xE000_ED04, 0xE000_ED0C, 0xE000_ED10, 0xE000_ED14, 0xE000_ED18, 0xE000_ED24, 0xE000_EF00,
)  # fmt: skip
#: A vector table whose last vectors are behind the SRAM, and one where nothing is.
_SHORT_TABLE, _NO_TABLE = 0x2000_4FD0, 0x3000_0000
#: Bytes of flash that a program has at most.
_ROOM = 0x400
#: What handlers do.
HANDLERS = """
returns: bx lr
skips: ldr r1, [sp, #24]
adds r1, #2
str r1, [sp, #24]
bx lr
fails: udf
reads: mov32 r1, #0x70000000
ldr r0, [r1, #0]
bx lr
calls: svc #1
bx lr
wrong: mov32 r0, #0xFFFFFFF3
bx r0
other: mov32 r0, #0xFFFFFFF1
bx r0
lost: mov32 r0, #0x20004FF0
mov sp, r0
bx lr
clears: movs r1, #0
str r1, [sp, #28]
bx lr
masks: cpsid f
bx lr
wakes: movs r0, #0
msr faultmask, r0
msr basepri, r0
bx lr
"""
_NAMES = ("returns", "skips", "skips", "skips", "fails", "reads", "calls", "wrong", "other", "lost", "clears", "wakes")
#: Vectors that no code stands at: nowhere, without the T bit, where nothing is executed, and the end of SRAM.
_BAD = (0, 0x2000_0000, 0xE000_0001, 0x2000_4FFF)
#: What may stand before a fault.
_BEFORE = (
    "", "", "", "cpsid i\n", "cpsid f\n", "movs r0, #64\nmsr basepri, r0\n", "movs r0, #1\nmsr control, r0\nisb\n",
    "mov32 r0, #0x20000010\nmov sp, r0\n", "mov32 r0, #0x20004FFC\nmov sp, r0\n",
    "mov32 r0, #0x20000804\nmsr psp, r0\nmovs r0, #2\nmsr control, r0\nisb\n", f"{store(_VTOR, _SHORT_TABLE)}dsb\n",
    f"{store(_VTOR, _NO_TABLE)}dsb\n", store(_AIRCR, 0x05FA_0000 | 5 << 8), store(_SCR, 0x12), store(_SCR, 6),
)  # fmt: skip
#: What fails, or asks for an exception.
_FAULTS = (
    *(source.replace("bad: ", "").replace("target", "{0}").replace("wfe_first: ", "") for _, source, _, _ in CASES),
    "svc #3", "svc #3", store(_ICSR, 1 << 28), store(_ICSR, 1 << 31), store(_ICSR, 1 << 26), store(_STIR, 7),
    "bkpt #1", "mov32 r1, #0x60000000\nstr r0, [r1, #0]\nldr r0, [r1, #0]", "push {r0-r3}\npop {r0-r3}\nsvc #0",
    "movs r0, #1\nmsr faultmask, r0\nsvc #0", store(_SHCSR, 0x1FFFF), store(_AIRCR, 0x05FA_0001),
    "sev\nwfe", "wfe", "sev\nwfi", f"cpsid i\n{store(_ICSR, 1 << 28)}wfi\ncpsie i",
)  # fmt: skip
#: Handlers in handlers, and FAULTMASK that a return clears, but for NMI's.
_NESTED: tuple[tuple[str, dict[int, str | int]], ...] = (
    *(("svc #1", {11: "fails", 3: name}) for name in ("wrong", "other", "skips", "clears", "returns", "masks")),
    ("svc #1", {11: "masks"}), ("udf", {3: "masks"}), (store(_ICSR, 1 << 31), {2: "masks"}),
    (store(_ICSR, 1 << 31), {2: "fails", 3: "skips"}), (store(_ICSR, 1 << 31), {2: "wrong", 3: "skips"}),
    (store(_ICSR, 1 << 28), {14: "calls", 11: "returns", 3: "skips"}),
)  # fmt: skip


@cache
def _program(number: int) -> tuple[bytes, str]:
    """Return a program as it stands in flash, and what it is in words."""
    dice = random.Random(f"faults {number}")
    vectors: dict[int, str | int] = {
        place: dice.choice(_BAD) if dice.random() < 0.06 else dice.choice(_NAMES)
        for place in (2, 3, 4, 5, 6, 11, 12, 14, 15, 23) if dice.random() < 0.8
    }  # fmt: skip
    setup = [
        store(_SHCSR, dice.choice((0, 1 << 16, 1 << 17, 1 << 18, 7 << 16, 7 << 16))),
        store(_CCR, dice.choice((0, 0x200, 0x18, 0x300, 0x219, 0x302))),
        *(store(_SHPR1 + 4 * n, dice.getrandbits(32)) for n in range(3) if dice.random() < 0.4),
        store(0xE000_E100, 0x80),
    ]
    picked = [dice.choice(_BEFORE)] + [dice.choice(_FAULTS) for _ in range(dice.choice((1, 2, 3)))]
    if number < len(_NESTED):
        setup, picked, vectors = [], [_NESTED[number][0]], _NESTED[number][1]
    body = "\n".join(f"{one.format(f't{n}')}\nadds r{n + 3}, #1" for n, one in enumerate(_bracketed(picked)))
    made = Assembler(f"{''.join(setup)}{body}\nstop: b stop\n{HANDLERS}", CODE)
    table = [STACK, CODE | 1, *[made.labels["stop"] | 1] * (VECTORS - 2)]
    for place, target in vectors.items():
        table[place] = target if isinstance(target, int) else made.labels[target] | 1
    data = struct.pack(f"<{VECTORS}I", *table).ljust(CODE - FLASH, b"\xff") + made.code
    return data.ljust(_ROOM, b"\xff"), f"{number} {picked} {vectors}"


def _bracketed(sources: list[str]) -> list[str]:
    """Return sources whose lists of registers are no places to fill."""
    return [source if "{0}" in source else source.replace("{", "{{").replace("}", "}}") for source in sources]


def _episodes(core: str, _: random.Random) -> Iterator[str]:
    with core_chosen(core):
        board = Machine("nop", {}).deafen().board
    fresh = board.snapshot()
    for number in range(PROGRAMS):
        data, words = _program(number)
        board.restore(fresh)
        Inspector(board).program_flash(0, data)
        board.chip.memory.write(_SHORT_TABLE, data[:48])
        board.chip.engine.jump(CODE | 1)
        board.chip.processor.halts_on_bkpt = number % 3 == 0
        lines = [words]
        for span in SPANS_NS:
            reached = board.advance_to(board.now_ns + span)
            lines.append(f"{said(reached)} {_shown(board)} {board.fault} {board.warnings} {board.verdict}")
        yield "\n".join(lines)


TRACES = {core: partial(_episodes, core) for core in (*CORES, "exact")}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
test_cores_that_go_from_block_to_block_show_the_same = judge_alike(__file__, CORES)
