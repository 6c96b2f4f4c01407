"""The things of a trial that can be left out, and its numbers: obstacles, events, faults, robots.

Those of the scenario stand in its lists of tables, those of the world in the lists of the world's file. A world that
ships is put among the trial's files first, so that it can be changed.

Invariant: a trial with all its things is the trial.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import cast

from p2os.pioneer.world import known_worlds, load_world
from p2os.pioneer.world.writer import write_world
from p2os.toml_file import toml_text
from robot_bench.campaign.trial import Trial

#: The name of the world's file in a trial whose world shipped.
WORLD_NAME = "world.toml"
#: Lists of a scenario whose tables can be left out. Goals are not: they say what a failure is.
OF_SCENARIO = ("obstacle", "when", "fault", "hand", "part", "robot")
#: Lists of a world's file; marks touch nothing and go with the rest.
OF_WORLD = ("wall", "box", "cylinder", "floor", "ramp", "mesh", "mark", "import")
#: Tables of a scenario whose numbers are made round, beside those of its lists.
_NUMBERED = ("start",)
#: Keys whose numbers come by the thousand.
_COUNTS = frozenset({"vertices_m", "triangles"})

#: The way to a value in nested tables and lists.
Path = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class ListedThing:
    """A table of a list."""

    #: Whether it stands in the world's file.
    is_of_world: bool
    list_name: str
    number: int


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a trial, by its place."""

    is_of_world: bool
    path: Path
    value: float

    @property
    def is_angle(self) -> bool:
        """Whether it is in degrees."""
        return any(str(part).endswith("_deg") for part in self.path)


def with_world(trial: Trial) -> Trial:
    """Return the trial with its world as a plain TOML file of its own; as it is where that stands there already."""
    name = str(trial.table["world"])
    if name in trial.files:
        return trial
    if name not in known_worlds():
        return trial
    text = files("p2os.pioneer.world.worlds").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    if {"import", "arena"} & tomllib.loads(text).keys():  # made of others, or by a program: written out
        text = write_world(load_world(name, seed=trial.seed))
    return replace(trial, table={**trial.table, "world": WORLD_NAME}, files={**trial.files, WORLD_NAME: text.encode()})


def world_table(trial: Trial) -> dict[str, object] | None:
    """Return the tables of the world's file; None where it is not a TOML file of the trial's."""
    name = str(trial.table["world"])
    if not name.endswith(".toml") or name not in trial.files:
        return None
    return tomllib.loads(trial.files[name].decode())


def with_world_table(trial: Trial, table: Mapping[str, object]) -> Trial:
    """Return the trial with other tables in the world's file."""
    return replace(trial, files={**trial.files, str(trial.table["world"]): toml_text(table).encode()})


def things(trial: Trial) -> list[ListedThing]:
    """Return all things of a trial: first what happens, then what stands there."""
    found = [ListedThing(False, name, number) for name in OF_SCENARIO for number in _numbers(trial.table.get(name))]
    world = world_table(trial)
    if world is not None:
        found += [ListedThing(True, name, number) for name in OF_WORLD for number in _numbers(world.get(name))]
    return found


def with_things(trial: Trial, kept: Sequence[ListedThing]) -> Trial:
    """Return the trial with these of its things and no others."""
    lists = {name: _kept(trial.table[name], kept, name, False) for name in OF_SCENARIO if name in trial.table}
    found = trial.with_lists(**lists) if lists else trial
    world = world_table(trial)
    if world is None:
        return found
    table = {key: value for key, value in world.items() if key not in OF_WORLD}
    for name in OF_WORLD:
        if name in world and (left := _kept(world[name], kept, name, True)):
            table[name] = left
    return with_world_table(found, table)


def numbers(trial: Trial) -> list[Number]:
    """Return the numbers of a trial's things and of its start; those of its goals say what a failure is."""
    tables = {name: trial.table[name] for name in (*_NUMBERED, *OF_SCENARIO) if name in trial.table}
    found = [Number(False, path, value) for path, value in _leaves(tables, ())]
    world = world_table(trial) or {}
    lists = {name: world[name] for name in ("start", *OF_WORLD) if name in world}
    return found + [Number(True, path, value) for path, value in _leaves(lists, ())]


def with_numbers(trial: Trial, values: Mapping[Number, float]) -> Trial:
    """Return the trial with other numbers in some places."""
    table = deepcopy(dict(trial.table))
    world = world_table(trial)
    for number, value in values.items():
        _put(table if not number.is_of_world else cast("dict[str, object]", world), number.path, value)
    found = replace(trial, table=table)
    return found if world is None else with_world_table(found, world)


def _numbers(value: object) -> range:
    is_list = isinstance(value, list) and all(isinstance(item, dict) for item in value)
    return range(len(cast("list[object]", value))) if is_list else range(0)


def _kept(value: object, kept: Sequence[ListedThing], name: str, is_of_world: bool) -> list[Mapping[str, object]]:
    numbers_kept = {one.number for one in kept if one.is_of_world is is_of_world and one.list_name == name}
    tables = cast("list[Mapping[str, object]]", value)
    return [table for number, table in enumerate(tables) if number in numbers_kept]


def _leaves(value: object, path: Path) -> Iterator[tuple[Path, float]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if key not in _COUNTS:
                yield from _leaves(inner, (*path, key))
    elif isinstance(value, list):
        for at, inner in enumerate(value):
            yield from _leaves(inner, (*path, at))
    elif isinstance(value, float):  # a whole number is round, or counts something
        yield path, value


def _put(table: dict[str, object], path: Path, value: float) -> None:
    held: object = table
    for part in path[:-1]:
        held = cast("dict[str | int, object]", held)[part]
    cast("dict[str | int, object]", held)[path[-1]] = value
