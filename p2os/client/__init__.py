"""The client: `Robot`, blocking here and in `p2os`, and for asyncio in `p2os.client.aio`.

`RobotCore` is the client without a line and without a clock, for tests and for
skins of one's own.
"""

from p2os.client.core import RobotCore
from p2os.client.goals import MotionResult
from p2os.client.gripper import Gripper, GripperAction
from p2os.client.notices import (
    BaudKept,
    BaudRaised,
    ConfigurationKnown,
    Connected,
    DeadmanStopped,
    Disobeyed,
    GapStopped,
    GaveUp,
    LinkLost,
    MotionEnded,
    MotorsDisabled,
    Notice,
    OdometryDoubtful,
    PacketArrived,
    ReconnectPlanned,
    RobotUnknown,
)
from p2os.client.problems import ConnectError, LinkLostError, MotionError, MotorsDisabledError, NoAnswerError
from p2os.client.robot import Robot
from p2os.client.settings import ClientSettings
from p2os.client.snapshots import Limits, Link, Pose, RobotState, SonarEcho

__all__ = [
    "BaudKept",
    "BaudRaised",
    "ClientSettings",
    "ConfigurationKnown",
    "ConnectError",
    "Connected",
    "DeadmanStopped",
    "Disobeyed",
    "GapStopped",
    "GaveUp",
    "Gripper",
    "GripperAction",
    "Limits",
    "Link",
    "LinkLost",
    "LinkLostError",
    "MotionEnded",
    "MotionError",
    "MotionResult",
    "MotorsDisabled",
    "MotorsDisabledError",
    "NoAnswerError",
    "Notice",
    "OdometryDoubtful",
    "PacketArrived",
    "Pose",
    "ReconnectPlanned",
    "Robot",
    "RobotCore",
    "RobotState",
    "RobotUnknown",
    "SonarEcho",
]
