"""The searched space: what a campaign file lets vary, as the unit cube, and the trial that stands at each point of it.

A search proposes points with a coordinate from 0 up to 1 for each dimension; it knows nothing of scenarios. Drawn
things have as many coordinates as the most of them need; those of things beyond the drawn count are without effect.

Invariant: a point comes to the same trial on every machine.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import cast

from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from p2os.toml_record import number_of, table_of, tables_of
from p2os.toml_schema import Table
from robot_bench.campaign.campaign_file import Campaign, Disturbance, Drawn, Span
from robot_bench.campaign.things import DrawnThing, Room
from robot_bench.campaign.trial import Trial, unpacked
from robot_bench.scenario.included_files import Setting

#: A coordinate for each dimension.
Point = tuple[float, ...]
#: Returns the value of a dimension, by its name, and notes that it has an effect.
Value = Callable[[str, Span], object]
_UNIT = Span(0.0, 1.0)
#: What places a thing that is seen from the robot.
_SEEN = ("ahead_m", "aside_m")


@dataclass(frozen=True, slots=True)
class Dimension:
    """One coordinate: what it is called, and the values along it."""

    name: str
    span: Span


@dataclass(frozen=True, slots=True)
class Proposal:
    """A point of the space with what stands there."""

    point: Point
    #: Dimension → value; those without effect at this point are left out.
    values: Mapping[str, object]
    settings: tuple[Setting, ...]
    obstacles: tuple[Table, ...]
    faults: tuple[Table, ...]
    #: Of what was drawn and of what disturbs it the names of what excuses from a goal.
    disturbed_by: frozenset[str] = frozenset()

    def trial(self, base: Trial, stage: Sequence[Setting]) -> Trial:
        """Return the trial of this point, with what a stage sets."""
        found = base.set(*stage, *self.settings)
        lists: dict[str, Sequence[Table]] = {}
        for name, more in (("obstacle", self.obstacles), ("fault", self.faults)):
            if more:
                lists[name] = [*tables_of(base.table, name), *more]
        return replace(found.with_lists(**lists), disturbed_by=self.disturbed_by | base.disturbed_by)


class Space:
    """The space of a campaign.

    Raises:
        ScenarioError: The world cannot be read.
    """

    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign
        self.dimensions = tuple(_dimensions(campaign))
        goals = tables_of(campaign.trial.table, "goal")
        self._excusing = frozenset(name for goal in goals for name in cast("Sequence[str]", goal.get("excused_by", ())))
        #: The floor of the world where nothing varies: least x, least y, greatest x and y, metres.
        self.extent = self._place(())[0].extent

    def proposal(self, point: Point) -> Proposal:
        """Return what stands at a point."""
        at = dict(zip((one.name for one in self.dimensions), point, strict=True))
        campaign, values = self._campaign, dict[str, object]()

        def value(name: str, span: Span) -> object:
            if span.count == 1:
                return span.value(0.0)
            values[name] = found = span.value(at[name])
            return found

        def chance(name: str) -> float:
            """Return a coordinate as it is, and note that it has an effect."""
            value(name, _UNIT)
            return at[name]

        def is_on(name: str) -> bool:
            """Tell whether the point has this feature; one of a swarm may be turned off."""
            return not campaign.swarm or chance(f"{name}{ON}") >= campaign.swarm

        groups = {group: is_on(group) for group in _groups(campaign)}
        settings = tuple((key, value(key, span)) for key, span in campaign.vary.items() if groups[_group(key)])
        obstacles: Sequence[Table] = ()
        if campaign.draws:
            world, starts = self._place(settings)
            draws = [draw for draw in campaign.draws if is_on(draw.name)]
            things = [thing for draw in draws for thing in _things(draw, world, starts[0], value)]
            room = Room(world, starts, campaign.gap_m, campaign.free_m)
            obstacles = room.tables(things)
        drawn = {str(table["name"]) for table in obstacles}
        names = {draw.name for draw in campaign.draws if any(one.startswith(f"{draw.name}-") for one in drawn)}
        faults = list[Table]()
        for number, one in enumerate(campaign.disturbances, 1):
            if is_on(f"disturb-{number}") and (tables := _faults(one, number, value, chance)):
                faults += tables
                names.add(one.name)
        return Proposal(point, values, settings, tuple(obstacles), tuple(faults), self._excusing & names)

    def coordinates(self, point: Point) -> dict[str, float]:
        """Return a point by the names of its dimensions."""
        return dict(zip((one.name for one in self.dimensions), point, strict=True))

    def point(self, coordinates: Mapping[str, float]) -> Point:
        """Return the point of such coordinates; the middle of each dimension that they do not have."""
        return tuple(coordinates.get(one.name, 0.5) for one in self.dimensions)

    def acting(self, proposal: Proposal) -> frozenset[int]:
        """Return the numbers of the dimensions that had an effect at a point."""
        return frozenset(number for number, one in enumerate(self.dimensions) if one.name in proposal.values)

    def _place(self, settings: Sequence[Setting]) -> tuple[World, Sequence[Pose]]:
        """Return the world of a point, and where its robots begin in it, the first one first."""
        deciding = tuple((key, value) for key, value in settings if key.partition(".")[0] in _DECIDING)
        return _world_and_starts(self._campaign.trial, deciding)


#: What decides where a robot begins.
_DECIDING = frozenset({"world", "seed", "start", "robot"})


def _world_and_starts(trial: Trial, settings: tuple[Setting, ...]) -> tuple[World, Sequence[Pose]]:
    changed = trial.set(*settings)
    with unpacked(trial.files) as folder:
        name = str(changed.table["world"])
        world = _world(str(folder / name) if name in trial.files else name, changed.seed)
    tables = tables_of(changed.table, "robot") or [table_of(changed.table, "start")]
    return world, [_pose(table) if "x_m" in table else world.start for table in tables]


def _pose(table: Table) -> Pose:
    x_m, y_m, heading_deg = (number_of(table, key) for key in ("x_m", "y_m", "heading_deg"))
    return Pose(x_m, y_m, math.radians(heading_deg))


@lru_cache(maxsize=64)
def _world(name: str, seed: int) -> World:
    return load_world(name, seed=seed)


#: What the dimension is called that turns a feature of a swarm on or off.
ON = ".on"


def _group(key: str) -> str:
    """Return what is turned on and off together: the keys of one table, or a key of the scenario."""
    return key.rpartition(".")[0] or key


def _groups(campaign: Campaign) -> list[str]:
    return list(dict.fromkeys(_group(key) for key in campaign.vary))


def _dimensions(campaign: Campaign) -> list[Dimension]:
    found = [Dimension(key, span) for key, span in campaign.vary.items()]
    if campaign.swarm:
        disturbed = [f"disturb-{number}" for number, _ in enumerate(campaign.disturbances, 1)]
        features = [*_groups(campaign), *(draw.name for draw in campaign.draws), *disturbed]
        found += [Dimension(f"{name}{ON}", _UNIT) for name in features]
    for draw in campaign.draws:
        found.append(Dimension(f"{draw.name}.count", draw.count))
        most = round(draw.count.high) if not draw.count.choices else max(int(str(one)) for one in draw.count.choices)
        for number in range(1, most + 1):
            name = f"{draw.name}-{number}"
            if draw.seen is None:
                found += [Dimension(f"{name}.x", _UNIT), Dimension(f"{name}.y", _UNIT)]
            else:
                found += [Dimension(f"{name}.{key}", span) for key, span in zip(_SEEN, draw.seen, strict=True)]
            found.append(Dimension(f"{name}.heading_deg", draw.heading_deg))
            found += [Dimension(f"{name}.{key}", span) for key, span in draw.measures.items()]
    for number, one in enumerate(campaign.disturbances, 1):
        name = f"disturb-{number}"
        if one.share < 1:
            found.append(Dimension(f"{name}.happens", _UNIT))
        found.append(Dimension(f"{name}.at_s", one.at_s))
        if one.for_s is not None:
            found.append(Dimension(f"{name}.for_s", one.for_s))
        found += [Dimension(f"{name}.{key}", span) for key, span in one.values.items()]
    return [one for one in found if one.span.count != 1]


def _things(draw: Drawn, world: World, start: Pose, value: Value) -> list[DrawnThing]:
    count = cast("int", value(f"{draw.name}.count", draw.count))
    found = []
    for number in range(1, count + 1):
        name = f"{draw.name}-{number}"
        heading_deg = cast("float", value(f"{name}.heading_deg", draw.heading_deg))
        if draw.seen is None:
            x0, y0, x1, y1 = draw.area_m or world.extent
            x, y = (cast("float", value(f"{name}.{key}", _UNIT)) for key in ("x", "y"))
            x_m, y_m = x0 + x * (x1 - x0), y0 + y * (y1 - y0)
        else:
            ahead_m, aside_m = (
                cast("float", value(f"{name}.{key}", span)) for key, span in zip(_SEEN, draw.seen, strict=True)
            )
            cosine, sine = math.cos(start.heading_rad), math.sin(start.heading_rad)
            x_m, y_m = start.x_m + ahead_m * cosine - aside_m * sine, start.y_m + ahead_m * sine + aside_m * cosine
            heading_deg += math.degrees(start.heading_rad) + 180
        place = (round(x_m, 3), round(y_m, 3), round(heading_deg % 360, 1))
        measures = {key: cast("float", value(f"{name}.{key}", span)) for key, span in draw.measures.items()}
        found.append(DrawnThing(name=name, kind=draw.kind, place=place, measures=measures, gap_m=draw.gap_m))
    return found


def _faults(one: Disturbance, number: int, value: Value, chance: Callable[[str], float]) -> list[Table]:
    name = f"disturb-{number}"
    if one.share < 1 and chance(f"{name}.happens") >= one.share:
        return []
    return [one.table(lambda key, span: value(f"{name}.{key}", span))]
