"""What both nodes hear: transforms, and a scan with the odometry's pose at its stamp."""

import math
from collections import deque
from collections.abc import Callable

import numpy as np
from driving import Pose, between
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATCHED_TRANSFORMS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def nanoseconds(stamp: object) -> int:
    """Return a builtin_interfaces/Time in nanoseconds."""
    return stamp.sec * 10**9 + stamp.nanosec  # type: ignore[attr-defined]  # a message of ROS


def planar(transform: object) -> Pose:
    """Return what a geometry_msgs/Transform is in the plane."""
    at, turned = transform.translation, transform.rotation  # type: ignore[attr-defined]  # a message of ROS
    return at.x, at.y, 2 * math.atan2(turned.z, turned.w)


class Ears:
    """Keeps the newest transforms, and hands on each scan once the odometry at its stamp is known.

    Args:
        node: Whose subscriptions they are.
        on_scan: Called with the scan and the pose of `base_link` in `odom` at its stamp.
    """

    def __init__(self, node: Node, on_scan: Callable[[LaserScan, Pose], None]) -> None:
        self._on_scan = on_scan
        self.odometry: deque[tuple[int, Pose]] = deque(maxlen=100)
        self.fixed: dict[tuple[str, str], Pose] = {}
        self.map_to_odom: Pose | None = None
        self._scans: deque[LaserScan] = deque(maxlen=10)
        self.subscriptions = [
            node.create_subscription(TFMessage, "/tf", self._moved, 100),
            node.create_subscription(TFMessage, "/tf_static", self._fixed, LATCHED_TRANSFORMS),
            node.create_subscription(LaserScan, "/scan", self._scanned, qos_profile_sensor_data),
        ]

    def laser(self, frame: str) -> Pose | None:
        """Return where on the robot the laser is, once that was heard."""
        return self.fixed.get(("base_link", frame))

    def _fixed(self, message: TFMessage) -> None:
        for one in message.transforms:
            self.fixed[one.header.frame_id, one.child_frame_id] = planar(one.transform)

    def _moved(self, message: TFMessage) -> None:
        for one in message.transforms:
            if (one.header.frame_id, one.child_frame_id) == ("odom", "base_link"):
                self.odometry.append((nanoseconds(one.header.stamp), planar(one.transform)))
            elif (one.header.frame_id, one.child_frame_id) == ("map", "odom"):
                self.map_to_odom = planar(one.transform)
        while self._scans and self._hand_on(self._scans[0]):
            self._scans.popleft()

    def _scanned(self, scan: LaserScan) -> None:
        self._scans.append(scan)

    def _hand_on(self, scan: LaserScan) -> bool:
        """Hand a scan on, or drop one that is older than all that is known of the odometry; else it waits."""
        at = nanoseconds(scan.header.stamp)
        if not self.odometry or self.odometry[-1][0] < at:
            return False
        later = next(number for number, (stamp, _) in enumerate(self.odometry) if stamp >= at)
        if later:
            self._on_scan(scan, between(self.odometry[later - 1], self.odometry[later], at))
        return True


def points_of(scan: LaserScan, laser: Pose) -> np.ndarray:
    """Return the points of a scan in the frame of the robot, [n, 2] m; what has no echo is left out."""
    ranges = np.array(scan.ranges, np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges)) + laser[2]
    seen = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    return np.stack(
        [laser[0] + ranges[seen] * np.cos(angles[seen]), laser[1] + ranges[seen] * np.sin(angles[seen])], axis=1
    )
