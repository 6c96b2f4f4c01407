"""ARIA's `.map` files (2D-Map): what MobileSim, MobileEyes and ARNL use.

Taken: lines and points of every section (millimetres) as walls; `Goal`,
`GoalWithHeading`, `Dock`, `RobotHome` as marks, the first home, dock or goal as
start; `ForbiddenLine` and `ForbiddenArea` as marks: programs keep out of them,
a robot's sonar and hull do not know them; `Reflector` as a mark and as a wall, which
a laser does not see brighter here.

Source: ARIA's ArMap documentation and the maps that ship with it; of reflectors, MobileSim's README.
"""

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.collection import Collection
from p2os.pioneer.world.formats.rectangles import rectangles
from p2os.pioneer.world.model import FARTHEST_M, Mark, Obstacle, ObstacleKind, Pose, World
from p2os.pioneer.world.text_file import read_foreign_text

#: A line has no thickness and a wall needs one; every body holds a robot at the least (1e-6 m). chosen: a hundred
#: times that, which 32-bit numbers still tell from nothing 1 km out. Half of it stands on either side.
LINE_THICK_M = 1e-4
WALL_HIGH_M = 1.0
DEFAULT_RESOLUTION_MM = 20
#: chosen: where a map has lines too, its points go on a coarser grid: they are what a scanner saw beside the walls.
POINT_CELL_MM = 50
#: So many cells on either side of a line belong to it.
BESIDE = range(-2, 3)
#: chosen: cells on all lines together, 100 km of walls on the grid of points.
MOST_LINE_CELLS = 2_000_000
#: Cells of the finest grid that points are put on.
MOST_CELLS = 50_000_000
MARK_KINDS: Mapping[str, str] = {
    "Goal": "goal", "GoalWithHeading": "goal", "Dock": "dock", "DockLynx": "dock", "RobotHome": "home",
    "ForbiddenLine": "forbidden", "ForbiddenArea": "forbidden", "Reflector": "reflector",
}  # fmt: skip
#: What makes the best start, best first.
STARTS = ("RobotHome", "Dock", "DockLynx", "GoalWithHeading", "Goal")
_WORDS = re.compile(r'"((?:\\.|[^"\\])*)"|(\S+)')


def read(path: Path, up: str) -> World:
    """Return the world of an ARIA map.

    Raises:
        WorldError: The file is no such map, or is cut short.
    """
    if up != "auto":
        raise WorldError(f"{path}: a map has no up axis")
    return _Reader(path).read()


