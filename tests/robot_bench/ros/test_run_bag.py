"""A run as a bag has what happened: the true motion, pins, prints, and the bytes of the P2OS line."""

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rosbags", reason="the extra ros is not installed")

from p2os.cli.main import run as p2os
from p2os.ros.bags import BagMessage, read_bag
from robot_bench.bench import Bench
from robot_bench.events.codec import Json
from robot_bench.events.kinds import Event, Note, Packet, PinEdge, Pose, Text, Verdict
from robot_bench.ros.run_bag import ERROR, INFO, RunMessages, write_bag
from robot_bench.run import meta_of
from robot_bench.scenario.scenario import Scenario, load_scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS
from tests.p2os.ros.spoken_types import SPOKEN
from tests.robot_bench.ros.test_bench_node import Script, ran, scenario

TYPES = frozenset(SPOKEN)
META = {"robot": {"name": "p2dx"}}


def happened(made: Scenario) -> tuple[list[Event], Json]:
    """Run a scenario; return what happened, and the first entry that its trace would have."""
    seen: list[Event] = []
    bench = Bench(made)
    bench.events.subscribe(seen.append)
    bench.run_until(made.duration_ns)
    return seen, meta_of(made, bench.parts.world, None, is_at_port=False)


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> list[BagMessage]:
    folder = tmp_path_factory.mktemp("run") / "bag"
    seen, meta = happened(scenario(mode="adapter", lasts_s=0.8))
    write_bag(seen, folder, meta, "sqlite3")
    return list(read_bag(folder, TYPES)) + [
        BagMessage("event", type(event).__name__, event.t, {"event": event}) for event in seen
    ]


def of(bag: list[BagMessage], topic: str) -> list[tuple[int, Any]]:
    return [(one.at_ns, one.message) for one in bag if one.topic == topic]


def events(bag: list[BagMessage], kind: type[Event]) -> list[Any]:
    return [message["event"] for _, message in of(bag, "event") if isinstance(message["event"], kind)]


def test_the_bytes_of_the_line_are_found_again(bag: list[BagMessage]) -> None:
    packets = events(bag, Packet)
    assert {packet.direction for packet in packets} == {"c2r", "r2c"}
    for topic, direction in (("/p2os/from_client", "c2r"), ("/p2os/from_robot", "r2c")):
        told = [(at, bytes(message["data"])) for at, message in of(bag, topic)]
        assert told == [(packet.t, packet.data) for packet in packets if packet.direction == direction]


def test_odometry_is_the_true_pose_with_its_time(bag: list[BagMessage]) -> None:
    told = [
        (at, message["header"]["stamp"]["nanosec"], message["pose"]["pose"]["position"]["x"])
        for at, message in of(bag, "/odom")
    ]
    assert told == [(pose.t, pose.t, pose.x_m) for pose in events(bag, Pose)]


def test_prints_and_notes_are_in_rosout(bag: list[BagMessage]) -> None:
    told = [(message["name"], message["msg"]) for _, message in of(bag, "/rosout")]
    for text in events(bag, Text):
        assert (text.port, text.data.decode().rstrip("\r\n")) in told
    assert len(told) == sum(len(events(bag, kind)) for kind in (Text, Note, Verdict))


def test_a_goal_that_was_missed_is_an_error(tmp_path: Path) -> None:
    verdicts = [Verdict(t=1, goal=f"{met}", met=met, says="") for met in (True, False)]
    assert write_bag(verdicts, tmp_path / "bag", META, "mcap") > 2
    told = [message["level"] for _, message in of(list(read_bag(tmp_path / "bag", TYPES)), "/rosout")]
    assert told == [INFO, ERROR]


def test_a_bag_holds_what_a_node_of_the_same_run_publishes() -> None:
    made, network = scenario(lasts_s=0.3), Script()
    seen, meta = happened(made)
    ran(made, network)
    ours = [one for _, one in RunMessages(meta).of(seen) if one[0].name != "/rosout"]
    for name in ("/clock", "/motor_left", "/distance_sensor_4", "/encoder_right", "/odom", "/tf", "/sonar_3"):
        live = [message for topic, message in network.published if topic.name == name]
        told = [message for topic, message in ours if topic.name == name]
        # The bag ends with the last event, a pose each 50 ms; the node's clock goes on until the end.
        assert 0 < len(told) > len(live) - 6
        assert told == live[: len(told)]


def test_a_level_counts_from_its_own_nanosecond() -> None:
    step = 10 * NS_PER_MS
    edges = [PinEdge(t=step, wire="DD1", level=True), PinEdge(t=2 * step + 1, wire="DD1", level=False)]
    told = {
        at: message["data"]
        for at, (topic, message) in RunMessages(META).of(edges)
        if topic.name == "/distance_sensor_1"
    }
    assert told == {step: 1, 3 * step: 0}


def test_a_robot_on_own_pins_is_refused(tmp_path: Path) -> None:
    made = load_scenario("rover")
    meta = meta_of(made, None, None, is_at_port=False)
    with pytest.raises(UsageError, match="a bag is of one Pioneer"):
        write_bag([], tmp_path / "bag", meta, "mcap")
    assert not (tmp_path / "bag").exists()


def test_a_run_folder_is_written_as_a_bag_by_a_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "trace.jsonl").write_text('{"k":"meta","scenario":"s","trace":2,"robot":{"name":"p2dx"}}\n')
    words = ["report", f"{tmp_path}", "--events", f"{tmp_path}/bag", "--ros2", "mcap"]
    assert p2os(words) == 0
    told = list(read_bag(tmp_path / "bag", TYPES))
    assert capsys.readouterr().out == f"{tmp_path}/bag: {len(told)} messages\n"
    assert p2os(words) == 2
    assert "is there already" in capsys.readouterr().err


def test_a_storage_needs_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["report", f"{tmp_path}", "--ros2", "mcap"]) == 2
    assert "--ros2 goes with --events FOLDER" in capsys.readouterr().err
