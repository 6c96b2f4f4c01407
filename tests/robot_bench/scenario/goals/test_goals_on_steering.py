"""Goals on turns, arcs and ways back that have no reason: a pose before, at and after each bound."""

from typing import Any

import pytest

from p2os.errors import ScenarioError
from robot_bench.events.kinds import Event, Ranges
from robot_bench.scenario.goals.judging import load_goal
from tests.robot_bench.recording.records import S
from tests.robot_bench.scenario.goals.test_goal_kinds import MS, at, outcome

FREE, NEAR, BETWEEN = 2000, 499, 500


def seen(t: int, left_mm: int = FREE, right_mm: int = FREE, side_mm: int = FREE) -> Ranges:
    """Return ranges: sonar 3 has something on the left, 6 on the right, 1 and 8 straight to the sides."""
    return Ranges(t=t, mm=(side_mm, FREE, left_mm, FREE, FREE, right_mm, FREE, side_mm))


def turn(t: int, x_m: float = 0.0, *, left: bool, steps: int = 10) -> list[Event]:
    """Return a turn on the spot, its rims part by 0.121 m in ten steps, then a pose that stands."""
    rim = 0.121 if left else -0.121
    poses = [at(t + step * 50 * MS, x_m, left=-rim, right=rim) for step in range(steps + 1)]
    return [*poses, at(t + (steps + 1) * 50 * MS, x_m)]


def turns_away(run: list[Event], **arguments: Any) -> Any:
    return outcome("turns_away", run, near_m=0.5, free_m=0.8, **arguments)


@pytest.mark.parametrize(("left_mm", "right_mm", "is_judged"), [
    (NEAR, 801, True), (NEAR, 800, False), (BETWEEN, 801, False), (NEAR, NEAR, False), (FREE, FREE, False),
])  # fmt: skip
def test_goal_turns_away_judges_a_turn_where_one_side_alone_is_near(
    left_mm: int, right_mm: int, is_judged: bool
) -> None:
    run = [at(0), seen(S, left_mm, right_mm), *turn(2 * S, left=True)]
    assert turns_away(run).met is not is_judged
    mirrored = [at(0), seen(S, right_mm, left_mm), *turn(2 * S, left=False)]
    assert turns_away(mirrored).met is not is_judged
    assert turns_away([at(0), seen(S, left_mm, right_mm), *turn(2 * S, left=False)]).met


def test_goal_turns_away_says_which_turn_it_was() -> None:
    found = turns_away([at(0), seen(S, NEAR), *turn(2 * S, 0.3, left=True)])
    assert (found.robustness, found.unit) == (-1, "of what is allowed")
    assert found.says == (
        "1 turn(s) in a row went to the side that was not free, the last at 2.000 s, x 0.30 m, y 0.00 m"
    )


@pytest.mark.parametrize(("steps", "met"), [(9, True), (10, False)])
def test_goal_turns_away_counts_a_turn_from_twenty_degrees_on(steps: int, met: bool) -> None:
    assert turns_away([at(0), seen(S, NEAR), *turn(2 * S, left=True, steps=steps)]).met is met


@pytest.mark.parametrize(("second_m", "met"), [(0.49, True), (0.5, False)])
def test_goal_turns_away_takes_what_begins_near_the_last_turn_for_a_part_of_it(second_m: float, met: bool) -> None:
    run = [at(0), seen(S, right_mm=NEAR), *turn(2 * S, left=True), seen(4 * S, NEAR), *turn(5 * S, second_m, left=True)]
    assert turns_away(run).met is met


def test_goal_turns_away_counts_those_in_a_row() -> None:
    ways = [True, False, True, True]
    run: list[Event] = [at(0), seen(S, NEAR)]
    for number, left in enumerate(ways):
        run += turn((2 + number) * S, float(number), left=left)
    assert turns_away(run[:-1], row=2).met
    assert not turns_away(run, row=1).met
    assert turns_away(run, row=1).robustness == -0.5


@pytest.mark.parametrize(("between", "met"), [(0, False), (2, False), (3, True)])
def test_goal_turns_away_counts_no_row_of_turns_that_are_far_apart(between: int, met: bool) -> None:
    run: list[Event] = [at(0), seen(S, NEAR), *turn(2 * S, left=True), seen(3 * S, BETWEEN)]
    for number in range(between):  # not judged: nothing is near
        run += turn((4 + number) * S, 1.0 + number, left=True)
    run += [seen(9 * S, NEAR), *turn(10 * S, 9.0, left=True)]
    assert turns_away(run, row=1, within_turns=3).met is met
    assert not turns_away(run, row=1).met
    assert not turns_away([*run, *turn(11 * S, 10.0, left=True)], row=1, within_turns=3).met  # a new row


def turned(t: int, degrees: float, x_m: float = 0.0) -> list[Event]:
    """Return a turn on the spot by so much, then a pose that stands."""
    ends = [at(t + n * 100 * MS, x_m, deg=degrees * n / 10, left=-0.12, right=0.12) for n in range(11)]
    return [at(t - 1, x_m), *ends, at(t + S + 50 * MS, x_m, deg=degrees)]


