"""Where the robot is, followed over wraps of its counters and over sessions.

The robot counts from where its session opened. A client's pose goes on: at the
first packet of a later session the robot is taken to stand where it was last
seen, since nobody knows how far it was carried meanwhile.

Invariant: within a session the pose is the robot's own odometry, moved and
turned by one fixed amount; nothing is accumulated but whole counts.
"""

import math

from p2os.client.snapshots import Pose
from p2os.odometry import POSITION_MODULUS, Odometry
from p2os.parameters import RobotParameters
from p2os.sip import StandardSip
from p2os.timing import Nanos


class PoseKeeper:
    """Turns the counters of the packets into one pose."""

    def __init__(self) -> None:
        self.pose = Pose()
        #: The robot's own count since its session opened; HEAD means its heading.
        self.odometry = Pose()
        #: Between the last two packets of this session.
        self.gap_ns: Nanos = 0
        self._anchor: tuple[Pose, Pose] | None = None
        self._odometry: Odometry | None = None

    def new_session(self) -> None:
        """Hold the pose until the next packet, which is taken to show the same place."""
        self._anchor = self._odometry = None

    def place(self, pose: Pose) -> None:
        """Say where the robot is."""
        self.pose = pose
        if self._anchor is not None:
            self._anchor = (pose, self.odometry)

    def take(self, sip: StandardSip, parameters: RobotParameters, now: Nanos) -> Pose:
        """Follow the robot to the place that a packet tells, and return it."""
        if self._odometry is None:
            self._odometry = Odometry(parameters)
            # Positions begin near zero; one of the upper half is a small step backwards.
            turn = parameters.angle_counts_per_turn
            self._first = (_signed(sip.raw_x, POSITION_MODULUS), _signed(sip.raw_y, POSITION_MODULUS),
                           _signed(sip.raw_heading, turn))  # fmt: skip
        self.gap_ns = self._odometry.update(sip, now).gap_ns
        x, y, heading = (first + way for first, way in zip(self._first, self._odometry.counts, strict=True))
        distance = parameters.distance_conv_mm / 1000
        self.odometry = Pose(x * distance, y * distance, heading * parameters.angle_conv_rad)
        if self._anchor is None:
            self._anchor = (self.pose, self.odometry)
        self.pose = _moved(*self._anchor, self.odometry)
        return self.pose


def _signed(raw: int, modulus: int) -> int:
    half = modulus // 2
    return (raw + half) % modulus - half


def _moved(start: Pose, then: Pose, now: Pose) -> Pose:
    """Return the pose of a robot that stood at `start` when it counted `then` and counts `now`."""
    turned = start.heading_rad - then.heading_rad
    cos, sin = math.cos(turned), math.sin(turned)
    dx, dy = now.x_m - then.x_m, now.y_m - then.y_m
    heading = start.heading_rad + now.heading_rad - then.heading_rad
    return Pose(start.x_m + cos * dx - sin * dy, start.y_m + sin * dx + cos * dy, heading)
