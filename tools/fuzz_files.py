"""Fuzzing of every file that users hand in: a hostile file is read, or refused in one line that names it.

    python tools/fuzz_files.py                              a few hundred cases of every format
    python tools/fuzz_files.py --format world --cases 10000 --seed 7

Each case takes a file that is right and damages it: a value becomes one of another type or an
extreme number, a key is dropped, doubled or misspelt, a line is cut, bytes are turned. What is
accepted is then used: a world gets a robot, a scenario's script is played, a trace is reported on.
Allowed are success and the project's own errors; anything else, a second line or more than
`LIMIT_S` of processor time is a failure, and the file is kept for a look.
"""

import argparse
import base64
import json
import random
import re
import signal
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from types import FrameType

from adapter_sim.pinout import faults_of, load_pinout
from p2os.capture import Reading, rows_of
from p2os.capture.chunks import Capture
from p2os.capture.formats.hex_text import write_hex
from p2os.capture.formats.pcap import write_pcap
from p2os.capture.formats.recording import write_recording
from p2os.capture.formats.sources import read_file
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.fleet_file import load_fleet
from p2os.pioneer.serve.fleet_order import make_fleet
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import World
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters, load_parameters
from robot_bench.events.codec import events_of
from robot_bench.recording.run_record import read_run
from robot_bench.recording.summary import outcome_of
from robot_bench.report.page import page_data, render_page
from robot_bench.scenario.goals.judging import judge
from robot_bench.scenario.scenario import Scenario, known_scenarios, read_scenario
from robot_bench.scenario.world_script import WorldScript
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS

ROOT = Path(__file__).resolve().parents[1]
GOLDEN = ROOT / "tests" / "golden"
#: chosen: the slowest right file of those below takes a tenth of it.
LIMIT_S = 2.0
#: chosen: a refusal is read on one line of a terminal, or on two.
LONGEST_MESSAGE = 600
#: An engine takes a hundred times as long to make as a world to read: one accepted world in so many.
ENGINE_SHARE = 25
P2DX = load_parameters("p2dx")


class CaseTimeoutError(BaseException):
    """A case took longer than its limit; not an Exception, so that no reader takes it for one of its own."""


class CaseFailedError(Exception):
    """A case was neither read nor refused as it should be."""


@dataclass(frozen=True, slots=True)
class Seed:
    """A file that is right, and what stands beside it."""

    name: str
    data: bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class FileFormat:
    """A kind of file: what is mutated, how its values look, and what reads and uses it."""

    seeds: Callable[[], list[Seed]]
    syntax: str
    use: Callable[[Path, random.Random], None]


# What reads a file, and uses what was accepted -----------------------------------------------


def use_world(path: Path, rng: random.Random) -> None:
    """Read a world and put a robot into it."""
    world = load_world(path, seed=1)
    world.to_plain()
    _stand(world, P2DX, rng)


def _stand(world: World, parameters: RobotParameters, rng: random.Random) -> None:
    for name in ("kinematic", rng.choice(("bullet", "mujoco"))):
        if name == "kinematic" or rng.randrange(ENGINE_SHARE) == 0:
            body = make_body(name, world, parameters)
            body.ranges(range(parameters.sonar_fitted))
            for _ in range(20):
                body.step(0.2, -0.1)
            body.clearance()


def use_fleet(path: Path, _rng: random.Random) -> None:
    """Read a fleet, and make it where it is small."""
    order = load_fleet(path)
    if len(order.robots) <= 3:
        fleet = make_fleet(order)
        together = fleet.multi_robot_world
        for part in fleet.robots if together is None else [together]:
            part.advance_to(300 * NS_PER_MS)


def _room() -> World:
    return load_world("room")


def _live(parameters: RobotParameters, settings: ControllerSettings) -> None:
    robot = Pioneer(parameters=parameters, body=make_body("kinematic", _room(), parameters), settings=settings)
    robot.advance_to(500 * NS_PER_MS)


def use_flash(path: Path, _rng: random.Random) -> None:
    """Read a FLASH, and run a robot that has it."""
    flash = load_flash(path)
    for profile in Profile:
        flash.config(P2DX, profile).to_frame()
    _live(P2DX, ControllerSettings().with_flash(flash))


def use_sensor_errors(path: Path, _rng: random.Random) -> None:
    """Read sensor errors, and run a robot that errs so."""
    _live(P2DX, ControllerSettings(errors=load_sensor_errors(str(path))))


