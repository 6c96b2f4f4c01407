"""Timed changes of the world act at their time, on a body that was brought there."""

import math

import pytest

from p2os.errors import ScenarioError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Obstacle, Pose
from p2os.robots.parameters import load_parameters
from robot_bench.scenario.world_script import BeforeSonar, Op, ScriptedChange, WorldScript, load_changes

S = 10**9
P2DX = load_parameters("p2dx")


def post(name: str = "post") -> Obstacle:
    return Obstacle(name=name, x_m=0, y_m=0, radius_m=0.02, height_m=0.5)


def script(*changes: ScriptedChange) -> tuple[WorldScript, list[tuple[str, str, int, dict[str, object]]], list[int]]:
    body = make_body("kinematic", load_world("room"), P2DX)
    body.reset(Pose(-1.0, 0.0, math.pi / 2), 0)
    changed: list[tuple[str, str, int, dict[str, object]]] = []
    brought: list[int] = []
    made = WorldScript(
        changes,
        body,
        P2DX,
        bring_to=brought.append,
        on_change=lambda op, name, at, f: changed.append((op, name, at, dict(f))),
    )
    return made, changed, brought


def test_changes_happen_in_order_of_time_each_at_its_own() -> None:
    made, changed, brought = script(
        ScriptedChange(at=3 * S, op=Op.REMOVE, name="post"),
        ScriptedChange(at=S, op=Op.PLACE, name="post", obstacle=post(), x_m=1, y_m=-1),
        ScriptedChange(at=2 * S, op=Op.MOVE, name="post", x_m=1.5, y_m=-1, heading_rad=0.5),
    )
    assert made.next_deadline() == S
    made.advance_to(S)
    assert [op for op, *_ in changed] == ["place"]
    made.advance_to(5 * S)
    assert brought == [S, 2 * S, 3 * S]
    assert [(op, at) for op, _, at, _ in changed] == [("place", S), ("move", 2 * S), ("remove", 3 * S)]
    assert changed[0][3]["radius"] == 0.02
    assert changed[1][3] == {"x": 1.5, "y": -1, "heading": 0.5}
    assert changed[2][3] == {}
    assert made.next_deadline() is None


@pytest.mark.parametrize("number", range(1, 9))
def test_a_thing_before_a_sonar_is_what_that_sonar_sees(number: int) -> None:
    change = ScriptedChange(
        at=0, op=Op.PLACE, name="post", obstacle=post(), before=BeforeSonar(number=number, distance_m=0.45)
    )
    made, changed, _ = script(change)
    made.advance_to(0)
    ranges = made._body.ranges(range(8))
    assert ranges[number - 1] == pytest.approx(0.45 - 0.02, abs=0.002)
    assert changed[0][3]["sonar"] == number
    assert [n for n, metres in enumerate(ranges, start=1) if metres < 0.6] == [number]


def test_a_restored_script_does_nothing_twice() -> None:
    changes = [
        ScriptedChange(at=at * S, op=Op.PLACE, name=f"post {at}", obstacle=post(f"post {at}"), x_m=1, y_m=at / 4)
        for at in (1, 2)
    ]
    first, _, _ = script(*changes)
    first.advance_to(S)
    second, changed, _ = script(*changes)
    second.restore(first.snapshot())
    second.advance_to(3 * S)
    assert [name for _, name, _, _ in changed] == ["post 2"]


SIZES = ("length_m", "width_m", "height_m")
WALKING = {"at_s": 1.0, "name": "visitor", "shape": "cylinder", "radius_m": 0.2, "height_m": 1.7}


def test_a_placed_thing_walks_and_another_can_be_pushed() -> None:
    parameters = load_parameters("p2dx")
    tables = [
        {**WALKING, "path_m": [[1, 0], [2.0, 0]], "speed_mps": 0.8, "repeat": "once"},
        {"at_s": 2.0, "name": "box", "x_m": 1, "y_m": 1, **dict.fromkeys(SIZES, 0.3), "mass_kg": 2.0},
    ]
    first, second = load_changes(tables, parameters, "s.toml")
    assert first.obstacle is not None
    assert first.obstacle.walk is not None
    assert first.obstacle.walk.pose_at(0.5)[0] == 1.4
    assert second.obstacle is not None
    assert (second.obstacle.mass_kg, second.obstacle.friction) == (2.0, 0.5)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"path_m": [[1, 0], [2]]}, "is not a list of lists of 2 numbers"),
        ({"path_m": [[1, 0], [True, 2]]}, "is not a list of lists of 2 numbers"),
        ({"path_m": [[1, 0]]}, "two points"),
        ({"path_m": [[1, 0], [2, 0]], "repeat": "never"}, "none of once"),
        ({"path_m": [[1, 0], [2, 0]], "mass_kg": 1}, "only one of"),
        ({"path_m": [[1, 0], [2, 0]], "before_sonar": 3, "distance_m": 1}, "path_m is for a thing"),
    ],
)
def test_a_path_that_cannot_be_is_refused(more: dict[str, object], said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        load_changes([{**WALKING, **more}], load_parameters("p2dx"), "s.toml")
