"""The kinds of goals: a row each, with the keys of its table, its sentence, and what watches a run for it.

A kind that is not here is looked for among the entry points of the group `robot_bench.goals`, whose values
are `GoalKind`s. So are those that know a program which ships: they stand in `robot_bench.scenarios`.
"""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint
from typing import cast

from p2os.errors import ScenarioError
from p2os.toml_schema import LONGEST_S, Key, Table
from robot_bench.scenario.goals.motion import (
    Cells,
    Energy,
    LeastClearance,
    MinDistance,
    MovesOn,
    NoCollision,
    Reach,
    Smooth,
    Stay,
    StopWithin,
)
from robot_bench.scenario.goals.signals import MotorSequence, PinHolds, WaveWithin, shown_pairs
from robot_bench.scenario.goals.steering import BacksOnPath, NoIdleTurn, SteersAway, TurnsAway
from robot_bench.scenario.goals.temporal import (
    SIGNALS,
    Happens,
    InOrderOfEvents,
    Latency,
    OverTime,
    around,
    bounds,
)
from robot_bench.scenario.goals.text import InOrder
from robot_bench.scenario.goals.watch import GoalKind, Watch, number, texts_of
from simbase.entry_points import installed_points
from simbase.errors import shown

_POSE_SIGNALS = tuple(SIGNALS)
_TEXT = Key(name="text", kind="text", required=True)
_PIN = Key(name="pin", kind="text", required=True)
_EVENT = Key(name="event", kind="text", required=True)
_AFTER = Key(name="after", kind="text")
_FROM = Key(name="from_s", kind="number", least=0, most=LONGEST_S)
_TO = Key(name="to_s", kind="number", above=0, most=LONGEST_S)
_WITHIN = Key(name="within_s", kind="number", above=0, most=LONGEST_S)
_LEAST = Key(name="least", kind="number", least=-1e6, most=1e6)
_MOST = Key(name="most", kind="number", least=-1e6, most=1e6)
_COUNT = (
    Key(name="least", kind="whole", least=0, most=1_000_000),
    Key(name="most", kind="whole", least=0, most=1_000_000),
)
_REGION = (
    Key(name="x_m", kind="number", least=-10_000, most=10_000),
    Key(name="y_m", kind="number", least=-10_000, most=10_000),
    Key(name="radius_m", kind="number", above=0, most=10_000),
    Key(name="area_m", kind="list"),
)
_ONE_REGION = ("area_m", "radius_m")
_SIGNAL = Key(name="signal", kind="text", required=True, choices=_POSE_SIGNALS)
_THING = Key(name="thing", kind="text")


def _wanted_distance(table: Table) -> str:
    parts = []
    if "distance_m" in table:
        parts.append(f"{number(table, 'distance_m'):g} m")
    if "distance_m_a_minute" in table:
        parts.append(f"{number(table, 'distance_m_a_minute'):g} m a minute")
    return f"drives at least {' and '.join(parts)}"


def _wanted_energy(table: Table) -> str:
    bounds = {"most_j": "J", "most_j_a_metre": "J a metre"}
    wanted = [f"{number(table, key):g} {unit}" for key, unit in bounds.items() if key in table]
    return f"takes at most {' and '.join(wanted)}"


def _place(table: Table) -> str:
    if "area_m" in table:
        low_x, low_y, high_x, high_y = cast("list[float]", table["area_m"])
        return f"x {low_x:g} to {high_x:g} m, y {low_y:g} to {high_y:g} m"
    x_m, y_m, radius_m = (number(table, key) for key in ("x_m", "y_m", "radius_m"))
    return f"the {radius_m:g} m around x {x_m:g} m, y {y_m:g} m"


def _when(table: Table) -> str:
    """Return the window of a goal as the end of its sentence."""
    parts = []
    if "after" in table:
        parts.append(f" after {table['after']!r}")
    times = [word for word in ("from", "to", "within") if f"{word}_s" in table]
    parts += [f" {word} {number(table, f'{word}_s'):g} s" for word in times]
    return "".join(parts)


def _bounds(table: Table) -> str:
    least = f" at least {number(table, 'least'):g}" if "least" in table else ""
    most = f" at most {number(table, 'most'):g}" if "most" in table else ""
    to = f" from {table['thing']}" if "thing" in table else ""
    return f"{table['signal']}{to}{least}{' and' if least and most else ''}{most}"


def _count(table: Table) -> str:
    least, most = (f"{table[key]} time(s)" if key in table else "" for key in ("least", "most"))
    return (f" at least {least}" if least else "") + (f" at most {most}" if most else "")


def _over_time(table: Table, *, is_always: bool) -> Watch:
    return OverTime(table, str(table["signal"]), bounds(table), is_always=is_always)


