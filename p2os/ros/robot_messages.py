"""What of a robot becomes which message: pure functions of values in SI units.

Units and frames are REP 103's and 105's; ranges without an echo REP 117's.

Covariances. Of the pose, one count of the wire at first, and a robot's own count errs by a share of its way and of its
turns (`ODOMETRY_ERROR`), so the variances grow with both; what a planar robot cannot do has `UNKNOWN`. Of the speeds,
the wire's whole mm/s and deg/s. None is ever 0, which a filter would take for certainty.
"""

import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from p2os.client.robot_state import RobotState, SonarEcho
from p2os.pioneer.devices.laser import LaserModel
from p2os.protocol.packets import SimLaserPacket
from p2os.protocol.times import CYCLE_NS
from p2os.robots.parameters import RobotParameters
from p2os.ros.codec import Message
from p2os.ros.frames import BASE, LASER, ODOM, Frames, about_z, header
from simbase.timing import NS_PER_S, Nanos

#: metres a metre and radians a radian: the odometry's error of AMRISim's Pioneers.
ODOMETRY_ERROR = 0.0075
#: chosen: the variance of what is not measured, as ROS' own drivers have it.
UNKNOWN = 1e6
#: Variance of a place that is sent in whole mm: one count.
PLACE_VARIANCE = 1e-6
#: Variances of a speed that is sent in whole mm/s, and of a turning speed made of two such: one count of each.
SPEED_VARIANCE, TURN_VARIANCE = 1e-6, 1e-4
#: The first variance of a measure that is not there (sensor_msgs/Imu).
NOT_MEASURED = -1.0
ULTRASOUND = 0
FLOAT32 = 7
#: power_supply_status, -health and -technology of sensor_msgs/BatteryState; lead and acid have no number.
UNKNOWN_STATUS, DISCHARGING = 0, 2
OK, WARN, ERROR = 0, 1, 2
_POINT = struct.Struct("<fff")
#: Name, level, message, values.
HealthRow: TypeAlias = tuple[str, int, str, Mapping[str, object]]


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryMotion:
    """Where a robot is and how it moves; metres, radians, seconds."""

    x_m: float
    y_m: float
    heading_rad: float
    forward_mps: float
    turn_radps: float
    #: Angles of the wheels since the beginning, and their rates, left first.
    wheels_rad: tuple[float, float]
    rates_radps: tuple[float, float]
    #: Its way and its turns so far, without sign.
    way_m: float = 0.0
    turned_rad: float = 0.0


class WheelTravel:
    """Follows the poses of a robot that does not report its wheels.

    The wheels' angles are what the poses' ways and turns make of them: display values, which drift as sums do.
    """

    def __init__(self, parameters: RobotParameters) -> None:
        self._half_track_m = parameters.track_mm / 2000
        self._radius_m = parameters.body.wheel_diameter_m / 2
        self._last: tuple[float, float, float] | None = None
        self._forward_m = self._heading_rad = self._way_m = self._turned_rad = 0.0

    def take(self, state: RobotState) -> OdometryMotion:
        """Return the motion of the robot at its newest state."""
        pose = state.pose
        here = (pose.x_m, pose.y_m, pose.heading_rad)
        if self._last is not None:
            x, y, heading = self._last
            mean = (heading + pose.heading_rad) / 2
            step = (pose.x_m - x) * math.cos(mean) + (pose.y_m - y) * math.sin(mean)
            turn = pose.heading_rad - heading
            self._forward_m += step
            self._heading_rad += turn
            self._way_m += abs(step)
            self._turned_rad += abs(turn)
        self._last = here
        rim_m = self._heading_rad * self._half_track_m
        return OdometryMotion(
            x_m=pose.x_m, y_m=pose.y_m, heading_rad=pose.heading_rad,
            forward_mps=state.forward_mps, turn_radps=state.turn_radps,
            wheels_rad=((self._forward_m - rim_m) / self._radius_m, (self._forward_m + rim_m) / self._radius_m),
            rates_radps=(state.left_mps / self._radius_m, state.right_mps / self._radius_m),
            way_m=self._way_m, turned_rad=self._turned_rad,
        )  # fmt: skip

    def jump(self) -> None:
        """Take the next pose as a place that the robot was put to."""
        self._last = None


