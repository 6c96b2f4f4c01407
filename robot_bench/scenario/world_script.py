"""Timed changes of the world: the `[[obstacle]]` tables of a scenario, and what carries them out.

    [[obstacle]]                       [[obstacle]]
    at_s = 10.0                        at_s = 4.0
    op = "place"                       name = "post"
    name = "crate"                     shape = "cylinder"
    shape = "box"                      radius_m = 0.02
    x_m = 1.0                          height_m = 0.5
    y_m = 0.5                          before_sonar = 3
    length_m = 0.4                     distance_m = 0.45
    width_m = 0.3                      hold_s = 1.0
    height_m = 0.5

Positions are those of the world, or relative to the robot ("before sonar 3, at
0.45 m"): these are worked out at their moment. With `hold_s` a thing is placed before
the sonar anew every 50 ms, so that it stays there while the robot moves, and is taken
away at the end. With `path_m` it walks along these points from its placing on; with
`mass_kg` the robot can push it.

Invariant: a change at t is seen by everything that happens after t, and by
nothing that happened up to t.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Annotated, Literal

from p2os.errors import ScenarioError
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.world.file import in_range
from p2os.pioneer.world.model import Obstacle, Repeat, Walk, World
from p2os.robots.parameters import RobotParameters
from p2os.toml_record import Record, read
from p2os.toml_schema import LONGEST_S, Key, Table, Where, placed, within
from robot_bench.scenario.timeline import Timeline
from simbase.errors import nearest, shown
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, nanos

#: chosen: the robot moves 10 mm at most in between.
FOLLOW_NS: Nanos = 50 * NS_PER_MS


class Op(Enum):
    """What is done to a thing."""

    PLACE = "place"
    MOVE = "move"
    REMOVE = "remove"


@dataclass(frozen=True, slots=True, kw_only=True)
class BeforeSonar:
    """A place in front of a sonar, counted from 1 at the left."""

    number: int
    distance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptedChange:
    """One change of the world at a given time."""

    at: Nanos
    op: Op
    name: str
    #: What to place, and only then; its position is that of the change.
    obstacle: Obstacle | None = None
    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    before: BeforeSonar | None = None
    #: File and line of its table, for messages.
    where: str = field(default="", compare=False)


#: Called with each change: (operation, name, ns, fields of its line in the trace).
ChangeListener = Callable[[str, str, Nanos, Mapping[str, object]], None]


#: chosen: an hour is 72 000 placings.
LONGEST_HOLD_S = 3600
_SIZES = {"box": ("length_m", "width_m", "height_m"), "cylinder": ("radius_m", "height_m")}


class ThingTable(Record):
    """A thing that is placed, moved or removed."""

    name: Annotated[str, Key(doc="of the thing")]
    shape: Annotated[Literal["box", "cylinder"], Key(doc="of what is placed")] = "box"
    x_m: Annotated[float | None, in_range("x_m", doc="its place in the world")] = None
    y_m: Annotated[float | None, in_range("y_m", doc="its place in the world")] = None
    heading_deg: Annotated[float, in_range("heading_deg", doc="counter-clockwise")] = 0.0
    length_m: Annotated[float | None, in_range("length_m", doc="of a box")] = None
    width_m: Annotated[float | None, in_range("width_m", doc="of a box")] = None
    height_m: Annotated[float | None, in_range("height_m", doc="of what is placed")] = None
    radius_m: Annotated[float | None, in_range("radius_m", doc="of a cylinder")] = None
    before_sonar: Annotated[int | None, Key(least=1, most=256, doc="in place of a place in the world, from 1")] = None
    distance_m: Annotated[float | None, Key(above=0, most=100, doc="how far before that sonar")] = None
    hold_s: Annotated[float | None, Key(
        above=0, most=LONGEST_HOLD_S, doc="it stays before that sonar for so long, and is taken away"
    )] = None  # fmt: skip
    mass_kg: Annotated[float, in_range("mass_kg", doc="of what the robot can push; 0 stands fast")] = 0.0
    friction: Annotated[float, in_range("friction", doc="of what the robot can push")] = 0.5
    path_m: Annotated[tuple[tuple[float, float], ...] | None, in_range(
        "path_m", doc="`[[x, y], …]` along which it walks from its placing on, whatever `x_m` and `y_m` are"
    )] = None  # fmt: skip
    speed_mps: Annotated[float, in_range("speed_mps", doc="of what walks")] = 0.5
    repeat: Annotated[Repeat, Key(doc="what follows the last point of a path")] = Repeat.BACK_AND_FORTH


class ObstacleTable(ThingTable):
    """`[[obstacle]]`: what is done to a thing at a time."""

    at_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="when")]
    op: Annotated[Op, Key(doc="what is done")] = Op.PLACE


def load_changes(
    tables: Sequence[Table], parameters: RobotParameters, where: Where, *, are_later: bool = False
) -> tuple[ScriptedChange, ...]:
    """Return the changes that a scenario's `[[obstacle]]` tables ask for, in order of time.

    With `are_later` the tables are not all: things may have been placed before.

    Raises:
        ScenarioError: A table breaks the schema, or asks for what cannot be.
    """
    changes: list[ScriptedChange] = []
    for number, table in enumerate(tables):
        place = within(where, "obstacle", number)
        row = read(ObstacleTable, table, place)
        changes += changes_of(row, row.op, nanos(row.at_s), parameters, str(place))
    changes.sort(key=lambda change: change.at)
    if not are_later:
        _check_names(changes)
    return tuple(changes)


def placed_things(changes: Sequence[ScriptedChange]) -> list[Obstacle]:
    """Return the things that are placed in the world, where each begins; not those placed before the robot's sonar."""
    return [
        replace(change.obstacle, x_m=change.x_m, y_m=change.y_m, heading_rad=change.heading_rad)
        for change in changes
        if change.obstacle is not None and change.before is None
    ]


