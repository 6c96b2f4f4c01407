"""Events as messages for Foxglove: in MCAP files and over its WebSocket, read back by readers that share no code."""

import asyncio
import contextlib
import json
import math
import struct
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.cli.main import run as p2os
from p2os.errors import P2osError
from robot_bench import Bench
from robot_bench.events.kinds import MICRO, Contact, Packet, PinEdge, Pose, Ranges, Text, Verdict, WorldChange
from robot_bench.recording.run_record import read_events, read_meta
from robot_bench.recording.scene_messages import ERROR, INFO, SceneMessages
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError

MCAP_MAGIC = b"\x89MCAP0\r\n"
META: dict[str, object] = {
    "world": {"obstacles": [
        {
            "name": "post", "kind": "obstacle", "shape": "cylinder", "x": 1.0, "y": 2.0, "heading": 0.0, "height": 0.6,
            "radius": 0.1,
        },
        {
            "name": "wall", "kind": "wall", "shape": "box", "x": 0.0, "y": 3.0, "heading": 0.5, "height": 1.0,
            "length": 4.0, "width": 0.1,
        },
    ]},
    "robot": {
        "front_m": 0.18, "rear_m": 0.26, "width_m": 0.38, "sonar_cone_rad": 0.5,
        "sonar": [[0.07, 0.13, 1.57], [0.1, 0.0, 0.0]],
    },
}  # fmt: skip


def records(data: bytes) -> list[tuple[int, bytes]]:
    """Return the records of an MCAP file, chunks opened; by the specification of mcap.dev."""
    assert data.startswith(MCAP_MAGIC)
    assert data.endswith(MCAP_MAGIC)
    place, found = len(MCAP_MAGIC), list[tuple[int, bytes]]()
    inner = data[: -len(MCAP_MAGIC)]
    while place < len(inner):
        kind, size = inner[place], int.from_bytes(inner[place + 1 : place + 9], "little")
        body = inner[place + 9 : place + 9 + size]
        if kind == 6:  # a chunk: times, size, crc, compression, then records
            compression = int.from_bytes(body[28:32], "little")
            assert compression == 0
            chunk, at = body[40:], 0
            while at < len(chunk):
                length = int.from_bytes(chunk[at + 1 : at + 9], "little")
                found.append((chunk[at], chunk[at + 9 : at + 9 + length]))
                at += 9 + length
        else:
            found.append((kind, body))
        place += 9 + size
    return found


def text_at(body: bytes, place: int) -> tuple[str, int]:
    size = int.from_bytes(body[place : place + 4], "little")
    return body[place + 4 : place + 4 + size].decode(), place + 4 + size


def messages_of(path: Path) -> dict[str, list[tuple[int, str, dict[str, Any]]]]:
    """Return topic → (time, schema's name, message), in the file's order."""
    schemas, channels = dict[int, str](), dict[int, tuple[str, str]]()
    found: dict[str, list[tuple[int, str, dict[str, Any]]]] = {}
    for kind, body in records(path.read_bytes()):
        number = int.from_bytes(body[:2], "little")
        if kind == 3:
            schemas[number] = text_at(body, 2)[0]
        elif kind == 4:
            channels[number] = text_at(body, 4)[0], schemas[int.from_bytes(body[2:4], "little")]
        elif kind == 5:
            topic, schema = channels[number]
            at = int.from_bytes(body[6:14], "little")
            found.setdefault(topic, []).append((at, schema, json.loads(body[22:])))
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "one"
    assert p2os(["run", "sensors", "--body", "kinematic", "--duration", "8s", "--out", str(folder)]) == 0
    return folder


