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
        self._height_m = height_m
        #: The rays of some sonar: the coordinates of all starts and then of all ends, a column each.
        self._kept: dict[tuple[int, ...], tuple[Points, Points, Points]] = {}

    def points(self, numbers: Sequence[int], origin: Sequence[float], matrix: Sequence[float]) -> tuple[Points, Points]:
        """Return the starts and the ends of some sonar's rays in the world: shape (rays, 3), metres.

        Args:
            numbers: Which sonar.
            origin: Of the robot's frame, metres.
            matrix: Its turn, nine numbers row by row.
        """
        key = tuple(numbers)
        if key not in self._kept:
            self._kept[key] = self._columns(key)
        x, y, z = self._kept[key]
        turn = np.array(matrix).reshape(3, 3)
        placed = origin + turn[:, 0] * x + turn[:, 1] * y + turn[:, 2] * z
        middle = len(placed) // 2
        return placed[:middle], placed[middle:]

    def _columns(self, numbers: tuple[int, ...]) -> tuple[Points, Points, Points]:
        cones, longest_m, z = [self._cones[number] for number in numbers], self.longest_m, self._height_m
        starts = [(cone.x_m, cone.y_m, z) for cone in cones for _ in cone.headings_rad]
        ends = [
            (cone.x_m + longest_m * math.cos(heading), cone.y_m + longest_m * math.sin(heading), z)
            for cone in cones
            for heading in cone.headings_rad
        ]
        x, y, z_all = np.array([*starts, *ends]).T
        return x[:, None].copy(), y[:, None].copy(), z_all[:, None].copy()

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