def use_robot(path: Path, rng: random.Random) -> None:
    """Read a robot model, and run one."""
    parameters = load_parameters(path)
    _live(parameters, ControllerSettings())
    _stand(_room(), parameters, rng)


def use_scenario(path: Path, _rng: random.Random) -> None:
    """Read a scenario, and play its script on a body."""
    scenario = read_scenario(path)
    play(scenario)


def play(scenario: Scenario) -> None:
    """Make every change of a scenario's world, without the time in between."""
    body = make_body("kinematic", load_world(scenario.world, seed=scenario.seed), scenario.parameters)
    if scenario.start is not None:
        body.reset(scenario.start, scenario.seed)
    script = WorldScript(scenario.changes[:500], body, scenario.parameters, bring_to=lambda _: None)
    while (at := script.next_deadline()) is not None:
        script.advance_to(at)
    for goal in scenario.goals:
        assert goal.wanted


def use_pinout(path: Path, _rng: random.Random) -> None:
    """Read a pin-out, and judge its revisions."""
    pinout = load_pinout(path)
    for revision in pinout.revisions:
        faults_of(pinout, revision.name)


def use_capture(path: Path, _rng: random.Random) -> None:
    """Read a capture, list it, and write it as every other kind."""
    capture = read_file(path)
    for _ in rows_of(capture, Reading(profile=Profile.P2OS, parameters=P2DX)):
        pass
    write_recording(capture)
    write_hex(capture)
    write_pcap(capture.chunks)


def use_trace(path: Path, _rng: random.Random) -> None:
    """Read a run folder's trace, judge it and write its page."""
    record = read_run(path.parent)
    json.dumps(outcome_of(record))
    render_page(record, page_data(record))
    with path.open(encoding="utf-8", errors="replace") as lines:
        judge(events_of(lines), read_scenario(_shipped_scenario("dodge")).goals, end_ns=record.last_ns)


# What is right ------------------------------------------------------------------------------


def _shipped(package: str, ending: str) -> list[Seed]:
    found = sorted(files(package).iterdir(), key=lambda entry: entry.name)
    return [Seed(f"seed{ending}", entry.read_bytes()) for entry in found if entry.name.endswith(ending)]


def _shipped_scenario(name: str) -> Path:
    return Path(str(files("robot_bench.scenarios").joinpath(f"{name}.toml")))


def _text(name: str, text: str, **beside: bytes) -> Seed:
    return Seed(name, text.encode(), {key.replace("_", "."): data for key, data in beside.items()})


