"""Reaches goals as a node of ROS 2: /map, /tf and /scan in, /cmd_vel and /plan out; the plans are of Nav2's navfn.

    PYTHON navigator.py navfn.so goals.json map.npz

navfn.so is navfn.cpp of nav2_navfn_planner with a function in C before it: `int navfn_plan(costs, width, height,
start's column and row, goal's column and row, float *xs, float *ys, int most)`, which returns how many points, in
cells, lead from the start to the goal, 0 where none do; costs are those of nav2_costmap_2d. It prints `reached N`,
`gave up N` (goals from 1) and `done`, and leaves the last map in a file. It runs with a stock rclpy and tf2_msgs.
"""

import ctypes
import json
import math
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from driving import SWING_M, Grid, Pose, compose, costs_of, freed, is_free_ahead, steer
from geometry_msgs.msg import PoseStamped, Twist
from listening import LATCHED, Ears, points_of
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

#: Nearer is there, m; a goal takes at most so long, and so long it rests there, s.
NEAR_M, LONGEST_S, REST_S = 0.12, 120.0, 0.7
#: chosen: seconds between two speeds, and between two plans.
TURN_S, PLAN_S = 0.1, 1.0
#: What is unknown around the map may be driven into, m.
MARGIN_M = 3.0
MOST_POINTS = 4000
#: Points of a scan that are nearer are obstacles of a plan, m.
SEEN_M = 3.0


class Navigator(Node):
    """Drives from goal to goal."""

    def __init__(self, library: str, goals: list[tuple[float, float]], out: Path) -> None:
        super().__init__("navigator")
        self._navfn = ctypes.CDLL(library).navfn_plan
        floats = ctypes.POINTER(ctypes.c_float)
        self._navfn.argtypes = [ctypes.c_void_p, *[ctypes.c_int] * 6, floats, floats, ctypes.c_int]
        self._goals, self._out = goals, out
        self._number, self._since, self._rests_until = 0, 0.0, 0.0
        self._grid: Grid | None = None
        self._path: np.ndarray | None = None
        self._planned_at = 0.0
        self._points, self._points_at = np.empty((0, 2)), (0.0, 0.0, 0.0)
        self._ears = Ears(self, self._scan)
        self._map = self.create_subscription(OccupancyGrid, "/map", self._mapped, LATCHED)
        self._speeds = self.create_publisher(Twist, "/cmd_vel", 10)
        self._plans = self.create_publisher(PathMessage, "/plan", 10)
        self.create_timer(TURN_S, self._turn)

    def _mapped(self, message: OccupancyGrid) -> None:
        info = message.info
        cells = np.array(message.data, np.int8).reshape(info.height, info.width)
        self._grid = Grid(cells, info.origin.position.x, info.origin.position.y, info.resolution)

    def _scan(self, scan: LaserScan, odometry: Pose) -> None:
        laser = self._ears.laser(scan.header.frame_id)
        if laser is not None:
            self._points, self._points_at = points_of(scan, laser), odometry

    def _turn(self) -> None:
        if self._grid is None or self._ears.map_to_odom is None or not self._ears.odometry:
            return
        now = time.monotonic()
        self._since = self._since or now
        pose = compose(self._ears.map_to_odom, self._ears.odometry[-1][1])
        goal = self._goals[self._number]
        if self._rests_until:
            if now > self._rests_until:
                self._next(now)
            return
        if math.dist(pose[:2], goal) < NEAR_M:
            self._speeds.publish(Twist())
            self._rests_until = now + REST_S
            return
        if now > self._since + LONGEST_S:
            self._speeds.publish(Twist())
            self._tell("gave up")
            self._next(now, is_reported=True)
            return
        if now > self._planned_at + PLAN_S:
            self._path = self._planned(self._grid.grown(MARGIN_M), pose, goal)
            self._planned_at = time.monotonic()
        forward, turn = (0.0, 0.0) if self._path is None else steer(pose, self._path)
        if forward and not is_free_ahead(self._points, forward):
            forward, turn = 0.0, turn or 0.3
        message = Twist()
        message.linear.x, message.angular.z = forward, turn
        self._speeds.publish(message)

    def _next(self, now: float, *, is_reported: bool = False) -> None:
        """Go to the next goal, or end."""
        if not is_reported:
            self._tell("reached")
        self._number, self._since = self._number + 1, now
        self._rests_until, self._path, self._planned_at = 0.0, None, 0.0
        if self._number == len(self._goals):
            grid = self._grid
            if grid is not None:
                np.savez(self._out, cells=grid.cells, corner=(grid.x, grid.y), size=grid.size)
            print("done", flush=True)
            raise SystemExit(0)

    def _tell(self, what: str) -> None:
        print(what, self._number + 1, flush=True)

    def _planned(self, grid: Grid, pose: Pose, goal: tuple[float, float]) -> np.ndarray | None:
        """Return a way over the map and past what is seen now; without one the robot stands."""
        near = self._points[np.hypot(self._points[:, 0], self._points[:, 1]) < SEEN_M]
        at = compose(self._ears.map_to_odom or (0.0, 0.0, 0.0), self._points_at)
        c, s = math.cos(at[2]), math.sin(at[2])
        costs = costs_of(grid, near @ np.array([[c, s], [-s, c]]) + at[:2])
        row, column = grid.cell(*pose[:2])
        goal_row, goal_column = grid.cell(*goal)
        if not (grid.has(row, column) and grid.has(goal_row, goal_column)):
            return None
        costs = np.ascontiguousarray(freed(costs, row, column, math.ceil(SWING_M / grid.size)))
        xs, ys = np.empty(MOST_POINTS, np.float32), np.empty(MOST_POINTS, np.float32)
        floats = ctypes.POINTER(ctypes.c_float)
        found = self._navfn(
            costs.ctypes.data, costs.shape[1], costs.shape[0], column, row, goal_column, goal_row,
            xs.ctypes.data_as(floats), ys.ctypes.data_as(floats), MOST_POINTS,
        )  # fmt: skip
        if not found:
            return None
        path = np.stack([grid.x + (xs[:found] + 0.5) * grid.size, grid.y + (ys[:found] + 0.5) * grid.size], axis=1)
        self._publish(path)
        return np.vstack([path, goal])

    def _publish(self, path: np.ndarray) -> None:
        message = PathMessage()
        message.header.stamp, message.header.frame_id = self.get_clock().now().to_msg(), "map"
        for x, y in path[::4]:
            one = PoseStamped()
            one.header = message.header
            one.pose.position.x, one.pose.position.y, one.pose.orientation.w = float(x), float(y), 1.0
            message.poses.append(one)
        self._plans.publish(message)


if __name__ == "__main__":
    rclpy.init()
    wanted = [(float(x), float(y)) for x, y in json.loads(Path(sys.argv[2]).read_text())]
    rclpy.spin(Navigator(sys.argv[1], wanted, Path(sys.argv[3])))
