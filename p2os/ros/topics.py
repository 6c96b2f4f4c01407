"""The topics of a robot's node: name, type and direction; what each says stands in docs/ros.md.

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
    is_latched: bool = False
    #: The node subscribes to it; else it publishes it.
    is_command: bool = False

    def topic(self, options: NodeOptions, number: int | None = None) -> Topic:
        """Return the topic of a node."""
        name = self.name if number is None else self.name.format(number)
        return Topic(options.topic(name), self.type, self.is_latched)


_COMMAND = {"is_command": True}
#: Services of a robot's node, where the transport has services, and the command that each is.
SERVICES: Mapping[str, TopicRow] = {
    "enable_motors": TopicRow(name="enable_motors", type="std_srvs/srv/SetBool"),
    "reset_odometry": TopicRow(name="reset_odometry", type="std_srvs/srv/Trigger"),
}
TOPICS: Mapping[str, TopicRow] = {
    "odom": TopicRow(name="odom", type="nav_msgs/msg/Odometry"),
    "tf": TopicRow(name="/tf", type="tf2_msgs/msg/TFMessage"),
    "tf_static": TopicRow(name="/tf_static", type="tf2_msgs/msg/TFMessage", is_latched=True),
    "joint_states": TopicRow(name="joint_states", type="sensor_msgs/msg/JointState"),
    "range": TopicRow(name="sonar_{}", type="sensor_msgs/msg/Range"),
    "sonar": TopicRow(name="sonar", type="sensor_msgs/msg/PointCloud2"),
    "battery_state": TopicRow(name="battery_state", type="sensor_msgs/msg/BatteryState"),
    "diagnostics": TopicRow(name="/diagnostics", type="diagnostic_msgs/msg/DiagnosticArray"),
    "bumper_front": TopicRow(name="bumper_front", type="std_msgs/msg/UInt8MultiArray"),
    "bumper_rear": TopicRow(name="bumper_rear", type="std_msgs/msg/UInt8MultiArray"),
    "imu": TopicRow(name="imu", type="sensor_msgs/msg/Imu"),
    "motors_state": TopicRow(name="motors_state", type="std_msgs/msg/Bool", is_latched=True),
    "robot_description": TopicRow(name="robot_description", type="std_msgs/msg/String", is_latched=True),
    "clock": TopicRow(name="/clock", type="rosgraph_msgs/msg/Clock"),
    "rosout": TopicRow(name="/rosout", type="rcl_interfaces/msg/Log"),
    "from_client": TopicRow(name="p2os/from_client", type="std_msgs/msg/UInt8MultiArray"),
    "from_robot": TopicRow(name="p2os/from_robot", type="std_msgs/msg/UInt8MultiArray"),
    "distance_sensor": TopicRow(name="distance_sensor_{}", type="std_msgs/msg/Int32"),
    "encoder_left": TopicRow(name="encoder_left", type="std_msgs/msg/Int32"),
    "encoder_right": TopicRow(name="encoder_right", type="std_msgs/msg/Int32"),
    "motor_left": TopicRow(name="motor_left", type="std_msgs/msg/Int32"),
    "motor_right": TopicRow(name="motor_right", type="std_msgs/msg/Int32"),
    "cmd_vel": TopicRow(name="cmd_vel", type="geometry_msgs/msg/Twist", **_COMMAND),
    "cmd_vel_stamped": TopicRow(name="cmd_vel", type="geometry_msgs/msg/TwistStamped", **_COMMAND),
    "enable_motors": TopicRow(name="enable_motors", type="std_msgs/msg/Bool", **_COMMAND),
    "reset_odometry": TopicRow(name="reset_odometry", type="std_msgs/msg/Empty", **_COMMAND),
}
