"""Events spelled, read, damaged, streamed, written down and drawn, each kind with each of its values otherwise."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile
from zlib import crc32

from pyarrow import parquet

from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanEnd, CanError
from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol
from bluepill_sim.peripherals.spi import SpiWord
from p2os.protocol.commands import pulse, vel
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from robot_bench.events import selection, whole_lines
from robot_bench.events.codec import Blocks, EdgeBlock, Levels, event_of, events_of, line_of
from robot_bench.events.kinds import (
    KINDS,
    CanTransfer,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.stream import EventStream
from robot_bench.events.words import distinguishing_words, is_frequent, last_words, words_of
from robot_bench.recording.client_view import OdometryPose, SipRanges
from robot_bench.recording.disputed import body_note, decided_after, first_disputed
from robot_bench.recording.divergence import differences, signal_of
from robot_bench.recording.event_files import write_named_events
from robot_bench.recording.run_record import RunRecord, record_of
from robot_bench.recording.signals import grouped, levels_and_duties, motor_steps, pin_labels
from robot_bench.recording.trace import TraceWriter
from robot_bench.recording.transfers import CanTransfers, I2cTransfers, SpiTransfers
from robot_bench.recording.variables import MOST_ROWS, VariableWriter, read_variables
from robot_bench.recording.waveforms import waveforms_of, write_sigrok, write_vcd
from robot_bench.wires.edges import Edges, pack
from simbase.errors import P2osError
from tests.robot_bench.recording.long_run import META, MORE, long_run
from tests.robot_bench.recording.records import S
from tests.tools.suite.approved import judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

BLOCK = next(pack([Edges([(5, 1), (9, 0)]), Edges([(7, 1)]), Edges()], 9))
BULK = [
    Levels(t=0, nets=("DD1", "DD2", "pwm"), levels="010"),
    EdgeBlock(t=BLOCK[0], count=BLOCK[1], data="AQcI"),
]
#: What takes the place of a value.
OTHERS = (None, True, -1, 0, 1, 2, 3.5, 1e19, "", "x", [], [1], {}, "00", float("nan"), 2**63)
#: First and last lines with all that they may hold.
WHOLE: tuple[dict[str, Any], ...] = (
    {
        "k": "meta",
        "trace": 1,
        **META,
        "scenario_path": None,
        "duration_s": 9,
        "seed": 1,
        "settings": [["a", 1]],
        "robots": ["a"],
        "start": {"x": 1, "y": 2, "heading": 0},
        "note": "n",
        "world_path": "room",
    },
    {
        "k": "end",
        "passed": True,
        "virtual_s": 1.5,
        "distance_m": None,
        "failures": ["a"],
        "goals_met": [],
        "notes": ["n"],
        "coverage": {"files": ["a"], "table": ["b"]},
        "parts": [{"name": "a", "words": "b", "png": "c"}],
        "trace_sha256": "0",
        "program": {
            "files": [{"name": "a", "lines": ["x"], "ran_ns": [1], "one_way": [2]}],
            "functions": [["f", 1, 2, 3, 4, 5]],
        },
    },
)


def every_kind() -> list[Event]:
    """Return one or two events of each kind."""
    found: dict[type, list[Event]] = {}
    for event in sorted([*MORE, *long_run(3)], key=lambda one: one.t):
        held = found.setdefault(type(event), [])
        if len(held) < 2:
            held.append(event)
    assert found.keys() == {*KINDS}
    return [event for held in found.values() for event in held]


def read(entry: Any) -> str:
    try:
        return said(event_of(entry))
    except (P2osError, KeyError, TypeError, ValueError, OverflowError) as error:
        return refusal(error) if isinstance(error, P2osError) else type(error).__name__


def other_values(held: Any) -> Iterator[tuple[str, Any]]:
    """Go through what a table becomes where one of its values, at any depth, is another, or is left out."""
    for key in [*held] if isinstance(held, dict) else range(len(held)):
        value = held[key]
        for other in OTHERS:
            held[key] = other
            yield f"{key}={other}", held
        held[key] = value
        if isinstance(held, dict):
            del held[key]
            yield f"no {key}", held
            held[key] = value
        if isinstance(value, dict | list):
            for words, _ in other_values(value):
                yield f"{key}.{words}", held


def lines(_draw: Random) -> Iterator[str]:
    """Spell each kind of event, and read its line with each value otherwise."""
    for event in (*BULK, *every_kind()):
        line = line_of(event)
        yield f"{line} {read(json.loads(line)) == said(event)}"
        table = json.loads(line)
        yield " ".join(f"{words}: {read(other)}" for words, other in other_values(table))
    for whole in WHOLE:
        bad = [words for words, other in other_values(whole) if not is_whole(other)]
        yield f"{whole['k']} {' '.join(bad)}"
    for version in (0, 1, 99, "1"):
        yield tried(record_of, [json.dumps(WHOLE[0] | {"trace": version}) + "\n"], "x")
    blocks = Blocks()
    blocks.begin(BULK[0])  # type: ignore[arg-type]  # the levels
    for count, data in ((3, "AQcI"), (2, "AQcI"), (1, "AQ=="), (1, "gA=="), (0, "")):
        block = EdgeBlock(t=3, count=count, data=data)
        yield said([count, data, tried(lambda b=block: [(net, list(edges)) for net, edges in blocks.take(b)])])
    whole_text = "".join(f"{line_of(event)}\n" for event in (*BULK, *sorted(every_kind(), key=lambda one: one.t)))
    yield said([*events_of(whole_text.splitlines(keepends=True))])
    for cut in ("{", "[1]\n", "{}\n", '{"k":"pose","t":1}', '{"k":"pose","t":-1}\n', '{"k":"pins","v":9,"nets":[]}\n',
                '{"k":"new"}\n'):  # fmt: skip
        yield f"{cut!r} {tried(lambda c=cut: [*events_of([line_of(BULK[0]) + chr(10), c], 'mine')])}"
        yield tried(lambda c=cut: repr(record_of([c], "mine")))


def is_whole(entry: dict[str, Any]) -> bool:
    try:
        whole_lines.check_whole_line(entry)
    except ValueError:
        return False
    return True


def words(_draw: Random) -> Iterator[str]:
    """Say each kind of event in words, and tell it from one with another value."""
    events = every_kind()
    for event in events:
        yield f"{words_of(event)} {is_frequent(event)}"
        for field in fields(event):
            value: Any = getattr(event, field.name)
            if isinstance(value, bool):
                other: Any = not value
            elif isinstance(value, int | float):
                other = value + 1
            elif isinstance(value, str):
                other = f"{value}~"
            elif isinstance(value, bytes):
                other = value[:1] + b"\x7f" * 40
            else:
                other = type(value)() if value else value
            yield said(distinguishing_words(event, replace(event, **{field.name: other})))
            if isinstance(value, bytes | str | tuple):
                empty: Any = type(value)()
                yield tried(words_of, replace(event, **{field.name: empty}))
    yield said(last_words(events, 5))
    yield said(distinguishing_words(events[0], events[-1]))


def writer(draw: Random) -> Iterator[str]:
    """Write traces in memory and to files: taken, copied, set back and gone on with."""
    events = sorted([*MORE, *long_run(5)], key=lambda one: one.t)[:700]
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for path in (None, Path(name, "a.jsonl")):
            made = TraceWriter(path)
            made.meta({"scenario": "mine"})
            kept: list[tuple[int, object]] = []
            place = 0
            while place < len(events):
                count = draw.choice((0, 1, 7, 60))
                limit = events[min(place + count, len(events) - 1)].t
                if draw.random() < 0.8:
                    made.take(events[place : place + count], limit)
                    place += count
                elif draw.random() < 0.5 or not kept:
                    kept.append((place, made.snapshot()))
                else:
                    place, state = kept.pop()
                    made.restore(state)
                there = -1 if path is None else path.stat().st_size
                yield said([place, made._length, len(made._unspelled), made._flushed_second, there])
            yield said([made.length, made.sha256, len(made.text), made.has_meta, made.has_end, len([*made.lines(40)])])
            other = Path(name, "b.jsonl")
            yield said([made.copy_to(other), other.read_bytes() == "".join(made.lines()).encode()])
            second = TraceWriter(other, goes_on=True)
            second.restore(made.snapshot() if path is not None else replace_written(made))
            yield said([second.sha256 == made.sha256, second.length, second.written])
            third = TraceWriter()
            third.copy(made.lines())
            yield said([third.sha256 == made.sha256, third.length, third.text[:80]])
            made.end({"passed": True})
            yield said([made.has_end, tried(made.take, [], 10**12), tried(made.flush)]).replace(name, "HERE")
            other.write_text("x" * 9999, encoding="utf-8")
            yield tried(second.restore, made.snapshot() if path is not None else second.snapshot()).replace(
                name, "HERE"
            )
        yield tried(TraceWriter, Path(name, "none", "a")).replace(name, "HERE")


def replace_written(made: TraceWriter) -> Any:
    state: Any = made.snapshot()
    state["written"] = made.length
    return state


def stream(draw: Random) -> Iterator[str]:
    """Publish, subscribe and release at random: who hears of what, when."""
    for _ in range(6):
        made, reported, ends = EventStream(), list[str](), list[Any]()
        listeners = made.listeners()
        made.record(lambda events, limit, reported=reported: reported.append(f"recorded {len(events)} {limit}"))
        now = 0
        for step in range(40):
            chance = draw.random()
            if chance < 0.2:
                kinds = tuple(draw.sample((Pose, Text, PinEdge, Contact), draw.randrange(4)))
                wires = draw.choice((None, ["DD1"], ["DD1", "DD2"]))

                def hear(
                    event: Event, step: int = step, reported: list[str] = reported, made: EventStream = made
                ) -> None:
                    reported.append(f"{step} hears {type(event).__name__} {event.t}")
                    if isinstance(event, Text) and event.data == b"echo":
                        made.publish(Text(t=event.t + 1, data=b"again"))

                ends.append(made.subscribe(hear, *kinds, wires=wires))
            elif chance < 0.27:
                ends.append(
                    made.at_limit(lambda limit, step=step, reported=reported: reported.append(f"{step} at {limit}"))
                )
            elif chance < 0.35 and ends:
                ends.pop(draw.randrange(len(ends)))()
            elif chance < 0.7:
                at = now + draw.randrange(-2, 9)
                event = draw.choice((
                    Text(t=at, data=draw.choice((b"echo", b"x"))), Levels(t=at, nets=("DD1", "DD3"), levels="10"),
                    Contact(t=at, what="x", x_m=0.0, y_m=0.0), Verdict(t=at, goal="g", met=True, says=""),
                ))  # fmt: skip
                reported.append(f"{type(event).__name__} {at} {tried(made.publish, event)}")
            else:
                now += draw.randrange(6)
                tracks = {"DD1": (0, Edges([(now - 1, 1), (now, 0)])), "DD2": (1, Edges([(now, 1)]))}
                chosen = {wire: row for wire, row in tracks.items() if draw.random() < 0.5 and made.wants_edges(wire)}
                made.release(now, chosen or None)
                reported.append(f"pending {said([one.t for one in made.pending()])} {made.released_until}")
            if step == 30 and draw.random() < 0.5:
                made.drop_later(listeners)
            yield " | ".join(reported)
            reported.clear()


#: Words that mean events, and words that mean none.
MEANT = """\
pin PB12 high|pin DD4 low|pin DD4 changes|pin DD5 changes|pin DD4|pin DD4 half|pin DD44 high|pin
pin DD4 high now|usart1 sends go|usart1 matches ^x=-?\\d+$|usart1 matches (|usart1 sends|usart1 says go
usart2 sends go|usb sends go|usart1|i2c1 writes 0x3c|i2c1 writes 60 aa|i2c1 reads 0x3c bb cc|i2c1 fails
i2c1 fails 3|i2c1 writes|i2c1 writes 1023|i2c1 writes 1024|i2c1 writes -1|i2c1 reads 1 zz|i2c2 writes 0x3c
i2c1|i2c1 asks 3|spi1 sends aa bb|spi1 gets bb|spi1 sends|spi1 takes aa|spi2 sends aa|can hears 0x123
can sends 0x123 aa|can hears 536870911|can hears 536870912|can fails|can fails 1|can hears|can|contact
contact post|contact 'post'|robot near 0.3 0.1 0.2|robot near 0.3 0.1 0|robot near 0 0|robot near a b 1
robot near nan 0 1|robot within 0.1 0.1 0.4 0.2|robot within 0.4 0 0.1 1|robot within 0 1 1 0
robot within 0.2 0.1 0.2 0.1|robot within 0 0 1|robot drives 0.3|robot drives 0|robot drives -1|robot drives
robot moves|robot stops|robot stops now|robot flies|robot|time 0|time 0.3|time 0.30001|time -1|time 1e9
time soon|time|sonar 1 below 0.4|sonar 2 below 0.5|sonar 3 below 0.5|sonar 0 below 1|sonar 1 above 0.4
sonar 1 below 0|sonar x below 1|sonar 1 below|note adapter|note adapter driving|note adapter driving why
note body|note|fault|fault sonar-stuck 3|fault link-down|thing post|thing card|thing|packet|packet SIP
packet pulse|packet VEL|packet nothing|goal met|goal missed|goal open|goal||nonsense|contacts|uart1 sends x"""


def meant_run(draw: Random) -> Iterator[Event]:
    """Yield events whose places, values and times lie at the bounds of the words above, or beside them."""
    t, bits = 0, draw.choice
    sip = StandardSip(raw_x=1, raw_y=2, raw_heading=3, raw_left_velocity=4, raw_right_velocity=5)
    frames = [pulse().to_frame().to_bytes(), vel(100).to_frame().to_bytes(), sip.to_frame(Profile.P2OS).to_bytes()]
    yield PinEdge(t=0, wire="DD4", level=bits((True, False)))
    for _ in range(220):
        t += bits((0, 50, 50, 100)) * S // 1000
        data, at = bits((b"\xaa", b"\xaa\xbb", b"\xbb\xcc", b"")), bits((0, 1000))
        x, y = bits((0, 99_999, 100_000, 200_000, 300_000, 400_000, 400_001)), bits((0, 100_000, 200_000, 300_000))
        yield bits((
            PinEdge(t=t, wire=bits(("DD4", "DD5")), level=bits((True, False))),
            Text(t=t, data=bits((b"go\n", b"g", b"o\n", b"x=3\r\n", b"x=-1", b" go go\n", b"\xff\n")), port=bits((
                "usart1", "usart1", "usart2", "usb"))),
            I2cTransfer(t=t, bus=bits(("i2c1", "i2c1", "i2c2")), begun=t - 1, address=bits((60, 60, 1023)), data=data,
                        is_read=bits((True, False)), answered=bits((True, True, False)), acknowledged=bits((0, 1, 2)),
                        end=bits(("stop", "stop", "lost", "cut", "restart"))),
            SpiTransfer(t=t, bus=bits(("spi1", "spi1", "spi2")), begun=t - 1, ended=t, from_master=data + b"\xbb",
                        from_slave=b"\xbb" * at + data),
            CanTransfer(t=t, bus="can", begun=t - 1, identifier=bits((0x123, 0x123, 7, 536_870_911)), is_extended=False,
                        is_remote=False, dlc=len(data), data=data, is_own=bits((True, False)),
                        error=bits(("", "", "bit"))),
            Contact(t=t, what=bits(("'post'", "wall", "post")), x_m=0.0, y_m=0.0),
            *(Pose(t=t, x=x, y=y, z=0, heading=0, pitch=0, left=bits((0, 5000, 5001, -5001)), right=bits((0, 0, -9000)),
                   left_angle=0, right_angle=0, collisions=0) for _ in range(3)),
            Ranges(t=t, mm=bits(((399, 500), (400, 499), (401, 5000), (399,), ()))),
            Note(t=t, who=bits(("adapter", "body")), what=bits(("driving", "lost")), detail=bits(("", "why"))),
            WorldChange(t=t, op="move", name=bits(("post", "card")), fields={}),
            Fault(t=t, op=bits(("inject", "clear", "died")), words=bits(("sonar-stuck 3 0.2", "link-down", "link"))),
            Packet(t=t, direction=bits(("c2r", "c2r", "r2c")), data=bits((*frames, frames[0][:3], frames[0][3:]))),
            Verdict(t=t, goal="g", met=bits((True, False)), says=""),
        ))  # fmt: skip


def meant(draw: Random) -> Iterator[str]:
    """Pick events of runs by every kind of words, and go on from a saved state; refuse what means none."""
    runs = [[*meant_run(draw)] for _ in range(6)]
    own = {"PB12": "lamp", "DD4": "DD5"}
    for words_ in "|".join(MEANT.splitlines()).split("|"):
        try:
            made, other = selection.select(words_), selection.select(words_)
        except P2osError as error:
            yield f"{words_}: {refusal(error)}"
            continue
        yield said([words_, [kind.__name__ for kind in made.kinds], made.wires, selection.bus_of(words_),
                    tried(lambda w=words_: selection.select(w, own).wires)])  # fmt: skip
        for run in runs:
            made, places, cut = selection.select(words_), list[int](), draw.randrange(len(run))
            for place, event in enumerate(run):
                if place == cut:
                    other.restore(made.snapshot())
                # What is of another kind it passes over, but for the time, which it takes from any event.
                if words_.startswith("time") and type(event) not in made.kinds:
                    continue
                is_taken = made.takes(event)
                if place >= cut and other.takes(event) is not is_taken:
                    places.append(-place)
                places += [place] * is_taken
            yield said(places)
    lines_ = selection.Lines("usb")
    for data, port in ((b"a", "usb"), (b"b", "usart1"), (b"c\r\n", "usb"), (b"\n", "usb")):
        yield said(lines_.take(Text(t=0, data=data, port=port)))
    yield said([tried(selection.wire_named, one, wires) for one in ("PB12", "DD4", "x") for wires in (None, own)])


def transfers(draw: Random) -> Iterator[str]:  # noqa: C901 - three buses side by side
    """Put words, conditions and frames together, in slices of any length."""
    for _ in range(5):
        reported: list[str] = []

        def tell(one: Event, reported: list[str] = reported) -> None:
            reported.append(said(one))

        spi, i2c, can, now = SpiTransfers("spi1", tell), I2cTransfers("i2c1", tell), CanTransfers("can", tell), 0
        for _ in range(40):
            rows, marks = [], []
            for _ in range(draw.randrange(5)):
                bits = draw.choice((8, 8, 16))
                now += draw.choice((1000, 1000, 50_999, 51_000, 51_001, 51_002, 200_000))
                rows.append(SpiWord(now, draw.randrange(1 << bits), draw.randrange(1 << bits), bits, 1000))
                step = draw.choice((I2cStep.BYTE,) * 6 + (I2cStep.START, I2cStep.START, *I2cStep))
                marks.append(I2cSymbol(now, step, draw.choice((0xF2, 0xF3, 0x78, 0x79, 5)), draw.random() < 0.8))
            spi.take(rows)
            i2c.take(marks)
            if draw.random() < 0.3:
                frame = CanFrame(identifier=draw.randrange(2048), data=b"\x01\x02"[: draw.randrange(3)])
                ended, is_own, error = now - draw.randrange(9), draw.random() < 0.5, draw.choice([*CanError])
                can.take([CanEnd(start_ns=now - 9, end_ns=ended, frame=frame, is_own=is_own, error=error)])
            if draw.random() < 0.5:
                limit = now + draw.choice((0, 50_000, 51_000, 52_000))
                for one in (spi, i2c, can):
                    one.release(limit)
                now = limit
            if draw.random() < 0.1:
                for kind, one in ((SpiTransfers, spi), (I2cTransfers, i2c)):
                    other = kind("x", lambda _: None)
                    other.restore(one.snapshot())
                    one.restore(other.snapshot())
            yield " | ".join(reported)
            reported.clear()
        for one in (spi, i2c, can):
            one.release(now + 5, is_end=True)
        yield " | ".join(reported)
    long = SpiTransfers("spi1", lambda one: reported.append(f"{one.t} {len(one.from_master)}"))  # type: ignore[union-attr]
    long.take([SpiWord(1000 * (n + 1), n & 0xFF, 0, 8, 1000) for n in range(4100)])
    more = I2cTransfers("i2c1", lambda one: reported.append(f"{one.t} {len(one.data)} {one.end}"))  # type: ignore[union-attr]
    more.take([I2cSymbol(1, I2cStep.START, 0, False), *(I2cSymbol(n + 2, I2cStep.BYTE, 8, True) for n in range(4100))])
    yield said(reported)


def views(draw: Random) -> Iterator[str]:
    """See a robot by its packets alone, over the ends of its counters."""
    for robot in ("p2dx", "amigo", "p3at"):
        parameters = load_parameters(robot)
        heard: list[object] = []
        pose, x, y, heading = OdometryPose(parameters), 32_700, 5, 4000

        def hear(at: int, metres: Sequence[float], heard: list[object] = heard) -> None:
            heard.append((at, *metres))

        ranges = SipRanges(parameters, Profile.P2OS, on_ranges=hear)
        for step in range(30):
            x, y = (x + draw.choice((0, 1, 40, -60))) % 32_768, (y + draw.choice((0, 3, -9))) % 32_768
            heading = (heading + draw.choice((0, 0, 1, 300, -500))) % parameters.angle_counts_per_turn
            readings = tuple(SonarReading(draw.randrange(18), draw.randrange(9000)) for _ in range(draw.randrange(3)))
            sip = StandardSip(raw_x=x, raw_y=y, raw_heading=heading, raw_left_velocity=draw.randrange(-300, 300),
                              raw_right_velocity=7, sonar=readings)  # fmt: skip
            yield said(pose.take(sip, step))
            data = sip.to_frame(Profile.P2OS).to_bytes()
            ranges.take(data if draw.random() < 0.8 else data[:-1], step)
        yield said([pose.distance_m, heard])


def record(draw: Random, **changes: Any) -> RunRecord:
    """Return a run with edges, waves, contacts and verdicts."""
    pins = {name: Edges([(0, 0), *((at, n % 2 ^ 1) for n, at in enumerate(sorted(draw.sample(range(1, 90_000), 4))))])
            for name in ("DD1", "PB9", "motor1_comm1", "left_pwm", "a b")}  # fmt: skip
    wave = Wave(t=20_000, wire="left_pwm", at=100, period=3600, high=900, ticks_hz=72_000_000)
    return RunRecord(pins=pins, waves={"left_pwm": [(20_000, wave), (70_000, None)], "PB9": [(50_000, wave)]},
                     last_ns=100_000, **changes)  # fmt: skip


def files(draw: Random) -> Iterator[str]:
    """Write events, edges and variables for other programs."""
    events = every_kind()
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for robots in (("",), ("", "east"), ("west",)):
            named = [(draw.choice(robots), event) for event in events]
            for end in (".jsonl", ".parquet", ".mcap", ".csv", ""):
                path = Path(name, f"out{end}")
                yield f"{robots} {end} {tried(write_named_events, named, path, META)}".replace(name, "HERE")
                if end == ".jsonl":
                    yield from path.read_text(encoding="utf-8").splitlines()
                elif end == ".parquet":
                    table = parquet.read_table(path)
                    yield said([(field.name, str(field.type)) for field in table.schema])
                    for row in table.to_pylist():
                        yield said({key: value for key, value in row.items() if value is not None})
        for run in (record(draw), RunRecord(pins={"DD1": Edges([(0, 1)])}, last_ns=7), RunRecord()):
            write_vcd(run, Path(name, "a.vcd"))
            yield from Path(name, "a.vcd").read_text(encoding="ascii").splitlines()
            write_sigrok(run, Path(name, "a.sr"))
            with ZipFile(Path(name, "a.sr")) as archive:
                yield said([(one, len(archive.read(one)), hex(crc32(archive.read(one)))) for one in archive.namelist()])
                yield archive.read("metadata").decode()
            found = waveforms_of(run, "mine")
            yield said([found.end_ns, {key: [*signal.edges] for key, signal in found.signals.items()}])
        yield said(grouped(["DD2", "DD1", "x", "left_a", "right_b", "motor2_comm1", "rst", "encoder1_s2", "left_pwm"]))
        made = [type("V", (), {"name": one, "type_name": f"int {one}"})() for one in ("a", "b")]
        with VariableWriter(Path(name), made) as file:
            for at in range(MOST_ROWS + 20):
                changes = [("a", at / 4), ("b", float("inf") if at == 9 else at)]
                file.take(at - at % 3, False, changes[: draw.choice((1, 2))])
        text = Path(name, "variables.jsonl").read_text(encoding="utf-8")
        yield said([len(line) for line in text.splitlines()])
        yield said([(one.name, one.type_name, len(one.times), one.values[:9]) for one in read_variables(Path(name))])
        rows: list[Any] = [{"v": 1, "variables": [{"name": "a", "type": "int"}]}, {"n": 0, "t": [1, 2], "v": [1, None]}]
        for number in (0, 1):
            for changed, _ in other_values(rows[number]):
                text = "".join(json.dumps(row) + "\n" for row in rows)
                Path(name, "variables.jsonl").write_text(text, encoding="utf-8")
                yield f"{changed}: {tried(read_variables, Path(name))}".replace(name, "HERE")


def signals(draw: Random) -> Iterator[str]:
    """Read motors' pins as numbers, waves as duties, and where two runs part in each signal."""
    yield said(pin_labels())
    for bits in (0, 1, 2, 3, 4):
        for motor in (1, 2):
            names = [f"motor{motor}_comm{bit + 1}" for bit in range(bits)]
            pins = {name: Edges([(0, draw.randrange(2)), *((draw.randrange(9) + 9 * n, n % 2) for n in (1, 2, 3))])
                    for name in names}  # fmt: skip
            found = motor_steps(pins, motor)
            yield said([[*pins.items()], [*found], [*found[1:3]], len(found), found == [*found], found == found[1:]])
    run = record(draw)
    yield said([(net, levels_and_duties(run, net)) for net in run.pins])
    events = every_kind()
    yield said([(type(event).__name__, signal_of(event)) for event in events])
    for _ in range(30):
        one, other = [*events], [*events]
        for rows in (one, other):
            place = draw.randrange(len(rows))
            if draw.random() < 0.5:
                rows[place] = replace(rows[place], t=rows[place].t + draw.choice((1, S)))
            else:
                del rows[place]
        yield said([(part.signal, part.at, part.one, part.other) for part in differences(one, other)])


def disputes(draw: Random) -> Iterator[str]:
    """Touch a box and a post at all angles: after which contacts bodies differ."""
    box = {"name": "box", "shape": "box", "x": 1.0, "y": 0.0, "heading": 0.0, "length": 0.4, "width": 0.2}
    post = {"name": "post", "shape": "cylinder", "x": 1.0, "y": 1.0, "radius": 0.1}
    for _ in range(60):
        heading = draw.choice((0, 5, 14, 15, 16, 30, 45, 60, 74, 75, 76, 85, 90)) * 17_453
        speed = draw.choice((0, 19_999, 20_000, 20_001, 200_000))
        poses = [Pose(t=at, x=x, y=0, z=0, heading=heading, pitch=0, left=speed, right=speed, left_angle=0,
                      right_angle=0, collisions=0) for at, x in ((0, 0), (S, 500_000), (2 * S, 600_000))]  # fmt: skip
        x_m, y_m = draw.choice(((0.8, 0.0), (0.8, 0.05), (0.81, 0.09), (1.0, 0.1), (0.82, 0.1), (0.79, 0.08)))
        at, what = draw.choice((S, S + 1, 2 * S)), draw.choice(("'box'", "'box'", "'post'", "something"))
        contact = Contact(t=at, what=what, x_m=x_m, y_m=y_m)
        verdicts = [Verdict(t=contact.t + more, goal=f"g{more}", met=more > 0, says="") for more in (-1, 0, 1, S)]
        run = RunRecord(meta={"body": draw.choice(("kinematic", "")), "world": {"obstacles": [box, post]}}, poses=poses,
                        contacts=[contact], verdicts=verdicts[: draw.randrange(5)])  # fmt: skip
        found = first_disputed(run)
        yield said([heading, speed, contact.what, contact.t, found and [found.angle_deg, found.beside_m, str(found)]])
        note = body_note(run).replace("mujoco", "BODY").replace("bullet", "BODY")
        yield said([one.goal for one in decided_after(run, contact)]) + note


TRACES: dict[str, Any] = {
    "lines": lines,
    "words": words,
    "writer": writer,
    "stream": stream,
    "meant": meant,
    "transfers": transfers,
    "views": views,
    "files": files,
    "disputes": disputes,
    "signals": signals,
    "declared": declared_of("robot_bench.events", "robot_bench.recording"),
}
test_what_becomes_of_events_is_what_was_approved = judge_of(__file__, TRACES)
