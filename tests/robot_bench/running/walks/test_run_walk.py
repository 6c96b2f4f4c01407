"""Short runs of all kinds, whole: every line of their traces, what a program expects of them, and what they leave."""

import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

from adapter_sim.masters import Master
from adapter_sim.pinout import load_pinout
from p2os.errors import TransportError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.world.loader import load_world
from p2os.robots.parameters import load_parameters
from robot_bench import adapter, run
from robot_bench.bench import board as board_module
from robot_bench.bench.bench import Bench, run_of
from robot_bench.bench.board import cut_wires, pins_of
from robot_bench.bench.expectations import Expectations
from robot_bench.bench.far_end import FarEnd
from robot_bench.bench.hand_driven_body import HandDrivenBody, hand_driven
from robot_bench.bench.interventions import Interventions
from robot_bench.bench.robot_run import RobotRun
from robot_bench.bench.waiting import EventWait, mark_of
from robot_bench.cli.shown.fleet_hands import FleetHands
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.summary import outcome_of
from robot_bench.remote import RemoteBench
from robot_bench.report.make import Files
from robot_bench.running.loop import RunLoop
from robot_bench.running.pacer import RealTimePacer
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS
from tests.robot_bench.firmware import thumb
from tests.robot_bench.firmware.hurried import hurried
from tests.robot_bench.run.test_port import Clock
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

#: What it is walked through with; imported, so that it stands near these.
PARTS = (Recorder, RunLoop, EventWait, Expectations, FarEnd, HandDrivenBody, Interventions, RobotRun)
SLICE_NS = 10 * NS_PER_MS
HEAD = """
firmware = "{firmware}"
world = "room"
body = "kinematic"
mode = "{mode}"
seed = 3
duration_s = {duration}
[start]
x_m = 0.5
y_m = 0.2
heading_deg = 10.0
"""
THINGS = """
[[obstacle]]
at_s = 0.0
op = "place"
name = "post"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
x_m = 0.9
y_m = 0.25
[[obstacle]]
at_s = 0.31
op = "move"
name = "post"
x_m = 0.86
y_m = 0.25
[[obstacle]]
at_s = 0.62
op = "remove"
name = "crate"
[[hand]]
at_s = 0.2
do = "drive"
forward_mps = 0.4
turn_dps = 10.0
[[hand]]
at_s = 0.5
do = "let_go"
what = "wheels"
[[hand]]
at_s = 0.55
do = "type"
text = "go"
[[hand]]
at_s = 0.56
do = "set_pin"
pin = "PA0"
level = "high"
[[hand]]
at_s = 0.57
do = "set_volts"
pin = "PA1"
volts = 1.25
[[hand]]
at_s = 0.58
do = "set_pin"
pin = "encoder1_s1"
level = "high"
[[hand]]
at_s = 0.6
do = "let_go"
what = "encoder1_s1"
[[hand]]
at_s = 0.7
do = "carry"
x_m = -0.5
y_m = -0.4
heading_deg = 45.0
[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m = 0.05
[[goal]]
kind = "usart_contains"
text = "CRUISE"
"""
FAULTS = """
[[fault]]
at_s = 0.35
fault = "sonar-stuck 3 0.2"
for_s = 0.1
[[fault]]
at_s = 0.8
fault = "link-down"
for_s = 0.05
"""
WHEN = """
[[when]]
event = "contact"
after_s = 0.1
do = "end"
"""


WITH_FAULTS = """
firmware = "motors.elf"
world = "room"
mode = "adapter"
duration_s = 0.1
[[fault]]
at_s = 0.05
fault = "link-down"
[[when]]
event = "contact"
do = "inject"
fault = "link-down"
[[hand]]
at_s = 0.05
do = "inject"
fault = "link-down"
"""


def scenarios(folder: Path) -> Iterator[tuple[str, Scenario]]:
    texts = {
        "adapter": HEAD.format(firmware=hurried("dodge", 5), mode="adapter", duration=1.0) + THINGS + FAULTS,
        "direct": HEAD.format(firmware=hurried("dodge", 1), mode="direct", duration=1.0) + THINGS,
        "ended": HEAD.format(firmware=hurried("dodge", 1), mode="direct", duration=2.0) + THINGS + WHEN,
        "motors": HEAD.format(firmware=hurried("motors", 1), mode="direct", duration=0.6),
    }
    for name, text in texts.items():
        file = folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        yield name, load_scenario(str(file))
    yield "rover", replace(load_scenario("rover"), goals=()).with_options(duration_s=0.4)
    core = load_scenario(str(folder / "adapter.toml"))
    yield "firmware", replace(core.with_options(adapter_core="firmware", duration_s=0.7), usart_baud=9600)


