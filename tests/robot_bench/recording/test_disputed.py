"""Which verdicts of a run hang on its body: contacts after which bodies differ, to the degree and the nanosecond."""

import math
from dataclasses import replace

import pytest

from p2os.pioneer.body.contacts import DISPUTED_BESIDE_M, DISPUTED_DEG
from p2os.pioneer.world import load_world
from robot_bench.events.kinds import Contact, Pose, Verdict, WorldChange
from robot_bench.recording.disputed import EDGE_M, body_note, first_disputed
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.summary import figures, outcome_of
from simbase.timing import NS_PER_S

TOUCHED_NS = 12 * NS_PER_S
#: The face of a wall at y = 1, along x.
WALL = {"name": "wall", "shape": "box", "x": 0.0, "y": 1.05, "heading": 0.0, "length": 16.0, "width": 0.1}
POST = {"name": "post", "shape": "cylinder", "x": 0.3, "y": 0.0, "heading": 0.0, "radius": 0.1}


def pose(t: int, heading_deg: float, *, x_m: float = 0.0, y_m: float = 0.0, mps: float = 0.3) -> Pose:
    values = dict.fromkeys(("z", "pitch", "left_angle", "right_angle", "collisions"), 0)
    rim = round(mps * 1e6)
    return Pose(
        t=t, x=round(x_m * 1e6), y=round(y_m * 1e6), heading=round(math.radians(heading_deg) * 1e6), left=rim,
        right=rim, **values,
    )  # fmt: skip


def run(
    thing: dict[str, object], at: tuple[float, float], approach: Pose, *, body: str = "bullet",
    decided_ns: int | None = None,
) -> RunRecord:  # fmt: skip
    """Return a run that touches a thing, and decides a goal a nanosecond later."""
    record = RunRecord(meta={"body": body, "world": {"name": "w", "obstacles": [thing]}})
    record.poses = [replace(approach, t=0), approach, replace(approach, t=TOUCHED_NS, left=0, right=0)]
    record.contacts = [Contact(t=TOUCHED_NS, what=repr(thing["name"]), x_m=at[0], y_m=at[1], part="front left")]
    decided_ns = TOUCHED_NS + 1 if decided_ns is None else decided_ns
    record.verdicts = [Verdict(t=decided_ns, goal="home", met=False, says="never came home")]
    record.end, record.is_cut = {"passed": False, "failures": [], "notes": ["first"]}, False
    return record


def wall(angle_deg: float, **named: object) -> RunRecord:
    approach = pose(TOUCHED_NS - 1, angle_deg, y_m=0.7)
    return run(WALL, (0.1, 1.0), approach, **named)  # type: ignore[arg-type]  # as of run


def post(beside_m: float) -> RunRecord:
    return run(POST, (0.2, beside_m), pose(TOUCHED_NS - 1, 0.0))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("angle_deg", "is_disputed"),
    [(0, False), (DISPUTED_DEG[0] - 0.1, False), (DISPUTED_DEG[0] + 0.1, True), (45, True),
     (DISPUTED_DEG[1] - 0.1, True), (DISPUTED_DEG[1] + 0.1, False), (90, False), (180 - 45, True), (180 - 10, False)],
)  # fmt: skip
def test_a_face_is_disputed_between_two_angles(sign: int, angle_deg: float, is_disputed: bool) -> None:
    assert bool(body_note(wall(sign * angle_deg))) is is_disputed


@pytest.mark.parametrize(
    ("beside_m", "is_disputed"),
    [(0.0, False), (DISPUTED_BESIDE_M - 0.001, False), (DISPUTED_BESIDE_M + 0.001, True), (-0.15, True)],
)
def test_a_post_is_disputed_beside_the_middle(beside_m: float, is_disputed: bool) -> None:
    assert bool(body_note(post(beside_m))) is is_disputed


@pytest.mark.parametrize(("x_m", "is_edge"), [(7.97, False), (7.99, True), (8.0, True)])
def test_the_end_of_a_wall_is_an_edge(x_m: float, is_edge: bool) -> None:
    assert 0.01 < EDGE_M < 0.03
    found = first_disputed(run(WALL, (x_m, 1.0), pose(TOUCHED_NS - 1, 45.0, x_m=x_m - 0.1, y_m=0.7)))
    assert found is not None
    assert (found.angle_deg is None) is is_edge


def test_a_wall_that_is_turned_has_its_face_turned() -> None:
    turned = {**WALL, "x": 1.05, "y": 0.0, "heading": math.pi / 2}
    assert body_note(run(turned, (1.0, 0.2), pose(TOUCHED_NS - 1, 90.0, x_m=0.8))) == ""
    assert body_note(run(turned, (1.0, 0.2), pose(TOUCHED_NS - 1, 0.0, x_m=0.8))) == ""
    assert "at 45°" in body_note(run(turned, (1.0, 0.2), pose(TOUCHED_NS - 1, 45.0, x_m=0.8)))


@pytest.mark.parametrize(("later_ns", "hangs"), [(-1, False), (0, False), (1, True)])
def test_a_verdict_hangs_on_the_body_where_it_came_after_the_contact(later_ns: int, hangs: bool) -> None:
    assert bool(body_note(wall(45, decided_ns=TOUCHED_NS + later_ns))) is hangs


def test_the_note_says_which_body_which_goal_and_what_to_do() -> None:
    assert body_note(wall(45)) == (
        "hangs on the body bullet: after the contact with 'wall' at 12.000 s, at 45° the bodies differ, and so may "
        "home (missed); run it with --body mujoco, too (docs/pioneer.md, oblique hits)"
    )
    assert "--body bullet" in body_note(wall(45, body="kinematic"))
    assert "0.10 m beside its middle" in body_note(post(0.1))


def test_the_outcome_and_the_page_have_the_note_beside_the_others() -> None:
    record = wall(45)
    assert outcome_of(record)["notes"] == ["first", body_note(record)]
    assert ("note", body_note(record)) in figures(record)
    assert outcome_of(wall(5))["notes"] == ["first"]
    assert "note" not in dict(figures(wall(5)))


def test_what_comes_to_a_robot_that_stands_is_no_hit_of_its_own() -> None:
    assert body_note(run(WALL, (0.1, 1.0), pose(TOUCHED_NS - 1, 45, y_m=0.7, mps=0.0))) == ""
    assert body_note(run(WALL, (0.1, 1.0), pose(TOUCHED_NS - 1, 45, y_m=0.7, mps=-0.3))) != ""


def test_a_thing_is_where_it_was_moved_to_before() -> None:
    record = wall(45)
    for at_ns, is_disputed in ((TOUCHED_NS + 1, True), (TOUCHED_NS, False)):
        record.changes = [
            WorldChange(t=at_ns, op="move", name="wall", fields={"x": 0.0, "y": 1.0, "heading": math.pi / 4})
        ]
        assert bool(body_note(record)) is is_disputed
    record.changes = [WorldChange(t=1, op="remove", name="wall")]
    assert body_note(record)


def test_what_the_trace_does_not_have_is_not_judged() -> None:
    assert body_note(RunRecord()) == ""
    other = wall(45)
    other.contacts = [replace(other.contacts[0], what="something")]
    assert body_note(other) == ""
    other = wall(45)
    other.poses = []
    assert body_note(other) == ""


def test_the_things_of_a_world_have_what_is_read_of_them() -> None:
    for thing in load_world("office").to_plain()["obstacles"]:  # type: ignore[attr-defined]  # plain values
        assert {"name", "shape", "x", "y", "heading"} <= thing.keys()
        assert thing["shape"] != "box" or {"length", "width"} <= thing.keys()
