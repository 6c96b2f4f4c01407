"""Two drives brought together: in time by an event or by their speeds, in space by a pose or by least squares.

In time, the one of all shifts is taken at which speeds and turn rates differ least: found on a grid by correlation,
then between the grid's times. In space there is a turn and a move and no scale: a drive in another scale is another
drive.

Invariant: what is aligned is never stretched.
"""

from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.optimize import minimize_scalar

from robot_bench.drives.drive import Floats, Trajectory
from simbase.errors import UsageError

#: chosen: seconds between the times at which speeds are correlated.
GRID_S = 0.02
#: chosen: half a metre's radius turns a rate in rad/s into a speed, so that driving and turning count alike.
LEVER_M = 0.5
#: chosen: shorter overlaps say nothing.
LEAST_OVERLAP_S = 1.0
#: Slower than this stands still, m/s and rad/s.
STILL = 0.005


def shift_by_speeds(reference: Trajectory, other: Trajectory) -> float:
    """Return by how many seconds `other` has to be later for the speeds of both to agree best.

    Raises:
        UsageError: One of them stands still all the time.
    """
    grids = []
    for trajectory in (reference, other):
        t, speed, turn = trajectory.speeds()
        if max(np.abs(speed).max(), LEVER_M * np.abs(turn).max()) < STILL:
            raise UsageError("a robot that stands still cannot be aligned in time", hint="--shift 0s")
        grid = np.arange(trajectory.t_s[0], trajectory.t_s[-1], GRID_S)
        grids.append((grid[0], np.interp(grid, t, speed), LEVER_M * np.interp(grid, t, turn)))
    (start, *ours), (other_start, *theirs) = grids
    lag = _lag(ours, theirs)
    coarse = float(start - other_start + lag * GRID_S)

    def difference(shift: float) -> float:
        return _difference(reference, other, shift)

    near = [coarse + step * GRID_S for step in range(-3, 4)]
    best = min(near, key=difference)
    found = minimize_scalar(
        difference, bounds=(best - GRID_S, best + GRID_S), method="bounded", options={"xatol": 1e-6}
    )
    return float(found.x if found.fun < difference(best) else best)


def _lag(ours: Sequence[Floats], theirs: Sequence[Floats]) -> int:
    """Return by how many steps theirs have to be later for the sum of products to be largest, by Fourier transforms."""
    length = len(ours[0]) + len(theirs[0]) - 1
    size = fft.next_fast_len(length, real=True)
    products = sum(fft.rfft(a, size) * fft.rfft(b[::-1], size) for a, b in zip(ours, theirs, strict=True))
    return int(np.argmax(fft.irfft(products, size)[:length])) - (len(theirs[0]) - 1)


def _difference(reference: Trajectory, other: Trajectory, shift: float) -> float:
    """Return the mean square by which speeds differ where both are known, m²/s²; infinite without an overlap."""
    t, speed, turn = reference.speeds()
    at, other_speed, other_turn = other.speeds()
    kept = (t >= at[0] + shift) & (t <= at[-1] + shift)
    if kept.sum() < 2:
        return np.inf
    ahead = speed[kept] - np.interp(t[kept] - shift, at, other_speed)
    around = LEVER_M * (turn[kept] - np.interp(t[kept] - shift, at, other_turn))
    return float(np.mean(ahead**2 + around**2))


def first_motion_s(trajectory: Trajectory) -> float:
    """Return when it first moves, seconds.

    Raises:
        UsageError: It never does.
    """
    t, speed, turn = trajectory.speeds()
    moving = np.flatnonzero((np.abs(speed) > STILL) | (np.abs(turn) > STILL))
    if not len(moving):
        raise UsageError("a robot that stands still has no first motion", hint="--shift 0s")
    return float(t[moving[0]])


def on_common_times(reference: Trajectory, other: Trajectory) -> tuple[Trajectory, Trajectory]:
    """Return both at the reference's times, where both are known.

    Raises:
        UsageError: That is less than a second.
    """
    first, last = max(reference.t_s[0], other.t_s[0]), min(reference.t_s[-1], other.t_s[-1])
    if last - first < LEAST_OVERLAP_S:
        raise UsageError(
            f"the drives have {max(last - first, 0.0):.1f} s in common, {LEAST_OVERLAP_S:g} s at least are needed",
            hint="--shift, or --at with an event of both",
        )
    ours = reference.between(first, last)
    return ours, other.at(ours.t_s)


def first_pose(reference: Trajectory, other: Trajectory) -> tuple[float, float, float]:
    """Return the move (x, y, turn) that puts `other`'s first pose on the reference's."""
    turn = float(reference.heading_rad[0] - other.heading_rad[0])
    return _move(turn, (reference.x_m[0], reference.y_m[0]), (other.x_m[0], other.y_m[0]))


def least_squares_pose(reference: Trajectory, other: Trajectory) -> tuple[float, float, float]:
    """Return the move (x, y, turn) after which the positions differ least in the mean square.

    Umeyama's solution (IEEE PAMI 13, 1991) in the plane and without scale: the turn has a closed form.

    Raises:
        UsageError: A robot that stays where it is gives no turn.
    """
    means = [(float(one.x_m.mean()), float(one.y_m.mean())) for one in (reference, other)]
    ours, theirs = ((one.x_m - mx, one.y_m - my) for one, (mx, my) in zip((reference, other), means, strict=True))
    along, across = _sum(ours[0] * theirs[0] + ours[1] * theirs[1]), _sum(ours[1] * theirs[0] - ours[0] * theirs[1])
    if np.hypot(along, across) < np.finfo(np.float64).eps:
        raise UsageError("positions that do not change give no direction", hint="--align first")
    return _move(float(np.arctan2(across, along)), *means)


def _sum(values: Floats) -> float:
    return float(values.sum())


def _move(turn: float, to: tuple[float, float], here: tuple[float, float]) -> tuple[float, float, float]:
    c, s = np.cos(turn), np.sin(turn)
    return float(to[0] - c * here[0] + s * here[1]), float(to[1] - s * here[0] - c * here[1]), turn
