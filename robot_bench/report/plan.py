"""The plan of a run: what is written on the drawing of world and path, and where.

`path.png` draws this list. Not here: shapes of things (in the trace) and colours.

Lengths are metres in the world's frame: x to the right (heading 0°), y up. Offsets of
labels are pixels, y down, at the size that the list was made for.

Invariant: no two labels of a list overlap, but those of things that come and go.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from p2os.pioneer.world.drawing import grid_step
from robot_bench.events.codec import Json

#: Width of the drawn world that the labels are made for, pixels.
WIDE_PX = 690
#: Of a label in 12 pixel sans-serif: an upper bound of a letter's mean width, and the line.
LETTER_PX, LINE_PX = 6.6, 14
#: chosen: enough to follow the time along a path, few enough to read.
MOST_TIMES = 12
#: chosen: nearer than this share of the plan's width, and turned by less, the robot is taken to stand: one mark.
STANDING_SHARE, TURNED_RAD = 0.01, 0.2
TIME_STEPS_S = (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600)
#: chosen: in a heap of collisions each has its mark, the first ones a label.
MOST_NAMED_HITS = 12
#: chosen: what is left free around the path where it leaves the world's extent.
EDGE_M = 0.3
#: Size of a cell in which labels look for the path.
CELL_PX = 6


@dataclass(slots=True)
class _Sheet:
    """The pixels of a drawing, and what is written there already."""

    bounds: tuple[float, float, float, float]
    width_px: float
    boxes: list[tuple[float, float, float, float]] = field(default_factory=list)
    path: set[tuple[int, int]] = field(default_factory=set)

    @property
    def scale(self) -> float:
        return self.width_px / (self.bounds[2] - self.bounds[0])

    def at(self, x: float, y: float) -> tuple[float, float]:
        return (x - self.bounds[0]) * self.scale, (self.bounds[3] - y) * self.scale


def plan(
    *, extent: Sequence[float], poses: Sequence[Sequence[float]], obstacles: Sequence[Json], changes: Sequence[Json],
    hits: Sequence[tuple[float, float, float, str]], duration_s: float,
) -> Json:  # fmt: skip
    """Return bounds, grid, scale bar, start, times along the path, and the labels.

    Args:
        extent: Least x and y and greatest x and y of the world, metres.
        poses: Rows that begin with t (s), x, y (m) and heading (rad).
        obstacles: Things of the world at the start.
        changes: What is placed, moved and removed, in order.
        hits: Collisions as (t in s, x and y in m, what was touched).
        duration_s: Of the run; at least as long as its last pose.
    """
    bounds = _bounds(extent, poses)
    times = list(_times(poses, duration_s, bounds))
    return {
        "bounds": bounds,
        "step": grid_step(max(bounds[2] - bounds[0], bounds[3] - bounds[1])),
        "times": times,
        "labels": _labels(_Sheet(bounds, WIDE_PX), poses, times, obstacles, changes, hits),
    }


def things_at_the_end(obstacles: Sequence[Json], changes: Sequence[Json]) -> list[Json]:
    """Return the things after every change that the run made."""
    now = {str(item["name"]): item for item in obstacles}
    for change in changes:
        name = str(change["name"])
        if change.get("op") == "remove":
            now.pop(name, None)
        else:
            now[name] = {**now.get(name, {}), **change}
    return list(now.values())


def _bounds(extent: Sequence[float], poses: Sequence[Sequence[float]]) -> tuple[float, float, float, float]:
    """Return the extent, widened to where the robot went: a real one's world is not known."""
    x0, y0, x1, y1 = extent
    if poses:
        xs, ys = [row[1] for row in poses], [row[2] for row in poses]
        x0, y0 = min(x0, min(xs) - EDGE_M), min(y0, min(ys) - EDGE_M)
        x1, y1 = max(x1, max(xs) + EDGE_M), max(y1, max(ys) + EDGE_M)
    return x0, y0, x1, y1


def _times(poses: Sequence[Sequence[float]], duration_s: float, bounds: Sequence[float]) -> Iterator[list[float]]:
    """Yield (t, x, y, heading, t of the last round time that finds it there) at round times after the start."""
    step = next((s for s in TIME_STEPS_S if duration_s / s <= MOST_TIMES), duration_s / MOST_TIMES)
    near_m, number = (bounds[2] - bounds[0]) * STANDING_SHARE, 1
    last: list[float] | None = None
    for row in poses:
        if row[0] < number * step:
            continue
        at = number * step
        number = math.floor(row[0] / step) + 1
        is_there = (
            last and math.hypot(row[1] - last[1], row[2] - last[2]) < near_m and abs(row[3] - last[3]) < TURNED_RAD
        )
        if last and is_there:
            last[4] = at
            continue
        if last:
            yield last
        last = [at, *row[1:4], at]
    if last:
        yield last


