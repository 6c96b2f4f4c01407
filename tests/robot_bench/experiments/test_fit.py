"""A robot's parameters out of drives: planted errors come back within intervals, and what is not seen is named."""

import dataclasses
import json
import math
import random
from pathlib import Path

import numpy as np
import pytest

from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory
from robot_bench.drives.of_packets import drive_of_capture
from robot_bench.experiments.drive_files import read_drive
from robot_bench.experiments.fitting.clocks import on_one_clock, without_delays
from robot_bench.experiments.fitting.examples import (
    ExampleDrive,
    empty_world,
    planted,
    record,
    square,
    wandering,
    write,
)
from robot_bench.experiments.fitting.least_squares import Parameter, Rounding, fit
from robot_bench.experiments.fitting.ramps import fit_ramps, ramped
from robot_bench.experiments.fitting.rounding import grain_of, noise_before
from robot_bench.experiments.fitting.sonar import fit_sonar
from robot_bench.experiments.fitting.umbmark import by_formulas, umbmark
from robot_bench.experiments.fitting.wheels import fit_wheels
from simbase.errors import FileError
from tests.robot_bench.experiments.synthetic_robots import WALLS, Planted, drive

P2DX = load_parameters("p2dx")


@pytest.mark.parametrize("seed", [1000])
def test_poses_on_other_clocks_give_the_same_wheels_and_sonar_and_no_delays(seed: int) -> None:
    source = random.Random(seed)
    robot = Planted.drawn(source)
    driven = [drive(P2DX, robot, source, 40.0) for _ in range(2)]
    for one, shift_s in zip(driven, (-1000.0, 37.0), strict=True):
        one.truth = one.truth.later(shift_s)
    found, why = on_one_clock(driven)
    assert "by 1000.0" in why
    assert "by -3" in why
    for fitted, lost in ((fit_wheels(found), "packet_delay_s"), (fit_sonar(found, WALLS), "sonar_delay_s")):
        seen_now = without_delays(fitted, why)
        assert seen_now.unseen == {lost: why}
        assert len(seen_now.estimates) == len(fitted.estimates) - 1
        for name, one in seen_now.estimates.items():
            assert abs(one.value - robot.truth(name)) < 3 * one.half_width, name


@pytest.mark.parametrize(("late_s", "is_moved"), [(-0.15, True), (-0.05, False), (0.45, False), (0.55, True)])
def test_a_shift_that_packets_can_have_is_a_delay_and_no_other_clock(late_s: float, is_moved: bool) -> None:
    source = random.Random(3)
    robot = Planted.drawn(source)
    driven = drive(P2DX, robot, source, 20.0)
    driven.truth = driven.truth.later(robot.packet_delay_s - late_s)
    (found,), why = on_one_clock([driven])
    assert bool(why) is is_moved
    assert (found.truth is not driven.truth) is is_moved
    assert fit_wheels([driven]).estimates["packet_delay_s"].value == pytest.approx(late_s, abs=0.01)


def test_a_drive_without_turns_shows_no_track_and_no_turning_ramps() -> None:
    source = random.Random(5)
    robot = Planted.drawn(source)
    straight = drive(
        P2DX, dataclasses.replace(robot, left_wheel=1.01, right_wheel=1.01), source, 30.0, 0.0, turns=False
    )
    wheels, ramps = fit_wheels([straight]), fit_ramps([straight])
    assert "track_mm" in wheels.unseen
    assert {"rot_accel_deg_s2", "rot_decel_deg_s2", "turn_gain"} <= ramps.unseen.keys()
    assert "track_mm" not in wheels.estimates
    for found, name in ((wheels, "left_wheel"), (ramps, "accel_mm_s2")):
        expected = 1.01 if name == "left_wheel" else robot.accel_mm_s2
        assert abs(found.estimates[name].value - expected) < 3 * found.estimates[name].half_width


def test_parameters_that_only_their_sum_shows_are_both_named() -> None:
    x = np.linspace(0, 1, 50)
    noise = np.random.default_rng(1).normal(0, 0.01, 50)
    two = [Parameter(name=name, start=0.0, scale=1.0, least=-9, most=9) for name in ("a", "b")]
    alone = Parameter(name="c", start=0.0, scale=1.0, least=-9, most=9)
    found = fit(
        lambda v: (v[0] + v[1]) * x + v[2] - 3 * x - 1 + noise, [*two, alone], np.arange(50), floor=1e-6, why="more"
    )
    assert found.unseen.keys() == {"a", "b"}
    assert "of a and b" in found.unseen["a"]


