"""One contract for a robot that drives against a thing, held by every body: it slides, or it stalls and rests."""

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest

from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world, parse_world
from p2os.pioneer.world.model import Pose
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, each_body, marks_of
from tools.surveys.contact_survey import MODELS, SurveyedContact, judged_states, measure, picture, survey

ARENA = load_world("arena", 1)
WALL = parse_world(
    """
    name = "wall"
    extent_m = [-9, -9, 9, 9]
    [[box]]
    name = "wall"
    x_m = 0.0
    y_m = 1.05
    length_m = 16.0
    width_m = 0.1
    height_m = 0.5
    """,
    "wall",
)
#: At these a corner of the hull meets a thing beside the robot's middle, and it may turn about it. Each engine has
#: some of them here, and all of thirty in a soak test.
OFF_CENTRE_DEG = {"kinematic": (72, 120, 312), "bullet": (72, 312), "mujoco": (120,)}


def reported(contact: SurveyedContact) -> str:
    return f"{contact.model} on {contact.body}, heading {contact.heading_deg:g}: {'; '.join(contact.faults())}"


@pytest.mark.parametrize(
    ("name", "heading_deg"),
    [
        pytest.param(name, heading, id=f"{name}-{heading}", marks=marks_of(name))
        for name, headings in OFF_CENTRE_DEG.items()
        for heading in headings
    ],
)
def test_a_robot_that_meets_a_thing_beside_its_middle_slides_or_stalls_and_rests(name: str, heading_deg: int) -> None:
    model = load_parameters("p2dx")
    contact = measure(make_body(name, ARENA, model), model, heading_deg, 3.0)
    assert contact is not None
    assert not contact.faults(), reported(contact)


def looks(*, slides_ms: int, stalls_ms: int, leaves_ms: int = 9_000, blocked_ms: int = 9_000) -> Iterator[BodyState]:
    """Three seconds after a touch: it slides until a time, has a stall bit, leaves and is blocked from others on."""
    for ms in range(10, 3_010, 10):
        stalls, rim_mps = ms >= stalls_ms, 0.0 if ms >= blocked_ms else 0.2
        yield BodyState(
            x_m=0.0004 * min(ms, slides_ms), left_speed_mps=rim_mps, right_speed_mps=rim_mps, stalled_left=stalls,
            stalled_right=stalls, in_contact=ms < leaves_ms,
        )  # fmt: skip


#: So long the mean over ten looks still says that it slides.
TAIL_MS = 80


@pytest.mark.parametrize(
    ("slides_ms", "stalls_ms", "leaves_ms", "faults"),
    [
        (0, 1_500, 9_000, []),
        (0, 1_510, 9_000, ["neither slides nor stalls 1.5 s after the first touch"]),
        (0, 9_000, 1_500, []),
        (0, 9_000, 1_510, ["neither slides nor stalls 1.5 s after the first touch"]),
        (1_500 - TAIL_MS, 1_520, 9_000, []),
        (1_490 - TAIL_MS, 1_520, 9_000, []),  # it slid until lately
        (1_050 - TAIL_MS, 1_660, 9_000, []),
        (1_050 - TAIL_MS, 1_670, 9_000, ["neither slides nor stalls 1.5 s after the first touch"]),
        (2_000 - TAIL_MS, 2_610, 9_000, []),
        (2_000 - TAIL_MS, 2_620, 9_000, ["neither slides nor stalls for 0.61 s"]),
    ],
)
def test_a_contact_is_decided_in_time(slides_ms: int, stalls_ms: int, leaves_ms: int, faults: list[str]) -> None:
    seen = list(looks(slides_ms=slides_ms, stalls_ms=stalls_ms, leaves_ms=leaves_ms))
    stopping = [BodyState()]
    assert judged_states("none", load_parameters("p2dx"), 0.0, seen, stopping).faults() == faults


