"""The kinds of goals: a row each, with the keys of its table, its sentence, and what watches a run for it.

A kind that is not here is looked for among the entry points of the group `robot_bench.goals`, whose values
are `GoalKind`s. So are those that know a program which ships: they stand in `robot_bench.scenarios`.
"""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint

from p2os.errors import ScenarioError
from robot_bench.scenario.goals import answering, motion, signals, steering, temporal, text
from robot_bench.scenario.goals.watch import GoalKind
from simbase.entry_points import installed_points
from simbase.errors import shown

#: Those of the package, from each file its own.
KINDS: Mapping[str, GoalKind] = {
    name: kind for part in (motion, steering, answering, temporal, signals, text) for name, kind in part.KINDS.items()
}


def kind_named(name: str) -> GoalKind | None:
    """Return a kind of goal, one of the package's own or one of an entry point; None where there is none.

    Raises:
        ScenarioError: What the entry point names cannot be had, or is no `GoalKind`.
    """
    found = KINDS.get(name)
    if found is not None or name not in (others := _entry_points()):
        return found
    try:
        loaded = others[name].load()
    except Exception as error:
        raise ScenarioError(f"goal {shown(name)} cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(loaded, GoalKind):
        raise ScenarioError(f"goal {shown(name)}: {others[name].value} is no GoalKind", hint="docs/scenarios.md, goals")
    return loaded


def every_kind() -> Mapping[str, GoalKind]:
    """Return all kinds by their names, those of entry points behind the package's own.

    Raises:
        ScenarioError: As `kind_named`.
    """
    named = ((name, kind_named(name)) for name in (*KINDS, *sorted(_entry_points())))
    return {name: kind for name, kind in named if kind is not None}


def known_kinds() -> list[str]:
    """Return the names of all kinds, also those of entry points."""
    return sorted({*KINDS, *_entry_points()})


@cache
def _entry_points() -> "Mapping[str, EntryPoint]":
    return installed_points("robot_bench.goals")
