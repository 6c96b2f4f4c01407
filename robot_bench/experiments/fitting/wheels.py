"""Wheels and track, from odometry beside poses that were measured from outside.

The packets' poses are taken apart into the ways of the two rims, as the firmware counts them. With true sizes l and r
of the wheels over those that the firmware assumes, and a true track b, the robot has driven

    left = l · counted left,  right = r · counted right,  ahead = (left + right)/2,  turn = (right - left)/b.

Compared are the motions over pieces of the way, each seen from its own beginning, so that an error of one piece does
not spoil the next, and drift adds up within a piece only. By how much the packets come late is estimated with them.

Not modelled: slip, a track that changes with the turn. Both show in the residual.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_bench.drives.drive import Drive, Floats, Trajectory, wrapped
from robot_bench.experiments.alignment import shift_by_speeds
from robot_bench.experiments.fitting.least_squares import Fit, Parameter, fit
from simbase.errors import FileError

#: chosen: seconds of a piece: ten packets, so that the grain of a count is a hundredth of the way.
PIECE_S = 1.0
#: chosen: metres that a radian counts, in the residual: the robot's own size.
LEVER_M = 0.2
#: chosen: pieces so far apart depend on each other: they share the poses at their ends.
LAGS = 5
#: A packet's grain: 0.84 mm on the coarsest robot that ships, evenly spread.
GRAIN_M = 0.84e-3 / 12**0.5
#: chosen: so much is left at both ends, so that a packet that comes later or sooner is still there.
MARGIN_S = 0.5
WHY = "it takes a way with straight lines and turns both ways, beside measured poses"


@dataclass(frozen=True, slots=True, eq=False)
class Rims:
    """Ways of both rims since the start, metres, as the firmware counts them."""

    t_s: Floats
    left_m: Floats
    right_m: Floats

    @classmethod
    def of(cls, odometry: Trajectory, track_m: float) -> "Rims":
        """Take a trajectory apart; exact where each step is an arc."""
        turn = np.diff(odometry.heading_rad)
        middle = odometry.heading_rad[:-1] + turn / 2
        chord = np.diff(odometry.x_m) * np.cos(middle) + np.diff(odometry.y_m) * np.sin(middle)
        ahead = chord / np.sinc(turn / (2 * np.pi))
        ways = [np.concatenate(([0.0], np.cumsum(ahead + side * turn * track_m / 2))) for side in (-1, 1)]
        return cls(odometry.t_s, *ways)

    def driven(self, left: float, right: float, track_m: float) -> Trajectory:
        """Return the way of a robot with wheels of these sizes and this track, from the origin."""
        ways = np.diff(self.left_m) * left, np.diff(self.right_m) * right
        turn = (ways[1] - ways[0]) / track_m
        heading = np.concatenate(([0.0], np.cumsum(turn)))
        chord = (ways[0] + ways[1]) / 2 * np.sinc(turn / (2 * np.pi))
        middle = heading[:-1] + turn / 2
        x, y = (np.concatenate(([0.0], np.cumsum(chord * way(middle)))) for way in (np.cos, np.sin))
        return Trajectory(self.t_s, x, y, heading)


def fit_wheels(drives: Sequence[Drive]) -> Fit:
    """Estimate `left_wheel`, `right_wheel`, `track_mm` and `packet_delay_s`.

    Raises:
        FileError: A drive has no odometry or no measured poses, or never moves.
    """
    track_mm = float(drives[0].parameters.track_mm)
    for drive in drives:
        if drive.truth is None or drive.odometry is None:
            raise FileError(
                f"{drive.name} has no {'odometry' if drive.truth else 'measured poses'}",
                hint="a run folder has both; beside NAME.jsonl stands NAME.truth.csv or .tum, or --truth",
            )
    shifts = [-shift_by_speeds(drive.truth, drive.odometry) for drive in drives if drive.truth and drive.odometry]
    late_s = float(np.median(shifts))
    pieces = [_Pieces.of(drive, late_s) for drive in drives]
    parameters = [
        Parameter(name="left_wheel", start=1.0, scale=0.02, least=0.5, most=2.0),
        Parameter(name="right_wheel", start=1.0, scale=0.02, least=0.5, most=2.0),
        Parameter(name="track_mm", start=track_mm, scale=0.03 * track_mm, least=track_mm / 2, most=2 * track_mm),
        Parameter(name="packet_delay_s", start=late_s, scale=0.05, least=late_s - 0.5, most=late_s + 0.5),
    ]

    def residuals(values: Floats) -> Floats:
        return np.concatenate([piece.residuals(*values) for piece in pieces])

    counts = [len(piece.t_s) - 1 for piece in pieces]
    numbers = np.concatenate([np.repeat(np.arange(count), 3) + sum(counts[:n]) for n, count in enumerate(counts)])
    return fit(residuals, parameters, numbers, floor=GRAIN_M, why=WHY, lags=LAGS)


@dataclass(frozen=True, slots=True, eq=False)
class _Pieces:
    """A drive cut into pieces."""

    rims: Rims
    #: Where pieces begin and end, in the time of the measured poses.
    t_s: Floats
    #: Of each piece as measured: ahead, to the left, turn.
    steps: tuple[Floats, Floats, Floats]

    @classmethod
    def of(cls, drive: Drive, late_s: float) -> "_Pieces":
        assert drive.truth is not None  # noqa: S101  # seen by who calls
        assert drive.odometry is not None  # noqa: S101
        first = max(drive.truth.t_s[0], drive.odometry.t_s[0] - late_s) + MARGIN_S
        last = min(drive.truth.t_s[-1], drive.odometry.t_s[-1] - late_s) - MARGIN_S
        if last - first < 2 * PIECE_S:
            raise FileError(f"{drive.name}: packets and measured poses have no three seconds in common")
        times = np.arange(first, last, PIECE_S)
        return cls(Rims.of(drive.odometry, drive.parameters.track_mm / 1000), times, _steps(drive.truth.at(times)))

    def residuals(self, left: float, right: float, track_mm: float, delay_s: float) -> Floats:
        ours = _steps(self.rims.driven(left, right, track_mm / 1000).at(self.t_s + delay_s))
        columns = [mine - measured for mine, measured in zip(ours, self.steps, strict=True)]
        columns[2] = LEVER_M * wrapped(columns[2])
        return np.stack(columns, axis=1).ravel()


def _steps(way: Trajectory) -> tuple[Floats, Floats, Floats]:
    dx, dy, c, s = np.diff(way.x_m), np.diff(way.y_m), np.cos(way.heading_rad[:-1]), np.sin(way.heading_rad[:-1])
    return c * dx + s * dy, c * dy - s * dx, np.diff(way.heading_rad)
