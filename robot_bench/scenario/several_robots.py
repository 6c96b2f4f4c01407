"""The `[[robot]]` tables of a scenario: robots of several kinds in one world, each with a program of its own.

    world = "arena"                    what all share stands at the top: world, body, seed, duration_s, …
    duration_s = 20.0

    [[robot]]                          [[robot]]                        [[goal]]
    name = "scout"                     name = "post"                    robot = "scout"
    firmware = "mine.elf"              model = "p2dx"                   kind = "min_distance"
    x_m = -1.0                         (no firmware: it stands)         distance_m = 1.0
    y_m = 0.0

A goal without `robot` is one for each that has a program; a fault, a thing before a sonar and a `[[when]]` are the
first one's.

Invariant: a message about a robot names the line of the file where it stands.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from p2os.errors import ScenarioError
from p2os.toml_record import keys_of, tables_of
from p2os.toml_schema import Key, KeyPlaces, Table, TablePlace, check_table, within
from robot_bench.scenario.tables import ROBOT, EachRobotTable, OwnTable, TopTable
from simbase.errors import nearest, shown

#: What a robot has for itself; those that a scenario of one robot has at its top, and where it stands.
OWN = ("firmware", *(key.name for key in keys_of(OwnTable)))
_PLACE = ("x_m", "y_m", "heading_deg")
#: What a scenario with several robots has at its top.
_TOP = (
    *(key for key in keys_of(TopTable) if key.name not in {*OWN, "start", "in_world", "robot"}),
    Key(name="robot", kind="tables", required=True),
)
#: chosen: more than a person can watch; each runs a chip.
MOST_ROBOTS = 16
_NAME = re.compile(r"[A-Za-z_][\w.-]{0,31}", re.ASCII)
#: Lists of a scenario whose tables may name a robot.
OF_ROBOTS = ("goal", "fault", "when", "hand", "obstacle", "part")


@dataclass(frozen=True, slots=True)
class RobotSource:
    """The places of one robot's scenario in the file that holds all."""

    source: KeyPlaces
    #: Which of the `[[robot]]` tables it is.
    number: int
    #: What stands in that.
    own: frozenset[str]
    #: List → the places of this robot's tables among all.
    numbers: Mapping[str, tuple[int, ...]]

    def at(self, table: str = "", key: str = "", number: int = 0) -> str:
        """Return `file:line` of a key."""
        if table in self.numbers:
            return self.source.at(table, key, self.number_of(table, number))
        if table == "" and key == "robot":
            return self.source.at("robot", "model", self.number)
        if table == "" and (key in self.own or not key):
            return self.source.at("robot", key, self.number)
        if table == "start":
            return self.source.at("robot", key, self.number)
        if table in self.own:
            return self.source.at("robot", table, self.number)
        return self.source.at(table, key, number)

    def number_of(self, table: str, number: int) -> int:
        """Return which of all tables of a list one of this robot's is."""
        numbers = self.numbers.get(table, ())
        return numbers[number] if number < len(numbers) else number


@dataclass(frozen=True, slots=True)
class RobotTable:
    """A robot as a scenario of its own."""

    name: str
    #: As of a scenario with this robot alone; without `firmware` where it has no program.
    table: Table
    place: TablePlace

    @property
    def has_firmware(self) -> bool:
        """Whether it has a program; without one it stands in the way."""
        return "firmware" in self.table


def split(table: Table, place: TablePlace) -> list[RobotTable]:
    """Return each robot of a scenario's table as one of its own.

    Args:
        table: What the file says.
        place: The file's.

    Raises:
        ScenarioError: A table breaks the schema, two robots have one name, or a list names one that is not there.
    """
    for name in OWN:
        if name in table:
            raise ScenarioError(
                f"{place.at(name)}: {name} beside [[robot]]", hint="each robot has its own: move it there"
            )
    check_table(table, _TOP, place)
    robots = tables_of(table, "robot")
    if len(robots) > MOST_ROBOTS:
        raise ScenarioError(f"{place.at('robot')}: more than {MOST_ROBOTS} robots")
    names = _names(robots, place)
    programmed = [name for name, robot in zip(names, robots, strict=True) if "firmware" in robot]
    if not programmed:
        raise ScenarioError(f"{within(place, 'robot', 0)}: no robot has a firmware", hint='firmware = "mine.elf"')
    lists = {key: _by_robot(tables_of(table, key), key, programmed, place) for key in OF_ROBOTS}
    shared = {key: value for key, value in table.items() if key not in {"robot", "seeds", "sweep", *OF_ROBOTS}}
    found = []
    for number, (name, robot) in enumerate(zip(names, robots, strict=True)):
        own = {key: value for key, value in robot.items() if key in OWN}
        start = {key: robot[key] for key in _PLACE if key in robot}
        mine = {key: [row for _, row in rows.get(name, [])] for key, rows in lists.items()}
        numbers = {key: tuple(place for place, _ in rows.get(name, [])) for key, rows in lists.items()}
        whole = {**shared, **own, **mine, "robot": robot.get("model", "p2dx"), **({"start": start} if start else {})}
        source = RobotSource(place.source, number, frozenset(robot), numbers)
        found.append(RobotTable(name, {key: value for key, value in whole.items() if value != []}, TablePlace(source)))
    return found


def _names(robots: Sequence[Table], place: TablePlace) -> list[str]:
    names: list[str] = []
    for number, robot in enumerate(robots):
        at = within(place, "robot", number)
        check_table(robot, keys_of(EachRobotTable), at)
        name = str(robot["name"])
        where = at.at("name") if isinstance(at, TablePlace) else at
        if not _NAME.fullmatch(name) or name in names:
            wrong = "two robots are called so" if name in names else "that is no name for a robot"
            raise ScenarioError(f"{where}: name = {shown(name)}: {wrong}", hint="letters, digits, _ - and .")
        names.append(name)
    return names


def _by_robot(
    tables: Sequence[Table], key: str, programmed: Sequence[str], place: TablePlace
) -> dict[str, list[tuple[int, Table]]]:
    """Return the tables of a list by the robot that they are for, each with its number and without `robot`."""
    found: dict[str, list[tuple[int, Table]]] = {}
    for number, table in enumerate(tables):
        at = within(place, key, number)
        check_table({"robot": table["robot"]} if "robot" in table else {}, (ROBOT,), at)
        name = table.get("robot")
        if name is not None and name not in programmed:
            where = at.at("robot") if isinstance(at, TablePlace) else at
            raise ScenarioError(
                f"{where}: robot = {shown(name)}: no robot with a program is called so",
                hint=nearest(str(name), programmed),
            )
        every = programmed if key == "goal" else programmed[:1]
        for robot in every if name is None else [str(name)]:
            found.setdefault(robot, []).append((number, {k: v for k, v in table.items() if k != "robot"}))
    return found
