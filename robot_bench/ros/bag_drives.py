"""Drives out of bags: what a P2OS driver of ROS published and was told.

    nav_msgs/Odometry                   poses and speeds: `odom` or `pose`, or the only one
    geometry_msgs/PoseStamped           measured poses, as motion capture publishes them: `ground_truth` or `pose`
    geometry_msgs/Twist, TwistStamped   VEL and RVEL, as such a driver sends them: `cmd_vel`, or the only one
    sensor_msgs/Range                   a sonar each, by the number at the end of its topic
    sensor_msgs/PointCloud, -2          all sonar, where there is a point for each (RosAria's `sonar`)
    p2os_msgs/SonarArray                all sonar, by their place

A message's own stamp is its time, where it has one, else when it was recorded. What is not finite is passed over.
"""

import math
import re
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from p2os.robots.parameters import RobotParameters
from p2os.ros.bags import BagMessage, is_bag, read_bag
from robot_bench.drives.drive import Drive, Trajectory, heading_of, steps_of
from simbase.errors import FileError, shown_name
from simbase.timing import NS_PER_S, Nanos

ODOMETRY, MEASURED = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
TWISTS = frozenset({"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"})
#: sensor_msgs/PointField.FLOAT32.
FLOAT32 = 7
#: Last words of topics that count where there are several of a kind, the first first.
ODOMETRY_NAMES, TWIST_NAMES = ("odom", "pose"), ("cmd_vel",)
#: Of measured poses only these count: goals have the same type.
TRUTH_NAMES = ("ground_truth", "pose")
Pairs = list[tuple[float, float]]
#: Sonar, from 0, and metres.
Echoes = Iterator[tuple[int, float]]


def knows(path: Path) -> bool:
    """Tell whether a path looks like a bag."""
    return is_bag(path)


def read(path: Path, parameters: RobotParameters) -> Drive:
    """Return what a bag tells of a drive.

    Args:
        path: As `read_bag` takes it.
        parameters: The robot's track and sonar.

    Raises:
        MissingDependencyError: rosbags is not installed.
        FileError: It is no bag, is damaged, or has no two odometry messages of one topic.
    """
    found = list(read_bag(path, frozenset({ODOMETRY, MEASURED, *TWISTS, *SONAR})))
    begins = min((_time_of(one) for one in found), default=0)
    told = _of_topic(found, {ODOMETRY}, ODOMETRY_NAMES)
    named = [one for one in found if one.topic.rpartition("/")[2] in TRUTH_NAMES]
    drive = Drive(
        name=path.name, parameters=parameters, odometry=_trajectory(told, begins),
        truth=_trajectory(_of_topic(named, {MEASURED}, TRUTH_NAMES), begins),
    )  # fmt: skip
    if drive.odometry is None:
        raise FileError(f"{shown_name(path)} holds no two odometry messages", hint="nav_msgs/Odometry on odom or pose")
    speeds = []
    for one in told:
        message: Mapping[str, Any] = one.message
        twist = message["twist"]["twist"]
        rim = twist["angular"]["z"] * parameters.track_mm / 2000
        speeds.append((_seconds(one, begins), twist["linear"]["x"], rim))
    sides = ([(at, forward + sign * rim) for at, forward, rim in speeds] for sign in (-1, 1))
    drive.told_left_mps, drive.told_right_mps = (steps_of(_finite(side)) for side in sides)
    drive.left_mps, drive.right_mps = drive.told_left_mps, drive.told_right_mps
    drive.commands = _commands(_of_topic(found, TWISTS, TWIST_NAMES), begins)
    drive.sonar_m = {number: steps_of(pairs) for number, pairs in _sonar(found, parameters, begins).items()}
    return drive


def _trajectory(found: Iterable[BagMessage], begins: Nanos) -> Trajectory | None:
    """Return poses as a trajectory; None where fewer than two are finite."""
    rows = []
    for one in found:
        message: Mapping[str, Any] = one.message
        pose = message["pose"].get("pose", message["pose"])  # of an Odometry with its covariance
        values = pose["position"]["x"], pose["position"]["y"], _heading(pose["orientation"])
        if all(map(math.isfinite, values)):
            rows.append((_seconds(one, begins), *values))
    return Trajectory.of_rows(rows) if len({row[0] for row in rows}) > 1 else None


