"""The loop of `p2os ros` between a robot and a network, both made by the test."""

import contextlib
import math
import os
import select
import signal
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pytest

from p2os.cli.robots.ros import HEALTH_NS, LOOK_S, MOST_NEWS, NEWS_OF_A_TURN, NodeLoop, stamp_of
from p2os.client import LinkLostError, Robot
from p2os.client.notices import DeadmanStopped, LinkLost, MotorsDisabledError
from p2os.client.observer import Observer
from p2os.pioneer.serve import served_pioneer
from p2os.pioneer.serve.background_host import ServedPioneer
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from p2os.ros.codec import Message
from p2os.ros.robot_node import RobotNode
from p2os.ros.topics import SERVICES, TOPICS
from p2os.ros.transport import NodeOptions, Received, Topic
from p2os.transport.wall_clock import wall_clock
from simbase.command_line.signals import end_on_signals, restored_signals
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.client.served_robot import until
from tests.tools.forked_python import forked_python

P2DX = load_parameters("p2dx")
OPTIONS = NodeOptions()
PEER = Path(__file__).with_name("raw_peer.py")


@dataclass
class Client:
    """A robot that notes what is asked of it."""

    asked: list[object] = field(default_factory=list)
    error: Exception | None = None
    enable_error: Exception | None = None
    tell: Callable[[Any], None] = lambda _news: None

    def on_state(self, callback: Callable[[Any], None]) -> Callable[[], None]:
        self.tell = callback
        return lambda: None

    on_event = on_state

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        if self.error is not None:
            raise self.error
        self.asked.append((forward_mps, turn_radps))

    def stop(self) -> None:
        self.asked.append("stop")

    def enable(self, on: bool) -> None:
        if self.enable_error is not None:
            raise self.enable_error
        self.asked.append(("enable", on))

    def set_pose(self) -> None:
        self.asked.append("pose")


@dataclass
class Network:
    """A network that has these messages for each look."""

    incoming: list[list[Received]] = field(default_factory=list)
    published: list[tuple[Topic, Message]] = field(default_factory=list)
    waits_s: list[float] = field(default_factory=list)
    served: list[Topic] = field(default_factory=list)
    damaged: int = 3

    def announce(self, topic: Topic) -> None:
        """Nobody is there."""

    subscribe = announce

    def serve(self, service: Topic) -> bool:
        self.served.append(service)
        return True

    def publish(self, topic: Topic, message: Message) -> None:
        self.published.append((topic, message))

    def take(self, timeout_s: float) -> list[Received]:
        self.waits_s.append(timeout_s)
        return self.incoming.pop(0) if self.incoming else []

    def wake(self) -> None:
        """It never waits."""

    def close(self) -> None:
        """Nothing is open."""

    def newest(self, name: str) -> Any:
        return [message for topic, message in self.published if topic.name == name][-1]


def message(key: str, **fields: Any) -> Received:
    return Received(TOPICS[key].topic(OPTIONS), fields)


def twist(x: float) -> Received:
    return message("cmd_vel", linear={"x": x}, angular={"z": 0.0})


def ran(client: Client, network: Network, *, turns: int, deadman_ns: int = NS_PER_S) -> NodeLoop:
    loop = NodeLoop(cast("Robot", client), network, RobotNode(P2DX, OPTIONS, deadman_ns=deadman_ns))
    left = iter(range(turns))
    loop.run(lambda: next(left, None) is None)
    return loop


def test_what_messages_ask_for_is_asked_of_the_robot() -> None:
    client = Client()
    ran(client, Network([[twist(0.2)], [message("enable_motors", data=False), message("reset_odometry")]]), turns=2)
    assert client.asked == [(0.2, 0.0), ("enable", False), "pose"]


def test_the_loop_waits_no_longer_than_the_deadman_and_then_stops_once(capsys: pytest.CaptureFixture[str]) -> None:
    client, network = Client(), Network([[twist(0.2)]])
    ran(client, network, turns=4, deadman_ns=1)
    assert client.asked == [(0.2, 0.0), "stop"]
    assert network.waits_s[:2] == [LOOK_S, 0]
    assert "nobody asked for a speed any more" in capsys.readouterr().err


def test_the_services_of_a_robot_are_offered_before_its_topics() -> None:
    network = Network()
    ran(Client(), network, turns=0)
    assert {one.type for one in network.served} == {"std_srvs/srv/SetBool", "std_srvs/srv/Trigger"}


def test_the_call_of_a_service_is_answered_with_what_became_of_it() -> None:
    client, answers = Client(), list[Message]()
    service = SERVICES["enable_motors"].topic(OPTIONS)
    call = Received(service, {"data": True}, answers.append)
    loop = ran(client, Network([[call]]), turns=1)
    assert client.asked == [("enable", True)]
    client.enable_error = LinkLostError("no robot is connected")
    cast("Network", loop._network).incoming = [[call]]
    loop.turn()
    assert answers == [{"success": True, "message": ""}, {"success": False, "message": "no robot is connected"}]


