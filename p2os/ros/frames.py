"""Where the parts of a robot are: frames and transforms, as TF and the URDF have them.

`base_link` is the middle of the axle on the floor, x ahead, y to the left, z up (REP 103, 105); a sonar's frame looks
along its x. A wheel turns about its y, forward where positive.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from p2os.robots.parameters import RobotParameters
from p2os.ros.codec import Message
from simbase.timing import NS_PER_S, Nanos

ODOM, BASE, CASTER, LASER = "odom", "base_link", "caster", "laser"


@dataclass(frozen=True, slots=True)
class Frames:
    """The frames of one robot.

    Args:
        parameters: Its measures.
        prefix: What the names begin with, such as "robot1/"; "" for none.
        has_laser: Whether a simulated one is on it, where the parameters say.
    """

    parameters: RobotParameters
    prefix: str = ""
    has_laser: bool = False

    @classmethod
    def of(cls, parameters: RobotParameters, namespace: str, *, has_laser: bool = False) -> "Frames":
        """Return the frames of a robot in a namespace of ROS."""
        return cls(parameters, f"{namespace.strip('/')}/" if namespace else "", has_laser)

    def name(self, frame: str) -> str:
        """Return a frame's whole name."""
        return self.prefix + frame

    @property
    def joints(self) -> list[str]:
        """Return the names of the wheels' joints, in the order of `wheel_places`."""
        return [f"{frame_of(wheel.name)}_joint" for wheel in self.parameters.wheel_places]

    def of_wheels(self, sides: tuple[float, float]) -> list[float]:
        """Return for each joint what its side has, left first."""
        return [sides[0] if wheel.is_left else sides[1] for wheel in self.parameters.wheel_places]

    def sonar(self, number: int) -> str:
        """Return the name of a sonar's frame."""
        return self.name(f"sonar_{number}")

    def fixed(self, stamp: Nanos, sonars: Iterable[int]) -> list[Message]:
        """Return what never moves on the robot: these sonar, the laser, and the caster."""
        parameters, base = self.parameters, self.name(BASE)
        found = []
        for number in sonars:
            place = parameters.sonar[number]
            at = (place.x_mm / 1000, place.y_mm / 1000, parameters.sonar_height_m)
            turned = about_z(math.radians(place.heading_deg))
            found.append(transform(stamp, base, self.sonar(number), at, turned))
        if self.has_laser:
            laser = parameters.equipment
            at = (laser.laser_x_mm / 1000, laser.laser_y_mm / 1000, parameters.sonar_height_m)
            found.append(transform(stamp, base, self.name(LASER), at, about_z(0.0)))
        if parameters.has_caster:
            at = (parameters.body.caster_x_m, 0.0, parameters.body.caster_radius_m)
            found.append(transform(stamp, base, self.name(CASTER), at, about_z(0.0)))
        return found

    def moving(self, stamp: Nanos, pose: tuple[float, float, float], wheels_rad: tuple[float, float]) -> list[Message]:
        """Return the robot's pose (x, y, heading) in `odom`, and its wheels in it, turned as their sides are."""
        base = self.name(BASE)
        found = [transform(stamp, self.name(ODOM), base, (*pose[:2], 0.0), about_z(pose[2]))]
        for wheel, angle in zip(self.parameters.wheel_places, self.of_wheels(wheels_rad), strict=True):
            at = (wheel.x_m, wheel.y_m, self.parameters.body.wheel_diameter_m / 2)
            found.append(transform(stamp, base, self.name(frame_of(wheel.name)), at, about_y(angle)))
        return found


def frame_of(part: str) -> str:
    """Return the frame of a robot's part, as its parameters call it."""
    return part.replace(" ", "_")


def transform(stamp: Nanos, parent: str, child: str, at: tuple[float, float, float], turned: Message) -> Message:
    """Return a geometry_msgs/TransformStamped."""
    x, y, z = at
    return {
        "header": header(stamp, parent),
        "child_frame_id": child,
        "transform": {"translation": {"x": x, "y": y, "z": z}, "rotation": turned},
    }


def header(stamp: Nanos, frame: str) -> Message:
    """Return a std_msgs/Header."""
    return {"stamp": time_of(stamp), "frame_id": frame}


def time_of(stamp: Nanos) -> Message:
    """Return a builtin_interfaces/Time: nanoseconds since 1970, or of virtual time."""
    return {"sec": stamp // NS_PER_S, "nanosec": stamp % NS_PER_S}


def about_z(angle_rad: float) -> Message:
    """Return the quaternion of a turn about z, counter-clockwise seen from above."""
    return {"x": 0.0, "y": 0.0, "z": math.sin(angle_rad / 2), "w": math.cos(angle_rad / 2)}


def about_y(angle_rad: float) -> Message:
    """Return the quaternion of a turn about y: forward, for a wheel."""
    return {"x": 0.0, "y": math.sin(angle_rad / 2), "z": 0.0, "w": math.cos(angle_rad / 2)}