def _of_topic(found: Sequence[BagMessage], types: Iterable[str], names: Sequence[str]) -> list[BagMessage]:
    """Return the messages of one topic: the first of `names` that is there, else the topic with the most messages."""
    ours = [one for one in found if one.type in types]
    counts = Counter(one.topic for one in ours)
    last = {topic.rpartition("/")[2]: topic for topic in sorted(counts, reverse=True)}
    most = max(sorted(counts), key=counts.__getitem__, default="")
    chosen = next((last[name] for name in names if name in last), most)
    return [one for one in ours if one.topic == chosen]


def _commands(found: Iterable[BagMessage], begins: Nanos) -> dict[str, Any]:
    """Return speeds as the commands of the wire: mm/s and degrees a second."""
    told: dict[str, Pairs] = {"VEL": [], "RVEL": []}
    for one in found:
        message: Mapping[str, Any] = one.message
        twist, at_s = message.get("twist", message), _seconds(one, begins)
        told["VEL"].append((at_s, twist["linear"]["x"] * 1000))
        told["RVEL"].append((at_s, math.degrees(twist["angular"]["z"])))
    return {name: steps_of(_finite(pairs)) for name, pairs in told.items() if pairs}


def _sonar(found: Iterable[BagMessage], parameters: RobotParameters, begins: Nanos) -> dict[int, Pairs]:
    sonar: dict[int, Pairs] = {}
    for one in found:
        for number, metres in SONAR[one.type](one, parameters) if one.type in SONAR else ():
            if not math.isnan(metres):
                reach = min(max(metres, 0.0), parameters.sonar_range_m)
                sonar.setdefault(number, []).append((_seconds(one, begins), reach))
    return sonar


def _range(one: BagMessage, _: RobotParameters) -> Echoes:
    digits = re.search(r"(\d{1,3})$", one.topic)
    message: Mapping[str, Any] = one.message
    if digits is not None:
        yield int(digits[1]), float(message["range"])


def _array(one: BagMessage, _: RobotParameters) -> Echoes:
    message: Mapping[str, Any] = one.message
    yield from ((number, float(metres)) for number, metres in enumerate(message["ranges"]))


def _points(one: BagMessage, parameters: RobotParameters) -> Echoes:
    message: Mapping[str, Any] = one.message
    yield from _of_points([(point["x"], point["y"]) for point in message["points"]], parameters)


def _points2(one: BagMessage, parameters: RobotParameters) -> Echoes:
    message: Mapping[str, Any] = one.message
    offsets = {field["name"]: field["offset"] for field in message["fields"] if field["datatype"] == FLOAT32}
    data, order = bytes(message["data"]), ">" if message["is_bigendian"] else "<"
    if message["width"] * message["height"] != parameters.sonar_fitted or not {"x", "y"} <= offsets.keys():
        return
    try:
        places = [
            tuple(struct.unpack_from(f"{order}f", data, point * message["point_step"] + offsets[axis])[0]
                  for axis in ("x", "y"))
            for point in range(parameters.sonar_fitted)
        ]  # fmt: skip
    except struct.error:  # less data than it says
        return
    yield from _of_points(places, parameters)


def _of_points(points: Sequence[Sequence[float]], parameters: RobotParameters) -> Echoes:
    """Yield how far each point is from its sonar, where there is one for each."""
    if len(points) == parameters.sonar_fitted:
        for number, ((x, y), place) in enumerate(zip(points, parameters.sonar, strict=False)):
            yield number, math.hypot(x - place.x_mm / 1000, y - place.y_mm / 1000)


#: Type → what reads its ranges.
SONAR: Mapping[str, Callable[[BagMessage, RobotParameters], Echoes]] = {
    "sensor_msgs/msg/Range": _range, "p2os_msgs/msg/SonarArray": _array,
    "sensor_msgs/msg/PointCloud": _points, "sensor_msgs/msg/PointCloud2": _points2,
}  # fmt: skip


def _finite(pairs: Pairs) -> Pairs:
    return [pair for pair in pairs if math.isfinite(pair[1])]


def _heading(turned: Mapping[str, float]) -> float:
    return heading_of(*(turned[name] for name in "xyzw"))


def _time_of(one: BagMessage) -> Nanos:
    message: Mapping[str, Any] = one.message
    stamp = message.get("header", {}).get("stamp", {})
    at_ns = int(stamp.get("sec", 0)) * NS_PER_S + int(stamp.get("nanosec", 0))
    return at_ns or one.at_ns


def _seconds(one: BagMessage, begins: Nanos) -> float:
    return (_time_of(one) - begins) / NS_PER_S