WORLD = """name = "all"
description = "one of each"
extent_m = [-5.0, -5.0, 5.0, 5.0]
[start]
x_m = 0.0
y_m = 0.0
heading_deg = 90
z_m = 0.0
[[box]]
name = "crate"
x_m = 2.0
y_m = 1.0
length_m = 0.5
width_m = 0.4
height_m = 0.5
heading_deg = 30
base_m = 0.0
floor_m = 0.0
mass_kg = 4.0
friction = 0.4
[[box]]
name = "cat"
x_m = -2.0
y_m = -2.0
length_m = 0.4
width_m = 0.2
path_m = [[-2.0, -2.0], [2.0, -2.0]]
speed_mps = 0.3
start_s = 1.0
repeat = "loop"
[[cylinder]]
name = "post"
x_m = 3.0
y_m = 3.0
radius_m = 0.1
height_m = 1.0
[[wall]]
name = "wall"
from_m = [-5, -5]
to_m = [5, -5]
thickness_m = 0.1
height_m = 1.0
fixed = true
[[floor]]
name = "stage"
x_m = -3.0
y_m = 3.0
length_m = 2.0
width_m = 2.0
top_m = 0.1
[[ramp]]
name = "ramp"
x_m = 3.0
y_m = -3.0
length_m = 1.0
width_m = 1.0
rise_m = 0.1
heading_deg = 10
base_m = 0.0
[[mesh]]
name = "rock"
vertices_m = [[4, 4, 0], [4.5, 4, 0], [4, 4.5, 0], [4, 4, 1]]
triangles = [[0, 1, 3], [1, 2, 3], [2, 0, 3]]
[[mark]]
name = "dock"
kind = "dock"
points_m = [[1.0, 1.0]]
[[import]]
file = "part.obj"
x_m = -4.0
y_m = 0.0
z_m = 0.0
heading_deg = 45
scale = 0.5
up = "z"
"""
OBJ = """# a tent, and a wall with a doorway as one polygon
v 3 3 0
v 4 3 0
v 4 4 0
v 3 4 0
v 3.5 3.5 1
f 1 2 5
f 2/2 3/3 5/5
f 3//3 4//4 5//5
f -2 1 5
f 4 3 2 1
l 1 2
"""
ARIA_MAP = """2D-Map
LineMinPos: -3000 -3000
LineMaxPos: 3000 3000
NumLines: 3
MinPos: -3000 -3000
MaxPos: 3000 3000
NumPoints: 3
Resolution: 20
Cairn: RobotHome 0 0 90.000000 "" ICON "home"
Cairn: Goal 1000 500 0.000000 "" ICON "there"
Cairn: ForbiddenArea 0 0 10.0 "" ICON "out" 1000 1000 2000 2000
Cairn: Odd 0 0 0 "" ICON ""
LINES
-3000 -3000 3000 -3000
3000 -3000 3000 3000
3000 3000 -3000 3000
DATA
-2000 1000
-2020 1000
-2040 1020
"""
SDF = """<?xml version="1.0"?>
<sdf version="1.6"><world name="w">
<include><uri>model://sun</uri></include>
<model name="m"><static>true</static><pose>2 0 0.5 0 0 0.3</pose>
<link name="l"><pose degrees="true">0 0 0 0 0 45</pose>
<collision name="a"><geometry><box><size>1 0.5 1</size></box></geometry></collision>
<collision name="b"><pose>0 1 0 0.2 0 0</pose><geometry>
<cylinder><radius>0.2</radius><length>1</length></cylinder></geometry></collision>
<collision name="c"><geometry><sphere><radius>0.3</radius></sphere></geometry></collision>
<collision name="d"><geometry><mesh><uri>part.obj</uri><scale>0.2 0.2 0.2</scale></mesh></geometry></collision>
<collision name="e"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision>
</link></model>
<include><name>again</name><uri>other.sdf</uri><pose>-3 0 0 0 0 0</pose></include>
</world></sdf>
"""
OTHER_SDF = """<sdf version="1.6"><model name="n"><link name="l"><collision name="c">
<geometry><box><size>1 1 1</size></box></geometry></collision></link></model></sdf>
"""
URDF = """<?xml version="1.0"?>
<robot name="r">
<link name="base"><collision><origin xyz="2 0 0.5" rpy="0 0 0.3"/><geometry>
<box size="1 0.5 1"/></geometry></collision></link>
<link name="arm"><visual><geometry><cylinder radius="0.2" length="1.0"/></geometry></visual></link>
<link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision>
<collision><geometry><mesh filename="package://part.obj" scale="0.2 0.2 0.2"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 2 0.5" rpy="0 0.1 0"/></joint>
<joint name="k" type="fixed"><parent link="arm"/><child link="tip"/><origin xyz="0 0 1"/></joint>
</robot>
"""
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01" name="cm"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">200 200 0 300 200 0 200 300 0 200 200 100</float_array>
<technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 3 1 2 3</p></triangles>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>3</vcount><p>2 0 3</p></polylist>
<polygons count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1</p></polygons>
</mesh></geometry></library_geometries>
<library_nodes><node id="n"><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s"><node>
<translate>0 0 0</translate><rotate>0 0 1 30</rotate><scale>1 1 1</scale>
<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>
<instance_geometry url="#g"/><instance_node url="#n"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
STL_TEXT = """solid tent
facet normal 0 0 1
outer loop
vertex 3 3 0
vertex 4 3 0
vertex 3 3 1
endloop
endfacet
facet normal 0 0 1
outer loop
vertex 3 4 0
vertex 4 3 0
vertex 3 3 1
endloop
endfacet
endsolid tent
"""
OCCUPANCY = """image: map.pgm
resolution: 0.1
origin: [-2.0, -2.0, 0.1]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
mode: trinary
"""
PGM = b"P5\n40 40\n255\n" + bytes(0 if x in {0, 39} or y in {0, 39} else 254 for y in range(40) for x in range(40))
FLEET = """world = "office"
body = "kinematic"
seed = 3
apart = false
[[robot]]
port = "tcp:127.0.0.1:8101"
at = [0.0, 0.0, 90]
model = "p2dx"
firmware = "AROS"
lenient = true
all_sonar = true
flash = "my.flash"
errors = "my.errors"
baud = 38400
aux = ["1=pty:/tmp/aux1"]
faults = ["sonar-stuck 3 1.2"]
sync_limit_s = 30
[[robot]]
count = 2
errors = "realistic"
"""
FLASH = """[flash]
name = "Wilma"
serial = "007"
watchdog = 1000
sipcycle = 50
hostbaud = 2
auxbaud = 1
transvelmax = 500
rotvelmax = 100
transacc = 300
rotacc = 100
frontbumps = 5
lowbattery = 110
ticksmm = 76
revcount = 17048
sonarcycle = 40
stallval = 100
stallcount = 100
joyvel = 300
rotkp = 20
"""
SENSOR_ERRORS = """based_on = "realistic"
[sonar]
noise_m = 0.02
noise_part = 0.01
dropout = 0.01
specular_deg = 30
crosstalk = 0.01
[odometry]
left_wheel = 1.01
right_wheel = 0.99
drift_deg = 0.5
[heading]
compass_noise_deg = 2.0
compass_bias_deg = -5.0
gyro_noise_counts = 0.7
gyro_bias_counts = -1.0
[power]
battery_resistance_ohm = 0.15
"""
ARIA_ROBOT = """;SECTION GENERAL
Section General settings
Class Pioneer
Subclass p2dx
RobotRadius 250
RobotWidth 400
RobotLength 500
RobotLengthFront 0
DiffConvFactor 0.0056
DistConvFactor 0.84
AngleConvFactor 0.00153
VelConvFactor 1
RangeConvFactor 0.268
Vel2Divisor 20
MaxVelocity 1600
TransAccel 300
HasMoveCommand true
SwitchToBaudRate 38400
GyroScaler 1.626
SonarNum 2
SonarUnit 0 69 136 90
SonarUnit 1 114 119 50
FrontBumpers true
NumFrontBumpers 5
"""
SCENARIO = """description = "one of each"
firmware = "dodge"
world = "room"
robot = "p2dx"
mode = "adapter"
body = "kinematic"
seed = 4
duration_s = 12.5
threshold_m = 0.6
start = { x_m = 0.5, y_m = -0.5, heading_deg = 45 }
[direct]
step_mm_s = 50
ramp_mm_s2 = 300
sensor_period_ms = 20
encoder_period_ms = 10
bit_order = "comm1_msb"
[adapter]
core = "model"
step_mm_s = 40.5
motor_meaning = "wheels"
max_velocity_mm_s = 150
max_rotation_deg_s = 60
encoder_at_open = "zero"
[controller]
name = "Rosie"
sonar_per_sip = "all"
errors = "my.errors"
flash = "my.flash"
[in_world.ramp]
threshold_m = 0.4
duration_s = 20
start = { x_m = 0.5, y_m = 0.1 }
[[obstacle]]
at_s = 1.0
name = "held"
shape = "cylinder"
radius_m = 0.02
height_m = 0.5
before_sonar = 3
distance_m = 0.4
hold_s = 0.15
[[obstacle]]
at_s = 0.5
name = "thing"
x_m = 1
y_m = 2
heading_deg = 10
length_m = 0.3
width_m = 0.2
height_m = 0.4
mass_kg = 2
friction = 0.4
[[obstacle]]
at_s = 2
op = "move"
name = "thing"
x_m = 1
y_m = 1
[[obstacle]]
at_s = 3
op = "remove"
name = "thing"
[[obstacle]]
at_s = 4
name = "walker"
length_m = 0.3
width_m = 0.2
height_m = 0.4
path_m = [[1, 1], [1.5, 1]]
speed_mps = 0.2
repeat = "once"
[[fault]]
at_s = 5.0
fault = "sonar-stuck 3 1.2"
for_s = 2.0
[[fault]]
at_s = 6
fault = "reboot"
[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m = 1.0
distance_m_a_minute = 2
[[goal]]
kind = "cells"
least = 3
[[goal]]
kind = "motor_sequence"
values = [[1, 1], [0, 0]]
held_s = 0.5
[[goal]]
kind = "usart_contains"
text = "on"
[[goal]]
kind = "usart_in_order"
texts = ["a", "b"]
[[goal]]
kind = "encoder_counts_match"
steps = 1
"""


