"""What a robot's node publishes and takes, without a network."""

import math
from dataclasses import replace
from typing import Any, cast

import pytest

from p2os.client.observer import Bumpers, Observer
from p2os.client.robot_state import RobotPose, RobotState
from p2os.protocol.packets import SimLaserPacket
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.motor_step import STEP_MPS
from p2os.robots.parameters import load_parameters
from p2os.ros.robot_node import MotorPower, Refused, ResetOdometry, RobotNode, Speed, StopRequest
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, Received
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S

P2DX = load_parameters("p2dx")
DEADMAN_NS = 500 * NS_PER_MS
OPTIONS = NodeOptions(namespace="/r1")


@pytest.fixture
def node() -> RobotNode:
    return RobotNode(P2DX, OPTIONS, deadman_ns=DEADMAN_NS, bumpers_fitted=(5, 0))


def asked(key: str, **message: Any) -> Received:
    return Received(TOPICS[key].topic(OPTIONS), message)


def twist(x: float, z: float = 0.0) -> Received:
    return asked("cmd_vel", linear={"x": x, "y": 0.0, "z": 0.0}, angular={"x": 0.0, "y": 0.0, "z": z})


def states(*sips: StandardSip) -> list[RobotState]:
    observer = Observer(P2DX)
    observer.bumpers = Bumpers(5, 0)
    observer.place(RobotPose())
    return [observer.take(sip, number * 100 * NS_PER_MS) for number, sip in enumerate(sips, start=1)]


def published(node: RobotNode, state: RobotState, stamp: int = 7_000_000_008) -> dict[str, Any]:
    return {topic.name: message for topic, message in node.take_state(state, stamp)}


def test_a_speed_is_held_until_one_tick_before_the_deadman_and_stopped_at_it(node: RobotNode) -> None:
    assert node.take_commands([twist(0.3, 0.1)], now=1000) == [Speed(0.3, 0.1)]
    assert node.next_deadline() == 1000 + DEADMAN_NS
    assert node.advance_to(1000 + DEADMAN_NS - 1) == []
    assert node.advance_to(1000 + DEADMAN_NS) == [StopRequest()]
    assert node.next_deadline() is None
    assert node.advance_to(1 << 60) == []


def test_a_scan_of_a_laser_that_the_robot_has_not_makes_nothing(node: RobotNode) -> None:
    assert node.take_packet(SimLaserPacket(total=3, first=0, ranges_mm=(1, 2, 3)), 0) == []
    assert list(node.at_connection()) == []


