"""Verbs on a robot of this process, on a clock that jumps, and on lines that are none; files of captures; as approved."""

# ruff: noqa: E501  # lines of commands stand as they are

import contextlib
import io
import json
import os
import random
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from unittest.mock import patch

from p2os import Robot
from p2os.capture import Chunk, Direction, capture_of, read_file
from p2os.capture.replay import Replay
from p2os.cli.captures.record import record_session
from p2os.cli.captures.replay import motions_of, play
from p2os.cli.held_robot import RobotWatch, problem_of, say_what_is_beyond
from p2os.cli.links import bench as link_bench
from p2os.cli.links.bench import LinkBenchmark, Measured, lines_of, measure
from p2os.cli.links.link_quality import spread_of
from p2os.cli.links.ports import ADAPTERS, guess
from p2os.cli.main import run
from p2os.cli.robots import drive
from p2os.cli.robots.command_queue import CommandQueue, is_stop
from p2os.cli.robots.drive_deadman import DriveDeadman
from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.teleop import PadDriver
from p2os.client import DeadmanStopped, Disobeyed, GapStopped, Limits, Link, LinkLost, MotorsDisabled
from p2os.client.goals import MotionResult
from p2os.client.notices import LinkLostError
from p2os.errors import TransportError
from p2os.gamepad import PadReport
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.world.loader import load_world
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from p2os.transport.virtual_clock import VirtualClock
from p2os.view.run_control import DRIVE_HOLD_NS, RunCommand
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.cli.conftest import serving
from tests.tools.suite.approved import Trace, judge_of, said, tried

GOLDEN = Path(__file__).resolve().parents[3] / "golden" / "captures"
ON_ROBOT = """\
drive URL --forward 20cm
drive URL --forward -10cm --turn 30deg --vel 100mm/s --turn-rate 20deg/s
drive URL --vel 0.2m/s --turn-rate 10deg/s --for 500ms --json
drive URL --vel 3m/s --turn-rate 400deg/s --for 300ms
drive URL --forward 9m
drive URL --forward 12cm --turn 20deg --json
drive URL --turn -25deg
send URL SONAR 0
send URL ENCODER 1 --json
send URL 250 126
send URL ROTATE 5 --wait 200ms
send URL CONFIG --json
send URL VEL2 5 -5
info URL
info URL --json
scan URL
scan URL --json
"""
ON_FILES = """\
decode GOLDEN/soar_p3dx.jsonl --only sip,vel
decode GOLDEN/soar_p3dx.jsonl --only damaged
decode GOLDEN/soar_p3dx.jsonl --only SIP --robot p3dx --profile AROS --json
decode GOLDEN/soar_p3dx.jsonl --explain --json
decode GOLDEN/soar_p3dx.jsonl --only nothing
decode GOLDEN/soar_p3dx.jsonl --robot nothing
decode GOLDEN/soar_p3dx.jsonl --dir x
decode fafb060b3bc800d33b --dir c2r
decode fafb060b3bc800d33b --dir r2c
decode fafb 060b 3bc8 00d33b --explain
decode zz
export GOLDEN/soar_p3dx.jsonl - --only vel,sip
export GOLDEN/soar_p3dx.jsonl - --only nothing
export GOLDEN/soar_p3dx.jsonl - --robot p3at --profile ARCOS
export GOLDEN/soar_p3dx.jsonl OUT
export GOLDEN/none.jsonl -
world
world list --json
world show office
world show ramp --out OUT/r.svg
world show ramp --out OUT/r.png
world show room --seed -1
world show room --up y
world check room
world check OUT/none.obj --up w
world check OUT/none.obj --up y
world new --kind doorway --seed 3
world new --out OUT/w.txt
world convert room
world convert walkway --out OUT/w.toml
world convert walkway --out OUT/w.toml
world convert walkway --out OUT/w.toml --force
world convert room --out OUT/w.gltf --robot p2dx
world convert --robot p3dx --out OUT/r.sdf
world convert --robot p3dx
world convert --robot p3dx --out OUT/r.toml
world convert --robot nothing --out OUT/r.sdf
serve --robots 2 --aux 1=pty:/tmp/x
serve --at 1m,1m --at 2m,2m
serve --at 1m
serve --at 1m,1m,1m
serve --at 1m,2m,3deg,4
serve --at 99m,0m
serve --robots 0
serve --laser 1deg
serve --for nobody
serve --firmware X
serve --errors nothing
serve --flash OUT/none.toml
serve --aux x
serve --aux 4=pty:/tmp/x
serve --fault nothing
serve --speed 0.001
serve --status 10ms
serve --sync-limit 0s
serve --seed -1
serve --fleet OUT/none.toml
serve --fleet OUT/none.toml --robot p3dx
serve --port nowhere
record nowhere --for 0s
bench nowhere --for 0s
monitor nowhere --for 1
sniff
sniff nowhere --robot nothing
scan --baud 299
scan nowhere
replay GOLDEN/soar_p3dx.jsonl serial:/dev/none --as client
replay GOLDEN/soar_p3dx.jsonl nowhere --speed 0.009
replay GOLDEN/soar_p3dx.jsonl nowhere --speed 101
teleop nowhere
"""
_TOOK = re.compile(r"in \d+\.\d\d s|(?<=\"connect_ms\": )\d+")


