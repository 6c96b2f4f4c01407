"""A node over DDS, against peers of cyclonedds alone."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="the extra ros is not installed")

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import Policy
from cyclonedds.domain import DomainParticipant

from p2os.cli.robots.ros import NodeLoop
from p2os.client import Robot, RobotState
from p2os.errors import TransportError
from p2os.pioneer.serve import served_pioneer
from p2os.ros.codec import Message, struct_of
from p2os.ros.dds import configuration
from p2os.ros.message_table import message_type
from p2os.ros.robot_node import RobotNode
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, RosTransport, Topic
from p2os.ros.transports import open_transport
from simbase.timing import NS_PER_MS

PEER = Path(__file__).with_name("raw_peer.py")
DEADMAN_NS = 300 * NS_PER_MS
LIMIT_S = 15.0
INT = "std_msgs/msg/Int32"


@pytest.fixture
def options(domain: int, namespace: str) -> NodeOptions:
    return NodeOptions(domain=domain, namespace=namespace)


@pytest.fixture
def network(options: NodeOptions) -> Iterator[RosTransport]:
    with contextlib.closing(open_transport("dds", options)) as opened:
        yield opened


@contextlib.contextmanager
def running(loop: NodeLoop) -> Iterator[None]:
    """Run a node's loop in a thread, no longer than the limit."""
    ends, is_left = time.monotonic() + LIMIT_S, threading.Event()
    thread = threading.Thread(target=loop.run, args=(lambda: is_left.is_set() or time.monotonic() >= ends,))
    thread.start()
    try:
        yield
    finally:
        is_left.set()
        thread.join()


@contextlib.contextmanager
def peer(options: NodeOptions) -> Iterator[tuple["subprocess.Popen[str]", list[dict[str, Any]]]]:
    """Start the raw peer, and yield it and the lines that it prints as they come."""
    words = [sys.executable, str(PEER), str(options.domain), options.namespace]
    heard: list[dict[str, Any]] = []
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env={"PATH": os.environ["PATH"]}) as process:
        assert process.stdout is not None
        listener = threading.Thread(target=lambda: heard.extend(map(json.loads, process.stdout or ())))
        listener.start()
        try:
            yield process, heard
        finally:
            process.kill()
            listener.join()


def wait_for(is_so: Callable[[], bool]) -> bool:
    ends = time.monotonic() + LIMIT_S
    while not is_so() and time.monotonic() < ends:
        time.sleep(0.01)
    return is_so()


def test_a_peer_of_its_own_types_drives_the_robot_and_the_robot_stops_when_that_peer_is_killed(
    network: RosTransport, options: NodeOptions
) -> None:
    with served_pioneer(world="room", body="kinematic") as url, Robot(url, deadman_s=5.0) as robot:
        loop = NodeLoop(robot, network, RobotNode(robot.parameters, options, deadman_ns=DEADMAN_NS))
        newest: list[RobotState] = []
        robot.on_state(newest.append)
        with running(loop), peer(options) as (process, heard):
            assert wait_for(lambda: any(line.get("mps", 0) > 0.15 for line in heard))
            assert wait_for(lambda: any("range_m" in line for line in heard))
            process.kill()
            assert wait_for(lambda: newest[-1].forward_mps == 0)
    odometry = [line for line in heard if "x_m" in line]
    ranges = [line for line in heard if "range_m" in line]
    start = options.namespace.strip("/")
    assert odometry[0]["frame"] == f"{start}/odom"
    assert odometry[0]["child"] == f"{start}/base_link"
    assert newest[-1].pose.x_m >= odometry[-1]["x_m"] > odometry[0]["x_m"]
    assert 0.5 < ranges[-1]["range_m"] < ranges[-1]["most_m"] == 5.0


def test_names_types_and_hashes_are_found_by_discovery_as_ros_writes_them(
    network: RosTransport, options: NodeOptions
) -> None:
    network.announce(TOPICS["odom"].topic(NodeOptions()))
    network.announce(TOPICS["robot_description"].topic(NodeOptions()))
    network.subscribe(TOPICS["cmd_vel"].topic(NodeOptions()))
    network.subscribe(TOPICS["cmd_vel_stamped"].topic(NodeOptions()))
    watcher = DomainParticipant(options.domain)
    found: dict[tuple[str, str], Any] = {}

    def look(kind: Any) -> None:
        for sample in BuiltinDataReader(watcher, kind).take(200):
            found[sample.topic_name, sample.type_name] = sample.qos

    assert wait_for(lambda: look(BuiltinTopicDcpsPublication) or ("rt/odom", "nav_msgs::msg::dds_::Odometry_") in found)
    look(BuiltinTopicDcpsSubscription)
    odom = found["rt/odom", "nav_msgs::msg::dds_::Odometry_"]
    assert odom[Policy.Userdata].data == f"typehash={message_type('nav_msgs/msg/Odometry').hash};".encode()
    assert odom[Policy.Durability] == Policy.Durability.Volatile
    latched = found["rt/robot_description", "std_msgs::msg::dds_::String_"]
    assert latched[Policy.Durability] == Policy.Durability.TransientLocal
    assert ("rt/cmd_vel", "geometry_msgs::msg::dds_::Twist_") in found
    assert ("rt/cmd_vel", "geometry_msgs::msg::dds_::TwistStamped_") in found
    assert ("ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_") in found