def shown_lines(bench: Bench) -> Iterator[str]:
    yield from (line.rstrip() for line in bench.trace.lines() if '"k":"meta"' not in line)


def runs(_draw: Random) -> Iterator[str]:
    """Run each scenario to its end and judge it."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for what, scenario in scenarios(Path(name)):
            bench = Bench(scenario, slice_ns=SLICE_NS)
            bench.run_until(bench.end)
            yield f"{what} {bench.end} {bench.now} {run_of(bench).note}"
            yield said(bench.judge()).replace(name, "HERE")
            yield from shown_lines(bench)
            yield said([bench.pose, bench.text, bench.last_events(), bench.parts.body.state])
            recorder = run_of(bench).recorder
            yield said([recorder.min_clearance_m, recorder.distance_m, recorder.last_line, recorder.unfinished_text])
            record = bench.record()
            yield said(
                [len(record.poses), len(record.contacts), record.usart_lines(), len(record.pins), record.last_ns]
            )
            yield said(outcome_of(record)).replace(name, "HERE")[:2000]
            yield said([pins_of(scenario), sorted(cut_wires(scenario, load_pinout()))])
        for program in ("SPIN", "NOWHERE", "DIVIDE", "OVERFLOW", "SLEEP"):
            file = Path(name, f"{program}.bin")
            file.write_bytes(getattr(thumb, program))
            short = load_scenario("dodge", firmware=file).with_options(body="kinematic", duration_s=0.02)
            bench = Bench(replace(short, goals=()))
            bench.run_until(bench.end)
            yield said([program, bench.now, bench.chip.verdict, bench.chip.has_died, run.notes(bench, bench.end, None)])
            yield said([bench.judge(), *bench.last_events(3)]).replace(name, "HERE")


def together(_draw: Random) -> Iterator[str]:
    """Run two robots in one world, set them back, and let another pair go on from there."""
    scenario = load_scenario("two-dodge").with_options(duration_s=0.5)
    scenario = replace(scenario, robots=tuple(
        replace(robot, scenario=robot.scenario and replace(robot.scenario, firmware=hurried("dodge", 1)))
        for robot in scenario.robots
    ))  # fmt: skip
    benches = Bench.together(scenario, slice_ns=SLICE_NS)
    first, second = benches.values()
    first.run_until("0.1 s")
    FleetHands(benches, first.end).do("west", "drive 0.4 60")
    FleetHands(benches, first.end).do("east", "drive -0.3 20")
    first.run_until("0.2 s")
    first.checkpoint()
    other = first.fork()
    first.run_until(first.end)
    for bench in benches.values():
        yield said([bench.scenario.name, bench.now, bench.end, bench.pose, bench.level("motor1_comm1")])
    first.rewind("0.3 s")
    yield said([first.now, second.now, second.pose, run_of(second).recorder.distance_m])
    first.run_until(first.end)
    other.run_until(other.end)
    for one in (*benches.values(), *other.robots.values()):
        yield said([one.trace.length, *one.last_events(3)])
    yield said(first.judge())
    for bench in benches.values():
        yield from shown_lines(bench)
    for bench in (first, second):
        run_of(bench).ends_at = ends = first.end - SLICE_NS  # its scenario ends it, and the other one's does not
        for at in (ends - 1, ends, ends + 1):
            yield said([[run_of(one).ended(at), run_of(one).end, run_of(one).whole_end] for one in (first, second)])
        run_of(bench).ends_at = None


#: What is asked of a bench, one after the other: the method, its arguments.
ASKED: Sequence[tuple[str, tuple[object, ...], dict[str, object]]] = (
    ("expect", ("pin p2dx_con high",), {"within": "0.5 s"}),
    ("expect_text", ("CRUISE",), {}),
    ("expect_text", (re.compile("VEER|TURN"), "1 s"), {}),
    ("expect", ("contact", "0.1 s"), {}),
    ("expect", ("contact", 300), {}),
    ("expect", ("contact", 1000), {}),
    ("expect_no", ("contact", "0.05 s"), {}),
    ("rewind", ("0.25 s",), {}),
    *(("expect_pose", (), {**place, "within": "0 s"}) for place in (
        {"x_m": 0.5696}, {"x_m": 0.5698}, {"y_m": 0.1536, "x_m": 0.52}, {"y_m": 0.1534}, {"heading_deg": 15.4},
        {"heading_deg": 15.6}, {"heading_deg": 370.5}, {"heading_deg": -340.0, "tolerance_deg": 20.0},
        {"x_m": 0.3, "y_m": 0.2, "tolerance_m": 0.2}, {"x_m": 0.33, "y_m": 0.2, "tolerance_m": 0.2}, {},
    )),
    ("expect_pose", (), {"x_m": 0.57, "tolerance_m": 0.001, "within": "90 ms"}),
    ("expect_pose", (), {"x_m": 9.0, "y_m": -9.0, "heading_deg": 1.0, "within": "60 ms"}),
    ("expect", ("contact",), {"within": "0.2 s"}),
    ("expect_no", ("contact", "0.02 s"), {}),
    ("rewind", ("0.3 s",), {}),
    ("rewind", ("9 s",), {}),
    ("expect_no", ("contact", "0.2 s"), {}),
    ("expect", ("robot moves",), {}),
    ("expect_no", ("pin encoder1_s1 changes", "0.1 s"), {}),
    ("expect_pin", ("motor1_comm1", "high"), {"within": "0.02 s"}),
    ("expect_pin", ("motor1_comm1", "low"), {"within": "0.02 s"}),
    ("expect_pin", ("motor1_comm1", "half"), {}),
    ("expect_pin", ("gone", "high"), {}),
    ("expect", ("spi1 sends 00",), {}),
    ("expect", ("nonsense",), {}),
    ("run_until", ("0.6 s",), {}),
    ("run_until", ("contact",), {"within": "0.1 s"}),
    ("checkpoint", (), {}),
    ("expect", ("pin motor1_comm2 changes", "0.1 s"), {}),
    ("expect", ("pin motor1_comm2 changes", "0.1 s"), {}),
    ("run_until", (lambda bench: bench.now > 800_000_000,), {"within": "0.3 s"}),
    ("rewind", ("0.75 s",), {}),
    ("expect", ("contact",), {"within": "5 s"}),
    ("expect", ("contact",), {}),
    ("run_until", ("99 s",), {}),
    ("finish", (), {}),
    ("run_until", ("100 s",), {}),
    ("level", ("PB7",), {}),
    ("level", ("PB99",), {}),
)  # fmt: skip


def expectations(_draw: Random) -> Iterator[str]:
    """Ask a bench for what happens, what does not, and what cannot be."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for what, scenario in [*scenarios(Path(name))][:2]:
            bench = Bench(scenario, slice_ns=SLICE_NS)
            yield said([what, repr(bench)])
            for method, arguments, named in ASKED:
                reported = tried(getattr(bench, method), *arguments, **named)
                shown = [one for one in arguments if isinstance(one, str | int)]
                yield f"{method} {shown} {named}: {reported} at {bench.now}, {run_of(bench).waits.since(bench.now)}"
            yield said([bench.trace.length, mark_of(bench.events, bench.trace, run_of(bench).harness)])
            yield tried(run_of(bench).refuse_the_ended)


