"""Until when a failure could still be avoided, found by runs that go on from saved states."""

import pytest

from p2os.errors import ScenarioError
from robot_bench.campaign.last_moment import SAVED_EACH_NS, STEP_NS, last_moment
from robot_bench.campaign.trial import Trial, run_trial, trial_of
from simbase.timing import NS_PER_S
from tests.robot_bench.firmware.hurried import hurried

#: `dodge` in a hurry, with sensors that see a hand's breadth, drives straight ahead at once, whatever stands there.
WALL = {
    "at_s": 0.0, "name": "wall", "shape": "box", "x_m": 0.7, "y_m": 0.0, "length_m": 0.1, "width_m": 2.0,
    "height_m": 0.5,
}  # fmt: skip
GOALS = [
    {"kind": "no_collision", "ends_run": "missed"},
    {"kind": "moves_on", "way_m": 0.05, "within_s": 4.0, "ends_run": "missed"},  # who stands misses it
]


@pytest.fixture(scope="module")
def trial() -> Trial:
    blind = [("body", "kinematic"), ("mode", "direct"), ("duration_s", 5), ("world", "arena"), ("threshold_m", 0.05)]
    base = trial_of("dodge", settings=blind, firmware=hurried("dodge"))
    return base.with_lists(obstacle=[WALL], goal=GOALS)


def stopped_at(trial: Trial, at_ns: int) -> Trial:
    """Return the trial with all wires of the motors held low from up to two poses after a time."""
    wires = [f"motor{motor}_comm{bit}" for motor in (1, 2) for bit in (1, 2, 3)]
    rows = [
        {"event": f"time {at_ns / NS_PER_S}", "do": "set_pin", "pin": wire, "level": "low", "after_s": 0.0}
        for wire in wires
    ]
    return trial.with_lists(when=rows)


@pytest.mark.slow
def test_the_last_moment_is_the_latest_at_which_standing_still_avoids_the_contact(trial: Trial) -> None:
    failed = run_trial(trial)
    assert [hit.what for hit in failed.hits[:1]] == ["'wall'"]
    found = last_moment(trial)
    assert found is not None
    assert found.avoidable_ns is not None
    assert 0 <= found.failed_ns - failed.hits[0].t <= STEP_NS
    assert found.avoidable_ns < failed.hits[0].t
    assert not run_trial(stopped_at(trial, found.avoidable_ns - 2 * STEP_NS)).failing_goals
    assert run_trial(stopped_at(trial, found.avoidable_ns + 2 * STEP_NS)).failing_goals
    assert found.words.startswith("missed at ")


def test_a_goal_that_asks_for_motion_is_avoided_by_no_stop(trial: Trial) -> None:
    stays = trial.with_lists(goal=[{"kind": "moves_on", "way_m": 5.0, "within_s": 3.0}])
    found = last_moment(stays)
    assert found is not None
    assert found.avoidable_ns is None
    assert found.words.endswith("stopping the motors never avoids it")


def test_a_run_that_does_not_fail_has_none(trial: Trial) -> None:
    assert last_moment(trial.with_lists(obstacle=[], goal=[]).set(("duration_s", 2))) is None
    assert SAVED_EACH_NS % STEP_NS == 0


def test_several_robots_are_refused() -> None:
    with pytest.raises(ScenarioError, match="alone in its world"):
        last_moment(trial_of("two-dodge", settings=[("duration_s", 1)]))
