"""How far a trajectory is from another at the same times: absolute and relative pose errors.

The absolute error (APE) of a pose is its distance to the reference's pose at that time; its rotation is the angle
between them. The relative error (RPE) is that of the motion over a step of so many poses, each step beginning where the
last ended: the step of one trajectory seen from the other's. Both are those of the TUM RGB-D benchmark (Sturm and
others, 2012), in the plane; figures agree with those of the program evo.

Invariant: both trajectories have the same times.
"""

from dataclasses import asdict, dataclass

import numpy as np

from robot_bench.drives.drive import Floats, Trajectory, wrapped
from simbase.errors import UsageError


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of errors, in their unit; `sse` is the sum of their squares."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    sse: float
    count: int

    @classmethod
    def of(cls, errors: Floats) -> "Statistics":
        """Return those of some errors, one at least; the standard deviation is of all, not of a sample."""
        square = np.power(errors, 2)
        return cls(
            rmse=float(np.sqrt(square.mean())), mean=float(errors.mean()), median=float(np.median(errors)),
            std=float(errors.std()), min=float(errors.min()), max=float(errors.max()), sse=float(square.sum()),
            count=len(errors),
        )  # fmt: skip

    def as_plain(self) -> dict[str, float]:
        """Return it for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class PoseErrors:
    """Of each pose or step: metres and radians, none negative, and when."""

    t_s: Floats
    translation_m: Floats
    rotation_rad: Floats


def absolute_errors(reference: Trajectory, other: Trajectory) -> PoseErrors:
    """Return the error of each pose."""
    return PoseErrors(
        reference.t_s,
        np.hypot(other.x_m - reference.x_m, other.y_m - reference.y_m),
        np.abs(wrapped(other.heading_rad - reference.heading_rad)),
    )


def relative_errors(reference: Trajectory, other: Trajectory, step: int) -> PoseErrors:
    """Return the error of each step of so many poses; what is left at the end is no step.

    Raises:
        UsageError: There are no more poses than one step has.
    """
    places = np.arange(0, len(reference), max(step, 1))
    if len(places) < 2:
        raise UsageError(f"no step of {step} poses in {len(reference)}", hint="a smaller --delta")
    ours, theirs = _steps(reference, places), _steps(other, places)
    # The turn into the frame of the reference's end changes no length.
    return PoseErrors(
        reference.t_s[places[1:]],
        np.hypot(theirs[0] - ours[0], theirs[1] - ours[1]),
        np.abs(wrapped(theirs[2] - ours[2])),
    )


def _steps(trajectory: Trajectory, places: "np.ndarray[tuple[int], np.dtype[np.int64]]") -> tuple[Floats, ...]:
    """Return each step seen from its beginning: ahead, to the left, turn."""
    x, y, heading = (column[places] for column in (trajectory.x_m, trajectory.y_m, trajectory.heading_rad))
    dx, dy, c, s = np.diff(x), np.diff(y), np.cos(heading[:-1]), np.sin(heading[:-1])
    return c * dx + s * dy, c * dy - s * dx, np.diff(heading)
