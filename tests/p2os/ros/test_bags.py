"""Bags, written here and read by others, written by others and read here, and broken ones."""

import contextlib
import sqlite3
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip("rosbags", reason="the extra ros is not installed")

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from p2os.ros.bags import STORAGES, BagFile, is_bag, read_bag
from p2os.ros.message_table import message_type
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, Topic
from simbase.errors import FileError, MissingDependencyError, UsageError
from tests.p2os.ros.spoken_types import SPOKEN

INT, ODOMETRY = "std_msgs/msg/Int32", "nav_msgs/msg/Odometry"
PLAIN = Topic("/encoder_left", INT)
LATCHED = TOPICS["robot_description"].topic(NodeOptions())
STRING = "std_msgs/msg/String"
STANDARD = [name for name in SPOKEN if "/srv/" not in name and "rmw" not in name]


@pytest.fixture(params=STORAGES)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "bag"
    with BagFile(path, request.param) as file:
        for number in range(5):
            file.write(PLAIN, {"data": number - 2}, 1000 * number)
        file.write(LATCHED, {"data": "<robot/>"}, 5000)
    assert file.count == 6
    return path


def file_of(bag: Path) -> Path:
    (found,) = (path for path in bag.iterdir() if path.suffix != ".yaml")
    return found


@pytest.mark.parametrize("storage", STORAGES)
def test_definitions_are_read_by_others_as_the_types_with_their_hashes(tmp_path: Path, storage: str) -> None:
    with BagFile(tmp_path / "bag", storage) as file:
        for number, name in enumerate(STANDARD):
            file.write(Topic(f"/of_{number}", name), {}, 0)
    with Reader(tmp_path / "bag") as reader:
        assert {connection.msgtype for connection in reader.connections} == set(STANDARD)
        for connection in reader.connections:
            name = connection.msgtype
            store = get_typestore(Stores.EMPTY)
            store.register(get_types_from_msg(connection.msgdef.data, name))
            assert store.hash_rihs01(name) == connection.digest == message_type(name).hash, name


def test_what_is_written_comes_back_in_order_from_the_folder_and_from_its_one_file(bag: Path) -> None:
    for path in (bag, file_of(bag)):
        assert is_bag(path)
        found = list(read_bag(path, frozenset({INT, STRING})))
        assert [(one.topic, one.at_ns, one.message["data"]) for one in found] == [
            *(("/encoder_left", 1000 * number, number - 2) for number in range(5)),
            ("/robot_description", 5000, "<robot/>"),
        ]  # fmt: skip
    assert list(read_bag(bag, frozenset({ODOMETRY}))) == []


def test_sqlite_alone_reads_the_tables_that_ros_has(tmp_path: Path) -> None:
    with BagFile(tmp_path / "bag", "sqlite3") as file:
        file.write(PLAIN, {"data": -2}, 7)
    with sqlite3.connect(file_of(tmp_path / "bag")) as tables:
        assert tables.execute("SELECT name, type, serialization_format FROM topics").fetchall() == [
            ("/encoder_left", INT, "cdr")
        ]
        rows = tables.execute("SELECT timestamp, data FROM messages").fetchall()
    tables.close()
    assert rows == [(7, bytes((0, 1, 0, 0)) + (-2).to_bytes(4, "little", signed=True))]


def test_another_reader_of_mcap_finds_cdr_with_ros_definitions(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    with BagFile(tmp_path / "bag", "mcap") as file:
        file.write(PLAIN, {"data": 3}, 7)
    with file_of(tmp_path / "bag").open("rb") as stream:
        ((schema, channel, message),) = reader.make_reader(stream).iter_messages()
    assert (schema.name, schema.encoding, schema.data.decode().strip()) == (INT, "ros2msg", "int32 data")
    assert (channel.topic, channel.message_encoding, message.log_time) == ("/encoder_left", "cdr", 7)
    assert message.data[4:] == (3).to_bytes(4, "little")


def test_a_bag_that_is_played_is_latched_where_the_node_is(bag: Path) -> None:
    with Reader(bag) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles[0] for one in reader.connections}  # type: ignore[union-attr]
    assert offered["/robot_description"].durability.name == "TRANSIENT_LOCAL"
    assert offered["/encoder_left"].durability.name == "VOLATILE"
    assert offered["/encoder_left"].depth == 10


def test_nothing_is_overwritten_and_no_other_storage_is_taken(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="is there already"):
        BagFile(bag, "mcap")
    with pytest.raises(UsageError, match="no storage 'csv'"):
        BagFile(tmp_path / "other", "csv")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)  # 9 ms each
@given(st.data())
def test_a_damaged_bag_is_read_or_refused_in_one_line(bag: Path, data: st.DataObject) -> None:
    whole = file_of(bag).read_bytes()
    place = data.draw(st.integers(0, len(whole) - 1))
    cut = data.draw(st.sampled_from((place, len(whole))))
    broken = bytearray(whole[:cut])
    if cut > place:
        broken[place] ^= data.draw(st.integers(1, 255))
    path = bag.parent / f"broken{file_of(bag).suffix}"
    path.write_bytes(broken)
    with contextlib.suppress(FileError):  # whose line `shown` makes; anything else is a bug
        list(read_bag(path, frozenset({INT, STRING})))


@pytest.mark.parametrize("name", ["none.mcap", "text.mcap", "text.db3", "text.bag"])
def test_what_is_no_bag_is_one_line(name: str, tmp_path: Path) -> None:
    if name.startswith("text"):
        (tmp_path / name).write_text("no bag\n" * 50)
    with pytest.raises(FileError, match="is no bag that can be read"):
        list(read_bag(tmp_path / name, frozenset({INT})))


def test_without_the_library_the_line_says_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    calls: list[Any] = [lambda: BagFile(tmp_path / "a", "mcap"), lambda: list(read_bag(tmp_path, frozenset()))]
    for call in calls:
        with pytest.raises(MissingDependencyError, match="bags need rosbags"):
            call()