class WorldScript(Timeline[ScriptedChange]):
    """Applies changes at their times.

    Args:
        changes: In any order.
        body: Where they are applied.
        parameters: Where the sonar sit.
        bring_to: Brings the body to an instant.
        on_change: Called with each change.
    """

    #: The body is saved by the robot that owns it.
    DERIVED = ("_body",)

    def __init__(
        self,
        changes: Sequence[ScriptedChange],
        body: RobotBody,
        parameters: RobotParameters,
        *,
        bring_to: Callable[[Nanos], None],
        on_change: ChangeListener | None = None,
    ) -> None:
        super().__init__(changes, self._apply)
        self._body = body
        self._parameters = parameters
        self._bring_to = bring_to
        self._on_change = on_change

    def _apply(self, change: ScriptedChange) -> None:
        self._bring_to(change.at)
        x_m, y_m, heading_rad = change.x_m, change.y_m, change.heading_rad
        if change.before is not None:
            x_m, y_m, heading_rad = self._place_before(change.before)
        fields: dict[str, object] = {}
        if change.op is Op.REMOVE:
            self._body.remove(change.name)
        elif change.op is Op.MOVE:
            self._body.move(change.name, x_m, y_m, heading_rad)
            fields = {"x": _rounded(x_m), "y": _rounded(y_m), "heading": _rounded(heading_rad)}
        elif change.obstacle is not None:
            obstacle = replace(change.obstacle, x_m=x_m, y_m=y_m, heading_rad=heading_rad)
            self._body.place(obstacle)
            fields = {key: _rounded(value) for key, value in obstacle.to_plain().items() if key != "name"}
        if change.before is not None and change.op is Op.PLACE:
            fields["sonar"] = change.before.number
        if self._on_change is not None:
            self._on_change(change.op.value, change.name, change.at, fields)

    def _place_before(self, before: BeforeSonar) -> tuple[float, float, float]:
        state = self._body.state
        sonar = self._parameters.sonar[before.number - 1]
        direction = state.heading_rad + math.radians(sonar.heading_deg)
        cosine, sine = math.cos(state.heading_rad), math.sin(state.heading_rad)
        x_m = state.x_m + (cosine * sonar.x_mm - sine * sonar.y_mm) / 1000 + before.distance_m * math.cos(direction)
        y_m = state.y_m + (sine * sonar.x_mm + cosine * sonar.y_mm) / 1000 + before.distance_m * math.sin(direction)
        return x_m, y_m, direction


