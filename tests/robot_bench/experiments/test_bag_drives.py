"""Drives out of bags that others wrote: of ROS 2 drivers and of ROS 1's RosAria and p2os_driver."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros is not installed")
pytest.importorskip("scipy", reason="the extra experiments is not installed")

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from p2os.cli.main import run as p2os
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive
from robot_bench.experiments.drive_files import read_drive
from simbase.errors import FileError

P2DX = load_parameters("p2dx")
BEGIN_S = 1_700_000_000
SPEED, TURN, COUNT = 0.2, 0.1, 30


class Robot:
    """Messages of a robot that drives a circle, as the types of a store."""

    def __init__(self, store: Any) -> None:
        self.store, self.types = store, store.types

    def header(self, at_s: float, frame: str = "odom") -> Any:
        names = self.types["std_msgs/msg/Header"].__dataclass_fields__
        stamp = self.types["builtin_interfaces/msg/Time"](sec=BEGIN_S + int(at_s), nanosec=round(at_s % 1 * 1e9))
        return self.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 0} if "seq" in names else {}))

    def twist(self, speed: float = SPEED, turn: float = TURN) -> Any:
        vector = self.types["geometry_msgs/msg/Vector3"]
        return self.types["geometry_msgs/msg/Twist"](linear=vector(speed, 0.0, 0.0), angular=vector(0.0, 0.0, turn))

    def odometry(self, at_s: float, x: float | None = None) -> Any:
        heading, types = TURN * at_s, self.types
        radius = SPEED / TURN
        x = radius * math.sin(heading) if x is None else x
        place = types["geometry_msgs/msg/Point"](x, radius * (1 - math.cos(heading)), 0.0)
        turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2))
        none = np.zeros(36)
        pose = types["geometry_msgs/msg/PoseWithCovariance"](types["geometry_msgs/msg/Pose"](place, turned), none)
        twist = types["geometry_msgs/msg/TwistWithCovariance"](self.twist(), none)
        return types["nav_msgs/msg/Odometry"](self.header(at_s), "base_link", pose, twist)

    def measured(self, at_s: float) -> Any:
        return self.types["geometry_msgs/msg/PoseStamped"](self.header(at_s, "map"), self.odometry(at_s).pose.pose)

    def range(self, at_s: float, metres: float) -> Any:
        return self.types["sensor_msgs/msg/Range"](self.header(at_s, "sonar"), 0, 0.5, 0.1, 5.0, metres, 0.0)

    def points(self, at_s: float, metres: float) -> Any:
        """All sonar as RosAria has them: a point each, on the sonar's axis, from the robot's middle."""
        point, places = self.types["geometry_msgs/msg/Point32"], []
        for sonar in P2DX.sonar[: P2DX.sonar_fitted]:
            x = sonar.x_mm / 1000 + metres * math.cos(math.radians(sonar.heading_deg))
            places.append(point(x, sonar.y_mm / 1000 + metres * math.sin(math.radians(sonar.heading_deg)), 0.0))
        return self.types["sensor_msgs/msg/PointCloud"](self.header(at_s), places, [])


Rows = list[tuple[str, float, Any]]


@cache  # it writes a program for each type that it meets
def store_of(stores: Stores) -> Any:
    store = get_typestore(stores)
    if stores is Stores.ROS1_NOETIC:
        sonar = "std_msgs/Header header\nint32 ranges_count\nfloat64[] ranges"
        store.register(get_types_from_msg(sonar, "p2os_msgs/msg/SonarArray"))
    return store


def ros2_bag(path: Path, make: Callable[[Robot], Rows], storage: str = "MCAP") -> Path:
    store = store_of(Stores.ROS2_HUMBLE if storage == "HUMBLE" else Stores.ROS2_JAZZY)
    plugin = rosbag2.StoragePlugin[storage if storage != "HUMBLE" else "SQLITE3"]
    with rosbag2.Writer(path, version=8, storage_plugin=plugin) as bag:
        connections: dict[str, Any] = {}
        for topic, at_s, message in make(Robot(store)):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=store)
            at_ns = round((BEGIN_S + at_s) * 1e9)
            bag.write(connections[topic], at_ns, store.serialize_cdr(message, kind))
    return path


def ros1_bag(path: Path, make: Callable[[Robot], Rows]) -> Path:
    store = store_of(Stores.ROS1_NOETIC)
    with rosbag1.Writer(path) as bag:
        connections: dict[str, Any] = {}
        for topic, at_s, message in make(Robot(store)):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, kind, typestore=store)
            bag.write(connections[topic], round((BEGIN_S + at_s) * 1e9), store.serialize_ros1(message, kind))
    return path


def driver(robot: Robot) -> Rows:
    rows: Rows = [("/robot1/odom", n / 10, robot.odometry(n / 10)) for n in range(COUNT)]
    rows += [("/odometry/filtered", n / 50, robot.odometry(n / 50, x=9.0)) for n in range(5 * COUNT)]
    rows += [("/robot1/cmd_vel", 0.5, robot.twist(0.3, 0.0)), ("/robot1/cmd_vel", 1.5, robot.twist(math.nan))]
    return rows


def is_the_circle(drive: Drive) -> None:
    assert drive.odometry is not None
    assert drive.reported_left_mps is not None
    assert drive.reported_right_mps is not None
    assert len(drive.odometry) == COUNT
    assert drive.odometry.t_s == pytest.approx(np.arange(COUNT) / 10, abs=1e-6)
    assert drive.odometry.heading_rad == pytest.approx(TURN * np.arange(COUNT) / 10)
    assert drive.odometry.speeds()[1] == pytest.approx(SPEED, rel=1e-4)
    rim = TURN * P2DX.track_mm / 2000
    assert drive.reported_left_mps.values == pytest.approx(SPEED - rim)
    assert drive.reported_right_mps.values == pytest.approx(SPEED + rim)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3", "HUMBLE"])
def test_a_ros_2_drivers_bag_is_a_drive(storage: str, tmp_path: Path) -> None:
    drive = read_drive(ros2_bag(tmp_path / "bag", driver, storage))
    is_the_circle(drive)
    reported = {name: (steps.t_s.tolist(), steps.values.tolist()) for name, steps in drive.commands.items()}
    assert reported["VEL"] == ([pytest.approx(0.5, abs=1e-6)], [300.0])
    assert reported["RVEL"][1] == [0.0, pytest.approx(math.degrees(TURN))]


def test_poses_of_motion_capture_are_the_truth_and_goals_are_not(tmp_path: Path) -> None:
    def make(robot: Robot) -> Rows:
        goals: Rows = [("/goal_pose", n / 10, robot.measured(9.0 + n)) for n in range(3)]
        return driver(robot) + goals + [("/robot1/pose", n / 50, robot.measured(n / 50)) for n in range(100)]

    found = read_drive(ros2_bag(tmp_path / "bag", make)).truth
    assert found is not None
    assert found.heading_rad == pytest.approx(TURN * np.arange(100) / 50)
    assert read_drive(ros2_bag(tmp_path / "other", driver)).truth is None


def test_ranges_have_the_number_of_their_topic_and_end_at_the_sonars_reach(tmp_path: Path) -> None:
    def make(robot: Robot) -> Rows:
        ranges = [(3, 1.25), (15, math.inf), (4, -math.inf), (5, math.nan)]
        return [*driver(robot), *((f"/sonar_{number}", 0.2, robot.range(0.2, metres)) for number, metres in ranges)]

    drive = read_drive(ros2_bag(tmp_path / "bag", make))
    reported = {number: steps.values.tolist() for number, steps in drive.sonar_m.items()}
    assert reported == {3: [1.25], 15: [P2DX.sonar_range_m], 4: [0.0]}


def test_rosarias_bag_of_ros_1_is_a_drive_with_all_its_sonar(tmp_path: Path) -> None:
    def make(robot: Robot) -> Rows:
        return [
            *(("/RosAria/pose", n / 10, robot.odometry(n / 10)) for n in range(COUNT)),
            ("/RosAria/sonar", 0.3, robot.points(0.3, 1.5)),
        ]

    drive = read_drive(ros1_bag(tmp_path / "old.bag", make))
    is_the_circle(drive)
    reported = [drive.sonar_m[number].values.tolist() for number in range(P2DX.sonar_fitted)]
    assert reported == [[pytest.approx(1.5, abs=1e-6)]] * P2DX.sonar_fitted


def test_p2os_drivers_own_type_is_read_by_the_definition_that_its_bag_brings(tmp_path: Path) -> None:
    def make(robot: Robot) -> Rows:
        sonar = robot.types["p2os_msgs/msg/SonarArray"](robot.header(0.4), 2, np.array([0.75, 7.0]))
        return [*(("/pose", n / 10, robot.odometry(n / 10)) for n in range(COUNT)), ("/sonar", 0.4, sonar)]

    drive = read_drive(ros1_bag(tmp_path / "old.bag", make))
    assert {number: steps.values.tolist() for number, steps in drive.sonar_m.items()} == {0: [0.75], 1: [5.0]}


def test_poses_that_are_no_numbers_are_passed_over_and_too_few_are_refused(tmp_path: Path) -> None:
    def make(robot: Robot) -> Rows:
        return [("/odom", 0.0, robot.odometry(0.0)), ("/odom", 0.1, robot.odometry(0.1, x=math.nan))]

    with pytest.raises(FileError, match="no two odometry messages"):
        read_drive(ros2_bag(tmp_path / "bag", make))


def test_a_bag_is_compared_with_another_of_the_same_drive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, other = ros2_bag(tmp_path / "one", driver), ros1_bag(tmp_path / "other.bag", driver)
    assert p2os(["compare", f"{one}", f"{other}"]) == 0
    reported = capsys.readouterr().out
    assert "APE, m                           0.0000" in reported
    assert "do not part" in reported