def turns_long(*turns: list[Event], **arguments: Any) -> Any:
    given = {"row": 3, "way_m": 0.3, "least_deg": 120, **arguments}
    return outcome("turns_long", [one for turn in turns for one in turn], **given)


@pytest.mark.parametrize(("last_deg", "met"), [(119.0, False), (121.0, True), (-121.0, True)])
def test_goal_turns_long_wants_one_of_a_row_to_be_long(last_deg: float, met: bool) -> None:
    rows = [turned(2 * n * S, 60.0) for n in (1, 2, 3)]  # the first belongs to none before
    assert turns_long(*rows).met
    found = turns_long(*rows, turned(8 * S, last_deg))
    assert found.met is met
    assert met or found.says == "3 turns in a row were short, the last at 9.050 s, x 0.00 m, y 0.00 m"
    assert found.robustness == pytest.approx(1 - 2 / 3 if met else -1 / 3)
    assert turns_long(*rows, turned(8 * S, last_deg), row=4).met


@pytest.mark.parametrize(("x_m", "met"), [(0.299, False), (0.3, True)])
def test_goal_turns_long_counts_what_begins_after_little_way(x_m: float, met: bool) -> None:
    rows = [turned(2 * n * S, 60.0) for n in (1, 2, 3)]
    assert turns_long(*rows, turned(8 * S, 60.0, x_m)).met is met
    back = [at(7 * S + 500 * MS, -0.01, left=-0.1, right=-0.1)]
    assert turns_long(*rows, back, turned(8 * S, 60.0)).met  # what follows a way back is another turn


@pytest.mark.parametrize(("kind", "wheels", "ranges"), [
    ("steers_away", (0.1, 0.16), (NEAR, FREE)), ("steers_away", (0.16, 0.1), (FREE, NEAR)),
    ("no_idle_turn", (-0.1, 0.1), (801, 801)), ("no_idle_turn", (0.1, -0.1), (801, 801)),
])  # fmt: skip
@pytest.mark.parametrize(("length", "met"), [(S - 1, True), (S, True), (S + 1, False)])
def test_goal_steers_away_and_goal_no_idle_turn_bound_the_time(
    kind: str, wheels: tuple[float, float], ranges: tuple[int, int], length: int, met: bool
) -> None:
    near = {"near_m": 0.5} if kind == "steers_away" else {}
    left, right = wheels
    run = [at(0), seen(S, *ranges), at(2 * S, left=left, right=right), at(2 * S + length, left=left, right=right)]
    found = outcome(kind, run, free_m=0.8, within_s=1, **near)
    assert (found.met, found.robustness) == (met, pytest.approx(1 - length / S))
    assert met or found.says.startswith("for 1.00 s from 2.000 s, x 0.00 m, y 0.00 m, it ")


@pytest.mark.parametrize(("kind", "wheels", "ranges"), [
    ("steers_away", (0.16, 0.1), (NEAR, FREE)),    # away from it
    ("steers_away", (0.1, 0.16), (NEAR, NEAR)),    # both
    ("steers_away", (-0.1, 0.1), (NEAR, FREE)),    # no way forward
    ("steers_away", (0.12, 0.16), (NEAR, FREE)),   # hardly bent
    ("no_idle_turn", (-0.1, 0.1), (800, FREE)),
    ("no_idle_turn", (0.1, 0.16), (FREE, FREE)),
    ("no_idle_turn", (0.0, 0.0), (FREE, FREE)),
])  # fmt: skip
def test_what_has_a_reason_is_not_counted(kind: str, wheels: tuple[float, float], ranges: tuple[int, int]) -> None:
    near = {"near_m": 0.5} if kind == "steers_away" else {}
    left, right = wheels
    run = [at(0), seen(S, *ranges), *(at(t * S, left=left, right=right) for t in (2, 3, 4))]
    found = outcome(kind, run, free_m=0.8, within_s=0.5, **near)
    assert (found.met, found.robustness) == (True, 1)


def idle_turn(*before: Event, deg: float = 130.0, x_m: float = 0.0, **arguments: Any) -> Any:
    """Return the outcome of a turn by so much, 100 ms a pose, with everything free once it goes on."""
    first, *on, _ = turned(5 * S, deg, x_m)[1:]
    run = [*before, first, seen(5 * S + 1), *on]
    return outcome("no_idle_turn", run, **{"free_m": 0.8, "within_s": 0.25, "long_deg": 100.0, **arguments})


AFTER_A_TURN = (at(0), seen(1, NEAR), *turned(S, 20.0), at(3 * S, 0.1, left=0.1, right=0.1))


@pytest.mark.parametrize(("deg", "met"), [(142.8, True), (143.0, False), (-142.8, True), (-143.0, False)])
def test_goal_no_idle_turn_judges_a_turn_soon_after_another_once_it_is_a_long_one(deg: float, met: bool) -> None:
    found = idle_turn(*AFTER_A_TURN, deg=deg)  # 0.3 s from a pose at 99.96 or 100.1 degrees on
    assert (found.met, idle_turn(*AFTER_A_TURN, deg=deg, long_deg=0.0).met) == (met, False)
    assert idle_turn(*AFTER_A_TURN, deg=99.9, within_s=0.01).met
    assert not idle_turn(*AFTER_A_TURN, deg=120.0, within_s=0.01, long_deg=99.9).met