def verbs_on_robots(draw: random.Random) -> Iterator[str]:
    for line in ON_ROBOT.splitlines():
        with contextlib.ExitStack() as stack:
            clock = VirtualClock()
            for made in (Robot, RobotWatch):
                stack.enter_context(patch.dict(made.__init__.__kwdefaults__, clock=clock))  # type: ignore[misc]
            url = stack.enter_context(serving(clock)).url
            yield ran(line, URL=url)


def verbs_on_files(draw: random.Random) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as made:
        for line in ON_FILES.splitlines():
            yield ran(line, GOLDEN=str(GOLDEN), OUT=made)
        yield said(sorted((path.name, path.stat().st_size) for path in Path(made).iterdir()))


def ran(line: str, **places: str) -> str:
    """Return a line of a command, its exit code and what it has said."""
    words = line
    for name, place in places.items():
        words = words.replace(name, place)
    out, err = io.StringIO(), io.StringIO()
    with patch.dict(os.environ, COLUMNS="80"), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(words.split())
    found = f"{line}\n{code}\n{out.getvalue()}\n{err.getvalue()}"
    for name, place in places.items():
        found = found.replace(place, name)
    return _TOOK.sub("in …", found)


class Bench:
    """A robot at the end of a line of this thread, and the time."""

    def __init__(self, model: str = "p2dx", **settings: object) -> None:
        self.now: Nanos = 5 * NS_PER_S
        self.is_cut = False
        self.description = "the line"
        self.sent: list[str] = []
        robot = load_parameters(model)
        self.pioneer = Pioneer(
            parameters=robot, body=make_body("kinematic", load_world("room"), robot),
            settings=ControllerSettings(**settings), on_event=lambda *_: None,  # type: ignore[arg-type]
        )  # fmt: skip
        self.pioneer.advance_to(self.now)

    def clock(self) -> Nanos:
        return self.now

    def write(self, data: bytes) -> None:
        if self.is_cut:
            raise TransportError("the line is cut")
        self.sent += [data.hex()] if data else []
        self.pioneer.receive(data, self.now)

    def read(self) -> bytes:
        if self.is_cut:
            raise TransportError("the line is cut")
        self.pioneer.advance_to(self.now)
        return b"".join(self.pioneer.take_output())

    def wait(self, _transport: object, deadline: Nanos | None, now: Nanos, *_: object) -> None:
        """Let a cycle of the line pass, or the time to a deadline."""
        self.now = now + min(30 * NS_PER_MS, max(NS_PER_MS, (deadline or now + NS_PER_S) - now))


