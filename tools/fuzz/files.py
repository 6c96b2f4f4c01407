"""Fuzzing of every file that users hand in: a hostile file is read, or refused in one line that names it.

    python -m tools.fuzz.files                            a few hundred cases of every format
    python -m tools.fuzz.files --format world --cases 10000 --seed 7

Each case takes a file that is right and damages it: a value becomes one of another type or an
extreme number, a key is dropped, doubled or misspelt, a line is cut, bytes are turned. What is
accepted is then used: a world gets a robot, a scenario's script is played, a trace is reported on.
Allowed are success and the project's own errors; anything else, a second line or more than
`LIMIT_S` of processor time is a failure, and the file is kept for a look.
"""

import argparse
import json
import random
import re
import signal
import struct
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
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
from p2os.pioneer.controller.flash import DEFAULTS, load_flash
from p2os.pioneer.sensor_errors import REALISTIC, load_sensor_errors
from p2os.pioneer.serve.fleet_file import load_fleet
from p2os.pioneer.serve.fleet_order import make_fleet
from p2os.pioneer.world import load_world
from p2os.pioneer.world.file import IMPORT_KEYS, MARK_KEYS, MESH_KEYS, SHAPES, START_KEYS, TOP_KEYS
from p2os.pioneer.world.model import World
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.toml_schema import Key
from robot_bench.events.codec import events_of
from robot_bench.recording.run_record import read_run
from robot_bench.recording.summary import outcome_of
from robot_bench.report.drawn import drawn_of
from robot_bench.report.run_page import render_run
from robot_bench.scenario.goals.judging import judge
from robot_bench.scenario.loading import known_scenarios, read_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.tables import TABLES
from robot_bench.scenario.world_script import WorldScript
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS
from tests.p2os.pioneer.serve.test_fleet_orders import FULL
from tests.p2os.pioneer.world import test_importers_gltf as gltf
from tests.p2os.pioneer.world import test_importers_maps as maps
from tests.p2os.pioneer.world import test_importers_meshes as meshes
from tests.p2os.pioneer.world import test_importers_odd as odd
from tests.p2os.pioneer.world import test_importers_xml as xml
from tests.p2os.robots.test_robot_files import MINE

ROOT = Path(__file__).resolve().parents[2]
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
    if len(order.robots) <= 4:
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
    drawn_of(record)
    render_run(record)
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


#: Of a scenario, what its settings are not: things that come and go, faults, goals.
SCRIPT = """[[obstacle]]
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


def _rows(keys: Iterable[Key], **given: object) -> str:
    """Return a line for each key that is no table: what is given, its default, its first choice, or 1 and the like."""
    plain: Mapping[str, object] = {"flag": False, "number": 1.0, "whole": 1}
    found = {}
    for key in keys:
        if key.kind not in {"table", "tables"}:
            first = key.choices[0] if key.choices else plain.get(key.kind)
            found[key.name] = given.get(key.name, first if key.default in (None, "") else key.default)
    # JSON's values are TOML's.
    return "".join(f"{name} = {json.dumps(value)}\n" for name, value in found.items() if value is not None)


def _world() -> str:
    """Return a world with one of each, and every key of it."""
    ends: dict[str, object] = {"from_m": [-5, -5], "to_m": [5, -5], "points_m": [[1, 1]], "path_m": [[-2, -2], [2, -2]]}
    corners: dict[str, object] = {"vertices_m": [[4, 4, 0], [4.5, 4, 0], [4, 4.5, 0], [4, 4, 1]]}
    ends |= corners | {"triangles": [[0, 1, 3], [1, 2, 3], [2, 0, 3]], "file": "part.obj", "rise_m": 0.1}
    ends |= {"heading_deg": 30, "scale": 0.5, "up": "z"}
    tables = {**SHAPES, "mesh": MESH_KEYS, "mark": MARK_KEYS, "import": IMPORT_KEYS}
    shown = "".join(f"[[{name}]]\n" + _rows(keys, **{"name": name, **ends}) for name, keys in tables.items())
    return _rows(TOP_KEYS, name="all", extent_m=[-5, -5, 5, 5]) + "[start]\n" + _rows(START_KEYS) + shown


def _scenario() -> str:
    """Return a scenario with every setting, and a script."""
    top = {"firmware": "dodge", "world": "room", "robot": "p2dx", "duration_s": 12.5, "record": None, "charge": None}
    tables = "".join(f"{name}\n" + _rows(TABLES[name], flash="my.flash", errors="my.errors")
                     for name in ("[start]", "[direct]", "[adapter]", "[controller]"))  # fmt: skip
    return f"{_rows(TABLES[''], **top)}{tables}[in_world.ramp]\n{_rows(TABLES['[in_world.NAME]'])}{SCRIPT}"


def _flash() -> str:
    return "[flash]\n" + "".join(f"{name} = {json.dumps(value)}\n" for name, value in DEFAULTS.items())


def _sensor_errors() -> str:
    tables = asdict(REALISTIC).items()
    rows = ("".join(f"{key} = {value}\n" for key, value in row.items()) for _, row in tables)
    return 'based_on = "realistic"\n' + "".join(f"[{name}]\n{row}" for (name, _), row in zip(tables, rows, strict=True))


def _meshes(ending: str, kind: type[str] | type[bytes], *more: str) -> Callable[[], list[Seed]]:
    """Return the wedges of the importers' tests in one format, as text or as bytes."""
    found = [data for name, data, _ in meshes.CASES.values() if name.endswith(ending) and isinstance(data, kind)]
    return _own(*(Seed(f"seed{ending}", one if isinstance(one, bytes) else one.encode()) for one in (*found, *more)))


