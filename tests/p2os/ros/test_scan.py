"""The simulated laser as LaserScan: whole sweeps only, seen from its own frame."""

import math
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.cli.robots.ros import NodeLoop
from p2os.client import Robot
from p2os.client.notices import PacketArrived
from p2os.client.observer import Observer
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.devices.laser import LASERS, LaserModel
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.packets import SimLaserPacket
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from p2os.ros.frames import Frames
from p2os.ros.robot_messages import Scans
from p2os.ros.robot_node import RobotNode
from p2os.ros.transport import Received
from p2os.transport.virtual_clock import VirtualClock
from p2os.transport.wall_clock import wall_clock
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.ros.test_node_loop import OPTIONS, Client, Network

P2DX = load_parameters("p2dx")
LASER = LaserModel(start_deg=-90, end_deg=90, step_cdeg=300, range_m=8.0)
READINGS = 61
LIMIT_NS = 15 * NS_PER_S


def packets(cuts: list[int], ranges_mm: list[int]) -> list[SimLaserPacket]:
    ends = [*sorted(cuts), len(ranges_mm)]
    return [
        SimLaserPacket(total=len(ranges_mm), first=first, ranges_mm=tuple(ranges_mm[first:end]))
        for first, end in zip([0, *ends], ends, strict=False)
    ]


@given(st.lists(st.integers(1, READINGS - 1), unique=True), st.data())
def test_a_sweep_is_a_scan_with_its_last_packet_and_one_with_a_gap_is_none(
    cuts: list[int], data: st.DataObject
) -> None:
    sweep = packets(cuts, list(range(1000, 1000 + READINGS)))
    scans = Scans(LASER, Frames(P2DX))
    *early, last = (scans.take(packet, 5) for packet in sweep)
    assert early == [None] * (len(sweep) - 1)
    assert last is not None
    assert last["ranges"] == [mm / 1000 for mm in range(1000, 1000 + READINGS)]
    lost = data.draw(st.integers(0, len(sweep) - 1))
    left = [packet for number, packet in enumerate(sweep) if number != lost]
    assert [scans.take(packet, 6) for packet in left] == [None] * len(left)
    assert [one is not None for one in (scans.take(packet, 7) for packet in sweep)][-1]


def test_a_scan_has_the_stamp_of_its_first_ray() -> None:
    first, second, last = packets([20, 40], [1000] * READINGS)
    scans = Scans(LASER, Frames(P2DX))
    for packet, stamp in ((first, 5), (second, 6)):
        assert scans.take(packet, stamp) is None
    scan: Any = scans.take(last, 7)
    assert scan["header"]["stamp"] == {"sec": 0, "nanosec": 5}


def test_a_scan_has_the_stamp_of_when_it_came_however_late_it_is_handed_on() -> None:
    """Else it is newer than the odometry of its own cycle, and tf2 has no transform for it yet."""
    client, network = LateClient(), Network()
    node = RobotNode(P2DX, OPTIONS, deadman_ns=NS_PER_S, laser=LASER)
    loop = NodeLoop(client, network, node)  # type: ignore[arg-type]  # stand-ins
    loop.run(iter([False, True]).__next__)
    came = wall_clock() - 40 * NS_PER_MS
    client.tell(PacketArrived(packets([], [1000] * READINGS)[0], came))
    client.tell(Observer(P2DX).take(StandardSip(), came))
    loop.turn()
    scan, odometry = (nanoseconds(network.newest(name)) for name in ("/scan", "/odom"))
    assert abs(scan - odometry) < 5 * NS_PER_MS
    assert time.time_ns() - scan >= 40 * NS_PER_MS


def nanoseconds(message: Any) -> int:
    stamp = message["header"]["stamp"]
    return stamp["sec"] * NS_PER_S + stamp["nanosec"]


class LateClient(Client):
    """Keeps what listens, after the loop has ended too, and is sent what the laser is asked."""

    def send(self, number: int, argument: int) -> None:
        self.asked.append((number, argument))