def test_messages_that_ask_for_no_speed_do_not_put_the_deadman_off(node: RobotNode) -> None:
    node.take_commands([twist(0.3)], now=0)
    others = [asked("reset_odometry"), asked("enable_motors", data=True), twist(math.nan), asked("motor_left", data=9)]
    for at in range(0, DEADMAN_NS, DEADMAN_NS // 10):
        node.take_commands(others, now=at)
    assert node.advance_to(DEADMAN_NS) == [StopRequest()]


def test_of_speeds_that_came_together_the_newest_counts(node: RobotNode) -> None:
    assert node.take_commands([twist(0.1), asked("enable_motors", data=False), twist(0.2)], now=0) == [
        MotorPower(False), Speed(0.2, 0.0),
    ]  # fmt: skip


def test_a_stamped_speed_is_taken_as_a_plain_one(node: RobotNode) -> None:
    plain = twist(0.25, -0.5).message
    assert node.take_commands([asked("cmd_vel_stamped", header={}, twist=plain)], now=0) == [Speed(0.25, -0.5)]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_speed_that_is_no_number_is_refused(node: RobotNode, value: float) -> None:
    assert isinstance(node.take_commands([twist(value)], now=0)[0], Refused)
    assert isinstance(node.take_commands([twist(0.0, value)], now=0)[0], Refused)
    assert node.next_deadline() is None


def test_odometry_is_reset_by_its_topic(node: RobotNode) -> None:
    assert node.take_commands([asked("reset_odometry")], now=0) == [ResetOdometry()]


def test_motor_topics_make_one_speed_of_two_wheels(node: RobotNode) -> None:
    node.take_commands([asked("motor_left", data=2)], now=0)
    speed = cast("Speed", node.take_commands([asked("motor_right", data=-2)], now=1)[0])
    assert speed.forward_mps == 0
    assert speed.turn_radps == pytest.approx(-4 * STEP_MPS / (P2DX.track_mm / 1000))


def test_after_a_stop_a_motor_topic_does_not_bring_the_other_wheel_back(node: RobotNode) -> None:
    node.take_commands([asked("motor_left", data=3), asked("motor_right", data=3)], now=0)
    node.advance_to(DEADMAN_NS)
    speed = cast("Speed", node.take_commands([asked("motor_right", data=1)], now=DEADMAN_NS + 1)[0])
    assert speed.forward_mps == pytest.approx(STEP_MPS / 2)


def test_odometry_is_the_pose_in_odom_and_the_speeds_in_base_link(node: RobotNode) -> None:
    there = StandardSip(raw_x=1000, raw_heading=1024, raw_left_velocity=190, raw_right_velocity=210)
    first, second = states(StandardSip(), there)
    published(node, first)
    odom = published(node, second)["/r1/odom"]
    assert odom["header"] == {"stamp": {"sec": 7, "nanosec": 8}, "frame_id": "r1/odom"}
    assert odom["child_frame_id"] == "r1/base_link"
    assert odom["pose"]["pose"]["position"]["x"] == pytest.approx(0.84)
    assert odom["pose"]["pose"]["orientation"]["z"] == pytest.approx(math.sin(math.pi / 4))
    assert odom["twist"]["twist"]["linear"]["x"] == pytest.approx(0.2)
    assert odom["twist"]["twist"]["angular"]["z"] == pytest.approx(0.02 / 0.357)


def test_the_covariance_is_a_square_of_six_that_grows_with_way_and_turns(node: RobotNode) -> None:
    pair = states(StandardSip(), StandardSip(raw_x=1000, raw_heading=512))
    variances = [published(node, state)["/r1/odom"]["pose"]["covariance"] for state in pair]
    assert [len(one) for one in variances] == [36, 36]
    places = [(row, column) for row in range(6) for column in range(6)]
    assert all(one[row * 6 + column] == one[column * 6 + row] for one in variances for row, column in places)
    # A pose is sent in whole mm and in 4096ths of a turn; a filter that fuses it takes no variance of 0
    # (robot_localization 1cb95337, ros_filter.cpp:2579).
    assert variances[0][0] == variances[0][7] == pytest.approx(1e-6)
    assert variances[0][35] == pytest.approx((math.tau / 4096) ** 2)
    assert variances[1][0] > variances[0][0]
    assert variances[1][35] > variances[0][35]
    assert all(one[14] == one[21] == one[28] == 1e6 for one in variances)


def test_a_range_beyond_the_sonars_reach_is_infinite_and_one_below_it_minus_infinite(node: RobotNode) -> None:
    counts = P2DX.range_conv_mm / 1000
    echoes = ((0, P2DX.sonar_range_m + 0.001), (1, P2DX.sonar_min_range_m - 0.001), (2, 1.0))
    (state,) = states(StandardSip(sonar=tuple(SonarReading(number, round(m / counts)) for number, m in echoes)))
    found = published(node, state)
    assert found["/r1/sonar_0"]["range"] == math.inf
    assert found["/r1/sonar_1"]["range"] == -math.inf
    assert found["/r1/sonar_2"]["range"] == pytest.approx(1.0, abs=counts)
    assert found["/r1/sonar_2"]["header"]["frame_id"] == "r1/sonar_2"
    assert found["/r1/sonar_2"]["max_range"] == P2DX.sonar_range_m
    assert [found[f"/r1/distance_sensor_{number}"]["data"] for number in (1, 2, 3)] == [0, 1, 1]
    assert found["/r1/sonar"]["width"] == 2


def test_only_new_readings_are_published_and_old_echoes_stay_in_the_cloud(node: RobotNode) -> None:
    pair = states(StandardSip(sonar=(SonarReading(0, 4000),)), StandardSip(sonar=(SonarReading(1, 4000),)))
    published(node, pair[0])
    found = published(node, pair[1])
    assert "/r1/sonar_0" not in found
    assert "/r1/sonar_1" in found
    assert found["/r1/sonar"]["width"] == 2


def test_a_sonar_of_the_rear_ring_gets_its_frame_when_it_is_first_heard(node: RobotNode) -> None:
    (state,) = states(StandardSip(sonar=(SonarReading(9, 4000),)))
    children = [one["child_frame_id"] for one in published(node, state)["/tf_static"]["transforms"]]
    assert "r1/sonar_9" in children
    assert "/tf_static" not in published(node, state)


def test_each_frame_of_a_message_has_a_place_in_tf(node: RobotNode) -> None:
    (state,) = states(StandardSip(sonar=tuple(SonarReading(number, 4000) for number in range(8))))
    fixed = dict(node.first(0))[TOPICS["tf_static"].topic(OPTIONS)]
    found = published(node, state)
    tree = {one["child_frame_id"]: one["header"]["frame_id"] for message in (fixed, found["/tf"])
            for one in cast("list[Any]", message["transforms"])}  # fmt: skip
    frames = {message["header"]["frame_id"] for message in found.values() if "header" in message} - {""}
    for leaf in frames:
        frame = leaf
        while frame != "r1/odom":
            frame = tree[frame]


def test_wheels_turn_forward_when_the_robot_drives_and_against_each_other_when_it_turns(node: RobotNode) -> None:
    start, ahead, turned = states(
        StandardSip(), StandardSip(raw_x=1000), StandardSip(raw_x=1000, raw_heading=1024)
    )  # fmt: skip
    published(node, start)
    left, right = published(node, ahead)["/r1/joint_states"]["position"]
    assert left == right == pytest.approx(0.84 / (P2DX.body.wheel_diameter_m / 2))
    after_left, after_right = published(node, turned)["/r1/joint_states"]["position"]
    assert after_right - right == pytest.approx(left - after_left)
    assert after_right - right == pytest.approx(math.pi / 2 * 0.357 / 2 / (P2DX.body.wheel_diameter_m / 2))


def test_a_reset_of_the_odometry_does_not_turn_the_wheels(node: RobotNode) -> None:
    start, ahead, back = states(StandardSip(), StandardSip(raw_x=1000), StandardSip())
    published(node, start)
    before = published(node, ahead)["/r1/joint_states"]["position"]
    node.forget_place()
    assert published(node, back)["/r1/joint_states"]["position"] == before


def test_bumpers_are_reported_where_they_are_fitted(node: RobotNode) -> None:
    (state,) = states(StandardSip(front_bumpers=0b00101, rear_bumpers=1))
    found = published(node, state)
    assert found["/r1/bumper_front"]["data"] == [1, 0, 1, 0, 0]
    assert "/r1/bumper_rear" not in found


@pytest.mark.parametrize(("reported", "share"), [(None, math.nan), (0.0, math.nan), (0.01, 0.01), (1.0, 1.0)])
def test_a_charge_that_nothing_measures_is_not_a_number(node: RobotNode, reported: float | None, share: float) -> None:
    (state,) = states(StandardSip(raw_battery=126))
    found = published(node, replace(state, state_of_charge=reported, temperature_c=31.0))["/r1/battery_state"]
    assert found["percentage"] == pytest.approx(share, nan_ok=True)
    assert (found["voltage"], found["temperature"]) == (12.6, 31.0)
    assert math.isnan(found["current"])


def test_motors_are_told_when_they_change_where_the_robot_reports_them(node: RobotNode) -> None:
    (state,) = states(StandardSip())
    assert "/r1/motors_state" not in published(node, state)
    assert published(node, replace(state, motors_enabled=True))["/r1/motors_state"] == {"data": True}
    assert "/r1/motors_state" not in published(node, replace(state, motors_enabled=True))
    assert published(node, replace(state, motors_enabled=False))["/r1/motors_state"] == {"data": False}


def test_a_compass_that_points_east_is_a_heading_of_zero(node: RobotNode) -> None:
    (state,) = states(StandardSip(raw_compass=45))
    assert published(node, state)["/r1/imu"]["orientation"]["z"] == pytest.approx(0.0)
    assert published(node, state)["/r1/imu"]["angular_velocity_covariance"][0] == -1


def test_health_says_when_the_link_is_lost_and_a_wheel_is_stalled(node: RobotNode) -> None:
    (state,) = states(StandardSip(stall_left=True))
    _, message = node.tell_health(state, NS_PER_S, "link lost: silence", is_open=False, counts={"damaged": 3})
    link, wheels, _ = cast("list[dict[str, Any]]", message["status"])
    assert (link["level"], link["message"]) == (2, "link lost: silence")
    assert link["values"] == [{"key": "damaged", "value": "3"}]
    assert (wheels["level"], wheels["message"]) == (1, "stalled: left")


@pytest.mark.parametrize(
    "bad",
    [{"name": "a b"}, {"name": ""}, {"namespace": "r1"}, {"namespace": "/"}, {"domain": 233}, {"domain": -1},
     {"interface": '"/><x'}],
)  # fmt: skip
def test_options_that_no_network_takes_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        NodeOptions(**bad)


def test_global_names_stay_outside_of_a_namespace() -> None:
    assert TOPICS["tf"].topic(OPTIONS).name == "/tf"
    assert TOPICS["odom"].topic(OPTIONS).name == "/r1/odom"
    assert TOPICS["odom"].topic(NodeOptions()).name == "/odom"
