"""Coverage, cycles and waits of blocks in any order, and the pages that show them, as approved."""

import random
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from bluepill_sim.analysis.columns import in_columns
from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.coverage_page import coverage_page
from bluepill_sim.analysis.coverage_text import coverage_lines, one_way_lines, refuse_without_lines, shortfall
from bluepill_sim.analysis.cycle_profile import ASLEEP, CycleProfile
from bluepill_sim.analysis.flame_graph import flame_svg
from bluepill_sim.analysis.interrupts.latency import ExceptionCost, LatencyProbe
from bluepill_sim.analysis.lcov import lcov_lines, write_lcov
from bluepill_sim.analysis.profile_text import exception_lines, function_lines
from bluepill_sim.analysis.stack import StackGauge, StackUse
from bluepill_sim.fabric.fabric import FIRST_LINE_ROW
from bluepill_sim.fabric.subscriptions import EDGE
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.image import Image, SymbolTable, load_image
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.program.static_code import StaticCode
from bluepill_sim.stm32f103 import FLASH_BASE
from tests.tools.suite.approved import Trace, judge_of, said, tried

PROGRAM = Path(__file__).resolve().parents[2] / "firmware" / "parts.elf"


class Run:
    """Listeners at a program that is not run: blocks come as they are drawn."""

    def __init__(self, draw: random.Random, *, has_lines: bool = True, has_names: bool = True) -> None:
        whole, memory = load_image(PROGRAM), Memory()
        for start, data in whole.segments:
            memory.load_flash(start - FLASH_BASE, data)
        self.image = whole if has_names else Image(whole.name, whole.segments, SymbolTable())
        self.code, functions = StaticCode(memory), FunctionTable(whole)
        self.coverage = Coverage(
            self.image, read_lines(whole) if has_lines else LineTable(), self.code, lambda cycle: 125 * cycle
        )
        self.profile = CycleProfile(FunctionTable(self.image), self.code)
        self.starts = sorted(self.code.reachable([one.address for one in functions.functions], functions.end_of))
        self.draw, self.cycle, self.depth = draw, 0, 0

    def go(self, blocks: int) -> None:
        """Let blocks, and exceptions around them, come one after the other; most go on where they lead."""
        draw, at, returns = self.draw, self.draw.choice(self.starts), list[int]()
        for _ in range(blocks):
            block = self.code.block(at)
            ways = [block.end if block.can_fall_through else None, block.last.destination]
            known = [way for way in ways if way is not None and self.code.block(way).addresses]
            after = (
                draw.choice(known)
                if known and draw.random() < 0.85
                else returns.pop()
                if returns
                else draw.choice(self.starts)
            )
            if block.is_call:
                returns.append(block.end)
            if draw.random() < 0.1:
                after = draw.choice([*block.addresses, block.end])
            cycles = draw.choice((1, 3, len(block.addresses), 40))
            following = None if draw.random() < 0.05 else after
            for listener in (self.coverage, self.profile):
                listener.block(at, following, self.cycle, cycles)
            self.cycle += cycles + draw.choice((0, 0, 0, 7, 25))
            self._maybe_interrupt()
            at = after

    def _maybe_interrupt(self) -> None:
        chance, listeners = self.draw.random(), (self.coverage, self.profile)
        if chance < 0.08:
            for one in listeners:
                one.enter(15 + len(listeners) * (chance < 0.04), self.cycle)
        elif chance < 0.16:
            for one in listeners:
                one.leave(self.cycle)
        elif chance < 0.17:
            for one in listeners:
                one.reset(self.cycle)
        self.cycle += self.draw.choice((0, 12))