def test_a_sweep_of_another_length_is_none() -> None:
    scans = Scans(LASER, Frames(P2DX))
    assert scans.take(SimLaserPacket(total=3, first=0, ranges_mm=(1, 2, 3)), 0) is None
    assert scans.take(SimLaserPacket(total=READINGS, first=0, ranges_mm=tuple(range(READINGS + 1))), 0) is None


@pytest.mark.parametrize(
    ("mm", "metres"), [(7999, 7.999), (8000, math.inf), (65535, math.inf), (10, 0.01), (9, -math.inf), (0, -math.inf)]
)
def test_a_range_is_infinite_from_the_longest_on_and_below_the_nearest(mm: int, metres: float) -> None:
    scan = Scans(LASER, Frames(P2DX)).take(packets([], [mm] * READINGS)[0], 0)
    assert scan is not None
    assert scan["ranges"] == [metres] * READINGS


@pytest.mark.parametrize(("cycle_ns", "seconds"), [(100 * NS_PER_MS, 0.1), (50 * NS_PER_MS, 0.05)])
def test_a_scan_says_how_near_it_sees_and_how_often_one_comes(cycle_ns: int, seconds: float) -> None:
    for laser in LASERS.values():
        scan = Scans(laser, Frames(P2DX), cycle_ns).take(packets([], [1000] * laser.readings)[0], 0)
        assert scan is not None
        assert (scan["scan_time"], scan["time_increment"]) == (seconds, 0)
        assert 0 < scan["range_min"] == laser.nearest_m < scan["range_max"]  # type: ignore[operator]  # a message


def test_the_lasers_of_aria_span_their_fields() -> None:
    for laser in LASERS.values():
        scan = Scans(laser, Frames(P2DX, "r1/")).take(packets([], [1000] * laser.readings)[0], 2)
        assert scan is not None
        assert math.degrees(scan["angle_min"]) == pytest.approx(laser.start_deg)  # type: ignore[arg-type]  # a message
        assert math.degrees(scan["angle_max"]) == pytest.approx(laser.end_deg)  # type: ignore[arg-type]
        assert scan["header"] == {"stamp": {"sec": 0, "nanosec": 2}, "frame_id": "r1/laser"}


class Waiting(Network):
    """Nothing comes in, in a while."""

    clock: VirtualClock

    def take(self, timeout_s: float) -> list[Received]:
        self.clock.sleep(timeout_s)
        return []


def served(settings: ControllerSettings, until: set[str]) -> Network:
    """Run a node that asks for the laser against a served robot until it has published these, or to the limit."""
    network, clock = Waiting(), VirtualClock()
    network.clock = clock
    with (
        served_pioneer(world="room", body="kinematic", settings=settings, clock=clock) as url,
        Robot(url, clock=clock) as robot,
    ):
        node = RobotNode(robot.parameters, OPTIONS, deadman_ns=NS_PER_S, laser=LASER)
        NodeLoop(robot, network, node).run(
            lambda: until <= {topic.name for topic, _ in network.published} or clock() >= LIMIT_NS
        )
    return network


def named(network: Network, name: str) -> list[Any]:
    return [message for topic, message in network.published if topic.name == name]


def test_a_simulators_laser_is_switched_on_and_seen_from_where_it_stands() -> None:
    network = served(ControllerSettings(laser=LASERS["lms2xx"]), {"/scan", "/sonar_0"})
    scan = named(network, "/scan")[-1]
    assert len(scan["ranges"]) == READINGS
    # The first sonar looks straight to the left, as the last ray does: both see the room's wall.
    (fixed,) = named(network, "/tf_static")
    places = {one["child_frame_id"]: one["transform"]["translation"] for one in fixed["transforms"]}
    left_m = named(network, "/sonar_0")[-1]["range"] + places["sonar_0"]["y"]
    assert scan["ranges"][-1] + places["laser"]["y"] == pytest.approx(left_m, abs=0.1)


def test_a_robot_without_a_laser_is_a_node_without_scans() -> None:
    network = served(ControllerSettings(), {"/odom", "/sonar_7"})
    assert named(network, "/odom")
    assert named(network, "/scan") == []