#: A wall with a doorway as one polygon, and a mesh whose faces need no counts.
DOORWAY = "".join(f"v {x} 0 {z}\n" for x, z in odd.DOORWAY) + "f 1 2 3 4 5 6 7 8\nl 1 2\n"
TRIANGLES = str(meshes.CASES["a COLLADA with Z up"][1]).replace("polylist", "triangles").replace("vcount", "extra")


def _gltf(uri: str | None) -> gltf.Document:
    """Return a wedge, shown twice, and a strip within a node; its bytes stand at a place."""
    strip = [{"mode": mode, "attributes": {"POSITION": 0}} for mode in (5, 1)]
    return gltf.document(
        scenes=[{"nodes": [0, 3]}], meshes=[*gltf.document()["meshes"], {"primitives": strip}],
        nodes=[
            {"translation": [2, 0, -2], "rotation": [0, 0.7071068, 0, 0.7071068], "children": [1, 2]},
            {"mesh": 0, "scale": [2, 1, 1]}, {"mesh": 1, "camera": 0},
            {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -2, 0, 2, 1]},
        ],
        buffers=[{"byteLength": 72} | ({"uri": uri} if uri else {})],
    )  # fmt: skip


def _gltf_text() -> list[Seed]:
    documents = [_gltf("part.bin"), gltf.document()]
    return [Seed("seed.gltf", json.dumps(one, indent=1).encode(), {"part.bin": gltf.BYTES}) for one in documents]


def _occupancy() -> Seed:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "map.pgm"
        maps.pgm(path, maps.ROOM)
        return _text("seed.yaml", maps.YAML + "mode: trinary\n", map_pgm=path.read_bytes())


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
                  "sonar": [[0.1, 0.1, 1.5]]},
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


_SCENE_BESIDE = {"crate.sdf": xml.CRATE.format(turn=0.5).encode(), "wedge.stl": xml.WEDGE.encode()}
_CONTROLLER_BESIDE = {"my.flash": _flash().encode(), "my.errors": _sensor_errors().encode()}


def _worlds() -> list[Seed]:
    own = _text("seed.toml", _world(), part_obj=_meshes(".obj", str)()[0].data)
    return [*_shipped("p2os.pioneer.world.worlds", ".toml"), own]


def _robots() -> list[Seed]:
    own = _text("seed.toml", 'based_on = "p2at"\nsubclass = "mine"\n[sonar]\nfitted = 2\n[body]\nmass_kg = 20.5\n')
    return [Seed("seed.toml", files("p2os.robots").joinpath("p2dx.toml").read_bytes()), own]


def _scenarios() -> list[Seed]:
    shipped = [Seed("seed.toml", _shipped_scenario(name).read_bytes()) for name in known_scenarios()]
    return [*shipped, *[Seed("seed.toml", _scenario().encode(), _CONTROLLER_BESIDE)] * 3]


FORMATS: Mapping[str, FileFormat] = {
    "world": FileFormat(_worlds, "toml", use_world),
    "aria-map": FileFormat(_own(_text("seed.map", maps.ARIA)), "words", use_world),
    "occupancy": FileFormat(_own(_occupancy()), "words", use_world),
    "sdf": FileFormat(_own(Seed("seed.sdf", xml.SDF.encode(), _SCENE_BESIDE)), "words", use_world),
    "urdf": FileFormat(_own(Seed("seed.urdf", xml.URDF.encode(), _SCENE_BESIDE)), "words", use_world),
    "obj": FileFormat(_meshes(".obj", str, DOORWAY), "words", use_world),
    "stl": FileFormat(_meshes(".stl", str), "words", use_world),
    "stl-binary": FileFormat(_meshes(".stl", bytes), "bytes", use_world),
    "collada": FileFormat(_meshes(".dae", str, TRIANGLES), "words", use_world),
    "gltf": FileFormat(_gltf_text, "json", use_world),
    "glb": FileFormat(_own(Seed("seed.glb", gltf.glb(_gltf(None)))), "bytes", use_world),
    "fleet": FileFormat(_own(_text("seed.toml", FULL, own_toml=_flash().encode())), "toml", use_fleet),
    "flash": FileFormat(_own(_text("seed.toml", _flash())), "toml", use_flash),
    "sensor-errors": FileFormat(_own(_text("seed.toml", _sensor_errors())), "toml", use_sensor_errors),
    "robot-file": FileFormat(_robots, "toml", use_robot),
    "aria-robot": FileFormat(_own(_text("seed.p", MINE)), "words", use_robot),
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
        reported = str(error)
        if "\n" in reported or len(reported) > LONGEST_MESSAGE or not reported.isprintable():
            raise CaseFailedError(f"a refusal that is no single line: {reported[:200]!r}") from error
        if not any(file in reported for file in (str(folder), seed.name, *seed.beside)):
            raise CaseFailedError(f"a refusal that names no file: {reported!r}") from error
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