@pytest.mark.parametrize("lags", [0, 3])
def test_an_interval_of_a_line_is_that_of_the_textbook(lags: int) -> None:
    random_ = np.random.default_rng(2)
    x = np.linspace(-1, 1, 400)
    y = 2 * x + random_.normal(0, 0.1, 400)
    found = fit(
        lambda v: v[0] * x - y, [Parameter(name="a", start=0.0, scale=1.0, least=-9, most=9)], np.arange(400),
        floor=1e-6, why="", lags=lags,
    )  # fmt: skip
    # sigma / sqrt(sum of x²), with 133.7 = sum of x², and Student's 1.966 for 399.
    assert found.estimates["a"].half_width == pytest.approx(1.966 * 0.1 / math.sqrt(133.7), rel=0.2)
    assert found.estimates["a"].low < 2 < found.estimates["a"].high


def test_neighbours_that_err_alike_make_an_interval_wider() -> None:
    random_ = np.random.default_rng(3)
    x = np.linspace(0, 1, 400)
    alike = np.repeat(random_.normal(0, 0.1, 100), 4)
    widths = []
    for noise in (alike, random_.permutation(alike)):
        y = 2 * x + noise
        found = fit(
            lambda v, y=y: v[0] * x - y, [Parameter(name="a", start=0.0, scale=1.0, least=-9, most=9)], np.arange(400),
            floor=1e-6, why="", lags=3,
        )  # fmt: skip
        widths.append(found.estimates["a"].half_width)
    # Four in a row that err alike are one: twice as wide; Bartlett's weights see 1 + 2 (0.75 · 0.75 + 0.5 · 0.5 +
    # 0.25 · 0.25) = 2.75 of the 4.
    assert widths[0] / widths[1] == pytest.approx(2.75**0.5, rel=0.25)


def test_clusters_are_independent_of_each_other_and_as_one_within() -> None:
    random_ = np.random.default_rng(3)
    x = np.linspace(0, 1, 400)
    widths = []
    for clusters in (np.arange(400), np.repeat(np.arange(100), 4)):
        y = 2 * x + np.repeat(random_.normal(0, 0.1, 100), 4)
        found = fit(
            lambda v, y=y: v[0] * x - y, [Parameter(name="a", start=0.0, scale=1.0, least=-9, most=9)], clusters,
            floor=1e-6, why="",
        )  # fmt: skip
        widths.append(found.estimates["a"].half_width)
    # Four in a row that err alike are one: twice as wide.
    assert widths[1] / widths[0] == pytest.approx(2, rel=0.25)


def test_an_interval_of_two_clusters_among_many_is_that_of_two() -> None:
    random_ = np.random.default_rng(5)
    clusters = np.arange(400) // 10
    tells = (clusters < 2).astype(float)  # of b; all tell of a
    y = 1.0 + random_.normal(0, 0.1, 400)
    found = fit(
        lambda v: v[0] + v[1] * tells - y,
        [Parameter(name=name, start=0.0, scale=1.0, least=-9, most=9) for name in "ab"], clusters, floor=1e-6, why="",
    )  # fmt: skip
    # Twenty readings of 0.1 have a mean of 0.022; of two clusters Student's quantile is 12.7 for one degree.
    assert 0.1 < found.estimates["b"].half_width < 0.6
    assert found.estimates["a"].half_width < 0.02


@pytest.mark.parametrize(("level", "error"), [(0.0, 0.0), (0.4, 0.4), (-0.3, -0.3)])
def test_readings_that_round_alike_for_ever_are_off_by_that_part_of_a_grain(level: float, error: float) -> None:
    def redrawn(values, _random):
        exact = np.full(200, values[0])
        return exact - np.round(exact)

    reported = np.round(np.full(200, 100.0 + level))
    for rounding in (None, Rounding(redrawn=redrawn, groups=[("a",)])):
        found = fit(
            lambda v: v[0] - reported, [Parameter(name="a", start=90.0, scale=10.0, least=0, most=200)],
            np.arange(200) // 5, floor=1e-3, why="", rounding=rounding,
        ).estimates["a"]  # fmt: skip
        assert found.value == pytest.approx(100.0 + level - error)
        # 1.96 deviations of what is evenly spread over a grain.
        assert found.half_width == pytest.approx(1.96 / 12**0.5 if rounding else 0.0, rel=0.2, abs=1e-6)


