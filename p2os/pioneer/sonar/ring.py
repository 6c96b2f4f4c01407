"""The sonar ring as rays, and the infra-red eyes: one geometry for every body.

Each sonar is rays spread over the opening angle of the robot file, in the
plane of the ring; the nearest echo of them is the reading. Not modelled here:
specular loss, crosstalk, noise.
"""

import math
from dataclasses import dataclass

from p2os.robots.parameters import RobotParameters

#: Rays a cone, evenly over the opening angle, both edges included.
RAYS_PER_CONE = 9


@dataclass(frozen=True, slots=True)
class Cone:
    """One sonar: where it sits in the robot frame, and the headings of its rays."""

    x_m: float
    y_m: float
    #: The rightmost first.
    headings_rad: tuple[float, ...]
    #: The same as unit vectors.
    directions: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class Eye(Cone):
    """An infra-red eye: one ray from the middle of the axle to where it sees."""

    length_m: float


def eyes(parameters: RobotParameters) -> tuple[Eye, ...]:
    """Return each infra-red eye, number 0 first.

    ARIA's parameter file has where a thing is that an eye sees, not where the eye is. Something on the way there from
    the middle of the robot, beyond its hull, is seen; what stands within the hull's outline never is.
    """
    found = []
    for x_mm, y_mm in parameters.infrared:
        length, heading = math.hypot(x_mm, y_mm) / 1000, math.atan2(y_mm, x_mm)
        found.append(Eye(0.0, 0.0, (heading,), ((math.cos(heading), math.sin(heading)),), length))
    return tuple(found)


def cones(parameters: RobotParameters) -> tuple[Cone, ...]:
    """Return the cone of each fitted sonar, number 0 first."""
    half = math.radians(parameters.sonar_cone_deg) / 2
    rays = [half * (2 * ray / (RAYS_PER_CONE - 1) - 1) for ray in range(RAYS_PER_CONE)]
    found = []
    for pose in parameters.sonar[: parameters.sonar_fitted]:
        headings = tuple(math.radians(pose.heading_deg) + offset for offset in rays)
        directions = tuple((math.cos(heading), math.sin(heading)) for heading in headings)
        found.append(Cone(pose.x_mm / 1000, pose.y_mm / 1000, headings, directions))
    return tuple(found)


def reading(nearest_m: float, parameters: RobotParameters) -> float:
    """Return what a sonar reports of its nearest echo: no less than its least range, no more than its longest."""
    return min(max(nearest_m, parameters.sonar_min_range_m), parameters.sonar_range_m)
