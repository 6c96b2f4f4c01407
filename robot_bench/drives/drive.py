"""A drive as functions of time: where the robot was, how fast, what it was told, what it saw.

Times are seconds of the drive's own clock as floating point; poses are metres and radians, x ahead and y to the left
of where the drive's frame says, headings counter-clockwise and never wrapped.

Invariant: the times of every array rise strictly.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.robots.parameters import RobotParameters
from robot_bench.events.kinds import Event
from simbase.errors import FileError, shown, shown_name

Floats: TypeAlias = npt.NDArray[np.float64]


def wrapped(angle_rad: Floats) -> Floats:
    """Return angles within half a turn of 0, radians."""
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time.

    Args:
        t_s: Shape (n,), rising strictly, n at least 2.
        x_m: Shape (n,).
        y_m: Shape (n,).
        heading_rad: Shape (n,), not wrapped.

    Raises:
        FileError: There are fewer than two poses, or time stands still.
    """

    t_s: Floats
    x_m: Floats
    y_m: Floats
    heading_rad: Floats

    def __post_init__(self) -> None:
        if len(self.t_s) < 2:
            raise FileError("a drive needs two poses at least", hint="was the robot connected, and its motors on?")
        if not np.all(np.diff(self.t_s) > 0):
            raise FileError("the times of the poses do not rise")

    def __len__(self) -> int:
        return len(self.t_s)

    @classmethod
    def of_rows(cls, rows: "list[tuple[float, float, float, float]]") -> "Trajectory":
        """Return (t, x, y, heading) rows as a trajectory; of several at one time the last counts."""
        kept = {row[0]: row for row in rows}
        t, x, y, heading = np.array([kept[at] for at in sorted(kept)], dtype=np.float64).reshape(-1, 4).T
        return cls(t, x, y, np.unwrap(heading))

    def at(self, t_s: Floats) -> "Trajectory":
        """Return the poses at other times, linear between those that are known."""
        columns = (np.interp(t_s, self.t_s, column) for column in (self.x_m, self.y_m, self.heading_rad))
        return Trajectory(t_s, *columns)

    def between(self, first_s: float, last_s: float) -> "Trajectory":
        """Return the poses from one time to another, both included."""
        kept = (self.t_s >= first_s) & (self.t_s <= last_s)
        return Trajectory(self.t_s[kept], self.x_m[kept], self.y_m[kept], self.heading_rad[kept])

    def moved(self, pose: tuple[float, float, float]) -> "Trajectory":
        """Return the trajectory in a frame whose own is turned and then moved by a pose (x, y, turn)."""
        x, y, turn = pose
        c, s = np.cos(turn), np.sin(turn)
        return Trajectory(
            self.t_s, x + c * self.x_m - s * self.y_m, y + s * self.x_m + c * self.y_m, self.heading_rad + turn
        )

    def later(self, shift_s: float) -> "Trajectory":
        """Return the same poses, each so much later."""
        return Trajectory(self.t_s + shift_s, self.x_m, self.y_m, self.heading_rad)

    def speeds(self) -> tuple[Floats, Floats, Floats]:
        """Return times, speed along the heading (m/s) and turn rate (rad/s) between each two poses, at their middle."""
        dt = np.diff(self.t_s)
        middle = (self.heading_rad[1:] + self.heading_rad[:-1]) / 2
        along = np.diff(self.x_m) * np.cos(middle) + np.diff(self.y_m) * np.sin(middle)
        return (self.t_s[1:] + self.t_s[:-1]) / 2, along / dt, np.diff(self.heading_rad) / dt

    @property
    def path_m(self) -> float:
        """Length of the way, metres."""
        return float(np.hypot(np.diff(self.x_m), np.diff(self.y_m)).sum())


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """A value that holds from each time until the next."""

    t_s: Floats
    values: Floats

    def at(self, t_s: Floats) -> Floats:
        """Return the value at each time; NaN before the first."""
        place = np.searchsorted(self.t_s, t_s, side="right") - 1
        return np.where(place >= 0, self.values[np.maximum(place, 0)], np.nan) if len(self.t_s) else t_s * np.nan

    def later(self, shift_s: float) -> "Steps":
        """Return the same, each so much later."""
        return Steps(self.t_s + shift_s, self.values)


@dataclass(slots=True, kw_only=True)
class DriveRows:
    """What a recording tells of a drive, row by row: seconds, metres, radians and m/s; commands in their own units."""

    #: (t, x, y, heading).
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)
    #: (t, speed) of the rims.
    left: list[tuple[float, float]] = field(default_factory=list)
    right: list[tuple[float, float]] = field(default_factory=list)
    commands: dict[str, list[tuple[float, float]]] = field(default_factory=dict)


def number_of(text: str, file: object, line: int) -> float:
    """Return the number that a field of a text file holds.

    Raises:
        FileError: It holds none, or one that is not finite; the message has the file and the line.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FileError(f"{shown_name(file)}:{line}: {shown(text)} is no number")
    return value


def heading_of(x: float, y: float, z: float, w: float) -> float:
    """Return the heading of a unit quaternion, rad."""
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def steps_of(pairs: "list[tuple[float, float]]") -> Steps:
    """Return (time, value) pairs as steps; of several at one time the last counts."""
    kept = dict(pairs)
    times = sorted(kept)
    return Steps(np.array(times, dtype=np.float64), np.array([kept[at] for at in times], dtype=np.float64))


@dataclass(slots=True, kw_only=True, eq=False)
class Drive:
    """All that a recording tells of a drive; what it does not tell is None or empty."""

    name: str
    parameters: RobotParameters
    #: What the robot believes, by its packets.
    odometry: Trajectory | None = None
    #: Where it was: of a virtual robot, or measured from outside.
    truth: Trajectory | None = None
    #: Speeds of the rims, m/s: by the body where it is known, else by the packets.
    left_mps: Steps | None = None
    right_mps: Steps | None = None
    #: The rims' speeds by the packets.
    reported_left_mps: Steps | None = None
    reported_right_mps: Steps | None = None
    #: Command's name → its argument over time, in the units of the wire.
    commands: Mapping[str, Steps] = field(default_factory=dict)
    #: Sonar, from 0 → metres, where a reading is new.
    sonar_m: Mapping[int, Steps] = field(default_factory=dict)
    #: Motor, 1 or 2 → value of its pins.
    motors: Mapping[int, Steps] = field(default_factory=dict)
    #: Sensor, 1 to 8 → level of its pin.
    sensors: Mapping[int, Steps] = field(default_factory=dict)
    #: A run's events; None where there are none.
    events: "list[Event] | None" = None
    #: Goals that a run left open, as sentences.
    open_goals: Sequence[str] = ()
    #: A run's first line and its world; empty for a capture.
    meta: Mapping[str, object] = field(default_factory=dict)

    @property
    def body(self) -> Trajectory:
        """Where it was, as well as it is known: the truth, else the odometry.

        Raises:
            FileError: Neither is there.
        """
        found = self.truth or self.odometry
        if found is None:
            raise FileError(f"{self.name} has no poses", hint="p2os decode shows what it holds")
        return found

    def poses(self, which: str) -> Trajectory:
        """Return the trajectory that a word names: `truth`, `odometry` or `auto`.

        Raises:
            FileError: It has none such.
        """
        if which == "auto":
            return self.body
        found = self.truth if which == "truth" else self.odometry
        if found is None:
            hint = "a capture has odometry alone" if which == "truth" else "its packets tell of none"
            raise FileError(f"{self.name} has no {which}", hint=hint)
        return found