def odometry(stamp: Nanos, frames: Frames, motion: OdometryMotion) -> Message:
    """Return a nav_msgs/Odometry."""
    place = (ODOMETRY_ERROR * motion.way_m) ** 2
    turn = (ODOMETRY_ERROR * motion.turned_rad) ** 2
    # A wrong heading carries the robot aside by as much of its way.
    place += turn * motion.way_m**2 + PLACE_VARIANCE
    turn += frames.parameters.angle_conv_rad**2
    return {
        "header": header(stamp, frames.name(ODOM)),
        "child_frame_id": frames.name(BASE),
        "pose": {
            "pose": {
                "position": {"x": motion.x_m, "y": motion.y_m, "z": 0.0},
                "orientation": about_z(motion.heading_rad),
            },
            "covariance": planar(place, place, turn),
        },
        "twist": {
            "twist": {"linear": _vector(motion.forward_mps), "angular": _vector(0.0, 0.0, motion.turn_radps)},
            "covariance": planar(SPEED_VARIANCE, SPEED_VARIANCE, TURN_VARIANCE),
        },
    }


def planar(x: float, y: float, yaw: float) -> list[float]:
    """Return a covariance of 6 x 6 with these variances, and the rest of the diagonal unknown."""
    diagonal = (x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw)
    return [diagonal[row] if row == column else 0.0 for row in range(6) for column in range(6)]


def joint_state(stamp: Nanos, frames: Frames, motion: OdometryMotion) -> Message:
    """Return a sensor_msgs/JointState of the wheels."""
    return {
        "header": header(stamp, frames.name(BASE)),
        "name": frames.joints,
        "position": frames.of_wheels(motion.wheels_rad),
        "velocity": frames.of_wheels(motion.rates_radps),
    }


def sonar_range(stamp: Nanos, frames: Frames, number: int, range_m: float) -> Message:
    """Return a sensor_msgs/Range of a sonar; what is beyond its reach is +inf, what is nearer than it sees -inf."""
    parameters = frames.parameters
    return {
        "header": header(stamp, frames.sonar(number)),
        "radiation_type": ULTRASOUND,
        "field_of_view": math.radians(parameters.sonar_cone_deg),
        "min_range": parameters.sonar_min_range_m,
        "max_range": parameters.sonar_range_m,
        "range": seen_as(range_m, parameters.sonar_min_range_m, parameters.sonar_range_m),
    }


def sonar_points(stamp: Nanos, frames: Frames, echoes: Iterable[SonarEcho]) -> Message:
    """Return a sensor_msgs/PointCloud2 of echoes in `base_link`, each on its sonar's axis."""
    high = frames.parameters.sonar_height_m
    points = [_POINT.pack(echo.x_m, echo.y_m, high) for echo in echoes if echo.is_echo]
    return {
        "header": header(stamp, frames.name(BASE)),
        "height": 1,
        "width": len(points),
        "fields": [
            {"name": name, "offset": 4 * place, "datatype": FLOAT32, "count": 1} for place, name in enumerate("xyz")
        ],
        "point_step": _POINT.size,
        "row_step": _POINT.size * len(points),
        "data": b"".join(points),
        "is_dense": True,
    }


class Scans:
    """Puts the packets of a simulated laser together.

    Args:
        laser: Its field, step and ranges.
        frames: The robot's.
        cycle_ns: How often the robot reports: a sweep comes with each packet, all rays of it at one moment.
    """

    def __init__(self, laser: LaserModel, frames: Frames, cycle_ns: Nanos = CYCLE_NS) -> None:
        self._laser, self._frames, self._cycle_ns = laser, frames, cycle_ns
        self._ranges_m: list[float] = []
        #: When the sweep's first ray came.
        self._stamp: Nanos = 0

    def take(self, packet: SimLaserPacket, stamp: Nanos) -> Message | None:
        """Return a sensor_msgs/LaserScan with the last packet of a sweep; a sweep with a gap is left out.

        Args:
            packet: The next one.
            stamp: When it came; a scan has that of its first ray.
        """
        if packet.first == 0:
            self._ranges_m, self._stamp = [], stamp
        if packet.first != len(self._ranges_m):
            return None
        self._ranges_m += [mm / 1000 for mm in packet.ranges_mm]
        if len(self._ranges_m) != packet.total or packet.total != self._laser.readings:
            return None
        laser, step_rad = self._laser, math.radians(self._laser.step_cdeg / 100)
        first_rad = math.radians(laser.start_deg)
        return {
            "header": header(self._stamp, self._frames.name(LASER)),
            "angle_min": first_rad,
            "angle_max": first_rad + step_rad * (laser.readings - 1),
            "angle_increment": step_rad,
            "time_increment": 0.0,
            "scan_time": self._cycle_ns / NS_PER_S,
            "range_min": laser.nearest_m,
            "range_max": laser.range_m,
            "ranges": [seen_as(one, laser.nearest_m, laser.range_m) for one in self._ranges_m],
        }