@pytest.mark.parametrize("error", [LinkLostError("the link was lost"), MotorsDisabledError("motors are disabled")])
def test_a_robot_that_cannot_move_is_no_end_of_the_node(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    client = Client(error=error)
    loop = ran(client, Network([[twist(0.2)], [twist(0.2)], [twist(math.nan)]]), turns=3)
    assert loop.counts == {"commands": 3, "refused": 3, "overrun": 0}
    assert capsys.readouterr().err.count("refused") == 1, "a message that comes 20 times a second is complained of once"


def test_a_lost_link_is_an_error_of_the_diagnostics_until_packets_come_again(monkeypatch: pytest.MonkeyPatch) -> None:
    client, network = Client(), Network()
    loop = NodeLoop(cast("Robot", client), network, RobotNode(P2DX, OPTIONS, deadman_ns=NS_PER_S))
    loop.run(lambda: True)
    clock = iter(range(0, 100 * HEALTH_NS, HEALTH_NS))
    monkeypatch.setattr("p2os.cli.robots.ros.wall_clock", lambda: next(clock))
    client.tell(LinkLost("silence"))
    loop.turn()
    status = network.newest("/diagnostics")["status"][0]
    assert (status["level"], status["message"]) == (2, "link lost: silence")
    assert {"key": "damaged", "value": "3"} in status["values"]
    client.tell(Observer(P2DX).take(StandardSip(), 0))
    loop.turn()
    assert network.newest("/diagnostics")["status"][0]["level"] == 0


def test_a_robot_that_sends_more_than_can_be_published_keeps_neither_the_deadman_nor_an_end_waiting() -> None:
    """A robot, or who has its place, that says all of it again and again: each publication brings the next."""
    client, network = Client(), Network([[twist(0.2)]])
    state = Observer(P2DX).take(StandardSip(), 0)
    publish = network.publish

    def publish_and_hear(topic: Topic, message: Message) -> None:
        publish(topic, message)
        client.tell(state)

    network.publish = publish_and_hear  # type: ignore[method-assign]
    loop = ran(client, network, turns=30, deadman_ns=1)
    assert client.asked == [(0.2, 0.0), "stop"]
    assert set(network.waits_s[1:]) == {0}, "what has come is not waited for"
    assert loop.counts["overrun"] > 0
    client.tell(DeadmanStopped(NS_PER_S))
    assert len(loop._news) == MOST_NEWS + 1, "what is no data is never left out"
    before, network.publish = len(network.published), publish  # type: ignore[method-assign]
    loop.turn()
    assert len([topic for topic, _ in network.published[before:] if topic.name == "/odom"]) == NEWS_OF_A_TURN


def test_after_a_stop_of_the_client_a_motor_topic_starts_from_zero() -> None:
    client = Client()
    network = Network([[message("motor_left", data=3), message("motor_right", data=3)]])
    loop = ran(client, network, turns=1)
    client.tell(DeadmanStopped(NS_PER_S))
    loop.turn()
    network.incoming = [[message("motor_right", data=2)]]
    loop.turn()
    assert client.asked[-1] == (0.0625, pytest.approx(0.125 / 0.357))


def test_a_stamp_is_the_time_since_1970_of_an_instant_of_the_wall_clock() -> None:
    now = wall_clock()
    assert abs(stamp_of(now) - stamp_of(now - 50 * NS_PER_MS) - 50 * NS_PER_MS) < 10 * NS_PER_MS


@pytest.mark.parametrize("name", ["announce", "subscribe", "serve", "take", "publish"])
def test_a_signal_waits_until_a_call_of_the_network_has_returned(name: str) -> None:
    network, returned = Network(), []
    called = getattr(network, name)

    def interrupted(*words: object) -> object:
        if not returned:
            signal.raise_signal(signal.SIGTERM)
        returned.append(called(*words))
        return returned[-1]

    setattr(network, name, interrupted)
    with restored_signals():
        end_on_signals()
        with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
            ran(Client(), network, turns=2)
    assert returned


Node = subprocess.Popen[str]


@contextlib.contextmanager
def node_and_peer(name: str) -> Iterator[tuple[ServedPioneer, Node, subprocess.Popen[bytes]]]:
    """Serve a robot to a node in a process of its own, and drive it by a peer in another."""
    domain, namespace = str(10 + os.getpid() % 80), f"/s{os.getpid()}{name}"
    verb = "EntryPoint('ros', 'p2os.cli.robots.ros', 'p2os.verbs')"
    with served_pioneer(world="room", body="kinematic") as url:
        words = ["ros", str(url), "--domain", domain, "--namespace", namespace, "--for", "20s"]
        code = (
            "from importlib.metadata import EntryPoint; from p2os.cli import main; "
            f"import faulthandler; faulthandler.enable(); main.verbs = lambda: [{verb}]; main.main({words!r})"
        )
        with (
            subprocess.Popen(
                [forked_python(), "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            ) as node,
            subprocess.Popen([forked_python(), str(PEER), domain, namespace], stdout=subprocess.PIPE) as peer,
        ):
            try:
                yield url, node, peer
            finally:
                node.kill()
                peer.kill()


@pytest.mark.slow
def test_a_signal_stops_the_robot_before_the_node_ends() -> None:
    pytest.importorskip("cyclonedds", reason="the extra ros is not installed")
    numbers = (signal.SIGTERM, signal.SIGINT)
    with contextlib.ExitStack() as left:  # both wait for their peers at the same time
        rows = [left.enter_context(node_and_peer(number.name)) for number in numbers]
        for number, (url, node, peer) in zip(numbers, rows, strict=True):
            heard = b""
            while b'"mps": 0.2' not in heard:
                assert peer.stdout is not None
                assert select.select([peer.stdout], [], [], 15.0)[0], "the peer hears nothing"
                heard = peer.stdout.readline()
            node.send_signal(number)
            _, reported = node.communicate(timeout=15)
            assert node.returncode == 130, reported
            assert "the robot was stopped and let go" in reported
            assert "motors off" in " ".join(url.order("status"))
            until(lambda: "wheels 0.000 0.000" in " ".join(url.order("status")), "a stand")  # noqa: B023  # by its ramp
