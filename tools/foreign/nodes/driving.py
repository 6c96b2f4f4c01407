"""What the nodes of this folder compute: poses in the plane, costs of a grid, and how to follow a path.

Plain functions of NumPy arrays; poses are (x m, y m, heading rad), grids are indexed [row, column], a row along x.
The nodes run under a Python of ROS, which has NumPy and none of this project.
"""

import math
from dataclasses import dataclass

import numpy as np

Pose = tuple[float, float, float]

#: Costs of nav2_costmap_2d: nothing is known; an obstacle; the robot's outline would touch one.
UNKNOWN, LETHAL, INSCRIBED = 255, 254, 253
#: chosen: of a nav_msgs/OccupancyGrid, occupied from here on, as map_saver has it.
OCCUPIED = 65
#: Straight behind a P2-DX's axle its corners are farthest out, 0.32 m, m; and where costs end.
SWING_M, FAR_M = 0.33, 0.70
#: chosen: m/s, rad/s, m.
CRUISE_MPS, TURN_RADPS, AHEAD_M = 0.35, 0.7, 0.4
#: A heading that is off by more is turned to on the spot, rad.
ON_THE_SPOT_RAD = 0.7


def compose(outer: Pose, inner: Pose) -> Pose:
    """Return a pose that is given in the frame of another."""
    x, y, heading = outer
    c, s = math.cos(heading), math.sin(heading)
    return x + c * inner[0] - s * inner[1], y + s * inner[0] + c * inner[1], wrapped(heading + inner[2])


def inverse(pose: Pose) -> Pose:
    """Return the pose of the outer frame in the inner one."""
    x, y, heading = pose
    c, s = math.cos(heading), math.sin(heading)
    return -c * x - s * y, s * x - c * y, wrapped(-heading)


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi."""
    return math.remainder(angle, math.tau)


def between(first: tuple[int, Pose], second: tuple[int, Pose], at: int) -> Pose:
    """Return the pose at a time between two of them, nanoseconds."""
    (begin, (x0, y0, h0)), (end, (x1, y1, h1)) = first, second
    share = (at - begin) / (end - begin) if end > begin else 1.0
    return x0 + share * (x1 - x0), y0 + share * (y1 - y0), wrapped(h0 + share * wrapped(h1 - h0))


@dataclass(frozen=True)
class Grid:
    """A grid of cells over the plane.

    Args:
        cells: [row, column].
        x, y: The corner of cell [0, 0], m.
        size: Of a cell, m.
    """

    cells: np.ndarray
    x: float
    y: float
    size: float

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return the row and the column of a point; they may be outside."""
        return math.floor((y - self.y) / self.size), math.floor((x - self.x) / self.size)

    def has(self, row: int, column: int) -> bool:
        """Tell whether a cell is in it."""
        return 0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]

    def grown(self, margin_m: float) -> "Grid":
        """Return it with unknown cells (-1) around it."""
        width = math.ceil(margin_m / self.size)
        cells = np.pad(self.cells, width, constant_values=-1)
        return Grid(cells, self.x - width * self.size, self.y - width * self.size, self.size)


def costs_of(grid: Grid, hits: np.ndarray) -> np.ndarray:
    """Return the costs of a map and of points that are seen now, [n, 2] m, inflated by the robot's outline."""
    occupied = grid.cells >= OCCUPIED
    for x, y in hits:
        row, column = grid.cell(x, y)
        if grid.has(row, column):
            occupied[row, column] = True
    reach = math.ceil(FAR_M / grid.size)
    span = range(-reach, reach + 1)
    stamp = np.array([[inflation(math.hypot(down, right) * grid.size) for right in span] for down in span], np.uint8)
    rows, columns = occupied.shape
    inflated = np.zeros((rows + 2 * reach, columns + 2 * reach), np.uint8)
    for row, column in zip(*np.nonzero(occupied), strict=True):
        part = inflated[row : row + len(stamp), column : column + len(stamp)]
        np.maximum(part, stamp, out=part)
    inflated = inflated[reach : reach + rows, reach : reach + columns]
    return np.where((grid.cells < 0) & (inflated < INSCRIBED), UNKNOWN, inflated).astype(np.uint8)


def inflation(distance_m: float) -> int:
    """Return the cost so far from an obstacle."""
    if distance_m == 0:
        return LETHAL
    if distance_m <= SWING_M:
        return INSCRIBED
    return 0 if distance_m >= FAR_M else round((INSCRIBED - 1) * ((FAR_M - distance_m) / (FAR_M - SWING_M)) ** 2)


def freed(costs: np.ndarray, row: int, column: int, radius: int) -> np.ndarray:
    """Return costs in which a robot that stands among inscribed cells finds its way out; obstacles stay."""
    top, left = max(0, row - radius), max(0, column - radius)
    out = costs.copy()
    part = out[top : row + radius + 1, left : column + radius + 1]
    part[part == INSCRIBED] = INSCRIBED - 1
    return out


def steer(pose: Pose, path: np.ndarray) -> tuple[float, float]:
    """Return the speeds (m/s, rad/s) that follow a path of points [n, 2]: pure pursuit, or a turn on the spot."""
    away = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1])
    nearest = int(np.argmin(away))
    beyond = np.nonzero(away[nearest:] >= AHEAD_M)[0]
    target = path[nearest + beyond[0]] if len(beyond) else path[-1]
    dx, dy = target[0] - pose[0], target[1] - pose[1]
    distance = math.hypot(dx, dy)
    error = wrapped(math.atan2(dy, dx) - pose[2])
    if abs(error) > ON_THE_SPOT_RAD:
        return 0.0, math.copysign(TURN_RADPS, error)
    left_m = math.hypot(path[-1][0] - pose[0], path[-1][1] - pose[1])
    forward = min(CRUISE_MPS, 0.1 + left_m) * math.cos(error) ** 2
    turn = 2 * forward * math.sin(error) / max(distance, 0.1)
    return forward, max(-TURN_RADPS, min(TURN_RADPS, turn))


def is_free_ahead(points: np.ndarray, forward: float) -> bool:
    """Tell whether the strip before the robot is free of points [n, 2] in its own frame, for half a second and 5 cm."""
    longest = 0.18 + 0.05 + 0.5 * forward
    return not bool(np.any((points[:, 0] > 0) & (points[:, 0] < longest) & (np.abs(points[:, 1]) < 0.21)))
