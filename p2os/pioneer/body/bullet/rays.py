"""The rays of every sonar, prepared once in the robot's frame and turned into the world in one go.

The arithmetic is element by element in a fixed order, so that the same pose gives
the same bits on every machine.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import Cone

Points = NDArray[np.float64]


class SonarRays:
    """Where rays begin and end in the robot's frame."""

    def __init__(self, cones: Sequence[Cone], height_m: float, longest_m: float) -> None:
        self.rays = len(cones[0].headings_rad) if cones else 0
        self.longest_m = longest_m
        self._cones = cones
        self._starts = [np.array([[cone.x_m, cone.y_m, height_m]] * self.rays) for cone in cones]
        self._ends = [
            np.array([
                [cone.x_m + longest_m * math.cos(heading), cone.y_m + longest_m * math.sin(heading), height_m]
                for heading in cone.headings_rad
            ])
            for cone in cones
        ]  # fmt: skip
        self._kept: dict[tuple[int, ...], tuple[Points, Points]] = {}

    def points(
        self, numbers: Sequence[int], origin: Sequence[float], matrix: Sequence[float]
    ) -> tuple[list[list[float]], list[list[float]]]:
        """Return the starts and the ends of some sonar's rays in the world.

        Args:
            numbers: Which sonar.
            origin: Of the robot's frame, metres.
            matrix: Its turn, nine numbers row by row.
        """
        key = tuple(numbers)
        if key not in self._kept:
            self._kept[key] = (
                np.concatenate([self._starts[number] for number in key]),
                np.concatenate([self._ends[number] for number in key]),
            )
        starts, ends = self._kept[key]
        return _placed(starts, origin, matrix), _placed(ends, origin, matrix)

    def echoes(self, number: int, hits: Sequence[tuple[Any, ...]], matrix: Sequence[float]) -> list[Echo]:
        """Return the echoes of one sonar's rays from what the engine returns for each: fraction and normal."""
        found = []
        for heading, hit in zip(self._cones[number].headings_rad, hits, strict=True):
            if hit[0] < 0:
                found.append(Echo(math.inf, 0.0))
                continue
            c, s = math.cos(heading), math.sin(heading)
            ray = [matrix[3 * row] * c + matrix[3 * row + 1] * s for row in range(3)]
            cosine = abs(sum(part * normal for part, normal in zip(ray, hit[4], strict=True)))
            found.append(Echo(hit[2] * self.longest_m, min(1.0, cosine)))
        return found


def _placed(points: Points, origin: Sequence[float], matrix: Sequence[float]) -> list[list[float]]:
    x, y, z = points[:, 0], points[:, 1], points[:, 2]
    rows = [origin[row] + matrix[3 * row] * x + matrix[3 * row + 1] * y + matrix[3 * row + 2] * z for row in range(3)]
    result: list[list[float]] = np.stack(rows, axis=1).tolist()
    return result
