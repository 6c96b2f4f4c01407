"""What a trace tells of the robot's surroundings: where it was, what was in the cones of its sensors, how it moved.

A cone is the one of the robot's model, in the plan; a point nearer than the threshold inside of it is to be seen.
Not known: what a thing that has moved looked like before (the contact's point is taken to stand still).

Invariant: it comes from the trace alone.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

from robot_bench.events.codec import Json
from robot_bench.events.kinds import Contact, Pose
from robot_bench.recording.run_record import RunRecord
from simbase.timing import NS_PER_S, Nanos

#: chosen: metres; a point so near to the border of the threshold is neither surely inside nor outside.
EDGE_M = 0.03
#: chosen: a program that knows nothing of its way still gives up what it does after so long, where no scenario says it.
GIVES_UP_S = 15.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A distance sensor: its wire, where it stands on the robot, and where it looks."""

    net: str
    x_m: float
    y_m: float
    heading_rad: float

    @property
    def side(self) -> str:
        """On which side it looks."""
        return "left" if self.heading_rad > 0 else "right"


class Scene:
    """The surroundings of one run's robot."""

    def __init__(self, record: RunRecord) -> None:
        self.record = record
        robot = cast("Json", record.meta.get("robot") or {})
        places = cast("Sequence[Sequence[float]]", robot.get("sonar") or ())
        nets = sorted((net for net in record.pins if net.startswith("DD")), key=lambda net: int(net[2:]))
        self.sensors = [
            Sensor(net=net, x_m=x, y_m=y, heading_rad=heading)
            for net, (x, y, heading) in zip(nets, places, strict=False)
        ]
        self.cone_rad = float(cast("float", robot.get("sonar_cone_rad", 0.52)))
        self.threshold_m = float(cast("float", record.meta.get("threshold_m") or 0.5))
        self.step_mps = record.step_mps
        #: For so long the program may go on with what it does before it does something else.
        self.gives_up_ns: Nanos = round(float(cast("float", record.meta.get("gives_up_s") or GIVES_UP_S)) * NS_PER_S)

    @cached_property
    def _pose_times(self) -> list[Nanos]:
        return [pose.t for pose in self.record.poses]

    def pose(self, at: Nanos) -> Pose:
        """Return the last recorded pose at a time."""
        return self.record.poses[max(0, bisect_right(self._pose_times, at) - 1)]

    def poses(self, since: Nanos, until: Nanos) -> list[Pose]:
        """Return the poses of a time."""
        return self.record.poses[bisect_right(self._pose_times, since - 1) : bisect_right(self._pose_times, until)]

    def bearing_rad(self, hit: Contact) -> float:
        """Return where a contact is, seen from the robot's centre: counter-clockwise from ahead."""
        pose = self.pose(hit.t)
        angle = math.atan2(hit.y_m - pose.y_m, hit.x_m - pose.x_m) - pose.heading_rad
        return math.remainder(angle, math.tau)

    def inside_m(self, sensor: Sensor, pose: Pose, x_m: float, y_m: float) -> float:
        """Return by how much a point is nearer than the threshold and inside a sensor's cone, m; negative outside."""
        c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        at_x = pose.x_m + c * sensor.x_m - s * sensor.y_m
        at_y = pose.y_m + s * sensor.x_m + c * sensor.y_m
        away = math.hypot(x_m - at_x, y_m - at_y)
        off = math.remainder(math.atan2(y_m - at_y, x_m - at_x) - pose.heading_rad - sensor.heading_rad, math.tau)
        return min(self.threshold_m - away, (self.cone_rad / 2 - abs(off)) * max(away, 0.1))

    def should_see(self, hit: Contact, since: Nanos) -> dict[str, Nanos]:
        """Return the sensors in whose cones the place of a contact surely was, and since when."""
        found: dict[str, Nanos] = {}
        for sensor in self.sensors:
            for pose in self.poses(since, hit.t):
                if self.inside_m(sensor, pose, hit.x_m, hit.y_m) > EDGE_M:
                    found.setdefault(sensor.net, pose.t)
        return found

    def may_see(self, hit: Contact, since: Nanos) -> bool:
        """Tell whether the place of a contact was in or near any cone."""
        return any(
            self.inside_m(sensor, pose, hit.x_m, hit.y_m) > -EDGE_M * 2
            for sensor in self.sensors
            for pose in self.poses(since, hit.t)
        )

    def still_since(self, hit: Contact, since: Nanos) -> Nanos:
        """Return from when on, at `since` the earliest, the thing that was touched stood where it was touched."""
        name = hit.what.strip("'")
        return max([since, *(change.t for change in self.record.changes if change.name == name and change.t <= hit.t)])