def _labels(
    sheet: _Sheet, poses: Sequence[Sequence[float]], times: Sequence[Sequence[float]], obstacles: Sequence[Json],
    changes: Sequence[Json], hits: Sequence[tuple[float, float, float, str]],
) -> list[Json]:  # fmt: skip
    """Return the labels that find room, the more important first."""
    for row in poses:
        x, y = sheet.at(row[1], row[2])
        sheet.path.add((int(x / CELL_PX), int(y / CELL_PX)))
    found: list[Json] = []
    if poses:
        _add(found, sheet, "start", poses[0][1:3], 10, {"kind": "start"})
    for t, x, y, what in hits[:MOST_NAMED_HITS]:
        _add(found, sheet, f"{what}, {t:.1f} s", (x, y), 9, {"kind": "hit", "t": t})
    for row in times:
        text = f"{row[0]:g} s" if row[0] == row[4] else f"{row[0]:g}–{row[4]:g} s"
        _add(found, sheet, text, row[1:3], 9, {"kind": "time", "t": row[0]})
    come_and_go = {str(item["name"]) for item in changes}
    first = {str(item["name"]): item for item in (*reversed(changes), *obstacles) if "x" in item}
    for name, item in first.items():
        if name not in come_and_go:
            _add(found, sheet, name, _middle(item), _reach(item, sheet.scale), {"kind": "thing", "name": name})
    for name in (name for name in first if name in come_and_go):
        free = _Sheet(sheet.bounds, sheet.width_px)
        _add(found, free, name, _middle(first[name]), _reach(first[name], sheet.scale), {"kind": "thing", "name": name})
    return found


def _add(found: list[Json], sheet: _Sheet, text: str, at: Sequence[float], reach: float | tuple[float, float],
         about: Json) -> None:  # fmt: skip
    """Add a label where it is on nothing written and least on the path; where it finds no room there is none."""
    px, py = sheet.at(at[0], at[1])
    width, height = LETTER_PX * len(text), LINE_PX
    across, along = reach if isinstance(reach, tuple) else (reach, reach)
    places = [("left", across + 2, 0.0), ("right", -across - 2, 0.0), ("center", 0.0, -along - 8),
              ("center", 0.0, along + 8), ("left", across, -along - 4), ("left", across, along + 4),
              ("right", -across, -along - 4), ("right", -across, along + 4)]  # fmt: skip
    if isinstance(reach, tuple):
        places.insert(0, ("center", 0.0, 0.0))
    best: tuple[int, Json, tuple[float, float, float, float]] | None = None
    high = (sheet.bounds[3] - sheet.bounds[1]) * sheet.scale
    for align, dx, dy in places:
        left = px + dx - {"left": 0.0, "center": width / 2, "right": width}[align]
        box = (left, py + dy - height / 2, left + width, py + dy + height / 2)
        if box[0] < 0 or box[1] < 0 or box[2] > sheet.width_px or box[3] > high:
            continue
        if any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in sheet.boxes):
            continue
        cells = sum(
            (column, row) in sheet.path
            for column in range(int(box[0] / CELL_PX), int(box[2] / CELL_PX) + 1)
            for row in range(int(box[1] / CELL_PX), int(box[3] / CELL_PX) + 1)
        )
        if align == "center" and dy == 0 and (width > 2 * across or height > 2 * along):
            cells += 1
        if best is None or cells < best[0]:
            label = {"text": text, "x": at[0], "y": at[1], "dx": round(dx), "dy": round(dy), "align": align, **about}
            best = (cells, label, box)
    if best is not None:
        found.append(best[1])
        sheet.boxes.append(best[2])


def _middle(item: Json) -> tuple[float, float]:
    return float(item["x"]), float(item["y"])  # type: ignore[arg-type]  # numbers, checked where the trace is read


def _reach(item: Json, scale: float) -> tuple[float, float]:
    """Return how far a thing reaches across and along the drawing from its middle, in pixels."""
    if "radius" in item:
        radius = float(item["radius"]) * scale  # type: ignore[arg-type]  # as above
        return radius, radius
    length, width, heading = (float(item.get(key) or 0.0) / 2 * scale if key != "heading" else float(item.get(key) or 0)  # type: ignore[arg-type]  # as above
                              for key in ("length", "width", "heading"))  # fmt: skip
    c, s = abs(math.cos(heading)), abs(math.sin(heading))
    return c * length + s * width, s * length + c * width
