"""The intervals of `p2os fit` hold as often as they say, of robots of several makes, and are no wider than need be."""

import random

import numpy as np
import pytest

from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps
from robot_bench.experiments.fitting.ramps import fit_ramps
from robot_bench.experiments.fitting.sonar import fit_sonar
from tests.robot_bench.experiments.fit_coverage import LEAST, MOST, WIDEST, Parameter, coverage, main
from tests.robot_bench.experiments.synthetic_robots import MAKES, WALLS, Planted, drive, ramp

NAMES = 17
SAMPLE = 4


@pytest.mark.soak
def test_of_a_few_robots_the_intervals_hold_what_was_planted() -> None:
    """Of 4 robots: 95 % of 4 hold, fewer than 2 in one of 2000 times."""
    found = coverage("rounded", range(1000, 1000 + SAMPLE))
    assert len(found) == NAMES
    assert all(len(row.off) == SAMPLE for row in found)
    held = {row.name: round(row.covered * SAMPLE) for row in found}
    assert {name: count for name, count in held.items() if count < 2} == {}
    assert sum(held.values()) >= 0.85 * NAMES * SAMPLE
    # No interval is so narrow that it holds nothing, and none so wide that it says nothing.
    for row in found:
        assert min(row.half) > 0.05 * max(row.half), row.name
        assert row.width < 3, row.name


def to_and_fro(gain: float, noise_mm_s: np.ndarray) -> Drive:
    """Return a drive that goes at 300 mm/s and stands, ten times for two seconds each, with noise of each packet."""
    starts = [1.0 + 2 * number for number in range(20)]
    targets = [300.0, 0.0] * 10
    steps = np.arange(0, 41_000, 100)
    speeds = gain * ramp(targets, starts, 41_001, (331.0, 297.0), 0.0)[steps]
    reported = Steps(steps / 1000 + 0.04, np.round(speeds + noise_mm_s * (speeds > 0)) / 1000)
    return Drive(
        name="to and fro", parameters=load_parameters("p2dx"), reported_left_mps=reported, reported_right_mps=reported,
        commands={"VEL": Steps(np.array(starts), np.array(targets))},
    )  # fmt: skip


@pytest.mark.parametrize(
    "mm_s", [299.6, 300.2, *(pytest.param(mm_s, marks=pytest.mark.soak) for mm_s in (299.8, 300.0, 300.4))]
)
def test_a_speed_that_always_rounds_to_the_same_number_is_known_to_half_a_grain(mm_s: float) -> None:
    gain = mm_s / 300
    one = fit_ramps([to_and_fro(gain, np.zeros(410))]).estimates["speed_gain"]
    assert one.low < gain < one.high
    assert 0.4 / 300 < one.half_width < 0.9 / 300


def test_a_lag_that_lasts_as_long_as_a_manoeuvre_widens_intervals_and_one_of_each_packet_does_less() -> None:
    normal = np.random.default_rng(2).normal
    widths = [
        fit_ramps([to_and_fro(1.0, noise)]).estimates["speed_gain"].half_width
        for noise in (np.repeat(normal(0, 3, 41), 20)[10:420], normal(0, 3, 410))
    ]
    # Some fifteen packets of a manoeuvre that err alike are one.
    assert widths[0] > 1.8 * widths[1]


@pytest.mark.parametrize("make", ["rounded", "rays"])
def test_the_shape_of_a_ping_is_seen(make: str) -> None:
    source = random.Random(14)
    robot = Planted.drawn(source)
    found = fit_sonar([drive(load_parameters("p2dx"), robot, source, make=MAKES[make])], WALLS).estimates
    for name in ("cone_deg", "sonar_offset_m", "sonar_delay_s"):
        assert abs(found[name].value - robot.truth(name)) < 1.5 * found[name].half_width, name


def test_a_robot_that_stands_shows_no_age_of_its_readings() -> None:
    source = random.Random(12)
    driven = drive(load_parameters("p2dx"), Planted.drawn(source), source, 30.0, slip_deg=0.0)
    truth, odometry = driven.truth, driven.odometry
    assert truth is not None and odometry is not None  # noqa: PT018
    for column in (truth.x_m, truth.y_m, truth.heading_rad):
        column[:] = column[0]
    found = fit_sonar([driven], WALLS)
    assert "sonar_delay_s" in found.unseen
    assert "sonar_delay_s" not in found.estimates


@pytest.mark.soak
def test_of_200_robots_90_to_99_of_100_intervals_hold_and_are_as_wide_as_the_errors_ask() -> None:
    found = coverage("rounded", range(200))
    assert len(found) == NAMES
    assert [row.line() for row in found if not row.is_true] == []


@pytest.mark.soak
@pytest.mark.parametrize("make", MAKES)
def test_of_robots_that_are_made_otherwise_four_intervals_of_five_hold_at_least(make: str) -> None:
    found = coverage(make, range(1000, 1060))
    assert len(found) == NAMES
    assert [row.line() for row in found if row.covered < 0.8 or row.width > 2] == []


@pytest.mark.parametrize(
    ("inside", "half", "is_true"),
    [(89, 1.0, False), (90, 1.0, True), (99, 1.0, True), (100, 1.0, False), (95, 1.5, True), (95, 1.51, False)],
)
def test_a_row_of_the_table_says_whether_it_holds(inside: int, half: float, is_true: bool) -> None:
    # The 95 % error is 1: of 100 errors of 1 those inside have intervals of `half`, the others of less.
    row = Parameter("ramps", "accel_mm_s2", [1.0] * 100, [half] * inside + [0.99] * (100 - inside))
    assert row.is_true is is_true
    assert len(row.line()) <= 80
    assert row.line().endswith("<-") is not is_true
    assert (LEAST, MOST, WIDEST) == (0.90, 0.99, 1.5)


def test_the_table_is_printed_and_its_end_says_whether_all_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--robots", "1", "--make", "rays"]) == 1  # of one robot all or nothing holds
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "rays: 1 robots"
    assert len(lines) == NAMES + 2
    assert all(len(line) <= 80 for line in lines)
