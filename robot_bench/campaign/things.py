"""Things that a campaign draws: posts, walls, dead ends, gaps, corners, doorways, walkers, …, each of a few numbers.

    [[draw]]
    kind = "dead-end"
    count = { from = 0, to = 2 }          # or a number
    width_m = { from = 0.6, to = 1.4 }    # a key of the kind's: a range, a list of values, or a value

A kind is a row: its measures with the range that each has where the file says nothing, and how `[[obstacle]]` tables
are made of them. A drawn place that has no room (nearer than `gap_m` to another thing, or `free_m` to the start) is
given up for one nearby, and a thing that finds none is left out; the same numbers always come to the same things.

Invariant: the tables are those of a scenario file, so that shrinking, `p2os run` and a person read what was searched.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.toml_schema import Table

#: chosen: higher than every sonar.
HEIGHT_M = 0.5
#: chosen: of walls of dead ends and gaps.
WALL_M = 0.08
#: chosen: so many places are tried; each next one is a golden angle on, and a little further off.
TRIES = 64
_GOLDEN_RAD = math.pi * (3 - math.sqrt(5))
_STEP_M = 0.35
#: Digits of what is written: millimetres and tenths of a degree.
_M, _DEG = 3, 1

Measures = Mapping[str, float]
#: What a table of the file has for a measure: a value of each, drawn.
Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ThingKind:
    """A kind of thing.

    Args:
        doc: What it is.
        measures: Key → the range that it has where the file gives none.
        boxes: Of drawn measures the boxes and cylinders, in metres and degrees about its own place and heading.
        walks: Whether it moves along its heading, by `way_m` at `speed_mps`, to and fro.
    """

    doc: str
    measures: Mapping[str, tuple[float, float]]
    boxes: Callable[[Measures], Sequence[Table]]
    walks: bool = False


def _box(x_m: float, y_m: float, length_m: float, width_m: float, heading_deg: float = 0.0) -> Table:
    return {"x_m": x_m, "y_m": y_m, "length_m": length_m, "width_m": width_m, "heading_deg": heading_deg}


def _post(measures: Measures) -> Sequence[Table]:
    return [{"x_m": 0.0, "y_m": 0.0, "radius_m": measures["width_m"] / 2}]


def _dead_end(measures: Measures) -> Sequence[Table]:
    """Return three walls about a place that is open to its heading."""
    width, depth = measures["width_m"], measures["depth_m"]
    side = (width + WALL_M) / 2
    return [
        _box(-(depth + WALL_M) / 2, 0.0, WALL_M, width + 2 * WALL_M),
        _box(0.0, side, depth, WALL_M),
        _box(0.0, -side, depth, WALL_M),
    ]


def _gap(measures: Measures) -> Sequence[Table]:
    """Return two walls in a line with a gap between them."""
    width, length = measures["width_m"], measures["length_m"]
    middle = (width + length) / 2
    return [_box(0.0, middle, WALL_M, length), _box(0.0, -middle, WALL_M, length)]


def _corner(measures: Measures) -> Sequence[Table]:
    """Return two walls of one length at a right angle about a place within it, open to its heading."""
    length = measures["length_m"]
    side = (length - WALL_M) / (2 * math.sqrt(2))
    return [_box(-side, side, length, WALL_M, 45.0), _box(-side, -side, length, WALL_M, -45.0)]


def _doorway(measures: Measures) -> Sequence[Table]:
    """Return a wall across the way with a door in it, and its jambs, which stand out to both sides."""
    jamb, width = measures["depth_m"], measures["width_m"]
    jambs = [_box(0.0, side * (width + WALL_M) / 2, jamb, WALL_M) for side in (1, -1)]
    return [*_gap({**measures, "width_m": width + 2 * WALL_M}), *jambs]


#: Kind → what it is made of.
KINDS: Mapping[str, ThingKind] = {
    "post": ThingKind("a cylinder", {"width_m": (0.04, 0.3)}, _post),
    "box": ThingKind(
        "a box", {"length_m": (0.1, 0.8), "width_m": (0.1, 0.6)},
        lambda measures: [_box(0.0, 0.0, measures["length_m"], measures["width_m"])],
    ),
    "wall": ThingKind(
        "8 cm thick", {"length_m": (0.6, 2.5)}, lambda measures: [_box(0.0, 0.0, measures["length_m"], WALL_M)],
    ),
    "dead-end": ThingKind(
        "three walls, open to its heading; inside measures", {"width_m": (0.8, 1.6), "depth_m": (0.6, 1.6)}, _dead_end
    ),
    "gap": ThingKind("two walls of that length in a line", {"width_m": (0.5, 1.2), "length_m": (0.4, 1.2)}, _gap),
    "corner": ThingKind("two walls at a right angle, open to its heading", {"length_m": (0.6, 1.6)}, _corner),
    "doorway": ThingKind(
        "a wall with a door between two lengths, jambs of that depth",
        {"width_m": (0.7, 1.2), "length_m": (0.8, 2.0), "depth_m": (0.1, 0.4)}, _doorway,
    ),
    "walker": ThingKind(
        "a cylinder that walks to and fro along its heading",
        {"width_m": (0.2, 0.5), "way_m": (1.0, 4.0), "speed_mps": (0.1, 0.6)}, _post, walks=True,
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnThing:
    """A drawn thing: its kind, where it is wanted, and its measures."""

    name: str
    kind: str
    place: Place
    measures: Measures
    #: How far it stands off other things at least, in place of the room's.
    gap_m: float | None = None


@dataclass(slots=True)
class Room:
    """Where things may stand: apart from the world's own, from where robots begin and from each other.

    Args:
        world: Where they are placed; its floor ends at its extent.
        starts: Where robots begin.
        gap_m: How far things stand apart at least.
        free_m: How far from the middle of each robot at its start nothing stands.
    """

    world: World
    starts: Sequence[Pose]
    gap_m: float
    free_m: float

    def tables(self, things: Sequence[DrawnThing]) -> list[Table]:
        """Return the `[[obstacle]]` tables of the things that find room, in their order."""
        taken = [Footprint(item) for item in self.world.obstacles if item.walk is None and not item.kind.is_driven_on]
        found: list[Table] = []
        for thing in things:
            kind = KINDS[thing.kind]
            for x_m, y_m, heading_deg in _places(thing.place):
                parts = [_placed(part, x_m, y_m, heading_deg) for part in kind.boxes(thing.measures)]
                prints = [Footprint(_obstacle(part)) for part in parts]
                gap_m = self.gap_m if thing.gap_m is None else thing.gap_m
                if all(self._is_free(one, taken, gap_m) for one in prints):
                    taken += [] if kind.walks else prints
                    names = [thing.name] if len(parts) == 1 else [f"{thing.name}-{n}" for n in range(1, len(parts) + 1)]
                    found += [_table(name, part, thing, heading_deg) for name, part in zip(names, parts, strict=True)]
                    break
        return found

    def _is_free(self, one: Footprint, others: Sequence[Footprint], gap_m: float) -> bool:
        x0, y0, x1, y1 = self.world.extent
        left, low, right, high = one.bounds
        if left < x0 or low < y0 or right > x1 or high > y1:
            return False
        if any(one.distance_to_point(start.x_m, start.y_m) < self.free_m for start in self.starts):
            return False
        return all(_apart_m(one, other) >= gap_m for other in others)


def _places(wanted: Place) -> Sequence[Place]:
    """Return places to try: the wanted one, then a spiral about it."""
    x_m, y_m, heading_deg = wanted
    return [
        (
            x_m + _STEP_M * math.sqrt(turn) * math.cos(turn * _GOLDEN_RAD),
            y_m + _STEP_M * math.sqrt(turn) * math.sin(turn * _GOLDEN_RAD),
            heading_deg,
        )
        for turn in range(TRIES)
    ]


def _placed(part: Table, x_m: float, y_m: float, heading_deg: float) -> dict[str, float]:
    """Return a box or cylinder of a thing as it stands in the plan."""
    values = {key: float(value) for key, value in part.items() if isinstance(value, (int, float))}
    turn = math.radians(heading_deg)
    px, py = values["x_m"], values["y_m"]
    values["x_m"] = round(x_m + px * math.cos(turn) - py * math.sin(turn), _M)
    values["y_m"] = round(y_m + px * math.sin(turn) + py * math.cos(turn), _M)
    if "heading_deg" in values:
        values["heading_deg"] = round((values["heading_deg"] + heading_deg) % 360, _DEG)
    return {key: round(value, _M) for key, value in values.items()}


def _obstacle(part: Mapping[str, float]) -> Obstacle:
    return Obstacle(
        name="drawn", x_m=part["x_m"], y_m=part["y_m"], heading_rad=math.radians(part.get("heading_deg", 0.0)),
        length_m=part.get("length_m", 0.0), width_m=part.get("width_m", 0.0), radius_m=part.get("radius_m", 0.0),
        height_m=HEIGHT_M,
    )  # fmt: skip


def _table(name: str, part: Mapping[str, float], thing: DrawnThing, heading_deg: float) -> Table:
    shape = "cylinder" if "radius_m" in part else "box"
    table: dict[str, object] = {"at_s": 0.0, "name": name, "shape": shape, **part, "height_m": HEIGHT_M}
    if KINDS[thing.kind].walks:
        turn, way_m = math.radians(heading_deg), thing.measures["way_m"]
        far = [round(part["x_m"] + way_m * math.cos(turn), _M), round(part["y_m"] + way_m * math.sin(turn), _M)]
        table |= {"path_m": [[part["x_m"], part["y_m"]], far], "speed_mps": round(thing.measures["speed_mps"], _M)}
    return table


def _apart_m(one: Footprint, other: Footprint) -> float:
    """Return how far two things are apart in the plan, metres; 0 where they overlap."""
    if one.polygon:
        return other.distance(one.polygon)
    if other.polygon:
        return one.distance(other.polygon)
    return max(math.hypot(one.x - other.x, one.y - other.y) - one.radius - other.radius, 0.0)
