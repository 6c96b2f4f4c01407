"""Boards whose programs fault, sleep, flip pins and reset, and what is asked of them meanwhile, as approved."""

import random
from collections.abc import Callable, Iterator

from bluepill_sim.board import BluePill
from tests.bluepill_sim.machine import PORT_A_OUT, Machine
from tests.tools.suite.approved import Trace, judge_of, said, tried

#: PA0 and PA1 count.
FLIPS = (
    PORT_A_OUT
    + """\
movs r3, #1
again: str r3, [r0, #12]
adds r3, #1
b again
"""
)
#: A program that faults, or lasts.
SOURCES = (
    "svc #0\nlog #1",
    "udf",
    "mov32 r1, #0x60000000\nldr r0, [r1, #0]",
    "mov32 r1, #0x08000001\nbx r1",
    "mov32 r1, #0x20004FFE\nldr r0, [r1, #0]\nldr r0, [r1, #4]",
    "mov32 r1, #0xE000ED14\nmovs r2, #16\nstr r2, [r1, #0]\nmovs r3, #4\nmovs r0, #0\nudiv r0, r3, r0",
    "cpsid i\nsvc #0",
    "wfi",
    "cpsid i\nwfi",
    "mov32 r0, #0xE000ED0C\nmov32 r1, #0x05FA0004\nstr r1, [r0, #0]",
    "mov32 r0, #0x40007C00\nldr r1, [r0, #0]\nstr r1, [r0, #0]",
    FLIPS,
)
VECTORS: tuple[dict[int, str | int], ...] = (
    {},
    {11: 0xFFFF_FFFF},
    {11: 0xFFFF_FFF9, 3: "handler"},
    {11: 0x0800_0200, 2: 0xFFFF_FFFF, 3: 0xFFFF_FFFF},
    {3: 0x2000_0001},
)


def stands(board: BluePill) -> str:
    return said(
        [
            *(str(board.fault), board.warnings, board.verdict, board.has_died, board.died_ns, board.is_asleep),
            *(board.activity, f"{board.pc:x}", board.where(), board.cycle, board.now_ns, board.next_deadline()),
            *(board.last_blocks()[-3:], board.led_is_on, [pin.name for pin in board.pins if pin.level][:9]),
        ]
    )


def faults(_draw: random.Random) -> Iterator[str]:
    for source in SOURCES:
        for vectors in VECTORS if source.startswith("svc") else VECTORS[3:] if source == "udf" else VECTORS[:1]:
            board = Machine(source + "\nhandler: nop", vectors).deafen().board
            for span in ("3 us", "50 us", "200 us"):
                yield said([span, board.run_for(span)]) + stands(board)


def lives(draw: random.Random) -> Iterator[str]:
    for _ in range(3):
        machine = Machine(draw.choice((FLIPS, FLIPS, SOURCES[-2])), {}).deafen()
        board, heard = machine.board, list[object]()
        pins = board.subscribe_pins(("PA0", "PA1"), lambda rows, heard=heard: heard.append(len(rows)))
        warned = board.subscribe_warnings(heard.append)
        for _ in range(26):
            found = draw.choice(ACTS)(draw, board)
            yield said([found, board.now_ns, board.cycle, f"{board.pc:x}", heard, board.warnings])
            heard.clear()
        pins.close()
        warned()


def until(draw: random.Random, board: BluePill) -> object:
    pin, end = board.pin("PA0"), board.cycle + draw.choice((0, 90, 10_000))
    what = draw.choice((lambda _: bool(pin.level), lambda one: one.cycle > end, lambda _: False))
    return tried(board.until, what, draw.choice(("1 us", "2 ms", "20 us", 1_000)))


def pins_of(draw: random.Random, board: BluePill) -> object:
    pin = board.pin(draw.choice(("PB0", "PA0", "PC13")))
    return [pin.name, pin.level]


def analog(draw: random.Random, board: BluePill) -> object:
    board.crystal_works = draw.random() < 0.5
    return [
        tried(setattr, board, "supply_v", draw.choice((3.3, 3.3, 2.0, 1.9, 3.6, 3.7, 0.0))),
        tried(setattr, board, "lsi_hz", draw.choice((30_000, 29_999, 60_000, 60_001, 40_000))),
        tried(setattr, board, "vdda_v", draw.choice((3.3, 2.4, 3.6, 9.0))),
        tried(setattr, board, "temperature_c", draw.choice((25.0, -40.0, 105.0, 106.0))),
        *(board.vdda_v, board.temperature_c, board.supply_v, board.lsi_hz, board.crystal_works),
    ]


def registers(draw: random.Random, board: BluePill) -> object:
    name = draw.choice(("GPIOA", "RCC", "gpioa", "X"))
    return [tried(lambda one: sorted(board.registers(one))[:4], name), board.read_memory(0x2000_0100, 4)]


def stop(_draw: random.Random, board: BluePill) -> object:
    board.request_stop()
    return board.run_for("1 ms")


ACTS: tuple[Callable[[random.Random, BluePill], object], ...] = (
    lambda draw, board: tried(board.run_for, draw.choice((0, 1, 125, 10_000, 150_000, "1 us", "x", -1))),
    lambda draw, board: board.step(board.now_ns + draw.choice((1, 100, 5_000))),
    *(until, until, pins_of, analog, registers, stop),
    lambda _draw, board: board.reset(),
)


TRACES: dict[str, Trace] = {"faults": faults, "lives": lives}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
