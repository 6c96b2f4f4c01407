"""Each kind of goal on the same long runs: its sentence, when it is decided, and what is said of it, as it is kept.

What a bound is and where a window ends is tested goal by goal; here is how all of it comes together.
"""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import pytest

from robot_bench.events.kinds import (
    Event,
    Pose,
    Text,
    WorldChange,
)
from robot_bench.scenario.goals.judging import GoalJudge, RunEnd, load_goal
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.json_schema import scenario_schema
from robot_bench.scenarios import encoders, sensors
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.long_run import LONG_S, long_run
from tests.robot_bench.recording.records import S

GOALS: Mapping[str, list[dict[str, Any]]] = {
    "no_collision": [{}],
    "min_distance": [{"distance_m": 2}, {"distance_m_a_minute": 3}, {"distance_m_a_minute": 9}, {"distance_m": 30}],
    "cells": [{"least": 4}, {"least": 40}],
    "reach": [{"x_m": 0.5, "y_m": 0, "radius_m": 0.2}, {"area_m": [0.3, -2, 3, 2], "within_s": 2},
              {"area_m": [5, 5, 6, 6.5]}, {"x_m": -9, "y_m": 1, "radius_m": 0.5, "within_s": 30}],
    "avoid": [{"area_m": [0.4, -1, 3, 1]}, {"x_m": 9, "y_m": 0, "radius_m": 1}],
    "stay_within": [{"area_m": [-0.5, -1, 0.8, 1]}, {"x_m": 0, "y_m": 0, "radius_m": 30}],
    "clearance": [{"least_m": 0.4}, {"least_m": 0.05}],
    "stop_within": [{"after": "contact", "within_s": 1.5}, {"after": "contact", "within_s": 30, "way_m": 0.5},
                    {"after": "pin DD4 high", "within_s": 9}, {"after": "contact wall", "within_s": 1, "if_any": True},
                    {"after": "contact wall", "within_s": 1}],
    "moves_on": [{"way_m": 0.5, "within_s": 6}, {"way_m": 0.3, "within_s": 30, "from_s": 5},
                 {"way_m": 0.5, "within_s": 8, "free_m": 0.21}, {"way_m": 0.5, "within_s": 8, "free_m": 0.3,
                                                                "ahead": [4, 5, 9]}],
    "smooth": [{"most_mps2": 4}, {"most_mps2": 100}],
    "energy": [{"most_j": 40}, {"most_j_a_metre": 30}, {"most_j_a_metre": 900, "most_j": 1000}],
    "turns_away": [{"near_m": 0.6, "free_m": 0.6}, {"near_m": 0.8, "free_m": 0.9, "row": 2, "within_turns": 2,
                                                    "apart_m": 0.1}],
    "turns_long": [{"row": 1, "way_m": 0.5, "least_deg": 60}, {"row": 3, "way_m": 2, "least_deg": 90}],
    "steers_away": [{"near_m": 0.5, "free_m": 0.5, "within_s": 0.1}, {"near_m": 0.7, "free_m": 0.7, "within_s": 3}],
    "no_idle_turn": [{"free_m": 0.21, "within_s": 0.08}, {"free_m": 0.3, "within_s": 4},
                     {"free_m": 0.21, "within_s": 0.04, "long_deg": 20, "apart_m": 0.3}],
    "backs_on_path": [{"off_m": 0.02}, {"off_m": 0.9}],
    "answers": [{"high": ["DD4"], "signal": "mean", "most": 2, "within_s": 0.5},
                {"any_high": ["DD4", "DD5"], "moving": ["forward"], "signal": "turn", "least": -1, "within_s": 0.4},
                {"low": ["DD4", "DD5"], "signal": "turn", "least": -9, "most": 9, "within_s": 0.1},
                {"high": ["DD5"], "low": ["DD4"], "signal": "mean", "least": 0, "within_s": 3}],
    "has_reason": [{"motion": "turn", "needs": [["DD4", "DD5"]], "within_s": 0.05},
                   {"motion": "back", "before": ["forward", "turn"], "needs": [["DD4"], ["DD5"]], "within_s": 0.4,
                    "row": 1},
                   {"motion": "turn", "given": ["DD5"], "needs": [["DD4"]], "within_s": 0.09}],
    "lasts": [{"motion": "forward", "least_s": 0.5}, {"motion": "turn", "before": ["forward"], "most_s": 2},
              {"motion": "stand", "least_s": 0.2, "most_s": 3}, {"motion": "back", "most_s": 60}],
    "hold_heading": [{"heading_deg": 0, "tolerance_deg": 20, "to_s": 3}, {"heading_deg": 370, "tolerance_deg": 60},
                     {"after": "pin DD4 high", "to_s": 0.2, "heading_deg": 0, "tolerance_deg": 170}],
    "hold_speed": [{"speed_mps": 0.1, "tolerance_mps": 0.3}, {"speed_mps": 0.1, "tolerance_mps": 0.1, "from_s": 2}],
    "always": [{"signal": "x_m", "least": -1, "most": 1}, {"signal": "sonar_m", "least": 0.1},
               {"signal": "left_mps", "most": 0.15, "after": "pin DD5 high", "from_s": 0.1, "to_s": 1},
               {"signal": "apart_m", "thing": "post", "most": 1.5}, {"signal": "clearance_m", "least": 0.2, "to_s": 9}],
    "eventually": [{"signal": "y_m", "least": 0.4}, {"signal": "heading_deg", "most": -200, "to_s": 30},
                   {"signal": "right_mps", "least": 0.15, "after": "contact", "to_s": 2},
                   {"signal": "speed_mps", "least": 0.1, "after": "contact wall"},
                   {"signal": "apart_m", "thing": "ghost", "most": 1, "to_s": 9}],
    "happens": [{"event": "contact", "least": 2}, {"event": "pin DD4 high", "least": 3, "most": 6, "within_s": 20},
                {"event": "usart1 sends go", "from_s": 5, "within_s": 20}, {"event": "contact wall", "least": 0},
                {"event": "contact", "least": 0, "most": 0}, {"event": "note adapter", "least": 99, "within_s": 30}],
    "never": [{"event": "contact wall"}, {"event": "robot drives 1", "from_s": 2}],
    "in_order": [{"events": ["pin DD4 high", "contact", "usart1 sends go"]}, {"events": ["contact", "contact wall"]},
                 {"events": ["contact wall"]}],
    "latency": [{"from_": "pin DD4 high", "to": "pin DD4 low", "most_s": 0.3},
                {"from_": "contact", "to": "usart1 sends go", "most_s": 9, "least_s": 0.1},
                {"from_": "pin DD5 high", "to": "pin DD5 low", "most_s": 9},
                {"from_": "contact wall", "to": "contact", "most_s": 1}],
    "motor_sequence": [{"values": [[0, 0], [3, 3]]}, {"values": [[0, 0]], "held_s": 0.4}, {"values": [[1, 1]]}],
    "pin_holds": [{"pin": "DD4", "level": "low"}, {"pin": "DD5", "level": "low", "to_s": 0.04},
                  {"pin": "motor1_comm3", "level": "high", "from_s": 0.2, "to_s": 3}],
    "wave": [{"pin": "p2dx_con", "least_hz": 950}, {"pin": "p2dx_con", "least_hz": 800, "most_hz": 1200,
                                                     "periods": 3, "least_duty": 0.3, "most_duty": 0.4},
             {"pin": "DD4", "most_hz": 100, "least_duty": 0.1}, {"pin": "rst"}],
    "usart_contains": [{"text": "go left=-2"}, {"text": "stop"}],
    "usart_lacks": [{"text": "stop"}, {"text": "x=0.1"}],
    "usart_in_order": [{"texts": ["ready", "go", "left=1"]}, {"texts": ["go", "ready"]}],
    "prints_numbers": [{"matches": r"x=(-?[\d.]+) m", "signal": "x_m", "tolerance": 0.006, "over_s": 0.1},
                       {"matches": r"x=(-?[\d.]+) m", "times": 100, "most": 50},
                       {"matches": r"x=(-?[\d.]+) m", "signal": "y_m", "tolerance": 0.1},
                       {"matches": r"y=(\d+)", "least": 0}],
    "prints_lines": [{"matches": ["ready", "go .*", "left.* m"], "first": "ready"}, {"matches": ["go .*", "ready"]},
                     {"matches": [".*"], "first": "go.*"}],
    "turn_ends": [{"low": ["DD4"], "within_s": 0.3}, {"low": ["DD4", "DD5"], "within_s": 1, "lingers_s": 0.2, "row": 2,
                                                      "way_m": 0.3, "passage": ["DD5"], "passage_s": 0.2}],
    "reports_motion": [{"motion": "turn", "matches": "go .*", "within_s": 0.5},
                       {"motion": "forward", "before": ["turn"], "matches": "ready", "within_s": 2}],
    "encoder_counts_match": [{}, {"steps": 0}],
    "sensor_named": [{}],
}  # fmt: skip


