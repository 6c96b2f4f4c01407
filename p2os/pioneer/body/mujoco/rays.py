"""The rays of every sonar in MuJoCo's world."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from p2os.pioneer.body.ray_cast import Echo
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.geometry import INFINITY

#: Which groups of geometry a ray meets: that of `model.ECHOING` alone.
_ECHOING = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)


class SonarRays:
    """The rays of each sonar: where its rays begin and look, in the robot's frame."""

    def __init__(self, cones: tuple[Cone, ...], height_m: float, longest_m: float) -> None:
        self._longest_m = longest_m
        self._starts = [np.array([cone.x_m, cone.y_m, height_m]) for cone in cones]
        self._ways = [np.array([[dx, dy, 0.0] for dx, dy in cone.directions]) for cone in cones]
        count = max((len(cone.directions) for cone in cones), default=0)
        self._numbers = np.zeros(count, dtype=np.int32)
        self._ranges = np.zeros(count)
        self._normals = np.zeros(3 * count)

    def nearest(
        self, number: int, model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> float:  # fmt: skip
        """Return the nearest echo of one sonar, metres; the longest range where there is none."""
        self._cast(number, model, data, origin, turn)
        met = self._ranges[self._ranges >= 0.0]
        return min(self._longest_m, float(met.min())) if met.size else self._longest_m

    def ranges(
        self, number: int, model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> list[float]:  # fmt: skip
        """Return how far each ray of one sonar goes, metres; the longest range where it meets nothing."""
        self._cast(number, model, data, origin, turn)
        longest = self._longest_m
        return [range_m if 0.0 <= range_m < longest else longest for range_m in self._ranges.tolist()]

    def echoes(
        self, number: int, model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> list[Echo]:  # fmt: skip
        """Return what each ray of one sonar meets, with the angle at which it meets it."""
        rays = self._cast(number, model, data, origin, turn)
        normals = self._normals.reshape(-1, 3)
        found = []
        for ray, normal, range_m in zip(rays.tolist(), normals.tolist(), self._ranges.tolist(), strict=True):
            if not 0.0 <= range_m <= self._longest_m:
                found.append(Echo(INFINITY, 0.0))
                continue
            cosine = abs(sum(part * other for part, other in zip(ray, normal, strict=True)))
            found.append(Echo(range_m, min(1.0, cosine)))
        return found

    def _cast(
        self, number: int, model: mujoco.MjModel, data: mujoco.MjData, origin: NDArray[np.float64],
        turn: NDArray[np.float64],
    ) -> NDArray[np.float64]:  # fmt: skip
        """Ask for one sonar; return its rays in the world."""
        x, y, z = self._starts[number]
        begin = origin + turn[:, 0] * x + turn[:, 1] * y + turn[:, 2] * z
        ways = self._ways[number]
        rays = ways[:, :1] * turn[:, 0] + ways[:, 1:2] * turn[:, 1]
        mujoco.mj_multiRay(
            model, data, begin, rays.ravel(), _ECHOING, True, -1, self._numbers, self._ranges, self._normals,
            len(ways), self._longest_m,
        )  # fmt: skip
        return rays
