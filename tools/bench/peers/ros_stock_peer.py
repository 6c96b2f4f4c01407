"""A stock ROS 2 node (rclpy, any rmw) beside `p2os ros`: what it hears and sees, both ways, with latency and loss.

Run it with a Python that has rclpy; it imports nothing of p2os:

    python3.11 -m venv rospeer
    rospeer/bin/pip install ros-jazzy-rclpy ros-jazzy-rmw-fastrtps-cpp ros-jazzy-sensor-msgs \
        ros-jazzy-nav-msgs ros-jazzy-diagnostic-msgs ros-jazzy-std-srvs ros-jazzy-rosgraph-msgs
    p2os serve --all-sonar --laser lms2xx & p2os ros tcp:127.0.0.1:8101 --laser lms2xx --domain 42 &
    ROS_DOMAIN_ID=42 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST rospeer/bin/python tools/bench/peers/ros_stock_peer.py 10

Those wheels are a third party's build of ROS; a ROS 2 of one's own does as well. It publishes cmd_vel at 20 Hz for so
many seconds, then the thesis's motor topics for two, and ends with exit code 1 where something was not heard.
"""

import math
import os
import statistics
import sys
import time
from collections.abc import Callable
from itertools import pairwise

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import BatteryState, JointState, LaserScan, PointCloud2, Range
from std_msgs.msg import Int32, String

RATE_HZ = 20
SETTLE_S, ALL_S = 2.0, 3.0
#: What navigation hears; latency and loss are of this traffic: one rclpy process hears no 500 messages a second.
NAVIGATION = {"odom", "sonar", "scan", "diagnostics"}


class PeerNode(Node):
    """Hears everything that a robot's node says, and drives it."""

    def __init__(self) -> None:
        super().__init__("stock_peer")
        self.heard: dict[str, list[tuple[float, object]]] = {}
        self.hearing: dict[str, object] = {}
        rows = [
            (Odometry, "odom"), (JointState, "joint_states"), (PointCloud2, "sonar"), (BatteryState, "battery_state"),
            (DiagnosticArray, "diagnostics"), (Int32, "encoder_left"), (Int32, "encoder_right"),
            (LaserScan, "scan"), *((Range, f"sonar_{number}") for number in range(8)),
            *((Int32, f"distance_sensor_{number}") for number in range(1, 9)),
        ]  # fmt: skip
        for kind, topic in rows:
            self.hearing[topic] = self.create_subscription(
                kind, f"/{topic}", lambda message, topic=topic: self._hear(topic, message), 10
            )
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(
            String, "/robot_description", lambda message: self._hear("robot_description", message), latched
        )
        self.velocity = self.create_publisher(Twist, "/cmd_vel", 10)
        self.motors = [self.create_publisher(Int32, f"/motor_{side}", 10) for side in ("left", "right")]

    def _hear(self, topic: str, message: object) -> None:
        self.heard.setdefault(topic, []).append((time.time(), message))

    def newest(self, topic: str) -> object | None:
        """Return the last message of a topic."""
        found = self.heard.get(topic)
        return found[-1][1] if found else None

    def spin(self, seconds: float, each: Callable[[int], object] = int) -> int:
        """Hear for so long; call `each` at 20 Hz, and return how often that was."""
        ends = time.monotonic() + seconds
        due, count = time.monotonic(), 0
        while (now := time.monotonic()) < ends:
            if now >= due:
                each(count)
                due, count = due + 1 / RATE_HZ, count + 1
            rclpy.spin_once(self, timeout_sec=max(0.0, min(due, ends) - time.monotonic()))
        return count


def counted(peer: PeerNode) -> int:
    """Return how many commands the node says that it has taken."""
    message = peer.newest("diagnostics")
    values = {} if message is None else {one.key: one.value for one in message.status[0].values}
    return int(values.get("commands", 0))


def latencies_ms(heard: list[tuple[float, object]]) -> list[float]:
    """Return milliseconds from a message's stamp to its arrival here."""
    return [(at - one.header.stamp.sec - one.header.stamp.nanosec / 1e9) * 1000 for at, one in heard]


def lost(heard: list[tuple[float, object]]) -> tuple[int, float]:
    """Return how many messages of an even rhythm are missing from the first to the last stamp, and the rhythm, s."""
    stamps = [one.header.stamp.sec + one.header.stamp.nanosec / 1e9 for _, one in heard]
    steps = [after - before for before, after in pairwise(stamps)]
    rhythm = statistics.median(steps)
    return max(0, round((stamps[-1] - stamps[0]) / rhythm) + 1 - len(stamps)), rhythm