@pytest.mark.parametrize(
    ("blocked_ms", "stalls_ms", "faults"),
    [
        (1_500, 2_100, []),  # it has come to stand there: the bit has its 0.6 s
        (
            1_510,
            2_110,
            ["neither slides nor stalls 1.5 s after the first touch", "neither slides nor stalls for 0.61 s"],
        ),
        (1_500, 2_110, ["neither slides nor stalls for 0.61 s", "blocked for 0.61 s without a stall bit"]),
    ],
)
def test_what_is_blocked_just_then_has_its_time(blocked_ms: int, stalls_ms: int, faults: list[str]) -> None:
    seen = list(looks(slides_ms=0, stalls_ms=stalls_ms, blocked_ms=blocked_ms))
    assert judged_states("none", load_parameters("p2dx"), 0.0, seen, [BodyState()]).faults() == faults


TOUCH = BodyState(in_contact=True, left_speed_mps=0.2, right_speed_mps=0.2)
STALL = replace(TOUCH, left_speed_mps=0.0, right_speed_mps=0.0, stalled_left=True, stalled_right=True)
REST = BodyState()
LOOKS_A_SECOND = 100


def judged(*pieces: tuple[float, BodyState, float]) -> SurveyedContact:
    """Judge a contact made of pieces: seconds, what the body says, and how fast its centre moves, m/s."""
    states, x = [], 0.0
    for seconds, state, speed in pieces:
        for _ in range(round(seconds * LOOKS_A_SECOND)):
            x += speed / LOOKS_A_SECOND
            states.append(replace(state, x_m=x))
    return judged_states("any", load_parameters("p2dx"), 45.0, states, [REST] * LOOKS_A_SECOND)


def undecided_faults(contact: SurveyedContact) -> list[str]:
    return [fault for fault in contact.faults() if fault.startswith("neither slides nor stalls")]


#: A mean over ten looks: the centre counts as sliding for so long after it stopped, at the command's own speed, s.
TAIL_S = 0.08


@pytest.mark.parametrize(("late_s", "is_fault"), [(0.59, False), (0.60, False), (0.61, True)])
def test_what_slid_until_then_stalls_within_its_time(late_s: float, is_fault: bool) -> None:
    blocked = late_s + TAIL_S
    assert bool(undecided_faults(judged((2.0, TOUCH, 0.4), (blocked, TOUCH, 0.0), (3.0, STALL, 0.0)))) is is_fault


@pytest.mark.parametrize(("slid_s", "is_fault"), [(1.2, True), (0.5, True), (0.1, False)])
def test_what_stopped_sliding_before_is_counted_from_there(slid_s: float, is_fault: bool) -> None:
    """Undecided for 0.8 s, over the moment of the decision or before it."""
    found = judged((slid_s, TOUCH, 0.4), (0.8 + TAIL_S, TOUCH, 0.0), (3.0, STALL, 0.0))
    assert bool(undecided_faults(found)) is (is_fault and slid_s + 0.8 > 1.5)


@pytest.mark.parametrize(("share", "is_fault"), [(0.201, False), (0.199, True)])
def test_a_fifth_of_the_command_is_sliding(share: float, is_fault: bool) -> None:
    assert bool(undecided_faults(judged((4.0, TOUCH, share * 0.4)))) is is_fault


def test_what_touches_nothing_any_more_is_not_asked() -> None:
    assert undecided_faults(judged((1.0, TOUCH, 0.4), (3.0, replace(TOUCH, in_contact=False), 0.0))) == []


@pytest.mark.parametrize(("late_s", "is_fault"), [(0.59, False), (0.60, False), (0.61, True)])
def test_a_stall_bit_comes_within_its_time_of_both_rims_blocked(late_s: float, is_fault: bool) -> None:
    stuck = replace(TOUCH, left_speed_mps=0.039, right_speed_mps=0.039)
    faults = judged((0.5, TOUCH, 0.4), (late_s, stuck, 0.2), (3.0, STALL, 0.0)).faults()
    assert any(fault.startswith("blocked for") for fault in faults) is is_fault
    free = replace(stuck, left_speed_mps=0.041)
    assert not judged((0.5, TOUCH, 0.4), (late_s, free, 0.2), (3.0, STALL, 0.0)).faults()


@pytest.mark.parametrize(("late_s", "is_fault"), [(1.9, False), (2.0, False), (2.01, True)])
def test_both_wheels_stalled_come_to_rest_within_two_seconds(late_s: float, is_fault: bool) -> None:
    faults = judged((0.5, TOUCH, 0.4), (late_s - TAIL_S - 0.01, STALL, 0.3), (3.0, STALL, 0.0)).faults()
    assert any("after both wheels stalled" in fault for fault in faults) is is_fault


