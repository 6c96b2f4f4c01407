"""Unwrap the counters of a SIP: positions of 15 bits, headings of 4096 counts.

Any step smaller than half of the modulus is exact, whatever the gap between
packets; a step of more than half looks like one the other way round.
"""

from dataclasses import dataclass

from p2os.protocol.sip import POSITION_MASK, StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: Positions are 15 bits wide in every firmware family (manuals, SIP table).
POSITION_MODULUS = POSITION_MASK + 1
#: As player, ROS and what is derived from them misread positions: 12 bits.
PLAYER_POSITION_MODULUS = 4096


class Unwrapper(Stateful):
    """Follow a counter that wraps.

    Args:
        modulus: How many values the counter has; 32768 for positions (12-bit readers take 4096).
    """

    STATE = ("total", "_last")

    __slots__ = ("_last", "modulus", "total")

    def __init__(self, modulus: int) -> None:
        self.modulus = modulus
        #: Counts since the first value, any size.
        self.total = 0
        self._last: int | None = None

    def update(self, raw: int) -> int:
        """Take a value; return the signed step since the last one, 0 for the first.

        The step lies in -modulus/2 (included) to modulus/2 (excluded).
        """
        value = raw % self.modulus
        if self._last is None:
            self._last = value
            return 0
        half = self.modulus // 2
        step = (value - self._last + half) % self.modulus - half
        self._last = value
        self.total += step
        return step

    def forget(self) -> None:
        """Take the next value as a new beginning; the total stays."""
        self._last = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryStep:
    """What one packet adds, in the robot's counts.

    Args:
        dx_counts: Along the robot's odometry x axis.
        dy_counts: Along its y axis.
        turn_counts: Counter-clockwise, 4096 to the turn.
        gap_ns: Since the packet before; 0 for the first.
        is_position_ambiguous: The robot could have driven half of the counter's span in the gap, so that the step
            may be one of several. It is counted as the shortest all the same: nothing is dropped.
        is_heading_ambiguous: It could have turned by half a turn in the gap.
    """

    dx_counts: int
    dy_counts: int
    turn_counts: int
    gap_ns: Nanos
    is_position_ambiguous: bool
    is_heading_ambiguous: bool

    @property
    def is_ambiguous(self) -> bool:
        """Whether the packets came too far apart to be sure of this step."""
        return self.is_position_ambiguous or self.is_heading_ambiguous


class Odometry(Stateful):
    """Follow a robot's position and heading over any number of wraps.

    Whole counts are kept and nothing else: a heading of ten thousand turns is as
    exact as that of the first.

    Args:
        parameters: The robot's conversions and the top speeds that decide what a gap makes ambiguous.
        position_modulus: 32768 (15 bits); 4096 for a robot that is read as player and ROS read it.
    """

    STATE = ("_x", "_y", "_heading", "_last_ns", "ambiguous_steps")

    def __init__(self, parameters: RobotParameters, *, position_modulus: int = POSITION_MODULUS) -> None:
        self._parameters = parameters
        self._x, self._y = Unwrapper(position_modulus), Unwrapper(position_modulus)
        self._heading = Unwrapper(parameters.angle_counts_per_turn)
        self._last_ns: Nanos | None = None
        half_span_nm = position_modulus // 2 * parameters.distance_nm_per_count
        # Nanometres through micrometres a second: microseconds, and so on to nanoseconds.
        self._longest_drive_ns = half_span_nm * 1000 // parameters.max_velocity_mm_s
        self._longest_turn_ns = 180 * NS_PER_S // parameters.max_rotation_deg_s
        #: Steps that packets too far apart have made ambiguous.
        self.ambiguous_steps = 0

    @property
    def x_m(self) -> float:
        """Metres along the odometry's x axis since the first packet."""
        return self._x.total * self._parameters.distance_nm_per_count / 1e9

    @property
    def y_m(self) -> float:
        """Metres along the odometry's y axis since the first packet."""
        return self._y.total * self._parameters.distance_nm_per_count / 1e9

    @property
    def heading_rad(self) -> float:
        """How far the robot has turned since the first packet, radians, never wrapped, + counter-clockwise."""
        return self._heading.total * self._parameters.angle_conv_rad

    @property
    def counts(self) -> tuple[int, int, int]:
        """x, y and heading since the first packet, in counts."""
        return self._x.total, self._y.total, self._heading.total

    def update(self, sip: StandardSip, now: Nanos) -> OdometryStep:
        """Take a packet that arrived at `now` nanoseconds, and return what it adds."""
        gap = 0 if self._last_ns is None else now - self._last_ns
        self._last_ns = now
        step = OdometryStep(
            dx_counts=self._x.update(sip.raw_x),
            dy_counts=self._y.update(sip.raw_y),
            turn_counts=self._heading.update(sip.raw_heading),
            gap_ns=gap,
            is_position_ambiguous=gap >= self._longest_drive_ns,
            is_heading_ambiguous=gap >= self._longest_turn_ns,
        )
        self.ambiguous_steps += step.is_ambiguous
        return step