@pytest.mark.parametrize("deviation", [0.0, 0.15, 0.3, 0.6, 2.0])
def test_noise_before_the_rounding_is_known_by_how_held_values_scatter(deviation: float) -> None:
    random_ = np.random.default_rng(7)
    levels = random_.uniform(0, 50, (400, 1))
    reported = 2.0 * np.round(levels + random_.normal(0, deviation, (400, 60)))
    assert grain_of(reported.ravel()) == pytest.approx(2.0)
    variance = float(np.mean(np.var(reported, axis=1, ddof=1)))
    assert noise_before(variance, 2.0) == pytest.approx(2 * deviation, rel=0.1, abs=0.02)


@pytest.mark.parametrize(("grain", "counts"), [(1e-3, [300, -150, 97]), (0.0268, [0, 40, 41, -3000]), (5.0, [0, 1])])
def test_the_grain_is_of_what_all_readings_are_multiples(grain: float, counts: list[int]) -> None:
    assert grain_of(np.array(counts) * grain) == pytest.approx(grain)


def test_what_is_not_rounded_has_no_grain() -> None:
    assert grain_of(np.zeros(3)) == 0.0
    assert grain_of(np.random.default_rng(1).normal(0, 1, 50)) == 0.0
    assert noise_before(4.0, 0.0) == 2.0


@pytest.mark.parametrize("count", [2, 3])
def test_as_many_pieces_as_parameters_are_too_few(count: int) -> None:
    parameters = [Parameter(name=name, start=0.0, scale=1.0, least=-9, most=9) for name in "ab"]
    x = np.arange(float(count))

    def found() -> object:
        return fit(lambda v: v[0] * x + v[1] - x, parameters, np.arange(count), floor=1e-6, why="")

    if count == 2:
        with pytest.raises(FileError, match="2 pieces"):
            found()
    else:
        found()


@pytest.mark.parametrize(
    ("at_s", "speed"), [(1.0, 0.0), (1.5, 100.0), (2.0, 200.0), (3.0, 200.0), (3.25, 125.0), (3.666667, 0.0),
                        (4.166667, -100.0), (9.0, -200.0)]
)  # fmt: skip
def test_a_ramp_goes_through_0_at_its_deceleration_and_on_at_its_acceleration(at_s: float, speed: float) -> None:
    commands = Steps(np.array([1.0, 3.0]), np.array([200.0, -200.0]))
    assert ramped(commands, np.array([0.0, at_s]), 200.0, 300.0)[1] == pytest.approx(speed, abs=1e-3)


@pytest.mark.parametrize(
    ("at_s", "speed"), [(3.25, 125.0), (3.666667, 0.0), (3.866667, 0.0), (4.366667, -100.0), (9.0, -200.0)]
)
def test_an_axis_stands_before_it_goes_the_other_way(at_s: float, speed: float) -> None:
    commands = Steps(np.array([1.0, 3.0]), np.array([200.0, -200.0]))
    assert ramped(commands, np.array([at_s]), 200.0, 300.0, 0.2)[0] == pytest.approx(speed, abs=1e-3)


@pytest.mark.parametrize(("turned_s", "speed"), [(3.7, 0.0), (3.8, 100 * 0.2), (4.0, 100 * 0.6)])
def test_a_command_while_it_stands_is_obeyed_at_once(turned_s: float, speed: float) -> None:
    commands = Steps(np.array([1.0, 3.0, 3.7]), np.array([200.0, -200.0, 200.0]))
    found = ramped(commands, np.array([3.69, turned_s]), 200.0, 300.0, 0.2)
    assert found.tolist() == pytest.approx([0.0, speed], abs=1e-3)


def test_the_formulas_give_back_small_errors_of_their_own_derivation() -> None:
    side, track, alpha, beta = 4.0, 0.34, 0.01, 0.004
    centres = tuple(
        np.array([-2 * side * (alpha + sign * beta), sign * -2 * side * (alpha + sign * beta)]) for sign in (1, -1)
    )
    e_d, e_b = by_formulas((centres[0], centres[1]), side, track)
    assert e_b == pytest.approx(90 / (90 - math.degrees(alpha)))
    radius = side / 2 / math.sin(beta / 2)
    assert e_d == pytest.approx((radius + track / 2) / (radius - track / 2))
    alike = np.array([0.1, 0.2]), np.array([0.1, -0.2])  # both ways round the same: wheels of one size
    assert by_formulas(alike, side, track) == (1.0, pytest.approx(90 / (90 + math.degrees(0.3 / (4 * side)))))