@pytest.mark.parametrize(("changes", "is_fault"), [(2, False), (3, True)])
def test_a_turn_changes_its_sign_twice_at_most(changes: int, is_fault: bool) -> None:
    pieces = [(0.3, replace(TOUCH, turn_radps=0.1 * (-1) ** number), 0.4) for number in range(changes + 1)]
    assert any("changes sign" in fault for fault in judged(*pieces).faults()) is is_fault


@pytest.mark.parametrize(("stop_s", "is_fault"), [(0.05, False), (0.06, True)])
def test_a_stop_is_effective_at_once(stop_s: float, is_fault: bool) -> None:
    stopping = [TOUCH] * round(stop_s * LOOKS_A_SECOND) + [REST] * LOOKS_A_SECOND
    states = [replace(TOUCH, x_m=0.004 * number) for number in range(400)]
    found = judged_states("any", load_parameters("p2dx"), 45.0, states, stopping)
    assert ("a stop is not effective at once" in found.faults()) is is_fault


def test_the_picture_shows_the_stall_and_the_rest_of_each_contact() -> None:
    contacts = list(survey(["kinematic"], ["p2dx"], 3, ARENA))
    drawn = picture(contacts)
    assert drawn.count('r="2.6"') == 2 * len(contacts) == 6
    assert "p2dx" in drawn


@pytest.mark.soak
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", each_body())
def test_every_contact_of_thirty_headings_is_within_the_contract(name: str, model: str) -> None:
    contacts = list(survey([name], [model], 30, ARENA))
    assert len(contacts) == 30
    broken = {contact.heading_deg: contact.faults() for contact in contacts if contact.faults()}
    assert broken == {}


@pytest.mark.parametrize("model", ["p2dx", "powerbot"])
@pytest.mark.parametrize("name", each_body())
def test_a_robot_that_meets_a_wall_at_a_small_angle_goes_along_it(name: str, model: str) -> None:
    parameters = load_parameters(model)
    hull, body = parameters.body, make_body(name, WALL, parameters)
    # A corner of its front is some 5 cm from the wall.
    body.reset(Pose(-4.0, 0.95 - hull.hull_width_m / 2 - 0.35 * hull.hull_front_m, math.radians(20)), 0)
    met = drive(body, 0.3, 0.3, 2.0)
    assert met.collisions
    along = drive(body, 0.3, 0.3, 2.2)
    assert along.x_m - met.x_m > 0.5 * 0.3 * 2.2
    assert abs(along.heading_rad) < math.radians(3)
    assert not along.stalled_left
    assert not along.stalled_right


@pytest.mark.parametrize("name", each_body())
def test_a_robot_that_meets_a_wall_at_a_large_angle_stalls(name: str) -> None:
    body = make_body(name, WALL, load_parameters("p2dx"))
    body.reset(Pose(-4.0, 0.7, math.radians(75)), 0)
    stuck = drive(body, 0.3, 0.3, 2.0)
    assert stuck.stalled_left
    assert stuck.stalled_right
    assert drive(body, 0.0, 0.0, 0.05).left_speed_mps == pytest.approx(0.0, abs=0.005)
    assert drive(body, -0.3, -0.3, 1.0).y_m < stuck.y_m - 0.2


@pytest.mark.parametrize("name", each_body("kinematic"))
def test_a_gear_holds_a_wheel_that_is_pushed_back_and_lets_it_go_again(name: str) -> None:
    body = make_body(name, ARENA, load_parameters("p2dx"))
    body.reset(Pose(0.0, 0.0, math.radians(72)), 0)
    stuck = drive(body, 0.4, 0.4, 6.5)
    assert stuck.stalled_left or stuck.stalled_right
    free = drive(body, -0.4, -0.4, 1.0)
    assert (free.left_speed_mps, free.right_speed_mps) == pytest.approx((-0.4, -0.4), abs=0.01)
    assert not free.stalled_left
    assert not free.stalled_right
