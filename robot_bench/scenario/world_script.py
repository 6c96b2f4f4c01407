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
from typing import cast

from p2os.errors import ScenarioError, WorldError
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.world.file import in_range
from p2os.pioneer.world.model import Obstacle, Repeat, Walk, World
from p2os.robots.parameters import RobotParameters
from p2os.toml_schema import LONGEST_S, Key, Table, Where, check_table, within
from robot_bench.scenario.timeline import Timeline
from simbase.errors import nearest, shown
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

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
KEYS = (
    Key(name="at_s", kind="number", required=True, least=0, most=LONGEST_S),
    Key(name="op", kind="text", choices=tuple(op.value for op in Op)),
    Key(name="name", kind="text", required=True),
    Key(name="shape", kind="text", choices=("box", "cylinder")),
    in_range("x_m"),
    in_range("y_m"),
    in_range("heading_deg"),
    in_range("length_m"),
    in_range("width_m"),
    in_range("height_m"),
    in_range("radius_m"),
    Key(name="before_sonar", kind="whole", least=1, most=256),
    Key(name="distance_m", kind="number", above=0, most=100),
    Key(name="hold_s", kind="number", above=0, most=LONGEST_HOLD_S),
    in_range("mass_kg"),
    in_range("friction"),
    in_range("path_m"),
    in_range("speed_mps"),
    Key(name="repeat", kind="text", choices=tuple(member.value for member in Repeat)),
)
#: Of a thing that is pushed, and of one that walks; the same as in a world file.
DEFAULT_FRICTION, DEFAULT_SPEED_MPS = 0.5, 0.5
_SIZES = {"box": ("length_m", "width_m", "height_m"), "cylinder": ("radius_m", "height_m")}


def load_changes(
    tables: list[Table], parameters: RobotParameters, where: Where, *, are_later: bool = False
) -> tuple[ScriptedChange, ...]:
    """Return the changes that a scenario's `[[obstacle]]` tables ask for, in order of time.

    With `are_later` the tables are not all: things may have been placed before.

    Raises:
        ScenarioError: A table breaks the schema, or asks for what cannot be.
    """
    changes: list[ScriptedChange] = []
    for number, table in enumerate(tables):
        place = within(where, "obstacle", number)
        check_table(table, KEYS, place)
        changes += _changes(table, parameters, str(place))
    changes.sort(key=lambda change: change.at)
    if not are_later:
        _check_names(changes)
    return tuple(changes)


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


def _changes(table: Table, parameters: RobotParameters, where: str) -> list[ScriptedChange]:
    at = _nanos(table, "at_s")
    op = Op(str(table.get("op", "place")))
    name = str(table["name"])
    before = _before(table, parameters, where)
    if op is Op.REMOVE:
        return [ScriptedChange(at=at, op=op, name=name, where=where)]
    if before is None and "path_m" not in table:
        _need(table, ("x_m", "y_m"), where)
    x_m, y_m = _number(table, "x_m"), _number(table, "y_m")
    heading_rad = math.radians(_number(table, "heading_deg"))
    first = ScriptedChange(
        at=at,
        op=op,
        name=name,
        x_m=x_m,
        y_m=y_m,
        heading_rad=heading_rad,
        obstacle=_obstacle(table, where) if op is Op.PLACE else None,
        before=before,
        where=where,
    )
    if "hold_s" not in table:
        return [first]
    if before is None or op is not Op.PLACE:
        raise ScenarioError(f"{where}: hold_s without before_sonar", hint="only a thing placed before a sonar is held")
    end = at + _nanos(table, "hold_s")
    moves = [
        ScriptedChange(at=moment, op=Op.MOVE, name=name, before=before, where=where)
        for moment in range(at + FOLLOW_NS, end, FOLLOW_NS)
    ]
    return [first, *moves, ScriptedChange(at=end, op=Op.REMOVE, name=name, where=where)]


def _before(table: Table, parameters: RobotParameters, where: str) -> BeforeSonar | None:
    if "before_sonar" not in table:
        return None
    number = cast("int", table["before_sonar"])
    if number > parameters.sonar_fitted:
        raise ScenarioError(f"{where}: before_sonar = {number}, the robot has {parameters.sonar_fitted}")
    _need(table, ("distance_m",), where)
    return BeforeSonar(number=number, distance_m=_number(table, "distance_m"))


def _obstacle(table: Table, where: str) -> Obstacle:
    shape = str(table.get("shape", "box"))
    sizes = _SIZES[shape]
    _need(table, sizes, where)
    strange = next((key for key in ("length_m", "width_m", "radius_m") if key in table and key not in sizes), None)
    if strange is not None:
        raise ScenarioError(f"{where}: a {shape} has no {strange}", hint=f"it has {', '.join(sizes)}")
    try:
        return Obstacle(
            name=str(table["name"]),
            x_m=0.0,
            y_m=0.0,
            length_m=_number(table, "length_m"),
            width_m=_number(table, "width_m"),
            radius_m=_number(table, "radius_m"),
            height_m=_number(table, "height_m"),
            mass_kg=_number(table, "mass_kg"),
            friction=float(cast("float", table.get("friction", DEFAULT_FRICTION))),
            walk=_walk(table, where),
        )
    except WorldError as error:
        raise ScenarioError(f"{where}: {error}") from error


def _walk(table: Table, where: str) -> Walk | None:
    """Return the path that a thing walks from its placing on."""
    if "path_m" not in table:
        return None
    if "before_sonar" in table or str(table.get("op", "place")) != Op.PLACE.value:
        raise ScenarioError(f"{where}: path_m is for a thing that is placed in the world")
    return Walk(
        points_m=tuple((float(x), float(y)) for x, y in cast("list[list[float]]", table["path_m"])),
        speed_mps=float(cast("float", table.get("speed_mps", DEFAULT_SPEED_MPS))),
        repeat=Repeat(str(table.get("repeat", Repeat.BACK_AND_FORTH.value))),
    )


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
    placed: set[str] = set()
    for change in changes:
        if change.op is Op.PLACE and change.name in placed:
            raise ScenarioError(f"{change.where}: {shown(change.name)} is placed at {_at(change)} while it is there")
        if change.op is Op.PLACE:
            placed.add(change.name)
        elif change.op is Op.REMOVE:
            placed.discard(change.name)


def _need(table: Table, keys: tuple[str, ...], where: str) -> None:
    for key in keys:
        if key not in table:
            raise ScenarioError(f"{where}: key {key!r} is missing", hint=f"it needs {', '.join(keys)}")


def _number(table: Table, key: str) -> float:
    return float(cast("float", table.get(key, 0.0)))


def _nanos(table: Table, key: str) -> Nanos:
    return round(_number(table, key) * NS_PER_S)


def _at(change: ScriptedChange) -> str:
    return f"{change.at / NS_PER_S:g} s"


def _rounded(value: object) -> object:
    """Return a length or an angle to a micrometre or microradian, anything else as it is."""
    return round(value, 6) if isinstance(value, float) else value
