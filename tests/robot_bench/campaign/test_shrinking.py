"""Failing trials made small: by an oracle that knows the answer, and by real runs of a firmware that is blind."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_bench.campaign.trial import Trial, run_trial, trial_of
from robot_bench.campaign.variants.shrinking.failure import Failure, FailureMode, failure_of
from robot_bench.campaign.variants.shrinking.reduction import ANGLE_STEPS, STEPS, fewest, rounded, rounder
from robot_bench.campaign.variants.shrinking.shrink import Judge, NoFailureError, shrink
from robot_bench.campaign.variants.shrinking.things import (
    numbers,
    things,
    with_numbers,
    with_things,
    with_world,
    world_table,
)
from simbase.timing import NS_PER_S, Nanos
from tests.robot_bench.firmware.hurried import hurried

#: chosen: what no trial of these tests needs more of.
ENOUGH = 300


def planted() -> tuple[Trial, list[Trial]]:
    """Return a trial with twelve posts, and where its judge will note what it is asked."""
    posts: list[dict[str, object]] = [
        {"name": f"post {n}", "at_s": 1.25 + n, "shape": "cylinder", "radius_m": 0.1037, "height_m": 0.5,
         "x_m": 1.0 + n * 0.3717, "y_m": -0.213 * n} for n in range(12)
    ]  # fmt: skip
    trial = trial_of("dodge", settings=[("mode", "direct"), ("body", "kinematic"), ("world", "room")])
    return trial.with_lists(obstacle=posts), []


def judged_by(needed: set[str], asked: list[Trial]) -> Judge:
    """Return a judge to whom a trial fails that has all of some obstacles, each right of x = 0.9 m."""

    def judge(trial: Trial, way: FailureMode | None, _until_ns: Nanos | None) -> Failure | None:
        asked.append(trial)
        posts = {str(post["name"]): post for post in trial.table.get("obstacle", [])}  # type: ignore[attr-defined]
        if not needed <= posts.keys() or any(posts[name]["x_m"] < 0.9 for name in needed):
            return None
        found = FailureMode(what="touches nothing", part="front")
        if way is not None and way != found:
            return None
        return Failure(way=found, at_ns=5 * NS_PER_S + 1, is_early=True, says="", blocks=frozenset())

    return judge


def test_of_twelve_obstacles_the_two_that_it_needs_are_left_and_nothing_of_the_world() -> None:
    trial, asked = planted()
    small = shrink(trial, judge=judged_by({"post 3", "post 9"}, asked), budget=ENOUGH)
    assert [post["name"] for post in small.trial.table["obstacle"]] == ["post 3", "post 9"]  # type: ignore[attr-defined]
    assert (small.things_before, small.things_after, small.is_complete) == (12 + 9, 2, True)
    world = world_table(small.trial)
    assert world is not None
    assert not {"wall", "box"} & world.keys()
    assert small.trials <= len(asked) <= small.trials + 1


def test_its_numbers_are_round_its_run_short_and_its_goals_one() -> None:
    trial, asked = planted()
    small = shrink(trial, judge=judged_by({"post 3"}, asked), budget=ENOUGH)
    (post,) = small.trial.table["obstacle"]  # type: ignore[misc]
    assert post == {
        "name": "post 3", "at_s": 4.0, "shape": "cylinder", "radius_m": 0.0, "height_m": 1.0, "x_m": 2.0, "y_m": -1.0,
    }  # fmt: skip
    assert small.trial.table["duration_s"] == 6.0, "the failure is at 5 s and a nanosecond"
    assert len(small.trial.table["goal"]) == 1


def test_no_question_is_asked_twice_and_the_answer_is_the_same_each_time() -> None:
    trial, asked = planted()
    one = shrink(trial, judge=judged_by({"post 0", "post 11"}, asked), budget=ENOUGH)
    assert len({each.sha256 for each in asked[1:]}) == len(asked) - 1
    again = shrink(trial, judge=judged_by({"post 0", "post 11"}, []), budget=ENOUGH)
    assert one == again


@pytest.mark.parametrize("budget", [0, 1, 5, 20])
def test_a_budget_is_kept_and_what_is_left_fails_still(budget: int) -> None:
    trial, asked = planted()
    judge = judged_by({"post 3", "post 9"}, asked)
    small = shrink(trial, judge=judge, budget=budget)
    assert len(asked) <= budget + 1
    assert not small.is_complete
    assert judge(small.trial, small.failure.way, None) is not None


def test_a_trial_that_passes_is_refused() -> None:
    trial, asked = planted()
    with pytest.raises(NoFailureError, match="does not fail"):
        shrink(trial, judge=judged_by({"post 12"}, asked))


def test_where_the_quick_run_misleads_all_is_done_as_it_was_meant() -> None:
    """At the cheap fidelity one post suffices; as it was meant the trial needs two."""
    trial, asked = planted()

    def judge(candidate: Trial, way: FailureMode | None, until_ns: Nanos | None) -> Failure | None:
        needed = {"post 3"} if candidate.table["body"] == "kinematic" else {"post 3", "post 9"}
        return judged_by(needed, asked)(candidate, way, until_ns)

    meant = trial.set(("body", "bullet"))
    small = shrink(meant, judge=judge, quick=[("body", "kinematic")], budget=ENOUGH)
    assert [post["name"] for post in small.trial.table["obstacle"]] == ["post 3", "post 9"]  # type: ignore[attr-defined]
    assert small.trial.table["body"] == "bullet"
    same = shrink(meant, judge=judged_by({"post 3"}, asked), quick=[("body", "kinematic")], budget=ENOUGH)
    assert (same.things_after, same.trial.table["body"]) == (1, "bullet")


@given(st.sets(st.integers(0, 40), max_size=6), st.integers(0, 41))
def test_the_fewest_items_are_those_that_are_needed(needed: set[int], count: int) -> None:
    if max(needed, default=-1) >= count:
        return
    assert fewest(range(count), lambda some: needed <= set(some)) == sorted(needed)


@given(st.lists(st.sets(st.integers(0, 9)), min_size=1, max_size=5))
def test_nothing_that_is_left_can_be_left_out_by_itself(wanted: list[set[int]]) -> None:
    def holds(some: Sequence[int]) -> bool:
        return any(each <= set(some) for each in wanted)

    left = fewest(range(10), holds)
    assert holds(left)
    assert not any(holds([other for other in left if other != item]) for item in left)


@given(st.floats(-1e4, 1e4), st.sampled_from([STEPS, ANGLE_STEPS]))
def test_rounder_numbers_are_near_and_each_rounder_than_the_next(value: float, steps: Sequence[float]) -> None:
    found = list(rounder(value, steps))
    assert len(set(found)) == len(found)
    assert value not in found
    assert all(abs(near - value) <= steps[0] / 2 + 1e-9 for near in found)


@pytest.mark.parametrize(
    ("value", "step", "wanted"),
    [(0.5, 1.0, 1.0), (0.49, 1.0, 0.5), (-0.5, 1.0, -1.0), (3.05, 1.0, 3.0), (0.0004, 1.0, 0.0004), (0.25, 0.1, 0.3)],
)
def test_a_number_is_rounded_half_away_from_nothing_and_never_to_nothing(
    value: float, step: float, wanted: float
) -> None:
    assert rounded(value, step) == wanted


def test_all_things_and_all_numbers_of_a_trial_put_back_are_the_trial() -> None:
    trial = with_world(planted()[0])
    again = with_things(trial, things(trial))
    assert world_table(again) == world_table(trial)
    assert again.table == trial.table
    same = with_numbers(trial, {number: number.value for number in numbers(trial)})
    assert (same.table, world_table(same)) == (trial.table, world_table(trial))


def test_a_shipped_world_put_among_the_files_gives_the_same_trace() -> None:
    settings = [("mode", "direct"), ("body", "kinematic"), ("duration_s", 1.0)]
    trial = trial_of("dodge", settings=settings, firmware=hurried("dodge")).with_lists(goal=TOUCHES)
    assert run_trial(with_world(trial)).sha256 == run_trial(trial).sha256
    for made in ("arena", "maze"):  # one that a program makes, and one that it once made
        elsewhere = with_world(trial.set(("world", made)))
        assert run_trial(elsewhere).sha256 == run_trial(trial.set(("world", made))).sha256
        assert things(elsewhere)


BLIND = (("mode", "direct"), ("body", "kinematic"), ("threshold_m", 0.05))
#: What a program in a hurry is judged by: dodge's own goals ask for its 3 s of standing, too.
TOUCHES = [{"kind": "no_collision"}]


@pytest.mark.slow
def test_a_robot_that_sees_nothing_needs_one_obstacle_of_nine_to_fail_the_same_way() -> None:
    near = {"x_m": 2.5, "y_m": 0.117, "heading_deg": 3.0}
    trial = trial_of("dodge", settings=[*BLIND, ("start", near)], firmware=hurried("dodge")).with_lists(goal=TOUCHES)
    small = shrink(trial)
    assert small.is_complete
    assert (small.things_before, small.things_after) == (9, 1)
    again = failure_of(small.trial)
    assert again is not None
    assert again == small.failure
    assert (again.way.what, again.way.part) == ("touches nothing", "front")


def test_a_failure_is_reported_with_its_time_and_part_and_one_of_another_way_is_not() -> None:
    settings = [*BLIND, ("start.x_m", 2.2), ("start.y_m", 0.0), ("duration_s", 6.0)]
    trial = trial_of("dodge", settings=settings, firmware=hurried("dodge")).with_lists(goal=TOUCHES)
    found = failure_of(trial)
    assert found is not None
    assert (found.way, found.is_early) == (FailureMode(what="touches nothing", part="front"), True)
    assert found.blocks
    assert failure_of(trial, replace(found.way, part="rear")) is None
    assert failure_of(trial, found.way, found.at_ns - NS_PER_S) is None
    assert failure_of(trial.set(("start.x_m", 99.0))) is None, "what cannot be run does not fail"


def test_what_was_left_out_is_not_asked_for_again_in_larger_pieces() -> None:
    asked: list[int] = []

    def holds(some: Sequence[int]) -> bool:
        asked.append(len(some))
        return {3, 9} <= set(some)

    assert fewest(range(12), holds) == [3, 9]
    assert len(asked) <= 29, "cutting anew in halves after each piece that was left out asks for more"


def test_a_failure_in_which_the_robot_could_do_nothing_is_of_another_way() -> None:
    near = {"x_m": 2.2, "y_m": 0.0, "heading_deg": 0.0}
    settings = [*BLIND, ("duration_s", 6.5), ("start", near)]
    trial = trial_of("dodge", settings=settings, firmware=hurried("dodge", 50)).with_lists(goal=TOUCHES)
    post = {"name": "post", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "before_sonar": 4}
    whole = failure_of(trial)
    at_rest = failure_of(trial.with_lists(obstacle=[{**post, "at_s": 0.3, "distance_m": 0.01}]))
    sudden = failure_of(trial.with_lists(obstacle=[{**post, "at_s": 1.5, "distance_m": 0.01}]))
    fair = failure_of(trial.with_lists(obstacle=[{**post, "at_s": 1.5, "distance_m": 0.35}]))
    assert [one is not None and one.way.is_sudden for one in (whole, at_rest, sudden, fair)] == [
        False, True, True, False,
    ]  # fmt: skip