def shown(robustness: float | None) -> str:
    return "-" if robustness is None else f"{robustness:.6g}"


def judged(kind: str, table: Mapping[str, Any], run: list[Event]) -> Iterator[str]:
    goal = load_goal({"kind": kind, **{key.rstrip("_"): value for key, value in table.items()}}, "mine.toml")
    yield f"{kind} {table}: {goal.wanted}"
    judge, ends = GoalJudge([goal]), LONG_S * S
    known = None
    for event in run:
        judge.feed([event])
        if judge._decided[0] is None:
            judge.advance_to(event.t)
        if known is None and (known := judge._decided[0]) is not None:
            yield f"  {event.t / S:.3f} s {known.met} {known.says!r} {shown(known.robustness)} {known.unit}"
    judge.advance_to(ends)
    if known is None and (known := judge._decided[0]) is not None:
        yield f"  in the end {known.met} {known.says!r} {shown(known.robustness)} {known.unit}"
    (at_end,) = judge.at_end(RunEnd(ends))
    outcome = at_end.outcome
    yield f"  at last {outcome.met} {outcome.says!r} {shown(outcome.robustness)} {outcome.unit} {at_end.is_open}"


@pytest.mark.parametrize("seed", [1, 4])
def test_each_goal_on_a_long_run(seed: int) -> None:
    assert GOALS.keys() == every_kind().keys()
    run = [*long_run(seed)]
    lines = [line for kind, tables in GOALS.items() for table in tables for line in judged(kind, table, run)]
    assert is_as_kept(lines, f"goals_on_long_run_{seed}")


