"""The topics of a robot's node: name, type and what each says; one table for the node, the bench and the manual page.

Names that begin with a slash belong to no robot and stay outside of any namespace, as REP 105 and ROS' own tools have
them. A name that ends in `{}` stands for one topic a number.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from p2os.ros.transport import NodeOptions, Topic


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicRow:
    """One topic, or one a number."""

    name: str
    type: str
    says: str
    is_latched: bool = False
    #: The node subscribes to it; else it publishes it.
    is_command: bool = False

    def topic(self, options: NodeOptions, number: int | None = None) -> Topic:
        """Return the topic of a node."""
        name = self.name if number is None else self.name.format(number)
        return Topic(options.topic(name), self.type, self.is_latched)


_COMMAND = {"is_command": True}
TOPICS: Mapping[str, TopicRow] = {
    "odom": TopicRow(
        name="odom", type="nav_msgs/msg/Odometry", says="pose in `odom`, speeds in `base_link`, with covariances"
    ),
    "tf": TopicRow(name="/tf", type="tf2_msgs/msg/TFMessage", says="`odom` to `base_link`, and the wheels"),
    "tf_static": TopicRow(
        name="/tf_static", type="tf2_msgs/msg/TFMessage", says="where sonar and caster are", is_latched=True
    ),
    "joint_states": TopicRow(name="joint_states", type="sensor_msgs/msg/JointState", says="wheels: rad, rad/s"),
    "range": TopicRow(name="sonar_{}", type="sensor_msgs/msg/Range", says="a sonar, from 0; +inf: no echo (REP 117)"),
    "sonar": TopicRow(name="sonar", type="sensor_msgs/msg/PointCloud2", says="all echoes, in `base_link`"),
    "battery_state": TopicRow(name="battery_state", type="sensor_msgs/msg/BatteryState", says="volts, charge"),
    "diagnostics": TopicRow(
        name="/diagnostics", type="diagnostic_msgs/msg/DiagnosticArray", says="link, motors, wheels, battery; 1 Hz"
    ),
    "bumper_front": TopicRow(
        name="bumper_front", type="std_msgs/msg/UInt8MultiArray", says="1 a pressed segment, where fitted"
    ),
    "bumper_rear": TopicRow(name="bumper_rear", type="std_msgs/msg/UInt8MultiArray", says="likewise"),
    "imu": TopicRow(name="imu", type="sensor_msgs/msg/Imu", says="heading of the compass, where fitted"),
    "motors_state": TopicRow(
        name="motors_state", type="std_msgs/msg/Bool", says="motors are on; AROS and ARCOS", is_latched=True
    ),
    "robot_description": TopicRow(
        name="robot_description", type="std_msgs/msg/String", says="the robot's URDF", is_latched=True
    ),
    "clock": TopicRow(name="/clock", type="rosgraph_msgs/msg/Clock", says="virtual time, of `p2os run --ros`"),
    "distance_sensor": TopicRow(
        name="distance_sensor_{}", type="std_msgs/msg/Int32", says="from 1; 1: something is near"
    ),
    "encoder_left": TopicRow(name="encoder_left", type="std_msgs/msg/Int32", says="0 to 7, 45 degrees each"),
    "encoder_right": TopicRow(name="encoder_right", type="std_msgs/msg/Int32", says="likewise"),
    "motor_left": TopicRow(name="motor_left", type="std_msgs/msg/Int32", says="-4 to 3; 4 to 7 mean -4 to -1"),
    "motor_right": TopicRow(name="motor_right", type="std_msgs/msg/Int32", says="likewise"),
    "cmd_vel": TopicRow(
        name="cmd_vel", type="geometry_msgs/msg/Twist", says="m/s ahead, rad/s to the left", **_COMMAND
    ),
    "cmd_vel_stamped": TopicRow(name="cmd_vel", type="geometry_msgs/msg/TwistStamped", says="the same", **_COMMAND),
    "enable_motors": TopicRow(name="enable_motors", type="std_msgs/msg/Bool", says="switches the motors", **_COMMAND),
    "reset_odometry": TopicRow(
        name="reset_odometry", type="std_msgs/msg/Empty", says="the robot is at 0, 0 now", **_COMMAND
    ),
}