def driven_otherwise(peer: PeerNode) -> tuple[float, float]:
    """Drive by TwistStamped, then by the thesis's motor topics; return m/s and rad/s that came of it."""
    peer.destroy_publisher(peer.velocity)  # Fast DDS has one type a topic in a participant
    publisher = peer.create_publisher(TwistStamped, "/cmd_vel", 10)
    stamped = TwistStamped()
    stamped.twist.linear.x = -0.1
    peer.spin(1.5, lambda _count: publisher.publish(stamped))
    back = peer.newest("odom").twist.twist.linear.x
    print(f"TwistStamped of -0.1 m/s: {back:.3f} m/s")
    turning_codes = tuple(zip(peer.motors, (2, -2), strict=True))
    peer.spin(2.0, lambda _count: [motor.publish(Int32(data=code)) for motor, code in turning_codes])
    turning = peer.newest("odom").twist.twist.angular.z
    print(f"motor_left 2, motor_right -2: {turning:.2f} rad/s")
    return back, turning


def main(seconds: float) -> int:
    """Hear, drive, and print what came of it."""
    rclpy.init()
    peer = PeerNode()
    print(f"rclpy with {rclpy.get_rmw_implementation_identifier()}, domain {os.environ.get('ROS_DOMAIN_ID', '0')}")
    peer.spin(SETTLE_S)
    print(
        "nodes:",
        ", ".join(sorted(f"{space.rstrip('/')}/{name}" for name, space in peer.get_node_names_and_namespaces())),
    )
    for name, types in sorted(peer.get_topic_names_and_types()):
        print(f"  {name:24} {', '.join(types)}")
    before, start = counted(peer), peer.newest("odom")
    twist = Twist()
    twist.linear.x, twist.angular.z = 0.2, 0.3
    peer.spin(ALL_S)
    described = peer.newest("robot_description")
    everything = {topic: len(found) for topic, found in sorted(peer.heard.items())}
    print("\nheard:", ", ".join(f"{topic} {count}" for topic, count in everything.items()))
    for topic in peer.hearing.keys() - NAVIGATION:
        peer.destroy_subscription(peer.hearing[topic])
    peer.heard.clear()
    sent = peer.spin(seconds, lambda _count: peer.velocity.publish(twist))
    window = {topic: list(found) for topic, found in peer.heard.items()}
    peer.spin(1.5)
    taken = counted(peer) - before
    there = peer.newest("odom")
    print(f"\n{'topic':20} {'count':>6} {'Hz':>6} {'median ms':>10} {'99 % ms':>8} {'lost':>5}")
    for topic, found in sorted(window.items()):
        row = f"{topic:20} {len(found):6d} {len(found) / seconds:6.1f}"
        if hasattr(found[0][1], "header") and len(found) > 20:
            delays = sorted(latencies_ms(found))
            row += f" {statistics.median(delays):10.2f} {delays[int(len(delays) * 0.99)]:8.2f}"
            row += f" {lost(found)[0]:5d}" if topic in {"odom", "scan"} else ""
        print(row)
    print(f"cmd_vel: {sent} sent at {RATE_HZ} Hz, {taken} taken by the node")
    moved = 0.0
    if start is not None and there is not None:
        begin = start.pose.pose.position
        places = [message.pose.pose.position for _, message in window.get("odom", ())]
        moved = max((math.hypot(one.x - begin.x, one.y - begin.y) for one in places), default=0.0)
        print(f"went {moved:.3f} m away; after the deadman {there.twist.twist.linear.x:.3f} m/s")
    if there is None:
        rclpy.shutdown()
        print("NOT HEARD: odom; is `p2os ros` in this domain?")
        return 1
    back, turning = driven_otherwise(peer)
    print(f"robot_description, latched: {len(described.data) if described else 0} characters of URDF")
    rclpy.shutdown()
    wanted = {"odom", "sonar", "sonar_0", "distance_sensor_1", "encoder_left", "joint_states", "battery_state"}
    well = (
        described
        and wanted <= everything.keys()
        and moved > 0.2
        and back < -0.05
        and turning < -0.3
        and taken > 0.9 * sent
    )
    missing = ", ".join(sorted(wanted - everything.keys())) or "what was sent"
    print("all was heard" if well else f"NOT HEARD: {missing}")
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0))
