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


#: Sends "ok\\r\\n" and "no\\n" on USART1 at 500 kbit/s, sets PA0 and clears it again, and sleeps; again at each event.
SPEAKS = (
    "mov32 r0, #0x40021018\nmov32 r1, #0x4005\nstr r1, [r0, #0]\nmov32 r0, #0x40010800\nmov32 r1, #0x44444443\n"
    "str r1, [r0, #0]\nmov32 r1, #0x444444B4\nstr r1, [r0, #4]\nmov32 r2, #0x40013800\nmovs r1, #16\nstr r1, [r2, #8]\n"
    "mov32 r1, #0x2008\nstr r1, [r2, #12]\nagain: movs r1, #1\nstr r1, [r0, #16]\n"
    + "".join(f"movs r1, #{byte}\nbl send\n" for byte in b"ok\r\nno\n")
    + "mov32 r1, #0x10000\nstr r1, [r0, #16]\nmov32 r4, #900\nwait: subs r4, #1\nbne wait\nwfe\nb again\n"
    "send: str r1, [r2, #4]\nfull: ldr r3, [r2, #0]\n.half 0x061B\nbpl full\nbx lr"
)
CONDITIONS = (
    "pin PA0 high", "pin pa0 low", "pin PA0 changes", "Pin PA0 other", "pin PD7 low", "pin PA0", "usart1 sends ok",
    "usart1 sends no", "usart1 sends never", "usart1 matches ^ok$", "usart1 matches o$", "usart1 matches [",
    "usart9 sends x", "usart1 sends", "asleep", "awake", "fault", "nonsense", "", "usb sends x",
)  # fmt: skip


def conditions(_draw: random.Random) -> Iterator[str]:
    """Yield how runs up to a condition end: on a board out of reset, and going on from where the last one ended."""
    for wakes in (False, True):
        board = Machine(SPEAKS, {}).deafen().board
        for condition in CONDITIONS:
            for span in ("60 us", "2 ms"):
                if wakes:
                    board.chip.processor.send_event()
                found = tried(board.until, condition, span)
                yield said([condition, span, found, board.now_ns, board.cycle, bytes(board.usart1.unread[-12:])])
        for wanted, within in ((b"ok", "1 ms"), (b"no", 200_000), (b"never", "90 us"), (b"k\r", "5 us")):
            board.chip.processor.send_event()
            yield said(
                [wanted, tried(board.usart1.expect, wanted, within=within), board.now_ns, bytes(board.usart1.unread)]
            )
    for boot0, boot1 in ((False, None), (True, False), (True, True)):
        board = Machine(FLIPS, {}).deafen().board
        board.chip.memory.write(0x2000_0000, bytes.fromhex("0050002001000020fee7"))
        board.boot0 = boot0
        board.pin("PB2").drive(boot1)
        yield said([tried(board.reset), tried(board.run_for, "20 us"), f"{board.pc:x}", board.fault is not None])
    for name in ("spi", "i2c"):
        for bus in ("SPI1", "SPI3", "I2C1", "I2C9", "spi2"):
            yield said([name, bus, tried(lambda name, bus: type(getattr(board, name)(bus)).__name__, name, bus)])
    for select in ("PZ1", "PB0"):
        yield tried(lambda select: type(board.spi("SPI1", None, select=select)).__name__, select)


TRACES: dict[str, Trace] = {"faults": faults, "lives": lives, "conditions": conditions}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
