"""Scenario files with each key left out, set to other values or set badly, alone and with the files that they name.

What is said of a file is in what it differs from the one that it was made of, or by which words it is refused.
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import robot_bench
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import Pose, load_world
from p2os.robots.parameters import load_parameters
from robot_bench.events.kinds import Contact, Event, PinEdge, Text
from robot_bench.events.stream import EventStream
from robot_bench.scenario.fault_script import FaultScript, load_faults
from robot_bench.scenario.hands.actions import HandScript
from robot_bench.scenario.hands.doing import ACTION_TABLES, Doing, doing_of
from robot_bench.scenario.hands.timed import load_hands
from robot_bench.scenario.hands.words import WORDS, meant_by
from robot_bench.scenario.included_files import (
    MergedSource,
    ScenarioTable,
    as_toml,
    parsed,
    read_setting,
    read_tables,
    set_key,
)
from robot_bench.scenario.loading import build_scenario, known_scenarios, load_scenario, read_scenario
from robot_bench.scenario.options import ScenarioOptions, known_code, listed, resolve_world
from robot_bench.scenario.plugged_parts import PartTable
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.several_robots import MOST_ROBOTS
from robot_bench.scenario.sweep import are_alike, load_axes, load_seeds, read_seeds, rows
from robot_bench.scenario.timeline import Timeline
from robot_bench.scenario.trigger_script import TriggerScript, load_triggers
from robot_bench.scenario.wired_robots import find_own_robot, known_own_robots
from robot_bench.scenario.world_script import WorldScript, load_changes, placed_things
from simbase.errors import P2osError
from tests.tools.suite.approved import judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

#: Imported, so that it stands near these.
PARTS = (PartTable, ScenarioOptions, MOST_ROBOTS)
MS = 1_000_000
PIONEER = """
firmware = "dodge.elf"
world = "room"
body = "kinematic"
seed = 3
seeds = "1-3"
duration_s = 4.0
threshold_m = 0.45
usart_baud = 9600
record = ["spi1"]
crystal_ppm = 20
sram = "random"
gives_up_s = 3.0
outside = "encoder, distance"
[start]
x_m = 0.5
y_m = 0.25
heading_deg = 90.0
[direct]
step_mm_s = 25.0
ramp_mm_s2 = 500.0
sensor_period_ms = 40
[adapter]
step_mm_s = 20.0
max_velocity_mm_s = 300
refresh_ms = 200
[controller]
name = "One"
sonar_per_sip = "all"
errors = "realistic"
[in_world.arena]
threshold_m = 0.3
duration_s = 6.0
[in_world.arena.start]
x_m = 1.0
y_m = 0.5
[[obstacle]]
at_s = 0.5
name = "post"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
before_sonar = 3
distance_m = 0.5
hold_s = 0.12
[[obstacle]]
at_s = 1.0
name = "visitor"
length_m = 0.4
width_m = 0.3
height_m = 0.5
path_m = [[1.0, 0.0], [1.5, 0.5]]
speed_mps = 0.25
repeat = "once"
[[obstacle]]
at_s = 1.5
op = "move"
name = "visitor"
x_m = 1.0
y_m = 1.0
[[obstacle]]
at_s = 2.0
op = "remove"
name = "crate"
[[fault]]
at_s = 1.0
fault = "sonar-stuck 3 0.5"
for_s = 0.5
[[fault]]
at_s = 0.25
fault = "link-down"
[[when]]
event = "spi1 sends 5A"
id = "first"
do = "set_pin"
pin = "PA12"
level = "high"
for_s = 0.2
[[when]]
event = "contact"
after = "first"
after_s = 0.5
every = true
do = "press"
button = "stop-button"
[[hand]]
at_s = 2.0
do = "drive"
forward_mps = 0.25
turn_dps = 30.0
for_s = 0.5
[[hand]]
at_s = 1.0
do = "let_go"
what = "PA0"
[[goal]]
kind = "latency"
from = "usart1 sends ready"
to = "contact"
most_s = 2.0
[[goal]]
kind = "always"
signal = "x_m"
least = -2.0
from_s = 1.0
[sweep]
threshold_m = [0.4, 0.6]
start.heading_deg = { from = 0, to = 90, step = 45 }
"""
ROVER = """
firmware = "rover.elf"
world = "arena"
body = "kinematic"
robot = "rover"
charge = 0.5
duration_s = 2.0
[pins]
bumper_front = "PB1"
battery = "PA2"
[[part]]
kind = "button"
name = "lamp"
out = "PC13"
[[hand]]
at_s = 1.0
do = "set_volts"
pin = "PA2"
volts = 2.5
"""
SEVERAL = """
world = "arena"
body = "kinematic"
duration_s = 3.0
seeds = "4,5"
[[robot]]
name = "post"
model = "p3at"
x_m = -1.5
y_m = 1.5
[[robot]]
name = "east"
firmware = "dodge.elf"
threshold_m = 0.5
x_m = 1.0
y_m = 0.25
heading_deg = 180.0
[[robot]]
name = "west"
firmware = "rover.elf"
model = "rover"
charge = 0.25
[[goal]]
kind = "no_collision"
[[goal]]
robot = "west"
kind = "usart_contains"
text = "ready"
[[fault]]
at_s = 1.0
fault = "link-down"
[[hand]]
robot = "west"
at_s = 1.0
do = "type"
text = "go"
[sweep]
seed = [1, 2]
"""
#: A file → what is set in it: (key, values).
SET: Mapping[str, Sequence[tuple[str, Sequence[object]]]] = {
    "pioneer": (
        ("firmware", ("motors", "gone.elf", 5)), ("world", ("arena", "arina", "gone.toml", "arena.toml")),
        ("body", ("bullit", "best")), ("mode", ("direct", "both")), ("seed", (-1, 2**63 - 1, 2**63)),
        ("seeds", ("", "5", "3-1", "1,1,2", "9-5")), ("duration_s", (0, 0.3, 2, 1.5, 2.1)),
        ("threshold_m", (0, 0.1, 100, 101)), ("usart_baud", (0, 1, 4_500_000, 4_500_001)),
        ("record", ([], "can", ["usb", "spi1", "can"], ["spi3"])), ("crystal_ppm", (-1000, 1000, 1001)),
        ("sram", ("zeros", "ones")), ("gives_up_s", (0, 0.001)), ("interrupt_latency_cycles", (0, 7, 1001)),
        ("outside", ("", "distance", "motor", "encoder encoder")),
        ("robot", ("p3at", "amigo", "p9", "rover", "gone.p")),
        ("charge", (0.5,)), ("pins", ({"a": "PA0"},)), ("version", (1, 0, 99)), ("extends", ("gone",)),
        ("start.x_m", (9.0, 0.0, math.inf)), ("start.y_m", (-0.25, "low")), ("start.heading_deg", (-90, 720)),
        ("direct.ramp_mm_s2", (0, -1, 0.5)), ("direct.encoder_period_ms", (1, 60_000, 60_001)),
        ("direct.motor_command", ("increment", "duty", "gone")), ("direct.bit_order", ("comm1-msb", "gone")),
        ("adapter.step_mm_s", (0.001, 0, 10_000)), ("adapter.max_rotation_deg_s", (0, 32_767, 32_768)),
        ("adapter.motor_meaning", ("wheels", "gone")), ("adapter.stop_unknown_robot", (True, 1)),
        ("adapter.liveness_ms", (1, 300, 60_001)), ("adapter.distance_stale_ms", (1, 5000)),
        ("adapter.core", ("gone",)),
        ("controller.kind", ("gone",)), ("controller.sonar_per_sip", ("new", "gone")),
        ("controller.errors", ("ideal", "gone.toml")), ("controller.flash", ("gone.toml",)), ("controller.name", ("",)),
        ("in_world.arena.duration_s", (0.25,)), ("in_world.room.threshold_m", (0.25,)),
        ("in_world.room.start", ({"x_m": 0.0, "y_m": 0.5}, {"x_m": 9.0, "y_m": 0.5})), ("in_world.rom", ({},)),
        ("obstacle.post.before_sonar", (0, 1, 8, 9, 257)), ("obstacle.post.hold_s", (0.05, 0.051, 3.5, 0, 3601)),
        ("obstacle.post.distance_m", (0, 100, 101)), ("obstacle.post.shape", ("box", "ball")),
        ("obstacle.post.at_s", (0, -1, 1.9, 4.0, 3.999)), ("obstacle.post.op", ("move", "remove", "turn")),
        ("obstacle.post.name", ("crate", "visitor", "")), ("obstacle.post.length_m", (0.2,)),
        ("obstacle.post.mass_kg", (1.0, -1)), ("obstacle.post.path_m", ([[0, 0], [1, 0]],)),
        ("obstacle.visitor.path_m", ([], [[0, 0]], [[0, 0], [0, 0]], [[0, 0], [1, "a"]])),
        ("obstacle.visitor.repeat", ("back_and_forth", "loop", "gone")), ("obstacle.visitor.hold_s", (1.0,)),
        ("obstacle.3.name", ("visitor", "crate", "crete", "north wall")), ("obstacle.3.path_m", ([[0, 0], [1, 0]],)),
        ("obstacle.4.name", ("visitor", "gone")), ("obstacle.5.name", ("x",)), ("obstacle.4.at_s", (1.2, 3, 5)),
        ("fault.1.fault", ("sonar-stuck 9 1", "bumper front 1", "gone", "dead-reckoning-jump 1", "reset")),
        ("fault.1.for_s", (0, 1e9)), ("fault.2.at_s", (1.25, 4.0)), ("fault.2.robot", ("one",)),
        ("when.1.event", ("contact", "can sends 1", "pin PA12 high", "gone")), ("when.1.after", ("second", "first")),
        ("when.1.pin", ("PB0", "motor1_comm1", "PD1", "gone")), ("when.1.level", ("up",)), ("when.1.id", ("", "other")),
        ("when.2.after", ("", "furst")), ("when.2.id", ("first", "second")),
        ("when.2.do", ("end", "drop_link", "gone")),
        ("when.2.button", ("bumper front 1", "bumper front 9", "go", "")), ("when.2.after_s", (-1, 0)),
        ("hand.1.at_s", (0.5, 3.9999, 4)), ("hand.1.forward_mps", (2, 2.1, -2)), ("hand.1.for_s", (0,)),
        ("hand.1.do", ("end", "gone")), ("hand.2.what", ("wheels", "PB99", "motor1_comm1", "PA1")),
        ("goal.1.from", ("spi2 sends 1", "gone")), ("goal.1.most_s", (0, -1)), ("goal.1.kind", ("gone",)),
        ("goal.1.from_s", (1,)), ("goal.2.from_s", (0, 3.999, 4, 6)), ("goal.2.signal", ("y_m", "gone")),
        ("goal.2.after", ("contact",)), ("sweep.threshold_m", ([], 5, [1], {"from": 1, "to": 2})),
        ("sweep", ({}, {"goal": [{}]}, {"goal": {"1": {"most_s": [1, 2]}}}, {"seed": [[1], [2]]})), ("unknown", (1,)),
        ("start.z_m", (1,)), ("seed.x", (1,)),
    ),
    "rover": (
        ("charge", (0, 1, 1.1)), ("mode", ("direct", "adapter")), ("pins.battery", ("PB5", "PB1", "PC13", "PD0", 5)),
        ("pins.bumper_front", ("PA0", "PA3", "PC13")), ("pins.bumper_rear", ("PA3",)), ("pins", ({},)),
        ("fault", ([{"at_s": 1.0, "fault": "link-down"}],)), ("adapter", ({},)), ("direct.step_mm_s", (1,)),
        ("part.lamp.out", ("PA2", "PB10", "pc14", "PD3", 5)), ("part.1.kind", ("potentiometer", "gone", 7)),
        ("part.1.select", (1, "PC15")), ("part.1.what", ({}, [1, 2], [[1]])), ("part.1.name", ("", False)),
        ("hand.1.pin", ("battery", "PA1", "left_a", "PC15", "gone")), ("hand.1.volts", (0, 25.5, 26)),
        ("outside", ("encoder",)), ("threshold_m", (0.2,)), ("controller.name", ("One",)),
        ("robot", ("rover.toml", "p2dx")), ("usart_baud", (115_200,)), ("goal", ([{"kind": "min_distance"}],)),
        ("when", ([{"event": "pin bumper_front low", "do": "end"}], [{"event": "pin bumper_rear low", "do": "end"}])),
        ("start", ({"x_m": 0.0, "y_m": 0.0}, {"x_m": 0.0})), ("record", (["spi1"],)),
    ),
    "several": (
        ("robot.post.name", ("west", "north wall", "box 1", "a b", "A-1.x", "_" * 33, 7)), ("robot.1.x_m", (1.1, 9.0)),
        ("robot.east.model", ("amigo", "gone")), ("robot.east.mode", ("direct",)), ("robot.post.charge", (1,)),
        ("robot.east.adapter", ({"step_mm_s": 5}, {"step_mm_s": -5})),
        ("robot.west.pins", ({"left_a": "PC14"}, {"x": 1})),
        ("robot.post.firmware", ("motors", "gone")), ("robot.west.heading_deg", (45,)), ("robot.west.x_m", (0.5,)),
        ("robot.4.x_m", (1,)), ("mode", ("direct",)), ("threshold_m", (1,)), ("start", ({"x_m": 0, "y_m": 0},)),
        ("goal.1.robot", ("east", "post", "wast")), ("goal.2.robot", ("east", 7)), ("goal.2.text", (5,)),
        ("fault.1.robot", ("east", "west")), ("fault.1.at_s", (3, "late")), ("hand.1.robot", ("east", "post")),
        ("hand.1.port", ("usart2", "usart9")), ("robot.east.controller", ({"kind": "gone"}, {"name": "E"})),
        ("seed", (5,)), ("seeds", ("x",)), ("world", ("office",)), ("sweep", ({"robot": {"east": {"x_m": [1, 2]}}},)),
        ("robot", ([], [{}], [{"name": "a"}], [{"name": "a", "firmware": "dodge.elf"}] * 2)),
    ),
}  # fmt: skip


def plain(value: object) -> str:
    """Return a value as text, without what belongs to this machine or to the whole of a robot."""
    return said(value).replace(str(Path(robot_bench.__file__).parent), "BENCH")


def seen(scenario: Scenario, base: Scenario | None = None) -> dict[str, str]:
    """Return what a scenario has, each as text; beside another, what is otherwise there."""
    names = [
        part.name for part in fields(scenario) if part.name not in {"text", "parameters", "path", "where", "robots"}
    ]
    each = {name: (getattr(scenario, name), getattr(base, name, None)) for name in names}
    found = {name: plain(value) for name, (value, other) in each.items() if base is None or value != other}
    if base is None or scenario.own_classes != base.own_classes:
        found["classes"] = plain([scenario.codes, scenario.own_classes])
    others = {} if base is None else {robot.name: robot for robot in base.robots}
    for robot in scenario.robots:
        other = others.get(robot.name)
        if other is None or (robot.start, robot.parameters) != (other.start, other.parameters):
            found[robot.name] = plain([robot.parameters.sonar_fitted, robot.start])
        if robot.scenario is not None:
            inner = seen(robot.scenario, None if other is None else other.scenario)
            found |= {f"{robot.name}.{key}": value for key, value in inner.items()}
    return found


def differing(base: Scenario, load: Callable[[], Scenario]) -> str:
    """Return in what a scenario is otherwise than another."""
    try:
        found = load()
    except (P2osError, LookupError) as error:
        return refusal(error)
    return said([[robot.name for robot in found.robots], seen(found, base)])


class Folder:
    """A folder of its own, where scenarios are read."""

    def __init__(self) -> None:
        self._before, self._made = Path.cwd(), TemporaryDirectory(prefix="p2os-test-")

    def __enter__(self) -> Path:
        os.chdir(self._made.name)
        return Path()

    def __exit__(self, *_what: object) -> None:
        os.chdir(self._before)
        self._made.cleanup()


def written(folder: Path, **texts: str) -> None:
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")


def settings(_draw: Random) -> Iterator[str]:
    """Set each key beside its file."""
    with Folder() as folder:
        written(folder, pioneer=PIONEER, rover=ROVER, several=SEVERAL)
        for name, keys in SET.items():
            path = folder / f"{name}.toml"
            base = read_scenario(path)
            yield from (f"{key} = {value}" for key, value in seen(base).items())
            read = read_tables(path)
            for key, values in keys:
                for value in values:
                    yield f"{key}={as_toml(value)}: " + differing(base, partial(with_set, read, path, key, value))
            for key in ("obstacle.1.at_s", "hand.1.at_s", "fault.1.at_s", "duration_s"):
                for value in (2.999, 3, 4, 6):
                    one = [(key, value)]
                    yield f"{key} {value} of the file: " + differing(base, partial(read_scenario, path, settings=one))


def with_set(read: ScenarioTable, path: Path, key: str, value: object) -> Scenario:
    """Return a scenario of tables that were read, with a key that is set beside them."""
    table = deepcopy(dict(read.table))
    source = MergedSource(read.source.parts, {set_key(table, key, value): f"--set {key}"})
    return build_scenario(ScenarioTable(table=table, source=source, text=""), path, settings=[(key, value)])


def lines(_draw: Random) -> Iterator[str]:
    """Leave out each line of a file."""
    with Folder() as folder:
        for name, text in (("rover", ROVER), ("several", SEVERAL)):
            path, every = folder / f"{name}.toml", text.splitlines()
            written(folder, **{name: text})
            base = read_scenario(path)
            for number, line in enumerate(every):
                if "=" in line:
                    path.write_text("\n".join([*every[:number], "", *every[number + 1 :]]), encoding="utf-8")
                    yield f"{name} without {line}: " + differing(base, partial(read_scenario, path))


#: Files that name others.
FILES: Mapping[str, str] = {
    "base": """firmware = "dodge.elf"
