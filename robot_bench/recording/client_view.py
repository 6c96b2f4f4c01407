"""A real or simulated robot as its client sees it: ranges and odometry, out of the standard packets alone.

Not the truth: with a real robot nothing else is known. A Pioneer 2 sends two sonar
readings a packet; the others keep their last value, and before the first reading the
sonar's longest range. What the wheels have turned follows from position and heading;
collisions are unknown.

Invariant: poses are the trace's integers: micrometres, microradians, µm/s.
"""

import math
from collections.abc import Callable, Sequence

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.frames import Frame
from p2os.protocol.odometry import POSITION_MODULUS, Unwrapper
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from p2os.robots.parameters import RobotParameters
from robot_bench.events.kinds import Pose
from simbase.state import Stateful
from simbase.timing import Nanos

UM_PER_M = 1_000_000
NM_PER_UM = 1_000


class SipRanges(Stateful):
    """Ranges of all fitted sonar; `on_ranges` is called after each packet that brings a reading."""

    STATE = ("_ranges_m",)

    def __init__(
        self, parameters: RobotParameters, profile: Profile, *, on_ranges: Callable[[Nanos, Sequence[float]], None]
    ) -> None:
        self._profile = profile
        self._parameters = parameters
        self._on_ranges = on_ranges
        self._ranges_m = [parameters.sonar_range_m] * parameters.sonar_fitted

    def take(self, data: bytes, now: Nanos) -> None:
        """Look into one frame; anything but a standard packet is passed over."""
        try:
            frame = Frame.from_bytes(data)
            if frame.kind not in SIP_KINDS:
                return
            sip = StandardSip.from_frame(frame, self._profile)
        except (LocalProtocolError, RemoteProtocolError):  # a noisy line: no sound frame
            return
        self.take_sip(sip, now)

    def take_sip(self, sip: StandardSip, now: Nanos) -> None:
        """Take the readings of a standard packet."""
        for reading in sip.sonar:
            if reading.number < len(self._ranges_m):
                metres = reading.raw_range * self._parameters.range_um_per_count / UM_PER_M
                self._ranges_m[reading.number] = min(metres, self._parameters.sonar_range_m)
        if sip.sonar:
            self._on_ranges(now, self._ranges_m)


class OdometryPose:
    """Follows the standard packets of one session."""

    def __init__(self, parameters: RobotParameters) -> None:
        self._parameters = parameters
        self._x, self._y = Unwrapper(POSITION_MODULUS), Unwrapper(POSITION_MODULUS)
        self._heading = Unwrapper(parameters.angle_counts_per_turn)
        self._forward_m = 0.0
        #: Path over ground, metres.
        self.distance_m = 0.0

    def take(self, sip: StandardSip, now: Nanos) -> Pose:
        """Return the pose that a packet tells; its wheel angles count from the first packet."""
        per_count_um = self._parameters.distance_nm_per_count / NM_PER_UM
        dx, dy = self._x.update(sip.raw_x), self._y.update(sip.raw_y)
        self.distance_m += math.hypot(dx, dy) * per_count_um / 1e6
        left_angle, right_angle = self._angles(dx * per_count_um / 1e6, dy * per_count_um / 1e6, sip.raw_heading)
        turn = sip.raw_heading / self._parameters.angle_counts_per_turn * 2 * math.pi
        speed_um = self._parameters.velocity_um_s_per_count
        return Pose(
            t=now,
            x=round(self._x.total * per_count_um),
            y=round(self._y.total * per_count_um),
            z=0,
            heading=round(turn * 1e6),
            pitch=0,
            left=sip.raw_left_velocity * speed_um,
            right=sip.raw_right_velocity * speed_um,
            left_angle=round(left_angle * 1e6),
            right_angle=round(right_angle * 1e6),
            collisions=0,
        )

    def _angles(self, dx_m: float, dy_m: float, raw_heading: int) -> tuple[float, float]:
        """Return what the wheels have turned, radians, after a step along an arc that ends with this heading."""
        parameters = self._parameters
        per_count = 2 * math.pi / parameters.angle_counts_per_turn
        turned = self._heading.update(raw_heading) * per_count
        middle = raw_heading * per_count - turned / 2
        chord_m = dx_m * math.cos(middle) + dy_m * math.sin(middle)
        self._forward_m += chord_m * (turned / 2 / math.sin(turned / 2) if turned else 1.0)
        rim_m = self._heading.total * per_count * parameters.track_mm / 2000
        radius_m = parameters.body.wheel_diameter_m / 2
        return (self._forward_m - rim_m) / radius_m, (self._forward_m + rim_m) / radius_m