def seen_as(range_m: float, nearest_m: float, farthest_m: float) -> float:
    """Return a range as ROS has it: +inf where there is no echo, -inf what is nearer than the sensor sees (REP 117)."""
    if range_m >= farthest_m:
        return math.inf
    return -math.inf if range_m < nearest_m else range_m


def battery(stamp: Nanos, state: RobotState) -> Message:
    """Return a sensor_msgs/BatteryState; what the robot does not report is NaN."""
    unknown = dict.fromkeys(("current", "charge", "capacity", "design_capacity"), math.nan)
    return {
        "header": header(stamp, ""),
        "voltage": state.battery_v,
        "temperature": math.nan if state.temperature_c is None else state.temperature_c,
        **unknown,
        # ARCOS robots without a gauge send 0.
        "percentage": state.state_of_charge or math.nan,
        "power_supply_status": DISCHARGING,
        "power_supply_health": UNKNOWN_STATUS,
        "power_supply_technology": UNKNOWN_STATUS,
        "present": True,
    }


def bumpers(pressed: Sequence[int], fitted: int) -> Message:
    """Return a std_msgs/UInt8MultiArray with a 1 for each segment that is pressed; they are numbered from 1."""
    return {
        "layout": {"dim": [{"label": "segment", "size": fitted, "stride": fitted}], "data_offset": 0},
        "data": [int(segment in pressed) for segment in range(1, fitted + 1)],
    }


def compass(stamp: Nanos, frames: Frames, heading_rad: float) -> Message:
    """Return a sensor_msgs/Imu that holds a heading only; x is east in REP 105, where a compass counts from north."""
    none = [NOT_MEASURED] + [0.0] * 8
    # Counts of 2 degrees, evenly spread.
    variance = math.radians(2) ** 2 / 12
    return {
        "header": header(stamp, frames.name(BASE)),
        "orientation": about_z(math.remainder(math.pi / 2 - heading_rad, math.tau)),
        "orientation_covariance": [UNKNOWN, 0.0, 0.0, 0.0, UNKNOWN, 0.0, 0.0, 0.0, variance],
        "angular_velocity_covariance": none,
        "linear_acceleration_covariance": none,
    }


def diagnostics(stamp: Nanos, rows: Iterable[HealthRow]) -> Message:
    """Return a diagnostic_msgs/DiagnosticArray of rows."""
    return {
        "header": header(stamp, ""),
        "status": [
            {
                "level": level,
                "name": f"p2os: {name}",
                "message": message,
                "hardware_id": "p2os",
                "values": [{"key": key, "value": f"{value}"} for key, value in values.items()],
            }
            for name, level, message, values in rows
        ],
    }


def health(state: RobotState | None, link: str, *, is_open: bool, counts: Mapping[str, object]) -> list[HealthRow]:
    """Return the rows of `diagnostics` for a robot.

    Args:
        state: The newest; None before the first.
        link: Where the client stands with the robot, in words.
        is_open: Whether packets flow.
        counts: Of what came over the network.
    """
    rows: list[HealthRow] = [("link", OK if is_open else ERROR, link, counts)]
    if state is None:
        return rows
    stalled = [side for side, is_so in (("left", state.stall_left), ("right", state.stall_right)) if is_so]
    motors = {None: "not reported", True: "on", False: "off"}[state.motors_enabled]
    rows.append(("wheels", WARN if stalled else OK, f"stalled: {', '.join(stalled)}" if stalled else "turning freely",
                 {"motors": motors, "STOP button": state.stop_button or False}))  # fmt: skip
    rows.append(("battery", OK, f"{state.battery_v:.1f} V", {"volts": f"{state.battery_v:.1f}"}))
    return rows


def _vector(x: float, y: float = 0.0, z: float = 0.0) -> Message:
    return {"x": x, "y": y, "z": z}