def test_a_run_as_mcap_holds_scene_motion_pins_text_and_the_very_bytes_of_the_line(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.mcap"
    assert p2os(["report", str(run), "--events", str(out)]) == 0
    found = messages_of(out)
    events = list(read_events(run))
    packets = [event for event in events if isinstance(event, Packet)]
    reported = [bytes.fromhex(message["hex"]) for _, _, message in found["/wire"]]
    assert reported == [packet.data for packet in packets]
    assert [at for at, _, _ in found["/wire"]] == [packet.t for packet in packets]
    poses = [event for event in events if isinstance(event, Pose)]
    assert [message["translation"]["x"] for _, _, message in found["/tf"]] == [pose.x / MICRO for pose in poses]
    assert {schema for _, schema, _ in found["/tf"]} == {"foxglove.FrameTransform"}
    assert [message["message"] for _, _, message in found["/usart1"]][:2] == ["sensors: ready", "sensor 1 on"]
    first, *later = found["/scene"]
    assert {entity["id"] for entity in first[2]["entities"]} >= {"crate", "robot"}
    assert any(entity["id"] == "post 1" for _, _, message in later for entity in message["entities"])
    assert any(gone["id"] == "post 1" for _, _, message in later for gone in message["deletions"])
    edges = [event for event in events if isinstance(event, PinEdge) and event.wire == "DD1"]
    assert [message["level"] for _, _, message in found["/pins/DD1"]] == [int(edge.level) for edge in edges]


def one(meta: dict[str, object], event: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(message.topic, dict(message.data)) for message in SceneMessages(meta).of(event)]


def test_things_stand_on_the_floor_with_their_shape_and_size() -> None:
    (message,) = SceneMessages(META).anew(5)
    post, wall, hull = cast("list[Any]", message.data["entities"])
    assert post["cylinders"][0]["size"] == {"x": 0.2, "y": 0.2, "z": 0.6}
    assert post["cylinders"][0]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 0.3}
    assert wall["cubes"][0]["size"] == {"x": 4.0, "y": 0.1, "z": 1.0}
    assert hull["frame_id"] == "base_link"
    assert hull["frame_locked"]
    assert hull["cubes"][0]["size"]["x"] == pytest.approx(0.44)
    assert hull["cubes"][0]["pose"]["position"]["x"] == pytest.approx(-0.04)


def test_a_thing_that_moves_keeps_its_shape_and_one_that_is_gone_is_not_told_anew() -> None:
    messages = SceneMessages(META)
    moved = WorldChange(t=7, op="move", name="post", fields={"x": 4.0, "y": 5.0, "heading": 0.0})
    (message,) = messages.of(moved)
    assert message.data["entities"][0]["cylinders"][0]["pose"]["position"] == {"x": 4.0, "y": 5.0, "z": 0.3}  # type: ignore[index]
    (message,) = messages.of(WorldChange(t=8, op="remove", name="post"))
    assert message.data["deletions"] == [{"timestamp": {"sec": 0, "nsec": 8}, "type": 0, "id": "post"}]
    (message,) = messages.anew(9)
    assert [entity["id"] for entity in message.data["entities"]] == ["wall", "robot"]  # type: ignore[attr-defined]


def test_each_sonar_is_a_fan_from_its_own_place() -> None:
    found = one(META, Ranges(t=1, mm=(500, 4000)))
    assert [topic for topic, _ in found] == ["/sonar/1", "/sonar/2"]
    scan = found[0][1]
    assert scan["pose"]["position"] == {"x": 0.07, "y": 0.13, "z": 0.2}
    assert (scan["start_angle"], scan["end_angle"], set(scan["ranges"])) == (-0.25, 0.25, {0.5})


def test_what_went_wrong_is_an_error_of_the_log_and_the_rest_is_not() -> None:
    hit = Contact(t=1, what="'post'", x_m=0.0, y_m=0.0, part="front")
    assert one(META, hit)[0][1]["level"] == ERROR
    assert one(META, Verdict(t=1, goal="g", met=False, says=""))[0][1]["level"] == ERROR
    assert one(META, Verdict(t=1, goal="g", met=True, says=""))[0][1]["level"] == INFO
    assert one(META, Text(t=1, data=b"caf\xff\r\n"))[0][1]["message"] == "caf\ufffd"


@given(st.integers(-3_000_000, 3_000_000), st.integers(-300_000, 300_000))
def test_a_transform_turns_the_robot_as_its_pose_says(heading: int, pitch: int) -> None:
    pose = Pose(
        t=0, x=0, y=0, z=0, heading=heading, pitch=pitch, left=0, right=0, left_angle=0, right_angle=0, collisions=0
    )
    turn = one(META, pose)[0][1]["rotation"]
    x, y, z, w = (turn[axis] for axis in "xyzw")
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    ahead = 1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx(heading / MICRO, abs=1e-9)
    assert math.asin(ahead[2]) == pytest.approx(pitch / MICRO, abs=1e-9)