_HOLD_HEADING = (
    Key(name="heading_deg", kind="number", required=True, least=-36_000, most=36_000),
    Key(name="tolerance_deg", kind="number", required=True, above=0, most=180),
)
_HOLD_SPEED = (
    Key(name="speed_mps", kind="number", required=True, least=-100, most=100),
    Key(name="tolerance_mps", kind="number", required=True, above=0, most=100),
)

_FREE = Key(name="free_m", kind="number", required=True, above=0, most=100)
_ONE_SIDE = (
    Key(name="near_m", kind="number", required=True, above=0, most=100),
    _FREE,
    Key(name="left", kind="list"),
    Key(name="right", kind="list"),
)
_APART = Key(name="apart_m", kind="number", least=0, most=100)
_NOT_LONGER = Key(name="within_s", kind="number", required=True, above=0, most=LONGEST_S)

KINDS: Mapping[str, GoalKind] = {
    "no_collision": GoalKind(
        keys=(), wanted=lambda _: "touches nothing", watch=lambda _: NoCollision(), needs_world=True
    ),
    "min_distance": GoalKind(
        keys=(
            Key(name="distance_m", kind="number", above=0, most=1e6),
            Key(name="distance_m_a_minute", kind="number", above=0, most=1e6),
        ),
        wanted=_wanted_distance, watch=MinDistance, any_of=("distance_m", "distance_m_a_minute"),
    ),
    "cells": GoalKind(
        keys=(Key(name="least", kind="whole", required=True, least=1, most=1_000_000),),
        wanted=lambda table: f"enters at least {table['least']} different cells of 0.5 m", watch=Cells,
    ),
    "motor_sequence": GoalKind(
        keys=(
            Key(name="values", kind="list", required=True),
            Key(name="held_s", kind="number", least=0, most=LONGEST_S),
        ),
        wanted=lambda table: f"sets the motors to {shown_pairs(table['values'])}", watch=MotorSequence,
        is_scripted=True,
    ),
    "usart_contains": GoalKind(
        keys=(_TEXT,), wanted=lambda table: f"prints {table['text']!r}",
        watch=lambda table: InOrder([str(table["text"])], "was not printed"),
    ),
    "usart_lacks": GoalKind(
        keys=(_TEXT,), wanted=lambda table: f"never prints {table['text']!r}",
        watch=lambda table: Happens({**table, "event": f"usart1 sends {table['text']}"}, least=0, most=0),
    ),
    "usart_in_order": GoalKind(
        keys=(Key(name="texts", kind="list", required=True),),
        wanted=lambda table: f"prints in order {', '.join(map(repr, texts_of(table, 'texts')))}",
        watch=lambda table: InOrder(texts_of(table, "texts"), "was not printed in its turn"), is_scripted=True,
    ),
    "reach": GoalKind(
        keys=(*_REGION, _WITHIN), wanted=lambda table: f"reaches {_place(table)}{_when(table)}", watch=Reach,
        any_of=_ONE_REGION, is_scripted=True,
    ),
    "avoid": GoalKind(
        keys=_REGION, wanted=lambda table: f"stays out of {_place(table)}",
        watch=lambda table: Stay(table, is_inside=False), any_of=_ONE_REGION,
    ),
    "stay_within": GoalKind(
        keys=_REGION, wanted=lambda table: f"stays within {_place(table)}",
        watch=lambda table: Stay(table, is_inside=True), any_of=_ONE_REGION,
    ),
    "clearance": GoalKind(
        keys=(Key(name="least_m", kind="number", required=True, above=0, most=100),),
        wanted=lambda table: f"keeps {number(table, 'least_m'):g} m away from everything",
        watch=LeastClearance, needs_world=True,
    ),
    "stop_within": GoalKind(
        keys=(
            Key(name="after", kind="text", required=True),
            Key(name="within_s", kind="number", required=True, above=0, most=LONGEST_S),
            Key(name="way_m", kind="number", above=0, most=1e6),
        ),
        wanted=lambda table: f"stands still{_when(table)}"
        + (f" and {number(table, 'way_m'):g} m" if "way_m" in table else ""),
        watch=StopWithin,
    ),
    "moves_on": GoalKind(
        keys=(
            Key(name="way_m", kind="number", required=True, above=0, most=1e6),
            Key(name="within_s", kind="number", required=True, above=0, most=LONGEST_S),
            _FROM,
        ),
        wanted=lambda table: f"gets {number(table, 'way_m'):g} m away from each place{_when(table)}", watch=MovesOn,
    ),
    "turns_away": GoalKind(
        keys=(*_ONE_SIDE, Key(name="row", kind="whole", least=0, most=1000), _APART),
        wanted=lambda table: "turns on the spot away from what stands on one side, but for "
        f"{table.get('row', 0)} in a row",
        watch=TurnsAway,
    ),
    "steers_away": GoalKind(
        keys=(*_ONE_SIDE, _NOT_LONGER),
        wanted=lambda table: "bends towards what stands on one side for no longer than "
        f"{number(table, 'within_s'):g} s",
        watch=SteersAway,
    ),
    "no_idle_turn": GoalKind(
        keys=(_FREE, _NOT_LONGER),
        wanted=lambda table: f"turns on the spot for no longer than {number(table, 'within_s'):g} s where "
        f"{number(table, 'free_m'):g} m are free",
        watch=NoIdleTurn,
    ),
    "backs_on_path": GoalKind(
        keys=(Key(name="off_m", kind="number", required=True, above=0, most=100),),
        wanted=lambda table: f"goes back only within {number(table, 'off_m'):g} m of the way that it came",
        watch=BacksOnPath,
    ),
    "smooth": GoalKind(
        keys=(Key(name="most_mps2", kind="number", required=True, above=0, most=1000),),
        wanted=lambda table: f"accelerates no rim by more than {number(table, 'most_mps2'):g} m/s²", watch=Smooth,
    ),
    "energy": GoalKind(
        keys=(
            Key(name="most_j", kind="number", above=0, most=1e9),
            Key(name="most_j_a_metre", kind="number", above=0, most=1e9),
        ),
        wanted=_wanted_energy, watch=Energy, any_of=("most_j", "most_j_a_metre"), needs_world=True,
    ),
    "hold_heading": GoalKind(
        keys=(*_HOLD_HEADING, _AFTER, _FROM, _TO),
        wanted=lambda table: f"holds heading {number(table, 'heading_deg'):g}° to "
        f"{number(table, 'tolerance_deg'):g}°{_when(table)}",
        watch=lambda table: OverTime(
            table, "heading_deg",
            around(number(table, "heading_deg"), number(table, "tolerance_deg"), is_angle=True), is_always=True,
        ),
        is_scripted=True,
    ),
    "hold_speed": GoalKind(
        keys=(*_HOLD_SPEED, _AFTER, _FROM, _TO),
        wanted=lambda table: f"holds {number(table, 'speed_mps'):g} m/s to "
        f"{number(table, 'tolerance_mps'):g} m/s{_when(table)}",
        watch=lambda table: OverTime(
            table, "speed_mps", around(number(table, "speed_mps"), number(table, "tolerance_mps")), is_always=True
        ),
        is_scripted=True,
    ),
    "always": GoalKind(
        keys=(_SIGNAL, _THING, _LEAST, _MOST, _AFTER, _FROM, _TO),
        wanted=lambda table: f"has always {_bounds(table)}{_when(table)}",
        watch=lambda table: _over_time(table, is_always=True), any_of=("least", "most"),
    ),
    "eventually": GoalKind(
        keys=(_SIGNAL, _THING, _LEAST, _MOST, _AFTER, _FROM, _TO),
        wanted=lambda table: f"has at some time {_bounds(table)}{_when(table)}",
        watch=lambda table: _over_time(table, is_always=False), any_of=("least", "most"),
    ),
    "happens": GoalKind(
        keys=(_EVENT, *_COUNT, _FROM, _WITHIN),
        wanted=lambda table: f"{table['event']!r} happens{_count(table)}{_when(table)}", watch=Happens,
    ),
    "never": GoalKind(
        keys=(_EVENT, _FROM), wanted=lambda table: f"{table['event']!r} never happens{_when(table)}",
        watch=lambda table: Happens(table, least=0, most=0),
    ),
    "in_order": GoalKind(
        keys=(Key(name="events", kind="list", required=True),),
        wanted=lambda table: f"in order {', '.join(map(repr, cast('list[str]', table['events'])))}",
        watch=InOrderOfEvents, is_scripted=True,
    ),
    "latency": GoalKind(
        keys=(
            Key(name="from", kind="text", required=True),
            Key(name="to", kind="text", required=True),
            Key(name="most_s", kind="number", required=True, above=0, most=LONGEST_S),
            Key(name="least_s", kind="number", least=0, most=LONGEST_S),
        ),
        wanted=lambda table: f"{table['to']!r} follows {table['from']!r} within {number(table, 'most_s'):g} s",
        watch=Latency,
    ),
    "pin_holds": GoalKind(
        keys=(_PIN, Key(name="level", kind="text", required=True, choices=("high", "low")), _FROM, _TO),
        wanted=lambda table: f"holds {table['pin']} {table['level']}{_when(table)}", watch=PinHolds,
    ),
    "wave": GoalKind(
        keys=(
            _PIN, _FROM, _TO,
            *(Key(name=name, kind="number", above=0, most=1e8) for name in ("least_hz", "most_hz")),
            *(Key(name=name, kind="number", least=0, most=1) for name in ("least_duty", "most_duty")),
            Key(name="periods", kind="whole", least=1, most=1_000_000_000),
        ),
        wanted=lambda table: f"has a wave in bounds on {table['pin']}{_when(table)}", watch=WaveWithin,
    ),
}  # fmt: skip


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