def measured(draw: random.Random) -> Iterator[str]:
    """Measure lines to robots that answer and do not, and say what was measured."""
    for settings in ({}, {"profile": Profile.ARCOS}, {"baud": 9600}):
        line = Bench(**settings)
        with patch("p2os.cli.links.bench.wait_for_line", line.wait):
            yield tried(lambda line=line: lines_of(measure(line, 2 * NS_PER_S, line.clock)))  # type: ignore[arg-type]
        yield said(line.sent)
    silent = Bench()
    with patch("p2os.cli.links.bench.wait_for_line", silent.wait), patch.object(silent, "read", bytes):
        yield tried(measure, silent, NS_PER_S, silent.clock)
    yield said((silent.now, silent.sent))
    for lost, count in ((0, 0), (1, 9), (3, 200)):
        found = Measured(connect_ms=12.6, period=spread_of([100 * NS_PER_MS] * count), round_trip=spread_of([NS_PER_MS * n for n in range(count)]),
                         unanswered=lost, packets=count, missed=lost, bad_checksums=lost + 1, noise_bytes=7, given_up=lost, seconds=1.5)  # fmt: skip
        yield said((lines_of(found), asdict(found)))
        with (
            patch.object(link_bench, "measure", return_value=found), patch.object(link_bench, "open_url"),
            patch.object(link_bench, "hold_robot"),
        ):  # fmt: skip
            yield ran("bench URL --for 2s")
            yield ran("bench URL --json")
    results = [MotionResult(asked=0.123456789, reached=-1.23456789, took_ns=took) for took in (0, 1_234_567_890)]
    yield "\n".join(json.dumps(drive._step("forward", "m", one)) for one in results)
    line = Bench(profile=Profile.P2OS)
    bench = LinkBenchmark(line.now)
    data = b""
    for _ in range(120):
        sent = bench.turn(data, line.now)
        line.write(sent if draw.random() < 0.8 else b"")
        due = bench.next_deadline()
        line.now = max(line.now + NS_PER_MS, min(due or line.now, line.now + 60 * NS_PER_MS) + draw.choice((-1, 0, 1)))
        data = line.read()
        yield said((line.now, sent.hex(), due, bench.unanswered, bench.first_sip_ns, bench.round_trips))
    yield said(bench.result(line.now))


def recorded(draw: random.Random) -> Iterator[str]:
    """Record robots that answer, are silent, and go; play what was recorded to robots again."""
    for case in ("sound", "silent", "cut"):
        line, heard = Bench(), list[Chunk]()

        def take(chunk: Chunk, heard: list[Chunk] = heard, line: Bench = line, case: str = case) -> None:
            heard.append(chunk)
            line.is_cut = case == "cut" and len(heard) > 12

        with patch("p2os.cli.captures.record.wait_for_line", line.wait), contextlib.ExitStack() as stack:
            if case == "silent":
                stack.enter_context(patch.object(line, "read", bytes))
            yield tried(record_session, line, take, lasts_ns=700 * NS_PER_MS, clock=line.clock)
        yield said([(one.at_ns, one.direction, one.data.hex()) for one in heard])
    for name in ("soar_p3dx", "ros_p2dx", "aria_p2de"):
        capture = read_file(GOLDEN / f"{name}.jsonl")
        short = capture_of([(one.at_ns, one.direction, one.data) for one in capture.chunks[:60]])
        yield said((motions_of(capture), motions_of(short)))
        for role in Direction:
            for case in ("", "silent"):
                line = Bench("p3dx" if "p3" in name else "p2dx")
                with patch("p2os.cli.captures.replay.wait_for_line", line.wait), contextlib.ExitStack() as stack:
                    if case:
                        stack.enter_context(patch.object(line, "read", bytes))
                    yield tried(play_bounded, Replay(short, role), line, role)
                yield said((line.now, line.sent))


def play_bounded(replay: Replay, line: Bench, role: Direction) -> None:
    """Play until all was sent, or half a minute has gone."""

    def clock() -> Nanos:
        if line.now > 35 * NS_PER_S:
            raise TransportError("half a minute has gone")
        return line.now

    play(replay, line, role, clock=clock)  # type: ignore[arg-type]


class Pad:
    """A pad whose reports are drawn, the robot that it drives, and the time."""

    def __init__(self, draw: random.Random) -> None:
        self.draw, self.now, self.lines = draw, 0, list[str]()
        self.turns = 0
        self.callback: Callable[[object], None] = lambda _: None
        self.stop = PageStop()

    def report(self) -> PadReport | None:
        self.turns += 1
        what = self.draw.random()
        if self.turns > 160 or what < 0.03:
            return None
        return PadReport(
            up=what > 0.6,
            down=what < 0.06,
            forward=self.draw.choice((0, 500, 1023)),
            backward=self.draw.choice((0, 0, 700)),
            turn=self.draw.choice((0, -512, 300)),
        )

    @contextlib.contextmanager
    def connect(self) -> Iterator["Pad"]:
        self.lines.append("connected")
        yield self
        self.lines.append("released")

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        self.lines.append(said((self.now, forward_mps, turn_radps)))
        if self.draw.random() < 0.02:
            raise LinkLostError("gone")
        if self.draw.random() < 0.02:
            self.callback(DeadmanStopped(NS_PER_S))

    def on_event(self, callback: Callable[[object], None]) -> None:
        self.callback = callback

    def wait(self, span_ns: Nanos) -> None:
        self.now += span_ns + self.draw.choice((0, 0, 0, 0, 0, 0, 90 * NS_PER_MS, 700 * NS_PER_MS))
        if self.draw.random() < 0.03:
            self.stop.offer(RunCommand(do="stop"))