def squares(seed: int, runs: int, *, noise: bool) -> list[Drive]:
    robot = planted(seed, noise=noise)
    found = []
    for clockwise in (True, False):
        for number in range(runs):
            recorded = record(robot, empty_world(), square(clockwise=clockwise), seed=number, camera=noise)
            found.append(drive_of(recorded))
    return found


def drive_of(recorded: ExampleDrive) -> Drive:
    found = drive_of_capture("a square", recorded.capture, P2DX)
    found.truth = Trajectory.of_rows(list(recorded.poses))
    return found


@pytest.fixture(scope="module")
def two_squares() -> list[Drive]:
    return squares(1, 1, noise=False)


def test_without_noise_the_largest_return_error_falls_ten_times(two_squares: list[Drive]) -> None:
    found = umbmark(two_squares)
    assert found.before.largest_m > 0.05
    # Formulas of the first order, where the largest error is a quarter of the square's side.
    assert found.formulas.largest_m < found.before.largest_m / 5
    assert found.least_squares.largest_m < found.before.largest_m / 10


@pytest.mark.soak
def test_the_return_errors_of_robots_fall_ten_times_without_noise_and_their_centres_five_times_with_it() -> None:
    for seed in range(2, 5):
        found = umbmark(squares(seed, 1, noise=False))
        assert found.before.largest_m > 0.05
        assert found.least_squares.largest_m < found.before.largest_m / 10, seed
    with_noise = umbmark(squares(1, 2, noise=True))
    assert with_noise.least_squares.e_max_m < with_noise.before.e_max_m / 5


def test_squares_of_one_way_round_and_what_is_no_square_are_refused(two_squares: list[Drive]) -> None:
    with pytest.raises(FileError, match="one way round"):
        umbmark(two_squares[:1])
    line = drive(P2DX, Planted.drawn(random.Random(1)), random.Random(1), 8.0, turns=False)
    with pytest.raises(FileError, match="a square by 270 or 360"):
        umbmark([*two_squares, line])


def test_an_example_gives_back_what_was_planted_in_files_that_are_taken(p2os, capsys) -> None:
    robot = planted(4)
    write(record(robot, load_world("room"), wandering(1, 30.0), seed=1), Path("d0.jsonl"))
    assert p2os("fit", "d0.jsonl", "--world", "room", "--out", "mine") == 0
    out = capsys.readouterr().out
    assert all(len(line) <= 80 for line in out.splitlines())
    fitted, errors = load_parameters("mine.toml"), load_sensor_errors("mine-errors.toml")
    assert fitted.track_mm == pytest.approx(robot.parameters.track_mm, abs=1)
    assert fitted.motion.accel_mm_s2 == pytest.approx(robot.parameters.motion.accel_mm_s2, abs=3)
    assert fitted.sonar_cone_deg == pytest.approx(robot.parameters.sonar_cone_deg, abs=0.5)
    assert errors.odometry.left_wheel == pytest.approx(robot.errors.odometry.left_wheel, abs=0.004)
    assert errors.odometry.track == pytest.approx(robot.errors.odometry.track, abs=0.004)
    assert errors.sonar.noise_m == pytest.approx(0.008, abs=0.004)
    assert p2os("fit", "d0.jsonl", "--json") == 0
    assert "--world" not in json.loads(capsys.readouterr().out)["sonar"]["not_fitted"]


def test_a_run_folder_is_fitted_without_any_other_file(runs: Path) -> None:
    found = fit_wheels([read_drive(runs / "near")])
    assert found.estimates["left_wheel"].low < 1.0 < found.estimates["left_wheel"].high


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "which drives?"),
        (["missing.jsonl"], "there is no missing.jsonl"),
        (["w.jsonl", "--world", "roof"], "roof"),
        (["w.jsonl", "--truth", "a", "--truth", "b"], "2 --truth for 1 drives"),
        (["w.jsonl", "--robot", "p9"], "no robot model"),
        (["--example", "full"], "holds something already"),
        (["--umbmark", "w.jsonl"], "no measured poses"),
    ],
)
def test_what_cannot_be_fitted_is_reported_in_one_line(words: list[str], says: str, runs: Path, p2os, capsys) -> None:
    Path("w.jsonl").write_bytes((runs / "near" / "wire.jsonl").read_bytes())
    Path("full").mkdir()
    Path("full/a").write_text("a", encoding="utf-8")
    assert p2os("fit", *words) == 2
    errors = capsys.readouterr().err
    assert says in errors
    assert "Traceback" not in errors
