"""A ROS 2 node of cyclonedds alone, which imports nothing of p2os: types and names are written anew from .msg files.

It drives with `rt/<namespace>/cmd_vel` at 20 Hz until it is killed, and prints a JSON line for each odometry and range.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int32, uint8, uint32
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

LOOPBACK = """<CycloneDDS><Domain id="any"><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
ENDS_S = 20.0


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Range(IdlStruct, typename="sensor_msgs::msg::dds_::Range_"):
    header: Header
    radiation_type: uint8
    field_of_view: float32
    min_range: float32
    max_range: float32
    range: float32
    variance: float32


QOS = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(10), Policy.Durability.Volatile)


def main(number: int, namespace: str) -> None:
    """Drive and print."""
    domain = Domain(number, LOOPBACK)
    node = DomainParticipant(number)
    driver = DataWriter(node, Topic(node, f"rt{namespace}/cmd_vel", Twist), qos=QOS)
    readers = (
        DataReader(node, Topic(node, f"rt{namespace}/odom", Odometry), qos=QOS),
        DataReader(node, Topic(node, f"rt{namespace}/sonar_3", Range), qos=QOS),
    )
    ends = time.monotonic() + ENDS_S
    while time.monotonic() < ends:
        driver.write(Twist(Vector3(0.2), Vector3()))
        for reader in readers:
            for sample in reader.take(10):
                if not isinstance(sample, InvalidSample):
                    sys.stdout.write(f"{json.dumps(plain(sample))}\n")
                    sys.stdout.flush()
        time.sleep(0.05)
    del domain


def plain(sample: Odometry | Range) -> dict[str, object]:
    """Return what a test looks at."""
    if isinstance(sample, Range):
        return {"range_m": sample.range, "frame": sample.header.frame_id, "most_m": sample.max_range}
    return {
        "x_m": sample.pose.pose.position.x,
        "mps": sample.twist.twist.linear.x,
        "frame": sample.header.frame_id,
        "child": sample.child_frame_id,
        "yaw_variance": sample.pose.covariance[35],
    }


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