def covered(draw: random.Random) -> Iterator[str]:
    for lines, names in ((True, True), (True, True), (False, True), (False, False)):
        run = Run(draw, has_lines=lines, has_names=names)
        run.go(draw.choice((60, 250)))
        coverage = run.coverage
        yield said(
            [coverage.instructions(), coverage.first_ns(), coverage.branches(), coverage.unreached, coverage.has_lines]
        )
        yield said([coverage.one_way(), coverage.functions(), coverage.pieces()])
        yield "\n".join(
            [*coverage_lines(coverage), *coverage_lines(coverage, missed=False), *one_way_lines(coverage)]
        ).replace(str(PROGRAM.parents[3]), "…")
        for file in coverage.files():
            yield said(
                [
                    file.name.rpartition("/")[2],
                    file.lines,
                    file.first_ns,
                    file.branches,
                    file.functions,
                    file.lines_hit,
                    file.ways,
                    file.missed_lines,
                ]
            )
        some = [row for row in coverage.files()[:1] for row in list(row.lines)[:12]]
        yield said([sorted(coverage.blocks_of(coverage.files()[0].name, line)) for line in some])
        yield said([shortfall(coverage, least) for least in (0, 0.01, 10, 50, 99.9, 100)]) + tried(
            refuse_without_lines, coverage, "a.elf"
        )
        page = coverage_page(coverage, title="a < b", sources=None)
        yield page.replace(str(PROGRAM.parents[3]), "…")
        named = [
            SimpleNamespace(
                **{name: getattr(file, name) for name in ("functions", "branches", "ways", "lines", "lines_hit")},
                name=name,
            )
            for file, name in zip(coverage.files()[:2], ("/a/b.c", "c.c"), strict=False)
        ]
        yield "\n".join([*lcov_lines(named), *lcov_lines(named, sources=Path("/src"))])  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        write_lcov([], Path(folder) / "x")
        yield (Path(folder) / "x").read_text()


def profiled(draw: random.Random) -> Iterator[str]:
    for _ in range(6):
        run = Run(draw, has_names=draw.random() < 0.8)
        run.go(draw.choice((40, 160)))
        profile = run.profile
        yield said([profile.total_cycles, profile.functions(), sorted(profile.calls.items()), run.cycle])
        yield "\n".join([*profile.folded(), *function_lines(profile), *function_lines(profile, most=2)])
        yield flame_svg(profile.stacks, title="a & b", hz=8_000_000)
    yield "\n".join(function_lines(CycleProfile(FunctionTable(load_image(PROGRAM)), StaticCode(Memory()))))
    for stacks in (
        {},
        {("a",): 0},
        {("a", ASLEEP): 5},
        {("a" * 300,): 10, ("b",): 1, ("<x>", "c"): 3_000, ("<x>",): 1, ("a", "b", "a"): 90_000},
    ):
        yield flame_svg(stacks, title="t", hz=1_000_000)
    profile = CycleProfile(FunctionTable(load_image(PROGRAM)), StaticCode(Memory()))
    profile.stacks.update({("main",): 3, ("main", ASLEEP): 97, ("<x>", "tick"): 4})
    profile.calls.update({"main": 1, "tick": 2})
    yield "\n".join(function_lines(profile))


class Listening:
    """As much of a board as waits are measured by."""

    def __init__(self) -> None:
        self.chip = self.pins = self.processor = self.systick = self
        self.sink: Callable[[bytes], None] = lambda _rows: None
        self.rows, self.is_over = b"", list[str]()

    def subscribe_pins(self, _pins: object, sink: Callable[[bytes], None], **_lines: object) -> "Listening":
        self.sink = sink
        return self

    def listen(self, _hears: object) -> None:
        self.is_over.append("listens")

    def unlisten(self, _hears: object) -> None:
        self.is_over.append("unlistens")

    def close(self) -> None:
        self.is_over.append("closed")

    def deliver(self) -> None:
        rows, self.rows = self.rows, b""
        self.sink(rows)

    def cycle_at(self, ns: int) -> int:
        return ns // 10


