"""Where two runs part, for outputs of every kind, and how long handlers run, as approved."""

import random
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

from bluepill_sim.analysis.interrupts import races
from bluepill_sim.analysis.interrupts.races import (
    Channel,
    HandlerStretches,
    InterruptOrder,
    Latencies,
    OutputParting,
    OutputRecording,
    Race,
    RaceReport,
    RaceSearch,
    RunOutputs,
    Slack,
    parting_of,
)
from bluepill_sim.core import BLOCK, EXCEPTION_RETURN, Reg
from bluepill_sim.core.recorder import RECORD
from bluepill_sim.debug.cores.comparison import core_value, values_apart
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.fabric.clocks import Clocks, illegal_settings
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE
from bluepill_sim.program.image import Image, Symbol, SymbolTable
from bluepill_sim.program.line_table import LineRow, LineTable
from bluepill_sim.spans import to_nanos
from tests.bluepill_sim.machine import PORT_A_OUT, Machine
from tests.tools.suite.approved import Trace, judge_of, said, tried


def outputs(draw: random.Random, end: int) -> RunOutputs:
    channels = {}
    for name in ("PA0", "PB1", "USART1")[: draw.choice((1, 2, 3, 3))]:
        at, channel = 0, Channel()
        for _ in range(draw.choice((0, 1, 4, 7))):
            at += draw.choice((5, 20, 100))
            channel.times.append(at)
            channel.values.append(draw.choice((0, 1, 2)) if name != "USART1" else draw.choice((65, 200)))
        channels[name] = channel
    last = max((time for channel in channels.values() for time in channel.times), default=0)
    return RunOutputs(channels=channels, end=draw.choice((end, last + 3, last + 12)), interrupts=draw.randrange(4))


def other_of(draw: random.Random, one: RunOutputs) -> RunOutputs:
    """Return outputs that are like others, a little later, with something else in them perhaps."""
    channels = {}
    for name, channel in one.channels.items():
        late = draw.choice((0, 0, 3, 8))
        times = [at + late + draw.choice((0, 0, 1, 9)) for at in channel.times]
        most = 300 if name.startswith("USART") else len(PinDrive)
        values = [value if draw.random() < 0.93 else (value + 1) % most for value in channel.values]
        cut = draw.choice((len(times), len(times), len(times) - 1))
        if draw.random() < 0.93:
            channels[name] = Channel(sorted(times)[:cut], values[:cut])
    return RunOutputs(channels=channels, end=one.end + draw.choice((0, -10, 10)), interrupts=one.interrupts)


def partings(draw: random.Random) -> Iterator[str]:
    for _ in range(320):
        entries = tuple(sorted(draw.randrange(400) for _ in range(draw.choice((0, 2, 5)))))
        slack = Slack(latency_ns=draw.choice((0, 1, 4)), stretch_ns=draw.choice((0, 2)), entries=entries)
        one = outputs(draw, draw.choice((50, 200, 1_000)))
        other = other_of(draw, one)
        found = parting_of(one, other, slack)
        shown = [] if found is None else [races._shown(run, found, slack) for run in (one, other)]
        yield said([found, parting_of(other, one, slack), shown, slack.near, slack.between(3, 200), slack.order(100)])
    slack = Slack(latency_ns=1, stretch_ns=2, entries=())
    run = RunOutputs(
        channels={name: Channel([5 * 10**6 * n for n in range(6)], [0, 1, 2, 3, 4, 0]) for name in ("PA0", "USART1")},
        end=9,
        interrupts=0,
    )
    for parting in (
        OutputParting(3, "PA0", 1),
        OutputParting(5_000_001, "PA0", 1, "USART1"),
        OutputParting(3, "PB0", 0),
        OutputParting(9, "USART1", 3),
    ):
        yield said(races._shown(run, parting, slack))


def stretches(draw: random.Random) -> Iterator[str]:
    for _ in range(30):
        seen, cycle, rows = HandlerStretches(), 0, b""
        for _ in range(14):
            cycle += draw.choice((0, 1, 12, 50))
            row = (cycle, 0x100, draw.choice((BLOCK, BLOCK, 3, 15, EXCEPTION_RETURN, EXCEPTION_RETURN)))
            if draw.random() < 0.5:
                seen.put(*row)
            else:
                rows = RECORD.pack(*row) + RECORD.pack(cycle, 0, BLOCK)
                seen.put_packed(rows)
            yield said([row, seen.longest, seen.entries])


class Board:
    """As much of a board as what it puts out is taken by."""

    def __init__(self, remaps: dict[str, int]) -> None:
        self.chip = SimpleNamespace(pins=SimpleNamespace(remaps=remaps), latency=SimpleNamespace(count=3))
        self.takers: dict[str, Any] = {}
        self.serial_ports = {
            f"usart{n}": SimpleNamespace(subscribe=lambda take, n=n: self.takers.__setitem__(f"u{n}", take))
            for n in (1, 2, 3)
        }

    def subscribe_pins(self, _pins: object, take: Any) -> None:
        self.takers["pins"] = take