class _Reader:
    def __init__(self, path: Path) -> None:
        self._path = path
        self._collection = Collection(path)
        self._points: list[tuple[float, float]] = []
        self._lines: list[tuple[tuple[float, float], tuple[float, float]]] = []
        self._starts: dict[str, Pose] = {}
        self._resolution_mm = DEFAULT_RESOLUTION_MM
        #: What the header promises, and what has come.
        self._promised = {"NumLines:": 0, "NumPoints:": 0}
        self._counted = {"NumLines:": 0, "NumPoints:": 0}

    def read(self) -> World:
        lines = read_foreign_text(self._path).splitlines()
        if not lines or not lines[0].startswith("2D-Map"):
            raise WorldError(f"{self._path}:1: an ARIA map begins with 2D-Map")
        take: Callable[[str, int], None] = self._header
        for number, line in enumerate(lines[1:], start=2):
            word = line.strip()
            if not word or word.startswith(("#", ";")):
                continue
            if re.fullmatch(r"LINES\d*", word):
                take = self._line
            elif re.fullmatch(r"DATA\d*", word):
                take = self._point
            else:
                take(word, number)
        for key, promised in self._promised.items():
            if self._counted[key] < promised:
                raise WorldError(
                    f"{self._path}: it promises {key.removeprefix('Num').rstrip(':').lower()} {promised}, "
                    f"and has {self._counted[key]}",
                    hint="the file is cut short",
                )
        self._add_points()
        start = next((self._starts[name] for name in STARTS if name in self._starts), None)
        return self._collection.world(start)

    def _header(self, line: str, number: int) -> None:
        key, _, rest = line.partition(" ")
        if key in self._promised or key == "Resolution:":
            value = round(self._numbers(rest, number, 1)[0])
            if key == "Resolution:":
                self._resolution_mm = max(1, value)
            else:
                self._promised[key] += value
        elif key == "Cairn:":
            self._cairn(rest, number)

    def _cairn(self, rest: str, number: int) -> None:
        """Take a place: type, x, y, heading in degrees, description, ICON, name, and the ends of a line or an area."""
        words = [quoted or plain for quoted, plain in _WORDS.findall(rest)]
        if not words:
            raise WorldError(f"{self._path}:{number}: a Cairn without a type")
        kind = MARK_KINDS.get(words[0])
        if kind is None:
            self._collection.skip(f"Cairn {words[0]}")
            return
        x, y, heading = self._numbers(" ".join(words[1:4]), number, 3)
        name = words[6] if len(words) > 6 else ""
        points = [(x / 1000, y / 1000)]
        if kind in {"forbidden", "reflector"}:
            ax, ay, bx, by = self._numbers(" ".join(words[7:11]), number, 4)
            points = [(ax / 1000, ay / 1000), (bx / 1000, by / 1000)]
            if words[0] == "ForbiddenArea":
                points = _turned_area(ax / 1000, ay / 1000, bx / 1000, by / 1000, math.radians(heading))
        if kind == "reflector":
            self._collection.add_wall(name or kind, points[0], points[1], thick=LINE_THICK_M, high=WALL_HIGH_M)
        self._collection.marks.append(Mark(name=name, kind=kind, points_m=tuple(points)))
        self._starts.setdefault(words[0], Pose(x / 1000, y / 1000, math.radians(heading)))

    def _line(self, line: str, number: int) -> None:
        x0, y0, x1, y1 = (value / 1000 for value in self._numbers(line, number, 4))
        self._counted["NumLines:"] += 1
        self._lines.append(((x0, y0), (x1, y1)))
        self._collection.add_wall(
            f"line {self._counted['NumLines:']}", (x0, y0), (x1, y1), thick=LINE_THICK_M, high=WALL_HIGH_M
        )

    def _point(self, line: str, number: int) -> None:
        x, y = self._numbers(line, number, 2)
        self._counted["NumPoints:"] += 1
        self._points.append((x, y))

    def _add_points(self) -> None:
        """Put the points on a grid of the map's resolution and take its cells as blocks."""
        if not self._points:
            return
        size = max(self._resolution_mm, POINT_CELL_MM) if self._lines else self._resolution_mm
        at_lines = self._cells_at_lines(size)
        seen = {(round(x / size), round(y / size)) for x, y in self._points}
        # Points on lines and beside them are the same walls again.
        cells = {(x, y) for x, y in seen if not any((x + i, y + j) in at_lines for i in BESIDE for j in BESIDE)}
        if not cells:
            return
        left, low = min(x for x, _ in cells), min(y for _, y in cells)
        width, top = max(x for x, _ in cells) - left + 1, max(y for _, y in cells)
        if width * (top - low + 1) > MOST_CELLS:
            raise WorldError(f"{self._path}: its points are too far apart for a resolution of {size} mm")
        rows = [bytearray(width) for _ in range(top - low + 1)]
        for x, y in cells:
            rows[top - y][x - left] = 1
        for number, (column, row, columns, count) in enumerate(rectangles(map(bytes, rows)), start=1):
            x_mm, y_mm = (left + column + (columns - 1) / 2) * size, (top - row - (count - 1) / 2) * size
            self._collection.add_thing(
                Obstacle(
                    name=f"points {number}",
                    x_m=x_mm / 1000,
                    y_m=y_mm / 1000,
                    length_m=columns * size / 1000,
                    width_m=count * size / 1000,
                    height_m=WALL_HIGH_M,
                    kind=ObstacleKind.WALL,
                    fixed=True,
                )
            )

    def _cells_at_lines(self, size: int) -> set[tuple[int, int]]:
        """Return the cells on lines."""
        length_mm = sum(math.dist(a, b) for a, b in self._lines) * 1000
        if length_mm / size > MOST_LINE_CELLS:
            raise WorldError(f"{self._path}: its lines are too long for points on a grid of {size} mm")
        found: set[tuple[int, int]] = set()
        for (ax, ay), (bx, by) in self._lines:
            steps = max(1, round(math.hypot(bx - ax, by - ay) * 1000 / size))
            for step in range(steps + 1):
                x, y = (ax + (bx - ax) * step / steps) * 1000 / size, (ay + (by - ay) * step / steps) * 1000 / size
                found.add((round(x), round(y)))
        return found

    def _numbers(self, text: str, number: int, count: int) -> list[float]:
        words = text.split()
        try:
            values = [float(word) for word in words[:count]]
        except ValueError:
            values = []
        if len(values) < count or not all(abs(value) <= FARTHEST_M * 1000 for value in values):
            raise WorldError(
                f"{self._path}:{number}: expected {count} numbers, got {text[:40]!r}",
                hint=f"millimetres, within {FARTHEST_M / 1000:g} km",
            )
        return values


def _turned_area(ax: float, ay: float, bx: float, by: float, heading: float) -> list[tuple[float, float]]:
    """Return the corners of an area that is given by two corners in a frame turned about the origin."""
    c, s = math.cos(heading), math.sin(heading)
    return [(c * x - s * y, s * x + c * y) for x, y in ((ax, ay), (bx, ay), (bx, by), (ax, by))]
