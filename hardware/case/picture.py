"""A picture of the case: its bodies from two sides, drawn from their STL files, with the board's parts in the base."""

import math
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from hardware.case.board import bodies
from hardware.pcb.layout.rules import BOARD_HEIGHT_MM, BOARD_THICKNESS_MM, BOARD_WIDTH_MM

if TYPE_CHECKING:
    import numpy as np

Point: TypeAlias = tuple[float, float, float]
#: Corners of a triangle.
Triangle: TypeAlias = tuple[Point, Point, Point]
Colour: TypeAlias = tuple[float, float, float]
_STL_HEAD, _TRIANGLE = 84, struct.Struct("<12fH")
_CASE, _BOARD, _PART = (0.80, 0.84, 0.88), (0.20, 0.52, 0.33), (0.42, 0.45, 0.48)
#: Of a view.
WIDTH, HEIGHT, PIXELS_PER_MM = 560, 440, 3.3
#: Title, body, turn and tilt in degrees, whether the board is in it.
VIEWS = (
    ("base with the board", "base", 28.0, 50.0, True),
    ("base, from the USB side", "base", 205.0, 40.0, False),
    ("lid", "lid", 28.0, 50.0, False),
)


def read_stl(path: Path) -> list[Triangle]:
    """Return the triangles of a binary STL file.

    Raises:
        ValueError: Its length and its count do not agree.
    """
    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, _STL_HEAD - 4)
    if len(data) != _STL_HEAD + count * _TRIANGLE.size:
        raise ValueError(f"{path.name}: {count} triangles in {len(data)} bytes")
    rows = (_TRIANGLE.unpack_from(data, _STL_HEAD + place * _TRIANGLE.size) for place in range(count))
    return [(row[3:6], row[6:9], row[9:12]) for row in rows]


def draw(folder: Path, output: Path) -> None:
    """Draw base with board, and lid, from the STL files of a folder."""
    from matplotlib import figure

    sheet = figure.Figure(figsize=(len(VIEWS) * WIDTH / 100, (HEIGHT + 30) / 100), dpi=100)
    for place, (title, name, turn, tilt, has_board) in enumerate(VIEWS, start=1):
        faces = [(triangle, _CASE) for triangle in read_stl(folder / f"{name}.stl")]
        if has_board:
            slab = (0.0, BOARD_WIDTH_MM, 0.0, BOARD_HEIGHT_MM, -BOARD_THICKNESS_MM, 0.0)
            faces += [(triangle, _BOARD) for triangle in _box(*slab)]
            faces += [(face, _PART) for box in bodies() for face in _box(*box.x, *box.y, *box.z)]
        axes = sheet.add_subplot(1, len(VIEWS), place)
        axes.imshow(_seen(faces, math.radians(turn), math.radians(tilt)))
        axes.set_title(title)
        axes.set_axis_off()
    sheet.subplots_adjust(left=0, right=1, bottom=0, top=0.93, wspace=0)
    sheet.savefig(output)


def _seen(faces: Iterable[tuple[Triangle, Colour]], turn: float, tilt: float) -> "np.ndarray":
    """Return what is seen from far away, with the nearest face at each pixel."""
    import numpy as np

    picture = np.ones((HEIGHT, WIDTH, 3))
    nearest = np.full((HEIGHT, WIDTH), -np.inf)
    cos_turn, sin_turn, cos_tilt, sin_tilt = math.cos(turn), math.sin(turn), math.cos(tilt), math.sin(tilt)
    # To the right, up and towards the eye.
    axes = np.array(
        [
            (cos_turn, sin_turn, 0.0),
            (-sin_turn * sin_tilt, cos_turn * sin_tilt, cos_tilt),
            (sin_turn * cos_tilt, -cos_turn * cos_tilt, sin_tilt),
        ]
    )
    middle = np.array((BOARD_WIDTH_MM / 2, -BOARD_HEIGHT_MM / 2 - 3.0, 5.0))
    for triangle, colour in faces:
        right, up, depth = axes @ (np.array(triangle) - middle).T
        x, y = WIDTH / 2 + right * PIXELS_PER_MM, HEIGHT / 2 - up * PIXELS_PER_MM
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
        left, top = max(0, math.floor(x.min())), max(0, math.floor(y.min()))
        columns, rows = np.arange(left, min(WIDTH, x.max() + 1)), np.arange(top, min(HEIGHT, y.max() + 1))
        if abs(area) < 1e-6 or not columns.size or not rows.size:
            continue
        at_x, at_y = columns[None, :], rows[:, None]
        second = ((at_x - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (at_y - y[0])) / area
        third = ((x[1] - x[0]) * (at_y - y[0]) - (at_x - x[0]) * (y[1] - y[0])) / area
        far = depth[0] + second * (depth[1] - depth[0]) + third * (depth[2] - depth[0])
        window = (slice(top, top + rows.size), slice(left, left + columns.size))
        seen = (second >= -1e-3) & (third >= -1e-3) & (second + third <= 1.001) & (far > nearest[window])
        nearest[window][seen] = far[seen]
        picture[window][seen] = np.array(colour) * _light(triangle)
    return picture


def _light(triangle: Triangle) -> float:
    """Return how bright a face is: the light comes from the left, from the front and from above."""
    import numpy as np

    first, second, third = map(np.array, triangle)
    normal = np.cross(second - first, third - first)
    return 0.45 + 0.55 * abs(float(normal @ (0.25, 0.42, 0.87))) / max(float(np.linalg.norm(normal)), 1e-12)


def _box(left: float, right: float, top: float, bottom: float, low: float, high: float) -> list[Triangle]:
    """Return the faces of a box, y up."""
    x, y, z = (left, right), (-bottom, -top), (low, high)
    corner = [(x[place & 1], y[place >> 1 & 1], z[place >> 2]) for place in range(8)]
    sides = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return [
        (corner[first], corner[one], corner[other])
        for first, second, third, fourth in sides
        for one, other in ((second, third), (third, fourth))
    ]
