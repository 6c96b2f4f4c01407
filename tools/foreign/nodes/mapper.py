"""A mapper as a node of ROS 2: /scan and /tf in, /map and map -> odom out; the mapping is Karto's.

    PYTHON mapper.py karto.so

karto.so is Karto's library (open_karto) with these functions in C before it:
`void *karto_new(laser x, y, yaw; first, last, step rad; nearest, farthest m)`, `int karto_count(mapper)`: its ranges;
`int karto_add(mapper, ranges, n, odometry's x, y, yaw, double corrected[3])`: 1 where it took the scan;
`int karto_map(mapper, resolution, int *width, int *height, double *x, double *y)`, then `karto_cells(mapper, int8_t *)`
with cells as of nav_msgs/OccupancyGrid. It runs with a stock rclpy and tf2_msgs, and imports nothing of this project.
"""

import ctypes
import math
import sys

import numpy as np
import rclpy
from driving import Pose, compose, inverse
from geometry_msgs.msg import TransformStamped
from listening import LATCHED, Ears
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

#: m; and a laser that sees farther is not believed there.
CELL_M, FARTHEST_M = 0.05, 12.0
#: chosen: seconds between two maps, and between two transforms.
MAP_S, TRANSFORM_S = 2.0, 0.1


class Mapper(Node):
    """Gives Karto the scans."""

    def __init__(self, library: str) -> None:
        super().__init__("mapper")
        self._karto = ctypes.CDLL(library)
        self._karto.karto_new.restype = ctypes.c_void_p
        self._karto.karto_new.argtypes = [ctypes.c_double] * 8
        self._karto.karto_count.argtypes = [ctypes.c_void_p]
        self._karto.karto_add.argtypes = [
            ctypes.c_void_p, ctypes.POINTER(ctypes.c_double), ctypes.c_int, *[ctypes.c_double] * 3,
            ctypes.POINTER(ctypes.c_double),
        ]  # fmt: skip
        self._karto.karto_map.argtypes = [
            ctypes.c_void_p, ctypes.c_double, *[ctypes.POINTER(ctypes.c_int)] * 2,
            *[ctypes.POINTER(ctypes.c_double)] * 2,
        ]  # fmt: skip
        self._karto.karto_cells.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
        self._mapper: ctypes.c_void_p | None = None
        self._taken = self._mapped = 0
        self._correction: Pose = (0.0, 0.0, 0.0)
        self._ears = Ears(self, self._scan)
        self._maps = self.create_publisher(OccupancyGrid, "/map", LATCHED)
        self._transforms = self.create_publisher(TFMessage, "/tf", 100)
        self.create_timer(MAP_S, self._publish_map)
        self.create_timer(TRANSFORM_S, self._publish_transform)

    def _scan(self, scan: LaserScan, odometry: Pose) -> None:
        if self._mapper is None and not self._begin(scan):
            return
        ranges = np.array(scan.ranges, np.float64)
        ranges[~np.isfinite(ranges)] = 0.0  # Karto leaves out what is nearer than the laser sees
        corrected = (ctypes.c_double * 3)()
        if self._karto.karto_add(
            self._mapper, ranges.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), len(ranges), *odometry, corrected
        ):
            self._taken += 1
            self._correction = compose((corrected[0], corrected[1], corrected[2]), inverse(odometry))

    def _begin(self, scan: LaserScan) -> bool:
        laser = self._ears.laser(scan.header.frame_id)
        if laser is None:
            return False
        self._mapper = ctypes.c_void_p(
            self._karto.karto_new(
                *laser, scan.angle_min, scan.angle_max, scan.angle_increment, scan.range_min,
                min(scan.range_max, FARTHEST_M),
            )
        )  # fmt: skip
        if self._karto.karto_count(self._mapper) != len(scan.ranges):
            raise SystemExit(f"Karto expects {self._karto.karto_count(self._mapper)} ranges, not {len(scan.ranges)}")
        return True

    def _publish_map(self) -> None:
        width, height, x, y = ctypes.c_int(), ctypes.c_int(), ctypes.c_double(), ctypes.c_double()
        refs = [ctypes.byref(one) for one in (width, height, x, y)]
        if self._taken == self._mapped or not self._karto.karto_map(self._mapper, CELL_M, *refs):
            return
        self._mapped = self._taken
        cells = np.empty((height.value, width.value), np.int8)
        self._karto.karto_cells(self._mapper, cells.ctypes.data)
        message = OccupancyGrid()
        message.header.stamp, message.header.frame_id = self.get_clock().now().to_msg(), "map"
        message.info.resolution, message.info.width, message.info.height = CELL_M, width.value, height.value
        message.info.origin.position.x, message.info.origin.position.y = x.value, y.value
        message.info.origin.orientation.w = 1.0
        message.data = cells.ravel().tolist()
        self._maps.publish(message)

    def _publish_transform(self) -> None:
        if not self._taken:
            return
        x, y, heading = self._correction
        one = TransformStamped()
        one.header.stamp, one.header.frame_id, one.child_frame_id = self.get_clock().now().to_msg(), "map", "odom"
        one.transform.translation.x, one.transform.translation.y = x, y
        one.transform.rotation.z, one.transform.rotation.w = math.sin(heading / 2), math.cos(heading / 2)
        self._transforms.publish(TFMessage(transforms=[one]))


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Mapper(sys.argv[1]))
