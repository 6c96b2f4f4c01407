"""Replays of real chips, of runs drawn at random: what each part shows, held, compared, looked at and let branch."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from adapter_sim.pinout import WireDirection, WireRole, load_pinout
from bluepill_sim.core.recorder import RECORD
from robot_bench.recording.run_record import RunRecord
from robot_bench.report.explain import explain, replay
from robot_bench.report.explain.against import compare
from robot_bench.report.explain.probing import Prober
from robot_bench.report.explain.replay import ChipReplay, Hold, ReplayPart
from robot_bench.wires.edges import Edges
from tests.robot_bench.firmware import thumb
from tests.robot_bench.firmware.hurried import hurried
from tests.robot_bench.recording.records import S, pose
from tests.tools.suite.approved import judge_of, said, tried

MS = S // 1000
LAST_NS = 900 * MS
DODGE, LATER = hurried("dodge"), hurried("dodge", 30)
#: Starts the independent watchdog, feeds it once, and sleeps: a reset each 0.41 s.
GUARDED = thumb.image(bytes.fromhex("0348034901600349016030bffde7") + struct.pack("<III", 0x4000_3000, 0xCCCC, 0xAAAA))
WIRES = load_pinout().wires
SENSORS = [wire.name for wire in WIRES if wire.role is WireRole.DISTANCE]


def record_of(draw: Random, **meta: object) -> RunRecord:
    """Return a run whose wires stand, but for the link, which comes up, and some sensors' pins, which toggle."""
    pins = {wire.name: Edges([(0, 0)]) for wire in WIRES}
    pins["p2dx_con"] = Edges([(0, 0), (20 * MS, 1)])
    for net in draw.sample(SENSORS, 3):
        pins[net] = Edges([(0, draw.randrange(2))])
        for _ in range(draw.randrange(1, 5)):
            pins[net].append(pins[net].times[-1] + draw.randrange(MS, 300 * MS), 1 - pins[net].levels[-1])
    poses = [pose(n * 50 * MS, left=25_000 * (n > 2)) for n in range(LAST_NS // (50 * MS))]
    return RunRecord(meta={"scenario": "mine", **meta}, pins=pins, poses=poses, last_ns=LAST_NS, is_cut=False)


def as_run(found: RunRecord, firmware: Path) -> RunRecord:
    """Return a run with what its program drives."""
    seen = ChipReplay(firmware, found).run(0, LAST_NS)
    pins = dict(found.pins)
    for net in (wire.name for wire in WIRES if wire.direction is WireDirection.TO_ADAPTER):
        first = int(seen.levels[net])
        rows = [(0, first)]
        for at, wire, level in seen.edges:
            if wire == net and level != rows[-1][1]:
                rows = [(0, int(level))] if at == 0 else [*rows, (at, int(level))]
        pins[net] = Edges(rows)
    return replace(found, pins=pins)


def shown(part: ReplayPart, names: Mapping[str, object] | None = None) -> str:
    """Return a part as text, what is long of it by its length and a checksum."""
    rows, memory = [*part.rows], [*part.memory]
    edges = [(at, wire, int(level)) for at, wire, level in part.edges if names is None or wire in names]
    return said([
        sorted(net for net, level in part.levels.items() if level), len(edges), edges[:6], edges[-2:],
        bytes(character for _, character in part.text), part.text[:1], len(rows), part.has_more_rows, rows[:2],
        rows[-1:], f"{zlib.crc32(part.packed_rows):08x}", len(memory), [at for at, _ in (*memory[:2], *memory[-1:])],
        f"{zlib.crc32(b''.join(data for _, data in memory)):08x}", [len(data) for _, data in memory[:1]],
    ])  # fmt: skip


def holds_of(draw: Random, since: int, until: int) -> list[Hold]:
    return [
        Hold(
            wire=draw.choice(SENSORS),
            level=draw.choice((True, False, None)),
            since=since + draw.choice((0, 1, MS)),
            until=until - draw.choice((0, 1, MS)),
        )
        for _ in range(draw.choice((0, 1, 3)))
    ]


def parts(draw: Random) -> Iterator[str]:
    """Run parts again: with inputs held, rows and variables or none, beside another part, and from a branch."""
    for meta in ({"sram": "random", "seed": 5}, {"crystal_ppm": 400}):
        made = as_run(record_of(draw, **meta), DODGE)
        chip = ChipReplay(DODGE, made)
        yield said([meta, chip.exact_until, chip.end, chip.resets, chip.inputs, chip.outputs, len(chip._states)])
        yield said([chip.role(WireRole.MOTOR), chip.variables, chip._variable_bytes])
        for number in range(5):
            since = draw.choice((0, 1, 30 * MS, 300 * MS, 700 * MS))
            until = since + draw.choice((1, 3 * MS, 60 * MS, 180 * MS))
            held, memory_ns = holds_of(draw, since, until), draw.choice((0, 5 * MS, 60 * MS))
            yield said([since, until, held, memory_ns])
            one = chip.run(since, until, held, rows=number % 3 > 0, memory_ns=memory_ns)
            yield shown(one)
            yield shown(chip.run(since, until))
            branch = chip.branch(since, until, held)
            yield said([sorted(net for net, level in branch.levels.items() if level), sorted(branch.held)])
            yield shown(chip.run(until, until + 20 * MS, branch=branch, rows=True))
            if number % 3 == 1:
                other = [Hold(wire=draw.choice(SENSORS), level=None, since=since, until=until)]
                for ends_parted in (False, True):
                    found = chip.run(
                        since, until, other, rows=True, memory_ns=memory_ns, beside=one, ends_parted=ends_parted
                    )
                    yield shown(found)
        with patch.object(replay, "MOST_ROWS", 40):
            for since in (0, 300 * MS):
                yield shown(chip.run(since, since + 200 * MS, rows=True, memory_ns=20 * MS))


def looks(draw: Random) -> Iterator[str]:
    """Look for which instructions write pins, read them, and feed the watchdog; and ask a program of its inputs."""
    made = as_run(record_of(draw), DODGE)
    chip = ChipReplay(DODGE, made)
    for at, wire, _ in chip.run(0, LAST_NS).edges[1:5]:
        port = chip.wires[wire].bluepill[1]
        yield said([at, wire, [str(chip.writer(at, one)) for one in (port, "C")]])
    for since in (0, 400 * MS):
        reads = chip.reads(since, since + 50 * MS)
        yield said([(line, len(times), times[:2], times[-1]) for line, times in reads.items()])
        yield said(chip.feeds(since, since + 50 * MS))
    prober = Prober(chip)
    held = [Hold(wire=SENSORS[3], level=True, since=400 * MS, until=LAST_NS)]
    yield said([prober.effect(held, LAST_NS), prober.noticed(held, LAST_NS, 400 * MS)])
    yield said([prober.answers(500 * MS), prober.takes_notice(500 * MS), prober.last_place(500 * MS)])
    yield said([sorted(prober.lines_run(400 * MS, 420 * MS).items()), sorted(prober.new_lines(300 * MS))])
    for reference in (DODGE, LATER):
        yield said([(one.t, one.says, one.part) for one in compare(prober, reference, LAST_NS)])
    for change in ({}, {"firmware_sha256": "0"}):
        limits: list[str] = []
        late = replace(made, meta={**made.meta, **change}, end={"failures": ["text: nothing in 1 s"]})
        asked = explain._prober(late, DODGE, limits)
        yield said([limits, None if asked is None else asked.replay.end])
    late.pins.pop("rst")
    yield tried(ChipReplay, DODGE, late)


def resets(draw: Random) -> Iterator[str]:
    """Replay a program that its watchdog resets, of which no name is known, and keep few states of it."""
    with TemporaryDirectory(prefix="p2os-test-") as folder:
        file = Path(folder, "guarded.bin")
        file.write_bytes(GUARDED)
        made = record_of(draw)
        made.pins["p2dx_con"] = Edges([(0, 0)])
        chip = ChipReplay(file, made)
        yield said([chip.exact_until, [(one.at, one.cause, str(one.place)) for one in chip.resets], chip.variables])
        yield said([chip._variable_bytes, str(chip.line(thumb.FLASH)), str(chip.end_line(thumb.FLASH + 0x100))])
        for since in (0, 380 * MS):
            yield shown(chip.run(since, since + 40 * MS, rows=True, memory_ns=10 * MS))
            yield said(chip.feeds(since, since + 50 * MS))
        yield said([chip.writer(500 * MS, "A"), chip.reads(0, MS)])
        with patch.object(replay, "MOST_STATES", 2), patch.object(replay, "STRIDE_NS", 100 * MS):
            few = ChipReplay(file, made)
            yield said([[at for at, _, _ in few._states], few.resets == chip.resets])
        yield said([explain._odd(Prober(chip)), RECORD.size])
        for net in ("motor1_comm1", "p2dx_con"):
            for edges in ([(0, 0), (5 * MS, 1)], [(0, 1)]):
                made.pins[net] = Edges(edges)
                yield said([net, edges, ChipReplay(file, made).exact_until])


def recordings(draw: Random) -> Iterator[str]:
    """Record blocks until there are too many, in slices that grow while few of them run."""
    size = RECORD.size
    with patch.object(replay, "MOST_ROWS", 640):
        for counts in ([0] * 9, [19, 20, 21] * 9, [20] * 40, [310, 9, 1, 99], [640], [641], [319, 1, 5],
                       [draw.randrange(60) for _ in range(30)]):  # fmt: skip
            for parts_at in (None, 3):
                drained, asked = iter([bytes(size * count) for count in counts]), list[object]()
                board = SimpleNamespace(now_ns=0, chip=SimpleNamespace(
                    record_blocks=lambda _room, d=drained: SimpleNamespace(drain_packed=lambda: next(d, b"")),
                    stop_recording=lambda a=asked: a.append("stopped"),
                ))  # fmt: skip

                def go_on(until: int, memory_ns: int, board: Any = board, asked: list[object] = asked) -> None:
                    asked.append([until - board.now_ns, memory_ns])
                    board.now_ns = until

                seen = SimpleNamespace(memory=[], has_more_rows=None, packed_rows=b"")
                made: Any = SimpleNamespace(board=board, _seen=seen, _go_on=go_on)
                with patch.object(replay, "_have_parted", lambda *_given, a=asked, p=parts_at: len(a) == p):
                    beside: Any = None if parts_at is None else "other"
                    parted = ChipReplay._go_on_recording(made, 10**9, 7, beside)
                yield said([parted, asked, seen.has_more_rows, len(seen.packed_rows) / size])


TRACES = {"recordings": recordings, "resets": resets, "parts": parts, "looks": looks}
test_what_replays_show_is_what_was_approved = judge_of(__file__, TRACES)
