"""What a robot model is: conversions of the wire, limits, equipment, sonar ring and body.

Where the numbers come from is said in `p2os/robots/*.toml`, each beside its
number; `p2os.robots.parameters` loads them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from simbase.errors import FileError

#: Families of firmware, whose packets differ: the names of `p2os.protocol.profiles.Profile`.
FIRMWARE = ("P2OS", "AROS", "ARCOS")


class ParametersError(FileError):
    """A robot file is missing or breaks its schema."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SonarPose:
    """Where a sonar sits and looks, robot frame (x forward, y left, + counter-clockwise)."""

    x_mm: float
    y_mm: float
    heading_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyParameters:
    """The robot as a physical thing; metres from the middle of the axle."""

    hull_front_m: float
    hull_rear_m: float
    hull_width_m: float
    hull_height_m: float
    ground_clearance_m: float
    mass_kg: float
    wheel_diameter_m: float
    wheel_width_m: float
    wheel_mass_kg: float
    caster_radius_m: float
    caster_x_m: float
    #: Of each driven wheel.
    motor_torque_nm: float
    #: Between the middles of the first and the last axle, and of an axle's wheels, where there is more than one axle;
    #: 0: as far as the hull reaches.
    axle_distance_m: float = 0.0
    wheel_distance_m: float = 0.0


#: Axles → what the names of their wheels begin with, the first axle before the others.
AXLES: Mapping[int, tuple[str, ...]] = {1: ("",), 2: ("front ", "rear ")}


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelPlace:
    """Where the middle of a driven wheel is, robot frame, metres."""

    name: str
    x_m: float
    y_m: float

    @property
    def is_left(self) -> bool:
        """Whether it turns as the robot's left side does."""
        return self.y_m > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDefaults:
    """Limits with which the robot starts, until a client sets others."""

    max_velocity_mm_s: int
    max_rotation_deg_s: int
    accel_mm_s2: int
    decel_mm_s2: int
    rot_accel_deg_s2: int
    rot_decel_deg_s2: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Equipment:
    """What a model has beside wheels and sonar."""

    #: Segments of each bumper; 0 where the model comes without.
    front_bumpers: int = 0
    rear_bumpers: int = 0
    #: Whether the firmware knows MOVE.
    has_move: bool = True
    #: Whether ARIA asks this model for IOpacs by itself: its bumpers and infra-red eyes are only there.
    sends_io_packets: bool = False
    #: Driven wheels, in pairs.
    wheels: int = 2
    #: Largest sideways speed, 0 where it cannot.
    max_lateral_mm_s: int = 0
    #: Where a simulated laser stands, if there is one.
    laser_x_mm: int = 0
    laser_y_mm: int = 0
    #: GyroScaler of ARIA's parameter file.
    gyro_scaler: float = 1.626


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotParameters:
    """All that is known of a robot model."""

    subclass: str
    robot_class: str
    title: str
    #: Families of the firmware that the model had, its usual one first.
    firmware: tuple[str, ...] = FIRMWARE[:1]
    distance_nm_per_count: int
    angle_counts_per_turn: int
    #: A few models count speeds and ranges in fractions of a micrometre (a second): nanometres keep them exact.
    velocity_nm_s_per_count: int
    range_nm_per_count: int
    vel2_divisor_mm_s: int
    #: Effective distance of the wheels for controller, adapter and body alike.
    track_mm: int
    max_velocity_mm_s: int
    max_rotation_deg_s: int
    radius_mm: int
    width_mm: int
    length_mm: int
    front_mm: int
    rear_mm: int
    equipment: Equipment
    motion: MotionDefaults
    #: How many of the poses have a sonar, from number 0.
    sonar_fitted: int
    sonar_range_m: float
    sonar_min_range_m: float
    #: Total opening angle of a sonar's cone.
    sonar_cone_deg: float
    sonar_height_m: float
    sonar: tuple[SonarPose, ...]
    #: Where each infra-red eye sees a thing, mm: x forward, y left.
    infrared: tuple[tuple[float, float], ...] = ()
    #: What each motor adds to the inertia of its wheel, behind its gear; 0 where wheels are told speeds.
    rotor_inertia_kg_m2: float = 0.0
    body: BodyParameters

    @property
    def has_caster(self) -> bool:
        """Whether a caster rolls behind a single pair of wheels."""
        return self._axles == 1

    @property
    def wheel_places(self) -> tuple[WheelPlace, ...]:
        """Return where the driven wheels are, from the front, left before right.

        A single pair stands as far apart as the controller reckons (`track_mm`). Several slip as the robot turns, and
        that effective distance is no place then.
        """
        body, axles = self.body, self._axles
        long_m, wide_m = 0.0, self.track_mm / 1000
        if axles > 1:
            long_m = body.axle_distance_m or body.hull_front_m + body.hull_rear_m - body.wheel_diameter_m
            wide_m = body.wheel_distance_m or max(body.hull_width_m - body.wheel_width_m, body.wheel_width_m)
        starts = AXLES.get(axles) or tuple(f"axle {number + 1} " for number in range(axles))
        return tuple(
            WheelPlace(
                name=f"{start}{side} wheel", y_m=wide_m / 2 * sign,
                x_m=long_m / 2 - (long_m * number / (axles - 1) if axles > 1 else 0.0),
            )
            for number, start in enumerate(starts) for side, sign in (("left", 1), ("right", -1))
        )  # fmt: skip

    @property
    def _axles(self) -> int:
        return max(1, self.equipment.wheels // 2)

    def with_every_sonar(self) -> "RobotParameters":
        """Return the same robot with a sonar at each of its poses: with the rear ring that is an option of it."""
        return replace(self, sonar_fitted=len(self.sonar))

    @property
    def distance_conv_mm(self) -> float:
        """DistConvFactor, mm a count."""
        return self.distance_nm_per_count / 1e6

    @property
    def angle_conv_rad(self) -> float:
        """AngleConvFactor, radians a count."""
        return 2 * math.pi / self.angle_counts_per_turn

    @property
    def velocity_conv(self) -> float:
        """VelConvFactor, mm/s a count."""
        return self.velocity_nm_s_per_count / 1e6

    @property
    def velocity_um_s_per_count(self) -> int:
        """VelConvFactor to a micrometre a second, for integer arithmetic."""
        return round(self.velocity_nm_s_per_count / 1000)

    @property
    def range_conv_mm(self) -> float:
        """RangeConvFactor, mm a count."""
        return self.range_nm_per_count / 1e6

    @property
    def range_um_per_count(self) -> int:
        """RangeConvFactor to a micrometre, for integer arithmetic."""
        return round(self.range_nm_per_count / 1000)

    @property
    def vel2_divisor(self) -> int:
        """Vel2Divisor, mm/s a step."""
        return self.vel2_divisor_mm_s