def test_fields_are_those_of_foxgloves_own_schemas(run: Path) -> None:
    library = pytest.importorskip("foxglove.messages")
    messages = SceneMessages(read_meta(run))
    every = [*messages.anew(0), *(message for event in read_events(run) for message in messages.of(event))]
    nested = {
        "translation": "Vector3", "rotation": "Quaternion", "position": "Vector3", "orientation": "Quaternion",
        "pose": "Pose", "size": "Vector3", "color": "Color",
        "entities": "SceneEntity", "deletions": "SceneEntityDeletion",
        "cubes": "CubePrimitive", "cylinders": "CylinderPrimitive", "poses": "Pose",
    }  # fmt: skip
    seen = set()

    def check(name: str, value: dict[str, Any]) -> None:
        allowed = {
            word.partition("=")[0].strip(" *,(") for word in getattr(library, name).__text_signature__[1:-1].split(", ")
        }
        assert set(value) <= allowed, name
        seen.add(name)
        for field, inner in value.items():
            for item in inner if isinstance(inner, list) else [inner]:
                if field in nested and isinstance(item, dict):
                    check(nested[field], item)

    for message in every:
        if message.schema.startswith("foxglove."):
            check(message.schema.removeprefix("foxglove."), dict(message.data))
    assert seen >= {"SceneUpdate", "SceneEntity", "FrameTransform", "PosesInFrame", "LaserScan", "Log", "CubePrimitive"}


def test_a_pitch_is_positive_uphill() -> None:
    pytest.importorskip("pybullet")
    bench = Bench.from_scenario("motors", body="bullet", world="ramp")
    bench.run_until("9.6 s")
    poses = [pose for pose in bench.record().poses if abs(pose.pitch) > 20_000]
    climbing = [b.z - a.z for a, b in pairwise(poses) if b.left > 0 and b.right > 0]
    assert climbing
    assert all((rise > 0) is (poses[0].pitch > 0) for rise in climbing if rise)


def looked_on(url: str, found: dict[str, list[dict[str, Any]]], subprotocols: list[str]) -> None:
    """Subscribe to all topics until the server goes."""
    websockets = pytest.importorskip("websockets")

    async def look() -> None:
        async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"]) as line:
            subprotocols.append(line.subprotocol)
            topics: dict[int, str] = {}
            async for message in line:
                if isinstance(message, str):
                    reported = json.loads(message)
                    if reported["op"] == "advertise":
                        topics |= {channel["id"]: channel["topic"] for channel in reported["channels"]}
                        wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in reported["channels"]]
                        await line.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
                elif message[0] == 1:
                    (number,) = struct.unpack("<I", message[1:5])
                    found.setdefault(topics[number], []).append(json.loads(message[13:]))

    with contextlib.suppress(websockets.ConnectionClosed, OSError):
        asyncio.run(asyncio.wait_for(look(), 60))


def test_a_viewer_of_a_running_bench_gets_the_scene_and_changes_nothing(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    from robot_bench.live import live_scene

    scenario = load_scenario("sensors").with_options(body="kinematic", duration_s=2.0)  # ranges are heard from 0.7 s on
    found: dict[str, list[dict[str, Any]]] = {}
    subprotocols: list[str] = []
    urls: list[str] = []
    with live_scene(scenario, "127.0.0.1:0", urls.append) as driver:
        viewer = threading.Thread(target=looked_on, args=(urls[0], found, subprotocols))
        viewer.start()
        while viewer.is_alive() and not subprotocols:
            time.sleep(0.02)
        seen = run_scenario(scenario, tmp_path / "seen", drive=driver, speed=2.0)
    viewer.join(60)
    alone = run_scenario(scenario, tmp_path / "alone")
    assert seen.outcome["trace_sha256"] == alone.outcome["trace_sha256"]
    assert subprotocols == ["foxglove.sdk.v1"]
    assert {"/scene", "/tf", "/wire", "/pins/p2dx_con", "/sonar/1"} <= found.keys()
    assert any(entity["id"] == "robot" for message in found["/scene"] for entity in message["entities"])


@pytest.mark.parametrize("place", ["x", "70000", "127.0.0.1:", ":x"])
def test_a_place_that_is_none_is_refused(place: str) -> None:
    from robot_bench.live import live_scene

    with (
        pytest.raises(UsageError, match="--foxglove takes PORT or HOST:PORT"),
        live_scene(load_scenario("motors"), place, print),
    ):
        pass


def test_a_taken_port_is_reported_in_a_line() -> None:
    pytest.importorskip("foxglove")
    from robot_bench.live import LiveScene

    first = LiveScene({}, port=0)
    try:
        with pytest.raises(P2osError, match="cannot serve at"):
            LiveScene({}, port=int(first.url.rpartition(":")[2]))
    finally:
        first.close()