@pytest.mark.parametrize(("x_m", "met"), [(0.299, True), (0.3, False), (-0.3, False)])
def test_goal_no_idle_turn_takes_what_begins_near_the_last_turn_for_soon_after_it(x_m: float, met: bool) -> None:
    assert idle_turn(*AFTER_A_TURN, x_m=x_m, deg=90.0, apart_m=0.3).met is met
    assert idle_turn(*AFTER_A_TURN, x_m=0.49, deg=90.0).met is True  # 0.5 where nothing is said
    assert idle_turn(*AFTER_A_TURN, x_m=0.5, deg=90.0).met is False


def test_goal_no_idle_turn_judges_the_first_turn_at_once_but_for_one_after_going_back() -> None:
    forward, back = (at(2 * S, left=rim, right=rim) for rim in (0.06, -0.06))
    slowly = at(3 * S, left=0.04, right=0.04)  # no way
    assert not idle_turn(at(0), seen(1), deg=90.0).met
    assert not idle_turn(at(0), seen(1), forward, deg=90.0).met
    assert idle_turn(at(0), seen(1), back, slowly, deg=90.0).met
    assert not idle_turn(at(0), seen(1), back, forward, deg=90.0).met


@pytest.mark.parametrize(("left_mm", "right_mm", "met"), [
    (800, 800, True), (801, 800, False), (800, 801, False), (FREE, FREE, False),
])  # fmt: skip
def test_goal_no_idle_turn_lets_a_turn_between_things_on_both_sides_be_long(
    left_mm: int, right_mm: int, met: bool
) -> None:
    assert idle_turn(at(0), seen(S, left_mm, right_mm), deg=90.0).met is met
    beside = Ranges(t=S, mm=(100, FREE, FREE, FREE, FREE, FREE, FREE, 100))  # straight to the sides: passed already
    assert not idle_turn(at(0), beside, deg=90.0).met
    assert not idle_turn(at(0), Ranges(t=S, mm=(FREE, NEAR, NEAR)), deg=90.0).met  # a ring without a right side


@pytest.mark.parametrize("kind", ["turns_away", "steers_away"])
def test_sides_are_sonar_that_may_be_named(kind: str) -> None:
    within = {"within_s": 0.5} if kind == "steers_away" else {}
    wheels = {"left": 0.1, "right": 0.3} if kind == "steers_away" else {"left": -0.12, "right": 0.12}
    poses = [at(2 * S + step * 50 * MS, **wheels) for step in range(20)]
    run = [at(0), seen(S, side_mm=300), *poses]
    assert outcome(kind, run, near_m=0.5, free_m=0.8, **within).met
    # `outcome` takes an underscore from the end of a name
    assert not outcome(kind, run, near_m=0.5, free_m=0.8, left_=[1, 99], right_=[5, 6], **within).met


@pytest.mark.parametrize("values", [{"left": ["1"]}, {"right": [0]}, {"left": [True]}, {"free_m": 0.4}])
def test_sides_that_are_none_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ScenarioError, match=r"must be a list of the numbers of sonar|free_m is below near_m"):
        load_goal({"kind": "turns_away", "near_m": 0.5, "free_m": 0.8, **values}, "mine.toml: [[goal]] 1")


def test_nothing_is_missed_before_a_range_is_known() -> None:
    assert turns_away(turn(0, left=True)).met
    spins = [at(t * S, left=-0.1, right=0.1) for t in range(5)]
    assert outcome("no_idle_turn", spins, free_m=0.8, within_s=0.5).robustness == 1


@pytest.mark.parametrize(("y_m", "met"), [(0.099, True), (0.1, True), (0.101, False)])
def test_goal_backs_on_path_measures_how_far_off_its_way_it_goes_back(y_m: float, met: bool) -> None:
    run = [at(t * 100 * MS, 0.02 * t) for t in range(50)]
    run += [at(6 * S, 0.5, y_m, left=-0.1, right=-0.1), at(7 * S, 0.2, left=-0.1, right=-0.1)]
    found = outcome("backs_on_path", run, off_m=0.1)
    assert (found.met, found.robustness) == (met, pytest.approx(1 - y_m / 0.1))
    assert met or found.says == (
        "it went back 0.10 m off the way that it had come at 6.000 s, x 0.50 m, y 0.10 m, 0.1 m are allowed"
    )


def test_goal_backs_on_path_does_not_take_a_way_back_for_one_that_it_has_come() -> None:
    back = [at(S + t * 100 * MS, -0.02 * t, left=-0.2, right=-0.2) for t in range(20)]
    assert outcome("backs_on_path", [at(0), *back], off_m=0.3).robustness == pytest.approx(1 - 0.38 / 0.3)
