"""The P2OS protocol: wire, commands, packets, connection, client and virtual robot.

    from p2os import Robot, served_pioneer

    with served_pioneer(world="room") as url, Robot(url) as robot:
        robot.drive(0.2)

`Robot` is the blocking client (`p2os.client.aio` has the one for asyncio), `served_pioneer` a
virtual robot in the background; on a `VirtualClock` both take no longer than their work does.
Names are fetched on first use: importing the package loads no port.
"""

from typing import TYPE_CHECKING

from simbase.lazy import lazily

if TYPE_CHECKING:
    from p2os.client import (
        ClientSettings,
        ConnectError,
        Limits,
        LinkLostError,
        MotionError,
        MotionResult,
        MotorsDisabledError,
        NoAnswerError,
        Robot,
        RobotPose,
        RobotState,
    )
    from p2os.pioneer.serve import served_pioneer
    from p2os.robots.parameters import load_parameters
    from p2os.transport.virtual_clock import VirtualClock
    from simbase.errors import P2osError

    __version__: str

__all__ = [
    "ClientSettings",
    "ConnectError",
    "Limits",
    "LinkLostError",
    "MotionError",
    "MotionResult",
    "MotorsDisabledError",
    "NoAnswerError",
    "P2osError",
    "Robot",
    "RobotPose",
    "RobotState",
    "VirtualClock",
    "load_parameters",
    "served_pioneer",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "p2os.client": (
                "ClientSettings",
                "ConnectError",
                "Limits",
                "LinkLostError",
                "MotionError",
                "MotionResult",
                "MotorsDisabledError",
                "NoAnswerError",
                "Robot",
                "RobotPose",
                "RobotState",
            ),
            "p2os.pioneer.serve": ("served_pioneer",),
            "p2os.robots.parameters": ("load_parameters",),
            "p2os.transport.virtual_clock": ("VirtualClock",),
            "simbase.errors": ("P2osError",),
        },
    )