def placed(t: float, sonar: int) -> Event:
    return WorldChange(t=round(t * S), op="place", name="card", fields={"sonar": sonar})


def said(t: float, line: str) -> Event:
    return Text(t=round(t * S), data=f"{line}\n".encode())


@pytest.mark.parametrize(
    ("events", "failure"),
    [
        ([placed(1, 3), said(1.1, "sensor 3 on"), said(2.0, "sensor 3 off"), placed(2.1, 4), said(2.1, "sensor 4 on"),
          said(10, "sensor 4 off")], ""),
        ([said(1, "sensor 3 on")], "nothing was placed before a sonar"),
        ([said(0.9, "sensor 3 on"), placed(1, 3)], "'sensor 3 on' was printed before anything was placed"),
        ([placed(1, 3), said(1, "sensor 3 on"), said(1.5, "other sensor 3 off"), placed(2, 4), said(2, "sensor 3 off")],
         "with something before sonar 3 from 1.000 s on it printed ['sensor 3 on']"),
        ([placed(1, 3), said(1, "sensor 3 off"), said(1.5, "sensor 3 on")],
         "with something before sonar 3 from 1.000 s on it printed ['sensor 3 off', 'sensor 3 on']"),
    ],
)  # fmt: skip
def test_goal_sensor_named_wants_what_is_printed_between_two_things(events: list[Event], failure: str) -> None:
    watch = sensors.GOAL.watch(None)
    for event in events:
        watch.feed(event)
    assert (watch.finish(10 * S).met, watch.finish(10 * S).says) == (not failure, failure)


def turned(t: float, left: int, right: int) -> Event:
    """A pose at which the wheels had turned by so many eighths and a half."""
    angles = [round((turns + 0.5) / 8 * math.tau * 1e6) for turns in (left, right)]
    return Pose(t=round(t * S), x=0, y=0, z=0, heading=0, pitch=0, left=0, right=0, left_angle=angles[0],
                right_angle=angles[1], collisions=0)  # fmt: skip


@pytest.mark.parametrize(
    ("events", "failure"),
    [
        ([turned(1, 3, -4), said(1.02, "left=4 right=-5"), turned(1.05, 9, 9)], ""),
        ([turned(1, 3, -4), said(1.02, "left=5 right=-4"), turned(1.05, 9, 9)],
         "left was printed as 5 at 1.020 s, the wheel had turned 3 steps"),
        ([turned(1, 3, -4), said(1.025, "left=3 right=-6"), turned(1.05, 9, 9)],
         "right was printed as -6 at 1.025 s, the wheel had turned -4 steps"),
        ([turned(1, 3, -4), said(1.026, "left=3 right=-4"), turned(1.05, 5, -4)],
         "left was printed as 3 at 1.026 s, the wheel had turned 5 steps"),
        ([said(0.9, "left=3 right=-4"), turned(1, 3, -4)], ""),
        ([turned(1, 3, -4), said(1.1, "left=7 right=0")],
         "left was printed as 7 at 1.100 s, the wheel had turned 3 steps"),
        ([turned(1, 3, -4), said(1.1, "left = 7")], "no counts were printed; the last line is 'left = 7'"),
        ([said(1.1, "left=7 right=0")], "no counts were printed; the last line is 'left=7 right=0'"),
    ],
)  # fmt: skip
def test_goal_encoder_counts_match_takes_the_nearest_pose(events: list[Event], failure: str) -> None:
    watch = encoders.GOAL.watch(encoders.EncoderCountsTable())
    for event in events:
        watch.feed(event)
    found = watch.finish(10 * S)
    assert (found.met, found.says) == (not failure, failure)


def without_words(schema: Any) -> Any:
    """Return a schema without what is for readers."""
    if isinstance(schema, dict):
        return {key: without_words(value) for key, value in schema.items() if key != "description"}
    return [*map(without_words, schema)] if isinstance(schema, list) else schema


def test_every_key_has_the_bounds_and_the_default_that_are_kept() -> None:
    found = json.dumps(without_words(scenario_schema()), sort_keys=True, indent=0).replace("{\n", "{")
    assert is_as_kept(found.splitlines(), "scenario_schema")