world = "room"
body = "kinematic"
duration_s = 2.0
[start]
x_m = 0.5
y_m = 0.0
[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m = 0.5
""",
    "posts": """[[obstacle]]
at_s = 0.5
name = "one"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
x_m = 0.0
y_m = 1.0
[[obstacle]]
at_s = 0.5
name = "two"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
x_m = 0.0
y_m = -1.0
""",
    "more": """[[obstacle]]
at_s = 1.0
op = "remove"
name = "two"
[start]
heading_deg = 30.0
""",
    "deep/down": 'include = ["../more.toml"]\nextends = "flat.toml"\nseed = 7\n',
    "deep/flat": """extends = "../base.toml"
world = "hall.toml"
robot = "p2dx"
[controller]
errors = "loud.toml"
[[goal]]
kind = "no_collision"
""",
    "extended": 'extends = "base.toml"\nseed = 4\n[start]\ny_m = 0.25\n',
    "other": 'extends = "base.toml"\n[[goal]]\nkind = "usart_contains"\ntext = "x"\n',
    "included": 'include = ["posts.toml", "more.toml"]\nextends = "base.toml"\n[start]\nheading_deg = 45.0\n',
    "swapped": 'include = ["more.toml", "posts.toml"]\nextends = "base.toml"\n',
    "lone": 'include = "base.toml"\n[[goal]]\nkind = "touches"\n',
    "shipped": 'extends = "motors"\nseed = 9\n',
    "own": 'include = ["deep/down.toml"]\nduration_s = 1.0\n',
    "round": 'include = ["circle.toml"]\n',
    "circle": 'extends = "round.toml"\n',
    "itself": 'extends = "itself.toml"\n',
    "gone": 'include = ["gone_by.toml"]\n',
    "dodgy": 'extends = "dodg"\n',
    "wrong": "include = [5]\n",
    "later": "version = 9\n",
    "broken": "seed = = 1\n",
    "bad": 'include = ["posts.toml"]\nextends = "base.toml"\n[[obstacle]]\nat_s = -1\nname = "x"\nop = "remove"\n',
    "worse": 'extends = "base.toml"\ninclude = ["deep/bad.toml"]\n',
    "deep/bad": '[start]\nx_m = "far"\n',
    "deep/loud": "",
    "empty": 'extends = "base.toml"\ngoal = []\nobstacle = []\n',
    "mixed": 'extends = "base.toml"\ngoal = 5\n',
}  # fmt: skip
KEYS = (
    "start.x_m=1.5", "goal.2.distance_m=0.25", "goal.0.distance_m=1", "goal.3.distance_m=1", "goal.two.x=1",
    "obstacle.two.x_m=0.5", "obstacle.1.at_s=9", "seed=-1", "world=arena", "duration_s=1", "start=5", "start.x_m.y=1",
    "seed.x=1", "new.key=1", "robot=[", "goal=[]", "obstacle.one=3", "description='a b'",
)  # fmt: skip


def tables_of(path: Path) -> str:
    """Return what a file says with all that it names."""
    found = read_tables(path)
    return plain([found.table, found.text if len(found.text) < 1500 else len(found.text)]).replace("\n", " ")


def values_of(path: Path) -> list[str]:
    """Return what the scenario of a file has."""
    return [*seen(read_scenario(path)).values()]


def included(_draw: Random) -> Iterator[str]:
    """Read files that name others, and set keys beside them."""
    with Folder() as folder:
        (folder / "deep").mkdir()
        written(folder, **FILES, **{"deep/hall": "version = 1\n"})
        for name in FILES:
            path = folder / f"{name}.toml"
            yield f"{name}: {tried(tables_of, path)}"
            yield tried(values_of, path)
        for name in ("included", "swapped", "extended"):
            path = folder / f"{name}.toml"
            base = read_scenario(path)
            for text in KEYS:
                setting = read_setting(text)
                try:
                    found = read_tables(path, [setting], "--with")
                    yield f"{name} {text}: {plain(found.table)} {found.text.splitlines()[-1]}"
                    for table, key, number in (("", setting[0], 0), ("goal", "kind", 0), ("goal", "distance_m", 1),
                                               ("obstacle", "", 2), ("obstacle", "at_s", 1), ("start", "x_m", 0),
                                               ("start", "heading_deg", 0), ("", "gone", 0),
                                               ("gone", "x", 3)):  # fmt: skip
                        yield found.source.at(table, key, number)
                    yield differing(base, partial(read_scenario, path, settings=[setting]))
                except P2osError as error:
                    yield f"{name} {text}: {refusal(error)}"
    for text in ("a.b=1", "a=", "=1", "a..b=1", "a", " a.b = [1, 'x'] ", "a='x=y'", "a=1\nb=2", "a=1 # c", "a={b=1}"):
        yield f"{text}: {tried(read_setting, text)}"
    for value in (True, 1, 1.5, "x", "1", "true", [1, "2", [False]], "a b", ""):
        yield f"{value!r}: {as_toml(value)} {parsed(as_toml(value))!r}"
    table: dict[str, object] = {"a": {"b": 1}, "list": [{"name": "x"}, {"k": 1}, 3], "none": []}
    for key in (
        "a.b",
        "a.c.d",
        "list.x.k",
        "list.2.k",
        "list.3.k",
        "list.4.k",
        "list.0.k",
        "none.1.k",
        "list",
        "list.1",
    ):
        yield f"{key}: {tried(set_key, table, key, 5)} {table}"


def first_seeds(text: str) -> list[int]:
    """Return how many seeds there are, and the first of them."""
    found = read_seeds(text)
    return [len(found), *found[:9]]


def axes_of(table: dict[str, object]) -> list[object]:
    """Return what is swept, and over which values."""
    return [[axis.key, len(axis.values), axis.values[:4], axis.values[-1]] for axis in load_axes(table, "x.toml")]


def rows_of(table: dict[str, object]) -> list[object]:
    """Return the rows of a sweep."""
    return [*rows(load_axes(table, "x.toml"))]


def many(_draw: Random) -> Iterator[str]:
    """Name seeds and sweep parameters."""
    for text in ("7", "0-3", "1, 5, 2-4", "3,3,1-3", "", "a", "5-4", "1-", "-1", f"{2**63 - 1}", f"{2**63}", "0-100000",
                 "٣", "1 - 2", "1,,2"):  # fmt: skip
        found = tried(first_seeds, text)
        yield f"{text}: {found} {tried(load_seeds, text, 'x.toml')[:60]}"
    yield said([len(read_seeds(text)) for text in ("0-99999", "5,0-99998")] + [tried(read_seeds, "5,6-100005")])
    yield said([load_seeds(None, "x"), are_alike(["a", "a"]), are_alike(["a"]), are_alike([]), are_alike([None, None])])
    yield said([are_alike(["a", "b"]), are_alike(["a", "a", None]), are_alike(iter("aaa"))])
    ranges = ((0, 1, 0.25), (0, 1, 0.3), (1, 0, 1), (2, 2, 1), (0, 10, 2), (0, 0.3, 0.1), (0.1, 0.9, 0.2), (0, 1, 0),
              (0, 100_000, 1), (0, math.inf, 1), (-1, 1, 1), (0, 1, -1))  # fmt: skip
    for first, last, step in ranges:
        table: dict[str, Any] = {
            "a": {"from": first, "to": last, "step": step},
            "b": {"c": [1, "x", True], "d": {"e": [2]}},
        }
        yield f"{first} {last} {step}: " + tried(axes_of, {"a": table["a"]})
        if last - first < 5:
            yield tried(rows_of, table)
    wide = {"from": 0, "to": 999, "step": 1}
    for table in ({}, {"a": {}}, {"a": []}, {"a": [{}]}, {"a": 5}, {"a": {"from": 1}}, {"a": {"b": 5}}, {"a": wide},
                  {"a": wide, "b": [*range(100)]}, {"a": wide, "b": [*range(101)]}):  # fmt: skip
        yield tried(axes_of, table)
    yield said([*rows(())])


#: What a command line sets otherwise.
OPTIONS: Sequence[dict[str, Any]] = (
    {}, {"mode": "direct"}, {"mode": "adapter"}, {"mode": "both"}, {"adapter_core": "firmware"},
    {"adapter_core": "gone"},
    {"body": "kinematic"}, {"body": "gone"}, {"world": "arena"}, {"world": "room"}, {"world": "arenna"},
    {"world": "gone.toml"}, {"world": ""}, {"seed": 0}, {"seed": -1}, {"seed": 2**63 - 1}, {"seed": 2**63},
    {"seed": 1.5},
    {"seed": True}, {"duration_s": 0}, {"duration_s": 0.5}, {"duration_s": math.inf}, {"duration_s": "1"},
    {"duration_s": -1}, {"usart_baud": 1200}, {"usart_baud": "fast"}, {"record": "can"}, {"record": "can, spi1,,"},
    {"record": ["usb"]}, {"record": ["spi1", "spi1"]}, {"record": "gone"}, {"firmware": "gone.elf"},
    {"firmware": "pioneer.toml"}, {"firmware": 5}, {"gone": 1}, {"seeds": 1}, {"mode": None, "seed": None},
)  # fmt: skip


def firmware_of(name: str) -> Path:
    """Return the program of a scenario that is given another one."""
    return load_scenario(name, firmware=Path("own.elf")).firmware


def robot_file(name: str) -> str:
    """Return the name of the file of a robot on own pins."""
    found = find_own_robot(name, Path())
    return "none" if found is None else found.name


def options(_draw: Random) -> Iterator[str]:
    """Set otherwise what a command line may, and look up what names stand for."""
    with Folder() as folder:
        written(folder, pioneer=PIONEER, rover=ROVER, several=SEVERAL, arena='name = "x"')
        for name in SET:
            scenario = read_scenario(folder / f"{name}.toml")
            for given in OPTIONS:
                yield f"{name} {given}: " + differing(scenario, partial(scenario.with_options, **given))
            yield said([scenario.threshold_m, scenario.has_robot, scenario.own_classes, len(scenario.programmed)])
        moved = load_scenario("pioneer.toml").with_options(world="arena").with_options(world="room")
        yield said([moved.start, moved.start_at, moved.threshold_um, moved.duration_ns])
        for name in ("dodge", "dodgy", "pioneer", "gone", "deep/gone", "gone.toml", "rover"):
            yield f"{name}: {tried(firmware_of, name)}"
        for world in ("arena", "room.toml", "arena.toml", "arena.TOML", "gone", "gone.wbt", "gone.glb"):
            yield f"{world}: {tried(resolve_world, world, folder, 'here')}"
        for robot in ("rover", "rover.toml", "pioneer.toml", "p2dx", "gone.toml"):
            yield f"{robot}: {tried(robot_file, robot)}"
    yield said([known_scenarios(), known_own_robots()])
    yield said([listed("a, b,,c "), listed(None), listed(["a", "b"]), listed("")])
    for what, name in (("body", "best"), ("body", "gone"), ("adapter", "model"), ("adapter", "kinematic"),
                       ("controller", "pioneer"), ("controller", "a.py:B")):  # fmt: skip
        yield f"{what} {name}: {tried(known_code, what, name)}"


WORDED = (
    "fault sonar-stuck 3 0.2", "clear link-down", "press stop-button", "pin PA0 high", "pin bumper 1 low", "pin PA0 up",
    "pin", "volts PA0 2.5", "volts PA0 much", "volts PA0", "let go wheels", "let go PA0", "let PA0",
    "type usart1 go on",
    "type usart2", "move box 1 to 1.5 -0.5", "move box to 1 2 heading 90", "move box 1 2",
    "move a to b to 1 2 heading 0",
    "place crate box 0.4 0.3 at 1.5 0", "place post cylinder 0.1 at 1 1 heading 45", "place post cylinder at 1 1",
    "place post ball 1 at 1 1", "remove box 1", "remove", "carry robot to 1.5 0 heading 90", "carry box to 1 2",
    "carry robot to 1", "drive 0.2 45", "drive -0.2 -4e-1", "drive 1", "drive 1 2 3", "drive 1e999 0", "jump", "",
    "  let go PA1 ",
    "drive 1. 2.5e3", "place a b box 1 2 at 3 4 heading 5.5",
)  # fmt: skip
ACTS: Sequence[tuple[str, dict[str, object]]] = (
    ("type", {"text": "gö", "port": "usart3"}), ("set_pin", {"pin": "PA12", "level": "low", "for_s": 0.5}),
    ("set_pin", {"pin": "PB7", "level": "high"}), ("set_volts", {"pin": "PB1", "volts": 1.25, "for_s": 0.1}),
    ("set_volts", {"pin": "motor1_comm1", "volts": 1.25}), ("let_go", {"what": "PB9"}), ("let_go", {"what": "wheels"}),
    ("let_go", {"what": "motor1_comm1"}), ("carry", {"x_m": 1, "y_m": 2, "heading_deg": 90}), ("let_go", {"what": "x"}),
    ("drive", {"forward_mps": -0.5, "turn_dps": 90, "for_s": 0.25}), ("drive", {"forward_mps": 1}), ("end", {}),
    ("drop_link", {"for_s": 0.5}), ("sag_battery", {"volts": 11}), ("sag_battery", {"volts": 11.5, "for_s": 1}),
    ("inject", {"fault": "sonar-dead 1", "for_s": 1}), ("clear", {"fault": "link-down"}), ("end", {"for_s": 1}),
    ("clear", {"fault": "sonar-dead 99"}), ("clear", {"fault": "sonar-dead 1", "for_s": 1}),
    ("press", {"button": "bumper rear 2", "for_s": 0.2}), ("remove", {"name": "x"}), ("move", {"name": "x", "x_m": 1}),
    ("place", {"name": "x", "x_m": 0, "y_m": 1, "shape": "cylinder", "radius_m": 1, "height_m": 1, "heading_deg": 90}),
)  # fmt: skip


def hands(_draw: Random) -> Iterator[str]:
    """Say in words what is done, and read what it comes to."""
    parameters, own = load_parameters("p2dx"), {"PA0": "left", "left": "left"}
    for words in WORDED:
        found = tried(meant_by, words)
        yield f"{words}: {found}"
    yield said({name: usage for name, (usage, _) in WORDS.items()})
    for do, keys in ACTS:
        for wires in (None, own):
            try:
                doing = doing_of(do, keys, parameters, "x.toml", wires)
            except P2osError as error:
                yield f"{do} {keys}: {refusal(error)}"
                continue
            begun = doing.begun_at(100)
            yield f"{do} {keys}: {said(doing)} {[(one.at, one.words) for one in begun.actions]} {begun.faults}"
            yield said([change.at for change in begun.changes])
    tables = [{"at_s": 2 - number / 8, "do": do, **keys} for number, (do, keys) in enumerate(ACTS[:4])]
    for hand in load_hands(tables, parameters, "x.toml"):
        yield said([hand.at, hand.table, replace(hand, robot="west").table, hand.doing])
    yield said(sorted(ACTION_TABLES))


CHANGES: Sequence[dict[str, object]] = (
    {"at_s": 0.2, "name": "post", "shape": "cylinder", "radius_m": 0.05, "height_m": 0.5, "before_sonar": 2,
     "distance_m": 0.5, "hold_s": 0.151},
    {"at_s": 0.1, "name": "box", "x_m": 1.2345678, "y_m": -0.5, "heading_deg": 30, "length_m": 0.2, "width_m": 0.3,
     "height_m": 0.5, "mass_kg": 2.0},
    {"at_s": 0.25, "op": "move", "name": "box", "x_m": 1.25, "y_m": -0.75, "heading_deg": -90},
    {"at_s": 0.25, "op": "move", "name": "box", "before_sonar": 8, "distance_m": 0.75},
    {"at_s": 0.5, "op": "remove", "name": "box"},
    {"at_s": 0.5, "name": "walker", "shape": "cylinder",
     "radius_m": 0.2, "height_m": 1.7, "path_m": [[1, 1], [1.5, 1]]},
)  # fmt: skip


def scripts(_draw: Random) -> Iterator[str]:
    """Carry out changes of the world, faults, and what hands do."""
    parameters = load_parameters("p2dx")
    changes = load_changes(CHANGES, parameters, "x.toml")
    yield said(changes)
    yield said(placed_things(changes))
    done: list[str] = []
    body = make_body("kinematic", load_world("room"), parameters)
    body.reset(Pose(-0.5, 0.25, math.radians(75)), 0)

    def bring_to(at: int) -> None:
        done.append(f"to {at}")

    def on_change(op: str, name: str, at: int, named: Mapping[str, object]) -> None:
        done.append(said([op, name, at, named]))

    def script(*some: Any) -> WorldScript:
        return WorldScript(some, body, parameters, bring_to=bring_to, on_change=on_change)

    world, later = script(*changes), changes[-3:]
    for limit in (99, 100, 199, 200, 260, 400, 499, 500, 900):
        state = world.snapshot()
        again = script(*changes[:3], *changes[4:])
        try:
            yield said(again.begun_as(state, limit * MS)["_done"])
        except P2osError as error:
            yield refusal(error)
        yield said([world.advance_to(limit * MS), world.next_deadline()])
        yield said(done)
        done.clear()
    world.take_back(*later)
    yield said([world.next_deadline(), world.snapshot()["_done"]])
    for at in (950, 1000, 2000):
        try:
            world.add(*(replace(change, at=at * MS) for change in later), now=1000 * MS)
        except P2osError as error:
            yield refusal(error)
        yield said([done, world.next_deadline(), world.snapshot()["_done"]])
        done.clear()
    faults = [{"at_s": 0.5, "fault": "link-down", "for_s": 0.25}, {"at_s": 0.25, "fault": "sonar-stuck 3 0.2"}]
    made = FaultScript(
        load_faults(faults, parameters, "x.toml"), bring_to=bring_to, do=lambda *one: done.append(said(one))
    )
    acted = HandScript(bring_to=bring_to, do=lambda one: done.append(one.words))
    acted.add(*doing_of("set_pin", dict(ACTS[1][1]), parameters, "x", None).actions)
    for limit in (0, 250, 500, 750):
        yield said(
            [made.advance_to(limit * MS), acted.advance_to(limit * MS), made.next_deadline(), acted.next_deadline()]
        )
        yield said(done)
        done.clear()
    yield from lists_of_changes(Timeline)


def lists_of_changes(kind: type[Timeline[Any]]) -> Iterator[str]:
    """Add to a list of changes and take from it, where some were made."""
    made: list[object] = []
    changes = load_changes(CHANGES, load_parameters("p2dx"), "x.toml", are_later=True)
    line = kind(changes[:3], made.append)
    line.advance_to(changes[1].at)
    line.add(changes[0], changes[4], now=changes[1].at)
    line.take_back(changes[2])
    for at in (0, 10**9):
        line.advance_to(at)
        yield said([len(made), line.next_deadline(), [getattr(one, "name", one) for one in made]])


WHEN: Sequence[dict[str, object]] = (
    {"event": "contact", "id": "a", "do": "end", "after_s": 0.1},
    {"event": "contact", "do": "drive", "forward_mps": 0.5, "every": True, "for_s": 0.1},
    {"event": "usart1 sends go", "after": "a", "id": "b", "do": "inject", "fault": "link-down"},
    {"event": "pin motor1_comm1 high", "after": "b", "do": "type", "text": "x", "every": True, "after_s": 0.02},
    {"event": "usart1 sends go", "do": "remove", "name": "box"},
)  # fmt: skip


def triggers(draw: Random) -> Iterator[str]:
    """Do things at events, whatever the slices, and from what was saved."""
    parameters = load_parameters("p2dx")
    happened: Sequence[Event] = [
        Contact(t=draw.choice((30, 50, 90, 150)) * MS + number, what="box", x_m=0.0, y_m=0.0)
        if number % 3 == 0 else Text(t=(40 + 30 * number) * MS, data=b"go\n") if number % 3 == 1
        else PinEdge(t=(20 + 30 * number) * MS, wire="motor1_comm1", level=number % 2 == 0) for number in range(12)
    ]  # fmt: skip
    for slice_ms in (10, 50, 400):
        done: list[tuple[object, ...]] = []

        def on_doing(doing: Doing, done: list[tuple[object, ...]] = done) -> None:
            done.append(
                tuple((one.at, getattr(one, "words", "")) for one in (*doing.changes, *doing.faults, *doing.actions))
            )

        def on_end(at: int, done: list[tuple[object, ...]] = done) -> None:
            done.append(("end", at))

        stream = EventStream()
        script = TriggerScript(load_triggers(WHEN, parameters, "x.toml"), on_doing=on_doing, on_end=on_end)
        script.subscribe(stream)
        left = sorted(happened, key=lambda event: event.t)
        for now in range(slice_ms, 410, slice_ms):
            while left and left[0].t <= now * MS:
                stream.publish(left.pop(0))
            stream.release(now * MS)
            if now == 200:
                script.restore(script.snapshot())
        yield f"{slice_ms}: {said(done)}"
        yield said([script.snapshot()[key] for key in ("_done", "_first", "_happened")])
    for n, more in (
        (0, {"id": ""}),
        (0, {"after": "b"}),
        (0, {"after": "a"}),
        (2, {"id": "a"}),
        (2, {"after": "c"}),
        (3, {"do": "no"}),
    ):
        table = [{**one, **(more if number == n else {})} for number, one in enumerate(WHEN)]
        yield f"{n} {more}: " + tried(load_triggers, table, parameters, "x.toml")
    yield tried(
        load_triggers, [{"event": "pin left high", "do": "end"}], parameters, "x", {"PA0": "left", "left": "left"}
    )


TRACES = {
    "declared": declared_of("robot_bench.scenario", "robot_bench.scenario.hands"),
    "scripts": scripts, "triggers": triggers, "hands": hands, "many": many, "lines": lines, "options": options,
    "included": included, "settings": settings,
}  # fmt: skip
test_what_scenarios_say_is_what_was_approved = judge_of(__file__, TRACES)