def recordings(draw: random.Random) -> Iterator[str]:
    for _ in range(20):
        board: Any = Board(draw.choice(({}, {"USART1": 1}, {"USART2": 9})))
        recording = OutputRecording(board)
        board.takers["pins"](
            b"".join(
                EDGE.pack(draw.randrange(99), pin, draw.randrange(5), 0, 0, 0)
                for pin in draw.choices((0, 2, 9, 16, 22, 31, 45), k=6)
            )
        )
        for number in draw.sample((1, 2, 3), draw.choice((0, 1, 2))):
            board.takers[f"u{number}"]([(65, 7), (66, 9)])
        yield said(recording.taken(100))
    yield said(
        [races._word("USART1", value) for value in (10, 65, 127, 128, 300)]
        + [races._word("PA0", n) for n in range(len(PinDrive))]
    )
    image = Image(
        "a",
        ((0x0800_0000, (0x2000_5000).to_bytes(4, "little") + (0x0800_0009).to_bytes(4, "little")),),
        SymbolTable((Symbol("main", 0x0800_0008, 8),)),
    )
    order = InterruptOrder(address=0x0800_000A, cycle=7, puts_out=("x",))
    race = Race(
        exception=15,
        before=order,
        behind=order,
        parting=OutputParting(1, "PA0", 2),
        latencies=Latencies(seed=1, most=2),
    )
    report = RaceReport(
        runs=1,
        differing=1,
        races=(race,),
        interrupts=4,
        stretch_ns=5,
        lines=LineTable((LineRow(0x0800_0008, 0x0800_000C, "m.c", 3),)),
        image=image,
    )
    yield said(
        [
            race.name,
            report.place(0x0800_000A),
            report.place(0x0800_000E),
            report.place(0x1000_0000),
            report.races[0].latencies,
            races._lines_of(image),
        ]
    )


def cores(draw: random.Random) -> Iterator[str]:
    for one, other in ((b"\0" * 8, b"\0\0\0\0\0\1\0\0"), (b"a", b"bc"), (1, 2), ("x", "y"), (0xFFFF_FFFF, 0)):
        yield said([core_value(name, one, other) for name in ("R0", "chip.sram")])
    machines = [Machine("movs r0, #1\nadds r0, #2\nstr r0, [r7, #0]", {}) for _ in range(2)]
    boards = (machines[0].board, machines[1].board)
    for board in boards:
        board.advance_to(3_000)
    yield said(values_apart(boards))
    boards[0].chip.memory.write(0x2000_0104, b"\5")
    boards[1].chip.engine.registers[Reg.R0] = 9
    boards[1].chip.warn("odd", once="odd")
    yield said(values_apart(boards))


def clocks(draw: random.Random) -> Iterator[str]:
    for sysclk in (8_000_000, 24_000_000, 24_024_000, 24_024_001, 48_048_001, 72_000_000, 72_072_000, 72_072_001):
        for states in (0, 1, 2, 3, 7):
            made = Clocks(
                sysclk_hz=sysclk,
                hclk_hz=draw.choice((sysclk, sysclk // 2)),
                pclk1_hz=draw.choice((36_000_000, 36_036_000, 36_036_001)),
                flash_wait_states=states,
                flash_prefetch=draw.choice((0, 1)),
            )
            yield said(
                [sysclk, states, illegal_settings(made), made == Clocks(), made == made.snapshot(), made.snapshot()]
            )
    yield said([Clocks() == Clocks(), Clocks().snapshot()])
    for span in (
        0,
        1,
        -1,
        True,
        "1 s",
        "10 ms",
        "0.1 us",
        "1",
        "x",
        "-1 s",
        "8784 h",
        "8784.1 h",
        "8785h",
        "1.5 min",
        "0.0000001 s",
        "1 ns",
        "0.5 ns",
        1.5,
    ):
        yield tried(to_nanos, span)


#: PA1 flips by a loop, PA0 by SysTick in the same register: what an interrupt does between the two is lost.
FLIPS = (
    PORT_A_OUT
    + """\
mov32 r1, #0xE000E010
mov32 r2, #{reload}
str r2, [r1, #4]
movs r2, #7
str r2, [r1, #0]
again: movs r5, #30
wait: subs r5, #1
bne wait
ldr r3, [r0, #12]
movs r4, #2
.half 0x4063
str r3, [r0, #12]
b again
tick: mov32 r1, #0x4001080C
ldr r2, [r1, #0]
movs r3, #1
.half 0x405A
str r2, [r1, #0]
bx lr
"""
)


def seen_of(report: RaceReport) -> list[object]:
    """Return a report without its image."""
    places = [(race.name, report.place(race.before.address)) for race in report.races]
    return [report.runs, report.differing, report.races, report.interrupts, report.stretch_ns, places]


def searches(_draw: random.Random) -> Iterator[str]:
    for reload, most in ((3_999, 2), (3_999, 12), (2_999, 7)):
        image = Machine(FLIPS.format(reload=reload), {15: "tick"}).deafen().image
        for core in ("exact",) if most > 2 else ("exact", "native"):
            with core_chosen(core):
                looked = list[int]()
                search = RaceSearch(
                    *(image, 2_500_000, lambda board: board.advance_to),
                    most=most,
                    look=lambda looked=looked: looked.append(1),
                )
                found = tried(lambda seeds, search=search: seen_of(search.search(seeds)), range(3))
                yield said([core, reload, most, found, len(looked), getattr(search, "_slack", "none")])


TRACES: dict[str, Trace] = {
    "searches": searches,
    "partings": partings,
    "stretches": stretches,
    "recordings": recordings,
    "cores": cores,
    "clocks": clocks,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
