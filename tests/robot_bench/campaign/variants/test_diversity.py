"""Which failures are one, and how far others lie apart: on sets made by hand, and on runs."""

from dataclasses import replace
from itertools import combinations, product

import pytest

from robot_bench.campaign.trial import GoalResult, HullContact, Outcome, Trial, TrialVerdict, run_trial, trial_of
from robot_bench.campaign.variants.diversity import (
    CELLS,
    SAME_PATH,
    _scene,
    clusters,
    distance,
    diversity,
    mean_distance,
    way_cells,
)
from tests.robot_bench.firmware.hurried import hurried

EXTENT = (-4.0, -4.0, 4.0, 4.0)
SETS = [frozenset(some) for size in range(5) for some in combinations(range(4), size)]


def failed(part: str = "front left", blocks: int = 100, way: tuple[tuple[int, int], ...] = ()) -> Outcome:
    goal = GoalResult(kind="no_collision", wanted="touches nothing", met=False, says="", robustness=None, unit="")
    hit = HullContact(t=1, what="'crate'", part=part, x_m=0.0, y_m=0.0)
    return Outcome(
        verdict=TrialVerdict.FAILED,
        failures=("x",),
        goals=(goal,),
        hits=(hit,),
        blocks=frozenset(range(blocks)),
        way_mm=way,
    )


def with_posts(*places: tuple[float, float]) -> Trial:
    trial = trial_of("dodge", settings=[("body", "kinematic")])
    return trial.with_lists(obstacle=[
        {"name": f"post {n}", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "x_m": x, "y_m": y, "at_s": 0.0}
        for n, (x, y) in enumerate(places)
    ])  # fmt: skip


def test_equal_sets_have_no_distance_and_sets_without_anything_in_common_have_1() -> None:
    assert mean_distance([{1, 2}, {1, 2}, {1, 2}]) == 0.0
    assert mean_distance([{1}, {2}, {3}]) == 1.0
    assert mean_distance([set(), set()]) == 0.0
    assert mean_distance([{1, 2}, {2, 3}]) == pytest.approx(2 / 3)
    assert mean_distance([{1}]) is None
    assert mean_distance([{1}, {1}, {2}]) == pytest.approx(2 / 3)


def test_the_distance_is_a_metric_and_no_order_changes_the_mean() -> None:
    """Of all sets of four things: what each has that the other has not, and what both have, is any of them."""
    apart = {(a, b): distance(a, b) for a, b in product(SETS, repeat=2)}
    for (a, b), how_far in apart.items():
        assert how_far == apart[b, a]
        assert (how_far == 0) is (a == b)
    for a, b, c in product(SETS, repeat=3):
        assert apart[a, c] <= apart[a, b] + apart[b, c] + 1e-12
    mean = mean_distance(SETS)
    assert mean is not None
    assert mean == pytest.approx(mean_distance(SETS[::-1]))
    assert mean == pytest.approx(sum(apart.values()) / (len(apart) - len(SETS)), abs=1e-9)


def test_the_same_world_twice_has_no_diversity_and_posts_elsewhere_have_all_of_it() -> None:
    one, other = with_posts((1.0, 0.0)), with_posts((-1.0, 0.5))
    same = diversity([one, one], [failed(), failed()])
    assert (same.obstacles, same.ways) == (0.0, 0.0)
    assert diversity([one, other], [failed(), failed()]).obstacles == 1.0, "walls that all have do not count"
    half = diversity([with_posts((1.0, 0.0), (0.0, 1.0)), one], [failed(), failed()]).obstacles
    assert half == 1.0, "what both have is left out, and one post remains"
    third = diversity([one, other, one], [failed()] * 3).obstacles
    assert third == pytest.approx(2 / 3)


def test_a_post_moved_within_its_cells_is_the_same_and_one_moved_out_is_not() -> None:
    assert _scene(with_posts((1.0, 0.1)))[1] == _scene(with_posts((1.001, 0.1)))[1]
    assert _scene(with_posts((1.0, 0.1)))[1] != _scene(with_posts((1.4, 0.1)))[1]


def test_a_thing_before_a_sensor_is_the_same_thing_wherever_the_robot_is() -> None:
    posts = [{"name": "post", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "at_s": 0.0, "distance_m": 0.5}]
    trials = [with_posts().with_lists(obstacle=[{**posts[0], "before_sonar": n}]) for n in (3, 3, 4)]
    cells = [_scene(trial)[1] for trial in trials]
    assert cells[0] == cells[1] != cells[2]


def test_a_way_is_the_cells_between_its_places_too_and_stays_within_the_extent() -> None:
    across = way_cells(failed(way=((-4000, 0), (4000, 0))), EXTENT)
    assert across == {(column, CELLS // 2) for column in range(CELLS)}
    assert way_cells(failed(way=((9000, 9000), (9000, 9000))), EXTENT) == {(CELLS - 1, CELLS - 1)}
    assert way_cells(failed(), EXTENT) == frozenset()


def test_failures_of_one_path_and_one_side_are_one_and_no_others() -> None:
    within, beyond = failed(blocks=int(100 * (1 - SAME_PATH))), failed(blocks=int(100 * (1 - SAME_PATH)) - 1)
    rows = [failed(), failed("rear"), failed("front right"), within, beyond, failed("rear left")]
    assert clusters(rows) == [[0, 2, 3], [1, 5], [4]]
    died = replace(failed(), died="firmware fault: BusFault at 0x08000100")
    elsewhere = replace(failed(), died="firmware fault: BusFault at 0x08000200")
    assert clusters([failed(), died, elsewhere]) == [[0], [1, 2]]
    assert clusters([]) == []


def test_two_starts_a_centimetre_apart_fail_by_one_path() -> None:
    blind = [("mode", "direct"), ("body", "kinematic"), ("threshold_m", 0.05), ("duration_s", 4.5)]
    trial = trial_of("dodge", settings=blind, firmware=hurried("dodge"))
    starts = [(2.2, 0.0), (2.21, 0.0)]
    found = [run_trial(trial.set(("start", {"x_m": x, "y_m": y, "heading_deg": 0.0}))) for x, y in starts]
    assert all(one.verdict is TrialVerdict.FAILED for one in found)
    assert clusters(found) == [[0, 1]]