def _own(*seeds: Seed) -> Callable[[], list[Seed]]:
    return lambda: list(seeds)


def _stl() -> Seed:
    corners = [(3, 3, 0), (4, 3, 0), (3, 3, 1), (3, 4, 0), (4, 3, 0), (3, 3, 1)]
    rows = [struct.pack("<12fH", 0, 0, 1, *(v for c in corners[at : at + 3] for v in c), 0) for at in (0, 3)]
    return Seed("seed.stl", bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows))


def _gltf() -> dict[str, object]:
    """Return a tent, shown twice, and a strip within a node; its bytes are `_gltf_bytes`."""
    view = {"buffer": 0, "byteOffset": 0, "byteLength": 48, "byteStride": 12}
    return {
        "asset": {"version": "2.0", "generator": "by hand"}, "scene": 0, "scenes": [{"nodes": [0, 3]}],
        "nodes": [
            {"name": "base", "translation": [2, 0, -2], "rotation": [0, 0.7071068, 0, 0.7071068], "children": [1, 2]},
            {"mesh": 0, "scale": [2, 1, 1]}, {"mesh": 1, "camera": 0},
            {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -2, 0, 2, 1]},
        ],
        "meshes": [
            {"name": "tent", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]},
            {"primitives": [{"mode": 5, "attributes": {"POSITION": 0}}, {"mode": 1, "attributes": {"POSITION": 0}}]},
        ],
        "materials": [{}], "cameras": [{"type": "orthographic"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [view, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [{"byteLength": 72}],
    }  # fmt: skip


def _gltf_bytes() -> bytes:
    return struct.pack("<12f12H", *(0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0), *(0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3))


def _gltf_text() -> list[Seed]:
    uris = ("part.bin", "data:application/octet-stream;base64," + base64.b64encode(_gltf_bytes()).decode())
    documents = [_gltf() | {"buffers": [{"byteLength": 72, "uri": uri}]} for uri in uris]
    return [Seed("seed.gltf", json.dumps(one, indent=1).encode(), {"part.bin": _gltf_bytes()}) for one in documents]


def _glb() -> Seed:
    text = json.dumps(_gltf()).encode()
    chunks = [(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", _gltf_bytes())]
    body = b"".join(struct.pack("<I", len(data)) + kind + data for kind, data in chunks)
    return Seed("seed.glb", struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def _sessions() -> list[Seed]:
    found = []
    for path in sorted((GOLDEN / "captures").glob("*.jsonl")):
        lines = path.read_text(encoding="utf-8").splitlines()
        found.append(_text("seed.jsonl", "\n".join(lines[:30]) + "\n"))
    return found


def _captured() -> Capture:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.jsonl"
        path.write_bytes(_sessions()[0].data)
        return read_file(path)


def _recordings() -> list[Seed]:
    return [*_sessions(), _text("seed.jsonl", write_recording(_captured()))]


def _pcaps() -> list[Seed]:
    return [Seed("seed.pcap", write_pcap(_captured().chunks)), Seed("seed.pcap", _pcapng())]


def _pcapng() -> bytes:
    """Return a pcapng file: a section, an interface, two packets of our link type."""
    blocks = [
        (0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)),
        (1, struct.pack("<HHIHHBxxxHH", 147, 0, 65535, 9, 1, 9, 0, 0)),
    ]
    for number in range(2):
        data = b"\0\xfa\xfb\x03\0\0\0\0"
        blocks.append((6, struct.pack("<IIIII", 0, 0, number * 1000, len(data), len(data)) + data))
    return b"".join(
        struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12) for kind, body in blocks
    )


def _hexes() -> list[Seed]:
    return [_text("seed.hex", write_hex(_captured())), _text("seed.hex", "00000000: fafb 0300 0000  ......\n")]


def _traces() -> list[Seed]:
    world = load_world("room").to_plain()
    meta = {
        "k": "meta", "scenario": "dodge", "text": "", "mode": "adapter", "body": "kinematic", "seed": 0, "world": world,
        "firmware": "dodge.elf", "firmware_sha256": "00", "duration_s": 2.0, "threshold_m": 0.6, "step_mps": 0.0625,
        "start": {"x": 0.0, "y": 0.0, "heading": 0.0}, "note": "",
        "robot": {"name": "p2dx", "front_m": 0.18, "rear_m": 0.26, "width_m": 0.38, "sonar_cone_rad": 0.5,
                  "sonar": [{"x": 0.1, "y": 0.1, "heading": 1.5}]},
    }  # fmt: skip
    pose = {"x": 0, "y": 0, "z": 0, "h": 0, "p": 0, "l": 0, "r": 0, "la": 0, "ra": 0, "c": 0}
    lines: list[dict[str, object]] = [
        meta,
        {"k": "pin", "net": "motor1_comm1", "v": 0, "t": 0},
        {"k": "pin", "net": "encoder1_s1", "v": 1, "t": 0},
        {"k": "pose", "t": 0, **pose},
        {"k": "usart", "t": 1000, "hex": "6c6566743d31"},
        {"k": "obstacle", "t": 1000, "op": "place", "name": "crate", "shape": "box", "x": 1.0, "y": 1.0, "heading": 0.1,
         "length": 0.5, "width": 0.4, "height": 0.3, "kind": "obstacle", "sonar": 3},
        {"k": "wire", "t": 2000, "dir": "c2r", "hex": "fafb03000000"},
        {"k": "event", "t": 2000, "who": "adapter", "what": "open", "detail": "now"},
        {"k": "sonar", "t": 3000, "mm": [5000, 1200]},
        {"k": "pin", "net": "motor1_comm1", "v": 1, "t": 4000},
        {"k": "pose", "t": 50_000_000, **pose, "x": 1000, "c": 1},
        {"k": "end", "virtual_s": 0.05, "wall_s": 0.1, "real_time_factor": 0.5, "distance_m": 0.001, "collisions": 1,
         "min_clearance_m": 0.2, "trace_sha256": "00", "passed": False, "failures": ["no"], "goals_met": ["yes"],
         "notes": [], "last_blocks": ["0x08000000"]},
    ]  # fmt: skip
    single = "".join(json.dumps(line) + "\n" for line in lines)
    head = {"k": "pins", "t": 0, "v": 1, "nets": ["motor1_comm1", "encoder1_s1"], "levels": "01"}
    block = {"k": "pins", "t": 4000, "n": 3, "d": "AAEG"}
    lines[1:3], lines[10:11] = [head], [block]
    blocks = "".join(json.dumps(line) + "\n" for line in lines if line["k"] != "pin")
    return [_text("trace.jsonl", single), _text("trace.jsonl", blocks)]


_OBJ_BESIDE = {"part.obj": OBJ.encode(), "other.sdf": OTHER_SDF.encode()}
_CONTROLLER_BESIDE = {"my.flash": FLASH.encode(), "my.errors": SENSOR_ERRORS.encode()}


def _worlds() -> list[Seed]:
    return [*_shipped("p2os.pioneer.world.worlds", ".toml"), Seed("seed.toml", WORLD.encode(), _OBJ_BESIDE)]


def _robots() -> list[Seed]:
    own = _text("seed.toml", 'based_on = "p2at"\nsubclass = "mine"\n[sonar]\nfitted = 2\n[body]\nmass_kg = 20.5\n')
    return [Seed("seed.toml", files("p2os.robots").joinpath("p2dx.toml").read_bytes()), own]


def _scenarios() -> list[Seed]:
    shipped = [Seed("seed.toml", _shipped_scenario(name).read_bytes()) for name in known_scenarios()]
    return [*shipped, *[Seed("seed.toml", SCENARIO.encode(), _CONTROLLER_BESIDE)] * 3]


FORMATS: Mapping[str, FileFormat] = {
    "world": FileFormat(_worlds, "toml", use_world),
    "aria-map": FileFormat(_own(_text("seed.map", ARIA_MAP)), "words", use_world),
    "occupancy": FileFormat(_own(_text("seed.yaml", OCCUPANCY, map_pgm=PGM)), "words", use_world),
    "sdf": FileFormat(_own(Seed("seed.sdf", SDF.encode(), _OBJ_BESIDE)), "words", use_world),
    "urdf": FileFormat(_own(Seed("seed.urdf", URDF.encode(), _OBJ_BESIDE)), "words", use_world),
    "obj": FileFormat(_own(_text("seed.obj", OBJ)), "words", use_world),
    "stl": FileFormat(_own(_text("seed.stl", STL_TEXT)), "words", use_world),
    "stl-binary": FileFormat(_own(_stl()), "bytes", use_world),
    "collada": FileFormat(_own(_text("seed.dae", DAE)), "words", use_world),
    "gltf": FileFormat(_gltf_text, "json", use_world),
    "glb": FileFormat(_own(_glb()), "bytes", use_world),
    "fleet": FileFormat(_own(Seed("seed.toml", FLEET.encode(), _CONTROLLER_BESIDE)), "toml", use_fleet),
    "flash": FileFormat(_own(_text("seed.toml", FLASH)), "toml", use_flash),
    "sensor-errors": FileFormat(_own(_text("seed.toml", SENSOR_ERRORS)), "toml", use_sensor_errors),
    "robot": FileFormat(_robots, "toml", use_robot),
    "aria-robot": FileFormat(_own(_text("seed.p", ARIA_ROBOT)), "words", use_robot),
    "scenario": FileFormat(_scenarios, "toml", use_scenario),
    "pinout": FileFormat(lambda: _shipped("adapter_sim", ".toml"), "toml", use_pinout),
    "recording": FileFormat(_recordings, "json", use_capture),
    "pcap": FileFormat(_pcaps, "bytes", use_capture),
    "hex": FileFormat(_hexes, "words", use_capture),
    "trace": FileFormat(_traces, "json", use_trace),
}


# Damage -------------------------------------------------------------------------------------

LONG = "x" * 5000
#: What a value may become, as each syntax writes it.
HOSTILE: Mapping[str, tuple[str, ...]] = {
    "toml": (
        '"text"', "true", "false", "[]", "{}", "[[1]]", "[1, 2]", "{ a = 1 }", "0", "1", "-1", "2", "0.5", "0.9", "nan",
        "inf", "-inf", "1e308", "-1e308", "1e300", "1e30", "1e9", "1e-30", "1e-300", "5e-324", "-0.0",
        "9223372036854775807", "9223372036854775808", "18446744073709551616", "-9223372036854775809",
        "1" + "0" * 400, '""', f'"{LONG}"', '"\\u0000"', '"a\\u0000b"', '"a\\nb"', '"\\u001b[2J"', '"é€😀"', '"../.."',
        '"/"', "1979-05-27", "07:32:00", "[" * 40 + "]" * 40,
    ),
    "json": (
        '"text"', "true", "false", "null", "[]", "{}", "[[1]]", "0", "1", "-1", "0.5", "NaN", "Infinity", "-Infinity",
        "1e308", "-1e308", "1e30", "1e400", "9223372036854775807", "9223372036854775808", "18446744073709551616",
        "1" + "0" * 400, '""', f'"{LONG}"', '"\\u0000"', '"\\ud800"', '"\\n"', '"é"', "[" * 900 + "]" * 900,
    ),
    "words": (
        "text", "true", "nan", "inf", "-inf", "1e308", "-1e308", "1e300", "1e30", "1e9", "1e-30", "5e-324", "0", "-0",
        "1", "-1", "0.9", "9223372036854775808", "18446744073709551616", "1" + "0" * 400, "", " ", LONG, "\0", "a\0b",
        "é€😀", "-", "[]", "{}", "..", "/", "1 2 3 4 5 6 7", "~", "0x10", "1_000", "&amp;", "<a>", '"', "'",
    ),
}  # fmt: skip
#: What counts as a value: strings, numbers and words, or a whole bracketed list after an equals sign.
VALUES: Mapping[str, re.Pattern[str]] = {
    "toml": re.compile(r'(?<==)[^\S\n]*\[[^\n]*\]|"(?:\\.|[^"\\\n])*"|\b(?:true|false)\b|[-+]?\b\d[\d.eE+-]*'),
    "json": re.compile(r'"(?:\\.|[^"\\\n])*"(?!\s*:)|\b(?:true|false|null)\b|-?\b\d[\d.eE+-]*'),
    "words": re.compile(r"[-+]?\b\d[\w.+-]*|[A-Za-z_][\w./#:-]*"),
}
KEYS: Mapping[str, re.Pattern[str]] = {
    "toml": re.compile(r"^\s*([A-Za-z_][\w.-]*)(?=\s*=)|(?<=\[)([a-z_.]+)(?=\])", re.MULTILINE),
    "json": re.compile(r'"(\w+)"(?=\s*:)'),
    "words": re.compile(r"^(\w+)", re.MULTILINE),
}
EXTREME_BYTES = (
    b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\0\0\x80\x7f", b"\0\0\xc0\x7f", b"\x7f\x7f",
    b"\xfa\xfb", b"\0", b"\xff", b"\xef\xbb\xbf",
)  # fmt: skip


def mutated(data: bytes, syntax: str, rng: random.Random) -> bytes:
    """Return a file with one to three hits of damage."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = _hit_bytes(data, rng) if syntax == "bytes" or rng.randrange(20) == 0 else _hit_text(data, syntax, rng)
    return data


def _hit_text(data: bytes, syntax: str, rng: random.Random) -> bytes:
    text = data.decode("utf-8", "surrogateescape")
    kind = rng.choices(("value", "key", "line", "head"), (14, 3, 3, 1))[0]
    if kind == "value":
        places = list(VALUES[syntax].finditer(text))
        if places:
            place = rng.choice(places)
            text = text[: place.start()] + " " * (syntax == "toml") + rng.choice(HOSTILE[syntax]) + text[place.end() :]
    elif kind == "key":
        places = list(KEYS[syntax].finditer(text))
        if places:
            place = rng.choice(places)
            word = place[0]
            other = rng.choice(
                (word[:-1], word + "x", rng.choice(places)[0], word.upper(), '""' if syntax == "toml" else "")
            )
            text = text[: place.start()] + other + text[place.end() :]
    elif kind == "line":
        lines = text.splitlines(keepends=True) or [""]
        at = rng.randrange(len(lines))
        match rng.randrange(5):
            case 0:
                del lines[at]
            case 1:
                lines.insert(at, lines[at])
            case 2:
                lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
            case 3:
                del lines[at:]
            case _:
                lines.insert(rng.randrange(len(lines) + 1), lines.pop(at))
        text = "".join(lines)
    else:
        text = "\ufeff" + text
    return text.encode("utf-8", "surrogateescape")


def _hit_bytes(data: bytes, rng: random.Random) -> bytes:
    work = bytearray(data)
    at = rng.randrange(len(work) + 1)
    match rng.randrange(6):
        case 0 if at < len(work):
            work[at] ^= 1 << rng.randrange(8)
        case 1:
            del work[at : at + rng.choice((1, 4, 64))]
        case 2:
            del work[at:]
        case 3:
            work[at:at] = work[at : at + rng.choice((1, 4, 64))]
        case _:
            extreme = rng.choice(EXTREME_BYTES)
            at -= at % len(extreme)
            work[at : at + len(extreme)] = extreme
    return bytes(work)


# Cases --------------------------------------------------------------------------------------


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Interrupt what takes more processor time; Python code alone, an engine in C ends its call first."""

    def ring(_number: int, _frame: FrameType | None) -> None:
        raise CaseTimeoutError

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def run_case(name: str, seed: Seed, data: bytes, folder: Path, rng: random.Random) -> bool:
    """Read one file; tell whether it was accepted.

    Raises:
        CaseFailedError: It ended in another way than by being read or refused.
    """
    path = folder / seed.name
    path.write_bytes(data)
    try:
        with limited(LIMIT_S):
            FORMATS[name].use(path, rng)
    except P2osError as error:
        told = str(error)
        if "\n" in told or len(told) > LONGEST_MESSAGE or not told.isprintable():
            raise CaseFailedError(f"a refusal that is no single line: {told[:200]!r}") from error
        if not any(file in told for file in (str(folder), seed.name, *seed.beside)):
            raise CaseFailedError(f"a refusal that names no file: {told!r}") from error
        return False
    except CaseTimeoutError as error:
        raise CaseFailedError(f"not done within {LIMIT_S:g} s of processor time") from error
    except Exception as error:
        raise CaseFailedError(f"{type(error).__name__}: {error}") from error
    return True


def fuzz(name: str, cases: int, seed: int, *, keep: Path | None = None) -> list[str]:
    """Run cases of a format; return what failed, one line each.

    Args:
        name: One of `FORMATS`.
        cases: How many.
        seed: Decides them; case N of a seed is the same whatever `cases` is.
        keep: A folder for the files that failed; None keeps none.
    """
    form, failures = FORMATS[name], []
    begun = form.seeds()
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        for file, data in {file: data for one in begun for file, data in one.beside.items()}.items():
            (folder / file).write_bytes(data)
        for number in range(cases):
            rng = random.Random(f"{name} {seed} {number}")
            one = rng.choice(begun)
            data = mutated(one.data, form.syntax, rng)
            try:
                run_case(name, one, data, folder, rng)
            except CaseFailedError as error:
                failures.append(f"{name}: case {number} of seed {seed}: {error}")
                if keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{name}-{seed}-{number}-{one.name}").write_bytes(data)
                    trace = "".join(traceback.format_exception(error))
                    (keep / f"{name}-{seed}-{number}.txt").write_text(trace, encoding="utf-8", errors="replace")
    return failures


def main() -> None:
    """Run what the command line asks for; exit code 1 where a case failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--format", choices=FORMATS, action="append", help="which; default: every one")
    parser.add_argument("--cases", type=int, default=300, help="of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="a folder for the files that fail")
    arguments = parser.parse_args()
    failed = 0
    for name in arguments.format or FORMATS:
        failures = fuzz(name, arguments.cases, arguments.seed, keep=arguments.keep)
        failed += len(failures)
        for line in failures:
            print(line)
        print(f"{name}: {arguments.cases} cases, {len(failures)} failed", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
