"""The nearest echo of many sonar at once, for many opening angles: walls in polar coordinates about each reading.

Seen from a sonar that looks along 0, the line of a wall is at p/cos(a - f) under the angle a, where p is its distance
and f the direction of its foot; the wall itself covers the angles from its one end to the other. With that a ray is
two multiplications, and the nearest point of a wall within a sector is where a, held between the edges of both, comes
nearest to f.

Two shapes of a ping are known: the fan of rays of a virtual sonar, which passes by what stands between two of them, and
the whole sector, as a transducer has it.

Not modelled: surfaces that send no echo back by their angle, and reflections.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from p2os.pioneer.sonar.ring import RAYS_PER_CONE
from robot_bench.drives.drive import Floats, wrapped

#: chosen: so many angles and walls are looked at in one step, of some 500 kB an array.
MOST_AT_ONCE = 65_536
#: A wall that passes through a sonar is this far off, metres.
_LEAST_M = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Bearings:
    """Walls as some sonar see them: one row for each sonar and each wall that it may meet, by sonar.

    Args:
        first: Of each sonar that may meet one, its first row; shape (k,).
        seeing: Which sonar those are, shape (k,).
        count: How many sonar there are.
        near: 1/p of each row, 1/m.
        foot_rad: f, from where the sonar looks.
        low_rad: Where the wall begins.
        high_rad: Where it ends, above `low_rad`.
        longest_m: What a sonar returns that meets nothing.
    """

    first: npt.NDArray[np.int64]
    seeing: npt.NDArray[np.int64]
    count: int
    near: Floats
    foot_rad: Floats
    low_rad: Floats
    high_rad: Floats
    longest_m: float

    @classmethod
    def of(cls, walls: Floats, sonar: Floats, widest_rad: float, longest_m: float) -> "Bearings":
        """Return the walls that sonar may meet.

        Args:
            walls: Shape (m, 4), metres, each from x, y to x, y.
            sonar: Shape (3, n): x and y in metres, heading in radians.
            widest_rad: No sector opens farther than this to either side; up to a quarter of a turn.
            longest_m: How far they hear.
        """
        x, y, heading = sonar[:, :, None]
        ax, ay, bx, by = (walls[:, 0] - x, walls[:, 1] - y, walls[:, 2] - x, walls[:, 3] - y)
        begin = np.arctan2(ay, ax)
        span = wrapped(np.arctan2(by, bx) - begin)
        middle = wrapped(begin + span / 2 - heading)
        low, high = middle - np.abs(span) / 2, middle + np.abs(span) / 2
        dx, dy = bx - ax, by - ay
        length = np.maximum(np.hypot(dx, dy), _LEAST_M)
        away = (ax * dy - ay * dx) / length  # of the line, to the right of it positive
        part = np.clip(-(ax * dx + ay * dy) / length**2, 0, 1)
        kept = (low < widest_rad) & (high > -widest_rad) & (np.hypot(ax + part * dx, ay + part * dy) < longest_m)
        foot = np.arctan2(-dx * np.sign(away), dy * np.sign(away)) - heading
        foot = middle + wrapped(foot - middle)
        rows, _ = np.nonzero(kept)
        seeing, first = np.unique(rows, return_index=True)
        return cls(
            first, seeing, len(sonar[0]), 1 / np.maximum(np.abs(away[kept]), _LEAST_M), foot[kept], low[kept],
            high[kept], longest_m,
        )  # fmt: skip

    def rays(self, angles_rad: Floats) -> Floats:
        """Return how far each sonar sees along some angles: shape (angles, n), metres."""
        found = np.zeros((len(angles_rad), self.count))
        along, across = np.cos(self.foot_rad) * self.near, np.sin(self.foot_rad) * self.near
        for some in self._shares(len(angles_rad)):
            a = angles_rad[some, None]
            over = np.cos(a) * along + np.sin(a) * across
            found[some] = self._nearest(np.where((a >= self.low_rad) & (a <= self.high_rad), over, 0.0))
        return self._ranges(found)

    def fans(self, halves_rad: Floats) -> Floats:
        """Return the nearest echo of fans of rays to either side of 0, edges included: shape (halves, n), metres."""
        spread = halves_rad[:, None] * np.linspace(-1, 1, RAYS_PER_CONE)
        found = self.rays(spread.ravel()).reshape(*spread.shape, self.count)
        return np.asarray(found.min(axis=1), dtype=np.float64)

    def sectors(self, halves_rad: Floats) -> Floats:
        """Return the nearest point within sectors to either side of 0: shape (halves, n), metres."""
        found = np.zeros((len(halves_rad), self.count))
        for some in self._shares(len(halves_rad)):
            half = halves_rad[some, None]
            low, high = np.maximum(self.low_rad, -half), np.minimum(self.high_rad, half)
            over = np.cos(np.clip(self.foot_rad, low, np.maximum(low, high)) - self.foot_rad) * self.near
            found[some] = self._nearest(np.where(low <= high, over, 0.0))
        return self._ranges(found)

    def _shares(self, count: int) -> list[slice]:
        at_once = max(1, MOST_AT_ONCE // max(1, len(self.near)))
        return [slice(first, first + at_once) for first in range(0, count, at_once)]

    def _nearest(self, over: Floats) -> Floats:
        """Return the largest of 1/range of each sonar's rows; 0 of one that has none."""
        found = np.zeros((len(over), self.count))
        if len(self.first):
            found[:, self.seeing] = np.maximum.reduceat(over, self.first, axis=1)
        return found

    def _ranges(self, over: Floats) -> Floats:
        return np.asarray(1 / np.maximum(over, 1 / self.longest_m), dtype=np.float64)


#: What a ping may be.
SHAPES: Mapping[str, Callable[[Bearings, Floats], Floats]] = {"sector": Bearings.sectors, "rays": Bearings.fans}