def pads(draw: random.Random) -> Iterator[str]:
    """Drive by pads that go, pause, are released and are stopped from a page."""
    for _ in range(8):
        pad = Pad(draw)
        PadDriver(
            pad.report,
            pad.connect,
            (0.3, 0.8),
            clock=lambda pad=pad: pad.now,
            wait=pad.wait,
            report=pad.lines.append,
            stop=pad.stop,
        ).run()  # type: ignore[arg-type,misc]
        yield "\n".join(pad.lines)
        yield said(pad.stop.state)


def pages(draw: random.Random) -> Iterator[str]:
    """Ask for what a page may ask, in any order."""
    one, now = DriveDeadman(0.5, 60.0), 0
    for _ in range(60):
        match draw.randrange(5):
            case 0:
                one.stop()
            case 1:
                one.advance_to(now)
            case _:
                one.ask(draw.choice((0.0, 0.0, 0.3, 0.9, -0.9)), draw.choice((0.0, 30.0, -99.0, 99.0)), now)
        yield said((now, one.speeds, one.is_driving, one.is_stopped, one.next_deadline()))
        now += draw.choice((0, NS_PER_MS, DRIVE_HOLD_NS - 1, DRIVE_HOLD_NS, DRIVE_HOLD_NS + 1))
    for most in (2, 64):
        queue = CommandQueue(most)
        for _ in range(60):
            command = RunCommand(
                do=draw.choice(("stop", "drive", "drive", "say")),
                robot=draw.choice(("", "a")),
                forward_mps=draw.choice((0.0, 0.2)),
                turn_dps=draw.choice((0.0, 9.0)),
            )
            yield said((is_stop(command), queue.offer(command), len(queue)))
            if draw.random() < 0.4:
                yield said(queue.take())
    stop = PageStop()
    for step in ("stop", "say", "stop", "drive"):
        yield said((stop.offer(RunCommand(do=step)), stop.state, stop.take(), stop.take(), stop.state))  # type: ignore[arg-type]
        stop.drives(is_driving=step == "say")
        yield said(stop.state)


def notices(draw: random.Random) -> Iterator[str]:
    """Say what is at a port, what ends a hold, and what is beyond a robot."""
    with tempfile.TemporaryDirectory() as made:
        for device, text in (("ttyUSB0", "16"), ("ttyUSB1", "1"), ("ttyUSB2", "2"), ("ttyUSB3", "3"), ("ttyUSB4", "x")):
            Path(made, device).mkdir()
            Path(made, device, "latency_timer").write_text(f"{text}\n")
        for number, identity in enumerate([*ADAPTERS, "0000:0000", "0403:6001", "0403:6001", "0403:6001", "0403:6001"]):
            port = {
                "url": f"serial:/dev/ttyUSB{number % 6}",
                "description": "x",
                "hardware": f"USB VID:PID={identity} SER=1",
            }
            yield guess(port, Path(made))
        for words in ("n/a", "", "PNP0501", "VID:PID=0403:60", "VID:PID=067b:2303"):
            yield guess({"url": "serial:/dev/ttyS0", "description": words, "hardware": words}, Path(made))
    for notice in (
        LinkLost("it"),
        GapStopped(1500 * NS_PER_MS),
        DeadmanStopped(400 * NS_PER_MS),
        MotorsDisabled("why"),
        Disobeyed("words"),
        Link.OPEN,
    ):
        yield said([tried(problem_of, notice, moves=moves) for moves in (True, False)])
    limits = Limits(
        forward_mps=0.5, turn_radps=1.0, accel_mps2=1.0, decel_mps2=1.0, turn_accel_radps2=1.0, turn_decel_radps2=1.0
    )
    for speed in (None, 0.5, -0.5, 0.51, -0.51):
        for rate in (None, 1.0, -1.0, 1.01, -1.01):
            with contextlib.redirect_stderr(io.StringIO()) as err:
                say_what_is_beyond(limits, speed_mps=speed, rate_radps=rate)
            yield said((speed, rate, err.getvalue()))


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (verbs_on_robots, verbs_on_files, measured, recorded, pads, pages, notices)
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
