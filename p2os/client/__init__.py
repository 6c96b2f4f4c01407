"""The client: `Robot`, blocking here and in `p2os`, and for asyncio in `p2os.client.aio`.

`RobotCore` is the client without a line and without a clock, for tests and for
I/O layers of one's own.
"""

from p2os.client.calls import Gripper, GripperAction
from p2os.client.core import RobotCore
from p2os.client.goals import MotionResult
from p2os.client.notices import (
    BaudKept,
    BaudRaised,
    ConfigurationKnown,
    Connected,
    ConnectError,
    DeadmanStopped,
    Disobeyed,
    GapStopped,
    GaveUp,
    LinkLost,
    LinkLostError,
    MotionEnded,
    MotionError,
    MotorsDisabled,
    MotorsDisabledError,
    NoAnswerError,
    Notice,
    OdometryDoubtful,
    PacketArrived,
    ReconnectPlanned,
    RobotUnknown,
)
from p2os.client.robot import Robot
from p2os.client.robot_state import Limits, Link, RobotPose, RobotState, SonarEcho
from p2os.client.settings import ClientSettings

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
    "ReconnectPlanned",
    "Robot",
    "RobotCore",
    "RobotPose",
    "RobotState",
    "RobotUnknown",
    "SonarEcho",
]