def waits(draw: random.Random) -> Iterator[str]:
    for _ in range(14):
        board: Any = Listening()
        probe, cycle = LatencyProbe(board), 0
        for _ in range(70):
            cycle += draw.choice((0, 1, 12, 100))
            what = draw.choice(
                ("tick", "line", "line", "enter", "enter", "enter", "block", "block", "leave", "leave", "reset")
            )
            if what == "tick":
                probe._tick_set(cycle, draw.choice((None, cycle, cycle + 5, cycle + 50)), draw.choice((0, 40, 100)))
            elif what == "line":
                board.rows += EDGE.pack(
                    10 * cycle + draw.choice((0, 9)),
                    FIRST_LINE_ROW + draw.choice((3, 37)),
                    draw.choice((0, 1, 1)),
                    draw.choice((0, 1, 1)),
                    0,
                    0,
                )
            elif what == "enter":
                probe.enter(draw.choice((15, 15, 19, 53)), cycle)
            elif what == "block":
                probe.block(0, None, cycle, 3)
            elif what == "reset" and draw.random() < 0.3:
                probe.reset(cycle)
            elif what == "leave":
                probe.leave(cycle)
            yield said([what, cycle, probe.by_name])
        probe.detach()
        costs = probe.by_name
        yield said(
            [board.is_over, [(cost.worst_wait, cost.mean_wait, cost.least_wait, cost.worst_duration) for cost in costs]]
        )
        yield "\n".join(exception_lines(costs, 72_000_000))
    yield said(
        [
            exception_lines((), 1),
            exception_lines([ExceptionCost(3)], 8_000_000),
            in_columns(("a", "bcd"), [("xx", "y"), ("", "")], right=(1,)),
            in_columns(("a",), []),
        ]
    )


def stacks(draw: random.Random) -> Iterator[str]:
    memory = Memory()
    board: Any = SimpleNamespace(
        image=load_image(PROGRAM), chip=SimpleNamespace(memory=memory), read_memory=memory.read
    )
    gauge = StackGauge(board)
    yield said([gauge.measure(), str(gauge.measure())])
    for _ in range(12):
        at = draw.choice(
            (
                gauge._top - 4,
                gauge._top - 100,
                gauge._bottom,
                gauge._bottom + 40,
                draw.randrange(gauge._bottom, gauge._top, 4),
            )
        )
        memory.write(at, bytes(draw.choice((1, 4, 64))) if at + 64 <= gauge._top else bytes(4))
        use = gauge.measure()
        yield f"{use} {said(use)} {use.lowest:x}"
    yield str(StackUse(0x2000_5000, 0, 0))


def memories(draw: random.Random) -> Iterator[str]:
    memory, calls = Memory(), list[str]()
    memory.on_reprogrammed = lambda: calls.append("reprogrammed")
    yield said(
        [
            [(region.base, region.end, region.is_writable) for region in memory.regions],
            memory.options.hex(),
            memory.read(0x1FFF_F7E0, 20),
        ]
    )
    for _ in range(60):
        region = draw.choice(memory.regions)
        at, size = (
            draw.choice((region.base - 1, region.base, region.base + 3, region.end - 4, region.end - 1, region.end)),
            draw.choice((1, 2, 4, 5)),
        )
        what = draw.choice(("read", "read_word", "write", "write", "flash", "options", "power", "seal", "reprogrammed"))
        if what == "read":
            found: object = memory.read(at, size)
        elif what == "read_word":
            found = memory.read_word(at)
        elif what == "write":
            found = memory.write(at, draw.randbytes(size))
        elif what == "flash":
            memory.load_flash(draw.choice((0, 0x1_FFF0)), draw.randbytes(4))
            found = memory.read_flash(0x1_FFF0, 4)
        elif what == "options":
            memory.options = draw.randbytes(16)
            found = memory.options.hex()
        elif what == "reprogrammed":
            found = memory.reprogrammed is None
            memory.reprogrammed = draw.choice((None, bytes(0x2_0000)))
        else:
            found = (memory.lose_power if what == "power" else memory.seal)()
        yield said(
            [
                what,
                f"{at:x}",
                size,
                found,
                memory.read(0x2000_0000, 8),
                memory.read(FLASH_BASE, 6),
                memory.read(0, 2),
                memory.reprogrammed is None,
                len(calls),
            ]
        )


TRACES: dict[str, Trace] = {
    "covered": covered,
    "profiled": profiled,
    "waits": waits,
    "stacks": stacks,
    "memories": memories,
}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
