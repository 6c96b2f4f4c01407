"""Where the robot is, followed over wraps of its counters and over sessions.

The robot counts from where its session opened. A client's pose goes on: at the
first packet of a later session the robot is taken to stand where it was last
seen, since nobody knows how far it was carried meanwhile.

Invariant: within a session the pose is the robot's own odometry, moved and
turned by one fixed amount; nothing is accumulated but whole counts.
"""

import math
from dataclasses import dataclass

from p2os.client.snapshots import Pose
from p2os.odometry import Unwrapper
from p2os.parameters import RobotParameters
from p2os.sip import POSITION_MASK, StandardSip

#: Headings are 4096 counts to the turn, sent as 16 signed bits (Pioneer 2/3 manuals, standard SIP).
HEADING_COUNTS = 4096


@dataclass(frozen=True, slots=True)
class RobotCounts:
    """The robot's own odometry since its session opened: metres, and radians that do not wrap."""

    x_m: float
    y_m: float
    heading_rad: float


class PoseKeeper:
    """Turns the counters of the packets into one pose."""

    def __init__(self) -> None:
        self.pose = Pose()
        #: The robot's heading as its HEAD command means it, radians, unwrapped.
        self.robot_heading_rad = 0.0
        self._anchor: tuple[Pose, RobotCounts] | None = None
        self._begin()

    def _begin(self) -> None:
        self._x, self._y = Unwrapper(POSITION_MASK + 1), Unwrapper(POSITION_MASK + 1)
        self._heading = Unwrapper(HEADING_COUNTS)
        self._first: tuple[int, int, int] | None = None

    def new_session(self) -> None:
        """Hold the pose until the next packet, which is taken to show the same place."""
        self._begin()
        self._anchor = None

    def place(self, pose: Pose) -> None:
        """Say where the robot is."""
        self.pose = pose
        if self._anchor is not None:
            self._anchor = (pose, self._counts_now)

    def take(self, sip: StandardSip, parameters: RobotParameters) -> Pose:
        """Follow the robot to the place that a packet tells, and return it."""
        raw = (sip.raw_x & POSITION_MASK, sip.raw_y & POSITION_MASK, sip.raw_heading)
        if self._first is None:
            # Positions begin near zero; one of the upper half is a small step backwards.
            half = (POSITION_MASK + 1) // 2
            self._first = ((raw[0] + half) % (2 * half) - half, (raw[1] + half) % (2 * half) - half,
                           (raw[2] + HEADING_COUNTS // 2) % HEADING_COUNTS - HEADING_COUNTS // 2)  # fmt: skip
        for unwrapper, value in zip((self._x, self._y, self._heading), raw, strict=True):
            unwrapper.update(value)
        distance = parameters.distance_conv_mm / 1000
        self._counts_now = RobotCounts(
            x_m=(self._first[0] + self._x.total) * distance,
            y_m=(self._first[1] + self._y.total) * distance,
            heading_rad=(self._first[2] + self._heading.total) * parameters.angle_conv_rad,
        )
        self.robot_heading_rad = self._counts_now.heading_rad
        if self._anchor is None:
            self._anchor = (self.pose, self._counts_now)
        self.pose = _moved(*self._anchor, self._counts_now)
        return self.pose


def _moved(start: Pose, then: RobotCounts, now: RobotCounts) -> Pose:
    """Return the pose of a robot that stood at `start` when it counted `then` and counts `now`."""
    turned = start.heading_rad - then.heading_rad
    cos, sin = math.cos(turned), math.sin(turned)
    dx, dy = now.x_m - then.x_m, now.y_m - then.y_m
    heading = start.heading_rad + now.heading_rad - then.heading_rad
    return Pose(start.x_m + cos * dx - sin * dy, start.y_m + sin * dx + cos * dy, heading)