def test_the_node_tells_its_name_and_which_endpoints_are_its_own(network: RosTransport, options: NodeOptions) -> None:
    from p2os.ros.dds import DISCOVERY, DdsNode

    assert isinstance(network, DdsNode)
    network.announce(Topic(options.topic("one"), INT))
    network.subscribe(Topic(options.topic("two"), INT))
    found: list[Message] = []
    late = Topic("/late", DISCOVERY.type, is_latched=True)
    reader = _reader_named(network, DISCOVERY.name, late)
    assert wait_for(lambda: bool(found.extend(network._taken(late, reader)) or found))
    (node,) = found[-1]["node_entities_info_seq"]  # type: ignore[misc]  # of a message
    assert (node["node_name"], node["node_namespace"]) == ("p2os", options.namespace)
    assert [len(node[key]) for key in ("reader_gid_seq", "writer_gid_seq")] == [1, 1]


def _reader_named(network: Any, name: str, topic: Topic) -> Any:
    from cyclonedds.sub import DataReader

    return DataReader(network._participant, network._topic(topic, name), qos=network._qos(topic))


def test_who_comes_late_gets_what_is_latched_and_nothing_else(network: RosTransport, options: NodeOptions) -> None:
    latched, plain = Topic(options.topic("kept"), INT, is_latched=True), Topic(options.topic("gone"), INT)
    for value in (1, 2):
        network.publish(latched, {"data": value})
        network.publish(plain, {"data": value})
    network.subscribe(latched)
    network.subscribe(plain)
    assert [(item.topic, item.message) for item in network.take(5.0)] == [(latched, {"data": 2})]


def test_garbage_at_the_ports_of_the_domain_is_ignored_without_a_word(
    network: RosTransport, options: NodeOptions, capfd: pytest.CaptureFixture[str]
) -> None:
    random, whole = Random(21), Topic(options.topic("whole"), INT, is_latched=True)
    network.subscribe(whole)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        for number in range(3000):
            # A header of RTPS and a sub-message of whatever kind and length, or nothing of the sort.
            head = b"RTPS\x02\x03\x01\x10" + random.randbytes(12) if number % 3 else b""
            first = 7410 + 250 * options.domain
            line.sendto(head + random.randbytes(random.randrange(120)), ("127.0.0.1", first + random.randrange(12)))
    network.publish(whole, {"data": 7})
    found: list[Any] = []
    assert wait_for(lambda: bool(found.extend(network.take(0.1)) or found))
    assert (found[0].message, network.damaged) == ({"data": 7}, 0)
    assert capfd.readouterr() == ("", "")


def test_a_message_with_no_text_in_its_text_is_counted_and_the_next_one_is_taken(
    network: RosTransport, options: NodeOptions, capfd: pytest.CaptureFixture[str]
) -> None:
    # Wrong lengths do not come so far: Cyclone DDS drops what is not of the type's form, on both sides.
    from p2os.ros.dds import DdsNode

    assert isinstance(network, DdsNode)
    topic = TOPICS["cmd_vel_stamped"].topic(options)
    network.subscribe(topic)
    network.announce(topic)
    # Encapsulation, stamp, a frame of two bytes that are no UTF-8, six numbers.
    data = bytes((0, 1, 0, 0)) + bytes(8) + b"\x02\x00\x00\x00\xff\x00" + bytes(50)
    broken = struct_of(topic.type, {})
    broken.serialize = lambda *_, **__: data  # type: ignore[method-assign]  # of this one
    network._writers[topic].write(broken)
    network.publish(topic, {})
    found: list[Any] = []
    assert wait_for(lambda: bool(found.extend(network.take(0.1)) or found))
    assert (len(found), network.damaged) == (1, 1)
    assert capfd.readouterr() == ("", "")


def test_a_waiting_node_is_woken_by_another_thread(network: RosTransport) -> None:
    taker = threading.Thread(target=network.take, args=(4 * LIMIT_S,))
    taker.start()
    network.wake()
    taker.join(LIMIT_S)
    assert not taker.is_alive()


def test_discovery_stays_on_loopback_unless_a_network_is_named() -> None:
    assert '<NetworkInterface address="127.0.0.1"/>' in configuration(NodeOptions().interface)
    assert "<AllowMulticast>false</AllowMulticast>" in configuration("127.0.0.1")
    assert "AllowMulticast" not in configuration("192.168.1.5")
    assert '<NetworkInterface name="eth0"/>' in configuration("eth0")


def test_a_network_that_this_machine_has_not_is_refused_in_one_line(domain: int) -> None:
    with pytest.raises(TransportError, match=r"no DDS on 198\.51\.100\.1"):
        open_transport("dds", NodeOptions(domain=domain + 100, interface="198.51.100.1"))