def changes_of(row: ThingTable, op: Op, at: Nanos, parameters: RobotParameters, where: str) -> list[ScriptedChange]:
    """Return what a thing's table asks for at a time, in order of time.

    Raises:
        ScenarioError: It cannot be.
    """
    name, before = row.name, _before(row, parameters, where)
    if op is Op.REMOVE:
        return [ScriptedChange(at=at, op=op, name=name, where=where)]
    if before is None and row.path_m is None:
        _need(row, ("x_m", "y_m"), where)
    if row.path_m is not None and (row.before_sonar is not None or op is not Op.PLACE):
        raise ScenarioError(f"{where}: path_m is for a thing that is placed in the world")
    first = ScriptedChange(
        at=at, op=op, name=name, x_m=row.x_m or 0.0, y_m=row.y_m or 0.0, heading_rad=math.radians(row.heading_deg),
        obstacle=_obstacle(row, where) if op is Op.PLACE else None, before=before, where=where,
    )  # fmt: skip
    if row.hold_s is None:
        return [first]
    if before is None or op is not Op.PLACE:
        raise ScenarioError(f"{where}: hold_s without before_sonar", hint="only a thing placed before a sonar is held")
    end = at + nanos(row.hold_s)
    moves = [
        ScriptedChange(at=moment, op=Op.MOVE, name=name, before=before, where=where)
        for moment in range(at + FOLLOW_NS, end, FOLLOW_NS)
    ]
    return [first, *moves, ScriptedChange(at=end, op=Op.REMOVE, name=name, where=where)]


def _before(row: ThingTable, parameters: RobotParameters, where: str) -> BeforeSonar | None:
    number = row.before_sonar
    if number is None:
        return None
    if number > parameters.sonar_fitted:
        raise ScenarioError(f"{where}: before_sonar = {number}, the robot has {parameters.sonar_fitted}")
    _need(row, ("distance_m",), where)
    return BeforeSonar(number=number, distance_m=row.distance_m or 0.0)


def _obstacle(row: ThingTable, where: str) -> Obstacle:
    sizes = _SIZES[row.shape]
    _need(row, sizes, where)
    has = (key for key in ("length_m", "width_m", "radius_m") if getattr(row, key) is not None)
    strange = next((key for key in has if key not in sizes), None)
    if strange is not None:
        raise ScenarioError(f"{where}: a {row.shape} has no {strange}", hint=f"it has {', '.join(sizes)}")
    points_m = tuple((float(x), float(y)) for x, y in row.path_m or ())
    with placed(where):
        walk = None if row.path_m is None else Walk(points_m=points_m, speed_mps=row.speed_mps, repeat=row.repeat)
        return Obstacle(
            name=row.name, x_m=0.0, y_m=0.0, length_m=row.length_m or 0.0, width_m=row.width_m or 0.0,
            radius_m=row.radius_m or 0.0, height_m=row.height_m or 0.0, mass_kg=row.mass_kg, friction=row.friction,
            walk=walk,
        )  # fmt: skip


def refuse_names(changes: Sequence[ScriptedChange], world: World) -> None:
    """Refuse to place what the world has, and to move or take out what it has not or what is fixed.

    Raises:
        ScenarioError: So it is; the message names file, line and thing.
    """
    there = {item.name: item.fixed for item in world.obstacles} | {mesh.name: True for mesh in world.meshes}
    for change in changes:
        what = f"{change.where}: {shown(change.name)} at {_at(change)}"
        if change.op is Op.PLACE and change.name in there:
            raise ScenarioError(f"{what}: world {shown(world.name)} has a thing of that name", hint="choose another")
        if change.op is not Op.PLACE and change.name not in there:
            raise ScenarioError(
                f"{what}: there is none of that name to {change.op.value} then", hint=nearest(change.name, list(there))
            )
        if change.op is not Op.PLACE and there[change.name]:
            raise ScenarioError(
                f"{what}: it is part of the building", hint="only what is not `fixed` and no mesh can change"
            )
        if change.op is Op.REMOVE:
            del there[change.name]
        else:
            there[change.name] = False


def _check_names(changes: list[ScriptedChange]) -> None:
    """Refuse a thing that is placed twice, or moved while it is not there."""
    there: set[str] = set()
    for change in changes:
        if change.op is Op.PLACE and change.name in there:
            raise ScenarioError(f"{change.where}: {shown(change.name)} is placed at {_at(change)} while it is there")
        if change.op is Op.PLACE:
            there.add(change.name)
        elif change.op is Op.REMOVE:
            there.discard(change.name)


def _need(row: ThingTable, keys: tuple[str, ...], where: str) -> None:
    for key in keys:
        if getattr(row, key) is None:
            raise ScenarioError(f"{where}: key {key!r} is missing", hint=f"it needs {', '.join(keys)}")


def _at(change: ScriptedChange) -> str:
    return f"{change.at / NS_PER_S:g} s"


def _rounded(value: object) -> object:
    """Return a length or an angle to a micrometre or microradian, anything else as it is."""
    return round(value, 6) if isinstance(value, float) else value
