"""A node over zenoh, against a session of zenoh alone: keys, tokens, attachments as rmw_zenoh describes them."""

import contextlib
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from p2os.errors import TransportError
from p2os.ros.topics import SERVICES, TOPICS
from p2os.ros.transport import DEPTH, NodeOptions, RosTransport, Topic
from p2os.ros.transports import open_transport
from p2os.ros.zenoh_node import ZenohNode

zenoh = pytest.importorskip("zenoh", reason="the extra ros is not installed")
#: A bound on every wait; reached only when something is broken.
LIMIT_S = 60.0
TWIST_HASH = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
INT_HASH = "RIHS01_b6578ded3c58c626cfe8d1a6fb6e04f706f97e9f03d2727c9ff4e74b1cef0deb"
NAMES = NodeOptions(namespace="/r1")


@pytest.fixture
def place() -> str:
    """An address on loopback where nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{free.getsockname()[1]}"


@pytest.fixture
def node(place: str) -> Iterator[RosTransport]:
    options = NodeOptions(namespace="/r1", domain=7, interface=place, is_router=True)
    with contextlib.closing(open_transport("zenoh", options)) as opened:
        yield opened


@pytest.fixture
def peer(node: RosTransport, place: str) -> Iterator[Any]:
    config = zenoh.Config()
    for key, value in (
        ("mode", "client"), ("connect/endpoints", [f"tcp/{place}"]), ("scouting/multicast/enabled", False)
    ):  # fmt: skip
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


def wait_for(is_so: Callable[[], Any]) -> bool:
    ends = time.monotonic() + LIMIT_S
    while not (so := is_so()) and time.monotonic() < ends:
        time.sleep(0.01)
    return bool(so)


def tokens(peer: Any) -> list[list[str]]:
    return sorted(str(reply.ok.key_expr).split("/") for reply in peer.liveliness().get("@ros2_lv/**"))


def test_a_message_has_its_key_its_bytes_and_an_attachment_that_counts(node: RosTransport, peer: Any) -> None:
    arrived: list[Any] = []
    subscriber = peer.declare_subscriber("**", arrived.append)
    odd = Topic("/r1/encoder_left", "std_msgs/msg/Int32")

    def publish() -> bool:
        node.publish(odd, {"data": 5})
        return len(arrived) >= 2

    before = time.time_ns()
    assert wait_for(publish)
    subscriber.undeclare()
    first, second = arrived[:2]
    assert str(first.key_expr) == f"7/r1/encoder_left/std_msgs::msg::dds_::Int32_/{INT_HASH}"
    assert first.payload.to_bytes() == bytes.fromhex("0001000005000000")
    rows = [struct.unpack("<qqB16s", item.attachment.to_bytes()) for item in (first, second)]
    assert rows[1][0] == rows[0][0] + 1 >= 2
    assert all(before <= stamp <= time.time_ns() for _, stamp, _, _ in rows)
    assert [size for _, _, size, _ in rows] == [16, 16]
    assert rows[0][3] == rows[1][3] != bytes(16)


def test_liveliness_tokens_tell_the_node_and_each_endpoint(node: RosTransport, peer: Any) -> None:
    node.announce(TOPICS["odom"].topic(NAMES))
    node.announce(TOPICS["robot_description"].topic(NAMES))
    node.subscribe(TOPICS["cmd_vel"].topic(NAMES))
    assert wait_for(lambda: len(tokens(peer)) == 4)
    found = {parts[5]: parts for parts in tokens(peer) if "%r1%robot_description" not in parts}
    session = found["NN"][2]
    assert 0 < int(session, 16) < 1 << 128  # without leading zeros
    assert found["NN"] == ["@ros2_lv", "7", session, "0", "0", "NN", "%", "%r1", "p2os"]
    assert found["MP"][:4] + found["MP"][5:11] == [
        "@ros2_lv", "7", session, "0", "MP", "%", "%r1", "p2os", "%r1%odom", "nav_msgs::msg::dds_::Odometry_",
    ]  # fmt: skip
    assert found["MP"][12] == "::,10:,:,:,,"
    assert found["MS"][9:] == ["%r1%cmd_vel", "geometry_msgs::msg::dds_::Twist_", TWIST_HASH, "::,10:,:,:,,"]
    (latched,) = [parts for parts in tokens(peer) if "%r1%robot_description" in parts]
    assert latched[12] == ":1:,1:,:,:,,"
    assert len({parts[4] for parts in tokens(peer)}) == 4


def test_a_speed_of_a_raw_peer_arrives_and_damaged_bytes_are_counted(node: RosTransport, peer: Any) -> None:
    topic = TOPICS["cmd_vel"].topic(NAMES)
    node.subscribe(topic)
    key = f"7/r1/cmd_vel/geometry_msgs::msg::dds_::Twist_/{TWIST_HASH}"
    whole = b"\0\1\0\0" + struct.pack("<6d", 0.2, 0, 0, 0, 0, -0.5)
    found: list[Any] = []

    def sent() -> list[Any]:
        peer.put(key, whole[:20])
        peer.put(key, whole)
        found.extend(node.take(0.05))
        return found

    assert wait_for(sent)
    assert found[0].topic == topic
    assert found[0].message["linear"] == {"x": 0.2, "y": 0.0, "z": 0.0}
    assert found[0].message["angular"]["z"] == -0.5
    assert node.damaged >= 1


def test_who_comes_late_gets_what_is_latched(node: RosTransport, peer: Any) -> None:
    from zenoh import ext

    latched = Topic("/r1/kept", "std_msgs/msg/Int32", is_latched=True)
    node.publish(latched, {"data": 1})
    node.publish(latched, {"data": 2})
    arrived: list[Any] = []
    history = ext.HistoryConfig(detect_late_publishers=True)
    subscriber = ext.declare_advanced_subscriber(peer, f"7/r1/kept/*/{INT_HASH}", arrived.append, history=history)
    assert wait_for(lambda: arrived)
    assert arrived[0].payload.to_bytes()[4:] == struct.pack("<i", 2)
    subscriber.undeclare()


def test_a_service_is_called_by_its_key_and_answered_with_the_number_of_the_call(node: RosTransport, peer: Any) -> None:
    service = SERVICES["enable_motors"].topic(NAMES)
    assert node.serve(service)
    hash_ = "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"
    key = f"7/r1/enable_motors/std_srvs::srv::dds_::SetBool_/{hash_}"
    assert wait_for(lambda: [parts for parts in tokens(peer) if parts[5] == "SS" and parts[9] == "%r1%enable_motors"])
    answers: list[Any] = []
    attached = struct.pack("<qqB16s", 41, time.time_ns(), 16, bytes(range(16)))
    peer.get(key, answers.append, payload=b"\0\1\0\0\1", attachment=attached)
    found: list[Any] = []
    assert wait_for(lambda: found.extend(node.take(0.05)) or found)
    assert found[0].message == {"data": True}
    found[0].reply({"success": True, "message": "on"})
    assert wait_for(lambda: answers)
    assert answers[0].ok.payload.to_bytes() == b"\0\1\0\0" + b"\1\0\0\0" + b"\3\0\0\0on\0"
    number, _, _, name = struct.unpack("<qqB16s", answers[0].ok.attachment.to_bytes())
    assert (number, name) == (41, bytes(range(16)))


def test_a_look_takes_no_more_than_a_topic_keeps_however_fast_messages_come(node: RosTransport) -> None:
    assert isinstance(node, ZenohNode)
    topic, looks = TOPICS["cmd_vel"].topic(NAMES), []

    def more() -> SimpleNamespace:  # for ever
        looks.append(1)
        assert len(looks) < 100 * DEPTH, "there is no end"
        return SimpleNamespace(payload=zenoh.ZBytes(bytes((0, 1, 0, 0)) + struct.pack("<6d", *[len(looks)] * 6)))

    node.subscribe(topic)
    node._subscribers[topic] = SimpleNamespace(handler=SimpleNamespace(try_recv=more))  # type: ignore[assignment]
    speeds = [item.message["linear"]["x"] for item in node.take(5.0)]  # type: ignore[index]  # of a message
    assert speeds == list(range(1, DEPTH + 1))


def test_of_more_messages_than_a_topic_keeps_the_newest_are_taken(node: RosTransport, peer: Any) -> None:
    topic = Topic("/r1/x", "std_msgs/msg/Int32")
    node.subscribe(topic)
    key = f"7/r1/x/std_msgs::msg::dds_::Int32_/{INT_HASH}"
    found: list[Any] = []

    def send(value: int) -> None:
        peer.put(key, bytes((0, 1, 0, 0)) + struct.pack("<i", value), congestion_control=zenoh.CongestionControl.BLOCK)

    def heard() -> list[Any]:
        send(-1)
        found.extend(node.take(0.05))
        return found

    assert wait_for(heard)
    last = Topic("/r1/last", "std_msgs/msg/Int32")
    node.subscribe(last)
    for value in range(100 * DEPTH):
        send(value)
    assert isinstance(node, ZenohNode)
    ring, taken = node._subscribers.pop(topic), []  # looked at when all is there
    # What the line has no room for is waited with: dropped, as zenoh does else, the newest would be others. And all
    # go one way, so when the last has come so have those before it.
    last_key = key.replace("/x/", "/last/")
    empty = bytes((0, 1, 0, 0)) + bytes(4)
    block = zenoh.CongestionControl.BLOCK
    assert wait_for(lambda: peer.put(last_key, empty, congestion_control=block) or node.take(0.05))
    while (sample := ring.handler.try_recv()) is not None:
        taken.append(struct.unpack("<i", sample.payload.to_bytes()[4:])[0])
    assert taken == list(range(100 * DEPTH - DEPTH, 100 * DEPTH))


def test_a_waiting_node_is_woken_by_another_thread(node: RosTransport) -> None:
    taker = threading.Thread(target=node.take, args=(4 * LIMIT_S,))
    taker.start()
    node.wake()
    taker.join(LIMIT_S)
    assert not taker.is_alive()


def test_a_port_that_another_router_has_is_refused_in_one_line(node: RosTransport, place: str) -> None:
    with pytest.raises(TransportError, match="zenoh cannot be the router on tcp/127"):
        open_transport("zenoh", NodeOptions(interface=place, is_router=True))
