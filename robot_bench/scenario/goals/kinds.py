"""The kinds of goals: a row each, with the keys of its table, its sentence, and what watches a run for it.

A kind that is not here is looked for among the entry points of the group `robot_bench.goals`, whose values
are `GoalKind`s. So are those that know a program which ships: they stand in `robot_bench.scenarios`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from typing import Annotated

from p2os.errors import ScenarioError
from p2os.toml_schema import Key
from robot_bench.scenario.goals.motion import (
    Cells,
    CellsTable,
    ClearanceTable,
    Energy,
    EnergyTable,
    LeastClearance,
    MinDistance,
    MinDistanceTable,
    MovesOn,
    MovesOnTable,
    NoCollision,
    Reach,
    ReachTable,
    RegionTable,
    Smooth,
    SmoothTable,
    Stay,
    StopWithin,
    StopWithinTable,
)
from robot_bench.scenario.goals.signals import (
    MotorSequence,
    MotorSequenceTable,
    PinHolds,
    PinHoldsTable,
    WaveTable,
    WaveWithin,
    shown_pairs,
)
from robot_bench.scenario.goals.steering import (
    BacksOnPath,
    BacksOnPathTable,
    NoIdleTurn,
    NoIdleTurnTable,
    SteersAway,
    SteersAwayTable,
    TurnsAway,
    TurnsAwayTable,
)
from robot_bench.scenario.goals.temporal import (
    Happens,
    HappensTable,
    HoldHeadingTable,
    HoldSpeedTable,
    InOrderOfEvents,
    InOrderTable,
    Latency,
    LatencyTable,
    NeverTable,
    OverTime,
    OverTimeTable,
    WindowTable,
    around,
    refuse_other_than_texts,
)
from robot_bench.scenario.goals.text import InOrder
from robot_bench.scenario.goals.watch import GoalKind, NoKeys, OfEvents, Watch
from simbase.entry_points import installed_points
from simbase.errors import shown


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintsTable:
    """A text."""

    text: Annotated[str, Key(doc="what the firmware prints")]


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintsInOrderTable:
    """Texts one after the other."""

    texts: Annotated[tuple[str, ...], Key(kind="list", doc="in this order")]

    def __post_init__(self) -> None:
        refuse_other_than_texts("texts", self.texts)


def _given(*parts: tuple[str, float | None, str]) -> list[str]:
    """Return words, number and unit of those that are given."""
    return [f"{words}{number:g}{unit}" for words, number, unit in parts if number is not None]


def _place(table: RegionTable) -> str:
    if table.area_m is not None:
        low_x, low_y, high_x, high_y = table.area_m
        return f"x {low_x:g} to {high_x:g} m, y {low_y:g} to {high_y:g} m"
    x_m, y_m, radius_m = table.circle
    return f"the {radius_m:g} m around x {x_m:g} m, y {y_m:g} m"


def _when(
    after: str | None = None, *, from_s: float | None = None, to_s: float | None = None, within_s: float | None = None
) -> str:
    """Return the window of a goal as the end of its sentence."""
    times = _given((" from ", from_s, " s"), (" to ", to_s, " s"), (" within ", within_s, " s"))
    return "".join([*([] if after is None else [f" after {after!r}"]), *times])


def _window(table: WindowTable) -> str:
    return _when(table.after, from_s=table.from_s, to_s=table.to_s)


def _bounds(table: OverTimeTable) -> str:
    bounds = " and".join(_given((" at least ", table.least, ""), (" at most ", table.most, "")))
    return f"{table.signal}{'' if table.thing is None else f' from {table.thing}'}{bounds}"


def _over_time(table: OverTimeTable, *, is_always: bool) -> Watch:
    return OverTime(table, table.signal, table.margin, is_always=is_always, thing=table.thing)


def _never(words: str, table: OfEvents, *, from_s: float | None = None) -> Watch:
    return Happens(HappensTable(event=words, least=0, most=0, from_s=from_s, wires=table.wires))


_ONE_REGION = ("area_m", "radius_m")

KINDS: Mapping[str, GoalKind] = {
    "no_collision": GoalKind(
        NoKeys, lambda _: "touches nothing", lambda _: NoCollision(),
        doc="the hull touches nothing; a failure names what was hit, when, where and with which part",
        needs_world=True,
    ),
    "min_distance": GoalKind(
        MinDistanceTable,
        lambda table: "drives at least " + " and ".join(
            _given(("", table.distance_m, " m"), ("", table.distance_m_a_minute, " m a minute"))
        ),
        MinDistance, doc="the path is at least so long", any_of=("distance_m", "distance_m_a_minute"),
    ),
    "cells": GoalKind(
        CellsTable, lambda table: f"enters at least {table.least} different cells of 0.5 m", Cells,
        doc="so many different cells of 0.5 m were entered",
    ),
    "motor_sequence": GoalKind(
        MotorSequenceTable, lambda table: f"sets the motors to {shown_pairs(table.values)}", MotorSequence,
        doc="the motor pins showed exactly these values, each held so long", is_scripted=True,
    ),
    "usart_contains": GoalKind(
        PrintsTable, lambda table: f"prints {table.text!r}",
        lambda table: InOrder([table.text], "was not printed"), doc="the firmware printed it",
    ),
    "usart_lacks": GoalKind(
        PrintsTable, lambda table: f"never prints {table.text!r}",
        lambda table: _never(f"usart1 sends {table.text}", OfEvents()), doc="the firmware never printed it",
    ),
    "usart_in_order": GoalKind(
        PrintsInOrderTable, lambda table: f"prints in order {', '.join(map(repr, table.texts))}",
        lambda table: InOrder(list(table.texts), "was not printed in its turn"),
        doc="the firmware printed these, in this order", is_scripted=True,
    ),
    "reach": GoalKind(
        ReachTable, lambda table: f"reaches {_place(table)}{_when(within_s=table.within_s)}", Reach,
        doc="the robot's centre comes into the region, in time", any_of=_ONE_REGION, is_scripted=True,
    ),
    "avoid": GoalKind(
        RegionTable, lambda table: f"stays out of {_place(table)}", lambda table: Stay(table, is_inside=False),
        doc="its centre stays out of the region", any_of=_ONE_REGION,
    ),
    "stay_within": GoalKind(
        RegionTable, lambda table: f"stays within {_place(table)}", lambda table: Stay(table, is_inside=True),
        doc="its centre stays in the region", any_of=_ONE_REGION,
    ),
    "clearance": GoalKind(
        ClearanceTable, lambda table: f"keeps {table.least_m:g} m away from everything", LeastClearance,
        doc="the hull stays so far from everything", needs_world=True,
    ),
    "stop_within": GoalKind(
        StopWithinTable,
        lambda table: f"stands still{_when(table.after, within_s=table.within_s)}"
        + "".join(_given((" and ", table.way_m, " m"))),
        StopWithin, doc="after each such event the robot stands in time, no further on",
    ),
    "moves_on": GoalKind(
        MovesOnTable,
        lambda table: f"gets {table.way_m:g} m away from each place"
        + _when(from_s=table.from_s, within_s=table.within_s),
        MovesOn, doc="it gets so far away from each place in time: it neither stands nor turns on the spot nor is shut "
        "in; the next place is where it was so far away",
    ),
    "turns_away": GoalKind(
        TurnsAwayTable,
        lambda table: f"turns on the spot away from what stands on one side, but for {table.row} in a row",
        TurnsAway, doc="a turn on the spot that begins with something nearer than `near_m` on one side and the other "
        "free beyond `free_m` goes to the free one",
    ),
    "steers_away": GoalKind(
        SteersAwayTable,
        lambda table: f"bends towards what stands on one side for no longer than {table.within_s:g} s",
        SteersAway, doc="driving forward it does not bend towards the side that is not free, as above, for longer",
    ),
    "no_idle_turn": GoalKind(
        NoIdleTurnTable,
        lambda table: f"turns on the spot for no longer than {table.within_s:g} s where {table.free_m:g} m are free",
        NoIdleTurn, doc="it does not go on turning on the spot for longer than that where every sonar is free",
    ),
    "backs_on_path": GoalKind(
        BacksOnPathTable, lambda table: f"goes back only within {table.off_m:g} m of the way that it came",
        BacksOnPath, doc="going back it stays so near to the way that it has come",
    ),
    "smooth": GoalKind(
        SmoothTable, lambda table: f"accelerates no rim by more than {table.most_mps2:g} m/s²", Smooth,
        doc="no rim changes its speed faster, from pose to pose",
    ),
    "energy": GoalKind(
        EnergyTable,
        lambda table: "takes at most " + " and ".join(
            _given(("", table.most_j, " J"), ("", table.most_j_a_metre, " J a metre"))
        ),
        Energy, doc="the work at the rims, |torque · rate| of both wheels over the run, stays within so many "
        "joules; a failure says where it became more, and where the power was greatest",
        any_of=("most_j", "most_j_a_metre"), needs_world=True,
    ),
    "hold_heading": GoalKind(
        HoldHeadingTable,
        lambda table: f"holds heading {table.heading_deg:g}° to {table.tolerance_deg:g}°{_window(table)}",
        lambda table: OverTime(
            table, "heading_deg", around(table.heading_deg, table.tolerance_deg, is_angle=True), is_always=True
        ),
        doc="its heading stays so, the short way round", is_scripted=True,
    ),
    "hold_speed": GoalKind(
        HoldSpeedTable,
        lambda table: f"holds {table.speed_mps:g} m/s to {table.tolerance_mps:g} m/s{_window(table)}",
        lambda table: OverTime(table, "speed_mps", around(table.speed_mps, table.tolerance_mps), is_always=True),
        doc="its speed stays so", is_scripted=True,
    ),
    "always": GoalKind(
        OverTimeTable, lambda table: f"has always {_bounds(table)}{_window(table)}",
        lambda table: _over_time(table, is_always=True), doc="the signal is in bounds at each sample",
        any_of=("least", "most"),
    ),
    "eventually": GoalKind(
        OverTimeTable, lambda table: f"has at some time {_bounds(table)}{_window(table)}",
        lambda table: _over_time(table, is_always=False), doc="the signal is in bounds at one of them",
        any_of=("least", "most"),
    ),
    "happens": GoalKind(
        HappensTable,
        lambda table: f"{table.event!r} happens"
        + ("" if table.least is None else f" at least {table.least} time(s)")
        + ("" if table.most is None else f" at most {table.most} time(s)")
        + _when(from_s=table.from_s, within_s=table.within_s),
        Happens, doc="the event happens so often in that time: once at least where `least` is not given",
    ),
    "never": GoalKind(
        NeverTable, lambda table: f"{table.event!r} never happens{_when(from_s=table.from_s)}",
        lambda table: _never(table.event, table, from_s=table.from_s), doc="it does not happen",
    ),
    "in_order": GoalKind(
        InOrderTable, lambda table: f"in order {', '.join(map(repr, table.events))}", InOrderOfEvents,
        doc="they happen one after the other", is_scripted=True,
    ),
    "latency": GoalKind(
        LatencyTable, lambda table: f"{table.to!r} follows {table.from_!r} within {table.most_s:g} s", Latency,
        doc="each `from` is followed by a `to` in time",
    ),
    "pin_holds": GoalKind(
        PinHoldsTable,
        lambda table: f"holds {table.pin} {table.level}{_when(from_s=table.from_s, to_s=table.to_s)}",
        PinHolds, doc="the wire has this level all the time",
    ),
    "wave": GoalKind(
        WaveTable,
        lambda table: f"has a wave in bounds on {table.pin}{_when(from_s=table.from_s, to_s=table.to_s)}",
        WaveWithin, doc="every period is in bounds, and there are so many",
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