#: What is done to a bench while it runs, one after the other.
DONE: Sequence[tuple[str, tuple[object, ...], dict[str, object]]] = (
    ("place", ("post",), {"shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "x_m": 1.2, "y_m": 0.25}),
    ("place", ("post",), {"shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "x_m": 1.5, "y_m": 0.25}),
    ("place", ("pole",), {"shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "before_sonar": 4,
                          "distance_m": 0.6, "hold_s": 0.03}),
    ("place", ("odd",), {"shape": "cone"}), ("place", ("odd",), {"at_s": 3.0}),
    ("move", ("post",), {"x_m": 1.3, "y_m": 0.3}), ("move", ("nothing",), {"x_m": 1.0, "y_m": 0.0}),
    ("remove", ("post",), {}), ("remove", ("post",), {}),
    ("inject", ("sonar-stuck 3 0.2",), {}), ("inject", ("sonar-stuck 4 0.3", "30 ms"), {}), ("inject", ("odd",), {}),
    ("clear", ("sonar-stuck 3",), {}), ("clear", ("sonar-stuck 3 0.2",), {}), ("clear", ("odd",), {}),
    ("press", ("stop-button",), {"during": "20 ms"}), ("press", ("bumper front 1",), {}),
    ("press", ("bumper front 2", 10_000_000), {}), ("press", ("bumper odd 1",), {}), ("press", ("sonar-dead 2",), {}),
    ("press", ("",), {}), ("clear", ("bumper front 1",), {}), ("drop_link", ("40 ms",), {}), ("drop_link", (), {}),
    ("clear", ("link-down",), {}), ("rewind", ("0.3 s",), {}), ("finish", (), {}), ("press", ("stop-button",), {}),
    ("remove", ("pole",), {}), ("clear", ("link-down",), {}),
)  # fmt: skip


def interventions(_draw: Random) -> Iterator[str]:
    """Change what runs from outside: things, faults, buttons and the line, in mode adapter and direct."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for what, scenario in [*scenarios(Path(name))][:2]:
            bench = Bench(replace(scenario, changes=(), hands=(), faults=()), slice_ns=SLICE_NS)
            for number, (method, arguments, named) in enumerate(DONE):
                if "finish" not in [done[0] for done in DONE[:number]]:
                    bench.run_until(bench.now + 25 * NS_PER_MS)
                reported = tried(getattr(bench, method), *arguments, **named)
                yield f"{what} {method} {arguments}: {reported} at {bench.now} {run_of(bench).waits.since(bench.now)}"
            yield from (line for line in shown_lines(bench) if '"k":"pin"' not in line and '"k":"wire"' not in line)


def folders(_draw: Random) -> Iterator[str]:
    """Run into folders: what is reported, what is left, what is refused."""
    before = Path.cwd()
    with TemporaryDirectory(prefix="p2os-test-") as name:
        os.chdir(name)
        try:
            found = dict(scenarios(Path(name)))
            for what in ("direct", "ended", "motors"):
                reported: list[object] = []

                def note(progress: run.RunProgress, reported: list[object] = reported) -> None:
                    reported.append([progress.now // SLICE_NS, progress.duration_ns, progress.doing()])

                place = Path(what)
                done = run.run_scenario(
                    found[what], place, on_progress=note, coverage=what == "motors", profile=what == "motors",
                    fail_under=90.0, explained=what == "ended",
                    files=Files.SUMMARY if what == "direct" else Files.REPORT,
                )  # fmt: skip
                kept = {key: value for key, value in done.outcome.items() if key not in {
                    "real_time_factor", "wall_s", "p2os", "trace_sha256", "version", "firmware_sha256",
                    "report"}}  # fmt: skip
                yield said([what, done.passed, done.was_interrupted, done.report.name, reported[-1:]])
                yield json.dumps(kept, sort_keys=True, default=str).replace(name, "HERE")
                yield said(sorted(path.name for path in place.iterdir()))
                for text in ("pins.vcd", "usart.txt", "coverage.txt"):
                    if (place / text).exists():
                        yield from (place / text).read_text(encoding="utf-8").splitlines()[:60]
            try:
                run.run_scenario(found["motors"], Path("motors"))
            except P2osError as error:
                yield f"{error} ({error.hint})"
        finally:
            os.chdir(before)


def by_hand(_draw: Random) -> Iterator[str]:
    """Drive a body by hand: what its steps, its power and its torques are asked, with and without the hand."""
    calls: list[str] = []
    for speeds in (None, (0.3, 0.0), (-0.2, 1.5), (0.0, -2.0), None):
        for is_powered in (True, False):
            inner: Any = Acted(calls, "body", hold=[["w1", "w2"]] * 9, step=["w"] * 9, ramp=[["r"]] * 9,
                               steps_within=[3] * 9, snapshot=["kept"] * 9)  # fmt: skip
            inner.dt_ns, inner.is_powered, inner.state = 5, True, "here"
            body = HandDrivenBody(inner, 0.4)
            body.drive_by_hand(speeds)
            yield said([body.step(0.1, 0.2), body.hold(0.1, 0.2, 2), body.ramp([(0.1, 0.2), (0.3, 0.4)])])
            yield said([body.steps_within(0.1, 0.25), body.rims, body.dt_ns, body.state])
            yield said([body.is_powered, inner.is_powered])
            body.limit_torques(1.0, 2.0)
            body.is_powered = is_powered
            yield said([body.is_powered, inner.is_powered])
            before = body.snapshot()
            body.drive_by_hand((0.1, 0.1))
            yield said([before, body.is_powered, inner.is_powered, body.rims])
            body.restore(before)
            body.jump(3)
            yield said([body.rims, body.is_powered, inner.is_powered, "jump" in vars(body), body.step(0.0, 0.0)])
            yield said([speeds, is_powered, taken(calls)])
    plain = HandDrivenBody(SimpleNamespace(dt_ns=1, is_powered=False, **dict.fromkeys(  # type: ignore[arg-type]  # as much
        ("step", "hold", "ramp", "steps_within"), len)), 0.4)  # fmt: skip
    yield said([hasattr(plain, "limit_torques"), plain.is_powered, tried(getattr, plain, "_inner") != ""])
    yield said([tried(hand_driven, 3), hand_driven(plain) is plain])


def refusals(_draw: Random) -> Iterator[str]:
    """Ask for what verbs refuse before, and by one condition at a time: of robots together, of chips of others."""
    calls: list[str] = []
    two, dodge = load_scenario("two-dodge").with_options(duration_s=0.05), load_scenario("dodge")
    with TemporaryDirectory(prefix="p2os-test-") as name, mock.patch.object(run, "run_together", Acted(calls).together):
        for named in ({}, {"variables": ["a"]}, {"drive": print}, {"coverage": True}, {"profile": True}):
            yield f"{[*named]} {tried(run.run_scenario, two, Path('x'), **named)} {len(calls)}"  # type: ignore[arg-type]
            calls.clear()
        yield f"{tried(run.run_at_port, two, Path('x'), Acted(calls, 'port'))} {taken(calls)}"
        yield tried(run.run_scenario, dodge, Path(name, "x"), variables=["gone"]).partition(" (known")[0]
        yield tried(Bench.from_scenario, 3)
        first = next(iter(Bench.together(two).values()))
        yield tried(first.run_until, two.duration_ns, lambda _cycles: None)
        yield tried(first._run_to, 9, lambda _cycles: None)
        yield tried(first.fork, Path(name, "fork")).replace(name, "HERE")
        first.run_until("0.02 s")
        heard: list[int] = []
        first.events.at_limit(heard.append)
        first.on_slice = heard.append
        first.checkpoint()
        kept = first.snapshot()
        first.run_until("0.03 s")
        count = len(heard)
        first.restart(kept)
        first.run_until("0.04 s")
        yield said([count > 0, len(heard) == count, first.now, first.on_slice is None, first._checkpoints])
    with TemporaryDirectory(prefix="p2os-test-") as name:
        (Path(name) / "mine.toml").write_text(WITH_FAULTS, encoding="utf-8")
        mine = load_scenario(str(Path(name, "mine.toml")))
        calm: dict[str, Any] = {"mode": "direct", "faults": (), "triggers": (), "hands": ()}
        for kept_one in ("faults", "triggers", "hands"):
            for where in (mine.where, ""):
                changed = replace(mine, **calm | {kept_one: getattr(mine, kept_one), "mode": "direct", "where": where})
                yield f"{kept_one} {tried(lambda c=changed: Bench(c).now)}".replace(name, "HERE")
    chip: Any = SimpleNamespace(usart1=None)
    board = Acted(calls, "recorder")
    for measured in ({"coverage": False, "profile": False}, {"coverage": True, "profile": False}, {
            "coverage": False, "profile": True}):  # fmt: skip
        yield tried(lambda m=measured: type(run._measured(chip, fail_under=0.0, **m)).__name__)
    yield said([tried(board_module.hear_buses, chip, board, buses) for buses in ((), ("spi1",))])
    yield tried(board_module.plug_in, dodge, chip, board)


class RobotLine:
    """A line to a virtual robot that follows a clock; it may break, and the robot may fall silent."""

    description = "a robot"

    def __init__(self, clock: Clock, *, breaks_ns: int = 1 << 60, silent_ns: int = 1 << 60) -> None:
        robot = load_parameters("p2dx")
        self._clock, self._breaks_ns, self._silent_ns = clock, breaks_ns, silent_ns
        self._robot = Pioneer(
            parameters=robot, body=make_body("kinematic", load_world("room"), robot), settings=ControllerSettings(),
            on_event=lambda *_: None,
        )  # fmt: skip
        self.sent, self.is_closed = b"", False

    def read(self) -> bytes:
        if self._clock.now >= self._breaks_ns:
            raise TransportError("the line is gone")
        self._robot.advance_to(self._clock.now)
        data = b"".join(self._robot.take_output())
        return data if self._clock.now < self._silent_ns else b""

    def write(self, data: bytes) -> None:
        if self._clock.now >= self._breaks_ns:
            raise TransportError("the line is gone")
        self.sent += data
        self._robot.receive(data, self._clock.now)

    def fileno(self) -> int:
        return -1

    def set_baud(self, baud: int) -> None: ...

    def close(self) -> None:
        self.is_closed = True


AT_PORT = """
[[goal]]
kind = "happens"
event = "usart1 sends CRUISE"
{ends}
[[goal]]
kind = "no_collision"
"""


def at_ports(_draw: Random) -> Iterator[str]:
    """Drive a robot at a port by a clock: to the end, ended by a goal, lagging, cut off, left without an answer."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        text = HEAD.format(firmware=hurried("dodge", 5), mode="adapter", duration=1.4) + THINGS
        for what, ends, named in (
            ("whole", "", {}), ("met", 'ends_run = "met"', {}),
            ("lags", "", {}), ("breaks", "", {"breaks_ns": 1_100_000_000}), ("silent", "", {"silent_ns": 900_000_000}),
        ):  # fmt: skip
            file = Path(name, f"{what}.toml")
            file.write_text(text + AT_PORT.format(ends=ends), encoding="utf-8")
            scenario, clock = load_scenario(str(file)), Clock()
            line = RobotLine(clock, **named)
            bench = RemoteBench(scenario, line, RealTimePacer(clock=clock, sleep=clock.sleep))
            bench.start_clock()

            def late(now: int, what: str = what, clock: Clock = clock) -> None:
                clock.now += (101 * NS_PER_MS) * (what == "lags" and now >= 1_000_000_000)

            bench.on_slice = late
            yield f"{what} {tried(bench.run_until, scenario.duration_ns)}"
            yield said([bench.note, bench.is_closed, bench.chip.now_ns, bench.adapter.state, clock.now, line.is_closed])
            yield said([len(line.sent), line.sent[-60:].hex(), bench.goals.has_ended_run])
            yield said([bench.judge(bench.chip.now_ns), bench.finish(), bench.recorder.distance_m])
            yield from (row.rstrip() for row in bench.trace.lines() if '"k":"wire"' not in row)
        clock = Clock()
        done = run.run_at_port(
            scenario, Path(name, "run"), RobotLine(clock), clock=clock, files=Files.SUMMARY,
            pacer=RealTimePacer(clock=clock, sleep=clock.sleep),
        )  # fmt: skip
        kept = {key: value for key, value in done.outcome.items() if key not in {"trace_sha256", "firmware_sha256"}}
        yield said([done.passed, done.was_interrupted, kept]).replace(name, "HERE")


def numbers(_draw: Random) -> Iterator[str]:
    """Give the adapter's firmware its numbers, for each robot; and round what is reported of things."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        scenario = dict(scenarios(Path(name)))["firmware"]
    for robot in ("p2dx", "p3at", "amigo"):
        parameters = load_parameters(robot)
        yield said([robot, adapter.robot_numbers(parameters), adapter.setting_numbers(scenario.adapter, parameters)])
    yield said([adapter.wire_numbers(load_pinout()), adapter.is_available()])
    bench = Bench(scenario)
    made = bench.parts.adapter
    assert isinstance(made, adapter.FirmwareAdapter)
    for at in ("0 s", "0.1 s", "0.3 s", "0.5 s"):
        bench.run_until(at)
        yield said([made.state, made.master, made.baud, made.status, made.next_deadline(), sorted(made.wakes_on)])
        yield said(made.numbers)
    made.restore(made.snapshot())
    yield tried(made.restore, 3)
    made.shutdown("enough", bench.now)
    yield said([made.state, made.take_output(), made.first_sight(5) - 5])
    made.set_master(list(Master)[-1], bench.now)
    yield said([made.master, made.numbers["master"]])


TRACES: dict[str, Trace] = {
    "declared": declared_of("robot_bench", "robot_bench.bench", "robot_bench.running"),
    "refusals": refusals, "by hand": by_hand, "numbers": numbers, "ports": at_ports, "together": together,
    "expectations": expectations, "interventions": interventions, "runs": runs, "folders": folders,
}  # fmt: skip
test_what_short_runs_are_is_what_was_approved = judge_of(__file__, TRACES)
